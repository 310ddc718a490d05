"""The proof that no N positions, at whatever angles, reach a ratio for all targets: a certificate, and its check.

The check shares nothing with the search that made the certificate (`proof_search`): it has its own regressors, cells,
symmetries and bounds. It is for the mounting `identity`.

A cut is a target k and a y with a'y ≥ r c_k, c_k the target's optimum. Where |F'y| ≤ 1 at every reading of a set, the
set's cost of k is at least a'y: so a set that reaches r has a position in the cut's region, where some |F'y| > 1. The
torus of both angles is divided into cells by lines; a region is the cells that may meet it. |F'y| in a cell is at most
its greatest value at the corners and, by linear interpolation along one angle after the other, h²/2 times the greatest
second derivative by each angle, h half of the cell's width. A reading counts in a cell where, by intervals, (1.9) may
hold somewhere in it.

The tree divides the sets of positions. A state is a list of items: so many positions lie in these cells. A node first
uses cuts whose region only one item meets: one of its positions is in the region. Then it divides, by which item has
the position that hits a cut, and is done with where none can; or by whether any of an item's positions is between two
lines; or every set in its state is also in that of an earlier node, or in its image under one of the sixteen symmetries
θ → ±θ + (0 or π) of both angles, which take readings to readings and targets to targets.
Regions are rounded outwards; the rest is sets of cells, which are integers, one bit for each cell.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import cache, cached_property, lru_cache
from itertools import product
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..result import Result

State = tuple[tuple[int, int], ...]
"""Items: cells, as the bits of a number, and how many positions lie in them. An item may lie within another."""

STAND = (((0, (2, 0), -1), (1, (0, 1), -1), (2, (0, 0), -1)), ((0, (2, 1), 1), (1, (0, 0), -1), (2, (0, 1), 1)))
STAND = (*STAND, ((1, (1, 2), 1),))
"""Of each accelerometer, X, (of α, of β) and sign: cosine is 0, sine 1, neither 2. (1.10) of the paper at Q = I."""
INPUTS = ((1, 1), (1, 0), (0, 2))
"""m = (sin α sin β, sin α cos β, cos α)."""
SLOTS = ((3, 7, 11), (5, 8, 12), (6, 10, 13))
"""X (from 0) by which each accelerometer, in rows, has each input; of its own, a negative one has the next X."""
TARGETS = {f"X{k}": ((k - 1, 1),) for k in (1, 2, 3, 4, 5, 9, 10, 14, 15, 8, 13, 16, 17, 18)}
TARGETS |= {"-X12": ((11, -1),), "X6+X8": ((5, 1), (7, 1)), "X7+X12": ((6, 1), (11, 1)), "X11+X13": ((10, 1), (12, 1))}
ROUNDING = 1e-9
"""Far above the rounding of sums of nine products whose coefficients are below `LARGEST`."""
LARGEST = 1e3


class Reading(Result):
    """A reading of an optimal plan: accelerometer (1 to 3), angles and weight Φ."""

    accelerometer: Annotated[int, Field(ge=1, le=3)]
    alpha_deg: float
    beta_deg: float
    weight: float


class OptimalPlan(Result):
    """A target's plan, which shows that its optimum is no more than `cost` [σ]."""

    target: str
    cost: Annotated[float, Field(gt=0.0)]
    readings: tuple[Reading, ...]


class Cut(Result):
    """A target and y (18) in the parameters X1 to X18."""

    target: str
    y: Annotated[tuple[Annotated[float, Field(ge=-LARGEST, le=LARGEST)], ...], Field(min_length=18, max_length=18)]


