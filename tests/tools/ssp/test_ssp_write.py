"""A scenario as an .ssp: valid to the schemas, the same run here and in FMPy."""

import json
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, find_components, read_ssd, read_ssv

import trihedron as th
from scenario_runs import SCENARIOS, wires
from trihedron.fmus import build
from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import RunOptions, Scenario, read_scenario, run_scenario
from trihedron.tools.ssp import scenario_of_ssp, self_contained, write_ssp
from trihedron.tools.ssp.documents import children, parsed

NUMBERS = {algorithm.name: algorithm.number for algorithm in ALGORITHMS}
EIGHTH = 0.125
"""A step that adds up without rounding, as FMPy adds up times."""


def bench(folder: Path = Path(), **sections) -> Scenario:
    """Return a table from rest at (0, 0), a block and a computer, in which FMPy's master gives the same numbers."""
    rows = {"alpha_deg": [0.0, 30.0, -45.0], "beta_deg": [0.0, 120.0, 120.0]}
    settings = {
        "title": "Bench for other tools",
        "run": {"step_s": EIGHTH},
        "fmus": {
            "table": {
                "component": "TurntableMotion",
                "parameters": {"kappa": 1e-3, "mounting_error": [0.0, 1e-3, 0.0]},
            },
            "block": {
                "component": "AccelerometerBlock",
                "effects": [{"effect": "quadratic", "where": "accelerometer-3", "coefficient": 1e-4}],
                "parameters": {"noise_bound": 0.0, "bias": [1e-3, 0.0, -2e-3]},
            },
            "computer": {
                "component": "AttitudeComputer",
                "parameters": {"algorithm": NUMBERS["one-sample-rodrigues"]},
            },
        },
        "connections": wires(
            "table.specific_force -> block.specific_force",
            "table.dwell -> block.dwell",
            "table.increment -> computer.increment",
        ),
        "stimuli": [
            {"to": "table.command", "table": rows, "dwell_s": 1.3},
            {"to": "table.temperature", "constant": 25.0},
        ],
        "base_folder": folder,
        **sections,
    }
    return Scenario.model_validate(settings)


ROWS = [
    {
        "table": {"time_s": [0.0, 1.0, 2.5], "a_deg": [0.0, 30.0, -45.0], "b_deg": [0.0, 0.0, 120.0]},
        "columns": {"table.command[1]": "a_deg", "table.command[2]": "b_deg"},
    },
    {
        "table": {"time_s": [0.5, 9.0], "warm_degC": [25.0, 30.0], "rest": [3.0, 7.0]},
        "columns": {"table.temperature": "warm_degC", "block.dwell": "rest"},
        "stamp": "end",
    },
]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ssp")
    return write_ssp(bench(), folder / "bench.ssp", flavour="python")


def all_parameters(path: Path) -> ParameterSet:
    """Return the parameters of all FMUs under their names in the system, as FMPy takes them."""
    system_text = ParameterSet()
    system_text.parameters = []
    for component in find_components(read_ssd(str(path)).system):
        for binding in component.parameterBindings:
            for parameter in read_ssv(str(path), binding.source).parameters:
                parameter.name = f"{component.name}.{parameter.name}"
                system_text.parameters.append(parameter)
    return system_text


def test_fmpy_reads_it_by_the_schemas(exported):
    description = read_ssd(str(exported))
    assert [c.name for c in find_components(description.system)] == ["programme", "table", "block", "computer"]
    values = {p.name: (p.type, p.value, p.unit) for p in all_parameters(exported).parameters}
    assert values["table.kappa"] == ("Real", "0.001", "rad")
    assert values["table.temperature"] == ("Real", "25.0", "degC")
    assert values["block.bias[3]"] == ("Real", "-0.002", "g")
    assert values["computer.algorithm"] == ("Integer", str(NUMBERS["one-sample-rodrigues"]), None)
    assert values["programme.positions"] == ("Integer", "3", None)
    assert values["programme.lead_steps"] == ("Integer", "1", None)
    assert float(values["programme.alpha[2]"][1]) == np.radians(30.0)
    assert "programme.alpha[4]" not in values


