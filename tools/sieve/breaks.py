"""A break: something of bench or block changes once, between two rows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.effects import EffectPlace, Rows
from ...models.effects.columns import is_inner_axis
from ...models.effects.definition import ACCELEROMETERS, AXES
from ...models.effects.lookup import ALL_ACCELEROMETERS, SCALE
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import Interval, SolverError, column_space
from ..bounded.sets import EffectSet, Problem, linear_radius, sets_of_size
from ..bounded.work import Work
from ..evidence.bench import Bench
from ..evidence.bench_in_motion import BenchInMotion
from ..evidence.bench_visits import signature_columns
from ..evidence.cells import FEWEST_ROWS
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, estimated
from ..rounding import Stated, exactly
from .simple import Simple

NEAR = 1.3
"""Below this radius a slightly larger noise bound does as well: nothing is proven."""
ROUNDS = 8
"""Rounds of least squares in which rows that misfit lose their weight."""
MOST_SLACK = 200.0
"""Largest error of the linear model about a fit to most of the rows [bounds]."""
MOST_SLACK_OF_TWO = 2.0
"""The same for two breaks."""
MOST_AT_ONCE = 4_000_000
"""Numbers in the columns of breaks that are judged together (160 MB): as many gaps of a long record as that allows."""
MOST_EXACT = 6
"""Gaps that are fitted in succession without success, the most promising first, before the search ends."""
MANY_ROWS, FEWEST_OF_FEW = 24, 4
"""A record with fewer rows than the first number needs the second number of rows on each side of a break."""
FROM_THE_FIRST = -1.0
"""A time [h] before every record."""
ROW, SPARE = 4, 5
"""Numbers that one wrong row costs; readings beyond a break that its numbers leave over, or the rows do as well."""


@dataclass(frozen=True)
class ChangingPart:
    """One number of bench or block that may change: a function that jumps, with its place and its factor.

    `key` is its name in results.
    """

    where: str
    factor: str
    key: str
    unit: str

    def jumping(self, hours: float) -> EffectPlace:
        """The change after a time [h], as an effect."""
        times = f"{self.factor} times " if self.factor else ""
        return EffectPlace("lookup", self.where, law=f"{times}hours jumps at {hours!r}")


BIASES = tuple(ChangingPart(where, "", f"bias_{p}_g", "g") for p, where in enumerate(ACCELEROMETERS, start=1))
SCALES = tuple(ChangingPart(where, f"n{p}", f"scale_factor_{p}", "") for p, where in enumerate(ACCELEROMETERS, start=1))
COMMON_SCALE = ChangingPart(ALL_ACCELEROMETERS, SCALE, "scale_factor", "")
ANGLES = tuple(ChangingPart(MOUNTING, f"turn {k}", f"mounting_{k}_rad", "rad") for k in (1, 2, 3))
OUTER_ZERO = ChangingPart(AXES[0], "", "alpha_zero_rad", "rad")
INNER_ZERO = ChangingPart(AXES[1], "", "beta_zero_rad", "rad")
PUT_BACK = "Possible cause: the block was taken off and put back, or it slipped."
SWITCHED = "Possible cause: a restart or a knock."
ANOTHER_GRAVITY = "Possible cause: another value of gravity, another unit or range."
LOST_COUNTS = "Possible cause: an encoder that lost counts or slipped."


@dataclass(frozen=True)
class ChangingGroup:
    """Parts that change together at a break.

    `words` begin the sentence, `supposed` ends it; `catalogued` is the effect of the catalogue that is the same, `same`
    are other parts that no record tells from these.
    """

    words: str
    parts: tuple[ChangingPart, ...]
    supposed: str
    catalogued: str = ""
    same: tuple[ChangingPart, ...] = ()

    @property
    def numbers(self) -> int:
        """Coefficients, and one for the gap."""
        return len(self.parts) + 1

    @property
    def where(self) -> tuple[str, ...]:
        """The places that change."""
        return tuple(dict.fromkeys(part.where for part in self.parts))

    def is_part_of(self, group: "ChangingGroup") -> bool:
        """Return true if another group can always make the same change."""
        parts = set(group.parts)
        return set(self.parts) <= parts or bool(self.same and set(self.same) <= parts)

    def jumping(self, hours: float) -> tuple[EffectPlace, ...]:
        """The change after a time [h], as effects."""
        return tuple(part.jumping(hours) for part in self.parts)


def groups_of(rows: Rows) -> tuple[ChangingGroup, ...]:
    """Return the groups, those with the fewest numbers first."""
    groups = [
        ChangingGroup(f"the bias of accelerometer {p}", (BIASES[p - 1],), SWITCHED, "bias-step") for p in (1, 2, 3)
    ]
    groups += [
        ChangingGroup(f"the scale factor of accelerometer {p}", (SCALES[p - 1],), "", "scale-step") for p in (1, 2, 3)
    ]
    inner, same = "the zero of the inner axis", []
    for k, angle in enumerate(ANGLES):
        if is_inner_axis(rows, k):
            same.append(angle)
            inner += f", or (no record tells them apart) the mounting about axis {k + 1} of the block,"
        else:
            groups.append(ChangingGroup(f"the mounting about axis {k + 1} of the block", (angle,), PUT_BACK))
    groups.append(ChangingGroup("the zero of the outer axis", (OUTER_ZERO,), LOST_COUNTS))
    groups.append(ChangingGroup(inner, (INNER_ZERO,), LOST_COUNTS, same=tuple(same)))
    alike = "the scale factor of all accelerometers alike"
    groups.append(ChangingGroup(alike, (COMMON_SCALE,), ANOTHER_GRAVITY, same=SCALES))
    groups.append(ChangingGroup("the biases", BIASES, SWITCHED))
    groups.append(ChangingGroup("the scale factors", SCALES, ""))
    groups.append(ChangingGroup("the mounting", ANGLES, PUT_BACK, "mounting-slip"))
    groups.append(ChangingGroup("the biases and the mounting", BIASES + ANGLES, PUT_BACK))
    return tuple(groups)


def breaks(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the smallest breaks that make the model fit."""
    if not isinstance(evidence.model, Bench | BenchInMotion) or evidence.model.radius < NEAR:
        return ()
    search, found = BreakSearch(evidence, Work()), []
    contained: list[ChangingGroup] = []
    for group in search.groups:
        if any(smaller.is_part_of(group) for smaller in contained):
            continue
        if fits := search.standing(group):
            contained.append(group)
            found.append(search.simple([group], fits))
    return tuple(found)


