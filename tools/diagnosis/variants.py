"""Effects that are not linear in their parameters: dead zone, saturation, quantisation, tried variant by variant."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import direction_jacobian, predicted_reading, reading_jacobian
from trihedron.calibration.programmes import chebyshev_radius
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.extended_fit import ExtendedFit, least_squares_step, rows_at
from trihedron.models.bench import SYMMETRIC_PAIRS, TARGETS
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.models.effects.rows import Rows, Variant

MAX_ITERATIONS = 8


def variant_fits(
    here: Linearisation, circumstances: Circumstances, place: EffectPlace, resolution: float, limit: float
) -> list[ExtendedFit]:
    """The ways in which an effect that is not linear makes a record consistent, at most the best of them.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    place : EffectPlace
    resolution : float
        half a last digit of the readings, as a fraction of g
    limit : float
        radius up to which a model is consistent

    Returns
    -------
    list of ExtendedFit
        one or none; its `variant` says how the effect acts
    """
    count = len(variants_at(here, circumstances, here.point, place, resolution)[1])
    fits = [fit_variant(here, circumstances, place, k, resolution) for k in range(count)]
    standing = [fit for fit in fits if fit is not None and fit.radius <= limit]
    return sorted(standing, key=lambda fit: fit.radius)[:1]


def variants_at(
    here: Linearisation, circumstances: Circumstances, point: NDArray, place: EffectPlace, resolution: float
) -> tuple[Rows, list[Variant]]:
    """What the effect sees at a point of the parameters, and the ways in which it can act there."""
    rows = replace(rows_at(here, point, here.positions, circumstances), resolution=resolution)
    variants = CATALOGUE[place.effect].variants
    return rows, [] if variants is None else variants(place, rows, here.reading, float(here.bound.min()))


def fit_variant(
    here: Linearisation, circumstances: Circumstances, place: EffectPlace, index: int, resolution: float
) -> ExtendedFit | None:
    """Fit the bench with one way in which an effect acts; None where the fit leaves that way."""
    p, point = here.parametrisation, here.point
    coefficients = np.zeros(0)
    for _ in range(MAX_ITERATIONS):
        rows, variants = variants_at(here, circumstances, point, place, resolution)
        if index >= len(variants):
            return None
        variant = variants[index]
        columns = variant.columns.reshape(len(here.residual), -1)
        if len(coefficients) != columns.shape[1]:
            coefficients = 0.5 * (variant.low + variant.high)
        jacobian = np.hstack((bench_slopes(here, point, variant), columns))
        predicted = predicted_reading(p, point, here.positions, here.sign) + variant.offset
        residual = here.reading.ravel() - predicted.ravel() - columns @ coefficients
        bound = here.bound + variant.widening.ravel()
        step = least_squares_step(jacobian, residual, bound)
        if np.abs(step).max(initial=0.0) < 1e-11:
            break
        point = point + step[: len(point)]
        coefficients = coefficients + step[len(point) :]
    else:
        return None
    radius, centre, duals = chebyshev_radius(jacobian, residual, bound)
    middle = coefficients + centre[len(point) :]
    within = bool(np.all(middle >= variant.low - 1e-12) and np.all(middle <= variant.high + 1e-12))
    if not within or not variant.stands(rows, middle):
        return None
    return ExtendedFit((place,), point, coefficients, residual, bound, jacobian, radius, centre, duals, variant=variant)


def bench_slopes(here: Linearisation, point: NDArray, variant: Variant) -> NDArray:
    """Derivatives (M, P) of the readings by the bench's parameters where the effect lets some of them through."""
    p = here.parametrisation
    slopes = reading_jacobian(p, point, here.positions, here.sign)
    if variant.lost.any():
        targets = (p.selection @ point)[here.positions.mounting]
        inputs = direction_jacobian(p, point, here.positions)
        for k, pair in enumerate(SYMMETRIC_PAIRS):
            rows = np.flatnonzero(variant.lost[:, k])
            chosen = np.where(here.sign[rows, k] >= 0, TARGETS.index(pair[0]), TARGETS.index(pair[1]))
            scale = 1.0 + targets[rows, chosen]
            by_scale = p.selection[here.positions.mounting[rows], chosen]
            slopes[rows, k] -= scale[:, None] * inputs[rows, k] + here.input[rows, k][:, None] * by_scale
    slopes[variant.fixed] = 0.0
    return slopes.reshape(len(here.residual), -1)
