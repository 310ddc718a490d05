"""What a session writes as it comes: the record, the operator's words, the positions; and how it is taken up again."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import LARGEST_TEXT, bytes_of, make_folders, said_writable
from ..locks import Taken, locked
from ..records import PositionRecord, write_record

PIECE = 1 << 20


class Kept:
    """The files of a session: RECORD.csv, which is an ordinary raw record, and beside it what goes with it.

    Every line is with the system before the next is read: killed at any moment nothing of it is lost. What a crash cut
    off within a line is taken away when it is taken up again.
    """

    def __init__(self, record: Path, header: Mapping[str, Any], *, resume: bool) -> None:
        if record.suffix.lower() != ".csv":
            raise InputError(f"--out {record}: is a record; give a name that ends with .csv")
        self.record = record
        self.words_file, self.positions_file = self.beside("session.jsonl"), self.beside("positions.csv")
        self.words: list[dict[str, Any]] = []
        self._header, self._held = dict(header), ExitStack()
        self._file: int | None = None
        there = [path for path in (record, self.words_file) if path.exists()]
        if there and not resume:
            raise InputError(f"{there[0]}: is there already; give another name, or --resume to go on with it")
        if there:
            self._take_up()

    def beside(self, ending: str) -> Path:
        """The name of another file of the session."""
        return self.record.with_name(f"{self.record.stem}.{ending}")

    def _take_up(self) -> None:
        if not self.words_file.exists():
            raise InputError(f"{self.words_file}: no such file: {self.record} is of no session; give another --out")
        data = bytes_of(self.words_file, most=LARGEST_TEXT)
        lines = data[: data.rfind(b"\n") + 1].decode("utf-8", "replace").splitlines()
        try:
            header, *self.words = map(json.loads, lines)
            if not all(isinstance(word, dict) and isinstance(word["rows"], int) for word in self.words):
                raise ValueError
        except (ValueError, KeyError, RecursionError):
            raise InputError(f"{self.words_file}: is no file of a session; give another --out") from None
        for name, value in self._header.items():
            if not isinstance(header, dict) or header.get(name) != value:
                said = "plan" if name == "settings" else name
                raise InputError(f"{self.words_file}: was begun with another {said}; give that, or another --out")
        self._begin(cut=True)

    def _begin(self, *, cut: bool) -> None:
        """Open the record, and write down what the session is of; with `cut` take away lines without an end."""
        with said_writable(self.record):
            make_folders(self.record.parent)
            if not cut:
                try:
                    self._write(self.words_file, self._header)
                except BaseException:
                    self.words_file.unlink(missing_ok=True)
                    raise
            try:
                self._held.enter_context(locked(self.words_file))
            except Taken:
                raise InputError(f"{self.record}: another process measures into it") from None
            for path in (self.words_file, self.record) if cut else ():
                if path.exists():
                    _without_open_line(path)
            self._file = os.open(
                self.record, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666
            )

    def replayed(self) -> Iterator[bytes]:
        """What the record holds, piece by piece."""
        if self._file is not None:
            with said_writable(self.record), self.record.open("rb") as file:
                while piece := file.read(PIECE):
                    yield piece

    def append(self, lines: bytes) -> None:
        """Write whole lines to the record."""
        if self._file is None:
            self._begin(cut=False)
        assert self._file is not None
        with said_writable(self.record):
            while lines:
                lines = lines[os.write(self._file, lines) :]

    def tell(self, word: Mapping[str, Any], rows: int) -> None:
        """Write down a word of the operator's, and after how many rows it came."""
        if self._file is None:
            self._begin(cut=False)
        self._write(self.words_file, {"rows": rows, **word})

    def _write(self, path: Path, content: Mapping[str, Any]) -> None:
        with said_writable(path), path.open("ab") as file:
            file.write(json.dumps(content, allow_nan=False).encode() + b"\n")

    def positions(self, record: PositionRecord | None) -> None:
        """Write the positions so far, and let what was written reach the disk."""
        if self._file is not None:
            with said_writable(self.record):
                os.fsync(self._file)
        if record is None:
            self.positions_file.unlink(missing_ok=True)
        else:
            about = dict(record.about) | ({"resolution_mps2": repr(record.resolution)} if record.resolution else {})
            write_record(replace(record, about=about), self.positions_file)

    def close(self) -> None:
        """Let go of the files."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        self._held.close()


def _without_open_line(path: Path) -> None:
    """Cut off what follows the last end of a line."""
    with path.open("r+b") as file:
        end = file.seek(0, os.SEEK_END)
        while end:
            start = max(end - PIECE, 0)
            file.seek(start)
            at = file.read(end - start).rfind(b"\n")
            if at >= 0:
                file.truncate(start + at + 1)
                return
            end = start
        file.truncate(0)