@dataclass(frozen=True)
class RowGap:
    """A gap between two rows: their numbers, from 0, of the order of time, and a time [h] between them."""

    before: int
    after: int
    hours: float


@dataclass(frozen=True, eq=False)
class FittingBreaks:
    """Gaps, one for each break, and the fit of the exact model."""

    gaps: tuple[RowGap, ...]
    fit: Fit


@dataclass(frozen=True)
class Beside:
    """Causes beside breaks: effects of the simulation, or a wrong row, as the search counts it or as the file does."""

    effects: tuple[EffectPlace, ...] = ()
    rows: tuple[int, ...] = ()

    @property
    def numbers(self) -> int:
        """Numbers of both, and one more for each."""
        numbers = (ROW + 1) * len(self.rows)
        for place in self.effects:
            numbers += len(place.definition.parameters) + (place.order is not None) + 1
        return numbers

    @property
    def where(self) -> tuple[str, ...]:
        """Their places."""
        return (*(place.where for place in self.effects), *(f"row-{row}" for row in self.rows))

    def sentences(self, values: Sequence[Sequence[float]], ends: Sequence[Sequence[Interval]]) -> Iterator[str]:
        """Describe the causes in words, with the sizes of the effects and their intervals."""
        for place, sizes, intervals in zip(self.effects, values, ends, strict=False):
            stated = {}
            for parameter, size, (low, high) in zip(place.definition.parameters, sizes, intervals, strict=True):
                stated[parameter.name] = Stated(size, low, high)
            yield f"Beside that {place.definition.sentence(place, stated)}."
        for row in self.rows:
            yield f"Beside that row {row} is wrong."


