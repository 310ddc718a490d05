"""Views of a measurement at the table and of a run: a terminal, and pages that this machine serves to itself."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
