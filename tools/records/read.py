"""Records from wherever they are: recognised by their columns, checked, in SI and radians.

A reader is a generator: it yields every fault that it finds and returns the columns of the rows that have none.
`read_record` raises the first, `trihedron check` lists them all.
"""

import csv
import hashlib
import io
import math
import os
import re
import shlex
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeVar, Union, overload, runtime_checkable

import lazy_loader
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..files import MAGIC, advice_on, bytes_of, cut_warning, fault_of_parquet, is_workbook
from ..progress import tracked
from .channels import Channels
from .columns import (
    ANGLES,
    BENCH,
    FORCE,
    FORCES,
    KINDS,
    MOUNTING,
    POSES,
    POSITION,
    QUATERNION,
    RAW,
    STRAPDOWN_KINDS,
    TEMPERATURE,
    TEXTS,
    UP,
    FileColumns,
    Layout,
    RecordError,
    RecordKind,
    comments_of,
    extra_warning,
    faults,
    quoted,
    recognise,
    spoilt_attitudes,
    warnings,
    with_force,
)
from .decisions import read_decisions, with_decisions, without_rows
from .even import times_unused, with_stamps
from .kinds import BenchRecord, ForceRecord, PoseRecord, PositionRecord, RawRecord, StrapdownRecord
from .rests import position_record_of
from .steps import reading_step

if TYPE_CHECKING:
    import polars as pl
    from polars import DataFrame, Series
else:
    # A record of a few rows is read without it.
    pl = lazy_loader.load("polars")

LARGE = 30_000_000
"""Bytes of a file from which on reading shows its progress."""
PART = 16384
"""Rows that are taken from text to numbers at once: bounds the memory that their texts need."""
NEGLIGIBLE = 1e-300
"""Numbers of a smaller size are zero."""
ROUNDED_ANGLE = 1e-5
"""Half a last digit [deg] of angles up to which their digits are roundings."""
MAY_BE_EMPTY = (*QUATERNION, *UP)
"""Columns of numbers whose fields may be empty, where a direction is not known."""
PACKED = b"\x1f\x8b"
"""First bytes of a file that gzip has packed."""


Record: TypeAlias = PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord
TO_CALIBRATE = (PositionRecord, StrapdownRecord, ForceRecord, PoseRecord)
"""Kinds of records that can be calibrated; a series of a table is averaged."""
Faults: TypeAlias = Generator[RecordError, None, FileColumns | None]
"""Every fault of a file; its result are the columns of the rows without a fault, None where there are none."""
Wanted = TypeVar("Wanted", PositionRecord, StrapdownRecord)
Other = TypeVar("Other", PositionRecord, StrapdownRecord, BenchRecord)

BOM = b"\xef\xbb\xbf"
HEAD = PART + 1024
"""Lines at the head of a file that are read by their fields; plain numbers behind them are read at once."""
_PLAIN = re.compile(rb"[0-9+\-.eE,\r\n]*")
_DIGITS = re.compile(r"\s*[+-]?(\d*)\.?(\d*)(?:[eE][+-]?\d+)?\s*")


@runtime_checkable
class Recorded(Protocol):
    """An object with a position record, such as a simulation."""

    def position_record(self) -> PositionRecord:
        """The position record; raises InputError where there is none."""
        ...


class Tabular(Protocol):
    """A table of another library, for example pandas: columns by their names."""

    columns: Any

    def __getitem__(self, name: Any, /) -> Any: ...


Source: TypeAlias = Union[str, Path, "DataFrame", Mapping[str, ArrayLike], NDArray[np.void], Tabular, Record, Recorded]
"""What holds a record: a file, a table in memory of any library, a record, a simulation."""


