"""Where the search linearises the bench: a fit that large effects have not drawn away from the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation, linearise
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.disturbance import coefficient_count, rows_at, signature_columns
from trihedron.diagnosis.extended_fit import extended_model, least_squares_step
from trihedron.models.effects import EffectPlace

USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
SMALL = 10.0
"""Up to this usual misfit, in units of the bounds, the point is good enough."""
MOST_EFFECTS = 3
ROUNDS = 12


@dataclass(frozen=True)
class StartingPoint:
    """A point of the bench's parameters.

    Attributes
    ----------
    here : Linearisation
        the nominal model there
    misfit : float
        usual misfit of the model that found it, in units of the bounds: of so many bounds the point may be wrong
    """

    here: Linearisation
    misfit: float


def starting_point(here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]) -> StartingPoint:
    """The nominal fit where that is good enough; else one that few readings cannot draw, with the effects that help.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    places : sequence of EffectPlace
        linear effects that may be taken in, the best first, up to three; only the point is kept
    """
    misfit = usual_misfit(here.residual, here.bound)
    if misfit <= SMALL and np.abs(here.residual / here.bound).max() <= 3.0 * SMALL:
        return StartingPoint(here, misfit)
    chosen: list[EffectPlace] = []
    point, coefficients, residual = robust_fit(here, circumstances, chosen, here.point, np.zeros(0))
    misfit = usual_misfit(residual, here.bound)
    while misfit > SMALL and len(chosen) < MOST_EFFECTS:
        more = most_helpful(moved(here, point), circumstances, places, chosen, residual)
        if more is None:
            break
        start = np.append(coefficients, np.zeros(coefficient_count(more)))
        tried = robust_fit(here, circumstances, [*chosen, more], point, start)
        if usual_misfit(tried[2], here.bound) >= misfit:
            break
        chosen.append(more)
        point, coefficients, residual = tried
        misfit = usual_misfit(residual, here.bound)
    return StartingPoint(moved(here, point), misfit)


def usual_misfit(residual: NDArray, bound: NDArray) -> float:
    """What most of the readings' misfits do not exceed, in units of the bounds."""
    return float(np.quantile(np.abs(residual / bound), USUAL))


def moved(here: Linearisation, point: NDArray) -> Linearisation:
    """The nominal model linearised at another point."""
    return linearise(here.parametrisation, here.positions, here.reading, point, here.bound)


def robust_fit(
    here: Linearisation,
    circumstances: Circumstances,
    chosen: Sequence[EffectPlace],
    point: NDArray,
    coefficients: NDArray,
) -> tuple[NDArray, NDArray, NDArray]:
    """Point (P,), coefficients (K,) and residuals (M,) with about the least sum of absolute misfits."""
    residual = here.residual
    for _ in range(ROUNDS):
        prediction, jacobian = extended_model(here, point, chosen, coefficients, circumstances)
        residual = here.reading.ravel() - prediction
        # Least squares with these bounds is the least sum of absolute values; misfits within the noise count as one.
        loose = here.bound * np.sqrt(np.maximum(1.0, np.abs(residual / here.bound)))
        step = least_squares_step(jacobian, residual, loose)
        point, coefficients = point + step[: len(point)], coefficients + step[len(point) :]
        if np.abs(step).max(initial=0.0) < 0.1 * here.bound.min():
            break
    return point, coefficients, residual


def most_helpful(
    here: Linearisation,
    circumstances: Circumstances,
    places: Sequence[EffectPlace],
    chosen: Sequence[EffectPlace],
    residual: NDArray,
) -> EffectPlace | None:
    """The effect that takes most off the sum of squares of what is left."""
    rows = rows_at(here, here.point, here.positions, circumstances)
    loose = here.bound * np.sqrt(np.maximum(1.0, np.abs(residual / here.bound)))
    nominal = here.jacobian / loose[:, None]
    basis, values, _ = np.linalg.svd(nominal / np.linalg.norm(nominal, axis=0).clip(1e-300), full_matrices=False)
    basis = basis[:, values > 1e-9 * values.max(initial=0.0)]
    target = residual / loose
    target = target - basis @ (basis.T @ target)
    gains = []
    for place in places:
        if place in chosen:
            continue
        columns = signature_columns([place], rows) / loose[:, None]
        before = np.linalg.norm(columns, axis=0)
        columns = columns - basis @ (basis.T @ columns)
        kept = np.linalg.norm(columns, axis=0) > 1e-7 * before
        if kept.any():
            part = np.linalg.svd(columns[:, kept], full_matrices=False)[0].T @ target
            gains.append((float(part @ part), place))
    return max(gains, key=lambda gain: gain[0])[1] if gains else None
