"""The page of a calibration."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .. import reports
from ..calibrated import Calibration, Gyros, Parameter
from ..calibration.applied import Applied
from ..calibration.calibration import HOW_TO_FIND, OF_RESIDUALS
from ..calibration.correction import Correction, correction_of, face_readings, levelling
from ..calibration.estimates import joint_sets
from ..calibration.gyros import said_of_place
from ..calibration.targets import ARCSEC
from ..document.blocks import Page, Section, Table, Tone, table_of
from ..document.notation import (
    Bar,
    Drawn,
    bars,
    bars_by_unit,
    equation,
    listed,
    symbol_text,
    unit_text,
)
from ..errors import InputError
from ..records import PositionRecord
from ..rounding import digits, exactly, residual, to_bound, upwards
from . import bench

TONES: dict[str, Tone] = {"consistent": "good"}
WOULD_TELL = "Measure these positions again to find the noise bound."
ERROR_BOUND = "error bound"
"""The word for a guaranteed error where σ is not a bound."""
MOST_TURNS = 5
"""Largest number of turns that a sentence names."""
WORDS = {"symbol": symbol_text, "name": bench.physical_words, "unit": unit_text}
"""Format of a parameter's texts in a table."""


def calibration_page(result: Calibration, record: PositionRecord | None) -> Page:
    """Return the page of a calibration: parameters, open questions, worth for levelling.

    Residuals, record, model, evidence and joint sets follow; those of the record only if it is known.
    """
    answer = [target_section(result), *effect_sections(result), *gyro_sections(result)]
    answer.append(Section("Proof", bench.proof_lines(result)))
    if result.verdict == "insufficient":
        answer = open_sections(result) + answer
    else:
        answer += open_sections(result) + levelling_sections(result)
    has_residuals = record is not None and (result.radius or 0.0) > bench.NO_RESIDUAL

    def further() -> list[Section]:
        sections: list[Section | None] = []
        # A calibration of a record in motion has no readings at positions.
        at_rest = None if result.linearised is None else record
        if at_rest is not None:
            sections += [residual_section(result, at_rest.position)] if has_residuals else []
            sections.append(bench.measured_section(at_rest, result))
        sections.append(beside_section(result))
        if at_rest is not None:
            sections.append(bench.proof_section(result, at_rest.position))
            sections += rest_sections(at_rest)
        sections += joint_set_sections(result)
        return [section for section in sections if section is not None]

    return Page(
        f"Calibration of {record.path.name}" if record is not None else "Calibration",
        verdict_sentence(result),
        answer,
        further,
        tone=TONES.get(result.verdict, "attention"),
        key=bench.key_figures(result),
        provenance=bench.provenance(result),
        sources=bench.calibration_sources(result),
        warnings=result.warnings,
    )


def effect_sections(result: Calibration) -> list[Section]:
    """Return the effects that were solved with the parameters; none where there were none."""
    if not result.effects:
        return []
    rows = []
    for effect in result.effects:
        numbers = table_of(effect.parameters, ("name", "central", "error_bound", "low", "high", "unit"), WORDS)
        rows += [[effect.effect, *cells] for cells in numbers.rows]
    text = (
        f"Effects named by {result.explained_by}, solved with the parameters in one programme: all intervals hold "
        "beside them."
    )
    if result.sets:
        text = f"Effects of the explanations that remain, by {result.explained_by}: all intervals hold with any."
    header = ["effect", "parameter", "estimate", "to within", "low", "high", "unit"]
    return [Section("Effects", [text], table=Table(header, rows))]


WITHOUT_NOISE = (
    "Noise bound unknown: σ comes from the residuals of the fit, so they cannot show a wrong model. Nothing is "
    "guaranteed."
)