@overload
def read_record(
    record: Source, *, channels: Sequence[str] = (), stamps: str | None = None, without: str = ""
) -> Record: ...
@overload
def read_record(
    record: Source,
    kind: type[Wanted],
    /,
    *,
    channels: Sequence[str] = (),
    stamps: str | None = None,
    without: str = "",
) -> Wanted: ...
@overload
def read_record(
    record: Source,
    kind: type[Wanted],
    second: type[Other],
    /,
    *,
    channels: Sequence[str] = (),
    stamps: str | None = None,
    without: str = "",
) -> Wanted | Other: ...
@overload
def read_record(
    record: Source, *kinds: type[Any], channels: Sequence[str] = (), stamps: str | None = None, without: str = ""
) -> Any: ...
def read_record(
    record: Source, *kinds: Any, channels: Sequence[str] = (), stamps: str | None = None, without: str = ""
) -> Any:
    """Read a record from a CSV or Parquet file, a table in memory, or an object that holds a record.

    Parameters
    ----------
    record : path, table in memory, record or Simulation
        the kind of record is recognised by its columns, the kind of file by its first bytes
    kinds : PositionRecord, StrapdownRecord
        accepted kinds; without any, every kind. Where a PositionRecord is accepted, a file with the angles of a table
        is a record of the table, with or without gyros; a raw record, or that of a bench, is averaged over its rests
    channels : sequence of str
        order, signs, senses and units of its channels, as of `Channels.given`; by default as they are in the file
    stamps : str or None
        "even", "logged" or a rate in hertz; None: of a file with gyros and uneven stamps, those under which gyros and
        gravity agree better. By default other records are read with their stamps
    without : str
        rows of a table of averaged readings, or rests of a raw record, to leave out: "42" or "6,19-30", counted from 1

    Returns
    -------
    record
        of one of these kinds

    Raises
    ------
    InputError
        when it cannot be used: the message names the file, the row (as an editor counts lines) and the column; or when
        it is of another kind, or has no rest
    """
    table = PositionRecord in kinds
    measured: Record
    is_read = isinstance(record, Record)
    if isinstance(record, Record):
        measured = record
    elif isinstance(record, Recorded):
        measured = record.position_record()
    else:
        known = STRAPDOWN_KINDS if kinds and not table and BenchRecord not in kinds else KINDS
        measured = _parsed(record, known, any_times=times_unused(stamps))
    if channels:
        measured = measured.read_with(Channels.given(channels))
    if stamps is not None or not is_read:
        measured = with_stamps(measured, stamps)
    if table and isinstance(measured, RawRecord):
        measured = position_record_of(measured)
    if without:
        measured = without_rows(measured, without)
    if not kinds or isinstance(measured, kinds):
        return measured
    if isinstance(measured, ForceRecord | PoseRecord):
        raise InputError(f"{measured.path}: is {with_article(measured.word)}, which `trihedron calibrate` takes")
    if table:
        what = f"is {with_article(measured.word)}; a position record or a raw record (alpha_deg, beta_deg) is needed"
        raise RecordError(measured.path, None, None, what)
    needed = "a strapdown record (w1_radps, ...) is needed"
    if isinstance(measured, RawRecord | PositionRecord):
        takers = "`trihedron calibrate` and `trihedron diagnose` take a table record"
        raise InputError(f"{measured.path}: is a table record; {needed}; {takers}")
    raise InputError(f"{measured.path}: is {with_article(measured.word)}; {needed}")


def with_article(word: str) -> str:
    """Return a kind of record with its article."""
    return f"an {word}" if word[0] in "aeiou" else f"a {word}"


def read_written(path: Path) -> Record:
    """Read a record from a file that this process has just written, without the check for corruption."""
    return _parsed(path, KINDS, trusted=True)


def table_in_memory(source: object) -> "DataFrame":
    """Return a table in memory of any library; an InputError for any other object.

    The index of pandas is a column if it has a name or holds times; the coordinates of xarray are columns.
    """
    if isinstance(source, pl.LazyFrame):
        source = source.collect()
    if isinstance(source, pl.DataFrame):
        return source
    to_dataframe = getattr(source, "to_dataframe", None)
    if to_dataframe is not None:
        source = to_dataframe()
    index = getattr(source, "index", None)
    has_names = [name for name in getattr(index, "names", ()) if name is not None]
    if hasattr(source, "reset_index") and (has_names or getattr(getattr(index, "dtype", None), "kind", "") in "Mm"):
        source = source.reset_index()  # type: ignore[attr-defined]
    named = getattr(getattr(source, "dtype", None), "names", None) or getattr(source, "columns", None)
    names = list(source if isinstance(source, Mapping) else () if named is None else named)
    try:
        columns = {_label(name): _column_in_memory(np.asarray(source[name])) for name in names}  # type: ignore[index]
        return pl.DataFrame(columns)
    except (TypeError, ValueError, KeyError, pl.exceptions.PolarsError) as error:
        raise InputError(f"a table in memory cannot be used: {str(error).splitlines()[0]}") from error


