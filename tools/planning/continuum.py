"""Optimal plans over all angles: exchange of columns, then Newton's method on the support, then the proof.

Newton's method solves for the positions (α_i, β_i) with weight, their weights Φ_i and the dual y. They obey Σ Φ_i F_i =
a and s_i F_i'y = 1. At each position, F'y is stationary (inside the admissible set), or stationary along the boundary
and on it, or the position is a corner of the boundary. The system is square but singular where optima are not unique:
steps are the shortest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from .certificate import ColumnProgramme, Optimum, UndeterminedError, ceiling, quietest, settled_optimum
from .forms import INSIDE, Ridges, SignSheet, WholeGrid, clearance, dual_forms, regressors_at, value

FIRST_STEP_DEG = 3.0
SCAN_STEP_DEG = 4.0
CLIMB_ROUNDS, FINE_ROUNDS = 6, 13
"""Rounds of climbing: to about 2e-5 degrees for peaks, to rounding for peaks that become columns."""
REFINED = 4.0 * 8.0**-CLIMB_ROUNDS
TO_PROVE = (2e-11, 2e-11, 5e-11, 1e-10, 2e-10, 4e-10)
"""Limits of |F'y| − 1 to prove, tried in turn while violations are found and mended."""
SLIGHT = 1e-11
EXCHANGES = 60
LEVEL = 0.3
"""Fraction of the gap that the quietest dual may give away while columns are exchanged."""
GOOD_GAP = 1e-9
PLANS = 4
"""Number of plans of a larger gap after which the best of them is returned."""
CLOSE = 1e-3
"""Relative distance of a dual from the optimum below which the search covers positions that the scan may have
missed."""
NEAR = np.radians(8.0)
QUIET = ((0.05, SLIGHT), (1e-3, SLIGHT), (0.0, SLIGHT), (0.0, 1e-10), (0.0, 3e-10))
"""Margins below one far from the support, and allowed excess above one, of a dual; tried in turn."""
BOXES = 100_000
ATTEMPTS = 24
ON_BOUNDARY = 1e-5
"""Clearance [g] below which a peak counts as lying on the boundary."""
AT_KINK = 3e-4
"""|term| over its greatest coefficient below which the peak also counts as a corner."""
STEPS = 12
CONVERGED = 1e-12
NO_WEIGHT = 1e-8
"""Weight below which a position does not belong to the support."""


