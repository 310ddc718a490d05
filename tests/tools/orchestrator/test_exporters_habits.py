"""FMUs of our own, each with a habit of a real exporter: the right result, or a refusal with its reason."""

import math
import re
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import pytest

from foreign_fmus.habits import Habit, build_habit
from scenario_runs import run_of_guests
from trihedron.tools import library
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Simulation

INTERFACES = ("ModelExchange", "CoSimulation")
EVERY = [(version, interface) for version in (2, 3) for interface in INTERFACES]
RUN = {"stop_s": 1.0, "step_s": 0.1}
VARYING = "canHandleVariableCommunicationStepSize='true'"
LATIN = (
    ("<fmiModelDescription ", "<?xml version='1.0' encoding='ISO-8859-1'?><fmiModelDescription "),
    ("modelName='Strict'", "modelName='Stra\xdfe'"),
)
CLOCK = "intervalVariability='constant' intervalDecimal='0.25'"


def run_of(habit: Habit, version: int, interface: str, folder: Path, **sections: Any) -> Simulation:
    """Run an FMU of a habit with u = 1, k = 2 and d = 3."""
    name = build_habit(habit, version, interface, folder).name
    fmu = {"fmu": name, "parameters": {"k": 2.0, "u": 1.0, "d": 3.0}}
    return run_of_guests(folder, {"plant": fmu}, **{"run": RUN, **sections})


def exact(time: float, rate: float = 2.0) -> float:
    """Return the solution of x' = 1 - k x, x(0) = 0."""
    return (1.0 - math.exp(-rate * time)) / rate


RIGHT = [
    Habit("strict"),
    Habit("late", ("LATE",)),
    Habit("fixed", ("FIXED",), "canHandleVariableCommunicationStepSize='false'"),
    Habit("inside", ("INTERNAL",)),
    Habit("tolerant", experiment="<DefaultExperiment tolerance='1e-8'/>"),
    Habit("reading", ("READING",), files=(("resources/start.txt", "0.0"),)),
    Habit("printing", ("PRINTING",)),
    Habit("allocating", ("ALLOCATING",)),
    Habit("marked", encoding="utf-8-sig"),
    Habit("latin", changes=LATIN, encoding="latin-1"),
    Habit("beginning", changes=(("start='0'", ""),)),
    Habit("unitless", changes=((" start='0'", " start='0' unit='furlong'"),)),
]
"""Habits with the right result."""


def each_once() -> list[Any]:
    """Return every habit in one kind of FMU, the strict one in all; the acceptance tests take all kinds."""
    cases = []
    for number, habit in enumerate(RIGHT):
        for kind, (version, interface) in enumerate(EVERY):
            marks = [] if kind == number % len(EVERY) or habit.name == "strict" else [pytest.mark.acceptance]
            case = pytest.param(habit, version, interface, marks=marks, id=f"{habit.name}-{interface}-{version}")
            cases.append(case)
    return cases


@pytest.mark.first(1)
@pytest.mark.parametrize(("habit", "version", "interface"), each_once())
def test_every_call_is_made_in_a_mode_that_allows_it(
    habit: Habit, version: int, interface: str, tmp_path: Path
) -> None:
    table = run_of(habit, version, interface, tmp_path).table
    times = table["time_s"].to_list()
    assert table["plant.x"].to_list() == pytest.approx([exact(t) for t in times], abs=2e-5)
    assert table["plant.m"].to_list() == [float(t > 0.35) for t in times]
    assert set(table["plant.y"].to_list()) == {3.0}
    if interface == "CoSimulation":
        assert table["plant.steps"][-1] == 10.0


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_an_fmu_may_ask_for_the_end_of_the_run(version: int, interface: str, tmp_path: Path) -> None:
    """It asks at 0.5 s, or at the solver's first step beyond 0.45 s: then the record ends at 0.4 s."""
    run = run_of(Habit("ending", ("ENDING=0.45",)), version, interface, tmp_path)
    end_s = float(re.findall(r"^FMU 'plant' \(ending\S+\) ended the run at (\S+) s", run.ended)[0])
    assert 0.45 < end_s <= 0.5
    assert run.final_time_s == pytest.approx(0.5 if end_s == 0.5 else 0.4)
    assert run.table["plant.x"][-1] == pytest.approx(exact(run.final_time_s), abs=2e-5)
    if interface == "ModelExchange":
        run = run_of(Habit("ended", ("ENDING=-1.0",)), version, interface, tmp_path)
        assert " ended the run at 0 s" in run.ended
        assert run.table["time_s"].to_list() == [0.0]


