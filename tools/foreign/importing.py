"""Import a measured file from elsewhere: read it, ask about it, write the record with its mapping."""

from collections.abc import Mapping as AnyMapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from ..files import (
    TAIL,
    at_once,
    bytes_of,
    cut_warning,
    is_workbook,
    note_own,
    note_read,
    ordinary_file,
    together,
    write_text,
)
from ..motion import trust_of, unchecked_gyros
from ..records import Record, write_record
from ..records.columns import FORCE, FORCES, SCATTER, VELOCITY, RecordKind
from ..records.read import PACKED, record_from
from ..result import ABSENT, Result
from ..rounding import upwards
from .containers import is_container, read_begin
from .conversion import Conversion, converted, record_columns
from .deciding import understood
from .frames import with_whole_text
from .joining import (
    GUESSES,
    GYROS,
    TableInFile,
    joined,
    of_instance,
    rank_of,
    sheet_in_memory,
    sheet_of_part,
    tables_in,
)
from .labelled import labelled_sheet
from .layout import has_table, layout_of, upright, with_exact_seconds, with_rate_above
from .mapping import (
    OPEN,
    SCHEMA,
    Mapping,
    OpenQuestions,
    mapping_text,
    plural,
    printable,
    read_mapping,
    refuse_edited,
    shell_word,
    with_answers,
)
from .names import DATE
from .novatel import is_novatel, novatel_sheet
from .sheet import (
    HEAD,
    LABVIEW,
    LARGE,
    LARGEST,
    Sheet,
    decoded,
    labview_sheet,
    lines_of,
    refuse_other,
    text_sheet,
    unpacked,
)
from .understanding import UnderstoodTable
from .workbook import names_of, sheet_of_workbook, workbook_sheets

if TYPE_CHECKING:
    from polars import DataFrame

SHOWN = 3
"""Number of first rows that are shown as understood."""
JUDGED = 1_000_000
"""Largest number of rows whose readings are examined."""
LISTED = 8
"""Largest number of left-out lines that are listed."""


class ImportedColumn(Result):
    """A column of the record: its name, its name and unit in the file, and its sign."""

    column: str
    source: str
    unit: str = ""
    sign: Literal[1, -1] = 1


class Imported(Result):
    """A record made from a file from elsewhere: schema trihedron.import/1.

    Attributes
    ----------
    file, kind : str
        the file, and the kind of record made from it
    record_file, mapping_file : str or None
        the written files
    rows, readings : int
        rows of the record, and rows of the file that they hold
    written_as : str
        form of the file: encoding, separator, decimal mark, lines of names and data
    columns : tuple of ImportedColumn
        the columns of the record
    left_out : tuple of str
        unused columns, and left-out rows with reason and lines
    notes : tuple of str
        further remarks
    about : dict
        the lines around the table, key -> text
    scatter_mps2 : tuple of float, or None
        standard error of a mean of several readings, for each accelerometer [m/s²]
    first_rows : tuple of dict
        the first rows as understood, in the record's units
    record : record
        the record itself, in Python only
    """

    schema_: Literal["trihedron.import/1"] = Field(default="trihedron.import/1", alias="schema")
    file: str
    kind: str
    record_file: str | None = None
    mapping_file: str | None = None
    rows: int
    readings: int
    written_as: str
    columns: tuple[ImportedColumn, ...]
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    about: dict[str, str] = Field(default_factory=dict)
    scatter_mps2: tuple[float, float, float] | None = None
    first_rows: tuple[dict[str, float | str], ...] = ()
    record: Any = Field(default=ABSENT, exclude=True)

    def to_polars(self) -> "DataFrame":
        """Return the record as a table; an empty table if the result was read from its JSON."""
        import polars as pl

        if self.record is None:
            return pl.DataFrame()
        return self.record.to_polars()


