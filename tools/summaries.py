"""What commands print for people."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..models.effects import CATALOGUE
from .calibration import Calibration
from .calibration.correction import ARCSEC, Application, Correction, correction_of, face_readings, levelling
from .check import Check
from .diagnosis import Cause, Diagnosis
from .errors import InputError
from .result import Result

VERDICTS = {
    "consistent": "consistent: the model explains the record within the noise bound",
    "falsified": "falsified: no parameters of the model keep every reading within the noise bound",
    "insufficient": "insufficient: the record cannot determine everything that is asked",
    "explained": "explained: a smallest set of effects makes the model consistent, and no other does",
    "ambiguous": "ambiguous: several sets of effects would make the model consistent",
    "unexplained": "unexplained: the model is falsified and nothing in the catalogue mends it",
}

MOST_SETS = 6
"""So many sets that remain are printed."""


def text_of(result: Result) -> str:
    """What a person reads of a result; the first line is the verdict."""
    if isinstance(result, Calibration):
        return calibration_summary(result)
    if isinstance(result, Application):
        return application_summary(result)
    if isinstance(result, Check):
        return "\n".join(check_lines(result))
    if isinstance(result, Diagnosis):
        from .report.strapdown_text import diagnosis_lines

        return diagnosis_summary(result) if result.unit is None else "\n".join(diagnosis_lines(result))
    return result.json_text()


def check_lines(result: Check) -> list[str]:
    """The verdict, then every problem as `file:line: what`."""
    said = [result.verdict]
    for problem in result.problems:
        place = "" if problem.line is None else f":{problem.line}"
        said.append(f"{result.file}{place}: {problem.text}")
    if result.not_listed:
        said.append(f"... and {result.not_listed} more")
    said += [f"  {line}" for line in result.summary]
    return said + [f"warning: {warning}" for warning in result.warnings]


LATITUDE_DEG = 55.75
"""Where the azimuth's error is told when nothing else is asked for."""


def calibration_summary(result: Calibration) -> str:
    """Verdict and table of targets."""
    lines = [
        VERDICTS[result.verdict],
        f"{result.positions} positions, {result.measurements} readings, σ = {result.noise_bound:.3g} g "
        f"({result.noise_bound_basis}), radius {result.radius:.3f}",
        "",
        f"{'target':<12} {'name':<34} {'estimate':>13} {'guaranteed':>11} {'low':>13} {'high':>13}  unit",
    ]
    for row in result.parameters:
        if row.estimate is None or row.guaranteed_error is None:
            lines.append(f"{row.symbol:<12} {row.name:<34} {'not determined':>13}")
            continue
        ends = ["" if end is None else f"{end:+z.7f}" for end in (row.low, row.high)]
        # Of a model that the readings contradict nothing is guaranteed.
        error = "" if result.verdict == "falsified" else f"{row.guaranteed_error:.1e}"
        lines.append(
            f"{row.symbol:<12} {row.name:<34} {row.estimate:>+z13.7f} {error:>11} "
            f"{ends[0]:>13} {ends[1]:>13}  {unit_of(row.unit)}".rstrip()
        )
    lines += levelling_lines(result)
    lines += witness_lines(result)
    lines += missing_lines(result)
    lines += [f"measure next: {position_text(position)}" for position in result.next_positions]
    lines += [f"warning: {warning}" for warning in result.warnings]
    return "\n".join(lines)


def unit_of(unit: str) -> str:
    """A unit behind a number: nothing for what has none."""
    return "" if unit == "1" else unit


PHYSICAL_WORDS = (
    (r"scale-factor-error-plus-(\d)", r"scale factor of accelerometer \1 for positive input"),
    (r"scale-factor-error-minus-(\d)", r"scale factor of accelerometer \1 for negative input"),
    (r"scale-factor-asymmetry-(\d)", r"scale-factor asymmetry of accelerometer \1"),
    (r"misalignment-(\d)(\d)", r"misalignment of accelerometer \1 towards axis \2"),
    (r"mounting-error-(\d)", r"mounting error about axis \1"),
    (r"bias-(\d)", r"bias of accelerometer \1"),
    (r"outer-axis-tilt", "tilt of the outer axis"),
    (r"outer-angle-offset", "zero of the outer angle"),
    (r"axis-nonorthogonality", "non-orthogonality of the axes"),
)
"""A target's name, and what an engineer calls it."""


