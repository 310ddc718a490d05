"""Calibration of an accelerometer block on a two-axis table, with guaranteed errors.

>>> result = calibrate(record, noise_bound=1e-5)
>>> result.to_json()["verdict"]
'consistent'
"""

from .procedure import calibrate, fit_record
from .result import Calibration, bench_parameters

__all__ = ["Calibration", "bench_parameters", "calibrate", "fit_record"]
