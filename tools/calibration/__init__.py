"""Calibration of an accelerometer block on a two-axis table, with guaranteed errors.

>>> result = calibrate(record, noise_bound=1e-5)
>>> result.to_json()["verdict"]
'consistent'
"""

from .procedure import calibrate, fit_record
from .result import Calibration

__all__ = ["Calibration", "calibrate", "fit_record"]