def read_undecided(path: Path, *, stamps: str | None = None) -> Record:
    """Read a record of any kind from a file without the decisions beside it; errors as `read_record`."""
    return with_stamps(_parsed(path, KINDS, any_times=times_unused(stamps), decided=False), stamps)


def _label(name: object) -> str:
    """Return the name of a column; a name of two levels has both words."""
    if isinstance(name, tuple):
        return " ".join(str(part) for part in name if str(part))
    return str(name)


def _column_in_memory(values: NDArray) -> Any:
    """Return the values of a column; times stay times, in nanoseconds."""
    if values.dtype.kind in "mM":
        return values.astype(f"{values.dtype.kind}8[ns]")
    return values.tolist()


def _parsed(
    source: Any,
    kinds: Sequence[RecordKind],
    *,
    trusted: bool = False,
    any_times: bool = False,
    decided: bool = True,
) -> Record:
    if in_memory := not isinstance(source, str | os.PathLike):
        path, written = Path("table"), io.BytesIO()
        if not (table := table_in_memory(source)).width:
            what = "a path, or a table with columns (polars, pandas, a mapping, a structured array)"
            raise InputError(f"a record is {what}, not {type(source).__name__}")
        table.write_parquet(written)
        content = written.getvalue()
    else:
        path = Path(source)
        content = bytes_of(path, "the file of a record is needed")
        if not content:
            raise InputError(f"{path}: is empty; a header and at least one row are needed")
        if path.suffix.lower() == ".parquet" and not content.startswith(MAGIC):
            raise RecordError(path, None, None, "is not a Parquet file (it does not begin with PAR1)")
    # a table in memory cannot be corrupt
    faults = all_faults(path, content, kinds, trusted=trusted or in_memory, any_times=any_times)
    try:
        raise next(faults)
    except StopIteration as done:
        columns: FileColumns = done.value
    lines = extra_warning(columns) + warnings(columns)
    if not (in_memory or trusted or content.startswith(MAGIC)):
        lines += tuple(f"{path}: {line}" for line in cut_warning(content))
    digest = hashlib.sha256(content).hexdigest()
    record = replace(record_from(columns), warnings=lines, sha256=digest)
    if in_memory or trusted or not decided:
        return record
    return with_decisions(record, read_decisions(path, digest))


def all_faults(
    path: Path,
    content: bytes,
    kinds: Sequence[RecordKind] = KINDS,
    *,
    trusted: bool = False,
    any_times: bool = False,
) -> Faults:
    """Find all faults in the columns and numbers of a record's file, given its bytes.

    First the faults of the table and of its fields come, in the order of the rows; then those of the numbers. Returned
    are the columns of the rows whose fields have no fault; None where there are none, or no table at all. Bytes of a
    Parquet file that this process made are trusted not to be corrupt. Where `any_times` holds, the times of a series
    may repeat and run back: they are not used.
    """
    try:
        if is_workbook(content):
            raise RecordError(path, None, None, "is a workbook")
        if content.startswith(PACKED):
            raise RecordError(path, None, None, "is packed by gzip")
        if content.startswith(MAGIC):
            columns = _read_parquet(path, content, kinds, trusted=trusted)
        else:
            columns = yield from _read_csv(path, content, kinds)
    except RecordError as error:
        yield _with_import(error, path, content)
        return None
    if columns is not None:
        columns = with_force(columns)
        yield from faults(columns, any_times=any_times)
    return columns


def _with_import(error: RecordError, path: Path, content: bytes) -> RecordError:
    """Return the error for a file that is not a record, with the command that imports a laboratory's file."""
    advice = advice_on(path, content, "record", "workbook")
    if advice:
        return RecordError(path, None, None, f"is not a record{advice}")
    is_readable = is_workbook(content) or content[:2] in (PACKED, b"\xff\xfe", b"\xfe\xff") or b"\0" not in content
    if not is_readable or content.startswith(MAGIC) or not content.strip() or "no rows follow" in error.what:
        return error
    name = shlex.quote(str(path))
    what = f"{error.what}; a laboratory's own file becomes a record by: trihedron import {name} --out RECORD.csv"
    return RecordError(path, error.row, error.column, what)


