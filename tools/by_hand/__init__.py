"""Calibration without a table: accelerometers by the norm of gravity in any poses, gyros by the moves between them.

>>> calibrate_by_hand(record).verdict
'usable'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
