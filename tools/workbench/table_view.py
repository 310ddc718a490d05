"""A measurement at the table, above the records on the page: the present rest, the next position, the promise."""

import queue
from collections.abc import Mapping, Sequence
from math import log
from pathlib import Path
from typing import Any

from ..live.loopback import template_of
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
from .desk import Desk

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
