"""The search for one unknown number beside a linear model: the times, or time constants, that a record allows.

No number is missed:

1. The least ranges cover all numbers that a record can determine (`cells_in_motion`).
2. A range is refused only where columns that hold the effect with every number of it leave a radius above the limit.
   A model consistent at one of the numbers would be consistent with these columns, so none of the numbers fits.
3. The other ranges are swept. Each row of an onset has its own columns; a proof for one row is moved to the others,
   and holds there for any source (`bounded.sweep`). Between neighbouring time constants bounds grow by the
   difference of the columns, times the largest size that is possible there.
4. Intervals hold the possible values for every number that no proof refuses.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.effects import EffectPlace
from ..bounded.sets import Problem, sets_of_size
from ..bounded.sweep import Rows, Swept, apart, largest_sizes, open_ranges
from ..bounded.work import Work
from .cells import Cell
from .cells_in_motion import Cells, Onsets, Range, TimeConstants, refused
from .evidence import Linear, limits_of
from .fit import Fit, coefficient_count

MOST_TRIED = 12
"""Number of rows of a range that fits, after which its least radius is not refined."""
FINE, DECIDED, FINER, LEAST_FINER, MOST_TIMES = 0.02, 1e-6, 16.0, 1.2, 5000
"""Time constants are taken so near each other that bounds grow by this part of themselves; where none stands, though
not all are refused, by the second. They are then nearer by this factor, at least by the fourth number; the fifth is the
most of them."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Numbers from `begin` to `end` with which an effect is consistent: fits at some of them, and possible values."""

    begin: float
    end: float
    fits: list[tuple[Fit, float]]
    swept: list[Swept]


