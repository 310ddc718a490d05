"""One run of a campaign equals the same run of the tool itself."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from attitude_motions import paper_error
from foreign_fmus import build_foreign
from named import Named
from trihedron.models.bench import TARGETS
from trihedron.tools.campaign import Campaign, carry_out_campaign, parse_campaign
from trihedron.tools.campaign.kinds import RunOutputs, motion_samples, reduced
from trihedron.tools.campaign.runs import Design, columns_of, make_runner
from trihedron.tools.campaign.store import make_order
from trihedron.tools.errors import InputError
from trihedron.tools.motion import (
    GyroErrors,
    algorithm_named,
    angle_between,
    angles_of_runs,
    read_increments,
    run_algorithm,
)
from trihedron.tools.motion.compare import LANES
from trihedron.tools.orchestrator import PreparedScenario, Scenario, read_scenario, run_scenario
from trihedron.tools.trials import Options, run_suite

ROOT = Path(__file__).resolve().parents[3]
HEAD = 'schema = "trihedron.campaign/1"\n'


def parsed(text: str, folder: Path = Path()) -> Campaign:
    return parse_campaign((HEAD + text).encode(), folder / "c.toml")


def results(campaign: Campaign) -> list[RunOutputs]:
    design, runner = Design(campaign), make_runner(campaign)
    table = [runner.run(k, design.values(k), design.seed(k)) for k in range(campaign.runs)]
    assert all(set(result.scalars) <= set(runner.outputs) for result in table)
    return table


@pytest.mark.acceptance
def test_true_values_are_inside_whatever_the_noise_within_sigma():
    for noise in ("uniform", "edge"):
        for result in results(parsed(f"repeats = 6\n[calibration]\nnoise = '{noise}'\n")):
            assert result.scalars["verdict"] == "consistent"
            assert result.scalars["misses"] == 0
            assert float(result.scalars["worst_error_ratio"] or 2.0) <= 1.0
            assert all(result.scalars[f"{symbol}_width"] is not None for symbol in TARGETS)


def test_noise_beyond_sigma_falsifies():
    (result,) = results(parsed("[calibration]\nnoise = 'edge'\nnoise_part = 8.0\n"))
    assert result.scalars["verdict"] == "falsified"
    assert float(result.scalars["radius"] or 0.0) > 1.0


def test_a_symmetric_block_and_a_swept_parameter():
    text = "[calibration]\nbaseline = 'symmetric'\ntruth = 'given'\nnoise_part = 0.0\n"
    text += "[parameters]\nkappa = { values = [2e-3] }\n"
    (result,) = results(parsed(text + "[keep]\nrecord = true\n"))
    assert "X5_error" not in result.scalars
    assert float(result.scalars["X1_error"] or 0.0) < 1e-9
    assert result.record is not None
    assert result.record.columns[:4] == ["position", "time_s", "alpha_deg", "beta_deg"]
    assert result.record.height == 24


def test_positions_of_ones_own(tmp_path):
    (tmp_path / "own.csv").write_text(
        "alpha_deg,beta_deg\n" + "\n".join(f"{20 + 31 * k},{25 + 47 * k}" for k in range(30))
    )
    (result,) = results(parsed("[calibration]\npositions = 'own.csv'\n", tmp_path))
    assert result.scalars["verdict"] == "consistent"
    (tmp_path / "own.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="not a list of positions"):
        make_runner(parsed("[calibration]\npositions = 'own.csv'\n", tmp_path))


@pytest.mark.acceptance
def test_faultless_gyros_leave_the_algorithms_own_error():
    (result,) = results(parsed("[attitude]\nrate_hz = 100.0\n"))
    expected_error = paper_error(algorithm_named("two-sample-rodrigues"), "1", 100.0)
    assert result.scalars["largest_error_rad"] == pytest.approx(expected_error, rel=1e-6)


@pytest.mark.acceptance
def test_gyros_err_as_the_component_does():
    samples, _ = motion_samples("1", 1.0, 1.0, 0.01, 40)
    gamma, bias = np.linspace(-1e-3, 1e-3, 9), np.array([1e-3, -2e-3, 3e-3])
    table = read_increments(samples, gamma, bias, 1e-4, 1e-3, 77)
    errors = {"quantum": 1e-4, "noise_bound": 1e-3, "seed": 77.0, "input_kind": 1.0}
    model = Named("GyroBlock", scale_misalignment=gamma, bias=bias, **errors).begin()
    for step, increment in enumerate(samples.increments):
        model.put(increment=increment).step(step * 0.01, 0.01)
        assert model["increment_reading"].tolist() == table[step].tolist()


@pytest.mark.parametrize("quantum", [0.0, 1e-5])
def test_runs_that_are_made_together_have_the_bits_of_single_runs(quantum: float):
    samples, attitudes = motion_samples("2", 1.0, 1.0, 0.01, 41)
    algorithm, draw = algorithm_named("two-sample-rodrigues"), np.random.default_rng(1)
    runs = []
    for seed in range(LANES + 3):
        runs.append(
            GyroErrors(1e-3 * draw.normal(size=9), 1e-3 * draw.normal(size=3), quantum * (seed % 2), 1e-4, seed)
        )
    for angles, gyros in zip(angles_of_runs(algorithm, samples, attitudes, runs), runs, strict=True):
        computed = run_algorithm(algorithm, read_increments(samples, *gyros), renormalise=True)
        assert angles.tolist() == angle_between(computed, attitudes[1:40:2]).tolist()


@pytest.mark.acceptance
def test_a_bias_turns_the_attitude_by_its_integral():
    text = "[attitude]\nmotion = 'small'\nduration_s = 10.0\n[parameters]\nbias_1_radps = { values = [1e-5, 2e-5] }\n"
    first, second = (float(result.scalars["last_error_rad"] or 0.0) for result in results(parsed(text)))
    assert first == pytest.approx(1e-4, rel=0.01)
    assert second == pytest.approx(2e-4, rel=0.01)


def test_a_run_without_enough_samples_fails_alone():
    text = "[attitude]\nrate_hz = 100.0\n[parameters]\nduration_s = { values = [0.01] }\n"
    with pytest.raises(InputError, match="from 8 to"):
        results(parsed(text))


def test_a_scenario_run_again_and_again_gives_the_bits_of_simulate():
    scenario = read_scenario(ROOT / "scenarios" / "table-attitude.toml")
    once = run_scenario(scenario).table
    repeated = PreparedScenario(scenario)
    changed = repeated.run({"table": {"kappa": 2e-3}})
    assert repeated.run({}).equals(once)
    assert not changed.equals(once)
    scenario_data = scenario.as_written()
    scenario_data["fmus"]["table"]["parameters"]["kappa"] = 2e-3
    scenario_data["stimuli"][0]["csv"] = str(ROOT / "scenarios" / scenario_data["stimuli"][0]["csv"])
    assert run_scenario(Scenario.model_validate(scenario_data)).table.equals(changed)
    repeated.close()


SIMULATION = """
[simulation]
scenario = "static-calibration.toml"
calibrate = true
[simulation.scalars]
alpha = { column = "alpha_deg" }
f1_largest = { column = "f1_mps2", take = "max-abs" }
[parameters]
"block.bias[1]" = { values = [1e-3, -4e-3] }
[keep]
record = true
"""


def test_a_simulation_is_measured_and_calibrated():
    first, second = results(parsed(SIMULATION, ROOT / "scenarios"))
    for result, bias in ((first, 1e-3), (second, -4e-3)):
        assert result.scalars["verdict"] == "consistent"
        error = float(result.scalars["X16_estimate"] or 0.0) - bias
        assert abs(error) <= float(result.scalars["X16_guaranteed"] or 0.0)
        assert result.record is not None
        assert result.record.height == 24
    # Each run has its own errors.
    assert first.scalars["X17_estimate"] != second.scalars["X17_estimate"]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("block.bias[1]", "blok.bias[1]", "did you mean 'block'?"),
        ("block.bias[1]", "block.bais[1]", "parameters.block.bais[1]"),
        ("block.bias[1]", "block.bias", "has 3 elements"),
        ('"alpha_deg"', '"alfa_deg"', "the record has no column 'alfa_deg'"),
        ('"f1_mps2"', '"f4_mps2"', "simulation.scalars.f1_largest: the record has no column 'f4_mps2'"),
        ("static-calibration.toml", "none.toml", "no such file"),
    ],
)
def test_what_a_scenario_does_not_have_is_refused(before, after, message):
    campaign = parsed(SIMULATION.replace(before, after), ROOT / "scenarios")
    with pytest.raises(InputError) as caught:
        columns_of(campaign, make_runner(campaign))
    assert message in str(caught.value)


def test_a_scenario_goes_out_with_all_the_files_that_it_reads(tmp_path):
    (tmp_path / "c.toml").write_text(HEAD + f"[simulation]\nscenario = '{ROOT}/scenarios/static-calibration.toml'\n")
    campaign = ROOT / "scenarios" / "campaigns" / "attitude-60s.toml"
    assert [name for name, _ in make_order(campaign)[0].files] == ["attitude-60s.toml"]
    order, _ = make_order(tmp_path / "c.toml")
    names = [name.rpartition("/")[2] for name, _ in order.files]
    assert sorted(names) == ["c.toml", "static-calibration-positions.csv", "static-calibration.toml"]


@pytest.mark.parametrize("take", ["last", "first", "mean", "min", "max", "max-abs", "rms", "std"])
def test_a_column_becomes_a_number(take):
    expected = {"last": -3.0, "first": 1.0, "mean": 0.0, "min": -3.0, "max": 2.0, "max-abs": 3.0}
    expected |= {"rms": np.sqrt(14 / 3), "std": np.sqrt(14 / 3)}
    assert reduced(np.array([1.0, 2.0, -3.0]), take) == pytest.approx(expected[take])


@pytest.mark.acceptance
def test_hidden_effect_cases_are_those_of_the_suite():
    text = "seed = 5\nrepeats = 1\n[hidden]\neffects = ['quadratic']\npositions = [14, 18]\nnoise = 'uniform'\n"
    suite: Any = run_suite(Options("single", ("quadratic",), (14, 18), "uniform"), 1, 5)
    table = results(parsed(text + "[keep]\ndiagnosis = true\n"))
    for outcome, result in zip(suite.results, table, strict=True):
        assert result.scalars["outcome"] == outcome.outcome == "right"
        assert result.scalars["radius"] == outcome.radius
        assert result.scalars["relative_size"] == outcome.hidden[0].relative_size
        assert result.scalars["named"] == result.scalars["hidden"] == "quadratic"
        diagnosed = json.loads(result.diagnosis or "")
        assert {key: diagnosed[key] for key in outcome.to_json()} == json.loads(json.dumps(outcome.to_json()))
        assert diagnosed["diagnosis"]["schema"] == "trihedron.diagnosis/3"


@pytest.mark.acceptance
def test_an_fmu_that_takes_its_process_with_it_costs_its_run_alone(tmp_path):
    """An FMU ends its process in one run, fails in another, and works in the others; no worker ends."""
    build_foreign("foreign_deadly", tmp_path)
    (tmp_path / "scenario.toml").write_text(
        'schema = "trihedron.scenario/1"\n[run]\nstop_s = 1.0\nstep_s = 0.5\n[fmus.f]\nfmu = "Deadly.fmu"\n'
    )
    (tmp_path / "c.toml").write_text(
        HEAD + "partition = 3\n[simulation]\nscenario = 'scenario.toml'\n"
        "[parameters]\n'f.level' = { values = [0.0, 2.0, -2.0, 0.5, 1.0] }\n"
    )
    summary = carry_out_campaign(tmp_path / "c.toml", tmp_path / "out", jobs=1)
    assert summary.runs == 5
    assert summary.failed == 2
    table = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert table["failed"].is_not_null().to_list() == [False, True, True, False, False]
    assert "fmi2DoStep at 0 s ended its process (exit status 9)" in table["failed"][1]
    assert "level too low" in table["failed"][2]
    assert table["f.y"].to_list() == [0.5, None, None, 1.0, 1.5]
