"""Records corrected by a calibration: corrected readings, their errors, and the reasons against a guarantee.

The promise of a correction holds for the same block, as warm, at rest under gravity.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.arrays import Floats
from ..errors import InputError
from ..records import BenchRecord, PoseRecord, PositionRecord, RawRecord, Source, StrapdownRecord, read_record
from ..records.columns import CORRECTED_BY
from ..records.rests import average_rests, find_rests
from ..result import Result, Told, finite_or_none
from ..rounding import digits, exactly
from .correction import Correction, GyroCorrection, Levelling, corrected, correction_of, levelling, read_correction

if TYPE_CHECKING:
    from polars import DataFrame

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..bounded.programmes import chebyshev_radius
from ..motion.rests import BY_CHANCE, quiet_rests, sampling_of
from ..records.sigma import deviation_widening
from ..rounding import residual, upwards
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


CALIBRATED = "the calibration of "
"""How a comment line of a record says that a calibration corrected it."""


class LevellingError(Result):
    """The greatest error of the vertical [rad]; `corrected_at_most` is None where nothing is guaranteed."""

    as_read: float
    corrected_at_most: float | None


class AppliedEffect(Result):
    """An effect that a diagnosis names, and its treatment in another record.

    "corrected": it was subtracted from the readings; "simulated": the extended FMUs have it, but no inverse exists;
    "left": it does not show in a record of this kind, or is not linear in its sizes
    """

    effect: str
    how: Literal["corrected", "simulated", "left"]


class Applied(Told):
    """A record corrected by a calibration, or by a diagnosis of another record, of its instrument.

    Attributes
    ----------
    rows : int
        of the record
    gravity_mps2, scale_plus, scale_minus, gamma, bias_g
        of the `Correction`, by a calibration
    levelled_at : str
        where the vertical was looked at: "positions", "rests" or "rows"
    levelling_error : LevellingError
    not_guaranteed : list of str
        why the levelling error is not guaranteed for this record; empty where it is
    verdict : str
        of the calibration
    standard_error_g : float or None
        largest standard error of a corrected reading, by the calibration
    open : list of str
        directions that the calibration leaves open
    gyros : str
        "corrected" where calibration and record have gyros
    effects : tuple of AppliedEffect
        of a diagnosis
    over, unit, rms_without, rms_with, max_without, max_with
        errors of the record simulated by FMUs, without and with the effects; `over` names the readings. Biases that
        belong to the record alone are fitted to it in both. Absent where nothing can be run
    correction : Correction
        not published
    record : PositionRecord, RawRecord or StrapdownRecord
        corrected; None where nothing could be taken out; not published
    levelling : Levelling
        at each position, rest or row; not published
    """

    schema_: Literal["trihedron.applied/2"] = Field(default="trihedron.applied/2", alias="schema")
    rows: int
    gravity_mps2: float | None = None
    scale_plus: list[float] | None = None
    scale_minus: list[float] | None = None
    gamma: list[list[float]] | None = None
    bias_g: list[float] | None = None
    levelled_at: Literal["positions", "rests", "rows"] | None = None
    levelling_error: LevellingError | None = Field(default=None, alias="levelling_error_rad")
    not_guaranteed: list[str] | None = None
    verdict: str | None = None
    standard_error_g: float | None = None
    open: list[str] = Field(default=[])
    gyros: Literal["corrected"] | None = None
    effects: tuple[AppliedEffect, ...] | None = None
    over: str | None = None
    unit: str | None = None
    rms_without: float | None = None
    rms_with: float | None = None
    max_without: float | None = None
    max_with: float | None = None
    warnings: list[str] = Field(default=[])
    correction: Correction | None = Field(default=None, exclude=True)
    record: Any = Field(default=None, exclude=True)
    levelling: Levelling | None = Field(default=None, exclude=True)

    def to_polars(self) -> "DataFrame | None":
        """The corrected readings: time_s, f1_mps2, f2_mps2, f3_mps2; None where nothing was taken out of any."""
        import polars as pl

        if self.record is None:
            return None
        force = {f"f{p + 1}_mps2": self.record.specific_force[:, p] for p in range(3)}
        return pl.DataFrame({"time_s": self.record.time_s, **force})


def apply_calibration(
    calibration: str | Path | Result,
    record: Source,
    *,
    noise_bound: float = 0.0,
    channels: Sequence[str] = (),
) -> Applied:
    """Correct the readings of a record by a calibration or its file; arguments and errors as of `trihedron.apply`.

    The noise bound is that of the averaged readings' own errors [g], for the error that remains after the correction.
    """
    if not (math.isfinite(noise_bound) and 0.0 <= noise_bound <= 1e-2):
        raise InputError(f"--noise-bound {exactly(noise_bound)}: must be a fraction of g from 0 to 0.01, as 1e-5")
    measured = read_record(record, channels=channels)
    if isinstance(calibration, str | Path):
        correction = read_correction(Path(calibration), measured.sha256)
    else:
        correction = correction_of(calibration.to_json(), "calibration", measured.sha256)
    at, still = "rows", measured
    if isinstance(measured, PositionRecord | PoseRecord):
        at = "positions"
    elif isinstance(measured, RawRecord):
        rests = find_rests(measured)
        if any(rest.refused is None for rest in rests):
            at, still = "rests", average_rests(measured, rests)
    before_it = measured.about.get(CORRECTED_BY, "")
    if CALIBRATED in before_it:
        raise InputError(
            f"{measured.path}: is corrected already ({before_it}); apply the calibration to the record as measured"
        )
    better = corrected(correction, measured.specific_force)
    if not np.isfinite(better).all():
        raise InputError(f"{measured.path}: the corrected readings are not finite")
    warnings = list(measured.warnings)
    if correction.of_record:
        warnings.append(
            f"what each record has of its own is that of {correction.of_record}, the last that was calibrated"
        )
    warnings += _cautions(correction)
    gain = levelling(correction, still.specific_force / correction.gravity, noise_bound)
    before, after = gain.worst
    n = corrected(correction, still.specific_force) / correction.gravity
    source = f"{CALIBRATED}{correction.source or 'a record'} (SHA-256 {correction.sha256 or 'none'})"
    if before_it:
        source = f"{before_it}; then {source}"
    about = {CORRECTED_BY: source} | dict(measured.about) | {CORRECTED_BY: source}
    channels_of_gyros: dict[str, NDArray] = {}
    of_gyros: dict[str, Any] = {}
    if correction.gyros is not None and isinstance(measured, BenchRecord | StrapdownRecord):
        of_gyros = {"gyros": "corrected"}
        channels_of_gyros = _corrected_gyros(correction.gyros, measured, better / correction.gravity)
    return Applied(
        gravity_mps2=correction.gravity,
        scale_plus=correction.plus.tolist(),
        scale_minus=correction.minus.tolist(),
        gamma=correction.gamma.tolist(),
        bias_g=correction.bias.tolist(),
        rows=len(measured),
        levelled_at=at,
        not_guaranteed=broken_conditions(correction, measured, still, n, noise_bound),
        verdict=correction.verdict,
        standard_error_g=_largest(correction.standard_errors(measured.specific_force) / correction.gravity),
        open=list(correction.open),
        levelling_error_rad=LevellingError(as_read=before, corrected_at_most=after),
        warnings=warnings,
        correction=correction,
        record=replace(measured, specific_force=better, about=about, **channels_of_gyros),
        levelling=gain,
        **of_gyros,
    )


def _cautions(correction: Correction) -> list[str]:
    """Return why the estimates of a calibration are to be used with care, in sentences."""
    if correction.verdict == "falsified":
        return ["the calibration is falsified: no parameters keep every reading within its noise bound"]
    if correction.verdict == "insufficient":
        size = "" if correction.pose_error is None else f" to {digits(1e3 * correction.pose_error, 2)} mg"
        return [f"the calibration is insufficient: in its worst pose |f| is known{size} only (1 standard error)"]
    return []


def _largest(values: NDArray) -> float | None:
    """Return the largest of values; None where one is not known."""
    return finite_or_none(float(values.max(initial=0.0)))


def _corrected_gyros(gyros: GyroCorrection, record: BenchRecord | StrapdownRecord, n: NDArray) -> dict[str, Floats]:
    """Return the corrected channels of a record's gyros by their names, at inputs (N, 3) [g]."""
    if record.rate is not None:
        return {"rate": gyros.corrected(record.rate, n)}
    if record.increment is None:
        return {}
    steps, first = np.diff(record.time_s), 0.0
    if len(steps):
        first = float(np.median(steps))
    return {"increment": gyros.corrected(record.increment, n, np.append(first, steps)[:, None])}
