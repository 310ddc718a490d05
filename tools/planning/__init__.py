"""Choose the table positions and weights of a measurement, with a proof that none are better."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
