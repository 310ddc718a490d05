"""Files checked before they are used: everything that is wrong at once, with lines."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
