"""The inspection of a strapdown record: simulated records with known truth, hostile ones, measured ones."""

import json
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from generator import G
from generator.carried import PERIOD, POSES, strapdown_record, true_motion
from record_files import measured
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.motion import calibrate_by_norm, inspect_record, norm_block, sampling_of
from trihedron.tools.motion.rests import reading_steps
from trihedron.tools.records import StrapdownRecord, write_record
from trihedron.tools.records.sigma import deviation_widening
from trihedron.tools.reports import allan_picture, allan_points
from trihedron.tools.rounding import exactly

GAMMA = np.array([[4e-3, 0.0, 0.0], [2e-3, -5e-3, 0.0], [-3e-3, 6e-3, 8e-3]])
BIAS = np.array([0.01, -0.02, 0.03])
TRUTH = np.concatenate([GAMMA[np.tril_indices(3)], BIAS])
GYRO_BIAS = np.array([0.01, -0.02, 0.005])


def inspected(record: Any, **columns: Any) -> Any:
    """Return the inspection of a record, with other columns; its use asserts optional parts."""
    return inspect_record(replace(record, **columns))


def chosen(record: Any, rows: np.ndarray) -> StrapdownRecord:
    """Return the record with some of its rows."""
    return StrapdownRecord(record.time_s[rows], record.rate[rows], None, record.specific_force[rows])


def test_rests_moves_and_excitation_are_those_of_the_motion():
    inspection = inspected(strapdown_record(gyro_bias=GYRO_BIAS))
    assert len(inspection.rests) == len(POSES)
    assert inspection.rests.force == pytest.approx(G * POSES, abs=0.01)
    assert inspection.rests.time_s == pytest.approx(1.5 + 4.5 * np.arange(len(POSES)), abs=0.15)
    _, rate, _ = true_motion()
    turned = PERIOD * np.linalg.norm(rate, axis=1).sum()
    assert sum(move.turn_rad for move in inspection.moves) == pytest.approx(turned, rel=0.02)
    assert inspection.turning.matrix == pytest.approx(np.eye(3), abs=0.05)
    assert inspection.turning.said == ()


def column(inspection: Any, name: str) -> np.ndarray:
    """Return numbers (9,) of the parameters of a calibration."""
    return inspection.to_polars()[name].to_numpy()


@pytest.mark.parametrize("seed", range(2))
def test_accelerometers_are_calibrated_within_their_guaranteed_ends(seed):
    inspection = inspected(strapdown_record(seed=seed, gamma=GAMMA, bias_g=BIAS)).accelerometers
    assert inspection.verdict == "consistent"
    low, high = column(inspection, "low"), column(inspection, "high")
    assert np.all((low <= TRUTH) & (high >= TRUTH) & (high - low < 0.03))
    assert np.abs((column(inspection, "estimate") - TRUTH) / column(inspection, "standard_error")).max() < 5.0


def test_an_effect_that_nine_parameters_cannot_hold_falsifies_them():
    time, rate, n = true_motion()
    record: Any = strapdown_record((time, rate, n + 0.02 * n**3 * np.array([0.0, 0.0, 1.0]) + 0.02 * n**2))
    inspection = inspected(record).accelerometers
    assert inspection.verdict == "falsified"
    assert inspection.radius > 1.0
    assert inspection.to_polars()["low"].null_count() == 9


def test_missing_poses_are_named_and_mend_it():
    """The block was never turned over: its third axis is mostly up."""
    few = POSES[POSES[:, 2] > 0.5]
    inspection = inspected(strapdown_record(true_motion(few))).accelerometers
    assert inspection.verdict == "insufficient"
    assert any("down" in direction.close_by for direction in inspection.open)
    signs = {"up": 1.0, "down": -1.0}
    added = []
    for pose in [direction.close_by for direction in inspection.open]:
        words = pose.replace(",", "").split()
        pairs = [(int(words[i + 1]) - 1, signs[words[i + 2]]) for i, word in enumerate(words) if word == "axis"]
        added.append(sum(sign * np.eye(3)[p] for p, sign in pairs) / np.sqrt(len(pairs)))
    mended = inspected(strapdown_record(true_motion(np.vstack([few, added])))).accelerometers
    assert mended.verdict == "consistent"


