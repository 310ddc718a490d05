"""The exported FMUs contain the found effects: without any further setting they give the measured record again."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import polars as pl
import pytest
from fmpy.ssp.ssd import read_ssv

from diagnoses import assert_named, diagnosed, worst_carried
from generator import SIGMA, G
from generator.carried import strapdown_record
from generator.positions import hidden_record
from generator.stands import random_bench, simulated
from parameter_intervals import intervals_in
from scenario_runs import run_of_file
from trihedron.models.effects import EffectPlace, parameter_name
from trihedron.tools.diagnosis import export_extended
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import read_scenario

HARMONIC = EffectPlace("encoder-harmonic", "inner-axis", 3)
HIDDEN = {
    EffectPlace("backlash", "inner-axis"): (3e-4,),
    EffectPlace("scale-step", "accelerometer-2"): (4e-4, 0.05),
    EffectPlace("bias-drift", "accelerometer-3"): (6e-3,),
    EffectPlace("mounting-slip", "mounting"): (2e-4, -3e-4, 1e-4, 0.05),
    EffectPlace("warm-up", "accelerometer-1"): (1e-4, 0.03),
    EffectPlace("thermal-lag", "accelerometer-2"): (1.2e-5, 2e-5, 0.015),
    EffectPlace("quantisation", "accelerometer-3"): (6e-4,),
}
"""Effects and their sizes; `make acceptance` exports slow ones, and those of other tests here."""


@cache
def with_harmonic() -> Any:
    record = hidden_record(17, HARMONIC, (2e-4, 2.0))
    # Steps of a run that begins at zero are exact: FMPy counts them differently.
    result = diagnosed(replace(record, time_s=record.time_s - record.time_s[0]))
    assert_named(result, {HARMONIC: (2e-4, 2.0)})
    return result


def misses(record, again) -> np.ndarray:
    """Return differences (N, 3) of readings over σ."""
    return np.abs(again.specific_force - record.specific_force) / G / SIGMA


@pytest.mark.first(1)
@pytest.mark.parametrize("place", HIDDEN, ids=lambda place: place.title)
def test_the_exported_scenario_gives_the_record_again(place, tmp_path):
    """The simulation of the export gives every reading within σ, at the record's times and encoder readings."""
    record = hidden_record(17, place, HIDDEN[place])
    result = diagnosed(record)
    assert [cause.place for cause in result.causes] == [place]
    export_extended(result, tmp_path)
    run = run_of_file(tmp_path / "scenario.toml")
    again = run.position_record()
    assert len(again) == len(record)
    off = misses(record, again)
    if place.effect == "quantisation":
        # Noise at a step: no simulation shows the side to which a reading was rounded.
        assert (off <= 1.0).mean() > 0.75
        off = np.minimum(off, np.abs(off - HIDDEN[place][0] / SIGMA))
    assert off.max() <= 1.0
    assert np.abs(again.alpha - record.alpha).max() < 1e-9
    assert np.abs(again.beta - record.beta).max() < 1e-9
    # The rests are centred on the record's times, except the first, which begins with the run. For readings that bend
    # within a rest without noise, the last part counts.
    steps = 10 if place.effect in ("warm-up", "thermal-lag") else 1
    assert np.abs(again.time_s - record.time_s)[1:].max() <= run.scenario.run.step_s * steps
    assert (again.approach_alpha == record.approach_alpha).all()


