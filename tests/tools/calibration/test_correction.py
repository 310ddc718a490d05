"""Corrected readings: the inverse of the block, bounds that hold for every truth, correct files."""

import json
from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.runs import PROGRAMME, Bench
from generator.stands import ALPHA, BETA, random_bench, record, simulated
from named import Named
from trihedron.fmus.parameters import bench_parameters
from trihedron.models.bench import TARGETS, target_values
from trihedron.tools.calibration import (
    Correction,
    apply_calibration,
    calibrate,
    corrected,
    correction_of,
    face_readings,
    levelling,
    remaining_error,
)
from trihedron.tools.document import text
from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord, read_record, write_record
from trihedron.tools.reports import applied_page
from trihedron.tools.reports.calibration import correction_equation

SIGMA = 1e-5


def calibrated(seed: int):
    """Return a bench's elementary parameters and the correction from its noisy record."""
    rng = np.random.default_rng(seed)
    bench = random_bench(rng)
    noise = SIGMA * rng.choice([-1.0, 1.0], (24, 3)) if seed % 2 else rng.uniform(-SIGMA, SIGMA, (24, 3))
    result = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA)
    return bench, result, correction_of(json.loads(result.json_text()), "here")


@cache
def faultless() -> str:
    """Return the calibration of a bench without errors, as text."""
    return calibrate(simulated(np.zeros(24)), noise_bound=SIGMA).json_text()


