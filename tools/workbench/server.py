"""The server of the page about records, on this machine's loopback, with a measurement at the table above them."""

import json
import math
import queue
import secrets
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import log
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from ..errors import InputError, one_line
from ..files import bytes_of, whole_file
from ..live.loopback import LoopbackHandler, LoopbackServer, template_of, text_of
from ..measure import Moment, Session, TableSetting
from ..reports.measure import (
    against_text,
    angles_text,
    next_text,
    present_text,
    promise_text,
    visit_text,
)
from ..rounding import digits, upwards
from . import answers
from .desk import COMMANDS, Desk, DeskRequest

MOST_WORDS = 16
"""That wait to be heard."""
ABOVE = 16.0
LOWEST, HIGHEST = 0.8, 30.0
"""Guaranteed error over the promised one, at the ends of the picture."""
PLOT = (720.0, 220.0, 44.0, 26.0)
"""Width, height, room on the left and below of the picture."""


class TableView:
    """Keeps the present moment of a measurement for the page, and the operator's words for the measurement.

    Parameters
    ----------
    desk : Desk
        the records on the page
    positions_file : Path
        the positions of the measurement; they are opened on the page after each change

    Attributes
    ----------
    page : bytes
        the present moment as HTML
    """

    def __init__(self, desk: Desk, positions_file: Path) -> None:
        self.desk, self._positions_file = desk, positions_file
        self.page = b""
        self._words: queue.Queue[dict[str, Any]] = queue.Queue(MOST_WORDS)

    def show(self, moment: Moment) -> None:
        """Keep the page of a moment for the next request, and open changed positions."""
        self.page = moment_page(moment).encode()
        changes = [kind for kind, _ in moment.news if kind != "refused"]
        if changes and self._positions_file.exists():
            self.desk.renew(self._positions_file)

    def words(self) -> Sequence[Mapping[str, Any]]:
        """Return the buttons pressed since the last call."""
        words = []
        while not self._words.empty():
            words.append(self._words.get_nowait())
        return words

    def hear(self, word: dict[str, Any]) -> bool:
        """Accept a word; return whether there was room for it."""
        try:
            self._words.put_nowait(word)
        except queue.Full:
            return False
        return True


def moment_page(moment: Moment) -> str:
    """Return a moment of a measurement as HTML, with all texts escaped."""
    session, present, settings = moment.session, moment.present, moment.session.programme.settings
    last = None
    if session.visits:
        last = session.visits[-1]
    bad = [visit_text(session, visit) for visit in session.visits if visit.bad and visit is not last]
    state = present.state
    if present.why and state != "settling":
        state = "bad"
    return template_of("workbench", "moment.html").render(
        next=next_text(session),
        present=present_text(session, present),
        state=state,
        promise=promise_text(session),
        reached=session.reached and not session.standing.against,
        against=against_text(session),
        trouble=moment.trouble,
        silent=int(moment.silent_s),
        source=moment.source,
        last=last and (visit_text(session, last), bool(last.bad)),
        bad=bad[-8:],
        done=len(settings) - len(session.left),
        count=len(settings),
        rows=moment.rows,
        targets=[_target(session, symbol, promised) for symbol, promised in session.programme.promised.items()],
        settings=[_row(session, setting) for setting in settings],
        picture=_picture(session),
        ended=moment.ended,
    )


def _target(session: Session, symbol: str, promised: float) -> tuple[str, str, str, int, bool]:
    """Symbol, guaranteed error and promise [σ], their ratio as percent of a bar, and whether the promise is kept."""
    error, share = session.standing.errors.get(symbol), session.share(symbol)
    if error is None or share is None:
        return symbol, "open", upwards(promised, 4), 100, False
    part = round(100.0 * min(share / 3.0, 1.0))
    return symbol, upwards(error, 4), upwards(promised, 4), part, share <= session.asked.within


def _row(session: Session, setting: TableSetting) -> tuple[str, str, str, int | None]:
    """Angles, state, encoder readings, and the rest that counts (None: none does)."""
    visits = session.visits_to(setting)
    good = [visit for visit in visits if session.counts(visit)]
    readings = ""
    if visits:
        readings = angles_text(*session.visit_angles_deg((good or visits)[-1]))
    number = None
    if good:
        number = good[-1].number
    return angles_text(setting.alpha_deg, setting.beta_deg), session.state_of(setting), readings, number


