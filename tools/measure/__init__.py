"""A measurement at the table while it is made: what comes in, the rests in it, what is done and what is next.

Readings come from a source, are kept as they come, and are cut into visits; a session is a fold over visits and the
operator's words. Nothing here knows how it is shown.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
