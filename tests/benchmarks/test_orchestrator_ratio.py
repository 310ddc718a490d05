"""The orchestrator against a plain FMPy loop and against a bare C program, on the same FMUs, in the same run."""

import gc
import shutil
import subprocess
import time
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from trihedron.fmus import build, host_compiler
from trihedron.tools.orchestrator import Scenario, run_scenario

STEP, ROUNDS = 0.01, 3
PLAIN_STEPS, STEPS = 20_000, 1_000_000
NAMES = ("TurntableMotion", "AccelerometerBlock", "AttitudeComputer")
WIRES = (
    ("TurntableMotion", "specific_force", "AccelerometerBlock", "specific_force"),
    ("TurntableMotion", "increment", "AttitudeComputer", "increment"),
)
RECORDED = {
    "AccelerometerBlock": ("reading[1]", "reading[2]", "reading[3]"),
    "AttitudeComputer": ("attitude[1]", "attitude[2]", "attitude[3]", "attitude[4]"),
}
COLUMNS = {f"c{i}_mps2": f"AccelerometerBlock.reading[{i + 1}]" for i in range(3)} | {
    f"q{i}": f"AttitudeComputer.attitude[{i + 1}]" for i in range(4)
}
COMMAND = [0.7, -1.1]


def elements(base: str) -> list[str]:
    return [f"{base}[{i}]" for i in (1, 2, 3)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the native FMUs."""
    if host_compiler() is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("native")
    for name in NAMES:
        build(name, folder, flavour="native", fmi=2)
    return folder


def plain_loop(folder: Path, work: Path, steps: int) -> tuple[float, np.ndarray]:
    """Run the usual loop with FMPy: getReal and setReal with lists."""
    slaves, refs = {}, {}
    for name in NAMES:
        description = fmpy.read_model_description(folder / f"{name}.fmu")
        refs[name] = {v.name: v.valueReference for v in description.modelVariables}
        unpacked = fmpy.extract(folder / f"{name}.fmu", work / name)
        identifier = description.coSimulation.modelIdentifier  # type: ignore[union-attr]
        slave = FMU2Slave(guid=description.guid, unzipDirectory=unpacked, modelIdentifier=identifier, instanceName=name)
        slaves[name] = slave
        slave.instantiate()
        slave.setupExperiment(startTime=0.0, stopTime=steps * STEP)
    table, block, computer = (slaves[name] for name in NAMES)
    table.setReal([refs[NAMES[0]]["command[1]"], refs[NAMES[0]]["command[2]"]], COMMAND)
    force, increment = ([refs[NAMES[0]][v] for v in elements(b)] for b in ("specific_force", "increment"))
    force_in = [refs[NAMES[1]][v] for v in elements("specific_force")]
    increment_in = [refs[NAMES[2]][v] for v in elements("increment")]
    reading, attitude = ([refs[name][v] for v in result] for name, result in RECORDED.items())
    for initialise in ("enterInitializationMode", "exitInitializationMode"):
        for slave in slaves.values():
            getattr(slave, initialise)()
        block.setReal(force_in, table.getReal(force))
        computer.setReal(increment_in, table.getReal(increment))
    rows = [block.getReal(reading) + computer.getReal(attitude)]
    began = time.perf_counter()
    for k in range(steps):
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


def bare_program(folder: Path, work: Path) -> Path:
    """Return a C program that makes the calls of the compiled loop, with the FMUs' names and references written into
    it."""
    lines = [
        f"#define STEP {STEP!r}",
        "#define STOP 1e9",
        f"static const double command[2] = {{{COMMAND[0]}, {COMMAND[1]}}};",
    ]
    expected = {
        "TurntableMotion": {
            "COMMAND": ["command[1]", "command[2]"],
            "MOVED": elements("specific_force") + elements("increment"),
        },
        "AccelerometerBlock": {"FORCE": elements("specific_force"), "READING": elements("reading")},
        "AttitudeComputer": {"INCREMENT": elements("increment"), "ATTITUDE": list(RECORDED["AttitudeComputer"])},
    }
    for short, name in zip(("TABLE", "BLOCK", "COMPUTER"), NAMES, strict=True):
        description = fmpy.read_model_description(folder / f"{name}.fmu")
        unpacked = Path(fmpy.extract(folder / f"{name}.fmu", work / name))
        library = next((unpacked / "binaries" / fmpy.platform).iterdir())
        lines += [f'#define {short}_LIBRARY "{library}"', f'#define {short}_GUID "{description.guid}"']
        references = {v.name: v.valueReference for v in description.modelVariables}
        for array, variables in expected[name].items():
            numbers = ", ".join(str(references[v]) for v in variables)
            lines.append(f"static const fmi2ValueReference {array}[{len(variables)}] = {{{numbers}}};")
    (work / "calls.h").write_text("\n".join(lines) + "\n")
    compiler = host_compiler()
    assert compiler is not None
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).parent / "bare_master.c"
    program = work / "bare"
    subprocess.run([compiler[0], "-O2", "-w", f"-I{headers}", f"-I{work}", source, "-o", program, "-ldl"], check=True)
    return program


def scenario(folder: Path, steps: int, *, in_process: bool | None = True, **more: object) -> Scenario:
    """Return the three FMUs coupled, with the seven outputs."""
    return Scenario.model_validate(
        {
            "base_folder": folder,
            "run": {"stop_s": steps * STEP, "step_s": STEP, "in_process": in_process},
            "fmus": {name: {"fmu": f"{name}.fmu"} for name in NAMES},
            "connections": [{"from": f"{a}.{output}", "to": f"{b}.{target}"} for a, output, b, target in WIRES],
            "stimuli": [{"to": "TurntableMotion.command", "constant": COMMAND}],
            "record": {"columns": COLUMNS},
            **more,
        }
    )


def seconds_of_steps(
    folder: Path, out: Path | None, most: int = STEPS, *, in_process: bool | None = True
) -> tuple[float, np.ndarray]:
    """Return the seconds for this number of further steps: starting up is excluded, as for the other loops."""
    times, rows = {}, np.zeros(0)
    for steps in (1, most):
        gc.collect()
        began = time.perf_counter()
        run = run_scenario(scenario(folder, steps, in_process=in_process), out)
        times[steps] = time.perf_counter() - began
        rows = run.table.drop("time_s").to_numpy()
        if out is not None:
            shutil.rmtree(out)
    return times[most] - times[1], rows


@pytest.mark.benchmark_ratio
def test_ratios_to_a_plain_fmpy_loop_and_to_bare_c(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, cost_row
) -> None:
    # As FMUs of others.
    monkeypatch.setattr("trihedron.fmus.is_built_here", lambda _: False)
    program = bare_program(folder, tmp_path)
    plain, bare, ours, disk, guests, child = [], [], [], [], [], []
    rows = ours_rows = np.zeros(0)
    last: list[float] = []
    run_scenario(scenario(folder, 1))
    for turn in range(ROUNDS):
        elapsed, rows = plain_loop(folder, tmp_path / f"plain-{turn}", PLAIN_STEPS)
        plain.append(1e6 * elapsed / PLAIN_STEPS)
        words = subprocess.run([program, str(STEPS)], capture_output=True, text=True, check=True).stdout.split()
        bare.append(1e6 * float(words[0]) / STEPS)
        last = [float.fromhex(word) for word in words[1:]]
        elapsed, ours_rows = seconds_of_steps(folder, None)
        ours.append(1e6 * elapsed / STEPS)
        elapsed, isolated = seconds_of_steps(folder, None, PLAIN_STEPS, in_process=False)
        guests.append(1e6 * elapsed / PLAIN_STEPS)
        assert (isolated == rows).all()
        elapsed, together = seconds_of_steps(folder, None, in_process=None)
        child.append(1e6 * elapsed / STEPS)
        assert (together == ours_rows).all()
        disk.append(1e6 * seconds_of_steps(folder, tmp_path / "out")[0] / STEPS)
    assert (ours_rows[: PLAIN_STEPS + 1] == rows).all()
    assert ours_rows[-1].tolist() == last
    with capsys.disabled():
        print(
            f"\nthree coupled native FMUs, seven recorded outputs, best of {ROUNDS}, us a step: plain FMPy loop "
            f"{min(plain):.2f}, bare C {min(bare):.3f}, orchestrator {min(ours):.3f}, to disk {min(disk):.3f}, all "
            f"in one child {min(child):.3f}, each in a process of its own {min(guests):.1f}; "
            f"plain/ours {min(plain) / min(ours):.1f}, ours/bare {min(ours) / min(bare):.2f}, "
            f"disk/memory {min(disk) / min(ours):.2f}, guests/plain {min(guests) / min(plain):.1f}, "
            f"a guest {(min(guests) - min(ours)) / len(NAMES):.0f} us a step"
        )
    cost_row("masters", "bare C", f"{min(bare):.1f}")
    cost_row("masters", "`trihedron`, in our process", f"{min(ours):.1f}")
    cost_row("masters", "FMPy's loop over a list", f"{min(plain):.0f}")
    cost_row("masters", "all in one process of their own, over 1,000,000 steps", f"{min(child):.1f}")
    cost_row("masters", "each FMU in a process of its own", f"{min(guests):.0f}")
    assert min(ours) / min(bare) < 1.5


@pytest.mark.benchmark_ratio
def test_ten_minutes_of_table_block_and_computer_at_2_khz(folder: Path, tmp_path: Path, capsys) -> None:
    run = {"stop_s": 600.0, "step_s": 0.0005, "in_process": True}
    began = time.perf_counter()
    result = run_scenario(scenario(folder, 1, run=run), tmp_path / "out")
    elapsed = time.perf_counter() - began
    assert result.height == 1_200_001
    with capsys.disabled():
        print(f"\n600 s at 2 kHz, recorded: {elapsed:.2f} s, {600.0 / elapsed:.0f} times real time")
