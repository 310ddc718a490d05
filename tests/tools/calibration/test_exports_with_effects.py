"""Calibrations beside effects of a diagnosis: each export holds the effects, or says that it does not."""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

import trihedron as th
from trihedron.tools import cli
from trihedron.tools.calibration import Calibration, export_calibrated

TEMPERATURE_BIAS = "temperature_bias.accelerometer_2.coefficient"


def values_of(path: Path) -> dict[str, float]:
    """Return the real parameters of an SSP parameter set."""
    values = {}
    for parameter in ElementTree.parse(path).iterfind(".//{*}Parameter"):
        (real,) = parameter.iterfind("{*}Real")
        values[parameter.attrib["name"]] = float(real.attrib["value"])
    return values


def simulated(fmu: Path, output: str, **inputs: list[float]) -> np.ndarray:
    """Return an output (3,) of an FMU after two steps of 0.1 s with constant inputs."""
    names, numbers = ["time"], [[0.0, 0.1, 0.2]]
    for name, values in inputs.items():
        for k, value in enumerate(values, start=1):
            names.append(f"{name}[{k}]" if len(values) > 1 else name)
            numbers.append([value] * 3)
    signals = np.array(list(zip(*numbers, strict=True)), dtype=[(name, np.float64) for name in names])
    wanted = [f"{output}[{k}]" for k in (1, 2, 3)]
    result = fmpy.simulate_fmu(str(fmu), input=signals, stop_time=0.2, output_interval=0.1, output=wanted)
    return np.array([result[name][-1] for name in wanted])


@pytest.fixture(scope="module")
def warmed(tmp_path_factory) -> tuple[Path, dict[str, Any]]:
    """Return a folder with a record whose second bias depends on the temperature, diagnosed, calibrated and exported,
    and the truth."""
    folder = tmp_path_factory.mktemp("warmed")
    record, diagnosis = str(folder / "record.csv"), str(folder / "diagnosis.json")
    hidden = ["--seed", "7", "--effect", "temperature-bias", "--answer", str(folder / "answer.json")]
    assert cli.main(["hidden", record, *hidden]) == 0
    assert cli.main(["diagnose", record, "--noise-bound", "1e-5", "--json", diagnosis]) == 0
    files = ["--json", str(folder / "c.json"), "--ssv", str(folder / "c.ssv"), "--export", str(folder / "fmus")]
    assert cli.main(["calibrate", record, "--with", diagnosis, *files]) == 0
    return folder, json.loads((folder / "answer.json").read_text(encoding="utf-8"))


@pytest.mark.acceptance
def test_fmus_start_with_an_effect_that_was_calibrated_too(warmed):
    folder, answer = warmed
    place, size = answer["hidden"]["where"], answer["hidden"]["parameters"]["coefficient"]
    block, axis = answer["truth"]["AccelerometerBlock"], int(place[-1])
    name = TEMPERATURE_BIAS.replace("accelerometer_2", place.replace("-", "_"))
    for path in (folder / "c.ssv", folder / "fmus" / "AccelerometerBlock.ssv"):
        assert values_of(path)[name] == pytest.approx(size, abs=3e-6)
    assert name not in values_of(folder / "fmus" / "AccelerometerCompensation.ssv")
    up = [0.3, -0.5, (1.0 - 0.34) ** 0.5]
    fmu, force = folder / "fmus" / "AccelerometerBlock.fmu", [9.80665 * n for n in up]
    cold, warm = (simulated(fmu, "reading", specific_force=force, temperature=[t]) for t in (20.0, 45.0))
    assert (warm - cold)[axis - 1] / 9.80665 == pytest.approx(25.0 * size, rel=0.15)
    scale = np.where(np.array(up) > 0.0, block["scale_error_plus"], block["scale_error_minus"])
    expected = np.array(up) * (1.0 + scale) + block["bias"]
    expected[1] += block["gamma_21"] * up[0]
    expected[2] += block["gamma_31"] * up[0] + block["gamma_32"] * up[1]
    # The calibration takes the error of gravity into the scale factors.
    np.testing.assert_allclose(cold / 9.80665, expected, atol=2e-3)


@pytest.mark.acceptance
def test_what_no_equation_takes_out_is_said_by_every_export(warmed, capsys):
    folder, answer = warmed
    title = f"temperature-bias {answer['hidden']['where']}"
    exported = th.export_calibration(folder / "c.json", "c", folder / "imu.h")
    assert exported.lost == [f"{title} stays in the readings"]
    assert f"{title} stays" in (folder / "imu.h").read_text(encoding="utf-8")
    assert f"lost: {title} stays in the readings" in str(exported)
    words = ["calibrate", str(folder / "record.csv"), "--with", str(folder / "diagnosis.json")]
    assert cli.main([*words, "--export", str(folder / "again")]) == 0
    assert f"AccelerometerCompensation does not take out {title}" in capsys.readouterr().out


SCENARIO = """schema = "trihedron.scenario/1"
[run]
step_s = 0.1
stop_s = 0.2
[fmus.block]
component = "AccelerometerBlock"
parameters_from = "c.json"
"""


@pytest.mark.acceptance
def test_parameters_of_a_scenario_need_the_effects_beside_which_they_were_calibrated(warmed, capsys):
    folder, answer = warmed
    scenario = folder / "scenario.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    assert cli.main(["simulate", str(scenario), "--out", str(folder / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"was solved beside temperature-bias {answer['hidden']['where']}" in line


