"""Look for the certificate of `proof` that no N positions reach a ratio: a tree, and the cuts that it needs.

A state says of each position, or of several, in which cells it lies. A cut that only one of these items meets narrows
it, and so on until nothing changes; what no item meets refutes the state. Else the state is divided: an item whose
cells are apart, between them; or by which item hits the cut that the fewest positions would, drawn at random from their
cells; or an item in the middle. Where every cut would be hit by many, cuts are looked for that fewer would hit: from
one y of each target at once, steps down the gradient of the weight of the cells with |F'y| > 1, the step at 1 made ever
steeper. A state that lies within one that is refuted, or within its image under a symmetry, needs no proof of its own.

A tree that is found is only proposed: what holds is what `Proof.verify` says.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import progress_bar
from .certificate import scaled_optimum
from .continuum import Continuum
from .forms import basis, clearance, sheets, x_from_targets
from .positions import Task, task_of, wanted
from .proof import Cut, Node, OptimalPlan, Proof, Reading
from .request import Request

QUARTER_DEG = (1.33, 2.6, 4.0, 6.0, 9.0, 13.0, 19.0, 26.0, 35.0, 45.0)
"""Lines between cells: narrow beside the multiples of 90°, where positions are to be."""
SAMPLES = np.linspace(0.0, 1.0, 13)
"""Where a cell's clearance is looked at, along each angle."""
STEPS, STEP = 40, 0.06
STEEP, AIM = (0.25, 0.008), 0.99
"""First and last width of the step at 1 of |F'y|, which stands a little lower."""
DECIMALS = 5
FIRST_DRAWN, DRAWN = 2500, 700
"""Cells at most that a descent looks at, drawn at random by their weight; before the tree begins, and in it."""
FIRST_TRIES = 5
"""Cuts for each target, from random y, before the tree begins."""
FEW = 0.6
"""New cuts are looked for where the expected number of positions that hit a cut is no less than this for any cut."""
ROUNDS, NEW = 2, 2
"""So often in a node, and so many cuts at most each time."""
APART_DEG = 5.0
"""Cells with a gap as wide as this between them are apart."""
SURE = 0.2
"""A cut that so few positions are expected to hit is used before items are divided that are apart."""
LOOK_DEPTH, LOOKED_AT = 12, 4
"""Down to here divisions are tried, so many of each kind, and the one is taken that leaves the positions least room."""
ALIKE_DEPTH = 8
"""Down to here a state is compared with those that are refuted."""
WHOLE, NONE = 1.0 - 1e-6, 1e-9


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

    @property
    def rows(self) -> int:
        """Number of regions, 16 for each cut."""
        return 16 * len(self.found)

    def region(self, row: int) -> NDArray:
        """The cells (n²,) of a region, as bool."""
        return self._regions[:, row] > 0.0

    def share(self, cells: NDArray, first: int) -> NDArray:
        """Which part of the area of these cells each region from the first on has."""
        area = self.cells.area[cells]
        return (area / area.sum()) @ self._regions[cells, first : self.rows]

    def tried(self, weight: NDArray, drawn: int) -> list[tuple[float, int, NDArray, NDArray]]:
        """A y for each target by descent with these weights (n²,): the weight of its region, target, y and region."""
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
        found = []
        for k, y in enumerate(_descended(rows, among, start, self._aims)):
            y = np.round(y, DECIMALS)
            y[k] = np.ceil((self._aims[k] + 1e-8) * 10.0**DECIMALS) / 10.0**DECIMALS
            region = self.cells.region(y)
            found.append((float(weight @ region), k, y, region))
        return found

    def add(self, target: int, y: NDArray, region: NDArray) -> None:
        """Keep one."""
        if self.rows + 16 > self._regions.shape[1]:
            self._regions = np.hstack([self._regions, np.zeros_like(self._regions)])
        self._regions[:, self.rows : self.rows + 16] = region[self.cells.images].T
        self.found.append((target, y))


class _Item:
    """So many positions in these cells; which part of the cells' area each region has."""

    def __init__(self, cells: NDArray, count: int, share: NDArray):
        self.cells, self.count, self._share = cells, count, share

    def share(self, cuts: Cuts) -> NDArray:
        if len(self._share) < cuts.rows:
            self._share = np.append(self._share, cuts.share(self.cells, len(self._share)))
        return self._share

    def of(self, count: int) -> "_Item":
        return _Item(self.cells, count, self._share)

    def within(self, region: NDArray, count: int) -> "_Item":
        """So many in those of its cells that are in a region (n²,)."""
        return _Item(self.cells[region[self.cells]], count, np.zeros(0))


