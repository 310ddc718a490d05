"""What several records of one instrument say together: lines for a terminal, and the page."""

from collections.abc import Sequence

from ..calibrated import Calibration, Parameter
from ..calibration.targets import NAMES
from ..diagnosis.applied import Applied
from ..diagnosis.cause import SizedParameter
from ..diagnosis.repeated import InOneRecord, Repeated
from ..diagnosis.several import JointCause, Several
from ..document.blocks import Page, Section, Table, Tone
from ..document.notation import Cell, minus, sentence, unit_text
from ..instrument import Entries, Entry, Trend
from ..rounding import digits, downwards, interval, residual, upwards
from .makers import cited, versions
from .pictures.several import drawable, repeatability_picture

VERDICTS = {
    "consistent": "consistent: one value for each parameter of the instrument does for all; nothing must differ",
    "explained": "explained: one smallest set makes all records consistent together, and no other does",
    "ambiguous": "ambiguous: several smallest sets would make all records consistent together",
    "unexplained": "unexplained: shared parameters are falsified, and nothing that can be named mends it",
    "insufficient": "insufficient: the records cannot tell together whether the simulation is wrong",
}
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}
MOST_SETS = 6
"""So many sets that remain are printed."""


def lines(result: Several) -> list[str]:
    """The verdict, whose what was found is, each record by itself, repeatability."""
    said = [verdict_line(result), *(sentences(result))]
    said += [f"not named: {text}" for text in result.not_named if result.radius is not None]
    said += [f"caution: {text}" for text in result.caution]
    if result.missing:
        said.append(f"still open: {', '.join(result.missing)}")
    if result.radius is not None:
        best = result.radius_with_causes
        radius = residual(result.radius) + ("" if best is None else f", with the causes {residual(best)}")
        said.append(f"shared parameters, radius {radius}: {', '.join(result.shared) or 'none'}")
    for one in result.records:
        alone = f"{one.record} by itself: {one.diagnosis.verdict}{_named(one.diagnosis.causes)}"
        said.append(alone + ("" if one.left_out is None else f"; not judged with the others: {one.left_out}"))
    for one in result.repeatability:
        if one.of == "instrument" and one.at_least > 0.0:
            most = "" if one.at_most is None else f", {upwards(one.at_most)} at most"
            said.append(f"{words(one.name)} changes by {_in_unit(downwards(one.at_least), one.unit)} at least{most}")
    for gain in result.gains:
        applied = ", ".join(f"{one.found_in} {digits(one.rms)}" for one in gain.applied)
        said.append(f"{gain.record}, {gain.over}: {digits(gain.rms)} {gain.unit} rms; with what was found in {applied}")
    said += helps_lines(result)
    if result.not_searched and result.radius is not None:
        said.append(f"not sought in several records together: {', '.join(result.not_searched)}")
    return said


HOW = {
    "corrected": "taken out of the readings",
    "simulated": "simulated: it has no inverse that could be taken out of readings",
    "left": "left: a record of this kind does not show it, or its size alone does not say what it does",
}


def applied_lines(result: Applied) -> list[str]:
    """What became of each effect, and the errors of the simulation without and with them."""
    said = [f"{one.effect}: {HOW[one.how]}" for one in result.effects]
    if result.rms_without is not None:
        ends = zip((result.rms_without, result.max_without), (result.rms_with, result.max_with), strict=True)
        rms, most = (" -> ".join(digits(value or 0.0) for value in pair) for pair in ends)
        said.append(f"{result.over}, simulated without and with them: {rms} {result.unit} rms, at most {most}")
    return said + [f"warning: {text}" for text in result.warnings]


def helps_lines(result: Several) -> list[str]:
    """Where each effect that was found helps; one that helps nowhere else is the run's."""
    return [
        f"{one.effect}, found in {one.found_in}: "
        + (f"helps on {', '.join(one.on)}" if one.on else "helps on no other record: it is the run's")
        for one in result.helps
    ]


def words(name: str) -> str:
    """A parameter by its symbol, and in words where it has such."""
    known = NAMES.get(name.partition("@")[0])
    return name if known is None else f"{name}, {known[0]}"


def _named(causes: Sequence[object]) -> str:
    return "".join(f", {cause.place.title}" for cause in causes)  # type: ignore[attr-defined]


def verdict_line(result: Several) -> str:
    """The first line: the verdict; where records that say too little alone say enough together, that they do."""
    said = VERDICTS[result.verdict]
    if result.radius is None:
        said = "insufficient: nothing is said of all together, as fewer than two records can be judged so"
    if result.verdict == "ambiguous" and not result.alternatives:
        also = "as the cautions say" if result.caution else "that were not tried"
        said = f"ambiguous: one set makes all records consistent together, and others may {also}"
    alone = [one.diagnosis.verdict for one in result.records if one.left_out is None]
    if alone and set(alone) == {"insufficient"} and result.verdict != "insufficient":
        said += "; each by itself is insufficient, together they are not"
    if result.radius is not None and (left := [one.record for one in result.records if one.left_out is not None]):
        said += f"; not judged with the others: {', '.join(left)}"
    return said


