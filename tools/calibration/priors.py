"""What is known beforehand, |a'X| ≤ limit: constraints that bound what the readings alone leave open."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .linearisation import Linearisation, determined
from .parametrisation import Parametrisation
from .targets import expression_weights

LEAST_LIMIT = 1e-12
"""The tightest prior, as the least noise bound: below is rounding."""
FROM_BOUNDS = "bounds"
"""The prior that stands for all: each parameter within u^max or v^0max of (1.7)."""


@dataclass(frozen=True)
class Prior:
    """|weights'X| ≤ limit, and how it was written."""

    text: str
    weights: NDArray
    limit: float


@dataclass(frozen=True)
class WithPriors(Linearisation):
    """A linearisation with a row for each prior after those of the measurements: 0 = weights'X within its limit.

    `residual`, `jacobian`, `bound` and `span` count the priors; `reading`, `position`, `accelerometer` do not.
    """

    prior: NDArray

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals (M + K,) at another point; a prior's is what is left to zero."""
        return np.append(super().residual_at(point), -self.prior @ point)


def asked_priors(texts: Sequence[str], p: Parametrisation, bounds: tuple[float, float]) -> list[Prior]:
    """Priors as a person writes them: "X16=1e-3", "X4-X5=2e-4", or "bounds" for all by (1.7).

    Raises
    ------
    InputError
        for another form, or a limit that is not positive
    """
    priors = []
    for text in texts:
        if text.strip() == FROM_BOUNDS:
            priors += [Prior(f"{s}={limit:g}", w, limit) for s, w, limit in _from_bounds(p, bounds)]
            continue
        expression, equals, limit = text.rpartition("=")
        where = f"--prior {text[:60]!r}"
        if not equals:
            raise InputError(f"{where}: write a combination and its greatest size, as X16=1e-3, or {FROM_BOUNDS}")
        try:
            value = float(limit)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{where}: {limit.strip()[:20]!r} is not a positive number; write X16=1e-3")
        if value < LEAST_LIMIT:
            raise InputError(f"{where}: {value:g} is below {LEAST_LIMIT:g}, the least that can be used")
        try:
            weights = expression_weights(expression, p)
        except InputError as error:
            raise InputError(str(error).replace("--target", "--prior", 1)) from error
        priors.append(Prior(" ".join(text.split()), weights, value))
    return priors


def _from_bounds(p: Parametrisation, bounds: tuple[float, float]) -> list[tuple[str, NDArray, float]]:
    limits = parameter_limits(p.symbols, bounds)
    return [(s, w, float(x)) for s, w, x in zip(p.symbols, np.eye(len(p.symbols)), limits, strict=True) if x > 0.0]


def parameter_limits(symbols: Sequence[str], bounds: tuple[float, float], priors: Sequence[Prior] = ()) -> NDArray:
    """How large each parameter (P,) may be: u^max or v^0max of (1.7), or what a prior on it alone says."""
    limits = np.array([bounds[0] if symbol in ("X1", "X2", "X3") else bounds[1] for symbol in symbols])
    for prior in priors:
        if np.count_nonzero(prior.weights) == 1:
            k = int(np.argmax(np.abs(prior.weights)))
            own = [
                q.limit / abs(q.weights[k]) for q in priors if np.array_equal(q.weights != 0.0, prior.weights != 0.0)
            ]
            limits[k] = min(own)
    return limits


def with_priors(here: Linearisation, priors: Sequence[Prior]) -> Linearisation:
    """The linearisation with the priors' rows; itself when there are none."""
    if not priors:
        return here
    rows = np.array([prior.weights for prior in priors])
    limits = np.array([prior.limit for prior in priors])
    values = dict(vars(here))
    # a direction that a prior bounds is bounded, however loosely
    span = determined(np.vstack([here.jacobian, rows]), float(here.bound.min()))
    values |= {
        "residual": np.append(here.residual, -rows @ here.point),
        "jacobian": np.vstack([here.jacobian, rows]),
        "bound": np.append(here.bound, limits),
        "span": span,
    }
    return WithPriors(**values, prior=rows)