@pytest.mark.acceptance
def test_an_fmu_starts_with_the_enumerations_that_other_tools_pass_over(exported, tmp_path):
    with zipfile.ZipFile(exported) as archive:
        (tmp_path / "computer.fmu").write_bytes(archive.read("resources/AttitudeComputer.fmu"))
    variables = {v.name: v.start for v in fmpy.read_model_description(tmp_path / "computer.fmu").modelVariables}
    assert variables["algorithm"] == str(NUMBERS["one-sample-rodrigues"])


def test_the_parts_stand_in_the_order_that_omsimulator_wants(exported):
    with zipfile.ZipFile(exported) as archive:
        names = archive.namelist()
        root = parsed(archive.read("SystemStructure.ssd"), "ssd", "ssd:SystemStructureDescription")
    assert names[0] == "SystemStructure.ssd"
    assert [e.tag.rpartition("}")[2] for e in root] == ["System", "Units", "DefaultExperiment"]
    parts = [e.tag.rpartition("}")[2] for e in children(root, "ssd:System")[0]]
    assert parts == ["Elements", "Connections", "Annotations"]
    annotation = children(root, "ssd:System/ssd:Annotations/ssc:Annotation")[0]
    assert annotation.get("type") == "org.openmodelica"
    masters = [e for e in annotation.iter() if e.tag.endswith("FixedStepMaster")]
    assert [(m.get("description"), m.get("stepSize")) for m in masters] == [("oms-ma", "0.125")]
    # FMPy gives every input connector a value, 0 without a source: an unconnected one has none.
    inputs = [e.get("name") for e in root.iter() if e.get("kind") == "input"]
    assert "temperature" not in inputs


@pytest.mark.acceptance
def test_the_same_bytes_on_every_export_and_the_same_run_when_it_comes_back(exported, tmp_path):
    again = write_ssp(bench(), tmp_path / "again.ssp", flavour="python")
    assert again.read_bytes() == exported.read_bytes()
    expected = run_scenario(bench()).table
    assert (
        run_scenario(self_contained(bench(), lambda _, component: build(component, tmp_path)))
        .table.select(expected.columns)
        .equals(expected)
    )
    with scenario_of_ssp(exported) as (again, ignored):
        assert ignored == ()
        simulation = run_scenario(again).table
    assert simulation.select(expected.columns).equals(expected)


@pytest.mark.acceptance
@pytest.mark.parametrize("stimuli", ["a programme", "rows"])
def test_fmpy_gives_the_numbers_of_a_run_that_is_delayed(stimuli, tmp_path):
    """FMPy passes outputs on when all FMUs have stepped; so does coupling = "delayed": no number differs."""
    scenario = bench(**({"stimuli": ROWS[:1], "run": {"step_s": EIGHTH, "stop_s": 8.0}} if stimuli == "rows" else {}))
    path = write_ssp(scenario, tmp_path / "bench.ssp", flavour="python")
    with scenario_of_ssp(path, RunOptions(coupling="delayed")) as (again, _):
        expected = run_scenario(again).table
    steps = expected.height - 1
    rows = simulate_ssp(str(path), stop_time=steps * EIGHTH, step_size=EIGHTH, parameter_set=all_parameters(path))
    assert len(np.unique(expected["table.angle_reading[1]_rad"])) > 10
    compared = 0
    for name in rows.dtype.names or ():
        columns = [c for c in expected.columns if c == name or c.startswith(f"{name}_")]
        if columns and name.partition(".")[0] in ("table", "block", "computer"):
            # Row k of FMPy's is after k + 1 steps. In its first one all inputs are 0, and an increment of velocity is
            # the mean of the readings at both ends of a step.
            first = 2 if name.startswith("block.increment_reading") else 1
            theirs, ours = rows[name][first:], expected[columns[0]][first + 1 :]
            np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-15, err_msg=name)
            compared += 1
    assert compared > 20