@pytest.mark.acceptance
def test_a_record_in_two_mountings_has_a_run_for_each(tmp_path):
    """The FMUs start with the first mounting; the scenario of the other sets the differences."""
    matrices = {"first": np.eye(3), "second": np.roll(np.eye(3), 1, axis=1)}
    rng = np.random.default_rng(8)
    bench, parts = random_bench(rng), []
    for matrix in matrices.values():
        bench[6:9] = rng.uniform(-3e-3, 3e-3, 3)
        parts.append(simulated(bench, noise=rng.uniform(-SIGMA, SIGMA, (24, 3)), mounting=matrix))
    count = np.arange(48)
    record = replace(
        parts[0],
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ("alpha", "beta")},
        specific_force=np.vstack([part.specific_force for part in parts]),
        time_s=30.0 * count,
        position=count + 1,
        row=count + 1,
        mounting=("first",) * 24 + ("second",) * 24,
    )
    record.specific_force[:, 0] += 6e-4 * G * record.time_s / 3600.0
    written = {name: matrix.tolist() for name, matrix in matrices.items()}
    result = diagnosed(record, mounting=written)
    assert [cause.title for cause in result.causes] == ["bias-drift accelerometer-1"]
    export_extended(result, tmp_path)
    for scenario, rows in (("scenario.toml", count[:24]), ("scenario-2.toml", count[24:])):
        again = run_of_file(tmp_path / scenario).position_record()
        assert misses(record.selected(rows), again).max() <= 1.0
    assert len(read_ssv(str(tmp_path / "TurntableMotion-2.ssv")).parameters) > 10


@pytest.mark.acceptance
def test_both_flavours_and_fmpy_give_the_same_bits(tmp_path):
    """FMPy runs the table, and the block on its specific force, without setting any found value."""
    runs = {}
    for flavour in ("native", "python"):
        export_extended(with_harmonic(), tmp_path / flavour, flavour)
        runs[flavour] = run_of_file(tmp_path / flavour / "scenario.toml").table
    assert runs["native"].equals(runs["python"])
    scenario, folder = read_scenario(tmp_path / "native" / "scenario.toml"), tmp_path / "native"
    rows, times = pl.read_csv(folder / "scenario-rows.csv"), runs["native"]["time_s"].to_numpy()
    row_of_time = np.searchsorted(rows["time_s"].to_numpy(), times + 1e-6 * scenario.run.step_s, side="right") - 1
    commands = {f"command[{i}]": rows[name].to_numpy()[row_of_time] for i, name in ((1, "alpha_rad"), (2, "beta_rad"))}
    parameters = scenario.fmus["table"].parameters
    of_run = {k: v for k, v in parameters.items() if not isinstance(v, list)}
    of_run |= {f"{k}[{i}]": x for k, v in parameters.items() if isinstance(v, list) for i, x in enumerate(v, start=1)}
    force = with_fmpy(folder / "TurntableMotion.fmu", times, commands, "specific_force", of_run)
    # The table's output at the end of a step is the block's input over it.
    inputs = {f"specific_force[{i}]": np.append(force[1:, i - 1], force[-1, i - 1]) for i in (1, 2, 3)}
    reading = with_fmpy(folder / "AccelerometerBlock.fmu", times, inputs, "reading", {})
    assert (reading[1:] == runs["native"].select("f1_mps2", "f2_mps2", "f3_mps2").to_numpy()[1:]).all()


@pytest.mark.acceptance
def test_start_values_and_parameter_sets_hold_values_and_intervals(tmp_path):
    """The FMU's start values are those of the JSON; the .ssv, valid to SSP's schemas, has the intervals too."""
    result, place = with_harmonic(), HARMONIC
    files = export_extended(result, tmp_path)
    assert [path.name for path in files] == [
        *("TurntableMotion.fmu", "AccelerometerBlock.fmu", "TurntableMotion.ssv", "AccelerometerBlock.ssv"),
        *("scenario.toml", "scenario-rows.csv"),
    ]
    content = result.to_json()
    targets = {entry["symbol"]: entry for entry in content["targets"]}
    expected = {"TurntableMotion": {"kappa": targets["X1"], "epsilon": targets["X3"], "alpha_offset": targets["X2"]}}
    expected["TurntableMotion"] |= {f"mounting_error[{i}]": targets[x] for i, x in ((1, "X13"), (2, "-X12"), (3, "X8"))}
    for parameter in content["causes"][0]["parameters"]:
        name = parameter_name(place, parameter["name"])
        expected["TurntableMotion"][name] = {**parameter, "after": parameter["estimate"]}
    expected["AccelerometerBlock"] = {"gamma_21": targets["X6+X8"], "gamma_32": targets["X11+X13"]}
    pairs = (("plus", ("X4", "X9", "X14")), ("minus", ("X5", "X10", "X15")))
    for sign, symbols in pairs:
        expected["AccelerometerBlock"] |= {f"scale_error_{sign}[{i}]": targets[x] for i, x in enumerate(symbols, 1)}
    expected["AccelerometerBlock"] |= {f"bias[{i}]": targets[f"X{15 + i}"] for i in (1, 2, 3)}
    for component, entries in expected.items():
        starts = starts_of(tmp_path / f"{component}.fmu")
        path = tmp_path / f"{component}.ssv"
        set_values = {p.name: float(p.value) for p in read_ssv(str(path)).parameters}
        ends = intervals_in(path)
        for name, entry in entries.items():
            assert entry["after"] != 0.0
            assert starts[name] == set_values[name] == entry["after"]
            assert entry["low"] <= entry["after"] <= entry["high"]
            assert ends[name] == (entry["low"], entry["high"])
        assert set(ends) <= set(set_values)


