"""Gyros against gravity and against a true attitude: exchanged, reversed, in degrees; and unusual correct ones."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generator.carried import strapdown_record
from generator.stands import random_bench, simulated
from generator.turns import turned_by
from record_files import measured
from trihedron.tools.calibration import PRESETS, calibrate
from trihedron.tools.check import check
from trihedron.tools.corrections import apply
from trihedron.tools.errors import InputError
from trihedron.tools.motion import inspect_record, trust_of, trusted
from trihedron.tools.motion.truth import downward_warning
from trihedron.tools.motion.turning import check_turning
from trihedron.tools.records import PERMUTATIONS, Channels, StrapdownRecord, read_record, reading_of, write_record

G = 9.80665
QUIET = np.full(3, 1e-3)


def said_of(record: Any) -> str:
    return "; ".join(check_turning(record.time_s, record.rate, record.specific_force, QUIET).said)


def order_of(matrix: np.ndarray) -> str:
    """Return the order that corrects channels with a signed permutation (3, 3) of the axes."""
    return ",".join(map(str, reading_of(matrix)))


@pytest.fixture(scope="module")
def clean() -> Any:
    return strapdown_record(seed=1)


def filmed(seed: int, *, speed: float, truth_every: int = 1, lag: float = 0.0, seconds: float = 25.0) -> Any:
    """Return a block that rests, then turns without a rest, with its true attitude in every `truth_every`-th row."""
    rng = np.random.default_rng(seed)
    period, fine = 0.005, 2
    count = round(seconds / period)
    time = period * np.arange(count)
    waves, phases = rng.uniform(0.2, 1.2, (4, 3)), rng.uniform(0.0, 6.0, (4, 3))

    def rate(at: np.ndarray) -> np.ndarray:
        moving = np.clip(at - 4.0, 0.0, 1.0)[:, None]
        return speed / 2.0 * moving * np.sin(2.0 * np.pi * waves * at[:, None, None] + phases).sum(axis=1)

    steps = rate(period / fine * (np.arange((count - 1) * fine) + 0.5)) * period / fine
    true = turned_by(np.vstack([np.zeros(3), steps]))[::fine]
    force = true.inv().apply([0.0, 0.0, G]) + rng.normal(0.0, 0.01, (count, 3))
    quaternion = np.roll(true.as_quat(), 1, axis=1)
    quaternion[np.arange(count) % truth_every != 0] = np.nan
    gyros = rate(time - lag) + rng.normal(0.0, 1e-3, (count, 3))
    return StrapdownRecord(time, gyros, None, force, quaternion)


@pytest.mark.acceptance
def test_every_signed_permutation_of_gyros_is_said_beside_gravity(clean):
    assert said_of(clean) == ""
    for matrix in PERMUTATIONS[1:]:
        advice = said_of(replace(clean, rate=clean.rate @ matrix.T))
        assert f"read it with --channels w={order_of(matrix)}" in advice
        degrees = said_of(replace(clean, rate=np.degrees(clean.rate) @ matrix.T))
        assert f"w={order_of(matrix)} w=deg" in degrees
    assert "read it with --channels w=deg" in said_of(replace(clean, rate=np.degrees(clean.rate)))


@pytest.mark.first(1)
@pytest.mark.parametrize("order", [(1, 2, 3), (2, 1, -3)])
def test_rates_that_were_said_to_be_degrees_and_are_none_are_said(clean, order):
    """With gravity and with a true attitude: the advice is to remove the wrong option, and nothing else."""
    for record in (clean, filmed(1, speed=2.0)):
        advice = Channels(gyros=order, degrees=True)
        record_read = replace(record, rate=record.rate @ advice.of_gyros.T, channels=advice)
        lines = trust_of(record_read).faults
        assert "the rates are probably in rad/s, not degrees per second" in lines[0]
        assert "read it with no --channels" in lines[0]


@pytest.mark.acceptance
def test_exchanged_accelerometers_are_listed_beside_gyros(clean):
    for matrix in PERMUTATIONS[1:]:
        advice = said_of(replace(clean, specific_force=clean.specific_force @ matrix.T))
        # Gravity that is reversed as a whole turns like gravity: the record does not show it.
        if np.array_equal(matrix, -np.eye(3)):
            assert advice == ""
        else:
            assert f"--channels {order_of(matrix)}" in advice


@pytest.mark.parametrize("seed", range(6))
def test_right_gyros_are_advised_nothing(seed):
    rng = np.random.default_rng(seed)
    motions = {
        "gyro_bias": rng.normal(0.0, 0.02, 3),
        "sensitivity": rng.normal(0.0, 5e-3, (3, 3)),
        "gamma": np.tril(rng.normal(0.0, 0.05, (3, 3))),
        "force_noise": 10.0 ** rng.uniform(-2.0, -0.3),
    }
    record: Any = strapdown_record(seed=seed, **motions)
    assert said_of(record) == ""
    lagging = replace(record, rate=np.roll(record.rate, int(rng.integers(0, 6)), axis=0) * rng.uniform(0.9, 1.1, 3))
    assert said_of(lagging) == ""


@pytest.mark.first(1)
@pytest.mark.parametrize(("speed", "every"), [(2.0, 1), (25.0, 1), (25.0, 30)])
def test_rotations_are_compared_with_the_true_ones_however_fast(speed, every):
    """With the truth in every thirtieth row the block turns by more than half a turn between known rows."""
    record = filmed(1, speed=speed, truth_every=every)
    assert trust_of(record).faults == ()
    for matrix in PERMUTATIONS[5::11]:
        advice = trust_of(replace(record, rate=record.rate @ matrix.T)).faults
        assert advice
        assert f"read it with --channels w={order_of(matrix)}" in advice[0]
    advice = trust_of(replace(record, rate=np.degrees(record.rate))).faults
    assert advice
    assert "--channels w=deg" in advice[0]


def test_where_the_truth_says_that_the_gyros_are_right_the_accelerometers_are_exchanged():
    """The motion is slow enough that gravity's turning shows in the accelerometers too."""
    record = filmed(4, speed=2.0)
    matrix = PERMUTATIONS[8 + 3]
    with pytest.raises(InputError, match="the accelerometers are exchanged") as refused:
        trusted(replace(record, specific_force=record.specific_force @ matrix.T))
    assert f"--channels {order_of(matrix)}" in str(refused.value)
    assert "w=" not in str(refused.value)


