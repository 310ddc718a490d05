"""The bench model together with a set of effects, fitted to a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace, Rows
from ...models.effects.rows import Variant
from ..bounded.programmes import chebyshev_radius
from ..calibration.model import Linearisation
from .circumstances import Circumstances
from .disturbance import is_linear, rows_at
from .extended_model import acting, coefficient_blocks, model_at
from .variants import variants_seen

MAX_ITERATIONS = 12
MAX_MOVES = 8
ATTAINED = 1e-10
"""Relative difference between the radius of the programme and the largest misfit where it is attained."""
ASTRAY = 10.0
"""No bench has a parameter as large [1], [rad], [g]: a fit that comes there runs away."""
CONVERGED = 1e-12
"""Parameters [1], [rad] that move by less than this do not move."""


@dataclass(frozen=True)
class ExtendedFit:
    """The model with effects, linearised where its largest misfit is least.

    Attributes
    ----------
    places : tuple of EffectPlace
        the effects
    point : (P,) array
        parameters of the bench, as in the linearisation of the nominal model
    coefficients : (K,) array
        linear coefficients of the effects
    blocks : tuple of slice
        the coefficients of each effect
    residual, bound : (M,) array
        exact residuals at the fit, bounds of the readings' errors; fractions of g
    jacobian : (M, P + K) array
        derivatives by parameters and coefficients
    radius : float
        least max |residual| / bound, attained at the point
    centre : (P + K,) array
        step from the point to where the radius is attained: none, but where possible sizes were asked for
    duals : (M,) array
        proof of the radius
    variants : tuple of (Variant or None)
        the way in which each effect acts that is not linear
    estimate : (P + K,) array
        parameters and coefficients of least squares
    """

    places: tuple[EffectPlace, ...]
    point: NDArray
    coefficients: NDArray
    blocks: tuple[slice, ...]
    residual: NDArray
    bound: NDArray
    jacobian: NDArray
    radius: float
    centre: NDArray
    duals: NDArray
    variants: tuple[Variant | None, ...]
    estimate: NDArray

    @property
    def linear(self) -> bool:
        """Whether every effect is linear in its coefficients."""
        return all(variant is None for variant in self.variants)

    @property
    def central(self) -> NDArray:
        """Coefficients (K,) where the radius is attained."""
        return self.coefficients + self.centre[len(self.point) :]

    def values(self) -> tuple[tuple[float, ...], ...]:
        """Parameters of each effect where the radius is attained."""
        return tuple(
            CATALOGUE[place.effect].at(place).from_coefficients(self.central[block])
            if variant is None
            else variant.values(self.central[block])
            for place, block, variant in zip(self.places, self.blocks, self.variants, strict=True)
        )


def least_squares_step(jacobian: NDArray, residual: NDArray, bound: NDArray) -> NDArray:
    """Step of least weighted squares, of least length where the measurements leave it open."""
    weighted = jacobian / bound[:, None]
    size = np.linalg.norm(weighted, axis=0)
    size[size == 0.0] = 1.0
    u, values, directions = np.linalg.svd(weighted / size, full_matrices=False)
    kept = values > 1e-8 * values.max(initial=0.0)
    return (directions[kept].T @ ((u[:, kept].T @ (residual / bound)) / values[kept])) / size


def fit_extended(here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]) -> ExtendedFit:
    """Fit the bench together with linear effects; arguments as for `fit_ways`."""
    fit = fit_ways(here, circumstances, places, {}, 0.0)
    if fit is None:
        raise ValueError("linear effects act in one way only")
    return fit


def fit_ways(
    here: Linearisation,
    circumstances: Circumstances,
    places: Sequence[EffectPlace],
    ways: Mapping[EffectPlace, int],
    resolution: float,
    largest: Mapping[EffectPlace, float] | None = None,
) -> ExtendedFit | None:
    """Fit the bench together with effects: least squares, then the Chebyshev programme, both relinearised.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of the rows
    places : sequence of EffectPlace
        the effects
    ways : mapping
        of each effect that is not linear, which of its variants
    resolution : float
        half a last digit of the readings, as a fraction of g; what is not linear needs it
    largest : mapping, optional
        largest coefficients of effects whose circumstances the record does not tell everywhere

    Returns
    -------
    ExtendedFit or None
        None where the fit leaves the way in which an effect acts, or runs away
    """
    point, reading = here.point, here.reading.ravel()
    rows = replace(rows_at(here, point, here.positions, circumstances), resolution=resolution)
    begun = [acting(place, ways[place], rows, here) if place in ways else None for place in places]
    if any(variant is None for place, variant in zip(places, begun, strict=True) if place in ways):
        return None
    blocks = coefficient_blocks(places, begun)
    coefficients = np.zeros(blocks[-1].stop if blocks else 0)
    for block, variant in zip(blocks, begun, strict=True):
        if variant is not None:
            coefficients[block] = 0.5 * (variant.low + variant.high)
    for iteration in range(MAX_ITERATIONS + 1):
        model = model_at(here, point, places, coefficients, blocks, circumstances, ways, resolution, largest or {})
        if model is None:
            return None
        step = least_squares_step(model.jacobian, reading - model.reading, model.bound)
        if iteration == MAX_ITERATIONS or np.abs(step).max(initial=0.0) < CONVERGED:
            break
        point = point + step[: len(point)]
        coefficients = coefficients + step[len(point) :]
        if _astray(point, coefficients):
            return None
    estimate = np.append(point, coefficients)
    residual = reading - model.reading
    radius, centre, duals = chebyshev_radius(model.jacobian, residual, model.bound)
    for _ in range(MAX_MOVES):
        # Noise may be at its very bound: then the second order of the step to the centre must not count either.
        point, coefficients = point + centre[: len(point)], coefficients + centre[len(point) :]
        if _astray(point, coefficients):
            return None
        there = model_at(here, point, places, coefficients, blocks, circumstances, ways, resolution, largest or {})
        if there is None:
            return None
        model, residual = there, reading - there.reading
        attained = float(np.abs(residual / model.bound).max(initial=0.0))
        if attained <= radius + ATTAINED * max(1.0, radius):
            break
        radius, centre, duals = chebyshev_radius(model.jacobian, residual, model.bound)
    centre = np.zeros(len(centre))
    radius = float(np.abs(residual / model.bound).max(initial=0.0))
    fit = ExtendedFit(
        tuple(places),
        point,
        coefficients,
        blocks,
        residual,
        model.bound,
        model.jacobian,
        radius,
        centre,
        duals,
        model.variants,
        estimate,
    )
    return fit if _stands(fit, model.rows) else None


def fit_nearest(
    here: Linearisation,
    circumstances: Circumstances,
    places: Sequence[EffectPlace],
    like: ExtendedFit,
    resolution: float,
) -> ExtendedFit | None:
    """Fit effects to other rows; what is not linear acts there in the way whose parameters are nearest to `like`'s."""
    rows = replace(rows_at(here, like.point, here.positions, circumstances), resolution=resolution)
    wanted = dict(zip(like.places, like.values(), strict=True))
    ways = {}
    for place in places:
        if is_linear(place):
            continue
        seen = variants_seen(place, rows, here.reading, float(here.bound.min()))
        if not seen:
            return None
        value = wanted[place][0]
        limits = [variant.limits[0] for variant in seen]
        ways[place] = int(np.argmin([max(low - value, value - high, 0.0) for low, high in limits]))
    return fit_ways(here, circumstances, places, ways, resolution)


def _astray(point: NDArray, coefficients: NDArray) -> bool:
    """Whether a fit runs away."""
    return not (np.abs(point).max() <= ASTRAY and np.isfinite(coefficients).all())


def _stands(fit: ExtendedFit, rows: Rows) -> bool:
    """Whether each effect that is not linear acts at the fit in the way that was assumed."""
    for block, variant in zip(fit.blocks, fit.variants, strict=True):
        if variant is None:
            continue
        middle = fit.central[block]
        within = bool(np.all(middle >= variant.low - 1e-12) and np.all(middle <= variant.high + 1e-12))
        if not within or not variant.stands(rows, middle):
            return False
    return True
