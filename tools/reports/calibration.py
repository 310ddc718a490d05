"""What a calibration says: text and page."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..calibrated import Calibration, Gyros, Parameter
from ..calibration.correction import Application, Correction, Levelling, correction_of, face_readings, levelling
from ..calibration.estimates import joint_sets
from ..calibration.gyros import said_of_place
from ..calibration.targets import ARCSEC
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
from ..rounding import NONE, Number, digits, exactly, interval, residual, to_bound, upwards
from . import bench
from .pictures.records import refused_rests
from .pictures.residuals import joint_set, residuals

TONES: dict[str, Tone] = {"consistent": "good"}


def page(result: Calibration, record: PositionRecord) -> Page:
    """Verdict, targets and residuals; record, model, evidence, what next, provenance."""
    answer = [target_section(result), gyro_section(result), residual_section(result, record.position)]
    answer = [section for section in answer if section is not None]
    sections = [
        *answer,
        bench.measured_section(record, result),
        bench.bench_section(result, bench.calibrated_values(result)),
        beside_section(result),
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
        answer=len(answer),
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
    bounds = [e.error_bound for e in result.targets if e.error_bound is not None]
    told = ""
    if bounds:
        told = f", and all {len(bounds)} targets are known, each to within {upwards(max(bounds))} or better"
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
    estimates |= {e.symbol: e.central for e in result.targets if e.central is not None}
    return [
        Section(
            f"Possible together: {group}",
            [TOGETHER] if k == 0 else [],
            joint_set(pairs, estimates, result.noise_bound),
            "Each pair of targets about its estimates, in units of σ; the truth lies inside, as the estimates do.",
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
        [int(raw.row[rest.first]), int(raw.row[rest.last]), digits(np.ptp(raw.time_s[rest.first : rest.last + 1])),
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
            f"({result.sigma.basis}); least possible largest residual {residual(result.radius)} σ.",
            *bench.missing_lines(result),
            *map(sentence, estimator_lines(result)),
        ],
        table=target_table(result, truth),
        files=files or [],
    )


def target_section(result: Calibration) -> Section:
    """The targets on a page of their own."""
    said = [sentence(line) for line in estimator_lines(result)]
    if result.missing:
        said.append(
            "Where there is no number the readings determine none: measure more, or say what is known by `--prior`."
        )
    if result.verdict == "falsified":
        said += [sentence(line) for line in beside_words(result)]
        said.append("No error is guaranteed. `trihedron diagnose` says what the model lacks.")
        return Section("Targets", said, table=beside_table(result))
    return Section("Targets", said, table=target_table(result))


def beside_section(result: Calibration) -> Section | None:
    """The other estimates beside the one that is stated; those of a falsified model stand in their place."""
    if result.verdict == "falsified" or not stands_beside(result):
        return None
    return Section(
        "Beside the estimates",
        [sentence(line) for line in beside_words(result)],
        table=beside_table(result),
    )


ESTIMATORS = {
    "analytic centre": "the estimates are the analytic centre: one possible set of values, which keeps every reading "
    "within its bound, in the middle of all such",
    "central programme": "the estimates are the point of the central programme: one possible set of values, as near to "
    "the middles of the intervals as any, where hardly more than a point is possible",
    "a priori": "the estimates are the a-priori ones, which the readings may prove impossible; calibrate again for "
    "others",
}
BESIDE = (
    "beside them: a-priori estimates, by weights that are best before anything is read, and least squares with its "
    "standard error"
)


def estimator_lines(result: Calibration) -> list[str]:
    """What the estimates are, or why there are none."""
    said = [ESTIMATORS[str(result.estimator)]] if stands_central(result) else []
    if result.no_estimate:
        said.append(f"no estimate{' of those' if stands_central(result) else ''}: {result.no_estimate}")
    return said


def stands_central(result: Calibration) -> bool:
    """Whether estimates are possible values."""
    return result.estimator in ESTIMATORS


def beside_words(result: Calibration) -> list[str]:
    """What stands beside the estimates, and why it may be outside an interval."""
    if not stands_beside(result):
        return []
    said = [BESIDE if stands_central(result) else BESIDE.replace("beside them", "what stands in their place")]
    for title, key, why in (
        ("the a-priori estimate", "a_priori", "it is a promise made before the data, which now say more"),
        ("least squares", "least_squares", "it knows no bound of the readings' errors"),
    ):
        outside = [e.symbol for e in result.targets if not e.possible(getattr(e, key))]
        if outside:
            said.append(f"{title} lies outside the interval of {few(outside)}: {why}")
    return said


def stands_beside(result: Calibration) -> list[Parameter]:
    """The targets of which other estimates are known; a file of the first schema has no others."""
    known = [e for e in result.targets if e.a_priori is not None]
    return known if result.estimator != "a priori" else []


def few(symbols: Sequence[str]) -> str:
    """The symbols, or how many they are."""
    return ", ".join(symbols) if len(symbols) <= bench.MOST_NAMED else f"{len(symbols)} targets"


def target_table(result: Calibration, truth: Mapping[str, float] | None = None) -> Table:
    """Each target with its interval, drawn in units of σ about its estimate; columns that say nothing are left out."""
    known, sigma = truth or {}, result.noise_bound

    def over(value: float | None, estimate: float | None) -> float | None:
        return None if value is None or estimate is None else (value - estimate) / sigma

    drawn, reach = bars(
        [
            Bar(
                None if e.central is None or e.guaranteed_error is None else e.guaranteed_error / sigma,
                *(over(value, e.central) for value in (e.low, e.high, known.get(e.symbol))),
                about=over(e.a_priori, e.central) or 0.0,
            )
            for e in result.targets
        ]
    )
    rows: list[list[Cell]] = []
    for e, bar in zip(result.targets, drawn, strict=True):
        estimate, low, high, *_ = numbers_of(e)
        row: list[Cell] = [symbol_text(e.symbol), bench.physical_words(e.name), estimate, upwards(e.error_bound)]
        rows.append([*row, bar, low, high, unit_text(e.unit), to_bound(known.get(e.symbol), e.error_bound)])
    header = ["target", "meaning", "estimate", "to within", "interval", "low", "high", "unit", "truth"]
    marks = "band: a-priori estimate and guaranteed error; line: what the readings leave possible; dot: estimate"
    marks += "; bar: truth" if known else ""
    drawn_from = f"Drawn from −{upwards(reach)} to {upwards(reach)} σ about each estimate. {sentence(marks)}"
    return Table(header, rows, "" if reach == 0.0 else drawn_from).told()


def beside_table(result: Calibration) -> Table:
    """Each target's estimates by the a-priori weights and by least squares; columns that say nothing are left out."""
    rows: list[list[Cell]] = []
    for e in result.targets:
        estimate, _, _, a_priori, squares = numbers_of(e)
        # Of a model that the readings contradict nothing is guaranteed.
        guaranteed = NONE if result.verdict == "falsified" else upwards(e.guaranteed_error)
        row: list[Cell] = [symbol_text(e.symbol), bench.physical_words(e.name), estimate, a_priori, guaranteed]
        beside = (("a priori", e.a_priori), ("least squares", e.least_squares))
        outside = " and ".join(name for name, value in beside if not e.possible(value))
        rows.append([*row, squares, digits(e.standard_error, 2), unit_text(e.unit), outside or None])
    header = ["target", "meaning", "estimate", "a priori", "guaranteed error", "least squares", "standard error"]
    return Table([*header, "unit", "outside the interval"], rows).told()