@pytest.mark.first(1)
@pytest.mark.parametrize("lag", [0.005, 0.05, 0.1])
def test_gyros_that_lag_or_scale_wrongly_are_right(lag):
    record = filmed(2, speed=12.0, lag=lag)
    assert trust_of(record).faults == ()
    assert trust_of(replace(record, rate=record.rate * [0.9, 1.1, 1.05])).faults == ()


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("change", "advice"),
    [
        (lambda q: q * [1.0, -1.0, -1.0, -1.0], "reference to body;"),
        (lambda q: np.roll(q, -1, axis=1), "body to reference, scalar last"),
        (lambda q: np.roll(q, 1500, axis=0), "is it body to reference, scalar first?"),
    ],
)
def test_a_true_attitude_of_another_meaning_is_said(change, advice):
    record = filmed(3, speed=6.0)
    with pytest.raises(InputError, match="do not turn as the true attitude") as refused:
        trusted(replace(record, attitude=change(record.attitude)))
    assert advice in str(refused.value)


@pytest.mark.acceptance
@pytest.mark.parametrize(("part", "way"), [(0.3, 9), (0.5, 21), (0.85, 40)])
def test_channels_that_change_during_a_record_are_said_with_the_time_and_no_way_of_reading(clean, part, way):
    """Test gravity, the true attitude, and a change of the accelerometers."""
    for record, of_forces in ((clean, False), (clean, True), (filmed(1, speed=2.0), False)):
        time, matrix = record.time_s, PERMUTATIONS[way]
        later = (time > part * time[-1])[:, None]
        force, rate = record.specific_force, record.rate
        if of_forces:
            force = np.where(later, force @ matrix.T, force)
        else:
            rate = np.where(later, rate @ matrix.T, rate)
        advice = "; ".join(trust_of(replace(record, rate=rate, specific_force=force)).faults)
        inspection = re.search(r"change their order, signs or unit at ([\d.]+) s: no --channels reads both", advice)
        if inspection is None:
            # moves of one half alone may leave two orders; then gravity at the later rests decides
            assert (record is clean, way) == (True, 21)
            assert "the gyros miss gravity after" in advice
            continue
        assert float(inspection[1]) == pytest.approx(part * time[-1], abs=0.1 * time[-1])


