"""Calibrations by hand as their JSON has them, of instruments that are known."""

from typing import Any, TypeVar

import numpy as np

from trihedron.tools.motion.determinacy import PRIOR_SD, TURN_PRIOR_SD

NAMES = ("gamma_11", "gamma_21", "gamma_22", "gamma_31", "gamma_32", "gamma_33", "bias_1", "bias_2", "bias_3")
OF_GYROS = ("B1", "B2", "B3", *(f"M{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)))
UNITS = {"B": "rad/s", "S": "rad/s/g", "L": "s"}
SENSITIVITY = tuple(f"S{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
GRAVITY = 9.81
Value = TypeVar("Value")


def present(value: Value | None) -> Value:
    """Return a value that must be there."""
    assert value is not None
    return value


class Instrument:
    """Accelerometers r/g = A n + b and gyros r = G w + S n + B, drawn from a seed."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.matrix = np.eye(3) + np.tril(rng.normal(0.0, 0.02, (3, 3)))
        self.bias = rng.normal(0.0, 0.03, 3)
        self.gyro_matrix = np.eye(3) + rng.normal(0.0, 0.01, (3, 3))
        self.gyro_bias = rng.normal(0.0, 0.02, 3)
        self.sensitivity = rng.normal(0.0, 1e-3, (3, 3))

    @classmethod
    def of_prior(cls, seed: int) -> "Instrument":
        """Return an instrument drawn as a calibration supposes any to be before its readings count."""
        rng = np.random.default_rng([seed, 1])
        instrument = cls(seed)
        instrument.matrix = np.eye(3)
        instrument.matrix[np.tril_indices(3)] += rng.normal(0.0, PRIOR_SD[:6])
        instrument.bias = rng.normal(0.0, PRIOR_SD[6:])
        instrument.gyro_matrix = np.eye(3) + rng.normal(0.0, TURN_PRIOR_SD).reshape(3, 3)
        instrument.sensitivity = np.zeros((3, 3))
        return instrument

    def readings(self, force: np.ndarray) -> np.ndarray:
        """Return readings (N, 3) [m/s2] at specific forces (N, 3) [m/s2]."""
        return force @ self.matrix.T + GRAVITY * self.bias

    def rates(self, rate: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return readings of the gyros (N, 3) [rad/s] at rates (N, 3) [rad/s] and specific forces (N, 3) [m/s2]."""
        return rate @ self.gyro_matrix.T + (force / GRAVITY) @ self.sensitivity.T + self.gyro_bias


def calibration(
    instrument: Instrument,
    *,
    gyros: bool = True,
    sensitivity: bool = True,
    verdict: str = "usable",
    half_width: float | None = None,
    **further: Any,
) -> dict[str, Any]:
    """Return the calibration of an instrument without errors: standard errors of 1e-4, intervals of `half_width`."""
    values: dict[str, float] = dict(zip(NAMES, [*instrument.matrix[np.tril_indices(3)], *instrument.bias], strict=True))
    for p in (1, 2, 3):
        values[f"gamma_{p}{p}"] -= 1.0
    if gyros:
        matrix = instrument.gyro_matrix - np.eye(3)
        values |= dict(zip(OF_GYROS, [*instrument.gyro_bias, *matrix.ravel()], strict=True))
        if sensitivity:
            values |= dict(zip(SENSITIVITY, instrument.sensitivity.ravel(), strict=True))
    parameters = []
    for symbol, value in values.items():
        unit = "g" if symbol.startswith("bias") else UNITS.get(symbol[0], "1")
        ends = (None, None) if half_width is None else (float(value) - half_width, float(value) + half_width)
        entry = {"symbol": symbol, "name": symbol, "unit": unit, "determined": True, "estimate": float(value)}
        parameters.append(entry | {"standard_error": 1e-4, "low": ends[0], "high": ends[1]})
    pose_error = {"worst_g": 0.00042, "rms_g": 0.0002, "direction": [0.1, -0.7, 0.7], "words": "determined"}
    of_hand = {"rests": 22, "moves": 21, "turns": 0, "pose_error": pose_error, "turn_error": None, "residual_g": 3e-4}
    of_hand |= {"residual_rad": None, "sensitivity": None, "case": None}
    kind = "estimated" if half_width is None else "bound"
    content = {
        "schema": "trihedron.calibration/3",
        "verdict": verdict,
        "sigma": {"value": 3e-4, "kind": kind, "from": "given"},
        "stands_with_sigma": None,
        "radius": None,
        "gravity_mps2": GRAVITY,
        "estimator": "least squares",
        "parameters": parameters,
        "by_hand": of_hand,
        "open": [],
        "provenance": {"trihedron": "1", "record": "phone.csv", "record_sha256": "ab" * 32, "kind": "by hand"},
        "warnings": [],
    }
    return content | further
