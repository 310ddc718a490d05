"""An effect with one unknown number, a time or a time constant, as cells that cover every value of it.

Between two rests a step acts on the same readings at any time: a cell is a gap. Within a cell of time constants a
response is a mean of those at its two ends, with weights of one sign, except for an error. The second derivative by the
logarithm of the constant limits this error: the bounds of the readings grow by it, times the size of the effect.

The cells cover all numbers. A cell is dropped only where weights prove that the linear model with its columns leaves a
radius above the limit and the error of that model (`bounded.sets`). The exact model is fitted with every other cell;
intervals hold the values that are possible in any consistent cell.

The lag of a temperature at the first row depends on earlier temperatures, which no record has. It is assumed to lie
within the range of the record's temperatures, widened by `BEFORE` of that range on both sides. Its response is a mean,
again with weights of one sign, of the responses from these two ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.effects import EffectPlace, Rows
from ...models.effects.columns import ONSET, on_columns, ports, response
from ...models.effects.last_stage import LAST_HOUR

FEWEST_ROWS = 2
"""Least number of rows on each side of a step; a step of one row is an outlier."""
CELL = 0.15
"""Width of a cell of time constants, as a difference of their logarithms."""
LONGEST = 10.0
"""Longest time constant over the record's length; a longer one looks like a drift."""
SHORTEST_ROW = 2
"""What settles before this row is an outlier of the first."""
SHORTER = 0.05
"""Shortest lag that is sought, as a part of the time of that row."""
BEFORE = 0.5
"""Distance of earlier temperatures beyond the record's, on both sides, over its range."""
MOST_THIRD = 0.43
"""The largest third derivative of e^(−x) by the logarithm of x."""
AT_ONCE = 1e-300
"""A time constant [h] with which nothing is left of what fades."""


@dataclass(frozen=True, eq=False)
class Cell:
    """An effect whose unknown number lies between two ends: there it is linear in its coefficients.

    Attributes
    ----------
    place : EffectPlace
    ends : (float, float)
        of the number [h]
    columns : (N, 3, K)
        change of the readings by a unit of each coefficient [g]
    numbers : (K,)
        the number at which each coefficient has these columns
    missed : (N, 3, K) or None
        error of a reading [g] per unit of the size of each coefficient, which then all have one sign;
        None where the columns are exact
    sums : (S, K) or None
        sums of coefficients that are the first of the parameters; None where these are the coefficients
    elsewhere : callable or None
        other rows, later than these -> (n, 3, K): the columns there
    """

    place: EffectPlace
    ends: tuple[float, float]
    columns: Floats
    numbers: Floats
    missed: Floats | None = None
    sums: Floats | None = None
    elsewhere: Callable[[Rows], Floats] | None = None

    @property
    def one_sign(self) -> bool:
        """Return whether the coefficients all have one sign."""
        return self.missed is not None

    @property
    def directions(self) -> Floats:
        """Sums (S, K) of coefficients that are the first of the parameters."""
        if self.sums is None:
            return np.eye(len(self.numbers))
        return self.sums

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """The possible values of each parameter."""
        limits = [parameter.range for parameter in self.place.definition.linear_parameters]
        return (*limits, self.ends)

    @property
    def low(self) -> Floats:
        """Lower ends (K,) of the coefficients: that of the first parameter to which each belongs."""
        return np.array(self.limits)[self._parameters, 0]

    @property
    def high(self) -> Floats:
        """Upper ends (K,) of the coefficients."""
        return np.array(self.limits)[self._parameters, 1]

    @property
    def _parameters(self) -> Ints:
        return (self.directions != 0.0).argmax(axis=0)

    def values(self, coefficients: Floats) -> tuple[float, ...]:
        """Values of the parameters; the number is the mean of those of the coefficients, by logarithms."""
        sizes = (self.directions @ coefficients).tolist()
        number = float(self.numbers[0])
        if self.one_sign:
            weights = np.full(len(self.numbers), 1.0 / len(self.numbers))
            if sizes[0] != 0.0:
                weights = coefficients / sizes[0]
            number = float(np.exp(weights @ np.log(self.numbers)))
        return (*sizes, number)

    def undecided(self, rows: Rows, sigma: float) -> Bools:
        """Return which readings (n, 3) of other rows lie between the ends of a time, so that they are undecided."""
        within = (rows.hours > self.ends[0]) & (rows.hours < self.ends[1])
        return within[:, None] & np.any(self.columns != 0.0, axis=(0, 2)) & (not self.one_sign)


