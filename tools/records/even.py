"""Even stamps or stamps as logged: those under which gyros and gravity, or the true attitude, agree better.

Over each move between two rests the gyros must turn gravity's direction at the first into that at the second, with
small errors of gyros and accelerometers fitted. Over each stretch with a true attitude they must turn as that does.
"""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from .. import postponed as postponed
from ..errors import InputError
from ..rounding import digits, exactly
from .kinds import BenchRecord, ForceRecord, PoseRecord, PositionRecord, RawRecord, StrapdownRecord
from .limits import runs_of
from .stamps import Grid, grid_of
from .turned import Stretches, thinned

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
"""Error of a move without any error of stamps [rad]."""
GYRO, RATE, ACCELEROMETER = 0.1, 0.02, 0.03
"""Sizes of the errors that are fitted: of a gyro's scale and axis, its bias [rad/s], and an accelerometer [g]."""
FEWEST_BLOCKS = 4
"""Fewer blocks hold no two rests."""
CONVERGED = 1e-3
"""The fit of small errors ends where nothing changes by more than this part."""
AS_WELL = 1.03
"""Even stamps that leave no more than this times what those logged leave are taken: loggers stamp late more often
than sensors sample unevenly."""
MOST_HELD = 0.5
"""Stamps that are farther from even times, in periods, are not taken as logged where nothing tells."""

Measured = TypeVar("Measured", bound=PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord)


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
    period = None if stamps in (EVEN, LOGGED) else 1.0 / rate_of(stamps)
    if stamps == LOGGED or isinstance(record, PositionRecord | PoseRecord):
        return _said(record, "time stamps: as logged, as said")
    if period is None and len(record) < 2:
        return record
    if period is None:
        grid = grid_of(record.time_s)
        if not grid.regular:
            raise InputError(f"{record.path}, column 'time_s': follows no even times; give --stamps RATE_HZ or logged")
        return _said(replace(record, time_s=grid.even), f"time stamps: even, {_every(grid.period)}, as said")
    even = record.time_s[0] + period * np.arange(len(record))
    return _said(replace(record, time_s=even), f"time stamps: even, {_every(period)}, as said; those logged are unused")


def times_unused(stamps: str | None) -> bool:
    """Return true if stamps may repeat and run back, because only the rows are counted."""
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
    off = f"logged ones are up to {digits(grid.departure / grid.period, 2)} periods off"
    missed = None
    if gyros.rate is not None:
        missed = missed_angles(gyros, grid)
    if missed is None:
        is_even = grid.departure > MOST_HELD * grid.period
        because = "nothing in the record tells which are right"
    else:
        is_even = missed.even <= AS_WELL * missed.logged
        even, logged = (f"{digits(math.degrees(angle) * 60.0, 3)}" for angle in (missed.even, missed.logged))
        pieces = f"over {missed.pieces} {missed.words}"
        because = f"{pieces} the gyros miss by {even} arcmin rms with even ones, {logged} with logged ones"
        if even == logged:
            because = f"{pieces} both do as well"
    if is_even:
        line = f"time stamps: even, {_every(grid.period)} ({off}); {because}; --stamps logged takes logged ones"
        return _said(replace(record, time_s=grid.even), line)
    off = f"up to {digits(grid.departure / grid.period, 2)} periods off even ones"
    return _said(record, f"time stamps: as logged, {off}; {because}; --stamps even takes even ones")


@dataclass(frozen=True)
class Missed:
    """Misses of gravity or the true attitude, rms [rad], with either kind of stamps; and their number."""

    even: float
    logged: float
    pieces: int
    words: str


def missed_angles(record: StrapdownRecord, grid: Grid) -> Missed | None:
    """Return the angles by which the gyros miss gravity over moves, or the true attitude; None if undetermined."""
    ends, words = _with_truth(record, grid), "stretches with a true attitude"
    directions = None
    if len(ends) < FEWEST:
        (ends, directions), words = _moves(record, grid), "moves between rests"
    if len(ends) < FEWEST:
        return None
    even, logged = (_least_missed(record, time, ends, directions) for time in (grid.even, grid.logged))
    if not min(even, logged) <= LARGEST:
        return None
    return Missed(even, logged, len(ends), words)


