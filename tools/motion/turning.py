"""Compare the gyros' turns with gravity or a true attitude: order and signs of their axes, and their unit.

All 48 signed permutations are tried, in rad/s and in degrees per second. A message reports a far better fit, with the
option that reads the record in that way.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field

from ...models.arrays import Floats
from ..records.channels import PERMUTATIONS, RADIANS, USUAL, Channels, advice, far_better, reading_of
from ..result import Array, Result
from ..rounding import digits

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

WINDOW = 0.2
"""Length of the windows in which gyros and accelerometers are compared [s]."""
MOVING = 10.0
"""A window is a move where its turn exceeds the noise of the gyros by this factor."""
LEAST_TURN = 0.01
"""Smaller turns in a window tell nothing [rad]; in degrees they are larger."""
FEWEST_WINDOWS = 30
"""Fewer windows of moves tell nothing."""
FEWEST_BEFORE, CLEARER = 10, 4.0
"""Channels change during a record where another way of reading misses less by the second factor, squared, than that of
the other side. That must hold over at least the first number of windows on each side of a time."""
LEAST_SHARE = 0.5
"""Part of the turns, squared, that gyros must show before anything is believed."""
CLEAR = 0.2
"""Where turns leave a smaller part of the changes of the specific force, squared, the gyros' size is known."""
LEAST_MISS, BETTER = 0.1, 0.1
"""Gyros are read wrongly where they miss at least the first part of the true turns, squared, and another way misses at
most the second part of that."""
ALIKE = 0.05
"""Ways cannot be told apart whose misses differ by at most this part of the true turns."""


class TurningCheck(Result):
    """Test of the gyros' turns against the accelerometers: units, signs and order of axes, from moves alone.

    A block that turns at ω sees gravity turn by df = −ω × f dt. The matrix K that fits df = −(K ω dt) × f best over
    short windows of moves is the identity for rates in rad/s along the accelerometers' axes. It is (π/180)·I for
    degrees per second; a swap or a flip of axes shows in it. The scale of the accelerometers does not matter.

    Attributes
    ----------
    matrix : (3, 3) array or None
        K; None where moves are too few, or do not turn about all axes
    said : tuple of str
        faults in words, with their remedies; empty if there are none
    of_forces : str
        remedies where the gyros are known to be right: the accelerometers' order and signs; may be empty
    scale : (3,) array or None
        how many times as far as they read the gyros turn, where turns explain nearly all that the specific force does
    """

    matrix: Array | None = Field(default=None)
    said: tuple[str, ...] = ()
    of_forces: str = Field(default="", exclude=True)
    scale: Array | None = Field(default=None, exclude=True)


def check_turning(
    time_s: NDArray,
    rate: NDArray,
    force: NDArray,
    noise: NDArray,
    broken: NDArray | None = None,
    before: Channels | None = None,
) -> TurningCheck:
    """Compare gyros with accelerometers (N, 3), as the record has them, over moves; times (N,) in [s].

    The noise (3,) is the scatter of a sample of the gyros at rest, in the rates' unit; windows with rows (N,) that are
    broken tell nothing. `before` is the way in which the file was read; where a person has stated that way, the result
    has no fault.
    """
    period = float(np.median(np.diff(time_s)))
    size = max(2, round(WINDOW / period))
    pieces = len(time_s) // size
    if pieces < FEWEST_WINDOWS:
        return TurningCheck()
    blocks = slice(0, pieces * size)
    middle = force[blocks].reshape(pieces, size, 3).mean(axis=1)
    mean = rate[blocks].reshape(pieces, size, 3).mean(axis=1)
    between = np.diff(time_s[blocks].reshape(pieces, size).mean(axis=1))
    turn = 0.5 * (mean[1:] + mean[:-1]) * between[:, None]
    change, level = np.diff(middle, axis=0), 0.5 * (middle[1:] + middle[:-1])
    # rates that were read as degrees and are none turn the block so much less
    smallest = LEAST_TURN / max(1.0, units_tried(before)[1])
    least = np.maximum(MOVING * noise * between[:, None] / np.sqrt(size), smallest)
    moving = (np.abs(turn) > least).any(axis=1) & (between < 1.5 * size * period)
    if broken is not None:
        spoilt = np.flatnonzero(broken[blocks].reshape(pieces, size).any(axis=1))
        moving[np.concatenate([spoilt[spoilt > 0] - 1, spoilt[spoilt < pieces - 1]])] = False
    if moving.sum() < FEWEST_WINDOWS:
        return TurningCheck()
    turn, change, level = turn[moving], change[moving], level[moving]
    overall = _fit(turn, change, level)
    if overall is None:
        return TurningCheck()
    matrix, uncertain, unexplained = overall
    scale = None
    if unexplained < CLEAR:
        scale = np.full(3, np.median(np.abs(matrix).max(axis=1)))
    if before == Channels():
        return TurningCheck(matrix=matrix, scale=scale)
    apart = [
        change - np.cross(level, unit * turn @ permutation.T)
        for unit in units_tried(before)
        for permutation in PERMUTATIONS
    ]
    squares = []
    for difference in apart:
        squares.append(np.square(difference).sum(axis=1))
    squares = np.array(squares)
    at = time_s[blocks].reshape(pieces, size)[1:, 0][moving]
    if change_found := _change(squares, np.square(change).sum(axis=1), at):
        return TurningCheck(matrix=matrix, said=(f"the gyros, or the accelerometers, {change_found[0]}",))
    if unexplained < 1.0 - LEAST_SHARE:
        return beside_gravity(matrix, uncertain, before).model_copy(update={"scale": scale})
    return TurningCheck(matrix=matrix)