def physical_words(name: str) -> str:
    """A target's name in words: "bias-1" is "bias of accelerometer 1"; the name of a mounting stays behind it."""
    for pattern, words in PHYSICAL_WORDS:
        name = re.sub(pattern, words, name)
    return name


MOST_NAMED = 5
"""So many targets that are open are named in a sentence."""


def open_targets(result: Calibration) -> str:
    """What the measurements leave open, in a sentence."""
    gaps = result.missing
    if not gaps:
        return "whether an error that holds over a rest is in them" if result.radius > 1.0 else "more than they have"
    if len(gaps) == len(result.parameters):
        return "any of the targets"
    if len(gaps) > MOST_NAMED:
        return f"{len(gaps)} of the {len(result.parameters)} targets"
    return ", ".join(physical_words(gap.name) for gap in gaps)


def missing_lines(result: Calibration) -> list[str]:
    """What the measurements leave open, in words."""
    if not result.missing:
        return []
    if len(result.missing) == len(result.parameters):
        return ["The readings determine no target. Measure the positions named, or say what is known by --prior."]
    named = ", ".join(f"{physical_words(gap.name)} ({gap.symbol})" for gap in result.missing)
    return [f"The readings do not determine: {named}. Measure the positions named, or say what is known by --prior."]


def is_corrected(result: Calibration) -> bool:
    """Whether the calibration gives a correction of readings with a bound."""
    return result.verdict == "consistent" and all(e.low is not None for e in result.reading_errors)


def levelling_lines(result: Calibration) -> list[str]:
    """What the calibration is worth for levelling, worst of the six attitudes with an axis vertical."""
    if not is_corrected(result):
        return []
    correction = correction_of(result.to_json(), "calibration")
    before, after = levelling(correction, face_readings(correction)[1]).worst
    return [
        f"levelling with an axis vertical: as read wrong by up to {before / ARCSEC:.2f} arcsec, "
        f"corrected by at most {after / ARCSEC:.2f} (guaranteed; `trihedron apply` corrects)"
    ]


def application_summary(result: Application, latitude_deg: float = LATITUDE_DEG) -> str:
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
    lines = correction_equation(result.correction)
    lines += [
        f"{len(gained.before)} {result.levelled_at}; largest error of the vertical, in arcseconds:",
        f"  as read {before / ARCSEC:.2f} ({result.levelled_at.removesuffix('s')} {worst + 1}), "
        f"corrected at most {after / ARCSEC:.2f}, guaranteed",
        f"  its part in the azimuth of a gyrocompass at latitude {latitude_deg:g}°: "
        f"as read up to {azimuth * before / ARCSEC:.2f}, corrected at most {azimuth * after / ARCSEC:.2f}",
    ]
    if result.levelled_at == "rows":
        lines.append("  (of the direction of the specific force; it is the vertical where the block is at rest)")
    lines += [f"warning: {warning}" for warning in result.warnings]
    return "\n".join(lines)


def correction_equation(correction: Correction) -> list[str]:
    """The correction as equations with their numbers, readings f to inputs n."""
    lines = [f"g = {correction.gravity:.12g} m/s2; f1, f2, f3 the readings in m/s2; corrected readings are g n:"]
    for p in range(3):
        terms = [f"f{p + 1}/g", _term(-correction.bias[p], "")]
        terms += [_term(-correction.gamma[p, c], f" n{c + 1}") for c in range(p)]
        plus, minus = (f"{scale[p]:.12g}" for scale in (correction.plus, correction.minus))
        lines.append(f"n{p + 1} = ({' '.join(terms)}) / ({plus} where n{p + 1} > 0, {minus} elsewhere)")
    return lines


def _term(value: float, of: str) -> str:
    return f"{'-' if value < 0.0 else '+'} {abs(value):.12g}{of}"


def witness_lines(result: Calibration) -> list[str]:
    """The measurements that prove a falsification."""
    if not result.witness:
        return []
    shown = ", ".join(f"{reading.position}/{reading.accelerometer}" for reading in result.witness)
    return [f"proved by position/accelerometer: {shown}"]


