"""The smallest sets of effects that explain a record: candidates, linear search, exact judgement."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace
from ...models.effects.outlier import place_of
from ..bounded.programmes import chebyshev_radius
from ..bounded.sets import MAX_SET, Problem, sets_of_size
from ..calibration.model import Linearisation
from ..progress import tracked
from .arguments import left_open
from .centre import TOO_MUCH, Centre, anchors, centre_of, moved, problem_at, slack_at
from .circumstances import Circumstances
from .classes import Classes
from .disturbance import added_bound, rows_at, signature_columns
from .extended_fit import ExtendedFit, fit_ways
from .intervals import parameter_intervals
from .possible import LARGEST_OF_BENCH, within_possible
from .variants import Relaxation, relaxations

MOST_FOUND = 60
"""So many sets of one size are enough to say that the positions cannot decide."""
MOST_JUDGED = 1500
"""So many sets of one size are fitted exactly before the search gives up."""


@dataclass(frozen=True)
class Found:
    """The smallest sets that explain a record.

    Attributes
    ----------
    fits : tuple of ExtendedFit
        the least radius first
    complete : bool
        whether they are all; else the search was cut off
    """

    fits: tuple[ExtendedFit, ...]
    complete: bool = True


def catalogue_places(baseline: str, circumstances: Circumstances) -> list[EffectPlace]:
    """Every effect at every place that can be tried: not in the baseline's model, nothing missing in the record."""
    return [
        place
        for effect in POSITION_EFFECTS.values()
        if effect.within != baseline and all(getattr(circumstances, need) is not None for need in effect.needs)
        for place in effect.places
    ]


def title_of(places: Sequence[EffectPlace]) -> str:
    """A set of effects in words."""
    return " and ".join(place.title for place in places)


def relaxed(problem: Problem, here: Linearisation, relaxation: Sequence[Relaxation]) -> tuple[Problem, NDArray]:
    """The problem that bounds every set with these effects from below, and the readings (m,) that it keeps."""
    if not relaxation:
        return problem, np.arange(len(problem.residual))
    nominal = np.hstack([problem.nominal, *(r.columns / here.bound[:, None] for r in relaxation)])
    widened = here.bound + sum(r.widening for r in relaxation)
    kept = np.flatnonzero(~np.any([r.touched for r in relaxation], axis=0))
    shrunk = (here.bound / widened)[kept]
    return (
        Problem(
            problem.residual[kept] * shrunk,
            nominal[kept] * shrunk[:, None],
            problem.columns[kept] * shrunk[:, None],
            problem.blocks,
        ),
        kept,
    )


def linear_sets(
    here: Linearisation,
    circumstances: Circumstances,
    centre: Centre,
    places: Sequence[EffectPlace],
    bent: Sequence[Relaxation],
    size: int,
    known: dict[tuple[EffectPlace, ...], list[Centre]],
) -> Iterator[frozenset[EffectPlace]]:
    """Sets of so many linear effects and outliers, beside those of a centre, that no bound refuses.

    Where the misfit is so large that the linear model may be wrong by much, the sets with an effect that stands out are
    judged at a fit that has it; `known` keeps such fits.
    """
    slack = slack_at(centre, here)
    free = [place for place in places if place not in centre.fixed]
    if size > 0 and slack > TOO_MUCH:
        if centre.fixed not in known:
            known[centre.fixed] = anchors(here, circumstances, centre, free)
        more = known[centre.fixed]
        for one in more:
            yield from linear_sets(here, circumstances, one, places, bent, size - 1, known)
        free = [place for place in free if place not in {one.fixed[-1] for one in more}]
    part, kept = relaxed(problem_at(here, circumstances, centre, free), here, bent)
    for candidate in sets_of_size(part, size, slack):
        outliers = [int(kept[row]) for row in candidate.outliers]
        yield frozenset(
            (
                *centre.fixed,
                *(free[i] for i in candidate.effects),
                *(place_of(int(here.position[i]) + 1, int(here.accelerometer[i])) for i in outliers),
            )
        )


def candidate_sets(
    here: Linearisation,
    circumstances: Circumstances,
    centre: Centre,
    places: Sequence[EffectPlace],
    bent: Sequence[Relaxation],
    size: int,
    known: dict[tuple[EffectPlace, ...], list[Centre]],
) -> Iterator[tuple[tuple[EffectPlace, ...], tuple[Relaxation, ...]]]:
    """All sets of a size that no bound refuses: linear effects and outliers, and effects that are not linear."""
    for count in range(min(size, len(bent)) + 1):
        for chosen in combinations(bent, count):
            seen = set()
            for places_of_one in linear_sets(here, circumstances, centre, places, chosen, size - count, known):
                if places_of_one not in seen:
                    seen.add(places_of_one)
                    yield tuple(sorted(places_of_one, key=lambda place: place.title)), chosen


