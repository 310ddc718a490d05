"""Optimal plans over all angles: exchange of columns, then Newton's method on the support, then the proof."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .certificate import ceiling
from .duals import quietest
from .forms import Sheet, clearance, dual_forms, value
from .grids import Lines
from .master import Master
from .optimum import Optimum, UndeterminedError, settled
from .ridges import INSIDE, arcs_at, climb, heights, local_maxima, stack
from .support import Support, kind_of_place, polish, touching

FIRST_STEP_DEG = 3.0
SCAN_STEP_DEG = 4.0
CLIMB_ROUNDS, FINE_ROUNDS = 6, 13
"""Peaks are followed to about 2e-5 degrees, those that become columns to rounding."""
REFINED = 4.0 * 8.0**-CLIMB_ROUNDS
TO_PROVE = (2e-11, 2e-11, 5e-11, 1e-10, 2e-10, 4e-10)
"""By how much |F'y| is proven not to exceed one: tried in turn, while violations are found and mended."""
SLIGHT = 1e-11
EXCHANGES = 60
LEVEL = 0.3
"""How much of the gap the quietest dual may give away while columns are exchanged."""
GOOD_GAP = 1e-9
PLANS = 4
"""Plans of a larger gap are kept, and other duals tried, so many times."""
CLOSE = 1e-3
"""How near the optimum a dual must be for the search of all positions that the scan may have missed."""
NEAR = np.radians(8.0)
QUIET = ((0.05, SLIGHT), (1e-3, SLIGHT), (0.0, SLIGHT), (0.0, 1e-10), (0.0, 3e-10))
"""How far below one a dual is asked to stay, far from the support, and how far above it may rise; tried in turn."""
BOXES = 100_000
ATTEMPTS = 24


@dataclass(frozen=True)
class Peaks:
    """Local maxima of |F'y|: sheet, sense, angles [rad] and value, (n,) each."""

    sheet: NDArray
    sense: NDArray
    alpha: NDArray
    beta: NDArray
    height: NDArray

    def above(self, limit: float) -> "Peaks":
        """Those that exceed the limit."""
        kept = self.height > limit
        return Peaks(self.sheet[kept], self.sense[kept], self.alpha[kept], self.beta[kept], self.height[kept])

    @property
    def places(self) -> NDArray:
        """Sheet, α, β as (n, 3)."""
        return np.column_stack([self.sheet, self.alpha, self.beta])


