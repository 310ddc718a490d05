"""Proven lower bounds of the worst ratio that a common set of a given number of positions can reach.

Lower bounds come from an implicit hitting set on a pool of table positions. A set reaches the ratio r only if it meets
a condition for every target k and every y with a'y = c_k: one of its positions has |F'y| ≥ 1/r. At least one position
of that region must be in the set. A linear programme over such cuts bounds the number of positions from below.

The search looks for cuts that the programme's present answer violates. It gathers positions, the heaviest first, while
they cannot reach r together; the dual that proves this is the cut. The cut holds for all images under the symmetries of
the problem, so the programme has one variable for each group of images. The bound is proven only for the positions of a
given pool. Regions that hold a measured position prove nothing.
"""

from dataclasses import dataclass
from itertools import product
from math import hypot

import numpy as np
import scipy
from numpy.typing import NDArray

from ..bounded.programmes import SolverError
from .certificate import ColumnProgramme
from .forms import harmonics
from .task import TURN, CertainReadings, Places, Task, allowed, clearances, on_all_mountings, readings

SAMPLES = 40
"""Number of random positions at which a symmetry is checked: forms of nine terms that agree there are equal."""
EQUAL = 1e-11
OFFSETS_DEG = (0.0, 1.4, 2.5, 5.0, 10.0, 20.0, 30.0, 45.0)
"""Distances of the pool's lines from the multiples of 90° of both axes."""
SAFE = 1e-9
"""Margin below 1/r within which a position still counts into a region."""
COVERED = 1e-6
BATCH = 24
"""Number of columns that are added to a programme at once."""
COARSE, FINE = 16, 1
"""Smallest group of positions, without and with weight in the present answer, that is tried together."""
MISSES = 10
"""A cut is complete after this number of consecutive groups that cannot be taken in."""
NOISE = 0.3
RATIO_STEPS = 24
NEAREST = 0.1
"""First and smallest fraction of the gap between bound and set at which the search aims."""
PATIENCE = 10
"""Number of recent cuts whose mean gain decides whether the remaining cuts can still prove the bound."""


@dataclass(frozen=True)
class Symmetry:
    """θ → sense θ + shift, for both angles: senses (2,) ±1 and shifts (2,) 0 or π [rad]."""

    sense: NDArray
    shift: NDArray

    def of(self, angle: NDArray) -> NDArray:
        """Return the images (N, 2) of positions (N, 2) [rad]."""
        return np.mod(self.sense * angle + self.shift, TURN)


def symmetries(task: Task) -> list[Symmetry]:
    """Return those of the sixteen candidates that map readings to readings and targets to targets, up to signs.

    The cost of every target on a set of positions equals the cost of a target with the same optimum on the set's image.
    A proof for a set therefore holds for its images. Measured positions must be their own image; keep-outs are ignored.
    """
    angle = np.random.default_rng(1).uniform(0.0, TURN, (SAMPLES, 2))
    regressor, clear = _best_sheets(task, angle)
    holding = []
    for senses in product((1.0, -1.0), repeat=2):
        for shifts in product((0.0, np.pi), repeat=2):
            symmetry = Symmetry(np.array(senses), np.array(shifts))
            image, moved = _best_sheets(task, symmetry.of(angle))
            if np.abs(clear - moved).max() <= EQUAL and _stays(task, symmetry) and _maps(task, regressor, image):
                holding.append(symmetry)
    return holding


def _best_sheets(task: Task, angle: NDArray) -> tuple[NDArray, NDArray]:
    """Return F (N, 3, P) of the sheets with the larger clearance, and that clearance (N, 3), with every mounting."""
    places = on_all_mountings(angle, len(task.parametrisation.mountings))
    clear = clearances(task, places)
    a, b = harmonics(places.angle[:, 0]), harmonics(places.angle[:, 1])
    f = np.einsum("spij,ni,nj->nsp", task.regressor, a, b, optimize=True)
    clear = np.stack([np.where(task.accelerometer == p, clear, -np.inf) for p in range(3)], axis=1)
    best = clear.argmax(axis=2)[..., None]
    return np.take_along_axis(f, best, axis=1), np.take_along_axis(clear, best, axis=2)[..., 0]


