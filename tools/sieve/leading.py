"""The leading part of a residual: the share of its squares that the best of all simple causes explains.

The best of M candidates explains about 2 ln M of the squares of pure noise, in units of its variance; a true cause
explains more.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ..bounded.programmes import column_space, spaces_beyond
from ..evidence.evidence import Evidence
from ..evidence.fit import coefficient_count
from ..evidence.pairs import HARMONICS, Form, Pair

BY_CHANCE = 1.3
"""Factor by which noise alone may explain more than its expected part."""
MOST_NUMBERS = 2
"""Most coefficients of a candidate."""
HIGHEST_POWER = 5
MOST_GAPS = 200
"""Most gaps between rows at which breaks are tried."""
WITHIN = 1e-6
"""A candidate with a smaller part (squared) beyond the model has no say."""


@dataclass(frozen=True, eq=False)
class Residual:
    """Residual of errors (M,) after least squares on some columns (M, P), both over their bounds."""

    errors: Floats
    columns: Floats

    @cached_property
    def base(self) -> Floats:
        """Orthonormal basis of the columns."""
        return column_space(self.columns)

    @cached_property
    def left(self) -> Floats:
        """The residual (M,)."""
        return self.errors - self.base @ (self.base.T @ self.errors)

    @property
    def squares(self) -> float:
        """Its sum of squares."""
        return float(self.left @ self.left)

    @property
    def freedom(self) -> int:
        """Its degrees of freedom."""
        return len(self.errors) - self.base.shape[1]

    def beside(self, columns: NDArray) -> "Residual":
        """Return the residual after least squares on further columns (M, k), too."""
        return Residual(self.errors, np.hstack([self.columns, columns]))

    def of_blocks(self, blocks: Sequence[NDArray]) -> Floats:
        """Return the squares (K,) that each block of columns (M, k) explains."""
        explained = []
        for space in spaces_beyond(self.columns, blocks):
            explained.append(float(np.square(space.T @ self.left).sum()))
        return np.array(explained)

    def of_columns(self, columns: NDArray) -> Floats:
        """Return the squares (K,) that each column (M, K) explains."""
        beyond = columns - self.base @ (self.base.T @ columns)
        size = np.square(beyond).sum(axis=0)
        is_beyond = size > WITHIN * np.square(columns).sum(axis=0)
        return np.where(is_beyond, np.square(self.left @ beyond) / np.where(is_beyond, size, 1.0), 0.0)

    def of_readings(self) -> Floats:
        """The squares (M,) that each error explains, were it free."""
        free = 1.0 - np.square(self.base).sum(axis=1)
        return np.where(free > WITHIN, np.square(self.left) / np.maximum(free, WITHIN), 0.0)


@dataclass(frozen=True, eq=False)
class LeadingFunctions:
    """Functions and effects of few coefficients, breaks and readings of a record, over the bounds of its rows."""

    evidence: Evidence

    @cached_property
    def residual(self) -> Residual:
        """The residual of the model without effects."""
        rows = self.evidence.rows
        return Residual(rows.residual / rows.bound, rows.nominal / rows.bound[:, None])

    @cached_property
    def effects(self) -> dict[EffectPlace, Floats]:
        """Columns (M, k) of each effect of the catalogue, one of each class."""
        columns = {}
        for place in self.evidence.model.classes.places:
            if coefficient_count(place) <= MOST_NUMBERS:
                columns[place] = self._over_bounds(self.evidence.rows.columns_of([place]))
        return columns

    @cached_property
    def functions(self) -> list[Floats]:
        """Columns (M, k) of functions of each quantity at each place."""
        columns = []
        for pair in self.evidence.reader.pairs:
            columns += [self._over_bounds(block) for block in _functions_of(pair)]
        return columns

    def breaks(self) -> Iterator[Floats]:
        """Columns (M, K) of each parameter that changes once, at every gap with two positions on each side."""
        position = np.arange(len(self.residual.errors)) // 3
        last = int(position.max(initial=0)) - 1
        gaps = np.unique(np.linspace(2, last, min(max(last - 1, 0), MOST_GAPS)).astype(int))
        is_after = position[:, None] >= gaps
        for column in self.residual.columns.T:
            yield column[:, None] * is_after

    def is_noise(self, residual: Residual) -> bool:
        """Return true if the best candidate explains no more of a residual than it would of noise."""
        explained = [residual.of_blocks([*self.effects.values(), *self.functions]), residual.of_readings()]
        explained += [residual.of_columns(columns) for columns in self.breaks()]
        every = np.concatenate(explained)
        most = BY_CHANCE * 2.0 * math.log(len(every)) / residual.freedom
        return float(every.max()) <= most * residual.squares

    def _over_bounds(self, columns: NDArray) -> Floats:
        return columns / self.evidence.rows.bound[:, None]


def _functions_of(pair: Pair) -> Iterator[Floats]:
    """Columns (M, k) of powers or harmonics of one pair, one by one."""
    if pair.told:
        yield pair.columns(Form("values"))
    elif pair.circle:
        for order in range(1, HARMONICS + 1):
            yield pair.columns(Form("harmonic", order))
    elif np.ptp(pair.values) > 0.0:
        powers = pair.columns(Form("powers", HIGHEST_POWER))
        for column in powers.T:
            yield column[:, None]
