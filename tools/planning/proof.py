"""The proof that no N positions, at whatever angles, reach a ratio for all targets: a certificate, and its check.

The check shares nothing with the search that made the certificate (`proof_search`): it has its own regressors, cells,
symmetries and bounds. It is for the mounting `identity`.

A cut is a target k and a y with a'y ≥ r c_k, c_k the target's optimum. Where |F'y| ≤ 1 at every reading of a set, the
set's cost of k is at least a'y: so a set that reaches r has a position in the cut's region, where some |F'y| > 1. The
torus of both angles is divided into cells by lines; a region is the cells that may meet it. |F'y| in a cell is at most
its greatest value at the corners and, by linear interpolation along one angle after the other, h²/2 times the greatest
second derivative by each angle, h half of the cell's width. A reading counts in a cell where, by intervals, (1.9) may
hold somewhere in it.

The tree divides the sets by how many of their positions lie in which box of cells. A node divides one box in two, once
for each way of sharing out its positions; or it is refuted: cuts with weights, so that Σ over boxes of positions × the
greatest weight of the cuts that one cell of the box can hit is less than all weights together, and some cut is hit by
no position; or it is an earlier node's image under one of the sixteen symmetries θ → ±θ + (0 or π) of both angles,
which take readings to readings and targets to targets. Weights and counts are integers, regions are rounded outwards.
"""

from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import product
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..result import Result

Box = tuple[int, int, int, int]
"""First cell and number of cells along α, then along β; beyond the last cell comes the first."""
State = tuple[tuple[Box, int], ...]
"""Boxes, and how many positions lie in each; none lie elsewhere."""

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
    """A node of the tree, one of three.

    Attributes
    ----------
    split : (int, int, int)
        number of a box, axis (0 α, 1 β), cells of its first part; the children follow, most positions in it first
    cuts : tuple of (int, int, int)
        refuted: number of a cut, of a symmetry, and weight
    like : int
        number of an earlier node, of which this is an image
    """

    omitted = frozenset({"split", "cuts", "like"})

    split: tuple[int, int, int] | None = None
    cuts: tuple[tuple[int, int, Annotated[int, Field(ge=1, le=10**9)]], ...] | None = None
    like: int | None = None


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
        the tree, a node's children after it and before its next sibling
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
        moved: dict[tuple[int, int], NDArray] = {}
        states: list[State] = []
        waiting: list[tuple[State, tuple[int, ...]]] = [((((0, n, 0, n), self.positions),), ())]
        for number, node in enumerate(self.nodes):
            where = f"nodes[{number + 1}]"
            if not waiting:
                raise InputError(f"{where}: belongs to no other")
            state, above = waiting.pop()
            states.append(state)
            if (node.split is None) + (node.cuts is None) + (node.like is None) != 2:
                raise InputError(f"{where}: must have one of split, cuts, like")
            if node.split is not None:
                children = _divided(state, node.split, n, where)
                waiting += [(child, (*above, number)) for child in reversed(children)]
            elif node.like is not None:
                if not 0 <= node.like < number or node.like in above:
                    raise InputError(f"{where}: like must be an earlier node that is done with")
                if not any(_image(state, g, n) == sorted(states[node.like]) for g in range(16)):
                    raise InputError(f"{where}: is no image of nodes[{node.like + 1}]")
            elif node.cuts is not None:
                load, total = np.zeros((n, n), dtype=np.int64), 0
                for cut, g, weight in node.cuts:
                    if not (0 <= cut < len(regions) and 0 <= g < 16):
                        raise InputError(f"{where}: no cut {cut} or no symmetry {g}")
                    if (cut, g) not in moved:
                        a, b = (_moved_cells(g, axis, n) for axis in (0, 1))
                        moved[cut, g] = regions[cut][np.ix_(a, b)]
                    load += weight * moved[cut, g]
                    total += weight
                hit = sum(count * int(load[_cells(box, n)].max()) for box, count in state)
                if hit >= total:
                    raise InputError(f"{where}: its positions can hit all cuts ({hit} of {total})")
        if waiting:
            raise InputError(f"nodes: {len(waiting)} are missing at the end")


def _divided(state: State, split: tuple[int, int, int], n: int, where: str) -> list[State]:
    """The children of a node, the most positions in the first part first."""
    which, axis, size = split
    if not (0 <= which < len(state) and axis in (0, 1) and 0 < size < state[which][0][2 * axis + 1]):
        raise InputError(f"{where}: split {split} divides no box")
    box, count = state[which]
    rest = state[:which] + state[which + 1 :]
    first, second = list(box), list(box)
    first[2 * axis + 1] = size
    second[2 * axis] = (box[2 * axis] + size) % n
    second[2 * axis + 1] = box[2 * axis + 1] - size
    return [
        (*rest, *((part, many) for part, many in ((_box(first), k), (_box(second), count - k)) if many))
        for k in range(count, -1, -1)
    ]


def _box(numbers: list[int]) -> Box:
    a, na, b, nb = numbers
    return a, na, b, nb


def _cells(box: Box, n: int) -> tuple[NDArray, ...]:
    a, na, b, nb = box
    return np.ix_((a + np.arange(na)) % n, (b + np.arange(nb)) % n)


def _sense_and_shift(g: int, axis: int) -> tuple[int, int]:
    """Of symmetry g θ → sense θ + shift × π, for one axis."""
    return (-1 if g >> (3 - axis) & 1 else 1), g >> (1 - axis) & 1


def _moved_cells(g: int, axis: int, n: int) -> NDArray:
    """Where each cell of an axis goes: line n/8 is at 0°."""
    sense, shift = _sense_and_shift(g, axis)
    cell = np.arange(n)
    return ((cell if sense > 0 else n // 4 - 1 - cell) + shift * n // 2) % n


def _image(state: State, g: int, n: int) -> list[tuple[Box, int]]:
    """The boxes where symmetry g takes positions, in order."""
    found = []
    for box, count in state:
        new: list[int] = []
        for axis in (0, 1):
            first, size = box[2 * axis], box[2 * axis + 1]
            moved = _moved_cells(g, axis, n)
            end = first if _sense_and_shift(g, axis)[0] > 0 else (first + size - 1) % n
            new += [0 if size == n else int(moved[end]), size]
        found.append((_box(new), count))
    return sorted(found)


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
