"""The orchestrator against a loop written with FMPy's own API: the same numbers, to the last bit."""

import shutil
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario

STEP, STEPS = 0.1, 1500
PARAMETERS = {
    "TurntableMotion": {"kappa": 1e-3, "seed": 7, "encoder_fluctuation_bound": 4.8e-6},
    "AccelerometerBlock": {},
    "AttitudeComputer": {},
}
COMMANDS = [(0, [0.35, 0.44]), (400, [1.13, 2.53]), (900, [-0.6, 4.6])]
WIRES = [  # producer, output, consumer, input; type; elements
    ("TurntableMotion", "specific_force", "AccelerometerBlock", "specific_force", "Real", 3),
    ("TurntableMotion", "dwell", "AccelerometerBlock", "dwell", "Integer", 0),
    ("TurntableMotion", "increment", "AttitudeComputer", "increment", "Real", 3),
]
WATCHED = {
    "TurntableMotion": ["angle_reading[1]", "angle_reading[2]"],
    "AccelerometerBlock": ["reading[1]", "reading[2]", "reading[3]"],
    "AttitudeComputer": ["attitude[1]", "attitude[2]", "attitude[3]", "attitude[4]"],
}


def names(base: str, count: int) -> list[str]:
    return [f"{base}[{i + 1}]" for i in range(count)] if count else [base]


def plain_loop(folder: Path) -> list[list[float]]:
    """Couple the three FMUs by hand."""
    slaves, references, folders = {}, {}, []
    for name, parameters in PARAMETERS.items():
        description = fmpy.read_model_description(folder / f"{name}.fmu")
        references[name] = {v.name: v.valueReference for v in description.modelVariables}
        folders.append(fmpy.extract(folder / f"{name}.fmu"))
        identifier = description.coSimulation.modelIdentifier  # type: ignore[union-attr]
        slaves[name] = slave = FMU2Slave(
            guid=description.guid, unzipDirectory=folders[-1], modelIdentifier=identifier, instanceName=name
        )
        slave.instantiate()
        for key, value in parameters.items():
            (slave.setInteger if key == "seed" else slave.setReal)([references[name][key]], [value])
        slave.setupExperiment(startTime=0.0, stopTime=STEPS * STEP)

    def refs(name: str, variables: list[str]) -> list[int]:
        return [references[name][v] for v in variables]

    def pass_on(consumer: str) -> None:
        for a, output, b, target, kind, count in WIRES:
            if b == consumer:
                values = getattr(slaves[a], f"get{kind}")(refs(a, names(output, count)))
                getattr(slaves[b], f"set{kind}")(refs(b, names(target, count)), values)

    def command(k: int) -> None:
        current = [angles for begin, angles in COMMANDS if begin <= k][-1]
        slaves["TurntableMotion"].setReal(refs("TurntableMotion", names("command", 2)), current)

    def watched() -> list[float]:
        return [v for name, found in WATCHED.items() for v in slaves[name].getReal(refs(name, found))]

    for name, slave in slaves.items():
        slave.enterInitializationMode()
        command(0)
        pass_on(name)
    for slave in slaves.values():
        slave.exitInitializationMode()
    for name in slaves:
        pass_on(name)
    rows = [watched()]
    for k in range(STEPS):
        command(k)
        for name, slave in slaves.items():
            pass_on(name)
            slave.doStep(k * STEP, STEP)
        rows.append(watched())
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
    for unpacked in folders:
        shutil.rmtree(unpacked)
    return rows


def test_the_orchestrator_gives_the_numbers_of_a_plain_loop(fmu_folder: Path) -> None:
    rows = {
        "time_s": [k * STEP for k, _ in COMMANDS],
        "a": [c[0] for _, c in COMMANDS],
        "b": [c[1] for _, c in COMMANDS],
    }
    scenario = Scenario.model_validate(
        {
            "run": {"stop_s": STEPS * STEP, "step_s": STEP},
            # Not in the order in which they must step.
            "fmus": {n: {"component": n, "parameters": PARAMETERS[n]} for n in reversed(PARAMETERS)},
            "connections": [{"from": f"{a}.{o}", "to": f"{b}.{t}"} for a, o, b, t, _, _ in WIRES],
            "stimuli": [
                {
                    "table": {"time_s": rows["time_s"], "a_rad": rows["a"], "b_rad": rows["b"]},
                    "columns": {"TurntableMotion.command[1]": "a_rad", "TurntableMotion.command[2]": "b_rad"},
                }
            ],
        }
    )
    table = simulate(scenario).table
    suffixes = {"TurntableMotion": "_rad", "AccelerometerBlock": "_mps2", "AttitudeComputer": ""}
    columns = [f"{fmu}.{v}{suffixes[fmu]}" for fmu, found in WATCHED.items() for v in found]
    expected = np.array(plain_loop(fmu_folder))
    found = table.select(columns).to_numpy()
    assert np.ptp(expected, axis=0).min() > 1e-3
    assert (found == expected).all()