def block_readings(bench: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the readings of the true block [g] at inputs n (N, 3) in units of the true g, as it was calibrated."""
    x = dict(zip(TARGETS, target_values(bench, np.eye(3)), strict=True))
    scale = np.where(n > 0, [x["X4"], x["X9"], x["X14"]], [x["X5"], x["X10"], x["X15"]])
    reading = n * (1 + scale) + [x["X16"], x["X17"], x["X18"]]
    reading[:, 1] += x["X6+X8"] * n[:, 0]
    reading[:, 2] += x["X7+X12"] * n[:, 0] + x["X11+X13"] * n[:, 1]
    return reading


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    n = rng.normal(size=(count, 3))
    faces = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    return np.vstack(
        [n / np.linalg.norm(n, axis=1, keepdims=True), faces, 1.3 * faces, 0.01 * faces, [[0.0, 0.0, 0.0]]]
    )


@pytest.mark.parametrize("seed", range(3))
def test_truth_is_within_what_remains_and_levelling_is_no_worse_than_guaranteed(seed):
    bench, _, correction = calibrated(seed)
    truth = directions(np.random.default_rng(100 + seed), 200)
    reading = block_readings(bench, truth)
    n = corrected(correction, GRAVITY * reading) / GRAVITY
    low, high = remaining_error(correction, n)
    assert np.all((low <= truth - n) & (truth - n <= high))
    # nothing known better would help much: the calibration itself is accurate to some σ
    assert np.abs(np.stack([low, high])).max() < 10 * SIGMA
    unit = truth[:206]
    gained = levelling(correction, reading[:206])
    assert gained.after is not None
    error = np.linalg.norm(np.cross(n[:206], unit), axis=1)
    assert np.all(error <= gained.after * (1 + 1e-9))
    raw = np.arcsin(np.linalg.norm(np.cross(reading[:206], unit), axis=1) / np.linalg.norm(reading[:206], axis=1))
    assert np.all(np.abs(raw - gained.before) <= gained.after * 1.01)
    assert gained.before.max() > 100 * gained.after.max()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_readings_that_err_are_further_from_the_truth_by_what_they_err(side):
    """With every reading at its bound, the truth is inside only if both ends have room for it."""
    bench, _, correction = calibrated(1)
    truth, noise = directions(np.random.default_rng(7), 50), 30.0 * SIGMA
    reading = block_readings(bench, truth) + side * noise
    n = corrected(correction, GRAVITY * reading) / GRAVITY
    low, high = remaining_error(correction, n, noise)
    assert np.all((low <= truth - n) & (truth - n <= high))
    assert np.abs(np.stack([low, high])).max() < noise + 10 * SIGMA
    error = np.linalg.norm(np.cross(n[:56], truth[:56]), axis=1)
    after = levelling(correction, reading[:56], noise).after
    assert after is not None
    assert np.all(error <= after * (1 + 1e-9))


def test_the_errors_are_those_of_the_true_input_not_of_the_corrected_one():
    """If a scale factor may be s too small, the truth is s / (1 − s) of the reading further, not s."""
    s, none = 0.05, np.zeros((3, 3, 3, 3))
    low, high = none.copy(), none.copy()
    for at, side in ((0, -1.0), (2, 1.0)):
        low[0, at], high[0, at] = min(0.0, -side * s), max(0.0, -side * s)
    correction = Correction(GRAVITY, np.ones(3), np.ones(3), np.zeros((3, 3)), np.zeros(3), low, high)
    truth = np.array([[0.9, 0.1, 0.2], [-0.9, 0.1, 0.2]])
    reading = truth * [1.0 - s, 1.0, 1.0]
    least, most = remaining_error(correction, reading)
    assert np.all((least - 1e-12 <= truth - reading) & (truth - reading <= most + 1e-12))
    assert np.all(np.abs(truth - reading)[:, 0] > s * np.abs(reading[:, 0]))


def test_the_correction_is_the_component():
    bench, result, correction = calibrated(4)
    name = "AccelerometerCompensation"
    model = Named(name, **bench_parameters(result.to_json())[name]).begin()
    reading = GRAVITY * block_readings(bench, directions(np.random.default_rng(1), 40))
    for row, expected in zip(reading, corrected(correction, reading), strict=True):
        np.testing.assert_allclose(model.put(reading=row)["specific_force"], expected, rtol=0, atol=1e-14)


def test_the_printed_equation_gives_the_corrected_readings():
    bench, _, correction = calibrated(3)
    reading = GRAVITY * block_readings(bench, directions(np.random.default_rng(2), 10))
    lines = correction_equation(correction)
    g = float(lines[0].split()[2])
    for row, expected in zip(reading, corrected(correction, reading), strict=True):
        names = {"g": g, "f1": row[0], "f2": row[1], "f3": row[2]}
        for p in (1, 2, 3):
            numerator, _, divisor = lines[p].partition(" = ")[2].rpartition(" / ")
            for k in range(1, p):
                numerator = numerator.replace(f" n{k}", f" * n{k}")
            plus, minus = divisor.strip("()").split(" where n")[0], divisor.split(", ")[1].split()[0]
            top = eval(numerator, {}, names)
            names[f"n{p}"] = top / float(plus if top > 0 else minus)
        np.testing.assert_allclose([g * names[f"n{p}"] for p in (1, 2, 3)], expected, rtol=0, atol=1e-10)


def test_faces_are_what_the_block_reads_with_an_axis_up():
    _, _, correction = calibrated(0)
    _, reading = face_readings(correction)
    n = corrected(correction, GRAVITY * reading) / GRAVITY
    np.testing.assert_allclose(np.abs(n).max(axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.sort(np.abs(n), axis=1)[:, :2], 0.0, atol=1e-15)


def test_each_kind_of_record_comes_out_corrected_and_is_otherwise_the_same(tmp_path):
    bench, result, correction = calibrated(5)
    file = tmp_path / "c.json"
    file.write_text(result.json_text(), encoding="utf-8")
    block = block_readings(bench, directions(np.random.default_rng(3), 30)[:30])
    positions = record(block, np.linspace(0, 6, 30), np.linspace(1, 5, 30))
    write_record(positions, tmp_path / "positions.csv")
    raw, _ = Bench(white=1e-5).run(PROGRAMME[:3])
    write_record(raw, tmp_path / "raw.csv")
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (30, 1))
    attitude[4] = np.nan
    increments = np.random.default_rng(4).normal(0, 1e-3, (30, 3))
    strapdown = StrapdownRecord(
        0.1 * np.arange(1, 31), None, increments, GRAVITY * block, attitude, 20.0 + np.arange(30)
    )
    write_record(strapdown, tmp_path / "strapdown.csv")
    for name, at in (("positions", "positions"), ("raw", "rests"), ("strapdown", "rows")):
        path, out = tmp_path / f"{name}.csv", tmp_path / f"{name}-out.csv"
        application = apply_calibration(file, path)
        assert application.levelled_at == at
        write_record(application.record, out)
        before, after = read_record(path), read_record(out)
        assert type(before) is type(after)
        np.testing.assert_array_equal(after.specific_force, corrected(correction, before.specific_force))
        printed, header = out.read_text().splitlines()[:2]
        assert printed.startswith("# corrected_by: the calibration of ")
        assert header.split(",")[:-3] == path.read_text().splitlines()[0].split(",")[:-3]
        for column in ("time_s", "alpha", "increment", "attitude", "temperature"):
            if getattr(before, column, None) is not None:
                np.testing.assert_array_equal(getattr(after, column), getattr(before, column))
        assert "guaranteed" in str(application)


@pytest.mark.parametrize(
    ("part", "change", "message"),
    [
        (None, {"schema": "trihedron.plan/1"}, "schema"),
        (None, {"reading_errors": []}, "reading_errors are not complete"),
        (None, {"reading_errors": 3}, "reading_errors are not as the schema says"),
        (None, {"parameters": []}, "lacks 'X"),
        (None, {"parameters": 7}, "schema says"),
        (None, {"convention": "A3"}, "its convention is 'A3'"),
        (None, {"baseline": "symmetric"}, "has no X5"),
        (None, {"gravity_mps2": 1e-300}, "gravity_mps2 is 1e-300; 4.9 to 14.7"),
        (None, {"gravity_mps2": "g"}, "gravity_mps2"),
        ("parameters", {"estimate": 5.0}, "X4: its estimate, .* exclude one another"),
        ("parameters", {"estimate": float("nan")}, "X4 is nan"),
        ("parameters", {"estimate": 10**400}, r"X4 is 10*\.\.\., not a number"),
        ("parameters", {"symbol": "X5"}, "X5 twice"),
        ("reading_errors", {"low": 10**400}, r"input \[-1, 0, 0\] is 10*\.\.\., not a number"),
        ("reading_errors", {"low": "-1e-5"}, r"accelerometer 1, input \[-1, 0, 0\] is '-1e-5', not a number"),
        ("reading_errors", {"low": -1e300}, "not a number"),
        ("reading_errors", {"low": -1.5}, "between -1 and 1"),
        ("reading_errors", {"low": 0.5, "high": 0.4}, "low <= high"),
        ("reading_errors", {"accelerometer": float("inf")}, "not complete"),
        ("reading_errors", {"accelerometer": 0}, "not complete"),
        ("reading_errors", {"input": [-1.5, 0, 0]}, "not complete"),
        ("reading_errors", {"input": -1}, "not as the schema says"),
    ],
)
def test_a_calibration_edited_by_hand_is_refused(part, change, message):
    content = json.loads(faultless())
    entry = content if part is None else next(e for e in content[part] if e.get("symbol", "X4") == "X4")
    entry |= change
    with pytest.raises(InputError, match=f"^here: .*{message}"):
        correction_of(content, "here")
    if "reading_errors" not in (part, *change):
        with pytest.raises(ValueError, match=message):
            bench_parameters(content)


@pytest.mark.parametrize("key", json.loads(faultless()))
def test_a_calibration_that_lacks_a_key_is_refused_or_corrects(key):
    """No key that is missing, or of another kind, ends in another error."""
    whole = json.loads(faultless())
    for edited in ({k: v for k, v in whole.items() if k != key}, whole | {key: None}, whole | {key: [3]}):
        with suppress(InputError):
            assert isinstance(correction_of(edited, "edited.json"), Correction)
    if key in ("verdict", "estimator"):
        del whole[key]
        with pytest.raises(InputError, match=f"edited.json: is not as its schema says .*{key}"):
            correction_of(whole, "edited.json")


def test_the_gyrocompass_is_where_the_record_says_it_was_measured(tmp_path):
    file, path = tmp_path / "c.json", tmp_path / "positions.csv"
    file.write_text(faultless(), encoding="utf-8")
    block = directions(np.random.default_rng(3), 30)[:30]
    for about, latitude in (({"latitude_deg": "-33.9"}, "-33.9"), ({}, "55.75")):
        placed = replace(record(block, np.linspace(0, 6, 30), np.linspace(1, 5, 30)), about=about)
        write_record(placed, path)
        application = apply_calibration(file, path)
        assert f"gyrocompass at latitude {latitude}°" in str(application)
        assert "gyrocompass at latitude 10°" in text(applied_page(application, 10.0))


def test_another_convention_gives_the_same_correction():
    bench = random_bench(np.random.default_rng(8))
    noisy = record(
        simulated(bench).specific_force / GRAVITY + SIGMA * np.sin(np.arange(72.0)).reshape(24, 3), ALPHA, BETA
    )
    first, second = (
        correction_of(calibrate(noisy, noise_bound=SIGMA, convention=c).to_json(), "here") for c in ("A1", "A2")
    )
    force = GRAVITY * directions(np.random.default_rng(5), 10)
    np.testing.assert_allclose(corrected(first, force), corrected(second, force), rtol=0, atol=1e-13)
