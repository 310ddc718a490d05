"""Pages of results as blocks, rendered as text, HTML or notebook. The package knows no record and no instrument."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