def _without_negligible(values: NDArray) -> NDArray:
    """Return numbers with zero for those that no instrument measures: their sign would decide a scale factor."""
    negligible = (np.abs(values) < NEGLIGIBLE) & (values != 0.0)
    return np.where(negligible, 0.0, values) if negligible.any() else values


def record_from(columns: FileColumns) -> Record:
    """The values of columns that have no faults."""
    classes: dict[RecordKind, type[Any]] = {POSITION: PositionRecord, RAW: RawRecord, POSES: PoseRecord}
    classes |= {FORCES: ForceRecord, **dict.fromkeys(BENCH, BenchRecord)}
    kind = classes.get(columns.layout.kind, StrapdownRecord)
    values: dict[str, Any] = {"path": columns.path, "row": columns.row, "about": columns.comments.about}
    for name, columns_of_group in kind.groups.items():
        if columns_of_group[0] not in columns.layout.present:
            values[name] = None
        elif columns_of_group[0] in TEXTS:
            values[name] = columns.texts[columns_of_group[0]]
        else:
            if len(columns_of_group) == 1:
                numbers = columns.numbers[columns_of_group[0]]
            else:
                numbers = columns.group(columns_of_group)
            if columns_of_group[0] in ANGLES:
                numbers = np.deg2rad(numbers)
            values[name] = _without_negligible(numbers)
    if values.get("attitude") is not None:
        # a row of NaN where it is not known
        values["attitude"][spoilt_attitudes(columns)] = np.nan
        values["attitude"] = values["attitude"] / np.sqrt(np.square(values["attitude"]).sum(axis=1, keepdims=True))
    if kind in (PositionRecord, RawRecord, BenchRecord):
        values["resolution"] = columns.resolution
        if kind is PositionRecord:
            values["resolution"] = max(columns.resolution, 0.5 * reading_step(values["specific_force"]))
    if kind is PositionRecord:
        # angles of few digits are settings, which the encoders reached
        rounded = columns.angle_resolution <= ROUNDED_ANGLE
        angle_resolution = 0.0
        if rounded:
            angle_resolution = float(np.deg2rad(columns.angle_resolution))
        values["angle_resolution"] = angle_resolution
        values["temperature_resolution"] = columns.temperature_resolution
        if columns.comments.scatter:
            values["scatter"] = np.tile(columns.comments.scatter, (len(columns.row), 1))
    return kind(**values)


