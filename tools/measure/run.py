"""Run a session: read, keep and judge readings; show them in views, which take the operator's words."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Protocol

from ..diagnosis import Diagnosis, diagnose
from ..errors import InputError
from ..files import LARGEST_TEXT, bytes_of, make_folders, refuse_input, said_writable
from ..locks import Taken, locked, refuse_irregular
from ..records import PositionRecord, read_record, write_record
from .programme import TableProgramme
from .readings import ByteSource, RecordLines, by_count
from .session import Ending, Measured, Session, SessionOptions, measured
from .visits import Present, RestVisit, Watch

PAUSE_S = 0.1
"""Pause after a source gave nothing [s]."""
SILENT_S = 5.0
"""Time without readings after which a source is silent [s]."""
PIECE = 1 << 20
"""Number of bytes of the record that are read at once."""


class Files:
    """The files of a session: RECORD.csv, an ordinary raw record, and beside it the operator's words and the positions.

    Every line reaches the system before the next is read, so a kill at any moment loses nothing. When the session is
    resumed, the incomplete last line of a crash is removed.
    """

    def __init__(self, record: Path, header: Mapping[str, Any], *, resume: bool) -> None:
        if record.suffix.lower() != ".csv":
            raise InputError(f"--out {record}: is a record; give a name that ends with .csv")
        self.record = record
        self.words_file, self.positions_file = self.beside("session.jsonl"), self.beside("positions.csv")
        self.words: list[dict[str, Any]] = []
        self._header, self._lock = dict(header), ExitStack()
        self._file: int | None = None
        present = [path for path in (record, self.words_file) if path.exists()]
        if present and not resume:
            raise InputError(f"{present[0]}: is there already; give another name, or --resume to go on with it")
        if present:
            self._take_up()

    def beside(self, ending: str) -> Path:
        """Return the name of another file of the session."""
        return self.record.with_name(f"{self.record.stem}.{ending}")

    def _take_up(self) -> None:
        if not self.words_file.exists():
            raise InputError(f"{self.words_file}: no such file: {self.record} is of no session; give another --out")
        content = bytes_of(self.words_file, most=LARGEST_TEXT)
        lines = content[: content.rfind(b"\n") + 1].decode("utf-8", "replace").splitlines()
        try:
            header, *self.words = map(json.loads, lines)
            if not all(isinstance(word, dict) and isinstance(word["rows"], int) for word in self.words):
                raise ValueError
        except (ValueError, KeyError, RecursionError):
            raise InputError(f"{self.words_file}: is not a file of a session; give another --out") from None
        for name, value in self._header.items():
            if not isinstance(header, dict) or header.get(name) != value:
                option = name
                if name == "settings":
                    option = "plan"
                raise InputError(f"{self.words_file}: was begun with another {option}; give that, or another --out")
        self._begin(cut=True)

    def _begin(self, *, cut: bool) -> None:
        """Open the record and write the session's header; with `cut`, remove lines without an end."""
        for path in (self.record, self.positions_file):
            refuse_input(path)
        for path in (self.record, self.words_file):
            refuse_irregular(path)
        with said_writable(self.record):
            make_folders(self.record.parent)
            if not cut:
                try:
                    self._write(self.words_file, self._header)
                except BaseException:
                    self.words_file.unlink(missing_ok=True)
                    raise
            try:
                self._lock.enter_context(locked(self.words_file))
            except Taken:
                raise InputError(f"{self.record}: another process measures into it") from None
            for path in (self.words_file, self.record):
                if cut and path.exists():
                    _without_open_line(path)
            self._file = os.open(
                self.record, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666
            )

    def replayed(self) -> Iterator[bytes]:
        """Yield the content of the record, piece by piece."""
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
        """Write a word of the operator, with the number of rows before it."""
        if self._file is None:
            self._begin(cut=False)
        self._write(self.words_file, {"rows": rows, **word})

    def _write(self, path: Path, content: Mapping[str, Any]) -> None:
        with said_writable(path), path.open("ab") as file:
            file.write(json.dumps(content, allow_nan=False).encode() + b"\n")

    def positions(self, record: PositionRecord | None) -> None:
        """Write the positions so far, and flush written data to the disk."""
        if self._file is not None:
            with said_writable(self.record):
                os.fsync(self._file)
        if record is None:
            self.positions_file.unlink(missing_ok=True)
        else:
            about = dict(record.about)
            if record.resolution:
                about["resolution_mps2"] = repr(record.resolution)
            write_record(replace(record, about=about), self.positions_file)

    def close(self) -> None:
        """Close the files."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        self._lock.close()


def _without_open_line(path: Path) -> None:
    """Cut off the text after the last end of a line."""
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


@dataclass(frozen=True)
class Moment:
    """Everything that a view may show.

    Attributes
    ----------
    session : Session
        the session
    present : Present
        state of the table
    source : str
        name of the source
    silent_s : float
        time without readings [s]; 0 below `SILENT_S`
    trouble : str
        reason for the silence, or fault of the readings
    rows, left_out : int
        readings kept, lines that are not rows
    news : tuple of (str, object)
        events since the previous moment: "visit", "word", "refused", "resumed"
    ended : bool
        True after the end
    """

    session: Session
    present: Present
    source: str
    silent_s: float = 0.0
    trouble: str = ""
    rows: int = 0
    left_out: int = 0
    news: tuple[tuple[str, Any], ...] = ()
    ended: bool = False


class View(Protocol):
    """A view shows moments and takes the operator's words."""

    def show(self, moment: Moment) -> None:
        """Show the present moment."""
        ...

    def words(self) -> Sequence[Mapping[str, Any]]:
        """Return the operator's words since the last call: "repeat" with its "visit", or "end"."""
        ...


