"""Two things at once: two breaks, a break and an effect, a break and a wrong row."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ...models.effects.last_stage import place_of
from ..bounded.sets import EffectSet, Problem, linear_radius, sets_of_size
from ..bounded.work import CutOff, Work
from ..evidence.bench import Bench
from ..evidence.bench_visits import is_linear, signature_columns
from ..evidence.evidence import Evidence
from .breaks import (
    ALONE,
    MOST_SLACK_OF_TWO,
    NEAR,
    Beside,
    BreakSearch,
    ChangingGroup,
    FittingBreaks,
    RowGap,
    jumping_at,
)
from .simple import Simple

FEWEST_ROWS, MOST_ROWS = 24, 120
"""Records of fewer rows do not tell two things; of more the pairs are too many."""
MOST_WORK = 8e6
"""The work of a search, after which the search has no answer."""
MOST_CANDIDATES = 400
"""Where more pairs stand in the linear model the record does not tell which it is."""
MOST_EXACT = 40
"""Most pairs that are fitted exactly, those of fewest numbers first."""
FARTHER = 2
"""Pairs that need this number more than the simplest are no rivals."""
LEAST_OF_TWO = 4
"""The least numbers that a pair needs."""
MOST_NUMBERS = 3
"""Most numbers that each of two breaks changes."""


Kind = tuple[tuple[ChangingGroup, ...], Beside]
"""The changes at each break of a pair, and the effects beside them."""


def _is_part_of(smaller: Kind, larger: Kind) -> bool:
    """Return true if a larger, different pair can always do everything that a smaller one does."""
    (groups, beside), (wider, beside_wider) = smaller, larger
    if smaller == larger or beside != beside_wider or len(groups) != len(wider):
        return False
    return all(group.is_part_of(other) for group, other in zip(groups, wider, strict=True))


@dataclass(frozen=True)
class Fault:
    """One of two things: a break of a group at a gap, or a cause beside one.

    `cells` has the cell of an effect with an unknown number.
    """

    groups: tuple[ChangingGroup, ...] = ()
    gaps: tuple[RowGap, ...] = ()
    beside: Beside = ALONE
    cells: frozenset[int] = frozenset()


NOTHING = Fault()
Options = tuple[list[Fault], list[Floats]]
"""Options, each with its columns (M, k) over the bounds of the rows."""


@dataclass(frozen=True, eq=False)
class FaultPair:
    """Two things with which the linear model fits: breaks in the order of time, the cause beside them, the radius.

    `cells` are those of the cause's unknown number with which it fits.
    """

    groups: tuple[ChangingGroup, ...]
    gaps: tuple[RowGap, ...]
    beside: Beside
    numbers: int
    radius: float
    cells: frozenset[int] = frozenset()

    def or_with(self, other: "FaultPair") -> "FaultPair":
        """Return the pair of less radius with the cells of both; they are of the same causes and gaps."""
        best = min(self, other, key=lambda pair: pair.radius)
        return replace(best, cells=self.cells | other.cells)


def tells_two_things(evidence: Evidence) -> bool:
    """Return true if pairs are sought: in position records that are long enough and misfit clearly."""
    model = evidence.model
    return isinstance(model, Bench) and model.radius >= NEAR and FEWEST_ROWS <= len(model.readings) <= MOST_ROWS


def joint_faults(evidence: Evidence) -> tuple[Simple, ...]:
    """Return pairs of a break and another cause that make the model fit, the fewest numbers first."""
    if not tells_two_things(evidence):
        return ()
    try:
        return PairSearch(BreakSearch(evidence, Work(MOST_WORK, "pairs of faults of the record"))).faults
    except CutOff:
        return ()


@dataclass(frozen=True, eq=False)
class PairSearch:
    """The search for pairs, in which breaks are as the search for one has them."""

    search: BreakSearch

    def breaks(self, groups: Sequence[ChangingGroup]) -> Options:
        """Return breaks of some groups at every gap, with their columns."""
        options, columns = [], []
        for group in groups:
            for gap, block in zip(self.search.gaps, self.search.columns(group), strict=True):
                options.append(Fault((group,), (gap,)))
                columns.append(block)
        return options, columns

    @cached_property
    def others(self) -> Options:
        """Effects that the readings determine, wrong rows, and cells of unknown numbers, with their columns."""
        options, columns, model = [], [], self.search.model
        for place in model.classes.places:
            if is_linear(place) and place not in model.search.relaxed:
                options.append(Fault(beside=Beside(effects=(place,))))
                columns.append(signature_columns([place], self.search.rows) / model.rows.bound[:, None])
        for row in range(len(model.readings)):
            block = np.zeros((len(model.rows.bound), 3))
            block[3 * row : 3 * row + 3] = np.eye(3)
            options.append(Fault(beside=Beside(rows=(row + 1,))))
            columns.append(block)
        for place, cells in model.search.cells.items():
            for number, cell in enumerate(cells):
                # A step is a break.
                if cell.one_sign:
                    options.append(Fault(beside=Beside(effects=(place,)), cells=frozenset((number,))))
                    columns.append(cell.columns.reshape(len(model.rows.bound), -1) / model.rows.bound[:, None])
        return options, columns

    def standing(self, few: bool) -> Iterator[FaultPair]:
        """Yield the pairs that make the linear model fit: breaks of few numbers, else of many beside effects."""
        groups = [group for group in self.search.every_group if (len(group.parts) <= MOST_NUMBERS) == few]
        options, columns = self.breaks(groups)
        others, columns_of_others = self.others
        problem = self._problem([*columns_of_others, *columns], alike=len(options))
        yield from self._of([*others, *options], problem, 2)
        for relaxation in self.search.model.search.relaxed.values():
            beside = Beside(effects=(relaxation.place,))
            relaxed, _ = self.search.model.search.beside(self._problem(columns, alike=len(columns)), [relaxation])
            yield from self._of([replace(option, beside=beside) for option in options], relaxed, 1)
        if few:
            yield from self._of(options, self._problem(columns, alike=0), 2)

    def _problem(self, columns: Sequence[NDArray], alike: int) -> Problem:
        return Problem.of(self.search.problem.residual, self.search.problem.nominal, columns, alike=alike)

    def _of(self, options: Sequence[Fault], problem: Problem, size: int) -> Iterator[FaultPair]:
        """Yield the sets of one or two options that stand, each of one break at least, once."""
        for chosen in sets_of_size(problem, size, min(self.search.slack, MOST_SLACK_OF_TWO), 0, self.search.work):
            things = [options[number] for number in chosen.effects]
            # Breaks come last.
            if things[-1].gaps and not self._are_of_one_group(*things):
                yield self._pair(things, linear_radius(problem, EffectSet(chosen.effects)))

    def _are_of_one_group(self, first: Fault, second: Fault = NOTHING) -> bool:
        """Return true if two options are breaks at one gap, of parts of one larger group."""
        if first.gaps != second.gaps:
            return False
        (one,), (other,) = first.groups, second.groups
        return any(one.is_part_of(group) and other.is_part_of(group) for group in self.search.every_group)

    def _pair(self, things: Sequence[Fault], radius: float) -> FaultPair:
        broken = [(group, gap) for thing in things for group, gap in zip(thing.groups, thing.gaps, strict=True)]
        broken.sort(key=lambda group_and_gap: group_and_gap[1].hours)
        groups, gaps = tuple(group for group, _ in broken), tuple(gap for _, gap in broken)
        beside = things[0].beside
        numbers = beside.numbers + len(groups) - 1
        for group, gap in zip(groups, gaps, strict=True):
            numbers += self.search.numbers_of(group, gap)
        return FaultPair(groups, gaps, beside, numbers, radius, things[0].cells)

    @property
    def faults(self) -> tuple[Simple, ...]:
        """Return the simplest pairs that make the exact model fit; empty if there are too many."""
        return self._faults(few=True) or self._faults(few=False)

    def _faults(self, few: bool) -> tuple[Simple, ...]:
        pairs: dict[tuple[Kind, tuple[RowGap, ...]], FaultPair] = {}
        for pair in self.standing(few):
            key = (pair.groups, pair.beside), pair.gaps
            pairs[key] = pair.or_with(pairs.get(key, pair))
            if len(pairs) > MOST_CANDIDATES:
                return ()
        return self._fitted(sorted(pairs.values(), key=lambda pair: (pair.numbers, pair.radius)))

    def _fitted(self, pairs: Sequence[FaultPair]) -> tuple[Simple, ...]:
        """Return those of some pairs, the simplest first, that make the exact model fit."""
        by_kind: dict[Kind, list[FittingBreaks]] = {}
        least = np.inf
        for pair in pairs[:MOST_EXACT]:
            kind = pair.groups, pair.beside
            if pair.numbers > least + FARTHER or any(_is_part_of(smaller, kind) for smaller in by_kind):
                continue
            places = self._places(pair)
            if pair.cells:
                self.search.model.search.leave_open(places, pair.cells)
            fit = self.search.fitted(places)
            if fit is not None:
                least = min(least, pair.numbers)
                by_kind.setdefault(kind, []).append(FittingBreaks(pair.gaps, fit))
        faults = []
        for (groups, beside), standing in by_kind.items():
            if self._is_of_catalogue(groups[0], beside):
                continue
            standing.sort(key=lambda one: one.fit.radius)
            faults.append(self.search.simple(groups, standing, beside))
        return tuple(faults)

    def _is_of_catalogue(self, group: ChangingGroup, beside: Beside) -> bool:
        """Return true if the catalogue's own search names both: it tries no two effects with unknown numbers."""
        is_searched = any(place.definition.searched is not None for place in beside.effects)
        return bool(beside.effects) and not is_searched and group.catalogued in self.search.listed

    def _places(self, pair: FaultPair) -> tuple[EffectPlace, ...]:
        places = [*jumping_at(pair.groups, pair.gaps), *pair.beside.effects]
        for row in pair.beside.rows:
            places += [place_of(row, p) for p in (1, 2, 3)]
        return tuple(places)
