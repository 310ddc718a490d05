"""Table positions that tell candidate causes apart, whatever parameters they have."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation, linearise
from trihedron.calibration.parametrisation import Positions
from trihedron.calibration.programmes import SolverError
from trihedron.diagnosis.circumstances import Circumstances, standing_still
from trihedron.diagnosis.extended_fit import ExtendedFit, extended_model
from trihedron.diagnosis.intervals import feasible_set
from trihedron.diagnosis.search import title_of
from trihedron.models.effects import EffectPlace
from trihedron.models.regressors import admissible

GRID_STEP_DEG = 5.0
SHORTLIST = 12
"""So many positions, those where the fitted predictions differ most, are judged over all possible parameters."""
MOST_PAIRS = 15
"""So many pairs of candidates, the best ones first, get a position of their own."""


def separating_positions(
    here: Linearisation,
    hours: float,
    candidates: Sequence[ExtendedFit],
    bounds: tuple[float, float],
    room: float,
    most: int = 6,
) -> list[dict[str, object]]:
    """For each pair of candidates the position where their predictions are farthest apart.

    Each candidate predicts an interval, over all parameters that the record leaves it; the gap between the intervals is
    what a reading there must be nearer to one of.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    hours : float
        when the new positions would be measured, since the first row
    candidates : sequence of ExtendedFit
        sets of effects that explain the record; outliers say nothing about other positions
    bounds : (float, float)
        u^max and v^0max: only readings whose sign is certain count
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g
    most : int
        at most so many positions

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, mounting where there are several, what is separated, and ``apart_g``: the least distance of
        the predictions, over all parameters (negative: they overlap, one reading there need not decide)
    """
    physical = [c for c in candidates if c.linear and any(p.effect != "outlier" for p in c.places)]
    p = here.parametrisation
    degrees = np.arange(0.0, 360.0, GRID_STEP_DEG)
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, range(len(p.mountings)), indexing="ij"))
    at = Positions(np.radians(alpha), np.radians(beta), mounting.astype(int))
    certain = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds)
    centres = [predictions(here, c, at, hours)[0] for c in physical]
    chosen: dict[int, tuple[float, list[str]]] = {}
    for first, second in list(combinations(range(len(physical)), 2))[:MOST_PAIRS]:
        apart = np.where(certain, np.abs(centres[first] - centres[second]), 0.0).max(axis=1)
        shortlist = np.argsort(-np.round(apart, 12), kind="stable")[:SHORTLIST]
        part = Positions(at.alpha[shortlist], at.beta[shortlist], at.mounting[shortlist])
        gap = guaranteed_gap(here, physical[first], physical[second], part, hours, certain[shortlist], room)
        best = int(np.argmax(np.round(gap, 12)))
        distance, names = chosen.setdefault(int(shortlist[best]), (np.inf, []))
        names += [t for c in (first, second) if (t := title_of(physical[c].places)) not in names]
        chosen[int(shortlist[best])] = (min(distance, float(gap[best])), names)
    positions = []
    for index, (distance, names) in list(chosen.items())[:most]:
        position: dict[str, object] = {"alpha_deg": float(alpha[index]), "beta_deg": float(beta[index])}
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(mounting[index])]
        apart_g = distance if np.isfinite(distance) else None
        positions.append({**position, "separates": names, "apart_g": apart_g})
    return positions


def physical_part(candidate: ExtendedFit) -> tuple[list[EffectPlace], NDArray]:
    """The effects of a set that act at other positions too, and which of its coefficients are theirs."""
    kept, own = [], []
    for place, block in zip(candidate.places, candidate.blocks, strict=True):
        if place.effect != "outlier":
            kept.append(place)
            own += list(range(block.start, block.stop))
    return kept, np.array(own, dtype=int)


def predictions(here: Linearisation, candidate: ExtendedFit, at: Positions, hours: float) -> tuple[NDArray, NDArray]:
    """What a candidate predicts at other positions, and how that changes with its parameters.

    Returns
    -------
    reading : (N, 3) array
        over g, at the centre of what is possible
    slopes : (N, 3, P + K) array
    """
    count, bench = len(at.alpha), len(candidate.point)
    point = candidate.point + candidate.centre[:bench]
    places, own = physical_part(candidate)
    there = linearise(
        here.parametrisation, at, np.zeros((count, 3)), point, np.full(3 * count, float(here.bound.min()))
    )
    circumstances: Circumstances = standing_still(count, np.full(count, hours))
    reading, jacobian = extended_model(there, point, places, candidate.central[own], circumstances)
    slopes = np.zeros((count, 3, len(candidate.centre)))
    slopes[..., np.append(np.arange(bench), bench + own)] = jacobian.reshape(count, 3, -1)
    return reading.reshape(count, 3), slopes


def guaranteed_gap(
    here: Linearisation,
    first: ExtendedFit,
    second: ExtendedFit,
    at: Positions,
    hours: float,
    certain: NDArray,
    room: float,
) -> NDArray:
    """Least distance (N,) [g] of two candidates' predictions over all their parameters, the best reading of each."""
    low_1, high_1 = prediction_intervals(here, first, at, hours, room)
    low_2, high_2 = prediction_intervals(here, second, at, hours, room)
    gap = np.maximum(low_1 - high_2, low_2 - high_1)
    return np.where(certain, gap, -np.inf).max(axis=1)


def prediction_intervals(
    here: Linearisation, candidate: ExtendedFit, at: Positions, hours: float, room: float
) -> tuple[NDArray, NDArray]:
    """Ends (N, 3) of what a candidate can predict at other positions; infinite where nothing bounds it."""
    reading, slopes = predictions(here, candidate, at, hours)
    polytope, span, scale = feasible_set(candidate, np.zeros((len(candidate.residual), 0)), room)
    low, high = np.full_like(reading, -np.inf), np.full_like(reading, np.inf)
    for row, axis in np.ndindex(*reading.shape):
        weights = slopes[row, axis] / scale
        if np.linalg.norm(weights - span @ (span.T @ weights)) > 1e-6 * np.linalg.norm(weights):
            continue
        try:
            low[row, axis] = reading[row, axis] - polytope.maximise(-span.T @ weights)[0]
            high[row, axis] = reading[row, axis] + polytope.maximise(span.T @ weights)[0]
        except SolverError:
            continue
    return low, high
