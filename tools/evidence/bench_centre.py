"""Where a bench is that few readings cannot draw: neither gross ones, nor exchanged channels, nor a common limit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.bench import admissible, nominal_input
from ...models.effects import EffectPlace
from ...models.effects.last_stage import EXCHANGED_READINGS
from ..bounded.programmes import least_squares
from ..calibration.estimates import widening
from ..calibration.model import Linearisation, linearise, predicted_input
from .bench_model import ASTRAY, Cast, Readings
from .bench_visits import Circumstances
from .fit import Fit, blocks_of

USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
ROUNDS = 12
"""Steps to a centre that few readings cannot draw."""
LOOSE = 10.0
"""A bound [g] within which a reading says nothing."""
GROSS = 1e-3
"""Where most misfits are above this [g], a limit that many readings reach may have drawn the model."""
AT_LIMIT, FEWEST_AT_LIMIT = 3.0, 3
"""Readings nearer to the largest of their channel than so many bounds are at a limit, where so many are."""
STANDS_OUT = 0.5
"""An effect stands out that leaves at most this part of the usual misfit."""


@dataclass(frozen=True, eq=False)
class Setting:
    """Where sets are sought: a centre, what the model linear there may be wrong by, and steps of effects in their ways.

    The slack is in units of the bounds.
    """

    centre: Fit
    slack: float
    steps: tuple[tuple[EffectPlace, int], ...]


def centre_of(readings: Readings, cast: Cast, start: NDArray, before: Fit | None = None) -> Fit:
    """The point with about the least sum of absolute misfits, which few readings cannot draw, with effects.

    These are linear, or in a way that only adds columns. It begins at parameters (P,) of the bench, or where the fit
    `before` with all of the effects but the last is.
    """
    count, bound = len(start), readings.bound
    blocks = blocks_of(cast.places, cast.variants(readings, readings.rows(start)) or ())
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    if before is not None:
        x[: len(before.at)] = before.at
    for iteration in range(ROUNDS + 1):
        model = cast.model(readings, x[:count], x[count:], blocks)
        assert model is not None
        residual = readings.reading.ravel() - model.reading
        # Least squares with these bounds is the least sum of absolute values; misfits within the noise count as one.
        loose = bound * np.sqrt(np.maximum(1.0, np.abs(residual / bound)))
        step = least_squares(model.jacobian / loose[:, None], residual / loose)
        settled = iteration == ROUNDS or np.abs(step).max(initial=0.0) < 0.1 * bound.min()
        if settled or not np.abs((x + step)[:count]).max() <= ASTRAY:
            radius = float(np.abs(residual / bound).max(initial=0.0))
            own = (model.jacobian, radius, x, x[count:], model.variants)
            return Fit(cast.places, blocks, x, 0.0 * x, residual, bound, *own)
        x = x + step
    raise AssertionError("the loop returns")


def without_last(readings: Readings, fit: Fit) -> Fit:
    """The model linear at the bench of a fit, with all of its effects but the last, of the sizes that they have."""
    places, blocks, count = fit.places[:-1], fit.blocks[:-1], len(fit.point)
    return _linear_at(readings, places, fit.at[: count + (blocks[-1].stop if blocks else 0)], count)


def _linear_at(readings: Readings, places: tuple[EffectPlace, ...], x: NDArray, count: int) -> Fit:
    """The model with linear effects at parameters and coefficients (P + K,), of which the first are the bench's."""
    blocks = blocks_of(places)
    model = Cast(places).model(readings, x[:count], x[count:], blocks)
    assert model is not None
    residual = readings.reading.ravel() - model.reading
    radius = float(np.abs(residual / readings.bound).max(initial=0.0))
    return Fit(places, blocks, x, 0.0 * x, residual, readings.bound, model.jacobian, radius, x, x[count:])


def usual_misfit(fit: Fit) -> float:
    """What most of the readings' misfits at a fit do not exceed, in units of the bounds."""
    return float(np.quantile(np.abs(fit.residual / fit.bound), USUAL))


def usual_centre(readings: Readings, start: NDArray) -> Fit:
    """The nominal model where few readings, channels that are exchanged, and a limit of a channel cannot draw it.

    It begins at a start (P,). Readings at the largest of their channel count for little where the others then agree far
    better: a limit that many reach draws all of them.
    """
    aligned = np.zeros(len(start))
    rows, bound, back = readings.rows(aligned), readings.bound, readings
    for place in EXCHANGED_READINGS.places:
        variants = readings.variants(place, rows)
        if variants:
            # From the first time on they may be exchanged, from the last on they are, and are exchanged back.
            first, last = variants[0], variants[-1]
            assert last.mixed is not None
            bound = np.where(first.touched.ravel(), LOOSE, bound)
            open_ = (first.touched & ~last.touched).ravel()
            own = np.einsum("nij,nj->ni", last.mixed, back.reading)
            back = replace(back, reading=own, bound=np.where(open_, LOOSE, back.bound))
    centre = centre_of(readings, Cast(()), start)
    if bound is not readings.bound:
        centre = _linear_at(replace(readings, bound=bound), (), centre_of(back, Cast(()), aligned).at, len(start))
    size = np.abs(readings.reading)
    within = size > size.max(axis=0) - AT_LIMIT * readings.bound.reshape(-1, 3)
    limited = within & (within.sum(axis=0) >= FEWEST_AT_LIMIT)
    if usual_misfit(centre) * float(readings.bound.min()) > GROSS and limited.any():
        other = centre_of(replace(readings, bound=np.where(limited.ravel(), LOOSE, bound)), Cast(()), aligned)
        told = ~limited.ravel()
        before, after = (np.quantile(np.abs(fit.residual / readings.bound)[told], USUAL) for fit in (centre, other))
        if after <= STANDS_OUT * before:
            return other
    return centre


def with_usual_signs(
    here: Linearisation, circumstances: Circumstances, noise_bound: float, bounds: tuple[float, float]
) -> Linearisation:
    """The nominal model with the signs of the inputs at the centre, where gross readings drew the fit far from it.

    σ is a fraction of g, the bounds are u^max and v^0max of (1.7).
    """
    p, at = here.parametrisation, here.positions
    point = usual_centre(Readings.of(here, circumstances), here.point).point
    sign = np.where(predicted_input(p, point, at) >= 0.0, 1, -1)
    if np.abs(point - here.point).max() <= bounds[1] or np.array_equal(sign, here.sign):
        return here
    there = linearise(p, at, here.reading, point, np.full_like(here.bound, noise_bound), sign)
    if p.symmetric:
        return there
    matrices = p.matrices[at.mounting]
    certain = admissible(at.alpha, at.beta, matrices, bounds=bounds)
    certain &= (nominal_input(at.alpha, at.beta, matrices) >= 0.0) == (sign > 0)
    return replace(there, bound=noise_bound + widening(there, certain, noise_bound, bounds))
