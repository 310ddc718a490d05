"""Contents of the page of a record, as plain values. A process of their own computes them and keeps the records that it
has read.

The answers are those of the functions of the library, on which the commands are a thin layer.
"""

import inspect
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from .. import by_hand, corrections, diagnosis, document, foreign, measured, motion, records, reports
from .. import calibration as calibrations
from ..document.notation import plain as plain_text
from ..document.notation import unit_text
from ..errors import InputError, one_line, reason
from ..files import json_text, write_text
from ..memory import Memory, each, kept, once
from ..options import ExportTarget
from ..records.limits import channel_limits, runs_of
from ..rounding import digits, interval, residual
from .equivalents import PLACE, command_line, python_lines
from .lines import GROUPS, SeriesChannels, lines_of, plain

OPTIONS: dict[str, type] = {
    "noise_bound": float,
    "noise_sd": float,
    "gravity": float,
    "rest_scatter": float,
    **dict.fromkeys(PLACE, float),
    "faces": str,
    "turns": str,
    "stamps": str,
    "channels": str,
    "trust": bool,
    "dwell": float,
    "positions": int,
}
"""Options that the page takes, and the type of their values."""
FUNCTIONS = {
    "calibrate": (measured.calibrate, measured.calibrate_together),
    "diagnose": (measured.diagnose, measured.diagnose_together),
    "noise": (measured.noise, measured.noise),
    "inspect": (measured.inspect, None),
}
"""Command -> its function for one record, and for several."""
ENDINGS = {"kalibr": ".yaml", "imucal": ".json", "ros": ".yaml", "c": ".h", "matlab": ".mat"}
ENDINGS |= {"csv": ".csv", "xlsx": ".xlsx"}
"""Target of an export -> ending of its file."""
MOST_ROWS = 2000
"""Most rows of a table that are shown."""
MOST_MARKS, MOST_OPEN = 200, 3
FIRST_ROWS, DIGITS, MOST_CHARACTERS = 6, 8, 40
"""Rows of an imported file that are shown, digits of their numbers, characters of a cell."""
KEPT: dict[tuple[Any, ...], records.Record] = {}
"""Records that were read, by file and the way of reading."""
MOST_KEPT = 8
MEMORY: Memory = Memory()
"""Values of the records that the last question was about."""
ABOUT: list[str] = []
"""Their files."""
MOST_ROWS_KEPT = 3_000_000
"""Values of calculations with longer records are not kept: they would fill the memory."""
RESULTS: "dict[tuple[str, ...], Shown]" = {}
"""The last results, for their pages and files, by the command and the paths."""


@dataclass(frozen=True)
class Shown:
    """A result with its records and options.

    Attributes
    ----------
    result : Result
    record : record or None
        the record for its page
    run : record
        the first record, with decisions
    channels : tuple of str
        the channels with which it was read
    """

    result: Any
    record: Any
    run: Any
    channels: tuple[str, ...]


def shown(command: str, paths: Sequence[str]) -> Shown:
    """Return the last result of a command about files; an InputError where it is not kept."""
    if (command, *paths) not in RESULTS:
        raise InputError("stopping the calculation removed its result; calculate again")
    return RESULTS[command, *paths]


def _keep(key: tuple[str, ...], result: Shown) -> None:
    """Keep a result, and the latest others."""
    RESULTS.pop(key, None)
    while len(RESULTS) >= MOST_KEPT:
        del RESULTS[next(iter(RESULTS))]
    RESULTS[key] = result


def outcome(function: Callable[..., Any], *arguments: Any) -> tuple[Any, str]:
    """Return the value of a function and an empty text; or None and the line with the reason of a refusal."""
    try:
        with kept(MEMORY):
            return function(*arguments), ""
    except (InputError, OSError) as error:
        return None, refusal_of(error)
    except Exception as error:
        return None, one_line(f"a fault of the program: {type(error).__name__}: {error}")


def refusal_of(error: InputError | OSError) -> str:
    """Return the line of an error; that of the system names the file."""
    if isinstance(error, InputError) or error.filename is None:
        return one_line(str(error))
    return one_line(f"{Path(error.filename).name}: {reason(error)}")


