"""What the gyros do at rest: the smallest model of their means that bounded errors do not refuse."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.turntable import EARTH_RATE
from ..bounded.programmes import chebyshev_radius

SPARE = 3
"""A model is tried with at least so many rests more than it has parameters for each gyro."""
DISTINCT = 1e-3
"""Least singular value, over the largest, of columns of size one that can be told apart."""
SHUFFLES, CHANCE = 200, 0.01
"""Of shuffled rests not more than this part may be explained as well by a term that is named."""
KINDS = ("drift", "gravity", "temperature")
"""What may be added to a constant: a term in time, in the direction of gravity, in temperature."""
WORDS = {
    (): "constant",
    ("drift",): "drifting with time",
    ("gravity",): "dependent on the direction of gravity",
    ("temperature",): "dependent on temperature",
}


@dataclass(frozen=True)
class RestModel:
    """A model of the gyros' means at rest and whether bounded errors refuse it.

    Attributes
    ----------
    terms : tuple of str
        beside the constant, of KINDS
    radius : float
        least possible largest residual over its bound; refused above 1
    coefficients : tuple of tuple of float
        for each gyro: the constant [rad/s], then the terms' [rad/s/h], three [rad/s/g], [rad/s/K]
    by_chance : float or None
        part of 200 shuffles of the rests in which the terms do as well; None of the constant and of what is refused
    """

    terms: tuple[str, ...]
    radius: float
    coefficients: tuple[tuple[float, ...], ...]
    by_chance: float | None = None

    @property
    def title(self) -> str:
        """In words."""
        return " and ".join(WORDS[(term,)] for term in self.terms) if self.terms else WORDS[()]


@dataclass(frozen=True)
class GyrosAtRest:
    """The smallest models that stand; none where all that could be tried are refused.

    Attributes
    ----------
    verdict : str
        "constant", "named": one smallest model stands; "ambiguous": several of that size; "wandering": none does,
        or only terms that do as well for shuffled rests; "insufficient": too few rests to refuse anything
    standing : tuple of RestModel
        of the smallest size that stands
    tried : tuple of RestModel
        all, in the order of their size
    not_tried : tuple of str
        terms that the rests do not allow to try, with the reason
    """

    verdict: str
    standing: tuple[RestModel, ...]
    tried: tuple[RestModel, ...]
    not_tried: tuple[str, ...]


def gyros_at_rest(
    time_s: NDArray, rate: NDArray, bound: NDArray, up: NDArray, temperature: NDArray | None = None
) -> GyrosAtRest:
    """Find the smallest model of the gyros' means at rest.

    Earth's rotation is in the means; without heading its direction is not known, so its size widens the bounds.

    Parameters
    ----------
    time_s : (K,) array
        middles of the rests [s]
    rate, bound : (K, 3) array
        means and the bounds of their errors [rad/s]
    up : (K, 3) array
        inputs of the accelerometers [g]
    temperature : (K,) array or None
        [°C]

    Returns
    -------
    GyrosAtRest
    """
    columns = {"drift": (time_s - time_s[:1]).reshape(-1, 1) / 3600.0, "gravity": up}
    not_tried = []
    if temperature is not None and np.ptp(temperature) > 0.0:
        columns["temperature"] = temperature.reshape(-1, 1) - 20.0
    else:
        not_tried.append("temperature: " + ("not in the record" if temperature is None else "does not change"))
    tried: list[RestModel] = []
    for size in range(len(columns) + 1):
        for terms in combinations([kind for kind in KINDS if kind in columns], size):
            design = _design([columns[term] for term in terms], len(rate))
            why = _hindrance(design)
            if why is None:
                tried.append(_fitted(terms, design, rate, bound + EARTH_RATE))
            elif size <= 1:
                not_tried.append(f"{' and '.join(terms) or 'constant'}: {why}")
        fits = [model for model in tried if len(model.terms) == size and model.radius <= 1.0]
        if not fits:
            continue
        if size == 0:
            return GyrosAtRest("constant", tuple(fits), tuple(tried), tuple(not_tried))
        judged = [_judged(model, columns, rate, bound + EARTH_RATE) for model in fits]
        tried = [model for model in tried if model not in fits] + judged
        standing = tuple(model for model in judged if model.by_chance is not None and model.by_chance <= CHANCE)
        verdict = "wandering" if not standing else "named" if len(standing) == 1 else "ambiguous"
        return GyrosAtRest(verdict, standing, tuple(tried), tuple(not_tried))
    return GyrosAtRest("wandering" if tried else "insufficient", (), tuple(tried), tuple(not_tried))


def _judged(model: RestModel, columns: Mapping[str, NDArray], rate: NDArray, bound: NDArray) -> RestModel:
    """The model with the part of shuffles of the rests in which its terms do as well."""
    rng = np.random.default_rng(0)
    design = _design([columns[term] for term in model.terms], len(rate))
    as_well = 0
    for _ in range(SHUFFLES):
        order = rng.permutation(len(rate))
        as_well += all(chebyshev_radius(design, rate[order, p], bound[order, p])[0] <= model.radius for p in range(3))
    return replace(model, by_chance=as_well / SHUFFLES)


def _design(columns: Sequence[NDArray], rows: int) -> NDArray:
    return np.hstack([np.ones((rows, 1)), *columns])


def _hindrance(design: NDArray) -> str | None:
    """Why a model cannot be tried; None where it can."""
    if len(design) < design.shape[1] + SPARE:
        return f"{len(design)} rests, {design.shape[1] + SPARE} are needed"
    size = np.abs(design).max(axis=0)
    if not size.all():
        return "nothing changes"
    singular = np.linalg.svd(design / size, compute_uv=False)
    return None if singular[-1] > DISTINCT * singular[0] else "the rests do not tell its terms apart"


def _fitted(terms: tuple[str, ...], design: NDArray, rate: NDArray, bound: NDArray) -> RestModel:
    fits = [chebyshev_radius(design, rate[:, p], bound[:, p]) for p in range(3)]
    return RestModel(terms, max(fit[0] for fit in fits), tuple(tuple(fit[1].tolist()) for fit in fits))