@pytest.mark.acceptance
def test_constant_gyros_are_constant_and_nothing_is_named_on_clean_records():
    for seed in range(3):
        gyros = inspected(strapdown_record(seed=seed, gyro_bias=GYRO_BIAS)).gyros
        assert gyros.verdict == "constant"
        assert np.array(gyros.standing[0].coefficients)[:, 0] == pytest.approx(GYRO_BIAS, abs=3e-4)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("drift", {"drift": np.array([0.2, -0.1, 0.15])}),
        ("gravity", {"sensitivity": np.array([[0.002, 0.0, 0.001], [0.0, -0.001, 0.0], [0.001, 0.0, 0.002]])}),
        ("temperature", {"gyro_bias": None}),
    ],
)
def test_what_the_gyros_depend_on_at_rest_is_named(name: str, effect: dict[str, Any]):
    motion = true_motion()
    time = motion[0]
    warmth = 25.0 + 4.0 * np.sin(time / 9.0)
    if name == "temperature":
        effect = {"gyro_bias": (warmth - 20.0)[:, None] * np.array([1e-3, 0.0, -5e-4])}
    gyros = inspected(strapdown_record(motion, temperature=warmth, **effect)).gyros
    assert gyros.verdict == "named"
    assert gyros.standing[0].terms == (name,)
    assert gyros.standing[0].by_chance == 0.0


def test_biases_that_change_from_rest_to_rest_are_given_no_cause():
    """Nothing in the record explains them, so nothing is named."""
    motion = true_motion()
    steps = np.repeat(np.random.default_rng(8).normal(0.0, 1e-3, (len(POSES), 3)), 450, axis=0)[: len(motion[0])]
    gyros = inspected(strapdown_record(motion, gyro_bias=steps)).gyros
    assert gyros.verdict == "wandering"
    assert gyros.standing == ()


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda w: w * [1.0, -1.0, 1.0], "gyro 2 has the wrong sign about axis 2"),
        (lambda w: w[:, [1, 0, 2]], "about axis 1 of the accelerometers is read by gyro 2"),
    ],
)
def test_wrong_units_signs_and_orders_of_the_gyros_are_said(change, words):
    record: Any = strapdown_record()
    inspection = inspected(record, rate=change(record.rate))
    assert any(words in line for line in inspection.turning.said)
    assert words in str(inspection)


def test_gaps_jitter_dead_and_saturated_channels_are_stated():
    record: Any = strapdown_record()
    rate = np.clip(record.rate, -1.0, 1.0)
    rate[:, 2] = 0.0
    rows = np.ones(len(record), dtype=bool)
    rows[1000:1200] = False
    time = record.time_s + np.random.default_rng(1).uniform(-1e-3, 1e-3, len(record))
    hurt = chosen(StrapdownRecord(time, rate, None, record.specific_force), rows)
    inspection = inspected(hurt)
    assert inspection.sampling.missing == 200
    gap = inspection.sampling.gaps[0]
    assert (gap.time_s, gap.length_s) == pytest.approx((10.0, 2.01), abs=0.01)
    assert inspection.sampling.jitter_rms == pytest.approx(1e-3 * np.sqrt(2.0 / 3.0), rel=0.1)
    assert inspection.sampling.dead == ("w3",)
    assert inspection.sampling.saturated.keys() == {"w1", "w2"}
    clipped = int((np.abs(rate[rows]) == 1.0).sum())
    assert sum(inspection.sampling.saturated.values()) == pytest.approx(clipped, abs=4)
    text = str(inspection)
    assert "w3: dead" in text
    assert "200 rows missing" in text


def test_a_clean_record_has_no_saturated_rows_and_its_increments_are_as_good_as_rates():
    record: Any = strapdown_record()
    assert sampling_of(record).saturated == {}
    summed = StrapdownRecord(record.time_s, None, record.rate * PERIOD, record.specific_force)
    first, second = inspected(record), inspected(summed)
    assert second.rests.rows == first.rests.rows
    assert second.rests.rate == pytest.approx(first.rests.rate, rel=1e-9, abs=1e-12)


@pytest.mark.acceptance
def test_with_thirty_percent_of_the_rows_missing_no_wrong_thing_is_named():
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS)
    keep = np.sort(np.random.default_rng(2).permutation(len(record))[: int(0.7 * len(record))])
    inspection = inspected(chosen(record, keep))
    assert inspection.sampling.missing == pytest.approx(0.3 * len(record), rel=0.02)
    assert inspection.gyros is None or inspection.gyros.verdict in ("constant", "insufficient")
    assert inspection.accelerometers is None or inspection.accelerometers.verdict != "falsified"


