"""Table positions that tell candidate causes apart, whatever parameters they have."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import Positions
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.disturbance import added_bound, rows_at
from trihedron.diagnosis.extended_fit import ExtendedFit
from trihedron.diagnosis.predictions import (
    Visits,
    depends_on_senses,
    lasting_part,
    prediction_intervals,
    predictions,
    seen_at_last,
)
from trihedron.diagnosis.search import title_of
from trihedron.models.regressors import admissible

GRID_STEP_DEG = 5.0
MOST_CANDIDATES = 10
"""So many candidates, the best ones first, are separated from each other."""
SHORTLIST = 24
"""So many positions, where the fitted predictions differ most, are judged over all possible parameters."""


@dataclass(frozen=True)
class Pair:
    """Two candidates by their numbers, and how far apart their fitted predictions are (N, 3) [g]."""

    first: int
    second: int
    apart: NDArray


def separating_positions(
    here: Linearisation,
    circumstances: Circumstances,
    candidates: Sequence[ExtendedFit],
    bounds: tuple[float, float],
    room: float,
    most: int = 6,
) -> list[dict[str, Any]]:
    """Positions whose readings decide between candidates, those that decide most pairs first.

    Each candidate predicts an interval, over all parameters that the record leaves it. Where the gap between two
    intervals is more than 2 σ, no reading can be within σ of both.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of the record's rows: the positions would be measured after them
    candidates : sequence of ExtendedFit
        sets of effects that explain the record, the best first
    bounds : (float, float)
        u^max and v^0max: only readings whose sign is certain count
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g
    most : int
        at most so many positions

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, mounting where there are several, the senses of the approach where they matter, what is
        separated, and ``apart_g``: the least distance of the predictions, over all parameters (negative: they overlap,
        one reading there need not decide; None: nothing bounds them)
    """
    chosen = list(candidates[:MOST_CANDIDATES])
    visits, senses = possible_visits(here, circumstances, chosen)
    at, p = visits.at, here.parametrisation
    certain = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds)
    certain &= told(here, chosen, visits)
    centres = [seen_at_last(here, c, visits, predictions(here, c, visits)[0]) for c in chosen]
    pairs = [
        Pair(i, j, np.where(certain, np.abs(centres[i] - centres[j]), 0.0))
        for i, j in combinations(range(len(chosen)), 2)
    ]
    short = shortlist(pairs)
    gaps = guaranteed_gaps(here, chosen, pairs, visits, short, float(here.bound.min()), room)
    positions = []
    for k, separated in deciding(gaps, 2.0 * float(here.bound.min()), most):
        row = int(short[k])
        position: dict[str, Any] = {
            "alpha_deg": float(np.round(np.degrees(at.alpha[row]), 6)),
            "beta_deg": float(np.round(np.degrees(at.beta[row]), 6)),
        }
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(at.mounting[row])]
        if senses:
            position["approach_alpha"] = int(visits.circumstances.sense_alpha[row])
            position["approach_beta"] = int(visits.circumstances.sense_beta[row])
        names: list[str] = []
        for n in separated:
            names += [t for c in (pairs[n].first, pairs[n].second) if (t := title_of(chosen[c].places)) not in names]
        least = float(gaps[separated, k].min())
        positions.append({**position, "separates": names, "apart_g": least if np.isfinite(least) else None})
    return positions


def told(here: Linearisation, candidates: Sequence[ExtendedFit], visits: Visits) -> NDArray:
    """Readings (N, 3) of bool whose circumstances are told, as far as a candidate depends on them."""
    places = sorted({place for c in candidates for place in lasting_part(c)[0]}, key=lambda place: place.title)
    rows = rows_at(here, here.point, visits.at, visits.circumstances)
    return added_bound(places, rows).reshape(-1, 3) == 0.0


def possible_visits(
    here: Linearisation, circumstances: Circumstances, candidates: Sequence[ExtendedFit]
) -> tuple[Visits, bool]:
    """A grid of positions with every mounting and those where outliers would be; and whether senses are in it."""
    p = here.parametrisation
    degrees = np.radians(np.arange(0.0, 360.0, GRID_STEP_DEG))
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, range(len(p.mountings)), indexing="ij"))
    rows = sorted(
        {
            int(place.where.removeprefix("position-")) - 1
            for c in candidates
            for place in c.places
            if place.effect == "outlier"
        }
    )
    alpha, beta = np.append(alpha, here.positions.alpha[rows]), np.append(beta, here.positions.beta[rows])
    mounting = np.append(mounting, here.positions.mounting[rows]).astype(int)
    hours = float(circumstances.hours[-1] * (1.0 + 1.0 / max(len(circumstances.hours) - 1, 1)))
    last = 20.0 if circumstances.temperature is None else float(circumstances.temperature[-1])
    sides = [(0.0, 0.0)]
    plain = _visits(alpha, beta, mounting, hours, last, sides)
    few = plain.selected(np.arange(0, len(alpha), 97))
    if any(depends_on_senses(c, here, few) for c in candidates):
        sides = [(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
        return _visits(alpha, beta, mounting, hours, last, sides), True
    return plain, False


def _visits(
    alpha: NDArray, beta: NDArray, mounting: NDArray, hours: float, temperature: float, sides: list[tuple[float, float]]
) -> Visits:
    count, times = len(alpha), len(sides)
    senses = np.repeat(np.array(sides), count, axis=0)
    constant = np.ones(count * times)
    return Visits(
        Positions(np.tile(alpha, times), np.tile(beta, times), np.tile(mounting, times)),
        Circumstances(hours * constant, temperature * constant, senses[:, 0], senses[:, 1], True),
    )


def shortlist(pairs: Sequence[Pair]) -> NDArray:
    """Numbers of the positions where each pair's predictions are farthest apart, every pair in its turn."""
    orders = [np.argsort(-np.round(pair.apart.max(axis=1), 12), kind="stable") for pair in pairs]
    chosen: list[int] = []
    for rank in range(SHORTLIST):
        for order in orders:
            if int(order[rank]) not in chosen and len(chosen) < SHORTLIST:
                chosen.append(int(order[rank]))
    return np.array(sorted(chosen), dtype=int)


