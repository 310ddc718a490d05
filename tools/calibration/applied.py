"""Records corrected by a calibration: corrected readings, their errors, and the reasons against a guarantee."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..records import BenchRecord, PoseRecord, PositionRecord, RawRecord, Source, StrapdownRecord, read_record
from ..records.columns import CORRECTED_BY
from ..records.rests import average_rests, find_rests
from ..result import Result, Told, finite_or_none
from ..rounding import digits, exactly
from .correction import Correction, GyroCorrection, Levelling, corrected, correction_of, levelling, read_correction
from .promise import broken_conditions

if TYPE_CHECKING:
    from polars import DataFrame

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
    stamps: str | None = None,
) -> Applied:
    """Correct the readings of a record by a calibration or its file; arguments and errors as of `trihedron.apply`.

    The noise bound is that of the averaged readings' own errors [g], for the error that remains after the correction.
    """
    if not (math.isfinite(noise_bound) and 0.0 <= noise_bound <= 1e-2):
        raise InputError(f"--noise-bound {exactly(noise_bound)}: must be a fraction of g from 0 to 0.01, as 1e-5")
    measured = read_record(record, channels=channels, stamps=stamps)
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


def _corrected_gyros(
    gyros: GyroCorrection, record: BenchRecord | StrapdownRecord, n: NDArray
) -> dict[str, NDArray[np.float64]]:
    """Return the corrected channels of a record's gyros by their names, at inputs (N, 3) [g]."""
    if record.rate is not None:
        return {"rate": gyros.corrected(record.rate, n)}
    if record.increment is None:
        return {}
    steps, first = np.diff(record.time_s), 0.0
    if len(steps):
        first = float(np.median(steps))
    return {"increment": gyros.corrected(record.increment, n, np.append(first, steps)[:, None])}
