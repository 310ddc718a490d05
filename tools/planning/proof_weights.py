"""Positions spread as weights over the cells where they may lie: can they put a weight of one into each region?

For the certificates of `proof`: a set of positions does, so where no spread can there is no set. It is a linear
programme over the few cells and regions that matter, taken in as they are found; its duals are weights of cuts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import highspy
import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import solved, solver
from .proof_cuts import Cuts

BEGUN, MORE = 15, 12
"""Regions that a programme of weights begins with at least, and takes in at a time."""
WHOLE_WEIGHT = 1000
"""Weights of cuts add up to about this."""


class Item:
    """So many positions in these cells; which part of the cells' area each region has."""

    def __init__(self, cells: NDArray, count: int, share: NDArray | None = None):
        self.cells, self.count = cells, count
        self._share = np.zeros(0, dtype=np.float32) if share is None else share

    def share(self, cuts: Cuts) -> NDArray:
        if len(self._share) < cuts.rows:
            area = cuts.cells.area[self.cells]
            self._share = np.append(self._share, cuts.hit(self.cells, area / area.sum(), len(self._share)))
        return self._share

    def of(self, count: int) -> "Item":
        return Item(self.cells, count, self._share)

    def within(self, region: NDArray, count: int) -> "Item":
        """So many in those of its cells that are in a region (n²,)."""
        return Item(self.cells[region[self.cells]], count)


Items = list[Item]


@dataclass(frozen=True, eq=False)
class Spread:
    """Positions spread as weights over their items' cells: the cells (K,), their weights, the least that a region has.

    `regions` are those that bind it. Where it is below one for certain `refuting` has cuts with whole weights.
    """

    least: float
    cells: NDArray
    weight: NDArray
    regions: list[int]
    refuting: tuple[tuple[int, int], ...] = ()


class _Weights:
    """The programme of a spread, the least weight in a region greatest, over the cells and regions taken in so far."""

    def __init__(self, items: Items, cuts: Cuts):
        self._items, self._cuts, self._highs = items, cuts, solver()
        self.regions, self.columns = list[int](), dict[tuple[int, int], None]()
        self._hit = np.zeros((0, cuts.cells.size**2), dtype=np.float32)
        count, empty = np.array([float(item.count) for item in items]), np.zeros(0)
        none = np.zeros(0, dtype=np.int32)
        self._highs.addRows(len(items), count, count, 0, np.zeros(len(items), dtype=np.int32), none, empty)  # pyright: ignore
        self._highs.addCol(-1.0, -highspy.kHighsInf, highspy.kHighsInf, 0, none, empty)  # pyright: ignore

    def add_regions(self, rows: Sequence[int]) -> bool:
        """Take in regions, and say whether there were new ones."""
        rows = [row for row in dict.fromkeys(rows) if row not in self.regions]
        if not rows:
            return False
        more = self._cuts.regions(rows)
        within = np.column_stack([-np.ones(len(rows)), more[:, [cell for _, cell in self.columns]]])
        at, index = np.nonzero(within)
        none, infinite = np.zeros(len(rows)), np.full(len(rows), highspy.kHighsInf)
        start = np.searchsorted(at, np.arange(len(rows))).astype(np.int32)
        self._highs.addRows(len(rows), none, infinite, len(at), start, index.astype(np.int32), within[at, index])  # pyright: ignore
        self._hit = np.vstack([self._hit, more])
        self.regions += rows
        return True

    def add_cells(self, columns: Sequence[tuple[int, int]]) -> bool:
        """Take in cells of items (item, cell), and say whether there were new ones."""
        columns = [column for column in dict.fromkeys(columns) if column not in self.columns]
        if not columns:
            return False
        items, cells = np.array(columns).T
        own = np.arange(len(self._items)) == items[:, None]
        within = np.column_stack([own, self._hit[:, cells].T]).astype(float)
        at, index = np.nonzero(within)
        none, infinite = np.zeros(len(columns)), np.full(len(columns), highspy.kHighsInf)
        start = np.searchsorted(at, np.arange(len(columns))).astype(np.int32)
        self._highs.addCols(
            len(columns), none, none, infinite, len(at), start, index.astype(np.int32), within[at, index]
        )  # pyright: ignore
        self.columns |= dict.fromkeys(columns)
        return True

    def best(self, weights: NDArray) -> list[tuple[float, int]]:
        """Of each item the greatest sum of the weights (R,) of the regions that a cell of it is in, and the cell."""
        value = weights.astype(np.float32) @ self._hit
        found = []
        for item in self._items:
            own = value[item.cells]
            most = int(own.argmax())
            found.append((float(own[most]), int(item.cells[most])))
        return found

    def solve(self) -> tuple[float, NDArray, NDArray]:
        """The least weight in a region, the weight of each cell, and the duals of the regions, which add up to one."""
        solution = solved(self._highs)
        values = np.array(solution.col_value)
        duals = np.abs(np.array(solution.row_dual)[len(self._items) :])
        return float(values[0]), values[1:], duals / max(duals.sum(), 1e-12)

    def refuting(self, duals: NDArray) -> tuple[tuple[int, int], ...]:
        """Cuts with whole weights of which the items cannot have as much as all; none where the duals prove nothing."""
        whole = np.round(duals * WHOLE_WEIGHT)
        best = self.best(whole)
        if sum(item.count * value for item, (value, _) in zip(self._items, best, strict=True)) > whole.sum() - 0.5:
            return ()
        return tuple((self.regions[k], int(whole[k])) for k in np.flatnonzero(whole))


def spread_of(items: Items, cuts: Cuts, rows: NDArray, begun: tuple[Sequence[int], NDArray], rounds: int) -> Spread:
    """Positions as weights, so that regions (rows) have as much as can be, or until each has one.

    `begun` are regions and cells to begin with.
    """
    programme, known = _Weights(items, cuts), set(rows.tolist())
    regions = [row for row in begun[0] if row in known]
    if len(regions) < BEGUN // 3:
        expected = sum(item.count * item.share(cuts)[rows] for item in items)
        regions += rows[np.argsort(expected, kind="stable")[:BEGUN]].tolist()
    programme.add_regions(regions)
    first = programme.best(np.ones(len(programme.regions)))
    near = np.zeros(cuts.cells.size**2, dtype=bool)
    near[begun[1]] = True
    programme.add_cells(
        [(k, int(cell)) for k, item in enumerate(items) for cell in (*item.cells[near[item.cells]], first[k][1])]
    )
    for _ in range(rounds):
        least, weight, duals = programme.solve()
        best = programme.best(duals)
        used = np.flatnonzero(weight > 1e-9)
        cells = np.array([cell for _, cell in programme.columns])[used]
        binding = [programme.regions[k] for k in np.flatnonzero(duals > 1e-9)]
        found = Spread(least, cells, weight[used], binding)
        most = sum(item.count * value for item, (value, _) in zip(items, best, strict=True))
        if most < 1.0 - 1e-6 and (refuting := programme.refuting(duals)):
            return Spread(least, cells, weight[used], binding, refuting)
        hit = cuts.hit(cells, weight[used])[rows]
        if hit.min() >= 1.0 - 1e-6:
            return found
        worst = [int(rows[k]) for k in np.argsort(hit, kind="stable")[:MORE] if hit[k] < min(least, 1.0) - 1e-6]
        more = programme.add_cells([(k, cell) for k, (_, cell) in enumerate(best)])
        if not programme.add_regions(worst) and not more:
            return found
    return found
