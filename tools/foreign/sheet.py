"""A file from elsewhere as rows of texts: what is read of it before anything is understood.

A sheet knows how it was written as far as the file says so itself (a marker of its encoding, a header of LabVIEW).
"""

import csv
import re
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from ..errors import InputError
from ..records.read import PACKED
from .numbers import bare, date_of, has_degree_mark, is_clock, is_missing, number

LARGEST = 400_000_000
"""Bytes of a file that is read."""
MOST_ROWS = 2_000_000
"""Rows of a file that are read."""
LONGEST_LINE = 100_000
"""Characters of a line."""
LOOKED_AT = 3000
"""Rows from which it is understood how a file is written."""
TRIED = 400
"""Lines that separators are tried on first."""
FEWEST_NUMBERS = 3
"""Numbers in a row of measured data, at least."""
SEPARATORS = {"tab": "\t", ";": ";", "|": "|", ",": ",", "blanks": " "}
"""What may stand between fields, the least likely to stand inside them first."""
ENCODINGS = ("utf-8", "utf-16", "cp1252", "cp1251", "cp1250", "latin-1", "cp437", "cp850", "mac-roman", "shift-jis")
OTHERS = {
    r"PK": "is a ZIP archive; unpack it and give the file in it",
    r"BZh|\xfd7zXZ|7z\xbc\xaf|Rar!|\(\xb5/\xfd": "is a packed archive; unpack it and give the file in it",
    r"%PDF-": "is a PDF; export the table as CSV",
    r"PAR1": "is Parquet; with the columns of a record it is one as it is: trihedron check FILE",
    r"(?i)<(\?xml|!doctype|html|table)\b": "is HTML or XML, whatever its name; save it from a spreadsheet as CSV",
    r'\{\s*["}]|\[\s*[{[]': "is JSON; save its table as CSV",
}
"""How files begin that are no text with a table (bytes as Latin-1), what they are and what would be right."""
MARKERS = {
    b"\xef\xbb\xbf": "utf-8-sig",
    b"\xff\xfe\0\0": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""What a text may begin with, and its encoding."""
LABVIEW = "LabVIEW Measurement"
END_OF_HEADER = "***End_of_Header***"
KEPT_OF_HEADER = ("Operator", "Project", "Description", "Date", "Time", "Notes")
"""What of a header of LabVIEW is about the measurement; the rest is about the file."""
Row = tuple[int, list[str]]
"""A row: its line, as an editor counts, and its texts."""


@dataclass(frozen=True)
class Stated:
    """What a file says of itself: decimal mark, line of names, unit of each field, column and period of time."""

    decimal: str = ""
    header_row: int = 0
    units: tuple[str, ...] = ()
    first_row: int = 0
    time: str = ""


@dataclass(frozen=True)
class Sheet:
    """Rows of texts, by lines of a text file or by cells of a table.

    Attributes
    ----------
    path : Path
    lines : sequence of str
        of a text file
    cells : sequence of list of str, or None
        of a table that has cells; numbers have decimal points there
    encoding, separator, name : str
        of a text file; of a table in a file of several
    stated : Stated
        what the file says of itself
    shape : str
        what shape the table had that was made an upright one
    """

    path: Path
    lines: Sequence[str] = ()
    cells: Sequence[list[str]] | None = None
    encoding: str = ""
    separator: str = ""
    name: str = ""
    stated: Stated = field(default_factory=Stated)
    shape: str = ""

    def rows(self, first: int = 1, last: int | None = None) -> Iterator[Row]:
        """The rows from line `first` on; what is empty is passed over."""
        if self.cells is not None:
            for line, texts in enumerate(self.cells[first - 1 : last], first):
                if any(text.strip() for text in texts):
                    yield line, texts
            return
        lines = islice(self.lines, first - 1, last)
        if self.separator == "blanks":
            for line, text in enumerate(lines, first):
                if text.strip():
                    yield line, text.split()
            return
        read = csv.reader(lines, delimiter=SEPARATORS[self.separator], skipinitialspace=True)
        while True:
            line = first + read.line_num
            try:
                texts = next(read)
            except StopIteration:
                return
            except csv.Error as error:
                raise InputError(f"{self.path}: row {line}: is no row of fields ({error})") from error
            if any(text.strip() for text in texts):
                yield line, texts

    @property
    def about(self) -> str:
        """How it is written, for a person."""
        shape = f", {self.shape}" if self.shape else ""
        if self.name:
            return f"sheet {self.name!r}{shape}"
        between = self.separator if self.separator in ("tab", "blanks") else repr(self.separator)
        return f"{self.encoding}, {between} between fields{shape}"


def is_value(text: str, decimal: str = "") -> bool:
    """Whether a text is a number, with either decimal mark where none is given, an angle, a time or a date."""
    if not any(map(str.isdigit, text)):
        return False
    marks = (decimal,) if decimal else (".", ",")
    if any(number(text, mark, "".join({".", ","} - {mark})) is not None for mark in marks):
        return True
    return is_clock(text) or has_degree_mark(text) or date_of(text) is not None


def value_cells(texts: Sequence[str]) -> int:
    """How many cells of a row hold values."""
    return sum(is_value(text) or is_value(bare(text)) for text in texts)


def is_data(texts: Sequence[str]) -> bool:
    """Whether a row holds measured numbers: three at least, and more of them than of words."""
    values = value_cells(texts)
    words = sum(not is_missing(text) for text in texts) - values
    return values >= FEWEST_NUMBERS and values > words


def unpacked(path: Path, data: bytes) -> bytes:
    """The bytes of a file that gzip packed; others as they are. An InputError where they are too many, or corrupt."""
    if not data.startswith(PACKED):
        return data
    parts, length = list[bytes](), 0
    while data.strip(b"\0"):
        reader = zlib.decompressobj(wbits=31)
        try:
            parts.append(reader.decompress(data, LARGEST + 1 - length))
        except zlib.error as error:
            raise InputError(f"{path}: is packed by gzip and cannot be unpacked ({error})") from error
        length += len(parts[-1])
        if length > LARGEST:
            raise InputError(f"{path}: unpacks to more than {LARGEST} bytes; not read")
        if not reader.eof:
            raise InputError(f"{path}: is packed by gzip and ends too early; copy it again")
        data = reader.unused_data
    return b"".join(parts)


def refuse_other(path: Path, data: bytes) -> None:
    """Refuse a file that is no text with a table, by what it begins with, and say what would be right."""
    begins = data[:1000].removeprefix(b"\xef\xbb\xbf").lstrip().decode("latin-1")
    for pattern, said in OTHERS.items():
        if re.match(pattern, begins):
            raise InputError(f"{path}: {said}")


def decoded(path: Path, data: bytes, encoding: str = "") -> tuple[str, str]:
    """Text and encoding of a file: by its marker, as UTF-8 where it is that, as Windows writes it where it is not."""
    for mark, name in MARKERS.items():
        if data.startswith(mark) and not encoding:
            return _decoded(path, data, name), name
    if encoding:
        return _decoded(path, data, encoding), encoding
    if 0 not in data.rstrip(b"\0"):
        # loggers fill up their last block with zeros
        data = data.rstrip(b"\0")
    zeros = data[:2000].count(0)
    if zeros:
        for name, at in (("utf-16-le", 1), ("utf-16-be", 0)):
            if data[at:2000:2].count(0) == zeros and 3 * zeros > len(data[:2000]):
                return _decoded(path, data, name), name
        raise InputError(f"{path}: is a binary file; text (CSV, LabVIEW) or a workbook is needed")
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return _decoded(path, data, "cp1252"), "cp1252"


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not {encoding}; give --set encoding=NAME") from error
    except LookupError as error:
        raise InputError(f"--set encoding={encoding}: is not known; {', '.join(ENCODINGS)}") from error


def lines_of(path: Path, text: str) -> list[str]:
    """The lines of a text, as an editor counts them; an InputError where there are too many, or they are too long."""
    if "\0" in text:
        raise InputError(f"{path}: is a binary file; text (CSV, LabVIEW) or a workbook is needed")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(lines) > MOST_ROWS:
        raise InputError(f"{path}: has {len(lines)} rows; at most {MOST_ROWS} are read")
    if max(map(len, lines)) > LONGEST_LINE:
        row = next(k for k, line in enumerate(lines, 1) if len(line) > LONGEST_LINE)
        raise InputError(f"{path}: row {row}: is longer than {LONGEST_LINE} characters; it is no table")
    return lines


def text_sheet(path: Path, lines: list[str], encoding: str, separator: str = "") -> Sheet:
    """A text file as a sheet; without a separator the one that makes most values of its rows."""
    sheet = Sheet(path, lines, encoding=encoding)
    if separator:
        if separator not in SEPARATORS:
            raise InputError(f"--set separator={separator}: must be one of {' '.join(SEPARATORS)}")
        return replace(sheet, separator=separator)
    hint = re.fullmatch(r"sep=(.)", lines[0].strip(), re.IGNORECASE) if lines[0].strip() else None
    named = next((name for name, mark in SEPARATORS.items() if hint and mark == hint[1]), "")
    if lines[0].lower() == "sep=\t":
        named = "tab"
    if named:
        # the line is Excel's alone
        return replace(sheet, lines=["", *lines[1:]], separator=named)
    worth: dict[str, tuple[int, int]] = {}
    for count in (TRIED, LOOKED_AT):
        worth = {name: _worth(replace(sheet, lines=lines[:count], separator=name)) for name in SEPARATORS}
        if max(worth.values())[0]:
            break
    return replace(sheet, separator=max(worth, key=lambda name: worth[name]))


def _worth(sheet: Sheet) -> tuple[int, int]:
    """Rows of data that a separator makes, all of the width that most have; the fewer words in them the better."""
    try:
        rows = [texts for _, texts in sheet.rows() if is_data(texts)]
    except InputError:
        return 0, 0
    widths = Counter(len(texts) for texts in rows)
    width = widths.most_common(1)[0][0] if rows else 0
    whole = [texts for texts in rows if len(texts) == width]
    return len(whole), -sum(not is_missing(text) and not is_value(text) for texts in whole for text in texts)


# LabVIEW's measurement files (.lvm): a header says separator, decimal mark, units and period


def is_labview(lines: list[str]) -> bool:
    """Whether lines of text are a measurement file."""
    return lines[0].strip().startswith(LABVIEW)


def labview_sheet(path: Path, lines: list[str], encoding: str) -> Sheet:
    """A measurement file as a sheet that knows what its header says; an InputError where that says no table."""
    ends = [line for line, text in enumerate(lines, 1) if text.strip().startswith(END_OF_HEADER)]
    if len(ends) != 2:
        what = "no end of its header" if not ends else f"{len(ends) - 1} parts with a header; one is read"
        raise InputError(f"{path}: is a LabVIEW measurement file with {what}")
    separator = "," if any(text.strip() == "Separator,Comma" for text in lines[: ends[0]]) else "\t"
    rows = [text.split(separator) for text in lines[: ends[1]]]
    header: dict[str, list[str]] = {}
    for cells in rows:
        header.setdefault(cells[0].strip(), [cell.strip() for cell in cells[1:]])
    decimal = _first_behind(header, "Decimal_Separator") or "."
    if decimal not in (".", ","):
        raise InputError(f"{path}: Decimal_Separator {decimal!r}: is neither a point nor a comma")
    names = next((line for line, text in enumerate(lines[ends[1] :], ends[1] + 1) if text.strip()), 0)
    seconds = _first_behind(header, "X_Dimension") in ("", "Time")
    period = number(_first_behind(header, "Delta_X"), decimal)
    kept = [
        text if any(text.startswith(f"{key}{separator}") for key in KEPT_OF_HEADER) else "" for text in lines[: ends[0]]
    ]
    stated = Stated(
        decimal=decimal,
        header_row=names,
        units=("s" if seconds else "", *header.get("Y_Unit_Label", ())),
        first_row=names + 1,
        time=f"{period!r} s" if seconds and period and _first_behind(header, "X_Columns") == "No" else "",
    )
    return Sheet(
        path,
        [*kept, *[""] * (ends[1] - ends[0]), *lines[ends[1] :]],
        encoding=encoding,
        separator="tab" if separator == "\t" else ",",
        stated=stated,
    )


def _first_behind(header: dict[str, list[str]], key: str) -> str:
    """The first text behind a key; "" where there is none."""
    return next(iter(header.get(key, ())), "")
