"""Corrections by calibrations without a table: any number of rows, with standard errors, for any verdict."""

import json
from typing import Any

import fmpy
import numpy as np
import pytest

import trihedron as th
from by_hand import GRAVITY, Instrument, calibration
from trihedron.fmus.parameters import calibrated_block, calibrated_gyros
from trihedron.tools.calibration import (
    Calibration,
    apply_calibration,
    correction_of,
    export_calibrated,
    remaining_error,
)
from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord, write_record


def motion(seed: int, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return specific forces [m/s2] and rates [rad/s], (count, 3)."""
    rng = np.random.default_rng([seed, 1])
    return rng.normal(0.0, 7.0, (count, 3)), rng.normal(0.0, 1.0, (count, 3))


@pytest.mark.parametrize("verdict", ["usable", "consistent", "falsified", "insufficient"])
def test_readings_are_corrected_to_the_truth_whatever_the_verdict(verdict):
    instrument = Instrument(3)
    force, rate = motion(3)
    correction = correction_of(calibration(instrument, verdict=verdict), "here")
    readings, turning = instrument.readings(force), instrument.rates(rate, force)
    np.testing.assert_allclose(correction(readings), force, rtol=0, atol=1e-13)
    both = correction(readings, turning)
    np.testing.assert_allclose(both[0], force, rtol=0, atol=1e-13)
    np.testing.assert_allclose(both[1], rate, rtol=0, atol=1e-14)


def test_a_stream_is_corrected_row_by_row_as_the_whole():
    instrument = Instrument(4)
    force, rate = motion(4, 10)
    correction = correction_of(calibration(instrument, sensitivity=False), "here")
    readings, turning = instrument.readings(force), instrument.rates(rate, force)
    whole = correction(readings, turning)
    for row in range(10):
        one = correction(list(readings[row]), turning[row])
        assert one[0].shape == one[1].shape == (3,)
        np.testing.assert_allclose(one[0], whole[0][row], rtol=0, atol=1e-14)
        np.testing.assert_allclose(one[1], whole[1][row], rtol=0, atol=1e-14)


@pytest.mark.parametrize("readings", [np.zeros((4, 2)), np.zeros(4), [["a", "b", "c"]], np.zeros((2, 2, 3)), 1.0])
def test_an_array_of_another_shape_is_refused(readings):
    correction = correction_of(calibration(Instrument(1), gyros=False), "here")
    with pytest.raises(InputError, match=r"readings: .*an array \(N, 3\)"):
        correction(readings)
    with pytest.raises(InputError, match="the calibration has no gyros"):
        correction(np.zeros((4, 3)), np.zeros((4, 3)))


@pytest.mark.acceptance
def test_standard_errors_are_the_scatter_of_corrections_by_drawn_parameters():
    instrument = Instrument(5)
    force, _ = motion(5, 6)
    readings = instrument.readings(force)
    rng = np.random.default_rng(6)
    root = 1e-3 * rng.normal(size=(9, 9))
    content = calibration(instrument, gyros=False)
    content["by_hand"]["covariance"] = (root @ root.T).tolist()
    predicted = correction_of(content, "here").standard_errors(readings)
    drawn = []
    for _ in range(4000):
        change = root @ rng.normal(size=9)
        other = json.loads(json.dumps(content))
        for entry, value in zip(other["parameters"], change, strict=True):
            entry["estimate"] += value
        drawn.append(correction_of(other, "here")(readings))
    np.testing.assert_allclose(np.std(drawn, axis=0), predicted, rtol=0.06)


def test_intervals_of_all_parameters_guarantee_the_corrected_reading():
    """Instruments anywhere in the intervals: the truth is within what remains, and nearly at its ends."""
    instrument, half = Instrument(7), 1e-3
    force, _ = motion(7)
    content = calibration(instrument, gyros=False, verdict="consistent", half_width=half)
    correction = correction_of(content, "here")
    rng = np.random.default_rng(8)
    reached = np.zeros((40, 3))
    for _ in range(300):
        true = Instrument(7)
        true.matrix = true.matrix + np.tril(half * rng.choice([-1.0, 1.0], (3, 3)))
        true.bias = true.bias + half * rng.choice([-1.0, 1.0], 3)
        n = correction(true.readings(force)) / GRAVITY
        low, high = remaining_error(correction, n)
        error = force / GRAVITY - n
        assert np.all((low <= error) & (error <= high))
        reached = np.maximum(reached, error / high)
    assert reached[:, 0].min() > 0.5
    assert np.median(reached[:, 0]) > 0.85


def test_without_intervals_nothing_is_guaranteed(tmp_path):
    instrument = Instrument(9)
    content = calibration(instrument, verdict="insufficient", open=[{"parameters": ["gamma_21"], "close_by": "axis 1"}])
    (tmp_path / "c.json").write_text(json.dumps(content), encoding="utf-8")
    force, rate = motion(9)
    record = StrapdownRecord(
        0.1 * np.arange(40), instrument.rates(rate, force), None, instrument.readings(force), None, None
    )
    write_record(record, tmp_path / "r.csv")
    applied: Any = apply_calibration(tmp_path / "c.json", tmp_path / "r.csv")
    np.testing.assert_allclose(applied.record.specific_force, force, rtol=0, atol=1e-12)
    np.testing.assert_allclose(applied.record.rate, rate, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(
        th.correction(tmp_path / "c.json")(instrument.readings(force)), applied.record.specific_force
    )
    text = str(applied)
    assert "insufficient" in text
    assert "corrected at most" not in text
    assert "not determined: gamma_21 (closed by axis 1)" in text
    assert any("0.42 mg" in warning for warning in applied.warnings)
    assert applied.to_json()["levelling_error_rad"]["corrected_at_most"] is None


def test_parameters_of_components_are_those_of_the_instrument():
    instrument = Instrument(10)
    content = calibration(instrument)
    block = calibrated_block(content)
    np.testing.assert_allclose(block["scale_error_plus"], np.diag(instrument.matrix) - 1.0, atol=1e-15)
    assert block["scale_error_plus"] == block["scale_error_minus"]
    assert block["gamma_32"] == pytest.approx(instrument.matrix[2, 1])
    gyros = calibrated_gyros(content)
    assert gyros is not None
    np.testing.assert_allclose(np.reshape(gyros[0]["scale_misalignment"], (3, 3)), instrument.gyro_matrix - np.eye(3))


@pytest.mark.acceptance
@pytest.mark.parametrize("sensitivity", [False, True])
def test_fmus_of_a_calibration_correct_its_readings(tmp_path, sensitivity):
    """The exported compensations start with the calibrated values, and their output equals the correction."""
    instrument = Instrument(14)
    content = calibration(instrument, sensitivity=sensitivity)
    files, _ = export_calibrated(Calibration.model_validate(content), tmp_path / "out")
    names = ("AccelerometerBlock", "AccelerometerCompensation", "GyroBlock", "GyroCompensation")
    assert sorted(path.name for path in files) == sorted(f"{name}.{end}" for name in names for end in ("fmu", "ssv"))
    force, rate = motion(14, 5)
    correction = correction_of(content, "here")
    times = 0.1 * np.arange(5)
    for name, readings, outputs, expected in (
        ("AccelerometerCompensation", {"reading": instrument.readings(force)}, "specific_force", force),
        (
            "GyroCompensation",
            {
                "increment_reading": 0.1 * instrument.rates(rate, sensitivity * force),
                "specific_force": sensitivity * force,
            },
            "rate",
            rate,
        ),
    ):
        columns = {"time": times}
        for variable, values in readings.items():
            columns |= {f"{variable}[{axis + 1}]": values[:, axis] for axis in range(3)}
        signals = np.array(
            list(zip(*columns.values(), strict=True)), dtype=[(column, np.float64) for column in columns]
        )
        result = fmpy.simulate_fmu(
            str(tmp_path / "out" / f"{name}.fmu"),
            input=signals,
            stop_time=0.4,
            output_interval=0.1,
            output=[f"{outputs}[{axis}]" for axis in (1, 2, 3)],
        )
        given = np.column_stack([result[f"{outputs}[{axis}]"] for axis in (1, 2, 3)])
        np.testing.assert_allclose(given[1], expected[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(correction(instrument.readings(force)), force, rtol=0, atol=1e-12)


@pytest.mark.acceptance
@pytest.mark.parametrize("lag", [0.004, 0.1, 0.13])
def test_the_gyros_of_a_calibration_lag_in_the_exported_block(tmp_path, lag):
    """The block reads its input of `lag` ago, here of rates that grow steadily, which no step changes."""
    instrument = Instrument(15)
    content = calibration(instrument, sensitivity=False)
    late = {"symbol": "L", "name": "lag of the gyros", "unit": "s", "estimate": lag, "low": None, "high": None}
    content["parameters"].append(late | {"determined": True, "standard_error": 1e-4})
    export_calibrated(Calibration.model_validate(content), tmp_path / "out")
    assert str(lag) in (tmp_path / "out" / "GyroBlock.ssv").read_text(encoding="utf-8")
    step, count = 0.1, 9
    growth = np.array([0.3, -0.2, 0.5])
    times = step * np.arange(count)
    mean_rate = growth * (times - 0.5 * step)[:, None]
    columns = {"time": times} | {f"increment[{axis + 1}]": step * mean_rate[:, axis] for axis in range(3)}
    signals = np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, np.float64) for name in columns])
    result = fmpy.simulate_fmu(
        str(tmp_path / "out" / "GyroBlock.fmu"),
        input=signals,
        stop_time=times[-1],
        output_interval=step,
        output=[f"increment_reading[{axis}]" for axis in (1, 2, 3)],
    )
    reading = np.column_stack([result[f"increment_reading[{axis}]"] for axis in (1, 2, 3)])
    expected = step * instrument.rates(mean_rate - lag * growth, np.zeros((count, 3)))
    np.testing.assert_allclose(reading[5], expected[4], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": []}, "lacks 'X4'"),
        ({"gravity_mps2": 98.0}, "gravity_mps2 is 98"),
        ({"verdict": None, "estimator": None, "parameters": 7}, "schema says"),
    ],
)
def test_a_calibration_that_was_edited_is_refused(change, message):
    with pytest.raises(InputError, match=f"^here: .*{message}"):
        correction_of(calibration(Instrument(1)) | change, "here")


def test_apply_takes_an_array_of_readings(tmp_path):
    instrument = Instrument(11)
    (tmp_path / "c.json").write_text(json.dumps(calibration(instrument)), encoding="utf-8")
    force, _ = motion(11)
    applied: Any = th.apply(tmp_path / "c.json", instrument.readings(force))
    np.testing.assert_allclose(applied.record.specific_force, force, rtol=0, atol=1e-12)
    with pytest.raises(th.InputError, match=r"has the shape \(4, 2\)"):
        th.apply(tmp_path / "c.json", np.zeros((4, 2)))
    with pytest.raises(th.InputError, match="not a number"):
        th.apply(tmp_path / "c.json", np.full((4, 3), np.nan))


def test_poses_of_another_instrument_are_told_by_gravity(tmp_path):
    instrument, other = Instrument(12), Instrument(13)
    content = calibration(instrument, gyros=False)
    (tmp_path / "c.json").write_text(json.dumps(content), encoding="utf-8")
    up = np.vstack([np.eye(3), -np.eye(3)])
    reasons = []
    for maker in (instrument, other):
        table = {"position": np.arange(1, 7)}
        for axis, column in enumerate(maker.readings(GRAVITY * up).T, start=1):
            table[f"f{axis}_mps2"] = column
        applied: Any = th.apply(tmp_path / "c.json", table)
        assert applied.levelled_at == "positions"
        reasons.append([reason for reason in applied.not_guaranteed if "g long" in reason])
    assert reasons[0] == []
    assert len(reasons[1]) == 1
