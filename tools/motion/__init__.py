"""Gyros and accelerometers in motion: sampling, rests, calibration by gravity's norm, attitudes carried on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