class Node(Result):
    """A node of the tree, with one of cover, split, weights, like. A cut and a symmetry g are the number 16 × cut + g.

    Attributes
    ----------
    narrow : tuple of int
        cuts, one after the other, that only one item meets: one of its positions is put into the region, an item of
        its own in its place, and the others come last
    cover : int
        a cut; of every item that meets it there is a child where one of its positions is in the region and, of the
        items before it, none is; where none meets it the node is done with
    split : (int, int, int, int)
        number of an item, axis (0 α, 1 β), first cell and number of cells; in the first child one of the item's
        positions is in them, in the second none is
    weights : tuple of (int, int)
        cuts and the weight of each: a set hits all of them, so what its positions hit, added up, is no less than all
        weights; where even the cells of the items that hit most add up to less, the node is done with
    like : int
        number of an earlier node
    """

    omitted = frozenset({"narrow", "cover", "split", "weights", "like"})

    narrow: tuple[int, ...] = ()
    cover: int | None = None
    split: tuple[int, int, int, int] | None = None
    weights: tuple[tuple[int, Annotated[int, Field(ge=1, le=10**6)]], ...] | None = None
    like: int | None = None

    @property
    def cuts(self) -> tuple[int, ...]:
        """All that it uses."""
        return (*self.narrow, *(() if self.cover is None else (self.cover,)), *(cut for cut, _ in self.weights or ()))

    def renumbered(self, number: Callable[[int], int]) -> "Node":
        """The same with other numbers of its cuts."""
        return self.model_copy(
            update={
                "narrow": tuple(number(cut) for cut in self.narrow),
                "cover": None if self.cover is None else number(self.cover),
                "weights": None if self.weights is None else tuple((number(cut), each) for cut, each in self.weights),
            }
        )


