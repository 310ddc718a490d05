"""A session carried out: readings taken, kept and judged, views shown what is, the operator's words heard."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Literal, Protocol

from ..errors import InputError
from .background import Diagnosing
from .kept import Kept
from .programme import Programme
from .readings import Lines, Taken, by_count
from .result import Measured, measured
from .session import Asked, Proposal, Session, proposals_of, taken, told
from .source import Source
from .visits import Present, Visit, Watch

PAUSE_S = 0.1
"""Between two looks at a source from which nothing came."""
SILENT_S = 5.0
"""A source that has been silent for so long is said to be."""


@dataclass(frozen=True)
class Moment:
    """All that a view may show.

    Attributes
    ----------
    session : Session
    present : Present
    proposals : tuple of Proposal
        what the operator may say yes to, by their places in the list
    diagnosing : Diagnosing
    source : str
        what readings come from
    silent_s : float
        time since something came; 0 below `SILENT_S`
    trouble : str
        why nothing comes, or what is wrong with what came
    rows, left_out : int
        readings kept, lines that could be none
    news : tuple of (str, object)
        what has happened since the moment before: "visit", "word", "diagnosis", "refused", "resumed"
    ended : bool
    """

    session: Session
    present: Present
    proposals: tuple[Proposal, ...]
    diagnosing: Diagnosing
    source: str
    silent_s: float = 0.0
    trouble: str = ""
    rows: int = 0
    left_out: int = 0
    news: tuple[tuple[str, Any], ...] = ()
    ended: bool = False


class View(Protocol):
    """Shows moments, and hears the operator."""

    def show(self, moment: Moment) -> None:
        """Show what is now."""
        ...

    def words(self) -> Sequence[Mapping[str, Any]]:
        """What the operator has said since: "yes" with the word of the "proposal", "repeat" with its "visit", "end"."""
        ...


@dataclass
class Measurement:
    """A session with its files: what comes in changes it, step by step.

    Attributes
    ----------
    session : Session
    kept : Kept
    lines : Lines
    watch : Watch
    diagnosing : Diagnosing
    left_out : int
        lines that could be no rows
    news : list
        as of `Moment`
    """

    session: Session
    kept: Kept
    lines: Lines
    watch: Watch
    diagnosing: Diagnosing
    left_out: int = 0
    trouble: str = ""
    news: list[tuple[str, Any]] = field(default_factory=list)

    @staticmethod
    def begun(programme: Programme, asked: Asked, out: Path, source: str, *, resume: bool) -> "Measurement":
        """A new one, or one that is taken up again from its files; `source` is what refusals call the readings."""
        session = Session.begun(programme, asked, out)
        kept = Kept(out, session.header(), resume=resume)
        watch = Watch(asked.noise_bound, asked.gravity, asked.dwell_s, out)
        one = Measurement(session, kept, Lines(Path(source)), watch, Diagnosing())
        words, rows = list(kept.words), 0
        for piece in kept.replayed():
            found = one.lines.feed(piece)
            for part in by_count(found.rows, rows, [word["rows"] for word in words]):
                one._visited(one.watch.take(part, one.lines.resolution))
                rows += len(part)
                while words and words[0]["rows"] <= rows:
                    one._again(words.pop(0))
        for word in words:
            one._again(word)
        if one.lines.header:
            one.lines.from_the_beginning()
            one.news = [("resumed", len(one.session.good))]
            kept.positions(one.session.record())
        return one

    def feed(self, data: bytes, *, ended: bool = False) -> None:
        """Take what came from the source: keep it first, then judge it."""
        found: Taken = self.lines.feed(data, ended=ended)
        if found.kept:
            self.kept.append(found.kept)
        if found.left_out:
            self.left_out += len(found.left_out)
            self.trouble = f"{self.left_out} lines were left out, the last: {found.left_out[-1]}"
            self.news.append(("refused", found.left_out[-1]))
        visits = self.watch.take(found.rows, self.lines.resolution)
        self._visited(visits + (self.watch.end() if ended else []))
        if visits or ended:
            self.kept.positions(self.session.record())

    def _visited(self, visits: Sequence[Visit]) -> None:
        for visit in visits:
            self.session = taken(self.session, visit)
            self.news.append(("visit", visit))

    def _follow(self, word: Mapping[str, Any]) -> None:
        self.session = told(self.session, word)
        self.news.append(("word", word))

    def _again(self, word: Mapping[str, Any]) -> None:
        """Follow a word that was written down."""
        try:
            self._follow(word)
        except (InputError, LookupError, TypeError, ValueError):
            raise InputError(f"{self.kept.words_file}: {dict(word)}: cannot be followed; give another --out") from None

    def hear(self, word: Mapping[str, Any]) -> bool:
        """Follow a word of the operator's, and write it down; whether it ends the session."""
        if word.get("word") == "end":
            return True
        try:
            if word.get("word") == "yes":
                # What was shown may not be proposed any more: then nothing else is taken for it.
                word = next(one.word for one in self.proposals if one.word == word["proposal"])
            self._follow(word)
        except (InputError, LookupError, StopIteration, TypeError, ValueError):
            self.news.append(("refused", f"{dict(word)}: cannot be followed"))
            return False
        self.kept.tell(word, self.lines.rows)
        self.kept.positions(self.session.record())
        return False

    @property
    def proposals(self) -> list[Proposal]:
        """What the last diagnosis asks for, where it is of what counts now."""
        current = self.diagnosing.of == len(self.session.good)
        return proposals_of(self.session, self.diagnosing.found) if current or self.diagnosing.running else []

    def diagnose(self) -> None:
        """Begin a diagnosis where the positions contradict the model, and hear of one that has ended."""
        if self.diagnosing.ended():
            self.news.append(("diagnosis", self.diagnosing.found))
        if self.session.standing.against and self.session.worst is not None and self.diagnosing.wants(self.session):
            self.diagnosing.start(self.session, self.kept.positions_file, self.kept.beside("diagnosis.html"))

    def moment(self, source: Source, silent_s: float, *, ended: bool = False) -> Moment:
        """What is now, for views; the news are told once."""
        news, self.news = tuple(self.news), []
        return Moment(
            self.session,
            self.watch.present(),
            tuple(self.proposals),
            self.diagnosing,
            source.name,
            silent_s if silent_s >= SILENT_S else 0.0,
            source.trouble or self.trouble,
            self.lines.rows,
            self.left_out,
            news,
            ended,
        )


