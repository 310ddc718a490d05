"""Effects from a user's own file: read, checked, and tried like those of the catalogue."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