def record_at(path: str, stamps: str | None = None) -> records.Record:
    """Return the record of a file without decisions, read once."""
    status = Path(path).stat()
    key = (path, status.st_mtime_ns, status.st_size, stamps)
    if key not in KEPT:
        while len(KEPT) >= MOST_KEPT:
            del KEPT[next(iter(KEPT))]
        KEPT[key] = records.read_undecided(_typed_path(path), stamps=stamps)
    return KEPT[key]


def described(path: str) -> dict[str, Any]:
    """Return the contents of a file: kind, rows, columns, and the decisions in the file beside it.

    Raises
    ------
    InputError
        for a file that holds no record
    """
    record = record_at(path)
    is_table = isinstance(record, records.PositionRecord | records.PoseRecord)
    warnings = list(record.warnings)
    decisions = None
    try:
        decisions = records.read_decisions(record.path, record.sha256)
    except InputError as error:
        warnings.append(f"{error}; your first decision here replaces it")
    about: dict[str, Any] = {
        "word": record.word,
        "rows": len(record),
        "seconds": None if is_table else float(record.time_s[-1] - record.time_s[0]),
        "table": is_table,
        "columns": list(record.columns()),
        "sha256": record.sha256,
        "warnings": warnings,
        "decisions": values_of(decisions),
        "moved": isinstance(record, records.RawRecord),
    }
    if is_table:
        about["table_rows"] = table_of(record)
    return about


def understood(path: str, given: Mapping[str, str], out: str = "") -> dict[str, Any]:
    """Return how a laboratory's file is read: open questions, or the columns and first rows of its record.

    Parameters
    ----------
    path : str
    given : mapping of str to str
        question -> answer
    out : str
        the record to write; empty: none is written

    Raises
    ------
    InputError
        for a file that holds no table of measurements, or an answer that is none
    """
    words = ["trihedron", "import", str(_typed_path(path)), "--out", f"{Path(path).stem}.record.csv"]
    for key, value in given.items():
        words += ["--set", f"{key}={value}"]
    command = shlex.join(words)
    try:
        imported = foreign.make_record(_typed_path(path), out=Path(out) if out else None, answers=given)
    except foreign.OpenQuestions as error:
        questions = []
        for question in error.questions:
            questions.append({"key": question.key, "answers": list(question.answers), "why": question.why})
        rows = [[text[:MOST_CHARACTERS] for text in row] for row in error.rows[:FIRST_ROWS]]
        return {"questions": questions, "columns": [], "header": list(error.header), "rows": rows, "command": command}
    columns = []
    for column in imported.columns:
        unit = f" [{column.unit}]" if column.unit else ""
        columns.append(f"{column.column} from {column.source}{unit}{' reversed' if column.sign < 0 else ''}")
    first = imported.record.to_polars().head(FIRST_ROWS)
    rows = [[_cell(value) for value in row] for row in first.iter_rows()]
    return {"questions": [], "columns": columns, "header": first.columns, "rows": rows, "command": command}


def _cell(value: object) -> str:
    """Return a value of a table as text; a missing one is empty."""
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    return "" if value is None else str(value)


def values_of(decisions: records.Decisions | None) -> dict[str, Any]:
    """Return decisions as plain values."""
    if decisions is None:
        return {}
    values: dict[str, Any] = {"left_out": list(decisions.left_out), "turns": decisions.turns}
    if decisions.rests is not None:
        values["rests"] = [[rest.from_s, rest.to_s, rest.face] for rest in decisions.rests]
    return values


def table_of(record: records.PositionRecord | records.PoseRecord) -> dict[str, Any]:
    """Return the first rows of a table of averaged readings, numbers as written."""
    columns = {"position": record.position, **record.columns()}
    rows = []
    for number in range(min(len(record), MOST_ROWS)):
        cells = []
        for values in columns.values():
            value = values[number]
            cells.append(value if isinstance(value, str) else f"{float(value):.10g}")
        rows.append(cells)
    return {"header": list(columns), "rows": rows}