def _read_csv(path: Path, content: bytes, kinds: Sequence[RecordKind]) -> Faults:
    """CSV: UTF-8, comma, one header line, comments with `#`; raises RecordError where there is no table at all."""
    head = _end_of_head(content)
    plain = _plain_numbers(content, head)
    lines = _lines(path, content if plain is None else content[:head])
    written = [bool(line) and line[0] != "#" and not line.isspace() for line in lines]
    rows = np.flatnonzero(written) + 1
    body = list(compress(lines, written))
    comments, fault = comments_of((row, line) for row, line in enumerate(lines, 1) if line.startswith("#"))
    if fault is not None:
        row, key, what = fault
        raise RecordError(path, row, None, f"comment {key}: {what}")
    if not body:
        raise RecordError(path, None, None, "is empty; a header and at least one row are needed")
    header_row = int(rows[0])
    names = [name.strip() for name in fields_of(path, header_row, body[0])]
    layout = recognise(path, names, header_row, kinds)
    if len(body) == 1:
        raise RecordError(path, header_row, None, "no rows follow the header")
    count = len(body) - 1 + (0 if plain is None else plain.height)
    if count > layout.kind.most_rows:
        yield _too_many(path, layout, count)
        return None
    place = {name: names.index(name) for name in sorted(layout.present, key=names.index)}
    parts: dict[str, list[NDArray]] = {name: [] for name in layout.numbers}
    texts_of: dict[str, list[str]] = {name: [] for name in place if name in TEXTS}
    blocks: list[NDArray] = []
    digits = dict.fromkeys(layout.numbers, 0)
    for start in tracked(range(1, len(body), PART), "reading", show=len(content) >= LARGE):
        some, where = body[start : start + PART], rows[start : start + PART]
        block_columns = taken_of(some, len(names), place)
        if block_columns is None:
            complete = np.ones(len(some), dtype=bool)
            for k, line in enumerate(some):
                for fault in faults_of_line(path, int(where[k]), line, len(names), place):
                    complete[k] = False
                    yield fault
            where = where[complete]
            block_columns = taken_of(list(compress(some, complete)), len(names), place)
            assert block_columns is not None, f"{path}: a row was refused without a fault"
        texts, numbers = block_columns
        for name in layout.numbers:
            parts[name].append(numbers[name])
            if start == 1:
                digits[name] = max(map(significant_digits, texts[name]), default=0)
        for name, column in texts_of.items():
            column += [text.strip() for text in texts[name]]
        blocks.append(where)
    if plain is not None:
        for name in layout.numbers:
            parts[name].append(plain[:, place[name]].to_numpy())
        blocks.append(np.arange(len(lines), len(lines) + plain.height))
    if not sum(map(len, blocks)):
        return None
    values = {name: np.concatenate(part) for name, part in parts.items()}

    def resolution(*columns: str) -> float:
        """Return half a last digit; 0 where there are no such columns."""
        if columns[0] not in values:
            return 0.0
        largest = max(float(np.abs(values[name]).max()) for name in columns)
        return written_resolution(largest, max(digits[name] for name in columns))

    return FileColumns(
        path,
        layout,
        values,
        {name: tuple(column) for name, column in texts_of.items()},
        np.concatenate(blocks),
        max(resolution(*FORCE), comments.resolution),
        max(resolution(*ANGLES), comments.angle),
        max(resolution(TEMPERATURE), comments.temperature),
        comments,
    )


def _end_of_head(content: bytes) -> int:
    """Return the number of bytes in the first `HEAD` lines."""
    end = 0
    for _ in range(HEAD):
        end = content.find(b"\n", end) + 1
        if end == 0:
            return len(content)
    return end


def _plain_numbers(content: bytes, start: int) -> "DataFrame | None":
    """Return the numbers of all lines from a byte on; None if any line is not a row of finite numbers alone.

    Each row has the number of fields of the header. The values are those of `float`.
    """
    header = next(
        (line for line in content[:start].removeprefix(BOM).splitlines() if line.strip() and line[:1] != b"#"), b""
    )
    plain = _PLAIN.fullmatch(content, start) is not None
    plain = plain and content.count(b"\r", start) == content.count(b"\r\n", start)
    if start == len(content) or b'"' in header or not plain:
        return None
    width = header.count(b",") + 1
    rows = memoryview(content)[start:]
    schema = {str(place): pl.Float64 for place in range(width)}
    try:
        numbers = pl.read_csv(io.BytesIO(rows), has_header=False, schema=schema)
    except pl.exceptions.PolarsError:
        return None
    separators = content.count(b",", start)
    finite = numbers.select(pl.all().is_finite().all()).row(0)
    if all(finite) and not any(numbers.null_count().row(0)) and separators == numbers.height * (width - 1):
        return numbers
    return None


def significant_digits(text: str) -> int:
    """Return the number of significant digits of a number as written, without leading zeros: 4 for "-0.01230"."""
    match = _DIGITS.fullmatch(text)
    if match:
        return len((match[1] + match[2]).lstrip("0"))
    return 0


def written_resolution(largest: float, digits: int) -> float:
    """Return half a last digit of the largest number in a column written with `digits` significant digits.

    It is half a unit of the last decimal where the number of decimals is fixed, and the largest rounding error where
    the number of significant digits is. A number that no double can hold has none.
    """
    if largest == 0.0 or digits == 0 or math.isinf(largest):
        return 0.0
    return 0.5 * 10.0 ** (math.floor(math.log10(largest)) - digits + 1)


