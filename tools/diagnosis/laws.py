"""Laws of a function with known place and quantity: those of the catalogue, then short formulas by size.

A law is linear in its unknown coefficients. One number may give its shape: a time constant, or the place of a step or
bend. A programme refutes whole intervals of shapes: in it the bounds grow with the coefficient by the law's change
within the interval. The remaining intervals hold every shape that fits.
"""

import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats
from ...models.effects import EffectPlace
from ...models.effects.formula import TARGETS, Formula
from ...models.effects.lookup import OF_ANGLES, WAYS
from ..bounded.programmes import (
    Growth,
    SolverError,
    chebyshev_radius,
    column_space,
    proven_radius,
    same_space,
    spaces_beyond,
)
from ..bounded.work import CutOff, Work
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..evidence.pairs import GYROS, LEAST_AROUND, Form, Pair
from .band import INPUTS, RATES, Possible
from .rivals import Listed

HIGHEST = 7
"""The highest power of an input."""
ORDERS = range(1, 13)
FINEST = 1.0 / 256.0
"""Part of all shapes below which an interval of shapes is one shape."""
SHARPEST = 0.05
"""An input saturates from this part of its range on, or later."""
LARGEST = 0.5
"""No law adds more [g], [rad]."""
TURNS = 1.2
"""Sum of changes over size above which a function counts as steps."""
MOST_LISTED = 3
"""Most sets of effects of the catalogue that are laws of a pair."""
LIKE = 0.05
"""An effect is a function of the quantity where at most this part of it is none."""
MOST_PROOFS = 6
"""Most recent proofs that are tried on the next shapes."""
SAME_LAW = 1e-5
"""Laws whose columns, each at its own fit, differ by less are one law in other words."""
SURELY = 1.0 + 1e-6
"""Radius beyond which a moved proof refuses."""
MOST_WORK = 3e6
"""The work of all laws of a pair, after which no more are tried."""
TEMPERATURE = "(temperature-20)"
TIMES = {
    **{name: name for name in (*INPUTS, *RATES, "hours")},
    "temperature": TEMPERATURE,
    **{name: f"{wave}({angle})" for name, (wave, angle) in OF_ANGLES.items()},
}
"""How a formula writes a factor."""
SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹"
LEFT = {
    **{(f"accelerometer-{p}", ""): f"f{p}" for p in (1, 2, 3)},
    **{(gyro, ""): f"w{p}" for p, gyro in enumerate(GYROS, start=1)},
    ("outer-axis", ""): "alpha",
    ("inner-axis", ""): "beta",
    ("outer-axis", "tilt"): "kappa",
    ("base", "tilt"): "kappa",
    ("inner-axis", "tilt"): "epsilon",
}
"""What stands left in the formula of a place that acts in a way."""


@dataclass(frozen=True, eq=False)
class Law:
    """A law that makes the model fit: its fit, and the ends of its shape number, if any.

    A law of the catalogue may consist of several effects that add up to one function.
    """

    fit: Fit
    shape: tuple[float, float] | None = None

    @property
    def place(self) -> EffectPlace:
        """The effect."""
        return self.fit.places[0]

    @property
    def is_listed(self) -> bool:
        """Return true if the law is in the catalogue."""
        return all(place.effect != "formula" for place in self.fit.places)

    @property
    def words(self) -> str:
        """As `words_of` its effects."""
        return " with ".join(words_of(place) for place in self.fit.places)


@dataclass(frozen=True)
class Family:
    """Laws that differ by one number s between `low` and `high`; `text` has {s} in its place.

    `value` (x (N,), s) -> (N,) is the factor of the one coefficient.
    """

    text: str
    low: float
    high: float
    value: Callable[[NDArray, float], Floats]
    parts: tuple[tuple[float, float], ...] = ()
    """intervals within which all shapes do the same to the values that are there"""


