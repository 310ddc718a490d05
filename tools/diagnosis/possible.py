"""Whether effects that mend a record can do so with sizes that the catalogue calls possible."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE
from ..bounded.programmes import chebyshev_radius
from .extended_fit import ExtendedFit

LARGEST_OF_BENCH = 0.5
"""No parameter of a bench [1], [rad], [g] is larger, as none of `--bounds`: accelerometers that are swapped or reversed
are no bench with an effect."""


def is_possible(fit: ExtendedFit) -> bool:
    """Whether the sizes at the centre of a fit are possible."""
    return all(
        parameter.possible(value)
        for place, values in zip(fit.places, fit.values(), strict=True)
        for parameter, value in zip(CATALOGUE[place.effect].at(place).parameters, values, strict=True)
    )


def within_possible(fit: ExtendedFit, limit: float) -> ExtendedFit | None:
    """A fit with possible sizes, its own or the nearest; None where none keep the radius at or below the limit."""
    if np.abs(fit.point).max() > LARGEST_OF_BENCH:
        return None
    if is_possible(fit):
        return fit
    low, high = coefficient_limits(fit)
    bench = np.full(len(fit.point), np.inf)
    radius, centre, duals = chebyshev_radius(
        fit.jacobian,
        fit.residual,
        fit.bound,
        low=np.concatenate((-bench, low - fit.coefficients)),
        high=np.concatenate((bench, high - fit.coefficients)),
    )
    moved = replace(fit, radius=radius, centre=centre, duals=duals)
    return moved if radius <= limit and is_possible(moved) else None


def coefficient_limits(fit: ExtendedFit) -> tuple[NDArray, NDArray]:
    """Least and largest coefficients (K,) with possible sizes; amplitudes and phases as the pairs that they are."""
    low, high = np.full(len(fit.coefficients), -np.inf), np.full(len(fit.coefficients), np.inf)
    for place, block, variant in zip(fit.places, fit.blocks, fit.variants, strict=True):
        if variant is not None:
            low[block], high[block] = variant.low, variant.high
            continue
        parameters = CATALOGUE[place.effect].at(place).parameters
        for k, parameter in enumerate(parameters):
            at = block.start + k
            if parameter.name.endswith("phase"):
                low[at], high[at] = low[at - 1], high[at - 1]
            elif parameter.name.endswith("amplitude"):
                # The square within the circle of the largest amplitude.
                high[at] = parameter.largest / np.sqrt(2.0)
                low[at] = -high[at]
            else:
                high[at] = parameter.largest
                low[at] = -parameter.largest if parameter.smallest is None else parameter.smallest
    return low, high
