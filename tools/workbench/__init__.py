"""Records on one page, which this machine serves to itself: measure, look, decide, calculate again, export."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
