"""A measurement in a terminal: a line for whatever happens, and below them one that says how the table stands."""

import queue
import shutil
import sys
import textwrap
import threading
from collections.abc import Mapping, Sequence
from typing import Any, TextIO

from ..measure import Moment
from ..reports.measure import (
    against_text,
    angles_text,
    diagnosis_text,
    next_text,
    present_text,
    promise_text,
    shares_text,
    visit_text,
)

HELP = "type: 1, 2, ... to take up a proposal; r N to repeat rest N; end to end"


class Terminal:
    """Prints to `out`, and reads the operator's words from `typed`, which is None where readings come from there."""

    def __init__(self, out: TextIO, typed: TextIO | None) -> None:
        self._out, self._tty = out, out.isatty()
        self._words: queue.Queue[str] = queue.Queue()
        self._said: tuple[Any, ...] = ()
        self._proposed: list[dict[str, Any]] = []
        self._status = ""
        if typed is not None:
            self._line(HELP)
            threading.Thread(target=self._listen, args=(typed,), daemon=True).start()

    def _listen(self, typed: TextIO) -> None:
        try:
            for line in typed:
                self._words.put(line)
        except (OSError, ValueError):
            return

    def words(self) -> Sequence[Mapping[str, Any]]:
        """What was typed since; what is no word is answered."""
        found = []
        while not self._words.empty():
            text = self._words.get_nowait().split()
            self._status = ""
            match text:
                case ["end" | "e" | "q"]:
                    found.append({"word": "end"})
                case ["r" | "repeat", number] if number.isdecimal():
                    found.append({"word": "repeat", "visit": int(number)})
                case [number] if number.isdecimal() and 1 <= int(number) <= len(self._proposed):
                    found.append({"word": "yes", "proposal": self._proposed[int(number) - 1]})
                case []:
                    pass
                case _:
                    self._line(HELP)
        return found

    def show(self, moment: Moment) -> None:
        """Print what is new, then how the table stands."""
        session, found = moment.session, moment.diagnosing.found
        if not moment.rows and not self._tty:
            return
        for kind, what in moment.news:
            if kind == "visit":
                self._line(visit_text(session, what))
            elif kind == "resumed":
                self._line(f"taken up again: {what} positions are measured")
            elif kind == "refused":
                self._line(f"left out: {what}")
            elif kind == "diagnosis" and moment.diagnosing.trouble:
                self._line(f"diagnosis: {moment.diagnosing.trouble}")
        counted = len(session.history)
        told = [(counted, line(session)) for line in (shares_text, promise_text, against_text) if counted]
        told += [(moment.diagnosing.of, diagnosis_text(found, moment.diagnosing.of))]
        told += [
            (0, f"proposal {k}: {one.why}{_where(one.settings)} (type {k} for yes)")
            for k, one in enumerate(moment.proposals, start=1)
        ]
        told.append((0, "" if moment.ended else next_text(session)))
        for line in told:
            if line not in self._said and line[1]:
                self._line(line[1])
        self._said = tuple(told)
        self._proposed = [one.word for one in moment.proposals]
        silent = f"; nothing has come for {int(moment.silent_s)} s" if moment.silent_s else ""
        self._stand(f"{present_text(session, moment.present)}{silent}" if not moment.ended else "", moment)

    def _stand(self, status: str, moment: Moment) -> None:
        """The last line, written over where that is possible; else only what is wrong is said, once."""
        if moment.trouble and not moment.rows and moment.trouble not in self._status:
            status = f"{status}: {moment.trouble}"
        if not self._tty or status == self._status:
            return
        width = shutil.get_terminal_size().columns - 1
        self._out.write(f"\r\x1b[2K{status[:width]}")
        self._out.flush()
        self._status = status

    def _line(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1 if self._tty else 10_000
        clear = "\r\x1b[2K" if self._tty else ""
        shown = textwrap.fill("".join(c if c.isprintable() else " " for c in text), width, subsequent_indent="  ")
        self._out.write(f"{clear}{shown}\n")
        self._out.flush()
        self._status = ""


def _where(settings: Sequence[tuple[float, float]]) -> str:
    return f": {'; '.join(angles_text(*setting) for setting in settings)}" if settings else ""


def terminal_of(source: str) -> Terminal:
    """The view of this process: words come from standard input, unless readings do."""
    return Terminal(sys.stderr, None if source == "-" or sys.stdin is None or not sys.stdin.isatty() else sys.stdin)
