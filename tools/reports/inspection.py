"""Pages of strapdown records: their content, the attitude from their gyros, a comparison of algorithms."""

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.bench import EARTH_RATE
from ..calibrated import Calibration
from ..document.blocks import Page, Section, Table, table_of
from ..document.notation import sentence, unit_text
from ..errors import InputError
from ..motion.attitude import AttitudeRun, split_error
from ..motion.compare import AttitudeComparison
from ..motion.inspect import EXCITED, AtTable, GyrosAtRest, Inspection, PosesSeen
from ..motion.rests import BY_CHANCE, FEWEST_FOR_NOISE, rest_warnings
from ..records.sigma import deviation_widening
from ..rounding import digits, downwards, exactly, outwards, residual, upwards
from .pictures.records import allan_picture, attitude_picture

DIGITS_OF_STAMPS = 1e-6
"""Relative jitter below which it is the rounding of the time stamps."""


def inspection_page(result: Inspection) -> Page:
    """Return the content of a strapdown or bench record, and its Allan deviation."""
    lines = sampling_lines(result) + rest_lines(result)
    first = lines.pop(0)
    if result.at_table is not None:
        lines.append(table_line(result.at_table))
    if result.gyros is not None:
        lines += gyro_lines(result.gyros)
    caption = "Allan deviation of the readings over the rests: what noise leaves of a mean of that length."
    answer = [Section("The record", lines, allan_picture(result), caption)]
    if result.accelerometers is not None:
        answer.append(_norm_section(result.accelerometers, gaps_named=True))
    return Page(f"Inspection of {result.record.path.name}", first, answer)


def table_line(at_table: AtTable) -> str:
    """Return the result of the accelerometers of a bench record against the table's angles."""
    verdict = at_table.verdict
    if verdict == "noise-unknown":
        verdict = "noise bound unknown"
    head = f"accelerometers against the table's angles: {verdict}"
    if at_table.radius is None or at_table.noise_bound is None:
        return f"{head}: {at_table.lacks}"
    return (
        f"{head}, {at_table.positions} positions, radius {residual(at_table.radius)}, "
        f"σ = {upwards(at_table.noise_bound, 3)} g "
        f"({at_table.noise_bound_basis}); `trihedron calibrate` gives the numbers"
    )


def sampling_lines(inspection: Inspection) -> list[str]:
    """Return rows, time stamps, and faults of columns, in lines."""
    record, sampling = inspection.record, inspection.sampling
    kind = "increments" if record.rate is None else "rates"
    length = float(record.time_s[-1] - record.time_s[0])
    jitter = f"jitter {digits(sampling.jitter_rms, 2)} s rms, {upwards(sampling.jitter_max)} s at most"
    if sampling.jitter_max < DIGITS_OF_STAMPS * sampling.period:
        jitter = "no jitter"
    lines = [
        f"{record.path.name}: {len(record)} rows of {kind} over {digits(length, 6)} s, "
        f"one every {exactly(sampling.period, 6)} s",
        f"time stamps: {jitter}; gaps: {len(sampling.gaps)}, {sampling.missing} rows missing; nothing is resampled",
    ]
    for gap in sampling.gaps[:5]:
        lines.append(f"gap of {digits(gap.length_s, 4)} s after {digits(gap.time_s, 6)} s")
    lines += inspection.seen.warnings
    lines += sampling.lines
    for name in sampling.dead:
        lines.append(f"{name}: dead, it never changes")
    lines.append("temperature: not in the record" if record.temperature is None else "temperature: in the record")
    return [*lines, *inspection.trust.faults, *inspection.trust.warnings]