ALONE = Beside()


@dataclass(frozen=True, eq=False)
class BreakSearch:
    """The search for breaks in the rows of a bench, linear about a fit in which rows that misfit have little weight."""

    evidence: Evidence
    work: Work

    @cached_property
    def model(self) -> Bench:
        """The model of the rests without a break; the exact fit adds the rows that need turns."""
        model = self.evidence.model
        return model.rests if isinstance(model, BenchInMotion) else model

    @cached_property
    def rows(self) -> Rows:
        """The rows for signatures at that fit."""
        return self.model.readings.rows(self.point)

    @cached_property
    def listed(self) -> frozenset[str]:
        """Effects of the catalogue that the record can show."""
        return frozenset(place.effect for place in self.model.places)

    @property
    def every_group(self) -> tuple[ChangingGroup, ...]:
        """All groups of parts that may change together."""
        return groups_of(self.rows)

    @property
    def groups(self) -> tuple[ChangingGroup, ...]:
        """The groups that are not in the catalogue; the search for effects covers the others."""
        groups = [group for group in self.every_group if group.catalogued not in self.listed]
        if isinstance(self.evidence.model, BenchInMotion):
            # The gyros see a turn of the block, too, at the moment of the turn: a slip of the catalogue.
            groups = [group for group in groups if set(group.where) <= set(ACCELEROMETERS)]
        return tuple(groups)

    @cached_property
    def order(self) -> Ints:
        """The rows (N,) in the order of time."""
        return np.argsort(self.hours, kind="stable")

    @property
    def hours(self) -> Floats:
        """Times (N,) of the rows [h]."""
        return self.model.readings.circumstances.hours

    @cached_property
    def gaps(self) -> list[RowGap]:
        """All gaps with enough rows on each side."""
        hours, gaps = self.hours[self.order], []
        fewest = FEWEST_ROWS if len(hours) >= MANY_ROWS else FEWEST_OF_FEW
        for after in range(fewest, len(hours) - fewest + 1):
            if hours[after] > hours[after - 1]:
                gaps.append(RowGap(after - 1, after, float(0.5 * (hours[after] + hours[after - 1]))))
        return gaps

    @cached_property
    def point(self) -> Floats:
        """Parameters (P,) of a fit to most of the rows."""
        point = self.model.here.point
        for _ in range(ROUNDS):
            at = self.model.about((), point, np.zeros(0))
            misfit = np.linalg.norm((at.residual / at.bound).reshape(-1, 3), axis=1)
            scale = 1.0 / (at.bound * np.repeat(np.sqrt(np.maximum(misfit, 1.0)), 3))
            point = point + estimated(at.jacobian * scale[:, None], at.residual * scale)
        return point

    @cached_property
    def problem(self) -> Problem:
        """The model without a break, about that fit."""
        at = self.model.about((), self.point, np.zeros(0))
        return Problem.of(at.residual / at.bound, column_space(at.jacobian / at.bound[:, None]), ())

    @cached_property
    def slack(self) -> float:
        """Largest error of the linear model, in bounds."""
        largest = float(np.abs(self.problem.residual).max())
        return self.model.limit - 1.0 + min(MOST_SLACK, self.model.curvature * largest**2)

    def columns(self, group: ChangingGroup) -> Iterator[Floats]:
        """Yield the columns that a change at each gap adds to the rows (M, k), in units of their bounds."""
        places = group.jumping(FROM_THE_FIRST)
        columns = signature_columns(places, self.rows) / self.model.rows.bound[:, None]
        return (columns * np.repeat(self.hours > gap.hours, 3)[:, None] for gap in self.gaps)

    def promising(self, group: ChangingGroup) -> list[RowGap]:
        """Gaps at which no bound refuses a change of the linear model, those that leave least first."""
        columns, radii = self.columns(group), {}
        size = max(1, MOST_AT_ONCE // (len(self.problem.residual) * len(group.jumping(FROM_THE_FIRST))))
        for first in range(0, len(self.gaps), size):
            blocks = list(islice(columns, size))
            problem = Problem.of(self.problem.residual, self.problem.nominal, blocks, alike=len(blocks))
            for chosen in sets_of_size(problem, 1, self.slack, 0, self.work):
                (number,) = chosen.effects
                radii[first + number] = linear_radius(problem, EffectSet((number,)))
        return [self.gaps[number] for number in sorted(radii, key=lambda number: radii[number])]

    def standing(self, group: ChangingGroup) -> list[FittingBreaks]:
        """Return the gaps at which a change makes the exact model fit, with its fits, the least radius first."""
        standing, failed = [], 0
        for gap in self.promising(group):
            fit = self.fitted(group.jumping(gap.hours))
            if fit is not None:
                standing.append(FittingBreaks((gap,), fit))
            failed += fit is None
            if failed == MOST_EXACT:
                break
        return sorted(standing, key=lambda one: one.fit.radius)

    def gaps_with(
        self, groups: Sequence[ChangingGroup], effects: Sequence[EffectPlace]
    ) -> Iterator[tuple[RowGap, ...]]:
        """Yield the gaps of breaks, in the order of time, with which the exact model fits beside linear effects."""
        options: list[tuple[ChangingGroup, RowGap]] = []
        columns: list[NDArray] = []
        for group in dict.fromkeys(groups):
            options += [(group, gap) for gap in self.gaps]
            columns += self.columns(group)
        beside = signature_columns(effects, self.rows) / self.model.rows.bound[:, None]
        nominal = column_space(np.hstack((self.problem.nominal, beside)))
        problem = Problem.of(self.problem.residual, nominal, columns)
        slack = self.slack if len(groups) == 1 else min(self.slack, MOST_SLACK_OF_TWO)
        for chosen in sets_of_size(problem, len(groups), slack, 0, self.work):
            broken = sorted((options[number] for number in chosen.effects), key=lambda one: one[1].hours)
            gaps = tuple(gap for _, gap in broken)
            in_order = [group for group, _ in broken] == list(groups)
            if in_order and self.fitted((*jumping_at(groups, gaps), *effects)) is not None:
                yield gaps

    def fitted(self, places: Sequence[EffectPlace]) -> Fit | None:
        """Return the exact model with a change; None if it does not fit."""
        try:
            fits = self.evidence.model.mended(places, self.work)
        except (ValueError, SolverError):
            return None
        return fits[0] if fits else None

    def simple(
        self, groups: Sequence[ChangingGroup], standing: Sequence[FittingBreaks], beside: Beside = ALONE
    ) -> Simple:
        """Return breaks of some groups, with the causes beside them, as a fault of the record; best gaps first."""
        (best, *others), room = standing, self.evidence.model.room
        fit = replace(best.fit, also=tuple(one.fit for one in others)).centred(room)
        values, intervals = list(fit.values()), list(fit.intervals(room))
        change: dict[str, float] = {}
        ends: dict[str, tuple[float, float]] = {}
        sentences, numbers = [], beside.numbers + len(groups) - 1
        for k, (group, gap) in enumerate(zip(groups, best.gaps, strict=True)):
            sizes = []
            ending = f"_from_{self.unit_of_rows}_{self.row_after(gap)}" if k else ""
            for part in group.parts:
                (value,), ((low, high),) = values.pop(0), intervals.pop(0)
                sizes.append(Stated(min(max(value, low), high), low, high))
                change[part.key + ending], ends[part.key + ending] = float(sizes[-1]), (low, high)
            first = min(one.gaps[k].before for one in standing)
            last = max(one.gaps[k].after for one in standing)
            sentence = f"{self.between(first, last)} {group.words} changed by {said(group, sizes)}"
            sentences.append(
                f"{sentence}{'' if k else '; all else is the same before and after'}. {group.supposed}".strip()
            )
            numbers += self.numbers_of(group, gap)
        gap, beside = best.gaps[0], self.numbered(beside)
        first, last = min(one.gaps[0].before for one in standing), max(one.gaps[0].after for one in standing)
        between = self.number_at(first), self.number_at(last)
        return Simple(
            kind="break",
            numbers=numbers,
            where=tuple(dict.fromkeys(place for group in groups for place in group.where)) + beside.where,
            sentence=" ".join([*sentences, *beside.sentences(values, intervals)]),
            radius=best.fit.radius,
            evidence=self.evidence,
            rows=beside.rows,
            change=change,
            within=ends if self.model.calibration.sigma.kind == "bound" else {},
            before_row=None if self.of_rests else self.row_after(gap),
            between_rows=between,
            time_s=float(self.model.readings.circumstances.began + 3600.0 * gap.hours),
            fit=fit,
            beside=beside.effects,
        )

    def numbers_of(self, group: ChangingGroup, gap: RowGap) -> int:
        """Return the numbers of a break; near an end of the record at least those of the rows beyond it."""
        beyond = min(gap.after, len(self.hours) - gap.after)
        if 3 * beyond - len(group.parts) < SPARE:
            return max(group.numbers, ROW * beyond)
        return group.numbers

    def row_after(self, gap: RowGap) -> int:
        """The first row after a gap, as in the file; of a series the number of its rest."""
        return self.number_at(gap.after)

    @cached_property
    def numbers(self) -> Ints:
        """Numbers (N,) of the rows in the file; of a series those of its rests."""
        source = self.evidence.source
        return np.arange(1, len(self.hours) + 1) if source is None else source.record.numbers

    def number_at(self, place: int) -> int:
        """Return the number of the row at a place, from 0, of the order of time."""
        return int(self.numbers[self.order[place]])

    def numbered(self, beside: Beside) -> Beside:
        """Return the causes beside breaks, their rows by the numbers of the file."""
        return replace(beside, rows=tuple(int(self.numbers[row - 1]) for row in beside.rows))

    @cached_property
    def of_rests(self) -> bool:
        """Return true if the rows are the rests of a series, not rows of a file."""
        source = self.evidence.source
        return source is not None and source.record.raw is not None

    @property
    def unit_of_rows(self) -> str:
        """Return the word for a row: "rest" or "row"."""
        return "rest" if self.of_rests else "row"

    def between(self, first: int, last: int) -> str:
        """Between which rows, from 0 in the order of time; of a series also when."""
        rows = f"Between {self.unit_of_rows}s {self.number_at(first)} and {self.number_at(last)}"
        if not self.of_rests:
            return rows
        circumstances = self.model.readings.circumstances
        begin, end = circumstances.began + 3600.0 * self.hours[self.order[[first, last]]]
        return f"{rows} ({exactly(round(begin))} s to {exactly(round(end))} s)"


def jumping_at(groups: Sequence[ChangingGroup], gaps: Sequence[RowGap]) -> tuple[EffectPlace, ...]:
    """Return the changes of groups at gaps, as effects."""
    places: list[EffectPlace] = []
    for group, gap in zip(groups, gaps, strict=True):
        places += group.jumping(gap.hours)
    return tuple(places)


def said(group: ChangingGroup, sizes: Sequence[Stated]) -> str:
    """Changes in words, each with its unit."""
    by_unit: dict[str, list[str]] = {}
    for part, size in zip(group.parts, sizes, strict=True):
        by_unit.setdefault(part.unit, []).append(f"{size:+.3g}")
    texts = []
    for unit, values in by_unit.items():
        text = values[0] if len(values) == 1 else f"({', '.join(values)})"
        texts.append(f"{text} {unit}".strip())
    return " and ".join(texts)
