"""The system of a record with true attitude: what is carried over windows of several lengths against the truth."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.turntable import EARTH_RATE
from ..records import StrapdownRecord
from .bounds import GyroNoise, factor_for, truth_scatter
from .carrying import matrices_of
from .rests import Rests
from .segments import Segments, known_rows, window_segments
from .signatures import piece_columns, turned
from .system import Part

LENGTHS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Of the windows [s]."""
FEWEST_WINDOWS = 8
"""A length with fewer windows is not used: they cannot be left out in blocks."""
EARTH = 2.0
"""So many times Earth's rate widens the bounds: once in the mean at rest, once in the motion."""


def window_parts(record: StrapdownRecord, broken: NDArray, period: float) -> list[Segments]:
    """Windows of each length of which the record holds enough."""
    known = known_rows(record)
    found = [window_segments(known, broken, period, seconds) for seconds in LENGTHS if seconds >= 4.0 * period]
    return [windows for windows in found if len(windows) >= FEWEST_WINDOWS]


def window_errors(windows: Segments, truth: NDArray, attitude: NDArray) -> NDArray[np.float64]:
    """Rotation vectors (S, 3) of the carried against the true turn (N, 4), in axes of each window's beginning [rad]."""
    start, end = matrices_of(truth[windows.first]), matrices_of(truth[windows.last])
    true = start.transpose(0, 2, 1) @ end
    return Rotation.from_matrix(turned(windows, attitude) @ true.transpose(0, 2, 1)).as_rotvec()


def truth_parts(
    windows: Sequence[Segments],
    truth: NDArray,
    rests: Rests,
    attitude: NDArray,
    rows: NDArray,
    integral: NDArray,
    gyro_parameters: int,
    noise: GyroNoise | None,
    time_s: NDArray,
) -> list[Part]:
    """The parts of the system, one for each length.

    Parameters
    ----------
    windows : sequence of Segments
    truth : (N, 4) array
        true attitude, NaN where it is not known
    rests : Rests
    attitude : (N, 4) array
        carried
    rows, integral : (B,), (B, 3, P + K) array
        of the baseline's parameters and the effects
    gyro_parameters : int
        P
    noise : GyroNoise or None
        None where the record does not tell: the bounds are then zero
    time_s : (N,) array
    """
    period = float(np.median(np.diff(time_s)))
    factor = factor_for(3 * sum(len(found) for found in windows))
    parts = []
    for found in windows:
        error = window_errors(found, truth, attitude)
        seconds = found.durations(time_s)
        limit = np.zeros(len(found))
        if noise is not None:
            limit = factor * np.sqrt(noise.angle_square(seconds)) + EARTH * EARTH_RATE * seconds
            limit = limit + truth_scatter(truth, rests, period, float(np.median(seconds)))
        columns = piece_columns(found, attitude, rows, integral)
        split = gyro_parameters
        bound = np.repeat(limit[:, None], 3, axis=1)
        parts.append(Part(found, error, bound, columns[..., :split], columns[..., split:], scored=True))
    return parts
