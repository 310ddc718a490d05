"""Breaks of other parts in place of a step of the catalogue: a set with a step does not prove what changed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.effects import EffectPlace
from ..bounded.work import CutOff, Work
from ..evidence.bench import Bench
from ..evidence.bench_visits import signature_columns
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from .breaks import NEAR, Beside, BreakSearch, ChangingGroup, FittingBreaks, RowGap
from .removal import held_by
from .simple import Simple

NEAREST = 3
"""Gaps around the time of a step at which other parts may have changed."""
MOST_FITS = 3
"""Most sets, the first ones, that are compared."""
FARTHER = 1
"""Numbers more than the set from which a break is not a rival."""
SLACK = 0.5
"""Largest error of the linear model about a set for another break [bounds]."""
MOST_WORK = 2e7


def other_breaks(evidence: Evidence, fits: Sequence[Fit]) -> tuple[Simple, ...]:
    """Return breaks that make the exact model fit beside the other effects of sets that contain a step.

    A step of the catalogue is that of one bias, one scale factor or the whole mounting. `fits` are the sets, the best
    ones first. The breaks with the fewest numbers come first.
    """
    if not isinstance(evidence.model, Bench) or evidence.model.radius < NEAR:
        return ()
    search = BreakSearch(evidence, Work(MOST_WORK, "breaks in place of steps"))
    faults: dict[tuple[ChangingGroup, Beside], Simple] = {}
    try:
        for fit in fits[:MOST_FITS]:
            for other in _in_place_of_steps(search, fit):
                key = other.group, other.beside
                if key not in faults and (standing := other.standing(search)):
                    faults[key] = search.simple([other.group], standing, other.beside)
    except CutOff:
        return ()
    return tuple(sorted(faults.values(), key=lambda fault: (fault.numbers, fault.radius)))


@dataclass(frozen=True, eq=False)
class Other:
    """A break of a group in place of a step of a fitted set, beside effects of the set; with the gaps to try."""

    fit: Fit
    group: ChangingGroup
    beside: Beside
    gaps: Sequence[RowGap]

    def may_stand(self, search: BreakSearch, gap: RowGap) -> bool:
        """Return true if the model linear about the set fits with the break."""
        fit, count = self.fit, len(self.fit.point)
        kept, residual = list(range(count)), fit.residual
        for place, block, _ in fit.ways:
            numbers = range(count + block.start, count + block.stop)
            if place in self.beside.effects:
                kept += numbers
            else:
                residual = residual + fit.jacobian[:, list(numbers)] @ fit.coefficients[block]
        columns = signature_columns(self.group.jumping(gap.hours), search.model.readings.rows_with(fit))
        matrix = np.hstack((fit.jacobian[:, kept], columns)) / fit.allowed[:, None]
        return held_by(matrix, residual / fit.allowed)[0] <= search.model.limit + SLACK

    def standing(self, search: BreakSearch) -> list[FittingBreaks]:
        """Return the gaps at which the break makes the exact model fit, with its fits, the least radius first."""
        standing = []
        for gap in self.gaps:
            if self.may_stand(search, gap):
                fit = search.fitted((*self.group.jumping(gap.hours), *self.beside.effects))
                standing += [] if fit is None else [FittingBreaks((gap,), fit)]
        return sorted(standing, key=lambda one: one.fit.radius)


def _in_place_of_steps(search: BreakSearch, fit: Fit) -> Iterator[Other]:
    """Yield breaks that may replace a step of a set, or the step and another effect."""
    by_name = {group.catalogued: group for group in search.every_group if group.catalogued}
    values = dict(zip(fit.places, fit.values(), strict=True))
    for step in fit.places:
        if step.effect not in by_name or len(fit.places) == 1:
            continue
        hours = values[step][-1]
        gaps = sorted(search.gaps, key=lambda gap: abs(gap.hours - hours))[:NEAREST]
        others = tuple(place for place in fit.places if place != step)
        most = by_name[step.effect].numbers + Beside(others).numbers + FARTHER
        for kept in _with_and_without_one(others):
            for group in search.groups:
                if group.numbers + Beside(kept).numbers <= most:
                    yield Other(fit, group, Beside(kept), gaps)


def _with_and_without_one(places: Sequence[EffectPlace]) -> list[tuple[EffectPlace, ...]]:
    """Return the effects without each one in turn (at least one remains), then all of them."""
    fewer = [tuple(place for place in places if place != other) for other in places] if len(places) > 1 else []
    return [*fewer, tuple(places)]
