"""System Structure and Parameterization 1.0: scenarios as .ssp for other tools, and those of other tools simulated."""