def verdict_sentence(result: Calibration) -> str:
    """Return the verdict in a sentence with its figures."""
    model = "the model"
    if result.sets:
        model = f"the model with any of {len(result.sets)} explanations"
    elif result.effects:
        model = f"the model with {' and '.join(effect.effect for effect in result.effects)}"
    if result.verdict == "falsified" and result.gyros is not None and result.gyros.witness:
        return (
            f"Falsified by the gyros: the best parameters leave a turn {residual(result.radius)} times its bound, "
            f"while the accelerometers at rest alone stand, within {residual(result.gyros.radius_of_rests)} σ. "
            "`trihedron diagnose` finds the cause."
        )
    if result.verdict == "falsified":
        proof = f", and {len(result.witness)} readings alone prove it" if result.witness else ""
        return (
            f"Falsified: no parameters of {model} keep every reading within the noise bound; the best leave "
            f"{residual(result.radius)} σ{proof}. `trihedron diagnose` finds the cause."
        )
    if result.verdict == "insufficient":
        more = bench.measure_words(result.next_positions)
        return f"Insufficient: the readings do not determine {bench.open_targets(result)}.{more}"
    if result.sigma.kind == "unknown":
        if result.sigma.basis.startswith(OF_RESIDUALS):
            return f"{WITHOUT_NOISE} To find the bound, {HOW_TO_FIND}."
        within = f"{residual(result.radius)} times the bound that their scatter within rests gives"
        said = f"{model} explains every reading within {within}"
        if not result.stands:
            said = f"the best parameters of {model} leave a reading {within}"
        return (
            f"Noise bound unknown: {said}. Scatter within rests does not show an error that holds over a rest, so that "
            f"nothing is guaranteed. To find the bound, {result.sigma.find or HOW_TO_FIND}."
        )
    bounds = [e.error_bound for e in result.targets if e.error_bound is not None]
    largest = ""
    if bounds:
        largest = f", and all {len(bounds)} targets are known, each to within {upwards(max(bounds))} or better"
    return f"Consistent: {model} explains every reading within {residual(result.radius)} σ{largest}."


def residual_section(result: Calibration, numbers: NDArray) -> Section:
    """Return the residuals of the readings for an ideal bench and for the calibrated one, with the noise band."""
    linearised = result.linearised
    errors = bench.centre_residual(result)
    texts = []
    for part in (bench.readings_at(linearised, np.zeros(len(linearised.point))), errors):
        rms, most = float(np.sqrt(np.mean(part**2))), float(np.abs(part).max())
        texts.append(f"{digits(rms, 2)} g (root mean square), at most {upwards(most)} g")
    ideal, best = texts
    return Section(
        "Residuals before and after",
        f"Against an ideal bench without errors the readings are off by {ideal}; against the calibrated one by "
        f"{best}. The picture shows the latter, in units of σ.",
        reports.residuals(
            linearised.positions, errors / bench.bounds_of_readings(linearised), None, bench.proved(result, numbers)
        ),
        "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
    )


TOGETHER = (
    "Where a set is narrow and inclined, a combination of the two targets is known better than each of them. The sets "
    "are exact for the model linearised at the fit, and hold the true values."
)


def joint_set_sections(result: Calibration) -> list[Section]:
    """Return pairwise projections of the set of all parameters that the readings leave possible."""
    if result.feasible is None:
        return []
    p = result.linearised.parametrisation
    estimates = dict(zip(p.symbols, result.linearised.point.tolist(), strict=True))
    estimates |= {e.symbol: e.central for e in result.targets if e.central is not None}
    return [
        Section(
            f"Joint uncertainty: {group}",
            [TOGETHER] if k == 0 else [],
            reports.joint_set(pairs, estimates, result.noise_bound),
            f"Pairs of targets around their estimates, in units of σ: {group}.",
        )
        for k, (group, pairs) in enumerate(joint_sets(result.feasible).items())
    ]


