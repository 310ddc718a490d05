"""What a strapdown record supports: sampling, rests, moves, excitation, and what its rests say of the instruments."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..records import StrapdownRecord
from ..shown import Shown
from .norm_calibration import NAMES, NormCalibration, calibrate_by_norm, inputs_of
from .rest_gyros import GyrosAtRest, gyros_at_rest
from .rests import Rests, find_rests
from .sampling import Sampling, rates_of, sampling_of
from .turning_check import TurningCheck, check_turning

if TYPE_CHECKING:
    from polars import DataFrame

LEAST_BOUND = 1e-9
"""Bounds of means [g], [rad/s] are not taken for less: arithmetic has errors too."""
EXCITED = 5.0
"""An axis is excited when its rate's rms in moves is so many times the noise of a sample."""


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Shown):
    """What a record supports.

    Attributes
    ----------
    record : StrapdownRecord
    gravity : float
        model value [m/s²]
    sampling : Sampling
    rests : Rests
    moves : (M, 2) array
        duration [s] and turn, the integral of the rate's size less the median mean at rest [rad], between rests
    excitation : (3,) array
        rms of each gyro's rate outside the rests [rad/s]
    turning : TurningCheck
    accelerometers : NormCalibration or None
        None where there are no rests, or their noise cannot be told
    gyros : GyrosAtRest or None
    """

    record: StrapdownRecord
    gravity: float
    sampling: Sampling
    rests: Rests
    moves: NDArray[np.float64]
    excitation: NDArray[np.float64]
    turning: TurningCheck
    accelerometers: NormCalibration | None
    gyros: GyrosAtRest | None

    def to_json(self) -> dict[str, Any]:
        """For JSON: SI units and radians, in names that say so."""
        calibration, gyros = self.accelerometers, self.gyros
        rests = self.rests
        return {
            "schema": "trihedron.inspection/1",
            "record": {"rows": len(self.record), "sha256": self.record.sha256, "warnings": list(self.record.warnings)},
            "gravity_mps2": self.gravity,
            "input": "rates" if self.record.rate is not None else "increments",
            "sampling": {
                "period_s": self.sampling.period,
                "jitter_rms_s": self.sampling.jitter_rms,
                "jitter_max_s": self.sampling.jitter_max,
                "gaps": [{"time_s": time, "length_s": length} for time, length in self.sampling.gaps],
                "missing_rows": self.sampling.missing,
                "saturated_rows": self.sampling.saturated,
                "dead_channels": list(self.sampling.dead),
            },
            "temperature": self.record.temperature is not None,
            "true_attitude": self.record.attitude is not None,
            "rests": {
                "count": len(rests),
                "slow_turns_left_out": rests.turning,
                "clipped_left_out": rests.clipped,
                "reading_step_mps2": rests.step.tolist(),
                "time_s": rests.time_s.tolist(),
                "length_s": [(r.stop - r.start) * self.sampling.period for r in rests.rows],
                "force_bound_mps2": None if rests.force_bound is None else rests.force_bound.tolist(),
                "rate_bound_radps": None if rests.rate_bound is None else rests.rate_bound.tolist(),
            },
            "moves": [{"length_s": float(length), "turn_rad": float(turn)} for length, turn in self.moves],
            "rate_rms_radps": self.excitation.tolist(),
            "turning": {
                "matrix": None if self.turning.matrix is None else self.turning.matrix.tolist(),
                "said": list(self.turning.said),
            },
            "accelerometers": None if calibration is None else _calibration_dict(calibration),
            "gyros_at_rest": None
            if gyros is None
            else {
                "verdict": gyros.verdict,
                "models": [
                    {
                        "terms": list(model.terms),
                        "radius": model.radius,
                        "by_chance": model.by_chance,
                        "stands": model in gyros.standing,
                        "coefficients": [list(row) for row in model.coefficients],
                    }
                    for model in gyros.tried
                ],
                "not_tried": list(gyros.not_tried),
            },
        }

    def json_text(self) -> str:
        """The result as JSON, the same bytes for the same record."""
        return json.dumps(self.to_json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def lines(self) -> list[str]:
        """Sampling, rests, accelerometers, gyros."""
        from .inspection_text import inspection_text

        shown: Any = self
        return inspection_text(shown).split("\n")

    def to_polars(self) -> "DataFrame":
        """A row for each rest: time_s, length_s."""
        return _rest_table(self.rests, self.sampling.period)


def _rest_table(rests: Rests, period: float) -> "DataFrame":
    import polars as pl

    lengths = [(rows.stop - rows.start) * period for rows in rests.rows]
    columns = {"time_s": rests.time_s.tolist(), "length_s": lengths}
    return pl.DataFrame(columns, schema=dict.fromkeys(columns, pl.Float64))


def _calibration_dict(found: NormCalibration) -> dict[str, Any]:
    def at(values: NDArray | None, k: int) -> float | None:
        return None if values is None else float(values[k])

    return {
        "verdict": found.verdict,
        "radius": found.radius,
        "missing": list(found.missing),
        "parameters": [
            {
                "name": name,
                "unit": "g" if name.startswith("bias") else "1",
                "least_squares": at(found.least_squares, k),
                "standard_error": at(found.standard_error, k),
                "low": at(found.low, k),
                "high": at(found.high, k),
            }
            for k, name in enumerate(NAMES)
        ],
    }


def inspect_record(record: StrapdownRecord, *, gravity: float = STANDARD_GRAVITY) -> Inspection:
    """Say what a strapdown record supports, and what its rests say of gyros and accelerometers.

    Nothing is resampled or repaired: gaps, jitter, saturated samples and wrong units are stated.

    Parameters
    ----------
    record : StrapdownRecord
    gravity : float
        model value [m/s²]; a wrong one is in every scale factor

    Raises
    ------
    InputError
        fewer than 16 rows
    """
    sampling = sampling_of(record)
    rests = find_rests(record, sampling)
    rate = rates_of(record)
    moving = np.ones(len(record), dtype=bool)
    for rows in rests.rows:
        moving[rows] = False
    level = np.median(rests.rate, axis=0) if len(rests) else np.zeros(3)
    excitation = np.sqrt(np.mean((rate[moving] - level) ** 2, axis=0)) if moving.any() else np.zeros(3)
    noise = rests.noise[:3] if len(rests) else np.zeros(3)
    calibration = gyros = None
    if len(rests) and rests.force_bound is not None and rests.rate_bound is not None:
        bound = np.maximum(rests.force_bound / gravity, LEAST_BOUND)
        calibration = calibrate_by_norm(rests.force / gravity, bound)
        stands = calibration.verdict == "consistent" and calibration.least_squares is not None
        x = calibration.least_squares if stands else np.zeros(9)
        assert x is not None
        up = inputs_of(x, rests.force / gravity)
        limits = np.maximum(rests.rate_bound, LEAST_BOUND)
        gyros = gyros_at_rest(rests.time_s, rests.rate, limits, up, rests.temperature)
    return Inspection(
        record=record,
        gravity=gravity,
        sampling=sampling,
        rests=rests,
        moves=_moves(record, rests, rate - level),
        excitation=excitation,
        turning=check_turning(record.time_s, rate - level, record.specific_force, noise),
        accelerometers=calibration,
        gyros=gyros,
    )


def _moves(record: StrapdownRecord, rests: Rests, rate: NDArray) -> NDArray:
    """Duration and turn of each move between rests, shape (M, 2)."""
    speed = np.linalg.norm(rate, axis=1)
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(record.time_s)
    between = [(a.stop - 1, b.start) for a, b in zip(rests.rows[:-1], rests.rows[1:], strict=True)]
    found = [(record.time_s[last] - record.time_s[first], steps[first:last].sum()) for first, last in between]
    return np.array(found, dtype=float).reshape(len(found), 2)