@pytest.mark.acceptance
def test_accelerometers_that_are_all_reversed_or_a_reference_whose_z_points_down_are_said(tmp_path):
    record = filmed(5, speed=2.0)
    assert downward_warning(record) == ()
    # a reference with a level z axis is neither
    level = Rotation.from_euler("x", 90.0, degrees=True) * Rotation.from_quat(np.roll(record.attitude, -1, axis=1))
    assert downward_warning(replace(record, attitude=np.roll(level.as_quat(), 1, axis=1))) == ()
    reversed_ = replace(record, specific_force=-record.specific_force)
    (advice,) = downward_warning(reversed_)
    assert "z points down, or all accelerometers are reversed (--channels -1,-2,-3)" in advice
    assert not trust_of(reversed_).faults
    path = tmp_path / "measured.csv"
    write_record(reversed_, path)
    assert advice in check(path).warnings
    assert advice not in check(path, ["-1,-2,-3"]).warnings
    assert advice in trusted(reversed_).warnings


@pytest.mark.acceptance
def test_check_and_apply_say_what_diagnose_would_refuse(clean, tmp_path):
    path = tmp_path / "measured.csv"
    write_record(replace(clean, rate=clean.rate @ PERMUTATIONS[30].T), path)
    option = f"--channels w={order_of(PERMUTATIONS[30])}"
    assert option in check(path).problems[0].text
    assert any(option in line for line in check(path, trust=True).warnings)
    assert check(path, [option.split()[1]]).good
    rng = np.random.default_rng(1)
    bench = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    calibration = calibrate(bench, noise_bound=1e-5)
    with pytest.raises(InputError, match=re.escape(option)):
        apply(calibration, path)
    assert any(option in line for line in apply(calibration, path, trust=True).warnings)
    write_record(replace(bench, specific_force=bench.specific_force[:, [1, 0, 2]]), path)
    assert any("--channels 2,1,3" in line for line in apply(calibration, path).warnings)
    write_record(bench, path)
    assert not apply(calibration, path).warnings
    mounted = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)), mounting=PRESETS["cyclic"])
    write_record(mounted, path)
    assert not apply(calibrate(mounted, noise_bound=1e-5, mounting="cyclic"), path).warnings


@pytest.mark.acceptance
def test_channels_read_gyros_right_and_who_knows_them_says_so(clean, tmp_path):
    matrix = PERMUTATIONS[29]
    path = tmp_path / "measured.csv"
    write_record(replace(clean, rate=clean.rate @ matrix.T), path)
    assert inspect_record(read_record(path, StrapdownRecord)).turning.said
    right: Any = read_record(path, StrapdownRecord, channels=[f"w={order_of(matrix)}"])
    np.testing.assert_allclose(right.rate, clean.rate, atol=1e-12)
    assert not inspect_record(right).turning.said
    assert "read with --channels w=" in str(inspect_record(right))
    as_it_stands = replace(right, rate=clean.rate @ matrix.T, channels=Channels())
    assert not inspect_record(as_it_stands).turning.said


LONG = [
    pytest.param(name, marks=pytest.mark.acceptance) for name in ("broad-03", "broad-08", "broad-21", "xsens-imu-tk")
]


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["mpu9150-4", *LONG])
def test_no_measured_record_is_read_wrongly(name):
    record: Any = measured(name)
    assert trust_of(record).faults == ()
    matrix = PERMUTATIONS[13]
    with pytest.raises(InputError, match=f"--channels w={order_of(matrix)}"):
        trusted(replace(record, rate=record.rate @ matrix.T))
