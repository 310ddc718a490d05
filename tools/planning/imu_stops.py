"""Rests and turns that may be chosen for a whole IMU, and the choice of them in given time.

The pool is a programme of all of them. What all together guarantee no choice can better, for with bounded errors to
measure the same again tells nothing new. Stops are chosen by the programmes of the guaranteed errors: the worst error's
vertex, two benches that what is taken does not tell apart, says which other stop tells them apart best.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...models.bench import TARGETS
from ..bounded.programmes import Polytope
from ..calibration.targets import Target
from ..calibration.turns import PLAUSIBLE, WithTurns
from .imu_programme import STEP_S, Planned, Visit, seconds_of

LATTICE_DEG, AWAY_DEG = 30.0, 7.5
"""The pool's places: a lattice that lies so far from the multiples of 90°, where inputs are of no certain sign."""
WHOLE_TURNS = (1, 4)
LONG = (1.0, 2.0, 3.75)
"""Rests of the pool last so many dwells: long ones tell biases and sensitivities. One that is four times shorter than
most is taken for none."""
POOL_DWELL_S = 5.0
"""How long the rests of the pool's own record last: its rows say what longer ones give."""
WAY_S = 3.0
"""About how long the way from one stop to the next takes [s]."""
PATIENCE = 0.25
"""What a stop tells is divided by this power of its time: what takes long tells what nothing else does."""
SHARP = 4
"""The power to which ratios are raised before use is summed: the worst ones count."""
SAME = 1e-6
"""A ratio that differs by less is the same."""
LARGEST = 1e-2
"""What no parameter of bench and accelerometers exceeds."""


