"""Where readings come from: a file that grows, standard input or a named pipe."""

import os
import queue
import stat
import sys
import threading
from pathlib import Path
from typing import BinaryIO, Protocol

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
        """Standard input is the process's, and what still waits for its writer ends with it."""
        if self._ended and self._file is not getattr(sys.stdin, "buffer", None):
            self._file.close()


def source_of(name: str) -> Source:
    """The source that `--from` names: - is standard input, all else a growing file or a named pipe."""
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
