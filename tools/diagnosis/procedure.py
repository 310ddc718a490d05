"""From a position record to a verdict on the simulation's model: the procedure of `trihedron diagnose`."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ...models.effects.outlier import place_of
from ..bounded.programmes import SolverError
from ..calibration.model import Linearisation
from ..calibration.procedure import STANDARD_BOUNDS, calibrate, radius_limit, reading_uncertainty, repeats
from ..calibration.result import Calibration
from ..errors import InputError
from ..records import PositionRecord
from .arguments import left_open
from .centre import with_usual_signs
from .circumstances import Circumstances, circumstances_of
from .classes import Classes, classes_of, same_space
from .disturbance import is_linear
from .extended_fit import ExtendedFit, fit_extended
from .gain import Gain, measure_gain
from .intervals import parameter_intervals
from .judgement import judge
from .limits import excluded_sizes, target_shifts
from .predictions import lasting_part
from .residual_structure import residual_structure
from .result import Cause, Diagnosis, Finding
from .search import catalogue_places, single_radii, smallest_explanations, title_of
from .second_mounting import SecondMounting, second_mounting
from .separation import MOST_CANDIDATES, separating_positions

FIT_TOLERANCE = 1e-8
"""What the fit of an extended model adds to the tolerance of its radius."""


def diagnose(
    record: PositionRecord,
    *,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    baseline: str = "asymmetric",
    bounds: tuple[float, float] = STANDARD_BOUNDS,
    mounting: Mapping[str, ArrayLike] | str = "identity",
    rerun: bool = True,
    progress: bool = False,
) -> Diagnosis:
    """Say whether the bench's model can be true of a record, and if not, which smallest set of effects mends it.

    Parameters
    ----------
    record, noise_bound, gravity, baseline, bounds, mounting
        as for `trihedron.tools.calibration.calibrate`
    rerun : bool
        simulate held-out positions again, without and with the effect that was named
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        as for `trihedron.tools.calibration.calibrate`
    """
    nominal = calibrate(
        record, noise_bound=noise_bound, gravity=gravity, baseline=baseline, bounds=bounds, mounting=mounting
    )
    here = nominal.linearised
    circumstances = circumstances_of(record)
    every = catalogue_places(baseline, circumstances)
    places = [place for place in every if is_linear(place)]
    room = reading_uncertainty(record.written_to(gravity))
    if nominal.verdict != "falsified":
        # With no more measurements than parameters every record fits.
        enough = nominal.verdict == "consistent" and len(here.residual) > here.span.shape[1]
        if not enough:
            proposed = tuple(nominal.next_positions or repeats(here))
            return Diagnosis("insufficient", nominal, record.position, next_positions=proposed)
        nominal_fit = fit_extended(here, circumstances, ())
        return Diagnosis(
            "consistent",
            nominal,
            record.position,
            excluded=excluded_sizes(here, circumstances, places, nominal_fit, room, bounds[1]),
        )
    try:
        return cause_of(nominal, record, circumstances, bounds, gravity, rerun=rerun, progress=progress)
    except SolverError as error:
        raise InputError(
            f"{record.path}: {error}; is --noise-bound {nominal.noise_bound:g} a fraction of g?"
        ) from error


def cause_of(
    nominal: Calibration,
    record: PositionRecord,
    circumstances: Circumstances,
    bounds: tuple[float, float],
    gravity: float,
    *,
    rerun: bool,
    progress: bool,
) -> Diagnosis:
    """The diagnosis of a record that the nominal model cannot explain; arguments as for `diagnose`."""
    here = with_usual_signs(nominal.linearised, circumstances, nominal.noise_bound, bounds)
    resolution = record.written_to(gravity)
    room = reading_uncertainty(resolution)
    limit = radius_limit(nominal.noise_bound, resolution) + FIT_TOLERANCE
    every = catalogue_places(nominal.baseline, circumstances)
    classes = classes_of(here, [place for place in every if is_linear(place)])
    bent = [place for place in every if not is_linear(place)]
    found = smallest_explanations(here, circumstances, classes, bent, limit, resolution, progress=progress)
    tried = tuple(single_radii(here, circumstances, classes.places))
    if not found.fits:
        structure = tuple(residual_structure(here, circumstances))
        return Diagnosis("unexplained", nominal, record.position, tried=tried, residual_structure=structure)
    groups = equivalence_groups(classes, found.fits)

    def open_of(fit: ExtendedFit) -> float:
        return room + left_open(fit, here, circumstances)

    findings = tuple(finding_of(classes, group[0], record.position, open_of(group[0]), bounds) for group in groups)
    if len(groups) > 1 or not found.complete:
        positions = separating_positions(here, circumstances, [group[0] for group in groups], bounds, room)
        return Diagnosis(
            "ambiguous",
            nominal,
            record.position,
            findings,
            tried=tried,
            next_positions=tuple(positions),
            complete=found.complete,
            judgement=judge(here, groups[0][0]),
            mounting=helpful_mounting(here, groups, positions),
        )
    named = groups[0][0]
    return Diagnosis(
        "explained",
        nominal,
        record.position,
        findings,
        tuple(other.places for other in groups[0][1:]),
        tried,
        gain_of(here, circumstances, named, gravity, resolution) if rerun else None,
        excluded=excluded_sizes(here, circumstances, classes.places, named, open_of(named), bounds[1]),
        targets=target_shifts(nominal, named, open_of(named)),
        judgement=judge(here, named),
        mounting=class_breaking_mounting(here, findings[0]),
    )


def helpful_mounting(
    here: Linearisation, groups: Sequence[Sequence[ExtendedFit]], positions: Sequence[Mapping[str, Any]]
) -> SecondMounting | None:
    """A mounting that tells apart two candidates that no further position with the record's mountings surely does."""
    sure = 2.0 * float(here.bound.min())
    settled = [set(p["separates"]) for p in positions if p["apart_g"] is not None and p["apart_g"] > sure]
    for first, second in combinations([group[0] for group in groups[:MOST_CANDIDATES]], 2):
        titles = title_of(first.places), title_of(second.places)
        if any(names >= set(titles) for names in settled) or not (first.linear and second.linear):
            continue
        found = second_mounting(here, lasting_part(first)[0], lasting_part(second)[0], titles)
        if found is not None:
            return found
    return None


