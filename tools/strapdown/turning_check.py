"""Whether the gyros turn as the accelerometers say: units, signs and order of axes, from moves alone.

A block that turns at ω sees gravity turn by df = −ω × f dt. The matrix K that fits df = −(K ω dt) × f best over short
windows of moves is the identity for rates in rad/s along the accelerometers' axes, (π/180)·I for degrees per second;
a swap or a flip of axes shows in it. The scale of the accelerometers does not matter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WINDOW = 0.2
"""Length of the windows [s]."""
MOVING = 10.0
"""A window is a move where its turn is so many times what the noise of the gyros makes."""
LEAST_TURN = 0.01
"""Smaller turns in a window tell nothing [rad]; in degrees they are larger."""
FEWEST = 30
"""Fewer windows of moves tell nothing."""
DEGREE = np.pi / 180.0


@dataclass(frozen=True, eq=False)
class TurningCheck:
    """K (3, 3), the standard error of its elements, and what it means.

    Attributes
    ----------
    matrix, error : (3, 3) array or None
        None where moves are too few, or do not turn about all axes
    share : float
        part of the change of the specific force that K ω explains; the rest is linear acceleration and noise
    said : tuple of str
        what is wrong, in words; empty where nothing is
    """

    matrix: NDArray[np.float64] | None
    error: NDArray[np.float64] | None
    share: float
    said: tuple[str, ...]


def check_turning(time_s: NDArray, rate: NDArray, force: NDArray, noise: NDArray) -> TurningCheck:
    """Compare gyros with accelerometers over moves.

    Parameters
    ----------
    time_s : (N,) array
        [s]
    rate, force : (N, 3) array
        as the record has them
    noise : (3,) array
        scatter of a sample of the gyros at rest, in the rates' unit

    Returns
    -------
    TurningCheck
    """
    period = float(np.median(np.diff(time_s)))
    size = max(2, round(WINDOW / period))
    pieces = len(time_s) // size
    if pieces < FEWEST:
        return TurningCheck(None, None, 0.0, ())
    blocks = slice(0, pieces * size)
    middle = force[blocks].reshape(pieces, size, 3).mean(axis=1)
    mean = rate[blocks].reshape(pieces, size, 3).mean(axis=1)
    between = np.diff(time_s[blocks].reshape(pieces, size).mean(axis=1))
    turn = 0.5 * (mean[1:] + mean[:-1]) * between[:, None]
    change, level = np.diff(middle, axis=0), 0.5 * (middle[1:] + middle[:-1])
    least = np.maximum(MOVING * noise * between[:, None] / np.sqrt(size), LEAST_TURN)
    moving = (np.abs(turn) > least).any(axis=1) & (between < 1.5 * size * period)
    if moving.sum() < FEWEST:
        return TurningCheck(None, None, 0.0, ())
    turn, change, level = turn[moving], change[moving], level[moving]
    cross = np.zeros((len(level), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -level[:, 2], level[:, 1], -level[:, 0]
    cross -= cross.transpose(0, 2, 1)
    # −(K ω) × f = f × (K ω); columns in the order of K's elements, row by row.
    design = np.einsum("nij,nk->nijk", cross, turn).reshape(3 * len(turn), 9)
    singular = np.linalg.svd(design, compute_uv=False)
    if singular[-1] < 0.02 * singular[0]:
        return TurningCheck(None, None, 0.0, ())
    target = change.ravel()
    solution = np.linalg.lstsq(design, target, rcond=None)[0]
    left = target - design @ solution
    share = 1.0 - float(left @ left) / float(target @ target)
    error = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * (left @ left) / (len(left) - 9))
    matrix = solution.reshape(3, 3)
    said = meaning(matrix, error.reshape(3, 3)) if share > 0.5 else ()
    return TurningCheck(matrix, error.reshape(3, 3), share, said)


def meaning(matrix: NDArray, error: NDArray) -> tuple[str, ...]:
    """What K (3, 3) says of units, order and signs of the gyros, where it is surely so."""
    said = []
    size = float(np.median(np.abs(matrix).max(axis=1)))
    if 0.5 * DEGREE < size < 2.0 * DEGREE:
        said.append("the rates are probably in degrees per second: they turn the block 57 times too far")
    elif not 0.5 < size < 2.0:
        said.append(f"the gyros turn the block {1.0 / size:.3g} times as far as gravity turns: check their unit")
    for axis in range(3):
        row, sure = matrix[axis] / size, error[axis] / size
        gyro = int(np.argmax(np.abs(row)))
        if np.abs(row[gyro]) < 0.5 or sure.max() > 0.1:
            continue
        if gyro != axis:
            said.append(f"what turns about axis {axis + 1} of the accelerometers is read by gyro {gyro + 1}")
        if row[gyro] < 0.0:
            said.append(f"gyro {gyro + 1} has the wrong sign about axis {axis + 1} of the accelerometers")
    return tuple(said)