def numbers_of(e: Parameter) -> tuple[Number, Number, Number, Number, Number]:
    """Estimate, both ends, a-priori estimate and least squares of a target, with the same decimals."""
    estimate, low, high = interval(e.central, e.low, e.high, e.error_bound)
    half = None if e.low is None or e.high is None or e.high == e.low else 0.5 * (e.high - e.low)
    place = half or e.guaranteed_error
    return estimate, low, high, to_bound(e.a_priori, place), to_bound(e.least_squares, place)


LATITUDE_DEG = 55.75
"""Where the azimuth's error is told when nothing else is asked for."""


def lines(result: Calibration) -> list[str]:
    """Verdict, the targets' estimates, and what stands beside them."""
    said = [
        bench.VERDICTS[result.verdict],
        f"{result.positions} positions, {result.measurements} readings, σ = {upwards(result.noise_bound, 3)} g "
        f"({result.sigma.basis}), radius {residual(result.radius)}",
        *estimator_lines(result),
        *beside_words(result),
        *([] if result.verdict == "falsified" else target_lines(result.targets)),
        *beside_lines(result),
        *gyro_lines(result),
    ]
    said += [*levelling_lines(result), *bench.proof_lines(result), *bench.missing_lines(result)]
    said += [f"measure next: {bench.position_text(position)}" for position in result.next_positions]
    return said + [f"warning: {warning}" for warning in result.warnings]


def target_lines(estimates: Sequence[Parameter]) -> list[str]:
    """Each target with its estimate and interval."""
    said = ["", f"{'target':<12} {'name':<34} {'estimate':>13} {'to within':>11} {'low':>13} {'high':>13}  unit"]
    for e in estimates:
        estimate, low, high, *_ = numbers_of(e)
        if e.central is None:
            estimate = "none" if e.determined else "not determined"
        text = f"{e.symbol:<12} {e.name:<34} {estimate:>13} {upwards(e.error_bound):>11} {low:>13} {high:>13}"
        said.append(f"{text}  {unit_of(e.unit)}".rstrip() if low else text.rstrip())
    return said


