"""An instrument's folder: its results by date and temperature, and the parameters that change."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
