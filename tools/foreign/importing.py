"""A measured file from elsewhere made a record: read, understood, asked about, written with its mapping."""

from collections.abc import Mapping as AnyMapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from ..errors import InputError
from ..files import at_once, bytes_of, is_workbook, ordinary_file, together, write_text
from ..records import PositionRecord, RawRecord, StrapdownRecord, write_record
from ..records.columns import FORCE, VELOCITY
from ..records.comments import RESOLUTION, SCATTER
from ..records.read import record_of
from ..result import ABSENT, Result
from ..rounding import upwards
from .conversion import Conversion, converted, record_columns
from .deciding import understood
from .layout import has_table
from .mapping import OPEN, Mapping, printable, read_mapping, refuse_edited, shell_word, text_of, with_answers
from .names import DATE
from .shape import upright
from .sheet import LARGEST, Sheet, decoded, is_labview, labview_sheet, lines_of, refuse_other, text_sheet, unpacked
from .understanding import Understanding
from .workbook import sheet_of_workbook, workbook_sheets

if TYPE_CHECKING:
    from polars import DataFrame

SHOWN = 3
"""First rows that are shown as understood."""
LISTED = 8
"""Lines of rows left out that are named."""
_OWN = {"mps2": "resolution_mps2", "deg": "resolution_deg", "degC": "resolution_degC"}
assert set(_OWN.values()) == set(RESOLUTION)


class ImportedColumn(Result):
    """A column of the record: its name, what it was called, the unit there, and its sign."""

    column: str
    source: str
    unit: str = ""
    sign: Literal[1, -1] = 1