@pytest.mark.acceptance
def test_timed_rows_go_out_as_components_that_give_the_same_run(tmp_path):
    scenario = bench(
        stimuli=ROWS,
        connections=wires("table.specific_force -> block.specific_force"),
        run={"step_s": 0.1, "stop_s": 6.0},
    )
    path = write_ssp(scenario, tmp_path / "rows.ssp", flavour="python")
    with zipfile.ZipFile(path) as archive:
        fmus = [n for n in archive.namelist() if "TimedRows" in n]
    # One for each unit and type.
    assert len(fmus) == 3
    expected = run_scenario(scenario).table
    with scenario_of_ssp(path) as (again, ignored):
        assert ignored == ()
        simulation = run_scenario(again).table
    assert simulation.select(expected.columns).equals(expected)
    assert len(expected["block.reading[1]_mps2"].unique()) > 10


@pytest.mark.acceptance
def test_a_calibration_goes_to_every_fmu_that_takes_it_under_the_scenarios_own_values(tmp_path):
    result = th.calibrate(th.simulate(SCENARIOS / "static-calibration.toml"), noise_bound=1e-5)
    (tmp_path / "measured.json").write_text(result.json_text())
    table, block = (
        {"component": name, "parameters_from": "measured.json"} for name in ("TurntableMotion", "AccelerometerBlock")
    )
    fmus = {"table": table, "first": block, "second": {**block, "parameters": {"bias": [0.0, 0.0, 0.0], "seed": 3}}}
    forces = wires(*(f"table.specific_force -> {name}.specific_force" for name in ("first", "second")))
    scenario = bench(tmp_path, fmus=fmus, connections=forces)
    path = write_ssp(scenario, tmp_path / "bench.ssp", flavour="python")
    with zipfile.ZipFile(path) as archive:
        resources = sorted(n for n in archive.namelist() if n.startswith("resources/"))
    fmus = ["AccelerometerBlock.fmu", "PositionProgramme.fmu", "TurntableMotion.fmu"]
    sets = ["first.ssv", "programme.ssv", "second.ssv", "table.ssv"]
    assert resources == sorted(f"resources/{name}" for name in fmus + sets)
    with zipfile.ZipFile(path) as archive:
        assert (
            'description="parameters of first, calibration measured.json"'
            in archive.read("resources/first.ssv").decode()
        )
    values = {p.name: float(p.value) for p in all_parameters(path).parameters}
    estimates = {p["symbol"]: p["estimate"] for p in json.loads((tmp_path / "measured.json").read_text())["parameters"]}
    assert values["first.bias[1]"] == estimates["X16"] != 0.0
    assert values["second.bias[1]"] == 0.0
    assert values["second.scale_error_plus[1]"] == values["first.scale_error_plus[1]"] == estimates["X4"]
    expected = run_scenario(scenario).table
    with scenario_of_ssp(path) as (again, _):
        fmus_again = again.fmus
        assert fmus_again["second"].parameters["bias[1]"] == 0.0
        assert fmus_again["first"].parameters["bias[1]"] == values["first.bias[1]"]
        assert run_scenario(again).table.select(expected.columns).equals(expected)


def test_what_cannot_stand_in_an_ssp_is_refused(tmp_path):
    many = {"to": "table.command", "dwell_s": 1.0, "table": {n: [0.0] * 129 for n in ("alpha_deg", "beta_deg")}}
    dashed = {"a-b": {"component": "TurntableMotion"}}
    for sections, says in [
        ({"fmus": dashed, "connections": []}, "fmus.a-b: other tools take names"),
        ({"stimuli": [many]}, "has 129 positions; the component PositionProgramme takes 128"),
    ]:
        with pytest.raises(InputError, match=says):
            write_ssp(bench(**sections), tmp_path / "x.ssp", flavour="python")
    with pytest.raises(InputError, match="--fmi 3"):
        write_ssp(bench(), tmp_path / "x.ssp", fmi=3)
    with pytest.raises(InputError, match=r"x\.zip: must end in \.ssp"):
        write_ssp(bench(), tmp_path / "x.zip")
    with pytest.raises(InputError, match="there is no native FMU for it"):
        write_ssp(bench(), tmp_path / "x.ssp", platform="")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.acceptance
