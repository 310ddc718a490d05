"""Time stamps: coarse, late and bursty ones lose no row; gaps are found; the report names the stamps that count."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from _pytest.mark.structures import ParameterSet
from scipy.spatial.transform import Rotation

import trihedron as th
from field_files import field_file
from generator.positions import write_hidden_record
from generator.runs import PROGRAMME, Bench
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord, write_record
from trihedron.tools.records.stamps import grid_of

PERIOD = 0.01
RESTS, REST_ROWS, MOVE_ROWS = 8, 200, 100


def times_of(path: Path, stamps: str | None = None) -> np.ndarray:
    """Return the times of a record [s]."""
    time = th.read_record(path, stamps=stamps).time_s
    assert time is not None
    return time


def moved_by_hand(seed: int, moments: np.ndarray | None = None) -> StrapdownRecord:
    """Return a block that is turned between rests, sampled at some moments (N,); 0 to N - 1 are the even ones."""
    rng = np.random.default_rng(seed)
    count = RESTS * REST_ROWS + (RESTS - 1) * MOVE_ROWS
    at = np.arange(count, dtype=float) if moments is None else moments
    rate = np.zeros((count, 3))
    fine = np.arange(count * 4) / 4.0
    speed = np.zeros((len(fine), 3))
    for move in range(RESTS - 1):
        begin = REST_ROWS + move * (REST_ROWS + MOVE_ROWS)
        axis = rng.standard_normal(3)
        turn = rng.uniform(0.7, 2.0) * axis / np.linalg.norm(axis)
        for rows, values in ((fine, speed), (at, rate)):
            phase = np.clip((rows - begin) / MOVE_ROWS, 0.0, 1.0)
            wobble = 1.0 + 0.9 * np.sin(2.0 * np.pi * 9.0 * phase)
            values += ((1.0 - np.cos(2.0 * np.pi * phase)) * wobble)[:, None] * turn / (MOVE_ROWS * PERIOD)
    turned = Rotation.identity()
    up = np.empty((len(fine), 3))
    for k, step in enumerate(speed * PERIOD / 4.0):
        up[k] = turned.inv().apply([0.0, 0.0, 9.80665])
        turned = turned * Rotation.from_rotvec(step)
    force = np.column_stack([np.interp(at, fine, values) for values in up.T])
    return StrapdownRecord(
        time_s=PERIOD * at,
        rate=rate + 5e-4 * rng.standard_normal((count, 3)) + [0.002, -0.001, 0.003],
        increment=None,
        specific_force=force + 0.01 * rng.standard_normal((count, 3)),
        row=np.arange(count) + 2,
    )


def stamped(time: np.ndarray, kind: str, seed: int) -> np.ndarray:
    """Return even times as a logger of some kind stamps them."""
    rng = np.random.default_rng(seed)
    count = len(time)
    if kind == "jitter":
        return time + rng.uniform(-0.4, 0.4, count) * PERIOD
    if kind == "coarse":
        step = PERIOD * rng.uniform(0.6, 0.95)
        return np.floor(time / step) * step
    if kind == "single precision":
        return (time + 1e5).astype(np.float32).astype(float)
    if kind == "late":
        late = time + np.where(rng.random(count) < 0.1, rng.exponential(3.0, count), 0.0) * PERIOD
        return np.maximum.accumulate(late) + 1e-7 * np.arange(count)
    size = int(rng.integers(5, 25))
    group = np.minimum((np.arange(count) // size + 1) * size, count) - 1
    bursts = time[group] + 0.1 * PERIOD * (np.arange(count) % size)
    return np.maximum.accumulate(bursts) + 1e-7 * np.arange(count)


KINDS = ("jitter", "coarse", "single precision", "late", "bursts")


def before_release(value: object) -> ParameterSet:
    """Return a further value of a kind that is tried already: only the long tests have it."""
    return pytest.param(value, marks=pytest.mark.acceptance)


SEEDS = (0, before_release(1), before_release(2))


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_stamps_of_even_samples_lose_no_row(kind: str, seed: int) -> None:
    grid = grid_of(stamped(PERIOD * np.arange(5000), kind, seed))
    assert grid.regular
    assert len(grid.gaps) == 0
    assert grid.period == pytest.approx(PERIOD, rel=1e-3)


@pytest.mark.first(2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_gap_is_found_among_such_stamps(kind: str, seed: int) -> None:
    rows = np.arange(5000)
    rows[2000:] += 60
    rows[3500:] += 90
    grid = grid_of(stamped(PERIOD * rows, kind, seed))
    is_first = grid.gaps < 2700
    assert np.abs(grid.gaps - np.where(is_first, 1999, 3499)).max() <= 25
    assert [grid.lost[is_first].sum(), grid.lost[~is_first].sum()] == pytest.approx([60, 90], abs=3)


@pytest.mark.parametrize(("lost", "places"), [((1,), (700,)), ((3, 1), (200, 900)), ((40, 2, 9), (100, 500, 1400))])
def test_single_lost_rows_are_found_beside_jitter(lost: tuple[int, ...], places: tuple[int, ...]) -> None:
    rows = np.arange(2000)
    for place, count in zip(places, lost, strict=True):
        rows[place:] += count
    time = PERIOD * rows + np.random.default_rng(5).uniform(-0.2, 0.2, 2000) * PERIOD
    assert grid_of(time).lost.tolist() == list(lost)


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", KINDS)
def test_even_stamps_count_where_samples_are_even(kind: str, tmp_path: Path) -> None:
    record = moved_by_hand(3)
    write_record(replace(record, time_s=stamped(record.time_s, kind, 4)), tmp_path / "record.csv")
    inspection = th.inspect(tmp_path / "record.csv")
    assert inspection.sampling.missing == 0
    assert len(inspection.rests) == RESTS
    assert any(line.startswith("time stamps: even, one every") for line in inspection.seen.warnings)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", SEEDS)
def test_stamps_as_logged_count_where_samples_are_uneven(seed: int, tmp_path: Path) -> None:
    count = RESTS * REST_ROWS + (RESTS - 1) * MOVE_ROWS
    moments = np.arange(count) + np.random.default_rng(seed).uniform(-0.45, 0.45, count)
    write_record(moved_by_hand(seed, moments), tmp_path / "record.csv")
    inspection = th.inspect(tmp_path / "record.csv")
    assert any(line.startswith("time stamps: as logged") for line in inspection.seen.warnings)
    assert inspection.sampling.missing == 0


@pytest.mark.acceptance
def test_the_option_decides(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = moved_by_hand(6)
    path = tmp_path / "record.csv"
    write_record(replace(record, time_s=stamped(record.time_s, "jitter", 7)), path)
    for stamps, words in (("even", "even, one every"), ("logged", "as logged"), ("50", "even, one every 0.02 s")):
        # With half of the true sampling rate the gyros turn twice as far as gravity: refused without --trust.
        command = ["inspect", str(path), "--stamps", stamps, "--trust", "--json", str(tmp_path / "out.json")]
        assert main(command) == 0
        assert f"time stamps: {words}" in capsys.readouterr().out
        assert words in json.loads((tmp_path / "out.json").read_text())["record"]["warnings"][-1]
    for stamps in ("uneven", "0", "nan", "-3"):
        assert main(["inspect", str(path), "--stamps", stamps]) == 2
        assert "even, logged or the sampling rate in hertz" in capsys.readouterr().err


@pytest.mark.parametrize("stamps", ["uneven", "0", "nan"])
def test_words_that_are_no_stamps_are_refused_of_a_table_of_positions_too(stamps, tmp_path):
    (tmp_path / "record.csv").write_text(
        "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2\n1,0,0,0,0,0,9.8\n"
    )
    with pytest.raises(th.InputError, match=f"stamps {stamps}: give even, logged or"):
        th.read_record(tmp_path / "record.csv", stamps=stamps)


@pytest.mark.acceptance
@pytest.mark.parametrize("step", [0.05, before_release(0.1), before_release(1.0)])
def test_stamps_that_repeat_are_refused_with_a_way_on(step: float, tmp_path: Path) -> None:
    record = moved_by_hand(8)
    table = record.to_polars().with_columns((pl.col("time_s") / step).floor() * step)
    table.write_csv(tmp_path / "record.csv")
    with pytest.raises(
        InputError, match=r"row \d+, column time_s: .* repeats; .*sampled evenly are taken with .*stamps"
    ):
        th.inspect(tmp_path / "record.csv")
    inspection = th.inspect(tmp_path / "record.csv", stamps="100")
    assert inspection.sampling.period == pytest.approx(0.01)
    assert len(inspection.rests) == RESTS


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", SEEDS)
def test_rests_need_no_regular_sampling(seed: int, tmp_path: Path) -> None:
    record = moved_by_hand(seed)
    kept = np.sort(np.random.default_rng(seed).choice(len(record), len(record) // 2, replace=False))
    record.to_polars()[kept.tolist()].write_csv(tmp_path / "record.csv")
    assert len(th.inspect(tmp_path / "record.csv").rests) >= RESTS - 1


@pytest.mark.acceptance
def test_a_regular_record_is_as_it_is_read(tmp_path: Path) -> None:
    record = moved_by_hand(9)
    write_record(record, tmp_path / "record.csv")
    inspection = th.inspect(tmp_path / "record.csv")
    assert inspection.seen.warnings == ()
    assert np.array_equal(inspection.record.time_s, record.time_s)
    assert inspection.sampling.period == float(np.mean(np.diff(record.time_s)))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_jump_ends_a_rest(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    faces = np.vstack([np.eye(3), -np.eye(3)])[rng.permutation(6)]
    count = 400
    force = 9.80665 * np.repeat(faces, count, axis=0) + 0.02 * rng.standard_normal((6 * count, 3))
    rate = 0.004 * rng.standard_normal((6 * count, 3)) + [0.001, 0.0, -0.002]
    record = StrapdownRecord(PERIOD * np.arange(6 * count), rate, None, force, row=np.arange(6 * count) + 2)
    write_record(record, tmp_path / "record.csv")
    assert len(th.inspect(tmp_path / "record.csv").rests) == 6


@pytest.mark.first(1)
@pytest.mark.parametrize("rows", [16, 8, 23])
@pytest.mark.parametrize("algorithm", ["two-sample-rodrigues", "four-sample-recursive", "rodrigues-iteration-8"])
def test_rows_that_fill_no_step_are_said_to_be_left_out(rows: int, algorithm: str, tmp_path: Path) -> None:
    moving = moved_by_hand(1).to_polars()[300 : 300 + rows]
    moving.write_csv(tmp_path / "record.csv")
    run = th.attitude_of_record(tmp_path / "record.csv", algorithm=algorithm)
    left = int(run.row[-1]) != rows + 1
    assert any("complete a step of" in line for line in run.warnings) == left


@pytest.mark.acceptance
@pytest.mark.parametrize(("name", "seconds", "unit"), [("micros", 1e-6, "us"), ("millis", 1e-3, "ms")])
@pytest.mark.parametrize("bits", [16, 32])
def test_a_counter_that_wraps_goes_on(name: str, seconds: float, unit: str, bits: int, tmp_path: Path) -> None:
    step = round(PERIOD / seconds)
    counts = (2**bits - 40 * step + step * np.arange(400)) % 2**bits
    lines = [f"{name},ax [m/s2],ay [m/s2],az [m/s2],gx [rad/s],gy [rad/s],gz [rad/s]"]
    for count in counts.tolist():
        lines.append(f"{count},0.01,0.02,9.8066,0.001,0.002,0.003")
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    th.import_record(tmp_path / "log.csv", out=tmp_path / "record.csv", answers={"units.time": unit})
    steps = np.diff(times_of(tmp_path / "record.csv"))
    assert np.allclose(steps, PERIOD, atol=1e-9)


@pytest.mark.first(1)
@pytest.mark.parametrize("first", [1403636579758555392, 1700000000000000001, 1699999999999999937])
def test_epoch_nanoseconds_stay_exact(first: int, tmp_path: Path) -> None:
    lines = ["#timestamp [ns],wx [rad/s],wy [rad/s],wz [rad/s],ax [m/s2],ay [m/s2],az [m/s2]"]
    for row in range(200):
        lines.append(f"{first + 5_000_001 * row},0.001,0.002,0.003,0.01,0.02,9.8066")
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    th.import_record(tmp_path / "log.csv", out=tmp_path / "record.csv")
    time = times_of(tmp_path / "record.csv")
    assert time.tolist() == [5_000_001 * row * 1e-9 for row in range(200)]


def increments_of(record: StrapdownRecord) -> StrapdownRecord:
    """Return the record with increments of angle and velocity in place of rates."""
    assert record.rate is not None
    turns, speeds = PERIOD * record.rate, PERIOD * record.specific_force
    return replace(record, rate=None, increment=turns, velocity_increment=speeds)


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", ["jitter", before_release("late"), before_release("bursts")])
def test_stamps_of_increments_are_taken_and_said(kind: str, tmp_path: Path) -> None:
    record = increments_of(moved_by_hand(3))
    write_record(replace(record, time_s=stamped(record.time_s, kind, 4)), tmp_path / "record.csv")
    message = th.read_record(tmp_path / "record.csv").warnings
    assert any(line.startswith("time stamps: ") and "nothing in the record tells" in line for line in message)
    run = th.attitude_of_record(tmp_path / "record.csv", stamps="even")
    assert run.period == pytest.approx(PERIOD, rel=1e-3)
    assert run.attitude == pytest.approx(th.attitude_of_record(record).attitude, abs=1e-12)


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", ["coarse", before_release("jitter"), before_release("bursts")])
def test_a_corrected_record_has_the_stamps_that_counted(kind: str, tmp_path: Path) -> None:
    record = moved_by_hand(5)
    path, out = tmp_path / "record.csv", tmp_path / "out.csv"
    write_record(replace(record, time_s=stamped(record.time_s, kind, 6)), path)
    write_hidden_record(tmp_path / "clean.csv", 5)
    calibration = th.calibrate(tmp_path / "clean.csv", noise_bound=1e-5)
    (tmp_path / "calibration.json").write_text(calibration.json_text())
    for stamps, times in (("even", None), ("100", None), ("logged", times_of(path, "logged"))):
        words = ["apply", str(tmp_path / "calibration.json"), str(path), "--out", str(out), "--stamps", stamps]
        assert main([*words, "--json", str(tmp_path / "out.json"), "--trust", "-q"]) == 0
        written = times_of(out, "logged")
        if times is None:
            assert np.diff(written) == pytest.approx(PERIOD, rel=1e-3)
        else:
            assert written.tolist() == times.tolist()
        assert "time stamps: " in (tmp_path / "out.json").read_text()


def test_a_raw_record_of_stamps_that_repeat_is_calibrated_by_its_rate(tmp_path: Path) -> None:
    record, _ = Bench(white=1e-4).run(PROGRAMME[:3])
    right = th.calibrate(record, noise_bound=1e-3)
    period = float(np.median(np.diff(record.time_s)))
    step = 4.0 * period
    table = record.to_polars().with_columns((pl.col("time_s") / step).floor() * step)
    table.write_csv(tmp_path / "coarse.csv")
    with pytest.raises(InputError, match=r"repeats; .*stamps RATE_HZ"):
        th.calibrate(tmp_path / "coarse.csv", noise_bound=1e-3)
    result = th.calibrate(tmp_path / "coarse.csv", noise_bound=1e-3, stamps=f"{1.0 / period}")
    assert (result.verdict, result.radius) == (right.verdict, pytest.approx(right.radius, rel=1e-6))
    assert any("those logged are unused" in line for line in result.warnings)


@pytest.mark.first(1)
@pytest.mark.parametrize("stamps", ["even", "logged", "100"])
def test_one_row_has_no_period(stamps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    moved_by_hand(3).to_polars()[:1].write_csv(tmp_path / "record.csv")
    assert main(["inspect", str(tmp_path / "record.csv"), "--stamps", stamps]) == 2
    assert "has 1 rows; at least 16 are needed" in capsys.readouterr().err


# Files from the field


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("name", "rests"),
    [
        ("tq_100_0.0078125_100000.0.csv", 9),
        ("t_f32_1e5.csv", 15),
        ("real_jitter_5ms_grid.csv", 3),
        ("real_bursts.csv", 1),
    ],
)
def test_field_stamps_lose_no_row(name: str, rests: int, tmp_path: Path) -> None:
    inspection = th.inspect(field_file(name, tmp_path))
    assert inspection.sampling.missing == 0
    assert inspection.sampling.period == pytest.approx(PERIOD, rel=0.01)
    assert len(inspection.rests) == rests
    assert any(line.startswith("time stamps: ") for line in inspection.seen.warnings)


def test_field_sections_cut_together_are_six_rests(tmp_path: Path) -> None:
    file = field_file("real_cut_rests.csv", tmp_path)
    assert len(th.inspect(file).rests) == 6
    assert not th.inspect(file).trust.faults
    assert not th.check(file).problems


@pytest.mark.parametrize(("name", "end"), [("tail_16.csv", "12.12"), ("tail_8.csv", "12.04")])
def test_field_tails_are_said_to_be_left_out(name: str, end: str, tmp_path: Path) -> None:
    run = th.attitude_of_record(field_file(name, tmp_path))
    assert any(f"; the attitude ends at {end}" in line for line in run.warnings)


@pytest.mark.acceptance
def test_field_counter_that_wraps(tmp_path: Path) -> None:
    answers = {"units.force": "1/16384 g", "units.rate": "1/131 deg/s"}
    th.import_record(field_file("mpu.csv", tmp_path), out=tmp_path / "record.csv", answers=answers)
    steps = np.diff(times_of(tmp_path / "record.csv"))
    assert np.allclose(steps, 0.005, atol=1e-9)


@pytest.mark.acceptance
def test_field_epoch_is_exact(tmp_path: Path) -> None:
    th.import_record(field_file("euroc.csv", tmp_path), out=tmp_path / "record.csv")
    time = times_of(tmp_path / "record.csv")
    assert np.abs(time - 0.005 * np.arange(len(time))).max() < 1e-6
    assert time[1] == 0.005


@pytest.mark.acceptance
def test_field_bench_with_gaps_over_all_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(field_file("bench-gaps-over-all-moves.csv", tmp_path))
    place = ["--latitude-deg", "55.75", "--azimuth-deg", "20"]
    for command in ("calibrate", "diagnose"):
        assert main([command, path, *place]) in (0, 2)
        assert "Traceback" not in capsys.readouterr().err
