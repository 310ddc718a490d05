"""Views of what goes on: a measurement in the terminal, a run on a page, and the server of pages of this machine."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
