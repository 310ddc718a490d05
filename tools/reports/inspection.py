"""What strapdown records say: what they support, the attitude that their gyros give, how algorithms compare."""

import math
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...models.effects.definition import matrix_formula
from ...models.turntable import EARTH_RATE
from ..calibrated import Calibration
from ..diagnosis.result import Diagnosis
from ..document.blocks import Section, Table
from ..document.notation import Cell, half_width, sentence, unit_text
from ..errors import InputError
from ..motion.attitude import AttitudeRun, split_error
from ..motion.compare import AttitudeComparison
from ..motion.inspect import EXCITED, AtTable, GyrosAtRest, Inspection
from ..motion.norm import COLUMNS, ROWS
from ..motion.rests import rest_warnings
from ..rounding import Number, digits, downwards, exactly, interval, outwards, residual, upwards
from .bench import Value, number, section_of_model
from .pictures.records import allan_picture, attitude_picture

DIGITS_OF_STAMPS = 1e-6
"""Jitter of so small a part of the period is in the last digits of the time stamps."""


def inspection_lines(found: Inspection) -> list[str]:
    """What `trihedron inspect` prints."""
    lines = [*sampling_lines(found), *rest_lines(found)]
    if found.accelerometers is not None:
        lines += accelerometer_lines(found.accelerometers)
    if found.at_table is not None:
        lines.append(table_line(found.at_table))
    return lines if found.gyros is None else [*lines, *gyro_lines(found.gyros)]


def table_line(found: AtTable) -> str:
    """The accelerometers of a bench record against the table's angles."""
    said = f"accelerometers against the table's angles: {found.verdict}"
    if found.radius is None or found.noise_bound is None:
        return f"{said}: {found.lacks}"
    return (
        f"{said}, {found.positions} positions, radius {residual(found.radius)}, σ = {upwards(found.noise_bound, 3)} g "
        f"({found.noise_bound_basis}); `trihedron calibrate` gives the numbers"
    )


def sampling_lines(found: Inspection) -> list[str]:
    """Rows, time stamps, and what is wrong with columns."""
    record, sampling = found.record, found.sampling
    kind = "rates" if record.rate is not None else "increments"
    length = float(record.time_s[-1] - record.time_s[0])
    jitter = f"jitter {digits(sampling.jitter_rms, 2)} s rms, {upwards(sampling.jitter_max)} s at most"
    if sampling.jitter_max < DIGITS_OF_STAMPS * sampling.period:
        jitter = "no jitter"
    lines = [
        f"{record.path.name}: {len(record)} rows of {kind} over {digits(length, 6)} s, "
        f"one every {exactly(sampling.period, 6)} s",
        f"time stamps: {jitter}; {len(sampling.gaps)} gaps, {sampling.missing} rows missing; nothing is resampled",
    ]
    lines += [f"gap of {digits(gap.length_s, 4)} s after {digits(gap.time_s, 6)} s" for gap in sampling.gaps[:5]]
    lines += [*found.seen.warnings, *sampling.lines]
    lines += [f"{name}: dead, it never changes" for name in sampling.dead]
    lines.append("temperature: " + ("in the record" if record.temperature is not None else "not in the record"))
    return lines + [f"units and axes: {said}" for said in found.turning.said]


def rest_lines(found: Inspection) -> list[str]:
    """Rests, moves, excitation, and what noise leaves of a mean at rest."""
    rests = found.rests
    if not len(rests):
        return ["no rests: neither gyros nor accelerometers can be judged at rest"]
    lengths = rests.length_s
    lines = [f"{len(rests)} rests {span_of(lengths)} s, median {digits(np.median(lengths))} s"]
    if rests.turning:
        lines[0] += f"; {rests.turning} slow turns left out"
    lines += rest_warnings(rests, found.gravity)
    if len(found.moves):
        turns = np.degrees([move.turn_rad for move in found.moves])
        lines.append(f"{len(turns)} moves between them, {span_of(turns)} degrees")
    quiet = [str(p + 1) for p in range(3) if found.excitation[p] < EXCITED * rests.noise[p]]
    rates = ", ".join(digits(math.degrees(value)) for value in found.excitation)
    lines.append(f"rates between the rests: {rates} deg/s rms about axes 1, 2, 3")
    if quiet:
        lines.append(f"not excited: axis {', '.join(quiet)}")
    if rests.force_bound is None or rests.rate_bound is None:
        lines.append("the rests are too short to tell the noise of their means")
    else:
        force, rate = np.median(rests.force_bound, axis=0).max(), np.median(rests.rate_bound, axis=0).max()
        lines.append(
            f"bound of a mean at rest, 3 Allan deviations: {upwards(force / found.gravity)} g, "
            f"{upwards(math.degrees(rate))} deg/s"
        )
    return lines


