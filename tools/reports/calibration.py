"""What a calibration says: text and page."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..calibration import Calibration
from ..calibration.correction import ARCSEC, Application, Correction, Levelling, correction_of, face_readings, levelling
from ..calibration.estimates import joint_sets
from ..document.blocks import Page, Section, Table, Tone
from ..document.notation import (
    Bar,
    Cell,
    bars,
    equation,
    sentence,
    symbol_text,
    unit_of,
    unit_text,
)
from ..errors import InputError
from ..records import PositionRecord
from ..rounding import NONE, digits, exactly, interval, residual, to_bound, upwards
from . import bench
from .pictures.records import refused_rests
from .pictures.residuals import joint_set, residuals

TONES: dict[str, Tone] = {"consistent": "good"}


def page(result: Calibration, record: PositionRecord) -> Page:
    """Verdict, record, model, residuals, targets, evidence, what next, provenance."""
    sections = [
        bench.measured_section(record, result),
        bench.bench_section(result, bench.calibrated_values(result)),
        residual_section(result, record.position),
        target_section(result),
        bench.proof_section(result, record.position),
        bench.next_section(result.linearised, result.next_positions),
        levelling_section(result),
        *joint_set_sections(result),
        *rest_sections(record),
    ]
    return Page(
        f"Calibration of {record.path.name}",
        verdict_sentence(result),
        [section for section in sections if section is not None],
        tone=TONES.get(result.verdict, "attention"),
        key=bench.key_figures(result),
        provenance=bench.provenance(result),
        sources=bench.calibration_sources(result),
    )


def verdict_sentence(result: Calibration) -> str:
    """The verdict in a sentence with its figures."""
    if result.verdict == "falsified":
        return (
            f"Falsified: no parameters of the model keep every reading within the noise bound; the best leave "
            f"{residual(result.radius)} σ, and {len(result.witness)} readings alone prove it."
        )
    if result.verdict == "insufficient":
        return f"Insufficient: the readings do not determine {bench.open_targets(result)}."
    worst = [e for e in result.parameters if e.estimate is not None and e.guaranteed_error is not None]
    told = ""
    if worst:
        largest = max(e.guaranteed_error for e in worst if e.guaranteed_error is not None)
        told = f", and all {len(worst)} targets are known, each to within {upwards(largest)} or better"
    return f"Consistent: the model explains every reading within {residual(result.radius)} σ{told}."


def residual_section(result: Calibration, numbers: NDArray) -> Section:
    """What is left of the readings: an ideal bench, and the calibrated one, within the noise band."""
    here = result.linearised
    left = bench.centre_residual(result)
    parts = here.residual_at(np.zeros(len(here.point))), left
    figures = ((digits(float(np.sqrt(np.mean(r**2))), 2), upwards(float(np.abs(r).max()))) for r in parts)
    ideal, best = (f"{rms} g (root mean square), at most {most} g" for rms, most in figures)
    return Section(
        "Residuals before and after",
        f"Against an ideal bench without errors the readings are off by {ideal}; against the calibrated one by "
        f"{best}. The picture shows the latter, in units of σ.",
        residuals(here.positions, left / here.bound.reshape(-1, 3), None, bench.proved(result, numbers)),
        "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
    )


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


def levelling_section(result: Calibration) -> Section | None:
    """The correction as equations, and the error of the vertical before and after it, attitude by attitude."""
    found = levelled(result)
    if found is None:
        return None
    correction, names, gained = found
    rows: list[list[Cell]] = [
        [name, upwards(before / ARCSEC), upwards(after / ARCSEC)]
        for name, before, after in zip(names, gained.before.tolist(), gained.after.tolist(), strict=True)
    ]
    header = ["attitude of the block", "error of the vertical as read [arcsec]", "corrected, guaranteed [arcsec]"]
    return Section(
        "What it bought",
        [
            "An inertial system that aligns itself by these accelerometers takes their readings for the vertical. "
            "The errors below are those of the block at rest; the readings' own errors come on top.",
            "The correction, with f the readings and g n what they become; `trihedron apply` does it:",
        ],
        equations=[
            equation(f"{n} = {terms} / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}")
            for n, terms, plus, minus in bench.correction_terms(correction, result.noise_bound, "_")
        ],
        table=Table(header, rows),
    )


def rest_sections(record: PositionRecord) -> list[Section]:
    """The rests of a raw record that were left out, each with its picture and its reason."""
    if record.raw is None:
        return []
    raw, refused = record.raw, [rest for rest in record.rests if rest.refused is not None]
    if not refused:
        return []
    rows = [
        [int(raw.row[rest.first]), int(raw.row[rest.last]), float(np.ptp(raw.time_s[rest.first : rest.last + 1])),
         rest.refused]
        for rest in refused
    ]  # fmt: skip
    kept = len(record.rests) - len(refused)
    picture, *others = refused_rests(raw, record.rests)
    first = Section(
        "Rests that were left out",
        [f"{len(record.rests)} rests were found, {kept} are used, {len(refused)} are not."],
        picture,
        "Angles and readings, less their medians, during the rests that were refused.",
        Table(["first row", "last row", "lasts [s]", "why"], rows),
    )
    return [first, *(Section("Rests that were left out, continued", svg=other) for other in others)]


def calibration_section(
    result: Calibration, truth: Mapping[str, float] | None = None, files: list[Path] | None = None
) -> Section:
    """The verdict in a sentence, and the targets."""
    return Section(
        "Calibration with guaranteed bounds",
        [
            sentence(bench.VERDICTS[result.verdict]),
            f"{result.positions} positions, {result.measurements} readings, σ = {upwards(result.noise_bound, 3)} g "
            f"({result.noise_bound_basis}); least possible largest residual {residual(result.radius)} σ.",
            *bench.missing_lines(result),
        ],
        table=target_table(result, truth),
        files=files or [],
    )


def target_section(result: Calibration) -> Section:
    """The targets on a page of their own."""
    said = ["An estimate is never wrong by more than its guaranteed error; the truth lies between low and high."]
    if result.verdict == "falsified":
        said = [
            "The estimates are those of a model that the readings contradict: no value is possible, and no error is "
            "guaranteed. `trihedron diagnose` says what the model lacks."
        ]
    if result.missing:
        said.append(
            "Where there is no number the readings determine none: measure more, or say what is known by `--prior`."
        )
    return Section("Targets", said, table=target_table(result))


def target_table(result: Calibration, truth: Mapping[str, float] | None = None) -> Table:
    """Each target with its interval, drawn in units of σ about its estimate; columns that say nothing are left out."""
    known, sigma = truth or {}, result.noise_bound
    falsified = result.verdict == "falsified"

    def over(value: float | None, estimate: float | None) -> float | None:
        return None if value is None or estimate is None else (value - estimate) / sigma

    # Of a model that the readings contradict nothing is guaranteed.
    errors = [None if e.estimate is None or falsified else e.guaranteed_error for e in result.parameters]
    drawn, reach = bars(
        [
            Bar(
                None if error is None else error / sigma,
                *(over(value, e.estimate) for value in (e.low, e.high, known.get(e.symbol))),
            )
            for e, error in zip(result.parameters, errors, strict=True)
        ]
    )
    rows: list[list[Cell]] = []
    for e, error, bar in zip(result.parameters, errors, drawn, strict=True):
        row: list[Cell] = [
            symbol_text(e.symbol),
            bench.physical_words(e.name),
            to_bound(e.estimate, e.guaranteed_error),
        ]
        ends = (None, None) if falsified else interval(None, e.low, e.high, e.guaranteed_error)[1:]
        row += [upwards(error), None if falsified else bar, *ends, unit_text(e.unit)]
        rows.append([*row, to_bound(known.get(e.symbol), e.guaranteed_error)])
    header = ["target", "meaning", "estimate", "guaranteed error", "interval", "low", "high", "unit", "truth"]
    marks = "band: estimate and guaranteed error; line: what the readings leave possible; dot: estimate"
    marks += "; bar: truth" if known else ""
    drawn_from = f"Drawn from −{upwards(reach)} to {upwards(reach)} σ about each estimate. {sentence(marks)}"
    return Table(header, rows, "" if falsified or reach == 0.0 else drawn_from).told()


LATITUDE_DEG = 55.75
"""Where the azimuth's error is told when nothing else is asked for."""


