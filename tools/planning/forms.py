"""Regressors and admissible sets as bilinear forms in (cos α, sin α, 1) and (cos β, sin β, 1).

For one accelerometer p and one sign s of its input every regressor of (1.10) is a form hᵀ(α) C h(β), with `harmonics` h
and C (3, 3). So is F'y for any y, which makes pricing and bounding cheap. The set of (1.9) is {c ≥ 0} with c = (1 − v)
s m_p − w − Σ weight |term|, its terms forms too (w is v for the rule "tables", else 0).

At a fixed α everything is a sinusoid in β. The admissible β form arcs. The greatest ±F'y over them is at the sinusoid's
own top or at an end of an arc, exactly: fine grids are priced row by row with it, and all angles by a search along α.

Source: Golovan, Matasov, Tarygin 2022, (1.7), (1.9), (1.10).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.bench import ASYMMETRIC_SLOTS, TARGETS
from ..calibration.model import Parametrisation
from ..calibration.targets import IN_TARGETS
from ..errors import InputError

DEFAULT_BOUNDS = (3e-3, 1e-2)
"""u^max [rad] and v^0max of section 3 of the paper."""
MOST_TERMS = 5
"""Absolute values in s_p^max: three of the bench, two of the other accelerometers' inputs."""
RULES = ("paper", "tables")
"""(1.7) as printed; with the bias rows too, as the published tables were computed."""
INSIDE = 1e-13
"""Margin [g] for positions that must be admissible in spite of rounding."""
OUTSIDE = -1e-12
"""Margin [g] for bounds that must hold on the admissible set in spite of rounding."""
FAN = 17
TOLERANCE = 1e-10
"""Largest excess of |F'y| over one on the grid: the cost is optimal to this."""
ROWS_AT_ONCE = 64
ROUNDING = 64 * np.finfo(float).eps
"""Relative rounding error of a form of nine terms, with sines and cosines, in units of the sum of its coefficients."""


@dataclass(frozen=True)
class SignSheet:
    """One accelerometer with one sign of its input: its regressor and the set where that sign is certain.

    Attributes
    ----------
    accelerometer : int
        p, from 0
    sign : int
        s: +1 or -1; 0 for a symmetric block, whose regressor does not depend on the sign
    regressor : (P, 3, 3) array
        a form for each parameter
    base : (3, 3) array
        c without its absolute values; 1 everywhere for a symmetric block
    terms : (T, 3, 3) array
        the forms in absolute value, each times its weight; T ≤ `MOST_TERMS`
    mounting : int
        index into the mountings of the parametrisation
    """

    accelerometer: int
    sign: int
    regressor: NDArray
    base: NDArray
    terms: NDArray
    mounting: int = 0


def sheets(p: Parametrisation, *, bounds: tuple[float, float] = DEFAULT_BOUNDS, rule: str = "paper") -> list[SignSheet]:
    """Return the sheets of a block, one mounting after the other: six for each, or three of a symmetric block.

    The bounds are u^max [rad] and v^0max of (1.7); the rule is "paper" or "tables" of `models.bench.sign_margin`.
    Raises InputError for another rule, and for bounds that are negative, not finite, or leave no position.
    """
    if rule not in RULES:
        raise InputError(f"--admissible {rule}: must be one of {', '.join(RULES)}")
    u, v = bounds
    if not (np.isfinite(bounds).all() and u >= 0.0 and v >= 0.0):
        raise InputError(f"--bounds {u:g} {v:g}: both must be finite and not negative")
    block = []
    for mounting, matrix in enumerate(p.matrices):
        to_x = x_from_targets() @ p.selection[mounting]
        inputs = np.zeros((3, 3, 3))
        inputs[:, 1, 1], inputs[:, 1, 0], inputs[:, 0, 2] = matrix.T
        for index, row in enumerate(matrix):
            stand = _stand_forms(row)
            for sign in (0,) if p.symmetric else (1, -1):
                x = np.zeros((18, 3, 3))
                x[:3] = stand
                for column, slot in enumerate(ASYMMETRIC_SLOTS[index]):
                    x[slot + (column == index and sign < 0)] = inputs[column]
                x[15 + index, 2, 2] = 1.0
                base, terms = np.zeros((3, 3)), np.zeros((0, 3, 3))
                base[2, 2] = 1.0
                if sign:
                    base = sign * (1.0 - v) * inputs[index]
                    base[2, 2] = -v if rule == "tables" else 0.0
                    terms = np.concatenate([u * stand, v * np.delete(inputs, index, axis=0)])
                    terms = terms[terms.any(axis=(1, 2))]
                block.append(SignSheet(index, sign, np.tensordot(to_x, x, axes=(0, 0)), base, terms, mounting))
    angle = np.radians(np.arange(0.0, 360.0, 5.0))
    for sheet in block:
        if v >= 1.0 or clearance(sheet, angle[:, None], angle[None, :]).max() <= 0.0:
            raise InputError(
                f"--bounds {u:g} {v:g}: leave no position where the sign of accelerometer "
                f"{sheet.accelerometer + 1}'s input is certain; give smaller bounds"
            )
    return block


