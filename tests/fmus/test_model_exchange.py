"""HarmonicMotion and TurntableMotion in model exchange: the numbers of co-simulation, events where moves change."""

import ctypes as ct
from itertools import product
from pathlib import Path

import fmpy
import numpy as np
import pytest
from packaging.version import Version

from component_kinds import elements_of
from native_driver import ERROR, OK, Library
from native_model import Model, open_fmu
from trihedron.fmus import build, components, host_compiler

pytestmark = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")

EXCHANGED = ("HarmonicMotion", "TurntableMotion")
LIMITS = {"max_rate": [0.5, 0.5], "max_acceleration": [0.5, 0.5]}
COMMANDS = [(0.0, 1.0, 0.0), (4.5, 0.3, -0.7), (5.0, 0.3, -0.7)]
"""Time, and commands of both axes from then on: the second comes while the table rests."""


class Info2(ct.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        *((name, ct.c_int) for name in ("needed", "terminate", "nominals", "values", "defined")),
        ("time", ct.c_double),
    )


class Exchange:
    """An instance for model exchange, past its initialisation."""

    def __init__(self, name: str, fmi: int, folder: Path, values: dict[str, list[float]] | None = None) -> None:
        path = build(name, folder, flavour="native", fmi=fmi)
        self.library: Library = open_fmu(path, folder / "unpacked")
        component = components()[name]
        self.model = Model(self.library, component, made(self.library))
        assert self.model.instance is not None, self.library.log
        for variable, every in (values or {}).items():
            assert self.model.set(variable, every) == OK, self.library.log
        self.library.start(self.model.instance)

    def call(self, name: str, *arguments) -> int:
        return self.library.call(name, self.model.instance, *arguments)

    def update(self) -> float | None:
        """Update discrete states; return the time of the next event."""
        if self.library.fmi == 2:
            info = Info2()
            assert self.call("NewDiscreteStates", ct.byref(info)) == OK, self.library.log
            assert not any((info.needed, info.terminate, info.nominals, info.values))
            return info.time if info.defined else None
        flags, time = [ct.c_bool(True) for _ in range(5)], ct.c_double()
        assert self.call("UpdateDiscreteStates", *(ct.byref(f) for f in flags), ct.byref(time)) == OK
        assert not any(f.value for f in flags[:4])
        return time.value if flags[4].value else None

    def flow(self) -> None:
        assert self.call("EnterContinuousTimeMode") == OK, self.library.log

    def go(self, time: float) -> int:
        return self.call("SetTime", ct.c_double(time))

    def complete(self) -> bool:
        """End a step of the integrator; return True if it asks for event mode."""
        kind = ct.c_int if self.library.fmi == 2 else ct.c_bool
        enter, end = kind(), kind()
        assert self.call("CompletedIntegratorStep", kind(True), ct.byref(enter), ct.byref(end)) == OK, self.library.log
        assert not end.value
        return bool(enter.value)


def made(library: Library) -> int | None:
    """Return an instance for model exchange, None if it is refused."""
    if library.fmi == 2:
        return library.instantiate(b"model", kind=0)
    no, yes = ct.c_bool(False), ct.c_bool(True)
    create = library.function("InstantiateModelExchange", ct.c_void_p)
    return create(b"model", library.token, b"", no, yes, None, library.logger)


def columns(rows) -> dict[str, np.ndarray]:
    """Return a column for each element of FMPy's result, by time; the last of several rows of one time."""
    last = {round(float(row["time"]), 9): row for row in rows}
    flat = [[x for value in row for x in np.atleast_1d(value)] for row in last.values()]
    return {str(i): column for i, column in enumerate(np.array(flat, dtype=float).T)}


@pytest.mark.parametrize("solver", ["Euler", "CVode"])
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", EXCHANGED)
def test_fmpy_gets_the_numbers_of_co_simulation(name, fmi, solver, tmp_path):
    if name == "TurntableMotion" and Version(fmpy.__version__) < Version("0.3.27"):
        pytest.skip("the loop of FMPy before 0.3.27 goes back in time after a time event")
    path = build(name, tmp_path, flavour="native", fmi=fmi)
    component = components()[name]
    values: dict[str, object] = {}
    inputs, output_names = None, [v.name for v in component.interface if v.causality == "output"]
    if name == "TurntableMotion":
        elements = [f"{name}[{i}]" for name, i in product(LIMITS, (1, 2))]
        values = dict.fromkeys(elements, 0.5) if fmi == 2 else dict.fromkeys(LIMITS, "0.5 0.5")
        at, alpha, beta = np.array(COMMANDS).T
        if fmi == 2:
            kinds = [("time", float), ("command[1]", float), ("command[2]", float)]
            inputs = np.array(list(zip(at, alpha, beta, strict=True)), dtype=kinds)
        else:
            # FMPy reads no discrete arrays: one command, from the start.
            values["command"] = "1.0 -0.3"
        # Values at the end of a step, and its length, belong to another step if events cut it.
        output_names = ["angle", "rate", "specific_force", "attitude", "attitude_inertial"]
    if fmi == 2:
        variables = elements_of(component, "output")
        output_names = [element for element, v in variables.items() if v.name in output_names]
    run = {"stop_time": 6.0, "output_interval": 0.125, "start_values": values, "input": inputs, "output": output_names}
    stepped = columns(fmpy.simulate_fmu(path, fmi_type="CoSimulation", **run))
    flown = columns(fmpy.simulate_fmu(path, fmi_type="ModelExchange", solver=solver, step_size=0.125, **run))
    times = np.isin(np.round(flown["0"], 9), stepped["0"])
    if solver == "CVode" and name == "TurntableMotion":
        assert len(flown["0"]) > len(stepped["0"])
    assert times.sum() == len(stepped["0"])
    largest = max(float(np.abs(flown[k][times] - stepped[k]).max()) for k in stepped)
    assert largest < 1e-13