def lines(result: Calibration) -> list[str]:
    """Verdict and table of targets."""
    said = [
        bench.VERDICTS[result.verdict],
        f"{result.positions} positions, {result.measurements} readings, σ = {upwards(result.noise_bound, 3)} g "
        f"({result.noise_bound_basis}), radius {residual(result.radius)}",
        "",
        f"{'target':<12} {'name':<34} {'estimate':>13} {'guaranteed':>11} {'low':>13} {'high':>13}  unit",
    ]
    for row in result.parameters:
        if row.estimate is None or row.guaranteed_error is None:
            said.append(f"{row.symbol:<12} {row.name:<34} {'not determined':>13}")
            continue
        estimate, low, high = interval(row.estimate, row.low, row.high, row.guaranteed_error)
        # Of a model that the readings contradict nothing is guaranteed.
        error = NONE if result.verdict == "falsified" else upwards(row.guaranteed_error)
        text = f"{row.symbol:<12} {row.name:<34} {estimate:>13} {error:>11} {low:>13} {high:>13}"
        said.append(f"{text}  {unit_of(row.unit)}".rstrip())
    said += [*levelling_lines(result), *bench.proof_lines(result), *bench.missing_lines(result)]
    said += [f"measure next: {bench.position_text(position)}" for position in result.next_positions]
    return said + [f"warning: {warning}" for warning in result.warnings]


