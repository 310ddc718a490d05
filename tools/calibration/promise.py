"""Checks whether a correction's promise holds for a record: the same block, as warm, and at rest under gravity."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import chebyshev_radius
from ..motion.rests import BY_CHANCE, quiet_rests, sampling_of
from ..records import PoseRecord, PositionRecord, StrapdownRecord
from ..records.columns import CORRECTED_BY
from ..records.sigma import deviation_widening
from ..rounding import digits, residual, upwards
from .model import Positions, direction_jacobian, parametrise, predicted_input

if TYPE_CHECKING:
    from ..records.read import Record as Measured
    from .correction import Correction

AS_WARM = 1.0
"""So far beyond the temperatures of its calibration a record is as warm [K]."""
ROOM = 1.01
"""Factor for the second order and rounding in a radius."""
OF_TABLE = ("X1", "X2", "X3", "X8", "-X12", "X13")
"""Parameters of table and mounting: those of another day are others."""
STEPS = 3
"""Gauss-Newton steps to table and mounting."""
SERIAL_NUMBERS = frozenset(
    ("serial", "serialnumber", "serialno", "sn", "instrument", "device", "block", "unit", "seriennummer", "gerät")
)
"""Keys of comment lines that name the block, without spaces and signs."""


def serial_number(comments: Mapping[str, str]) -> str | None:
    """Return the serial number that comment lines give; None where none does."""
    for key, text in comments.items():
        if re.sub(r"[\W_]", "", key.casefold()) in SERIAL_NUMBERS:
            return text.strip()
    return None


def broken_conditions(
    correction: "Correction", record: "Measured", still: "Measured", n: NDArray, noise_bound: float
) -> list[str]:
    """Return in words why a promise of a correction does not hold for a record; empty where it does.

    Parameters
    ----------
    correction : Correction
    record : Measured
        as it was measured
    still : Measured
        its rests, where it has some
    n : ndarray, shape (N, 3)
        corrected readings of these [g]
    noise_bound : float
        of them [g]; 0 takes that of the calibration
    """
    reasons = []
    if correction.low is None:
        reasons.append(f"the calibration's verdict is {correction.verdict}: it gives standard errors, no intervals")
    if correction.sigma_kind != "bound":
        reasons.append(
            "the noise bound of the calibration is estimated, or taken from its record; calibrate with --noise-bound"
        )
    if correction.effects:
        reasons.append(
            f"{' and '.join(correction.effects)} stays in the readings: the calibration was made beside it, and the "
            "equation does not take it out"
        )
    if CORRECTED_BY in record.about:
        reasons.append(f"the record was corrected before ({record.about[CORRECTED_BY]})")
    if not record.sha256 or record.sha256 != correction.sha256:
        reasons += _other_block(correction, record) + _other_temperature(correction, record)
    if isinstance(still, PositionRecord):
        reasons += _against_gravity(correction, still, n, noise_bound or correction.noise_bound)
    elif isinstance(record, PoseRecord):
        bound = correction.bound_at(n, noise_bound or correction.noise_bound)
        reason = _of_length(n, bound, [f"pose {number}" for number in record.position])
        reasons += [reason] if reason else []
    elif isinstance(record, StrapdownRecord):
        reasons += _against_gravity_at_rests(correction, record, noise_bound or correction.noise_bound)
    return reasons


def _other_block(correction: "Correction", record: "Measured") -> list[str]:
    """Return why the block may be another one than that of the calibration."""
    calibrated, measured = serial_number(correction.comments), serial_number(record.about)
    if calibrated is None and measured is None:
        return []
    if calibrated is None:
        return [f"the record is of block {measured!r}, and the calibration does not name its block"]
    if measured is None:
        return [f"the calibration is of block {calibrated!r}, and the record does not name its block"]
    if measured.casefold() != calibrated.casefold():
        return [f"the record is of block {measured!r}, the calibration of {calibrated!r}"]
    return []


def _other_temperature(correction: "Correction", record: "Measured") -> list[str]:
    """Return why the block may not have been as warm as at its calibration."""
    calibrated = correction.temperature
    if record.temperature is None and calibrated is None:
        return []
    if record.temperature is None:
        return ["the record does not say its temperature, which the calibration does"]
    coldest, hottest = float(record.temperature.min()), float(record.temperature.max())
    measured = f"the record was measured at {_span(coldest, hottest)}"
    if calibrated is None:
        return [f"{measured}, and the calibration does not say its temperature"]
    low, high = calibrated
    if coldest < low - AS_WARM or hottest > high + AS_WARM:
        return [f"{measured}, the calibration at {_span(low, high)}"]
    return []


def _span(low: float, high: float) -> str:
    """Return temperatures [°C] in words."""
    if digits(low, 3) == digits(high, 3):
        return f"{digits(low, 3)} °C"
    return f"{digits(low, 3)} to {digits(high, 3)} °C"


def _against_gravity(correction: "Correction", record: PositionRecord, n: NDArray, noise_bound: float) -> list[str]:
    """Return why corrected readings (N, 3) [g] at rest are not gravity, or not where the encoders have it."""
    bound = correction.bound_at(n, noise_bound + record.resolution / correction.gravity)
    if reason := _of_length(n, bound, [f"position {number}" for number in record.position]):
        return [reason]
    several = record.mounting is not None and len(set(record.mounting)) > 1
    if correction.mounting is None or several:
        return []
    radius = _radius_at_table(record, correction.mounting, n, bound + 2.0 * record.angle_resolution)
    if radius <= ROOM:
        return []
    return [
        f"the corrected readings miss the directions of the encoders by {residual(radius)} times what is promised: "
        "another block, or wrong angles"
    ]


def _against_gravity_at_rests(correction: "Correction", record: StrapdownRecord, noise_bound: float) -> list[str]:
    """Return why the corrected means of a strapdown record's rests are not gravity; nothing where it has no rests."""
    rests = quiet_rests(record, sampling_of(record))
    if not len(rests) or rests.force_scatter is None:
        return []
    scatter = deviation_widening(len(rests), BY_CHANCE) * rests.force_scatter / correction.gravity
    n = correction.inputs_of(rests.force)
    bound = correction.bound_at(n, np.maximum(scatter, noise_bound))
    reason = _of_length(n, bound, [f"the rest at {digits(time, 4)} s" for time in rests.time_s.tolist()])
    return [reason] if reason else []


