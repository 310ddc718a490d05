"""The state of the page about records: files, decisions, the answer before and after, and the running calculation."""

import re
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import records
from ..errors import InputError, one_line
from ..files import write_text
from ..workers import OneProcess
from . import answers
from .lines import SeriesChannels, channels_of_file, lines_of

WAIT_S = 600.0
"""So long a look at a record may take."""
READING = "is being read"
WRONG_ROW = r" row (?!1:)\d+"
"""Names damage; a wrong header, row 1, is that of another kind of file."""
COMMANDS = tuple(answers.FUNCTIONS)


@dataclass
class OpenFile:
    """A file on the page.

    Attributes
    ----------
    path : Path
    about : mapping or None
        its contents by `answers.described`; None of a file that is not a record
    problem : str
        why it is not a record; empty of one
    decisions : mapping
        plain values of the decisions about it
    earlier : list of mapping
        decisions before each change, the last one last
    preview : Channels or None
        channels of a series, unchecked, for its pictures
    given : mapping of str to str
        answers to the questions of its import
    imported : mapping or None
        how it is understood, as `answers.understood` has it; None of a record, and of what cannot be imported
    outcome : mapping or None
        command, verdict and figures of the last answer about it, and whether that was with other files
    looked_at : Event
        is set when it has been read
    looking : Lock
        is held by the one who reads it
    """

    path: Path
    about: Mapping[str, Any] | None = None
    problem: str = ""
    decisions: Mapping[str, Any] = field(default_factory=dict)
    earlier: list[Mapping[str, Any]] = field(default_factory=list)
    preview: SeriesChannels | None = None
    given: Mapping[str, str] = field(default_factory=dict)
    imported: Mapping[str, Any] | None = None
    outcome: Mapping[str, Any] | None = None
    looked_at: threading.Event = field(default_factory=threading.Event)
    looking: threading.Lock = field(default_factory=threading.Lock)

    @property
    def of_content(self) -> dict[str, Any]:
        """Return the decisions with the digest of the content that they are about."""
        return {**self.decisions, "record_sha256": "" if self.about is None else self.about["sha256"]}


@dataclass(frozen=True)
class DeskRequest:
    """A calculation that is asked for: a command about some of the files, with options as texts."""

    command: str
    files: tuple[int, ...]
    options: Mapping[str, Any]


