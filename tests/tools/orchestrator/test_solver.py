"""The solver for an FMU of model exchange: inputs, events of state and of time, failures; exact solutions, too."""

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from foreign_fmus import compile_foreign
from scenario_runs import ACCUMULATOR, CLOCK, GAIN, refusal, run_of_guests, wires

VARIABLES = {
    "u": 'causality="input" variability="continuous"><Real start="0"/>',
    "x": 'causality="output" variability="continuous"><Real/>',
    "n": 'causality="output" variability="discrete"><Real/>',
    "m": 'causality="output" variability="discrete"><Real/>',
    "way": 'causality="parameter" variability="fixed"><Integer start="0"/>',
    "der": 'variability="continuous"><Real derivative="2"/>',
}
PLANT = {"fmu": "Exchanged.fmu", "tolerance": 1e-9}


@pytest.fixture(scope="module")
def plants(tmp_path_factory: pytest.TempPathFactory, foreign: Path) -> Path:
    """Return a folder with the FMU, and foreign ones for co-simulation."""
    folder = tmp_path_factory.mktemp("exchanged")
    states = '<Derivatives><Unknown index="6"/></Derivatives>'
    compile_foreign("exchanged", folder, VARIABLES, "ModelExchange", 'numberOfEventIndicators="1"', states)
    for name in ("Gain", "Clock", "Accumulator"):
        shutil.copy(foreign / f"{name}.fmu", folder)
    return folder


@pytest.mark.acceptance
def test_a_driven_plant_with_events_of_state_and_of_time(plants: Path) -> None:
    """x' = u - x with u = 1 to 1 s, then 0, is exactly solvable; in a scenario, one FMU reads time, another adds."""
    fmus = {"gain": {**GAIN, "parameters": {"gain": 1.0}}, "plant": PLANT, "sum": ACCUMULATOR}
    rows = {"table": {"time_s": [0.0, 1.0], "u": [1.0, 0.0]}, "columns": {"gain.u[1]": "u"}}
    wired = wires("gain.y[1] -> plant.u", "plant.x -> sum.increment")
    for folder in (False, True):
        setting = {"stop_s": 2.0, "step_s": 0.1, "in_process": folder}
        table = run_of_guests(plants, fmus, run=setting, connections=wired, stimuli=[rows]).table
        times = table["time_s"].to_numpy()
        top = 1.0 - math.exp(-1.0)
        expected = np.where(times <= 1.0, 1.0 - np.exp(-times), top * np.exp(1.0 - times))
        assert np.abs(table["plant.x"].to_numpy() - expected).max() < 1e-8
        assert table["plant.n"].to_list() == [float(t > math.log(2.0)) for t in times]
        assert table["plant.m"].to_list() == [float(t >= 0.35) for t in times]
        assert table["sum.total"][-1] == pytest.approx(expected[1:].sum(), abs=1e-7)


def test_the_tolerance_decides_the_error(plants: Path) -> None:
    errors = []
    for tolerance in (1e-3, 1e-5, 1e-7):
        fmus = {"plant": {**PLANT, "tolerance": tolerance, "parameters": {"u": 1.0}}}
        table = run_of_guests(plants, fmus, run={"stop_s": 2.0, "step_s": 2.0}).table
        errors.append(abs(table["plant.x"][-1] - (1.0 - math.exp(-2.0))))
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2] > 0.0
    assert errors[2] < 1e-5


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("way", "says"),
    [
        (1, r"FMU 'plant' \(Exchanged.fmu\): fmi2DoStep at 0.2 s .*: fmi2GetDerivatives ended with status 3"),
        (2, r"FMU 'plant' \(Exchanged.fmu\): fmi2DoStep at 0.2 s ended with Error: "),
        (3, r"FMU 'plant' \(Exchanged.fmu\): fmi2DoStep at 0.2 s crashed \(SIGABRT\)"),
        (4, r"fmi2DoStep at 0.3 s ended with Error: an event at 0.35 s does not come to its end"),
    ],
)
def test_its_failures_are_named(plants: Path, way: int, says: str) -> None:
    message = refusal(plants, {"plant": {**PLANT, "parameters": {"way": way, "u": 1.0}}, "clock": CLOCK})
    assert re.search(says, message), message


def test_what_does_not_go_with_it_is_refused(plants: Path) -> None:
    message = refusal(plants, {"clock": {**CLOCK, "interface": "me"}})
    assert message == "Clock.fmu: has no model exchange; --interface cs may be there"
    fmus, around = {"plant": PLANT, "gain": GAIN}, wires("plant.x -> gain.u[1]", "gain.y[1] -> plant.u")
    message = refusal(plants, fmus, connections=around, run={"stop_s": 1.0, "step_s": 0.1, "coupling": "iterate"})
    assert "'plant' (Exchanged.fmu) cannot get and set its state" in message


@pytest.mark.acceptance
def test_shorter_steps_do_not_increase_the_error(plants: Path) -> None:
    """CVODE continues over the steps: x' = u - x with a thousand steps is as good as with one."""
    errors = []
    for step in (1.0, 0.1, 0.001):
        fmus = {"plant": {**PLANT, "tolerance": 1e-6, "parameters": {"u": 1.0}}}
        table = run_of_guests(plants, fmus, run={"stop_s": 1.0, "step_s": step}).table
        errors.append(abs(table["plant.x"][-1] - (1.0 - math.exp(-1.0))))
    assert max(errors) < 5e-6
    assert max(errors[1:]) <= 1.5 * errors[0]