@pytest.mark.acceptance
@pytest.mark.parametrize("nominal", [0.0, -1.0])
def test_a_nominal_value_of_a_state_may_be_unknown(nominal: float, tmp_path: Path) -> None:
    run = run_of(Habit("nominal", (f"NOMINAL={nominal}",)), 2, "ModelExchange", tmp_path)
    assert run.table["plant.x"][-1] == pytest.approx(exact(1.0), abs=2e-5)


REFUSED = {
    "choosy": ("Instantiate failed: it was made for another description", EVERY),
    "parting": ("Terminate at 1 s crashed", EVERY),
    "pending": ("DoStep at 0.5 s ended with Pending", [(2, "CoSimulation"), (3, "CoSimulation")]),
    "discarding": ("DoStep at 0.5 s ended with Discard", [(2, "CoSimulation"), (3, "CoSimulation")]),
    "hasty": ("fmi3DoStep at 0 s returned before the end of the step", [(3, "CoSimulation")]),
}
"""Habits, the reason of their refusal, and the interfaces that can have them."""


@pytest.mark.parametrize("name", list(REFUSED))
def test_what_cannot_be_done_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    reason, kinds = REFUSED[name]
    for version, interface in kinds:
        with pytest.raises(InputError) as refused:
            run_of(Habit(name, (name.upper(),)), version, interface, tmp_path)
        assert reason in str(refused.value)


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_a_value_that_is_not_held_is_refused(version: int, interface: str, tmp_path: Path) -> None:
    for habit, held in ((Habit("lost", ("LOST",)), 1.0), (Habit("limited", ("LIMITED",)), 1.5)):
        with pytest.raises(InputError) as refused:
            run_of(habit, version, interface, tmp_path)
        assert f"1 of 1 given values are not held: k is {held} after 2.0 was set" in str(refused.value)
        assert "--accept-lost" in str(refused.value)
        run = run_of(habit, version, interface, tmp_path, run={**RUN, "accept_lost": True})
        assert run.table["plant.x"][-1] == pytest.approx(exact(1.0, held), abs=2e-5)
        (note,) = run.notes
        assert f"k is {held} after 2.0 was set" in note


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_no_step_passes_the_stop_time(version: int, interface: str, tmp_path: Path) -> None:
    """0.1 + 0.2 passes 0.3 by an ulp, and 0.4 s does not divide the run."""
    for step, stop in ((0.1, 0.3), (0.4, 1.0), (1 / 3, 1.0), (0.3, 0.7)):
        run = run_of(
            Habit("strict", (), VARYING),
            version,
            interface,
            tmp_path,
            run=RUN | {"stop_s": stop, "step_s": step, "shorten": True},
        )
        assert run.table["time_s"][-1] == pytest.approx(stop, abs=1e-15)
        assert run.table["plant.x"][-1] == pytest.approx(exact(stop), abs=2e-5)


@pytest.mark.acceptance
def test_a_last_step_is_shortened_only_for_an_fmu_that_allows_it(tmp_path: Path) -> None:
    fixed = build_habit(Habit("fixed", ("FIXED",)), 2, "CoSimulation", tmp_path)
    varying = build_habit(Habit("varying", (), VARYING), 2, "CoSimulation", tmp_path)
    run = library.simulate(fixed, stop=0.95, step=0.1)
    assert run.table["time_s"][-1] == pytest.approx(0.9)
    assert "the run ends at 0.9 s" in run.notes[0]
    run = library.simulate(varying, stop=0.95, step=0.1)
    assert run.table["time_s"].to_list()[-2:] == pytest.approx([0.9, 0.95], abs=1e-15)
    assert "the last step is 0.05 s long" in run.notes[0]


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_a_run_without_outputs_records_states(version: int, interface: str, tmp_path: Path) -> None:
    run = run_of(Habit("silent", without_outputs=True), version, interface, tmp_path)
    assert run.columns == ["time_s", "plant.x"]
    assert run.table["plant.x"][-1] == pytest.approx(exact(1.0), abs=2e-5)
    assert "no FMU has outputs: plant.x recorded" in run.notes[0]
    fmu = tmp_path / f"silent{version}{interface[:1]}.fmu"
    chosen = library.simulate(fmu, stop=1.0, step=0.1, record=["der(x)", "m"], values=["u=1"])
    assert chosen.columns == ["time_s", f"{fmu.stem}.der(x)", f"{fmu.stem}.m"]
    assert chosen.table[f"{fmu.stem}.der(x)"][0] == 1.0


