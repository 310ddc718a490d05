"""What was measured, on the page of a strapdown record: sampling, rests and moves, and the instruments at rest."""

import math

import numpy as np

from ..diagnosis.result import Diagnosis
from ..motion.inspect import EXCITED, GyrosAtRest, Inspection
from ..motion.norm import NAMES, NormCalibration
from .allan_pictures import allan_picture
from .cells import Cell, Written
from .page import Section, Table
from .rounding import outwards, significant, to_bound, unit_text, upwards
from .strapdown_model import own_words
from .strapdown_text import parameters_of

EVEN = 1e-6
"""Time stamps that stray by less than so much of a period are called even."""
GYROS = {
    "constant": "At rest the gyros read a constant, as far as their noise tells.",
    "named": "At rest the gyros' means are not constant: one smallest model stands, {}.",
    "ambiguous": "At rest the gyros' means are not constant, and several models stand: {}.",
    "wandering": "At rest the gyros' means are not constant, and nothing that was tried explains it.",
    "insufficient": "There are too few rests to say how the gyros' means change.",
}


def measured_sections(result: Diagnosis) -> list[Section]:
    """The record, and what its rests say of accelerometers and gyros."""
    found = result.evidence.found
    first = Section(
        "What was measured",
        [sampling_words(found), *rest_words(found), *(f"Warning: {text}." for text in result.warnings)],
        allan_picture(found.record, found.rests, found.sampling.period),
        "Allan deviation of the readings over the rests: what noise leaves of a mean of that length.",
    )
    # Where gravity is the reference the accelerometers stand among the block's own parameters, better known.
    accelerometers = (
        None if any(p.name.startswith("accelerometer") for p in parameters_of(result)) else found.accelerometers
    )
    sections = [] if accelerometers is None else [accelerometer_section(accelerometers, told=bool(result.missing))]
    return [first, *sections, *([] if found.gyros is None else [gyro_section(found.gyros)])]


def sampling_words(found: Inspection) -> str:
    """Rows, sampling, and what else the record has."""
    record, sampling = found.record, found.sampling
    kind = "rates" if record.rate is not None else "increments"
    length = float(record.time_s[-1] - record.time_s[0])
    lasted = f"{length:.0f} seconds" if length < 120.0 else f"{length / 60.0:.0f} minutes"
    said = f"{len(record)} rows of {kind} and specific forces within {lasted}, one every {sampling.period:.6g} s"
    if sampling.jitter_max > EVEN * sampling.period:
        said += f"; the time stamps stray by {sampling.jitter_rms:.2g} s rms, {sampling.jitter_max:.2g} s at most"
    if sampling.gaps:
        said += f"; {len(sampling.gaps)} gaps, {sampling.missing} rows missing"
    there = {"the temperature": record.temperature is not None, "the true attitude": record.attitude is not None}
    known = " and ".join(name for name, present in there.items() if present)
    return f"{said}. Known besides: {known}." if known else f"{said}."


def rest_words(found: Inspection) -> list[str]:
    """Rests, moves, excitation, and what noise leaves of a mean at rest."""
    rests = found.rests
    if not len(rests):
        return ["There are no rests: neither gyros nor accelerometers can be judged at rest."]
    lengths = np.array([(r.stop - r.start) * found.sampling.period for r in rests.rows])
    said = f"One rest of {lengths[0]:.2g} s"
    if len(rests) > 1:
        said = f"{len(rests)} rests of {lengths.min():.2g} to {lengths.max():.2g} s, half of them up to "
        said += f"{np.median(lengths):.2g} s"
    if len(found.moves):
        turns = np.degrees([move.turn_rad for move in found.moves])
        said += f"; {len(turns)} moves between them, of {turns.min():.0f} to " if len(turns) > 1 else "; one move of "
        said += f"{turns.max():.0f} degrees"
    rates = ", ".join(f"{math.degrees(value):.3g}" for value in found.excitation)
    said += f"; rates of {rates} deg/s (root mean square) about axes 1, 2, 3 outside the rests."
    lines = [said]
    quiet = [str(p + 1) for p in range(3) if found.excitation[p] < EXCITED * rests.noise[p]]
    if quiet:
        lines.append(f"The block was not turned about axis {', '.join(quiet)}.")
    if rests.force_bound is not None and rests.rate_bound is not None:
        force, rate = np.median(rests.force_bound, axis=0).max(), np.median(rests.rate_bound, axis=0).max()
        lines.append(
            f"Noise leaves the mean of a rest known to {force / found.gravity:.2g} g and {math.degrees(rate):.2g} "
            "deg/s (three Allan deviations of its length)."
        )
    return lines


def accelerometer_section(found: NormCalibration, *, told: bool) -> Section:
    """The accelerometers calibrated by the norm of gravity; `told` where the verdict says what is missing."""
    leaves = (
        "" if found.radius is None else f", whose least possible largest residual is {found.radius:.2g} of its bound"
    )
    said = {
        "consistent": f"At every rest the size of gravity must come out. Nine parameters explain the rests{leaves}.",
        "falsified": f"At every rest the size of gravity must come out. No nine parameters explain the rests{leaves}.",
        "insufficient": "The rests do not determine the accelerometers' nine parameters.",
    }[found.verdict]
    rows: list[list[Cell]] = []
    if found.least_squares is not None and found.low is not None and found.high is not None:
        errors = np.full(len(NAMES), np.nan) if found.standard_error is None else found.standard_error
        for name, value, error, low, high in zip(
            NAMES, found.least_squares, errors, found.low, found.high, strict=True
        ):
            half = 0.5 * float(high - low)
            ends = outwards(float(low), float(high), half)
            unit = "g" if name.startswith("bias") else "1"
            row: list[Cell] = [own_words(f"accelerometer {name}"), to_bound(float(value), half)]
            rows.append([*row, upwards(float(error)), *ends, unit_text(unit)])
    header = ["parameter", "least squares", "standard error", "low", "high", "unit"]
    missing = [f"Poses that would determine them: {'; '.join(found.missing)}."] if found.missing and not told else []
    table = Table(header, rows, "Low and high hold for any errors within the bounds.") if rows else None
    return Section("Accelerometers at rest", [said, *missing], table=table)


def gyro_section(found: GyrosAtRest) -> Section:
    """What the gyros do at rest."""
    said = GYROS[found.verdict].format("; ".join(model.title for model in found.standing))
    rows: list[list[Cell]] = [
        [
            model.title,
            significant(model.radius, 3),
            "–" if model.by_chance is None else Written(f"{100.0 * model.by_chance:.0f} %"),
        ]
        for model in found.tried
    ]
    header = ["model of the means", "largest residual over its bound", "shuffled rests that do as well"]
    more = [f"Not tried: {why}." for why in found.not_tried]
    return Section("Gyros at rest", [said, *more], table=Table(header, rows) if rows else None)
