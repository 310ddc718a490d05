"""Evidence: the one form in which every kind of record meets a model, and the functions that make it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