def _stand_forms(row: NDArray) -> NDArray:
    """Return the forms (3, 3, 3) of (Q B)_p, the derivatives by κ, Δα + α*, ε, for row p of Q (3,)."""
    first, second, third = row
    forms = np.zeros((3, 3, 3))
    forms[0, 2, 0], forms[0, 2, 1] = -first, second
    forms[1, 0, 1], forms[1, 0, 0], forms[1, 1, 2] = -first, -second, third
    forms[2, 0, 0], forms[2, 0, 1] = -first, second
    return forms


def x_from_targets() -> NDArray:
    """Return X (18) of the paper as a function of the targets (18), as a matrix (18, 18)."""
    matrix = np.zeros((18, 18))
    for k in range(18):
        symbol = f"X{k + 1}"
        for target, factor in IN_TARGETS.get(symbol, {symbol: 1.0}).items():
            matrix[k, TARGETS.index(target)] = factor
    return matrix


def padded_terms(block: Sequence[SignSheet]) -> NDArray:
    """Return the terms of all sheets (S, `MOST_TERMS`, 3, 3), zero for the missing terms of a sheet."""
    terms = np.zeros((len(block), MOST_TERMS, 3, 3))
    for k, sheet in enumerate(block):
        terms[k, : len(sheet.terms)] = sheet.terms
    return terms


def harmonics(angle: ArrayLike) -> NDArray:
    """Return (cos, sin, 1) of angles (...) [rad], as (..., 3)."""
    angle = np.asarray(angle, dtype=float)
    values = np.ones((*angle.shape, 3))
    values[..., 0], values[..., 1] = np.cos(angle), np.sin(angle)
    return values


def slopes(angle: NDArray) -> NDArray:
    """Return the derivative (..., 3) of `harmonics`."""
    return np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1)


def dual_forms(block: Sequence[SignSheet], dual: NDArray) -> NDArray:
    """Return F'y (S, 3, 3) of each sheet for a dual y (P,)."""
    return np.array([np.tensordot(dual, sheet.regressor, axes=(0, 0)) for sheet in block])


def value(form: NDArray, alpha: ArrayLike, beta: ArrayLike) -> NDArray:
    """Return values (..., K) of forms (K, 3, 3), or (...) of one form (3, 3), at angles (...) that broadcast [rad]."""
    a, b = harmonics(alpha), harmonics(beta)
    if form.ndim == 2:
        rows = a @ form
        return rows[..., 0] * b[..., 0] + rows[..., 1] * b[..., 1] + rows[..., 2] * b[..., 2]
    return np.einsum("kij,...i,...j->...k", form, a, b)


