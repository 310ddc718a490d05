"""The optimum on the continuum to rounding: Newton's method on the positions that carry weight.

Unknown are the positions (α_i, β_i), their weights Φ_i and the dual y. They obey Σ Φ_i F_i = a; s_i F_i'y = 1; and, at
each position, F'y is stationary (inside the admissible set), or stationary along the boundary and on it, or it is a
corner of the boundary. The system is square but, where optima are not unique, singular: steps are the shortest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from .forms import Sheet, clearance, value
from .ridges import INSIDE

ON_BOUNDARY = 1e-5
"""Clearance [g] below which a peak is taken to lie on the boundary."""
AT_KINK = 3e-4
"""|term| over its greatest coefficient below which it is taken to lie on a corner too."""
STEPS = 12
CONVERGED = 1e-12
NO_WEIGHT = 1e-8
"""A position with so little weight does not belong to the support."""


@dataclass(frozen=True)
class Support:
    """Positions with weights, and a dual that is ±1 and stationary there.

    Attributes
    ----------
    sheet : (n,) array of int
    sense : (n,) array
        sign s_i of the weight
    alpha, beta : (n,) array
        [rad]
    corner : (n,) array of int
        -2 inside, -1 on the boundary, else the term that vanishes too
    weights : (n,) array
    dual : (P,) array
    """

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


def kind_of_place(sheet: Sheet, alpha: float, beta: float) -> int:
    """-2 inside the set, -1 on its boundary, else the index of the term whose kink makes a corner of the boundary."""
    if float(clearance(sheet, alpha, beta)) > ON_BOUNDARY:
        return -2
    terms = np.abs(value(sheet.terms, alpha, beta)) / np.abs(sheet.terms).max(axis=(1, 2))
    return int(terms.argmin()) if len(terms) and terms.min() < AT_KINK else -1


def polish(sheets: Sequence[Sheet], target: NDArray, metric: NDArray, start: Support) -> Support | None:
    """The optimum near a support that is nearly right; None when Newton's method does not lead to one.

    Positions whose weight turns out to have the wrong sign, or none, are dropped.

    Parameters
    ----------
    sheets : sequence of Sheet
    target : (P,) array
        a
    metric : (P, P) array
        lower triangular L: the size of a dual is |L'y|
    start : Support
    """
    found = start
    for _ in range(2 * len(start.sheet) + 2):
        if not len(found.sheet):
            return None
        before = found
        polished = _newton(sheets, target, metric, before)
        if polished is None:
            return None
        found = polished
        crossed = _crossed(sheets, before, found)
        if (crossed != before.corner).any():
            found = replace(before, corner=crossed)
            continue
        weights = found.weights * found.sense
        if 0.0 <= weights.min() < NO_WEIGHT:
            found = _subset(found, weights >= NO_WEIGHT)
            continue
        if weights.min() < 0.0:
            columns = np.array([_regressor(sheets, found, i) for i in range(len(weights))])
            fitted, misfit = nnls((columns * found.sense[:, None]).T, target)
            if misfit > CONVERGED:
                found = _subset(found, np.arange(len(weights)) != weights.argmin())
                continue
            found = _subset(replace(found, weights=fitted * found.sense), fitted > NO_WEIGHT)
            continue
        clear = [
            float(clearance(sheets[k], a, b)) for k, a, b in zip(found.sheet, found.alpha, found.beta, strict=True)
        ]
        return found if min(clear) > 0.0 else None
    return None


def _crossed(sheets: Sequence[Sheet], before: Support, after: Support) -> NDArray:
    """Kinds of place, with a corner where Newton's method left a smooth boundary across a kink."""
    corner = before.corner.copy()
    for i in np.flatnonzero(corner == -1):
        sheet = sheets[before.sheet[i]]
        terms = (value(sheet.terms, s.alpha[i], s.beta[i]) for s in (before, after))
        over = np.flatnonzero(np.multiply(*terms) < 0.0)
        if len(over):
            corner[i] = over[0]
    return corner


