"""Noise of simulated records: right processes, true intervals, the Allan deviation of another program."""

import json
import math
from dataclasses import replace

import allantools
import numpy as np
import pytest
import yaml

import trihedron as th
from generator.noise import GRAVITY, known, noise_series, static_record
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.noise import Letter, Noise, Sensor
from trihedron.tools.records import ForceRecord, StrapdownRecord, write_record
from trihedron.tools.rounding import digits

STEP = 0.01
HOUR = 360_000
GYRO_SIZE, FORCE_SIZE = 1e-4, 1e-3


def noise_of(gyro, accelerometer, seed: int, rows: int = HOUR) -> Noise:
    """Return the noise of a static record, in units of these sizes."""
    record = static_record(
        rows,
        STEP,
        {letter: GYRO_SIZE * size for letter, size in gyro.items()},
        {letter: FORCE_SIZE * size for letter, size in accelerometer.items()},
        seed,
    )
    return th.noise(record)


def interval_holds(result: Noise, sensor: Sensor, letter: Letter, truth: float) -> list[bool]:
    """Return for each axis whether the interval of a coefficient holds the truth."""
    holds = []
    for channel in result.of(sensor):
        one = channel.coefficient(letter)
        assert one is not None
        assert one.high is not None
        holds.append((one.low or 0.0) <= truth <= one.high)
    return holds


def sets_of(result: Noise, sensor: Sensor) -> list[str]:
    return [channel.admissible[0] for channel in result.of(sensor)]


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("sizes", "name"),
    [
        ({"N": 1.0}, "N"),
        ({"N": 1.0, "B": 0.4}, "N + B"),
        ({"N": 1.0, "K": 0.1}, "N + K"),
        ({"N": 1.0, "Q": 0.18}, "N + Q"),
        ({"N": 1.0, "M": 1.0}, "N + M"),
    ],
)
def test_large_processes_are_named_with_their_size(sizes, name):
    """Each process is well above its limit of detection; of six axes one interval in twenty may miss."""
    result = noise_of(sizes, sizes, seed=len(name), rows=120_000)
    names = sets_of(result, "gyro") + sets_of(result, "accelerometer")
    assert names.count(name) >= 5
    for letter, size in sizes.items():
        holds = interval_holds(result, "gyro", letter, GYRO_SIZE * size) if names[:3] == [name] * 3 else []
        holds += interval_holds(result, "accelerometer", letter, FORCE_SIZE * size) if names[3:] == [name] * 3 else []
        assert holds.count(False) <= 1


@pytest.mark.acceptance
def test_a_process_that_is_not_there_has_an_upper_end_near_the_limit_of_detection():
    result = noise_of({"N": 1.0}, {"N": 1.0}, seed=1)
    for channel in result.of("gyro"):
        flicker, walk = known(channel.coefficient("B")), known(channel.coefficient("K"))
        assert not flicker.detected
        # medians over records: 3.8 N/sqrt(T) and 12 N/T
        assert 0.3 < known(flicker.high) / (3.8 * GYRO_SIZE / 60.0) < 4.0
        assert 0.3 < known(walk.high) / (12.0 * GYRO_SIZE / 3600.0) < 5.0


@pytest.mark.acceptance
def test_allan_deviation_is_that_of_another_program():
    values = noise_series(5000, STEP, {"N": 1.0, "B": 0.5}, seed=3)
    record = StrapdownRecord(
        time_s=STEP * np.arange(5000),
        rate=1e-4 * np.stack([values] * 3, axis=1),
        increment=None,
        specific_force=np.stack([values, values, values + 1000.0], axis=1) * 1e-2,
    )
    curve = th.noise(record, gravity=10.0).of("gyro")[0].allan
    _, deviation, _, _ = allantools.oadev(1e-4 * values, rate=1.0 / STEP, data_type="freq", taus=np.array(curve.tau_s))
    np.testing.assert_allclose(curve.deviation, deviation, rtol=1e-12)


@pytest.mark.acceptance
def test_its_band_holds_the_allan_deviation_of_such_records():
    inside = []
    for seed in range(5):
        result = noise_of({"N": 1.0, "B": 0.4}, {"N": 1.0}, seed=50 + seed, rows=20_000)
        for channel in result.channels:
            curve = channel.allan
            inside += [
                low <= d <= high
                for low, d, high in zip(curve.model_low, curve.deviation, curve.model_high, strict=True)
            ]
    assert 0.90 < np.mean(inside) < 0.995


@pytest.mark.acceptance
def test_sigma_for_positions_is_kept_by_averages_of_such_noise():
    """Averages of simulated rests keep the bound in about the stated part of records, and nearly reach it."""
    step, rows, sizes = 0.1, 200, {"N": 1e-3, "K": 3e-5}
    result = th.noise(static_record(36_000, step, {"N": 1e-4}, sizes, seed=8), dwell=20.0, positions=24)
    averaged = result.averaged
    assert averaged is not None
    largest = []
    for seed in range(100):
        readings = [noise_series(24 * rows, step, sizes, 1000 * seed + axis) for axis in range(3)]
        means = np.stack(readings).reshape(3, 24, rows).mean(axis=2)
        largest.append(np.abs(means - means.mean(axis=1, keepdims=True)).max() / GRAVITY)
    kept = np.mean(np.array(largest) <= averaged.sigma)
    assert kept >= 0.93
    assert 0.4 * averaged.sigma < np.median(largest) < averaged.sigma


