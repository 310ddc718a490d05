"""Programme and proof of an optimal plan: columns of readings, a dual vector, a bound of |F'y| over all positions.

A dual y with |F'y| ≤ 1 on all readings proves that every estimator costs at least a'y. The quietest of the suitable
duals has the least mean square of |F'y|. A vertex of the dual programme touches ±1 at many positions and exceeds it
beside them; the quietest dual touches only where it must.

The bound is branch and bound over boxes in (α, β). On a box, let f = ±F'y and the set be {c ≥ 0}. Freezing the signs of
the absolute values in c gives functions c_i ≥ c, so f ≤ h = f + λ₁c₁ + λ₂c₂ on the set for any λ ≥ 0. With λ that
cancel the gradient, h is bounded by its quadratic expansion about the centre plus a bound of the third-order remainder.
Every bound is raised by more than the largest rounding error of its evaluation: it is proven, not estimated.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import highspy
import numpy as np
import scipy
from numpy.typing import NDArray

from ..bounded.programmes import OTHER_STRATEGIES, solved, solver
from .forms import MOST_TERMS, ROUNDING, SignSheet, dual_forms, padded_terms

ARTIFICIAL_COST = 1e4
"""Cost of an artificial column [σ]: a plan that costs more is of no use."""
NO_WEIGHT = 1e-9
"""Largest weight that counts as zero: the solver's tolerance."""
RANK = 1e-9
DEAF = 1e-6
"""Smallest freedom for which an inequality is kept beside the equations, unless it is violated by as much."""
FIRST_BOXES = 16
MAX_BOXES = 400_000


def _flips() -> NDArray:
    flipped = np.eye(MOST_TERMS, dtype=bool)
    unchanged = np.zeros(MOST_TERMS, dtype=bool)
    pairs = list(combinations(flipped, 2))
    ways = [(unchanged, term) for term in flipped]
    ways += [(unchanged, first | second) for first, second in pairs]
    return np.array(ways + pairs)


FLIPS = _flips()
"""Absolute values whose sign is reversed in c_1 and in c_2 (25, 2, 5), relative to the box's centre."""
FEW_BOXES = 200
"""Number of boxes below which each is divided twice before evaluation, whose cost hardly depends on the number."""
SMALLEST = 1e-9
"""Half-width [rad] below which a box is not divided."""


class UndeterminedError(ArithmeticError):
    """The allowed positions cannot determine the target."""


@dataclass(frozen=True)
class Optimum:
    """The readings that estimate one target at least cost, and a bound of every other estimator's cost.

    Attributes
    ----------
    accelerometer : (n,) array of int
        accelerometer, from 0
    alpha, beta : (n,) array
        angles [rad]
    weights : (n,) array
        Φ
    dual : (P,) array
        y
    lower_bound : float
        proven: no plan costs less [σ]
    alpha_deg, beta_deg : (n,) array
        the same angles in degrees, as the grid has them
    """

    accelerometer: NDArray
    alpha: NDArray
    beta: NDArray
    weights: NDArray
    dual: NDArray
    lower_bound: float
    alpha_deg: NDArray
    beta_deg: NDArray

    @property
    def cost(self) -> float:
        """Guaranteed error Σ|Φ| [σ]."""
        return float(np.abs(self.weights).sum())

    @property
    def gap(self) -> float:
        """Return (cost − lower bound) / cost: the largest possible gain of another plan."""
        return max(self.cost - self.lower_bound, 0.0) / self.cost

    def times(self, factor: float) -> "Optimum":
        """Return the optimum of the target times a positive factor."""
        return replace(self, weights=factor * self.weights, lower_bound=factor * self.lower_bound * (1.0 - 1e-15))


def scaled_optimum(optimum: Callable[[NDArray], Optimum], target: NDArray) -> Optimum:
    """Return the optimum for a target a (P,) of any size; `optimum` solves the target of size 1."""
    size = float(np.abs(target).max())
    return optimum(target / size).times(size)


