"""The band: all functions of one quantity at one place that fit a record, for any law."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypedDict

from ...models.arrays import Floats, Ints
from ...models.effects.definition import AXES
from ...models.effects.lookup import MOST_KNOTS, TILTS, TURN, Table
from ..bounded.functions import Band, Functions, Unknown
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..evidence.pairs import Pair
from ..fields import Number, Ordered
from ..result import Told

NEAREST = 1.0 / 4000.0
"""Values of a quantity nearer to each other than this part of their range are one knot."""
MOST_TOLD = 41
"""Most knots of which values are listed; of several functions, in all."""
INPUTS, RATES = ("n1", "n2", "n3"), ("w1", "w2", "w3", "dw1", "dw2", "dw3")


class Knot(TypedDict):
    """A value of the quantity, and the ends of all possible functions there."""

    at: Number
    low: Number
    high: Number


class BandOfFunctions(Told):
    """The ends of every function of one quantity, at one place, that a record leaves possible.

    Attributes
    ----------
    where, quantity, factor : str
        the functions' place, their quantity, and their factor
    knots : tuple of Knot
        ends, exact for all functions that bend no more than `bending`; where the record has more values of the quantity
        than knots, for functions that are straight between knots
    imitated : tuple of tuple of float
        functions, by their values at the knots, that the model without effects imitates. They are taken out of the
        band, by least squares over the record's values of the quantity
    bending : float
        total variation of the slope, times the range of the knots; of functions that jump that of the values
    steps : bool
        true if functions jump
    """

    where: str
    quantity: str
    factor: str | None = None
    steps: bool
    imitated: tuple[tuple[Number, ...], ...]
    bending: Number
    knots: tuple[Annotated[Knot, Ordered], ...]

    @staticmethod
    def of(possible: "Possible") -> "BandOfFunctions":
        """The band of possible functions."""
        pair, band = possible.pair, possible.band
        rows = possible.every.imitated[: len(possible.knots)][np.searchsorted(possible.knots, band.knots)]
        # Where the function is zero, rounding may exchange the ends.
        ends = zip(band.knots, np.minimum(band.low, band.high), np.maximum(band.low, band.high), strict=True)
        knots = tuple(Knot(at=float(at), low=float(low), high=float(high)) for at, low, high in ends)
        factor_key = {"factor": pair.factor} if pair.factor else {}
        content = {
            "steps": possible.steps,
            "imitated": tuple(map(tuple, rows.T.tolist())),
            "bending": band.bending,
            "knots": knots,
        }
        return BandOfFunctions(where=pair.where, quantity=pair.quantity, **factor_key, **content)


@dataclass(frozen=True, eq=False)
class Possible:
    """The functions of a pair of place and quantity that evidence leaves possible; they may jump in `steps`.

    `others`: pairs at other places, each with a function of its own that acts beside them.
    """

    evidence: Evidence
    pair: Pair
    steps: bool = False
    others: tuple["Possible", ...] = ()

    @staticmethod
    def each(evidence: Evidence, pair: Pair, steps: bool) -> "tuple[Possible, ...]":
        """Return the functions of each place of a pair, with those of the others next to it."""
        alone = [Possible(evidence, function, steps) for function in pair.members or (pair,)]
        beside = []
        for function in alone:
            others = tuple(further for further in alone if further is not function)
            beside.append(replace(function, others=others))
        return tuple(beside)

    @cached_property
    def knots(self) -> Floats:
        """The values of the quantity that the record has, of too many some; of an input the zero, where it bends."""
        return self.spaced(self.places)

    def spaced(self, places: int) -> Floats:
        """Return the knots of one function when `places` functions act together."""
        values = np.unique(self.pair.values % TURN if self.pair.circle else self.pair.values)
        if self.pair.quantity in (*INPUTS, *RATES) and values[0] < 0.0 < values[-1]:
            values = np.unique(np.append(values, 0.0))
        least, separate = NEAREST * float(np.ptp(values)), [values[0]]
        for value in values[1:]:
            if value - separate[-1] > least:
                separate.append(value)
            elif value == 0.0:
                separate[-1] = value
        knots = np.array(separate)
        chosen = spread_over(len(knots), (MOST_KNOTS - 1) // places)
        return np.unique(np.append(knots[chosen], knots[knots == 0.0]))

    @property
    def places(self) -> int:
        """Return the number of functions that act together."""
        return 1 + len(self.others)

    @property
    def sign(self) -> float:
        """Return -1 for a function of a turn about an axis: the encoder reads more, so the table turns less; else 1."""
        return -1.0 if self.pair.where in AXES and self.pair.factor not in TILTS else 1.0

    def hats(self, knots: NDArray) -> Floats:
        """Return the weights (N, K) of the knots' values in the function, at each value of the quantity."""
        around = self.pair.circle
        table = Table("alpha" if around else "hours", "around" if around else "at", tuple(knots.tolist()))
        return table.columns(self.pair.values)

    def unknown(self, knots: NDArray) -> Unknown:
        """A function at the place itself, by its values at knots (K,)."""
        columns = self.sign * self.pair.spread(self.hats(knots))
        missed = None if self.pair.missed is None or self.steps else self.pair.missed(knots) / np.ptp(knots)
        return Unknown(knots, columns, TURN if self.pair.circle else None, self.steps, missed)

    def functions(self, knots: NDArray) -> Functions:
        """Return the functions by their values at knots (K,), followed by those of other places."""
        evidence = self.evidence
        beside_it = [function.unknown(function.spaced(self.places)) for function in self.others]
        unknown = Unknown.together([self.unknown(knots), *beside_it])
        bound = evidence.rows.bound * (1.0 + evidence.model.second_order) + evidence.model.room
        return Functions(evidence.rows.nominal, evidence.rows.residual, bound, unknown)

    @cached_property
    def every(self) -> Functions:
        """The functions by their values at all knots."""
        return self.functions(self.knots)

    @cached_property
    def band(self) -> Band:
        """Return the ends of the band at the reported knots; raise a SolverError where no function is possible."""
        return self.every.band(spread_over(len(self.knots), MOST_TOLD // self.places))

    @property
    def least(self) -> Floats:
        """The function (K,) at all knots that bends least."""
        return self.band.least[: len(self.knots)]

    def values_of(self, columns: NDArray) -> Floats:
        """Return the function (K,) at all knots that adds about these columns (M,), next to those of other places."""
        every = self.every.told(np.linalg.lstsq(self.every.unknown.columns, columns, rcond=None)[0])
        return every[: len(self.knots)]

    def drawn(self, fit: Fit) -> Floats:
        """Return the effects of a fit as a function (K,) at all knots, less the part that the bare model imitates."""
        return self.values_of(fit.jacobian[:, len(fit.point) :] @ fit.stated)

    def whole(self, fit: Fit) -> Floats:
        """Return the effects of a fit as a function (K,) at all knots, with the part that the bare model imitates.

        A knot without a reading beside it is NaN.
        """
        columns = self.every.unknown.columns
        values: Floats
        values = np.linalg.lstsq(columns, fit.jacobian[:, len(fit.point) :] @ fit.stated, rcond=None)[0].astype(float)
        values[~columns.any(axis=0)] = np.nan
        return values[: len(self.knots)]


def spread_over(count: int, most: int) -> Ints:
    """Return at most `most` indices, spread evenly over `count` items."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