def levelling_sections(result: Calibration) -> list[Section]:
    """Return the correction as equations, and the error of the vertical before and after it, attitude by attitude.

    There is none without a guaranteed error, or beside effects of accelerometers, which the equations do not
    correct.
    """
    errors = result.reading_errors
    if not (result.stands and errors) or any(error.low is None for error in errors):
        return []
    if any(effect.in_readings for effect in result.effects):
        return []
    correction = correction_of(result.to_json(), "calibration")
    names, readings = face_readings(correction)
    errors = levelling(correction, readings)
    before, after = errors.worst
    if errors.after is None or after is None:
        return []
    rows = []
    for name, as_read, corrected in zip(names, errors.before.tolist(), errors.after.tolist(), strict=True):
        rows.append([name, upwards(as_read / ARCSEC), upwards(corrected / ARCSEC)])
    equations = []
    for n, terms, plus, minus in bench.correction_terms(correction, result.noise_bound, "_"):
        equations.append(equation(f"{n} = {terms} / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}"))
    promise = f"if the noise bound, {exactly(result.noise_bound, 3)} g, is one"
    if result.sigma.kind == "bound":
        promise = "guaranteed"
    header = ["attitude of the block", "error of the vertical as read [arcsec]", f"corrected, {promise} [arcsec]"]
    return [
        Section(
            "Levelling",
            [
                f"Levelling with an axis vertical: as read wrong by up to {upwards(before / ARCSEC, 3)} arcsec, "
                f"corrected by at most {upwards(after / ARCSEC, 3)} ({promise}; `trihedron apply` corrects). The "
                "readings' own errors come on top."
            ],
            equations=equations,
            table=Table(header, rows),
        )
    ]


def rest_sections(record: PositionRecord) -> list[Section]:
    """Return the rests of a raw record that were left out, each with its picture and its reason."""
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
    usable = len(record.rests) - len(refused)
    pictures = reports.refused_rests(raw, record.rests)
    first = Section(
        "Rests that were left out",
        [f"{len(record.rests)} rests were found, {usable} are used, {len(refused)} are not."],
        pictures[0],
        "Angles and readings, less their medians, during the rests that were refused.",
        Table(["first row", "last row", "lasts [s]", "why"], rows),
    )
    sections = [first]
    for picture in pictures[1:]:
        sections.append(Section("Rests that were left out, continued", picture=picture))
    return sections


def target_section(result: Calibration, truth: Mapping[str, float] | None = None) -> Section:
    """Return the parameters of bench and accelerometers; for a falsified model, the text in place of estimates."""
    paragraphs = estimator_texts(result)
    if result.verdict == "falsified":
        paragraphs += beside_texts(result)
        paragraphs.append("No error is guaranteed.")
        return Section("Targets", paragraphs, table=beside_table(result))
    if result.verdict == "noise-unknown" and not result.stands:
        return Section("Targets", paragraphs + beside_texts(result), table=beside_table(result))
    return Section("Targets", paragraphs, table=target_table(result, truth))


def open_sections(result: Calibration) -> list[Section]:
    """Return the positions that would determine the open targets, then these targets; empty without any."""
    sections = []
    if result.linearised is not None:
        purpose = bench.WOULD_DETERMINE if result.missing else WOULD_TELL
        sections += bench.next_sections(result.linearised, result.next_positions, purpose)
    sections.append(Section("Open parameters", bench.missing_texts(result)))
    return sections


def beside_section(result: Calibration) -> Section | None:
    """Return the other estimates beside the given one; for a falsified model, all estimates."""
    shown_before = result.verdict in ("falsified", "noise-unknown") and not result.stands
    if shown_before or not stands_beside(result):
        return None
    return Section(
        "Other estimates",
        beside_texts(result),
        table=beside_table(result),
    )


ESTIMATORS = {
    "analytic centre": "Estimates are the centre of all parameter values that fit every reading within its bound.",
    "central programme": "Estimates are possible values near the middles of their intervals.",
    "a priori": "Estimates are a-priori ones, which the readings may exclude. Calibrate again for better ones.",
}
BESIDE = (
    "Two other estimates: a priori, by the best weights before the measurement; and least squares, with its "
    "standard error."
)
A_PRIORI = "Beside them are the a-priori estimates, by weights that are best before anything is read."
WHY_OUTSIDE = {
    "a_priori": "The readings exclude the a-priori estimate of {}.",
    "least_squares": "Least squares ignores the noise bound; the readings exclude its estimate of {}.",
}


def estimator_texts(result: Calibration) -> list[str]:
    """Return sentences on the kind of estimates, or on the reason for having none."""
    if result.estimator == "least squares":
        texts = [f"Estimates are those of least squares: {result.no_estimate}."]
        return texts + ([f"The model would stand with `{result.option_to_stand}`."] if result.option_to_stand else [])
    texts = [ESTIMATORS[result.estimator]] if result.estimator in ESTIMATORS else []
    if result.no_estimate and len(result.missing) < len(result.targets):
        texts.append(f"{'Some targets have no estimate' if texts else 'No estimate'}: {result.no_estimate}.")
    return texts


