"""A calibrated instrument in SI, as other programs take it: r = A f + b of accelerometers, w = G ω + D f + c of gyros.

A is lower triangular, in the calibration's axes; readings r [m/s²] and w [rad/s].
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ..rounding import digits, exactly
from .correction import Correction

FRAME = "axis 1 is accelerometer 1, axis 2 lies in the plane of accelerometers 1 and 2, axis 3 is right-handed"


@dataclass(frozen=True)
class AffineTriad:
    """Three sensors: reading = `matrix` (3, 3) input + `bias` (3,), with standard errors, NaN where unknown."""

    matrix: Floats
    bias: Floats
    matrix_sd: Floats
    bias_sd: Floats

    @property
    def inverse(self) -> NDArray:
        """The inverse (3, 3) of the matrix."""
        return np.linalg.inv(self.matrix)


@dataclass(frozen=True)
class AffineModel:
    """A calibrated instrument in SI.

    Attributes
    ----------
    gravity : float
        of the calibration [m/s²]
    accelerometers : AffineTriad
        A [1], lower triangular, and b [m/s²]
    plus, minus : (3,) array
        diagonal of A for positive and for negative inputs; A has their mean
    gyros : Triad or None
        G [1] and c [rad/s]
    sensitivity, sensitivity_sd : (3, 3) array
        D [rad/s per m/s²]
    verdict : str
        of the calibration
    open : tuple of str
        its open directions
    about : dict
        what every export says, in words
    """

    gravity: float
    accelerometers: AffineTriad
    plus: Floats
    minus: Floats
    gyros: AffineTriad | None
    sensitivity: Floats
    sensitivity_sd: Floats
    verdict: str
    open: tuple[str, ...]
    about: Mapping[str, str]

    @classmethod
    def of(cls, correction: Correction) -> Self:
        """Return the model of a correction."""
        g = correction.gravity
        matrix = correction.gamma + np.diag(0.5 * (correction.plus + correction.minus))
        deviations = np.sqrt(np.diag(correction.covariance))
        matrix_sd = np.zeros((3, 3))
        matrix_sd[np.tril_indices(3)] = deviations[:6]
        accelerometers = AffineTriad(matrix, g * correction.bias, matrix_sd, g * deviations[6:])
        gyros, sensitivity, sensitivity_sd = None, np.zeros((3, 3)), np.zeros((3, 3))
        if correction.gyros is not None:
            known = correction.gyros
            gyros = AffineTriad(known.matrix, known.bias, known.matrix_sd, known.bias_sd)
            sensitivity, sensitivity_sd = known.sensitivity / g, known.sensitivity_sd / g
        return cls(
            gravity=g,
            accelerometers=accelerometers,
            plus=correction.plus,
            minus=correction.minus,
            gyros=gyros,
            sensitivity=sensitivity,
            sensitivity_sd=sensitivity_sd,
            verdict=correction.verdict,
            open=correction.open,
            about=_about(correction),
        )

    @property
    def asymmetry(self) -> float:
        """The largest error [m/s²] at 1 g of one scale factor in place of two."""
        return self.gravity * 0.5 * float(np.abs(self.plus - self.minus).max())


def _about(correction: Correction) -> dict[str, str]:
    """Return what every export says of a calibration, by keys."""
    about = {
        "model": "r = A f + b (readings r of the accelerometers, specific force f); A lower triangular, forward",
        "correction": "f = A^-1 (r - b)",
        "units": "m/s2 and rad/s",
        "axes": FRAME,
        "gravity_mps2": repr(correction.gravity),
    }
    if correction.gyros is None:
        about["gyros"] = "not calibrated"
    else:
        about["gyros"] = "w = G omega + D f + c (readings w, angular rate omega)"
    about["verdict"] = correction.verdict
    if correction.pose_error is not None:
        about["standard_error"] = f"{digits(1e3 * correction.pose_error, 2)} mg of |f| at rest in the worst pose"
    if correction.noise_bound:
        about["noise_bound"] = f"{exactly(correction.noise_bound, 3)} g ({correction.sigma_kind})"
    about["not_determined"] = "; ".join(correction.open) or "nothing"
    if stays := stays_in_readings(correction):
        about["not_corrected"] = "; ".join(stays)
    about["record"] = f"{correction.source or 'unknown'} (SHA-256 {correction.sha256 or 'none'})"
    if correction.of_record:
        about["biases_of"] = correction.of_record
    if correction.temperature is not None:
        about["temperature_degC"] = " to ".join(digits(value, 4) for value in correction.temperature)
    return about


def stays_in_readings(correction: Correction) -> list[str]:
    """Return in words what the calibration knows and no affine equation takes out."""
    return [*(f"{effect} stays in the readings" for effect in correction.effects), *correction.in_motion]


@dataclass(frozen=True)
class ExportRequest:
    """What an export is asked for beside the calibration.

    Attributes
    ----------
    densities : tuple of 4 float or None
        accelerometers' noise density [m/s²/√Hz] and random walk [m/s³/√Hz], gyros' [rad/s/√Hz] and [rad/s²/√Hz]
    rate : float or None
        readings per second [Hz]
    topic : str
        of ROS
    name : str
        prefix of names in C, variable of MATLAB
    notes : tuple of str
        how the densities were taken
    """

    densities: tuple[float, float, float, float] | None = None
    rate: float | None = None
    topic: str = "/imu0"
    name: str = "imu"
    notes: tuple[str, ...] = ()