def test_how_cycles_are_taken_goes_out_and_comes_back(tmp_path, capsys):
    scenario = read_scenario(SCENARIOS / "table-stabilised.toml")
    run = scenario.run.model_copy(update={"stop_s": 20 * scenario.run.step_s})
    scenario = scenario.model_copy(update={"run": run})
    path = write_ssp(scenario, tmp_path / "around.ssp", flavour="python")
    expected = run_scenario(scenario).table
    with scenario_of_ssp(path) as (again, _):
        assert again.run.coupling == scenario.run.coupling is not None
        assert run_scenario(again).table.equals(expected)
    with scenario_of_ssp(path, RunOptions(coupling="jacobi")) as (again, _):
        assert again.run.coupling == "jacobi"
    assert cli.main(["simulate", str(SCENARIOS / "table-stabilised.toml"), "--coupling", "jacobi"]) == 2
    assert "--coupling: belongs to an .ssp" in capsys.readouterr().err


@pytest.mark.acceptance
@pytest.mark.parametrize("options", [{}, {"stimuli": ROWS, "run": {"stop_s": 8.0, "step_s": EIGHTH}}])
def test_different_steps_go_out_and_come_back(tmp_path, options):
    """Run a slow table, by a programme or by rows, with its computer beside a fast block."""
    written = bench().as_written()
    fmus, connections = written["fmus"], written["connections"]
    for name in ("table", "computer"):
        fmus[name]["step_s"] = 4 * EIGHTH
    for connection, way in zip(connections, ("interpolate", "hold", None), strict=True):
        connection["between"] = way
    if options:
        # The rows give the length of a rest so far.
        connections = [connection for connection in connections if connection["to"] != "block.dwell"]
    scenario = bench(**options, fmus=fmus, connections=connections)
    expected = run_scenario(scenario).table
    with scenario_of_ssp(write_ssp(scenario, tmp_path / "rates.ssp", flavour="python")) as (again, _):
        assert run_scenario(again).table.select(expected.columns).equals(expected)
        assert again.fmus["block"].step_s is None
    with scenario_of_ssp(tmp_path / "rates.ssp", RunOptions(coupling="delayed")) as (again, _):
        assert again.fmus["table"].step_s == 4 * EIGHTH


def test_of_ssp_2_it_is_the_same_system(exported, tmp_path):
    path = write_ssp(bench(), tmp_path / "second.ssp", flavour="python", ssp="2.0")
    with zipfile.ZipFile(exported) as first, zipfile.ZipFile(path) as second:
        for name in first.namelist():
            before, after = first.read(name), second.read(name)
            if name.endswith((".ssd", ".ssv")):
                root = ElementTree.fromstring(after)
                assert root.get("version") == "2.0"
                root.set("version", "1.0")
                assert ElementTree.tostring(root) == ElementTree.tostring(ElementTree.fromstring(before))
            else:
                assert after == before
    with scenario_of_ssp(path) as (again, _):
        expected = run_scenario(bench()).table
        assert run_scenario(again).table.select(expected.columns).equals(expected)
    with pytest.raises(InputError, match=r"--ssp 3\.0: must be 1\.0 or 2\.0"):
        write_ssp(bench(), tmp_path / "x.ssp", ssp="3.0")  # type: ignore[arg-type]


def test_by_commands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    th.new("scenario", "bench.toml", positions=6)
    assert cli.main(["export-ssp", "bench.toml", "--out", "bench.ssp"]) == 0
    by_command = Path("bench.ssp").read_bytes()
    assert th.export_ssp("bench.toml", "bench.ssp") == Path("bench.ssp")
    assert Path("bench.ssp").read_bytes() == by_command
    assert cli.main(["simulate", "bench.toml", "--out", "direct"]) == 0
    assert cli.main(["simulate", "bench.ssp", "--out", "through"]) == 0
    assert capsys.readouterr().out.split()[0] == "bench.ssp"
    for name in ("run.parquet", "positions.csv"):
        assert Path("through", name).read_bytes() == Path("direct", name).read_bytes()
    assert json.loads(Path("through/run.json").read_text())["steps"] > 100
    assert cli.main(["simulate", "bench.toml", "--step", "0.1"]) == 2
    assert "--step: belongs to an .ssp" in capsys.readouterr().err
    assert cli.main(["export-ssp", "bench.toml", "--out", "bench.toml"]) == 2
    assert {p.name for p in tmp_path.iterdir()} == {
        "bench-positions.csv",
        "bench.ssp",
        "bench.toml",
        "direct",
        "through",
    }
