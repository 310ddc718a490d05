"""Steps of encoders and readings are seen in a record, go into the bounds, and are reported."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron as th
from diagnoses import diagnosed
from generator.positions import Session, errors
from generator.runs import PROGRAMME, Bench
from trihedron.models.effects import EffectPlace
from trihedron.tools.cli import main
from trihedron.tools.records import PositionRecord, read_record, write_record
from trihedron.tools.records.steps import angle_steps, reading_step

QUADRATIC = EffectPlace("quadratic", "accelerometer-2")
MINUTE = 1.0 / 60.0


def rounded(angle: np.ndarray, step: float) -> np.ndarray:
    """Return angles [rad] rounded to a step [deg]."""
    return np.radians(np.round(np.degrees(angle) / step) * step)


def drawn(seed: int, count: int) -> tuple[Session, np.random.Generator]:
    """Return a session at angles of any value."""
    rng = np.random.default_rng([seed, count])
    session = Session.drawn(rng, count)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    return replace(session, alpha=alpha, beta=beta), rng


def coarse_record(tmp_path, seed: int, count: int, step: float, decimals: int = 6):
    """Return the file of a record whose encoders read in steps [deg]."""
    session, rng = drawn(seed, count)
    angles, reading = session.read((), errors(rng, count)[0])
    path = tmp_path / f"coarse-{seed}.csv"
    write_record(session.recorded(rounded(angles, step), reading), path, decimals)
    return path


@pytest.mark.parametrize("decimals", [4, 6, 9, None])
@pytest.mark.parametrize("step", [0.1, MINUTE, 0.05, 0.01, 10.0 / 3600.0, 360.0 / 2**16, 0.5 * MINUTE])
def test_the_step_of_an_encoder_is_seen_in_its_angles(step, decimals):
    angle = np.degrees(rounded(np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, (2, 24)), step))
    if decimals is not None:
        angle = np.round(angle, decimals)
    assert angle_steps(*np.radians(angle)).degrees == pytest.approx((step, step), rel=1e-4)


@pytest.mark.parametrize("step", [0.5, 5.0, 15.0, 45.0])
def test_wide_grids_are_settings(step):
    angle = rounded(np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, (2, 24)), step)
    assert angle_steps(*angle).error == 0.0


def test_angles_of_any_value_show_no_step():
    assert angle_steps(*np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, (2, 24))).error == 0.0


@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "count", "step"), [(1, 24, 0.1), (2, 48, MINUTE), (3, 36, 0.01), (4, 100, 0.1)])
def test_rounded_angles_do_not_falsify_a_record(seed, count, step, tmp_path):
    path = coarse_record(tmp_path, seed, count, step)
    calibration = th.calibrate(path, noise_bound=1e-5)
    assert calibration.verdict == "consistent"
    (warning,) = [line for line in calibration.warnings if "the angles are in steps of" in line]
    assert "is added to the noise bound of 1e-5 g" in warning
    assert calibration.provenance is not None
    assert calibration.provenance.angle_steps_deg == pytest.approx([step, step], rel=1e-4)
    diagnosis = diagnosed(read_record(path))
    assert (diagnosis.verdict, diagnosis.causes) == ("consistent", ())
    assert any("the angles are in steps of" in line for line in diagnosis.warnings)


def test_intervals_hold_the_truth_with_rounded_angles(tmp_path):
    session, _ = drawn(6, 60)
    calibration = th.calibrate(coarse_record(tmp_path, 6, 60, 0.1), noise_bound=1e-5)
    (kappa,) = [parameter for parameter in calibration.parameters if parameter.symbol == "X1"]
    assert kappa.low is not None
    assert kappa.high is not None
    assert kappa.low <= session.stand.kappa <= kappa.high
    assert kappa.high - kappa.low > 1e-4


@pytest.mark.first(1)
@pytest.mark.parametrize("step", [0.1, MINUTE, 0.001])
def test_a_table_that_stands_at_its_settings_hides_no_effect(step, tmp_path):
    session, rng = drawn(7, 40)
    session = replace(session, alpha=rounded(session.alpha, step), beta=rounded(session.beta, step))
    angles, reading = session.read([(QUADRATIC, (3e-4,))], errors(rng, 40)[0])
    path = tmp_path / "r.csv"
    write_record(session.recorded(angles, reading), path, 9)
    assert th.calibrate(path, noise_bound=1e-5).verdict == "falsified"
    diagnosis = diagnosed(read_record(path))
    assert {cause.place for cause in diagnosis.causes} == {QUADRATIC}


@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "count", "row", "step"), [(11, 28, 2, 0.1), (12, 24, 17, 0.1), (13, 36, 9, MINUTE)])
def test_one_angle_a_step_off_is_no_rounding(seed, count, row, step, tmp_path):
    session, rng = drawn(seed, count)
    session = replace(session, alpha=rounded(session.alpha, step), beta=rounded(session.beta, step))
    angles, reading = session.read((), errors(rng, count)[0])
    angles[row, 0] += np.radians(step)
    path = tmp_path / "r.csv"
    write_record(session.recorded(angles, reading), path, 9)
    assert th.calibrate(path, noise_bound=1e-5).verdict == "falsified"
    diagnosis = diagnosed(read_record(path))
    assert (diagnosis.verdict, diagnosis.explanations[0].rows) == ("explained", (row + 1,))


@pytest.mark.acceptance
def test_the_answer_at_the_terminal_names_the_step(tmp_path, capsys):
    path = coarse_record(tmp_path, 8, 30, 0.1)
    assert main(["diagnose", str(path), "--noise-bound", "1e-5"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("Consistent")
    assert "in steps of 0.1°" in captured.out + captured.err


@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_readings_in_steps_are_not_falsified_and_named(step, tmp_path):
    session, rng = drawn(9, 48)
    angles, reading = session.read((), errors(rng, 48)[0])
    record = session.recorded(angles, reading)
    force = step * np.round(record.specific_force / step)
    path = tmp_path / "steps.csv"
    write_record(replace(record, specific_force=force), path, 9)
    assert read_record(path, PositionRecord).resolution == pytest.approx(0.5 * step, rel=1e-3)
    calibration = th.calibrate(path, noise_bound=1e-5)
    assert calibration.verdict == "consistent"
    assert any("the readings are in steps of" in line for line in calibration.warnings)


def test_rests_that_scatter_too_much_for_the_bound_are_named():
    record, _ = Bench(white=2e-3).run(PROGRAMME)
    (warning,) = [line for line in th.calibrate(record, noise_bound=1e-6).warnings if "too short" in line]
    assert "rests that are" in warning
    assert not [line for line in th.calibrate(record, noise_bound=3e-4).warnings if "too short" in line]


def test_readings_of_any_value_show_no_step():
    assert reading_step(np.random.default_rng(4).normal(size=(40, 3))) == 0.0


@pytest.mark.parametrize("least", [1e-310, 1e-30])
def test_readings_of_extreme_sizes_show_no_step_and_no_warning(least):
    readings = np.linspace(-1.0, 1.0, 60).reshape(20, 3) ** 3
    readings[3], readings[4], readings[5] = 0.0, least, 1e200
    assert reading_step(readings) == 0.0


def test_readings_of_the_smallest_sizes_give_no_warning():
    readings = 1e-310 * (1.0 + np.linspace(-1.0, 1.0, 60).reshape(20, 3) ** 3)
    assert reading_step(readings) < 1e-310
