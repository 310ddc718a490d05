"""The orchestrator against a plain FMPy loop on the same FMUs, in the same run."""

import gc
import time
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from trihedron.orchestrator.archive import unpack
from trihedron.orchestrator.bus import make_buses
from trihedron.orchestrator.connections import resolve_connections
from trihedron.orchestrator.grid import Grid
from trihedron.orchestrator.interface import interface_of
from trihedron.orchestrator.master import run_fmus
from trihedron.orchestrator.stimuli import resolve_constant
from trihedron.scenario import Connection, Stimulus

STEP, STEPS, ROUNDS = 0.01, 10_000, 3
NAMES = ("TurntableMotion", "AccelerometerBlock", "AttitudeComputer")
WIRES = (
    ("TurntableMotion", "specific_force", "AccelerometerBlock", "specific_force"),
    ("TurntableMotion", "increment", "AttitudeComputer", "increment"),
)
RECORDED = {
    "AccelerometerBlock": ("reading[1]", "reading[2]", "reading[3]"),
    "AttitudeComputer": ("attitude[1]", "attitude[2]", "attitude[3]", "attitude[4]"),
}
COMMAND = [0.7, -1.1]


def elements(base: str) -> list[str]:
    return [f"{base}[{i}]" for i in (1, 2, 3)]


def plain_loop(folder: Path, work: Path) -> tuple[float, np.ndarray]:
    """The loop as one writes it with FMPy: getReal and setReal with lists."""
    slaves, refs = {}, {}
    for name in NAMES:
        description = fmpy.read_model_description(folder / f"{name}.fmu")
        refs[name] = {v.name: v.valueReference for v in description.modelVariables}
        unpacked = fmpy.extract(folder / f"{name}.fmu", work / name)
        identifier = description.coSimulation.modelIdentifier  # type: ignore[union-attr]
        slave = FMU2Slave(guid=description.guid, unzipDirectory=unpacked, modelIdentifier=identifier, instanceName=name)
        slaves[name] = slave
        slave.instantiate()
        slave.setupExperiment(startTime=0.0, stopTime=STEPS * STEP)
    table, block, computer = (slaves[name] for name in NAMES)
    table.setReal([refs[NAMES[0]]["command[1]"], refs[NAMES[0]]["command[2]"]], COMMAND)
    force, increment = ([refs[NAMES[0]][v] for v in elements(b)] for b in ("specific_force", "increment"))
    force_in = [refs[NAMES[1]][v] for v in elements("specific_force")]
    increment_in = [refs[NAMES[2]][v] for v in elements("increment")]
    reading, attitude = ([refs[name][v] for v in found] for name, found in RECORDED.items())
    for initialise in ("enterInitializationMode", "exitInitializationMode"):
        for slave in slaves.values():
            getattr(slave, initialise)()
        block.setReal(force_in, table.getReal(force))
        computer.setReal(increment_in, table.getReal(increment))
    rows = [block.getReal(reading) + computer.getReal(attitude)]
    began = time.perf_counter()
    for k in range(STEPS):
        t = k * STEP
        table.doStep(t, STEP)
        block.setReal(force_in, table.getReal(force))
        block.doStep(t, STEP)
        computer.setReal(increment_in, table.getReal(increment))
        computer.doStep(t, STEP)
        rows.append(block.getReal(reading) + computer.getReal(attitude))
    elapsed = time.perf_counter() - began
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
    return elapsed, np.array(rows)


def orchestrator(folder: Path, work: Path) -> tuple[float, np.ndarray]:
    """The orchestrator's loop; setting up is left out, as it is for the plain loop."""
    fmus, interfaces = {}, {}
    for name in NAMES:
        fmus[name] = unpack(folder / f"{name}.fmu", name, lambda _, name=name: work / name)
        interfaces[name] = interface_of(name, name, fmus[name].description)
    wires = resolve_connections(
        [Connection.model_validate({"from": f"{a}.{output}", "to": f"{b}.{target}"}) for a, output, b, target in WIRES],
        interfaces,
    )
    drive = resolve_constant(Stimulus(to="TurntableMotion.command", constant=COMMAND), interfaces)
    recorded = {name: [interfaces[name].variables[v] for v in RECORDED.get(name, ())] for name in NAMES}
    buses = make_buses(NAMES, wires, [drive], recorded)
    marks = []

    def timed(ticks: range):
        marks.append(time.perf_counter())
        yield from ticks
        marks.append(time.perf_counter())

    values = run_fmus(NAMES, fmus, dict.fromkeys(NAMES, ()), buses, Grid(0.0, STEP, STEPS), 1, timed)
    rows = np.column_stack([values[name, v] for name, found in RECORDED.items() for v in found])
    return marks[1] - marks[0], rows


@pytest.mark.benchmark_ratio
def test_ratio_to_a_plain_fmpy_loop(fmu_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times: dict[str, list[float]] = {}
    numbers: dict[str, np.ndarray] = {}
    loops: tuple[Callable[[Path, Path], tuple[float, np.ndarray]], ...] = (plain_loop, orchestrator)
    for turn in range(ROUNDS):
        for loop in loops:
            gc.collect()
            elapsed, numbers[loop.__name__] = loop(fmu_folder, tmp_path / f"{loop.__name__}-{turn}")
            times.setdefault(loop.__name__, []).append(elapsed)
    assert numbers["orchestrator"].shape == (STEPS + 1, 7)
    assert (numbers["orchestrator"] == numbers["plain_loop"]).all()
    plain, ours = (1e6 * min(times[name]) / STEPS for name in ("plain_loop", "orchestrator"))
    with capsys.disabled():
        print(
            f"\nthree coupled FMUs, {STEPS} steps, best of {ROUNDS}: plain FMPy loop {plain:.2f} us a step, "
            f"orchestrator {ours:.2f} us a step, ratio {plain / ours:.2f}"
        )