def test_a_record_without_noise_and_one_of_few_rows():
    force = np.tile([0.0, 0.0, G], (3000, 1))
    inspection = inspected(StrapdownRecord(PERIOD * np.arange(3000), np.zeros((3000, 3)), None, force))
    assert len(inspection.sampling.dead) == 6
    assert inspection.accelerometers is None or inspection.accelerometers.verdict == "insufficient"
    with pytest.raises(InputError, match="at least 16"):
        inspected(chosen(strapdown_record(), np.arange(8)))


@pytest.mark.acceptance
def test_rests_without_noise_are_where_nothing_changes():
    exact = strapdown_record(gyro_bias=GYRO_BIAS, force_noise=0.0, rate_noise=0.0)
    # As computed attitudes come: occasionally a last digit differs.
    force = exact.specific_force * np.where(np.arange(len(exact)) % 37 == 0, 1.0 + 2e-16, 1.0)[:, None]
    inspection = inspected(replace(exact, specific_force=force))
    assert inspection.rests.force == pytest.approx(G * POSES, abs=1e-12)
    assert len(inspection.moves) == len(POSES) - 1
    assert inspection.accelerometers is not None
    assert inspection.accelerometers.verdict == "consistent"


@pytest.mark.acceptance
def test_a_single_rest_has_one_length_and_nine_rests_no_standard_errors(tmp_path, capsys):
    for count in (1, 9):
        write_record(strapdown_record(true_motion(POSES[:count])), tmp_path / f"{count}.csv")
        assert main(["inspect", str(tmp_path / f"{count}.csv")]) == 0
    printed = capsys.readouterr().out
    assert "1 rest of 2.6 s" in printed
    assert "scale factor of accelerometer 1" in printed
    assert "±" not in printed


def test_the_allan_curve_of_white_noise_falls_as_its_root():
    rng = np.random.default_rng(5)
    times, deviation = allan_points(rng.standard_normal((40000, 3)), [slice(0, 40000)], PERIOD)
    short = times < 1.0
    assert deviation[short] == pytest.approx(np.sqrt(PERIOD / times[short])[:, None] * np.ones(3), rel=0.1)


@pytest.mark.acceptance
def test_the_command_prints_writes_json_and_a_picture(tmp_path, capsys):
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS)
    path, text, picture = tmp_path / "r.csv", tmp_path / "r.json", tmp_path / "a.svg"
    write_record(record, path)
    assert main(["inspect", str(path), "--json", str(text), "--allan", str(picture)]) == 0
    printed = capsys.readouterr().out
    assert "14 rests" in printed
    assert "Accelerometers, by |f| = g at rest: consistent" in printed
    words = json.loads(text.read_text(encoding="utf-8"))
    assert words["schema"] == "trihedron.inspection/1"
    assert words["gyros_at_rest"]["verdict"] == "constant"
    assert ElementTree.fromstring(picture.read_text(encoding="utf-8")).tag.endswith("svg")
    assert main(["inspect", str(path), "--gravity", "0"]) == 2
    assert "gravity" in capsys.readouterr().err


def test_the_picture_of_a_record_without_rests_says_so():
    record = chosen(strapdown_record(), np.arange(40))
    assert "no rests" in allan_picture(inspected(record)).svg()


@pytest.mark.acceptance
@pytest.mark.parametrize("limit", [0.6, 0.9, 0.999])
def test_rests_with_an_accelerometer_at_its_limit_are_left_out(limit):
    """Their means would falsify the norm calibration; the others give the true parameters."""
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS)
    force = np.array(record.specific_force)
    unchanged = inspected(record).rests
    level = limit * force[:, 2].max() if limit > 0.95 else limit * G
    force[:, 2] = np.clip(force[:, 2], -level, level)
    inspection = inspected(record, specific_force=force)
    surely = int((np.abs(unchanged.force[:, 2]) > level).sum())
    assert inspection.rests.clipped >= surely
    assert surely > 0 or limit > 0.95
    assert len(inspection.rests) == len(POSES) - inspection.rests.clipped
    assert (inspection.rests.clipped > 0) == (f"its limit: {inspection.rests.clipped}, left out" in str(inspection))
    calibration = inspection.accelerometers
    assert calibration.verdict != "falsified"


