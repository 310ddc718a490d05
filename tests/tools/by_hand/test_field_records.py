"""Real records without a table, where they are: five parts, left out in turn, against plain least squares."""

import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import trihedron as th
from by_hand import Instrument, present
from hand_sessions import NOISE, attitudes, strapdown, turning, written
from trihedron.tools.by_hand.moves import Windows
from trihedron.tools.by_hand.run import HandRequest, run_of
from trihedron.tools.records import StrapdownRecord, read_record

DATA = Path(os.environ.get("TRIHEDRON_DATA", Path(__file__).parents[4] / "shared" / "data"))
MARKS = {
    "mpu9150-0": (0.54, 6.1),
    "mpu9150-1": (0.51, 8.1),
    "mpu9150-2": (0.83, 7.7),
    "mpu9150-4": (0.71, 7.0),
    "xsens-imu-tk": (0.16, 44.7),
}
"""Plain least squares: unseen rests [mg], unseen moves [arcmin]."""


def record_of(name: str) -> Path:
    path = DATA / f"{name}.strapdown.csv"
    if not path.exists():
        pytest.skip(f"{path} is not here: set TRIHEDRON_DATA")
    return path


def norms(x: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return |f| - 1 of readings by nine parameters of their inverse, independent of the program."""
    matrix = np.zeros((3, 3))
    matrix[np.tril_indices(3)] = x[:6]
    return np.linalg.norm((reading - x[6:]) @ matrix.T, axis=1) - 1.0


@pytest.mark.first(1)
@pytest.mark.parametrize(("name", "part"), [("broad-03", 0.3), ("broad-08", 0.3)])
def test_gyros_and_their_lag_against_a_true_attitude(name: str, part: float) -> None:
    """Both records are of one instrument, whose gyros lag by about 4 ms."""
    result = th.calibrate(record_of(name))
    assert present(result.by_hand).axes == "true attitude"
    assert result["L"].estimate == pytest.approx(4e-3, abs=1e-3)
    assert present(present(present(result.by_hand).gain).move_after) < part * present(
        present(present(result.by_hand).gain).move_before
    )


@pytest.mark.first(2)
@pytest.mark.parametrize("name", MARKS)
def test_unseen_rests_and_moves_are_predicted_no_worse_than_by_plain_least_squares(name: str) -> None:
    path = record_of(name)
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    reading = run_of(record, HandRequest()).rests.force
    start = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    off = []
    for part in np.array_split(np.arange(len(reading)), 5):
        used = np.setdiff1d(np.arange(len(reading)), part)
        off.append(norms(least_squares(lambda x, used=used: norms(x, reading[used]), start).x, reading[part]))
    plain = float(np.sqrt(np.mean(np.concatenate(off) ** 2)))
    gain = present(present(th.calibrate(path).by_hand).gain)
    assert present(gain.rest_after) <= 1.1 * plain
    assert 1e3 * present(gain.rest_after) <= 1.1 * MARKS[name][0]
    assert np.degrees(present(gain.move_after)) * 60.0 <= 1.1 * MARKS[name][1]


@pytest.mark.acceptance
def test_records_of_one_imu_with_a_true_attitude_and_few_rests_are_pooled() -> None:
    """M differs between them by more than its errors, and its standard errors hold that."""
    paths = [record_of(name) for name in ("broad-03", "broad-06")]
    result = th.calibrate_together(*paths)
    assert any("the gyros of the records differ by" in line for line in result.warnings)
    alone = [th.calibrate(path) for path in paths]
    for number, record in enumerate(result.of_record.values()):
        own = {p.symbol: p for p in record.parameters}
        assert own["L"].estimate == pytest.approx(4e-3, abs=1e-3)
        for axis in (1, 2, 3):
            p = result[f"M{axis}{axis}"]
            assert p.determined
            assert abs(present(p.estimate) - present(alone[number][p.symbol].estimate)) < 8.0 * present(
                p.standard_error
            )
            assert own[f"B{axis}"].estimate == pytest.approx(alone[number][f"B{axis}"].estimate, abs=3e-4)


def late_gyros(path: Path) -> Path:
    """Write a short record with a true attitude, whose gyros are two rows late."""
    rng = np.random.default_rng(17)
    time, attitude = turning(attitudes(rng, 18), 1.2, 0.4)
    table = strapdown(Instrument(17), time, attitude, rng, NOISE)
    table = table.with_columns(pl.col(f"w{axis}_radps").shift(2).fill_null(strategy="backward") for axis in (1, 2, 3))
    quaternion = attitude.as_quat(scalar_first=True)
    return written(table.with_columns(pl.Series(f"q{k}", quaternion[:, k]) for k in range(4)), path)


def ends_of_windows(x: np.ndarray, turn: np.ndarray, rise: np.ndarray, seconds: np.ndarray) -> Rotation:
    """Return the attitude at the end of each window by readings (T, M, 3) [rad], their bias, matrix (3, 3) and lag."""
    right = turn + x[12] * rise - x[:3] * seconds[:, :, None]
    true = right @ np.linalg.inv(np.eye(3) + x[3:12].reshape(3, 3)).T
    attitude = Rotation.identity(turn.shape[1])
    for step in true:
        attitude = attitude * Rotation.from_rotvec(step)
    return attitude


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "name", ["simulated", *(pytest.param(f"broad-{n}", marks=pytest.mark.acceptance) for n in ("03", "06", "08", "21"))]
)
def test_unseen_windows_are_predicted_no_worse_than_by_plain_least_squares(name: str, tmp_path: Path) -> None:
    """Bias, matrix and lag of the gyros against the true attitude, fitted here, without the program's equations."""
    path = late_gyros(tmp_path / "late.csv") if name == "simulated" else record_of(name)
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    assert record.rate is not None
    assert record.attitude is not None
    windows = run_of(record, HandRequest()).moves
    assert isinstance(windows, Windows)
    ends = windows.way.ends
    turn, rise = np.zeros((2, int(np.diff(ends).max()), len(ends), 3))
    seconds = np.zeros(turn.shape[:2])
    for number, (first, last) in enumerate(ends):
        seconds[: last - first, number] = np.diff(record.time_s[first : last + 1])
        rate = record.rate[first : last + 1]
        turn[: last - first, number] = 0.5 * (rate[1:] + rate[:-1]) * seconds[: last - first, number, None]
        rise[: last - first, number] = np.diff(rate, axis=0)
    begin, end = (Rotation.from_quat(record.attitude[rows], scalar_first=True) for rows in ends.T)
    true = (begin.inv() * end).as_quat()

    def missed(x: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        carried = ends_of_windows(x, turn[:, chosen], rise[:, chosen], seconds[:, chosen])
        return (carried * Rotation.from_quat(true[chosen]).inv()).as_rotvec()

    off = []
    for part in np.array_split(np.arange(len(ends)), 5):
        used = np.setdiff1d(np.arange(len(ends)), part)
        fit = least_squares(lambda x, used=used: missed(x, used).ravel(), np.zeros(13), xtol=1e-6)
        off.append(missed(fit.x, part))
    plain = float(np.sqrt(np.mean(np.square(np.linalg.norm(np.vstack(off), axis=1)))))
    gain = present(present(th.calibrate(path).by_hand).gain)
    assert present(gain.move_after) <= 1.1 * plain
    assert present(gain.move_before) > 2.0 * present(gain.move_after)