@dataclass
class Measurement:
    """A session with its files, updated by each incoming piece.

    Attributes
    ----------
    session : Session
        the session so far
    files : Files
        its files
    lines : Lines
        lines of the source
    watch : Watch
        rests of the table
    left_out : int
        lines that are not rows
    news : list
        as in `Moment`
    """

    session: Session
    files: Files
    lines: RecordLines
    watch: Watch
    left_out: int = 0
    trouble: str = ""
    news: list[tuple[str, Any]] = field(default_factory=list)

    @staticmethod
    def begun(
        programme: TableProgramme, asked: SessionOptions, out: Path, source: str, *, resume: bool
    ) -> "Measurement":
        """Begin a session, or resume one from its files; `source` names the readings in refusals."""
        session = Session(programme, asked, out)
        files = Files(out, session.header(), resume=resume)
        watch = Watch(asked.noise_bound, asked.gravity, asked.dwell_s, out)
        measurement = Measurement(session, files, RecordLines(Path(source)), watch)
        measurement._replay()
        return measurement

    def _replay(self) -> None:
        """Replay the files: rows, and the words between them."""
        words, rows = list(self.files.words), 0
        for piece in self.files.replayed():
            taken_in = self.lines.feed(piece)
            for part in by_count(taken_in.rows, rows, [word["rows"] for word in words]):
                self._visited(self.watch.take(part, self.lines.resolution))
                rows += len(part)
                while words and words[0]["rows"] <= rows:
                    self._again(words.pop(0))
        for word in words:
            self._again(word)
        if self.lines.header:
            self.lines.from_the_beginning()
            self.news = [("resumed", len(self.session.good))]
            self.files.positions(self.session.record())

    def _again(self, word: Mapping[str, Any]) -> None:
        """Apply a recorded word."""
        try:
            self.session = self.session.told(word)
        except (InputError, LookupError, TypeError, ValueError):
            raise InputError(f"{self.files.words_file}: {dict(word)}: cannot be followed; give another --out") from None

    def feed(self, data: bytes, *, ended: bool = False) -> None:
        """Take data from the source: keep it first, then judge it."""
        taken_in = self.lines.feed(data, ended=ended)
        if taken_in.kept:
            self.files.append(taken_in.kept)
        if taken_in.left_out:
            self.left_out += len(taken_in.left_out)
            self.trouble = f"{self.left_out} lines were left out, the last: {taken_in.left_out[-1]}"
            self.news.append(("refused", taken_in.left_out[-1]))
        visits = self.watch.take(taken_in.rows, self.lines.resolution)
        if ended:
            visits += self.watch.end()
        self._visited(visits)
        if visits or ended:
            self.files.positions(self.session.record())

    def end(self) -> None:
        """Count the present rest."""
        self._visited(self.watch.end())
        self.files.positions(self.session.record())

    def _visited(self, visits: Sequence[RestVisit]) -> None:
        for visit in visits:
            self.session = self.session.after(visit)
            self.news.append(("visit", visit))

    def hear(self, word: Mapping[str, Any]) -> bool:
        """Apply a word of the operator and record it; return True if it ends the session."""
        if word.get("word") == "end":
            return True
        try:
            self.session = self.session.told(word)
        except (InputError, LookupError, TypeError, ValueError):
            self.news.append(("refused", f"{dict(word)}: cannot be followed"))
            return False
        self.news.append(("word", word))
        self.files.tell(word, self.lines.rows)
        self.files.positions(self.session.record())
        return False

    def moment(self, source: ByteSource, silent_s: float, *, ended: bool = False) -> Moment:
        """Return the present moment for views; news are given once."""
        news, self.news = tuple(self.news), []
        if silent_s < SILENT_S:
            silent_s = 0.0
        return Moment(
            session=self.session,
            present=self.watch.present(),
            source=source.name,
            silent_s=silent_s,
            trouble=source.trouble or self.trouble,
            rows=self.lines.rows,
            left_out=self.left_out,
            news=news,
            ended=ended,
        )

    def diagnosed(self) -> Diagnosis | None:
        """Diagnose the positions and write the page beside the record; None if a target is undetermined."""
        if self.session.worst is None:
            return None
        options, programme = self.session.asked, self.session.programme
        record = read_record(self.files.positions_file, PositionRecord, channels=options.channels)
        diagnosis = diagnose(
            record,
            noise_bound=options.noise_bound,
            gravity=options.gravity,
            baseline=programme.baseline,
            bounds=programme.bounds,
            mounting=dict(programme.mounting),
        )
        diagnosis.report(self.files.beside("diagnosis.html"), record)
        return diagnosis