def gyro_words(gyros: Gyros, parameters: Sequence[Parameter]) -> list[str]:
    """What the gyros' calibration rests on, and what their turns say of the bench."""
    said = [
        f"gyros: {gyros.pieces} rests, moves and parts of moves; their noise {_basis(gyros)}; encoders within "
        f"{upwards(gyros.encoder_bound)} rad; latitude {digits(gyros.latitude_deg, 7)}°, outer axis at azimuth "
        f"{digits(gyros.azimuth_deg, 7)}°"
    ]
    said += [
        f"the turns make {gain.symbol} better known: guaranteed within {upwards(gain.with_gyros)}, by the "
        f"accelerometers alone {upwards(gain.accelerometers_alone)}"
        for gain in gyros.gains
    ]
    missing = [p for p in parameters if not p.determined]
    if missing:
        named = ", ".join(f"{bench.physical_words(gap.name)} ({gap.symbol})" for gap in missing)
        said.append(
            f"the turns do not determine: {named}; turn the table by whole turns about both axes, the outer one at "
            "several inner angles, steadily for some seconds"
        )
    if gyros.witness:
        turns = [f"gyro {t.gyro} from {digits(t.from_s, 7)} s to {digits(t.to_s, 7)} s" for t in gyros.witness]
        said.append(f"what contradicts the model: {few(turns)}")
    return said


def _basis(gyros: Gyros) -> str:
    return "as given" if gyros.noise_basis == "given" else f"by the {gyros.noise_basis}"


def gyro_lines(result: Calibration) -> list[str]:
    """The gyros of a bench record."""
    if result.gyros is None:
        return []
    known = [] if result.verdict == "falsified" else target_lines(result.of_gyros)
    return [*gyro_words(result.gyros, result.of_gyros), *known, ""]


def gyro_section(result: Calibration) -> Section | None:
    """The gyros of a bench record: bias, matrix, sensitivity, lag, with their intervals."""
    if result.gyros is None:
        return None
    rows: list[list[Cell]] = []
    for e in result.of_gyros:
        estimate, low, high, _, squares = numbers_of(e)
        row: list[Cell] = [e.symbol, bench.physical_words(e.name), estimate, upwards(e.error_bound), low, high]
        rows.append([*row, upwards(e.guaranteed_error), squares, unit_text(e.unit)])
    header = ["target", "meaning", "estimate", "to within", "low", "high", "guaranteed error", "least squares", "unit"]
    words = [sentence(line) for line in gyro_words(result.gyros, result.of_gyros)]
    return Section("The gyros, in the accelerometers' axes", words, table=Table(header, rows).told())


def beside_lines(result: Calibration) -> list[str]:
    """Each target's estimates by the a-priori weights and by least squares; beside the central one, where there is."""
    known = stands_beside(result)
    falsified = result.verdict == "falsified"
    first = f"{'name':<34}" if falsified else f"{'estimate':>13}"
    others = f"{'a priori':>14} {'guaranteed':>11} {'least squares':>14} {'standard error':>15}"
    said = ["", f"{'target':<12} {first} {others}"] if known else []
    for e in known:
        estimate, _, _, a_priori, squares = numbers_of(e)
        first = f"{e.name:<34}" if falsified else f"{estimate or 'none':>13}"
        # Of a model that the readings contradict nothing is guaranteed.
        guaranteed = NONE if falsified else upwards(e.guaranteed_error)
        beyond = ["" if e.possible(value) else "*" for value in (e.a_priori, e.least_squares)]
        text = f"{e.symbol:<12} {first} {a_priori + beyond[0]:>14} {guaranteed:>11} {squares + beyond[1]:>14}"
        said.append(f"{text} {digits(e.standard_error, 2):>15}".rstrip())
    if not all(e.possible(e.a_priori) and e.possible(e.least_squares) for e in known):
        said.append("* outside the interval")
    return [*said, ""] if known else []


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


def application_lines(result: Application, latitude_deg: float | None = None) -> list[str]:
    """The equation with its numbers, and what the correction is worth for an alignment.

    The latitude is what is given, or what comment lines of the record say, or `LATITUDE_DEG`.

    Raises
    ------
    InputError
        for a latitude at which there is no azimuth to find
    """
    if latitude_deg is None:
        latitude_deg = said_of_place(result.record).get("latitude_deg", LATITUDE_DEG)
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
    if result.gyros is not None and result.correction.gyros is not None:
        gyros = result.correction.gyros
        lags = [f"their lag of {exactly(1e3 * gyros.lag, 3)} ms stays"]
        if gyros.force_lag is not None:
            lags.append(f"that of the accelerometers, {exactly(1e3 * gyros.force_lag, 3)} ms, too")
        lines.append(f"gyros, too: w = (I + M)^-1 (reading - B - S n), as calibrated; {', '.join(lags)}")
    if result.levelled_at == "rows":
        lines.append("  (of the direction of the specific force; it is the vertical where the block is at rest)")
    return lines + [f"warning: {warning}" for warning in result.warnings]


def correction_equation(correction: Correction) -> list[str]:
    """The correction as equations with their numbers, readings f to inputs n."""
    lines = [f"g = {exactly(correction.gravity)} m/s2; f1, f2, f3 the readings in m/s2; corrected readings are g n:"]
    for n, terms, plus, minus in bench.correction_terms(correction):
        lines.append(f"{n} = {terms.replace('−', '-')} / ({plus} where {n} > 0, {minus} elsewhere)")
    return lines
