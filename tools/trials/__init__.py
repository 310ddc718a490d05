"""Trials: hidden effects drawn, measured by simulation, diagnosed and judged, for every kind of record."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
