"""The physics: pure functions and kernels. Knows no FMI, no files and no options."""
