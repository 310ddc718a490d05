"""Faults of a record, not of the physics: rows, a stretch, a break, a noise bound that is too small.

Each kind is found by a function of the evidence, which returns the simplest faults of its kind with which the model
stands.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
