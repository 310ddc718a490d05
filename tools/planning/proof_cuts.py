"""Cuts for the certificates of `proof`: which cells their regions meet, and where cuts come from.

A cut is a target k and a y with y_k = r c_k, and better the fewer of the cells in question its region meets. Two ways
lead to one. Where cells are many, down the gradient of the weight of those with |F'y| > 1, from one y of each target at
once, the step at 1 made ever steeper. Where they are few, by a linear programme: |F'y| ≤ 1 at all their corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import SolverError
from .certificate import Columns
from .forms import basis, clearance, sheets
from .positions import Task

SAMPLES = np.linspace(0.0, 1.0, 13)
"""Where a cell's clearance is looked at, along each angle."""
STEPS, STEP = 40, 0.06
STEEP, AIM = (0.25, 0.008), 0.99
"""First and last width of the step at 1 of |F'y|, which stands a little lower."""
DECIMALS = 5
LARGEST = 900.0
"""A y with a greater element is left: the check refuses it."""
BENT = 0.75
"""What a programme leaves for the curvature of |F'y| in a cell, by its half widths squared: the region decides."""
WORST, APART = 8, 0.97
"""So many corners more in each round of a programme, no two of them with F so near (cosine)."""
ROUNDS = 40


@dataclass(frozen=True, eq=False)
class Found:
    """A cut that was found: target, y (P,) and the cells (n²,) of its region."""

    target: int
    y: NDArray
    region: NDArray


