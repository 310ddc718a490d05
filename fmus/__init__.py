"""The components: each model with its interface, exported as an FMU."""
