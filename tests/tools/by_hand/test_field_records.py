"""Real records without a table, where they are: five parts, left out in turn, against plain least squares."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import trihedron as th
from by_hand import present
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