@pytest.mark.acceptance
def test_a_strapdown_record_is_carried_again(tmp_path):
    """Gravity agrees with the accelerometers after every move, within the bounds; both ways give the same bits."""
    place = EffectPlace("gyro-g-sensitivity", "gyro-block")
    matrix = 2e-3 * np.array([[1.0, 0.2, -0.5], [0.3, -2.0, 0.4], [0.0, 0.3, 1.5]])
    record = strapdown_record(seed=3, gyro_bias=np.array([2e-3, -1e-3, 1.5e-3]), sensitivity=matrix)
    result = diagnosed(record)
    assert [cause.place for cause in result.causes] == [place]
    runs = {}
    for flavour in ("native", "python"):
        export_extended(result, tmp_path / flavour, flavour)
        runs[flavour] = run_of_file(tmp_path / flavour / "scenario.toml").table
    assert runs["native"].equals(runs["python"])
    assert worst_carried(result.evidence, runs["native"]) <= 1.0
    starts = starts_of(tmp_path / "native" / "GyroCompensation.fmu")
    stated = {p["name"]: p["estimate"] for p in result.stated.to_json()["parameters"]}
    assert [starts[f"bias[{i}]"] for i in (1, 2, 3)] == [stated[f"gyro bias_{i}"] for i in (1, 2, 3)]
    ends = intervals_in(tmp_path / "native" / "GyroCompensation.ssv")
    for parameter in result.causes[0].parameters:
        name = parameter_name(place, parameter.name)
        assert starts[name] == parameter.estimate
        assert ends[name] == (parameter.low, parameter.high)


@pytest.mark.acceptance
def test_nothing_is_written_where_nothing_is_explained_and_a_value_beyond_a_component_is_said(tmp_path):
    result = with_harmonic()
    assert export_extended(result.model_copy(update={"verdict": "ambiguous"}), tmp_path / "none") == []
    assert not (tmp_path / "none").exists()
    finding = result.findings[0]
    far = replace(finding, fit=replace(finding.fit, estimate=finding.fit.estimate + 0.6))
    with pytest.raises(InputError, match=r"--export .*kappa = 0\.\d+ is beyond what TurntableMotion takes"):
        export_extended(result.model_copy(update={"findings": (far,)}), tmp_path / "far")
    assert not (tmp_path / "far").exists()


def starts_of(path: Path) -> dict[str, float]:
    """Return the start values of an FMU's parameters, by name."""
    variables = fmpy.read_model_description(path).modelVariables
    return {str(v.name): float(v.start or "nan") for v in variables if v.causality == "parameter" and v.type == "Real"}


def with_fmpy(path: Path, times: np.ndarray, inputs: dict, output: str, values: dict) -> np.ndarray:
    """Return FMPy's outputs (N, 3) of an array at the times, each input held over the step that begins there."""
    step = float(times[1] - times[0])
    kinds = [("time", float), *((name, float) for name in inputs)]
    rows = np.array(list(zip(times, *inputs.values(), strict=True)), dtype=kinds)
    names = [f"{output}[{i}]" for i in (1, 2, 3)]
    outputs = fmpy.simulate_fmu(
        str(path), start_time=times[0], stop_time=times[-1], step_size=step, output_interval=step,
        input=rows, output=names, start_values=values,
    )  # fmt: skip
    return np.column_stack([outputs[name] for name in names])
