"""The Modelica Association's Reference-FMUs agree with their own results, alone and in a scenario."""

import io
import math
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import polars as pl
import pytest
from scipy.integrate import solve_ivp

from foreign_fmus import rewritten
from scenario_runs import refusal, run_of_guests, wires
from trihedron.tools import library

FOLDERS = [*map(Path, filter(None, [os.environ.get("TRIHEDRON_DATA")]))]
FOLDERS.append(Path(__file__).resolve().parents[4] / "shared" / "data")
HERE = next((folder / "reference-fmus" for folder in FOLDERS if (folder / "reference-fmus").is_dir()), Path())
WITH_RESULTS = [
    *(f"fmi{v}/{name}" for v in (2, 3) for name in ("BouncingBall", "Dahlquist", "Resource", "Stair", "VanDerPol")),
    *("fmi2/Feedthrough", "fmi3/Feedthrough", "fmi3/StateSpace"),
]
UNSTATED_STEPS = {"fmi2/Feedthrough": 0.1, "fmi2/Resource": 1.0}
"""Steps of the published results, for FMUs that state none."""
STEPS = {"BouncingBall": 0.01, "Dahlquist": 0.1, "Feedthrough": 0.1, "Resource": 1.0, "Stair": 0.2, "StateSpace": 1.0}
STEPS["VanDerPol"] = 0.01
"""Step of the published results."""
COUPLED = {"a": "fmi2/BouncingBall", "b": "fmi3/BouncingBall", "c": "fmi2/VanDerPol", "d": "fmi3/VanDerPol"}
pytestmark = pytest.mark.skipif(
    not HERE.is_dir() or Path() == HERE, reason="the Reference-FMUs are not there; TRIHEDRON_DATA names their folder"
)


def published(name: str) -> pl.DataFrame:
    """Return the results inside an FMU."""
    with zipfile.ZipFile(HERE / f"{name}.fmu") as archive:
        stem = name.partition("/")[2]
        return pl.read_csv(io.BytesIO(archive.read(f"extra/org.fmi-standard.fmi-ls-ref/{stem}_out.csv")))


def largest_difference(table: pl.DataFrame, expected: pl.DataFrame, fmu: str) -> float:
    """Return the largest difference over all common columns, numbers, texts and flags; rows must agree in number and
    time."""
    differences = 0.0
    np.testing.assert_allclose(table["time_s"], expected["time"], rtol=0.0, atol=1e-14)
    assert table.height == expected.height
    compared = 0
    for column in expected.columns:
        ours = f"{fmu}.{column}"
        several = [c for c in table.columns if c.startswith(f"{ours}[")]
        instance = [c for c in table.columns if c == ours or c.startswith(f"{ours}_m")]
        if several:
            rows = np.array([[float(x) for x in text.split()] for text in expected[column]])
            differences = max(differences, float(np.abs(table.select(several).to_numpy() - rows).max()))
        elif instance and expected.schema[column].is_numeric():
            differences = max(
                differences, float(np.abs(table[instance[0]].to_numpy() - expected[column].to_numpy()).max())
            )
        elif instance:
            assert table[instance[0]].to_list() == expected[column].to_list()
        compared += bool(several or instance)
    assert compared >= 1
    return differences


@pytest.mark.first(1)
@pytest.mark.parametrize("name", WITH_RESULTS)
def test_alone_by_its_default_experiment(name: str, tmp_path: Path) -> None:
    simulation = library.simulate(HERE / f"{name}.fmu", step=UNSTATED_STEPS.get(name), out=tmp_path)
    difference = largest_difference(simulation.table, published(name), name.partition("/")[2])
    print(f"{name}: largest difference {difference:.3g}")
    assert difference == 0.0
    assert [path.name for path in simulation.files] == ["run.csv", "run.json"]
    assert ("ended the run at 9 s" in simulation.ended) == name.endswith("Stair")


@pytest.mark.acceptance
def test_together_each_in_its_process_or_all_in_ours() -> None:
    fmus = {key: {"fmu": f"{name}.fmu"} for key, name in COUPLED.items()}
    for together in (False, True):
        simulation = run_of_guests(HERE, fmus, run={"stop_s": 3.0, "step_s": 0.01, "in_process": together})
        for key, name in COUPLED.items():
            expected = published(name)[:301]
            for column in expected.columns[1:]:
                ours = next(c for c in simulation.table.columns if c.startswith(f"{key}.{column}"))
                assert np.array_equal(simulation.table[ours].to_numpy(), expected[column].to_numpy()), (name, column)


@pytest.mark.acceptance
@pytest.mark.parametrize("in_process", [True, False])
def test_all_in_one_scenario_each_with_its_own_step(in_process: bool) -> None:
    """Until Stair asks for the end, each FMU does the same as alone."""
    names = {name.replace("/", "_"): name for name in WITH_RESULTS}
    fmus = {key: {"fmu": f"{name}.fmu", "step_s": STEPS[name.partition("/")[2]]} for key, name in names.items()}
    simulation = run_of_guests(HERE, fmus, run={"stop_s": 10.0, "step_s": 0.01, "in_process": in_process})
    assert "ended the run at 9 s" in simulation.ended
    for key, name in names.items():
        rows = simulation.table[:: round(STEPS[name.partition("/")[2]] / 0.01)]
        expected = published(name)
        height = min(rows.height, expected.height)
        difference = largest_difference(rows[:height], expected[:height], key)
        print(f"{name} among {len(names)}: largest difference {difference:.3g} over {height} rows")
        assert difference == 0.0