class SettingIn(Linear):
    """A model with effects `starting` that set in or fade; `set_in` has the times [h] of the fitted ones.

    `left_open` are ranges of an effect's times that are known to hold all that are possible.
    """

    starting: tuple[EffectPlace, ...]
    set_in: Mapping[EffectPlace, float]

    @property
    def left_open(self) -> Mapping[EffectPlace, Sequence[tuple[int, int]]]:
        """None are known."""
        return {}

    def make_cells(self, place: EffectPlace) -> Cells:
        """Return the cells of an effect's unknown number."""
        raise NotImplementedError

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The evidence with an effect that sets in after a row, or with the time constant of that number, too."""
        raise NotImplementedError

    def over_bounds(self, columns: Sequence[NDArray]) -> Floats:
        """Columns (S, d, K) of each part of the onsets as rows (M, K) over their bounds."""
        raise NotImplementedError

    @cached_property
    def cells(self) -> dict[EffectPlace, Cells]:
        """The cells of each effect that sets in or fades."""
        return {place: self.make_cells(place) for place in self.starting}

    @cached_property
    def ranges(self) -> dict[tuple[EffectPlace, int, int], Range]:
        """Ranges already computed, by effect and the numbers at both ends."""
        return {}

    def with_onsets(self, fit: Fit) -> Self:
        """The evidence with the effects of a fit that set in, at the times of the fit."""
        evidence = self
        for place, values in zip(fit.places, fit.values(), strict=True):
            if place in self.starting:
                evidence = evidence.with_onset(place, self.cells[place].number(values[-1]))
        return evidence

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,); those that set in have their times."""
        values = self.rows.values_of(places, solution)
        for place in values:
            if place in self.set_in:
                values[place] = (*values[place], self.set_in[place])
        return values

    most_with_onset: ClassVar[int] = 1
    """Sets of more effects have none that sets in: in a long record each such pair costs tens of programmes."""

    def sets_in_time(self, size: int, work: Work, slack: float = 0.0) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of one effect that sets in, or of two with one that does, where no bound refuses the two.

        `slack` is the possible error of the rows, in bounds.
        """
        if size > self.most_with_onset:
            return
        for place in self.starting:
            if size == 1:
                yield (place,)
                continue
            for candidate in self._candidates(place, work, slack):
                yield candidate, place

    def _candidates(self, place: EffectPlace, work: Work, slack: float) -> list[EffectPlace]:
        """Return the linear effects beside which an effect may set in, in the order of their places."""
        every, standing, columns = self.classes.places, set[int](), []
        for candidate in every:
            columns.append(self.rows.columns_of([candidate]))

        def standing_in(begin: int, end: int, among: Sequence[int]) -> Sequence[int]:
            """Return candidates that no bound refuses in a range, except those that are consistent in another one."""
            among = [number for number in among if number not in standing]
            columns_held, missed = self._range(place, begin, end)
            finite = np.isfinite(columns_held).all(axis=1)
            nominal = np.hstack([self.rows.nominal, columns_held])[finite]
            problem = Problem.of(self.rows.residual[finite], nominal, [columns[k][finite] for k in among])
            open_candidates = []
            for open_set in sets_of_size(problem, 1, self.limit - 1.0 + missed + slack, 0, work):
                open_candidates.append(among[open_set.effects[0]])
            return open_candidates

        for _, _, candidates in open_ranges(self._edges(place), range(len(every)), standing_in):
            standing.update(candidates)
        return [every[k] for k in sorted(standing)]

    def mended_in_time(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return fits of a set of effects with possible sizes, at the possible times of the effect that sets in.

        The times begin at zero where an effect that acts from the first row on would fit as well.
        """
        place, linear = self._apart(places)
        cells = self.cells[place]
        if isinstance(cells, TimeConstants):
            standing = self._fading(place, linear, work)
        else:
            standing = self._setting_in(place, linear, work)
        if standing is None:
            return []
        ends, fits = cells.ends(standing.begin, standing.end), []
        for fit, number in sorted(standing.fits, key=lambda fit_and_number: fit_and_number[0].radius):
            fits.append(setting_in_at(fit, place, cells.value(number), ends))
        return [replace(fits[0], also=tuple(fits[1:]), swept=tuple(standing.swept))]

    def _apart(self, places: Sequence[EffectPlace]) -> tuple[EffectPlace, list[EffectPlace]]:
        """The effect of a set that sets in, and the others."""
        (place,) = (place for place in places if place in self.starting)
        return place, [other for other in places if other != place]

    def _setting_in(self, place: EffectPlace, linear: list[EffectPlace], work: Work) -> Standing | None:
        """Return the rows at which an effect beside others can set in; None if there are none."""
        places, fits, swept_ranges, rows = [*linear, place], [], [], []
        for begin, end in self.open_ranges_of(place, linear, work):
            swept = self._swept(place, linear, (begin, end))
            fit = self._searched(swept, places, np.arange(begin, end + 1), work)
            if fit is not None:
                fits.append(fit)
                swept_ranges.append(swept)
                rows += [begin, end]
        if not fits:
            return None
        if self.with_onset(place, 0).refit(places).radius <= self.limit:
            # An effect that acts from the first row on fits as well.
            rows.append(0)
        return Standing(min(rows), max(rows), fits, swept_ranges)

    def _fading(self, place: EffectPlace, linear: list[EffectPlace], work: Work) -> Standing | None:
        """Return the time constants with which an effect beside others can fade; None if there are none."""
        ranges = list(self.open_ranges_of(place, linear, work))
        if not ranges:
            return None
        begin, end = float(ranges[0][0]), float(ranges[-1][1])
        parts, sizes, fit = 1.0, None, None
        while True:
            numbers = np.linspace(begin, end, max(2, round((end - begin) * parts)) + 1)
            rows, error = self._rows_of_times(place, linear, numbers)
            far = apart(rows, error)
            if sizes is None:
                sizes = largest_sizes(rows, self.limit, far, rows.bound[len(self.rows.residual) :])
            growth = float((far @ sizes / rows.bound).max())
            swept = Swept(replace(rows, bound=rows.bound + far @ sizes), self.limit, np.zeros(rows.fixed.shape[1]))
            gap = numbers[1] - numbers[0]
            within = np.zeros(len(numbers), dtype=bool)
            for low, high in ranges:
                within |= (numbers >= low - gap) & (numbers <= high + gap)
            swept.proven[~within] = np.inf
            fit = self._searched(swept, [*linear, place], numbers, work) or fit
            # The first and last numbers that are not refused are consistent with the grown bounds.
            for side in (0, -1):
                while not swept.refused.all() and swept.tried(_standing(swept)[side]) > self.limit:
                    work.programme(*swept.rows.fixed.shape)
            if swept.refused.all():
                return None
            first, last = _standing(swept)
            begin, end = float(numbers[max(0, first - 1)]), float(numbers[min(len(numbers) - 1, last + 1)])
            # With smaller distances bounds grow less.
            nearer = FINER
            if growth > FINE:
                nearer = growth / FINE
            finer = min(parts * nearer, MOST_TIMES / (end - begin))
            if (fit and growth <= FINE) or growth <= DECIDED or finer < LEAST_FINER * parts:
                break
            parts = finer
        if fit is None:
            return None
        every = swept
        swept = Swept(every.rows.chosen(slice(len(self.rows.residual))), self.limit, every.origin, every.radii)
        swept.proven = every.proven
        return Standing(begin, end, [fit], [swept])

    def _rows_of_times(
        self, place: EffectPlace, linear: Sequence[EffectPlace], numbers: NDArray
    ) -> tuple[Rows, Floats]:
        """Return rows with an effect at time constants of the given numbers (R,), and its error (M, k) between these.

        The last k rows hold the sizes within their limits.
        """
        cells = self.cells[place]
        assert isinstance(cells, TimeConstants)
        moving, ways, error = cells.swept(numbers)
        before = self.rows.matrix(linear)
        largest = np.abs(limits_of([place])).max(axis=0)
        (count, columns_before), none = before.shape, np.zeros((len(largest), len(largest)))
        fixed = np.zeros((count + len(largest), columns_before + len(largest)))
        fixed[:count, :columns_before], fixed[count:, columns_before:] = before, np.eye(len(largest))
        columns = np.vstack([moving, np.zeros((len(largest), ways.shape[1]))])
        residual, bound = np.append(self.rows.residual, none[0]), np.append(self.rows.bound, largest)
        rows = Rows(fixed, columns, ways, columns_before + np.arange(len(largest)), residual, bound)
        return rows, np.vstack([error, none])

    def _swept(self, place: EffectPlace, linear: Sequence[EffectPlace], ends: tuple[int, int]) -> Swept:
        """An effect beside others at every row between two."""
        cells = self.cells[place]
        assert isinstance(cells, Onsets)
        fixed, moving, ways = cells.swept(*ends)
        matrix, residual = np.hstack([self.rows.matrix(linear), fixed]), self.rows.residual.copy()
        numbers_moving = np.arange(matrix.shape[1] - fixed.shape[1], matrix.shape[1])
        # Rows that the effect leaves open there carry no information.
        untold = ~np.isfinite(fixed).all(axis=1)
        matrix[untold], moving[untold], residual[untold] = 0.0, 0.0, 0.0
        rows = Rows(matrix, moving, ways, numbers_moving, residual, self.rows.bound)
        return Swept(rows, self.limit, np.zeros(matrix.shape[1]))

    def _searched(
        self, swept: Swept, places: Sequence[EffectPlace], numbers: NDArray, work: Work
    ) -> tuple[Fit, float] | None:
        """Return the consistent fit of a set of effects at a value next to the best, with its number; or None."""
        best, least = 0, math.inf
        rows, columns = swept.rows.fixed.shape
        for count, (way, radius) in enumerate(swept.search()):
            work.programme(rows, columns)
            if radius < least:
                best, least = way, radius
            if swept.refused.all() or (count >= MOST_TRIED and least <= self.limit):
                break
        if least > self.limit:
            return None
        fit = self.with_onset(places[-1], numbers[best]).refit(places)
        if fit.radius > self.limit:
            return None
        return fit, numbers[best]

    def open_ranges_of(
        self, place: EffectPlace, linear: Sequence[EffectPlace], work: Work
    ) -> Iterator[tuple[int, int]]:
        """Yield the rows between which an effect beside others may set in, if no bound refuses it."""
        if place in self.left_open:
            yield from self.left_open[place]
            return
        matrix, cells = self.rows.matrix(linear), self.cells[place]

        def standing_in(begin: int, end: int, among: Sequence[int]) -> Sequence[int]:
            """Return nothing where bounds refuse the effect in a range."""
            columns_held, missed = self._range(place, begin, end)
            finite = np.isfinite(columns_held).all(axis=1)
            columns = np.hstack([matrix, columns_held])[finite]
            if refused(columns, self.rows.residual[finite], self.limit + missed, work):
                return []
            return among

        for begin, end, _ in open_ranges(self._edges(place), [0], standing_in):
            yield begin, end - cells.at_once

    def _edges(self, place: EffectPlace) -> Ints:
        """Return the ends of the least ranges of an effect's numbers; none where too few pieces determine them."""
        cells = self.cells[place]
        if len(cells.rows_between) < 2:
            return np.zeros(0, dtype=int)
        return cells.edges

    def _range(self, place: EffectPlace, begin: int, end: int) -> Range:
        """Return the range of an effect between two numbers, and store it for the next set."""
        known = self.ranges.get((place, begin, end))
        if known is None:
            largest = np.abs(limits_of([place])).max(axis=0)
            known = self.ranges[place, begin, end] = self.cells[place].range(begin, end, largest)
        return known


def _standing(swept: Swept) -> tuple[int, int]:
    """Return the first and the last value that is not refused."""
    standing = np.flatnonzero(~swept.refused)
    return int(standing[0]), int(standing[-1])


def setting_in_at(fit: Fit, place: EffectPlace, start: float, ends: tuple[float, float]) -> Fit:
    """Return a fit whose last effect sets in at a time [h], with times within the possible ends."""
    count = coefficient_count(place)
    way = Cell(place, ends, np.zeros((0, 3, count)), np.full(count, start))
    return replace(fit, variants=(*[None] * (len(fit.places) - 1), way))
