"""The attitude of a record: what the attitude computer makes of its gyros, and how far that is from the truth."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trihedron.tools.demo import WHERE_TO_GET, find_record
from trihedron.tools.errors import InputError
from trihedron.tools.motion.attitude import AttitudeRun, attitude_of_record, rate_at_rest
from trihedron.tools.motion.attitude_error import attitude_error, heading_and_tilt
from trihedron.tools.records import StrapdownRecord, read_record
from trihedron.tools.reports.inspection import attitude_lines

BROAD = find_record("broad-03.strapdown.csv")
GRAVITY = 9.80665


def scalar_first(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def rotations(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def steady_record(
    rate: tuple[float, float, float], count: int = 41, period: float = 0.05, begin: float = 3.0
) -> StrapdownRecord:
    """A block that turns at a constant rate, with its true attitude; the reference's third axis is up."""
    time = begin + period * np.arange(count)
    start = Rotation.from_rotvec([0.3, -0.2, 0.5])
    true = start * Rotation.from_rotvec(np.outer(time - begin, rate))
    up = true.inv().apply([0.0, 0.0, GRAVITY])
    return StrapdownRecord(time, np.tile(rate, (count, 1)), None, up, scalar_first(true), path=Path("steady.csv"))


def test_a_constant_rate_is_followed_exactly() -> None:
    run = attitude_of_record(steady_record((0.4, -0.3, 0.2)), algorithm="mean-rate")
    assert len(run.time_s) == 41
    assert run.maximum is not None
    assert run.maximum < 1e-13
    assert run.error_angle[0] < 1e-15


def test_only_updates_of_the_two_sample_algorithm_are_judged() -> None:
    record = steady_record((0.4, -0.3, 0.2), count=42)
    run = attitude_of_record(record)
    assert run.row.tolist() == list(range(1, 43, 2))
    np.testing.assert_allclose(run.time_s, record.time_s[::2], rtol=0, atol=1e-12)
    # Equation (22) leaves out phi^5/1920 of each step's quarter-angle tangent, four times that in the angle.
    turn = 0.1 * math.sqrt(0.29)
    assert run.final is not None
    assert run.final < 20 * 4 * 1.1 * turn**5 / 1920 + 1e-14


def test_a_gyro_bias_drifts_at_its_own_rate_and_about_its_own_axis() -> None:
    still = steady_record((0.0, 0.0, 0.0), count=201)
    bias = np.array([0.0, 0.0, 0.01])
    record = dataclasses.replace(still, rate=still.rate + bias)
    run = attitude_of_record(record, algorithm="mean-rate")
    elapsed = run.time_s - run.time_s[0]
    np.testing.assert_allclose(run.error_angle, 0.01 * elapsed, rtol=0, atol=1e-12)
    axis = Rotation.from_rotvec([0.3, -0.2, 0.5]).apply(bias)
    np.testing.assert_allclose(run.error_rad, np.outer(elapsed, axis), rtol=0, atol=1e-12)
    assert run.drift == pytest.approx(0.01, rel=1e-9)
    assert run.rms == pytest.approx(float(np.sqrt(np.mean((0.01 * elapsed[1:]) ** 2))), rel=1e-9)
    mended = attitude_of_record(record, algorithm="mean-rate", gyro_bias=bias)
    assert mended.maximum is not None
    assert mended.maximum < 1e-12
    assert any("bias" in line for line in attitude_lines(mended))


def test_rates_averaged_over_the_interval_and_increments_are_the_same_thing() -> None:
    steady = steady_record((0.0, 0.0, 0.0), count=33)
    rate = np.random.default_rng(5).normal(0.0, 0.5, (33, 3))
    averaged = attitude_of_record(dataclasses.replace(steady, rate=rate), rates="averaged")
    increments = attitude_of_record(dataclasses.replace(steady, rate=None, increment=0.05 * rate))
    np.testing.assert_allclose(averaged.attitude, increments.attitude, rtol=0, atol=1e-15)
    instantaneous = attitude_of_record(dataclasses.replace(steady, rate=rate))
    assert np.abs(instantaneous.attitude - averaged.attitude).max() > 1e-3