def carry_out(measurement: Measurement, source: ByteSource, views: Sequence[View]) -> Measured:
    """Measure until the source ends, the operator ends it, or the patience runs out without readings.

    Afterwards all positions are diagnosed, and the page is written beside the record. Raises InputError for a source
    without readings, and for files that cannot be written; earlier readings are kept.
    """
    with closing(measurement.files), closing(source):
        ending = _measure(measurement, source, views)
        if not measurement.lines.rows:
            trouble = source.trouble.removesuffix(" yet")
            raise InputError(trouble or f"{source.name}: gave no readings; is it a raw record?")
        if ending != "source":
            measurement.end()
            _show(measurement.moment(source, 0.0, ended=True), views)
        diagnosis, trouble = None, measurement.session.standing.trouble
        try:
            diagnosis = measurement.diagnosed()
        except InputError as error:
            trouble = trouble or str(error)
        positions_file = None
        if measurement.files.positions_file.exists():
            positions_file = str(measurement.files.positions_file)
        return measured(
            measurement.session,
            diagnosis,
            rows=measurement.lines.rows,
            left_out=measurement.left_out,
            ended=ending,
            positions_file=positions_file,
            trouble=trouble,
        )


def _measure(measurement: Measurement, source: ByteSource, views: Sequence[View]) -> Ending:
    """Feed incoming data and show each moment; return the reason for the end."""
    last, patience_s = monotonic(), measurement.session.asked.patience_s
    ending: Ending | None = None
    while ending is None:
        content = source.read()
        if content is None:
            measurement.feed(b"", ended=True)
            ending = "source"
        elif content:
            measurement.feed(content)
            last = monotonic()
        silent_s = monotonic() - last
        for view in views:
            for word in view.words():
                if measurement.hear(word):
                    ending = "operator"
        if ending is None and patience_s is not None and not content and silent_s >= patience_s:
            ending = "patience"
        _show(measurement.moment(source, silent_s, ended=ending is not None), views)
        if not content and ending is None:
            sleep(PAUSE_S)
    return ending


def _show(moment: Moment, views: Sequence[View]) -> None:
    for view in views:
        view.show(moment)