def smallest_explanations(
    here: Linearisation,
    circumstances: Circumstances,
    classes: Classes,
    bent: Sequence[EffectPlace],
    limit: float,
    resolution: float,
    *,
    progress: bool = False,
) -> Found:
    """All sets of effects of the smallest size, up to three, that make the record consistent; the least radius first.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    classes : Classes
        linear candidates; outliers are tried at every reading besides
    bent : sequence of EffectPlace
        candidates that are not linear
    limit : float
        radius up to which a model is consistent
    resolution : float
        half a last digit of the readings, as a fraction of g
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Found
    """
    centre = centre_of(here, circumstances, ())
    if np.abs(centre.point).max() > LARGEST_OF_BENCH:
        return Found(())
    here = moved(here, centre)
    rows = replace(rows_at(here, here.point, here.positions, circumstances), resolution=resolution)
    untold = [place for place in classes.places if added_bound([place], rows).any()]
    places = [place for place in classes.places if place not in untold]
    softened = relaxations(here, rows, [*untold, *bent])
    known: dict[tuple[EffectPlace, ...], list[Centre]] = {}
    for size in range(1, MAX_SET + 1):
        found: list[ExtendedFit] = []
        sets = candidate_sets(here, circumstances, centre, places, softened, size, known)
        candidates = tracked(sets, f"sets of {size}", show=progress)
        complete = True
        for judged, (named, chosen) in enumerate(candidates, start=1):
            found += best_in_class(here, circumstances, classes, named, chosen, limit, resolution)
            if len(found) >= MOST_FOUND or judged >= MOST_JUDGED:
                complete = False
                break
        if found or not complete:
            return Found(tuple(sorted(found, key=lambda fit: (round(fit.radius, 9), title_of(fit.places)))), complete)
    return Found(())


def best_in_class(
    here: Linearisation,
    circumstances: Circumstances,
    classes: Classes,
    linear: Sequence[EffectPlace],
    bent: Sequence[Relaxation],
    limit: float,
    resolution: float,
) -> list[ExtendedFit]:
    """The best fit of a set or, where it does not mend the record, of one with other members of the same classes.

    Members of a class differ in the second order of their sizes: noise at its bound leaves no room for that.
    """
    for places in product(*(classes.whole_class(place) for place in linear)):
        found = best_fit(here, circumstances, places, bent, limit, resolution)
        if found:
            return found
    return []


def best_fit(
    here: Linearisation,
    circumstances: Circumstances,
    linear: Sequence[EffectPlace],
    bent: Sequence[Relaxation],
    limit: float,
    resolution: float,
) -> list[ExtendedFit]:
    """A set of effects fitted in the best of the ways in which it can act; none where it does not mend the record."""
    places = [*linear, *(r.place for r in bent)]
    best: list[ExtendedFit] = []
    for ways in product(*(range(max(r.ways, 1)) for r in bent)):
        chosen = {r.place: way for r, way in zip(bent, ways, strict=True) if r.ways}
        fit = mending(fit_ways(here, circumstances, places, chosen, resolution), here, circumstances, limit)
        if fit is not None and (largest := largest_untold(fit)):
            again = fit_ways(here, circumstances, places, chosen, resolution, largest)
            fit = mending(again, here, circumstances, limit)
        if fit is not None and (not best or fit.radius < best[0].radius):
            best = [fit]
    return best


def mending(
    fit: ExtendedFit | None, here: Linearisation, circumstances: Circumstances, limit: float
) -> ExtendedFit | None:
    """A fit, with possible sizes, where it mends the record within what the record tells of its effects' arguments."""
    if fit is None:
        return None
    limit = limit + left_open(fit, here, circumstances) / float(fit.bound.min())
    return within_possible(fit, limit) if fit.radius <= limit else None


def largest_untold(fit: ExtendedFit) -> dict[EffectPlace, float]:
    """The largest coefficients that a record allows of effects whose circumstances it does not tell everywhere."""
    places = [place for place in fit.places if CATALOGUE[place.effect].at(place).untold is not None]
    intervals = dict(zip(fit.places, parameter_intervals(fit, 0.0), strict=True)) if places else {}
    return {place: max(abs(intervals[place][0][0]), abs(intervals[place][0][1])) for place in places}


def single_radii(
    here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]
) -> list[tuple[str, float]]:
    """What each single effect leaves, by the model linearised at the nominal fit; the least radius first."""
    rows = rows_at(here, here.point, here.positions, circumstances)
    tried = []
    for place in places:
        jacobian = np.hstack((here.jacobian, signature_columns([place], rows)))
        bound = here.bound + added_bound([place], rows)
        radius, step, _ = chebyshev_radius(jacobian, here.residual, bound)
        if np.any(bound > here.bound):
            # Where the record does not tell, the effect is no larger than it is elsewhere.
            bound = here.bound + added_bound([place], rows, {place: abs(float(step[-1]))})
            radius = chebyshev_radius(jacobian, here.residual, bound)[0]
        tried.append((place.title, radius))
    return sorted(tried, key=lambda entry: (round(entry[1], 9), entry[0]))
