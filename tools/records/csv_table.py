"""CSV: UTF-8, comma, one header line, comments with `#`; fields to numbers, the first wrong one named."""

import csv
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from ..progress import tracked
from .columns import (
    ANGLES,
    FORCE,
    QUATERNION,
    TEMPERATURE,
    Columns,
    Layout,
    RecordError,
    refusal,
    shown,
)

LARGE = 30_000_000
"""From so many bytes on reading shows its progress."""
PART = 16384
"""Rows that are taken from text to numbers at once: bounds the memory that their texts need."""

_DIGITS = re.compile(r"\s*[+-]?(\d*)\.?(\d*)(?:[eE][+-]?\d+)?\s*")


def read_csv(path: Path, data: bytes, recognise: Callable[[Sequence[str], int], Layout]) -> Columns:
    """Read the columns that `recognise` asks for from the bytes of a CSV file.

    Parameters
    ----------
    path : Path
        for messages
    data : bytes
        the whole file
    recognise : callable
        (names of the columns, header's row) -> Layout

    Raises
    ------
    InputError
        for everything that is not such a table of finite numbers; it names the first fault's row and column
    """
    reader, body, rows = _opened(path, data, recognise)
    layout = reader.layout
    parts: dict[str, list[np.ndarray]] = {name: [] for name in layout.numbers}
    texts: dict[str, list[str]] = {name: [] for name in layout.texts}
    digits: dict[str, int] = {}
    for start in tracked(range(1, len(body), PART), "reading", show=len(data) >= LARGE):
        columns = reader.part(body[start : start + PART], rows[start : start + PART])
        for name in layout.numbers:
            parts[name].append(columns[name][1])
        for name in layout.texts:
            texts[name] += [text.strip() for text in columns[name][0]]
        if start == 1:
            digits = {name: max(map(significant_digits, columns[name][0])) for name in layout.numbers}
    numbers = {name: np.concatenate(part) for name, part in parts.items()}

    def written(*names: str) -> float:
        largest = max(float(np.abs(numbers[name]).max()) for name in names)
        return written_resolution(largest, max(digits[name] for name in names))

    return Columns(
        path,
        layout,
        numbers,
        {k: tuple(v) for k, v in texts.items()},
        rows[1:],
        written(*FORCE),
        written(*ANGLES) if ANGLES[0] in numbers else 0.0,
        written(TEMPERATURE) if TEMPERATURE in numbers else 0.0,
    )


def read_faulty_csv(
    path: Path, data: bytes, recognise: Callable[[Sequence[str], int], Layout]
) -> tuple[list[RecordError], Columns | None]:
    """Every fault of the fields of a CSV file, and the columns of the rows that have none.

    Parameters and errors are those of `read_csv`, which raises the first of these faults; an error is raised where
    there is no table at all. The columns are None where every row has a fault.
    """
    reader, body, rows = _opened(path, data, recognise)
    found: list[RecordError] = []
    whole = []
    for line, row in zip(body[1:], rows[1:], strict=True):
        faults = list(reader.faults(line, int(row)))
        found += faults
        if not faults:
            whole.append(line)
    if not whole:
        return found, None
    kept = b"\n".join([body[0].encode(), *(line.encode() for line in whole)])
    faulty = {fault.row for fault in found}
    columns = read_csv(path, kept, recognise)
    return found, replace(columns, row=np.array([row for row in rows[1:].tolist() if row not in faulty]))


def _opened(
    path: Path, data: bytes, recognise: Callable[[Sequence[str], int], Layout]
) -> tuple["_Reader", list[str], np.ndarray]:
    """A reader of the rows, the lines that are written, the header first, and where each stands."""
    lines = _lines(path, data)
    written = [bool(line) and line[0] != "#" and not line.isspace() for line in lines]
    rows = np.flatnonzero(written) + 1
    body = list(compress(lines, written))
    if not body:
        raise refusal(path, None, None, "is empty; a header and at least one row are needed")
    header_row = int(rows[0])
    names = [name.strip() for name in _fields(path, header_row, body[0])]
    layout = recognise(names, header_row)
    if len(body) == 1:
        raise refusal(path, header_row, None, "no rows follow the header")
    return _Reader(path, names, layout), body, rows


def significant_digits(text: str) -> int:
    """How many digits of a number are written, leading zeros not counted: 4 for "-0.01230"."""
    found = _DIGITS.fullmatch(text)
    return len((found[1] + found[2]).lstrip("0")) if found else 0


def written_resolution(largest: float, digits: int) -> float:
    """Half a last digit of the largest number in a column that is written with so many significant digits.

    It is half a unit of the last decimal where the number of decimals is fixed, and the largest rounding
    error where the number of significant digits is.
    """
    if largest == 0.0 or digits == 0:
        return 0.0
    return 0.5 * 10.0 ** (math.floor(math.log10(largest)) - digits + 1)


