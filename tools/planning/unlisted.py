"""Positions that show a fault that is in no catalogue, whatever its law, from as small a size on as can be.

The power of a set of positions is that of `evidence.bench_power`, for the pairs of place and quantity that depend on
the position alone. It is a linear programme for each pair and knot; while positions are exchanged, least squares stand
in for it: the variance of what a function has of its own, in a model with the bench's parameters and the function. One
position after the other goes to the place on a lattice where the worst pair, relative to what the whole lattice gives,
is best; the sets that are found are compared by the programmes themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Positions, reading_jacobian
from ..evidence.bench_power import class_of, judged_pairs
from ..evidence.bench_visits import Circumstances, Visits
from ..evidence.power import largest_hidden
from ..progress import progress_bar
from ..result import Result, finite_or_none
from .positions import Places, Task, allowed, on_all_mountings, readings

STEP_DEG = 15.0
"""Of the lattice; it lies between the multiples of 90°, where inputs would be of no certain sign."""
FLOOR = 1e-8
"""What every function is determined by, at least, so that a set which does not determine all can be compared."""
SHARP = 6
"""The power to which ratios of variances are raised before they are summed: the worst ones count."""
SWEEPS = 12
GAIN = 1e-3
"""A sweep that gains relatively less is the last."""
FEW = 10
"""One of so many of the request's starts is made: each takes seconds."""


class UnlistedSize(Result):
    """From which size on an unknown function of a quantity at a place is surely seen; None: from none.

    Attributes
    ----------
    place, quantity : str
    factor : str
        by which the function is multiplied; empty without
    size : float or None
        in σ: of a function whose values are in rad, as angles over σ
    """

    omitted = frozenset({"factor"})

    place: str
    quantity: str
    factor: str = ""
    size: float | None


@dataclass(frozen=True, eq=False)
class Lattice:
    """Places where positions may go, and of each pair the columns (n, 3, m) there and what counts of them (k, m)."""

    places: Places
    columns: tuple[NDArray, ...]
    told: tuple[NDArray, ...]

    @staticmethod
    def of(task: Task) -> "Lattice":
        """All places of the lattice that are allowed, at multiples of the table's resolution, with every mounting."""
        degrees = np.arange(0.5 * STEP_DEG, 360.0, STEP_DEG)
        if task.request.resolution_deg is not None:
            degrees = np.unique(np.round(degrees / task.request.resolution_deg) * task.request.resolution_deg % 360.0)
        angle = np.radians(np.stack(np.meshgrid(degrees, degrees, indexing="ij"), axis=-1).reshape(-1, 2))
        places = on_all_mountings(angle[allowed(task, angle)], len(task.parametrisation.mountings))
        counted, visits = counts(task, places), visits_of(task, places)
        jacobian = jacobian_at(task, places)
        columns, told = [], []
        for pair in judged_pairs(visits.rows(np.zeros(jacobian.shape[1]))):
            own, values = class_of(pair, task.parametrisation, jacobian)
            columns.append(own.reshape(len(places), 3, -1) * counted[:, :, None])
            told.append(values)
        return Lattice(places, tuple(columns), tuple(told))

    @cached_property
    def best(self) -> NDArray[np.float64]:
        """The worst variance (pairs,) of each pair for one position, were all of the lattice measured as often."""
        found = [_variances(_information(c) / len(c), t).max() for c, t in zip(self.columns, self.told, strict=True)]
        return np.array(found)

    def nearest(self, places: Places) -> NDArray[np.int_]:
        """The rows (N,) of the lattice that are nearest to other places with the same mountings."""
        apart = np.abs(np.angle(np.exp(1j * (self.places.angle[None] - places.angle[:, None])))).max(axis=2)
        apart[self.places.mounting[None] != places.mounting[:, None]] = np.inf
        return apart.argmin(axis=1)

    def merit(self, rows: NDArray) -> float:
        """The sum of the ratios of all pairs, each to a high power."""
        worst = [_variances(_information(c[rows]), t).max() for c, t in zip(self.columns, self.told, strict=True)]
        return float(((np.array(worst) * len(rows) / self.best) ** SHARP).sum() ** (1.0 / SHARP))

    def exchanged(self, rows: NDArray) -> NDArray[np.int_]:
        """The set (N,) with each position in turn at the best place of the lattice, until that gains little."""
        rows, before = rows.copy(), self.merit(rows)
        for _ in range(SWEEPS):
            for at in range(len(rows)):
                rows[at] = int(self._merits_beside(np.delete(rows, at)).argmin())
            now = self.merit(rows)
            if now > (1.0 - GAIN) * before:
                break
            before = now
        return rows

    def _merits_beside(self, rows: NDArray) -> NDArray[np.float64]:
        """The merit of these positions with each of the lattice (n,)."""
        total = np.zeros(len(self.places))
        for columns, told, best in zip(self.columns, self.told, self.best, strict=True):
            inverse = np.linalg.inv(_information(columns[rows]))
            spread, seen = told @ inverse, columns @ inverse
            # One position more is a change of rank three.
            inner = np.linalg.inv(np.eye(3) + seen @ columns.transpose(0, 2, 1))
            less = seen @ told.T
            variances = (spread * told).sum(axis=1) - np.einsum("nik,nij,njk->nk", less, inner, less, optimize=True)
            total += (variances.max(axis=1) * (len(rows) + 1) / best) ** SHARP
        return total


