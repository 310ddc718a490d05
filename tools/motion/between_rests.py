"""Compare the gyros of a record with gravity at its rests: the attitude carried between rests must meet it.

Between two rests the gyros, less their mean at both, turn gravity's direction at the first into that at the second.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...models.arrays import Bools, Floats
from ..records import StrapdownRecord
from ..records.channels import PERMUTATIONS, Channels
from ..records.turned import Stretches, thinned
from ..rounding import digits
from .rests import RecordSampling, Rests
from .truth import usable_in
from .turning import said_of_ways, units_tried

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

ALLOWED, ALLOWED_PART = 0.15, 0.1
"""Largest error of gravity by the carried attitude [rad], and its part of the turns of the block."""
TELLING = 1.0
"""A move that may miss by more tells nothing [rad]."""
LONGEST_S = 60.0
"""Longer moves are left out: their rates may have drifted."""
STANDING = 0.2
"""Where gyros read more than this at rest [rad/s], they may turn steadily, as in a centrifuge."""
SAME_FORCE = 0.1
"""Specific forces at two rests that differ by more than this part are not gravity alone."""
FEWEST_MOVES = 3
"""Fewer moves name no way of reading."""
LEAST_TURN = 0.3
"""Moves that turn gravity by less tell no way of reading from another [rad]."""
MOST_MOVES = 80
"""Most moves that are compared, spread over the record."""
SCALES = 2.0 ** np.arange(-3.0, 3.01, 0.25)
"""Sizes of the gyros' readings that are tried."""
OF_ONE = np.concatenate([1.0 + (part - 1.0) * np.eye(3) for part in (0.25, 0.5, 2.0, 4.0)])
"""The same of one gyro beside the others."""
CLEARER = 0.2
"""Gyros are told from each other where that leaves at most this part of the squared error."""
ALIKE = 0.1
"""Error [rad] for which a difference of 1 in the logarithms of the gyros' scales counts: without evidence they stay
alike."""


@dataclass(frozen=True, eq=False)
class Moves:
    """Moves between two rests.

    Gravity's directions (M, 3) at both, the turns between, and the largest drift of the gyros (M,) [rad]. The times (M,
    2) are those at which moves begin and end [s].
    """

    before: Floats
    after: Floats
    turns: Stretches
    drift: Floats
    times: Floats

    def __len__(self) -> int:
        return len(self.drift)

    def those(self, mask: Bools) -> "Moves":
        """Some of the moves."""
        return Moves(self.before[mask], self.after[mask], self.turns.those(mask), self.drift[mask], self.times[mask])

    def carried(self, matrix: Floats) -> Floats:
        """Gravity (M, 3) at the second rests, as gyros carry it that are read through a matrix (3, 3)."""
        if not len(self):
            return self.before
        return self.turns.total(matrix).inv().apply(self.before)

    def missed(self, matrix: Floats) -> Floats:
        """Angles (M,) between gravity as it is carried and as it is measured [rad]."""
        return angles_of(self.carried(matrix), self.after)

    def allowed(self, size: float = 1.0) -> Floats:
        """Return the errors (M,) allowed to usual gyros whose true turns are `size` times the readings [rad]."""
        return ALLOWED + ALLOWED_PART * size * self.turns.way + self.drift

    def missing(self, scale: Floats) -> Bools:
        """Return the moves (M,) over which gyros of these scales (3,) miss gravity by more than allowed."""
        allowed = self.allowed(float(scale.max()))
        return (allowed <= TELLING) & (self.missed(np.diag(scale)) > allowed)

    @property
    def turned(self) -> Floats:
        """Angles (M,) by which gravity turned [rad]."""
        return angles_of(self.before, self.after)


