"""Noise of gyros and accelerometers at rest: processes, coefficients, Allan deviation, and what follows from them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
