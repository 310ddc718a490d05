"""Results of several records of one instrument together: lines for a terminal, and the page."""

from collections.abc import Sequence

from ..calibrated import Calibration, Parameter
from ..calibration.targets import NAMES
from ..diagnosis.cause import Cause, SizedParameter
from ..diagnosis.result import Diagnosis, Explanation
from ..document.blocks import Page, Section, Table, Tone, table_of
from ..document.notation import Cell, sentence, symbol_text, unit_text
from ..instrument import Entries, Entry
from ..rounding import digits, downwards, interval, residual, upwards
from .bench import physical_words
from .pictures.residuals import drawable, repeatability_picture
from .sources import cited, versions

VERDICTS = {
    "consistent": "consistent: one value of each instrument parameter fits all records",
    "explained": "explained: one set of effects makes all records consistent; no other set of its size does",
    "ambiguous": "ambiguous: several sets of effects of the smallest size make all records consistent",
    "unexplained": "unexplained: shared parameters are falsified, and no set of effects explains the records",
    "insufficient": "insufficient: the records cannot show whether the simulation is wrong",
}
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}
SHORTER = {" error of accelerometer": "", " of accelerometer": "", " for ": ", ", " specific force along": ""}
"""Phrases of a parameter's name, and those in a picture."""
MOST_SETS = 6
"""Largest number of remaining sets that are printed."""


def helps_lines(result: Diagnosis) -> list[str]:
    """Return the records that each found effect improves; one that improves no other record belongs to its run."""
    lines = []
    for effect in result.helps or ():
        where = f"improves {', '.join(effect.on)}" if effect.on else "improves no other record: it belongs to this run"
        lines.append(f"{effect.effect}, found in {effect.found_in}: {where}")
    return lines


def words(symbol: str) -> str:
    """Return a parameter by its symbol, and in words if it has any."""
    head, at, mounting = symbol.partition("@")
    if head not in NAMES:
        return symbol
    return f"{symbol_text(symbol)} {physical_words(NAMES[head][0] + at + mounting)}"


def verdict_line(result: Diagnosis) -> str:
    """Return the verdict; if only the records together determine enough, with a remark on that."""
    text = VERDICTS[result.verdict]
    if result.radius is None:
        text = "insufficient: nothing is said of all together, as fewer than two records can be judged so"
    if result.verdict == "ambiguous" and len(result.sets) < 2:
        also = "as the cautions say" if result.caution else "that were not tried"
        text = f"ambiguous: one set makes all records consistent together, and others may {also}"
    verdicts, left_out = set(), []
    for entry in result.records or ():
        if entry.left_out is None:
            verdicts.add(entry.diagnosis.verdict)
        else:
            left_out.append(entry.record)
    if verdicts == {"insufficient"} and result.verdict != "insufficient":
        text += "; each by itself is insufficient, together they are not"
    if result.radius is not None and left_out:
        text += f"; not judged with the others: {', '.join(left_out)}"
    faulty = [entry.record for entry in result.records or () if entry.set_aside is not None]
    if faulty:
        text += f"; a fault of {' and '.join(faulty)} is set aside"
    return text


def set_aside(result: Diagnosis) -> list[str]:
    """Return the faults of single records, without which they are judged with the others."""
    texts = []
    for entry in result.records or ():
        if entry.set_aside is not None:
            texts.append(f"{entry.record}: {entry.set_aside} It is set aside")
    return texts


def sentences(result: Diagnosis) -> list[str]:
    """Return the found effects with owner and sizes."""
    texts = []
    for number, causes in enumerate(result.sets[:MOST_SETS]):
        for cause in causes:
            texts.append(f"or: {cause_text(cause)}" if number else cause_text(cause))
    if len(result.sets) > MOST_SETS:
        texts.append(f"... and {len(result.sets) - MOST_SETS} sets more")
    if result.verdict != "ambiguous":
        return texts
    if result.instrument == "yes":
        texts.append("in every one of these sets something is the instrument's")
    for label, answer in (result.runs or {}).items():
        if answer == "yes":
            texts.append(f"in every one of these sets something is of the run {label} alone")
    return texts


def cause_text(cause: Cause) -> str:
    """Return a cause with its owner and its sizes."""
    owner = "the instrument's" if cause.is_of_instrument else f"the run's, {cause.record} alone"
    sizes = [f"{p.name} {_possible(p, p.unit)}" for p in cause.parameters]
    alike = [place.title for place in cause.alike]
    same = f"; these records cannot tell it from {', '.join(alike)}" if alike else ""
    return f"{owner}: {cause.title}: {', '.join(sizes)}{same}"


def _possible(parameter: SizedParameter | Parameter, unit: str = "1") -> str:
    """Return an estimate, in a unit if one is given, and the ends of its interval."""
    value, low, high = interval(parameter.estimate, parameter.low, parameter.high)
    return f"{_in_unit(value, unit)} ({low} to {high})"