def _lines(path: Path, data: bytes) -> list[str]:
    """The lines as an editor counts them; the byte order mark is dropped."""
    zero = data.find(b"\0")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise refusal(path, None, None, "is UTF-16; save it as UTF-8")
    if zero >= 0:
        raise refusal(path, None, None, f"is a binary file (byte {zero} is 0); a CSV or Parquet file is needed")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # the codec counts from behind the byte order mark
        at = error.start + (3 if data.startswith(b"\xef\xbb\xbf") else 0)
        row = data[:at].replace(b"\r\n", b"\n").replace(b"\r", b"\n").count(b"\n") + 1
        what = f"byte {at} (0x{data[at]:02x}) is not UTF-8; save the file as UTF-8"
        raise refusal(path, row, None, what) from error
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _fields(path: Path, row: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line], strict=True, skipinitialspace=True))
    except csv.Error as error:
        if "unexpected end" in str(error):
            raise refusal(path, row, None, 'a quote (") is not closed on its line') from error
        raise refusal(path, row, None, f"not a row of comma-separated fields ({error})") from error


class _Reader:
    """Takes rows of text to numbers, a part of the file at a time."""

    def __init__(self, path: Path, names: Sequence[str], layout: Layout) -> None:
        self.path = path
        self.names = names
        self.layout = layout
        self.place = {name: names.index(name) for name in layout.present}

    def part(self, lines: list[str], rows: np.ndarray) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
        """Texts and numbers of each column that is asked for; raises InputError for the first fault."""
        try:
            fields = list(csv.reader(lines, strict=True, skipinitialspace=True))
        except csv.Error:
            raise self._first_fault(lines, rows) from None
        if len(fields) != len(lines) or set(map(len, fields)) != {len(self.names)}:
            raise self._first_fault(lines, rows)
        columns = list(zip(*fields, strict=True))
        result = {}
        for name, place in self.place.items():
            texts = columns[place]
            values = np.zeros(0)
            if name in self.layout.numbers:
                found = _numbers(texts, may_be_empty=name in QUATERNION)
                if found is None:
                    raise self._first_fault(lines, rows)
                values = found
            elif any(_name_fault(text) for text in texts):
                raise self._first_fault(lines, rows)
            result[name] = (texts, values)
        return result

    def _first_fault(self, lines: list[str], rows: np.ndarray) -> RecordError:
        for line, number in zip(lines, rows, strict=True):
            for fault in self.faults(line, int(number)):
                return fault
        raise AssertionError(f"{self.path}: rows {rows[0]} to {rows[-1]} were refused without a fault")

    def faults(self, line: str, row: int) -> Iterator[RecordError]:
        """Everything that is wrong with the fields of a row."""
        try:
            fields = _fields(self.path, row, line)
        except RecordError as error:
            yield error
            return
        if len(fields) != len(self.names):
            what = f"{len(fields)} fields, where the header has {len(self.names)} columns"
            yield refusal(self.path, row, None, what)
            return
        for name, place in sorted(self.place.items(), key=lambda item: item[1]):
            if name in self.layout.texts:
                fault = _name_fault(fields[place])
            else:
                fault = _number_fault(fields[place], may_be_empty=name in QUATERNION)
            if fault:
                yield refusal(self.path, row, name, fault)


def _numbers(texts: Sequence[str], may_be_empty: bool) -> np.ndarray | None:
    """The texts as finite numbers; None when one of them is not."""
    joined = "".join(texts)
    # float() takes 1_000 and the digits of every script
    if "_" in joined or not joined.isascii():
        return None
    empty = 0
    try:
        if may_be_empty:
            filled = [text if text.strip() else "nan" for text in texts]
            empty = sum(not text.strip() for text in texts)
            values = np.array([float(text) for text in filled])
        else:
            values = np.array([float(text) for text in texts])
    except ValueError:
        return None
    return values if np.count_nonzero(np.isfinite(values)) == len(values) - empty else None


def _number_fault(text: str, may_be_empty: bool) -> str | None:
    if not text.strip():
        return None if may_be_empty else "the field is empty; a number is needed"
    if _numbers([text], may_be_empty=False) is not None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = None
    if value is not None and math.isnan(value):
        return f"{shown(text)} is not a number; a finite number is needed"
    if value is not None and math.isinf(value):
        return f"{shown(text)} is infinite; a finite number is needed"
    comma = "; write a decimal point, not a comma" if re.fullmatch(r"\s*[+-]?\d+,\d+\s*", text) else ""
    return f"{shown(text)} is not a number; a decimal number is needed{comma}"


def _name_fault(text: str) -> str | None:
    if not text.strip():
        return "the field is empty; a name is needed"
    if not text.strip().isprintable():
        return f"{shown(text)} is not a name; letters, digits and signs are needed"
    return None