@pytest.mark.parametrize(("version", "derivative"), [(2, " derivative='2'"), (3, " derivative='1'")])
def test_a_run_without_outputs_and_states_records_what_changes(version: int, derivative: str, tmp_path: Path) -> None:
    """A local variable that is fixed is left out."""
    fixed = ("name='m' valueReference='6' causality='local' variability='discrete'",) * 2
    changes = ((derivative, ""), (fixed[0], fixed[1].replace("discrete", "fixed")))
    run = run_of(Habit("mute", without_outputs=True, changes=changes), version, "CoSimulation", tmp_path)
    assert run.columns == ["time_s", "plant.x", "plant.der(x)", "plant.y", "plant.steps", "plant.ticks"]
    assert run.notes == (
        "no FMU has outputs: 5 states or local variables (plant.x, plant.der(x), plant.y, ...) recorded; choose with "
        "--record NAME",
    )


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_nan_ends_the_run_unless_it_is_allowed(version: int, interface: str, tmp_path: Path) -> None:
    habit = Habit("nan", ("NOT_A_NUMBER",))
    with pytest.raises(InputError, match=r"y is nan at 0.6 s; to run all the same: --allow-nan"):
        run_of(habit, version, interface, tmp_path)
    table = run_of(habit, version, interface, tmp_path, run={**RUN, "allow_nan": True}).table
    assert math.isnan(table["plant.y"][-1])
    assert table["plant.x"][-1] == pytest.approx(exact(1.0), abs=2e-5)


def test_a_missing_library_is_named_with_those_that_are_there(tmp_path: Path) -> None:
    for habit in (Habit("renamed", library="other"), Habit("elsewhere", platform="win64")):
        with pytest.raises(InputError) as refused:
            run_of(habit, 2, "CoSimulation", tmp_path)
        there = f"binaries/{habit.platform or fmpy.platform}/{habit.library}{fmpy.sharedLibraryExtension}"
        missing = f"binaries/{fmpy.platform}/strict{fmpy.sharedLibraryExtension} is missing"
        assert f"{missing}; it has {there}" in str(refused.value)


@pytest.mark.acceptance
@pytest.mark.parametrize("interface", INTERFACES)
def test_a_periodic_clock_ticks_on_the_grid(interface: str, tmp_path: Path) -> None:
    """It ticks at 0, 0.25, 0.5, 0.75 and 1 s; with a shift of 0.1 s four times; by counters as by decimals."""
    events = "hasEventMode='true' canReturnEarlyAfterIntermediateUpdate='true'"
    for clock, count in (
        (CLOCK, 5.0),
        (f"{CLOCK} shiftDecimal='0.1'", 4.0),
        ("intervalVariability='constant' intervalCounter='1' resolution='10'", 11.0),
    ):
        habit = Habit("clock", ("EVENTS",) if interface == "CoSimulation" else (), events, clock=clock, versions=(3,))
        for step in (0.1, 0.5):
            table = run_of(habit, 3, interface, tmp_path, run={"stop_s": 1.0, "step_s": step}).table
            assert table["plant.ticks"][-1] == count
            assert table["plant.x"][-1] == pytest.approx(exact(1.0), abs=2e-5)
            assert table["plant.m"][-1] == 1.0


def test_other_clocks_are_refused_by_name(tmp_path: Path) -> None:
    clocks = {"triggered": "is triggered; only constant periodic clocks tick", "constant": "cannot tick"}
    for variability, reason in clocks.items():
        attributes = f"intervalVariability='{variability}' intervalDecimal='0.1'"
        with pytest.raises(InputError) as refused:
            run_of(Habit("clock", clock=attributes), 3, "CoSimulation", tmp_path)
        assert "input clock 'clock'" in str(refused.value)
        assert reason in str(refused.value)