def rest_lines(inspection: Inspection) -> list[str]:
    """Return rests, moves, excitation, and the noise of a mean at rest, in lines."""
    rests = inspection.rests
    if not len(rests):
        return ["no rests: neither gyros nor accelerometers can be judged at rest"]
    head = f"{len(rests)} rests {span_of(rests.length_s)} s, median {digits(np.median(rests.length_s))} s"
    if len(rests) == 1:
        head = f"1 rest {span_of(rests.length_s)} s"
    if rests.turning:
        head += f"; {rests.turning} slow turns left out"
    lines = [head]
    lines += rest_warnings(rests, inspection.gravity)
    lines += pose_lines(inspection.poses)
    if len(inspection.moves):
        turns = np.degrees([move.turn_rad for move in inspection.moves])
        lines.append(f"{len(turns)} moves between them, {span_of(turns)} degrees")
    rates, quiet = [], []
    for axis, (excitation, noise) in enumerate(zip(inspection.excitation, rests.noise[:3], strict=True), start=1):
        rates.append(digits(math.degrees(excitation)))
        if excitation < EXCITED * noise:
            quiet.append(str(axis))
    lines.append(f"rates between the rests: {', '.join(rates)} deg/s rms about axes 1, 2, 3")
    if quiet:
        lines.append(f"not excited: axis {', '.join(quiet)}")
    if rests.force_scatter is None or rests.rate_scatter is None:
        lines.append("the rests are too short to tell the noise of their means")
        return lines
    if rests.force_bound is None or rests.rate_bound is None:
        lines.append(f"the noise of a mean at rest needs {FEWEST_FOR_NOISE} rests")
        return lines
    widening = deviation_widening(len(rests), BY_CHANCE)
    force = np.median(rests.force_bound, axis=0).max() / inspection.gravity
    rate = math.degrees(np.median(rests.rate_bound, axis=0).max())
    lines.append(
        f"bound of a mean at rest, 3 Allan deviations, widened by {upwards(widening)} for the number of rests: "
        f"{upwards(force)} g, {upwards(rate)} deg/s"
    )
    return lines


def pose_lines(poses: PosesSeen | None) -> list[str]:
    """Return lines on the predicted errors by the poses of the rests, and on missing poses."""
    if poses is None:
        return []
    line = f"predicted error of |f| in the worst pose: {digits(1e3 * poses.worst_error_g, 2)} mg (1 standard error)"
    if not poses.missing:
        return [f"{line}: the poses are enough"]
    after = digits(1e3 * poses.error_with_these_g, 2)
    return [
        line,
        f"missing poses, with which it is {after} mg: {'; '.join(poses.missing)}",
    ]


def span_of(values: NDArray) -> str:
    """Return the least and the largest of values, or the only one."""
    least, largest = float(values.min()), float(values.max())
    return f"of {' to '.join(outwards(least, largest))}" if least < largest else f"of {digits(least)}"


def norm_page(result: Calibration, _: object = None) -> Page:
    """Return the accelerometers calibrated by the norm of gravity."""
    return Page("Accelerometers by the norm of gravity", _norm_summary(result), [_norm_section(result)])


def _norm_summary(result: Calibration) -> str:
    """Return the verdict on the accelerometers, and the radius if there is one."""
    radius = "" if result.radius is None else f", radius {residual(result.radius)}"
    return f"accelerometers, by |f| = g at rest: {result.verdict}{radius}"


def _norm_section(result: Calibration, *, gaps_named: bool = False) -> Section:
    """Return the nine parameters that explain the size of gravity at every rest; `gaps_named`: elsewhere."""
    paragraphs = [
        "At every rest |f| must equal gravity. Nine parameters are fitted to the rests.",
        sentence(_norm_summary(result)),
    ]
    if result.open and not gaps_named:
        poses = [direction.close_by for direction in result.open]
        paragraphs.append(f"Poses that are missing: {'; '.join(poses)}.")
    table = None
    if all(p.bounded for p in result.parameters):
        columns = ("name", "central", "standard_error", "low", "high", "unit")
        words = {"name": lambda name: own_words(f"accelerometer {name}"), "unit": unit_text}
        rows = table_of(result.parameters, columns, words)
        table = Table(rows.header, rows.rows, "Low and high hold for any errors within the bounds.")
    return Section("Accelerometers at rest", paragraphs, table=table)


GYRO_VERDICTS = {
    "constant": "constant",
    "named": "",
    "ambiguous": "several models do: ",
    "wandering": "not constant, and the record supports no explanation",
    "insufficient": "insufficient, too few rests",
}