def _picture(session: Session) -> dict[str, Any]:
    """Return the curves of the 18 errors over their limits against the number of valid positions, on a log scale."""
    width, height, margin, below = PLOT
    count = max(len(session.programme.settings), len(session.history), 2)

    def x(position: int) -> float:
        return round(margin + (width - margin - ABOVE) * (position - 1) / (count - 1), 1)

    def y(share: float) -> float:
        part = log(min(max(share, LOWEST), HIGHEST) / LOWEST) / log(HIGHEST / LOWEST)
        return round((height - below - ABOVE) * (1.0 - part) + ABOVE, 1)

    lines, dots = [], []
    for symbol in session.programme.promised:
        points = []
        for position, standing in enumerate(session.history, start=1):
            share = session.share(symbol, standing)
            if share is not None:
                points.append(f"{x(position)},{y(share)}")
        if points:
            lines.append(" ".join(points))
        if len(points) == 1:
            dots.append(points[0])
    marked = {1, count}
    if count < 60:
        marked.update(range(5, count + 1, 5))
    return {
        "width": width,
        "height": height,
        "left": margin,
        "promise": y(1.0),
        "lines": lines,
        "dots": dots,
        "ticks": [(y(share), digits(share, 2)) for share in (1.0, 2.0, 5.0, 10.0, 30.0)],
        "marks": [(x(position), position) for position in sorted(marked)],
    }


MOST_BYTES = 1 << 20
"""Most bytes of a request with decisions."""
MOST_WORD_BYTES = 4096
"""Most bytes of a word from the operator."""
MOST_EXPLANATIONS = 1000
MOST_DROPPED = 1 << 30
"""Most bytes of a file that is dropped on the page."""
SMALL, FIRST_LOOK_S = 5_000_000, 30.0
"""Files up to this size are read before the page opens [bytes], for so long at most [s]."""
JSON = "application/json"
FRAME = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'unsafe-inline'"


class DeskServer(LoopbackServer):
    """Server of the page of a desk, with a measurement above it if there is a table. Port 0: any free port."""

    def __init__(self, desk: Desk, port: int = 0, folder: Path | None = None, table: TableView | None = None) -> None:
        self.desk, self.table = desk, table
        self.folder = Path.cwd() if folder is None else folder
        super().__init__(port, _Handler)

    def close(self) -> None:
        """Stop the server and any running calculation."""
        super().close()
        self.desk.close()


def open_records(*files: str | Path, port: int = 0, advise: answers.Advise | None = None) -> DeskServer:
    """Serve a page on this machine about records: look, decide, calculate again, export.

    Parameters
    ----------
    files : path
        Records, or files to import. More are dropped on the page.
    port : int
        Port of the page; 0 takes a free one.
    advise : function, optional
        Gives the command that follows a result; that of the command line.

    Returns
    -------
    DeskServer
        Its `address` is for a browser of this machine; `close()` ends it.

    Raises
    ------
    InputError
        for a file that is not a record and cannot be imported, or a port that is taken

    Examples
    --------
    >>> import trihedron as th
    >>> page = th.open("walk.csv")  # doctest: +SKIP
    >>> page.address  # doctest: +SKIP
    """
    small = []
    for number, file in enumerate(files):
        path = Path(file)
        if not path.is_file() or path.stat().st_size <= SMALL:
            bytes_of(path, "the file of a record is needed")
            small.append(number)
    desk = Desk((), advise)
    numbers = [desk.open(Path(file)) for file in files]
    try:
        for number in small:
            desk.wait_for(numbers[number], FIRST_LOOK_S)
        return DeskServer(desk, port)
    except InputError:
        desk.close()
        raise


