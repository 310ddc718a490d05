"""Lower bounds for sets of N positions, by an implicit hitting set.

A set reaches the ratio r only if, for every target k and every y with a'y = c_k, one of its positions has
|F'y| ≥ 1/r: at least one position of that region must be in the set. A linear programme over such cuts bounds the
number of positions from below. Cuts are found where the programme's present answer violates them: positions are
gathered, the heaviest first, while they cannot reach r together; the dual that proves that is the cut. Each cut holds
for all images under the symmetries, and the programme has one variable for each group of images.

The bound is proven for positions of a stated pool, not of the continuum: that would need regions of whole cells.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from .master import Master
from .places import Task
from .pool import Pool

SAFE = 1e-9
"""A position this little below 1/r is counted into a region."""
COVERED = 1e-6
BATCH = 24
"""Columns that are added to a programme at once."""
COARSE, FINE = 16, 1
"""Least size of the groups of positions without and with weight in the present answer that are tried together."""
NOISE = 0.3
RATIO_STEPS = 24
NEAREST = 0.1
"""Least part of what is open between bound and set that is aimed at."""


@dataclass(frozen=True)
class Bound:
    """What is proven.

    Attributes
    ----------
    ratio : float
        no set of `count` positions of the pool has a worst ratio below it
    count : int
    on : str
        the pool in words
    cuts : int
        how many cuts prove it, images not counted
    """

    ratio: float
    count: int
    on: str
    cuts: int


class HittingSet:
    """The cuts found so far on a pool, for any ratio and any number of positions.

    Parameters
    ----------
    task : Task
    pool : Pool
    seed : int
    """

    def __init__(self, task: Task, pool: Pool, seed: int = 0):
        self._task, self._pool = task, pool
        self._rng = np.random.default_rng(seed)
        self._height = np.zeros((len(pool.places), 0))
        self._size = np.bincount(pool.orbit, minlength=pool.orbits)
        self._whole = np.array([self._cost_of_all(k) for k in range(len(task.targets))])

    def __len__(self) -> int:
        """The number of cuts."""
        return self._height.shape[1]

    def least_count(self, ratio: float) -> tuple[float, NDArray]:
        """A proven lower bound of how many positions reach the ratio, and the programme's answer (n,) by position."""
        if (self._whole > ratio).any():
            return np.inf, np.zeros(len(self._pool.places))
        if not len(self):
            return 0.0, np.full(len(self._pool.places), 1.0 / len(self._pool.places))
        inside = self._height >= 1.0 / ratio - SAFE
        share = np.stack(
            [np.bincount(self._pool.orbit, weights=column, minlength=len(self._size)) for column in inside.T]
        )
        share /= self._size
        solved = linprog(np.ones(len(self._size)), A_ub=-share, b_ub=-np.ones(len(share)), method="highs")
        if solved.x is None:
            return 0.0, np.zeros(len(self._pool.places))
        prices = np.maximum(-solved.ineqlin.marginals, 0.0)
        proven = float(prices.sum() / max(1.0, (share.T @ prices).max()))
        return proven * (1.0 - SAFE), (solved.x / self._size)[self._pool.orbit]

    def prove(self, count: int, ratio: float, most: int) -> bool:
        """Look for cuts that prove that `count` positions cannot reach the ratio; at most `most` new ones."""
        failures = 0
        for turn in range(4 * most):
            least, answer = self.least_count(ratio)
            if least > count:
                return True
            if most <= 0 or failures >= len(self._task.targets):
                return False
            found = self._cut(turn % len(self._task.targets), ratio, answer)
            failures = failures + 1 if found is None else 0
            if found is not None:
                self._height = np.column_stack([self._height, self._pool.heights(found[None])[:, 0]])
                most -= 1
        return False

    def bound(self, count: int, ceiling: float) -> Bound:
        """The greatest ratio below `ceiling` that the cuts exclude for this number of positions."""
        low, high = 1.0, ceiling
        for _ in range(RATIO_STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.least_count(middle)[0] > count else (low, middle)
        return Bound(low, count, self._pool.description, len(self))

    def _cost_of_all(self, k: int) -> float:
        master, regressor = Master(self._task.regressor.shape[1]), self._pool.readings.regressor
        master.aim(self._task.targets[k].weights)
        while True:
            _, dual, _ = master.solve()
            new = np.argsort(-np.abs(regressor @ dual), kind="stable")[:BATCH]
            new = new[np.abs(regressor[new] @ dual) > 1.0 + SAFE]
            if not len(new):
                return float(dual @ self._task.targets[k].weights) / self._task.best[k] * (1.0 - 10 * SAFE)
            master.add(regressor[new])

    def _cut(self, k: int, ratio: float, answer: NDArray) -> NDArray | None:
        """A dual y (P,) whose region the answer covers by less than one; None when the greedy search finds none."""
        noisy = answer * np.exp(NOISE * self._rng.normal(size=len(answer)))
        order = np.argsort(-noisy, kind="stable")
        heavy = order[answer[order] > 0.0]
        light = self._rng.permutation(np.flatnonzero(answer <= 0.0))
        gathering = _Gathering(self._task, self._pool, k, ratio)
        left = 1.0 - COVERED
        for chunk in np.array_split(heavy, max(1, len(heavy) // COARSE)):
            left -= gathering.gather(chunk, FINE, answer, left)
            if left <= 0.0:
                return None
        for chunk in np.array_split(light, max(1, len(light) // (8 * COARSE))):
            gathering.gather(chunk, COARSE, answer, np.inf)
        return gathering.dual * (self._task.best[k] / float(gathering.dual @ self._task.targets[k].weights))


class _Gathering:
    """A set of positions that cannot reach the ratio for a target, and the dual that proves it."""

    def __init__(self, task: Task, pool: Pool, k: int, ratio: float):
        self._limit = ratio * task.best[k] * (1.0 + SAFE)
        self._target = task.targets[k].weights
        self._master = Master(task.regressor.shape[1])
        self._master.aim(self._target)
        self._pool = pool
        self._inside = np.zeros(len(pool.places), dtype=bool)
        self._added = np.zeros(len(pool.readings.position), dtype=bool)
        self._rows = np.zeros(0, dtype=int)
        self.dual = self._master.solve()[1]

    def gather(self, chunk: NDArray, least: int, answer: NDArray, room: float) -> float:
        """Take in as many of these positions as the set can hold; the weight of those that it cannot."""
        if self._holds(chunk):
            return 0.0
        if len(chunk) <= least:
            return float(answer[chunk].sum())
        half = len(chunk) // 2
        lost = self.gather(chunk[:half], least, answer, room)
        return lost + (self.gather(chunk[half:], least, answer, room - lost) if lost < room else np.inf)

    def _holds(self, chunk: NDArray) -> bool:
        """Try the set with these positions: kept when it still cannot reach the ratio."""
        self._inside[chunk] = True
        self._close(chunk, closed=False)
        regressor, position = self._pool.readings.regressor, self._pool.readings.position
        dual = self._master.solve()[1]
        if dual @ self._target <= self._limit:
            self._inside[chunk] = False
            self._close(chunk, closed=True)
            return False
        height = np.abs(regressor @ dual)
        while True:
            new = np.flatnonzero(self._inside[position] & ~self._added & (height > 1.0 + 0.5 * SAFE))
            if not len(new):
                self.dual = dual
                return True
            new = new[np.argsort(-height[new], kind="stable")[:BATCH]]
            self._master.add(regressor[new])
            self._added[new] = True
            self._rows = np.append(self._rows, new)
            dual = self._master.solve()[1]
            if dual @ self._target <= self._limit:
                break
            height = np.abs(regressor @ dual)
        self._inside[chunk] = False
        self._close(chunk, closed=True)
        return False

    def _close(self, chunk: NDArray, *, closed: bool) -> None:
        known = np.flatnonzero(np.isin(self._pool.readings.position[self._rows], chunk))
        if len(known):
            self._master.close(known, closed=closed)


def bound_positions(hitting: HittingSet, count: int, reached: float, cuts: int) -> Bound:
    """The best bound for so many positions that a number of new cuts gives, aimed ever nearer to what was reached.

    Parameters
    ----------
    hitting : HittingSet
        its cuts are used, and new ones added
    count : int
        N
    reached : float
        worst ratio of the best set known
    cuts : int
        how many new cuts may be looked for
    """
    known = hitting.bound(count, reached).ratio
    share = 0.5
    before = len(hitting)
    while (left := cuts - (len(hitting) - before)) > 0 and share > NEAREST:
        aim = known + share * (reached - known)
        if hitting.prove(count, aim, left):
            known = max(aim, known)
        else:
            share *= 0.5
    return hitting.bound(count, reached)
