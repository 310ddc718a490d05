"""Where the search linearises the bench: fits that few readings cannot draw, with effects that stand out in them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.regressors import admissible, nominal_input
from ..bounded.sets import Problem
from ..calibration.model import Linearisation, linearise, predicted_input, widening
from .circumstances import Circumstances
from .disturbance import coefficient_count, disturbed, rows_at, signature_columns
from .extended_fit import ASTRAY, least_squares_step
from .extended_model import coefficient_blocks, extended_model

USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
LEAST_SLACK = 0.05
SECOND_ORDER = 5.0
"""The linear model may be wrong by so many times the square of the usual misfit, as fractions of g."""
TOO_MUCH = 0.3
"""With more slack than this, effects that stand out are fitted before others are sought."""
MOST_ANCHORS = 3
STANDS_OUT = 0.5
"""An effect stands out that leaves at most this part of the usual misfit."""
ROUNDS = 12


@dataclass(frozen=True)
class Centre:
    """A fit of the bench with some effects, and the model linearised there.

    Attributes
    ----------
    fixed : tuple of EffectPlace
        the effects
    point : (P,) array
        parameters of the bench
    coefficients : (K,) array
        of the effects
    residual : (M,) array
        exact, fractions of g
    jacobian : (M, P + K) array
    """

    fixed: tuple[EffectPlace, ...]
    point: NDArray
    coefficients: NDArray
    residual: NDArray
    jacobian: NDArray


def centre_of(
    here: Linearisation, circumstances: Circumstances, fixed: Sequence[EffectPlace], before: Centre | None = None
) -> Centre:
    """The point with about the least sum of absolute misfits.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    fixed : sequence of EffectPlace
        linear effects
    before : Centre, optional
        with all of them but the last: where to begin
    """
    point = here.point if before is None else before.point
    coefficients = np.zeros(sum(coefficient_count(place) for place in fixed))
    if before is not None:
        coefficients[: len(before.coefficients)] = before.coefficients
    reading = here.reading.ravel()
    for iteration in range(ROUNDS + 1):
        prediction, jacobian = extended_model(here, point, fixed, coefficients, circumstances)
        residual = reading - prediction
        # Least squares with these bounds is the least sum of absolute values; misfits within the noise count as one.
        loose = here.bound * np.sqrt(np.maximum(1.0, np.abs(residual / here.bound)))
        step = least_squares_step(jacobian, residual, loose)
        if iteration == ROUNDS or np.abs(step).max(initial=0.0) < 0.1 * here.bound.min():
            return Centre(tuple(fixed), point, coefficients, residual, jacobian)
        if not np.abs(point + step[: len(point)]).max() <= ASTRAY:
            return Centre(tuple(fixed), point, coefficients, residual, jacobian)
        point, coefficients = point + step[: len(point)], coefficients + step[len(point) :]
    raise AssertionError("the loop returns")


def usual_misfit(residual: NDArray, bound: NDArray) -> float:
    """What most of the readings' misfits do not exceed, in units of the bounds."""
    return float(np.quantile(np.abs(residual / bound), USUAL))


def slack_at(centre: Centre, here: Linearisation) -> float:
    """What the linear model may be wrong by, in units of the bounds: of second order in the usual misfit."""
    misfit = usual_misfit(centre.residual, here.bound)
    return LEAST_SLACK + SECOND_ORDER * misfit**2 * float(here.bound.min())


def problem_at(
    here: Linearisation, circumstances: Circumstances, centre: Centre, places: Sequence[EffectPlace]
) -> Problem:
    """The search for further effects as a linear problem in units of the bounds; the fixed ones are always there."""
    blocks = coefficient_blocks(centre.fixed, [None] * len(centre.fixed))
    at = disturbed(here, centre.point, centre.fixed, centre.coefficients, blocks, circumstances)
    rows = rows_at(here, centre.point, at, circumstances)
    columns, own, first = [np.zeros((len(centre.residual), 0))], [], 0
    for place in places:
        block = signature_columns([place], rows) / here.bound[:, None]
        columns.append(block)
        own.append(slice(first, first + block.shape[1]))
        first += block.shape[1]
    return Problem(centre.residual / here.bound, centre.jacobian / here.bound[:, None], np.hstack(columns), tuple(own))


def anchors(
    here: Linearisation, circumstances: Circumstances, centre: Centre, places: Sequence[EffectPlace]
) -> list[Centre]:
    """Centres with one effect more that stands out, the most helpful first."""
    helpful = most_helpful(problem_at(here, circumstances, centre, places), places)
    misfit = usual_misfit(centre.residual, here.bound)
    more = [centre_of(here, circumstances, (*centre.fixed, place), centre) for place in helpful[:MOST_ANCHORS]]
    return [one for one in more if usual_misfit(one.residual, here.bound) <= STANDS_OUT * misfit]


def most_helpful(problem: Problem, places: Sequence[EffectPlace]) -> list[EffectPlace]:
    """Effects by what each takes off the robust sum of squares, the most helpful first."""
    root = 1.0 / np.sqrt(np.maximum(1.0, np.abs(problem.residual)))
    nominal = root[:, None] * problem.nominal
    size = np.linalg.norm(nominal, axis=0)
    basis, values, _ = np.linalg.svd(nominal / np.where(size > 0.0, size, 1.0), full_matrices=False)
    basis = basis[:, values > 1e-9 * values.max(initial=0.0)]
    target = root * problem.residual
    target = target - basis @ (basis.T @ target)
    gains = []
    for place, block in zip(places, problem.blocks, strict=True):
        columns = root[:, None] * problem.columns[:, block]
        before = np.linalg.norm(columns, axis=0)
        columns = columns - basis @ (basis.T @ columns)
        kept = np.linalg.norm(columns, axis=0) > 1e-7 * before
        if kept.any():
            part = np.linalg.svd(columns[:, kept], full_matrices=False)[0].T @ target
            gains.append((-float(part @ part), place.title, place))
    return [place for _, _, place in sorted(gains, key=lambda gain: gain[:2])]


def with_usual_signs(
    here: Linearisation, circumstances: Circumstances, noise_bound: float, bounds: tuple[float, float]
) -> Linearisation:
    """The nominal model with the signs of the inputs at the centre, where gross readings drew the fit far from it.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    noise_bound : float
        σ, as a fraction of g
    bounds : (float, float)
        u^max and v^0max of (1.7)
    """
    p, at = here.parametrisation, here.positions
    point = centre_of(here, circumstances, ()).point
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


def moved(here: Linearisation, centre: Centre) -> Linearisation:
    """The nominal model linearised at a centre's point of the bench; bounds belong to the signs, and both stay."""
    return linearise(here.parametrisation, here.positions, here.reading, centre.point, here.bound, here.sign)
