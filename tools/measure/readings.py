"""Incoming readings from a growing file, standard input or a named pipe: lines of a raw record.

Lines are converted to numbers; lines that cannot be rows are left out and counted.
"""

import os
import queue
import stat
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ..errors import InputError, reason
from ..files import note_read
from ..records.columns import (
    ANGLES,
    BENCH,
    FORCE,
    RAW,
    SHORTEST,
    TEMPERATURE,
    FileColumns,
    Layout,
    RecordError,
    faults,
    recognise,
)
from ..records.read import PART, faults_of_line, fields_of, significant_digits, taken_of, written_resolution

LONGEST_LINE = 8192
"""Largest part of a line that is kept while its end has not come [bytes]."""
LONGEST_GAP_S = 7 * 86400.0
"""Largest credible jump of a clock [s]."""
TIME, ALPHA, BETA, F1, LINE, WARMTH = 0, 1, 2, 3, 6, 7
"""Columns of the rows: s, rad, rad, m/s² (three), line of the record, °C (NaN if there is none)."""


@dataclass(frozen=True)
class AcceptedLines:
    """Incoming lines: bytes to keep, the rows in them (n, 8), and a line for each part left out."""

    kept: bytes
    rows: Floats
    left_out: tuple[str, ...] = ()


NOTHING = AcceptedLines(b"", np.zeros((0, 8)))