class Continuum:
    """The continuous admissible set and the columns found on it so far, shared by all targets.

    Parameters
    ----------
    sheets : sequence of Sheet
    """

    def __init__(self, sheets: Sequence[Sheet]):
        self._sheets = sheets
        self._inner = stack(sheets, INSIDE)
        angle = np.radians(np.arange(0.0, 360.0, FIRST_STEP_DEG))
        self._first, self._angle = Lines(sheets, angle, np.arange(len(angle))), angle
        size = sheets[0].regressor.shape[0]
        self._master = Master(size)
        self._place = np.zeros((0, 3))
        gram = np.zeros((size, size))
        for k, sheet in enumerate(sheets):
            i, j = (g.ravel() for g in np.meshgrid(angle[2::5], angle[3::5], indexing="ij"))
            inside = clearance(sheet, i, j) > 0.0
            f = value(sheet.regressor, i[inside], j[inside])
            gram += f.T @ f / len(f)
            some = np.flatnonzero(inside)[::3]
            self._add(np.column_stack([np.full(len(some), k), i[some], j[some]]))
        self._metric = np.linalg.cholesky(gram)
        lines = np.radians(np.arange(0.0, 360.0, SCAN_STEP_DEG))
        cases = np.arange(2 * len(sheets))
        self._scan = arcs_at(self._inner, np.repeat(cases // 2, len(lines)), np.tile(lines, len(cases)))
        self._sense = np.repeat(1.0 - 2.0 * (cases % 2), len(lines))

    def optimum(self, target: NDArray) -> Optimum:
        """The plan of least cost for a target a (P,), with the dual that proves it.

        Raises
        ------
        UndeterminedError
            when no positions can determine the target
        """
        self._master.aim(target)
        weights, cost = self._start()
        bound, proof = 0.0, np.zeros(len(target))
        before = 0.0
        plans: list[Optimum] = []
        dual = self._level_dual(target, cost, 0.9 * cost)
        for _ in range(EXCHANGES):
            peaks = self._peaks(dual)
            new = peaks.above(1.0 + SLIGHT).places
            reached = float(target @ dual) / max(1.0, float(peaks.height.max(initial=1.0)))
            if not len(new) and (reached > (1.0 - CLOSE) * cost or cost == before):
                new = self._overlooked(dual, 1.0 + max(GOOD_GAP, 0.1 * (1.0 - reached / cost)))
                bound, reached = (0.0, 0.0) if len(new) else (bound, reached)
            before = cost
            if reached > bound:
                bound, proof = reached, dual
            found = polish(self._sheets, target, self._metric, self._guess(weights, dual, peaks))
            if found is not None:
                proven = self._prove(found)
                if isinstance(proven, tuple):
                    plans.append(self._optimum(found, target, *proven))
                    if plans[-1].gap <= GOOD_GAP or len(plans) == PLANS:
                        return min(plans, key=lambda plan: plan.gap)
                    proven = np.zeros((0, 3))
                new = np.vstack([new, found.places, proven])
            self._add(new)
            weights, _, _ = self._master.solve()
            cost = float(np.abs(weights).sum())
            dual = self._level_dual(target, cost, min(bound, cost))
        return min([*plans, self._unfinished(target, weights, proof)], key=lambda plan: plan.gap)

    def _overlooked(self, dual: NDArray, limit: float) -> NDArray:
        """Positions (K, 3) where |F'y| exceeds the limit and that the scan missed, in a narrow tip of the set."""
        return self._tops(dual, ceiling(self._sheets, dual, limit, max_boxes=BOXES).violations)

    def _tops(self, dual: NDArray, violations: NDArray) -> NDArray:
        """The local maxima (K, 3) to which violations (K, 4) belong."""
        sheet, sense, alpha = violations[:, 0].astype(int), violations[:, 1], violations[:, 2]
        if not len(sheet):
            return np.zeros((0, 3))
        forms, reach = dual_forms(self._sheets, dual), np.radians(SCAN_STEP_DEG)
        alpha, beta, _ = climb(self._inner, forms, sheet, sense, alpha, reach, FINE_ROUNDS)
        return np.column_stack([sheet, alpha, beta])

    def _unfinished(self, target: NDArray, weights: NDArray, dual: NDArray) -> Optimum:
        """The plan that the columns give, with the gap that can be proven."""
        used = np.flatnonzero(weights)
        sheet, alpha, beta = self._place[used].T
        inside = np.full(len(used), -2)
        plan = Support(sheet.astype(int), np.sign(weights[used]), alpha, beta, inside, weights[used], dual)
        return self._optimum(plan, target, dual, self._provable(dual))

    def _provable(self, dual: NDArray) -> float:
        """What |F'y| is proven not to exceed, by limits that rise until none is violated."""
        excess = 5e-10
        while len((bounded := ceiling(self._sheets, dual, 1.0 + excess, max_boxes=BOXES)).violations):
            excess *= 1.9
        return bounded.bound

    def _start(self) -> tuple[NDArray, float]:
        while True:
            weights, dual, possible = self._master.solve()
            _, places = self._first.price(dual_forms(self._sheets, dual))
            if not len(places):
                break
            self._add(np.column_stack([places[:, 0], self._angle[places[:, 1]], self._angle[places[:, 2]]]))
        if not possible:
            raise UndeterminedError
        return weights, float(np.abs(weights).sum())

    def _add(self, places: NDArray) -> None:
        if len(places):
            self._master.add(self._columns(places))
            self._place = np.vstack([self._place, places])

    def _columns(self, places: NDArray) -> NDArray:
        return np.array([value(self._sheets[int(k)].regressor, a, b) for k, a, b in places])

    def _level_dual(self, target: NDArray, cost: float, bound: float) -> NDArray:
        """The quietest dual of the columns that gives away part of what is still open."""
        columns = self._master.regressors
        slopes = np.vstack([columns, -columns, -target])
        most = np.append(np.ones(2 * len(columns)), -(cost - LEVEL * (cost - bound)))
        dual = quietest(self._metric, np.zeros((0, len(target))), np.zeros(0), slopes, most)
        return self._master.solve()[1] if dual is None else dual

    def _peaks(self, dual: NDArray) -> Peaks:
        forms = dual_forms(self._sheets, dual)
        height, _ = heights(self._inner, self._scan, forms, self._sense)
        lines = height.reshape(2 * len(self._sheets), -1)
        case, line = local_maxima(lines, 0.95).T
        at = case * lines.shape[1] + line
        sheet, sense = self._scan.sheet[at], self._sense[at]
        reach = np.radians(SCAN_STEP_DEG)
        alpha, beta, height = climb(self._inner, forms, sheet, sense, self._scan.alpha[at], reach, CLIMB_ROUNDS)
        high = np.flatnonzero(height > 1.0 + SLIGHT)
        reach *= REFINED
        alpha[high], beta[high], height[high] = climb(
            self._inner, forms, sheet[high], sense[high], alpha[high], reach, FINE_ROUNDS - CLIMB_ROUNDS
        )
        return Peaks(sheet, sense, alpha, beta, height)

    def _guess(self, weights: NDArray, dual: NDArray, peaks: Peaks) -> Support:
        """The support: the columns that carry weight, each at the nearest peak."""
        places = [list(x) for x in (peaks.sheet, peaks.sense, peaks.alpha, peaks.beta)]
        total: dict[int, float] = {}
        for column in np.flatnonzero(np.abs(weights) > 1e-7):
            (sheet, alpha, beta), weight = self._place[column], weights[column]
            sense = np.sign(weight)
            far = np.maximum(_apart(np.array(places[2]), alpha), _apart(np.array(places[3]), beta))
            far[(np.array(places[0]) != sheet) | (np.array(places[1]) != sense)] = np.inf
            nearest = int(far.argmin()) if len(far) else -1
            if nearest < 0 or far[nearest] > NEAR:
                for list_, item in zip(places, (int(sheet), sense, alpha, beta), strict=True):
                    list_.append(item)
                nearest = len(places[0]) - 1
            total[nearest] = total.get(nearest, 0.0) + weight
        chosen = sorted(total)
        sheet = np.array([places[0][i] for i in chosen], dtype=int)
        sense, alpha, beta = (np.array([places[k][i] for i in chosen]) for k in (1, 2, 3))
        corner = np.array([kind_of_place(self._sheets[k], a, b) for k, a, b in zip(sheet, alpha, beta, strict=True)])
        return Support(sheet, sense, alpha, beta, corner, np.array([total[i] for i in chosen]), dual)

    def _prove(self, found: Support) -> tuple[NDArray, float] | NDArray:
        """A dual that touches ±1 on the support and exceeds it nowhere, with what is proven of its |F'y|.

        Without one, the positions (K, 3) at which the duals that were tried exceed one.
        """
        rows, values = touching(self._sheets, found)
        places = self._place
        quiet, limits = iter(QUIET), iter(TO_PROVE)
        (below, slack), limit = next(quiet), next(limits)
        dual = found.dual
        for _ in range(ATTEMPTS):
            dual = None
            while dual is None:
                caps = 1.0 + slack - below * _distance(places, found)
                columns = self._columns_of(places)
                slopes, most = np.vstack([columns, -columns]), np.concatenate([caps, caps])
                dual = quietest(self._metric, rows, values, slopes, most)
                if dual is None:
                    below, slack = next(quiet, (0.0, 0.0))
                    if slack == 0.0:
                        return places[len(self._place) :]
                    limit = max(limit, 1.5 * slack)
                    limits = iter([x for x in TO_PROVE if x > limit])
            peaks = self._peaks(dual).above(1.0 + limit)
            more = peaks.places
            if not len(more):
                bounded = ceiling(self._sheets, dual, 1.0 + limit, max_boxes=BOXES)
                if not len(bounded.violations):
                    return dual, bounded.bound
                limit = next(limits, 0.0)
                if limit == 0.0:
                    break
                more = self._tops(dual, bounded.violations)
            places = np.vstack([places, more])
        return dual, self._provable(dual)

    def _columns_of(self, places: NDArray) -> NDArray:
        own = len(self._master.regressors)
        extra = self._columns(places[own:])
        return np.vstack([self._master.regressors, extra]) if len(extra) else self._master.regressors

    def _optimum(self, found: Support, target: NDArray, dual: NDArray, bound: float) -> Optimum:
        accelerometer = np.array([self._sheets[k].accelerometer for k in found.sheet])
        alpha, beta = np.mod(found.alpha, 2 * np.pi), np.mod(found.beta, 2 * np.pi)
        places = accelerometer, alpha, beta, np.degrees(alpha), np.degrees(beta)
        return settled(target, dual, bound, self._columns(found.places), found.weights, places)


def _apart(one: NDArray, other: float | NDArray) -> NDArray:
    """Distance of angles [rad], round the circle."""
    return np.abs(np.angle(np.exp(1j * (one - other))))


def _distance(places: NDArray, found: Support) -> NDArray:
    """0 at the support, 1 far from it, square in between; (M,) for places (M, 3)."""
    away = np.maximum(_apart(places[:, 1:2], found.alpha[None]), _apart(places[:, 2:3], found.beta[None]))
    away = np.where(places[:, :1] == found.sheet[None], away, np.inf).min(axis=1)
    return np.minimum(1.0, (away / 0.3) ** 2)