class Cells:
    """The torus of both angles, divided: which sheets count where, F at corners and middles, images, areas."""

    def __init__(self, task: Task, quarter_deg: Sequence[float]):
        around = np.concatenate([-np.array(quarter_deg)[::-1], [0.0], quarter_deg[:-1]])
        self.low_deg = (90.0 * np.arange(4)[:, None] + around).ravel()
        self.width_deg = np.diff(np.append(self.low_deg, self.low_deg[0] + 360.0))
        self.size = n = len(self.low_deg)
        self.area = (np.outer(self.width_deg, self.width_deg).ravel() / 360.0**2).astype(np.float32)
        low, width = np.radians(self.low_deg), np.radians(self.width_deg)
        self._half = 0.5 * width
        inside = (low[:, None] + width[:, None] * SAMPLES).ravel()
        self._regressor = task.regressor
        self._counts = np.stack(
            [
                clearance(sheet, inside[:, None], inside).reshape(n, len(SAMPLES), n, len(SAMPLES)).max(axis=(1, 3))
                > 0.0
                for sheet in sheets(task.parametrisation, bounds=task.request.bounds, rule=task.request.admissible)
            ]
        )
        corner, centre = basis(low), basis(low + self._half)
        self._corners = np.einsum("spij,ai,bj->sabp", task.regressor, corner, corner, optimize=True)
        values = np.einsum("spij,ai,bj->sabp", task.regressor, centre, centre, optimize=True)
        # The middle stands for the whole cell, where F'y is greater by about as much.
        values *= (self._counts * (1.0 + 0.4 * (self._half[:, None] + self._half)))[..., None]
        first = np.argsort(~self._counts, axis=0, kind="stable")[: self._counts.sum(axis=0).max()]
        values = np.take_along_axis(values, first[..., None], axis=0)
        self.rows = values.reshape(len(values), n * n, -1).astype(np.float32)
        axes = []
        for g in range(16):
            one = []
            for sense, shift in ((g >> 3 & 1, g >> 1 & 1), (g >> 2 & 1, g & 1)):
                cell = np.arange(n)
                one.append(((n // 4 - 1 - cell if sense else cell) + shift * n // 2) % n)
            axes.append((one[0][:, None] * n + one[1]).ravel())
        self.images = np.array(axes)

    def corners(self, cells: NDArray) -> NDArray:
        """F (K, P) at the corners of these cells, of sheets that count there, a little larger for what lies between."""
        i, j = np.divmod(cells, self.size)
        reserve = 1.0 - BENT * (self._half[i] ** 2 + self._half[j] ** 2)
        parts = []
        for counts, values in zip(self._counts, self._corners, strict=True):
            own = counts[i, j]
            for a, b in ((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)):
                parts.append((values[a % self.size, b % self.size] / reserve[:, None])[own])
        return np.vstack(parts)

    def region(self, y: NDArray) -> NDArray:
        """Which cells (n²,) |F'y| may exceed one in."""
        form = np.tensordot(self._regressor, y, axes=(1, 0))
        value = np.abs(self._corners @ y)
        value = np.maximum(value, np.roll(value, -1, axis=1))
        value = np.maximum(value, np.roll(value, -1, axis=2))
        a, b = (np.sqrt(2.0) * np.linalg.norm(part, 2, axis=(1, 2)) for part in (form[:, :2], form[:, :, :2]))
        bent = a[:, None, None] * self._half[:, None] ** 2 + b[:, None, None] * self._half**2
        return (self._counts & (value + 0.5 * bent > 1.0 - 1e-7)).any(axis=0).ravel()


class Cuts:
    """Cuts that were found, with the regions of all their images."""

    def __init__(self, cells: Cells, aims: NDArray, rng: np.random.Generator):
        self.cells, self.found = cells, list[tuple[int, NDArray]]()
        self._aims, self._rng = aims, rng
        self._regions = np.zeros((cells.size**2, 1024), dtype=np.float32)
        self._images = list[NDArray]()

    @property
    def rows(self) -> int:
        """Number of regions, 16 for each cut."""
        return 16 * len(self.found)

    def region(self, row: int) -> NDArray:
        """The cells (n²,) of a region, as bool."""
        return self._regions[:, row] > 0.0

    def hit(self, cells: NDArray, weight: NDArray, first: int = 0) -> NDArray:
        """Which part of the weight of these cells each region from the first on has."""
        weight, every = weight.astype(np.float32), self._regions[:, first : self.rows]
        if 4 * len(cells) < len(every):
            return weight @ every[cells]
        return np.bincount(cells, weight, len(every)).astype(np.float32) @ every

    def regions(self, rows: Sequence[int]) -> NDArray:
        """Regions (R, n²) as numbers."""
        return np.stack([self._images[row // 16][row % 16] for row in rows])

    def descended(self, weight: NDArray, drawn: int) -> list[Found]:
        """A cut for each target by descent with these weights (n²,)."""
        inside = np.flatnonzero(weight)
        if len(inside) > drawn:
            inside = self._rng.choice(len(weight), drawn, replace=False, p=weight / weight.sum())
            among = np.full(drawn, weight.sum() / drawn)
        else:
            among = weight[inside]
        rows = self.cells.rows[:, inside]
        start = 0.5 * self._rng.normal(size=(len(self._aims), rows.shape[2]))
        for k in np.flatnonzero(self._rng.random(len(self._aims)) < 0.4):
            if known := [y for target, y in self.found if target == k]:
                start[k] = known[self._rng.integers(len(known))] + 0.1 * self._rng.normal(size=start.shape[1])
        return [self._cut(k, y) for k, y in enumerate(_descended(rows, among, start, self._aims))]

    def _cut(self, target: int, y: NDArray) -> Found:
        y = np.round(y, DECIMALS)
        y[target] = np.ceil((self._aims[target] + 1e-8) * 10.0**DECIMALS) / 10.0**DECIMALS
        return Found(target, y, self.cells.region(y))

    def excluding(self, others: "Corners", left: int) -> list[Found]:
        """A cut of each target that has one which no corner is in but those of the part that is left out."""
        found = []
        for target, aim in enumerate(self._aims):
            y = others.excluded(target, aim, left)
            if y is not None and np.abs(y).max() < LARGEST:
                found.append(self._cut(target, y))
        return found

    def add(self, cut: Found) -> None:
        """Keep one."""
        if self.rows + 16 > self._regions.shape[1]:
            self._regions = np.hstack([self._regions, np.zeros_like(self._regions)])
        self._images.append(cut.region[self.cells.images].astype(np.float32))
        self._regions[:, self.rows : self.rows + 16] = self._images[-1].T
        self.found.append((cut.target, cut.y))


class Corners:
    """The corners of the cells of several parts, and the programmes about them."""

    def __init__(self, cells: Cells, parts: Sequence[NDArray]):
        every = [cells.corners(part) for part in parts]
        self._regressors = np.vstack(every)
        self._part = np.repeat(np.arange(len(parts)), [len(each) for each in every])
        self._columns = Columns(self._regressors.shape[1])
        self._taken = np.zeros(0, dtype=int)

    def excluded(self, target: int, aim: float, left: int) -> NDArray | None:
        """y (P,) with y_k = aim and |F'y| ≤ 1 at all corners but those of the part that is left out, or None."""
        outside = np.flatnonzero(self._part[self._taken] == left)
        self._columns.close(outside)
        try:
            return self._solved(target, aim, self._part == left)
        except SolverError:
            return None
        finally:
            self._columns.close(outside, closed=False)

    def _solved(self, target: int, aim: float, outside: NDArray) -> NDArray | None:
        self._columns.aim(np.eye(self._regressors.shape[1])[target])
        for _ in range(ROUNDS):
            _, y, _ = self._columns.solve()
            if y[target] < aim * (1.0 + 1e-6):
                return None
            size = np.abs(self._regressors @ y)
            size[outside] = 0.0
            if size.max(initial=0.0) <= y[target] / aim:
                return y * (aim / y[target])
            more, left = list[int](), np.argsort(-size, kind="stable")[:400]
            left = left[size[left] > 1.0 + 1e-9]
            while len(left) and len(more) < WORST:
                more.append(int(left[0]))
                rows = self._regressors[left]
                left = left[np.abs(rows @ rows[0]) < APART * np.linalg.norm(rows, axis=1) * np.linalg.norm(rows[0])]
            if not more:
                return None
            self._columns.add(self._regressors[more])
            self._taken = np.append(self._taken, more)
        return None


def _descended(rows: NDArray, weight: NDArray, start: NDArray, aims: NDArray) -> NDArray:
    """y (K, P), each of the target in its place with y_k = aim, whose regions have little weight.

    The rows (S, n, P) are F of the cells with these weights (n,); a sheet that does not count is zero there.
    """
    flat, weight, each = rows.reshape(-1, rows.shape[2]), weight.astype(np.float32)[:, None], np.arange(len(aims))
    y = start.T.astype(np.float32)
    y[each, each] = aims
    first, second = np.zeros_like(y), np.zeros_like(y)
    for part in np.linspace(0.0, 1.0, STEPS):
        value = (flat @ y).reshape(*rows.shape[:2], -1)
        height = np.abs(value).max(axis=0)
        step = 1.0 / (
            1.0 + np.exp(-np.clip((height - AIM) / (STEEP[0] ** (1.0 - part) * STEEP[1] ** part), -15.0, 15.0))
        )
        pull = np.where(np.abs(value) == height, np.sign(value) * weight * step * (1.0 - step), 0.0)
        slope = flat.T @ pull.reshape(len(flat), -1).astype(np.float32)
        slope[each, each] = 0.0
        slope /= np.linalg.norm(slope, axis=0) + 1e-20
        first, second = 0.9 * first + 0.1 * slope, 0.98 * second + 0.02 * slope**2
        y -= STEP * 0.1**part * first / (np.sqrt(second) + 1e-3)
        y[each, each] = aims
    return y.T.astype(float)
