"""A place and a quantity: the effect of an unknown function of the quantity, acting at the place, on the rows.

A function is written in one of several forms with few coefficients. Beside the model a form costs its coefficients, and
one more for each searched number, the time of a jump or the order of a harmonic.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ...models.effects.definition import GYRO_BLOCK
from ...models.effects.lookup import OF_ANGLES, TILTS, TURNS, WAYS

TURN = 2.0 * math.pi
Spread = Callable[[Floats], Floats]
"""Functions (n, K) of a quantity on the rows (M, K) of evidence."""
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Equal pieces of a function that is straight within each."""
LEAST_AROUND = 3
WAVES = tuple(0.25 * k for k in range(3, 97))
"""Waves over the whole range of a quantity that a function may have, each by itself."""
POWERS, HARMONICS, ORDERS = 20, 8, 12
"""The highest power, the highest harmonic beside all lower ones, and the highest one alone."""
QUANTITIES = {
    "n1": "the input of accelerometer 1",
    "n2": "the input of accelerometer 2",
    "n3": "the input of accelerometer 3",
    "alpha": "the outer angle",
    "beta": "the inner angle",
    "hours": "time",
    "temperature": "temperature",
    "sense": "the sense of approach",
    "w1": "the rate about axis 1",
    "w2": "the rate about axis 2",
    "w3": "the rate about axis 3",
    "dw1": "the angular acceleration about axis 1",
    "dw2": "the angular acceleration about axis 2",
    "dw3": "the angular acceleration about axis 3",
    "rate": "each gyro's own rate",
    "acceleration": "each gyro's own angular acceleration",
    "force": "the specific force along each gyro",
}
"""Quantities in words; of two of them the product counts."""


@dataclass(frozen=True)
class Form:
    """A way to write functions of one quantity: `kind` with a number of pieces, powers, orders, or where it jumps.

    `kind` is "pieces", "powers", "around" (pieces of a circle, from `at` on), "harmonics" (all up to an order),
    "harmonic" (one) or "jump". Others are "sawtooth" (of a circle, straight but for one jump), "wave" (one, `at` times
    over the range), "while" (another value from `at` to `until`) and "values". `searched` numbers are found beside the
    coefficients.
    """

    kind: str
    count: int = 1
    at: float = 0.0
    until: float = 0.0

    @property
    def searched(self) -> int:
        """Number of searched values beside the coefficients."""
        return {"jump": 1, "sawtooth": 1, "harmonic": 1, "wave": 1, "while": 2}.get(self.kind, 0)

    @property
    def coefficients(self) -> int:
        """Number of functions that the form consists of."""
        if self.kind in ("pieces", "powers"):
            return self.count + 1
        if self.kind == "around":
            return self.count
        if self.kind == "harmonics":
            return 2 * self.count
        if self.kind in ("harmonic", "wave"):
            return 2
        return 1

    def knots(self, values: NDArray) -> Floats:
        """Return the knots between the pieces of a function of the values (n,)."""
        if self.kind == "around":
            return (self.at + TURN * np.arange(self.count) / self.count) % TURN
        return np.linspace(values.min(), values.max(), self.count + 1)

    def columns(self, values: NDArray) -> Floats:
        """The functions (n, K) at values (n,) of the quantity."""
        if self.kind == "jump":
            return (values > self.at).astype(float)[:, None]
        if self.kind == "while":
            return ((values >= self.at) & (values <= self.until)).astype(float)[:, None]
        if self.kind == "sawtooth":
            return (((values - self.at) / TURN) % 1.0 - 0.5)[:, None]
        if self.kind == "harmonic":
            return np.stack([np.cos(self.count * values), np.sin(self.count * values)], axis=1)
        if self.kind == "harmonics":
            waves = []
            for order in range(1, self.count + 1):
                waves += [np.cos(order * values), np.sin(order * values)]
            return np.stack(waves, axis=1)
        if self.kind == "around":
            steps = ((values - self.at) / TURN * self.count) % self.count
            apart = np.abs(steps[:, None] - np.arange(self.count))
            return np.maximum(0.0, 1.0 - np.minimum(apart, self.count - apart))
        if self.kind == "values":
            return values[:, None]
        part = (values - values.min()) / np.ptp(values)
        if self.kind == "wave":
            return np.stack([np.cos(TURN * self.at * part), np.sin(TURN * self.at * part)], axis=1)
        if self.kind == "powers":
            return np.polynomial.legendre.legvander(2.0 * part - 1.0, self.count)
        return np.maximum(0.0, 1.0 - np.abs(self.count * part[:, None] - np.arange(self.count + 1)))


