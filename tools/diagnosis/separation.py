"""Table positions that tell candidate causes apart, whatever parameters they have."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ...models.regressors import admissible
from ..bounded.programmes import least_largest
from ..calibration.model import Linearisation, Positions
from .circumstances import Circumstances
from .disturbance import added_bound, rows_at
from .extended_fit import ExtendedFit
from .intervals import feasible_rows
from .predictions import Visits, depends_on_senses, lasting_part, predictions, seen_at_last
from .search import title_of

GRID_STEP_DEG = 5.0
MOST_CANDIDATES = 10
"""So many candidates, the best ones first, are separated from each other."""
MOST_FOR_A_PAIR = 4
"""So many new positions are proposed to decide between two candidates."""


@dataclass(frozen=True)
class Rival:
    """What a candidate predicts at positions that might be measured, over the parameters that the record leaves it.

    Attributes
    ----------
    centre : (N, 3) array
        readings over g at the centre of what is possible
    slopes : (N, 3, rank) array
        derivatives in the coordinates of the set of possible parameters
    matrix, lower, upper : arrays
        that set: lower ≤ matrix x ≤ upper
    known : (N, 3) array of bool
        readings whose prediction is bounded
    linear : bool
        whether prediction and slopes say it all
    """

    centre: NDArray
    slopes: NDArray
    matrix: NDArray
    lower: NDArray
    upper: NDArray
    known: NDArray
    linear: bool


def rival_of(here: Linearisation, candidate: ExtendedFit, visits: Visits, room: float) -> Rival:
    """A candidate as a rival of others."""
    reading, slopes = predictions(here, candidate, visits)
    nothing = np.zeros((len(candidate.residual), 0))
    matrix, lower, upper, span, scale = feasible_rows(candidate, nothing, room)
    scaled = slopes / scale
    inside = scaled @ span
    outside = np.linalg.norm(scaled - inside @ span.T, axis=2) > 1e-6 * np.linalg.norm(scaled, axis=2)
    seen = seen_at_last(here, candidate, visits, reading)
    return Rival(seen, inside, matrix, lower, upper, ~outside, candidate.linear)


def separating_positions(
    here: Linearisation,
    circumstances: Circumstances,
    candidates: Sequence[ExtendedFit],
    bounds: tuple[float, float],
    room: float,
) -> list[dict[str, Any]]:
    """Positions whose readings, together, decide between candidates.

    For two candidates the parameters that the record leaves them are sought with which their predictions at the
    positions chosen so far are nearest; the position where they are then farthest apart is added, until they differ
    somewhere by more than 2 σ whatever the parameters: then no readings can be within σ of both.

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

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, mounting where there are several, the senses of the approach where they matter, what is
        separated, and ``apart_g``: by so much the predictions of the pair for which the position was chosen differ at
        one of the positions at least, over all parameters; more than 2 σ decides
    """
    chosen = list(candidates[:MOST_CANDIDATES])
    visits, senses = possible_visits(here, circumstances, chosen)
    at, p = visits.at, here.parametrisation
    usable = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds) & told(here, chosen, visits)
    rivals = [rival_of(here, candidate, visits, room) for candidate in chosen]
    sure = 2.0 * (float(here.bound.min()) + room)
    rows: list[int] = []
    apart: dict[int, float] = {}
    names: dict[int, list[str]] = {}
    for first, second in combinations(range(len(chosen)), 2):
        distance, own = decide(rivals[first], rivals[second], usable, rows, sure)
        for row in own:
            if row not in apart:
                rows.append(row)
            apart[row] = min(apart.get(row, np.inf), distance)
            names.setdefault(row, [])
            names[row] += [title for c in (first, second) if (title := title_of(chosen[c].places)) not in names[row]]
    positions = []
    for row in rows:
        position: dict[str, Any] = {
            "alpha_deg": float(np.round(np.degrees(at.alpha[row]), 6)),
            "beta_deg": float(np.round(np.degrees(at.beta[row]), 6)),
        }
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(at.mounting[row])]
        if senses:
            position["approach_alpha"] = int(visits.circumstances.sense_alpha[row])
            position["approach_beta"] = int(visits.circumstances.sense_beta[row])
        positions.append({**position, "separates": names[row], "apart_g": float(apart[row])})
    return positions


def decide(first: Rival, second: Rival, usable: NDArray, rows: Sequence[int], sure: float) -> tuple[float, list[int]]:
    """Positions that decide between two candidates, of those chosen already and up to `MOST_FOR_A_PAIR` new ones.

    Returns
    -------
    distance : float
        least distance of the predictions at the worst of the positions [g]
    own : list of int
        the positions that this takes
    """
    usable = usable & first.known & second.known
    difference = np.where(usable, first.centre - second.centre, 0.0)
    own = [row for row in rows if np.abs(difference[row]).max() > sure]
    if not first.linear or not second.linear:
        # What is not linear has its sizes, not a set of them: the fitted predictions speak.
        best = int(np.argmax(np.round(np.abs(difference).max(axis=1), 12)))
        own = own or [best]
        return float(np.abs(difference[own]).max()), own
    new = 0
    while True:
        distance, apart = nearest(first, second, usable, difference, own)
        if distance > sure or new == MOST_FOR_A_PAIR:
            return distance, own
        farthest = int(np.argmax(np.round(np.abs(apart).max(axis=1), 12)))
        if farthest in own:
            return distance, own
        own.append(farthest)
        new += 1


def nearest(
    first: Rival, second: Rival, usable: NDArray, difference: NDArray, own: Sequence[int]
) -> tuple[float, NDArray]:
    """How near the predictions at some positions can be [g], and how far apart (N, 3) they all are then."""
    if not own:
        return 0.0, difference
    axes = usable[list(own)]
    offset = difference[list(own)][axes]
    slopes = np.hstack((first.slopes[list(own)][axes], -second.slopes[list(own)][axes]))
    if not len(offset):
        return 0.0, difference
    distance, x = least_largest(
        np.asarray(block_diag(first.matrix, second.matrix)),
        np.concatenate((first.lower, second.lower)),
        np.concatenate((first.upper, second.upper)),
        offset,
        slopes,
    )
    mine, other = x[: first.matrix.shape[1]], x[first.matrix.shape[1] :]
    return distance, np.where(usable, difference + first.slopes @ mine - second.slopes @ other, 0.0)


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
