"""Every command and Ctrl-C: the remaining files are whole, and the exit status marks the interruption."""

import inspect
import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from command_table import QUICK, Command, files
from trihedron.tools import cli


def whole(folder: Path) -> bool:
    """Return True if no file is incomplete: those have names that begin with a dot, or say so."""
    return not list(folder.rglob(".*")) and not list(folder.rglob("*.incomplete"))


def calls_of(command: Command) -> int:
    """Return the number of calls of our functions in a command."""
    count = 0

    def counted(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        if event == "call" and is_ours(frame):
            count += 1

    sys.setprofile(counted)
    try:
        cli.main(list(command.arguments))
    finally:
        sys.setprofile(None)
    return count


def interrupted_at(command: Command, number: int) -> int:
    """Return the exit status of a command that Ctrl-C strikes in the n-th call of our functions."""
    count = 0

    def strike(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        if event == "call" and is_ours(frame):
            count += 1
            if count == number:
                sys.setprofile(None)
                raise KeyboardInterrupt

    sys.setprofile(strike)
    try:
        return cli.main(list(command.arguments))
    finally:
        sys.setprofile(None)


OURS = str(Path(cli.__file__).resolve().parent)


def is_ours(frame: Any) -> bool:
    name = frame.f_code.co_filename
    # A generator is also called for closing, where Python passes no exception on.
    if frame.f_code.co_flags & inspect.CO_GENERATOR:
        return False
    return name.startswith(OURS) and "/tools/cli/" not in name


STRIKES = (0.02, 0.5, 0.97)
"""Parts of the run at which Ctrl-C comes."""
LONG = (
    *("calibrate clean.csv", "diagnose measured.csv", "plan target X4", "plan positions 6", "plan check angles.csv"),
    *("hidden --cases", "campaign campaign.toml", "reproduce calibration"),
)
"""Commands whose calls are not all counted in each run of the tests."""
INTERRUPTIBLE = [c for c in QUICK if c.arguments[0] not in ("completion", "doctor")]


@pytest.mark.first(2)
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[pytest.mark.acceptance] if c.title in LONG else []) for c in INTERRUPTIBLE],
    ids=lambda c: c.title,
)
def test_ctrl_c_in_the_middle(command: Command, here: Path, capsys):
    """Interrupt at several places: the remaining files are whole, and the exit status marks the interruption."""
    before = files(here)
    calls = calls_of(command)
    capsys.readouterr()
    complete = {name: content for name, content in files(here).items() if name not in before}
    for part in STRIKES:
        for name in [*complete, *(p.name for p in here.iterdir() if p.name.startswith("out"))]:
            path = here / Path(name).parts[0]
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        status = interrupted_at(command, max(1, int(part * calls)))
        output = capsys.readouterr()
        remaining = {name: content for name, content in files(here).items() if name not in before}
        assert {name: content for name, content in files(here).items() if name in before} == before
        assert "Traceback" not in output.err
        if status == 0:
            # A stopped search returns its best result, and says so.
            assert "interrupted" in output.out or remaining == complete, (part, output)
            continue
        assert status == 130, output.err
        assert output.err.count("\n") == 1
        assert output.err.startswith("trihedron: interrupted")
        assert whole(here), (part, sorted(remaining))
        for name, content in remaining.items():
            if command.arguments[0] in ("simulate", "campaign"):
                continue
            assert content == complete[name], (part, name)
        if command.arguments[0] == "simulate" and remaining:
            said_complete = json.loads(remaining["out/run.json"]).get("complete", True)
            assert said_complete is False or remaining["out/run.csv"] == complete["out/run.csv"]
    assert not list(Path(tempfile.gettempdir()).iterdir())