def beside_texts(result: Calibration) -> list[str]:
    """Return sentences on the other estimates, and on the reason why they may be outside an interval."""
    if not stands_beside(result):
        return []
    texts = [A_PRIORI if result.estimator == "least squares" else BESIDE]
    for name, text in WHY_OUTSIDE.items():
        outside = [p.symbol for p in result.targets if not p.possible(getattr(p, name))]
        if outside:
            texts.append(text.format(few(outside)))
    return texts


def stands_beside(result: Calibration) -> list[Parameter]:
    """Return the targets that have other estimates; a file of the first schema has none."""
    estimated = [e for e in result.targets if e.a_priori is not None]
    return estimated if result.estimator != "a priori" else []


def few(symbols: Sequence[str]) -> str:
    """Return the symbols, or their number."""
    return ", ".join(symbols) if len(symbols) <= bench.MOST_NAMED else f"{len(symbols)} targets"


BEFORE_INTERVAL = 4
"""Columns of a table of parameters before the drawn interval."""


def target_table(result: Calibration, truth: Mapping[str, float] | None = None) -> Table:
    """Return each target with its interval, drawn in units of σ about its estimate; with its true value if known.

    It has no rows if the readings determine none of them.
    """
    if len(result.missing) == len(result.targets):
        return Table([], [])
    pictures, reach = bars(_intervals(result.targets, truth, result.noise_bound))
    caption = ""
    if reach > 0.0:
        caption = f"Drawn from −{upwards(reach)} to {upwards(reach)} σ about each estimate. {_legend(result, truth)}"
    return _interval_table(result.targets, truth, pictures, caption)


def gyro_table(result: Calibration, truth: Mapping[str, float] | None = None) -> Table:
    """Return each parameter of the gyros with its interval, drawn in one scale for all of one unit."""
    units = [p.unit for p in result.of_gyros]
    pictures = bars_by_unit(_intervals(result.of_gyros, truth, 1.0), units)
    caption = f"Drawn about each estimate, in one scale for all of one unit. {_legend(result, truth)}"
    return _interval_table(result.of_gyros, truth, pictures, caption if any(pictures) else "")


def _intervals(parameters: Sequence[Parameter], truth: Mapping[str, float] | None, scale: float) -> list[Bar]:
    """Return the intervals less their estimates, over a scale."""

    def scaled(p: Parameter, value: float | None) -> float | None:
        return None if value is None or p.central is None else (value - p.central) / scale

    intervals = []
    for p in parameters:
        band = None if p.central is None or p.guaranteed_error is None else p.guaranteed_error / scale
        true_value = scaled(p, (truth or {}).get(p.symbol))
        intervals.append(Bar(band, scaled(p, p.low), scaled(p, p.high), true_value, about=scaled(p, p.a_priori) or 0.0))
    return intervals


def _legend(result: Calibration, truth: Mapping[str, float] | None) -> str:
    """Return the meaning of the signs in a drawn interval."""
    text = (
        f"Band: a-priori estimate and {promised_error(result)}; line: what the readings leave possible; dot: estimate"
    )
    return f"{text}; bar: truth." if truth else f"{text}."


def _interval_table(
    parameters: Sequence[Parameter],
    truth: Mapping[str, float] | None,
    pictures: Sequence[Drawn | None],
    caption: str,
) -> Table:
    """Return parameters with their drawn intervals, and with their true values if known."""
    numbers = table_of(parameters, ("symbol", "name", "central", "error_bound", "low", "high", "unit"), WORDS)
    rows = []
    for cells, bar, p in zip(numbers.rows, pictures, parameters, strict=True):
        row = list(cells)
        row.insert(BEFORE_INTERVAL, bar)
        row.append(to_bound((truth or {}).get(p.symbol), p.error_bound))
        rows.append(row)
    header = list(numbers.header)
    header.insert(BEFORE_INTERVAL, "interval")
    header.append("truth")
    return Table(header, rows, caption)