@pytest.mark.acceptance
def test_growth_of_the_attitude_error_is_at_least_that_of_simulated_records():
    """The prediction takes upper ends, and the worst axis: it is up to twice the spread, never far below."""
    step, sizes = 0.1, {"N": 1e-4, "B": 4e-5}
    result = th.noise(static_record(72_000, step, sizes, {"N": 1e-3}, seed=9))
    predicted = math.radians(known(result.drifts[1].attitude_deg))
    ends = []
    for seed in range(80):
        rates = noise_series(6600, step, sizes, 5000 + seed)
        ends.append((rates[600:] - rates[:600].mean()).sum() * step)
    assert 0.9 < predicted / np.std(ends) < 2.5


@pytest.mark.acceptance
def test_growth_by_detected_processes_is_that_of_the_noise_and_the_rest_is_said_apart():
    """White noise alone: N times the root of t + t²/60 s, the second part from the bias taken over a minute."""
    result = th.noise(static_record(60_000, 0.01, {"N": 1e-4}, {"N": 1e-3}, seed=4))
    for drift in result.drifts:
        turned = math.degrees(1e-4 * math.sqrt(drift.time_s + drift.time_s**2 / 60.0))
        moved = 1e-3 * math.sqrt(drift.time_s + drift.time_s**2 / 60.0)
        assert known(drift.attitude_detected_deg) == pytest.approx(turned, rel=0.02)
        assert known(drift.velocity_detected_mps) == pytest.approx(moved, rel=0.02)
        assert known(drift.attitude_deg) > known(drift.attitude_detected_deg)


@pytest.mark.acceptance
def test_rests_of_a_longer_record_are_pooled_and_a_moved_record_is_not_static():
    rows = 3000
    record = static_record(rows, STEP, {"N": 1e-4}, {"N": 1e-3}, seed=4)
    force = record.specific_force.copy()
    rate = known(record.rate).copy()
    middle = slice(1400, 1600)
    rate[middle, 0] += 0.8
    force[1600:, 1:] = force[1600:, :0:-1]
    turned = StrapdownRecord(time_s=record.time_s, rate=rate, increment=None, specific_force=force)
    result = th.noise(turned)
    assert not result.static
    assert result.stretches == 2
    assert 0.9 < known(known(result.of("gyro")[0].coefficient("N")).estimate) / 1e-4 < 1.1


@pytest.mark.acceptance
def test_accelerometers_alone_have_noise_too():
    record = static_record(30_000, STEP, {"N": 1e-4}, {"N": 1e-3}, seed=12)
    alone = ForceRecord(time_s=record.time_s, specific_force=record.specific_force)
    result = th.noise(alone)
    assert result.static
    assert [channel.channel for channel in result.channels] == ["accelerometer 1", "accelerometer 2", "accelerometer 3"]
    assert known(result.of("accelerometer")[0].coefficient("N")).estimate == pytest.approx(1e-3, rel=0.02)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "hum", [((30.0, 2e-3),), ((17.3013, 1e-2),), ((29.9971, 1e-2), (17.3, 2e-4)), ((12.34567, 5e-3), (12.5, 3e-3))]
)
def test_mains_is_a_line_and_no_process(hum):
    record = static_record(60_000, STEP, {"N": 1e-4}, {"N": 1e-3}, seed=5)
    rate = known(record.rate).copy()
    for frequency, amplitude in hum:
        rate[:, 1] += amplitude * np.sin(2.0 * np.pi * frequency * record.time_s)
    humming = StrapdownRecord(time_s=record.time_s, rate=rate, increment=None, specific_force=record.specific_force)
    noise = th.noise(humming)
    channel = noise.of("gyro")[1]
    assert channel.admissible == ["N"]
    assert len(channel.lines) == len(hum)
    for line, (frequency, amplitude) in zip(channel.lines, hum, strict=True):
        assert line.frequency_hz == pytest.approx(frequency, abs=0.05)
        assert line.amplitude == pytest.approx(amplitude, rel=0.05)
        assert f"of amplitude {digits(line.amplitude, 3)} rad/s, is left out" in str(noise)


@pytest.mark.acceptance
def test_a_filter_of_the_sensor_gives_no_false_process():
    record = static_record(120_000, STEP, {"N": 1e-4}, {"N": 1e-3}, seed=6)
    rate = known(record.rate).copy()
    for row in range(1, len(rate)):
        rate[row] += 0.28 * rate[row - 1]
    filtered = StrapdownRecord(time_s=record.time_s, rate=rate, increment=None, specific_force=record.specific_force)
    result = th.noise(filtered)
    assert all(channel.filtered and channel.admissible == ["N"] for channel in result.of("gyro"))