def _lines(path: Path, content: bytes) -> list[str]:
    """The lines as an editor counts them; the byte order mark is dropped."""
    zero = content.find(b"\0")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise RecordError(path, None, None, "is UTF-16; save it as UTF-8")
    if zero >= 0:
        raise RecordError(path, None, None, f"is a binary file (byte {zero} is 0); a CSV or Parquet file is needed")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # the codec counts from behind the byte order mark
        behind_mark = 0
        if content.startswith(BOM):
            behind_mark = 3
        at = error.start + behind_mark
        row = content[:at].replace(b"\r\n", b"\n").replace(b"\r", b"\n").count(b"\n") + 1
        what = f"byte {at} (0x{content[at]:02x}) is not UTF-8; save the file as UTF-8"
        raise RecordError(path, row, None, what) from error
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def fields_of(path: Path, row: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line], strict=True, skipinitialspace=True))
    except csv.Error as error:
        if "unexpected end" in str(error):
            raise RecordError(path, row, None, 'a quote (") is not closed on its line') from error
        raise RecordError(path, row, None, f"not a row of comma-separated fields ({error})") from error


def taken_of(
    lines: list[str], width: int, place: dict[str, int]
) -> tuple[dict[str, tuple[str, ...]], dict[str, NDArray]] | None:
    """Texts and numbers of the columns in their places; None when a line has a fault."""
    if not lines:
        return dict.fromkeys(place, ()), dict.fromkeys(place, np.zeros(0))
    try:
        fields = list(csv.reader(lines, strict=True, skipinitialspace=True))
    except csv.Error:
        return None
    if len(fields) != len(lines) or set(map(len, fields)) != {width}:
        return None
    columns = list(zip(*fields, strict=True))
    texts = {name: columns[k] for name, k in place.items()}
    numbers = {}
    for name, column in texts.items():
        if name in TEXTS:
            if any(_text_fault(name, text) for text in set(column)):
                return None
            continue
        values = _numbers(column, may_be_empty=name in MAY_BE_EMPTY)
        if values is None:
            return None
        numbers[name] = values
    return texts, numbers


def faults_of_line(path: Path, row: int, line: str, width: int, place: dict[str, int]) -> Iterator[RecordError]:
    """Everything that is wrong with the fields of a row."""
    try:
        fields = fields_of(path, row, line)
    except RecordError as error:
        yield error
        return
    if len(fields) != width:
        yield RecordError(path, row, None, f"{len(fields)} fields, where the header has {width} columns")
        return
    for name, k in place.items():
        if name in TEXTS:
            fault = _text_fault(name, fields[k])
        else:
            fault = _number_fault(fields[k], name in MAY_BE_EMPTY)
        if fault:
            yield RecordError(path, row, name, fault)


def _numbers(texts: Sequence[str], may_be_empty: bool) -> NDArray | None:
    """Return the texts as finite numbers, or NaN if they may be empty; None when one is neither."""
    joined = "".join(texts)
    # float() takes 1_000 and the digits of every script
    if "_" in joined or not joined.isascii():
        return None
    if may_be_empty:
        texts = [text if text.strip() else "nan" for text in texts]
    try:
        values = np.array([float(text) for text in texts])
    except ValueError:
        return None
    allowed = np.isfinite(values)
    if may_be_empty:
        allowed |= np.isnan(values)
    if allowed.all():
        return values
    return None


def _number_fault(text: str, may_be_empty: bool) -> str | None:
    if not text.strip():
        if may_be_empty:
            return None
        return "the field is empty; a number is needed"
    if _numbers([text], may_be_empty) is not None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if math.isinf(value):
        return f"{quoted(text)} is infinite; a finite number is needed"
    if math.isnan(value):
        return f"{quoted(text)} is not a number; a finite number is needed"
    comma = ""
    if re.fullmatch(r"\s*[+-]?\d+,\d+\s*", text):
        comma = "; write a decimal point, not a comma"
    return f"{quoted(text)} is not a number; a decimal number is needed{comma}"


def _text_fault(name: str, text: str) -> str | None:
    """Return the fault of a field of a column of words; all but a mounting may be empty."""
    if name != MOUNTING and not text.strip():
        return None
    return _name_fault(text)