def _regressor(sheets: Sequence[Sheet], support: Support, i: int) -> NDArray:
    return value(sheets[support.sheet[i]].regressor, support.alpha[i], support.beta[i])


def _subset(support: Support, kept: NDArray) -> Support:
    return replace(
        support,
        **{name: getattr(support, name)[kept] for name in ("sheet", "sense", "alpha", "beta", "corner", "weights")},
    )


def _newton(sheets: Sequence[Sheet], target: NDArray, metric: NDArray, start: Support) -> Support | None:
    size, count = len(target), len(start.sheet)
    alpha, beta = start.alpha.copy(), start.beta.copy()
    weights, scaled = start.weights.copy(), metric.T @ start.dual
    inverse = np.linalg.inv(metric)
    signs = _signs(sheets, start)
    for step in range(STEPS):
        dual = inverse.T @ scaled
        residual = np.zeros(size + 3 * count)
        matrix = np.zeros((size + 3 * count, size + 3 * count))
        residual[:size] = -target
        for i in range(count):
            sheet, sense = sheets[start.sheet[i]], start.sense[i]
            jet = _jet(sheet.regressor, alpha[i], beta[i])
            column = size + 3 * i
            residual[:size] += weights[i] * jet[0]
            matrix[:size, column : column + 3] = np.stack([jet[0], weights[i] * jet[1], weights[i] * jet[2]], axis=1)
            touch = (sense * (dual @ jet[0]) - 1.0, sense * jet[0], sense * (jet[1:3] @ dual))
            conditions = _conditions(sheet, int(start.corner[i]), signs[i], alpha[i], beta[i], jet, dual)
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


def touching(sheets: Sequence[Sheet], support: Support) -> tuple[NDArray, NDArray]:
    """What every dual of the optimum obeys: rows (K, P) and values (K,) of touching ±1 and of being stationary."""
    rows, values = [], []
    signs = _signs(sheets, support)
    for i in range(len(support.sheet)):
        sheet, corner = sheets[support.sheet[i]], int(support.corner[i])
        jet = _jet(sheet.regressor, support.alpha[i], support.beta[i])
        rows.append(jet[0])
        values.append(support.sense[i])
        for _, by_dual, _ in _conditions(sheet, corner, signs[i], support.alpha[i], support.beta[i], jet, support.dual):
            if by_dual.any():
                rows.append(by_dual)
                values.append(0.0)
    return np.array(rows), np.array(values)


def _jet(forms: NDArray, alpha: float, beta: float) -> NDArray:
    """Values and derivatives (6, K) of forms (K, 3, 3): 1, α, β, αα, αβ, ββ."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    a = np.array([[ca, sa, 1.0], [-sa, ca, 0.0], [-ca, -sa, 0.0]])
    b = np.array([[cb, sb, 1.0], [-sb, cb, 0.0], [-cb, -sb, 0.0]])
    order = ([0, 1, 0, 2, 1, 0], [0, 0, 1, 0, 1, 2])
    return np.einsum("kij,mi,mj->mk", forms, a[order[0]], b[order[1]])


def _signs(sheets: Sequence[Sheet], support: Support) -> list[NDArray]:
    places = zip(support.sheet, support.alpha, support.beta, strict=True)
    return [np.sign(value(sheets[k].terms, a, b)) for k, a, b in places]


def _conditions(sheet: Sheet, corner: int, signs: NDArray, alpha: float, beta: float, jet: NDArray, dual: NDArray):
    """Two conditions on a position, each (amount, derivative by y (P,), derivatives by α and β (2,))."""
    f = jet @ dual
    nothing = np.zeros(len(dual))
    if corner == -2:
        return (f[1], jet[1], f[[3, 4]]), (f[2], jet[2], f[[4, 5]])
    c = _jet(sheet.base[None], alpha, beta)[:, 0]
    terms = _jet(sheet.terms, alpha, beta)
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
