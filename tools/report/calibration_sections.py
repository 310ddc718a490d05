"""Sections of the page of `trihedron calibrate` beside the targets: what is possible jointly, what it bought, rests."""

import numpy as np

from ..calibration import Calibration
from ..calibration.correction import ARCSEC, correction_of, face_readings, levelling
from ..calibration.estimates import joint_sets
from ..records import PositionRecord
from ..summaries import is_corrected
from .cells import Cell
from .joint_set_pictures import joint_set
from .model_sections import correction_lines
from .page import Section, Table
from .rest_pictures import refused_rests
from .rounding import places_of, significant, upwards

TOGETHER = (
    "Errors hang together: where a set is narrow and aslant, a combination is known better than each target by itself. "
    "The sets are exact, of the model linearised at the fit."
)


def joint_set_sections(result: Calibration) -> list[Section]:
    """Pairwise projections of the set of all parameters that the readings leave possible."""
    if result.feasible is None:
        return []
    p = result.linearised.parametrisation
    estimates = dict(zip(p.symbols, result.linearised.point.tolist(), strict=True))
    estimates |= {e.symbol: e.estimate for e in result.parameters if e.estimate is not None}
    return [
        Section(
            f"Possible together: {group}",
            [TOGETHER] if k == 0 else [],
            joint_set(pairs, estimates, result.noise_bound),
            "Each pair of targets about its estimates, in units of σ; an estimate may lie outside, the truth does not.",
        )
        for k, (group, pairs) in enumerate(joint_sets(result.feasible).items())
    ]


def levelling_sections(result: Calibration) -> list[Section]:
    """The correction as equations, and the error of the vertical before and after it, attitude by attitude."""
    if not is_corrected(result):
        return []
    correction = correction_of(result.to_json(), "calibration")
    names, reading = face_readings(correction)
    gained = levelling(correction, reading)
    rows: list[list[Cell]] = [
        [name, significant(before / ARCSEC, 3), upwards(after / ARCSEC)]
        for name, before, after in zip(names, gained.before.tolist(), gained.after.tolist(), strict=True)
    ]
    return [
        Section(
            "What it bought",
            [
                "An inertial system that aligns itself by these accelerometers takes their readings for the vertical. "
                "The errors below are those of the block at rest; the readings' own errors come on top.",
                "The correction, with f the readings and g n what they become; `trihedron apply` does it:",
            ],
            equations=correction_lines(correction, places_of(result.noise_bound)),
            table=Table(
                ["attitude of the block", "error of the vertical as read [arcsec]", "corrected, guaranteed [arcsec]"],
                rows,
            ),
        )
    ]


def rest_sections(record: PositionRecord) -> list[Section]:
    """The rests of a raw record that were left out, each with its picture and its reason."""
    if record.raw is None:
        return []
    refused = [rest for rest in record.rests if rest.refused is not None]
    if not refused:
        return []
    kept = len(record.rests) - len(refused)
    pictures = refused_rests(record.raw, record.rests)
    duration = [float(np.ptp(record.raw.time_s[rest.first : rest.last + 1])) for rest in refused]
    rows = [
        [int(record.raw.row[rest.first]), int(record.raw.row[rest.last]), lasts, rest.refused]
        for rest, lasts in zip(refused, duration, strict=True)
    ]
    first = Section(
        "Rests that were left out",
        [f"{len(record.rests)} rests were found, {kept} are used, {len(refused)} are not."],
        pictures[0],
        "Angles and readings, less their medians, during the rests that were refused.",
        Table(["first row", "last row", "lasts [s]", "why"], rows),
    )
    more = [Section("Rests that were left out, continued", svg=picture) for picture in pictures[1:]]
    return [first, *more]