def sentences(result: Several) -> list[str]:
    """What is found, whose it is, with its sizes."""
    sets = (result.causes, *result.alternatives)[:MOST_SETS]
    said = [f"{'or: ' if number else ''}{cause_text(cause)}" for number, causes in enumerate(sets) for cause in causes]
    if len(result.alternatives) >= MOST_SETS:
        said.append(f"... and {len(result.alternatives) - MOST_SETS + 1} sets more")
    if result.verdict == "ambiguous":
        of_run = [label for label, told in result.runs.items() if told == "yes"]
        said += ["in every one of these sets something is the instrument's"] if result.instrument == "yes" else []
        said += [f"in every one of these sets something is of the run {label} alone" for label in of_run]
    return said


def cause_text(cause: JointCause) -> str:
    """A cause with its owner and its sizes."""
    owner = "the instrument's" if cause.of == "instrument" else f"the run's, {cause.record} alone"
    sizes = [f"{p.name} {_possible(p, p.unit)}" for p in cause.parameters]
    same = f"; these records cannot tell it from {', '.join(cause.equivalents)}" if cause.equivalents else ""
    return f"{owner}: {cause.title}: {', '.join(sizes)}{same}"


def _possible(one: SizedParameter | InOneRecord | Parameter, unit: str = "1") -> str:
    """What is stated, in a unit where one is said, and the ends of what is possible."""
    value, low, high = interval(one.estimate, one.low, one.high)
    return f"{_in_unit(value, unit)} ({low} to {high})"


def _in_unit(number: str, unit: str) -> str:
    return f"{number} {unit_text(unit)}".rstrip()


def page(result: Several) -> Page:
    """The page: together, each by itself, repeatability, what was shared."""
    found = [sentence(text) for text in sentences(result)]
    why = [sentence(text) for text in (*result.not_named, *result.caution)]
    together = Section("Together", [*found, *why] or ["Nothing must differ."])
    rows: list[list[Cell]] = [
        [one.record, one.diagnosis.verdict, _named(one.diagnosis.causes)[2:], one.left_out or ""]
        for one in result.records
    ]
    header = ["record", "verdict", "causes", "not judged with the others"]
    alone = Section("Each by itself", table=Table(header, rows))
    own = [f"Each record's own: {', '.join(result.own)}."] if result.own else []
    not_sought = [f"Not sought in several records together: {', '.join(result.not_searched)}."] if result.radius else []
    shared = Section(
        "What is shared", [f"One value for all: {', '.join(result.shared) or 'no parameter'}.", *own, *not_sought]
    )
    return Page(
        "Several records of one instrument",
        sentence(verdict_line(result)),
        [together, alone, *_gains(result), *_repeatability(result.repeatability), shared],
        TONES.get(result.verdict, "attention"),
        {} if result.radius is None else {"radius with shared parameters": residual(result.radius)},
        {**versions(), **{one.record: one.sha256 for one in result.records}},
        cited("guaranteed", "simplex", "lawson", "left-out", "shuffles"),
    )


def _gains(result: Several) -> list[Section]:
    if not result.gains:
        return []
    sources = [one.found_in for one in result.gains[0].applied]
    rows: list[list[Cell]] = [
        [f"{gain.record}, {gain.over}", digits(gain.rms), *(digits(one.rms) for one in gain.applied), gain.unit]
        for gain in result.gains
    ]
    said = (
        "What was found in one record, applied to each by the extended FMUs: errors, root mean square. Sizes are those "
        "of the one record; a record's own biases, or mounting and table, are its own. What explains nothing by "
        "itself, but helps most, counts as found."
    )
    table = Table(["errors of", "without", *(f"with that of {source}" for source in sources), "unit"], rows)
    return [Section("What one record says of the others", [said, *map(sentence, helps_lines(result))], table=table)]


def _typeset(name: str) -> str:
    """A parameter and its name, the sign of a symbol in typography."""
    return words(name).replace("-X", "−X")


def _repeatability(found: Sequence[Repeated]) -> list[Section]:
    if not found:
        return []
    labels = [record.record for record in found[0].records]
    rows: list[list[Cell]] = []
    for one in found:
        cells = [None if record.estimate is None else minus(_possible(record)) for record in one.records]
        most = None if one.at_most is None else upwards(one.at_most)
        rows.append([_typeset(one.name), one.of, *cells, downwards(one.at_least), most, unit_text(one.unit)])
    header = ["parameter", "of", *labels, "changes at least", "at most", "unit"]
    said = (
        "Each record by itself, with the effects that are named. Every value inside an interval is possible, "
        "none outside: where two intervals do not meet, the parameter is no constant."
    )
    drawn = drawable(found)
    caption = "A bar for each record, in their order from above; each row has a scale of its own."
    picture = repeatability_picture(found) if drawn else None
    return [Section("Repeatability", [said], picture, caption if drawn else "", Table(header, rows))]