@pytest.mark.acceptance
def test_no_rest_of_a_sound_record_counts_as_clipped():
    """Test readings in steps, and others."""
    for step in (0.0, 0.02, 0.05, 0.2):
        record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS, seed=2)
        force = record.specific_force if step == 0.0 else step * np.round(record.specific_force / step)
        assert inspected(record, specific_force=force).rests.clipped == 0


@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "step_g"), [(0, 0.003), (1, 0.006), (2, 0.01)])
def test_steps_of_the_readings_count_in_the_bounds_of_their_means(seed, step_g):
    """Noise of 0.3 mg does not average steps of 3 mg and more out: half a step may remain."""
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS, force_noise=3e-3, seed=seed)
    force = np.array(record.specific_force)
    force[:, 1] = step_g * G * np.round(force[:, 1] / (step_g * G))
    inspection = inspected(record, specific_force=force)
    assert inspection.rests.step[1] == pytest.approx(step_g * G, rel=1e-6)
    assert inspection.rests.step[[0, 2]] == pytest.approx(0.0, abs=0.0)
    assert f"f2 reads in steps of {exactly(step_g)} g" in str(inspection)
    calibration = inspection.accelerometers
    assert calibration.verdict == "consistent"
    assert np.all((column(calibration, "low") <= TRUTH) & (column(calibration, "high") >= TRUTH))


@pytest.mark.parametrize("decimals", [None, 9, 6])
def test_accelerometers_without_noise_do_not_read_in_steps(decimals):
    """Each rest has one value, as with coarse steps; but the values have no common divisor."""
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS, force_noise=0.0)
    force = record.specific_force if decimals is None else np.round(record.specific_force, decimals)
    inspection = inspected(record, specific_force=force)
    assert len(inspection.rests) == len(POSES)
    assert not inspection.rests.step.any()
    assert inspection.rests.force_scatter.max() < 1e-5 * G


def test_a_step_is_found_though_no_two_rests_are_one_apart():
    step = 0.05
    values = step * np.array([0.0, 14.0, 35.0, 41.0, 80.0]).repeat(50)
    channel = np.column_stack([values, values + 0.3 * step, np.zeros_like(values)])
    rests = tuple(slice(k, k + 50) for k in range(0, 250, 50))
    inspection, off = reading_steps(channel, rests)
    assert inspection == pytest.approx([step, step, 0.0])
    assert off == pytest.approx([0.5 * step, 0.5 * step, 0.0])


def test_noise_wider_than_the_steps_averages_them_out():
    record: Any = strapdown_record(gamma=GAMMA, bias_g=BIAS, seed=4)
    stepped = replace(record, specific_force=0.01 * np.round(record.specific_force / 0.01))
    plain, inspection = inspected(record), inspected(stepped)
    assert not inspection.rests.step.any()
    assert inspection.rests.force_bound == pytest.approx(plain.rests.force_bound, rel=0.25)


@pytest.mark.acceptance
def test_steady_turns_about_the_vertical_are_no_rests_and_gyros_that_depend_on_gravity_turn_nothing():
    """Accelerometers do not sense the turns; a sensitivity of 0.02 rad/s/g is 20 times the noise of a sample."""
    sensitivity = np.array([[0.0, 0.02, 0.0], [0.0, 0.0, -0.015], [0.01, 0.0, 0.0]])
    record: Any = strapdown_record(sensitivity=sensitivity, gyro_bias=GYRO_BIAS)
    unchanged = inspected(record)
    assert len(unchanged.rests) == len(POSES)
    assert unchanged.rests.turning == 0
    rate, turned = np.array(record.rate), (4, 9)
    for k in turned:
        middle = round(unchanged.rests.time_s[k] / PERIOD)
        rate[middle - 170 : middle + 170] += 0.1 * POSES[k] / np.linalg.norm(POSES[k])
    inspection = inspected(record, rate=rate)
    assert inspection.rests.turning >= len(turned)
    remaining = np.delete(unchanged.rests.time_s, turned)
    assert inspection.rests.time_s == pytest.approx(remaining, abs=0.2)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "name", ["mpu9150-0", *(pytest.param(f"mpu9150-{k}", marks=pytest.mark.acceptance) for k in (1, 2))]
)
def test_nine_parameters_are_enough_for_the_mpu9150_and_no_behaviour_of_the_gyros_is_named(name):
    inspection: Any = inspect_record(measured(name))
    assert 15 <= len(inspection.rests) <= 25
    assert inspection.sampling.period == pytest.approx(0.01)
    assert inspection.turning.said == ()
    assert inspection.accelerometers.verdict == "consistent"
    assert max(abs(p.estimate) for p in inspection.accelerometers.parameters) < 0.05
    assert inspection.gyros.verdict in ("constant", "wandering", "insufficient")


