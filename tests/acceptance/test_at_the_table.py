"""A measurement from its first reading to its verdict, by an operator who follows the view: page and terminal.

The table is made of the FMUs, and goes where the view says. One rest is bad, and the program is killed once and
resumed; then the same with an effect hidden in the table.
"""

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from browser import Window
from simulated_table import SimulatedTable
from trihedron.tools.records import PositionRecord, read_record

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name != "posix", reason="a terminal of POSIX")]

PLAN = Path(__file__).resolve().parents[2] / "scenarios" / "static-calibration-positions.csv"
HARMONIC = {"effect": "encoder-harmonic", "where": "inner-axis", "order": 2, "amplitude": 8e-5, "phase": 0.7}
SECONDS = 180.0
"""Time limit of each step on a busy machine [s]."""
NEXT = re.compile(r"(next|repeat) position (\d+) of (\d+): α (-?[\d.]+)°, β (-?[\d.]+)°")


def waited(observe: Callable[[], object], what: str) -> object:
    """Return the first result of an observation."""
    ends = time.monotonic() + SECONDS
    while time.monotonic() < ends:
        if result := observe():
            return result
        time.sleep(0.05)
    raise AssertionError(f"not seen: {what}")


class Program:
    """`trihedron measure` as a process, with its terminal output."""

    def __init__(self, folder: Path, *options: str) -> None:
        command = [sys.executable, "-m", "trihedron.tools.cli", "measure", str(PLAN), "--from", "growing.csv"]
        command += ["--out", "monday.csv", "--noise-bound", "1e-5", "--dwell", "5", "--json", "done.json", *options]
        ours, theirs = pty.openpty()
        environment = os.environ | {"COLUMNS": "400", "LINES": "50"}
        self.process = subprocess.Popen(
            command, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, close_fds=True
        )
        os.close(theirs)
        self._terminal, self._shown = ours, b""

    def message(self) -> str:
        """Return the whole text in the terminal."""
        while select.select([self._terminal], [], [], 0.0)[0]:
            try:
                piece = os.read(self._terminal, 1 << 16)
            except OSError:
                break
            if not piece:
                break
            self._shown += piece
        return self._shown.decode("utf-8", "replace")

    def typed(self, text: str) -> None:
        os.write(self._terminal, text.encode())

    def killed(self) -> None:
        """Kill the process at once, without time to finish anything."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def ended(self) -> int:
        waited(lambda: self.message() is not None and self.process.poll() is not None, "the end")
        return self.process.returncode

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._terminal)


class Terminal:
    """An operator who reads the terminal."""

    options: tuple[str, ...] = ()

    def __init__(self, program: Program) -> None:
        self.program = program

    def text(self) -> str:
        return self.program.message()

    def next(self) -> str:
        output = re.findall(r"(?:next|repeat) position [^\r\n]*|all positions are measured", self.text())
        return output[-1].strip() if output else ""

    def end(self) -> None:
        self.program.typed("end\n")

    def sees_the_loss(self) -> bool:
        return self.program.process.poll() is not None


class Page:
    """An operator who looks at the page."""

    options = ("--serve",)

    def __init__(self, program: Program, window: Window) -> None:
        self.program, self.page = program, window.page
        result = waited(lambda: re.search(r"http://127\.0\.0\.1:\d+/[\w-]+/", program.message()), "the address")
        window.open(result[0], 1280)  # type: ignore[index]
        window.page.wait_for_selector("#next")

    def text(self) -> str:
        # read its terminal, too: a program waits for a full one
        self.program.message()
        return self.page.inner_text("main").lower()

    def next(self) -> str:
        self.program.message()
        return self.page.inner_text("#next").strip().lower()

    def end(self) -> None:
        self.page.once("dialog", lambda dialog: dialog.accept())
        self.page.click("#end")

    def sees_the_loss(self) -> bool:
        return self.page.is_visible("#lost") and "is lost since" in self.page.inner_text("#lost")


@pytest.fixture(params=["terminal", "page"])
def operator(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Terminal | Page]]:
    """Start the program, and return an operator at its terminal or its page."""
    programs: list[Program] = []
    window = request.getfixturevalue("window") if request.param == "page" else None

    def start(*options: str) -> Terminal | Page:
        kind = Terminal if window is None else Page
        programs.append(Program(tmp_path, *kind.options, *options))
        return Terminal(programs[-1]) if window is None else Page(programs[-1], window)

    yield start
    for program in programs:
        program.close()


def measured(operator: Terminal | Page, table: SimulatedTable, count: int, *, knocked: int | None = None) -> list[str]:
    """Go to the next position, this number of times; return the positions."""
    missing: list[str] = []
    for _ in range(count):
        output = str(waited(lambda: NEXT.match(operator.next()) and operator.next(), "where to go"))
        to = NEXT.match(output)
        assert to is not None
        table.go(float(to[4]), float(to[5]), knocked=len(missing) == knocked)
        missing.append(output)
        # the rest ends when the table leaves it
        remaining = float(to[4]) + 4.0
        table.go(remaining, float(to[5]), 0.5)
        waited(lambda before=output: operator.next() != before, f"another than {output}")
    return missing


def test_24_positions_with_a_bad_rest_and_a_kill(operator, tmp_path: Path):
    table = SimulatedTable(tmp_path / "growing.csv", seed=3)
    first = operator()
    missing = measured(first, table, 9, knocked=5)
    assert missing[6].startswith("repeat position 6 of 24")
    assert "a knock in row" in first.text()
    assert not missing[7].startswith("repeat")
    first.program.killed()
    waited(first.sees_the_loss, "the loss")
    table.go(*(200.0, 25.0))
    second = operator("--resume")
    measured(second, table, 15)
    waited(lambda: "the promise is reached" in second.text() and "you can stop" in second.text(), "the promise")
    assert second.next() == "all positions are measured"
    second.end()
    assert second.program.ended() == 0
    process = json.loads((tmp_path / "done.json").read_text(encoding="utf-8"))
    assert (process["done"], process["planned"], process["promise_reached"], process["verdict"]) == (
        24,
        24,
        True,
        "consistent",
    )
    assert [rest["rest"] for rest in process["rests"] if not rest["counts"]] == [6]
    assert (tmp_path / "monday.csv").read_bytes() == table.file.read_bytes()
    ours = read_record(tmp_path / "monday.positions.csv", PositionRecord)
    usual = read_record(table.file, PositionRecord)
    np.testing.assert_array_equal(ours.specific_force, usual.specific_force)
    np.testing.assert_array_equal(ours.alpha, usual.alpha)
    assert 'class="verdict good"' in (tmp_path / "monday.diagnosis.html").read_text(encoding="utf-8")


def test_a_hidden_effect_is_noticed_and_named_at_the_table(operator, tmp_path: Path):
    table = SimulatedTable(tmp_path / "growing.csv", seed=1, hidden=[HARMONIC])
    view = operator()
    noticed = 0
    for k in range(24):
        measured(view, table, 1)
        if not noticed and "no parameters explain the readings" in view.text():
            noticed = k + 1
    assert 8 < noticed < 24, "noticed while it is measured"
    assert "trihedron diagnose monday.positions.csv" in view.text()
    view.end()
    assert view.program.ended() == 0
    process = json.loads((tmp_path / "done.json").read_text(encoding="utf-8"))
    assert (process["verdict"], process["falsified"], process["diagnosed"]) == ("ambiguous", True, 24)
    assert "encoder-harmonic inner-axis order 2" in (tmp_path / "monday.diagnosis.html").read_text(encoding="utf-8")
