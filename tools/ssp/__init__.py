"""System Structure and Parameterization 1.0: export scenarios as .ssp, and simulate those of other tools."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