@pytest.mark.acceptance
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_a_table_of_inputs_is_read_as_fmpy_reads_it(version: int, interface: str, tmp_path: Path) -> None:
    fmu = build_habit(Habit("fed"), version, interface, tmp_path)
    table = tmp_path / "u.csv"
    table.write_text("time,u,d\n0,0,1\n0.5,0.5,2\n1,1,3\n")
    run = library.simulate(fmu, stop=1.0, step=0.001, inputs=table, tolerance=1e-8)
    # x' = t - x with x(0) = 0: the input holds over each step of 1 ms.
    assert run.table[f"{fmu.stem}.x"][-1] == pytest.approx(math.exp(-1.0), abs=1e-3)
    assert run.table[f"{fmu.stem}.y"].to_list()[::250] == [1.0, 1.0, 1.0, 2.0, 2.0]


def carried(rows: list[tuple[float, float]], time: float) -> float:
    """Return the solution of x' = u - x, x(0) = 0, for an input that is linear between rows."""
    x = 0.0
    for (begin, first), (end, last) in pairwise(rows):
        length = min(end, time) - begin
        if length > 0.0:
            slope, gone = (last - first) / (end - begin), math.exp(-length)
            x = x * gone + first * (1.0 - gone) + slope * (length - 1.0 + gone)
    return x


@pytest.mark.acceptance
@pytest.mark.parametrize("version", [2, 3])
def test_a_solver_takes_inputs_at_all_times(version: int, tmp_path: Path) -> None:
    """A ramp, a pulse between two steps, and a jump: the solution at the rows does not depend on the step."""
    fmu = build_habit(Habit("driven", (), VARYING), version, "ModelExchange", tmp_path)
    rows = [(0.0, 0.0), (0.3, 0.3), (0.305, 100.0), (0.31, 0.3), (0.6, -1.0), (0.6, 2.0), (2.0, 2.0)]
    table = tmp_path / "u.csv"
    table.write_text("time,u\n" + "".join(f"{time},{u}\n" for time, u in rows))
    for step in (0.5, 0.1, 0.01):
        run = library.simulate(fmu, stop=1.0, step=step, inputs=table)
        expected = [carried(rows, time) for time in run.table["time_s"]]
        assert run.table[f"{fmu.stem}.x"].to_list() == pytest.approx(expected, abs=1e-5)


@pytest.mark.first(1)
@pytest.mark.parametrize(("version", "interface"), EVERY)
def test_an_initial_value_of_a_state_may_be_set(version: int, interface: str, tmp_path: Path) -> None:
    begins = "variability='continuous' initial='exact'"
    changes = (
        ("variability='continuous'><Real />", f"{begins}><Real start='0'/>"),
        ("causality='output' variability='continuous' />", f"causality='output' {begins} start='0'/>"),
    )
    fmu = build_habit(Habit("begun", changes=changes), version, interface, tmp_path)
    run = library.simulate(fmu, stop=1.0, step=0.1, values=["x=3", "k=2"])
    expected = [3.0 * math.exp(-2.0 * time) for time in run.table["time_s"]]
    assert run.table[f"{fmu.stem}.x"].to_list() == pytest.approx(expected, abs=2e-5)
    with pytest.raises(InputError, match=r"m of 'begun.*' is output, not a parameter or an input"):
        library.simulate(fmu, values=["m=1"])


def test_a_run_in_real_time_takes_its_time(tmp_path: Path) -> None:
    """Half a second at twice real time takes a quarter; the rows are those of any run."""
    fmu = build_habit(Habit("paced"), 2, "CoSimulation", tmp_path)
    began = time.perf_counter()
    run = library.simulate(fmu, stop=0.5, step=0.05, realtime=2.0, in_process=True, values=["u=1", "k=2"])
    assert time.perf_counter() - began > 0.2
    assert run.table["paced2C.x"][-1] == pytest.approx(exact(0.5), abs=1e-12)
    assert "real time times 2: 10 steps of 25 ms, delay" in run.notes[-1]
    with pytest.raises(InputError, match=r"--realtime -1: must be greater than 0"):
        library.simulate(fmu, realtime=-1.0)
