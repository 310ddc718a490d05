"""The attitude of a record: the attitude computer's result from its gyros, its error and the cause of the error."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import trihedron as th
from generator.turns import turned_by
from record_files import find_record, measured
from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.motion import (
    AttitudeRun,
    angle_between,
    attitude_error,
    compare_algorithms,
    heading_and_tilt,
    rotation_of,
    run_algorithm,
    sample_motion,
    split_error,
)
from trihedron.tools.papers import EXACT, angle_errors, paper_motion
from trihedron.tools.records import StrapdownRecord, write_record

GRAVITY = 9.80665


def scalar_first(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def steady_record(rate: tuple[float, float, float], count: int = 41, period: float = 0.05, begin: float = 3.0) -> Any:
    """Return a block that turns at a constant rate, with its true attitude; the reference's third axis is up."""
    time = begin + period * np.arange(count)
    start = Rotation.from_rotvec([0.3, -0.2, 0.5])
    true = start * Rotation.from_rotvec(np.outer(time - begin, rate))
    up = true.inv().apply([0.0, 0.0, GRAVITY])
    return StrapdownRecord(time, np.tile(rate, (count, 1)), None, up, scalar_first(true), path=Path("steady.csv"))


def turning(rate: np.ndarray, attitude: np.ndarray | None = None) -> StrapdownRecord:
    """Return gyros that read these rates (N, 3) at 100 Hz; accelerometers read gravity along the third axis."""
    return StrapdownRecord(
        0.01 * np.arange(len(rate)), rate, None, np.tile([0.0, 0.0, GRAVITY], (len(rate), 1)), attitude
    )


def swinging(count: int, sizes: tuple[float, float, float] = (1.0, 0.7, 1.0)) -> np.ndarray:
    """Return rates (count, 3) of slow swings about each axis, the first of them from zero on."""
    time = 0.01 * np.arange(count)
    return np.stack([np.sin(time), np.sin(1.3 * time), np.cos(time)], axis=1) * sizes


def test_a_constant_rate_is_followed_exactly() -> None:
    run: Any = th.attitude_of_record(steady_record((0.4, -0.3, 0.2)), algorithm="mean-rate")
    assert len(run.time_s) == 41
    assert run.maximum < 1e-13
    assert run.error_angle[0] < 1e-15


def test_only_updates_of_the_two_sample_algorithm_are_judged() -> None:
    record = steady_record((0.4, -0.3, 0.2), count=42)
    run: Any = th.attitude_of_record(record)
    assert run.row.tolist() == list(range(1, 43, 2))
    np.testing.assert_allclose(run.time_s, record.time_s[::2], rtol=0, atol=1e-12)
    # Equation (22) leaves out phi^5/1920 of each step's quarter-angle tangent, four times that in the angle.
    turn = 0.1 * math.sqrt(0.29)
    assert run.final < 20 * 4 * 1.1 * turn**5 / 1920 + 1e-14


def test_a_gyro_bias_drifts_at_its_own_rate_and_about_its_own_axis() -> None:
    still = steady_record((0.0, 0.0, 0.0), count=201)
    bias = np.array([0.0, 0.0, 0.01])
    record = replace(still, rate=still.rate + bias)
    run: Any = th.attitude_of_record(record, algorithm="mean-rate")
    elapsed = run.time_s - run.time_s[0]
    np.testing.assert_allclose(run.error_angle, 0.01 * elapsed, rtol=0, atol=1e-12)
    axis = Rotation.from_rotvec([0.3, -0.2, 0.5]).apply(bias)
    np.testing.assert_allclose(run.error_rad, np.outer(elapsed, axis), rtol=0, atol=1e-12)
    assert run.drift == pytest.approx(0.01, rel=1e-9)
    assert run.rms == pytest.approx(float(np.sqrt(np.mean((0.01 * elapsed[1:]) ** 2))), rel=1e-9)
    mended: Any = th.attitude_of_record(record, algorithm="mean-rate", gyro_bias=bias.tolist())
    assert mended.maximum < 1e-12
    assert "bias" in str(mended)


def test_rates_averaged_over_the_interval_and_increments_are_the_same_thing() -> None:
    steady = steady_record((0.0, 0.0, 0.0), count=33)
    rate = np.random.default_rng(5).normal(0.0, 0.5, (33, 3))
    averaged = th.attitude_of_record(replace(steady, rate=rate), rates="averaged")
    increments = th.attitude_of_record(replace(steady, rate=None, increment=0.05 * rate))
    np.testing.assert_allclose(averaged.attitude, increments.attitude, rtol=0, atol=1e-15)
    instantaneous = th.attitude_of_record(replace(steady, rate=rate))
    assert np.abs(instantaneous.attitude - averaged.attitude).max() > 1e-3