CALIBRATED = {
    "consistent": "consistent: one value for each parameter of the instrument does for all",
    "falsified": "falsified: the instrument's parameters have no one value for all; `trihedron diagnose` says why",
    "insufficient": "insufficient: the records together leave parameters open",
}


def joint_calibration_lines(result: Calibration) -> list[str]:
    """The verdict; each parameter, the instrument's first, with its interval."""
    said = [CALIBRATED[result.verdict], f"{len(result.of_record)} records, radius {residual(result.radius)}"]
    for record, parameters in _owners(result):
        where = f" in {record}" if record else ""
        said += [f"{words(p.symbol)}{where}: {_possible(p, p.unit)}" for p in parameters if p.bounded]
    return said + _still_open(result)


def _owners(result: Calibration) -> list[tuple[str, list[Parameter]]]:
    """The parameters of the instrument, whose label is empty, then those of each record."""
    return [("", result.parameters), *((label, record.parameters) for label, record in result.of_record.items())]


def _still_open(result: Calibration) -> list[str]:
    """What the records leave open, in a line."""
    missing = [symbol for direction in result.open for symbol in direction.parameters]
    return [f"still open: {', '.join(missing)}"] if missing else []


def joint_calibration_page(result: Calibration) -> Page:
    """The page: what is the instrument's, then what is each record's own."""
    sections = []
    for record, parameters in _owners(result):
        rows: list[list[Cell]] = []
        for p in parameters:
            value, low, high = interval(p.estimate, p.low, p.high) if p.bounded else (None, None, None)
            rows.append([_typeset(p.symbol), value, low, high, unit_text(p.unit)])
        said = ["Every value inside an interval is possible, none outside."] if not record and rows else []
        if not record:
            said += map(sentence, _still_open(result))
        head = f"{record} alone" if record else "The instrument"
        table = Table(["parameter", "estimate", "at least", "at most", "unit"], rows) if rows else None
        sections += [Section(head, said, table=table)] if said or table else []
    return Page(
        "An instrument calibrated by several records",
        sentence(CALIBRATED[result.verdict]),
        sections,
        "good" if result.verdict == "consistent" else "attention",
        {"records": len(result.of_record), "radius": residual(result.radius)},
        {**versions(), **{label: record.provenance.sha256 for label, record in result.of_record.items()}},
        cited("guaranteed", "simplex"),
    )


def entry_lines(result: Entry) -> list[str]:
    """What an entry is, and when and how warm it was measured."""
    warm = "" if result.temperature is None else f", {digits(result.temperature)} °C"
    of = "" if result.serial is None else f", of {result.serial}"
    return [f"{result.date.removesuffix('T00:00')}{warm}: {result.kind}, {result.verdict}{of}: {result.file}"]


def entries_lines(result: Entries) -> list[str]:
    """The entries, in order of their dates."""
    return [line for entry in result.entries for line in entry_lines(entry)] or ["nothing is in the folder"]


def trend_lines(result: Trend) -> list[str]:
    """Parameters that are no constants, with the date since when; then how many may be."""
    said = []
    for one in sorted(result.parameters, key=lambda one: one.of == "run"):
        if one.falsified is not None:
            whose = ", each run's own" if one.of == "run" else ""
            change = f"changes by {_in_unit(downwards(one.at_least), one.unit)} at least"
            said.append(f"{words(one.name)}{whose}: no constant since {one.falsified} (beside {one.against}): {change}")
    told = [one for one in result.parameters if sum(r.low is not None for r in one.records) > 1]
    kept = sum(one.falsified is None for one in told)
    return [*said, f"{kept} of {len(told)} parameters may be constants over {len(result.dates)} dates"]


def trend_page(result: Trend) -> Page:
    """The page: what is no constant, and all parameters with their intervals."""
    lines = trend_lines(result)
    changed = sum(one.falsified is not None for one in result.parameters)
    verdict = f"{changed} parameters are no constants" if changed else "Every parameter may be a constant"
    sections = [Section("Since when", [sentence(line) for line in lines]), *_repeatability(result.parameters)]
    title = "An instrument over time" if result.serial is None else f"{result.serial} over time"
    tone: Tone = "attention" if changed else "good"
    return Page(title, f"{verdict}.", sections, tone, {"dates": len(result.dates)}, versions(), cited("guaranteed"))