class Desk:
    """Files on a page, and a process that looks at them beside one that calculates.

    Parameters
    ----------
    paths : sequence of Path
        the files that are open at the beginning
    advise : function, optional
        gives the command that follows a result
    """

    def __init__(self, paths: Sequence[Path] = (), advise: answers.Advise | None = None) -> None:
        self._advise = advise
        self._lock = threading.RLock()
        self._looking, self._calculating = OneProcess(), OneProcess()
        self.files: list[OpenFile] = []
        self.answer: Mapping[str, Any] | None = None
        self.before: Mapping[str, Any] | None = None
        self.refusal = ""
        self.outdated = False
        self.number = self.answered = 0
        self._request: DeskRequest | None = None
        self._began = 0.0
        self._running: Future[Any] | None = None
        for path in paths:
            self.open(path)

    def open(self, path: Path) -> int:
        """Open a file; return its number. A file that is open already keeps its number."""
        path = path.absolute()
        for number, file in enumerate(self.files):
            if file.path == path:
                return number
        file = OpenFile(path, problem=READING)
        with self._lock:
            self.files.append(file)
            number = len(self.files) - 1
            self.number += 1
        self._look_at(file)
        return number

    def renew(self, path: Path) -> None:
        """Open a file; look again at one that is open and has been written anew, and calculate its result again."""
        opened = len(self.files)
        number = self.open(path)
        if number < opened:
            self._look_at(self.files[number], then=self.again)

    def _look_at(self, file: OpenFile, then: Callable[[], None] | None = None) -> None:
        threading.Thread(target=self._looked, args=(file, then), daemon=True).start()

    def _looked(self, file: OpenFile, then: Callable[[], None] | None) -> None:
        with file.looking:
            self._describe(file)
        if then is not None:
            with suppress(InputError):
                then()

    def _describe(self, file: OpenFile) -> None:
        """Look at a file: its channels for a first picture, its contents, and the decisions in the file beside it."""
        file.preview = channels_of_file(file.path)
        self.number += 1
        try:
            about = self.look(answers.described, str(file.path))
        except (InputError, OSError) as error:
            problem = one_line(str(error))
            try:
                file.imported, why = self.look(answers.understood, str(file.path), {}), "an import is needed"
            except (InputError, OSError) as reason:
                why = one_line(str(reason))
            # The import reads more kinds of files; of a record with a wrong row the reader of records knows more.
            file.problem = problem if re.search(WRONG_ROW, problem) else why
        else:
            file.decisions, file.about, file.problem = about["decisions"], about, ""
        self.number += 1
        file.looked_at.set()

    def wait_for(self, number: int, seconds: float) -> None:
        """Wait until a file has been read.

        Raises
        ------
        InputError
            for a file that is not a record and that no answer makes one
        """
        file = self.files[number]
        is_read = file.looked_at.wait(seconds)
        if is_read and file.about is None and file.imported is None and "--set " not in file.problem:
            raise InputError(file.problem)

    def import_with(self, number: int, given: Mapping[str, str], *, write: bool) -> dict[str, Any]:
        """Take answers about a file that is not a record; with `write` make the record beside it, and open it.

        Raises
        ------
        InputError
            for an answer that is none
        """
        if not 0 <= number < len(self.files) or self.files[number].about is not None:
            raise InputError("first choose a file that needs an import")
        file = self.files[number]
        out = answers.free_name(file.path.with_name(f"{file.path.stem}.record.csv")) if write else ""
        view = self.look(answers.understood, str(file.path), dict(given), str(out))
        with self._lock:
            file.given, file.imported = dict(given), view
            self.number += 1
        if write and not view["questions"]:
            return {"file": self.open(Path(out))}
        return {}

    def look(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the value of a function of `answers` for a record, beside a running calculation."""
        return _value(self._looking, function, *arguments)

    def lines(self, number: int, begin: float | None, end: float | None, points: int) -> dict[str, Any]:
        """Return the lines of a series between two times [s]; errors as `_record`."""
        preview = self.files[number].preview if 0 <= number < len(self.files) else None
        if preview is not None:
            return lines_of(preview, begin, end, points)
        return self.look(answers.lines, str(self._record(number).path), begin, end, points)

    def state(self, known: int = -1) -> dict[str, Any]:
        """Return all that the page shows, as plain values; only what runs where it knows the last change."""
        with self._lock:
            running = None
            if self._running is not None and self._request is not None:
                names = [self.files[number].path.name for number in self._request.files]
                running = {
                    "command": f"trihedron {self._request.command} {' '.join(names)}",
                    "seconds": round(time.monotonic() - self._began),
                }
            if known == self.number:
                return {"number": self.number, "running": running}
            files = []
            for file in self.files:
                files.append(
                    {
                        "name": file.path.name,
                        "about": file.about,
                        "problem": file.problem,
                        "decisions": file.decisions,
                        "preview": file.preview is not None,
                        "imported": file.imported,
                        "outcome": file.outcome,
                        "given": file.given,
                        "undo": bool(file.earlier),
                        "decisions_file": records.decisions_file(file.path).name,
                    }
                )
            return {
                "number": self.number,
                "answered": self.answered,
                "files": files,
                "running": running,
                "answer": self.answer,
                "before": self.before,
                "outdated": self.outdated and self.answer is not None,
                "refusal": self.refusal,
            }

    def run(self, request: DeskRequest) -> None:
        """Begin a calculation in place of one that is running.

        Raises
        ------
        InputError
            for an unknown command or file
        """
        if request.command not in COMMANDS:
            raise InputError(f"{request.command}: is not a command of the page; use {', '.join(COMMANDS)}")
        if not request.files or not all(0 <= number < len(self.files) for number in request.files):
            raise InputError("choose a file first")
        chosen = [self.files[number] for number in request.files]
        for file in chosen:
            if file.about is None:
                raise InputError(f"{file.path.name}: is not a record: {file.problem}")
        paths = [str(file.path) for file in chosen]
        asked = answers.FilesCommand(request.command, paths, [file.of_content for file in chosen], request.options)
        with self._lock:
            self._stop()
            changed = self._request != request
            self._request, self._began, self.refusal = request, time.monotonic(), ""
            future = self._calculating.call(answers.outcome, answers.answer, asked, self._advise)
            self._running = future
            self.number += 1
        future.add_done_callback(lambda done: self._ended(done, request, same_request=not changed))

    def _ended(self, future: Future[Any], request: DeskRequest, *, same_request: bool) -> None:
        """Take the answer of a calculation that is still the wanted one, with the numbers of its files."""
        with self._lock:
            if future is not self._running:
                return
            self._running = None
            self.number += 1
            self.answered += 1
            if future.exception() is not None:
                self.refusal = "the process of the calculation ended; there may be too little memory"
                return
            answer, self.refusal = future.result()
            if not self.refusal:
                self.before = self.answer if same_request else None
                self.answer = {**answer, "files": request.files}
                outcome = {"command": request.command, "together": len(request.files) > 1}
                for number in request.files:
                    self.files[number].outcome = {**outcome, "verdict": answer["verdict"], "key": answer["key"]}
                self.outdated = False

    def stop(self) -> None:
        """Stop the calculation that is running, if any."""
        with self._lock:
            self._stop()

    def _stop(self) -> None:
        if self._running is not None:
            self._running = None
            self._calculating.stop()
            self.number += 1

    def decide(self, number: int, values: Mapping[str, Any]) -> None:
        """Take decisions about a file in place of the earlier ones, write them beside it, and calculate again.

        Raises
        ------
        InputError
            for decisions that are none, or that do not go with the record; the earlier ones stay
        """
        file = self._record(number)
        assert file.about is not None
        made = records.decisions_of(values, "decisions")
        self.look(answers.decided_size, str(file.path), {**values, "record_sha256": file.about["sha256"]})
        with self._lock:
            file.earlier.append(file.decisions)
            self._keep(file, made, values)
        self.again()

    def undo(self, number: int) -> None:
        """Take back the last decisions about a file, and calculate again."""
        file = self._record(number)
        with self._lock:
            if not file.earlier:
                return
            values = file.earlier.pop()
            self._keep(file, records.decisions_of(values, "decisions"), values)
        self.again()

    def _keep(self, file: OpenFile, made: records.Decisions, values: Mapping[str, Any]) -> None:
        """Write decisions beside the record; without any the file is taken away."""
        assert file.about is not None
        beside = records.decisions_file(file.path)
        if made:
            write_text(beside, records.decisions_text(made, file.path, file.about["sha256"]))
        else:
            beside.unlink(missing_ok=True)
        file.decisions, file.outcome = values, None
        self.outdated = True
        self.number += 1

    def again(self) -> None:
        """Calculate the last request again, if there was one."""
        if self._request is not None:
            self.run(self._request)

    def _record(self, number: int) -> OpenFile:
        """Return an open file that holds a record; raise an InputError of another."""
        if not 0 <= number < len(self.files) or self.files[number].about is None:
            raise InputError("choose a record first")
        return self.files[number]

    def page(self, explanation: int | None = None) -> str:
        """Return the page of the last result, or of one of its explanations, as HTML."""
        if self.answer is None:
            raise InputError("calculate something first")
        if explanation is None:
            return _value(self._calculating, answers.page)
        return _value(self._calculating, answers.explanation, explanation)

    def save(self, what: str) -> dict[str, Any]:
        """Write a file of the last result beside its first record.

        Raises
        ------
        InputError
            without a result, or for an output that it does not have
        """
        if self.answer is None:
            raise InputError("calculate something first")
        return _value(self._calculating, answers.saved, what)

    def close(self) -> None:
        """End both processes."""
        self._looking.stop()
        self._calculating.stop()


def _value(process: OneProcess, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the answer of a process to a call.

    Raises
    ------
    InputError
        with the line of a refusal, or where the process ended
    """
    try:
        value, refusal = process.call(answers.outcome, function, *arguments).result(WAIT_S)
    except (RuntimeError, CancelledError, TimeoutError) as error:
        raise InputError("the process that looks at the records ended") from error
    if refusal:
        raise InputError(refusal)
    return value