def regressors_at(block: Sequence[SignSheet], sheet: NDArray, alpha: NDArray, beta: NDArray) -> NDArray:
    """Return F (K, P) of each of the places: its sheet's index (K,), α and β (K,) [rad]."""
    regressors, a, b = np.empty((len(sheet), len(block[0].regressor))), harmonics(alpha), harmonics(beta)
    for k in range(len(block)):
        places = np.flatnonzero(sheet == k)
        if len(places):
            rows = a[places] @ block[k].regressor
            regressors[places] = (rows * b[places]).sum(axis=-1).T
    return regressors


def clearance(sheet: SignSheet, alpha: ArrayLike, beta: ArrayLike) -> NDArray:
    """Return c (...): |m_p| − s_p^max for the sheet's sign, positive if (1.9) holds; 1 everywhere for a symmetric
    block."""
    if sheet.sign == 0:
        return np.ones(np.broadcast_shapes(np.shape(alpha), np.shape(beta)))
    c = value(sheet.base, alpha, beta)
    for term in sheet.terms:
        c = c - np.abs(value(term, alpha, beta))
    return c


@dataclass(frozen=True)
class Arcs:
    """Sheets and α (N,) [rad] and the ends β (N, K) of the arcs there, NaN beyond the last.

    They are the part of pricing that does not depend on y.
    """

    sheet: NDArray
    alpha: NDArray
    ends: NDArray


def _by_alpha(forms: NDArray) -> NDArray:
    """Return forms (K, 3, 3) as a matrix (3, 3 K) from the basis of α to their factors of cos β, of sin β and of 1."""
    return forms.transpose(1, 2, 0).reshape(3, -1)


