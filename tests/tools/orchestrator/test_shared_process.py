"""One process for all foreign FMUs: the rows of separate processes, and every failure with its reason."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from foreign_fmus.habits import Habit, build_habit
from scenario_runs import run_of_guests, wires
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import PreparedScenario, Simulation, shared_process

RUN = {"stop_s": 1.0, "step_s": 0.1}
VARYING = "canHandleVariableCommunicationStepSize='true'"


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run even short runs in one process."""
    monkeypatch.setattr(shared_process, "WORTH_EXCHANGES", 1)


def chain(folder: Path, *macros: str, **run: object) -> Simulation:
    """Run two FMUs, where one drives the other; the second has the macros."""
    first = build_habit(Habit("first"), 2, "CoSimulation", folder)
    second = build_habit(Habit("second", macros), 3, "CoSimulation", folder)
    fmus = {
        "first": {"fmu": first.name, "parameters": {"u": 1.0, "k": 2.0}},
        "second": {"fmu": second.name, "parameters": {"k": 0.5}},
    }
    return run_of_guests(folder, fmus, run={**RUN, **run}, connections=wires("first.x -> second.u"))


@pytest.mark.acceptance
def test_the_rows_are_those_of_separate_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    separate = chain(tmp_path).table
    monkeypatch.setattr(shared_process, "WORTH_EXCHANGES", 1)
    monkeypatch.setattr(shared_process, "run_fmus", None)
    assert chain(tmp_path).table.equals(separate)


@pytest.mark.acceptance
@pytest.mark.usefixtures("always")
def test_each_failure_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"FMU 'second' \(second3C.fmu\): fmi3DoStep at 0.5 s crashed \(SIGABRT\)"):
        chain(tmp_path, "DEADLY")
    with pytest.raises(InputError, match=r"fmi3DoStep at 0.5 s ended with Error: it will not go on"):
        chain(tmp_path, "DEAF")
    with pytest.raises(InputError, match=r"second.*: y is nan at 0.6 s; to run all the same: --allow-nan"):
        chain(tmp_path, "NOT_A_NUMBER")
    assert "y is" not in str(chain(tmp_path, "NOT_A_NUMBER", allow_nan=True).notes)


@pytest.mark.acceptance
@pytest.mark.usefixtures("always")
def test_what_an_fmu_writes_to_the_pipe_is_no_row(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"FMU 'second' .* sent a reply that cannot be read"):
        chain(tmp_path, "TALKING")


@pytest.mark.acceptance
@pytest.mark.usefixtures("always")
def test_rows_before_a_failure_are_kept_once(tmp_path: Path) -> None:
    first = build_habit(Habit("deadly", ("DEADLY",)), 2, "CoSimulation", tmp_path)
    rows: list[float] = []
    scenario = run_of_guests(tmp_path, {"a": {"fmu": first.name}}, run={"stop_s": 0.4, "step_s": 0.1}).scenario
    long = scenario.model_copy(update={"run": scenario.run.model_copy(update={"stop_s": 1.0})})
    prepared = PreparedScenario(long)
    with pytest.raises(InputError, match="crashed"):
        shared_process.run_in_one_process(prepared.assemble({}), lambda table, _: rows.extend(table["time_s"]))
    prepared.close()
    assert rows == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


@pytest.mark.skipif(sys.platform == "win32", reason="skipped: no signals")
def test_an_interrupted_run_keeps_its_rows(tmp_path: Path) -> None:
    fmu = build_habit(Habit("long", (), VARYING), 2, "CoSimulation", tmp_path)
    command = [sys.executable, "-m", "trihedron", "simulate", str(fmu), "--stop", "1e9", "--step", "1", "--out", "o"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "o").exists():
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, text = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "o/run.csv has the run up to" in text