Items = list[_Item]


def _put(items: Items, which: int, region: NDArray) -> Items:
    """One position of an item is in the region; the item's others come last."""
    item = items[which]
    rest = [item.of(item.count - 1)] if item.count > 1 else []
    return [*items[:which], item.within(region, 1), *items[which + 1 :], *rest]


def _without(items: Items, which: int, region: NDArray) -> Items:
    """No position of an item is in the region."""
    return [*items[:which], items[which].within(~region, items[which].count), *items[which + 1 :]]


@dataclass
class _Refuted:
    """Nodes that are done with: of each image of their state, what is outside an item's cells, and its positions."""

    number: int
    images: list[list[tuple[int, int]]]


class _GaveUp(Exception):
    """The tree has more nodes than are allowed, or a state that nothing refutes and that cannot be divided."""


class _Tree:
    def __init__(self, cuts: Cuts, most: int, report: Callable[..., None]):
        self.nodes: list[Node] = []
        self._cuts, self._most, self._report = cuts, most, report
        self._refuted: list[_Refuted] = []

    def grow(self, items: Items, rows: NDArray, depth: int, share: float) -> None:
        """Refute a state; `rows` are the regions that not all of its sets hit, `share` its part of the work."""
        number, start, cuts = len(self.nodes), items, self._cuts
        if number >= self._most:
            raise _GaveUp
        if depth < ALIKE_DEPTH and (like := self._like(items)) is not None:
            self.nodes.append(Node(like=like))
            self._report(share)
            return
        narrow: list[int] = []
        for step in range(ROUNDS + 1):
            items, rows, refuting = self._narrowed(items, rows, narrow)
            if refuting is not None:
                self.nodes.append(Node(narrow=tuple(narrow), cover=refuting))
                self._report(share)
                self._keep(number, start, depth)
                return
            expected = self._met(items, rows) @ np.array([float(item.count) for item in items])
            least = expected.min(initial=np.inf)
            if least < FEW or step == ROUNDS:
                break
            before = cuts.rows
            if not self._add(items, least):
                break
            rows = np.append(rows, np.arange(before, cuts.rows))
        known = cuts.rows
        if not (ways := self._ways(items, rows, expected)):
            raise _GaveUp
        if len(ways) > 1 and depth < LOOK_DEPTH:
            before = sum(item.count * np.log(cuts.cells.area[item.cells].sum()) for item in items)
            sizes = [sum(self._size(child, rows, before) for child in children) for _, children in ways]
            ways = [ways[int(np.argmin(sizes))]]
        way, children = ways[0]
        self.nodes.append(way.model_copy(update={"narrow": tuple(narrow)}))
        for child in children:
            self.grow(child, np.append(rows, np.arange(known, cuts.rows)), depth + 1, share / len(children))
        self._keep(number, start, depth)

    def _met(self, items: Items, rows: NDArray) -> NDArray:
        """Which part of each item's cells is in each of these regions (R, items)."""
        return np.array([item.share(self._cuts)[rows] for item in items]).T

    def _narrowed(self, items: Items, rows: NDArray, narrow: list[int]) -> tuple[Items, NDArray, int | None]:
        """The items, narrowed by regions that one alone meets; what regions are open; a region that none meets."""
        part = self._met(items, rows)
        while True:
            meets = part > NONE
            if (none := ~meets.any(axis=1)).any():
                return items, rows, int(rows[none.argmax()])
            is_open = ~(part > WHOLE).any(axis=1)
            rows, part, meets = rows[is_open], part[is_open], meets[is_open]
            if not len(alone := np.flatnonzero(meets.sum(axis=1) == 1)):
                return items, rows, None
            item = meets[alone].argmax(axis=1)
            single = np.array([items[i].count == 1 for i in item])
            if single.any():
                alone, item = alone[single], item[single]
            size = part[alone, item]
            for i in np.unique(item) if single.any() else item[[size.argmin()]]:
                row = int(rows[alone[item == i][size[item == i].argmin()]])
                narrow.append(row)
                items = _put(items, i, self._cuts.region(row))
                part[:, i] = items[i].share(self._cuts)[rows]
            if len(items) > part.shape[1]:
                part = np.column_stack([part, items[-1].share(self._cuts)[rows]])

    def _add(self, items: Items, least: float) -> bool:
        """Look for cuts that fewer positions hit; whether there were any."""
        weight = np.zeros(self._cuts.cells.size**2)
        for item in items:
            area = self._cuts.cells.area[item.cells].astype(float)
            weight[item.cells] += item.count * area / area.sum()
        found = [each for each in self._cuts.tried(weight, DRAWN) if each[0] < 0.9 * least]
        for _, target, y, region in sorted(found, key=lambda each: each[0])[:NEW]:
            self._cuts.add(target, y, region)
        return bool(found)

    def _size(self, items: Items, rows: NDArray, before: float) -> float:
        """About how much work a state is, of one whose positions have cells of this area (its logarithm)."""
        items, _, refuting = self._narrowed(items, rows, [])
        if refuting is not None:
            return 0.0
        return float(
            np.exp(0.3 * (sum(i.count * np.log(self._cuts.cells.area[i.cells].sum()) for i in items) - before))
        )

    def _ways(self, items: Items, rows: NDArray, expected: NDArray) -> list[tuple[Node, list[Items]]]:
        """Nodes that divide a state, and their children; the one to take unless one looks ahead comes first."""
        covers = [int(rows[k]) for k in np.argsort(expected, kind="stable")[:LOOKED_AT] if expected[k] < 1.5]
        apart, wide = self._divisions(items)
        found = [self._covered(items, row) for row in covers]
        divided = [self._divided(items, *way) for way in apart[:LOOKED_AT] or (() if covers else wide[:2])]
        return found + divided if expected.min(initial=np.inf) < SURE else divided + found

    def _covered(self, items: Items, row: int) -> tuple[Node, list[Items]]:
        region, children = self._cuts.region(row), list[Items]()
        for which, met in enumerate(self._met(items, np.array([row]))[0]):
            if met > NONE:
                children.append(_put(items, which, region))
                items = _without(items, which, region)
                if not len(items[which].cells):
                    break
        return Node(cover=row), children

    def _divided(self, items: Items, which: int, axis: int, lines: NDArray) -> tuple[Node, list[Items]]:
        line = np.arange(self._cuts.cells.size**2)
        line = line // self._cuts.cells.size if axis == 0 else line % self._cuts.cells.size
        region = np.isin(line, lines)
        node = Node(split=(which, axis, int(lines[0]), len(lines)))
        return node, [_put(items, which, region), _without(items, which, region)]

    def _divisions(self, items: Items) -> tuple[list[tuple[int, int, NDArray]], list[tuple[int, int, NDArray]]]:
        """Of items whose cells are apart, the largest first, and of others, the widest: which, axis, lines."""
        cells = self._cuts.cells
        apart, wide = list[tuple[float, tuple[int, int, NDArray]]](), list[tuple[float, tuple[int, int, NDArray]]]()
        for which, item in enumerate(items):
            if len(item.cells) == cells.size**2:
                continue
            for axis in (0, 1):
                line = item.cells // cells.size if axis == 0 else item.cells % cells.size
                used = np.unique(line)
                if len(used) < 2:
                    continue
                low, width = cells.low_deg[used], cells.width_deg[used]
                gap = np.append(low[1:], low[0] + 360.0) - low - width
                turn = gap.argmax() + 1
                used, gap, width = np.roll(used, -turn), np.roll(gap, -turn)[:-1], np.roll(width, -turn)
                if gap.max() > APART_DEG:
                    size, order, found = int(gap.argmax()) + 1, -float(len(item.cells)), apart
                else:
                    part = np.cumsum(np.bincount(line, cells.area[item.cells], cells.size)[used])
                    size = int(np.abs(part[:-1] / part[-1] - 0.5).argmin()) + 1
                    order, found = -float(width.sum()) / min(item.count, 2), wide
                lines = (used[0] + np.arange((used[size - 1] - used[0]) % cells.size + 1)) % cells.size
                found.append((order, (which, axis, lines)))
        for found in (apart, wide):
            found.sort(key=lambda each: each[0])
        return [way for _, way in apart], [way for _, way in wide]

    def _bits(self, cells: NDArray) -> int:
        mask = np.zeros(self._cuts.cells.size**2, dtype=bool)
        mask[cells] = True
        return int.from_bytes(np.packbits(mask).tobytes(), "big")

    def _keep(self, number: int, items: Items, depth: int) -> None:
        if depth < ALIKE_DEPTH:
            known = sorted(items, key=lambda item: len(item.cells))
            images = [
                [(~self._bits(image[item.cells]), item.count) for item in known] for image in self._cuts.cells.images
            ]
            self._refuted.append(_Refuted(number, images))

    def _like(self, items: Items) -> int | None:
        """A node that is done with, of whose sets, or of their images, all those of this state are."""
        mine = [(self._bits(item.cells), item.count) for item in sorted(items, key=lambda item: len(item.cells))]
        for refuted in reversed(self._refuted):
            if any(_within(mine, image) for image in refuted.images):
                return refuted.number
        return None