def _name_fault(text: str, signs: str = "letters, digits and signs") -> str | None:
    if not text.strip():
        return "the field is empty; a name is needed"
    if text.strip().isprintable():
        return None
    return f"{quoted(text)} is not a name; {signs} are needed"


def _too_many(path: Path, layout: Layout, rows: int) -> RecordError:
    most = layout.kind.most_rows
    return RecordError(path, None, None, f"has {rows} rows; at most {most} are read of a {layout.kind.name}")


def _read_parquet(path: Path, content: bytes, kinds: Sequence[RecordKind], *, trusted: bool) -> FileColumns:
    """Parquet with the same column names; rows count from 1; raises RecordError for the first fault."""
    wrong = None
    if not trusted:
        wrong = fault_of_parquet(content)
    if wrong is not None:
        raise RecordError(path, None, None, wrong)
    try:
        layout: Layout = recognise(path, list(pl.read_parquet_schema(io.BytesIO(content))), None, kinds)
        rows = pl.scan_parquet(io.BytesIO(content)).select(pl.len()).collect().item()
        if rows > layout.kind.most_rows:
            raise _too_many(path, layout, rows)
        frame = pl.read_parquet(io.BytesIO(content), columns=list(layout.present))
    except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError) as error:
        lines = str(error).strip().splitlines() or ["it is corrupt"]
        raise RecordError(path, None, None, f"is not a readable Parquet file ({lines[0][:120]})") from error
    if frame.height == 0:
        raise RecordError(path, None, None, "has no rows; at least one is needed")
    numbers = {name: _parquet_numbers(path, frame[name]) for name in layout.numbers}
    resolution = 0.0
    if FORCE[0] in layout.present and any(frame[name].dtype == pl.Float32 for name in FORCE):
        # half a last binary digit of readings that are kept in single precision
        largest = max(float(np.abs(frame[name].to_numpy()).max()) for name in FORCE)
        resolution = 0.5 * float(np.spacing(np.float32(largest)))
    texts = {name: _parquet_names(path, frame[name]) for name in layout.present if name in TEXTS}
    return FileColumns(path, layout, numbers, texts, np.arange(1, frame.height + 1), resolution)


def _parquet_numbers(path: Path, series: "Series") -> NDArray:
    if not series.dtype.is_numeric():
        raise RecordError(path, None, series.name, f"holds {series.dtype}; numbers are needed")
    empty = series.is_null().to_numpy()
    if empty.any() and series.name not in MAY_BE_EMPTY:
        row = int(np.argmax(empty)) + 1
        raise RecordError(path, row, series.name, "the field is empty; a number is needed")
    values = np.array(series.cast(pl.Float64).to_numpy())
    wrong = ~np.isfinite(values) & ~empty
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        what = f"{values[row - 1]} is not a finite number; a finite number is needed"
        raise RecordError(path, row, series.name, what)
    return values


def _parquet_names(path: Path, series: "Series") -> tuple[str, ...]:
    if series.dtype not in (pl.String, pl.Categorical, pl.Enum, pl.Null):
        raise RecordError(path, None, series.name, f"holds {series.dtype}; names are needed")
    names = [(name or "").strip() for name in series.cast(pl.String).to_list()]
    for row, name in enumerate(names, 1):
        fault = None
        if name or series.name == MOUNTING:
            fault = _name_fault(name, "letters and digits")
        if fault:
            raise RecordError(path, row, series.name, fault)
    return tuple(names)


def record_of_array(source: Any) -> ForceRecord | None:
    """Return an array (N, 3) of accelerometer readings [m/s²] as a record, a row a second; None of anything else.

    An InputError for an array of another shape, or with something that is not a number.
    """
    if not isinstance(source, np.ndarray) or source.dtype.names is not None:
        return None
    if source.ndim != 2 or source.shape[1] != 3 or not len(source):
        raise InputError(f"record: has the shape {source.shape}; an array (N, 3) of readings in m/s2 is needed")
    if source.dtype.kind not in "fiu" or not np.isfinite(source).all():
        raise InputError("record: holds something that is not a number; an array (N, 3) of readings in m/s2 is needed")
    force = source.astype(np.float64)
    return ForceRecord(time_s=np.arange(float(len(force))), specific_force=force, path=Path("array"))