@dataclass(frozen=True, eq=False)
class CellsAtRest(Sequence[Cell]):
    """The cells of an effect's unknown number for readings at rest, each made when it is looked at."""

    place: EffectPlace
    rows: Rows

    def __len__(self) -> int:
        return max(0, len(self.ends) - 1)

    def __getitem__(self, k: Any) -> Any:
        """One cell."""
        if not 0 <= k < len(self):
            raise IndexError(k)
        low, high = self.ends[k : k + 2].tolist()
        if self.is_step:
            after = self.first * (self.rows.hours > low)[:, None, None]
            middles = np.full(after.shape[2], 0.5 * (low + high))
            return Cell(self.place, (low, high), after, middles, elsewhere=self.from_first)
        # A record cannot distinguish the end of the searched range from the values beyond it.
        if k == 0:
            low = 0.0
        if k == len(self) - 1:
            high = LAST_HOUR
        count = len(self.beginnings)
        sums = np.vstack((np.ones(2 * count), np.tile(self.beginnings.T, 2)))
        numbers, missed = np.repeat(self.ends[k : k + 2], count), np.tile(self.missed(k), 2)
        elsewhere = partial(self.with_constants, k)
        return Cell(self.place, (low, high), elsewhere(self.rows), numbers, missed, sums, elsewhere)

    @property
    def is_step(self) -> bool:
        """Return whether the number is the time of a step: a cell for each row, made quickly."""
        return self.place.definition.searched == ONSET

    @cached_property
    def first(self) -> Floats:
        """Columns (N, 3, K) of an effect that acts from the first row of the record on."""
        return self.from_first(self.rows)

    @cached_property
    def ends(self) -> Floats:
        """Ends (C + 1,) of the cells [h]."""
        hours, effect = self.rows.hours, self.place.definition
        if self.is_step:
            times, counts = np.unique(hours, return_counts=True)
            before = np.cumsum(counts)
            # Gaps with enough rows on both sides are next to each other: a time before each, and one behind the last.
            enough = (before[:-1] >= FEWEST_ROWS) & (len(hours) - before[:-1] >= FEWEST_ROWS)
            return times[np.append(enough, False) | np.append(False, enough)]
        if effect.memory is None:
            return time_constants(hours)
        return time_constants(hours, SHORTER)

    def read(self, added: Floats, rows: Rows) -> Floats:
        """Return the changes (N, 3, K) of the readings by additions (N, ports, K) at the effect's stage."""
        return rows.by_ports(self.place.definition.stage) @ added

    def from_first(self, rows: Rows) -> Floats:
        """Columns (N, 3, K) of an effect that acts from the first row on."""
        return self.read(ports(self.place.definition, self.place, rows), rows)

    @cached_property
    def beginnings(self) -> Floats:
        """Limits of the further coefficients per unit of the first: (B, 0) or (B, 1)."""
        if self.place.definition.memory is None:
            return np.zeros((1, 0))
        return beginnings(self.warmth)[:, None]

    @property
    def warmth(self) -> Floats:
        """Temperature of the record [degC]; ValueError where it is not known."""
        if self.rows.temperature is None:
            raise ValueError("effects of temperature need the temperature of the rows")
        return self.rows.temperature

    def with_constants(self, k: int, rows: Rows) -> Floats:
        """Columns (N, 3, 2 B) with the time constants at both ends of a cell, of each from every beginning."""
        place, columns, at = self.place, [], rows
        for number in (k, k + 1):
            if place.definition.memory is not None:
                at = replace(rows, kept=self.lag(number, rows))
            for further in self.beginnings.tolist():
                parameters = [1.0, *further, float(self.ends[number])]
                columns.append(response(place.definition, place, at, parameters))
        return self.read(np.stack(columns, axis=2), rows)

    def lag(self, number: int, rows: Rows) -> Floats:
        """The lagging temperature (N,) at the rows of the record, or at others as if each were the next after it."""
        effect, lag = self.place.definition, lagged_of(self.rows.hours.tobytes(), self.warmth.tobytes())[0][:, number]
        if rows is self.rows:
            return lag
        temperatures, before = [lag[-1]] * 3, (self.rows.hours[-1], self.warmth[-1])
        sizes = [0.0] * len(effect.linear_parameters)
        arguments = [*effect.place_numbers(self.place), *sizes, float(self.ends[number]), temperatures]
        on_columns(effect.memory)(rows.seen_by(effect.component)[0], before, *arguments)
        return np.asarray(temperatures[self.place.index], dtype=float)

    def missed(self, k: int) -> Floats:
        """Return the error (N, 3, B) within a cell of the mean of the columns at its ends, per unit of size."""
        place, rows, ends = self.place, self.rows, self.ends[k : k + 2]
        faded = fading_error(rows.hours, ends)[:, 0]
        if place.definition.memory is None:
            # The fading part is the difference between a response that never fades and one that fades at once.
            fading = ports(place.definition, place, rows, np.inf) - ports(place.definition, place, rows, AT_ONCE)
            error = np.abs(fading) * faded[:, None, None]
            return np.abs(rows.by_ports(place.definition.stage)) @ error
        error = lagged_of(rows.hours.tobytes(), self.warmth.tobytes())[1][:, k] + rows.temperature_resolution
        missed = np.zeros((len(rows.hours), 3, len(self.beginnings)))
        missed[:, place.index] = error[:, None] + faded[:, None] * np.abs(self.beginnings[:, 0])
        return missed


