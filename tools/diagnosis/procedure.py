"""From a position record to a verdict on the simulation's model: the procedure of `trihedron diagnose`."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike, NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.procedure import (
    STANDARD_BOUNDS,
    calibrate,
    chebyshev_centre,
    radius_limit,
    reading_uncertainty,
)
from trihedron.calibration.programmes import SolverError
from trihedron.diagnosis.classes import equivalents
from trihedron.diagnosis.extension import measure_gain
from trihedron.diagnosis.intervals import parameter_intervals
from trihedron.diagnosis.residual_structure import residual_structure
from trihedron.diagnosis.result import Cause, Diagnosis
from trihedron.diagnosis.search import Candidate, catalogue_places, outlier_places, try_effects
from trihedron.diagnosis.separation import separating_positions
from trihedron.errors import InputError
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.outlier import place_of

if TYPE_CHECKING:
    from trihedron.records import PositionRecord


def diagnose(
    record: "PositionRecord",
    *,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    baseline: str = "asymmetric",
    bounds: tuple[float, float] = STANDARD_BOUNDS,
    mounting: Mapping[str, ArrayLike] | str = "identity",
    rerun: bool = True,
    progress: bool = False,
) -> Diagnosis:
    """Say whether the bench's model can be true of a record, and if not, which single effect mends it.

    Parameters
    ----------
    record, noise_bound, gravity, baseline, bounds, mounting
        as for `trihedron.calibration.calibrate`
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
        as for `trihedron.calibration.calibrate`
    """
    nominal = calibrate(
        record, noise_bound=noise_bound, gravity=gravity, baseline=baseline, bounds=bounds, mounting=mounting
    )
    here = nominal.linearised
    hours = (record.time_s - record.time_s[0]) / 3600.0
    if nominal.verdict != "falsified":
        # With no more measurements than parameters every record fits.
        enough = nominal.verdict == "consistent" and len(here.residual) > here.span.shape[1]
        positions = () if enough else nominal.next_positions
        verdict = "consistent" if enough else "insufficient"
        return Diagnosis(verdict, nominal, record.position, next_positions=positions)
    resolution = record.resolution / gravity
    limit = radius_limit(nominal.noise_bound, resolution)
    try:
        _, _, duals = chebyshev_centre(here)
        places = [*catalogue_places(baseline), *outlier_places(here, duals)]
        tried = try_effects(here, hours, places, progress=progress)
    except SolverError as error:
        raise InputError(
            f"{record.path}: {error}; is --noise-bound {nominal.noise_bound:g} a fraction of g?"
        ) from error
    standing = [candidate for candidate in tried if candidate.possible and candidate.fit.radius <= limit]
    if not standing:
        structure = tuple(residual_structure(here, hours))
        return Diagnosis("unexplained", nominal, record.position, tried=tuple(tried), residual_structure=structure)
    groups = classes_of(here, standing)
    room = reading_uncertainty(resolution)
    causes = [cause_of(here, group, catalogue_places(baseline), record.position, room) for group in groups]
    if len(groups) > 1:
        ahead = float(hours[-1] + (hours[-1] / max(len(hours) - 1, 1)))
        positions = separating_positions(here, ahead, [group[0] for group in groups], bounds)
        return Diagnosis(
            "ambiguous",
            nominal,
            record.position,
            (causes[0],),
            tuple(causes[1:]),
            tuple(tried),
            next_positions=tuple(positions),
        )
    named = groups[0][0]
    physical = CATALOGUE[named.place.effect].kernel is not None
    gain = measure_gain(here, hours, named.fit, gravity) if rerun and physical else None
    return Diagnosis("explained", nominal, record.position, (causes[0],), tried=tuple(tried), gain=gain)


def classes_of(here: Linearisation, standing: Sequence[Candidate]) -> list[list[Candidate]]:
    """Candidates that no measurement could tell apart, together; the class with the least radius first."""
    groups: list[list[Candidate]] = []
    left = list(standing)
    while left:
        first = left.pop(0)
        others = [c for c in left if c.place.effect != "outlier"] if first.place.effect != "outlier" else []
        same = equivalents(here, first.place, [c.place for c in others]) if others else []
        groups.append([first, *(c for c in left if c.place in same)])
        left = [c for c in left if c.place not in same]
    return groups


def cause_of(
    here: Linearisation, group: Sequence[Candidate], places: Sequence[EffectPlace], numbers: NDArray, room: float
) -> Cause:
    """The first candidate of a class as a cause, with everything in the catalogue that is equivalent to it."""
    first = group[0]
    intervals = parameter_intervals(first.fit, room)
    if first.place.effect == "outlier":
        row = int(first.place.where.removeprefix("position-")) - 1
        place = place_of(int(numbers[row]), first.place.axes[0])
        return Cause(place, (), first.values, intervals, first.fit.radius)
    others = [place for place in places if place != first.place]
    same = tuple(equivalents(here, first.place, others))
    return Cause(first.place, same, first.values, intervals, first.fit.radius)
