"""Read files from elsewhere as rows of texts: text with separators, LabVIEW measurement files, workbooks.

A sheet knows its format if the file states it (a marker of its encoding, a header of LabVIEW). Calamine (in Rust) reads
workbooks in another process, because a corrupt or malicious workbook may crash it. It gets a ZIP archive with only the
parts that a table needs, and no more memory than tables take.
"""

import csv
import gzip
import io
import math
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import islice
from operator import xor
from pathlib import Path

import polars as pl

from ..errors import InputError
from ..files import advice_on
from ..records.read import PACKED
from .numbers import Typed, bare, date_of, has_degree_mark, is_clock, is_missing, parsed_number
from .tables import TABLES

LARGEST = 2 << 30
"""Largest file that is read [bytes]."""
LARGE, HEAD = 30_000_000, 4_000_000
"""Size of a text from which its columns are read as numbers at once, and of its part that is examined [bytes]."""
MOST_ROWS = 2_000_000
"""Largest number of rows that are read."""
LONGEST_LINE = 100_000
"""Largest length of a line [characters]."""
LOOKED_AT = 3000
"""Number of rows that decide the format of a file."""
TRIED = 400
"""Number of lines on which separators are tried first."""
FEWEST_NUMBERS = 3
"""Smallest number of numbers in a row of measured data."""
SEPARATORS = {"tab": "\t", ";": ";", "|": "|", ",": ",", "blanks": " "}
"""Separators of fields, the least likely to occur inside fields first."""
ENCODINGS = ("utf-8", "utf-16", "cp1252", "cp1251", "cp1250", "latin-1", "cp437", "cp850", "mac-roman", "shift-jis")