def span_of(values: np.ndarray) -> str:
    """The least and the largest of values, or the only one."""
    least, most = float(values.min()), float(values.max())
    return f"of {' to '.join(outwards(least, most))}" if least < most else f"of {digits(least)}"


def accelerometer_lines(found: Calibration) -> list[str]:
    """The accelerometers calibrated by the norm of gravity."""
    lines = [f"accelerometers by the norm of gravity: {found.verdict}"]
    if found.radius is not None:
        lines[0] += f", radius {residual(found.radius)}"
    if found.open:
        lines.append("poses that are missing: " + "; ".join(direction.close_by for direction in found.open))
    if all(p.bounded for p in found.parameters):
        lines.append("            least squares            guaranteed")
        for p in found.parameters:
            value, low, high = interval(p.estimate, p.low, p.high)
            error = "" if p.standard_error is None else f"± {upwards(p.standard_error)}"
            lines.append(f"  {p.name:9} {value:>10} {error:<10} {low:>10} to {high:>10}")
    return lines


def gyro_lines(found: GyrosAtRest) -> list[str]:
    """What the gyros' means at rest do."""
    said = {
        "constant": "constant",
        "named": "",
        "ambiguous": "several models do: ",
        "wandering": "not constant, but nothing is supported that would explain it",
        "insufficient": "insufficient, too few rests",
    }[found.verdict]
    if found.verdict in ("named", "ambiguous"):
        said += "; ".join(model.title for model in found.standing)
    lines = [f"gyros at rest: {said}"]
    for model in found.tried:
        chance = (
            "" if model.by_chance is None else f", as good for {digits(100.0 * model.by_chance)} % of shuffled rests"
        )
        lines.append(f"  {model.title}: radius {residual(model.radius)}{chance}")
    return lines + [f"  not tried, {why}" for why in found.not_tried]


def record_sections(found: Inspection, warnings: Sequence[str] = (), *, forces: bool, told: bool) -> list[Section]:
    """The record, and what its rests say of accelerometers, with `forces`, and gyros.

    `told` where it is said elsewhere what is missing.
    """
    size, *more = sampling_lines(found)
    lines = [size.removeprefix(f"{found.record.path.name}: "), *more, *rest_lines(found)]
    lines += ["true attitude: in the record"] if found.record.attitude is not None else []
    lines += [f"warning: {warning}" for warning in warnings if warning not in lines]
    first = Section(
        "What was measured",
        list(map(sentence, dict.fromkeys(lines))),
        allan_picture(found),
        "Allan deviation of the readings over the rests: what noise leaves of a mean of that length.",
    )
    sections = [] if found.accelerometers is None or not forces else [_accelerometers(found.accelerometers, told=told)]
    return [first, *sections, *([] if found.gyros is None else [_gyros(found.gyros)])]


def _accelerometers(found: Calibration, *, told: bool) -> Section:
    rows: list[list[Cell]] = []
    for p in found.parameters if all(p.bounded for p in found.parameters) else ():
        value, *ends = interval(p.estimate, p.low, p.high)
        name = own_words(f"accelerometer {p.name}")
        rows.append([name, value, upwards(p.standard_error), *ends, unit_text(p.unit)])
    said, *missing = accelerometer_lines(found)[: 2 if found.open and not told else 1]
    explained = "At every rest the size of gravity must come out; nine parameters explain the rests, or none do."
    header = ["parameter", "least squares", "standard error", "low", "high", "unit"]
    table = Table(header, rows, "Low and high hold for any errors within the bounds.") if rows else None
    return Section("Accelerometers at rest", [explained, *map(sentence, [said, *missing])], table=table)


def _gyros(found: GyrosAtRest) -> Section:
    said, *_ = gyro_lines(found)
    rows: list[list[Cell]] = [
        [
            model.title,
            residual(model.radius),
            None if model.by_chance is None else Number(f"{digits(100.0 * model.by_chance)} %"),
        ]
        for model in found.tried
    ]
    header = ["model of the means", "largest residual over its bound", "shuffled rests that do as well"]
    more = [sentence(f"not tried: {why}") for why in found.not_tried]
    return Section("Gyros at rest", [sentence(said), *more], table=Table(header, rows).told() if rows else None)