@dataclass(frozen=True, eq=False)
class Pair:
    """An unknown function of one quantity at one place, times a known factor.

    `values` (n,) are those of the quantity where the function is taken; `spread` maps functions (n, K) of it to the
    rows (M, K) of the evidence. `freedom` names the way in which a place acts: all pairs of one freedom are special
    cases of a place that acts freely every time. `circle`: the quantity is an angle. `told`: it has few values, and the
    function is a multiple of these. `waves`: it has enough values to search for a wave. `moves`: intervals in which the
    block was moved once, each by itself. `anything`: a place that acted freely could do anything to the rows. `members`
    are pairs of several places with a function each; then the values and the spread are those of the first. `missed`:
    knots (k,) -> the largest differences of rows (M,) for a function that is not straight between them, and whose slope
    changes by one in all. It is None where only the values act.
    """

    where: str
    quantity: str
    values: Floats
    spread: Spread
    freedom: str
    factor: str = ""
    circle: bool = False
    told: bool = False
    waves: bool = False
    moves: tuple[tuple[float, float], ...] = ()
    anything: bool = False
    members: tuple["Pair", ...] = ()
    missed: Spread | None = None

    @property
    def depends_on(self) -> frozenset[str]:
        """All quantities that it depends on."""
        return frozenset(word for word in f"{self.quantity} {self.factor}".split() if word in QUANTITIES)

    def is_named_as(self, pair: "Pair") -> bool:
        """Return whether another pair has the same place and quantity, for any values."""
        own = (self.where, self.quantity, self.factor, self.freedom)
        return own == (pair.where, pair.quantity, pair.factor, pair.freedom)

    def table(self, law: str) -> EffectPlace:
        """A table of its quantity at its place."""
        if self.where in GYROS:
            return EffectPlace("lookup", GYRO_BLOCK, axes=(GYROS.index(self.where) + 1,), law=law)
        return EffectPlace("lookup", self.where, law=law)

    @property
    def name(self) -> str:
        """Quantity and factor as a law begins with them."""
        return named(self.quantity, self.factor)

    @property
    def in_words(self) -> str:
        """Place and quantity in words."""
        return function_in_words(self.where, self.quantity, self.factor)

    def columns(self, form: Form) -> Floats:
        """Return the columns (M, K) of the functions of a form."""
        return self.columns_of([form])[0]

    def size(self, form: Form) -> int:
        """Return the number of coefficients of the functions of a form."""
        return form.coefficients * max(1, len(self.members))

    def columns_of(self, forms: Sequence[Form]) -> list[Floats]:
        """Return the columns of several forms, as `columns` does of one."""
        if self.members:
            of_members = [member.columns_of(forms) for member in self.members]
            return [np.hstack(of_form) for of_form in zip(*of_members, strict=True)]
        functions = [form.columns(self.values) for form in forms]
        ends = np.cumsum([form.coefficients for form in forms])[:-1]
        return np.split(self.spread(np.hstack(functions)), ends, axis=1)

    def ladders(self) -> Iterator[tuple[Form, ...]]:
        """Forms of the same kind, ever more complex; the last ones contain all others."""
        if self.told:
            yield (Form("values"),)
        elif self.circle:
            for half in (0.0, 0.5):
                yield tuple(Form("around", k, half * TURN / k) for k in PIECES if k >= LEAST_AROUND)
            yield tuple(Form("harmonics", order) for order in range(1, HARMONICS + 1))
        elif np.ptp(self.values) > 0.0:
            yield tuple(Form("pieces", k) for k in PIECES)
            yield tuple(Form("powers", k) for k in range(1, POWERS + 1))

    def single(self) -> Iterator[Form]:
        """Yield the forms with a searched number: a jump at every gap, a harmonic of every order."""
        if self.told:
            return
        if self.circle:
            for order in range(1, ORDERS + 1):
                yield Form("harmonic", order)
            values = np.unique(self.values % TURN)
            values = np.append(values, values[0] + TURN)
            for gap in 0.5 * (values[1:] + values[:-1]):
                yield Form("sawtooth", at=float(gap % TURN))
            return
        values = np.unique(self.values)
        gaps = 0.5 * (values[1:] + values[:-1])
        # A jump between the last two values affects one reading only.
        for gap in gaps[1:-1]:
            yield Form("jump", at=float(gap))
        if self.waves:
            for wave in WAVES:
                yield Form("wave", at=wave)
        for begin, end in self.moves:
            yield Form("while", at=begin, until=end)


GYROS = ("gyro-1", "gyro-2", "gyro-3")
SINES = {"sin": "sine", "cos": "cosine"}
FACTORS = {
    **{name: f"the {SINES[wave]} of {QUANTITIES[angle]}" for name, (wave, angle) in OF_ANGLES.items()},
    **dict.fromkeys((*WAYS, ""), ""),
}
"""Names of places that are no quantities; a tilt or a turn is a way to act, no factor."""


def in_words(name: str) -> str:
    """Return a quantity, a product of two, or a factor in words; empty for any other name."""
    if name in FACTORS:
        return FACTORS[name]
    words = [QUANTITIES[word] for word in name.split()]
    return words[0] if len(words) == 1 else f"the product of {' and '.join(words)}"


def named(quantity: str, factor: str | None) -> str:
    """A quantity with its factor as a law begins with them."""
    return f"{factor} times {quantity}" if factor else quantity


def function_in_words(where: str, quantity: str, factor: str | None) -> str:
    """Place, quantity and factor in words: "a function of the outer angle at the outer axis"."""
    function, place = "a function", where.replace("-", " ")
    if factor_words := in_words(factor or ""):
        function = f"{factor_words} times a function"
    function += f" of {in_words(quantity)}"
    if factor in TILTS:
        function += ", as a tilt,"
    if factor in TURNS:
        function += f", as a turn of the block about its axis {factor[-1]},"
    if not where[-1].isdigit():
        place = f"the {place}"
    return f"{function} at {place}"
