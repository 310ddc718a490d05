"""Find errors of the simulation: falsify the model, name the cause, extend the model, measure the gain."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