def make_record(
    source: Any,
    second: Path | None = None,
    *,
    out: Path | None = None,
    mapping: Path | None = None,
    answers: AnyMapping[str, str] | None = None,
) -> Imported:
    """Make a record of a measured file from elsewhere; see `trihedron.import_record`.

    Raises InputError if something is unclear. The message lists all options that answer it, and the mapping beside
    `out` is written with a line to fill in for each.
    """
    file, mapping_file = Path("table"), None
    if isinstance(source, str | Path):
        file = Path(source)
    if out is not None:
        mapping_file = mapping_beside(out)
    for path in (out, mapping_file):
        ordinary_file(None, path)
    is_own = mapping is not None and mapping_file is not None and mapping.resolve() == mapping_file.resolve()
    if mapping_file is not None and not is_own:
        refuse_edited(mapping_file)
    if is_own and mapping_file is not None:
        note_own(mapping_file)
    answers = {printable(key): printable(text) for key, text in (answers or {}).items()}
    filled = with_answers({} if mapping is None else read_mapping(mapping), answers)
    if not isinstance(source, str | Path):
        table, conversion = _converted_sheets(file, [sheet_in_memory(source)], filled)
    elif second is None:
        table, conversion = _of_parts(file, filled)
    else:
        table, conversion = _of_two((file, second), (filled, filled))
    if table.questions:
        raise _questions(table, file, mapping_file, is_own=is_own)
    columns = record_columns(table, conversion)
    record = replace(record_from(columns), about=_about(table, conversion, file))
    with together():
        if out is not None:
            write_record(record, out)
        if mapping_file is not None and (answers or not is_own):
            write_text(mapping_file, mapping_text(table.whole_mapping, (), _first_rows_as_written(table)))
    return _imported(table, conversion, record, (file, out, mapping_file))


def _converted(file: Path, mapping: Mapping, role: RecordKind | None = None) -> tuple[UnderstoodTable, Conversion]:
    """Understand a file and convert its rows; the table has the questions that are open.

    `role` is the kind of record of one of two files.
    """
    return _converted_sheets(file, sheets_of(file, mapping), mapping, role)


def _converted_sheets(
    file: Path, sheets: list[Sheet], mapping: Mapping, role: RecordKind | None = None
) -> tuple[UnderstoodTable, Conversion]:
    if "=" in mapping.part:
        sheets = [of_instance(sheets[0], mapping.part), *sheets[1:]]
    table = understood(sheets[0], mapping, role)
    mixed = next((question for question in table.questions if question.key == "part"), None)
    if mixed is not None and "," not in mixed.answers[0]:
        table = understood(of_instance(sheets[0], mixed.answers[0]), mapping, role)
        table.ask(mixed.key, mixed.answers, mixed.why)
    if len(sheets) > 1:
        table.ask("sheet", names_of(sheets), "several sheets have tables")
    if sheets[0].stated.parts:
        table.ask("part", sheets[0].stated.parts, f"tables in the file; --list shows them: {file.name}")
    if table.questions:
        return table, Conversion()
    if sheets[0].whole is not None and not with_whole_text(table):
        table = understood(_whole_text_sheet(file, sheets[0]), mapping, role)
    return table, converted(table)


def _of_parts(file: Path, mapping: Mapping) -> tuple[UnderstoodTable, Conversion]:
    """Understand a file, and join two tables in it where the user names them, or nothing is likelier."""
    parts = mapping.part.split(",")
    if len(parts) == 2:
        first, second = (mapping.model_copy(update={"part": part}) for part in parts)
        return _of_two((file, file), (first, second))
    table, conversion = _converted(file, mapping)
    asked = next((question for question in table.questions if question.key == "part"), None)
    if asked and "," in asked.answers[0]:
        table, _ = _of_parts(file, mapping.model_copy(update={"part": asked.answers[0]}))
        table.ask(asked.key, asked.answers, asked.why)
    return table, conversion


def _of_two(files: tuple[Path, Path], mappings: tuple[Mapping, Mapping]) -> tuple[UnderstoodTable, Conversion]:
    """Understand accelerometers and gyros of two tables, and join them; the table has the open questions of both."""
    forces, rates = files
    if "gyr" in forces.name.lower() and "acc" in rates.name.lower():
        forces, rates = rates, forces
    force_table, force = _converted(forces, mappings[0], FORCES)
    rate_table, rate = _converted(rates, mappings[1], GYROS)
    for question in rate_table.questions:
        force_table.ask(question.key, question.answers, question.why)
    if force_table.questions:
        return force_table, Conversion()
    return joined((force_table, force), (rate_table, rate))


def listed(file: Path) -> list[TableInFile]:
    """Return the tables of a file: of a container, or the sheets of a workbook; a text has one."""
    if is_container(file, read_begin(file)):
        return tables_in(file)
    tables = []
    for sheet in sheets_of(file, Mapping(schema=SCHEMA)):
        layout = layout_of(sheet, Mapping(schema=SCHEMA))
        names = tuple(head.text for head in layout.headings)
        rows = len(sheet.cells if sheet.cells is not None else sheet.lines) - layout.first + 1
        tables.append(TableInFile(sheet.name, rows, len(names), GUESSES[rank_of(names)]))
    return tables


def _whole_text_sheet(file: Path, sheet: Sheet) -> Sheet:
    """Return a large text with all its lines."""
    content = sheet.whole if isinstance(sheet.whole, bytes) else bytes_of(file, "a measured file is needed")
    text, _ = decoded(file, content, sheet.encoding)
    return _sheet_of_text(file, lines_of(file, text), sheet.encoding, sheet.separator)


