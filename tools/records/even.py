"""Even stamps or stamps as logged: those under which gyros and gravity, or the true attitude, agree better.

Over each move between two rests the gyros, with small errors of gyros and accelerometers fitted, must turn gravity's
direction at the first into that at the second; over each stretch with a true attitude they must turn as that does.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..rounding import digits, exactly
from .kinds import BenchRecord, PositionRecord, RawRecord, StrapdownRecord
from .stamps import Grid, grid_of

EVEN, LOGGED = "even", "logged"
"""What `--stamps` takes beside a rate in hertz."""
FEWEST = 3
"""Fewer moves or stretches tell nothing."""
MOST = 60
"""Largest number of moves that are compared, spread over the record."""
BLOCK = 0.25
"""Length of the blocks in which rest is looked for [s]."""
STILL = 3.0
"""A block is at rest when its gyros scatter at most this many times as in the quietest tenth."""
LONGEST = 30.0
"""Longer moves are left out: their rates may have drifted [s]."""
STRETCH = 1.0
"""Length of the stretches that are held against the true attitude [s]."""
LARGEST = 0.3
"""Larger disagreement, rms, comes of something other than stamps [rad]."""
TURNED = 0.1
"""Moves that turn by less tell nothing of stamps [rad]."""
NOISE = 2e-3
"""What a move misses by without any error of stamps [rad]."""
GYRO, RATE, ACCELEROMETER = 0.1, 0.02, 0.03
"""Sizes of the errors that are fitted: of a gyro's scale and axis, its bias [rad/s], and an accelerometer [g]."""
AS_WELL = 1.03
"""Even stamps that leave no more than this times what those logged leave are taken: loggers stamp late more often
than sensors sample unevenly."""
MOST_HELD = 0.5
"""Stamps that are farther from even times, in periods, are not taken as logged where nothing tells."""

Measured = TypeVar("Measured", bound=PositionRecord | RawRecord | StrapdownRecord)


def with_stamps(record: Measured, stamps: str | None = None) -> Measured:
    """Return a record with the stamps that count, and a warning that says which; even stamps as they are.

    Parameters
    ----------
    record : record
    stamps : str or None
        "even", "logged", or a rate in hertz; None: those under which gyros and gravity agree better

    Raises
    ------
    InputError
        other words, a rate that is none, or stamps that lie on no line and are to be even
    """
    if stamps is None:
        if not isinstance(record, BenchRecord | StrapdownRecord) or len(record) < 2:
            return record
        grid = grid_of(record.time_s)
        if grid.uneven:
            return _better(record, grid)
        return record
    if stamps == LOGGED or isinstance(record, PositionRecord):
        return _said(record, "time stamps: as logged, as said")
    if stamps == EVEN:
        grid = grid_of(record.time_s)
        if not grid.regular:
            raise InputError(f"{record.path}, column 'time_s': follows no even times; give --stamps RATE_HZ or logged")
        return _said(replace(record, time_s=grid.even), f"time stamps: even, {_every(grid.period)}, as said")
    period = 1.0 / rate_of(stamps)
    even = record.time_s[0] + period * np.arange(len(record))
    return _said(replace(record, time_s=even), f"time stamps: even, {_every(period)}, as said; those logged are unused")


def times_unused(stamps: str | None) -> bool:
    """Whether the stamps may repeat and run back: only the rows are counted."""
    return stamps is not None and stamps != LOGGED


def rate_of(stamps: str) -> float:
    """The rate that `--stamps` gives [Hz]; an InputError for none."""
    try:
        rate = float(stamps)
    except ValueError:
        rate = math.nan
    if not 1e-3 <= rate <= 1e6:
        raise InputError(f"--stamps {stamps}: give even, logged or the sampling rate in hertz, 0.001 to 1e6")
    return rate


def _every(period: float) -> str:
    return f"one every {exactly(period, 6)} s"


def _said(record: Measured, line: str) -> Measured:
    return replace(record, warnings=(*record.warnings, line))