class RecordLines:
    """The lines of a source: a fold over bytes, whose state is the header, the last time, and a line without its end.

    Attributes
    ----------
    layout : Layout or None
        columns that the header names; None before it has come
    count : int
        lines kept
    last_s : float
        time of the last row kept [s]
    resolution : float
        half a last digit of the readings as they are written [m/s²]
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.layout: Layout | None = None
        self.header: list[str] = []
        self.count, self.rows, self.last_s = 0, 0, -np.inf
        self._place: dict[str, int] = {}
        self._open, self._overlong = b"", False
        self._digits, self._largest = 0, 0.0
        self._before: float | None = None

    @property
    def resolution(self) -> float:
        """Half a last digit of the largest reading so far [m/s²], like that of a whole record."""
        return written_resolution(self._largest, self._digits)

    def from_the_beginning(self) -> None:
        """Expect repeated lines: skip the header, and rows up to the last time."""
        self._open, self._overlong = b"", False
        self._before = None
        if self.rows:
            self._before = self.last_s
        self.layout = None

    def feed(self, data: bytes, *, ended: bool = False) -> AcceptedLines:
        """Take incoming bytes; a line without its end waits for it, unless the source has ended.

        Raises InputError for a header that is not a raw record's.
        """
        lines_come, newline, self._open = (self._open + data).rpartition(b"\n")
        lines = (lines_come + newline).splitlines(keepends=True)
        if ended and self._open:
            lines.append(self._open + b"\n")
            self._open = b""
        refused = []
        if self._overlong and lines:
            lines, self._overlong = lines[1:], False
        if len(self._open) > LONGEST_LINE:
            refused, self._open, self._overlong = ["a line without end"], b"", True
        written, rows = [], [NOTHING.rows]
        if self.layout is None:
            head, lines = self._header_of(lines)
            written += self._counted(head)
        for start in range(0, len(lines), PART):
            part, numbers, faulty = self._checked(lines[start : start + PART])
            written += part
            rows.append(numbers)
            refused += faulty
        return AcceptedLines(b"".join(written), np.concatenate(rows), tuple(refused))

    def _header_of(self, lines: list[bytes]) -> tuple[list[bytes], list[bytes]]:
        """Return the kept lines up to the header, and the lines after it; numbers alone have the usual columns."""
        again = bool(self.header)
        for k, line in enumerate(lines):
            encoding = "utf-8"
            if k == 0 and self.count == 0:
                encoding = "utf-8-sig"
            try:
                text = line.decode(encoding).strip()
            except UnicodeDecodeError:
                raise InputError(f"{self.path}: row {k + 1}: is not UTF-8; a raw record (CSV) is needed") from None
            if "\0" in text:
                raise InputError(f"{self.path}: is binary; a raw record (CSV) is needed")
            if not text or text.startswith("#"):
                continue
            fields = fields_of(self.path, self.count + k + 1, text)
            if not _is_number(fields[0]):
                self._recognised(self.count + k + 1, [name.strip() for name in fields])
                head, remaining = lines[: k + 1], lines[k + 1 :]
            else:
                names = self.header
                if not again:
                    usual = [*RAW.required, TEMPERATURE]
                    names = usual[: max(6, len(fields))]
                self._recognised(self.count + k + 1, names)
                head, remaining = lines[:k], lines[k:]
                head.append((",".join(names) + "\n").encode())
            break
        else:
            head, remaining = lines, []
        if again:
            head = []
        return head, remaining

    def _recognised(self, row: int, names: list[str]) -> None:
        if "position" in names:
            raise InputError(f"{self.path}: holds averaged positions; the time series of the table is needed")
        if self.header and names != self.header:
            raise InputError(f"{self.path}: has other columns than the record, which has {','.join(self.header)}")
        self.layout = recognise(self.path, names, row, (*BENCH, RAW))
        self.header = names
        self._place = {name: names.index(name) for name in self.layout.present}

    def _checked(self, lines: list[bytes]) -> tuple[list[bytes], NDArray, list[str]]:
        """Return the kept lines, the numbers of their rows, and the reasons for leaving others out."""
        texts: list[str] = []
        rows: list[int] = []
        remarks: set[int] = set()
        without_headers: list[bytes] = []
        for line in lines:
            text = line.decode("utf-8", "replace").rstrip("\r\n")
            # a repeated header, as after a restart, is neither a row nor a remark
            if text.partition(",")[0].strip() == self.header[0]:
                continue
            if text.strip() and not text.startswith("#"):
                rows.append(len(texts))
            else:
                remarks.add(len(texts))
            texts.append(text)
            without_headers.append(line)
        rows, fields, refused = self._fields(texts, rows)
        numbers = dict.fromkeys(self._place, np.zeros(0))
        if fields:
            numbers = fields[1]
        good, faulty_numbers = self._good(numbers)
        refused += faulty_numbers
        if fields and self.rows < PART:
            for name in FORCE:
                for text in fields[0][name]:
                    self._digits = max(self._digits, significant_digits(text))
        chosen = {rows[k] for k in np.flatnonzero(good).tolist()}
        written: list[bytes] = []
        line_numbers: list[float] = []
        for k, line in enumerate(without_headers):
            if k in remarks and self._before is None:
                written.append(line)
            elif k in chosen:
                written.append(line)
                line_numbers.append(self.count + len(written))
        self._counted(written)
        force = np.column_stack([numbers[name][good] for name in FORCE])
        self.rows += len(force)
        self._largest = max(self._largest, float(np.abs(force).max(initial=0.0)))
        if len(force):
            self._before, self.last_s = None, float(numbers["time_s"][good][-1])
        angles = np.radians(np.column_stack([numbers[name][good] for name in ANGLES]))
        warmth = np.full(len(force), np.nan)
        if TEMPERATURE in numbers:
            warmth = numbers[TEMPERATURE][good]
        at = np.array(line_numbers, dtype=float)
        return written, np.column_stack([numbers["time_s"][good], angles, force, at, warmth]), refused

    def _fields(self, texts: list[str], rows: list[int]) -> tuple[list[int], Any, list[str]]:
        """Return the rows with readable fields, these fields (None without rows), and the reasons for leaving others
        out."""
        width = len(self.header)
        fields = None
        refused: list[str] = []
        if rows:
            fields = taken_of([texts[k] for k in rows], width, self._place)
        if not rows or fields is not None:
            return rows, fields, refused
        readable = []
        for k in rows:
            fault = next(iter(faults_of_line(self.path, 0, texts[k], width, self._place)), None)
            if fault is None:
                readable.append(k)
            else:
                refused.append(_without_row(fault))
        if readable:
            fields = taken_of([texts[k] for k in readable], width, self._place)
        return readable, fields, refused

    def _counted(self, lines: list[bytes]) -> list[bytes]:
        self.count += len(lines)
        return lines

    def _good(self, numbers: dict[str, NDArray]) -> tuple[NDArray, list[str]]:
        """Return a mask of the rows that fit a record with increasing times, and the faults of the others."""
        time = numbers["time_s"]
        good = np.ones(len(time), dtype=bool)
        if not len(time):
            return good, []
        assert self.layout is not None
        columns = FileColumns(self.path, self.layout, numbers, {}, np.arange(len(time)), 0.0)
        refused = []
        for fault in faults(columns):
            # times are checked below, together with earlier rows; a wrong unit is reported for a rest
            if fault.row is not None and fault.column != "time_s" and good[fault.row]:
                good[fault.row] = False
                refused.append(_without_row(fault))
        for k in np.flatnonzero(good).tolist():
            before, now = self.last_s, float(time[k])
            if self._before is not None and now <= self._before:
                good[k] = False
            elif now - before < SHORTEST or (np.isfinite(before) and now - before > LONGEST_GAP_S):
                good[k] = False
                refused.append(f"time_s: {now:.12g} after {before:.12g}; it must grow from row to row")
            else:
                self.last_s = now
        return good, refused


def _is_number(text: str) -> bool:
    try:
        return np.isfinite(float(text))
    except ValueError:
        return False


def _without_row(fault: RecordError) -> str:
    if fault.column is None:
        return fault.what
    return f"column {fault.column}: {fault.what}"


def by_count(rows: NDArray, before: int, at: Sequence[int]) -> list[NDArray]:
    """Cut rows at these total counts; `before` rows came earlier."""
    cuts = []
    for number in at:
        if before < number < before + len(rows):
            cuts.append(number - before)
    return np.split(rows, cuts)


MOST_BYTES = 1 << 20
"""Largest number of bytes that are taken at once."""
WAITING = 64
"""Largest number of waiting pieces of standard input; then its writer waits."""


class ByteSource(Protocol):
    """A stream of bytes."""

    name: str
    trouble: str
    """reason for the silence, if it is known; empty otherwise"""

    def read(self) -> bytes | None:
        """Return new bytes, empty if there are none; None after the end."""
        ...

    def close(self) -> None:
        """Release the source."""
        ...


class GrowingFile:
    """A file to which another program appends; it may not exist yet."""

    def __init__(self, path: Path) -> None:
        self.path, self.name, self.trouble = path, str(path), ""
        self._file: BinaryIO | None = None

    def read(self) -> bytes | None:
        try:
            if self._file is None:
                if not self.path.exists():
                    self.trouble = f"{self.path}: no such file yet"
                    return b""
                if not self.path.is_file():
                    raise InputError(f"{self.path}: is not a regular file; give the file that grows")
                self._file, self.trouble = self.path.open("rb"), ""
                note_read(self.path, os.fstat(self._file.fileno()))
            if os.fstat(self._file.fileno()).st_size < self._file.tell():
                raise InputError(f"{self.path}: has become shorter; a file that only grows is needed")
            return self._file.read(MOST_BYTES)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({reason(error)})") from error

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


class Stream:
    """Standard input, or a pipe, read in a thread: its writer never waits for long."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self.name, self.trouble = name, ""
        self._file = file
        self._pieces: queue.Queue[bytes | None] = queue.Queue(WAITING)
        self._ended = False
        threading.Thread(target=self._listen, args=(file.fileno(),), daemon=True).start()

    def _listen(self, number: int) -> None:
        while True:
            try:
                piece = os.read(number, 1 << 16)
            except OSError:
                piece = b""
            self._pieces.put(piece or None)
            if not piece:
                return

    def read(self) -> bytes | None:
        pieces: list[bytes] = []
        while not self._ended and len(pieces) < WAITING:
            try:
                piece = self._pieces.get_nowait()
            except queue.Empty:
                break
            if piece is None:
                self._ended = True
            else:
                pieces.append(piece)
        if self._ended and not pieces:
            return None
        return b"".join(pieces)

    def close(self) -> None:
        """Leave standard input open: it belongs to the process, and waiting pieces end with it."""
        if self._ended and self._file is not getattr(sys.stdin, "buffer", None):
            self._file.close()


def source_of(name: str) -> ByteSource:
    """Return the source that `--from` names: - is standard input, all else a growing file or a named pipe."""
    if name == "-":
        return Stream(sys.stdin.buffer, "standard input")
    path = Path(name)
    try:
        mode = path.stat().st_mode
    except OSError:
        if not path.absolute().parent.is_dir():
            raise InputError(f"--from {name}: there is no folder {path.parent}") from None
        return GrowingFile(path)
    if stat.S_ISCHR(mode):
        advice = "is a device; pipe what it sends into `trihedron measure ... --from -`, or let a logger write a file"
        raise InputError(f"--from {name}: {advice}")
    if stat.S_ISFIFO(mode):
        return Stream(path.open("rb", buffering=0), name)
    return GrowingFile(path)