def levelled(result: Calibration) -> tuple[Correction, list[str], Levelling] | None:
    """The correction, the six attitudes with an axis vertical, and what it is worth there; None without a bound."""
    if result.verdict != "consistent" or any(e.low is None for e in result.reading_errors):
        return None
    correction = correction_of(result.to_json(), "calibration")
    names, reading = face_readings(correction)
    return correction, names, levelling(correction, reading)


def levelling_lines(result: Calibration) -> list[str]:
    """What the calibration is worth for levelling, worst of the six attitudes with an axis vertical."""
    found = levelled(result)
    if found is None:
        return []
    before, after = found[2].worst
    return [
        f"levelling with an axis vertical: as read wrong by up to {upwards(before / ARCSEC, 3)} arcsec, "
        f"corrected by at most {upwards(after / ARCSEC, 3)} (guaranteed; `trihedron apply` corrects)"
    ]


def application_lines(result: Application, latitude_deg: float = LATITUDE_DEG) -> list[str]:
    """The equation with its numbers, and what the correction is worth for an alignment.

    Raises
    ------
    InputError
        for a latitude at which there is no azimuth to find
    """
    if not abs(latitude_deg) <= 89.0:
        raise InputError(
            f"--latitude-deg {exactly(latitude_deg)}: must be from -89 to 89; there is no azimuth at a pole"
        )
    gained = result.levelling
    worst = int(np.argmax(gained.before))
    before, after = gained.worst
    azimuth = abs(math.tan(math.radians(latitude_deg)))
    lines = correction_equation(result.correction)
    lines += [
        f"{len(gained.before)} {result.levelled_at}; largest error of the vertical, in arcseconds:",
        f"  as read {upwards(before / ARCSEC, 3)} ({result.levelled_at.removesuffix('s')} {worst + 1}), "
        f"corrected at most {upwards(after / ARCSEC, 3)}, guaranteed",
        f"  its part in the azimuth of a gyrocompass at latitude {exactly(latitude_deg)}°: "
        f"as read up to {upwards(azimuth * before / ARCSEC, 3)}, "
        f"corrected at most {upwards(azimuth * after / ARCSEC, 3)}",
    ]
    if result.levelled_at == "rows":
        lines.append("  (of the direction of the specific force; it is the vertical where the block is at rest)")
    return lines + [f"warning: {warning}" for warning in result.warnings]


def correction_equation(correction: Correction) -> list[str]:
    """The correction as equations with their numbers, readings f to inputs n."""
    lines = [f"g = {exactly(correction.gravity)} m/s2; f1, f2, f3 the readings in m/s2; corrected readings are g n:"]
    for n, terms, plus, minus in bench.correction_terms(correction):
        lines.append(f"{n} = {terms.replace('−', '-')} / ({plus} where {n} > 0, {minus} elsewhere)")
    return lines