@dataclass(frozen=True, eq=False)
class Laws:
    """The laws of the functions of a pair; `each` lists its places."""

    evidence: Evidence
    pair: Pair
    each: Sequence[Possible]
    work: Work
    proofs: dict[float, deque[Floats]] = field(
        default_factory=lambda: {sign: deque(maxlen=MOST_PROOFS) for sign in (-1.0, 1.0)}
    )
    """duals (M,) that refused shapes, for coefficients of each sign, the last first"""

    @property
    def possible(self) -> Possible:
        """The functions of the first place."""
        return self.each[0]

    def standing(self, listed: Sequence[Fit]) -> list[Law]:
        """Return the fitting laws of the catalogue, then the fitting formulas with the fewest numbers.

        The work may be used up before all of these are tried: `work.is_done` then.
        """
        listed_laws = [Law(fit) for fit in listed if self.is_one(fit)][:MOST_LISTED]
        formulas: list[Law] = []
        try:
            for size in (1, 2, 3):
                for law in self.of_size(size):
                    if not self.is_known(law, listed_laws):
                        formulas.append(law)
                if formulas:
                    break
        except CutOff:
            pass
        return [*listed_laws, *formulas]

    def is_one(self, fit: Fit) -> bool:
        """Return true if the effects of a fit are functions of the quantity at the place."""
        if self.pair.anything:
            return Listed(self.evidence).is_of(fit, self.pair)
        if any(place.where != self.pair.where for place in fit.places):
            return False
        base, columns = np.hsplit(fit.jacobian, [len(fit.point)])
        if self.pair.told:
            return bool(self._within(base, self.pair.spread(self.pair.values[:, None]), columns).all())
        # With a knot at every value, any values are a function of the quantity: few knots keep it smooth.
        few = Form("around" if self.pair.circle else "pieces", max(LEAST_AROUND, len(self.pair.values) // 2))
        smooth = self._within(base, self.pair.columns(few), columns)
        values = np.linalg.lstsq(self.possible.every.unknown.columns, columns, rcond=None)[0]
        hardly_turns = np.abs(np.diff(values, axis=0)).sum(axis=0) <= TURNS * np.ptp(values, axis=0)
        within_values = self._within(base, self.possible.every.unknown.columns, columns)
        return bool((smooth | (within_values & hardly_turns)).all())

    @staticmethod
    def _within(base: NDArray, functions: NDArray, columns: NDArray) -> Bools:
        """Return true for each column (M, k) that is nearly a function (M, K) plus a change in parameters (M, P)."""
        space = column_space(np.hstack((base, functions)))
        remaining = columns - space @ (space.T @ columns)
        return np.linalg.norm(remaining, axis=0) <= LIKE * np.linalg.norm(columns, axis=0)

    def fitted(self, places: Sequence[EffectPlace], shape: tuple[float, float] | None = None) -> list[Law]:
        """Return the effects' fit, if the model fits with them."""
        fits = self.evidence.including(places).model.mended(places, self.work)
        return [Law(fit, shape) for fit in fits[:1]]

    def is_known(self, law: Law, laws: Sequence[Law]) -> bool:
        """Return true if a law equals another, or its part at one gyro, in other words."""
        fits = [law.fit]
        for known_law in laws:
            fits += [known_law.fit, *known_law.fit.also]
        columns = [fit.jacobian[:, len(fit.point) :] for fit in fits]
        if self.pair.where in GYROS:
            single = columns[:1]
            for columns_of_law in columns[1:]:
                single += np.hsplit(columns_of_law, columns_of_law.shape[1])
            columns = single
        first, *spaces = spaces_beyond(self.evidence.rows.nominal, columns)
        return any(same_space(first, known_space, SAME_LAW) for known_space in spaces)

    def places_of(self, text: str) -> list[EffectPlace]:
        """The effect of a formula in x, the quantity (a temperature from 20 degrees), or in y, the quantity as it is.

        For several places, one effect each. None if the place or its factor has no formulas, or if the quantity is a
        sense, whose two values no formula orders.
        """
        places = [_place_of(possible.pair, text) for possible in self.each]
        known = [place for place in places if place is not None]
        return known if len(known) == len(places) else []

    def of_size(self, size: int) -> Iterator[Law]:
        """Yield the formulas with `size` unknown numbers that fit."""
        for text in formulas(self.possible.pair, size):
            if places := self.places_of(text):
                yield from self.fitted(places)
        if size != 2 or self.pair.members:
            return
        for family in families(self.pair):
            if not self.places_of(family.text.format(s=family.high)):
                continue
            for low, high in self.open_shapes(family):
                places = self.places_of(family.text.format(s=float(f"{0.5 * (low + high):.6g}")))
                if places and (laws := self.fitted(places, (low, high))):
                    yield laws[0]

    def open_shapes(self, family: Family) -> list[tuple[float, float]]:
        """Intervals of the shapes of a family, those that are next to each other as one, that are not refused."""
        open_, standing = list(family.parts or [(family.low, family.high)]), []
        stands = cache(lambda s: self.stands_at(family, s))
        while open_:
            low, high = open_.pop()
            if self.refused(family, low, high):
                continue
            fine = family.parts or high - low <= FINEST * (family.high - family.low)
            # Between two shapes that fit, the search does not look for one that does not.
            if fine or (stands(low) and stands(high)):
                standing.append((low, high))
            else:
                middle = 0.5 * (low + high)
                open_ += [(low, middle), (middle, high)]
        joined: list[tuple[float, float]] = []
        for low, high in sorted(standing):
            if joined and low <= joined[-1][1]:
                joined[-1] = (joined[-1][0], high)
            else:
                joined.append((low, high))
        return joined

    def stands_at(self, family: Family, s: float) -> bool:
        """Return true if the linear model fits with one shape."""
        evidence = self.evidence
        jacobian = np.hstack((evidence.rows.nominal, self.pair.spread(family.value(self.pair.values, s)[:, None])))
        self.work.programme(*jacobian.shape)
        return chebyshev_radius(jacobian, evidence.rows.residual, self.bound)[0] <= 1.0

    @property
    def bound(self) -> Floats:
        """Return the bounds (M,), widened by the error of the linear model and by rounding."""
        evidence = self.evidence
        return evidence.rows.bound * (1.0 + evidence.model.second_order) + evidence.model.room

    @cached_property
    def sizes(self) -> Floats:
        """Return the absolute change of the rows (M, n) per unit at each value of the quantity."""
        return np.abs(self.pair.spread(np.eye(len(self.pair.values))))

    def refused(self, family: Family, low: float, high: float) -> bool:
        """Return true if no shape between `low` and `high` makes the model fit."""
        evidence, x = self.evidence, self.pair.values
        middle = family.value(x, 0.5 * (low + high))
        # Every family is monotonous in its shape, at each value of the quantity.
        ends = () if family.parts else (low, high)
        apart = np.max([0.0 * middle, *(np.abs(family.value(x, end) - middle) for end in ends)], axis=0)
        column = self.pair.spread(middle[:, None])
        spread = (self.sizes @ apart)[:, None]
        count = evidence.rows.nominal.shape[1]
        jacobian = np.hstack((evidence.rows.nominal, column))
        largest = LARGEST / max(float(np.abs(middle).max() + apart.max()), 1e-9)
        for sign in (-1.0, 1.0):
            rows = np.zeros(jacobian.shape)
            rows[:, count:] = sign * spread
            sizes = np.full((2, count + 1), np.inf) * [[-1.0], [1.0]]
            sizes[:, count] = sorted((0.0, sign * largest))
            growth, proofs = Growth(np.zeros(len(rows)), rows, *sizes), self.proofs[sign]
            # A proof that refutes shapes nearly refutes their neighbours, too.
            self.work.add(len(proofs) * (60.0 + 0.01 * jacobian.size))
            if any(
                proven_radius(jacobian, evidence.rows.residual, self.bound, growth, proof) > SURELY for proof in proofs
            ):
                continue
            self.work.programme(*jacobian.shape)
            try:
                radius, _, duals = chebyshev_radius(jacobian, evidence.rows.residual, self.bound, growth=growth)
            except SolverError:
                return False
            if radius <= 1.0 + 1e-9:
                return False
            proofs.appendleft(duals)
        return True


def _place_of(pair: Pair, text: str) -> EffectPlace | None:
    tilted = pair.factor if pair.factor in WAYS else ""
    target = LEFT.get((pair.where, tilted))
    factor = "" if tilted else pair.factor
    if target is None or pair.told or (factor and factor not in TIMES):
        return None
    if not set(pair.quantity.split()) <= set(TARGETS[target].names):
        return None
    y = pair.quantity.replace(" ", "*")
    names = {"x": y.replace("temperature", TEMPERATURE), "y": y}
    written = re.sub(r"\b[xy]\b", lambda match: names[match[0]], text)
    return Formula.of(f"{target} += {TIMES[factor]}*({written})" if factor else f"{target} += {written}").place


def words_of(place: EffectPlace) -> str:
    """Return the name of an effect of the catalogue, or the term that a formula adds, as written on paper."""
    if place.effect != "formula":
        return place.effect if place.order is None else f"{place.effect} of order {place.order}"
    text = place.law.split("+=")[1].strip().replace(" ** ", "**").replace(" * ", "*")
    text = re.sub(r"abs\((\w+)\)", r"|\1|", text)
    return re.sub(r"\*\*(\d)\b", lambda power: SUPERSCRIPTS[int(power[1])] * (power[1] != "1"), text).replace("*", " ")


def formulas(pair: Pair, size: int) -> Iterator[str]:
    """Yield short formulas with `size` unknown coefficients; x is the quantity of a pair."""
    if pair.circle:
        yield from (f"a*cos({order}*x) + b*sin({order}*x)" for order in (ORDERS if size == 2 else ()))
    elif pair.quantity in (*INPUTS, *RATES):
        if size == 1:
            yield "c*x"
        for power in range(2, HIGHEST + 1) if size == 1 else ():
            yield f"c*x**{power}"
            yield f"c*x*abs(x)**{power - 1}" if power % 2 == 0 else f"c*abs(x)**{power}"
    else:
        powers = ("x", "x**2", "x**3")
        yield " + ".join(f"{letter}*{power}" for power, letter in zip(powers[:size], "abc", strict=False))
        yield from (f"a*{power}" for power in powers[1:] if size == 1)


def families(pair: Pair) -> Iterator[Family]:
    """Laws with one coefficient and one number that gives their shape."""
    x = pair.values
    low, high = float(x.min()), float(x.max())
    if pair.circle or pair.told or not high > low:
        return
    values = np.unique(x)
    # A deviation at a single value counts as a reading.
    gaps = tuple((float(a), float(b)) for a, b in pairwise(values[1:-1]))
    if pair.quantity in (*INPUTS, *RATES):
        end = max(-low, high)
        yield Family("c*x/sqrt(1 + (x/{s!r})**2)", SHARPEST * end, end, lambda x, s: x / np.sqrt(1.0 + (x / s) ** 2))
        # A hyperbolic tangent, but for a constant.
        half = 0.5 * end
        yield Family("c/(1 + exp(-x/{s!r}))", SHARPEST * half, half, lambda x, s: 1.0 / (1.0 + np.exp(-x / s)))
    yield Family("c*step(y - {s!r})", low, high, lambda x, s: (x > s).astype(float), gaps)
    yield Family("c*(y - {s!r})*step(y - {s!r})", low, high, lambda x, s: np.maximum(0.0, x - s))
    if pair.quantity == "hours":
        yield Family("c*exp(-x/{s!r})", high / 50.0, 2.0 * high, lambda x, s: np.exp(-x / s))