def test_the_run_begins_where_the_truth_begins_and_judges_only_where_it_is_known() -> None:
    record = steady_record((0.1, 0.2, 0.3), count=31)
    true = record.attitude.copy()
    true[:7] = np.nan
    true[15:20] = np.nan
    run: Any = th.attitude_of_record(replace(record, attitude=true), algorithm="mean-rate")
    assert run.row[0] == 8
    assert np.isnan(run.error_angle[8:13]).all()
    assert run.judged.sum() == 31 - 7 - 5 - 1
    assert run.maximum < 1e-13


def test_without_truth_the_attitude_begins_at_the_identity_and_nothing_is_claimed() -> None:
    record = replace(steady_record((0.1, 0.2, 0.3)), attitude=None)
    run: Any = th.attitude_of_record(record, algorithm="mean-rate")
    assert run.attitude[0].tolist() == [1.0, 0.0, 0.0, 0.0]
    expected = Rotation.from_rotvec(2.0 * np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(run.attitude[-1], scalar_first(expected), rtol=0, atol=1e-13)
    assert run.rms is run.maximum is run.final is run.drift is None
    assert run.heading is run.tilt is None
    assert "no true attitude" in str(run)


def test_heading_and_tilt_put_the_error_together_again() -> None:
    generator = np.random.default_rng(2)
    error = Rotation.from_quat(generator.normal(0.0, 1.0, (200, 4))).as_rotvec()
    heading, tilt = heading_and_tilt(error)
    up = Rotation.from_rotvec(error).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(tilt, np.arccos(np.clip(up[:, 2], -1, 1)), rtol=0, atol=1e-7)
    turned = Rotation.from_rotvec(error) * Rotation.from_rotvec(np.outer(heading, [0.0, 0.0, 1.0])).inv()
    np.testing.assert_allclose(turned.as_rotvec()[:, 2], 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turned.magnitude(), tilt, rtol=0, atol=1e-12)
    small = generator.normal(0.0, 1e-6, (20, 3))
    heading, tilt = heading_and_tilt(small)
    np.testing.assert_allclose(heading, small[:, 2], rtol=0, atol=1e-11)
    np.testing.assert_allclose(tilt, np.hypot(small[:, 0], small[:, 1]), rtol=0, atol=1e-11)


def test_heading_is_not_spoken_of_where_the_third_axis_is_not_vertical() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    assert th.attitude_of_record(record).heading is not None
    lying = rotation_of(np.array([1.0, 1.0, 0.0, 0.0]) / math.sqrt(2.0)) * rotation_of(record.attitude)
    assert th.attitude_of_record(replace(record, attitude=scalar_first(lying))).heading is None


def test_error_of_no_rows() -> None:
    assert attitude_error(np.zeros((0, 4)), np.zeros((0, 4))).shape == (0, 3)


@pytest.mark.parametrize("how", ["instantaneous", "averaged", "increments"])
def test_attitudes_after_a_clipped_gyro_are_marked(how: Any) -> None:
    """Up to the last update before the first clipped row the attitude is that of the whole motion."""
    time, period = 0.01 * np.arange(3000), 0.01
    rate = np.stack([np.sin(time + 4.0), 0.7 * np.sin(1.3 * time), 0.5 * np.cos(0.8 * time)], axis=1)

    def run(gyros: np.ndarray) -> Any:
        if how == "increments":
            record = replace(turning(gyros), rate=None, increment=period * gyros)
            return th.attitude_of_record(record, algorithm="mean-rate")
        return th.attitude_of_record(turning(gyros), algorithm="mean-rate", rates=how)

    unclipped, clipped = run(rate), run(np.clip(rate, -0.8, 0.8))
    assert (unclipped.trusted_until, unclipped.saturated, unclipped.trusted.all()) == (None, {}, True)
    beyond = np.abs(rate[:, 0]) > 0.8
    assert clipped.saturated == {"w1": np.count_nonzero(beyond)}
    assert clipped.trusted_until == pytest.approx(time[np.argmax(beyond)] - period)
    apart = angle_between(unclipped.attitude, clipped.attitude)
    assert apart[clipped.trusted].max() == 0.0
    assert apart[-1] > 0.2
    assert np.array_equal(clipped.to_polars()["trusted"], clipped.trusted)


def test_a_limit_before_the_run_begins_does_not_count() -> None:
    rate = np.clip(swinging(3000), -np.inf, [0.8, 9.0, 9.0])
    rate[1300:] *= 0.5
    true = np.full((3000, 4), np.nan)
    true[1500] = [1.0, 0.0, 0.0, 0.0]
    record = turning(rate)
    assert th.attitude_of_record(record).trusted_until is not None
    assert th.attitude_of_record(replace(record, attitude=true)).trusted_until is None


@pytest.mark.acceptance
def test_a_clipped_record_cannot_be_overlooked_on_the_command_line(tmp_path: Path, capsys: Any) -> None:
    """Check text, JSON, table, complaint and exit status; with --compare too."""
    path, result_file, out = tmp_path / "turn.csv", tmp_path / "found.json", tmp_path / "out"
    write_record(turning(np.clip(swinging(3000), -0.8, 0.8)), path)
    for options in ([], ["--compare"]):
        assert main(["attitude", str(path), "--json", str(result_file), "--out", str(out), *options]) == 2
        streams = capsys.readouterr()
        assert "turn.csv: attitudes after 0 s are not to be trusted: a gyro is at its limit" in streams.err
        assert "not to be trusted after 0 s: w1: " in streams.out
        assert "rows are saturated, at -0.8 and 0.8 rad/s, the first at 0.93 s" in streams.out
        assert json.loads(result_file.read_text(encoding="utf-8"))["trusted_until_s"] == 0.0
    assert pl.read_csv(out / "attitude.csv")["trusted"].sum() == 1
    assert pl.read_parquet(out / "run.parquet")["trusted"].sum() == 1
    assert set(pl.read_csv(out / "comparison.csv")["trusted_until_s"]) == {0.0}


def test_every_row_that_is_written_says_whether_it_is_to_be_trusted(tmp_path: Path) -> None:
    """Test rows of the run, and updates of the attitude: both end before the same row."""
    record = turning(np.clip(swinging(600, (1.0, 0.2, 0.1)), -0.8, 0.8))
    for divisor in (1, 3):
        run = th.attitude_of_record(record, rate_divisor=divisor, out=tmp_path)
        rows = pl.read_parquet(tmp_path / "run.parquet")
        assert run.trusted_until is not None
        first = record.time_s[np.argmax((np.abs(np.asarray(record.rate)) >= 0.8).any(axis=1))]
        trusted = rows.filter(pl.col("trusted"))["time_s"].to_numpy()
        assert trusted.max() < first < trusted.max() + 0.01 * divisor * 1.5
        assert trusted.max() > run.trusted_until - 1e-9
        assert rows["trusted"].to_list() == sorted(rows["trusted"], reverse=True)
    th.attitude_of_record(steady_record((0.1, 0.2, 0.3)), out=tmp_path)
    assert pl.read_parquet(tmp_path / "run.parquet")["trusted"].all()


def test_stamps_that_jitter_are_said_and_the_rates_integrated_as_logged() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    time = record.time_s.copy()
    time[20] += 0.0095 * 0.05
    run = th.attitude_of_record(replace(record, time_s=time))
    assert run.warnings == ()
    time[20:] += 0.02 * 0.05
    jittering = th.attitude_of_record(replace(record, time_s=time))
    assert "time stamps are up to" in jittering.warnings[0]
    # At a constant rate the turn is the rate times the time between stamps.
    turn = 2.0 * np.arccos(abs(jittering.attitude[-1] @ jittering.attitude[0]))
    assert turn == pytest.approx(np.linalg.norm([0.1, 0.2, 0.3]) * (time[-1] - time[0]), rel=1e-9)


def test_a_time_far_off_the_grid_is_refused_by_its_row() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    time = record.time_s.copy()
    time[20:] = time[20] + 0.9 * (time[20:] - time[20])
    with pytest.raises(InputError, match=r"steady\.csv, row \d+, column 'time_s': .* % of the period"):
        th.attitude_of_record(replace(record, time_s=time))


def test_rates_in_degrees_are_refused_before_they_wrap() -> None:
    with pytest.raises(InputError, match=r"steady\.csv, row 2: a turn of 5 rad .* rad/s\?"):
        th.attitude_of_record(steady_record((60.0, 80.0, 0.0)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rates": "average"}, "rates should be 'instantaneous' or 'averaged'"),
        ({"gyro_bias": [0.1, 0.2]}, "three finite numbers"),
        ({"gyro_bias": [0.1, 0.2, math.nan]}, "three finite numbers"),
    ],
)
def test_options_that_are_not_known_are_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        th.attitude_of_record(steady_record((0.1, 0.2, 0.3)), **options)


def test_a_record_that_ends_where_its_truth_begins_is_refused() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    true = np.full_like(record.attitude, np.nan)
    true[-1] = record.attitude[-1]
    with pytest.raises(InputError, match="row 41: the first known attitude is that of the last row"):
        th.attitude_of_record(replace(record, attitude=true))
    first_file = StrapdownRecord(np.zeros(1), np.zeros((1, 3)), None, np.zeros((1, 3)))
    with pytest.raises(InputError, match="at least two"):
        th.attitude_of_record(first_file)


def test_the_run_is_written_and_repeats_to_the_byte(tmp_path: Path) -> None:
    record = steady_record((0.1, 0.2, 0.3))
    first = th.attitude_of_record(record, out=tmp_path / "a")
    again = th.attitude_of_record(record, out=tmp_path / "b")
    assert [file.name for file in first.files] == ["run.parquet", "run.json"]
    for first_file, second_file in zip(first.files, again.files, strict=True):
        assert first_file.read_bytes() == second_file.read_bytes()
    assert set(first.provenance["fmus"]) == {"computer"}


def test_records_are_looked_for_where_the_variable_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.strapdown.csv").write_text("")
    monkeypatch.setenv("TRIHEDRON_DATA", str(tmp_path))
    assert find_record("mine.strapdown.csv") == tmp_path / "mine.strapdown.csv"
    assert find_record("no-such-record.csv") is None


@pytest.fixture(scope="module")
def broad() -> Any:
    return measured("broad-03")


def composed(record: Any, run: AttitudeRun, bias: np.ndarray) -> Rotation:
    """Return the attitude at each update by scipy: each pair of intervals as one rotation vector s + (2/3) g' x g''."""
    rate = record.rate[int(run.row[0]) - 2 :] - bias
    step = 0.0035 * 0.5 * (rate[:-1] + rate[1:])
    step = step[: len(step) // 2 * 2].reshape(-1, 2, 3)
    turns = step.sum(axis=1) + 2.0 / 3.0 * np.cross(step[:, 0], step[:, 1])
    return rotation_of(record.attitude[int(run.row[0]) - 2]) * turned_by(np.vstack([np.zeros(3), turns]))


@pytest.mark.acceptance
def test_the_measured_record_agrees_with_another_composition(broad: Any) -> None:
    run: Any = th.attitude_of_record(broad)
    second_file = composed(broad, run, np.zeros(3))
    assert len(second_file) == len(run.row) == 27654
    assert float((second_file.inv() * rotation_of(run.attitude)).magnitude().max()) < 1e-6


@pytest.mark.acceptance
def test_the_measured_record_drifts_by_its_gyros_bias(broad: Any) -> None:
    raw: Any = th.attitude_of_record(broad)
    bias: Any = broad.rate[:2800].mean(axis=0)  # at rest for ten seconds
    # The gyros at rest have half a degree a second; the error cannot grow much faster.
    assert 25.0 < 60.0 * math.degrees(float(np.linalg.norm(bias))) < 45.0
    assert math.degrees(raw.rms) == pytest.approx(44.2, abs=0.5)
    assert raw.drift < float(np.linalg.norm(bias)) * 1.1
    mended: Any = th.attitude_of_record(broad, gyro_bias=bias)
    assert math.degrees(mended.rms) == pytest.approx(2.7, abs=0.2)
    assert mended.judged.sum() == np.isfinite(mended.tilt[1:]).sum()


BY_NAME = {a.name: a for a in ALGORITHMS}
CHOSEN = [BY_NAME[n] for n in ("mean-rate", "two-sample-rodrigues", "panov", "panov-cut-off", "adaptive-degree")]


def harmonic_record(count: int = 401, motion: str = "2") -> Any:
    """Return a motion of Table 1 at 100 Hz as a record of exact increments, with its true attitude."""
    period = 0.01
    samples = sample_motion(paper_motion(motion, EXACT), period, count - 1)
    angle = np.vstack((np.zeros(3), samples.angles))
    true = Rotation.from_euler("YZX", angle)
    return StrapdownRecord(
        period * np.arange(count),
        None,
        np.vstack((np.zeros(3), samples.increments)),
        true.inv().apply([0.0, 9.80665, 0.0]),
        np.roll(true.as_quat(), 1, axis=-1),
        path=Path("harmonic.csv"),
    )


def names_in_table(text: str) -> list[str]:
    """Return the first words of the rows below the head of the table of algorithms."""
    rows = text[text.index("algorithm  ") :].split("\n\n")[0].splitlines()[1:]
    return [row.split()[0] for row in rows]


def test_algorithms_stand_side_by_side_with_their_errors() -> None:
    comparison = compare_algorithms(harmonic_record(motion="5"), algorithms=CHOSEN)
    rows, table = comparison.algorithms, comparison.to_polars()
    assert names_in_table(str(comparison)) == [a.name for a in CHOSEN]
    assert table["algorithm"].to_list() == [a.name for a in CHOSEN]
    assert table["error_max_deg"][0] == pytest.approx(math.degrees(rows[0].maximum or 0.0))
    assert table["error_max_deg"][3] is None
    by_name = {row.algorithm: row for row in rows}
    assert [row.updates for row in rows] == [400, 200, 100, 0, 50]
    assert [row.rows_left_out for row in rows] == [0, 0, 0, None, 0]
    # 60 degrees at 1 Hz turn by more than the range of Panov's cut-off series.
    assert "panov-cut-off is valid to 0.07 rad" in by_name["panov-cut-off"].refused
    errors: list[Any] = [by_name[a.name].maximum for a in CHOSEN if a.name != "panov-cut-off"]
    apart = [by_name[a.name].apart for a in CHOSEN if a.name != "panov-cut-off"]
    assert all(error is not None for error in errors)
    assert errors[0] > errors[2] > errors[1] > 1e3 * errors[3]
    assert errors[3] < 1e-9
    # The distance from the best is the error if the best has none.
    assert apart[0] == pytest.approx(errors[0], rel=0.2)
    assert apart[3] == 0.0


@pytest.mark.first(1)
@pytest.mark.parametrize("increments", [3, 8, 23])
def test_last_rows_that_fill_no_step_are_counted(increments: int) -> None:
    comparison = compare_algorithms(harmonic_record(increments + 1))
    for row, algorithm in zip(comparison.algorithms, ALGORITHMS, strict=True):
        assert (row.updates, row.rows_left_out) == divmod(increments, algorithm.samples)
    assert "rows left out" in str(comparison)


def test_a_slower_gyro_is_the_same_record_with_increments_added_up() -> None:
    record = harmonic_record()
    slow: Any = th.attitude_of_record(record, algorithm="panov", rate_divisor=5)
    assert slow.period == pytest.approx(0.05, rel=1e-12)
    assert slow.row.tolist() == [1 + 20 * k for k in range(21)]
    np.testing.assert_allclose(slow.time_s, 0.2 * np.arange(21), rtol=0, atol=1e-12)
    added = record.increment[1:].reshape(-1, 5, 3).sum(axis=1)
    rarer = StrapdownRecord(
        record.time_s[::5],
        None,
        np.vstack((np.zeros(3), added)),
        record.specific_force[::5],
        record.attitude[::5],
        path=record.path,
    )
    np.testing.assert_allclose(
        slow.attitude, th.attitude_of_record(rarer, algorithm="panov").attitude, rtol=0, atol=1e-14
    )
    fast: Any = th.attitude_of_record(record, algorithm="panov")
    # Fourth order: five times the step, about 625 times the error.
    assert 300.0 < slow.maximum / fast.maximum < 1000.0


@pytest.mark.parametrize("divisor", [0, -1, 401])
def test_a_divisor_that_leaves_no_sample_is_refused(divisor: int) -> None:
    with pytest.raises(InputError, match="rate_divisor"):
        th.attitude_of_record(harmonic_record(), rate_divisor=divisor)


def test_a_turn_beyond_the_range_is_refused_by_its_row() -> None:
    record = harmonic_record()
    record.increment[37] = [0.0, 0.7, 0.0]
    with pytest.raises(InputError, match=r"row 38: a turn of 0\.7 rad in one sample; two-sample-rodrigues is valid"):
        th.attitude_of_record(record, trust=True)


@pytest.mark.acceptance
def test_the_command_takes_an_algorithm_a_divisor_and_compares(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = harmonic_record(41)
    columns = {"time_s": record.time_s}
    columns |= {f"dtheta{i + 1}_rad": record.increment[:, i] for i in range(3)}
    columns |= {f"f{i + 1}_mps2": record.specific_force[:, i] for i in range(3)}
    path = tmp_path / "record.csv"
    pl.DataFrame(columns).write_csv(path)
    assert main(["attitude", str(path), "--algorithm", "panov", "--rate-divisor", "2"]) == 0
    assert "50 Hz, algorithm panov" in capsys.readouterr().out
    assert main(["attitude", str(path), "--compare", "--out", str(tmp_path / "out")]) == 0
    assert names_in_table(capsys.readouterr().out) == [a.name for a in ALGORITHMS]
    assert (tmp_path / "out" / "comparison.csv").is_file()


@settings(max_examples=25)
@given(
    st.floats(0.5, 4.0),
    st.floats(0.0, 6.0),
    st.tuples(st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3)),
    st.floats(0.1, 1.0),
)
def test_a_line_and_a_wave_come_apart(period: float, phase: float, drift: tuple, amplitude: float) -> None:
    time = np.arange(0.0, 100.0, 0.04)
    wave = amplitude * np.sin(2 * np.pi * time / period + phase)
    error = np.column_stack((drift[0] * time + wave, 1.0 + drift[1] * time + 0.3 * wave))
    for given_period in (period, None):
        split = split_error(time, error, given_period)
        assert split.period == pytest.approx(period, rel=1e-3)
        np.testing.assert_allclose(split.rate, drift, rtol=0, atol=5e-5 * amplitude)
        # The crest may lie between two samples.
        crest = float(np.abs(wave).max())
        np.testing.assert_allclose(split.amplitude, [crest, 0.3 * crest], rtol=5e-3)
        np.testing.assert_allclose(split.slow + split.periodic, error, rtol=0, atol=1e-12)


def test_the_period_of_the_paper_is_two_seconds() -> None:
    """With harmonics of 1 Hz beside a weaker one of 0.5 Hz, the period is the 2 s of ϑ, as in the paper."""
    time = np.arange(0.0, 60.0, 0.01)
    error = 2e-6 * time + np.sin(2 * np.pi * time) + 0.3 * np.sin(np.pi * time)
    assert split_error(time, error).period == pytest.approx(2.0, rel=1e-3)


@pytest.mark.acceptance
def test_the_drift_of_an_algorithm_is_the_growth_between_equal_phases() -> None:
    """The first motion repeats every 2 s, so the error's growth over whole periods is the drift, exactly."""
    algorithm = BY_NAME["mean-rate"]
    samples = sample_motion(paper_motion("1", EXACT), 0.01, 6000)
    attitudes = run_algorithm(algorithm, samples.increments, renormalise=True)
    true = run_algorithm(BY_NAME["functional-iteration-8"], samples.increments, renormalise=True)
    error = attitude_error(attitudes[7::8], true)
    time = 0.08 * (1 + np.arange(len(error)))
    split = split_error(time, error, 2.0)
    expected = (error[700] - error[75]) / (time[700] - time[75])
    np.testing.assert_allclose(split.rate, expected, rtol=1e-3, atol=1e-9)
    # The paper's largest error is drift and wave together.
    largest = angle_errors(attitudes, samples.angles_at_steps(algorithm), normalised=True)
    assert np.linalg.norm(largest) <= 1.2 * np.linalg.norm(np.abs(split.slow).max(axis=0) + split.amplitude)


def test_what_does_not_grow_has_no_drift_and_what_only_grows_has_no_wave() -> None:
    time = np.arange(0.0, 50.0, 0.05)
    still = split_error(time, np.zeros_like(time))
    assert still.rate[0] == 0.0
    assert still.amplitude[0] == 0.0
    growing = split_error(time, 3e-4 * time)
    assert growing.rate[0] == pytest.approx(3e-4, rel=1e-9)
    assert growing.amplitude[0] < 1e-12


@pytest.mark.parametrize(
    ("time", "error", "period", "streams"),
    [
        (np.arange(5.0), np.zeros(5), None, "at least eight"),
        (np.arange(20.0), np.full(20, np.nan), None, "finite"),
        (np.zeros(20), np.zeros(20), None, "growing"),
        (np.arange(20.0), np.zeros(20), 10.0, "shorter than two periods"),
        (np.arange(20.0), np.zeros(20), 0.0, "shorter than two periods"),
    ],
)
def test_what_cannot_be_split_is_refused(
    time: np.ndarray, error: np.ndarray, period: float | None, streams: str
) -> None:
    with pytest.raises(InputError, match=streams):
        split_error(time, error, period)