class Stop(NamedTuple):
    """A rest, or whole turns to and fro with rests at both ends: its visits, and its rows (K,) of the pool."""

    visits: tuple[Visit, ...]
    rows: NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Pool:
    """What is compared with: rows (M, P) over their bounds, and the stops that give some of them and may be chosen."""

    rows: NDArray[np.float64]
    stops: tuple[Stop, ...]

    @staticmethod
    def of(planned: Planned, dwell_s: float, rate_dps: float, others: Sequence[WithTurns]) -> "Pool":
        """Rests on the lattice, and turns about either axis at its angles of the other; and what others measure.

        Whatever is measured rests but shortly in the pool's own record: the rows of a rest say what a longer one gives.
        """
        lattice = np.arange(AWAY_DEG, 360.0, LATTICE_DEG).tolist()
        opposite = lattice[:: len(lattice) // 2]
        places = [(a, b) for k, a in enumerate(lattice) for b in (lattice if k % 2 == 0 else lattice[::-1])]
        around = [(a, b, 0) for b in lattice for a in opposite] + [(a, b, 1) for a in lattice for b in opposite]
        turns = [
            tuple((a + 360.0 * n * (1 - axis), b + 360.0 * n * axis) for n in (0, count, 0))
            for a, b, axis in around
            for count in WHOLE_TURNS
        ]
        path, at = _joined([*((place,) for place in places), *turns])
        here = planned.linearised([Visit(*place, POOL_DWELL_S, rate_dps) for place in path])
        count, behind = len(path), 3 * len(path)
        # Pieces are the rests, then what lies between two of them.
        between = np.searchsorted(here.turns.last[:count], here.turns.first[count:], side="right") - 1

        def moves(begin: int, end: int) -> NDArray[np.int_]:
            pieces = count + np.flatnonzero((between >= begin) & (between < end))
            return (behind + 3 * pieces[:, None] + np.arange(3)).ravel()

        rows, stops = [here.jacobian / here.bound[:, None]], []
        for (rest, end), turn in zip(at[len(places) :], turns, strict=True):
            own = np.append(3 * rest + np.arange(3), moves(rest, end))
            stops.append(Stop(tuple(Visit(*place, dwell_s, rate_dps) for place in turn), own))
        for (rest, _), place in zip(at, places, strict=False):
            for dwell in (factor * dwell_s for factor in LONG):
                own = np.append(3 * rest + np.arange(3), len(here.bound) + 3 * (len(rows) - 1) + np.arange(3))
                stops.append(Stop((Visit(*place, dwell, rate_dps),), own))
                rows.append(_longer(here, rest, behind, dwell))
        # Rests as short as those of the pool's own record are none of it.
        rows[0][behind : behind + 3 * count] = 0.0
        rows += [other.jacobian / other.bound[:, None] for other in others]
        return Pool(np.vstack(rows), tuple(stops))


def _joined(stops: Sequence[Sequence[tuple[float, float]]]) -> tuple[list[tuple[float, float]], list[tuple[int, int]]]:
    """Places one after the other, none right after itself; and at which of them each stop begins and ends."""
    path: list[tuple[float, float]] = []
    ends = []
    for stop in stops:
        if not path or path[-1] != stop[0]:
            path.append(stop[0])
        first = len(path) - 1
        path += stop[1:]
        ends.append((first, len(path) - 1))
    return path, ends


def _longer(here: WithTurns, rest: int, behind: int, dwell_s: float) -> NDArray[np.float64]:
    """The gyros' rows (3, P) over their bounds of a rest that lasts longer than in the pool's record."""
    turns, own = here.turns, behind + 3 * rest + np.arange(3)
    seconds = (turns.last[rest] - turns.first[rest]) * STEP_S
    longer = 1.0 + (dwell_s - POOL_DWELL_S) / seconds
    noise = turns.noise[rest]
    bound = here.bound[own] - noise + noise * np.sqrt(longer)
    return longer * here.jacobian[own] / bound[:, None]


def confined(rows: NDArray) -> tuple[NDArray, Polytope]:
    """Rows (M, P) over their bounds, and behind them what no parameter exceeds; the polytope that begins with those."""
    known = np.diag(1.0 / np.append(np.full(len(TARGETS), LARGEST), PLAUSIBLE))
    every = np.vstack([rows, known])
    return every, Polytope(every, np.ones(len(every)), np.arange(len(rows), len(every)))


class Search:
    """Which stops of a pool are taken, and the guaranteed errors with them, each by its programme."""

    def __init__(self, pool: Pool, targets: Sequence[Target], seconds: float):
        self._pool, self._targets, self._seconds = pool, targets, seconds
        self._rows, self._polytope = confined(pool.rows)
        self.taken: list[int] = []
        self._vertex = np.zeros((len(targets), self._rows.shape[1]))
        self._share = np.zeros((len(targets), len(self._rows)))
        self.error = np.zeros(len(targets))
        self._solve(range(len(targets)), every=True)
        self.best = self.error.copy()
        self._solve(range(len(targets)))

    def _solve(self, which: Sequence[int] | range | NDArray, *, every: bool = False) -> None:
        upper = np.full(len(self._rows), np.inf)
        upper[len(self._pool.rows) :] = 1.0
        for stop in range(len(self._pool.stops)) if every else self.taken:
            upper[self._pool.stops[stop].rows] = 1.0
        self._polytope.confine(-upper, upper)
        for k in which:
            self.error[k], self._vertex[k], duals = self._polytope.maximise(self._targets[k].weights)
            self._share[k] = np.abs(duals) / self.error[k]

    @property
    def ratio(self) -> NDArray[np.float64]:
        """Guaranteed errors (T,) over those of the whole pool."""
        return self.error / self.best

    def take(self, stop: int) -> None:
        """Take a stop, and solve what it changes."""
        self.taken.append(stop)
        rows = self._rows[self._pool.stops[stop].rows]
        self._solve(np.flatnonzero(np.abs(rows @ self._vertex.T).max(axis=0) > 1.0 + 1e-9))

    def drop(self, stop: int) -> None:
        """Leave a stop out again, and solve what made use of it."""
        self.taken.remove(stop)
        rows = self._pool.stops[stop].rows
        self._solve(np.flatnonzero(self._share[:, rows].sum(axis=1) > 0.0))

    def restore(self, taken: Sequence[int]) -> None:
        """Take just these stops."""
        self.taken = list(taken)
        self._solve(range(len(self._targets)))

    def fill(self) -> None:
        """Take for the worst target, as long as time lasts, the stop that its vertex contradicts most for its time."""
        open_targets = np.ones(len(self._targets), dtype=bool)
        short = np.zeros(len(self._pool.stops), dtype=bool)
        short[self.taken] = True
        while open_targets.any() and not short.all():
            worst = int(np.where(open_targets, self.ratio, 0.0).argmax())
            seen = np.abs(self._rows @ self._vertex[worst])
            gain = np.array([seen[stop.rows].max() for stop in self._pool.stops])
            worth = np.where(short, 0.0, np.log(np.maximum(gain, 1.0)) / self._costs**PATIENCE)
            if worth.max() <= 1e-9:
                open_targets[worst] = False
                continue
            stop = int(worth.argmax())
            if seconds_of(self.programme([*self.taken, stop])) > self._seconds:
                short[stop] = True
                continue
            self.take(stop)
            short[stop] = True
            open_targets[:] = True

    @cached_property
    def _costs(self) -> NDArray[np.float64]:
        """About how long (E,) each stop takes, with the way to it [s]."""
        return np.array([WAY_S + seconds_of(stop.visits) for stop in self._pool.stops])

    def exchange(self) -> bool:
        """Leave out what the worst ratio does without, and fill the time again; whether that made it less."""
        before, ratio = list(self.taken), float(self.ratio.max())
        use = (self.ratio[:, None] ** SHARP * self._share).sum(axis=0)
        for stop in sorted(before, key=lambda s: (round(float(use[self._pool.stops[s].rows].sum()), 9), s)):
            kept = list(self.taken), self.error.copy(), self._vertex.copy(), self._share.copy()
            self.drop(stop)
            if self.ratio.max() > ratio * (1.0 + SAME):
                self.taken, self.error, self._vertex, self._share = kept
        self.fill()
        if self.ratio.max() > ratio * (1.0 + SAME):
            self.restore(before)
            return False
        return True

    def programme(self, taken: Sequence[int]) -> list[Visit]:
        """The stops one after the other, each time the one that is nearest; rests at one place are one."""
        longest: dict[tuple[float, float], Visit] = {}
        turns: list[tuple[Visit, ...]] = []
        for visits in (self._pool.stops[stop].visits for stop in sorted(taken)):
            first, *more = visits
            here = first[:2]
            if more:
                turns.append(visits)
            elif here not in longest or longest[here].dwell_s < first.dwell_s:
                longest[here] = first
        joined = [_with_long(visits, longest) for visits in turns]
        left: list[tuple[Visit, ...]] = [*joined, *((visit,) for visit in longest.values())]
        path = list(left.pop(0))
        while left:
            at = path[-1]
            near = left.pop(min(range(len(left)), key=lambda k, at=at: (_way(at, left[k][0]), left[k])))
            path += near[1:] if near[0][:2] == at[:2] else near
        return path


def _way(one: Visit, other: Visit) -> float:
    """By how much the axis turns that turns most [deg]."""
    return max(abs(one.alpha_deg - other.alpha_deg), abs(one.beta_deg - other.beta_deg))


def _with_long(visits: tuple[Visit, ...], longest: dict[tuple[float, float], Visit]) -> tuple[Visit, ...]:
    """Turns whose first rest is the rest that is wanted at its place."""
    long = longest.pop(visits[0][:2], None)
    return visits if long is None else (long, *visits[1:])


def together(pool: Pool, here: WithTurns, targets: Sequence[Target]) -> NDArray[np.float64]:
    """What the pool and a programme's own moves guarantee (T,) all together."""
    rows, polytope = confined(np.vstack([pool.rows, here.jacobian / here.bound[:, None]]))
    polytope.confine(-np.ones(len(rows)), np.ones(len(rows)))
    return np.array([polytope.maximise(target.weights)[0] for target in targets])
