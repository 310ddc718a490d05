"""An instrument's folder: what was found of it, by date and temperature, and what is no constant."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