def guaranteed_gaps(
    here: Linearisation,
    candidates: Sequence[ExtendedFit],
    pairs: Sequence[Pair],
    visits: Visits,
    short: NDArray,
    sigma: float,
    room: float,
) -> NDArray:
    """Least distances (pairs, n) [g] of the candidates' predictions over all parameters, the best reading of each.

    Only readings are judged at which the fitted predictions of a pair differ by more than the noise.
    """
    part = visits.selected(short)
    low, high = [], []
    for number, candidate in enumerate(candidates):
        wanted = np.zeros((len(short), 3), dtype=bool)
        for pair in pairs:
            if number in (pair.first, pair.second):
                wanted |= pair.apart[short] > sigma
        ends = prediction_intervals(here, candidate, part, wanted, room)
        low.append(ends[0])
        high.append(ends[1])
    gaps = np.full((len(pairs), len(short)), -np.inf)
    for n, pair in enumerate(pairs):
        gap = np.maximum(low[pair.first] - high[pair.second], low[pair.second] - high[pair.first])
        gaps[n] = np.where(pair.apart[short] > sigma, gap, -np.inf).max(axis=1)
    return gaps


def deciding(gaps: NDArray, enough: float, most: int) -> list[tuple[int, list[int]]]:
    """Positions (columns of `gaps`) one by one, each with the pairs that it decides, until every pair is decided.

    A pair that no position decides gets the one where its gap is largest, as long as there is any.
    """
    chosen: list[tuple[int, list[int]]] = []
    open_pairs = list(range(len(gaps)))
    while open_pairs and len(chosen) < most:
        decided = gaps[open_pairs] > enough
        best = int(np.argmax(decided.sum(axis=0) + 1e-3 * np.where(decided, gaps[open_pairs], 0.0).sum(axis=0)))
        separated = [n for n, yes in zip(open_pairs, decided[:, best], strict=True) if yes]
        if not separated:
            first = open_pairs[0]
            if not np.isfinite(gaps[first]).any():
                open_pairs.remove(first)
                continue
            best, separated = int(np.argmax(gaps[first])), [first]
        chosen.append((best, separated))
        open_pairs = [n for n in open_pairs if n not in separated]
    return chosen