def attitude_lines(run: AttitudeRun) -> list[str]:
    """Lines for a person: what was run, and how large the error is."""
    span = run.time_s[-1] - run.time_s[0]
    how = {
        "instantaneous": "instantaneous rates, trapezoid rule",
        "averaged": "rates averaged over their intervals",
    }
    lines = [
        f"{run.record.name}: {digits(span, 4)} s at {digits(1.0 / run.period, 4)} Hz, algorithm {run.algorithm}, "
        f"{how.get(run.rates, 'increments as measured')}"
    ]
    lines += care_lines(run)
    if run.velocity_at_end is not None:
        velocity = ", ".join(digits(value, 6) for value in run.velocity_at_end)
        lines.append(f"velocity at the end, of the specific force alone, in the reference: ({velocity}) m/s")
    rms, maximum, final, drift = run.rms, run.maximum, run.final, run.drift
    if rms is None or maximum is None or final is None or drift is None:
        return [*lines, "attitude error: the record has no true attitude to compare with"]
    known = run.judged
    if run.gyro_bias is None:
        earth = math.degrees(EARTH_RATE * (run.time_s[known][-1] - run.time_s[0]))
        lines.append(
            f"rates as measured: neither the gyros' bias nor Earth's rotation ({digits(earth)} deg over this time) "
            "is taken out"
        )
    else:
        bias = ", ".join(digits(math.degrees(value), 4) for value in run.gyro_bias)
        lines.append(f"a gyro bias of ({bias}) deg/s is taken out of the rates")
    lines.append(
        f"attitude error over {int(known.sum())} updates: {digits(math.degrees(rms))} deg rms, "
        f"{upwards(math.degrees(maximum), 3)} deg at most, {digits(math.degrees(final))} deg at the end, "
        f"drift {digits(60.0 * math.degrees(drift))} deg/min"
    )
    if run.heading is not None and run.tilt is not None:
        heading, tilt = (float(np.sqrt(np.mean(part[known] ** 2))) for part in (run.heading, run.tilt))
        lines.append(
            f"of it heading {digits(math.degrees(heading))} deg rms, tilt {digits(math.degrees(tilt))} deg rms"
        )
    return lines + split_lines(run)


def distrust(run: AttitudeRun | AttitudeComparison, name: str) -> str:
    """One line, where a gyro of the record of that name is at its limit; else nothing."""
    if run.trusted_until is None:
        return ""
    return f"{name}: attitudes after {downwards(run.trusted_until, 9)} s are not to be trusted: a gyro is at its limit"


def care_lines(run: AttitudeRun | AttitudeComparison) -> list[str]:
    """What stamps, limits of the gyros and bridged gaps mean for the attitude."""
    lines = list(run.warnings)
    if run.trusted_until is not None:
        limits = [line for line in run.warnings if line.startswith("w")]
        lines = [line for line in run.warnings if line not in limits]
        lines.insert(0, f"not to be trusted after {downwards(run.trusted_until, 9)} s: {'; '.join(limits)}")
    if run.bridged_bound:
        lines.append(f"bridged gaps turn the attitude by at most {upwards(math.degrees(run.bridged_bound), 3)} deg")
    return lines


def split_lines(run: AttitudeRun) -> list[str]:
    """The error as a slowly growing and a periodic part; nothing where the run is too short to tell them apart."""
    known = run.judged
    try:
        split = split_error(run.time_s[known], np.degrees(run.error_rad[known]))
    except InputError:
        return []
    rate = ", ".join(digits(60.0 * value) for value in split.rate)
    amplitude = ", ".join(upwards(value, 3) for value in split.amplitude)
    return [
        f"slowly growing part ({rate}) deg/min, periodic part at most ({amplitude}) deg about axes 1, 2, 3 "
        f"(period {exactly(split.period, 3)} s)"
    ]


def attitude_section(runs: Sequence[AttitudeRun]) -> Section:
    """Attitude errors of a measured record, a row for each run; the picture is that of the last."""
    shown = runs[-1]
    rows: list[list[Cell]] = []
    for run in runs:
        bias = "none" if run.gyro_bias is None else ", ".join(digits(np.degrees(value)) for value in run.gyro_bias)
        known = [None if part is None else part[run.judged] for part in (run.heading, run.tilt)]
        parts = [None if part is None else float(np.sqrt(np.mean(part**2))) for part in known]
        drift = None if run.drift is None else 60.0 * run.drift
        figures = [None if v is None else math.degrees(v) for v in (run.rms, run.maximum, run.final, drift, *parts)]
        rms, largest, *others = figures
        rows.append([Number(bias), digits(rms), upwards(largest, 3), *map(digits, others)])
    names = ["rms [deg]", "largest [deg]", "at the end [deg]", "drift [deg/min]", "heading rms [deg]", "tilt rms [deg]"]
    return Section(
        "A measured strapdown record",
        [f"{attitude_lines(shown)[0]}.", *map(sentence, [*care_lines(shown), *split_lines(shown)])],
        attitude_picture(shown),
        "Attitude from the measured gyros, "
        + ("" if shown.gyro_bias is None else "their bias at rest taken out, ")
        + "less the true attitude.",
        Table(["gyro bias taken out [deg/s]", *names], rows) if shown.rms is not None else None,
        files=[file for run in runs for file in run.files],
    )