def _sheet_of_text(file: Path, lines: list[str], encoding: str, separator: str) -> Sheet:
    """Return a text as a sheet with a row for each reading."""
    if is_novatel(lines):
        return novatel_sheet(file, lines)
    if lines[0].strip().startswith(LABVIEW):
        return labview_sheet(file, lines, encoding)
    sheet = None if separator else labelled_sheet(file, lines, encoding)
    return upright(with_exact_seconds(sheet or with_rate_above(text_sheet(file, lines, encoding, separator))))


def mapping_beside(out: Path) -> Path:
    """Return the path of a record's mapping."""
    if out.suffix.lower() != ".csv":
        raise InputError(f"--out {out}: records are written as CSV; give a name that ends with .csv")
    return out.with_name(f"{out.stem}.import.toml")


def sheets_of(file: Path, mapping: Mapping) -> list[Sheet]:
    """Return the candidate sheets of a file: one for a text; for a workbook the given one, or all with a table."""
    begin = read_begin(file)
    if mapping.part and "=" not in mapping.part and not is_container(file, begin):
        raise InputError(f"{file}: --from {mapping.part}: the file holds no parts; a sheet is --set sheet=NAME")
    if is_container(file, begin):
        note_read(file, file.stat())
        return [sheet_of_part(file, "" if "=" in mapping.part else mapping.part)]
    if begin and not begin.startswith((PACKED, b"PK")) and LARGE < file.stat().st_size <= LARGEST:
        note_read(file, file.stat())
        with file.open("rb") as opened:
            return [_large_sheet(file, opened.read(HEAD), file, mapping)]
    content = bytes_of(file, "a measured file is needed", most=LARGEST)
    if not content:
        raise InputError(f"{file}: is empty; a table of measured data is needed")
    content = unpacked(file, content)
    if len(content) > LARGE and not is_workbook(content):
        return [_large_sheet(file, content[:HEAD], content, mapping)]
    if not is_workbook(content):
        refuse_other(file, content)
        text, encoding = decoded(file, content, mapping.encoding)
        return [_sheet_of_text(file, lines_of(file, text), encoding, mapping.separator)]
    sheets = [upright(with_exact_seconds(sheet)) for sheet in workbook_sheets(file, content)]
    if mapping.sheet not in ("", OPEN):
        return [sheet_of_workbook(sheets, file, mapping.sheet)]
    tables = [sheet for sheet in sheets if has_table(sheet, mapping)]
    if not tables:
        raise InputError(f"{file}: no sheet has rows of at least three numbers; a table of measured data is needed")
    return tables


def _large_sheet(file: Path, head: bytes, whole: Path | bytes, mapping: Mapping) -> Sheet:
    """Return a large text whose first lines are examined; read other encodings than UTF-8 whole."""
    refuse_other(file, head)
    complete = head[: head.rfind(b"\n") + 1] or head
    text, encoding = decoded(file, complete, mapping.encoding)
    lines = lines_of(file, text)
    sheet = _sheet_of_text(file, lines, encoding, mapping.separator)
    is_plain = encoding in ("utf-8", "utf-8-sig") and sheet.lines and sheet.lines[0] == lines[0]
    if not is_plain:
        return _whole_text_sheet(file, replace(sheet, whole=whole))
    return replace(sheet, whole=whole)


def _questions(table: UnderstoodTable, file: Path, mapping_file: Path | None, *, is_own: bool) -> OpenQuestions:
    """Return the questions about a table in one line; write the mapping to fill in unless the user gave that file."""
    count = len(table.questions)
    what, advice = f"{file}: {'one fact is' if count == 1 else f'{count} facts are'} missing", ""
    if mapping_file is not None:
        if not is_own:
            with at_once():
                text = mapping_text(table.whole_mapping, table.questions, _first_rows_as_written(table))
                write_text(mapping_file, text)
        advice = f"; or fill in {mapping_file} and give --mapping {shell_word(str(mapping_file))}"
    questions = OpenQuestions(what, table.questions, advice)
    questions.header, questions.rows = _first_rows(table)
    return questions


def _first_rows_as_written(table: UnderstoodTable) -> list[str]:
    """Return the names and the first rows of the file, for the end of a mapping."""
    header, rows = _first_rows(table)
    lines = [f"{table.sheet.path.name}, {table.sheet.about}; its first rows:", *map(" | ".join, (header, *rows))]
    return [printable(line)[:200] for line in lines]