def _stays(task: Task, symmetry: Symmetry) -> bool:
    """Return True if the image of the measured positions is the same positions."""
    at = task.measured
    apart = np.sin(0.5 * (symmetry.of(at.angle)[:, None] - at.angle[None])) ** 2
    same = (apart.sum(axis=2) < EQUAL**2) & (at.mounting[:, None] == at.mounting[None])
    return bool(same.any(axis=1).all())


def _maps(task: Task, regressor: NDArray, image: NDArray) -> bool:
    """Return True if F at the images, times a sign for each accelerometer, is F with its parameters permuted.

    The permutation must also map groups of targets to groups.
    """
    groups = {frozenset(group) for group in task.groups}
    size = regressor.shape[2]
    for second, third in product((1.0, -1.0), repeat=2):
        turned = image * np.array([1.0, second, third])[None, :, None]
        mixed = _permutation(regressor.reshape(-1, size), turned.reshape(-1, size))
        if mixed is None:
            continue
        moved = (task.weights @ mixed)[:, None]
        near = np.minimum(np.abs(task.weights - moved).max(axis=2), np.abs(task.weights + moved).max(axis=2))
        target = near.argmin(axis=1)
        images = {frozenset(target[list(group)].tolist()) for group in groups}
        if near.min(axis=1).max() <= EQUAL and images == groups:
            return True
    return False


def _permutation(regressor: NDArray, image: NDArray) -> NDArray | None:
    """Return D (P, P), a permutation with signs, with image = regressor D; None if there is none."""
    size = regressor.shape[1]
    mixed = np.zeros((size, size))
    for column in range(size):
        for sign in (1.0, -1.0):
            same = np.abs(regressor - sign * image[:, column : column + 1]).max(axis=0) < EQUAL
            if same.sum() == 1:
                mixed[int(same.argmax()), column] = sign
    one_each = (np.abs(mixed).sum(axis=0) == 1).all() and (np.abs(mixed).sum(axis=1) == 1).all()
    return mixed if one_each else None


@dataclass(frozen=True)
class PositionPool:
    """Positions on which bounds are proven, the group (n,) that each forms with its images, and all their readings."""

    places: Places
    orbit: NDArray
    readings: CertainReadings

    def heights(self, duals: NDArray) -> NDArray:
        """Return the greatest |F'y| (n,) over the readings of each position and the duals (D, P)."""
        first = np.searchsorted(self.readings.position, np.arange(len(self.places)))
        return np.maximum.reduceat(np.abs(self.readings.regressor @ duals.T).max(axis=1), first)


def pool_of(task: Task, known: Places) -> PositionPool:
    """Return crossings of lines at fixed distances from multiples of 90°, optimal plans, known positions, and all
    images.

    Positions in a keep-out and positions without a reading that counts are left out.
    """
    offsets = np.unique(np.concatenate([np.array(OFFSETS_DEG), -np.array(OFFSETS_DEG)]))
    lines = np.unique(np.mod((90.0 * np.arange(4)[:, None] + offsets).ravel(), 360.0))
    grid = np.radians(np.stack(np.meshgrid(lines, lines, indexing="ij"), axis=-1).reshape(-1, 2))
    places = on_all_mountings(np.concatenate([grid, task.support]), len(task.parametrisation.mountings)).joined(known)
    group = symmetries(task)
    images = np.stack([np.round(np.mod(np.degrees(s.of(places.angle)), 360.0), 9) % 360.0 for s in group], axis=1)
    mounting = np.broadcast_to(places.mounting[:, None, None], (*images.shape[:2], 1))
    keys = np.concatenate([mounting, images], axis=2)
    least = np.array([min(rows) for rows in keys.tolist()])
    _, orbit = np.unique(least, axis=0, return_inverse=True)
    distinct, first = np.unique(keys.reshape(-1, 3), axis=0, return_index=True)
    places = Places(np.radians(distinct[:, 1:]), distinct[:, 0].astype(int))
    orbit = np.repeat(orbit.ravel(), len(group))[first]
    counted = np.unique(readings(task, places).position)
    counted = counted[allowed(task, places.angle[counted])]
    _, orbit = np.unique(orbit[counted], return_inverse=True)
    places = places.chosen(counted)
    return PositionPool(places, orbit.ravel(), readings(task, places))


@dataclass(frozen=True)
class Bound:
    """A proof: no set of `count` positions of a pool (in words) has a worst ratio below `ratio`.

    `cuts` is the number of cuts in the proof, without images.
    """

    ratio: float
    count: int
    on: str
    cuts: int


