"""What candidate causes predict at other table positions, over all parameters that the record leaves them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace, Rows
from ...models.restricted import CONTEXT_SIZE, INPUT
from ..calibration.model import Linearisation, Positions, linearise
from .circumstances import Circumstances
from .disturbance import is_linear, rows_at, signature_columns
from .extended_fit import ExtendedFit
from .extended_model import extended_model


@dataclass(frozen=True)
class Visits:
    """Positions that might be measured.

    Attributes
    ----------
    at : Positions
        N of them
    circumstances : Circumstances
        in which they would be measured
    """

    at: Positions
    circumstances: Circumstances

    def selected(self, rows: NDArray) -> "Visits":
        """Some of them (n,) of int."""
        at = self.at
        return Visits(Positions(at.alpha[rows], at.beta[rows], at.mounting[rows]), self.circumstances.selected(rows))


def lasting_part(candidate: ExtendedFit) -> tuple[list[EffectPlace], NDArray]:
    """The linear effects of a set that act at other positions too, and which of its coefficients are theirs."""
    kept, own = [], []
    for place, block in zip(candidate.places, candidate.blocks, strict=True):
        if place.effect != "outlier" and is_linear(place):
            kept.append(place)
            own += list(range(block.start, block.stop))
    return kept, np.array(own, dtype=int)


def depends_on_senses(candidate: ExtendedFit, here: Linearisation, visits: Visits) -> bool:
    """Whether it matters to a candidate from which side a position is approached."""
    places, _ = lasting_part(candidate)
    count = len(visits.at.alpha)
    columns = []
    for sense in (-1.0, 1.0):
        senses = np.full(count, sense)
        moved = Circumstances(visits.circumstances.hours, visits.circumstances.temperature, senses, senses, True)
        columns.append(signature_columns(places, rows_at(here, here.point, visits.at, moved)))
    return bool(np.any(columns[0] != columns[1]))


def predictions(here: Linearisation, candidate: ExtendedFit, visits: Visits) -> tuple[NDArray, NDArray]:
    """What a candidate predicts at its centre, and how that changes with its parameters.

    Returns
    -------
    reading : (N, 3) array
        over g, before what is not linear acts
    slopes : (N, 3, P + K) array
    """
    at, count, bench = visits.at, len(visits.at.alpha), len(candidate.point)
    point = candidate.point + candidate.centre[:bench]
    places, own = lasting_part(candidate)
    there = linearise(
        here.parametrisation, at, np.zeros((count, 3)), point, np.full(3 * count, float(here.bound.min()))
    )
    reading, jacobian = extended_model(there, point, places, candidate.central[own], visits.circumstances)
    slopes = np.zeros((count, 3, len(candidate.centre)))
    slopes[..., np.append(np.arange(bench), bench + own)] = jacobian.reshape(count, 3, -1)
    return reading.reshape(count, 3), slopes


def seen_at_last(here: Linearisation, candidate: ExtendedFit, visits: Visits, reading: NDArray) -> NDArray:
    """Readings (N, 3) after the candidate's dead zone, saturation or rounding has acted on them."""
    bent = [
        (place, values)
        for place, values in zip(candidate.places, candidate.values(), strict=True)
        if not is_linear(place)
    ]
    if not bent:
        return reading
    rows = rows_at(here, candidate.point, visits.at, visits.circumstances)
    return acted_on(bent, rows, reading)


def acted_on(bent: Sequence[tuple[EffectPlace, tuple[float, ...]]], rows: Rows, reading: NDArray) -> NDArray:
    """Readings (N, 3) after the kernels of effects that are not linear, with these parameters."""
    seen = reading.copy()
    for row in range(len(seen)):
        context = np.zeros(CONTEXT_SIZE)
        context[INPUT : INPUT + 3] = rows.n[row]
        for place, values in bent:
            effect = CATALOGUE[place.effect].at(place)
            if effect.kernel is not None:
                effect.kernel(context, rows.own[row], *effect.place_numbers(place), *values, seen[row])
    return seen