def _better(record: Measured, grid: Grid) -> Measured:
    """The record with even stamps or with those logged, whichever gyros and gravity agree with."""
    gyros = record.gyros if isinstance(record, BenchRecord) else record
    assert isinstance(gyros, StrapdownRecord)
    off = f"stamps are up to {digits(grid.departure / grid.period, 2)} periods off even times"
    missed = None
    if gyros.rate is not None:
        missed = missed_angles(gyros, grid)
    if missed is None:
        is_even = grid.departure > MOST_HELD * grid.period
        because = "nothing in the record tells which are right"
    else:
        even, logged = missed.even, missed.logged
        is_even = even <= AS_WELL * logged
        because = (
            f"over {missed.pieces} {missed.words} the gyros miss by {digits(math.degrees(even) * 60.0, 3)} arcmin rms "
            f"with even stamps, {digits(math.degrees(logged) * 60.0, 3)} as logged"
        )
    if is_even:
        line = f"time stamps: even, {_every(grid.period)} ({off}); {because}; --stamps logged takes them as they are"
        return _said(replace(record, time_s=grid.even), line)
    return _said(record, f"time stamps: as logged ({off}); {because}; --stamps even takes even times")


@dataclass(frozen=True)
class Missed:
    """By how much gyros miss gravity or the true attitude, rms [rad], with either kind of stamps; over how many."""

    even: float
    logged: float
    pieces: int
    words: str


def missed_angles(record: StrapdownRecord, grid: Grid) -> Missed | None:
    """By how much the gyros miss gravity over moves, or the true attitude; None where the record does not tell."""
    pieces, words = _with_truth(record, grid), "stretches with a true attitude"
    directions = None
    if len(pieces) < FEWEST:
        rests = _rests(record, grid)
        pieces, directions = _moves(record, grid, rests)
        words = "moves between rests"
    if len(pieces) < FEWEST:
        return None
    sizes = []
    for time in (grid.even, grid.logged):
        sizes.append(_least_missed(record, time, pieces, directions))
    if not min(sizes) <= LARGEST:
        return None
    return Missed(sizes[0], sizes[1], len(pieces), words)


def _thinned(pieces: list) -> list:
    """At most so many of some pieces, spread evenly."""
    if len(pieces) <= MOST:
        return pieces
    return [pieces[k] for k in np.linspace(0, len(pieces) - 1, MOST).astype(int)]


def _with_truth(record: StrapdownRecord, grid: Grid) -> list[tuple[int, int]]:
    """Stretches, first and last row, in which the block turns and its true attitude is known at both ends."""
    if record.attitude is None:
        return []
    rows = max(2, round(STRETCH / grid.period))
    known = np.asarray(np.isfinite(record.attitude).all(axis=1))
    gaps = np.concatenate([[0], np.cumsum(grid.is_gap)])
    first = np.arange(0, len(record) - rows, rows)
    last = first + rows
    first, last = first[known[first] & known[last]], last[known[first] & known[last]]
    whole = gaps[first] == gaps[last]
    pieces = list(zip(first[whole].tolist(), last[whole].tolist(), strict=True))
    return _thinned([piece for piece in pieces if _turn(record, grid, *piece) > TURNED])


def _turn(record: StrapdownRecord, grid: Grid, first: int, last: int) -> float:
    """How far the block turns between two rows, by the gyros [rad]."""
    assert record.rate is not None
    return float(grid.period * np.linalg.norm(record.rate[first:last], axis=1).sum())


