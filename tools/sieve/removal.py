"""The fewest parts of a record whose removal makes a linear model fit: all smallest sets, or proof of none.

The Chebyshev programme of what remains names the readings that prove that no parameters fit, by its duals: one of their
parts must go. Such conflicts are pooled; sets that meet all of them are sought depth first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ..bounded.exchange import exchanged
from ..bounded.programmes import chebyshev_radius

MOST_PROGRAMMES = 300
"""Programmes after which a search ends without an answer."""
NAMED = 1e-9
"""A dual that is smaller, relatively to all, names nothing."""
Parts = frozenset[int]


class TooMany(Exception):
    """The search took too many programmes."""


@dataclass(eq=False)
class Removal:
    """A search among the parts of linear rows.

    `matrix` (M, P) and `target` (M,) are over the bounds; `belongs` (M, K) marks the parts with which each row is
    removed. `excess` (K,) is the misfit of each part in a robust fit: the order in which parts are tried.
    """

    matrix: Floats
    target: Floats
    belongs: Bools
    excess: Floats
    limit: float
    programmes: int = 0
    conflicts: list[Parts] = field(default_factory=list)

    def smallest(self, most: int) -> list[Parts]:
        """Return all smallest sets of at most `most` parts whose removal makes the model fit; else an empty list."""
        try:
            for size in range(1, most + 1):
                standing = self.of_size(size)
                if standing:
                    return standing
        except TooMany:
            pass
        return []

    def of_size(self, size: int) -> list[Parts]:
        """Return all sets of `size` parts; a TooMany where they take too many programmes."""
        standing: list[Parts] = []
        visited: set[Parts] = set()

        def descend(removed: Parts) -> None:
            if removed in visited:
                return
            visited.add(removed)
            unmet = [conflict for conflict in self.conflicts if not conflict & removed]
            if _disjoint(unmet) > size - len(removed):
                return
            if not unmet:
                conflict = self.conflict(removed)
                if conflict is None:
                    standing.append(removed)
                    return
                self.conflicts.append(conflict)
                unmet = [conflict]
            if len(removed) == size:
                return
            shortest = min(unmet, key=len)
            for part in sorted(shortest, key=lambda one: -self.excess[one]):
                descend(removed | {part})

        descend(frozenset())
        return standing

    def conflict(self, removed: Parts) -> Parts | None:
        """Return parts that include one more to remove; None where the model fits without those already removed."""
        self.programmes += 1
        if self.programmes > MOST_PROGRAMMES:
            raise TooMany
        kept = np.flatnonzero(~self.belongs[:, list(removed)].any(axis=1))
        radius, named = held_by(self.matrix[kept], self.target[kept])
        if radius <= self.limit:
            return None
        return frozenset(np.flatnonzero(self.belongs[kept[named]].any(axis=0)).tolist())


def held_by(matrix: NDArray, target: NDArray) -> tuple[float, Ints]:
    """The least largest error of linear rows over their bounds, and the rows that prove it."""
    exchange = exchanged(matrix, target)
    if exchange is not None:
        sizes = np.abs(exchange.multipliers)
        return exchange.radius, exchange.rows[sizes > NAMED * sizes.max(initial=0.0)]
    radius, _, duals = chebyshev_radius(matrix, target, np.ones(len(target)))
    sizes = np.abs(duals)
    return radius, np.flatnonzero(sizes > NAMED * sizes.max(initial=0.0))


def _disjoint(conflicts: Sequence[Parts]) -> int:
    """Return a number of conflicts that share no part: at least that number of parts must go."""
    met: set[int] = set()
    count = 0
    for conflict in sorted(conflicts, key=len):
        if not conflict & met:
            met |= conflict
            count += 1
    return count