def gyro_lines(gyros: GyrosAtRest) -> list[str]:
    """Return the model of the gyros' means at rest, in lines."""
    summary = GYRO_VERDICTS[gyros.verdict]
    if gyros.verdict in ("named", "ambiguous"):
        summary += "; ".join([model.title for model in gyros.standing])
    lines = [f"gyros at rest: {summary}"]
    for model in gyros.tried:
        line = f"  {model.title}: radius {residual(model.radius)}"
        if model.by_chance is not None:
            line += f", as good for {digits(100.0 * model.by_chance)} % of shuffled rests"
        lines.append(line)
    for reason in gyros.not_tried:
        lines.append(f"  not tried, {reason}")
    return lines


def record_sections(
    inspection: Inspection, warnings: Sequence[str] = (), *, forces: bool, gaps_named: bool
) -> list[Section]:
    """Return the record, and the results at rest for gyros and, with `forces`, accelerometers.

    `gaps_named`: another section names the missing measurements.
    """
    lines = sampling_lines(inspection) + rest_lines(inspection)
    lines[0] = lines[0].removeprefix(f"{inspection.record.path.name}: ")
    if inspection.record.attitude is not None:
        lines.append("true attitude: in the record")
    lines += [f"warning: {warning}" for warning in warnings if warning not in lines]
    first = Section(
        "Measurements",
        list(map(sentence, dict.fromkeys(lines))),
        allan_picture(inspection),
        "Allan deviation of the readings over the rests: what noise leaves of a mean of that length.",
    )
    sections = [first]
    if inspection.accelerometers is not None and forces:
        sections.append(_norm_section(inspection.accelerometers, gaps_named=gaps_named))
    if inspection.gyros is not None:
        sections.append(_gyros(inspection.gyros))
    return sections


def _gyros(gyros: GyrosAtRest) -> Section:
    """Return the models of the gyros' means at rest, and the fit of each."""
    paragraphs = [sentence(gyro_lines(gyros)[0])]
    for reason in gyros.not_tried:
        paragraphs.append(sentence(f"not tried: {reason}"))
    rows = []
    for model in gyros.tried:
        chance = None if model.by_chance is None else digits(100.0 * model.by_chance)
        rows.append([model.title, residual(model.radius), chance])
    header = ["model of the means", "largest residual over its bound", "shuffled rests that do as well [%]"]
    table = Table(header, rows)
    return Section("Gyros at rest", paragraphs, table=table)


HOW_RATES_ARE_TAKEN = {
    "instantaneous": "instantaneous rates, trapezoid rule",
    "averaged": "rates averaged over their intervals",
    "increments": "increments as measured",
}


def attitude_page(run: AttitudeRun) -> Page:
    """Return the run and the size of its error."""
    lines = error_lines(run)
    for file in run.files:
        lines.append(str(file))
    picture = None if run.rms is None else attitude_picture(run)
    answer = [Section("Attitude", lines, picture, "The computed attitude less the true one.")]
    return Page(f"Attitude of {run.record.name}", run_line(run), answer)


def run_line(run: AttitudeRun) -> str:
    """Return the record, its length and rate, and the algorithm."""
    duration = digits(run.time_s[-1] - run.time_s[0], 4)
    rate = digits(1.0 / run.period, 4)
    how = HOW_RATES_ARE_TAKEN[run.rates]
    error = "" if run.rms is None else f", error {digits(math.degrees(run.rms))} deg rms"
    return f"{run.record.name}: {duration} s at {rate} Hz, algorithm {run.algorithm}, {how}{error}"


