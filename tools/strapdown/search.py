"""Smallest sets of effects that bring every error of a strapdown record within its bound.

Few columns, plain linear programmes; a weighted sum of squares that is above the bounds refuses most sets beforehand
(Lawson's bound).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.programmes import chebyshev_radius
from ..bounded.sets import Problem, Projection, project, sharp_weights
from .system import System, weighted_step

LARGEST_SET = 3
LIMIT = 1.0 + 1e-7
"""Radius up to which a model stands: one, and what the programmes may be wrong by."""
SEEN = 1e-3
"""An effect of its largest possible size that moves no error by so much of its bound cannot be seen."""
SAME = 1e-6
"""Two effects whose signatures differ by less of their size are one class in this record."""
MOST_FITTED = 300
"""So many sets of one size are fitted; the rest, with larger bounds, is not: the search is then said to be cut off."""
SHARPENING = 12
FIRST_ROWS, MORE_ROWS = 300, 100
"""Rows that a linear programme begins with, and takes in at a time."""
TOLERANCE = 1e-9
"""How far, relatively, a row that was not taken in may be beyond the radius."""


@dataclass(frozen=True, eq=False)
class SetFit:
    """A set of effects fitted to a system.

    Attributes
    ----------
    places : tuple of EffectPlace
    radius : float
        least possible largest error over its bound, with coefficients of possible size
    solution : (P + k,) array
        steps of the baseline's parameters and coefficients of the effects, a Chebyshev centre
    """

    places: tuple[EffectPlace, ...]
    radius: float
    solution: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes
    ----------
    fits : tuple of SetFit
        the smallest sets that stand, the least radius first; the empty set where the baseline stands
    complete : bool
        whether these are all
    """

    fits: tuple[SetFit, ...]
    complete: bool = True

    @property
    def members(self) -> set[EffectPlace]:
        """Every effect of some smallest set."""
        return {place for fit in self.fits for place in fit.places}


def fit_set(system: System, places: Sequence[EffectPlace]) -> SetFit:
    """The Chebyshev fit of the baseline and some effects of possible sizes."""
    matrix = system.matrix(places)
    free = np.full(len(system.names), np.inf)
    ends = system.limits_of(places)
    low, high = np.concatenate([-free, ends[0]]), np.concatenate([free, ends[1]])
    if not matrix.shape[1]:
        return SetFit((), float(np.abs(system.residual).max(initial=0.0)), np.zeros(0))
    # Of many rows few matter: those that least squares fit worst, and what a fit to them violates.
    left = np.abs(system.residual - matrix @ weighted_step(matrix, system.residual))
    taken = np.argsort(-left, kind="stable")[:FIRST_ROWS]
    while True:
        bound = np.ones(len(taken))
        radius, x, _ = chebyshev_radius(matrix[taken], system.residual[taken], bound, low=low, high=high)
        excess = np.abs(system.residual - matrix @ x) - radius
        excess[taken] = 0.0
        more = np.argsort(-excess, kind="stable")[:MORE_ROWS]
        more = more[excess[more] > TOLERANCE * max(1.0, radius)]
        if not len(more):
            return SetFit(tuple(places), radius, x)
        taken = np.concatenate([taken, more])


def seen_places(system: System) -> list[EffectPlace]:
    """Effects that some size which is called possible makes visible beside the baseline."""
    projection = project(_problem(system), np.full(len(system.residual), 1.0 / len(system.residual)))
    seen = []
    for place, block in zip(system.places, system.blocks, strict=True):
        left = (
            projection.columns[:, block] * np.sqrt(len(system.residual)) * np.abs(system.limits_of([place])).max(axis=0)
        )
        if np.abs(left).max(initial=0.0) > SEEN:
            seen.append(place)
    return seen


def classes_of(system: System, places: Sequence[EffectPlace]) -> dict[EffectPlace, tuple[EffectPlace, ...]]:
    """Of effects that this record cannot tell apart the first, with the others."""
    projection = project(_problem(system), np.full(len(system.residual), 1.0 / len(system.residual)))
    spaces = {place: _space(projection.columns[:, system.blocks[system.places.index(place)]]) for place in places}
    classes: dict[EffectPlace, list[EffectPlace]] = {}
    for place in places:
        for first, others in classes.items():
            a, b = spaces[first], spaces[place]
            if a.shape == b.shape and np.linalg.norm(b - a @ (a.T @ b)) < SAME:
                others.append(place)
                break
        else:
            classes[place] = []
    return {place: tuple(others) for place, others in classes.items()}


def smallest_sets(system: System, places: Sequence[EffectPlace], *, largest: int = LARGEST_SET) -> Found:
    """The smallest sets of effects, of up to three, with which the model stands; nothing where none does."""
    baseline = fit_set(system, ())
    if baseline.radius <= LIMIT:
        return Found((baseline,))
    reduced = system.with_places(places)
    problem = _problem(reduced)
    even = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections = [project(problem, even), project(problem, sharp_weights(problem, even, SHARPENING))]
    for size in range(1, largest + 1):
        candidates = []
        for chosen in combinations(range(len(places)), size):
            least = max(_squared_bound(p, problem.columns_of(chosen)) for p in projections)
            if least <= LIMIT**2:
                candidates.append((least, chosen))
        candidates.sort()
        fits = [fit_set(reduced, [places[i] for i in chosen]) for _, chosen in candidates[:MOST_FITTED]]
        standing = [fit for fit in fits if fit.radius <= LIMIT]
        if standing:
            order = sorted(standing, key=lambda fit: (round(fit.radius, 9), [p.title for p in fit.places]))
            return Found(tuple(order), complete=len(candidates) <= MOST_FITTED)
        if len(candidates) > MOST_FITTED:
            return Found((), complete=False)
    return Found(())


def _problem(system: System) -> Problem:
    """The system as Lawson's bound takes it."""
    return Problem(system.residual, system.nominal, system.columns, system.blocks)


def _squared_bound(projection: Projection, columns: NDArray) -> float:
    """Least weighted sum of squares with some columns."""
    product = projection.product[columns]
    gram = projection.gram[np.ix_(columns, columns)]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    solved = np.linalg.lstsq(gram / np.outer(scale, scale), product / scale, rcond=1e-9)[0]
    return projection.square - float(product / scale @ solved)


def _space(columns: NDArray) -> NDArray:
    """Orthonormal basis of columns, each of size one before."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return left[:, values > 1e-7 * values.max(initial=0.0)]
