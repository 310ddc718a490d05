"""Fields of results that are more than a number: counts, intervals, probabilities, directions, rotations, covariances.

A file of results that holds another value is refused when it is read.
"""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, Field

from ..models.arrays import Floats
from ..models.bench import checked_rotation

Number = Annotated[float, Field(allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=0)]
Axis = Annotated[int, Field(ge=1, le=3)]
Direction = Annotated[list[Number], Field(min_length=3, max_length=3)]
NEGATIVE = 1e-6
"""An eigenvalue of a covariance, scaled to a unit diagonal, is below zero by no more than this from rounding."""
ROUNDING, LEAST_END = 1e-9, 1e-15
"""A low end is above a high one only by more than this part of both, and this."""
Interval = TypeVar("Interval", bound=Mapping[str, Any])


def check_ends(low: Any, high: Any) -> None:
    """Raise a ValueError for a low end above its high end; of numbers, of arrays of them, and of None for no end."""
    if low is None or high is None:
        return
    if isinstance(low, float) and isinstance(high, float) and low <= high:
        return
    apart, size = np.subtract(low, high), np.abs(low) + np.abs(high)
    # Of a function that is zero at a knot rounding decides which end is lower.
    if (apart > LEAST_END + ROUNDING * size).any():
        raise ValueError(f"low = {low!r} is above high = {high!r}")


def _ordered_pair(ends: Any) -> Any:
    check_ends(*ends)
    return ends


def _ordered(interval: Interval) -> Interval:
    check_ends(interval["low"], interval["high"])
    return interval


def _rotation(rows: list[list[float]]) -> list[list[float]]:
    checked_rotation(rows)
    return rows


def checked_covariance(rows: Any) -> Floats:
    """Return a covariance (9, 9) from nested lists; a ValueError for any other matrix."""
    try:
        covariance = np.array(rows, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError("must be 9 rows of 9 numbers") from error
    if covariance.shape != (9, 9) or not np.isfinite(covariance).all():
        raise ValueError("must be 9 rows of 9 numbers")
    variances = np.diag(covariance)
    if variances.min() < 0.0:
        raise ValueError(f"the variance {variances.min():.3g} on its diagonal is negative")
    scale = np.sqrt(variances) + np.finfo(float).tiny
    correlation = covariance / scale / scale[:, None]
    if np.abs(correlation - correlation.T).max() > NEGATIVE:
        raise ValueError("is not symmetric")
    if not np.abs(correlation).max() <= 1.0 + NEGATIVE or np.linalg.eigvalsh(correlation)[0] < -NEGATIVE:
        raise ValueError("gives some combination of the parameters a negative variance")
    return covariance


def _covariance(rows: list[list[float]]) -> list[list[float]]:
    checked_covariance(rows)
    return rows


OrderedPair = AfterValidator(_ordered_pair)
"""Of a pair of ends."""
Ordered = AfterValidator(_ordered)
"""Of an object with the keys low and high."""
Range = Annotated[list[Number], Field(min_length=2, max_length=2), OrderedPair]
Rotation = Annotated[list[list[Number]], AfterValidator(_rotation)]
Covariance = Annotated[list[list[Number]], AfterValidator(_covariance)]
"""Of nine parameters, symmetric and without a negative variance."""
