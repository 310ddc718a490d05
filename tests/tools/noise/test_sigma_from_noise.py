"""The loop: static record, noise, σ, calibration. σ from the noise hardly ever falsifies clean records."""

import json

import numpy as np
import pytest

import trihedron as th
from generator.noise import GRAVITY, known, noise_series, static_record
from generator.positions import Session
from trihedron.tools.cli import main
from trihedron.tools.records import write_record
from trihedron.tools.rounding import upwards

STEP, ROWS, POSITIONS = 0.1, 200, 24
SIZES = {"N": 1e-3, "B": 3e-5}


@pytest.fixture(scope="module")
def noise():
    return th.noise(static_record(36_000, STEP, {"N": 1e-4}, SIZES, seed=3), dwell=STEP * ROWS, positions=POSITIONS)


def averaged_record(seed: int, count: int = POSITIONS):
    """Return a clean record of positions whose averages have the noise of the same instrument."""
    series = [noise_series(count * ROWS, STEP, SIZES, 100 * seed + axis) for axis in range(3)]
    means = np.stack(series, axis=1).reshape(count, ROWS, 3).mean(axis=1)
    session = Session.drawn(np.random.default_rng(seed), count)
    return session.record(error=(means - means.mean(axis=0)) / GRAVITY)


@pytest.mark.acceptance
def test_clean_records_of_the_instrument_are_consistent(noise):
    """At most one of a hundred is falsified."""
    verdicts = [th.calibrate(averaged_record(seed), noise_result=noise).verdict for seed in range(100)]
    assert verdicts.count("consistent") >= 99


@pytest.mark.acceptance
def test_sigma_is_not_needlessly_wide(noise):
    radii = [float(known(th.calibrate(averaged_record(seed), noise_result=noise).radius)) for seed in range(10)]
    assert np.median(radii) > 0.25


def test_commands_take_the_file(noise, tmp_path, capsys):
    noise_file, record = tmp_path / "noise.json", tmp_path / "positions.csv"
    noise_file.write_text(noise.json_text())
    write_record(averaged_record(1), record)
    (tmp_path / "copy.csv").write_bytes(record.read_bytes())
    out = tmp_path / "calibration.json"
    assert main(["calibrate", str(record), "--noise", str(noise_file), "--json", str(out)]) == 0
    assert json.loads(out.read_text())["sigma"]["kind"] == "estimated"
    assert main(["diagnose", str(record), "--noise", str(noise_file)]) == 0
    capsys.readouterr()
    for words, text in (
        (["--noise", str(noise_file), "--noise-bound", "1e-5"], "σ is given twice"),
        (["--noise", str(noise_file.with_name("copy.csv"))], "is not JSON text"),
        (["--noise", str(out)], "is not a result of `trihedron noise`"),
        (["--noise", str(tmp_path / "missing.json")], "missing.json: no such file"),
    ):
        assert main(["calibrate", str(record), *words]) == 2
        assert text in capsys.readouterr().err
    assert main(["calibrate", str(record), "--noise", str(noise_file), "--json", str(noise_file)]) == 2


@pytest.mark.acceptance
def test_plans_take_the_file(noise, tmp_path, capsys):
    """σ of a plan is that of its dwell and number of positions."""
    file = tmp_path / "noise.json"
    file.write_text(noise.json_text())
    search = ["--cuts", "0", "--starts", "1", "--goal", "levelling", "--accuracy", "100arcsec"]
    words = ["plan", "positions", *search, "--noise", str(file), "--out", str(tmp_path / "plan")]
    assert main(words) == 0
    programme = (tmp_path / "plan" / "programme.csv").read_text().splitlines()
    assert programme[1].endswith(f",{STEP * ROWS:g}")
    capsys.readouterr()
    assert main(["plan", "check", str(tmp_path / "plan" / "angles.csv"), "--noise", str(file)]) == 0
    sigma = noise.average(STEP * ROWS, len(programme) - 1).sigma
    assert f"σ = {upwards(sigma, 6)};" in capsys.readouterr().out
    capsys.readouterr()
    for words, text in (
        (["12"], "--noise: goes with --goal or --accuracy"),
        ([*search, "--noise-bound", "1e-5"], "σ is given twice"),
        ([*search, "--dwell", "5"], "gives σ for 20 s"),
    ):
        assert main(["plan", "positions", *words, "--noise", str(file)]) == 2
        assert text in capsys.readouterr().err


@pytest.mark.acceptance
def test_a_plan_of_an_imu_takes_the_file(noise, tmp_path):
    """The mean noise of a gyro over a second is as likely within its bound as averaged readings."""
    file, plan = tmp_path / "noise.json", tmp_path / "imu.json"
    file.write_text(noise.json_text())
    assert main(["plan", "imu", "--minutes", "40", "--exchanges", "0", "--noise", str(file), "--json", str(plan)]) == 0
    planned = json.loads(plan.read_text())
    assert planned["noise_bound"] == pytest.approx(noise.averaged.sigma, rel=1e-9)
    likely = noise.averaged.sigma / noise.averaged.not_excluded
    assert planned["gyro_noise"] == pytest.approx(likely * 1e-4, rel=0.05)