@pytest.mark.acceptance
def test_effects_of_gyros_alone_are_in_fmus_and_in_no_equation(tmp_path, capsys):
    record, diagnosis, calibration = (str(tmp_path / name) for name in ("r.csv", "d.json", "c.json"))
    answer = tmp_path / "answer.json"
    hidden = ["--strapdown", "--seed", "7", "--effect", "gyro-g-sensitivity", "--answer", str(answer)]
    assert cli.main(["hidden", record, *hidden]) == 0
    assert cli.main(["diagnose", record, "--json", diagnosis]) == 0
    words = ["calibrate", record, "--with", diagnosis, "--json", calibration, "--export", str(tmp_path / "fmus")]
    assert cli.main(words) == 0
    assert "apply" not in capsys.readouterr().out
    assert sorted(path.stem for path in (tmp_path / "fmus").glob("*.fmu")) == ["GyroBlock", "GyroCompensation"]
    sizes = json.loads(answer.read_text(encoding="utf-8"))["hidden"]
    truth = np.array([[sizes[f"coefficient_{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)])
    force = [0.0, 0.0, 9.80665]
    out = simulated(tmp_path / "fmus" / "GyroBlock.fmu", "increment_reading", increment=[0.0] * 3, specific_force=force)
    np.testing.assert_allclose(out / 0.1, truth[:, 2], atol=4e-4)
    reading = [0.1 * truth[k, 2] for k in range(3)]
    back = simulated(
        tmp_path / "fmus" / "GyroCompensation.fmu", "rate", increment_reading=reading, specific_force=force
    )
    np.testing.assert_allclose(back, 0.0, atol=4e-4)
    capsys.readouterr()
    assert cli.main(["export-calibration", calibration, "--to", "c", "--out", str(tmp_path / "imu.h")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "calibrate without --with, or use FMUs" in line


@pytest.mark.acceptance
def test_lags_and_places_of_a_bench_in_motion_are_in_fmus_and_said_elsewhere(warmed, tmp_path):
    """Parameters whose intervals exclude zero; an effect at the same place adds to the lag of all accelerometers."""
    content = json.loads((warmed[0] / "c.json").read_text(encoding="utf-8"))
    symbols = {"A": 2e-3, "L": 3e-3, "r11": 0.02, "r12": 0.0, "r13": 0.0}
    symbols |= dict.fromkeys(("r21", "r22", "r23"), 0.0) | {"B1": 1e-3, "B2": 0.0, "B3": 0.0}
    symbols |= {f"{name}{i}{j}": 0.0 for name in "MS" for i in (1, 2, 3) for j in (1, 2, 3)}
    units = {"A": "s", "L": "s", "S": "rad/s/g", "B": "rad/s", "r": "m", "M": "rad"}
    form = content["parameters"][0]
    for symbol, value in symbols.items():
        ends = {"estimate": value, "low": value - 1e-4, "high": value + 1e-4}
        content["parameters"].append(form | ends | {"symbol": symbol, "name": symbol, "unit": units[symbol[0]]})
    time = form | {"symbol": "time", "name": "time", "unit": "s", "estimate": 1e-3, "low": 9e-4, "high": 11e-4}
    content["effects"] = [
        {"effect": "accelerometer-lag accelerometer-2", "where": "accelerometer-2", "parameters": [time]}
    ]
    content["reading_errors"] = []
    (tmp_path / "c.json").write_text(json.dumps(content), encoding="utf-8")
    _, stays = export_calibrated(Calibration.model_validate(content), tmp_path / "fmus")
    block = values_of(tmp_path / "fmus" / "AccelerometerBlock.ssv")
    lags = [block[f"accelerometer_lag.accelerometer_{k}.time"] for k in (1, 2, 3)]
    assert lags == pytest.approx([2e-3, 3e-3, 2e-3])
    assert block["lever_arm.accelerometer_1.r_1"] == 0.02
    assert "lever_arm.accelerometer_2.r_1" not in block
    gyros = values_of(tmp_path / "fmus" / "GyroBlock.ssv")
    assert gyros["latency.gyro_block.delay"] == 3e-3
    assert "gyro_g_sensitivity.gyro_block.coefficient_11" not in gyros
    assert "AccelerometerCompensation does not take out lever-arm accelerometer-1" in stays
    exported = th.export_calibration(tmp_path / "c.json", "csv", tmp_path / "c.csv")
    assert exported.lost == [
        "accelerometer-lag accelerometer-2 stays in the readings",
        "the gyros' lag of 3 ms: shift their time stamps by it",
        "the accelerometers' lag of 2 ms: shift their time stamps by it",
        "the accelerometers are up to 20 mm off the centre: ω × (ω × r) + dω/dt × r stays",
    ]


def test_components_have_the_first_of_several_explanations_even_where_another_is_a_formula(warmed, tmp_path):
    """Estimates hold with the first explanation."""
    content = json.loads((warmed[0] / "c.json").read_text(encoding="utf-8"))
    first = content["effects"][0]
    zero = [p | {"estimate": 0.0, "low": 0.0, "high": 1e-4} for p in first["parameters"]]
    others = ["cubic accelerometer-2", "formula accelerometer-2 f2 += c * n2"]
    content["effects"] += [{"effect": name, "where": "accelerometer-2", "parameters": zero} for name in others]
    content["sets"] = [{"effects": [name]} for name in (first["effect"], *others)]
    _, stays = export_calibrated(Calibration.model_validate(content), tmp_path / "fmus")
    effects = {name.split(".")[0] for name in values_of(tmp_path / "fmus" / "AccelerometerBlock.ssv") if "." in name}
    assert effects == {"temperature_bias"}
    assert stays[-1] == f"the record does not tell which of 3 explanations is true: these have {first['effect']}"