def test_the_run_begins_where_the_truth_begins_and_judges_only_where_it_is_known() -> None:
    record = steady_record((0.1, 0.2, 0.3), count=31)
    assert record.attitude is not None
    true = record.attitude.copy()
    true[:7] = np.nan
    true[15:20] = np.nan
    run = attitude_of_record(dataclasses.replace(record, attitude=true), algorithm="mean-rate")
    assert run.row[0] == 8
    assert np.isnan(run.error_angle[8:13]).all()
    assert run.judged.sum() == 31 - 7 - 5 - 1
    assert run.maximum is not None
    assert run.maximum < 1e-13


def test_without_truth_the_attitude_begins_at_the_identity_and_nothing_is_claimed() -> None:
    record = dataclasses.replace(steady_record((0.1, 0.2, 0.3)), attitude=None)
    run = attitude_of_record(record, algorithm="mean-rate")
    assert run.attitude[0].tolist() == [1.0, 0.0, 0.0, 0.0]
    expected = Rotation.from_rotvec(2.0 * np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(run.attitude[-1], scalar_first(expected), rtol=0, atol=1e-13)
    assert run.rms is run.maximum is run.final is run.drift is None
    assert run.heading is run.tilt is None
    assert "no true attitude" in " ".join(attitude_lines(run))


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
    assert attitude_of_record(record).heading is not None
    assert record.attitude is not None
    lying = rotations(np.array([1.0, 1.0, 0.0, 0.0]) / math.sqrt(2.0)) * rotations(record.attitude)
    assert attitude_of_record(dataclasses.replace(record, attitude=scalar_first(lying))).heading is None


def test_error_of_no_rows() -> None:
    assert attitude_error(np.zeros((0, 4)), np.zeros((0, 4))).shape == (0, 3)


def changed_time(change: float, row: int) -> StrapdownRecord:
    record = steady_record((0.1, 0.2, 0.3))
    time = record.time_s.copy()
    time[row:] += change
    return dataclasses.replace(record, time_s=time, row=np.arange(5, 46))


def test_a_gap_is_refused_by_its_row() -> None:
    with pytest.raises(InputError, match=r"steady\.csv, row 25, column 'time_s': a gap of 0\.15 s"):
        attitude_of_record(changed_time(0.1, 20))


def test_a_time_off_the_grid_is_refused_by_its_row() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    time = record.time_s.copy()
    time[20] += 0.02 * 0.05
    with pytest.raises(InputError, match=r"steady\.csv, row 21, column 'time_s': .* 2 % of the period"):
        attitude_of_record(dataclasses.replace(record, time_s=time))
    time[20] -= 0.0105 * 0.05
    assert attitude_of_record(dataclasses.replace(record, time_s=time)).final is not None


def test_rates_in_degrees_are_refused_before_they_wrap() -> None:
    with pytest.raises(InputError, match=r"steady\.csv, row 2: a turn of 5 rad .* rad/s\?"):
        attitude_of_record(steady_record((60.0, 80.0, 0.0)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"algorithm": "two-samples-rodrigues"}, "did you mean 'two-sample-rodrigues'"),
        ({"rates": "average"}, "did you mean 'averaged'"),
        ({"gyro_bias": [0.1, 0.2]}, "three finite numbers"),
        ({"gyro_bias": [0.1, 0.2, math.nan]}, "three finite numbers"),
    ],
)
def test_options_that_are_not_known_are_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        attitude_of_record(steady_record((0.1, 0.2, 0.3)), **options)


def test_a_record_that_ends_where_its_truth_begins_is_refused() -> None:
    record = steady_record((0.1, 0.2, 0.3))
    assert record.attitude is not None
    true = np.full_like(record.attitude, np.nan)
    true[-1] = record.attitude[-1]
    with pytest.raises(InputError, match="row 41: the first known attitude is that of the last row"):
        attitude_of_record(dataclasses.replace(record, attitude=true))
    one = StrapdownRecord(np.zeros(1), np.zeros((1, 3)), None, np.zeros((1, 3)))
    with pytest.raises(InputError, match="at least two"):
        attitude_of_record(one)


