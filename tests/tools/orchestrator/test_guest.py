"""A foreign FMU in a process of its own: its faults do not harm our process; its results are the same."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_runs import children, command_of
from foreign_fmus import rewritten
from foreign_fmus.hostile import assert_named_and_kept, build_hostile, hostile_scenario, outcome
from scenario_runs import ACCUMULATOR, CLOCK, FAILING, GAIN, run_of_guests, scenario, wires
from trihedron.tools import library
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import run_scenario, write_scenario

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the hostile FMU is written for POSIX")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMU."""
    return build_hostile(tmp_path_factory.mktemp("hostile")).parent


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("call", "way"),
    [
        *(("DoStep", way) for way in ("error", "exit", "crash", "hang")),
        *(("Instantiate", "error"), ("ExitInitializationMode", "exit"), ("SetReal", "crash"), ("GetReal", "exit")),
        *(("GetString", "error"), ("SetFMUstate", "crash"), ("Terminate", "error"), ("FreeInstance", "crash")),
    ],
)
def test_the_culprit_is_named_and_the_record_kept(hostile: Path, tmp_path: Path, call: str, way: str) -> None:
    assert_named_and_kept(hostile, call, way, tmp_path / "out")


@pytest.mark.first(1)
@pytest.mark.parametrize("way", ["chdir", "printf", "threads"])
def test_what_it_does_to_its_process_changes_nothing(
    hostile: Path, tmp_path: Path, way: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The results are in their places, our output has nothing of it, and no process is left."""
    monkeypatch.chdir(tmp_path)
    assert outcome(hostile, f"{way}_DoStep", Path("out")) == ""
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["run.json", "run.parquet"]
    assert Path.cwd() == tmp_path
    assert capfd.readouterr() == ("", "")
    assert not [pid for pid in children(os.getpid()) if b"guest_process" in command_of(pid)]


@pytest.mark.acceptance
def test_not_a_number_and_the_last_words(hostile: Path, tmp_path: Path) -> None:
    message = outcome(hostile, "nan_DoStep", tmp_path / "nan")
    assert "FMU 'nan_DoStep' (Hostile.fmu): Real_out is nan at 0.3 s" in message
    message = outcome(hostile, "abort_DoStep", tmp_path / "abort")
    assert "fmi2DoStep at 0.2 s crashed (SIGABRT): the valve is stuck" in message


@pytest.mark.first(1)
@pytest.mark.parametrize("call", ["Instantiate", "DoStep", "GetReal"])
@pytest.mark.parametrize("way", ["garbage", "long", "short", "deep"])
def test_what_it_writes_into_its_reply_ends_its_run_only(hostile: Path, tmp_path: Path, way: str, call: str) -> None:
    message = outcome(hostile, f"{way}_{call}", tmp_path / "out")
    assert message.startswith(f"FMU '{way}_{call}' (Hostile.fmu): "), message
    assert "sent a reply that cannot be read" in message


@pytest.mark.first(1)
@pytest.mark.parametrize("call", ["Instantiate", "SetReal", "DoStep", "GetReal"])
def test_a_progress_file_that_it_cuts_short_does_not_end_us(hostile: Path, tmp_path: Path, call: str) -> None:
    message = outcome(hostile, f"truncate_{call}", tmp_path / "out")
    assert message.startswith(f"FMU 'truncate_{call}' (Hostile.fmu): "), message


@pytest.mark.first(1)
@pytest.mark.parametrize("name", ["fork_Instantiate", "fork_DoStep", "fork_Terminate", "forkexit_DoStep"])
def test_processes_that_it_has_begun_end_with_it(
    hostile: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    message = outcome(hostile, name, tmp_path / "out")
    assert ("ended its process" in message) == name.startswith("forkexit")
    time.sleep(0.1)
    assert not [place for place in _working_folders() if place.startswith(str(tmp_path))]


def _working_folders() -> list[str]:
    """Return the working folders of the processes that this user may inspect."""
    folders = []
    for link in Path("/proc").glob("[0-9]*/cwd"):
        with suppress(OSError):
            folders.append(str(link.readlink()))
    return folders


@pytest.mark.first(1)
@pytest.mark.parametrize("call", ["Instantiate", "ExitInitializationMode", "DoStep"])
def test_its_memory_has_a_limit(hostile: Path, tmp_path: Path, call: str) -> None:
    assert re.search("failed|ended with Error", outcome(hostile, f"memory_{call}", tmp_path / "out"))


@pytest.mark.acceptance
def test_more_calls_before_a_step_than_a_byte_counts(hostile: Path, tmp_path: Path) -> None:
    """Make 300 connections into one guest whose step fails: the step is named."""
    many = "".join(
        f'<ScalarVariable name="u{k}" valueReference="0" causality="input" variability="continuous">'
        '<Real start="0"/></ScalarVariable>'
        for k in range(300)
    ).encode()

    def change(name: str, content: bytes) -> tuple[str, bytes]:
        return name, content.replace(b"</ModelVariables>", many + b"</ModelVariables>")

    rewritten(hostile / "Hostile.fmu", tmp_path / "Hostile.fmu", change)
    connections = wires(*(f"good.Real_out -> none_DoStep.u{k}" for k in range(300)))
    fmus = {name: {"fmu": "Hostile.fmu"} for name in ("good", "none_DoStep")}
    table = run_of_guests(tmp_path, fmus, connections=connections, run={"stop_s": 0.5, "step_s": 0.1}).table
    assert table.height == 6


@pytest.mark.acceptance
def test_the_command_says_it_with_a_status_that_is_not_zero(hostile: Path, tmp_path: Path) -> None:
    def simulated(name: str, *options: str) -> subprocess.CompletedProcess[str]:
        write_scenario(scenario(hostile, **hostile_scenario(hostile, name)), hostile / f"{name}.toml")
        command = [sys.executable, "-m", "trihedron.tools.cli", "simulate", str(hostile / f"{name}.toml"), *options]
        return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)

    process = simulated("exit_DoStep")
    assert (process.returncode, process.stdout, process.stderr.count("\n")) == (2, "", 1)
    assert "fmi2DoStep at 0.2 s ended its process (exit status 0)" in process.stderr
    process = simulated("control_DoStep")
    assert process.returncode == 2
    assert process.stderr.rstrip("\n").isprintable(), process.stderr
    assert "stuck" in process.stderr
    process = simulated("printf_DoStep", "--json", "-")
    assert json.loads(process.stdout)["schema"] == "trihedron.simulation/1"


def test_who_asks_for_it_has_it_in_our_process(hostile: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def ran(name: str, **options: Any) -> None:
        library.simulate(scenario(hostile, **hostile_scenario(hostile, name)), **options)

    ran("printf_DoStep", in_process=True)
    assert "nonsense" in capfd.readouterr().out
    with pytest.raises(InputError, match=r"fmi2DoStep at 0\.2 s did not return within 0\.5 s"):
        ran("hang_DoStep", call_limit=0.5)
    with pytest.raises(InputError, match=r"--call-limit: 0\.0 must be greater than 0 s"):
        ran("none_DoStep", call_limit=0.0)


def test_a_guest_gives_the_same_bits(foreign: Path) -> None:
    """Strings, integers, restored states, and inputs that go around are the same as in our own process."""
    fmus = {"clock": CLOCK, "one": GAIN, "sum": ACCUMULATOR, "fails": FAILING}
    connections = wires("clock.ended -> one.u[1]", "one.y[1] -> sum.increment")
    tables = [
        run_of_guests(
            foreign, fmus, connections=connections, run={"stop_s": 5.0, "step_s": 0.01, "in_process": folder}
        ).table
        for folder in (True, False)
    ]
    assert tables[0].equals(tables[1])


@pytest.mark.acceptance
@pytest.mark.parametrize("coupling", ["iterate", "jacobi"])
def test_a_guest_in_a_cycle_gives_the_same_bits(hostile: Path, coupling: str) -> None:
    tables = []
    for folder in (True, False):
        cycle = hostile_scenario(hostile, "none_SetFMUstate", in_process=folder, coupling=coupling)
        tables.append(run_scenario(scenario(hostile, cycle.pop("fmus"), **cycle)).table)
    assert tables[0].equals(tables[1])
    # y = u / 2 + t, twice around: y = 2 t; taken as Jacobi it is late.
    settled = np.array(tables[0]["good.Real_out"]) - 2 * np.array(tables[0]["time_s"])
    assert (np.abs(settled).max() < 1e-9) == (coupling == "iterate")


@pytest.mark.parametrize("reference", ["-1", "4294967296"])
def test_a_value_reference_that_is_none(hostile: Path, tmp_path: Path, reference: str) -> None:
    """Taken modulo 2^32 it would silently be another variable's."""

    def change(name: str, content: bytes) -> tuple[str, bytes]:
        message = f'"Real_in" valueReference="{reference}"'.encode()
        return name, content.replace(b'"Real_in" valueReference="0"', message)

    rewritten(hostile / "Hostile.fmu", tmp_path / "Hostile.fmu", change)
    with pytest.raises(InputError, match=rf"variable 'Real_in': its value reference {reference} does not fit 32 bits"):
        run_of_guests(tmp_path, {"x": {"fmu": "Hostile.fmu"}})


@pytest.mark.parametrize(
    ("option", "value", "printed"),
    [
        ("step", 0.0, "must be greater than 0 s"),
        ("step", -0.1, "must be greater than 0 s"),
        ("step", float("nan"), "must be a finite number"),
        ("start", float("inf"), "must be a finite number"),
        ("stop", float("nan"), "must be a finite number"),
    ],
)
def test_times_that_make_no_run_of_an_fmu(hostile: Path, option: str, value: float, printed: str) -> None:
    times: dict[str, Any] = {option: value}
    with pytest.raises(InputError, match=rf"^--{option} .*: {printed}"):
        library.simulate(hostile / "Hostile.fmu", **times)
