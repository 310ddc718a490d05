"""The loop of docs/noise.md in one act: static record, noise, σ, simulation with this noise, plan, calibration."""

import json

import numpy as np
import pytest

import trihedron as th
from generator.noise import GRAVITY, noise_series, static_record
from generator.positions import Session
from hidden_noise import SCENARIO
from trihedron.tools.cli import main
from trihedron.tools.orchestrator import read_scenario
from trihedron.tools.records import write_record

STEP, DWELL, POSITIONS = 0.1, 20.0, 24
SIZES = {"N": 1e-3, "B": 3e-4}


def measured_positions(seed: int):
    """Return a record of positions whose averages have the noise of the instrument."""
    rows = round(DWELL / STEP)
    series = [noise_series(POSITIONS * rows, STEP, SIZES, seed + axis) for axis in range(3)]
    means = np.stack(series, axis=1).reshape(POSITIONS, rows, 3).mean(axis=1)
    session = Session.drawn(np.random.default_rng(seed), POSITIONS)
    return session.record(error=(means - means.mean(axis=0)) / GRAVITY)


@pytest.mark.acceptance
def test_from_a_static_record_to_a_calibration(tmp_path, capsys):
    static, scenario = tmp_path / "static.csv", tmp_path / "bench.toml"
    write_record(static_record(36_000, STEP, {"N": 1e-4}, SIZES, seed=11), static)
    scenario.write_text(SCENARIO.format(step=STEP))
    noise_file, noisy, run = tmp_path / "noise.json", tmp_path / "noisy.toml", tmp_path / "run"
    words = ["noise", static, "--dwell", DWELL, "--positions", POSITIONS, "--json", noise_file]
    assert main([str(word) for word in [*words, "--against", scenario, "--export", noisy]]) == 0
    noise = json.loads(noise_file.read_text())
    assert all("B" in one["alternatives"] for one in noise["against"][3:])
    parameters = read_scenario(noisy).fmus["block"].parameters
    assert all(1.5e-4 < size < 6e-4 for size in parameters["bias_instability"])
    assert main(["simulate", str(noisy), "--out", str(run)]) == 0
    assert main(["plan", "positions", "12", "--starts", "1", "--cuts", "0", "--out", str(tmp_path / "plan12")]) == 0
    write_record(measured_positions(4), tmp_path / "positions.csv")
    assert main(["calibrate", str(tmp_path / "positions.csv"), "--noise", str(noise_file)]) == 0
    assert "consistent" in capsys.readouterr().out.lower()
    assert th.calibrate(tmp_path / "positions.csv", noise_result=noise_file).verdict == "consistent"