def angles_of(a: Floats, b: Floats) -> Floats:
    """Angles (M,) between vectors (M, 3) [rad]."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def moves_between(record: StrapdownRecord, sampling: RecordSampling, rests: Rests) -> Moves:
    """The moves between neighbouring rests at which gravity alone acts, without a gap, a knock or a saturated gyro.

    Parts of the column `part` or `face` that follow each other without unnamed rows may be sections put together,
    without the rows between them.
    """
    size = np.linalg.norm(rests.force, axis=1)
    standing = np.linalg.norm(rests.rate, axis=1) < STANDING
    first = np.array([rows.stop - 1 for rows in rests.rows[:-1]], dtype=int)
    last = np.array([rows.start for rows in rests.rows[1:]], dtype=int)
    suits = (np.abs(np.diff(size)) <= SAME_FORCE * size[:-1]) & standing[1:] & standing[:-1]
    suits &= (record.time_s[last] - record.time_s[first] <= LONGEST_S) & usable_in(record, sampling)(first, last)
    names = record.part or record.face
    if names is not None:
        joints = [one != other and bool(one and other) for one, other in pairwise(names)]
        before = np.concatenate([[0], np.cumsum(joints)])
        suits &= before[last] == before[first]
    chosen = thinned(np.flatnonzero(suits), MOST_MOVES)
    ends = np.column_stack([first[chosen], last[chosen]])
    level = 0.5 * (rests.rate[1:] + rests.rate[:-1])[chosen]
    direction = rests.force / np.where(size > 0.0, size, 1.0)[:, None]
    times = record.time_s[ends]
    drift = np.diff(times, axis=1)[:, 0] * np.linalg.norm(np.diff(rests.rate, axis=0)[chosen], axis=1)
    turns = Stretches.of(record, record.time_s, ends).less(level)
    return Moves(direction[chosen], direction[chosen + 1], turns, drift, times)


def ways_beside_gravity(moves: Moves, before: Channels | None) -> tuple[str, str] | None:
    """Describe wrong order, signs or unit of gyros that miss gravity over most moves, as `said_of_ways` does."""
    telling = moves.those(moves.turned > LEAST_TURN)
    unknown = not (telling.allowed() <= TELLING).any()
    if before == Channels() or not (unknown or 2 * telling.missing(np.ones(3)).sum() > len(telling)):
        return None
    return said_of_ways(ways_that_fit(telling, before), before)


def missed_gravity(moves: Moves, scale: Floats) -> tuple[str, ...]:
    """A line where gyros of these scales (3,) and usual errors miss gravity over some move; nothing where none does."""
    missing = moves.missing(scale)
    if not missing.any():
        return ()
    missed = np.where(missing, moves.missed(np.diag(scale)), 0.0)
    worst = int(np.argmax(missed))
    begins, ends = (digits(float(time), 6) for time in moves.times[worst])
    return (
        f"the gyros miss gravity after {int(missing.sum())} of {len(moves)} moves, by "
        f"{digits(np.degrees(missed[worst]), 3)} degrees at the rest from {ends} s on: look at their rows between "
        f"{begins} and {ends} s",
    )


def ways_that_fit(moves: Moves, before: Channels | None) -> list[tuple[int, int]]:
    """Other ways of reading, by unit and signed permutation, that carry gravity over every move; the best first."""
    fits: dict[tuple[int, int], float] = {}
    if len(moves) < FEWEST_MOVES:
        return []
    for unit, size in enumerate(units_tried(before)):
        allowed = moves.allowed(size)
        if not (allowed <= TELLING).any():
            continue
        for number, axes in enumerate(PERMUTATIONS):
            # a way of reading turns readings about the axes that a permutation maps them to
            missed = moves.missed(size * axes.T)
            if (missed <= allowed).all():
                fits[unit, number] = float(missed @ missed)
    if (0, 0) in fits:
        return []
    return sorted(fits, key=lambda way: fits[way])


def scales_by_rests(moves: Moves) -> Floats | None:
    """Return the ratio of true to measured turn of each gyro (3,), by gravity at the rests; None if undetermined.

    They differ where that misses far less.
    """
    telling = moves.those((moves.turned > LEAST_TURN) & (moves.allowed() - ALLOWED <= 4.0 * TELLING))
    if len(telling) < FEWEST_MOVES:
        return None

    def misses(logs: Floats) -> Floats:
        """Return the misses of gyros of scales whose logarithms are given, one or three."""
        scale = np.exp(logs) * np.ones(3)
        missed = telling.carried(np.diag(scale)) - telling.after
        return np.append(missed, ALIKE * (logs - logs.mean()))

    def fitted(starts: Floats) -> "OptimizeResult":
        """Return the best fit from the best of some starts, logarithms (S, 1) or (S, 3)."""
        costs = [float(np.square(misses(start)).sum()) for start in starts]
        return scipy.optimize.least_squares(misses, starts[int(np.argmin(costs))])

    # Gyros that meet gravity as they are need no other start.
    meets = (telling.missed(np.eye(3)) <= telling.allowed()).all()
    fit = fitted(np.zeros((1, 1)) if meets else np.log(SCALES)[:, None])
    if 2.0 * fit.cost > ALLOWED**2 * len(telling):
        single = np.log(OF_ONE)
        apart = fitted(np.concatenate([single, single + fit.x]))
        if apart.cost < CLEARER * fit.cost:
            fit = apart
    scale = np.exp(fit.x) * np.ones(3)
    if (telling.missed(np.diag(scale)) <= telling.allowed(float(scale.max()))).all():
        return scale
    return None