def settled_optimum(
    target: NDArray, dual: NDArray, ceiling: float, regressors: NDArray, near: NDArray, places: tuple[NDArray, ...]
) -> Optimum:
    """Return an optimum from a solver's weights, made unbiased to rounding and without readings of zero weight.

    Parameters
    ----------
    target, dual : (P,) array
        a, y
    ceiling : float
        proven bound of |F'y|
    regressors, near : (n, P), (n,) array
        F of the readings, independent, and their approximate weights
    places : accelerometer, alpha, beta, alpha_deg, beta_deg
        places of the readings, (n,) each
    """
    used = np.abs(near) > NO_WEIGHT
    if used.any() and np.linalg.lstsq(regressors[used].T, target, rcond=1e-12)[1].sum() > NO_WEIGHT**2:
        used = near != 0.0
    weights, columns = near[used], regressors[used]
    for _ in range(2):
        weights = weights + np.linalg.lstsq(columns.T, target - columns.T @ weights, rcond=1e-12)[0]
    accelerometer, alpha, beta, alpha_deg, beta_deg = places
    order = np.lexsort((beta_deg[used], alpha_deg[used], accelerometer[used]))
    rows = np.flatnonzero(used)[order]
    return Optimum(
        accelerometer[rows],
        alpha[rows],
        beta[rows],
        weights[order],
        dual,
        lower_bound(target, dual, ceiling),
        alpha_deg[rows],
        beta_deg[rows],
    )


def lower_bound(target: NDArray, dual: NDArray, ceiling: float) -> float:
    """Return the least cost of any plan from a dual y with |F'y| ≤ ceiling: a'y / ceiling, rounded down."""
    rounding = 4 * len(dual) * np.finfo(float).eps * float(np.abs(target) @ np.abs(dual))
    return (float(target @ dual) - rounding) / (max(ceiling, 1.0) * (1.0 + 1e-15))


def quietest(metric: NDArray, rows: NDArray, values: NDArray, slopes: NDArray, most: NDArray) -> NDArray | None:
    """Return y (P,) of least |L'y| with rows (K, P)·y = values and slopes (M, P)·y ≤ most; None if there is none.

    Least distance programming in the null space of the equations (Lawson and Hanson 1974, chapter 23); the metric L (P,
    P) is lower triangular.
    """
    inverse = np.linalg.inv(metric)
    base, free = np.zeros(len(metric)), np.eye(len(metric))
    if len(rows):
        left, singular, right = np.linalg.svd(rows @ inverse.T, full_matrices=True)
        rank = int((singular > RANK * singular[0]).sum())
        base = right[:rank].T @ ((left.T @ values)[:rank] / singular[:rank])
        free = right[rank:].T
    scaled = slopes @ inverse.T
    excess = scaled @ base - most
    if (excess <= 0.0).all():
        return inverse.T @ base
    moves = scaled @ free
    size = np.linalg.norm(moves, axis=1)
    free_enough = size > DEAF
    if (excess[~free_enough] > DEAF).any() or not free_enough.any():
        return None
    stacked = np.vstack([-moves[free_enough].T, excess[free_enough]]) / size[free_enough]
    aim = np.zeros(len(stacked))
    aim[-1] = 1.0
    try:
        weights, _ = scipy.optimize.nnls(stacked, aim, maxiter=50 * len(stacked))
    except RuntimeError:
        return None
    rest = stacked @ weights - aim
    if -rest[-1] < RANK:
        return None
    return inverse.T @ (base - free @ (rest[:-1] / rest[-1]))


@dataclass(frozen=True)
class Ceiling:
    """A proven bound of |F'y| over the admissible set.

    Attributes
    ----------
    bound : float
        proven: |F'y| is nowhere greater
    violations : (K, 4) array
        places where |F'y| exceeds the limit: sheet, sense (±1), α, β [rad], worst first; empty if the limit is proven
    """

    bound: float
    violations: NDArray