def _usable(record: StrapdownRecord, grid: Grid, ends: Ints) -> Ints:
    """Return stretches (S, 2) of rows without a gap, in which the block turns; spread over the record."""
    gaps = np.append(0, np.cumsum(grid.is_gap))
    whole = np.flatnonzero(gaps[ends[:, 0]] == gaps[ends[:, 1]])
    turned = Stretches.of(record, grid.even, ends[whole]).way > TURNED
    return thinned(whole[turned], MOST)


def _with_truth(record: StrapdownRecord, grid: Grid) -> Ints:
    """Stretches (S, 2), first and last row, in which the block turns and its true attitude is known at both ends."""
    rows = max(2, round(STRETCH / grid.period))
    first = np.arange(0, len(record) - rows, rows)
    if record.attitude is None:
        return np.zeros((0, 2), dtype=int)
    known = np.asarray(np.isfinite(record.attitude).all(axis=1))
    first = first[known[first] & known[first + rows]]
    ends = np.column_stack([first, first + rows])
    return ends[_usable(record, grid, ends)]


def _moves(record: StrapdownRecord, grid: Grid) -> tuple[Ints, Floats]:
    """Moves (S, 2), from the middle of a rest to that of the next, and gravity's directions (S, 2, 3) at both.

    Rests are neighbouring quiet blocks without a gap.
    """
    assert record.rate is not None
    size = max(8, round(BLOCK / grid.period))
    count = len(record) // size
    if count < FEWEST_BLOCKS:
        return np.zeros((0, 2), dtype=int), np.zeros((0, 2, 3))
    rows = slice(0, count * size)
    scatter = record.rate[rows].reshape(count, size, 3).std(axis=1).max(axis=1)
    still = scatter <= STILL * np.quantile(scatter, 0.1)
    still[grid.gaps[grid.gaps < count * size] // size] = False
    begins, stops = runs_of(still)
    long = stops - begins >= 2
    begins, stops = begins[long] * size, stops[long] * size
    directions = np.zeros((len(begins), 3))
    for place, (begin, stop) in enumerate(zip(begins, stops, strict=True)):
        mean = record.specific_force[begin:stop].mean(axis=0)
        directions[place] = mean / max(float(np.linalg.norm(mean)), 1e-300)
    middle = (begins + stops) // 2
    ends = np.column_stack([middle[:-1], middle[1:]])
    short = np.flatnonzero((ends[:, 1] - ends[:, 0]) * grid.period <= LONGEST)
    usable = short[_usable(record, grid, ends[short])]
    return ends[usable], np.stack([directions[:-1], directions[1:]], axis=1)[usable]


def _least_missed(record: StrapdownRecord, time: NDArray, ends: Ints, directions: NDArray | None) -> float:
    """Return the gyros' miss [rad], rms over stretches (S, 2), with the best small errors of the instruments."""
    stretches = Stretches.of(record, time, ends)

    def missed(errors: NDArray) -> NDArray:
        """Return misses (S, 3) [rad] with errors (24,) in units of their sizes: of gyros, then of accelerometers."""
        gyros, bias = np.eye(3) + GYRO * errors[:9].reshape(3, 3), RATE * errors[9:12]
        turn = stretches.less(np.tile(-bias, (len(ends), 1))).total(gyros)
        if directions is None:
            assert record.attitude is not None
            before, behind = (
                scipy.spatial.transform.Rotation.from_quat(record.attitude[rows], scalar_first=True) for rows in ends.T
            )
            return (turn.inv() * before.inv() * behind).as_rotvec()
        force = directions @ (np.eye(3) + ACCELEROMETER * errors[12:21].reshape(3, 3)).T + ACCELEROMETER * errors[21:]
        return force[:, 1] - turn.inv().apply(force[:, 0])

    def residuals(errors: NDArray) -> NDArray:
        return np.append(missed(errors).ravel() / NOISE, errors)

    errors = scipy.optimize.least_squares(residuals, np.zeros(24), method="lm", ftol=CONVERGED, xtol=CONVERGED).x
    return float(np.sqrt(3.0 * np.mean(np.square(missed(errors)))))
