"""The greatest ±F'y over β at given α: exact, because at a fixed α everything is a sinusoid in β.

The admissible β form arcs; the greatest value is at the sinusoid's own top or at an end of an arc. Fine grids are
priced row by row with it, and the continuum by a search along α.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .forms import MOST_TERMS, Sheet, basis

INSIDE = 1e-13
"""Margin [g] for positions that are to be admissible in spite of rounding."""
OUTSIDE = -1e-12
"""Margin [g] for bounds that are to hold on the admissible set in spite of rounding."""
FAN = 17


@dataclass(frozen=True)
class Stack:
    """The sheets' admissible sets in arrays of equal size.

    Attributes
    ----------
    base : (S, 3, 3) array
    terms : (S, 5, 3, 3) array
        zero where a sheet has fewer
    patterns : (S, K, 3, 3) array
        c with the signs of its absolute values frozen, every way
    free : bool
        every position is admissible
    margin : float
        the set is {c ≥ margin}
    """

    base: NDArray
    terms: NDArray
    patterns: NDArray
    free: bool
    margin: float


@dataclass(frozen=True)
class Arcs:
    """Given α and the ends of the arcs there: all that pricing needs and that does not depend on y.

    Attributes
    ----------
    sheet : (N,) array of int
    alpha : (N,) array
        [rad]
    ends : (N, K) array
        β [rad] of the arcs' ends, NaN beyond the last
    """

    sheet: NDArray
    alpha: NDArray
    ends: NDArray


def stack(sheets: Sequence[Sheet], margin: float) -> Stack:
    """The admissible sets of the sheets, each with this margin [g]."""
    signs = np.array(list(product((-1.0, 1.0), repeat=MOST_TERMS)))
    base = np.array([sheet.base for sheet in sheets])
    terms = np.zeros((len(sheets), MOST_TERMS, 3, 3))
    for k, sheet in enumerate(sheets):
        terms[k, : len(sheet.terms)] = sheet.terms
    each = [np.unique(b - np.einsum("et,tij->eij", signs, t), axis=0) for b, t in zip(base, terms, strict=True)]
    most = max(len(one) for one in each)
    patterns = np.array([np.resize(one, (most, 3, 3)) for one in each])
    return Stack(base, terms, patterns, sheets[0].sign == 0, margin)


def arcs_at(among: Stack, sheet: NDArray, alpha: NDArray) -> Arcs:
    """The arcs of sheets (N,) at angles α (N,)."""
    if among.free:
        return Arcs(sheet, alpha, np.zeros((len(alpha), 0)))
    edge = np.squeeze(basis(alpha)[:, None, None, :] @ among.patterns[sheet], -2)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        spread = np.arccos((2.0 * among.margin - edge[..., 2]) / np.hypot(edge[..., 0], edge[..., 1]))
    middle = np.arctan2(edge[..., 1], edge[..., 0])
    beta = np.concatenate([middle - spread, middle + spread], axis=1)
    known = np.isfinite(beta)
    slack = abs(among.margin)
    beta[~known] = 0.0
    known &= _clearance(among, sheet, alpha, beta) >= 2.0 * among.margin - slack
    order = np.argsort(~known, axis=1, kind="stable")[:, : max(int(known.sum(axis=1).max(initial=0)), 1)]
    return Arcs(sheet, alpha, np.where(np.take_along_axis(known, order, 1), np.take_along_axis(beta, order, 1), np.nan))


def _clearance(among: Stack, sheet: NDArray, alpha: NDArray, beta: NDArray) -> NDArray:
    """c (N, K) of sheets (N,) at α (N,) and β (N, K)."""
    a, b = basis(alpha), basis(beta)
    c = np.squeeze(b @ (a[:, None, :] @ among.base[sheet]).transpose(0, 2, 1), -1)
    terms = np.squeeze(a[:, None, None, :] @ among.terms[sheet], -2)
    return c - np.abs(b @ terms.transpose(0, 2, 1)).sum(axis=2)


def heights(among: Stack, arcs: Arcs, forms: NDArray, sense: NDArray) -> tuple[NDArray, NDArray]:
    """The greatest sense·F'y over the admissible β of each row, and that β; -inf where no β is admissible.

    Parameters
    ----------
    forms : (S, 3, 3) array
        F'y of each sheet
    sense : (N,) array
        ±1
    """
    f = sense[:, None] * (basis(arcs.alpha)[:, None, :] @ forms[arcs.sheet])[:, 0]
    own = np.arctan2(f[:, 1], f[:, 0])
    top = np.hypot(f[:, 0], f[:, 1]) + f[:, 2]
    if among.free:
        return top, own
    known = np.isfinite(arcs.ends)
    ends = np.where(known, arcs.ends, 0.0)
    values = np.where(known, f[:, :1] * np.cos(ends) + f[:, 1:2] * np.sin(ends) + f[:, 2:], -np.inf)
    best = values.argmax(axis=1)
    n = np.arange(len(best))
    height, beta = values[n, best], ends[n, best]
    higher = np.flatnonzero(top > height)
    clear = _clearance(among, arcs.sheet[higher], arcs.alpha[higher], own[higher, None])[:, 0]
    higher = higher[clear >= among.margin]
    height[higher], beta[higher] = top[higher], own[higher]
    return height, beta


def local_maxima(height: NDArray, low: float) -> NDArray:
    """Where heights (M, n) along closed lines of α have local maxima above `low`: indices (K, 2)."""
    peak = (height > low) & (height >= np.roll(height, 1, axis=1)) & (height >= np.roll(height, -1, axis=1))
    return np.argwhere(peak)


def climb(
    among: Stack, forms: NDArray, sheet: NDArray, sense: NDArray, alpha: NDArray, reach: float, rounds: int
) -> tuple[NDArray, NDArray, NDArray]:
    """Follow maxima (N,) along α from within ±reach [rad]: their α, β and value.

    Each round looks at a fan of 17 angles and makes it eight times finer.
    """
    alpha, n = alpha.copy(), np.arange(len(alpha))
    best, beta = heights(among, arcs_at(among, sheet, alpha), forms, sense)
    fan = np.linspace(-1.0, 1.0, FAN)
    many, twice = np.repeat(sheet, FAN), np.repeat(sense, FAN)
    for _ in range(rounds):
        trial = (alpha[:, None] + reach * fan).ravel()
        value, at = (x.reshape(-1, FAN) for x in heights(among, arcs_at(among, many, trial), forms, twice))
        pick = value.argmax(axis=1)
        better = value[n, pick] > best
        best = np.where(better, value[n, pick], best)
        beta = np.where(better, at[n, pick], beta)
        alpha = np.where(better, trial.reshape(-1, FAN)[n, pick], alpha)
        reach *= 2.0 / (FAN - 1)
    return alpha, beta, best