class Continuum:
    """The continuous admissible set and its columns so far, shared by all targets."""

    def __init__(self, sheets: Sequence[SignSheet]):
        self._sheets = sheets
        self._ridges = Ridges(sheets, INSIDE)
        angle = np.radians(np.arange(0.0, 360.0, FIRST_STEP_DEG))
        self._first, self._angle = WholeGrid(sheets, angle, np.arange(len(angle))), angle
        size = sheets[0].regressor.shape[0]
        self._columns = ColumnProgramme(size)
        self._place = np.zeros((0, 3))
        gram = np.zeros((size, size))
        for k, sheet in enumerate(sheets):
            i, j = np.repeat(angle[2::5], len(angle[3::5])), np.tile(angle[3::5], len(angle[2::5]))
            inside = np.flatnonzero(clearance(sheet, i, j) > 0.0)
            f = value(sheet.regressor, i[inside], j[inside])
            gram += f.T @ f / len(f)
            first = inside[::3]
            self._add(np.column_stack([np.full(len(first), k), i[first], j[first]]))
        self._metric = np.linalg.cholesky(gram)
        lines = np.radians(np.arange(0.0, 360.0, SCAN_STEP_DEG))
        cases = np.arange(2 * len(sheets))
        self._scan = self._ridges.arcs(np.repeat(cases // 2, len(lines)), np.tile(lines, len(cases)))
        self._sense = np.repeat(1.0 - 2.0 * (cases % 2), len(lines))

    def optimum(self, target: NDArray) -> Optimum:
        """Return the plan of least cost for a target a (P,), with the dual that proves it.

        Raises UndeterminedError if no positions can determine the target.
        """
        self._columns.aim(target)
        weights, cost = self._start()
        bound, proof = 0.0, np.zeros(len(target))
        before = 0.0
        plans: list[Optimum] = []
        dual = self._level_dual(target, cost, 0.9 * cost)
        for _ in range(EXCHANGES):
            peaks = self._peaks(dual)
            new = _above(peaks, 1.0 + SLIGHT)
            reached = float(target @ dual) / max(1.0, float(peaks[:, 4].max(initial=1.0)))
            if not len(new) and (reached > (1.0 - CLOSE) * cost or cost == before):
                # the scan may miss a position in a narrow tip of the set
                limit = 1.0 + max(GOOD_GAP, 0.1 * (1.0 - reached / cost))
                new = self._tops(dual, ceiling(self._sheets, dual, limit, max_boxes=BOXES).violations)
                bound, reached = (0.0, 0.0) if len(new) else (bound, reached)
            before = cost
            if reached > bound:
                bound, proof = reached, dual
            support = polish(self._guess(weights, dual, peaks), target, self._metric)
            if support is not None:
                proof_or_places = self._prove(support)
                if isinstance(proof_or_places, tuple):
                    plans.append(self._optimum(support, target, *proof_or_places))
                    if plans[-1].gap <= GOOD_GAP or len(plans) == PLANS:
                        return min(plans, key=lambda plan: plan.gap)
                    proof_or_places = np.zeros((0, 3))
                new = np.vstack([new, support.places, proof_or_places])
            self._add(new)
            weights, _, _ = self._columns.solve()
            cost = float(np.abs(weights).sum())
            dual = self._level_dual(target, cost, min(bound, cost))
        return min([*plans, self._unfinished(target, weights, proof)], key=lambda plan: plan.gap)

    def _tops(self, dual: NDArray, violations: NDArray) -> NDArray:
        """Return the local maxima (K, 3) to which violations (K, 4) belong."""
        sheet, sense, alpha = violations[:, 0].astype(int), violations[:, 1], violations[:, 2]
        if not len(sheet):
            return np.zeros((0, 3))
        forms, reach = dual_forms(self._sheets, dual), np.radians(SCAN_STEP_DEG)
        alpha, beta, _ = self._ridges.climb(forms, sheet, sense, alpha, reach, FINE_ROUNDS)
        return np.column_stack([sheet, alpha, beta])

    def _unfinished(self, target: NDArray, weights: NDArray, dual: NDArray) -> Optimum:
        """Return the plan of the columns, with the gap that can be proven."""
        used = np.flatnonzero(weights)
        sheet, alpha, beta = self._place[used].T
        inside, sense = np.full(len(used), -2), np.sign(weights[used])
        plan = Support(self._sheets, sheet.astype(int), sense, alpha, beta, inside, weights[used], dual)
        return self._optimum(plan, target, dual, self._provable(dual))

    def _provable(self, dual: NDArray) -> float:
        """Return a proven bound of |F'y|, from limits that rise until none is violated."""
        excess = 5e-10
        while len((bounded := ceiling(self._sheets, dual, 1.0 + excess, max_boxes=BOXES)).violations):
            excess *= 1.9
        return bounded.bound

    def _start(self) -> tuple[NDArray, float]:
        while True:
            weights, dual, possible = self._columns.solve()
            _, places = self._first.price(dual_forms(self._sheets, dual))
            if not len(places):
                break
            self._add(np.column_stack([places[:, 0], self._angle[places[:, 1]], self._angle[places[:, 2]]]))
        if not possible:
            raise UndeterminedError
        return weights, float(np.abs(weights).sum())

    def _add(self, places: NDArray) -> None:
        if len(places):
            self._columns.add(self._regressors(places))
            self._place = np.vstack([self._place, places])

    def _regressors(self, places: NDArray) -> NDArray:
        return regressors_at(self._sheets, *places.T)

    def _level_dual(self, target: NDArray, cost: float, bound: float) -> NDArray:
        """Return the quietest dual of the columns that gives away a part of the gap."""
        columns = self._columns.regressors
        slopes = np.vstack([columns, -columns, -target])
        most = np.append(np.ones(2 * len(columns)), -(cost - LEVEL * (cost - bound)))
        dual = quietest(self._metric, np.zeros((0, len(target))), np.zeros(0), slopes, most)
        return self._columns.solve()[1] if dual is None else dual

    def _peaks(self, dual: NDArray) -> NDArray:
        """Return local maxima (n, 5) of |F'y|: sheet, sense, α, β [rad] and value."""
        forms = dual_forms(self._sheets, dual)
        lines = self._ridges.heights(self._scan, forms, self._sense)[0].reshape(2 * len(self._sheets), -1)
        higher = (lines >= np.roll(lines, 1, axis=1)) & (lines >= np.roll(lines, -1, axis=1))
        at = np.flatnonzero((lines > 0.95) & higher)
        sheet, sense = self._scan.sheet[at], self._sense[at]
        reach = np.radians(SCAN_STEP_DEG)
        climb = self._ridges.climb
        alpha, beta, height = climb(forms, sheet, sense, self._scan.alpha[at], reach, CLIMB_ROUNDS)
        high, rounds = np.flatnonzero(height > 1.0 + SLIGHT), FINE_ROUNDS - CLIMB_ROUNDS
        finer = climb(forms, sheet[high], sense[high], alpha[high], reach * REFINED, rounds)
        alpha[high], beta[high], height[high] = finer
        return np.column_stack([sheet, sense, alpha, beta, height])

    def _guess(self, weights: NDArray, dual: NDArray, peaks: NDArray) -> "Support":
        """Return the support: the columns that carry weight, each at the nearest peak."""
        spots, total = peaks[:, :4], {}
        for column in np.flatnonzero(np.abs(weights) > 1e-7):
            (sheet, alpha, beta), weight = self._place[column], weights[column]
            sense = np.sign(weight)
            far = np.maximum(_apart(spots[:, 2], alpha), _apart(spots[:, 3], beta))
            far[(spots[:, 0] != sheet) | (spots[:, 1] != sense)] = np.inf
            if far.min(initial=np.inf) > NEAR:
                far = np.append(far, 0.0)
                spots = np.vstack([spots, (sheet, sense, alpha, beta)])
            nearest = int(far.argmin())
            total[nearest] = total.get(nearest, 0.0) + weight
        chosen = sorted(total)
        sheet, (sense, alpha, beta) = spots[chosen, 0].astype(int), spots[chosen, 1:].T
        corner = np.array([_kind_of_place(self._sheets[k], a, b) for k, a, b in zip(sheet, alpha, beta, strict=True)])
        weight = np.array([total[i] for i in chosen])
        return Support(self._sheets, sheet, sense, alpha, beta, corner, weight, dual)

    def _prove(self, support: "Support") -> tuple[NDArray, float] | NDArray:
        """Return a dual that touches ±1 on the support and exceeds it nowhere, with a proven bound of its |F'y|.

        If there is none, return the positions (K, 3) at which the tried duals exceed one.
        """
        rows, values = support.touching()
        places = self._place
        quiet, limits = iter(QUIET), iter(TO_PROVE)
        (below, slack), limit = next(quiet), next(limits)
        dual = support.dual
        for _ in range(ATTEMPTS):
            dual = None
            while dual is None:
                caps = 1.0 + slack - below * _distance(places, support)
                columns = self._columns.regressors
                if len(places) > len(columns):
                    columns = np.vstack([columns, self._regressors(places[len(columns) :])])
                slopes, most = np.vstack([columns, -columns]), np.concatenate([caps, caps])
                dual = quietest(self._metric, rows, values, slopes, most)
                if dual is None:
                    below, slack = next(quiet, (0.0, 0.0))
                    if slack == 0.0:
                        return places[len(self._place) :]
                    limit = max(limit, 1.5 * slack)
                    limits = iter([x for x in TO_PROVE if x > limit])
            more = _above(self._peaks(dual), 1.0 + limit)
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

    def _optimum(self, support: "Support", target: NDArray, dual: NDArray, bound: float) -> Optimum:
        accelerometer = np.array([self._sheets[k].accelerometer for k in support.sheet])
        alpha, beta = np.mod(support.alpha, 2 * np.pi), np.mod(support.beta, 2 * np.pi)
        places = accelerometer, alpha, beta, np.degrees(alpha), np.degrees(beta)
        return settled_optimum(target, dual, bound, support.regressors, support.weights, places)


def _above(peaks: NDArray, limit: float) -> NDArray:
    """Return sheet, α, β (K, 3) of the peaks that exceed the limit."""
    return peaks[peaks[:, 4] > limit][:, [0, 2, 3]]


def _apart(angle: NDArray, center: float | NDArray) -> NDArray:
    """Return the distance of angles round the circle [rad]."""
    return np.abs(np.angle(np.exp(1j * (angle - center))))


def _distance(places: NDArray, support: "Support") -> NDArray:
    """Return 0 at the support, 1 far from it, square in between; (M,) for places (M, 3)."""
    away = np.maximum(_apart(places[:, 1:2], support.alpha[None]), _apart(places[:, 2:3], support.beta[None]))
    away = np.where(places[:, :1] == support.sheet[None], away, np.inf).min(axis=1)
    return np.minimum(1.0, (away / 0.3) ** 2)


@dataclass(frozen=True)
class Support:
    """Positions with weights, and a dual that is ±1 and stationary there.

    Attributes
    ----------
    sheets : sequence of SignSheet
        the sheets of the block
    sheet : (n,) array of int
        index of each position's sheet
    sense : (n,) array
        sign s_i of the weight
    alpha, beta : (n,) array
        angles [rad]
    corner : (n,) array of int
        -2 inside, -1 on the boundary, else the term that vanishes too
    weights : (n,) array
        Φ
    dual : (P,) array
        y
    """

    sheets: Sequence[SignSheet]
    sheet: NDArray
    sense: NDArray
    alpha: NDArray
    beta: NDArray
    corner: NDArray
    weights: NDArray
    dual: NDArray

    @property
    def places(self) -> NDArray:
        """Sheet, α, β as (n, 3)."""
        return np.column_stack([self.sheet, self.alpha, self.beta])

    @property
    def at(self) -> list[tuple[SignSheet, float, float]]:
        """Sheet, α and β of each position."""
        return [(self.sheets[k], a, b) for k, a, b in zip(self.sheet, self.alpha, self.beta, strict=True)]

    @property
    def regressors(self) -> NDArray:
        """F (n, P)."""
        return regressors_at(self.sheets, self.sheet, self.alpha, self.beta)

    @property
    def term_signs(self) -> list[NDArray]:
        """Return the signs of each position's terms."""
        return [np.sign(value(sheet.terms, a, b)) for sheet, a, b in self.at]

    def chosen(self, rows: NDArray) -> "Support":
        """Return the support of the chosen positions."""
        names = ("sheet", "sense", "alpha", "beta", "corner", "weights")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def touching(self) -> tuple[NDArray, NDArray]:
        """Return the equations of every optimal dual: rows (K, P), values (K,) for touching ±1 and being stationary."""
        rows, values = [], []
        for i, (signs, (sheet, alpha, beta)) in enumerate(zip(self.term_signs, self.at, strict=True)):
            jet = _jet(sheet.regressor, alpha, beta)
            rows.append(jet[0])
            values.append(self.sense[i])
            for _, by_dual, _ in _conditions(sheet, int(self.corner[i]), signs, (alpha, beta), jet, self.dual):
                if by_dual.any():
                    rows.append(by_dual)
                    values.append(0.0)
        return np.array(rows), np.array(values)


def _kind_of_place(sheet: SignSheet, alpha: float, beta: float) -> int:
    """Return -2 inside the set, -1 on its boundary, else the index of the term whose kink makes a corner there."""
    if float(clearance(sheet, alpha, beta)) > ON_BOUNDARY:
        return -2
    terms = np.abs(value(sheet.terms, alpha, beta)) / np.abs(sheet.terms).max(axis=(1, 2))
    return int(terms.argmin()) if len(terms) and terms.min() < AT_KINK else -1


def polish(start: Support, target: NDArray, metric: NDArray) -> Support | None:
    """Return the optimum near an approximate support; None if Newton's method does not converge to one.

    Positions whose weight turns out zero or of the wrong sign are dropped. The size of a dual is |L'y| with the metric
    L (P, P).
    """
    before = start
    for _ in range(2 * len(start.sheet) + 2):
        after = _newton(before, target, metric) if len(before.sheet) else None
        if after is None:
            return None
        crossed = _crossed(before, after)
        if (crossed != before.corner).any():
            before = replace(before, corner=crossed)
            continue
        weights = after.weights * after.sense
        if weights.min() >= NO_WEIGHT:
            return after if min(float(clearance(*at)) for at in after.at) > 0.0 else None
        if weights.min() >= 0.0:
            before = after.chosen(weights >= NO_WEIGHT)
            continue
        fitted, misfit = scipy.optimize.nnls((after.regressors * after.sense[:, None]).T, target)
        if misfit > CONVERGED:
            before = after.chosen(np.arange(len(weights)) != weights.argmin())
        else:
            before = replace(after, weights=fitted * after.sense).chosen(fitted > NO_WEIGHT)
    return None


def _crossed(before: Support, after: Support) -> NDArray:
    """Return the kinds of place, with a corner wherever Newton's method left a smooth boundary across a kink."""
    corner = before.corner.copy()
    for i in np.flatnonzero(corner == -1):
        terms = (value(before.sheets[s.sheet[i]].terms, s.alpha[i], s.beta[i]) for s in (before, after))
        over = np.flatnonzero(np.multiply(*terms) < 0.0)
        if len(over):
            corner[i] = over[0]
    return corner


def _newton(start: Support, target: NDArray, metric: NDArray) -> Support | None:
    size, count = len(target), len(start.sheet)
    alpha, beta = start.alpha.copy(), start.beta.copy()
    weights, scaled = start.weights.copy(), metric.T @ start.dual
    inverse = np.linalg.inv(metric)
    signs = start.term_signs
    for step in range(STEPS):
        dual = inverse.T @ scaled
        residual = np.zeros(size + 3 * count)
        matrix = np.zeros((size + 3 * count, size + 3 * count))
        residual[:size] = -target
        for i in range(count):
            sheet, sense = start.sheets[start.sheet[i]], start.sense[i]
            jet = _jet(sheet.regressor, alpha[i], beta[i])
            column = size + 3 * i
            residual[:size] += weights[i] * jet[0]
            matrix[:size, column : column + 3] = np.stack([jet[0], weights[i] * jet[1], weights[i] * jet[2]], axis=1)
            touch = (sense * (dual @ jet[0]) - 1.0, sense * jet[0], sense * (jet[1:3] @ dual))
            conditions = _conditions(sheet, int(start.corner[i]), signs[i], (alpha[i], beta[i]), jet, dual)
            for row, (amount, by_dual, by_position) in enumerate((touch, *conditions), start=column):
                residual[row] = amount
                matrix[row, :size] = inverse @ by_dual
                matrix[row, column + 1 : column + 3] = by_position
        if np.abs(residual).max() < CONVERGED and step:
            return replace(start, alpha=alpha, beta=beta, weights=weights, dual=dual)
        change = np.linalg.lstsq(matrix, -residual, rcond=1e-11)[0]
        if not np.isfinite(change).all() or np.abs(change).max() > 2.0 * (1.0 + np.abs(scaled).max()):
            return None
        scaled = scaled + change[:size]
        moves = change[size:].reshape(-1, 3)
        weights, alpha, beta = weights + moves[:, 0], alpha + moves[:, 1], beta + moves[:, 2]
    return None


def _jet(forms: NDArray, alpha: float, beta: float) -> NDArray:
    """Return values and derivatives (6, K) of forms (K, 3, 3): 1, α, β, αα, αβ, ββ."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    a = np.array([[ca, sa, 1.0], [-sa, ca, 0.0], [-ca, -sa, 0.0]])
    b = np.array([[cb, sb, 1.0], [-sb, cb, 0.0], [-cb, -sb, 0.0]])
    order = ([0, 1, 0, 2, 1, 0], [0, 0, 1, 0, 1, 2])
    return np.einsum("kij,mi,mj->mk", forms, a[order[0]], b[order[1]])


def _conditions(
    sheet: SignSheet, corner: int, signs: NDArray, place: tuple[float, float], jet: NDArray, dual: NDArray
) -> tuple[tuple[float, NDArray, NDArray], ...]:
    """Return two conditions on a position, each (amount, derivative by y (P,), derivatives by α and β (2,))."""
    f = jet @ dual
    nothing = np.zeros(len(dual))
    if corner == -2:
        return (f[1], jet[1], f[[3, 4]]), (f[2], jet[2], f[[4, 5]])
    c = _jet(sheet.base[None], *place)[:, 0]
    terms = _jet(sheet.terms, *place)
    for k, sign in enumerate(signs):
        if k != corner:
            c = c - sign * terms[:, k]
    edge = (c[0] - 2.0 * INSIDE, nothing, c[1:3])
    if corner >= 0:
        return edge, (terms[0, corner], nothing, terms[1:3, corner])
    turn = f[1] * c[2] - f[2] * c[1]
    by_position = np.array(
        [
            f[3] * c[2] + f[1] * c[4] - f[4] * c[1] - f[2] * c[3],
            f[4] * c[2] + f[1] * c[5] - f[5] * c[1] - f[2] * c[4],
        ]
    )
    return edge, (turn, jet[1] * c[2] - jet[2] * c[1], by_position)