def _rests(record: StrapdownRecord, grid: Grid) -> list[slice]:
    """Rows of the rests: neighbouring quiet blocks without a gap."""
    assert record.rate is not None
    size = max(8, round(BLOCK / grid.period))
    count = len(record) // size
    if count < 4:
        return []
    shape = (count, size, 3)
    scatter = record.rate[: count * size].reshape(shape).std(axis=1).max(axis=1)
    still = scatter <= STILL * np.quantile(scatter, 0.1)
    still[grid.gaps[grid.gaps < count * size] // size] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    rests = []
    for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if stop - first >= 2:
            rests.append(slice(first * size, stop * size))
    return rests


def _moves(
    record: StrapdownRecord, grid: Grid, rests: list[slice]
) -> tuple[list[tuple[int, int]], list[tuple[NDArray, NDArray]]]:
    """Moves between rests, first and last row, and gravity's directions at both."""
    gaps = np.concatenate([[0], np.cumsum(grid.is_gap)])
    chosen = []
    for before, behind in pairwise(rests):
        first, last = (before.start + before.stop) // 2, (behind.start + behind.stop) // 2
        is_whole = gaps[first] == gaps[last] and (last - first) * grid.period <= LONGEST
        if is_whole and _turn(record, grid, before.stop, behind.start) > TURNED:
            chosen.append((first, last, before, behind))
    pieces, directions = [], []
    for first, last, before, behind in _thinned(chosen):
        pieces.append((first, last))
        directions.append((_direction(record, before), _direction(record, behind)))
    return pieces, directions


def _direction(record: StrapdownRecord, rows: slice) -> NDArray:
    mean = record.specific_force[rows].mean(axis=0)
    return mean / max(float(np.linalg.norm(mean)), 1e-300)


def _least_missed(
    record: StrapdownRecord,
    time: NDArray,
    pieces: list[tuple[int, int]],
    directions: list[tuple[NDArray, NDArray]] | None,
) -> float:
    """What the gyros miss [rad], rms over pieces, with the best small errors of the instruments."""
    assert record.rate is not None
    step = np.diff(time)
    gyros, bias = np.eye(3), np.zeros(3)
    missed = math.inf
    for _ in range(3):
        residuals, designs = [], []
        for number, (first, last) in enumerate(pieces):
            seconds = step[first:last, None]
            turns = 0.5 * (record.rate[first:last] + record.rate[first + 1 : last + 1]) * seconds
            partial = _products(Rotation.from_rotvec(turns @ gyros.T + seconds * bias).as_matrix())
            if directions is None:
                assert record.attitude is not None
                ends = Rotation.from_quat(record.attitude[[first, last]], scalar_first=True)
                residual, design = _beside_truth(partial, turns, seconds, (ends[0].inv() * ends[1]).as_matrix())
            else:
                residual, design = _beside_gravity(partial, turns, seconds, *directions[number])
            residuals.append(residual)
            designs.append(design)
        matrix, values = np.concatenate(designs) / NOISE, np.concatenate(residuals) / NOISE
        sizes = np.repeat([GYRO, RATE, ACCELEROMETER], [9, 3, matrix.shape[1] - 12])
        free = np.vstack([matrix, np.diag(1.0 / sizes)])
        solution = np.linalg.lstsq(free, np.concatenate([values, np.zeros(len(sizes))]), rcond=None)[0]
        missed = NOISE * float(np.sqrt(np.mean((values - matrix @ solution) ** 2)))
        gyros, bias = gyros + solution[:9].reshape(3, 3), bias + solution[9:12]
    return missed * math.sqrt(3.0)


def _products(matrices: NDArray) -> NDArray:
    """Products (n, 3, 3) of the first, the first two, ... of some rotations (n, 3, 3)."""
    products, apart = matrices.copy(), 1
    while apart < len(products):
        products[apart:] = products[:-apart] @ products[apart:]
        apart *= 2
    return products


def _turned_by_errors(partial: NDArray, turns: NDArray, seconds: NDArray) -> NDArray:
    """How the turn at the end of a piece changes (3, 12) with the errors of gyros, then with their biases."""
    at_end = partial[-1].T @ partial
    by_gyros = np.einsum("kia,kb->iab", at_end, turns).reshape(3, 9)
    return np.hstack([by_gyros, np.einsum("kia,k->ia", at_end, seconds[:, 0])])


def _beside_truth(partial: NDArray, turns: NDArray, seconds: NDArray, true: NDArray) -> tuple[NDArray, NDArray]:
    """What the gyros miss the true turn (3, 3) by [rad], and how it changes with the errors."""
    residual = Rotation.from_matrix(partial[-1].T @ true).as_rotvec()
    return residual, _turned_by_errors(partial, turns, seconds)


def _beside_gravity(
    partial: NDArray, turns: NDArray, seconds: NDArray, before: NDArray, behind: NDArray
) -> tuple[NDArray, NDArray]:
    """What the gyros miss gravity behind a move by [rad], and how it changes with the errors."""
    back = partial[-1].T
    carried = back @ before
    design = np.cross(carried, _turned_by_errors(partial, turns, seconds), axisb=0, axisc=0)
    of_force = back @ _of_accelerometers(before) - _of_accelerometers(behind)
    return behind - carried, np.hstack([design, of_force])


def _of_accelerometers(direction: NDArray) -> NDArray:
    """How a reading (3,) [g] changes (3, 12) with the errors of accelerometers, then with their biases."""
    return np.hstack([np.kron(np.eye(3), direction), np.eye(3)])
