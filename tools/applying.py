"""A calibration applied to a record: readings corrected, and what that is worth for levelling."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .calibration.correction import (
    ARCSEC,
    Correction,
    Levelling,
    corrected,
    correction_of,
    equation_lines,
    levelling,
    read_correction,
)
from .errors import InputError
from .records import (
    PositionRecord,
    RawRecord,
    StrapdownRecord,
    read_record,
    write_record,
)
from .records.rests import average_rests, find_rests
from .shown import Shown

if TYPE_CHECKING:
    from polars import DataFrame

    from .calibration import Calibration

SCHEMA = "trihedron.correction/1"
LATITUDE_DEG = 55.75
"""Where the azimuth's error is told when nothing else is asked for."""


@dataclass(frozen=True, repr=False)
class Application(Shown):
    """A corrected record.

    Attributes
    ----------
    correction : Correction
    record : PositionRecord, RawRecord or StrapdownRecord
        with corrected specific force
    at : str
        where the vertical was looked at: "positions", "rests" or "rows"
    levelling : Levelling
        at each of these
    """

    correction: Correction
    record: PositionRecord | RawRecord | StrapdownRecord
    at: str
    levelling: Levelling

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.correction/1: the correction's numbers, what it is worth."""
        c = self.correction
        before, after = self.levelling.worst
        return {
            "schema": SCHEMA,
            "gravity_mps2": c.gravity,
            "scale_plus": c.plus.tolist(),
            "scale_minus": c.minus.tolist(),
            "gamma": c.gamma.tolist(),
            "bias_g": c.bias.tolist(),
            "rows": len(self.record),
            "levelled_at": self.at,
            "levelling_error_rad": {"as_read": before, "corrected_at_most": after},
            "warnings": list(self.record.warnings),
        }

    def lines(self) -> list[str]:
        """The equation with its numbers, what the correction is worth."""
        return application_summary(self, LATITUDE_DEG).split("\n")

    def to_polars(self) -> "DataFrame":
        """The corrected readings: time_s, f1_mps2, f2_mps2, f3_mps2."""
        import polars as pl

        force = {f"f{p + 1}_mps2": self.record.specific_force[:, p] for p in range(3)}
        return pl.DataFrame({"time_s": self.record.time_s, **force})


def apply_calibration(
    calibration: "str | Path | Calibration", record: Path, *, noise_bound: float = 0.0
) -> Application:
    """Correct the readings of a record by a calibration's file.

    Parameters
    ----------
    calibration : Path or Calibration
        of `trihedron calibrate --json`, or the value
    record : Path
        position, raw or strapdown record
    noise_bound : float
        bound of the averaged readings' own errors [g], for what remains after the correction

    Raises
    ------
    InputError
        for a calibration that is not consistent, or a record that cannot be used
    """
    if not (math.isfinite(noise_bound) and 0.0 <= noise_bound <= 1e-2):
        raise InputError(f"--noise-bound {noise_bound:g}: must be a fraction of g from 0 to 0.01, as 1e-5")
    if isinstance(calibration, str | Path):
        correction = read_correction(Path(calibration))
    else:
        correction = correction_of(calibration.to_json(), "calibration")
    measured = read_record(record)
    at, still = "positions" if isinstance(measured, PositionRecord) else "rows", measured
    if isinstance(measured, RawRecord):
        rests = find_rests(measured)
        if any(rest.refused is None for rest in rests):
            at, still = "rests", average_rests(measured, rests)
    better = corrected(correction, measured.specific_force)
    if not np.isfinite(better).all():
        raise InputError(f"{record}: the corrected readings are not finite")
    gained = levelling(correction, still.specific_force / correction.gravity, noise_bound)
    return Application(correction, replace(measured, specific_force=better), at, gained)


def write_corrected(result: Application, path: Path) -> None:
    """Write the corrected record as CSV, whole or not at all."""
    write_record(result.record, path)


def application_summary(result: Application, latitude_deg: float) -> str:
    """The equation with its numbers, and what the correction is worth for an alignment.

    Raises
    ------
    InputError
        for a latitude at which there is no azimuth to find
    """
    if not abs(latitude_deg) <= 89.0:
        raise InputError(f"--latitude-deg {latitude_deg:g}: must be from -89 to 89; there is no azimuth at a pole")
    gained = result.levelling
    worst = int(np.argmax(gained.before))
    before, after = gained.worst
    azimuth = abs(math.tan(math.radians(latitude_deg)))
    lines = equation_lines(result.correction)
    lines += [
        f"{len(gained.before)} {result.at}; largest error of the vertical, in arcseconds:",
        f"  as read {before / ARCSEC:.2f} ({result.at.removesuffix('s')} {worst + 1}), "
        f"corrected at most {after / ARCSEC:.2f}, guaranteed",
        f"  its part in the azimuth of a gyrocompass at latitude {latitude_deg:g}°: "
        f"as read up to {azimuth * before / ARCSEC:.2f}, corrected at most {azimuth * after / ARCSEC:.2f}",
    ]
    if result.at == "rows":
        lines.append("  (of the direction of the specific force; it is the vertical where the block is at rest)")
    lines += [f"warning: {warning}" for warning in result.record.warnings]
    return "\n".join(lines)