class _Handler(LoopbackHandler):
    def do_GET(self) -> None:
        desk: Desk = self.server.of.desk
        table: TableView | None = self.server.of.table
        at_table = () if table is None else ("now",)
        name = self.trusted(("", "state", "lines", "rests", "page", *at_table))
        if name == "":
            nonce = secrets.token_urlsafe(12)
            style = text_of("document", "page.css")
            page = template_of("workbench", "page.html").render(
                nonce=nonce,
                style=style,
                script=text_of("workbench", "page.js"),
                commands=COMMANDS,
                at_table=table is not None,
            )
            self.answer_shell(page, nonce, "; frame-src 'self'")
        elif name == "state":
            known = parse_qs(urlsplit(self.path).query).get("number", [""])[0]
            self._answer_object(desk.state(int(known) if known.isdecimal() else -1))
        elif name == "page":
            self._answer_page(desk)
        elif name == "now" and table is not None:
            self.answer(200, table.page)
        elif name is not None:
            query = {key: values[0] for key, values in parse_qs(urlsplit(self.path).query).items()}
            self._tell(lambda: _looked(desk, name, query))

    def _answer_page(self, desk: Desk) -> None:
        """Send the page of a result, or of one of its explanations, for a frame."""
        query = parse_qs(urlsplit(self.path).query)
        try:
            answer = _number(query["answer"][0], len(desk.answers)) if "answer" in query else None
            explanation = _number(query["explanation"][0], MOST_EXPLANATIONS) if "explanation" in query else None
            page = desk.page(answer, explanation)
        except InputError as error:
            self.answer(404, one_line(str(error)).encode())
            return
        self.answer(200, page.encode(), FRAME, in_frame=True)

    def do_POST(self) -> None:
        table: TableView | None = self.server.of.table
        at_table = () if table is None else ("word",)
        name = self.trusted(("do", "drop", *at_table))
        if name == "drop":
            self._drop()
        elif name == "word" and table is not None:
            self._hear(table)
        elif name is not None:
            asked = self.posted_object(MOST_BYTES)
            if asked is not None:
                self._tell(lambda: _done(self.server.of.desk, asked))

    def _hear(self, table: TableView) -> None:
        """Pass the operator's word on to the measurement."""
        word = self.posted_object(MOST_WORD_BYTES)
        if word is None:
            return
        if word.get("word") not in ("repeat", "end"):
            self.answer(400, b"no word")
            return
        self.answer(204 if table.hear(word) else 503, b"")

    def _drop(self) -> None:
        """Keep a file that was dropped on the page in the working folder, and open it."""
        name = Path(unquote(urlsplit(self.path).query)).name
        body = self.posted(MOST_DROPPED)
        if body is None:
            return
        server: DeskServer = self.server.of

        def kept() -> dict[str, Any]:
            if not name or name.startswith("."):
                raise InputError("the file has no name")
            path = server.folder / name
            if not path.exists():
                with whole_file(path) as unfinished:
                    unfinished.write_bytes(body)
            elif path.read_bytes() != body:
                raise InputError(f"{name}: the working folder has another file of this name; rename one of them")
            return {"file": server.desk.open(path)}

        self._tell(kept)

    def _tell(self, work: Any) -> None:
        """Send what some work gives, or the line with the reason why it cannot be done."""
        try:
            content = work()
        except (InputError, OSError) as error:
            content = {"refusal": answers.refusal_of(error)}
        self._answer_object(content)

    def _answer_object(self, content: Mapping[str, Any]) -> None:
        self.answer(200, json.dumps(content, allow_nan=False).encode(), kind=JSON)


def _looked(desk: Desk, name: str, query: Mapping[str, str]) -> dict[str, Any]:
    """Return the lines or the rests of an open file."""
    number = _number(query.get("file"), len(desk.files))
    if name == "lines":
        begin, end = (_time(query[key]) if key in query else None for key in ("from", "to"))
        return desk.lines(number, begin, end, _number(query.get("points", "800"), 5000))
    options = {key: value for key, value in query.items() if key in answers.OPTIONS}
    file = desk.files[number]
    return desk.look(answers.rests, str(file.path), file.of_content, answers.typed(options))


def _number(text: str | None, most: int) -> int:
    """Return a whole number below a limit; an InputError of anything else."""
    if text is None or not text.isdecimal() or int(text) >= most:
        raise InputError(f"{text}: a whole number below {most} is needed")
    return int(text)


def _time(text: str) -> float:
    """Return a time [s]; an InputError of anything else."""
    with suppress(ValueError):
        if math.isfinite(time := float(text)):
            return time
    raise InputError(f"{text}: a time in seconds is needed")


def _done(desk: Desk, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Carry out a request of the page."""
    what = asked.get("do")
    if what == "run":
        files, options = asked.get("files"), asked.get("options", {})
        if not isinstance(files, list) or not all(type(k) is int for k in files) or not isinstance(options, dict):
            raise InputError("files and options are needed")
        desk.run(DeskRequest(str(asked.get("command")), tuple(files), options))
    elif what == "decide" and isinstance(asked.get("decisions"), dict) and type(asked.get("file")) is int:
        desk.decide(asked["file"], asked["decisions"])
    elif what == "import" and isinstance(asked.get("given"), dict) and type(asked.get("file")) is int:
        given = {str(key): str(value) for key, value in asked["given"].items()}
        return desk.import_with(asked["file"], given, write=asked.get("write") is True)
    elif what == "undo" and type(asked.get("file")) is int:
        desk.undo(asked["file"])
    elif what == "stop":
        desk.stop()
    elif what == "again":
        desk.again()
    elif what == "save":
        answer = asked.get("answer")
        return desk.save(str(asked.get("what")), None if answer is None else _number(str(answer), len(desk.answers)))
    else:
        raise InputError("the page has no such address")
    return {}