def _in_beta(forms: Sequence[NDArray], sheet: NDArray, alpha: NDArray) -> NDArray:
    """Return factors (3, N, K) of cos β, of sin β and of 1 of each sheet's forms, as of `_by_alpha`, at α (N,)."""
    a, factors = harmonics(alpha), np.empty((len(sheet), forms[0].shape[1]))
    for k, form in enumerate(forms):
        rows = np.flatnonzero(sheet == k)
        factors[rows] = a[rows] @ form
    return factors.reshape(len(sheet), 3, factors.shape[1] // 3).transpose(1, 0, 2)


class Ridges:
    """The greatest ±F'y over the admissible β, as functions of α; a β counts where c ≥ margin [g]."""

    def __init__(self, block: Sequence[SignSheet], margin: float):
        self._margin, self._free = margin, block[0].sign == 0
        signs = np.array(list(product((-1.0, 1.0), repeat=MOST_TERMS)))
        # c with every choice of frozen signs of its absolute values: an arc ends at a zero of one of these.
        frozen, self._clearances = [], []
        for sheet, terms in zip(block, padded_terms(block), strict=True):
            frozen.append(np.unique(sheet.base - np.einsum("et,tij->eij", signs, terms), axis=0))
            self._clearances.append(_by_alpha(np.concatenate([sheet.base[None], terms])))
        most = max(map(len, frozen))
        self._frozen = np.array([np.resize(forms, (most, 3, 3)) for forms in frozen])
        self._edges = [_by_alpha(forms) for forms in self._frozen]

    def arcs(self, sheet: NDArray, alpha: NDArray) -> Arcs:
        """Return the arcs of sheets (N,) at angles α (N,)."""
        if self._free:
            return Arcs(sheet, alpha, np.zeros((len(alpha), 0)))
        margin = self._margin
        cos, sin = self._crossings(sheet, alpha)
        with np.errstate(invalid="ignore"):
            known = self._clearance(sheet, alpha, cos, sin) >= 2.0 * margin - abs(margin)
        row, end = np.divmod(np.flatnonzero(known), known.shape[1])
        upper, which = np.divmod(end, self._frozen.shape[1])
        edge = (harmonics(alpha)[row, None, :] @ self._frozen[sheet[row], which])[:, 0]
        with np.errstate(invalid="ignore"):
            spread = np.arccos((2.0 * margin - edge[:, 2]) / np.hypot(edge[:, 0], edge[:, 1]))
        count = known.sum(axis=1)
        ends = np.full((len(alpha), max(int(count.max(initial=0)), 1)), np.nan)
        beta = np.arctan2(edge[:, 1], edge[:, 0]) + np.where(upper, spread, -spread)
        ends[row, np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)] = beta
        return Arcs(sheet, alpha, ends)

    def _crossings(self, sheet: NDArray, alpha: NDArray) -> NDArray:
        """Return cosines and sines (2, N, 2 E) of the β at which each of the frozen c equals the margin; NaN if never.

        Most of them are not ends of arcs, so the angles themselves are not computed.
        """
        factors = _in_beta(self._edges, sheet, alpha)
        crossings = np.empty((2, len(sheet), 2, factors.shape[2]))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            inner = 2.0 * self._margin - factors[2]
            size = np.hypot(*factors[:2])
            inner /= size
            outer = 1.0 - inner
            outer *= 1.0 + inner
            np.sqrt(outer, out=outer)
            for crossing, along, across in zip(crossings, factors, (-factors[1], factors[0]), strict=False):
                along, across = along / size, across / size
                along *= inner
                across *= outer
                np.subtract(along, across, out=crossing[:, 0])
                np.add(along, across, out=crossing[:, 1])
        return crossings.reshape(2, len(sheet), 2 * factors.shape[2])

    def _clearance(self, sheet: NDArray, alpha: NDArray, cos: NDArray, sin: NDArray) -> NDArray:
        """Return c (N, K) of sheets (N,) at α (N,) and the cosines and sines of β (N, K)."""
        rows = _in_beta(self._clearances, sheet, alpha)
        value, term = np.empty(cos.shape), np.empty(cos.shape)
        c = np.empty(cos.shape)
        for k in range(rows.shape[2]):
            a, b, constant = rows[:, :, k, None]
            np.multiply(a, cos, out=value)
            value += np.multiply(b, sin, out=term)
            value += constant
            if k == 0:
                c[:] = value
            else:
                c -= np.abs(value, out=term)
        return c

    def heights(self, arcs: Arcs, forms: NDArray, sense: NDArray) -> tuple[NDArray, NDArray]:
        """Return the greatest sense·F'y over the admissible β of each row, and that β; -inf if no β is admissible.

        The forms (S, 3, 3) are F'y of each sheet, the senses (N,) ±1.
        """
        f = sense[:, None] * (harmonics(arcs.alpha)[:, None, :] @ forms[arcs.sheet])[:, 0]
        top_beta = np.arctan2(f[:, 1], f[:, 0])
        top = np.hypot(f[:, 0], f[:, 1]) + f[:, 2]
        if self._free:
            return top, top_beta
        known = np.isfinite(arcs.ends)
        ends = np.where(known, arcs.ends, 0.0)
        values = np.where(known, f[:, :1] * np.cos(ends) + f[:, 1:2] * np.sin(ends) + f[:, 2:], -np.inf)
        best = values.argmax(axis=1)
        n = np.arange(len(best))
        height, beta = values[n, best], ends[n, best]
        higher = np.flatnonzero(top > height)
        at = top_beta[higher, None]
        clear = self._clearance(arcs.sheet[higher], arcs.alpha[higher], np.cos(at), np.sin(at))[:, 0]
        higher = higher[clear >= self._margin]
        height[higher], beta[higher] = top[higher], top_beta[higher]
        return height, beta

    def climb(
        self, forms: NDArray, sheet: NDArray, sense: NDArray, alpha: NDArray, reach: float, rounds: int
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Follow maxima (N,) along α from within ±reach [rad]: their α, β and value.

        Each round looks at a fan of 17 angles and makes it eight times finer.
        """
        alpha, n = alpha.copy(), np.arange(len(alpha))
        best, beta = self.heights(self.arcs(sheet, alpha), forms, sense)
        fan = np.linspace(-1.0, 1.0, FAN)
        many, twice = np.repeat(sheet, FAN), np.repeat(sense, FAN)
        for _ in range(rounds if len(alpha) else 0):
            trial = (alpha[:, None] + reach * fan).ravel()
            high, at = (x.reshape(-1, FAN) for x in self.heights(self.arcs(many, trial), forms, twice))
            pick = high.argmax(axis=1)
            better = high[n, pick] > best
            best = np.where(better, high[n, pick], best)
            beta = np.where(better, at[n, pick], beta)
            alpha = np.where(better, trial.reshape(-1, FAN)[n, pick], alpha)
            reach *= 2.0 / (FAN - 1)
        return alpha, beta, best


class WholeGrid:
    """A grid that is priced whole: every admissible position of the given lines of both angles (n,) [rad]."""

    def __init__(self, sheets: Sequence[SignSheet], angle: NDArray, lines: NDArray):
        self._lines, self._basis = lines, harmonics(angle[lines])
        at = angle[lines]
        self._inside = [(clearance(s, at[:, None], at[None, :]) > 0.0).astype(float) for s in sheets]
        self._values = np.empty((len(lines), len(lines)))

    def price(self, forms: NDArray) -> tuple[float, NDArray]:
        """Return the greatest |F'y|, rounding included, and the worst positions (K, 3) (sheet, row, column) above
        one."""
        slack = _rounding(forms)
        above, ceiling = [], 0.0
        for k, (form, inside) in enumerate(zip(forms, self._inside, strict=True)):
            values = np.matmul(self._basis @ form, self._basis.T, out=self._values)
            values *= inside
            for worst in (int(values.argmax()), int(values.argmin())):
                ceiling = max(ceiling, abs(values.flat[worst]))
                if abs(values.flat[worst]) > 1.0 + TOLERANCE:
                    i, j = divmod(worst, len(self._lines))
                    above.append((k, self._lines[i], self._lines[j]))
        return ceiling + slack, np.array(above, dtype=int).reshape(-1, 3)


class FineGrid:
    """A grid of angles (n,) [rad] that is priced row by row, and only in rows that may hold a position above one."""

    def __init__(self, sheets: Sequence[SignSheet], angle: NDArray):
        self._sheets, self._angle, self._basis = sheets, angle, harmonics(angle)
        self._ridges = Ridges(sheets, OUTSIDE)
        self._arcs = [self._ridges.arcs(np.full(len(angle), k), angle) for k in range(len(sheets))]

    def price(self, forms: NDArray, most: int | None) -> tuple[float, NDArray]:
        """Price like `WholeGrid.price`, but only at most `most` rows of each sheet and sense, the most promising."""
        limit, slack = 1.0 + TOLERANCE, _rounding(forms)
        above, ceiling = [], limit
        for k in range(len(self._sheets)):
            for sense in (1.0, -1.0):
                height, _ = self._ridges.heights(self._arcs[k], forms, np.full(len(self._angle), sense))
                rows = np.flatnonzero(height + 2.0 * slack > limit)
                if most is not None:
                    rows = rows[np.argsort(-height[rows], kind="stable")[:most]]
                top, worst = self._highest(k, sense * forms[k], rows, slack)
                ceiling = max(ceiling, top)
                if top > limit:
                    above.append(worst)
        return ceiling + slack, np.array(above, dtype=int).reshape(-1, 3)

    def _highest(self, k: int, form: NDArray, rows: NDArray, slack: float) -> tuple[float, tuple[int, int, int]]:
        """Return the greatest value of a form above one on a sheet's admissible positions of some rows, and its
        place."""
        best, where = 1.0 + TOLERANCE, (k, 0, 0)
        for chunk in np.array_split(rows, len(rows) // ROWS_AT_ONCE + 1):
            values = self._basis[chunk] @ form @ self._basis.T
            i, j = np.nonzero(values + slack > best)
            inside = clearance(self._sheets[k], self._angle[chunk[i]], self._angle[j]) > 0.0
            i, j = i[inside], j[inside]
            if len(i):
                worst = int(values[i, j].argmax())
                top = float(values[i[worst], j[worst]])
                if top > best:
                    best, where = top, (k, int(chunk[i[worst]]), int(j[worst]))
        return best, where


def _rounding(forms: NDArray) -> float:
    return ROUNDING * float(np.abs(forms).sum(axis=(1, 2)).max())