def promised_error(result: Calibration) -> str:
    """Return the name of an estimate's largest error: "guaranteed error" only if σ is a bound."""
    return "guaranteed error" if result.sigma.kind == "bound" else ERROR_BOUND


def header_without_promise(result: Calibration, table: Table) -> list[str]:
    """Return the header of a table, which calls an error guaranteed only where σ is a bound."""
    return [promised_error(result) if title == "guaranteed error" else title for title in table.header]


def beside_table(result: Calibration) -> Table:
    """Return each parameter's estimates by the a-priori weights and by least squares."""
    columns = ["symbol", "name", "central", "a_priori", "guaranteed_error", "least_squares", "standard_error", "unit"]
    if result.verdict == "falsified" or result.sigma.kind == "unknown":
        # Nothing is guaranteed for a falsified model, or without a bound of the readings' errors.
        columns.remove("guaranteed_error")
    parameters = result.targets
    if result.stands:
        parameters = [*parameters, *result.of_gyros]
    numbers = table_of(parameters, columns, WORDS)
    rows = []
    for cells, p in zip(numbers.rows, parameters, strict=True):
        outside = []
        if not p.possible(p.a_priori):
            outside.append("a priori")
        if not p.possible(p.least_squares):
            outside.append("least squares")
        row = list(cells)
        row.append(" and ".join(outside) or None)
        rows.append(row)
    header = header_without_promise(result, numbers)
    header.append("outside the interval")
    return Table(header, rows)


LATITUDE_DEG = 55.75
"""Default latitude for the azimuth's error [deg]."""


def gyro_texts(gyros: Gyros, parameters: Sequence[Parameter]) -> list[str]:
    """Return sentences on the basis of the gyros' calibration, and on the bench by their turns."""
    basis = "as given" if gyros.noise_basis == "given" else f"by the {gyros.noise_basis}"
    texts = [
        f"Gyros: {gyros.pieces} rests, moves and parts of moves; their noise {basis}; encoders within "
        f"{upwards(gyros.encoder_bound)} rad; latitude {digits(gyros.latitude_deg, 7)}°, outer axis at azimuth "
        f"{digits(gyros.azimuth_deg, 7)}°."
    ]
    for gain in gyros.gains:
        texts.append(
            f"The turns make {gain.symbol} better known: within {upwards(gain.with_gyros)}, by the "
            f"accelerometers alone {upwards(gain.accelerometers_alone)}."
        )
    missing = [f"{bench.physical_words(p.name)} ({p.symbol})" for p in parameters if not p.determined]
    if missing:
        texts.append(
            f"The turns do not determine: {', '.join(missing)}. Turn the table by whole turns about both axes, the "
            "outer one at several inner angles, steadily for some seconds."
        )
    if gyros.witness:
        turns = []
        for turn in gyros.witness:
            turns.append(f"gyro {turn.gyro} from {digits(turn.from_s, 7)} s to {digits(turn.to_s, 7)} s")
        texts.append(f"These contradict the model: {listed(turns, MOST_TURNS)}.")
    return texts


def gyro_sections(result: Calibration, truth: Mapping[str, float] | None = None) -> list[Section]:
    """Return the gyros of a bench record with their intervals: bias, matrix, sensitivity, lag."""
    if result.gyros is None and not (result.explained_by and result.of_gyros):
        return []
    texts = [] if result.gyros is None else gyro_texts(result.gyros, result.of_gyros)
    table = None if result.verdict == "falsified" else gyro_table(result, truth)
    return [Section("The gyros, in the accelerometers' axes", texts, table=table)]


HOW = {
    "corrected": "taken out of the readings",
    "simulated": "simulated: it has no inverse that could be taken out of readings",
    "left": "left: a record of this kind does not show it, or its size alone does not say what it does",
}


