"""Bounded-error mathematics: programmes, bounds of sets, possible sets. It knows no record and no instrument."""

import lazy_loader

from .. import postponed as postponed

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