def error_lines(run: AttitudeRun) -> list[str]:
    """Return the cautions, the velocity and the error against the true attitude, in lines."""
    lines = care_lines(run)
    if run.velocity_at_end is not None:
        velocity = ", ".join([digits(value, 6) for value in run.velocity_at_end])
        lines.append(f"velocity at the end, of the specific force alone, in the reference: ({velocity}) m/s")
    rms, maximum, final, drift = run.rms, run.maximum, run.final, run.drift
    if rms is None or maximum is None or final is None or drift is None:
        lines.append("attitude error: the record has no true attitude to compare with")
        return lines
    judged = run.judged
    if run.gyro_bias is None:
        earth = math.degrees(EARTH_RATE * (run.time_s[judged][-1] - run.time_s[0]))
        lines.append(
            f"rates as measured: neither the gyros' bias nor Earth's rotation ({digits(earth)} deg over this time) "
            "is taken out"
        )
    else:
        bias = ", ".join([digits(math.degrees(value), 4) for value in run.gyro_bias])
        lines.append(f"a gyro bias of ({bias}) deg/s is taken out of the rates")
    lines.append(
        f"attitude error over {int(judged.sum())} updates: {digits(math.degrees(rms))} deg rms, "
        f"{upwards(math.degrees(maximum), 3)} deg at most, {digits(math.degrees(final))} deg at the end, "
        f"drift {digits(60.0 * math.degrees(drift))} deg/min"
    )
    if run.heading is not None and run.tilt is not None:
        heading, tilt = rms_degrees(run.heading[judged]), rms_degrees(run.tilt[judged])
        lines.append(f"of it heading {digits(heading)} deg rms, tilt {digits(tilt)} deg rms")
    return lines + split_lines(run)


def rms_degrees(angles: NDArray) -> float:
    """Return the root mean square of angles [rad] in degrees."""
    return math.degrees(float(np.sqrt(np.mean(angles**2))))


def distrust(run: AttitudeRun | AttitudeComparison, name: str) -> str:
    """Return one line if a gyro of the record of that name is at its limit; else an empty string."""
    if run.trusted_until is None:
        return ""
    return f"{name}: attitudes after {downwards(run.trusted_until, 9)} s are not to be trusted: a gyro is at its limit"


def care_lines(run: AttitudeRun | AttitudeComparison) -> list[str]:
    """Return lines on the effect of stamps, gyro limits and bridged gaps on the attitude."""
    lines = list(run.warnings)
    if run.trusted_until is not None:
        limits = [line for line in run.warnings if line.startswith("w")]
        lines = [line for line in run.warnings if line not in limits]
        lines.insert(0, f"not to be trusted after {downwards(run.trusted_until, 9)} s: {'; '.join(limits)}")
    if run.bridged_bound:
        lines.append(f"bridged gaps turn the attitude by at most {upwards(math.degrees(run.bridged_bound), 3)} deg")
    return lines


def split_lines(run: AttitudeRun) -> list[str]:
    """Return the error as a slowly growing and a periodic part; empty if the run is too short to separate them."""
    judged = run.judged
    try:
        split = split_error(run.time_s[judged], np.degrees(run.error_rad[judged]))
    except InputError:
        return []
    rates, amplitudes = [], []
    for rate, amplitude in zip(split.rate, split.amplitude, strict=True):
        rates.append(digits(60.0 * rate))
        amplitudes.append(upwards(amplitude, 3))
    return [
        f"slowly growing part ({', '.join(rates)}) deg/min, periodic part at most ({', '.join(amplitudes)}) deg "
        f"about axes 1, 2, 3 (period {exactly(split.period, 3)} s)"
    ]


def attitude_comparison_page(result: AttitudeComparison) -> Page:
    """Return the comparison of attitude algorithms, a row for each."""
    columns = ("algorithm", "order", "updates", "rows_left_out", "apart", "rms", "maximum", "refused")
    words = {"refused": lambda text: text or None}
    table = table_of(result.algorithms, columns, words)
    worst = max(result.algorithms, key=lambda algorithm: algorithm.apart or 0.0)
    verdict = (
        f"{len(result.algorithms)} algorithms; farthest from {result.reference}: {worst.algorithm}, "
        f"{digits(math.degrees(worst.apart or 0.0))}°."
    )
    return Page("Attitude algorithms", verdict, [Section("Algorithms", table=table)], warnings=care_lines(result))


_OWN = re.compile(r"(?P<sensor>accelerometer|gyro) (?P<kind>gamma|bias)_(?P<first>\d)(?P<second>\d?)")


def own_words(name: str) -> str:
    """Return a parameter of the block in words: "gyro gamma_12" is the misalignment of gyro 1 towards axis 2."""
    match = _OWN.fullmatch(name)
    if match is None:
        return name
    sensor = f"{match['sensor']} {match['first']}"
    if match["kind"] == "bias":
        return f"bias of {sensor}"
    same = match["first"] == match["second"]
    return f"scale factor of {sensor}" if same else f"misalignment of {sensor} towards axis {match['second']}"