def test_rate_at_rest_is_that_of_the_beginning_only() -> None:
    generator = np.random.default_rng(4)
    count, bias = 2000, np.array([0.01, -0.02, 0.005])
    rate = bias + generator.uniform(-1e-3, 1e-3, (count, 3))
    rate[520:1500] += generator.normal(0.0, 1.0, (980, 3))
    rate[1500:] += 0.5
    record = StrapdownRecord(0.01 * np.arange(count), rate, None, np.zeros((count, 3)))
    found = rate_at_rest(record)
    assert found is not None
    np.testing.assert_array_equal(found, rate[:500].mean(axis=0))
    assert rate_at_rest(dataclasses.replace(record, rate=rate[::-1].copy())) is not None
    rate[:30] += generator.normal(0.0, 1.0, (30, 3))
    assert rate_at_rest(dataclasses.replace(record, rate=rate)) is None


def test_the_run_is_written_and_repeats_to_the_byte(tmp_path: Path) -> None:
    record = steady_record((0.1, 0.2, 0.3))
    first = attitude_of_record(record, out=tmp_path / "a")
    again = attitude_of_record(record, out=tmp_path / "b")
    assert [file.name for file in first.files] == ["run.parquet", "run.json"]
    for one, other in zip(first.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert set(first.provenance["fmus"]) == {"computer"}


def test_records_are_looked_for_where_the_variable_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.strapdown.csv").write_text("")
    monkeypatch.setenv("TRIHEDRON_DATA", str(tmp_path))
    assert find_record("mine.strapdown.csv") == tmp_path / "mine.strapdown.csv"
    assert find_record("no-such-record.csv") is None


@pytest.fixture(scope="module")
def broad() -> StrapdownRecord:
    if BROAD is None:
        pytest.skip(WHERE_TO_GET)
    record = read_record(BROAD)
    assert isinstance(record, StrapdownRecord)
    return record


def composed(record: StrapdownRecord, run: AttitudeRun, bias: np.ndarray) -> Rotation:
    """The attitude at each update by scipy: each pair of intervals as one rotation vector s + (2/3) g' x g''."""
    assert record.rate is not None
    assert record.attitude is not None
    rate = record.rate[int(run.row[0]) - 2 :] - bias
    step = 0.0035 * 0.5 * (rate[:-1] + rate[1:])
    step = step[: len(step) // 2 * 2].reshape(-1, 2, 3)
    turns = Rotation.from_rotvec(step.sum(axis=1) + 2.0 / 3.0 * np.cross(step[:, 0], step[:, 1]))
    attitude = [rotations(record.attitude[int(run.row[0]) - 2])]
    for turn in turns:
        attitude.append(attitude[-1] * turn)
    return Rotation.concatenate(attitude)


def test_the_measured_record_agrees_with_another_composition(broad: StrapdownRecord) -> None:
    run = attitude_of_record(broad)
    other = composed(broad, run, np.zeros(3))
    assert len(other) == len(run.row) == 27654
    assert float((other.inv() * rotations(run.attitude)).magnitude().max()) < 1e-6


def test_the_measured_record_drifts_by_its_gyros_bias(broad: StrapdownRecord) -> None:
    raw = attitude_of_record(broad)
    bias = rate_at_rest(broad)
    assert bias is not None
    # Half a degree a second stands in the gyros at rest; the error cannot grow faster than that by much.
    assert 25.0 < 60.0 * math.degrees(float(np.linalg.norm(bias))) < 45.0
    assert raw.rms is not None
    assert raw.drift is not None
    assert math.degrees(raw.rms) == pytest.approx(44.2, abs=0.5)
    assert raw.drift < float(np.linalg.norm(bias)) * 1.1
    mended = attitude_of_record(broad, gyro_bias=bias)
    assert mended.rms is not None
    assert math.degrees(mended.rms) == pytest.approx(2.7, abs=0.2)
    assert mended.tilt is not None
    assert mended.judged.sum() == np.isfinite(mended.tilt[1:]).sum()