def _information(columns: NDArray) -> NDArray[np.float64]:
    rows = columns.reshape(-1, columns.shape[-1])
    return rows.T @ rows + FLOOR * np.eye(columns.shape[-1])


def _variances(information: NDArray, told: NDArray) -> NDArray[np.float64]:
    return (told @ np.linalg.inv(information) * told).sum(axis=1)


def counts(task: Task, places: Places) -> NDArray[np.bool_]:
    """Which readings (N, 3) count: those whose sign is certain."""
    given = readings(task, places)
    found = np.zeros((len(places), 3), dtype=bool)
    found[given.position, task.accelerometer[given.sheet]] = True
    return found


def visits_of(task: Task, places: Places) -> Visits:
    """The places, without times, temperatures and senses."""
    still = np.zeros(len(places))
    at = Positions(places.angle[:, 0], places.angle[:, 1], places.mounting)
    return Visits(task.parametrisation, at, Circumstances(still, None, still, still, True))


def jacobian_at(task: Task, places: Places) -> NDArray[np.float64]:
    """Derivatives (3 N, P) of the readings of a faultless bench."""
    point = np.zeros(len(task.parametrisation.symbols))
    return reading_jacobian(task.parametrisation, point, visits_of(task, places).at).reshape(3 * len(places), -1)


def sizes_of(task: Task, places: Places) -> tuple[UnlistedSize, ...]:
    """From which size on each pair that depends on the position alone is surely seen at a set of positions."""
    jacobian, kept = jacobian_at(task, places), counts(task, places).ravel()
    found = []
    for pair in judged_pairs(visits_of(task, places).rows(np.zeros(jacobian.shape[1]))):
        columns, told = class_of(pair, task.parametrisation, jacobian)
        size = largest_hidden(columns[kept], told, np.full(kept.sum(), 2.0))
        found.append(
            UnlistedSize(place=pair.where, quantity=pair.quantity, factor=pair.factor, size=finite_or_none(size))
        )
    return tuple(found)


def worst_of(sizes: Sequence[UnlistedSize]) -> float:
    """The largest size; infinite where one is seen from none."""
    return max(np.inf if one.size is None else one.size for one in sizes)


def against_unlisted(
    task: Task, count: int, given: Sequence[Places], *, progress: bool = False
) -> tuple[Places, int, bool]:
    """The set of so many positions with the least worst size, how many were improved, and whether Ctrl-C ended that.

    It begins with what is nearest on the lattice to sets that are given, and with sets drawn at random.
    """
    lattice, rng = Lattice.of(task), np.random.default_rng(task.request.seed)
    starts = [lattice.nearest(places) for places in given]
    starts += [rng.choice(len(lattice.places), count, replace=False) for _ in range(-(-task.request.starts // FEW))]
    found: list[tuple[float, Places]] = []
    with progress_bar(f"{count} positions", len(starts), show=progress) as advance:
        try:
            for start in starts:
                places = lattice.places.chosen(lattice.exchanged(start))
                found.append((round(worst_of(sizes_of(task, places)), 6), places))
                advance(1, None)
        except KeyboardInterrupt:
            if not found:
                raise
    return min(found, key=lambda one: one[0])[1], len(found), len(found) < len(starts)
