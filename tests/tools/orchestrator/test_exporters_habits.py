"""FMUs of our own, each with a habit of a real exporter: the right result, or a refusal with its reason."""

import math
from pathlib import Path

import pytest

from foreign_fmus.habits import Habit, build_habit
from scenario_runs import run_of_guests
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Simulation

INTERFACES = ("ModelExchange", "CoSimulation")
EVERY = [(version, interface) for version in (2, 3) for interface in INTERFACES]
RUN = {"stop_s": 1.0, "step_s": 0.1}
CLOCK = "intervalVariability='constant' intervalDecimal='0.25'"


def run_of(habit: Habit, version: int, interface: str, folder: Path, **sections: object) -> Simulation:
    """Run an FMU of a habit with u = 1 and k = 2."""
    name = build_habit(habit, version, interface, folder).name
    fmu = {"fmu": name, "parameters": {"k": 2.0, "u": 1.0, "d": 3.0}, **dict(sections.pop("fmu", {}))}
    return run_of_guests(folder, {"plant": fmu}, **{"run": RUN, **sections})


def exact(time: float, rate: float = 2.0) -> float:
    """Return the solution of x' = 1 - k x, x(0) = 0."""
    return (1.0 - math.exp(-rate * time)) / rate


@pytest.mark.parametrize(("version", "interface"), EVERY)
@pytest.mark.parametrize(
    "habit",
    [
        Habit("strict"),
        Habit("late", ("LATE",)),
        Habit("fixed", ("FIXED",), "canHandleVariableCommunicationStepSize='false'"),
        Habit("inside", ("INTERNAL",)),
        Habit("tolerant", experiment="<DefaultExperiment tolerance='1e-8'/>"),
    ],
    ids=lambda habit: habit.name,
)
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
