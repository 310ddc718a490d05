"""A running measurement at the table: incoming readings, their rests, finished positions and the next one.

Readings come from a source, are kept at once, and are cut into visits; a session is a fold over visits and the
operator's words. This package does not depend on any display.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