def ceiling(sheets: Sequence[SignSheet], dual: NDArray, limit: float, *, max_boxes: int = MAX_BOXES) -> Ceiling:
    """Bound |F'y| on the admissible set for a dual y (P,), if possible by `limit`.

    The search ends when the limit is proven, when a position violates it, or after `max_boxes` boxes with the bound so
    far.
    """
    forms, third, size = _forms(sheets, dual)
    width = float(np.pi) / FIRST_BOXES
    centres = width * (2 * np.arange(FIRST_BOXES) + 1)
    case = np.repeat(np.arange(len(forms)), FIRST_BOXES**2)
    alpha = np.tile(np.repeat(centres, FIRST_BOXES), len(forms))
    beta = np.tile(centres, FIRST_BOXES * len(forms))
    half = np.full((2, len(case)), width)
    examined, bound = 0, limit
    while len(case):
        examined += len(case)
        values = _expand(forms, case, alpha, beta)
        radius = half * (1.0 + 1e-12) + 1e-15
        inside = values[:, 0, 1] - np.abs(values[:, 0, 2:]).sum(axis=1) >= 0.0
        violated = np.flatnonzero(inside & (values[:, 0, 0] > limit))
        if len(violated):
            violated = violated[np.argsort(-values[violated, 0, 0], kind="stable")]
            _, first = np.unique(case[violated], return_index=True)
            worst = violated[np.sort(first)]
            where = np.column_stack([case[worst] // 2, 1 - 2 * (case[worst] % 2), alpha[worst], beta[worst]])
            return Ceiling(np.inf, where)
        upper, share = _upper(values, third[case], size[case], radius, limit)
        keep = upper > limit
        final = keep & (half.max(axis=0) < SMALLEST)
        if examined + 2 * keep.sum() > max_boxes:
            final = keep
        if final.any():
            bound = max(bound, float(upper[final].max()))
            keep &= ~final
        case, alpha, beta, half, share = case[keep], alpha[keep], beta[keep], half[:, keep], share[:, keep]
        for _ in range(2 if len(case) < FEW_BOXES else 1):
            along = (share[1] > share[0]).astype(int)
            half[along, np.arange(len(case))] *= 0.5
            share[along, np.arange(len(case))] *= 0.5
            step = np.where(along == 0, half[0], 0.0), np.where(along == 1, half[1], 0.0)
            case, half, share = np.tile(case, 2), np.tile(half, 2), np.tile(share, 2)
            alpha = np.concatenate([alpha - step[0], alpha + step[0]])
            beta = np.concatenate([beta - step[1], beta + step[1]])
    return Ceiling(bound, np.zeros((0, 4)))


def _forms(sheets: Sequence[SignSheet], dual: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return forms (2S, 7, 3, 3): ±F'y, base and terms; bounds (2S, 7, 3) of their third derivatives, sizes (2S, 7)."""
    forms = np.zeros((2 * len(sheets), 2 + MOST_TERMS, 3, 3))
    forms[::2, 0] = dual_forms(sheets, dual)
    forms[::2, 1] = [sheet.base for sheet in sheets]
    forms[::2, 2:] = padded_terms(sheets)
    forms[1::2] = forms[::2]
    forms[1::2, 0] *= -1.0
    mixed = np.linalg.norm(forms[..., :2, :2], 2, axis=(-2, -1))
    along_a = mixed + np.linalg.norm(forms[..., :2, 2], axis=-1)
    along_b = mixed + np.linalg.norm(forms[..., 2, :2], axis=-1)
    return forms, np.stack([along_a, mixed, along_b], axis=-1) * (1 + 1e-12), np.abs(forms).sum(axis=(-2, -1))


def _expand(forms: NDArray, case: NDArray, alpha: NDArray, beta: NDArray) -> NDArray:
    """Return values and derivatives (N, 6, 7) of the forms at centres: 1, α, β, αα, αβ, ββ."""
    a, b = _jets(alpha)[:, [0, 1, 0, 2, 1, 0]], _jets(beta)[:, [0, 0, 1, 0, 1, 2]]
    monomials = (a[..., :, None] * b[..., None, :]).reshape(len(alpha), 6, 9)
    values = np.empty((len(alpha), 6, forms.shape[1]))
    for k in np.unique(case):
        rows = case == k
        values[rows] = monomials[rows] @ forms[k].reshape(-1, 9).T
    return values


def _jets(angle: NDArray) -> NDArray:
    """Return (cos, sin, 1) of angles (N,) and its first two derivatives (N, 3, 3)."""
    jets = np.zeros((len(angle), 3, 3))
    c, s = np.cos(angle), np.sin(angle)
    jets[:, 0, 0], jets[:, 0, 1], jets[:, 0, 2] = c, s, 1.0
    jets[:, 1, 0], jets[:, 1, 1] = -s, c
    jets[:, 2, 0], jets[:, 2, 1] = -c, -s
    return jets


def _upper(values: NDArray, third: NDArray, size: NDArray, radius: NDArray, limit: float) -> tuple[NDArray, NDArray]:
    """Return upper bounds (N,) of f on the boxes, -inf for a box outside the set; and each direction's share (2, N)."""
    cubic = np.stack([radius[0] ** 3, 3 * radius[0] * radius[1] * radius.sum(axis=0), radius[1] ** 3]) / 6.0
    remainder = np.einsum("nft,tn->nf", third, cubic)
    f = values[:, :, 0]
    upper = _quadratic_maximum(f, radius) + remainder[:, 0] + ROUNDING * size[:, 0]
    side = np.where(values[:, 0, 2:] < 0.0, -1.0, 1.0)
    pattern = values[:, :, 1] - np.einsum("nkt,nt->nk", values[:, :, 2:], side)
    of_c = remainder[:, 1:].sum(axis=1) + ROUNDING * size[:, 1:].sum(axis=1)
    of_f = remainder[:, 0] + ROUNDING * size[:, 0]
    best = f.copy()

    def improve(rows: NDArray, h: NDArray, weight: NDArray) -> None:
        bound = _quadratic_maximum(h, radius[:, rows]) + of_f[rows] + weight * of_c[rows]
        order = np.lexsort((bound, rows))
        least = order[np.flatnonzero(np.diff(rows[order], prepend=-1))]
        least = least[bound[least] < upper[rows[least]]]
        upper[rows[least]] = bound[least]
        best[rows[least]] = h[least]

    outside = _quadratic_maximum(pattern, radius) + remainder[:, 1:].sum(axis=1) + ROUNDING * size[:, 1:].sum(axis=1)
    upper[outside < 0.0] = -np.inf
    rows = np.flatnonzero(upper > limit)
    g, c = f[rows, 1:3] * radius.T[rows], pattern[rows, 1:3] * radius.T[rows]
    weight = np.maximum(-(g * c).sum(axis=1) / np.maximum((c * c).sum(axis=1), 1e-300), 0.0)
    weight[~(weight < 1e9)] = 0.0
    improve(rows, f[rows] + weight[:, None] * pattern[rows], weight)
    high = np.flatnonzero(upper > limit)
    turned = 2.0 * values[high, :, 2:] * side[high, None, :]
    reach = np.abs(values[high, 1, 2:]) * radius[0, high, None] + np.abs(values[high, 2, 2:]) * radius[1, high, None]
    near = np.abs(values[high, 0, 2:]) <= 2.0 * reach + 1e-12
    box, flip = np.nonzero((near[:, None, :] | ~FLIPS.any(axis=1)).all(axis=2))
    rows, turn = high[box], turned[box]
    first, second = pattern[rows] + (turn @ FLIPS[flip].transpose(0, 2, 1)).transpose(2, 0, 1)
    determinant = first[:, 1] * second[:, 2] - first[:, 2] * second[:, 1]
    by_first = -f[rows, 1] * second[:, 2] + f[rows, 2] * second[:, 1]
    by_second = -first[:, 1] * f[rows, 2] + first[:, 2] * f[rows, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = np.stack([by_first, by_second]) / determinant
    usable = np.flatnonzero((np.isfinite(weights) & (weights >= 0.0) & (weights < 1e9)).all(axis=0))
    rows, weights = rows[usable], weights[:, usable]
    improve(
        rows, f[rows] + weights[0][:, None] * first[usable] + weights[1][:, None] * second[usable], weights.sum(axis=0)
    )
    share = np.abs(best[:, 1:3]).T * radius + 0.5 * np.abs(best[:, [3, 5]]).T * radius**2
    share = share + np.stack([third[:, :, 0].sum(axis=1), third[:, :, 2].sum(axis=1)]) * radius**3 / 6.0
    return upper, share


def _quadratic_maximum(h: NDArray, radius: NDArray) -> NDArray:
    """Return an upper bound (N,) of the quadratic with values and derivatives h (N, 6) over boxes of half-widths (2,
    N)."""
    a, b = radius
    separate = h[:, 0] + np.abs(h[:, 4]) * a * b
    for gradient, curvature, r in ((h[:, 1], h[:, 3], a), (h[:, 2], h[:, 5], b)):
        slope = np.abs(gradient)
        at_end = slope * r + 0.5 * curvature * r * r
        inner = -curvature * r > slope
        top = np.where(inner, 0.5 * slope * slope / np.where(inner, -curvature, 1.0), at_end)
        separate = separate + top
    product = h[:, 3] * h[:, 5]
    determinant = product - h[:, 4] ** 2
    concave = (h[:, 3] < 0.0) & (determinant > 1e-3 * np.abs(product) + 1e-300)
    # Only if the top is near, so that rounding errors of the gradient stay below their allowance.
    concave &= np.abs(h[:, 1:3]).sum(axis=1) * np.abs(h[:, [3, 5]]).sum(axis=1) < 4.0 * determinant
    safe = np.where(concave, determinant, 1.0)
    square = h[:, 1] ** 2 * h[:, 5] - 2.0 * h[:, 1] * h[:, 2] * h[:, 4] + h[:, 2] ** 2 * h[:, 3]
    whole = h[:, 0] + 0.5 * np.abs(square) / safe * (1.0 + 1e-9)
    return np.where(concave, np.minimum(separate, whole), separate)


class ColumnProgramme:
    """The restricted programme of column generation: min Σ|Φ| with Σ Φ F = a, over the columns so far.

    It is one warm HiGHS model to which columns are added; a new target changes only the right-hand side. `regressors`
    (K, P) are F of the columns in the order of addition, for P parameters.
    """

    def __init__(self, size: int):
        self._size = size
        self.regressors = np.zeros((0, size))
        self._highs = solver()
        zero = np.zeros(size)
        empty = np.zeros(0, dtype=np.int32)
        self._highs.addRows(size, zero, zero, 0, np.zeros(size, dtype=np.int32), empty, np.zeros(0))  # pyright: ignore
        self._add_columns(ARTIFICIAL_COST, np.eye(size))

    def add(self, regressors: NDArray) -> None:
        """Add columns F (K, P); each may have a weight of either sign."""
        self._add_columns(1.0, regressors)
        self.regressors = np.vstack([self.regressors, regressors])

    def _add_columns(self, cost: float, regressors: NDArray) -> None:
        matrix = np.repeat(regressors, 2, axis=0)
        matrix[1::2] *= -1.0
        count = len(matrix)
        columns, rows = np.nonzero(matrix)
        self._highs.addCols(
            count,
            np.full(count, cost),  # pyright: ignore[reportArgumentType]
            np.zeros(count),  # pyright: ignore[reportArgumentType]
            np.full(count, highspy.kHighsInf),  # pyright: ignore[reportArgumentType]
            len(rows),
            np.searchsorted(columns, np.arange(count)).astype(np.int32),  # pyright: ignore[reportArgumentType]
            rows.astype(np.int32),  # pyright: ignore[reportArgumentType]
            matrix[columns, rows],  # pyright: ignore[reportArgumentType]
        )

    def close(self, columns: NDArray, *, closed: bool = True) -> None:
        """Exclude columns (n,) from every plan, or allow them again."""
        pairs = (2 * (self._size + np.asarray(columns))[:, None] + np.arange(2)).ravel().astype(np.int32)
        upper = np.full(len(pairs), 0.0 if closed else highspy.kHighsInf)
        self._highs.changeColsBounds(len(pairs), pairs, np.zeros(len(pairs)), upper)  # pyright: ignore

    def aim(self, target: NDArray) -> None:
        """Set the weights a (P,) of the target."""
        rows = np.arange(self._size, dtype=np.int32)
        self._highs.changeRowsBounds(self._size, rows, target, target)  # pyright: ignore

    def solve(self) -> tuple[NDArray, NDArray, bool]:
        """Return Φ (K,) of each column, at most P of them nonzero; y (P,) with |F'y| ≤ 1 on the columns and cost a'y.

        The last value is True if the columns can determine the target.
        """
        solution = solved(self._highs, usual=0, others=OTHER_STRATEGIES[1:])
        values = np.array(solution.col_value)
        pairs = values[0::2] - values[1::2]
        possible = bool(np.abs(pairs[: self._size]).max() <= 1e-9)
        return pairs[self._size :], np.array(solution.row_dual), possible