def class_breaking_mounting(here: Linearisation, finding: Finding) -> SecondMounting | None:
    """A mounting that tells a named effect from one of its equivalents."""
    for cause in finding.causes:
        for other in cause.equivalents:
            found = second_mounting(here, [cause.place], [other], (cause.place.title, other.title))
            if found is not None:
                return found
    return None


def gain_of(
    here: Linearisation, circumstances: Circumstances, named: ExtendedFit, gravity: float, resolution: float
) -> Gain | None:
    """The gain of a set of effects on held-out positions; None where it says nothing of other positions: outliers."""
    if any(CATALOGUE[place.effect].kernel is None for place in named.places):
        return None
    return measure_gain(here, circumstances, named, gravity, resolution)


def equivalence_groups(classes: Classes, found: Sequence[ExtendedFit]) -> list[list[ExtendedFit]]:
    """Sets that no measurement on this bench could tell apart, together; the least radius first."""
    groups: list[list[ExtendedFit]] = []
    spaces: list[tuple[frozenset[EffectPlace], NDArray]] = []
    for fit in found:
        # Outliers and effects that are not linear are compared by name: they have no space of their own.
        outliers = frozenset(place for place in fit.places if classes.whole_class(place)[0] not in classes.places)
        physical = [place for place in fit.places if place not in outliers]
        space = classes.joint_space(physical) if physical else np.zeros((1, 0))
        for group, (others, other) in zip(groups, spaces, strict=True):
            if outliers == others and same_space(space, other):
                group.append(fit)
                break
        else:
            groups.append([fit])
            spaces.append((outliers, space))
    return groups


def finding_of(
    classes: Classes, fit: ExtendedFit, numbers: NDArray, room: float, bounds: tuple[float, float]
) -> Finding:
    """A set of effects as causes, each with everything in the catalogue that is equivalent to it."""
    intervals = parameter_intervals(fit, room, bounds)
    causes = []
    for place, values, ends in zip(fit.places, fit.values(), intervals, strict=True):
        named = place
        if place.effect == "outlier":
            row = int(place.where.removeprefix("position-")) - 1
            named = place_of(int(numbers[row]), place.axes[0])
        parameters = CATALOGUE[place.effect].at(place).parameters
        possible = (v if p.smallest is None else max(p.smallest, v) for p, v in zip(parameters, values, strict=True))
        causes.append(Cause(named, classes.equivalents(place), tuple(possible), ends))
    return Finding(tuple(causes), fit)