@pytest.mark.acceptance
def test_in_event_mode_they_are_the_same() -> None:
    """They return before the end of a step, their events are handled, and the step is completed."""
    names = ("BouncingBall", "Feedthrough", "Stair")
    fmus = {n: {"fmu": f"fmi3/{n}.fmu", "step_s": STEPS[n], "event_mode": True} for n in names}
    simulation = run_of_guests(HERE, fmus, run={"stop_s": 10.0, "step_s": 0.01})
    assert "'Stair' (fmi3/Stair.fmu) ended the run at 9 s (fmi3DoStep asked for it)" in simulation.ended
    for name in names:
        rows, expected = simulation.table[:: round(STEPS[name] / 0.01)], published(f"fmi3/{name}")
        height = min(rows.height, expected.height)
        assert largest_difference(rows[:height], expected[:height], name) == 0.0
    message = refusal(HERE, {"x": {"fmu": "fmi3/VanDerPol.fmu", "event_mode": True}})
    assert message.startswith("fmus.x.event_mode: fmi3/VanDerPol.fmu does not say hasEventMode")


def test_model_exchange_by_a_solver(tmp_path: Path) -> None:
    """Solve FMUs reduced to model exchange, of both versions, and compare with known solutions."""

    def exchange_only(name: str, content: bytes) -> tuple[str, bytes]:
        if name == "modelDescription.xml":
            content = re.sub(rb"<CoSimulation[^>]*/>|<CoSimulation.*?</CoSimulation>", b"", content, flags=re.DOTALL)
        return name, content

    models = ("BouncingBall", "Dahlquist", "Stair", "VanDerPol")
    fmus = {f"{name}{fmi}": {"fmu": f"{name}{fmi}.fmu", "tolerance": 1e-8} for name in models for fmi in (2, 3)}
    for key, fmu in fmus.items():
        rewritten(HERE / f"fmi{key[-1]}" / f"{key[:-1]}.fmu", tmp_path / fmu["fmu"], exchange_only)
    simulation = run_of_guests(tmp_path, fmus, run={"stop_s": 10.0, "step_s": 0.1})
    assert "ended the run at 9 s" in simulation.ended
    table, times = simulation.table, simulation.table["time_s"].to_numpy()
    assert times[-1] == pytest.approx(9.0)

    def field(_: float, x: np.ndarray) -> list[float]:
        return [x[1], (1.0 - x[0] ** 2) * x[1] - x[0]]

    swung = solve_ivp(field, (0.0, 10.0), [2.0, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12)
    truth = {
        "BouncingBall": ("h", bounces(times)),
        "Dahlquist": ("x", np.exp(-times)),
        "Stair": ("counter", np.floor(times + 1e-9) + 1.0),
        "VanDerPol": ("x0", swung.y[0]),
    }
    for name, (variable, expected) in truth.items():
        for fmi in (2, 3):
            column = next(c for c in table.columns if c.startswith(f"{name}{fmi}.{variable}"))
            # The resting place of the ball depends on the threshold of its bounces.
            judged = times < 2.3 if name == "BouncingBall" else times < 10.0
            difference = float(np.abs(table[column].to_numpy() - expected)[judged].max())
            print(f"{name}, FMI {fmi}, by CVODE: largest difference {difference:.3g}")
            assert difference < 2e-5


def bounces(times: np.ndarray) -> np.ndarray:
    """Return the heights [m] of the ball, dropped from 1 m, that keeps 0.7 of its speed."""
    gravity, begin = 9.81, math.sqrt(2.0 / 9.81)
    speed = 0.7 * gravity * begin
    heights = 1.0 - 0.5 * gravity * times**2
    while speed > 0.1:
        since = times - begin
        heights = np.where(since > 0.0, speed * since - 0.5 * gravity * since**2, heights)
        begin, speed = begin + 2.0 * speed / gravity, 0.7 * speed
    return heights


def test_what_one_puts_out_another_passes_on_to_the_bit() -> None:
    fmus = {"ball": {"fmu": "fmi2/BouncingBall.fmu"}, "through": {"fmu": "fmi3/Feedthrough.fmu"}}
    connections = wires("ball.h -> through.Float64_continuous_input")
    table = run_of_guests(HERE, fmus, connections=connections, run={"stop_s": 3.0, "step_s": 0.1}).table
    height = next(c for c in table.columns if c.startswith("ball.h"))
    assert table["through.Float64_continuous_output"].to_list() == table[height].to_list()
    assert table["through.String_output"][-1] == "Set me!"


@pytest.mark.acceptance
@pytest.mark.parametrize("in_process", [True, False])
def test_binaries_go_in_along_and_out(in_process: bool) -> None:
    """Pass bytes with a zero among them, and none at all, with the other process or without; by the compiled loop,
    too."""
    setting = {"stop_s": 1.0, "step_s": 0.1, "in_process": in_process}
    connections = wires(
        "a.Binary_output -> b.Binary_input", "a.Float64_continuous_output -> b.Float64_continuous_input"
    )
    for content in ("00fF10", ""):
        parameters = {"Binary_input": content, "Float64_continuous_input": 2.5}
        fmus = {"a": {"fmu": "fmi3/Feedthrough.fmu", "parameters": parameters}, "b": {"fmu": "fmi3/Feedthrough.fmu"}}
        table = run_of_guests(HERE, fmus, connections=connections, run=setting).table
        assert set(table["b.Binary_output"]) == {content.lower()}
        columns = {"columns": {"x": "b.Float64_continuous_output"}}
        assert set(run_of_guests(HERE, fmus, connections=connections, run=setting, record=columns).table["x"]) == {2.5}
    fmus["a"]["parameters"]["Binary_input"] = "0x1"
    message = refusal(HERE, fmus, run=setting)
    assert message == "fmus.a.parameters: Binary_input = '0x1' must be hexadecimal digits, two for each byte"


@pytest.fixture(scope="module")
def state_space(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with StateSpace, corrected: its published setter of structural parameters counts a value
    twice."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    folder = tmp_path_factory.mktemp("space")
    with zipfile.ZipFile(HERE / "fmi3" / "StateSpace.fmu") as archive:
        archive.extractall(folder / "published")
    sources = folder / "published" / "sources"
    model = sources / "model.c"
    wrong, text = "const uint64_t v = values[(*index)++];", model.read_text()
    assert wrong in text
    head, tail = text.split(wrong)
    model.write_text(f"{head}ASSERT_NVALUES(1);\n    {wrong}{tail.replace('ASSERT_NVALUES(1);', '', 3)}")
    library = folder / "StateSpace.so"
    headers = Path(fmpy.__file__).parent / "c-code"
    files = [model, sources / "fmi3Functions.c", sources / "cosimulation.c"]
    flags = [
        "-shared",
        "-fPIC",
        "-w",
        "-DFMI_VERSION=3",
        "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
        f"-I{headers}",
        f"-I{sources}",
    ]
    subprocess.run([compiler, *flags, *files, "-o", library, "-lm"], check=True)

    def mended(name: str, content: bytes) -> tuple[str, bytes]:
        return name, library.read_bytes() if name == "binaries/x86_64-linux/StateSpace.so" else content

    rewritten(HERE / "fmi3" / "StateSpace.fmu", folder / "StateSpace.fmu", mended)
    return folder


@pytest.mark.acceptance
@pytest.mark.skipif(fmpy.platform_tuple != "x86_64-linux", reason="compiles for x86_64 Linux")
def test_structural_parameters_say_how_long_arrays_are(state_space: Path) -> None:
    """x' = A x + B u, y = C x with two states, one input and one output, by Euler from 0: it ignores x0."""
    a, b, c = np.array([[0.0, 1.0], [-0.5, -0.25]]), np.array([0.0, 2.0]), np.array([1.0, 0.5])
    parameters = {"m": 1, "n": 2, "r": 1, "A": a.ravel().tolist(), "B": b.tolist(), "C": c.tolist(), "D": [0.0]}
    parameters |= {"u": [3.0]}
    setting = {"stop_s": 5.0, "step_s": 1.0}
    x, expected, inside = np.zeros(2), [0.0], 1000
    for _ in range(5):
        for _ in range(inside):
            x = x + (a @ x + b * 3.0) / inside
        expected.append(float(c @ x))
    for together in (False, True):
        space = {"s": {"fmu": "StateSpace.fmu", "parameters": parameters}}
        table = run_of_guests(state_space, space, run={**setting, "in_process": together}).table
        assert table.columns == ["time_s", "s.y[1]"]
        assert table["s.y[1]"].to_list() == pytest.approx(expected, rel=1e-14)
    message = refusal(state_space, {"s": {"fmu": "StateSpace.fmu", "parameters": {"n": 9}}}, run=setting)
    assert "Variable n must not be greater than 5. [setting n = 9]" in message


def test_what_cannot_be_run_is_refused_for_the_right_reason() -> None:
    message = refusal(HERE, {"x": {"fmu": "fmi3/Clocks.fmu"}})
    assert message == "fmi3/Clocks.fmu: is for scheduled execution only; export it for co-simulation"


@pytest.mark.acceptance
def test_roberts_reaction_keeps_its_mass() -> None:
    """Its results are the bouncing ball's; each step of an explicit method keeps mass."""
    table = library.simulate(HERE / "fmi3" / "Roberts.fmu", start=0.0, stop=1.0).table
    values = table.drop("time_s").to_numpy()
    assert values.shape == (1001, 3)
    assert np.abs(values.sum(axis=1) - 1.0).max() < 1e-12
    assert values[-1, 0] < 0.97