def decided(path: str, decisions: Mapping[str, Any], options: Mapping[str, Any]) -> records.Record:
    """Return the record of a file with decisions; an InputError if it is not of the content that these are about."""
    record = record_at(path, options.get("stamps"))
    if decisions.get("record_sha256", record.sha256) != record.sha256:
        raise InputError(f"{Path(path).name}: has changed since it was opened; start `trihedron open` again")
    taken = records.decisions_of(decisions, "decisions")
    if taken:
        taken = replace(taken, file=records.decisions_file(Path(path)).name)
    return records.with_decisions(record, taken)


def decided_size(path: str, decisions: Mapping[str, Any]) -> int:
    """Return the number of rows that decisions keep; an InputError of decisions that do not go with the record."""
    return len(decided(path, decisions, {}))


def lines(path: str, begin: float | None, end: float | None, points: int) -> dict[str, Any]:
    """Return the lines of a series between two times [s]; all of it without these."""
    record = record_at(path)
    if record.time_s is None:
        raise InputError(f"{record.path}: has no times")
    channels = {field: getattr(record, field, None) for _, field, *_ in GROUPS}
    return lines_of(SeriesChannels(record.time_s, channels), begin, end, points)


def rests(path: str, decisions: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the rests of a series, those that are refused with the reason, and what else is marked in it.

    A rest has "from_s", "to_s", "face", "norm" [g], "scatter" [g] and "refused"; a mark its "kind", its "from_s" and
    "to_s", and "what" it is in words.
    """
    record: Any = decided(path, decisions, options)
    if isinstance(record, records.PositionRecord | records.PoseRecord):
        raise InputError(f"{record.path}: a table of averaged readings has no rests")
    _keep_only([path])
    listed: list[dict[str, Any]] = []
    moves: list[dict[str, Any]] = []
    reason = ""
    try:
        rests_of_record, moved = _rests_of(record, options)
        sizes = each(_size_at_rest, record.specific_force, [rows for rows, _, _ in rests_of_record])
        for (rows, face, refused), size in zip(rests_of_record, sizes, strict=True):
            listed.append({**_ends(record, rows.start, rows.stop - 1), "face": face, "refused": refused, **size})
        for first, last in moved:
            moves.append({**_ends(record, first, last), "kind": "move", "what": "move"})
    except InputError as error:
        reason = str(error)
    return {"rests": listed, "reason": reason, "marks": [*moves, *once(_marks_of, record)]}


def _keep_only(paths: Sequence[str]) -> None:
    """Forget the values of other records."""
    if list(paths) != ABOUT:
        MEMORY.clear()
    ABOUT[:] = paths


def _size_at_rest(values: NDArray) -> dict[str, float]:
    """Return the norm of the mean of readings (n, 3) and their largest scatter [g]."""
    force = values / STANDARD_GRAVITY
    return {"norm": float(np.linalg.norm(force.mean(axis=0))), "scatter": float(force.std(axis=0).max())}


def _ends(record: Any, first: int, last: int) -> dict[str, float]:
    return {"from_s": float(record.time_s[first]), "to_s": float(record.time_s[last])}


Moved: TypeAlias = list[tuple[int, int]]
"""First and last row of each move."""


def _rests_of(record: Any, options: Mapping[str, Any]) -> tuple[list[tuple[slice, str, str]], Moved]:
    """Return rows, face and reason of refusal of each rest of a series, and the moves between them."""
    if isinstance(record, records.RawRecord):
        of_table = records.position_record_of(record).rests or ()
        moved = [(rest.last, then.first) for rest, then in pairwise(of_table)]
        return [(rest.kept, "", rest.refused or "") for rest in of_table], moved
    known = {name: options[name] for name in ("gravity", "rest_scatter", "faces") if name in options}
    run = None
    try:
        run = by_hand.run_of(record, by_hand.HandRequest.told(**known))
    except InputError:
        if record.decisions is None:
            raise
    moved: Moved = []
    if run is not None and run.moves is not None:
        # Between rests; of a record with a true attitude the windows that are compared.
        pairs = getattr(run.moves, "rests", None)
        of_run, ends = run.rests.rows, run.moves.way.ends
        moved = ends.tolist() if pairs is None else [(of_run[a].stop - 1, of_run[b].start) for a, b in pairs.tolist()]
    if record.decisions is not None and record.decisions.rests is not None:
        # All of them, whether a calibration takes them or not.
        rows = records.rows_of_rests(record.time_s, record.decisions.rests, record.path.name)
        faces = [rest.face for rest in record.decisions.rests]
        return [(rows_of_rest, face, "") for rows_of_rest, face in zip(rows, faces, strict=True)], moved
    return [(rows, "", "") for rows in (run.rests.rows if run else ())], moved


def _marks_of(record: Any) -> list[dict[str, Any]]:
    """Return stretches with readings that are not used, at a limit or unlike their neighbours, and gaps."""
    marks = []
    stretches = {("spike", "knock"): record.knocks}
    stretches |= {("spike", words): rows for words, rows in motion.odd_rows(record).items()}
    if not isinstance(record, records.ForceRecord):
        stretches |= {("limit", f"limit of {name}"): rows for name, rows in once(channel_limits, record).rows.items()}
    for (kind, what), rows in stretches.items():
        for first, stop in list(zip(*runs_of(rows), strict=True))[:MOST_MARKS]:
            marks.append({**_ends(record, first, stop - 1), "kind": kind, "what": what})
    steps = np.diff(record.time_s)
    for row in np.flatnonzero(steps > 2.5 * np.median(steps))[:MOST_MARKS].tolist():
        marks.append({**_ends(record, row, row + 1), "kind": "gap", "what": "gap"})
    return marks


def checked_options(command: str, several: bool, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a command from texts of the page.

    Raises
    ------
    InputError
        for an option that the command does not take
    """
    function = FUNCTIONS[command][several]
    if function is None:
        raise InputError(f"{command}: takes one record")
    known = {*inspect.signature(function).parameters, *(PLACE if command in ("calibrate", "diagnose") else ())}
    options = typed(values)
    for name in options:
        if name not in known:
            raise InputError(f"--{name.replace('_', '-')}: `{command}` of this record has no such option")
    return options


def typed(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return options of their types from texts; empty ones are left out.

    Raises
    ------
    InputError
        for an option that the page does not have, or a value that is none
    """
    options: dict[str, Any] = {}
    for name, value in values.items():
        if value in ("", None, False):
            continue
        if name not in OPTIONS:
            raise InputError(f"--{name.replace('_', '-')}: is not an option of the page")
        try:
            options[name] = OPTIONS[name](value)
        except (ValueError, TypeError) as error:
            raise InputError(f"--{name.replace('_', '-')} {value}: a number is needed, as 1e-5") from error
    return options


@dataclass(frozen=True)
class FilesCommand:
    """A command about files with decisions, its options as the page has them."""

    command: str
    paths: Sequence[str]
    decisions: Sequence[Mapping[str, Any]]
    options: Mapping[str, Any]


Advise: TypeAlias = Callable[[str, Sequence[str], Mapping[str, Any], Any], str]
"""Gives the command that follows, by command, files, options and result."""


def answer(asked: FilesCommand, advise: Advise | None = None) -> dict[str, Any]:
    """Return the answer of a command, and the ways to have it without the page.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line
    """
    command, several = asked.command, len(asked.paths) > 1
    options = checked_options(command, several, asked.options)
    runs = []
    for path, made in zip(asked.paths, asked.decisions, strict=True):
        runs.append(decided(path, made, options))
    _keep_only(asked.paths)
    result, record = _result(command, runs, options)
    if sum(map(len, runs)) > MOST_ROWS_KEPT:
        MEMORY.clear()
    page = reports.page_of(result, record)
    assert page is not None
    channels = (options["channels"],) if "channels" in options else ()
    _keep((command, *asked.paths), Shown(result, record, runs[0], channels))
    typed_paths = [str(_typed_path(path)) for path in asked.paths]
    following = "" if advise is None else advise(command, typed_paths, options, result)
    return {
        "verdict": page.verdict,
        "tone": page.tone,
        "key": {plain_text(name): plain_text(value) for name, value in page.key.items()},
        "sentences": [*_sentences(page), *_open(result)],
        "warnings": list(page.warnings),
        "parameters": _parameters(result),
        "gives": _gives(result),
        "wrong": _wrong_positions(result, runs[0]),
        "explanations": _explanations(result),
        "next": following,
        "command": command_line(command, typed_paths, options),
        "python": python_lines(command, typed_paths, options),
    }


def _typed_path(path: str) -> Path:
    """Return a path as one would type it in the working folder."""
    with suppress(ValueError):
        return Path(path).relative_to(Path.cwd())
    return Path(path)


def _sentences(page: document.Page) -> list[str]:
    """Return the first sentences of the answer of a page without figures."""
    if page.key or not page.answer:
        return []
    return [plain_text(sentence).replace("`", "") for sentence in page.answer[0].paragraphs[:3]]


def _open(result: Any) -> list[str]:
    """Return the open directions of a calibration, each with the readings that would close it."""
    lines = []
    for direction in getattr(result, "open", ())[:MOST_OPEN]:
        closing = f"; measure {direction.close_by}" if direction.close_by else ""
        lines.append(f"Open: {', '.join(direction.parameters)}{closing}.")
    return lines


def _result(command: str, runs: Sequence[Any], options: dict[str, Any]) -> tuple[Any, Any]:
    """Return the result of a command, and the record for its page."""
    one, several = FUNCTIONS[command]
    known = dict(options)
    known.pop("stamps", None)
    if "channels" in known:
        known["channels"] = (known["channels"],)
    place = {name: known.pop(name) for name in PLACE if name in known}
    if len(runs) > 1:
        assert several is not None
        return several(*runs, **known), None
    if command == "noise":
        return one(runs[0], **known), None
    if command == "inspect":
        result = one(runs[0], **known)
        return result, result.record
    record = runs[0]
    if isinstance(record, records.RawRecord):
        record = records.position_record_of(record)
    if place or isinstance(record, records.PositionRecord):
        known["bench"] = measured.bench_at(record, **place)
    return one(record, **known), record


def _parameters(result: Any) -> list[dict[str, Any]]:
    """Return symbol, estimate and ends of each parameter, for a comparison of before and after."""
    calibration = getattr(result, "calibration", result)
    parameters = []
    for parameter in getattr(calibration, "parameters", ()):
        row = {name: getattr(parameter, name, None) for name in ("symbol", "estimate", "low", "high", "unit")}
        row["name"] = str(getattr(parameter, "name", ""))
        numbers = [row[name] for name in ("estimate", "low", "high")]
        row["estimate"], row["low"], row["high"] = plain(np.array([_or_nan(number) for number in numbers]), 7)
        row["text"] = _interval_text(numbers, parameter.standard_error)
        row["unit"] = unit_text(parameter.unit)
        parameters.append(row)
    return parameters


def _interval_text(numbers: Sequence[float | None], error: float | None) -> str:
    """Return an estimate with its ends or its standard error; "open" where it is not determined."""
    if numbers[0] is None:
        return "open"
    if numbers[1] is None and error:
        estimate, _, _ = interval(numbers[0], numbers[0] - error, numbers[0] + error)
        return f"{estimate} ± {digits(error, 2)}"
    estimate, low, high = interval(*numbers)
    return str(estimate) if numbers[1] is None else f"{estimate} ({low} to {high})"


def _gives(result: Any) -> list[str]:
    """Return the files that a result can give: words of `saved`, and "export" for those of other programs."""
    files = ["json", "report"]
    if isinstance(result, diagnosis.Diagnosis) and result.explanations:
        files += ["corrected", "fmu"]
    if isinstance(result, calibrations.Calibration):
        files += ["corrected", "fmu", "export"]
    return files


def _or_nan(number: float | None) -> float:
    return float("nan") if number is None else float(number)


def _wrong_positions(result: Any, record: Any) -> list[int]:
    """Return the numbers of the positions that a diagnosis names wrong; it counts the rows of the file."""
    explanations = getattr(result, "explanations", ())
    if not explanations or explanations[0].kind != "rows" or not hasattr(record, "position"):
        return []
    return record.position[np.isin(record.numbers, explanations[0].rows or ())].tolist()


def _explanations(result: Any) -> list[dict[str, Any]]:
    """Return the explanations of a diagnosis: sentence, count of numbers, largest errors and sizes."""
    listed = []
    for explanation in getattr(result, "explanations", ()):
        radius = "unknown" if explanation.radius is None else f"{residual(explanation.radius)} σ"
        listed.append(
            {
                "sentence": explanation.sentence,
                "numbers": explanation.numbers,
                "radius": radius,
                "without": "unknown" if result.radius is None else f"{residual(result.radius)} σ",
                "sizes": _sizes(explanation),
            }
        )
    return listed


def _sizes(explanation: Any) -> list[tuple[str, str]]:
    """Return the names and the sizes, with their ends, of what an explanation adds."""
    sizes = []
    for cause in explanation.causes:
        for name, estimate, least, most, unit in reports.sizes_of(cause):
            sizes.append((f"{cause.place.title}, {name}", f"{estimate} ({least} to {most}) {unit}".strip()))
    for name, value in (explanation.change or {}).items():
        sizes.append((name, str(value if isinstance(value, str) else digits(value))))
    return sizes


def page(command: str, paths: Sequence[str], explanation: int | None = None) -> str:
    """Return the page of a result, or of one explanation of a diagnosis, as HTML; an InputError where there is none."""
    result = shown(command, paths)
    if explanation is None:
        of_result = reports.page_of(result.result, result.record)
        assert of_result is not None
        return document.html(of_result)
    if not isinstance(result.result, diagnosis.Diagnosis):
        raise InputError("this result is not a diagnosis")
    return document.html(reports.explanation_page(result.result, explanation))


def saved(command: str, paths: Sequence[str], what: str) -> dict[str, Any]:
    """Write a file of a result beside its first record; `what` is a target of an export, or one of these words.

    "json", "report", "corrected": the result, its page, the corrected record; "fmu": a folder of FMUs. A file that is
    there already is kept: the new one has a number in its name.

    Raises
    ------
    InputError
        for an output that the result does not have
    """
    kept_result, beside = shown(command, paths), Path(paths[0])
    result = kept_result.result
    kind = type(result).__name__.lower()
    if what == "json":
        out = free_name(beside.with_name(f"{beside.stem}.{kind}.json"))
        write_text(out, json_text(result.to_json()))
    elif what == "report":
        out = free_name(beside.with_name(f"{beside.stem}.{kind}.html"))
        reports.write_report(out, result, kept_result.record)
    elif what == "corrected":
        out = free_name(beside.with_name(f"{beside.stem}.corrected.csv"))
        corrected = corrections.apply(result, kept_result.run, channels=kept_result.channels).record
        if corrected is None:
            raise InputError("the diagnosis names nothing that a correction could remove")
        records.write_record(corrected, out)
    elif what == "fmu":
        out = free_name(beside.with_name(f"{beside.stem}-fmus"))
        _export(result, out)
    elif what in ENDINGS:
        out = free_name(beside.with_name(f"{beside.stem}.{what}{ENDINGS[what]}"))
        noise = _noise_for(beside) if what == "kalibr" else None
        corrections.export_calibration(result, cast("ExportTarget", what), out, noise=noise)
    else:
        raise InputError(f"{what}: is not a format for a result")
    return {"file": str(out)}


def _noise_for(beside: Path) -> Path:
    """Return the saved noise of a record, whose densities kalibr needs."""
    noise = beside.with_name(f"{beside.stem}.noise.json")
    if not noise.is_file():
        raise InputError(f"kalibr needs noise densities: run Noise and save it as {noise.name}; then calibrate")
    return noise


def _export(result: Any, folder: Path) -> None:
    """Write the FMUs of a calibration, or of a diagnosis with its cause."""
    if isinstance(result, diagnosis.Diagnosis):
        if not diagnosis.export_extended(result, folder):
            raise InputError(f"nothing to export, {diagnosis.nothing_exported(result)}")
    else:
        calibrations.export_calibrated(result, folder)


def free_name(path: Path) -> Path:
    """Return the path, with a number where it is taken."""
    taken, number = path, 2
    while taken.exists():
        taken = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return taken
