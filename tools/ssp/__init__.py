"""System Structure and Parameterization 1.0: scenarios as .ssp for other tools, and those of other tools simulated."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
