"""The bench model together with a set of effects, fitted to a record."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import (
    Parametrisation,
    Positions,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)
from trihedron.calibration.programmes import chebyshev_radius
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.models.bench import SYMMETRIC_PAIRS, TARGETS
from trihedron.models.effects import CATALOGUE, EffectPlace, Rows
from trihedron.models.effects.rows import Variant

MAX_ITERATIONS = 12
CONVERGED = 1e-12
"""Parameters [1], [rad] that move by less than this do not move."""
INPUT_CHANGE = 1e-4
"""Change of an input [g] between rows whose sense is certain; a smaller one says nothing."""
SAME_WAY = 0.02
"""Ways [rad] of the two axes that differ by less end together."""


@dataclass(frozen=True)
class ExtendedFit:
    """The model with effects, linearised at its fit.

    Attributes
    ----------
    places : tuple of EffectPlace
        the effects
    point : (P,) array
        parameters of the bench, as in the linearisation of the nominal model
    coefficients : (K,) array
        linear coefficients of the effects, one effect after the other
    residual, bound : (M,) array
        exact residuals at the fit, bounds of the readings' errors; fractions of g
    jacobian : (M, P + K) array
        derivatives by parameters and coefficients
    radius : float
        least max |residual| / bound
    centre : (P + K,) array
        step from the fit to where the radius is attained
    duals : (M,) array
        proof of the radius
    variant : Variant or None
        the way in which an effect that is not linear acts; its coefficients are then those of the variant
    """

    places: tuple[EffectPlace, ...]
    point: NDArray
    coefficients: NDArray
    residual: NDArray
    bound: NDArray
    jacobian: NDArray
    radius: float
    centre: NDArray
    duals: NDArray
    variant: Variant | None = None


def acts_on_encoder(place: EffectPlace) -> bool:
    """Whether an effect adds to the readings of the encoders: then the true angles follow from it exactly."""
    return CATALOGUE[place.effect].stage == "encoder_effects"


def true_angles(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    circumstances: Circumstances,
) -> Positions:
    """Encoder readings [rad] freed from what effects add to them: the readings of faultless encoders."""
    at = here.positions
    alpha, beta = at.alpha, at.beta
    if not any(acts_on_encoder(place) for place in places):
        return at
    shift = point[here.symbols.index("X2")]
    nothing = np.zeros((len(alpha), 3))
    for _ in range(6):
        rows = Rows(
            hours=circumstances.hours,
            alpha=alpha - shift,
            beta=beta,
            n=nothing,
            by_alpha=nothing,
            by_beta=nothing,
            sense_alpha=circumstances.sense_alpha,
            sense_beta=circumstances.sense_beta,
        )
        turn = np.zeros((len(alpha), 4))
        first = 0
        for place in places:
            effect = CATALOGUE[place.effect].at(place)
            count = coefficient_count(place)
            if acts_on_encoder(place) and effect.turns is not None:
                turn += effect.turns(place, rows) @ coefficients[first : first + count]
            first += count
        alpha, beta = at.alpha + turn[:, 1], at.beta + turn[:, 3]
    return Positions(alpha, beta, at.mounting)


def rows_at(here: Linearisation, point: NDArray, at: Positions, circumstances: Circumstances) -> Rows:
    """What the signatures see at these positions; derivatives by a complex step."""
    p, step = here.parametrisation, 1e-30
    n = predicted_input(p, point, at)

    def slope(parameter: str | None, alpha: float = 0.0, beta: float = 0.0) -> NDArray:
        moved = point + 1j * step * np.array([symbol == parameter for symbol in p.symbols])
        there = Positions(at.alpha + 1j * step * alpha, at.beta + 1j * step * beta, at.mounting)
        return np.imag(predicted_reading(p, moved, there)) / step

    targets = (p.selection @ point)[at.mounting]
    plus, minus = (targets[:, [TARGETS.index(pair[k]) for pair in SYMMETRIC_PAIRS]] for k in (0, 1))
    return Rows(
        hours=circumstances.hours,
        alpha=at.alpha - point[here.symbols.index("X2")],
        beta=at.beta,
        n=n,
        by_alpha=slope(None, alpha=1.0),
        by_beta=slope(None, beta=1.0),
        by_kappa=slope("X1"),
        by_epsilon=slope("X3"),
        temperature=circumstances.temperature,
        sense_alpha=circumstances.sense_alpha,
        sense_beta=circumstances.sense_beta,
        input_sense=input_senses(p, point, at, circumstances),
        own=n + np.where(n >= 0.0, plus, minus) * n,
        prediction=predicted_reading(p, point, at),
    )


def input_senses(p: Parametrisation, point: NDArray, at: Positions, circumstances: Circumstances) -> NDArray:
    """Senses (N, 3) of the last change of each accelerometer's input: with the approach, else from the row before.

    The first row comes from no input. At an approach the axis with the longer way, which arrives last where both set
    out together at equal rates, has the last word; both have it when the ways are equal or not known.
    """
    step = 1e-30
    n = predicted_input(p, point, at)
    if circumstances.approached or circumstances.before is None:
        first, second = later_axes(at, circumstances)
        moving = Positions(
            at.alpha + 1j * step * first * circumstances.sense_alpha,
            at.beta + 1j * step * second * circumstances.sense_beta,
            at.mounting,
        )
        return np.sign(np.imag(predicted_input(p, point, moving)))
    before = predicted_input(p, point, Positions(circumstances.before[:, 0], circumstances.before[:, 1], at.mounting))
    change = n - np.nan_to_num(before)
    return np.where(np.abs(change) > INPUT_CHANGE, np.sign(change), 0.0)


def later_axes(at: Positions, circumstances: Circumstances) -> tuple[NDArray, NDArray]:
    """Whether (N,) the outer and the inner axis still moved when the table came to each position."""
    both = np.ones(len(at.alpha), dtype=bool)
    if circumstances.before is None:
        return both, both
    senses = np.stack((circumstances.sense_alpha, circumstances.sense_beta), axis=1)
    ways = np.remainder(senses * (np.stack((at.alpha, at.beta), axis=1) - circumstances.before), 2.0 * np.pi)
    # An axis that stayed seems to have gone all the way round.
    longer = np.diff(np.where(ways > 2.0 * np.pi - SAME_WAY, 0.0, ways), axis=1)[:, 0]
    return ~(longer > SAME_WAY), ~(longer < -SAME_WAY)


def signature_columns(places: Sequence[EffectPlace], rows: Rows) -> NDArray:
    """Signatures (3 N, K) of all effects, side by side."""
    columns = [CATALOGUE[place.effect].signature(place, rows).reshape(3 * len(rows.hours), -1) for place in places]
    return np.hstack(columns) if columns else np.zeros((3 * len(rows.hours), 0))


def coefficient_count(place: EffectPlace) -> int:
    """Number of linear coefficients of an effect: it has as many parameters."""
    return len(CATALOGUE[place.effect].at(place).parameters)


def extended_reading(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    circumstances: Circumstances,
) -> tuple[NDArray, NDArray]:
    """Predicted readings (3 N,) over g with the effects, and their signatures (3 N, K) there."""
    at = true_angles(here, point, places, coefficients, circumstances)
    rows = rows_at(here, point, at, circumstances)
    columns = signature_columns(places, rows)
    reading = predicted_reading(here.parametrisation, point, at, here.sign).ravel()
    first = 0
    for place in places:
        count = coefficient_count(place)
        if not acts_on_encoder(place):
            reading = reading + columns[:, first : first + count] @ coefficients[first : first + count]
        first += count
    return reading, columns


def least_squares_step(jacobian: NDArray, residual: NDArray, bound: NDArray) -> NDArray:
    """Step of least weighted squares, of least length where the measurements leave it open."""
    weighted = jacobian / bound[:, None]
    size = np.linalg.norm(weighted, axis=0)
    size[size == 0.0] = 1.0
    u, values, directions = np.linalg.svd(weighted / size, full_matrices=False)
    kept = values > 1e-8 * values.max(initial=0.0)
    return (directions[kept].T @ ((u[:, kept].T @ (residual / bound)) / values[kept])) / size


def fit_extended(here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]) -> ExtendedFit:
    """Fit the bench together with effects: least squares, relinearised, then the Chebyshev programme.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of the rows
    places : sequence of EffectPlace
        the effects

    Returns
    -------
    ExtendedFit
    """
    point = here.point
    coefficients = np.zeros(sum(coefficient_count(place) for place in places))
    reading = here.reading.ravel()
    jacobian = np.zeros((len(reading), 0))
    for _ in range(MAX_ITERATIONS):
        predicted, columns = extended_reading(here, point, places, coefficients, circumstances)
        at = true_angles(here, point, places, coefficients, circumstances)
        bench = reading_jacobian(here.parametrisation, point, at, here.sign).reshape(len(reading), -1)
        jacobian = np.hstack((bench, columns))
        step = least_squares_step(jacobian, reading - predicted, here.bound)
        if np.abs(step).max(initial=0.0) < CONVERGED:
            break
        point = point + step[: len(point)]
        coefficients = coefficients + step[len(point) :]
    predicted, _ = extended_reading(here, point, places, coefficients, circumstances)
    residual = reading - predicted
    radius, centre, duals = chebyshev_radius(jacobian, residual, here.bound)
    return ExtendedFit(tuple(places), point, coefficients, residual, here.bound, jacobian, radius, centre, duals)