def _fit(turn: NDArray, change: NDArray, level: NDArray) -> tuple[NDArray, NDArray, float] | None:
    """K (3, 3), its covariance (9, 9), and the part of the changes of the specific force (S, 3) beyond turns (S, 3).

    None where the block does not turn about all axes.
    """
    cross = np.zeros((len(level), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -level[:, 2], level[:, 1], -level[:, 0]
    cross -= cross.transpose(0, 2, 1)
    # −(K ω) × f = f × (K ω); columns in the order of K's elements, row by row.
    design = np.einsum("nij,nk->nijk", cross, turn).reshape(3 * len(turn), 9)
    singular = np.linalg.svd(design, compute_uv=False)
    if singular[-1] < 0.02 * singular[0]:
        return None
    target = change.ravel()
    solution = np.linalg.lstsq(design, target, rcond=None)[0]
    residual = target - design @ solution
    # part of the change of the specific force that K ω explains; the rest is linear acceleration and noise
    unexplained = float(residual @ residual) / float(target @ target)
    uncertain = np.linalg.inv(design.T @ design) * float(residual @ residual) / (len(residual) - 9)
    return solution.reshape(3, 3), uncertain, unexplained


def _change(missed: NDArray, none: NDArray, at: NDArray) -> tuple[str, float] | None:
    """When channels begin to be read otherwise, in words, and the part of the turns that is missed then; None if never.

    Squared misses (W, S) of each way of reading in each window, squared sizes (S,) of the changes in the windows, times
    (S,) [s].
    """
    cuts = np.arange(FEWEST_BEFORE, len(none) - FEWEST_BEFORE + 1)
    if not len(cuts):
        return None
    before = np.cumsum(missed, axis=1)
    before, behind = before[:, cuts - 1], before[:, -1:] - before[:, cuts - 1]
    k = int(np.argmin(before.min(axis=0) + behind.min(axis=0)))
    first, second, cut = int(np.argmin(before[:, k])), int(np.argmin(behind[:, k])), int(cuts[k])
    clearer = before[second, k] > CLEARER * before[first, k] and behind[first, k] > CLEARER * behind[second, k]
    share = max(float(before[first, k] / none[:cut].sum()), float(behind[second, k] / none[cut:].sum()))
    if not clearer or share > LEAST_SHARE:
        return None
    what = f"change their order, signs or unit at {digits(float(at[cut]))} s"
    return f"{what}: no --channels reads both; give what is before and what is behind as files of their own", share


def units_tried(before: Channels | None) -> tuple[float, float]:
    """Return the units of rates to try, next to the present one: unchanged, and the other one."""
    return (1.0, 1.0 / RADIANS if before is not None and before.degrees else RADIANS)


def _costs(matrix: NDArray, uncertain: NDArray, before: Channels | None) -> Floats:
    """Costs (96,) of K (3, 3), with its covariance (9, 9), as each signed permutation in each of the two units."""
    costs = []
    for unit in units_tried(before):
        weights = np.linalg.inv(uncertain / unit**2 + USUAL**2 * np.eye(9))
        apart = (matrix / unit - np.array(PERMUTATIONS)).reshape(-1, 9)
        costs.append(np.einsum("wi,ij,wj->w", apart, weights, apart))
    return np.concatenate(costs)


def beside_gravity(matrix: NDArray, uncertain: NDArray, before: Channels | None) -> TurningCheck:
    """Return faults of units, order and signs of the gyros that K (3, 3), with its covariance (9, 9), proves."""
    told = said_of_ways(
        [divmod(int(way), len(PERMUTATIONS)) for way in far_better(_costs(matrix, uncertain, before))], before
    )
    if told is not None:
        return TurningCheck(matrix=matrix, said=told[:1], of_forces=told[1])
    return TurningCheck(matrix=matrix)


def said_of_ways(ways: Sequence[tuple[int, int]], before: Channels | None) -> tuple[str, str] | None:
    """Describe the fault where these ways of reading, the best first, fit far better; None where there are none.

    A way is the number of a unit and of a signed permutation. The second text mends the accelerometers alone.
    """
    gyros: list[tuple[Channels, str]] = []
    of_forces: list[tuple[Channels, str]] = []
    for number, permutation in ways:
        axes, degrees = PERMUTATIONS[permutation], number > 0
        gyros.append((Channels(gyros=reading_of(axes.T), degrees=degrees), ""))
        # Accelerometers that are turned see gravity turn as turned gyros do; that all are reversed does not show.
        if np.linalg.det(axes) > 0.0 and permutation:
            for sign in (1.0, -1.0):
                of_forces.append((Channels(reading_of(sign * axes), degrees=degrees), ""))
    if not gyros:
        return None
    alternatives = ""
    if of_forces:
        alternatives = advice(of_forces, before)
    words = _words(gyros[0][0], "the accelerometers", before)
    return f"{words}: read it with {advice([*gyros, *of_forces], before)}", alternatives


def beside_truth(
    increments: NDArray, true: "Rotation", windows: NDArray, before: Channels | None, time_s: NDArray
) -> tuple[tuple[str, ...], float]:
    """Return faults of the gyros by true turns (S) over windows, and the squared part that the best way misses.

    Increments (N, 3) are up to each row [rad], at times (N,); windows (S, 2) are the rows at their ends. Where a person
    has stated that the gyros stand as they are, `before` is `Channels()` and only that way is compared.
    """
    target = true.as_matrix()
    missed = []
    none = np.square(target - np.eye(3)).sum(axis=(1, 2))
    for unit in units_tried(before):
        # A proper permutation turns the carried attitude; a mirroring one turns that of the reversed gyros.
        forth, back = (carried(sign * unit * increments, windows).as_matrix() for sign in (1.0, -1.0))
        for axes in PERMUTATIONS:
            sign = np.sign(np.linalg.det(axes))
            if sign > 0.0:
                turn = forth
            else:
                turn = back
            turned = (sign * axes) @ turn @ (sign * axes).T
            missed.append(np.square(turned - target).sum(axis=(1, 2)))
    apart = np.array(missed)
    shares = apart.mean(axis=1) / none.mean()
    if before == Channels():
        return (), float(shares[0])
    if change := _change(apart, none, time_s[windows[:, 0]]):
        return (f"the gyros {change[0]}",), change[1]
    best = float(shares.min())
    if not (shares[0] > LEAST_MISS and best < BETTER * shares[0]):
        return (), best
    same = np.flatnonzero(shares <= max(best / BETTER, best + ALIKE))
    same = same[np.argsort(shares[same], kind="stable")]
    ways = []
    for number, permutation in (divmod(int(way), len(PERMUTATIONS)) for way in same):
        ways.append((Channels(gyros=reading_of(PERMUTATIONS[permutation].T), degrees=number > 0), ""))
    return (f"{_words(ways[0][0], 'the true attitude', before)}: read it with {advice(ways, before)}",), best


def carried(increments: NDArray, windows: NDArray) -> "Rotation":
    """Turns (S) that increments (N, 3) [rad] up to each row make over windows (S, 2) of rows."""
    rotation = scipy.spatial.transform.Rotation.identity(len(windows))
    first, last = windows.T
    for ahead in range(1, int((last - first).max(initial=0)) + 1):
        rows = np.minimum(first + ahead, last)
        rotation = rotation * scipy.spatial.transform.Rotation.from_rotvec(
            np.where((first + ahead <= last)[:, None], increments[rows], 0.0)
        )
    return rotation


def _words(channels: Channels, reference: str, before: Channels | None) -> str:
    """Describe the fault of gyros that should be read in another way than before."""
    now = "degrees per second"
    if before is not None and before.degrees:
        now = "rad/s, not degrees per second"
    words = []
    if channels.degrees:
        words = [f"the rates are probably in {now}"]
    for axis, channel in enumerate(channels.gyros, start=1):
        if abs(channel) != axis:
            words.append(f"what turns about axis {axis} of {reference} is read by gyro {abs(channel)}")
        if channel < 0:
            words.append(f"gyro {abs(channel)} has the wrong sign about axis {axis} of {reference}")
    return "; ".join(words)


def rotation_of(quaternion: NDArray) -> "Rotation":
    """Return the rotations of quaternions (N, 4), scalar first."""
    return scipy.spatial.transform.Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
