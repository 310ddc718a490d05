"""What an attitude algorithm is, as data, and the range in which it is used."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

MAX_INCREMENT = math.pi
"""Largest increment over one sample [rad] that any algorithm takes: beyond half a turn its direction is ambiguous."""

RANGE_ERROR = 1e-3
"""Error of one update at a constant rate [rad] that sets the range of an algorithm whose series is cut off."""

MOST_SAMPLES = 8
"""Of one update of any algorithm."""

SUM = MOST_SAMPLES
"""In place of the first increment of a product: the sum of all of the step before the second one."""

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
        how it is shown, where it stands
    kernel : callable
        restricted Python; what it takes beside the increments depends on the algorithm
    samples : int
        gyro samples that one update takes
    order : int
        observed order of the attitude's error in the step over a fixed time; one update errs by one order more
    coning_order : int
        power of (frequency times sample interval) in the relative drift under coning
    max_increment : float
        valid range: longest increment over one sample [rad]. Where a constant rate is exact: half a turn over a step,
        or to where it stays exact; else to where one update at a constant rate errs by `RANGE_ERROR`
    norm_order : int or None
        order of the quaternion's deviation from the unit sphere over a fixed time, where it is not renormalised;
        None: none but rounding
    previous : bool
        whether the increments of the step before are used; there are none at the first update: they count as zero
    constant_rate : bool
        whether a turn at a constant rate is exact but for rounding
    name : str
        how it is chosen; by default as its kernel
    products : tuple of Product
        of the rotation vector, or of the one that its formula stands for; velocity goes by them, too. None where the
        attitude is iterated
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