class HittingSet:
    """The cuts on a pool so far, for any ratio and any number of positions."""

    def __init__(self, task: Task, pool: PositionPool):
        self._task, self._pool = task, pool
        self._rng = np.random.default_rng(task.request.seed)
        self._height = np.zeros((len(pool.places), 0))
        self._measured = readings(task, task.measured).regressor
        self._measured_height = np.zeros(0)
        self._size = np.bincount(pool.orbit)
        least = []
        for k in range(len(task.groups)):
            gathering = _Gathering(task, pool, k, -np.inf)
            gathering.gather(np.arange(len(pool.places)), 1, np.zeros(0), 0.0)
            least.append(gathering.cost / task.least[k] * (1.0 - 10 * SAFE))
        self._least_ratio = max(least)

    def __len__(self) -> int:
        """The number of cuts."""
        return self._height.shape[1]

    def least_count(self, ratio: float) -> tuple[float, NDArray]:
        """Return a proven lower bound of the number of positions that reach the ratio, and the programme's answer
        (n,)."""
        count = len(self._pool.places)
        if self._least_ratio > ratio:
            return np.inf, np.zeros(count)
        valid = self._measured_height < 1.0 / ratio - SAFE
        if not valid.any():
            return 0.0, np.full(count, 1.0 / count)
        inside, orbit = self._height[:, valid] >= 1.0 / ratio - SAFE, self._pool.orbit
        share = np.stack([np.bincount(orbit, column, len(self._size)) for column in inside.T]) / self._size
        least = np.ones(len(share))
        solved = scipy.optimize.linprog(np.ones(len(self._size)), A_ub=-share, b_ub=-least, method="highs")
        if solved.x is None:
            return 0.0, np.zeros(count)
        prices = np.maximum(-solved.ineqlin.marginals, 0.0)
        proven = float(prices @ least / max(1.0, (share.T @ prices).max()))
        return proven * (1.0 - SAFE), (solved.x / self._size)[self._pool.orbit]

    def prove(self, count: int, ratio: float, most: int) -> bool:
        """Search for at most `most` new cuts that prove that `count` positions cannot reach the ratio."""
        failures, reached = 0, []
        for turn in range(4 * most):
            least, answer = self.least_count(ratio)
            if least > count:
                return True
            reached.append(least)
            if most <= 0 or failures >= len(self._task.groups):
                return False
            if len(reached) > PATIENCE and least + (least - reached[-1 - PATIENCE]) * most / PATIENCE < count:
                return False
            try:
                duals = self._cut(turn % len(self._task.groups), ratio, answer)
            except SolverError:
                duals = None
            if duals is None:
                failures += 1
                continue
            failures = 0
            self._height = np.column_stack([self._height, self._pool.heights(duals)])
            height = np.abs(self._measured @ duals.T).max(initial=0.0)
            self._measured_height = np.append(self._measured_height, height)
            most -= 1
        return False

    def bound(self, count: int, ceiling: float) -> Bound:
        """Return the greatest ratio below `ceiling` that the cuts exclude for this number of positions."""
        low, high = 1.0, ceiling
        for _ in range(RATIO_STEPS):
            middle = 0.5 * (low + high)
            if self.least_count(middle)[0] > count:
                low = middle
            else:
                high = middle
        return Bound(low, count, f"pool of {len(self._pool.places)} positions", len(self))

    def _cut(self, k: int, ratio: float, answer: NDArray) -> NDArray | None:
        """Return duals y (D, P) whose region the answer covers by less than one; None if the greedy search finds
        none."""
        noisy = answer * np.exp(NOISE * self._rng.normal(size=len(answer)))
        order = np.argsort(-noisy, kind="stable")
        heavy = order[answer[order] > 0.0]
        light = self._rng.permutation(np.flatnonzero(answer <= 0.0))
        gathering = _Gathering(self._task, self._pool, k, ratio)
        room = 1.0 - COVERED
        for chunk in np.array_split(heavy, max(1, len(heavy) // COARSE)):
            room -= gathering.gather(chunk, FINE, answer, room)
            if room <= 0.0:
                return None
        missed = 0
        for chunk in np.array_split(light, max(1, len(light) // COARSE)):
            missed = 0 if gathering.takes(chunk) else missed + 1
            if missed >= MISSES:
                break
        return gathering.cut()


class _Gathering:
    """Positions that, with the measured ones, cannot reach the ratio for a group of targets, and the duals that prove
    it.

    If |F'y| of no dual exceeds one, the targets cost at least a'y, and the group the root of the sum of their squares.
    """

    def __init__(self, task: Task, pool: PositionPool, k: int, ratio: float):
        self._limit, self._least = ratio * task.least[k] * (1.0 + SAFE), float(task.least[k])
        self._targets = task.weights[list(task.groups[k])]
        measured = readings(task, task.measured).regressor
        self._first = len(measured)
        # One programme for each target: the last solution is no use for another aim.
        self._programmes = []
        for target in self._targets:
            programme = ColumnProgramme(self._targets.shape[1])
            programme.aim(target)
            if len(measured):
                programme.add(measured)
            self._programmes.append(programme)
        self._pool = pool
        self._inside = np.zeros(len(pool.places), dtype=bool)
        self._added = np.zeros(len(pool.readings.position), dtype=bool)
        self._rows = np.zeros(0, dtype=int)
        self._duals = np.array([programme.solve()[1] for programme in self._programmes])

    @property
    def cost(self) -> float:
        """Return the least cost of the group with these positions [σ]."""
        return self._together(self._duals)

    def cut(self) -> NDArray | None:
        """Return the duals y (D, P), scaled to the group's optimum; None if the measured positions alone reach the
        ratio."""
        return self._duals * (self._least / self.cost) if self.cost > self._limit else None

    def _together(self, duals: NDArray) -> float:
        return hypot(*(duals * self._targets).sum(axis=1))

    def gather(self, chunk: NDArray, least: int, answer: NDArray, room: float) -> float:
        """Add these positions as long as the set can hold them; return the weight of the others."""
        if self.takes(chunk):
            return 0.0
        if len(chunk) <= least:
            return float(answer[chunk].sum())
        half = len(chunk) // 2
        lost = self.gather(chunk[:half], least, answer, room)
        if lost >= room:
            return np.inf
        return lost + self.gather(chunk[half:], least, answer, room - lost)

    def takes(self, chunk: NDArray) -> bool:
        """Try the set with these positions, and keep them if it still cannot reach the ratio."""
        self._inside[chunk] = True
        self._close(chunk, closed=False)
        regressor, position = self._pool.readings.regressor, self._pool.readings.position
        duals, candidates = self._duals.copy(), self._inside[position]
        while self._together(duals) > self._limit:
            heights = np.abs(regressor @ duals.T)
            over = candidates & (heights.max(axis=1) > 1.0 + 0.5 * SAFE)
            if not over.any():
                self._duals = duals
                return True
            broken = heights[over].max(axis=0) > 1.0 + 0.5 * SAFE
            new = np.flatnonzero(over & ~self._added)
            new = new[np.argsort(-heights[new].max(axis=1), kind="stable")[:BATCH]]
            for programme in self._programmes:
                programme.add(regressor[new])
            self._added[new] = True
            self._rows = np.append(self._rows, new)
            candidates = self._inside[position] & ~self._added
            # Duals whose columns were not broken keep their value.
            for k in np.flatnonzero(broken).tolist():
                duals[k] = self._programmes[k].solve()[1]
        self._inside[chunk] = False
        self._close(chunk, closed=True)
        return False

    def _close(self, chunk: NDArray, *, closed: bool) -> None:
        known = np.flatnonzero(np.isin(self._pool.readings.position[self._rows], chunk))
        if len(known):
            for programme in self._programmes:
                programme.close(self._first + known, closed=closed)


def bound_positions(task: Task, pool: PositionPool, count: int, reached: float) -> Bound:
    """Return the best bound for this number of positions from the request's number of cuts.

    The search aims ever nearer to `reached`, the worst ratio of the best known set.
    """
    hitting, share = HittingSet(task, pool), NEAREST
    known = hitting.bound(count, reached).ratio
    while (remaining := task.request.cuts - len(hitting)) > 0:
        aim = known + share * (reached - known)
        if hitting.prove(count, aim, remaining):
            known, share = max(aim, known), max(share, 0.5)
            continue
        share *= 0.5
        if share <= NEAREST:
            break
    return hitting.bound(count, reached)
