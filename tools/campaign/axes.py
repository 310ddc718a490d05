"""What a campaign sweeps: values one by one, or a distribution; a parameter's value from a number in [0, 1)."""

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.special import ndtri

Number = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Number, Number]
Span = tuple[Number, Number, Annotated[int, Field(ge=2, le=1_000_000)]]

DISCRETE = ("values", "grid", "log_grid")
DISTRIBUTIONS = ("uniform", "log_uniform", "normal", "truncated_normal", "triangular")
MOST_DEVIATIONS = 3.0
"""A truncated normal distribution ends at so many standard deviations."""


class Axis(BaseModel):
    """How one parameter varies; exactly one of the fields is given.

    Attributes
    ----------
    values : list
        these, one by one
    grid, log_grid : (first, last, count)
        evenly spaced, or by even factors
    uniform, log_uniform : (low, high)
    normal, truncated_normal : (mean, standard deviation)
        the second ends at three standard deviations
    triangular : (low, most likely, high)
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    values: Annotated[list[bool | int | Number | str], Field(min_length=1, max_length=1_000_000)] | None = None
    grid: Annotated[Span, Field(strict=False)] | None = None
    log_grid: Annotated[Span, Field(strict=False)] | None = None
    uniform: Annotated[Pair, Field(strict=False)] | None = None
    log_uniform: Annotated[Pair, Field(strict=False)] | None = None
    normal: Annotated[Pair, Field(strict=False)] | None = None
    truncated_normal: Annotated[Pair, Field(strict=False)] | None = None
    triangular: Annotated[tuple[Number, Number, Number], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one(self) -> "Axis":
        given = [name for name in (*DISCRETE, *DISTRIBUTIONS) if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give one of {', '.join((*DISCRETE, *DISTRIBUTIONS))}; here: {' and '.join(given) or 'none'}"
            )
        for name in ("log_grid", "log_uniform"):
            pair = getattr(self, name)
            if pair is not None and not (pair[0] > 0.0 and pair[1] > 0.0):
                raise ValueError(f"{name} = {list(pair)} needs positive ends")
        for name in ("uniform", "log_uniform", "triangular"):
            ends = getattr(self, name)
            if ends is not None and not (sorted(ends) == list(ends) and ends[0] < ends[-1]):
                raise ValueError(f"{name} = {list(ends)} must rise")
        for name in ("normal", "truncated_normal"):
            pair = getattr(self, name)
            if pair is not None and not pair[1] > 0.0:
                raise ValueError(f"{name} = {list(pair)}: the standard deviation must be positive")
        if self.values is not None and not _of_one_kind(self.values):
            raise ValueError("values must be all numbers, all texts, or all true or false")
        return self

    @property
    def discrete(self) -> bool:
        """Whether the values are given one by one."""
        return any(getattr(self, name) is not None for name in DISCRETE)

    def listed(self) -> list[Any]:
        """The values of a discrete axis; numbers as floats."""
        if self.values is not None:
            numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in self.values)
            return [float(v) for v in self.values] if numbers else list(self.values)
        if self.grid is not None:
            return np.linspace(self.grid[0], self.grid[1], self.grid[2]).tolist()
        assert self.log_grid is not None
        return np.geomspace(self.log_grid[0], self.log_grid[1], self.log_grid[2]).tolist()

    def quantile(self, part: ArrayLike) -> NDArray:
        """Values of a distribution that these parts, from 0 to 1, of its probability lie below."""
        u = np.asarray(part, dtype=float)
        if self.uniform is not None:
            low, high = self.uniform
            return low + u * (high - low)
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return low * np.exp(u * math.log(high / low))
        if self.normal is not None:
            return self.normal[0] + self.normal[1] * ndtri(np.clip(u, 2.0**-54, 1.0 - 2.0**-53))
        if self.truncated_normal is not None:
            # The tails beyond the ends have this probability, each.
            tail = 0.5 * math.erfc(MOST_DEVIATIONS / math.sqrt(2.0))
            return self.truncated_normal[0] + self.truncated_normal[1] * ndtri(tail + u * (1.0 - 2.0 * tail))
        assert self.triangular is not None
        low, top, high = self.triangular
        below = (top - low) / (high - low)
        rising = low + np.sqrt(u * (high - low) * (top - low))
        return np.where(u < below, rising, high - np.sqrt((1.0 - u) * (high - low) * (high - top)))


def _of_one_kind(values: Sequence[Any]) -> bool:
    kinds = {"flag" if isinstance(v, bool) else "text" if isinstance(v, str) else "number" for v in values}
    return len(kinds) == 1
