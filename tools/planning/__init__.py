"""Which table positions to measure at, with what weights, and the proof that nothing better exists."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
