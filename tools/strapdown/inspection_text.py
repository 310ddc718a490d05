"""What `trihedron inspect` says of a strapdown record."""

import math

import numpy as np

from .inspection import EXCITED, Inspection
from .norm_calibration import NAMES
from .rests import Rests

DIGITS_OF_STAMPS = 1e-6
"""Jitter of so small a part of the period is in the last digits of the time stamps."""


def inspection_text(found: Inspection) -> str:
    """What `trihedron inspect` prints."""
    return "\n".join([*_sampling_lines(found), *_rest_lines(found), *_accelerometer_lines(found), *_gyro_lines(found)])


def _sampling_lines(found: Inspection) -> list[str]:
    record, sampling = found.record, found.sampling
    kind = "rates" if record.rate is not None else "increments"
    length = float(record.time_s[-1] - record.time_s[0])
    jitter = f"jitter {sampling.jitter_rms:.2g} s rms, {sampling.jitter_max:.2g} s at most"
    if sampling.jitter_max < DIGITS_OF_STAMPS * sampling.period:
        jitter = "no jitter"
    lines = [
        f"{record.path.name}: {len(record)} rows of {kind} over {length:.6g} s, one every {sampling.period:.6g} s",
        f"time stamps: {jitter}; {len(sampling.gaps)} gaps, {sampling.missing} rows missing; nothing is resampled",
    ]
    lines += [f"gap of {size:.4g} s after {time:.6g} s" for time, size in sampling.gaps[:5]]
    lines += [f"{name}: {rows} rows are saturated" for name, rows in sampling.saturated.items()]
    lines += [f"{name}: dead, it never changes" for name in sampling.dead]
    lines.append("temperature: " + ("in the record" if record.temperature is not None else "not in the record"))
    return lines + [f"units and axes: {said}" for said in found.turning.said]


def rest_warnings(rests: Rests, gravity: float) -> list[str]:
    """What a person should know of the accelerometers at rest: limits and steps."""
    said = [f"rests with an accelerometer at its limit: {rests.clipped}, left out"] if rests.clipped else []
    for p in np.flatnonzero(rests.step):
        said.append(
            f"f{p + 1} reads in steps of {rests.step[p] / gravity:.2g} g: half of one counts in its means' bounds"
        )
    return said


def _rest_lines(found: Inspection) -> list[str]:
    rests = found.rests
    if not len(rests):
        return ["no rests: neither gyros nor accelerometers can be judged at rest"]
    lengths = np.array([(r.stop - r.start) * found.sampling.period for r in rests.rows])
    lines = [f"{len(rests)} rests of {lengths.min():.2g} to {lengths.max():.2g} s, median {np.median(lengths):.2g} s"]
    if rests.turning:
        lines[0] += f"; {rests.turning} slow turns left out"
    lines += rest_warnings(rests, found.gravity)
    if len(found.moves):
        turns = np.degrees(found.moves[:, 1])
        lines.append(f"{len(turns)} moves between them, of {turns.min():.3g} to {turns.max():.3g} degrees")
    quiet = [str(p + 1) for p in range(3) if found.excitation[p] < EXCITED * rests.noise[p]]
    rates = ", ".join(f"{math.degrees(value):.3g}" for value in found.excitation)
    lines.append(f"rates between the rests: {rates} deg/s rms about axes 1, 2, 3")
    if quiet:
        lines.append(f"not excited: axis {', '.join(quiet)}")
    if rests.force_bound is None or rests.rate_bound is None:
        lines.append("the rests are too short to tell the noise of their means")
    else:
        force, rate = np.median(rests.force_bound, axis=0).max(), np.median(rests.rate_bound, axis=0).max()
        lines.append(
            f"bound of a mean at rest, 3 Allan deviations: {force / found.gravity:.2g} g, "
            f"{math.degrees(rate):.2g} deg/s"
        )
    return lines


def _accelerometer_lines(found: Inspection) -> list[str]:
    calibration = found.accelerometers
    if calibration is None:
        return []
    lines = [f"accelerometers by the norm of gravity: {calibration.verdict}"]
    if calibration.radius is not None:
        lines[0] += f", radius {calibration.radius:.3g}"
    if calibration.missing:
        lines.append("poses that are missing: " + "; ".join(calibration.missing))
    if calibration.least_squares is not None and calibration.low is not None and calibration.high is not None:
        error = np.full(9, np.nan) if calibration.standard_error is None else calibration.standard_error
        rows = zip(NAMES, calibration.least_squares, error, calibration.low, calibration.high, strict=True)
        lines.append("            least squares            guaranteed")
        lines += [f"  {name:9} {x:+.5f} ± {e:.5f}   {low:+.5f} to {high:+.5f}" for name, x, e, low, high in rows]
    return lines


def _gyro_lines(found: Inspection) -> list[str]:
    gyros = found.gyros
    if gyros is None:
        return []
    said = {
        "constant": "constant",
        "named": "",
        "ambiguous": "several models do: ",
        "wandering": "not constant, but nothing is supported that would explain it",
        "insufficient": "insufficient, too few rests",
    }[gyros.verdict]
    if gyros.verdict in ("named", "ambiguous"):
        said += "; ".join(model.title for model in gyros.standing)
    lines = [f"gyros at rest: {said}"]
    for model in gyros.tried:
        chance = "" if model.by_chance is None else f", as good for {100.0 * model.by_chance:.0f} % of shuffled rests"
        lines.append(f"  {model.title}: radius {model.radius:.3g}{chance}")
    return lines + [f"  not tried, {why}" for why in gyros.not_tried]