def _first_rows(table: UnderstoodTable) -> tuple[list[str], list[list[str]]]:
    """Return the names and the first rows of the file."""
    return [head.text for head in table.layout.headings], [list(texts) for _, texts in table.rows[:SHOWN]]


def _about(table: UnderstoodTable, conversion: Conversion, file: Path) -> dict[str, str]:
    """Return the comment lines of the record: the file's remarks, and facts that its numbers no longer show."""
    about = {"imported from": file.name, **table.layout.remarks}
    for unit, size in conversion.resolution.items():
        about[f"resolution_{unit}"] = upwards(size, 3)
    if conversion.scatter is not None:
        about["readings averaged"] = _range_of_readings(conversion)
        about[SCATTER] = " ".join(upwards(error, 4) for error in conversion.scatter.tolist())
    if VELOCITY[0] in conversion.numbers and FORCE[0] not in conversion.numbers:
        about["f1_mps2 to f3_mps2"] = "means of dv1_mps to dv3_mps over the intervals beside a row"
    return about


def _range_of_readings(conversion: Conversion) -> str:
    """Return the smallest and the largest number of readings of a rest."""
    assert conversion.readings is not None
    low, high = int(conversion.readings.min()), int(conversion.readings.max())
    return str(low) if low == high else f"{low} to {high}"


def _imported(
    table: UnderstoodTable,
    conversion: Conversion,
    record: Record,
    files: tuple[Path, Path | None, Path | None],
) -> Imported:
    file, out, mapping_file = (None if path is None else str(path) for path in files)
    layout, columns = table.layout, record.columns()
    lines = f"names in row {layout.names}" if layout.names else "no names"
    if layout.units:
        lines += f", units in row {layout.units}"
    left_out = [f"column {field.head.text!r}" for field in table.free_fields if field.head.text]
    for why, rows in conversion.left_out.items():
        listed = ", ".join(map(str, rows[:LISTED])) + (", ..." if len(rows) > LISTED else "")
        left_out.append(f"{plural(len(rows), 'row')} ({why}): {listed}")
    if layout.last:
        left_out.append(f"lines below row {layout.last}")
    judged = record
    if len(record) > JUDGED:
        judged = record.selected(np.arange(JUDGED))
        table.notes.append(f"the first {JUDGED} rows are examined; trihedron check examines all")
    check = trust_of(judged)
    notes = [*table.notes, *conversion.notes, *check.warnings]
    if table.sheet.encoding and table.sheet.path.is_file():
        with table.sheet.path.open("rb") as opened:
            opened.seek(max(0, table.sheet.path.stat().st_size - TAIL))
            notes += cut_warning(opened.read())
    notes += [f"results of this record would be wrong: {line}" for line in check.faults]
    if not check.faults:
        notes += filter(None, [unchecked_gyros(judged)])
    scatter, readings = None, len(conversion.row)
    if conversion.readings is not None and conversion.scatter is not None:
        readings, scatter = int(conversion.readings.sum()), tuple(conversion.scatter.tolist())
        notes.append(
            f"{_range_of_readings(conversion)} readings averaged in each row; standard error of a mean "
            f"{upwards(max(scatter))} m/s², from which σ is taken without --noise-bound"
        )
    first_rows = [
        {name: values[k] if isinstance(values[k], str) else float(values[k]) for name, values in columns.items()}
        for k in range(min(SHOWN, len(record)))
    ]
    return Imported(
        file=str(file),
        kind=record.word,
        record_file=out,
        mapping_file=mapping_file,
        rows=len(record),
        readings=readings,
        written_as=f"{table.sheet.about}, decimal {table.decimal!r}, {lines}, data from row {layout.first}",
        columns=tuple(_imported_column(table, column) for column in table.origins),
        left_out=tuple(left_out),
        notes=tuple(notes),
        about=dict(layout.remarks),
        scatter_mps2=scatter,  # type: ignore[arg-type]
        first_rows=tuple(first_rows),
        record=record,
    )


def _imported_column(table: UnderstoodTable, column: str) -> ImportedColumn:
    """Return a column of the record with its form in the file; the unit is its own, its quantity's, or its head's."""
    origin = table.origins[column]
    quantity = "" if origin.unit is None else origin.unit.quantity
    by_quantity = table.whole_mapping.units.get(quantity, "")
    in_head = "" if quantity in table.mapping.units else origin.field.head.unit
    further = f" and {len(origin.beside)} beside it" if origin.beside else ""
    return ImportedColumn(
        column="time_s" if column == DATE else column,
        source=origin.name + further,
        unit=table.mapping.of(column).unit or in_head or by_quantity,
        sign=origin.sign,
    )
