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
from ..bounded.sets import Projection, project, sharp_weights
from ..evidence.carried import LIMIT
from ..evidence.evidence import Evidence, Fit

LARGEST_SET = 3
SEEN = 1e-3
"""An effect of its largest possible size that moves no error by so much of its bound cannot be seen."""
SAME = 1e-6
"""Two effects whose signatures differ by less of their size are one class in this record."""
MOST_FITTED = 300
"""So many sets of one size are fitted; the rest, with larger bounds, is not: the search is then said to be cut off."""
SHARPENING = 12


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes
    ----------
    fits : tuple of Fit
        the smallest sets that stand, the least radius first; the empty set where the baseline stands
    complete : bool
        whether these are all
    """

    fits: tuple[Fit, ...]
    complete: bool = True

    @property
    def members(self) -> set[EffectPlace]:
        """Every effect of some smallest set."""
        return {place for fit in self.fits for place in fit.places}


def seen_places(system: Evidence) -> list[EffectPlace]:
    """Effects that some size which is called possible makes visible beside the baseline."""
    projection = project(system.problem, np.full(len(system.residual), 1.0 / len(system.residual)))
    seen = []
    for place, block in zip(system.places, system.blocks, strict=True):
        left = (
            projection.columns[:, block] * np.sqrt(len(system.residual)) * np.abs(system.limits_of([place])).max(axis=0)
        )
        if np.abs(left).max(initial=0.0) > SEEN:
            seen.append(place)
    return seen


def classes_of(system: Evidence, places: Sequence[EffectPlace]) -> dict[EffectPlace, tuple[EffectPlace, ...]]:
    """Of effects that this record cannot tell apart the first, with the others."""
    projection = project(system.problem, np.full(len(system.residual), 1.0 / len(system.residual)))
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


def smallest_sets(system: Evidence, places: Sequence[EffectPlace], *, largest: int = LARGEST_SET) -> Found:
    """The smallest sets of effects, of up to three, with which the model stands; nothing where none does."""
    baseline = system.refit(())
    if baseline.radius <= LIMIT:
        return Found((baseline,))
    reduced = system.with_places(places)
    problem = reduced.problem
    even = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections = [project(problem, even), project(problem, sharp_weights(problem, even, SHARPENING))]
    for size in range(1, largest + 1):
        candidates = []
        for chosen in combinations(range(len(places)), size):
            least = max(_squared_bound(p, problem.columns_of(chosen)) for p in projections)
            if least <= LIMIT**2:
                candidates.append((least, chosen))
        candidates.sort()
        fits = [reduced.refit([places[i] for i in chosen]) for _, chosen in candidates[:MOST_FITTED]]
        standing = [fit for fit in fits if fit.radius <= LIMIT]
        if standing:
            order = sorted(standing, key=lambda fit: (round(fit.radius, 9), [p.title for p in fit.places]))
            return Found(tuple(order), complete=len(candidates) <= MOST_FITTED)
        if len(candidates) > MOST_FITTED:
            return Found((), complete=False)
    return Found(())


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