class Proof(Result):
    """No set of so many positions has a worst ratio below `ratio`: a certificate, schema trihedron.positions-bound/1.

    Attributes
    ----------
    positions, ratio : int, float
    bounds, admissible
        as of `plan`
    quarter_deg : tuple of float
        lines at these distances from the multiples of 90°, and at these multiples, divide the torus; the last is 45
    optima : tuple of OptimalPlan
        of every target
    cuts : tuple of Cut
    nodes : tuple of Node
        the tree, a node's children after it and before its next sibling; the first has all cells for all positions
    """

    schema_: Literal["trihedron.positions-bound/1"] = Field(default="trihedron.positions-bound/1", alias="schema")
    positions: Annotated[int, Field(ge=1, le=60)]
    ratio: Annotated[float, Field(gt=1.0)]
    bounds: tuple[Annotated[float, Field(ge=0.0, lt=0.5)], Annotated[float, Field(ge=0.0, lt=0.5)]]
    admissible: Literal["paper", "tables"]
    quarter_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=60)]
    optima: tuple[OptimalPlan, ...]
    cuts: tuple[Cut, ...]
    nodes: tuple[Node, ...]

    def verify(self) -> None:
        """An InputError that names what does not hold; nothing where the certificate proves what it says."""
        if (
            list(self.quarter_deg) != sorted({*self.quarter_deg})
            or self.quarter_deg[0] <= 0.0
            or self.quarter_deg[-1] != 45.0
        ):
            raise InputError("quarter_deg: must rise from above 0 to 45")
        costs = self._checked_optima()
        _checked_symmetries(costs)
        for number, cut in enumerate(self.cuts):
            if cut.target not in costs:
                raise InputError(f"cuts[{number + 1}]: {cut.target!r} is none of the targets {', '.join(TARGETS)}")
            if _aim(cut.target) @ cut.y < self.ratio * costs[cut.target] + ROUNDING:
                raise InputError(f"cuts[{number + 1}]: a'y is below ratio × optimum of {cut.target}")
        self._check_tree()

    def _checked_optima(self) -> dict[str, float]:
        """The optimum of each target; its plan must be admissible and without bias."""
        (u, v), found = self.bounds, {}
        for plan in self.optima:
            total, where = np.zeros(18), f"optima of {plan.target}"
            if plan.target not in TARGETS:
                raise InputError(f"{where}: no such target")
            for reading in plan.readings:
                p = reading.accelerometer - 1
                a, b = (np.radians(angle) for angle in (reading.alpha_deg, reading.beta_deg))
                at = np.outer([np.cos(a), np.sin(a), 1.0], [np.cos(b), np.sin(b), 1.0])
                terms = [abs(at[form]) for _, form, _ in STAND[p]]
                inputs = [at[form] for form in INPUTS]
                margin = u * sum(terms) + v * np.abs(inputs).sum() + v * (self.admissible == "tables")
                if abs(inputs[p]) < margin - 1e-12:
                    raise InputError(f"{where}: a reading is not admissible")
                total += reading.weight * (_forms()[p, int(inputs[p] < 0.0)] * at).sum(axis=(1, 2))
            if np.abs(total - _aim(plan.target)).max() > 1e-8:
                raise InputError(f"{where}: the plan is biased")
            if sum(abs(reading.weight) for reading in plan.readings) > plan.cost + ROUNDING:
                raise InputError(f"{where}: the plan costs more")
            found[plan.target] = plan.cost
        if missing := [name for name in TARGETS if name not in found]:
            raise InputError(f"optima: lack {', '.join(missing)}")
        return found

    @cached_property
    def _lines(self) -> NDArray:
        """All lines [rad], from −45°; the first again at the end."""
        quarter = [Fraction(line) for line in self.quarter_deg]
        one = [*(-line for line in reversed(quarter)), Fraction(0), *quarter[:-1]]
        return np.radians([float(90 * k + line) for k in range(4) for line in one] + [315.0])

    @cached_property
    def _counts(self) -> NDArray:
        """Where (3, 2, n, n), of accelerometer and sign, a reading may count."""
        (u, v), n = self.bounds, len(self._lines) - 1
        ends = np.stack([np.cos(self._lines), np.sin(self._lines), np.ones(n + 1)])
        low, high = np.minimum(ends[:, :-1], ends[:, 1:]), np.maximum(ends[:, :-1], ends[:, 1:])

        def interval(form: tuple[int, int]) -> tuple[NDArray, NDArray]:
            every = [x[form[0]][:, None] * y[form[1]][None, :] for x in (low, high) for y in (low, high)]
            return np.minimum.reduce(every), np.maximum.reduce(every)

        def least(form: tuple[int, int]) -> NDArray:
            below, above = interval(form)
            return np.maximum(0.0, np.maximum(below, -above))

        counts = np.zeros((3, 2, n, n), dtype=bool)
        for p in range(3):
            below, above = interval(INPUTS[p])
            others = v * sum(least(form) for k, form in enumerate(INPUTS) if k != p)
            others = others + u * sum(least(form) for _, form, _ in STAND[p]) + v * (self.admissible == "tables")
            for s, most in enumerate((above, -below)):
                counts[p, s] = (1.0 - v) * most - others > -ROUNDING
        return counts

    def _region(self, y: NDArray) -> NDArray:
        """The cells (n, n) that may meet the region of a cut."""
        lines, half = self._lines, 0.5 * np.diff(self._lines)
        ends = np.stack([np.cos(lines), np.sin(lines), np.ones(len(lines))])
        found = np.zeros(self._counts.shape[2:], dtype=bool)
        for p, s in product(range(3), range(2)):
            form = np.tensordot(y, _forms()[p, s], axes=(0, 0))
            value = np.abs(ends.T @ form @ ends)
            corner = np.maximum.reduce([value[:-1, :-1], value[1:, :-1], value[:-1, 1:], value[1:, 1:]])
            bent_a, bent_b = (np.sqrt(2.0) * np.linalg.norm(part, 2) for part in (form[:2], form[:, :2]))
            most = corner + 0.5 * (bent_a * half[:, None] ** 2 + bent_b * half[None, :] ** 2)
            found |= self._counts[p, s] & (most > 1.0 - ROUNDING)
        return found

    def _check_tree(self) -> None:
        n = len(self._lines) - 1
        regions = [self._region(np.array(cut.y)) for cut in self.cuts]

        @cache
        def region(number: int) -> int:
            if not 0 <= number < 16 * len(regions):
                raise InputError(f"nodes: there is no cut {number // 16}")
            return _bits(_image(regions[number // 16], number % 16))

        asked = {node.like for node in self.nodes}
        states: dict[int, State] = {}
        waiting: list[tuple[State, tuple[int, ...]]] = [((((1 << n * n) - 1, self.positions),), ())]
        for number, node in enumerate(self.nodes):
            where = f"nodes[{number + 1}]"
            if not waiting:
                raise InputError(f"{where}: belongs to no other")
            state, above = waiting.pop()
            if number in asked:
                states[number] = state
            if sum(way is not None for way in (node.cover, node.split, node.weights, node.like)) != 1:
                raise InputError(f"{where}: must have one of cover, split, weights, like")
            for cut in node.narrow:
                met = _met(state, region(cut))
                if len(met) != 1:
                    raise InputError(f"{where}: narrow: {len(met)} items meet {cut}")
                state = _put(state, met[0], region(cut))
            children: list[State] = []
            if node.cover is not None:
                children = _covered(state, region(node.cover))
            elif node.split is not None:
                children = _divided(state, node.split, n, where)
            elif node.weights is not None:
                weight = sum(
                    (each * _cells(region(cut), n) for cut, each in node.weights), np.zeros((n, n), dtype=np.int64)
                )
                most = sum(count * int(weight[_cells(cells, n)].max(initial=0)) for cells, count in state)
                if most >= sum(each for _, each in node.weights):
                    raise InputError(f"{where}: positions may hit a weight of {most}")
            elif node.like not in states or node.like in (*above, number):
                raise InputError(f"{where}: like must be an earlier node that is done with")
            elif not _within_an_image(state, states[node.like], n):
                raise InputError(f"{where}: is in no image of nodes[{node.like + 1}]")
            waiting += [(child, (*above, number)) for child in reversed(children)]
        if waiting:
            raise InputError(f"nodes: {len(waiting)} are missing at the end")


def _bits(cells: NDArray) -> int:
    """Cells (n, n) as a number; n is a multiple of 8."""
    return int.from_bytes(np.packbits(cells).tobytes(), "big")


def _cells(bits: int, n: int) -> NDArray:
    """The cells (n, n) of such a number."""
    return np.unpackbits(np.frombuffer(bits.to_bytes(n * n // 8, "big"), np.uint8)).reshape(n, n).astype(bool)


def _met(state: State, region: int) -> list[int]:
    """The items that meet a region."""
    return [number for number, (cells, _) in enumerate(state) if cells & region]


def _put(state: State, which: int, region: int) -> State:
    """One position of an item is in the region; the item's others come last."""
    cells, count = state[which]
    rest = ((cells, count - 1),) if count > 1 else ()
    return *state[:which], (cells & region, 1), *state[which + 1 :], *rest


def _without(state: State, which: int, region: int) -> State:
    """No position of an item is in the region."""
    cells, count = state[which]
    return *state[:which], (cells & ~region, count), *state[which + 1 :]


def _covered(state: State, region: int) -> list[State]:
    """The children, one for each item that may be the first with a position in the region."""
    children = []
    for which in _met(state, region):
        children.append(_put(state, which, region))
        state = _without(state, which, region)
        if not state[which][0]:
            break
    return children


def _divided(state: State, split: tuple[int, int, int, int], n: int, where: str) -> list[State]:
    """A position of an item is in these rows or columns of cells; none is."""
    which, axis, first, size = split
    if not (0 <= which < len(state) and axis in (0, 1) and 0 < size < n):
        raise InputError(f"{where}: split {split} divides no item")
    between = np.zeros((n, n), dtype=bool)
    between[(first + np.arange(size)) % n] = True
    region = _bits(between if axis == 0 else between.T)
    if not state[which][0] & region or not state[which][0] & ~region:
        raise InputError(f"{where}: split {split} divides no item")
    return [_put(state, which, region), _without(state, which, region)]


def _within_an_image(state: State, other: State, n: int) -> bool:
    """Whether each position of a state, one by one, lies in the cells of one of the other's image."""
    known = sorted(other, key=lambda item: item[0].bit_count())
    cells = [_cells(bits, n) for bits, _ in known]
    small_first = sorted(state, key=lambda item: item[0].bit_count())
    for g in range(16):
        left = [count for _, count in small_first]
        for part, (_, count) in zip(cells, known, strict=True):
            outside, lacking = ~_bits(_image(part, g)), count
            for number, (mine, _) in enumerate(small_first):
                if left[number] and not mine & outside:
                    taken = min(left[number], lacking)
                    left[number] -= taken
                    lacking -= taken
        if not any(left):
            return True
    return False


def _sense_and_shift(g: int, axis: int) -> tuple[int, int]:
    """Of symmetry g θ → sense θ + shift × π, for one axis."""
    return (-1 if g >> (3 - axis) & 1 else 1), g >> (1 - axis) & 1


def _moved_cells(g: int, axis: int, n: int) -> NDArray:
    """Where each cell of an axis goes: line n/8 is at 0°."""
    sense, shift = _sense_and_shift(g, axis)
    cell = np.arange(n)
    return ((cell if sense > 0 else n // 4 - 1 - cell) + shift * n // 2) % n


def _image(cells: NDArray, g: int) -> NDArray:
    """Cells (n, n) where symmetry g, which is its own inverse, takes them."""
    a, b = (_moved_cells(g, axis, len(cells)) for axis in (0, 1))
    return cells[np.ix_(a, b)]


def _aim(target: str) -> NDArray:
    """The weights a (18) of a target in X1 to X18."""
    aim = np.zeros(18)
    for k, factor in TARGETS[target]:
        aim[k] = factor
    return aim


@lru_cache(maxsize=1)
def _forms() -> NDArray:
    """F (3, 2, 18, 3, 3) of accelerometer and sign (+, −): of each X a form in (cos, sin, 1) of α and of β."""
    forms = np.zeros((3, 2, 18, 3, 3))
    for p, s in product(range(3), range(2)):
        for x, form, sign in STAND[p]:
            forms[p, s, x][form] = sign
        for k, form in enumerate(INPUTS):
            forms[p, s, SLOTS[p][k] + (s if k == p else 0)][form] = 1.0
        forms[p, s, 15 + p, 2, 2] = 1.0
    return forms


def _checked_symmetries(costs: dict[str, float]) -> None:
    """Verify, exactly, that the sixteen take readings to readings and each target to one with the same optimum.

    F of accelerometer p at the image is ±F at the position, with the parameters in another order and with other signs
    and, where the input of p changes its sign, that of the other sign.
    """
    forms = _forms()
    for g in range(16):
        (turn_a, over_a), (turn_b, over_b) = (_sense_and_shift(g, axis) for axis in (0, 1))
        cos_a, cos_b = 1 - 2 * over_a, 1 - 2 * over_b
        basis = np.outer([cos_a, turn_a * cos_a, 1], [cos_b, turn_b * cos_b, 1])
        signs = (1, turn_b, turn_a * turn_b * cos_b)
        there = np.zeros_like(forms)
        for p, s in product(range(3), range(2)):
            other = s if basis[INPUTS[p]] > 0 else 1 - s
            there[p, other] = signs[p] * forms[p, s] * basis
        goes = np.zeros((18, 18))
        for x, y, sign in product(range(18), range(18), (1, -1)):
            if np.array_equal(there[:, :, x], sign * forms[:, :, y]):
                goes[y, x] = sign
        if not (np.abs(goes).sum(axis=0) == 1).all():
            raise InputError(f"symmetry {g} does not hold")
        for name in TARGETS:
            image = goes @ _aim(name)
            alike = [other for other in TARGETS if any(np.array_equal(sign * image, _aim(other)) for sign in (1, -1))]
            if not any(abs(costs[other] - costs[name]) < ROUNDING for other in alike):
                raise InputError(f"optima: {name} differs from that of its image under symmetry {g}")
