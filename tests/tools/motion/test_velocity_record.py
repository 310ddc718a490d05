"""Records with increments of velocity: read, integrated beside the attitude, refused if they are incomplete."""

import math

import numpy as np
import pytest
from scipy.special import j1

import trihedron as th
from trihedron.tools.check import check
from trihedron.tools.cli import main
from trihedron.tools.records import StrapdownRecord, read_record, write_record

PERIOD, AMPLITUDE, FORCE = 0.01, 0.3, 5.0


def sculled(periods: int = 4, count: int = 40) -> StrapdownRecord:
    """Return a turn A sin Ωt about the first axis, a force B sin Ωt along the second and g along the third of the
    body."""
    phase = 2.0 * math.pi * np.arange(-1, periods * count + 1) / count
    rate = 2.0 * math.pi / (count * PERIOD)
    zero = np.zeros(len(phase) - 1)
    increment = np.column_stack((AMPLITUDE * np.diff(np.sin(phase)), zero, zero))
    velocity = np.column_stack((zero, -FORCE / rate * np.diff(np.cos(phase)), np.full_like(zero, 9.8 * PERIOD)))
    force = np.column_stack((zero, FORCE * np.sin(phase[1:]), np.full_like(zero, 9.8)))
    time = PERIOD * np.arange(len(zero))
    return StrapdownRecord(time, None, increment, force, velocity_increment=velocity)


def without_force(record: StrapdownRecord, path):
    write_record(record, path)
    table = [line.split(",") for line in path.read_text().splitlines()]
    places = [k for k, name in enumerate(table[0]) if not name.startswith("f")]
    path.write_text("\n".join(",".join(row[k] for k in places) for row in table) + "\n")
    return path


def test_a_record_of_increments_gives_the_velocity_of_strong_sculling(tmp_path, capsys) -> None:
    path = without_force(sculled(), tmp_path / "sculled.csv")
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    assert check(path).kind == "strapdown record"
    # The specific force at a row is the mean of the intervals beside it, without a lag.
    error = np.abs(record.specific_force - sculled().specific_force)[1:-1]
    assert error.max() < 1.1 * FORCE * (2.0 * math.pi / 40) ** 2 / 6
    run = th.attitude_of_record(record, algorithm="functional-iteration-8")
    assert run.velocity_at_end is not None
    # Along the third axis: sculling's B J1(A), and the mean of g cos θ, g J0(A).
    end = 160 * PERIOD
    lifted = 9.8 * end * np.cos(AMPLITUDE * np.sin(np.linspace(0, 2 * np.pi, 100001)[:-1])).mean()
    assert run.velocity_at_end[2] == pytest.approx(FORCE * j1(AMPLITUDE) * end + lifted, rel=1e-9)
    assert run.to_polars().columns[5:8] == ["v1_mps", "v2_mps", "v3_mps"]
    assert main(["attitude", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "velocity at the end" in capsys.readouterr().out
    coarse = th.attitude_of_record(record, algorithm="functional-iteration-4", rate_divisor=2)
    assert coarse.velocity_at_end == pytest.approx(run.velocity_at_end, rel=1e-4)


def test_velocity_increments_follow_the_accelerometers_channels(tmp_path) -> None:
    path = without_force(sculled(), tmp_path / "turned.csv")
    turned = read_record(path, channels=("2,1,-3",))
    assert isinstance(turned, StrapdownRecord)
    expected = np.asarray(sculled().velocity_increment) @ [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    assert np.asarray(turned.velocity_increment).tolist() == expected.tolist()


def test_a_part_of_the_specific_forces_is_refused(tmp_path, capsys) -> None:
    path = without_force(sculled(), tmp_path / "part.csv")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0] + ",f1_mps2", *(line + ",0" for line in lines[1:])]) + "\n")
    assert main(["attitude", str(path)]) == 2
    assert "column 'f2_mps2' is missing" in capsys.readouterr().err


def test_a_saturated_accelerometer_is_told() -> None:
    record = sculled(20)
    noise = np.random.default_rng(1).normal(scale=1e-4, size=(3, len(record), 3))
    free = np.asarray(record.velocity_increment) + noise[0]
    velocity = free.copy()
    velocity[:, 1] = np.minimum(velocity[:, 1], 0.03)
    force, turn = record.specific_force + noise[1], np.asarray(record.increment) + 0.01 * noise[2]
    spoilt = StrapdownRecord(record.time_s, None, turn, force, velocity_increment=velocity)
    lines = th.attitude_of_record(spoilt).warnings
    assert any(line.startswith("dv2: ") and "saturated, at 0.03 m/s" in line for line in lines)
    unclipped = StrapdownRecord(record.time_s, None, turn, force, velocity_increment=free)
    assert not any("dv" in line for line in th.attitude_of_record(unclipped).warnings)