@pytest.mark.acceptance
def test_warm_up_at_the_start_is_left_out_on_request():
    record = static_record(120_000, STEP, {"N": 1e-4}, {"N": 1e-3}, seed=7)
    warming = 2e-4 * np.exp(-record.time_s / 60.0)[:, None]
    warm = StrapdownRecord(
        time_s=record.time_s, rate=known(record.rate) + warming, increment=None, specific_force=record.specific_force
    )
    assert "K" not in sets_of(th.noise(warm), "gyro")[0].split(" + ")
    assert sets_of(th.noise(warm, skip=500.0), "gyro") == ["N", "N", "N"]


@pytest.mark.acceptance
def test_command_writes_json_page_and_kalibr(tmp_path, capsys):
    record = static_record(20_000, STEP, {"N": 1e-4, "K": 1e-5}, {"N": 1e-3}, seed=2)
    path = tmp_path / "static.csv"
    write_record(record, path)
    files = {name: tmp_path / name for name in ("noise.json", "noise.html", "imu.yaml")}
    words = ["noise", path, "--dwell", 10, "--json", files["noise.json"], "--report", files["noise.html"]]
    assert main([str(word) for word in [*words, "--kalibr", files["imu.yaml"]]]) == 0
    shown = capsys.readouterr().out
    assert "N angle random walk" in shown
    assert max(len(line) for line in shown.splitlines() if "warning" not in line) <= 80
    content = json.loads(files["noise.json"].read_text())
    assert content["schema"] == "trihedron.noise/1"
    assert known(Noise.model_validate(content).averaged).sigma > 0.0
    densities = yaml.safe_load(files["imu.yaml"].read_text())
    assert densities["update_rate"] == 100
    assert densities["gyroscope_noise_density"] == pytest.approx(1e-4, rel=0.1)
    assert densities["accelerometer_noise_density"] == pytest.approx(1e-3, rel=0.1)
    assert densities["accelerometer_random_walk"] > 0.0


@pytest.mark.acceptance
def test_refusals_say_what_to_do(tmp_path, capsys):
    positions = tmp_path / "positions.csv"
    rows = [f"{k},{15 * k},{10 * k},0.1,0.2,9.8" for k in range(12)]
    positions.write_text("position,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2\n" + "\n".join(rows) + "\n")
    assert main(["noise", str(positions)]) == 2
    slow, fast = tmp_path / "slow.csv", tmp_path / "fast.csv"
    write_record(static_record(2000, 0.02, {"N": 1e-4}, {"N": 1e-3}, seed=1), slow)
    write_record(static_record(2000, 0.01, {"N": 1e-4}, {"N": 1e-3}, seed=1), fast)
    assert main(["noise", str(slow), str(fast)]) == 2
    assert "give records of one rate" in capsys.readouterr().err
    assert main(["noise", str(slow), "--dwell", "-1"]) == 2
    assert "--dwell -1.0" in capsys.readouterr().err
    assert main(["noise", str(slow), "--json", str(slow)]) == 2


@pytest.mark.parametrize("rows", [1, 2, 15])
def test_a_record_of_few_rows_has_no_rest(rows: int):
    record = static_record(rows, 0.01, {"N": 1e-4}, {"N": 1e-3}, 4)
    with pytest.raises(InputError, match=f"has {rows} rows; a rest of"):
        th.noise(record)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("least", [2e-4, 8.7e-4])
def test_coarse_readings_at_rest_are_no_fault(seed: int, least: float):
    """Gyros of 0.01 and 0.05 deg/s that repeat themselves for many rows, and a biased one at exactly 0."""
    record = static_record(3000, 0.01, {"N": 2e-5}, {"N": 1e-3}, seed)
    rate = least * np.round(known(record.rate) / least + [0.0, 0.3, -2.4])
    force = 0.01 * np.round(record.specific_force / 0.01)
    noise = th.noise(replace(record, rate=rate, specific_force=force))
    hidden = [line.partition(":")[0] for line in noise.warnings if "steps are wider than its noise" in line]
    assert hidden == (["gyro 1", "gyro 2", "gyro 3"] if least > 5e-4 else [])
    assert len(noise.warnings) == len(hidden)
    assert noise.static


@pytest.mark.first(1)
@pytest.mark.parametrize("value", [0.0, 1e-3, 9.80665])
def test_a_channel_that_repeats_one_value_is_a_warning(value: float):
    record = static_record(2000, 0.01, {"N": 1e-4}, {"N": 1e-3}, 6)
    force = np.column_stack([record.specific_force[:, :2], np.full(2000, 9.8)])
    rate = np.column_stack([np.full(2000, 0.01 * value), known(record.rate)[:, 1:]])
    noise = th.noise(replace(record, rate=rate, specific_force=force))
    assert [line.partition(":")[0] for line in noise.warnings] == ["gyro 1", "accelerometer 3"]
    assert noise.channels[1].coefficients[0].detected