def position_text(position: Mapping[str, Any]) -> str:
    """A proposed table position."""
    text = f"alpha {position['alpha_deg']:g}°, beta {position['beta_deg']:g}°"
    if "mounting" in position:
        text += f", mounting {position['mounting']}"
    if "approach_alpha" in position:
        text += f", approached {sense_text(position['approach_alpha'])} in alpha, "
        text += f"{sense_text(position['approach_beta'])} in beta"
    if position.get("separates"):
        text += f" (separates {', '.join(position['separates'])})"
    return text


def sense_text(sense: int) -> str:
    """The sense of a move in words."""
    return "forwards" if sense > 0 else "backwards"


def judgement_lines(result: Diagnosis) -> list[str]:
    """What readings that were left out say, and a mounting that would help."""
    lines = []
    if result.judgement is not None:
        for name, part in (("positions", result.judgement.folds), ("parts in time", result.judgement.blocks)):
            if part is not None:
                said = part.to_json()
                lines.append(
                    f"left-out {name} ({said['scored']} readings): rms {said['rms_before']:.2e} -> "
                    f"{said['rms_after']:.2e} g, max {said['max_before']:.2e} -> {said['max_after']:.2e} g"
                )
        if result.judgement.shuffles:
            shuffles = result.judgement.shuffles
            shuffles = result.judgement.shuffles
            lines.append(f"as good when shuffled: {shuffles.as_good} of {shuffles.tried}")
        lines += [f"warning: {warning}" for warning in result.judgement.warnings]
    if result.second_mounting is not None:
        other = result.second_mounting
        lines.append(
            f"a second mounting ({other.mounting}) tells apart {' and '.join(other.separates)}: "
            f"correlation {other.correlation_before:.2f} -> {other.correlation_after:.2f}"
        )
    return lines


def cause_lines(cause: Cause) -> list[str]:
    """A cause with its parameters."""
    lines = [f"cause: {cause.place.title}: {cause.sentence}"]
    for parameter, value, (low, high) in zip(
        CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
    ):
        text = f"  {parameter.name} {value:+.4e}, within [{low:+.4e}, {high:+.4e}] {unit_of(parameter.unit)}"
        lines.append(text.rstrip())
    return lines + [f"  cannot be told from {other.title}" for other in cause.alike]


def diagnosis_summary(result: Diagnosis) -> str:
    """Verdict, evidence, cause and gain."""
    nominal = result.evidence.calibration
    lines = [
        VERDICTS[result.verdict],
        f"{nominal.positions} positions, {nominal.measurements} readings, σ = {nominal.noise_bound:.3g} g "
        f"({nominal.noise_bound_basis}); nominal model: radius {nominal.radius:.3f}",
        *witness_lines(nominal),
    ]
    for finding in result.findings[:MOST_SETS]:
        for cause in finding.causes:
            lines += cause_lines(cause)
        lines.append(f"  radius with {'it' if len(finding.causes) == 1 else 'them'} {finding.fit.radius:.3f}")
    if len(result.findings) > MOST_SETS:
        lines.append(f"  ... and {len(result.findings) - MOST_SETS} sets more")
    for places in result.equal_sets:
        lines.append(f"  cannot be told from {' and '.join(place.title for place in places)}")
    if result.gain is not None:
        g = result.gain.to_json()
        lines.append(
            f"held-out positions, simulated again ({int(np.isfinite(result.gain.before).sum())} readings): "
            f"rms {g['held_out_rms_before']:.2e} -> {g['held_out_rms_after']:.2e} g, "
            f"max {g['held_out_max_before']:.2e} -> {g['held_out_max_after']:.2e} g"
        )
    elif result.verdict == "explained":
        lines.append("gain on held-out positions: not possible with these effects and positions")
    if result.gain is not None and not result.gain.improves:
        lines.append("warning: the extension does not improve the positions that were held out")
    lines += judgement_lines(result)
    if result.complete is False:
        lines.append("warning: the search was cut off: more sets of effects would make the model consistent")
    for entry in (result.residual_structure or ())[:5]:
        lines.append(
            f"residual of accelerometer {entry['accelerometer']}: {100 * entry['explained']:.0f} % of it is predicted "
            f"by {entry['on']}; {100 * entry['explainable']:.0f} % is more than noise"
        )
    lines += [f"measure next: {position_text(position)}" for position in result.next_positions or ()]
    lines += [f"warning: {warning}" for warning in nominal.warnings]
    return "\n".join(lines)
