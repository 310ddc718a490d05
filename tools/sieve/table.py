"""Rests on a table, linearised about a point robust to wrong rows, and changes that make a row fit."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.bench import admissible, nominal_input
from ..bounded.programmes import chebyshev_radius, least_squares
from ..calibration.estimates import widening
from ..calibration.model import Linearisation, linearise, predicted_reading, reading_jacobian
from ..evidence.bench import Bench
from ..evidence.evidence import Evidence
from .removal import Removal, held_by

ROUNDS = 30
"""Steps to a point that few rows cannot draw."""
SETTLED = 1e-9
"""Size of a step [1], [rad], [g] that changes nothing."""
ASTRAY = 0.5
"""No bench has a larger parameter [1], [rad], [g]."""
SECOND_ORDER = 0.05
"""Largest error of a linear model about a robust fit, in bounds."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """Readings at table positions, linear about a point.

    `limit` is the largest radius of a model that fits, `numbers` (N,) are those of the rows in the file.
    """

    linear: Linearisation
    limit: float
    numbers: Ints

    @staticmethod
    def of(evidence: Evidence) -> "TableRows | None":
        """The rests of evidence about a robust fit; None of a record of no table."""
        model = evidence.model
        if not isinstance(model, Bench) or evidence.source is None:
            return None
        record, gravity = evidence.source.record, model.calibration.gravity
        bound = record.bounds_with(model.calibration.noise_bound, gravity)
        p, at, reading = model.here.parametrisation, model.here.positions, model.here.reading
        point = robust_point(model.here, bound)
        linear = linearise(p, at, reading, point, bound)
        if not p.symmetric:
            matrices = p.matrices[at.mounting]
            certain = admissible(at.alpha, at.beta, matrices, bounds=model.bounds)
            certain &= (nominal_input(at.alpha, at.beta, matrices) >= 0.0) == (linear.sign > 0)
            linear = replace(linear, bound=bound + widening(linear, certain, bound, model.bounds))
        return TableRows(linear, model.limit, record.numbers)

    def __len__(self) -> int:
        return len(self.linear.reading)

    @cached_property
    def matrix(self) -> Floats:
        """Derivatives (3 N, P) over the bounds, by the combinations that the readings determine."""
        return (self.linear.jacobian @ self.linear.span) / self.linear.bound[:, None]

    @cached_property
    def target(self) -> Floats:
        """Errors (3 N,) over the bounds."""
        return self.linear.residual / self.linear.bound

    @property
    def excess(self) -> Floats:
        """Largest error of each row (N,), in bounds."""
        return np.abs(self.target.reshape(-1, 3)).max(axis=1)

    def removal(self, slack: float = SECOND_ORDER) -> Removal:
        """The search for rows to be removed."""
        return Removal(self.matrix, self.target, self.belongs, self.excess, self.limit + slack)

    @property
    def belongs(self) -> Bools:
        """Marks (3 N, N) of the row of each reading."""
        return np.repeat(np.eye(len(self), dtype=bool), 3, axis=0)

    def readings_without(self, rows: NDArray) -> Ints:
        """Numbers of the readings that remain without some rows."""
        return np.flatnonzero(~np.repeat(np.isin(np.arange(len(self)), rows), 3))

    def about(self, rows: NDArray) -> Self:
        """The same about the Chebyshev fit of all but some rows."""
        table = self
        for _ in range(3):
            kept = table.readings_without(rows)
            _, step, _ = chebyshev_radius(table.matrix[kept], table.target[kept], np.ones(len(kept)))
            linear = table.linear
            moved = linear.point + linear.span @ step
            again = linearise(
                linear.parametrisation, linear.positions, linear.reading, moved, linear.bound, linear.sign
            )
            table = replace(table, linear=again)
            if np.abs(step).max(initial=0.0) < SETTLED:
                break
        return table

    def radius_without(self, rows: NDArray) -> float:
        """The radius of all but some rows."""
        kept = self.readings_without(rows)
        return held_by(self.matrix[kept], self.target[kept])[0]

    def keeps_rank(self, rows: NDArray) -> bool:
        """Return true if the other rows determine everything that all rows determine."""
        kept = self.matrix[self.readings_without(rows)] * self.linear.bound.min()
        values = np.linalg.svd(kept, compute_uv=False)
        least = np.sqrt(float(self.linear.bound.min()))
        return len(kept) >= kept.shape[1] and bool(values.min() > max(1e-4, least))


def robust_point(here: Linearisation, bound: NDArray) -> Floats:
    """Parameters (P,) with about the least sum of the rows' misfits, which few rows cannot draw."""
    p, at = here.parametrisation, here.positions
    point = np.zeros(len(p.symbols))
    best, least = here.point, _misfit(here, here.point, bound)
    for _ in range(ROUNDS):
        residual = (here.reading - predicted_reading(p, point, at)).ravel() / bound
        size = np.linalg.norm(residual.reshape(-1, 3), axis=1) / np.sqrt(3.0)
        weight = np.repeat(1.0 / np.sqrt(np.maximum(size, 1.0)), 3)
        jacobian = reading_jacobian(p, point, at).reshape(len(residual), -1) @ here.span
        step = here.span @ least_squares(jacobian * (weight / bound)[:, None], residual * weight)
        point = np.clip(point + step, -ASTRAY, ASTRAY)
        if np.abs(step).max(initial=0.0) < SETTLED:
            break
    return point if _misfit(here, point, bound) <= least else best


def _misfit(here: Linearisation, point: NDArray, bound: NDArray) -> float:
    """The sum of the rows' misfits at a point."""
    residual = (here.reading - predicted_reading(here.parametrisation, point, here.positions)).ravel() / bound
    return float(np.linalg.norm(residual.reshape(-1, 3), axis=1).sum())
