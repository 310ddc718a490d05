"""Where readings come from: a file that grows, standard input, a serial port. Asked, each gives what has come since."""

import os
import queue
import stat
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from ..errors import InputError, reason

MOST_BYTES = 1 << 20
"""Taken at once."""
WAITING = 64
"""Pieces of standard input that wait to be taken; then its writer waits."""


class Source(Protocol):
    """Bytes as they come."""

    name: str
    trouble: str
    """why nothing comes, where that is known; empty otherwise"""

    def read(self) -> bytes | None:
        """What has come since, nothing where nothing has; None where no more can come."""
        ...

    def close(self) -> None:
        """Let go of what is read."""
        ...


class GrowingFile:
    """A file to which another program appends; it need not be there yet."""

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
            if os.fstat(self._file.fileno()).st_size < self._file.tell():
                raise InputError(f"{self.path}: has become shorter; a file that only grows is needed")
            return self._file.read(MOST_BYTES)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({reason(error)})") from error

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


class Stream:
    """Standard input, or a pipe, read beside: who writes it is never kept waiting for long."""

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
        found: list[bytes] = []
        while not self._ended and len(found) < WAITING:
            try:
                piece = self._pieces.get_nowait()
            except queue.Empty:
                break
            if piece is None:
                self._ended = True
            else:
                found.append(piece)
        return None if self._ended and not found else b"".join(found)

    def close(self) -> None:
        """Standard input is the process's, and what still waits for its writer ends with it."""
        if self._ended and self._file is not getattr(sys.stdin, "buffer", None):
            self._file.close()


class SerialPort:
    """A serial port, by pyserial; one that is lost is opened again. Its first line is left out: a part, maybe."""

    def __init__(self, name: str, baud: int) -> None:
        try:
            import serial
        except ImportError:
            said = 'a serial port needs pyserial: python -m pip install "trihedron[serial]"'
            raise InputError(f"--from {name}: {said}") from None
        self.name, self.trouble = name, ""
        self._serial: Any = serial
        self._baud, self._whole = baud, False
        self._port: Any = None
        self._open(first=True)

    def _open(self, *, first: bool) -> None:
        try:
            self._port, self._whole = self._serial.Serial(self.name, self._baud, timeout=0), False
            self.trouble = ""
        except (self._serial.SerialException, OSError, ValueError) as error:
            if first:
                raise InputError(f"--from {self.name}: cannot be opened ({error})") from error
            self.trouble = f"{self.name}: is lost ({error}); it is tried again"

    def read(self) -> bytes | None:
        if self._port is None:
            self._open(first=False)
            return b""
        try:
            data = self._port.read(MOST_BYTES)
        except (self._serial.SerialException, OSError) as error:
            self.trouble = f"{self.name}: is lost ({error}); it is tried again"
            self._port.close()
            self._port = None
            return b"\n"
        if not self._whole and data:
            _, newline, data = data.partition(b"\n")
            self._whole = bool(newline)
        return data

    def close(self) -> None:
        if self._port is not None:
            self._port.close()


def source_of(name: str, baud: int) -> Source:
    """The source that `--from` names: - is standard input, a device or COMn a serial port, all else a growing file."""
    if name == "-":
        return Stream(sys.stdin.buffer, "standard input")
    path = Path(name)
    if not 50 <= baud <= 50_000_000:
        raise InputError(f"--baud {baud}: must be from 50 to 50000000")
    if name.upper().startswith("COM") and name[3:].isdigit():
        return SerialPort(name, baud)
    try:
        mode = path.stat().st_mode
    except OSError:
        if str(path).startswith("/dev/"):
            raise InputError(f"--from {name}: no such device") from None
        if not path.absolute().parent.is_dir():
            raise InputError(f"--from {name}: there is no folder {path.parent}") from None
        return GrowingFile(path)
    if stat.S_ISCHR(mode):
        return SerialPort(name, baud)
    if stat.S_ISFIFO(mode):
        return Stream(path.open("rb", buffering=0), name)
    return GrowingFile(path)