@pytest.mark.acceptance
def test_the_rests_of_broad_03_are_those_before_and_after_the_motion():
    """The source describes slow rotation from 45.7 to 166.1 s; two poses calibrate nothing."""
    inspection: Any = inspect_record(measured("broad-03"))
    assert len(inspection.rests) == 2
    ends = [inspection.record.time_s[[rows.start, rows.stop - 1]] for rows in inspection.rests.rows]
    assert ends[0][1] < 45.7
    assert ends[1][0] > 166.1
    assert inspection.turning.said == ()
    assert inspection.accelerometers.verdict == "insufficient"
    assert len(inspection.accelerometers.open) >= 5
    assert inspection.gyros.verdict == "insufficient"


def test_a_record_without_rests_has_none():
    t = PERIOD * np.arange(6000)
    rate = np.stack([np.sin(2.0 * t), np.cos(3.1 * t), 0.7 * np.sin(1.3 * t + 1.0)], axis=1)
    rng = np.random.default_rng(0)
    force = G * np.stack(
        [np.sin(1.1 * t), np.cos(1.1 * t) * np.sin(0.7 * t), np.cos(1.1 * t) * np.cos(0.7 * t)], axis=1
    )
    noisy = force + 0.03 * rng.standard_normal(force.shape)
    inspection = inspected(StrapdownRecord(t, rate + 1e-3 * rng.standard_normal(rate.shape), None, noisy))
    assert len(inspection.rests) == 0
    assert inspection.accelerometers is None
    assert "no rests" in str(inspection)


def test_a_record_of_one_rest_is_insufficient():
    rng = np.random.default_rng(0)
    force = np.array([0.0, 0.0, G]) + 0.03 * rng.standard_normal((6000, 3))
    inspection = inspected(
        StrapdownRecord(PERIOD * np.arange(6000), 1e-3 * rng.standard_normal((6000, 3)), None, force)
    )
    assert len(inspection.rests) == 1
    assert inspection.accelerometers.verdict == "insufficient"
    assert inspection.gyros.verdict == "insufficient"
    assert inspection.turning.said == ()


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_twelve_rests_that_determine_all_have_ends_with_the_truth_between_them(seed):
    rng = np.random.default_rng(seed)
    truth, direction, bound = rng.normal(size=9) * 1e-3, rng.normal(size=(12, 3)), np.full((12, 3), 1e-4)
    matrix, bias = norm_block(truth)
    inputs = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    inspection = calibrate_by_norm(inputs @ matrix.T + bias + rng.uniform(-bound, bound), bound)
    assert inspection.verdict == "consistent", seed
    low, high = column(inspection, "low"), column(inspection, "high")
    assert low is not None
    assert high is not None
    assert (low <= truth).all()
    assert (truth <= high).all()


def test_the_bounds_of_means_in_json_are_those_of_the_text_and_none_of_few_rests():
    """The bounds are widened because a deviation of few rests may be too small."""
    many: Any = strapdown_record()
    rows = np.flatnonzero(many.time_s < 1.5 + 4.5 * 3.5)
    stated = inspected(chosen(many, rows)).to_json()["rests"]
    assert stated["count"] == 4
    assert stated["force_bound_mps2"] is None
    assert stated["rate_bound_radps"] is None
    inspection = inspected(many)
    ratio = inspection.rests.force_bound / inspection.rests.force_scatter
    assert ratio == pytest.approx(deviation_widening(len(inspection.rests), 0.05))


def test_poses_that_are_enough_are_said_to_be_and_others_are_named():
    whole = inspected(strapdown_record(true_motion()))
    assert whole.poses.worst_error_g < 1e-3
    assert whole.poses.missing == ()
    assert "the poses are enough" in str(whole)
    few = inspected(strapdown_record(true_motion(POSES[POSES[:, 2] > 0.5])))
    assert few.poses.worst_error_g > 1e-2
    assert few.poses.error_with_these_g < 1e-3
    shown = str(few)
    assert f"mg: {few.poses.missing[0]}" in shown
    assert shown.count(f": {few.poses.missing[0]}") == 1
