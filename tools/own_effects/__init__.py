"""Effects that stand in a file of the user's own: read, checked, and tried like the catalogue's."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
