"""Look for the certificate of `proof` that no N positions reach a ratio: a tree, and the cuts that it needs.

A state says of each position, or of several, in which cells it lies. A cut that only one of these items meets narrows
it, and so on until nothing changes; what no item meets refutes the state. Nor can it be where even weights, an item's
positions spread at will over its cells, do not put a weight of one into each region (`proof_weights`). Else cuts are
looked for that these weights do not hit, or that no item hits but one (`proof_cuts`). Then the state is divided, by
which item hits a cut or where an item lies: of some ways the one is taken that leaves weights and positions least room.
A state that lies within one that is refuted, or within its image under a symmetry, needs no proof of its own.

A tree that is found is only proposed: what holds is what `Proof.verify` says.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import progress_bar
from .certificate import scaled_optimum
from .continuum import Continuum
from .forms import sheets, x_from_targets
from .positions import task_of, wanted
from .proof import Cut, Node, OptimalPlan, Proof, Reading
from .proof_cuts import DECIMALS, Cells, Corners, Cuts, Found
from .proof_weights import Item, Items, Spread, spread_of
from .request import Request

QUARTER_DEG = (1.33, 2.6, 4.0, 6.0, 9.0, 13.0, 19.0, 26.0, 35.0, 45.0)
"""Lines between cells: narrow beside the multiples of 90°, where positions are to be."""
FIRST_DRAWN, DRAWN = 2500, 700
"""Cells at most that a descent looks at, drawn at random by their weight; before the tree begins, and in it."""
FIRST_TRIES = 3
"""Cuts for each target, from random y, before the tree begins."""
ROUNDS, NEW = 6, 3
"""So often in a node new cuts are looked for, and so many at most each time."""
MISSED, SPREAD = 0.98, (0.05, 0.005)
"""A cut is new where the weights hit it with less than this; to find it, so much more is spread evenly, in turn."""
FEW_CELLS = 500
"""Items of more cells are no part of the programmes about corners, but as the one that is left out."""
NARROWER = 0.9
"""A cut about the other items is of use where it leaves an item no more than this part of its cells."""
APART_DEG = 5.0
"""Cells with a gap as wide as this between them are apart."""
LOOKED_AT, WIDE = 5, 3
"""So many divisions of each kind are tried; of items whose cells are not apart, so many."""
EXACT, TRIED, SWEEPS = 60, 6, 2
"""Rounds of a programme of weights; where a division is tried, and how often its state is narrowed there."""
GAIN, ROOM, MOST = 60.0, 0.3, 1.5
"""The work of a state grows with the exponential of so much of the least weight, up to a most, and of log volume."""
ALIKE_DEPTH = 8
"""Down to here a state is compared with those that are refuted."""
WHOLE, NONE = 1.0 - 1e-6, 1e-9


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

    def grow(self, items: Items, rows: NDArray, begun: tuple[Sequence[int], NDArray], depth: int, share: float) -> None:
        """Refute a state; `rows` are the regions that not all of its sets hit, `share` its part of the work.

        `begun` are regions and cells that programmes of weights begin with.
        """
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
            leaf = None if refuting is None else Node(narrow=tuple(narrow), cover=refuting)
            spread = None
            if leaf is None and len(rows):
                spread = spread_of(items, cuts, rows, begun, EXACT)
                begun = spread.regions, spread.cells
                if spread.refuting:
                    leaf = Node(narrow=tuple(narrow), weights=spread.refuting)
            if leaf is not None:
                self.nodes.append(leaf)
                self._report(share)
                self._keep(number, start, depth)
                return
            if step == ROUNDS or not (more := self._more(items, spread, step)):
                break
            before = cuts.rows
            for cut in more:
                cuts.add(cut)
            new = np.arange(before, cuts.rows)
            rows = np.append(rows, new)
            if spread is not None:
                begun = [*begun[0], *new[cuts.hit(spread.cells, spread.weight, before) < MISSED].tolist()], begun[1]
        known = cuts.rows
        if spread is None or (chosen := self._chosen(items, rows, spread)) is None:
            raise _GaveUp
        way, children = chosen
        self.nodes.append(way.model_copy(update={"narrow": tuple(narrow)}))
        for child in children:
            open_rows = np.append(rows, np.arange(known, cuts.rows))
            self.grow(child, open_rows, begun, depth + 1, share / len(children))
        self._keep(number, start, depth)

    def _met(self, items: Items, rows: NDArray) -> NDArray:
        """Which part of each item's cells is in each of these regions (R, items)."""
        return np.array([item.share(self._cuts)[rows] for item in items]).T

    def _narrowed(
        self, items: Items, rows: NDArray, narrow: list[int], sweeps: float = np.inf
    ) -> tuple[Items, NDArray, int | None]:
        """The items, narrowed by regions that one alone meets; what regions are open; a region that none meets."""
        part = self._met(items, rows)
        while True:
            meets = part > NONE
            if (none := ~meets.any(axis=1)).any():
                return items, rows, int(rows[none.argmax()])
            is_open = ~(part > WHOLE).any(axis=1)
            rows, part, meets = rows[is_open], part[is_open], meets[is_open]
            if not len(alone := np.flatnonzero(meets.sum(axis=1) == 1)) or not sweeps:
                return items, rows, None
            sweeps -= 1
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

    def _more(self, items: Items, spread: Spread | None, step: int) -> list[Found]:
        """New cuts: about all items but one at most, or else that the weights of a spread do not hit."""
        if found := self._exact(items, every=spread is None):
            return found
        if spread is None:
            return []
        area, weight = self._cuts.cells.area, np.zeros(self._cuts.cells.size**2)
        np.add.at(weight, spread.cells, spread.weight)
        mixed = weight.copy()
        for item in items:
            mixed[item.cells] += SPREAD[step % 2] * item.count * area[item.cells] / area[item.cells].sum()
        missed = [(float(weight @ cut.region), cut) for cut in self._cuts.descended(mixed, DRAWN)]
        return [cut for hit, cut in sorted(missed, key=lambda each: each[0])[:NEW] if hit < MISSED]

    def _exact(self, items: Items, every: bool) -> list[Found]:
        """Cuts that no item meets, or one alone, which they narrow: one with many cells, or where asked any other."""
        wide = [k for k, item in enumerate(items) if item.count > 1 or len(item.cells) > FEW_CELLS]
        if len(wide) > 1:
            return []
        parts = [np.zeros(0, dtype=int) if k in wide else item.cells for k, item in enumerate(items)]
        corners = Corners(self._cuts.cells, parts)
        if found := self._excluding(items, corners, wide[0] if wide else -1):
            return found
        if wide or not every:
            return []
        for k in sorted(range(len(items)), key=lambda k: -len(items[k].cells)):
            if len(items[k].cells) > 1:
                found += self._excluding(items, corners, k)
            if len(found) > NEW:
                break
        return found

    def _excluding(self, items: Items, corners: Corners, left: int) -> list[Found]:
        found = []
        for cut in self._cuts.excluding(corners, left):
            met = [item for item in items if cut.region[item.cells].any()]
            if not met:
                return [cut]
            area = self._cuts.cells.area[met[0].cells]
            part = float(area @ cut.region[met[0].cells] / area.sum())
            if len(met) == 1 and part < NARROWER:
                found.append((part, cut))
        return [cut for _, cut in sorted(found, key=lambda each: each[0])[:NEW]]

    def _chosen(self, items: Items, rows: NDArray, spread: Spread) -> tuple[Node, list[Items]] | None:
        """The division whose children seem least work, and these; None where there is none."""
        part = self._met(items, rows)
        hit = np.maximum(self._cuts.hit(spread.cells, spread.weight)[rows] - 1.0, 0.0)
        many = (part > NONE).sum(axis=1) + 3.0 * hit + part @ np.array([float(item.count) for item in items])
        apart, wide = self._divisions(items)
        ways = [self._covered(items, int(rows[k])) for k in np.argsort(many, kind="stable")[:LOOKED_AT]]
        ways += [self._divided(items, *way) for way in apart[:LOOKED_AT] or wide[:WIDE]]
        least, chosen = np.inf, None
        for way, children in ways:
            work = 0.0
            for child in children:
                work += self._work(child, rows, spread, self._room(items))
                if work >= least:
                    break
            if work < least:
                least, chosen = work, (way, children)
            if not work:
                break
        return chosen

    def _room(self, items: Items) -> float:
        return float(sum(item.count * np.log(self._cuts.cells.area[item.cells].sum()) for item in items))

    def _work(self, items: Items, rows: NDArray, spread: Spread, room: float) -> float:
        """About how much work a state is, of one with this spread and room."""
        items, rows, refuting = self._narrowed(items, rows, [], SWEEPS)
        if refuting is not None:
            return 0.0
        least = MOST
        if len(rows):
            found = spread_of(items, self._cuts, rows, (spread.regions, spread.cells), TRIED)
            if found.refuting:
                return 0.0
            least = min(found.least, MOST)
        return float(np.exp(GAIN * (least - spread.least) + ROOM * (self._room(items) - room)))

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
    nodes; with one thread of linear algebra it is the same each time. An InputError where what was found does not hold.
    """
    request = Request(admissible="tables")
    optima = _optimal_plans(request)
    task = task_of(request, best=np.array([plan.cost for plan in optima]))
    cells, rng, to_x = Cells(task, quarter_deg), np.random.default_rng(seed), x_from_targets()
    cuts = Cuts(cells, ratio * task.best, rng)
    for _ in range(FIRST_TRIES):
        for cut in cuts.descended(cells.area.astype(float), FIRST_DRAWN):
            cuts.add(cut)
    everywhere = Item(np.arange(cells.size**2), count)
    with progress_bar(f"{count} positions, {ratio:g}", 1.0, show=progress) as report:
        tree = _Tree(cuts, nodes, report)
        try:
            tree.grow([everywhere], np.arange(cuts.rows), ([], np.zeros(0, dtype=int)), 0, 1.0)
        except _GaveUp:
            return None
    used = {number // 16 for node in tree.nodes for number in node.cuts}
    place = {number: k for k, number in enumerate(sorted(used))}
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
        nodes=tuple(node.renumbered(lambda number: 16 * place[number // 16] + number % 16) for node in tree.nodes),
    )
    proof.verify()
    return proof


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