MARKERS = {
    b"\xef\xbb\xbf": "utf-8-sig",
    b"\xff\xfe\0\0": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""Byte-order mark of a text -> its encoding."""
SERIAL = re.compile(r"^(\d\d:\d\d:\d\d[.:]\d+) -?> ")
"""Times that a monitor of a serial port writes before each line."""
CHECKED = re.compile(r"[$!](.+)\*([\dA-Fa-f]{2})\s*$")
"""A line with the checksum of NMEA: the exclusive or of its characters."""
_FIELD = re.compile(r"[^\s,;|]+")
_WORD = re.compile(r"[\dA-F]{4}|[\dA-F]{6}|[\dA-F]{8}|[\da-f]{4}|[\da-f]{6}|[\da-f]{8}")
"""A count of 16, 24 or 32 bits as a hexadecimal word, in letters of one case."""
LABVIEW = "LabVIEW Measurement"
"""First words of a LabVIEW measurement file (.lvm); its header has separator, marks, units and period."""
END_OF_HEADER = "***End_of_Header***"
KEPT_OF_HEADER = ("Operator", "Project", "Description", "Date", "Time", "Notes")
"""Entries of a LabVIEW header about the measurement; the others are about the file."""


Row = tuple[int, list[str]]
"""A row: its line, as an editor counts, and its texts."""


@dataclass(frozen=True)
class HeaderFacts:
    """Facts that a file states: decimal mark, line of names or these names, units, period of time, a likely rate.
    Further ones are the names of other tables in the file that may be meant, and a remark on its lines."""

    decimal: str = ""
    header_row: int = 0
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    first_row: int = 0
    time: str = ""
    likely_rate: str = ""
    parts: tuple[str, ...] = ()
    remark: str = ""


@dataclass(frozen=True)
class Sheet:
    """Rows of texts, by lines of a text file or by cells of a table.

    Attributes
    ----------
    path : Path
        the file
    lines : sequence of str
        lines of a text file
    cells : sequence of list of str, or None
        cells of a table that has cells; their numbers have decimal points
    encoding, separator, name : str
        encoding and separator of a text file; name of a table in a file of several
    stated : HeaderFacts
        facts that the file states
    shape : str
        original shape of a table that was made upright
    frame : table, or None
        columns of numbers, of a file that holds such; its names are line 1 if they are stated
    whole : Path, bytes or None
        content of a large text that begins with `lines`
    """

    path: Path
    lines: Sequence[str] = ()
    cells: Sequence[list[str]] | None = None
    encoding: str = ""
    separator: str = ""
    name: str = ""
    stated: HeaderFacts = field(default_factory=HeaderFacts)
    shape: str = ""
    frame: pl.DataFrame | None = None
    whole: Path | bytes | None = None

    def rows(self, first: int = 1, last: int | None = None) -> Iterator[Row]:
        """Yield the non-empty rows from line `first` on."""
        if self.frame is not None:
            yield from self._rows_of_frame(self.frame, first, last)
            return
        if self.cells is not None:
            for line, texts in enumerate(self.cells[first - 1 : last], first):
                if has_text(texts):
                    yield line, texts
            return
        lines = islice(self.lines, first - 1, last)
        if self.separator == "blanks":
            for line, text in enumerate(lines, first):
                if text.strip():
                    yield line, text.split()
            return
        reader = csv.reader(lines, delimiter=SEPARATORS[self.separator], skipinitialspace=True)
        while True:
            line = first + reader.line_num
            try:
                texts = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                raise InputError(f"{self.path}: row {line}: is not a row of fields ({error})") from error
            if has_text(texts):
                yield line, texts

    def _rows_of_frame(self, frame: pl.DataFrame, first: int, last: int | None) -> Iterator[Row]:
        """Yield the names and the rows of columns of numbers, as texts."""
        if self.stated.header_row >= first:
            yield 1, list(frame.columns)
        before = self.stated.header_row + 1
        rows = frame.slice(max(first - before, 0), None if last is None else max(last - first + 1, 0))
        line = max(first, before)
        for part in rows.iter_slices(LOOKED_AT):
            for values in part.iter_rows():
                yield line, [_text_of(value) for value in values]
                line += 1

    def changed(self, change: Callable[[int, list[str]], list[str]]) -> "Sheet":
        """Return a sheet of cells whose rows, with their lines, a function changes."""
        cells: list[list[str]] = []
        for line, texts in self.rows():
            cells += [[] for _ in range(line - 1 - len(cells))]
            cells.append(change(line, list(texts)))
        return replace(self, lines=(), cells=cells, frame=None)

    @property
    def about(self) -> str:
        """Return the format in words."""
        if self.frame is not None:
            return f"columns of {self.name}" if self.name else "columns"
        form = f"sheet {self.name!r}" if self.name else self.encoding
        if self.separator and not self.name:
            between = self.separator if self.separator in ("tab", "blanks") else repr(self.separator)
            form += f", {between} between fields"
        return ", ".join(filter(None, (form, self.shape)))


def _text_of(value: object) -> str:
    """Return a value of a column as a text: a number keeps its digits, NaN and nothing are empty."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int | float):
        return Typed(repr(value))
    return str(value)


def has_text(texts: Sequence[str]) -> bool:
    """Return True if some cell of a row is not empty."""
    return bool("".join(texts).strip())


def cell(texts: Sequence[str], place: int) -> str:
    """Return the text of a field of a row; "" if the row is shorter."""
    if place < len(texts):
        return texts[place]
    return ""


def is_value(text: str) -> bool:
    """Return True if a text is a number with either decimal mark, an angle, a time or a date."""
    if not any(map(str.isdigit, text)):
        return False
    is_number = parsed_number(text, ".", ",") is not None or parsed_number(text, ",", ".") is not None
    return is_number or is_clock(text) or has_degree_mark(text) or date_of(text) is not None


def is_word(text: str) -> bool:
    """Return True if a text is neither a value nor a mark of a missing measurement."""
    return not is_missing(text) and not is_value(text)


def is_data(texts: Sequence[str]) -> bool:
    """Return True if a row holds measured numbers: at least three, and more numbers than words."""
    values = sum(is_value(text) or is_value(bare(text)) for text in texts)
    words = sum(not is_missing(text) for text in texts) - values
    return values >= FEWEST_NUMBERS and values > words


def unpacked(path: Path, content: bytes) -> bytes:
    """Return the bytes of a file, unpacked if gzip packed it.

    Raises InputError if they are too many, or corrupt.
    """
    if not content.startswith(PACKED):
        return content
    try:
        with gzip.open(io.BytesIO(content)) as file:
            content = file.read(LARGEST + 1)
    except EOFError as error:
        raise InputError(f"{path}: is packed by gzip and is cut short; copy it again") from error
    except (OSError, zlib.error) as error:
        raise InputError(f"{path}: is packed by gzip and cannot be unpacked ({error})") from error
    if len(content) > LARGEST:
        raise InputError(f"{path}: unpacks to more than {LARGEST} bytes; not read")
    return content


def refuse_other(path: Path, content: bytes) -> None:
    """Refuse a file that is not text with a table, by its first bytes, with advice."""
    advice = advice_on(path, content, "record", "workbook")
    if advice:
        raise InputError(f"{path}: is not a table of measured data{advice}")
    begins = content[:1000].removeprefix(b"\xef\xbb\xbf").lstrip().decode("latin-1")
    for pattern, what in TABLES["others"].items():
        if re.match(pattern, begins):
            raise InputError(f"{path}: {what}")


def decoded(path: Path, content: bytes, encoding: str = "") -> tuple[str, str]:
    """Return text and encoding of a file: by its marker, otherwise as UTF-8, otherwise in the encoding of Windows."""
    for mark, name in MARKERS.items():
        if content.startswith(mark):
            encoding = encoding or name
    if encoding:
        return _decoded(path, content, encoding), encoding
    if 0 not in content.rstrip(b"\0"):
        # loggers fill up their last block with zeros
        content = content.rstrip(b"\0")
    zeros = content[:2000].count(0)
    if zeros:
        for name, at in (("utf-16-le", 1), ("utf-16-be", 0)):
            if content[at:2000:2].count(0) == zeros and 3 * zeros > len(content[:2000]):
                return _decoded(path, content, name), name
        raise InputError(f"{path}: is a binary file; text (CSV, LabVIEW) or a workbook is needed")
    try:
        return content.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return _decoded(path, content, "cp1252"), "cp1252"


def _decoded(path: Path, content: bytes, encoding: str) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not {encoding}; give --set encoding=NAME") from error
    except LookupError as error:
        raise InputError(f"--set encoding={encoding}: is not known; {', '.join(ENCODINGS)}") from error


def lines_of(path: Path, text: str) -> list[str]:
    """Return the lines of a text, as an editor counts them.

    Raises InputError if there are too many, or if they are too long.
    """
    if "\0" in text:
        raise InputError(f"{path}: is a binary file; text (CSV, LabVIEW) or a workbook is needed")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(lines) > MOST_ROWS:
        raise InputError(f"{path}: has {len(lines)} rows; at most {MOST_ROWS} are read")
    if max(map(len, lines)) > LONGEST_LINE:
        row = next(k for k, line in enumerate(lines, 1) if len(line) > LONGEST_LINE)
        raise InputError(f"{path}: row {row}: is longer than {LONGEST_LINE} characters; a table is needed")
    return lines


def text_sheet(path: Path, lines: list[str], encoding: str, separator: str = "") -> Sheet:
    """Return a text file as a sheet; the default separator gives most values."""
    if 2 * sum(SERIAL.match(line) is not None for line in lines[:TRIED]) > len(lines[:TRIED]):
        plain = text_sheet(path, [SERIAL.sub("", line) for line in lines], encoding, separator)
        stamped = rf"\1{SEPARATORS[plain.separator]}"
        return replace(plain, lines=[SERIAL.sub(stamped, line) for line in lines])
    if all(map(CHECKED.match, filter(None, lines[:TRIED]))):
        lines = [without_checksum(line) for line in lines]
    lines = with_marked_words(lines)
    sheet = Sheet(path, lines, encoding=encoding)
    if separator:
        if separator not in SEPARATORS:
            raise InputError(f"--set separator={separator}: must be one of {' '.join(SEPARATORS)}")
        return replace(sheet, separator=separator)
    hint = lines[0].lower()
    if hint != "sep=\t":
        hint = hint.strip()
    for name, mark in SEPARATORS.items():
        if hint == f"sep={mark}":
            # only Excel writes this line
            return replace(sheet, lines=["", *lines[1:]], separator=name)
    best = (0, 0)
    for count in (TRIED, LOOKED_AT):
        for name in SEPARATORS:
            worth = _worth(replace(sheet, lines=lines[:count], separator=name))
            if not separator or worth > best:
                separator, best = name, worth
        if best[0]:
            break
    return replace(sheet, separator=separator)


def with_marked_words(lines: list[str]) -> list[str]:
    """Return lines whose counts in hexadecimal words, as 1F0A, are marked as such: 0x1F0A; unchanged if they are none.

    Such a field has words of one length in all rows but the first ones; some have letters, and most have digits.
    """
    fields = [_FIELD.findall(line) for line in lines[1:TRIED] if line.strip()]
    places = []
    for place, texts in enumerate(zip(*fields[len(fields) // 2 :], strict=False)):
        letters = sum(not text.isdecimal() for text in texts)
        digits = sum(any(map(str.isdecimal, text)) for text in texts)
        if len({len(text) for text in texts}) == 1 and letters and 2 * digits > len(texts):
            places += [place] * all(map(_WORD.fullmatch, texts))
    if len(places) < FEWEST_NUMBERS:
        return lines
    marked = []
    for line in lines:
        texts = list(_FIELD.finditer(line))
        if len(texts) > places[-1] and all(_WORD.fullmatch(texts[place][0]) for place in places):
            for place in reversed(places):
                line = f"{line[: texts[place].start()]}0x{line[texts[place].start() :]}"
        marked.append(line)
    return marked


def without_checksum(line: str) -> str:
    """Return a line between "$" and "*" without its checksum where that is right, and else unchanged."""
    checked = CHECKED.match(line)
    if checked and reduce(xor, checked[1].encode(), 0) == int(checked[2], 16):
        return checked[1]
    return line


def _worth(sheet: Sheet) -> tuple[int, int]:
    """Return a separator's score: data rows of the most frequent width; then few words in them."""
    words: dict[int, list[int]] = {}
    try:
        for _, texts in sheet.rows():
            if is_data(texts):
                words.setdefault(len(texts), []).append(sum(map(is_word, texts)))
    except InputError:
        return 0, 0
    most = max(words.values(), key=len, default=[])
    return len(most), -sum(most)


def labview_sheet(path: Path, lines: list[str], encoding: str) -> Sheet:
    """Return a LabVIEW measurement file as a sheet with the facts of its header.

    Raises InputError if the header describes no table.
    """
    ends = [line for line, text in enumerate(lines, 1) if text.strip().startswith(END_OF_HEADER)]
    if len(ends) != 2:
        what = f"{len(ends) - 1} parts with a header; one is read" if ends else "no end of its header"
        raise InputError(f"{path}: is a LabVIEW measurement file with {what}")
    of_file, of_table = ends
    separator, mark = "tab", "\t"
    if "Separator,Comma" in map(str.strip, lines[:of_file]):
        separator = mark = ","
    header: dict[str, list[str]] = {}
    for text in lines[:of_table]:
        key, *cells = map(str.strip, text.split(mark))
        header.setdefault(key, cells)
    decimal, dimension, step, in_columns = (
        next(iter(header.get(key, ())), "") for key in ("Decimal_Separator", "X_Dimension", "Delta_X", "X_Columns")
    )
    decimal = decimal or "."
    if decimal not in (".", ","):
        raise InputError(f"{path}: Decimal_Separator {decimal!r}: is neither a point nor a comma")
    body = lines[of_table:]
    names = next((line for line, text in enumerate(body, of_table + 1) if text.strip()), 0)
    seconds = dimension in ("", "Time")
    period = parsed_number(step, decimal)
    stated = HeaderFacts(
        decimal=decimal,
        header_row=names,
        units=("s" if seconds else "", *header.get("Y_Unit_Label", ())),
        first_row=names + 1,
        time=f"{period!r} s" if seconds and period and in_columns == "No" else "",
    )
    remarks = [text if mark in text and text.split(mark)[0] in KEPT_OF_HEADER else "" for text in lines[:of_file]]
    remarks += [""] * (of_table - of_file)
    return Sheet(path, remarks + body, encoding=encoding, separator=separator, stated=stated)