def _in_unit(number: str, unit: str) -> str:
    return f"{number} {unit_text(unit)}".rstrip()


def several_page(result: Diagnosis) -> Page:
    """Return the result of all records, of each by itself, repeatability, and the shared parameters."""
    texts = set_aside(result) + sentences(result)
    texts += result.not_named or ()
    texts += result.caution
    together = [sentence(text) for text in texts]
    if result.missing:
        together.append(f"Still open: {', '.join(map(str, result.missing))}.")
    rows = []
    provenance = versions()
    for entry in result.records or ():
        rows.append([entry.record, entry.diagnosis.verdict, _titles(entry.diagnosis.best), entry.left_out or None])
        provenance[entry.record] = entry.sha256
    alone = Table(["record", "verdict", "causes", "not judged with the others"], rows)
    shared = [f"One value for all: {', '.join(result.shared or ()) or 'no parameter'}."]
    if result.own:
        shared.append(f"Separate in each record: {', '.join(result.own)}.")
    if result.radius is not None and result.not_searched:
        shared.append(f"Not sought in several records together: {', '.join(result.not_searched)}.")
    sigma = _sigma(result)
    answer = [
        _changes(result.repeatability, sigma),
        Section("Together", together),
        Section("Each by itself", table=alone),
    ]
    answer += _gains(result)
    answer.append(Section("Shared parameters", shared))
    return Page(
        "Several records of one instrument",
        sentence(verdict_line(result)),
        answer,
        lambda: _repeatability(result.repeatability),
        TONES.get(result.verdict, "attention"),
        _key(result, sigma),
        provenance,
        cited("guaranteed", "simplex", "lawson", "left-out", "shuffles"),
    )


def _key(result: Diagnosis, sigma: float | None) -> dict[str, object]:
    """Return the figures below the verdict."""
    unit = "times the bound" if sigma is None else "σ"
    key: dict[str, object] = {"records": len(result.records or ())}
    if sigma is not None:
        key["noise bound σ"] = f"{upwards(sigma, 3)} g"
    if result.radius is not None:
        key["largest error, shared parameters"] = f"{residual(result.radius)} {unit}"
        if result.best is not None:
            key["with the causes"] = f"{residual(result.best.radius)} {unit}"
    if result.repeatability is not None:
        instrument = [change for change in result.repeatability.changes if change.of == "instrument"]
        changed = [change for change in instrument if change.at_least > 0.0]
        key["parameters of the instrument that change"] = f"{len(changed)} of {len(instrument)}"
    return key


def _sigma(result: Diagnosis) -> float | None:
    """Return the noise bound of the records of positions [g]; None if it has no single value."""
    bounds = set()
    for entry in result.records or ():
        calibration = entry.diagnosis.calibration
        bounds.add(calibration.sigma.value if calibration.positions else None)
    return bounds.pop() if len(bounds) == 1 else None


def _changes(alone: Calibration | None, sigma: float | None = None) -> Section:
    """Return the parameters of each record, and those that surely change; an empty section without several."""
    if alone is None or not drawable(alone):
        return Section("Changes")
    rows = []
    for change in alone.changes:
        if change.of == "instrument" and change.at_least > 0.0:
            row: list[Cell] = [words(change.symbol), downwards(change.at_least), upwards(change.at_most)]
            rows.append([*row, unit_text(change.unit)])
    text = "No parameter of the instrument surely changes."
    if rows:
        text = "A parameter has changed where the intervals of two records do not meet."
    names = {}
    for change in alone.changes:
        names[change.symbol] = words(change.symbol)
        for phrase, shorter in SHORTER.items():
            names[change.symbol] = names[change.symbol].replace(phrase, shorter)
    table = Table(["parameter of the instrument", "changes at least", "at most", "unit"], rows)
    caption = "Exact intervals of each record by itself, with the effects that are named, on one scale."
    return Section("Changes", [text], repeatability_picture(alone, sigma, names), caption, table)


def _titles(explanation: Explanation | None) -> str | None:
    if explanation is None or not explanation.causes:
        return explanation and explanation.sentence
    return ", ".join([cause.title for cause in explanation.causes])


def _gains(result: Diagnosis) -> list[Section]:
    """Return the change of each record's errors by an effect found in one record; empty without such a gain."""
    if not result.cross_gain:
        return []
    header = ["errors of", "without"]
    for applied in result.cross_gain[0].applied:
        header.append(f"with that of {applied.found_in}")
    header.append("unit")
    rows = []
    for gain in result.cross_gain:
        row: list[Cell] = [f"{gain.record}, {gain.over}", digits(gain.rms)]
        for applied in gain.applied:
            row.append(digits(applied.rms))
        row.append(gain.unit)
        rows.append(row)
    paragraphs = [
        "Root-mean-square errors with the effects of one record in the FMUs of each. Sizes are those of that record; "
        "biases, mounting and table are those of each record. A record without an explanation gives the effects that "
        "help it most."
    ]
    for line in helps_lines(result):
        paragraphs.append(sentence(line))
    return [Section("Effects of one record in the others", paragraphs, table=Table(header, rows))]


