"""The cost of the master itself: three coupled native FMUs that compute almost nothing, seven recorded outputs."""

import gc
import subprocess
import time
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from trihedron.fmus import host_compiler
from trihedron.tools.orchestrator import Scenario, run_scenario

STEP, STEPS, PLAIN_STEPS = 0.01, 4_000_000, 30_000
VARIABLES = "".join(
    f'<ScalarVariable name="u[{i + 1}]" valueReference="{i}" causality="input"><Real start="0"/></ScalarVariable>'
    for i in range(3)
) + "".join(
    f'<ScalarVariable name="y[{i + 1}]" valueReference="{i + 3}" causality="output"><Real/></ScalarVariable>'
    for i in range(3)
)
DESCRIPTION = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Light" guid="light"><CoSimulation modelIdentifier="light"/>
<ModelVariables>{VARIABLES}</ModelVariables>
<ModelStructure><Outputs><Unknown index="4"/><Unknown index="5"/><Unknown index="6"/></Outputs></ModelStructure>
</fmiModelDescription>
"""
COLUMNS = {f"b{i}": f"b.y[{i}]" for i in (1, 2, 3)} | {f"c{i}": f"c.y[{i}]" for i in (1, 2, 3)} | {"a1": "a.y[1]"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with Light.fmu."""
    compiler = host_compiler()
    if compiler is None:
        pytest.skip("needs a C compiler")
    source = Path(__file__).parents[1] / "foreign_fmus" / "light.c"
    library = tmp_path / f"light{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [compiler[0], "-O2", "-shared", "-fPIC", "-w", f"-I{headers}", source, "-o", library]
    subprocess.run(command, check=True)
    with zipfile.ZipFile(tmp_path / "Light.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{fmpy.platform}/light{fmpy.sharedLibraryExtension}")
    return tmp_path


def scenario(folder: Path, steps: int, *, in_process: bool | None = True) -> Scenario:
    return Scenario.model_validate(
        {
            "base_folder": folder,
            "run": {"stop_s": steps * STEP, "step_s": STEP, "in_process": in_process},
            "fmus": {name: {"fmu": "Light.fmu"} for name in "abc"},
            "connections": [{"from": "a.y", "to": "b.u"}, {"from": "b.y", "to": "c.u"}],
            "stimuli": [{"to": "a.u", "constant": [1.0, 2.0, 3.0]}],
            "record": {"columns": COLUMNS},
        }
    )


def seconds(folder: Path, steps: int, out: Path | None) -> float:
    """Return the CPU time of a run: unlike the clock, it excludes other work of the machine."""
    gc.collect()
    began = time.process_time()
    run_scenario(scenario(folder, steps), out)
    return time.process_time() - began


def plain_loop(folder: Path, work: Path) -> tuple[float, np.ndarray]:
    """Run the usual loop with FMPy: getReal and setReal with lists."""
    unpacked = fmpy.extract(folder / "Light.fmu", work)
    slaves = []
    for name in "abc":
        slave = FMU2Slave(guid="light", unzipDirectory=unpacked, modelIdentifier="light", instanceName=name)
        slave.instantiate()
        slave.setupExperiment(startTime=0.0, stopTime=PLAIN_STEPS * STEP)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slaves.append(slave)
    a, b, c = slaves
    a.setReal([0, 1, 2], [1.0, 2.0, 3.0])
    rows = [[0.0] * 7]
    began = time.process_time()
    for k in range(PLAIN_STEPS):
        t = k * STEP
        a.doStep(t, STEP)
        b.setReal([0, 1, 2], a.getReal([3, 4, 5]))
        b.doStep(t, STEP)
        c.setReal([0, 1, 2], b.getReal([3, 4, 5]))
        c.doStep(t, STEP)
        rows.append(b.getReal([3, 4, 5]) + c.getReal([3, 4, 5]) + a.getReal([3]))
    elapsed = time.process_time() - began
    for slave in slaves:
        slave.terminate()
        slave.fmi2FreeInstance(slave.component)
    return elapsed, np.array(rows)


@pytest.mark.benchmark_ratio
def test_the_master_against_fmpys_list_api(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_scenario(scenario(folder, 1))
    loops = [plain_loop(folder, tmp_path / f"unpacked-{turn}") for turn in range(3)]
    rows = loops[0][1]
    plain = 1e6 * min(elapsed for elapsed, _ in loops) / PLAIN_STEPS
    result = run_scenario(scenario(folder, PLAIN_STEPS)).table.drop("time_s").to_numpy()
    assert (result == rows).all()
    ours = 1e6 * min(seconds(folder, STEPS, None) for _ in range(3)) / STEPS
    disk = 1e6 * min(seconds(folder, STEPS, tmp_path / f"out-{turn}") for turn in range(3)) / STEPS
    with capsys.disabled():
        print(
            f"\nthree coupled FMUs that compute next to nothing, seven recorded outputs, CPU us a step: FMPy list API "
            f"{plain:.2f}, orchestrator {ours:.3f} ({plain / ours:.0f} times), to disk {disk:.3f}"
        )
    assert plain / ours > 100.0


@pytest.mark.benchmark_ratio
def test_one_process_for_all_foreign_fmus(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its cost of a step, without its start, is at most 3 us above that in our process."""
    costs = {}
    for in_process in (True, None):
        elapsed = []
        for steps in (STEPS // 10, STEPS):
            began = time.perf_counter()
            run_scenario(scenario(folder, steps, in_process=in_process))
            elapsed.append(time.perf_counter() - began)
        costs[in_process] = 1e6 * (elapsed[1] - elapsed[0]) / (STEPS - STEPS // 10)
    with capsys.disabled():
        print(f"\nthree coupled FMUs, us a step: in process {costs[True]:.3f}, in one process {costs[None]:.3f}")
    assert costs[None] < costs[True] + 3.0