def _within(mine: list[tuple[int, int]], image: list[tuple[int, int]]) -> bool:
    """Whether each position lies in an item of the other's, taken in turn."""
    left = [count for _, count in mine]
    for outside, lacking in image:
        for number, (cells, _) in enumerate(mine):
            if left[number] and not cells & outside:
                taken = min(left[number], lacking)
                left[number] -= taken
                lacking -= taken
        if lacking:
            return False
    return True


def prove(
    count: int,
    ratio: float,
    *,
    nodes: int = 50000,
    seed: int = 0,
    quarter_deg: Sequence[float] = QUARTER_DEG,
    progress: bool = False,
) -> Proof | None:
    """A certificate, verified, that no `count` positions have a worst ratio below `ratio`; None where none is found.

    For the mounting `identity`, the default bounds, and the admissible set of the tables. The tree has at most so many
    nodes. An InputError where what was found does not hold.
    """
    request = Request(admissible="tables")
    optima = _optimal_plans(request)
    task = task_of(request, best=np.array([plan.cost for plan in optima]))
    cells, rng, to_x = Cells(task, quarter_deg), np.random.default_rng(seed), x_from_targets()
    cuts = Cuts(cells, ratio * task.best, rng)
    for _ in range(FIRST_TRIES):
        for _, target, y, region in cuts.tried(cells.area.astype(float), FIRST_DRAWN):
            cuts.add(target, y, region)
    everywhere = _Item(np.arange(cells.size**2), count, np.zeros(0))
    with progress_bar(f"{count} positions, {ratio:g}", 1.0, show=progress) as report:
        tree = _Tree(cuts, nodes, report)
        try:
            tree.grow([everywhere], np.arange(cuts.rows), 0, 1.0)
        except _GaveUp:
            return None
    used = {number // 16 for node in tree.nodes for number in (*node.narrow, node.cover) if number is not None}
    place = {number: k for k, number in enumerate(sorted(used))}

    def renumbered(number: int | None) -> int | None:
        return None if number is None else 16 * place[number // 16] + number % 16

    proof = Proof(
        positions=count,
        ratio=ratio,
        bounds=task.request.bounds,
        admissible="tables",
        quarter_deg=tuple(quarter_deg),
        optima=optima,
        cuts=tuple(
            Cut(target=optima[k].target, y=tuple(np.round(to_x @ y, DECIMALS).tolist()))
            for k, y in (cuts.found[number] for number in place)
        ),
        nodes=tuple(
            Node(
                narrow=tuple(16 * place[number // 16] + number % 16 for number in node.narrow),
                cover=renumbered(node.cover),
                split=node.split,
                like=node.like,
            )
            for node in tree.nodes
        ),
    )
    proof.verify()
    return proof


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


def _optimal_plans(request: Request) -> tuple[OptimalPlan, ...]:
    p, plans = request.parametrisation(), []
    everywhere = Continuum(sheets(p, bounds=request.bounds, rule=request.admissible))
    for target in wanted(p, request.convention, request.expressions):
        plan = scaled_optimum(everywhere.optimum, target.weights)
        rows = zip(plan.accelerometer + 1, np.degrees(plan.alpha), np.degrees(plan.beta), plan.weights, strict=True)
        readings = tuple(
            Reading(accelerometer=int(p), alpha_deg=float(a), beta_deg=float(b), weight=float(w)) for p, a, b, w in rows
        )
        cost = float(np.abs(plan.weights).sum()) + 5e-10
        plans.append(OptimalPlan(target=target.symbol, cost=cost, readings=readings))
    return tuple(plans)