def carry_out(one: Measurement, source: Source, views: Sequence[View]) -> Measured:
    """Measure until the source ends, the operator ends it, or nothing has come for so long as there is patience.

    At the end the positions are diagnosed as a whole, and the diagnosis is written beside the record. An InputError for
    a source that gives no readings, or files that cannot be written; what came until then is kept.
    """
    with ExitStack() as stack:
        for ending in (one.kept, one.diagnosing, source):
            stack.enter_context(closing(ending))
        ended, last, patience_s = "", monotonic(), one.session.asked.patience_s
        while not ended:
            data = source.read()
            if data is None:
                one.feed(b"", ended=True)
                ended = "source"
            elif data:
                one.feed(data)
                last = monotonic()
            silent = monotonic() - last
            words = [word for view in views for word in view.words()]
            if sum(map(one.hear, words)):
                ended = "operator"
            elif patience_s is not None and not data and silent >= patience_s:
                ended = ended or "patience"
            one.diagnose()
            moment = one.moment(source, silent, ended=bool(ended))
            for view in views:
                view.show(moment)
            if not data and not ended:
                sleep(PAUSE_S)
        return _ended(one, source, views, ended)


def _ended(
    one: Measurement, source: Source, views: Sequence[View], ended: Literal["source", "operator", "patience"] | str
) -> Measured:
    """The rest that is going on counts; then the diagnosis of all."""
    if not one.lines.rows:
        raise InputError(source.trouble.removesuffix(" yet") or f"{source.name}: gave no readings; is it a raw record?")
    if ended != "source":
        one._visited(one.watch.end())
        one.kept.positions(one.session.record())
    if one.session.worst is not None:
        if one.diagnosing.wants(one.session):
            one.diagnosing.start(one.session, one.kept.positions_file, one.kept.beside("diagnosis.html"))
        while one.diagnosing.running:
            if one.diagnosing.ended(PAUSE_S):
                one.news.append(("diagnosis", one.diagnosing.found))
            moment = one.moment(source, 0.0, ended=True)
            for view in views:
                view.show(moment)
    positions = one.kept.positions_file
    said = "patience" if ended == "patience" else "source" if ended == "source" else "operator"
    return measured(
        one.session, one.diagnosing, one.lines.rows, one.left_out, said, str(positions) if positions.exists() else None
    )