def comparison_lines(found: AttitudeComparison) -> list[str]:
    """The comparison as lines for a person, angles in degrees."""

    def degrees(angle: float | None, width: int, how: Callable[..., str] = digits) -> str:
        return f"{'-' if angle is None else how(math.degrees(angle), 3):>{width}}"

    width = max(len(row.algorithm) for row in found.algorithms)
    lines = care_lines(found)
    lines += [f"{'algorithm':{width}}  order  updates  from {found.reference}  error rms  error max   [deg]"]
    for row in found.algorithms:
        start = f"{row.algorithm:{width}}  {row.order:5d}"
        if row.refused:
            lines.append(f"{start}  not taken: {row.refused}")
        else:
            angles = "  ".join((degrees(row.apart, 20), degrees(row.rms, 9), degrees(row.maximum, 9, upwards)))
            lines.append(f"{start}  {row.updates:7d}  {angles}")
    return lines


# The model of a block that is carried

AXES = ("1", "2", "3")
_OWN = re.compile(r"(?P<sensor>accelerometer|gyro) (?P<kind>gamma|bias)_(?P<first>\d)(?P<second>\d?)")


def own_words(name: str) -> str:
    """A parameter of the block in words: "gyro gamma_12" is the misalignment of gyro 1 towards axis 2."""
    match = _OWN.fullmatch(name)
    if match is None:
        return name
    sensor = f"{match['sensor']} {match['first']}"
    if match["kind"] == "bias":
        return f"bias of {sensor}"
    same = match["first"] == match["second"]
    return f"scale factor of {sensor}" if same else f"misalignment of {sensor} towards axis {match['second']}"


def carried_section(result: Diagnosis) -> Section:
    """The model of a block that is carried: block, attitude and effects, where the result names them."""
    values: dict[str, Value] = {
        p.name: (p.estimate, half_width(p.low, p.high)) for p in result.baseline.parameters or ()
    }
    gravity = result.reference == "gravity"
    free = "biases, scale factors and misalignments" if result.baseline_model == "calibrated" else "biases"
    own = f"whose {free} are free to be what the record says"
    if result.bias_at_rest is not None:
        own = "taken as delivered: their mean at rest is taken out, and nothing else"
    said = [
        f"A block of three gyros{' and three accelerometers' if gravity else ''}, {own}. Its readings "
        "are taken back to rates by the inverse of these equations, and the rates carry the attitude q. n is the "
        "specific force in units of g, ω the rate in rad/s, both in the block's axes."
    ]
    if values:
        said.append("Numbers are rounded to what their intervals justify.")
    forces = f"f/g = n + {_triangle(values)} n + {_vector('accelerometer bias', values)} + Δf/g"
    lines = [_read(result, values), "dq/dt = q ∘ ω / 2"]
    if gravity:
        lines = [forces, *lines, "n 'at rest' = q⁻ ∘ up ∘ q"]
    return section_of_model(said, lines, result.causes if result.verdict == "explained" else ())


def _read(result: Diagnosis, values: Mapping[str, Value]) -> str:
    """What the gyros read."""
    terms = ["ω_read = ω"]
    if "gyro gamma_11" in values:
        own = {f"gamma_{p}{q}": number(values[f"gyro gamma_{p}{q}"]) for p in AXES for q in AXES}
        terms.append(f"+ {matrix_formula('gamma', AXES).format(**own)} ω")
    if result.bias_at_rest is not None:
        bounds = result.evidence.found.rests.rate_bound
        near = [None] * 3 if bounds is None else [float(b) for b in np.median(bounds, axis=0)]
        # It is no parameter that is fitted: the noise at rest says how well it is known.
        at_rest = {f"gyro bias_{p + 1}": (float(result.bias_at_rest.radps[p]), near[p]) for p in range(3)}
        terms.append(f"+ {_vector('gyro bias', at_rest)}")
    elif "gyro bias_1" in values:
        terms.append(f"+ {_vector('gyro bias', values)}")
    return " ".join([*terms, "+ Δω"])


def _vector(name: str, values: Mapping[str, Value]) -> str:
    """Three numbers, one for each axis."""
    return f"({', '.join(number(values.get(f'{name}_{p}', (None, None))) for p in AXES)})"


def _triangle(values: Mapping[str, Value]) -> str:
    """The accelerometers' matrix: its first axis is the first accelerometer's, so that nothing stands above."""
    below = {(int(r), int(c)) for r, c in zip(ROWS, COLUMNS, strict=True)}
    rows = (
        " ; ".join(
            number(values.get(f"accelerometer gamma_{r + 1}{c + 1}", (None, None))) if (r, c) in below else "0"
            for c in range(3)
        )
        for r in range(3)
    )
    return f"[{' | '.join(rows)}]"
