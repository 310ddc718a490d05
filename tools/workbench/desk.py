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


@dataclass
class DeskAnswer:
    """The answer of a command about some files.

    Attributes
    ----------
    request : DeskRequest
        the last one of this command about these files
    answer, before : mapping or None
        content by `answers.answer`, and that before the last change of the same request
    ended : bool
        whether it was answered or refused once; a calculation that was stopped begins by no change
    outdated : bool
        whether decisions or files changed afterwards
    """

    request: DeskRequest
    answer: Mapping[str, Any] | None = None
    before: Mapping[str, Any] | None = None
    ended: bool = False
    outdated: bool = False


@dataclass
class Worker:
    """A process for one calculation at a time, and what it is about."""

    process: OneProcess = field(default_factory=OneProcess)
    request: DeskRequest | None = None
    began: float = 0.0
    future: Future[Any] | None = None

    def stop(self) -> None:
        """Stop the calculation that is running, if any."""
        if self.future is not None:
            self.future = None
            self.process.stop()


class Desk:
    """Files on a page, a process that looks at them, one that diagnoses, and one for all other calculations.

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
        self._looking = OneProcess()
        self._calculating, self._diagnosing = self._workers = Worker(), Worker()
        self._waiting: list[DeskRequest] = []
        self.files: list[OpenFile] = []
        self.answers: list[DeskAnswer] = []
        self._asked: DeskAnswer | None = None
        self._answered: DeskAnswer | None = None
        self.refusal = ""
        self.number = self.answered = 0
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
        """Open a file; look again at one that is open and has been written anew, and calculate its results again."""
        opened = len(self.files)
        number = self.open(path)
        if number < opened:
            self._look_at(self.files[number], then=lambda: self._changed(number))

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
            running = self._what_runs()
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
            every = []
            for one in self.answers:
                every.append(
                    {
                        "command": one.request.command,
                        "files": one.request.files,
                        "answer": one.answer,
                        "before": one.before,
                        "outdated": one.outdated,
                        "running": one.request in self._running,
                    }
                )
            return {
                "number": self.number,
                "answered": self.answered,
                "files": files,
                "running": running,
                "answers": every,
                "asked": None if self._asked is None else self.answers.index(self._asked),
                "refusal": self.refusal,
            }

    def _what_runs(self) -> dict[str, Any] | None:
        """Return the commands that run and that wait, and the seconds since the first began; None if none runs."""
        if not self._running:
            return None
        begins = [worker.began for worker in self._workers if worker.future is not None]
        return {
            "commands": [self._words(request) for request in self._running],
            "waiting": [self._words(request) for request in self._waiting],
            "seconds": round(time.monotonic() - min(begins)),
        }

    @property
    def _running(self) -> list[DeskRequest]:
        """Return the requests that are being calculated."""
        return [worker.request for worker in self._workers if worker.future is not None and worker.request is not None]

    def _words(self, request: DeskRequest) -> str:
        names = [self.files[number].path.name for number in request.files]
        return f"trihedron {request.command} {' '.join(names)}"

    @property
    def answer(self) -> Mapping[str, Any] | None:
        """The answer to the last request of the person that has one; None before the first one."""
        return None if self._asked is None else self._asked.answer

    def run(self, request: DeskRequest) -> None:
        """Begin a calculation in place of one of its kind that is running.

        Raises
        ------
        InputError
            for an unknown command or file
        """
        if request.command not in COMMANDS:
            raise InputError(f"{request.command}: is not a command of the page; use {', '.join(COMMANDS)}")
        if not request.files or not all(0 <= number < len(self.files) for number in request.files):
            raise InputError("choose a file first")
        for number in request.files:
            self._record(number)
        with self._lock:
            self.refusal = ""
            if self.answer is not None:
                self._answered = self._asked
            self._asked = self._entry(request)
            if self._asked is None:
                self._asked = DeskAnswer(request)
                self.answers.append(self._asked)
            self._worker(request).stop()
            self._begin(request)

    def _entry(self, request: DeskRequest) -> DeskAnswer | None:
        """Return what is known of a command about the same files; None if it was not asked for."""
        about = request.command, request.files
        return next((one for one in self.answers if (one.request.command, one.request.files) == about), None)

    def _worker(self, request: DeskRequest) -> Worker:
        return self._diagnosing if request.command == "diagnose" else self._calculating

    def _begin(self, request: DeskRequest) -> None:
        """Begin a calculation by a worker that is free."""
        entry, worker = self._entry(request), self._worker(request)
        assert entry is not None
        chosen = [self.files[number] for number in request.files]
        paths = [str(file.path) for file in chosen]
        asked = answers.FilesCommand(request.command, paths, [file.of_content for file in chosen], request.options)
        changed = entry.request != request
        self._waiting = [one for one in self._waiting if one != entry.request]
        entry.request = worker.request = request
        worker.began = time.monotonic()
        worker.future = future = worker.process.call(answers.outcome, answers.answer, asked, self._advise)
        self.number += 1
        future.add_done_callback(lambda done: self._ended(done, worker, entry, same_request=not changed))

    def _ended(self, future: Future[Any], worker: Worker, entry: DeskAnswer, *, same_request: bool) -> None:
        """Take the answer of a calculation that is still the wanted one, and begin the next one."""
        with self._lock:
            if future is not worker.future:
                return
            worker.future = None
            self.number += 1
            self.answered += 1
            entry.ended = True
            refusal = "the process of the calculation ended; there may be too little memory"
            if future.exception() is None:
                answer, refusal = future.result()
                if not refusal:
                    self._take(entry, answer, same_request=same_request)
            self.refusal = refusal or self.refusal
            if refusal and entry is self._asked and entry.answer is None:
                self._asked = self._answered or entry
            self._begin_next()

    def _take(self, entry: DeskAnswer, answer: Mapping[str, Any], *, same_request: bool) -> None:
        entry.before = entry.answer if same_request else None
        entry.answer, entry.outdated = answer, False
        command, files = entry.request.command, entry.request.files
        outcome = {"command": command, "together": len(files) > 1, "verdict": answer["verdict"], "key": answer["key"]}
        for number in files:
            self.files[number].outcome = outcome

    def stop(self) -> None:
        """Stop what is running, and what waits for it."""
        with self._lock:
            self._waiting.clear()
            for worker in self._workers:
                worker.stop()
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
        self._changed(number)

    def undo(self, number: int) -> None:
        """Take back the last decisions about a file, and calculate again."""
        file = self._record(number)
        with self._lock:
            if not file.earlier:
                return
            values = file.earlier.pop()
            self._keep(file, records.decisions_of(values, "decisions"), values)
        self._changed(number)

    def _keep(self, file: OpenFile, made: records.Decisions, values: Mapping[str, Any]) -> None:
        """Write decisions beside the record; without any the file is taken away."""
        assert file.about is not None
        beside = records.decisions_file(file.path)
        if made:
            write_text(beside, records.decisions_text(made, file.path, file.about["sha256"]))
        else:
            beside.unlink(missing_ok=True)
        file.decisions, file.outcome = values, None

    def _changed(self, number: int) -> None:
        """Calculate all results about a file again."""
        with self._lock:
            for one in self.answers:
                one.outdated |= one.ended and number in one.request.files
            for request in self._running:
                if number in request.files:
                    self._worker(request).stop()
            self.again()

    def again(self) -> None:
        """Calculate the results that are outdated again, diagnoses behind all others."""
        with self._lock:
            self.refusal = ""
            running = self._running
            outdated = [one.request for one in reversed(self.answers) if one.outdated and one.request not in running]
            self._waiting = sorted(outdated, key=lambda request: request.command == "diagnose")
            self.number += 1
            self._begin_next()

    def _begin_next(self) -> None:
        """Begin what waits, unless its worker or that of the short calculations is busy."""
        if self._waiting and self._calculating.future is None and self._worker(self._waiting[0]).future is None:
            self._begin(self._waiting.pop(0))

    def _record(self, number: int) -> OpenFile:
        """Return an open file that holds a record; raise an InputError of another."""
        if not 0 <= number < len(self.files):
            raise InputError("choose a record first")
        file = self.files[number]
        if file.about is None:
            raise InputError(f"{file.path.name}: is not a record: {file.problem}")
        return file

    def page(self, number: int | None = None, explanation: int | None = None) -> str:
        """Return the page of an answer, or of one of its explanations, as HTML; by default of the last one asked for.

        Raises
        ------
        InputError
            without a result
        """
        return self._of_result(number, answers.page, explanation)

    def save(self, what: str, number: int | None = None) -> dict[str, Any]:
        """Write a file of the result of an answer beside its first record; by default of the last one asked for.

        Raises
        ------
        InputError
            without a result, or for an output that it does not have
        """
        return self._of_result(number, answers.saved, what)

    def _of_result(self, number: int | None, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the value of a function of a result, computed where it was calculated."""
        with self._lock:
            entry = self._asked if number is None else self.answers[number]
            if entry is None or entry.answer is None:
                raise InputError("calculate something first")
            request = entry.request
            paths = [str(self.files[file].path) for file in request.files]
        return _value(self._worker(request).process, function, request.command, paths, *arguments)

    def close(self) -> None:
        """End all processes."""
        self._looking.stop()
        for worker in self._workers:
            worker.process.stop()


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
