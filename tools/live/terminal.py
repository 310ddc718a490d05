"""A measurement in a terminal: a line for each event, above a status line of the table."""

import contextlib
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
    next_text,
    present_text,
    promise_text,
    shares_text,
    visit_text,
)

HELP = "type: r N to repeat rest N; end to end"
LONGEST_LINE = 10_000
"""Characters of a line where no terminal breaks it."""


class Terminal:
    """Prints to `out`, and reads the operator's words from `typed`; None if readings come from there."""

    def __init__(self, out: TextIO, typed: TextIO | None) -> None:
        self._out, self._tty = out, out.isatty()
        self._words: queue.Queue[str] = queue.Queue()
        self._printed: list[tuple[int, str]] = []
        self._status = self._trouble = ""
        if typed is not None:
            self._line(HELP)
            threading.Thread(target=self._listen, args=(typed,), daemon=True).start()

    def _listen(self, typed: TextIO) -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in typed:
                self._words.put(line)

    def words(self) -> Sequence[Mapping[str, Any]]:
        """Return the words typed since the last call; answer unknown ones."""
        words = []
        while not self._words.empty():
            text = self._words.get_nowait().split()
            self._status = ""
            match text:
                case ["end" | "e" | "q"]:
                    words.append({"word": "end"})
                case ["r" | "repeat", number] if number.isdecimal():
                    words.append({"word": "repeat", "visit": int(number)})
                case []:
                    pass
                case _:
                    self._line(HELP)
        return words

    def show(self, moment: Moment) -> None:
        """Print the news, then the state of the table."""
        session = moment.session
        if not moment.rows and not self._tty:
            if moment.silent_s and moment.trouble != self._trouble:
                self._line(f"{moment.trouble}; waiting for it")
                self._trouble = moment.trouble
            return
        for kind, what in moment.news:
            if kind == "visit":
                self._line(visit_text(session, what))
            elif kind == "resumed":
                self._line(f"taken up again: {what} positions are measured")
            elif kind == "refused":
                self._line(f"left out: {what}")
        # After each good rest these are printed again, though they may be the same.
        counted = len(session.history)
        lines = []
        if counted:
            lines = [(counted, text(session)) for text in (shares_text, promise_text, against_text)]
        if not moment.ended:
            lines.append((0, next_text(session)))
        for line in lines:
            if line not in self._printed and line[1]:
                self._line(line[1])
        self._printed = lines
        status = ""
        if not moment.ended:
            status = present_text(session, moment.present)
            if moment.silent_s:
                status += f"; nothing has come for {int(moment.silent_s)} s"
        self._stand(status, moment)

    def _stand(self, status: str, moment: Moment) -> None:
        """Overwrite the status line where the terminal allows it; do nothing elsewhere."""
        if moment.trouble and not moment.rows and moment.trouble not in self._status:
            status = f"{status}: {moment.trouble}"
        if not self._tty or status == self._status:
            return
        width = shutil.get_terminal_size().columns - 1
        self._out.write(f"\r\x1b[2K{status[:width]}")
        self._out.flush()
        self._status = status

    def _line(self, text: str) -> None:
        width, clear = LONGEST_LINE, ""
        if self._tty:
            width, clear = shutil.get_terminal_size().columns - 1, "\r\x1b[2K"
        printable = "".join(character if character.isprintable() else " " for character in text)
        self._out.write(f"{clear}{textwrap.fill(printable, width, subsequent_indent='  ')}\n")
        self._out.flush()
        self._status = ""


def terminal_of(source: str) -> Terminal:
    """The view of this process: words come from standard input, unless readings do."""
    listens = source != "-" and sys.stdin is not None and sys.stdin.isatty()
    return Terminal(sys.stderr, sys.stdin if listens else None)