def _of_length(n: NDArray, bound: NDArray, where: Sequence[str]) -> str:
    """Return why inputs (N, 3) [g] at rest within bounds (N, 3) [g] are not gravity; "" where they may be."""
    size = np.linalg.norm(n, axis=1)
    allowed = ROOM * np.einsum("ij,ij->i", np.abs(n), bound) / size
    over = np.nan_to_num(np.abs(size - 1.0) / allowed, nan=0.0)
    worst = int(np.argmax(over))
    if over[worst] <= 1.0:
        return ""
    return (
        f"at {where[worst]} the corrected reading is {digits(size[worst], 6)} g long, where 1 g to within "
        f"{upwards(allowed[worst])} g is promised: another block, temperature or gravity"
    )


def _radius_at_table(record: PositionRecord, mounting: NDArray, n: NDArray, bound: NDArray) -> float:
    """Return the least largest misfit of inputs (N, 3) over bounds (N, 3), with any table and mounting error."""
    p = parametrise({"record": mounting})
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    columns = [p.symbols.index(symbol) for symbol in OF_TABLE]
    point = np.zeros(len(p.symbols))
    for _ in range(STEPS):
        jacobian = direction_jacobian(p, point, at)[:, :, columns].reshape(-1, len(columns))
        misfit = (n - predicted_input(p, point, at)).ravel()
        point[columns] += np.linalg.lstsq(jacobian, misfit, rcond=None)[0]
    misfit = (n - predicted_input(p, point, at)).ravel()
    return chebyshev_radius(jacobian, misfit, bound.ravel())[0]