def _repeatability(alone: Calibration | None) -> list[Section]:
    """Return each parameter in each record by itself; empty if nothing is repeated."""
    if alone is None or not alone.changes:
        return []
    rows = []
    for change in alone.changes:
        for label, p in alone.each(change.symbol).items():
            row: list[Cell] = [words(change.symbol), change.of, label]
            row += interval(p.estimate, p.low, p.high)
            rows.append([*row, unit_text(change.unit)])
    header = ["parameter", "of", "record", "estimate", "low", "high", "unit"]
    return [Section("Each parameter in each record", table=Table(header, rows))]


CALIBRATED = {
    "consistent": "consistent: one value of each instrument parameter fits all records",
    "falsified": "falsified: no values of the parameters fit all records; `trihedron diagnose` finds the cause",
    "insufficient": "insufficient: the records together do not determine all parameters",
}


def joint_calibration_page(result: Calibration, _: object = None) -> Page:
    """Return the parameters of the instrument, then those of each record."""
    missing = []
    for direction in result.open:
        missing += direction.parameters
    texts = []
    if result.parameters:
        texts.append("Every value inside an interval is possible, none outside.")
    if missing:
        texts.append(f"Still open: {', '.join(missing)}.")
    answer = []
    if texts:
        answer.append(Section("The instrument", texts, table=_joint_table(result.parameters)))
    provenance = versions()
    for label, record in result.of_record.items():
        provenance[label] = record.provenance.sha256
        if record.parameters:
            answer.append(Section(f"{label} alone", table=_joint_table(record.parameters)))
    return Page(
        "An instrument calibrated by several records",
        sentence(CALIBRATED[result.verdict]),
        answer,
        tone="good" if result.verdict == "consistent" else "attention",
        key={"records": len(result.of_record), "largest residual": f"{residual(result.radius)} σ"},
        provenance=provenance,
        sources=cited("guaranteed", "simplex"),
    )


def _joint_table(parameters: Sequence[Parameter]) -> Table | None:
    """Return parameters with their intervals; None if there are none."""
    if not parameters:
        return None
    rows = table_of(parameters, ("symbol", "central", "low", "high", "unit"), {"symbol": words, "unit": unit_text})
    return Table(["parameter", "estimate", "at least", "at most", "unit"], rows.rows)


def entry_page(result: Entry) -> Page:
    """Return an entry, with date and temperature of its measurement."""
    return Page("An entry", entry_text(result), [])


def entry_text(entry: Entry) -> str:
    """Return an entry of an instrument's folder in a line."""
    warm = "" if entry.temperature is None else f", {digits(entry.temperature)} °C"
    serial = "" if entry.serial is None else f", of {entry.serial}"
    return f"{entry.date.removesuffix('T00:00')}{warm}: {entry.kind}, {entry.verdict}{serial}: {entry.file}"


def entries_page(result: Entries) -> Page:
    """Return the entries, in order of their dates."""
    lines = [entry_text(entry) for entry in result.entries]
    verdict = lines[0] if lines else "nothing is in the folder"
    return Page("Entries", verdict, [Section("Entries", lines[1:])])


def trend_page(result: Calibration, _: object = None) -> Page:
    """Return the parameters that are not constant, with the date since when, and all with their intervals."""
    changes, constants, judged = [], 0, 0
    for change in sorted(result.changes, key=lambda change: change.of == "run"):
        told_twice = len(result.each(change.symbol)) > 1
        judged += told_twice
        constants += told_twice and change.since is None
        if change.since is not None:
            owner = ", each run's own" if change.of == "run" else ""
            by = f"changes by {_in_unit(downwards(change.at_least), change.unit)} at least"
            since = f"changed by {change.since} (against {change.beside})"
            changes.append(sentence(f"{words(change.symbol)}{owner}: {since}: {by}"))
    verdict = f"{len(changes)} of the parameters have changed" if changes else "No parameter has surely changed"
    tone: Tone = "attention" if changes else "good"
    serial = result.provenance.comments.get("serial") if result.provenance is not None else None
    return Page(
        f"{serial or 'An instrument'} over time",
        f"{verdict}: {constants} of {judged} fit one value over {len(result.of_record)} dates.",
        [Section("Since when", changes), _changes(result)],
        lambda: _repeatability(result),
        tone,
        {"dates": len(result.of_record)},
        versions(),
        cited("guaranteed"),
    )