class Imported(Result):
    """What became of a file from elsewhere: schema trihedron.import/1.

    Attributes
    ----------
    file, kind : str
        the file, and the kind of record made of it
    record_file, mapping_file : str or None
        what was written
    rows, readings : int
        rows of the record, and rows of the file that they hold
    written_as : str
        how the file is written: encoding, separator, decimal mark, lines of names and data
    columns : tuple of ImportedColumn
    left_out : tuple of str
        columns that are not taken, and rows with why and their lines
    notes : tuple of str
        what else was found
    about : dict
        what the lines around the table say, key -> text
    scatter_mps2 : tuple of float, or None
        standard error of a mean of several readings, for each accelerometer
    first_rows : tuple of dict
        as understood, in the record's units
    record : record
        for the program alone
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
        """The record as a table; an empty one where the result came back from its JSON."""
        import polars as pl

        return pl.DataFrame() if self.record is None else self.record.to_polars()


def import_record(
    file: Path, *, out: Path | None = None, mapping: Path | None = None, answers: AnyMapping[str, str] | None = None
) -> Imported:
    """Make a record of a measured file from elsewhere; `trihedron.import_record` says more.

    An InputError where something has to be said first: it names every option that would, and the mapping beside `out`
    is written with a line to fill in for each.
    """
    beside = None if out is None else mapping_beside(out)
    for path in (out, beside):
        ordinary_file(None, path)
    if beside is not None and (mapping is None or mapping.resolve() != beside.resolve()):
        refuse_edited(beside)
    answers = {printable(key): printable(text) for key, text in (answers or {}).items()}
    given = with_answers({} if mapping is None else read_mapping(mapping), answers)
    sheets = sheets_of(file, given)
    found = understood(sheets[0], given)
    if len(sheets) > 1:
        found.ask("sheet", [sheet.name for sheet in sheets], "tables stand in several sheets")
    if not found.questions:
        made = converted(found)
    if found.questions:
        raise _asked(found, file, mapping, beside)
    columns = record_columns(found, made)
    about = _about(found, made, file)
    record = replace(record_of(columns), about=about)
    kept = mapping is not None and beside is not None and mapping.resolve() == beside.resolve() and not answers
    with together():
        if out is not None:
            write_record(record, out)
        if beside is not None and not kept:
            write_text(beside, text_of(found.mapping, (), _first_rows_said(found)))
    return _imported(found, made, record, (file, out, beside))


def mapping_beside(out: Path) -> Path:
    """Where the mapping of a record stands."""
    if out.suffix.lower() != ".csv":
        raise InputError(f"--out {out}: records are written as CSV; give a name that ends with .csv")
    return out.with_name(f"{out.stem}.import.toml")


def sheets_of(file: Path, given: Mapping) -> list[Sheet]:
    """The sheets of a file that may be meant: a text is one, of a workbook that which is given or all with a table."""
    data = bytes_of(file, "a measured file is needed", most=LARGEST)
    if not data:
        raise InputError(f"{file}: is empty; a table of measured data is needed")
    data = unpacked(file, data)
    if not is_workbook(data):
        refuse_other(file, data)
        text, encoding = decoded(file, data, given.encoding)
        lines = lines_of(file, text)
        if is_labview(lines):
            return [labview_sheet(file, lines, encoding)]
        return [upright(text_sheet(file, lines, encoding, given.separator))]
    sheets = [upright(sheet) for sheet in workbook_sheets(file, data)]
    if given.sheet not in ("", OPEN):
        return [sheet_of_workbook(sheets, file, given.sheet)]
    tables = [sheet for sheet in sheets if has_table(sheet, given)]
    if not tables:
        raise InputError(f"{file}: no sheet has rows of at least three numbers; a table of measured data is needed")
    return tables


def _asked(found: Understanding, file: Path, mapping: Path | None, beside: Path | None) -> InputError:
    """What has to be said, in one line; the mapping to fill in is written, where there is a place for it."""
    count = len(found.questions)
    things = "one thing is" if count == 1 else f"{count} things are"
    said = printable(f"{file}: {things} not known: " + "; ".join(map(str, found.questions)))
    if beside is None:
        return InputError(said)
    if mapping is None or mapping.resolve() != beside.resolve():
        with at_once():
            write_text(beside, text_of(found.mapping, found.questions, _first_rows_said(found)))
        said += f"; or fill in {beside} and give --mapping {shell_word(str(beside))}"
    return InputError(said)


def _first_rows_said(found: Understanding) -> list[str]:
    """The names and the first rows of the file, for the end of a mapping."""
    names = " | ".join(head.text for head in found.layout.headings)
    rows = [" | ".join(texts) for _, texts in found.looked_at[:SHOWN]]
    lines = [f"{found.sheet.path.name}, {found.sheet.about}; its first rows:", names, *rows]
    return [printable(line)[:200] for line in lines]


def _about(found: Understanding, made: Conversion, file: Path) -> dict[str, str]:
    """The comment lines of the record: what the file says of itself, and what its numbers cannot say any more."""
    own: dict[str, str] = {_OWN[name]: upwards(size, 3) for name, size in made.resolution.items()}
    if made.readings is not None and made.scatter is not None:
        own["readings averaged"] = _span(int(made.readings.min()), int(made.readings.max()))
        own[SCATTER] = " ".join(upwards(float(value), 4) for value in made.scatter)
    if VELOCITY[0] in made.numbers and FORCE[0] not in made.numbers:
        own["f1_mps2 to f3_mps2"] = "means of dv1_mps to dv3_mps over the intervals beside a row"
    return {"imported from": file.name, **found.layout.remarks, **own}


def _span(low: int, high: int) -> str:
    return str(low) if low == high else f"{low} to {high}"


def _imported(
    found: Understanding,
    made: Conversion,
    record: PositionRecord | RawRecord | StrapdownRecord,
    files: tuple[Path, Path | None, Path | None],
) -> Imported:
    file, out, beside = files
    table = record.columns()
    layout, mapping = found.layout, found.mapping
    lines = f"names in row {layout.names}" if layout.names else "no names"
    lines += f", units in row {layout.units}" if layout.units else ""
    units = {**mapping.units}
    columns = []
    for column, taken in found.taken.items():
        source = mapping.of(column)
        quantity = taken.unit.quantity if taken.unit is not None else ""
        unit = (source.unit if source else "") or layout.headings[taken.field].unit or units.get(quantity, "")
        unit = units.get(quantity, unit) if quantity in found.given.units and not (source and source.unit) else unit
        columns.append(
            ImportedColumn(
                column=column if column != DATE else "time_s",
                source=taken.said + (f" and {len(taken.beside)} beside it" if taken.beside else ""),
                unit=unit,
                sign=-1 if taken.sign < 0 else 1,
            )
        )
    left = [f"column {name!r}" for name in found.left_out]
    for why, rows in made.left_out.items():
        shown = ", ".join(map(str, rows[:LISTED])) + (", ..." if len(rows) > LISTED else "")
        left.append(f"{len(rows)} row{'s' if len(rows) > 1 else ''} ({why}): {shown}")
    if layout.last:
        left.append(f"what stands below row {layout.last}")
    notes = [*found.notes, *made.notes]
    scatter = None
    readings = len(made.row)
    if made.readings is not None and made.scatter is not None:
        readings = int(made.readings.sum())
        scatter = tuple(float(value) for value in made.scatter)
        each = _span(int(made.readings.min()), int(made.readings.max()))
        notes.append(
            f"{each} readings averaged in each row, a mean's standard error {upwards(float(made.scatter.max()))} m/s²: "
            "the noise bound's evidence where --noise-bound is not given"
        )
    first = [
        {name: (values[k] if isinstance(values[k], str) else float(values[k])) for name, values in table.items()}
        for k in range(min(SHOWN, len(record)))
    ]
    return Imported(
        file=str(file),
        kind=record.word,
        record_file=None if out is None else str(out),
        mapping_file=None if beside is None else str(beside),
        rows=len(record),
        readings=readings,
        written_as=f"{found.sheet.about}, decimal {found.decimal!r}, {lines}, data from row {layout.first}",
        columns=tuple(columns),
        left_out=tuple(left),
        notes=tuple(notes),
        about=dict(found.layout.remarks),
        scatter_mps2=scatter,  # type: ignore[arg-type]
        first_rows=tuple(first),
        record=record,
    )