def time_constants(hours: Floats, part: float = 1.0) -> Floats:
    """Return ends (C + 1,) of the cells of time constants [h] for rows at some hours (N,); none for too few rows.

    The shortest is a `part` of the time of the third row.
    """
    times = np.unique(hours)
    if len(times) <= SHORTEST_ROW:
        return np.zeros(0)
    shortest, longest = part * (times[SHORTEST_ROW] - times[0]), LONGEST * (times[-1] - times[0])
    count = int(np.ceil(np.log(longest / shortest) / CELL))
    return np.geomspace(shortest, longest, count + 1)


def fading_error(hours: Floats, ends: Floats) -> Floats:
    """Return the error (N, C) within each cell of the mean of e^(−t/τ) at its ends, cells (C + 1,)."""
    return most_bent(hours[:, None] / ends) * np.log(ends[1:] / ends[:-1]) ** 2 / 8.0


def most_bent(x: Floats) -> Floats:
    """The largest second derivatives (N, C) of e^(−x) by log x, each between two neighbours of falling x (N, C + 1)."""
    by_log = np.abs(x * x - x) * np.exp(-x)
    largest = np.maximum(by_log[:, :-1], by_log[:, 1:])
    # The extremes of the second derivative.
    for peak in (0.5 * (3.0 - 5.0**0.5), 0.5 * (3.0 + 5.0**0.5)):
        inside = (x[:, 1:] <= peak) & (x[:, :-1] >= peak)
        largest = np.where(inside, abs(peak * peak - peak) * np.exp(-peak), largest)
    return largest


def lagged(hours: Floats, temperature: Floats, ends: Floats) -> tuple[NDArray, NDArray]:
    """Return the lag (N, C + 1) of a temperature at ends of cells, and the error (N, C) of their means.

    The temperature (N,) is linear between the rows, and its lag begins with it.
    """
    ages = np.maximum(0.0, hours[:, None] - hours)
    slopes = np.diff(temperature) / np.where(np.diff(hours) > 0.0, np.diff(hours), np.inf)
    values, by_log = np.zeros((2, len(hours), len(ends)))
    for k, end in enumerate(ends):
        x = ages / end
        faded = np.exp(-x)
        # For a slope that began at each age: the delay of the lag, and its second derivative by log τ.
        behind = end * (1.0 - faded)
        bent = end * (1.0 - faded * (1.0 + x + x * x))
        values[:, k] = temperature - (behind[:, :-1] - behind[:, 1:]) @ slopes
        by_log[:, k] = np.abs((bent[:, :-1] - bent[:, 1:]) @ slopes)
    travelled = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(temperature)))))
    width = np.log(ends[1:] / ends[:-1])
    largest = np.maximum(by_log[:, :-1], by_log[:, 1:]) + 0.5 * width * MOST_THIRD * travelled[:, None]
    return values, largest * width**2 / 8.0


@lru_cache(maxsize=4)
def lagged_of(hours: bytes, temperature: bytes) -> tuple[NDArray, NDArray]:
    """Return `lagged` of a record, computed once for all accelerometers."""
    when = np.frombuffer(hours)
    return lagged(when, np.frombuffer(temperature), time_constants(when, SHORTER))


def beginnings(temperature: Floats) -> Floats:
    """Return the limits (2,) [K] of a lag above the first of some temperatures (N,)."""
    low, high = float(temperature.min()), float(temperature.max())
    return np.array([low - BEFORE * (high - low), high + BEFORE * (high - low)]) - temperature[0]