@pytest.mark.parametrize("fmi", [2, 3])
def test_events_come_where_a_move_changes_and_where_a_rest_begins(fmi, tmp_path):
    """1 rad with 0.5 rad/s and 0.5 rad/s²: speeding up, cruising and braking for one second each."""
    table = Exchange("TurntableMotion", fmi, tmp_path, LIMITS)
    assert table.update() is None
    assert table.model.set("command", [1.0, 0.0]) == OK
    by = {v.name: v for v in table.model.component.interface}
    for k in (1, 2, 3):
        event = table.update()
        assert event is not None
        assert event == pytest.approx(k, abs=1e-12)
        table.flow()
        assert table.go(event - 0.4) == OK
        assert not table.complete()
        assert table.model.get(by["at_rest"]) == [0.0]
        assert table.go(event) == OK
        assert not table.complete()
        assert table.call("EnterEventMode") == OK
    assert table.model.get(by["at_rest"]) == [1.0]
    assert table.model.get(by["dwell"]) == [2.0]
    assert table.model.get(by["angle"]) == pytest.approx([1.0, 0.0], abs=1e-15)
    assert table.update() is None
    # A command in continuous time brings events, which are requested.
    table.flow()
    assert table.model.set("command", [0.0, 0.0]) == OK
    assert table.go(4.0) == OK
    assert table.complete()


@pytest.mark.first(2)
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", EXCHANGED)
def test_a_time_that_was_tried_changes_nothing(name, fmi, tmp_path):
    straight, trial = (Exchange(name, fmi, tmp_path / part, LIMITS if "Table" in name else {}) for part in "ab")
    for state in (straight, trial):
        if "Table" in name:
            assert state.model.set("command", [1.0, -0.3]) == OK
        state.update()
        state.flow()
    for k in range(1, 6):
        for time in (0.9 * k, 0.4 * k + 0.1, 0.41 * k):
            assert trial.go(time) == OK
            trial.model.outputs()
        saved = trial.library.save(trial.model.instance)
        assert trial.go(0.9 * k) == OK
        trial.complete()
        assert trial.library.restore(trial.model.instance, saved) == OK
        for state in (straight, trial):
            assert state.go(0.4 * k) == OK
            state.complete()
        assert trial.model.outputs() == straight.model.outputs()
    before = trial.model.outputs()
    assert trial.go(1.0) == ERROR
    assert trial.model.outputs() == before


@pytest.mark.parametrize("fmi", [2, 3])
def test_each_kind_of_instance_refuses_what_is_of_the_other(fmi, tmp_path):
    harmonic = Exchange("HarmonicMotion", fmi, tmp_path / "harmonic")
    library, instance = harmonic.library, harmonic.model.instance
    stepped = library.instantiate(b"stepped")
    library.start(stepped)
    assert library.step(instance, 0.0, 0.1) == ERROR
    for name in ("EnterEventMode", "EnterContinuousTimeMode"):
        assert library.call(name, stepped) == ERROR
    assert library.restore(stepped, library.save(instance)) == ERROR
    assert library.restore(instance, library.save(stepped)) == ERROR
    harmonic.update()
    harmonic.flow()
    assert harmonic.model.set("psi_amplitude", [0.1] * 4) == ERROR
    states = "GetDerivatives" if fmi == 2 else "GetContinuousStateDerivatives"
    assert harmonic.call(states, None, ct.c_size_t(0)) == OK
    assert harmonic.call(states, None, ct.c_size_t(1)) == ERROR
    assert harmonic.call("Terminate") == OK
    path = build("AccelerometerBlock", tmp_path / "block", flavour="native", fmi=fmi)
    block = open_fmu(path, tmp_path / "block" / "unpacked")
    assert made(block) is None
    assert "co-simulation only" in block.log[-1][2]
