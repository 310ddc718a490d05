"""Calibration of an accelerometer block on a two-axis table, with guaranteed errors.

>>> result = calibrate(record, noise_bound=1e-5)
>>> result.to_json()["verdict"]
'consistent'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