def applied_page(result: Applied, latitude_deg: float | None = None) -> Page:
    """Return the correction of a record: for a calibration the equation and its worth, for a diagnosis each effect.

    The latitude is the given one, or that of the record's comment lines, or `LATITUDE_DEG`. Raises InputError for a
    latitude without a defined azimuth.
    """
    if result.correction is None:
        return _effects_page(result)
    lines = correction_equation(result.correction)
    lines += _levelling_lines(result, _latitude(result, latitude_deg))
    if result.gyros is not None and result.correction.gyros is not None:
        words = "gyros, too: w = (I + M)^-1 (reading - B - S n), as calibrated"
        lines.append("; ".join([words, *result.correction.in_motion]))
    if result.levelled_at == "rows":
        lines.append("  (of the direction of the specific force; it is the vertical where the block is at rest)")
    return Page("Correction", lines[0], [Section("Correction", lines[1:])], warnings=result.warnings)


def _effects_page(result: Applied) -> Page:
    """Return the fate of each effect, and the errors of the simulation without and with them."""
    lines = [f"{effect.effect}: {HOW[effect.how]}" for effect in result.effects or ()]
    if result.rms_without is not None:
        rms = f"{digits(result.rms_without)} -> {digits(result.rms_with or 0.0)}"
        largest = f"{digits(result.max_without or 0.0)} -> {digits(result.max_with or 0.0)}"
        lines.append(f"{result.over}, simulated without and with them: {rms} {result.unit} rms, at most {largest}")
    return Page("Effects applied to a record", lines[0], [Section("Effects", lines[1:])], warnings=result.warnings)


def _latitude(result: Applied, latitude_deg: float | None) -> float:
    if latitude_deg is None:
        latitude_deg = said_of_place(result.record).get("latitude_deg", LATITUDE_DEG)
    if not abs(latitude_deg) <= 89.0:
        raise InputError(
            f"--latitude-deg {exactly(latitude_deg)}: must be from -89 to 89; there is no azimuth at a pole"
        )
    return latitude_deg


def _levelling_lines(result: Applied, latitude_deg: float) -> list[str]:
    """Return the errors of the vertical as read and corrected, and their parts in an azimuth."""
    gained = result.levelling
    if gained is None:
        return []
    before, after = gained.worst
    places = result.levelled_at or "rows"
    reasons = [f"  not guaranteed: {reason}" for reason in result.not_guaranteed or ()]
    if after is None:
        return [
            f"{len(gained.before)} {places}; the correction turns the vertical by up to {upwards(before / ARCSEC, 3)} "
            "arcsec",
            *_standard_error_lines(result),
            *reasons,
        ]
    azimuth = abs(math.tan(math.radians(latitude_deg)))
    promise = "not guaranteed" if result.not_guaranteed else "guaranteed"
    worst = f"{places.removesuffix('s')} {int(np.argmax(gained.before)) + 1}"
    return [
        f"{len(gained.before)} {places}; largest error of the vertical, in arcseconds:",
        f"  as read {upwards(before / ARCSEC, 3)} ({worst}), corrected at most {upwards(after / ARCSEC, 3)}, {promise}",
        *reasons,
        f"  its part in the azimuth of a gyrocompass at latitude {exactly(latitude_deg)}°: as read up to "
        f"{upwards(azimuth * before / ARCSEC, 3)}, corrected at most {upwards(azimuth * after / ARCSEC, 3)}",
    ]


def _standard_error_lines(result: Applied) -> list[str]:
    """Return the standard errors of corrected readings, and the calibration's open directions, in lines."""
    lines = []
    if result.standard_error_g is not None:
        error = digits(1e3 * result.standard_error_g, 2)
        lines.append(f"  standard error of a corrected reading, by the calibration: at most {error} mg")
    pose_error = result.correction.pose_error if result.correction is not None else None
    if pose_error is not None:
        lines.append(f"  standard error of |f| at rest in the worst pose: {digits(1e3 * pose_error, 2)} mg")
    for direction in result.open:
        lines.append(f"  not determined: {direction}")
    return lines


def correction_equation(correction: Correction) -> list[str]:
    """Return the correction as equations with their numbers, readings f to inputs n."""
    lines = [f"g = {exactly(correction.gravity)} m/s2; f1, f2, f3 the readings in m/s2; corrected readings are g n:"]
    for n, terms, plus, minus in bench.correction_terms(correction):
        divisor = plus if plus == minus else f"({plus} where {n} > 0, {minus} elsewhere)"
        lines.append(f"{n} = {terms.replace('−', '-')} / {divisor}")
    return lines
