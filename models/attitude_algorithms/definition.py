"""An attitude algorithm as data, and its range of use."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

RANGE_ERROR = 1e-3
"""Error of one update at a constant rate [rad] that sets the range of an algorithm whose series is cut off."""

MOST_SAMPLES = 8
"""Largest number of samples in one update of any algorithm."""

SUM = MOST_SAMPLES
"""First index of a product for the sum of all increments of the step before the second index."""

Product: TypeAlias = tuple[int, int, Fraction]
"""i, j, k: the rotation vector has k γ_i × γ_j, i and j counted from the first increment of the step."""


@dataclass(frozen=True)
class Algorithm:
    """An attitude algorithm as data.

    Attributes
    ----------
    number : int
        value of the parameter `algorithm` of the attitude computer
    title, source : str
        title, publication
    kernel : callable
        restricted Python; its arguments beside the increments depend on the algorithm
    samples : int
        gyro samples in one update
    order : int
        observed order of the attitude's error in the step over a fixed time; one update errs by one order more
    coning_order : int
        power of (frequency times sample interval) in the relative drift under coning
    max_increment : float
        valid range: longest increment over one sample [rad]. If a constant rate is exact: half a turn over a step, or
        the end of the exact range; otherwise the point at which the error of one update at a constant rate is
        `RANGE_ERROR`
    norm_order : int or None
        order of the quaternion's deviation from the unit sphere over a fixed time without renormalisation; None: only
        rounding
    previous : bool
        True if the increments of the previous step are used; at the first update they count as zero
    constant_rate : bool
        True if a turn at a constant rate is exact except for rounding
    name : str
        name for its choice; by default that of its kernel
    products : tuple of Product
        products of the rotation vector, or of the vector that its formula represents; velocity uses them, too. None if
        the attitude is iterated
    """

    number: int
    title: str
    source: str
    kernel: Callable[..., int | None]
    samples: int
    order: int
    coning_order: int
    max_increment: float
    norm_order: int | None = None
    previous: bool = False
    constant_rate: bool = False
    name: str = ""
    products: tuple[Product, ...] = ()

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.kernel.__name__.replace("_", "-"))
