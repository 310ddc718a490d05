"""Numbers as text: bounds rounded up, ends of intervals outwards, estimates to nearest, so that guarantees hold.

Code that shows a number to a person - terminal, page, table, picture, message - writes it by these functions. The name
of the function states the promise of the number. JSON and tables for programs keep every digit.

Rounding is exact: a number is taken for the decimal number that JSON has of it, the shortest that is read back as the
same double. A shown number thus holds for the stored one, and 1e-5 stays 1e-5.
"""

import math
import re
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal

FIXED = range(-3, 6)
"""Powers of ten of a leading digit that are written without one: from 0.001 to 999999."""
MOST_DECIMALS = 9
"""Numbers of an interval with more decimals are written with a power of ten."""
DECADES = 0.02
"""An estimate is far smaller than half of its interval below this part of it."""
MOST_DIGITS = 17
"""Significant digits of a double: ends of an interval have no more."""
_EXACT = Context(prec=800)


class Number(str):
    """A rounded number as ASCII text; empty for None. A page sets it as a number."""

    __slots__ = ()


NONE = Number("")


class Stated(float):
    """An estimate with the interval that it is stated in: written in any format, it is not seen outside.

    A format that would show it outside, were it read again, gets more digits. Multiples keep their interval.
    """

    low: float
    high: float

    def __new__(cls, value: float, low: float, high: float) -> "Stated":
        """Join the value and its ends."""
        stated = super().__new__(cls, value)
        stated.low, stated.high = low, high
        return stated

    def __mul__(self, factor: float) -> "Stated":
        return Stated(float(self) * factor, *sorted((self.low * factor, self.high * factor)))

    __rmul__ = __mul__

    def __neg__(self) -> "Stated":
        return self * -1.0

    def __format__(self, form: str) -> str:
        text = format(float(self), form)
        if not self.low <= self <= self.high or _within(text, self.low, self.high) or "." not in form:
            return text
        longer = re.sub(r"\.(\d+)", lambda places: f".{int(places[1]) + 1}", form)
        if int(longer.partition(".")[2][:-1]) <= MOST_DIGITS:
            return format(self, longer)
        return text


def _within(text: str, low: float, high: float) -> bool:
    try:
        return low <= float(text) <= high
    except ValueError:
        return True


def upwards(value: float | None, count: int = 2) -> Number:
    """A bound: never less than the value.

    Parameters
    ----------
    value : float or None
        in the unit that is shown: converted before, not after
    count : int
        significant digits; fewer where fewer say all
    """
    return _significant(value, count, ROUND_CEILING)


def downwards(value: float | None, count: int = 2, above: float | None = None) -> Number:
    """Return a lower bound as text, rounded down; with `above`, with digits enough to show that it is exceeded."""
    text = _significant(value, count, ROUND_FLOOR)
    if value is None or above is None or not above < value < math.inf:
        return text
    if Decimal(text) > decimal(above):
        return text
    return downwards(value, count + 1, above)


def digits(value: float | None, count: int = 3) -> Number:
    """Return a figure without a guarantee, such as a root mean square, with a fixed number of digits."""
    return _significant(value, count, ROUND_HALF_EVEN)


def exactly(value: float | None, count: int = MOST_DIGITS) -> Number:
    """A number that a person has given, with all its digits and no more: 1e-5, 0.25, 30.

    `count`: most digits that count of a number that was computed from others, as a period from time stamps.
    """
    if value is None:
        return NONE
    if math.isnan(value):
        return Number("nan")
    return _significant(float(f"{value:.{count}g}"), MOST_DIGITS, ROUND_HALF_EVEN)


def residual(radius: float | None, count: int = 3) -> Number:
    """A least largest residual over its bound.

    Up to 1 it bounds the residuals of a model, and is rounded up. Above 1 it states that no parameters leave less, and
    is rounded down, with the digits that show that it is above 1.
    """
    if radius is None or radius <= 1.0:
        return upwards(radius, count)
    return downwards(radius, count, above=1.0)


def interval(
    value: float | None, low: float | None, high: float | None, bound: float | None = None
) -> tuple[Number, Number, Number]:
    """Return an estimate and the ends of its interval, all to the place of the second digit of half the width.

    The lower end is rounded down, the upper up, the estimate to nearest; an estimate within its interval is shown
    within. A positive estimate that is far smaller than that has three digits of its own. Ends may be infinite, or None
    where they are unknown: then the place is that of `bound`, and without a bound each number has three digits of
    its own.

    Parameters
    ----------
    value, low, high : float or None
    bound : float, optional
        of the estimate's error
    """
    if low is not None and high is not None and 0.0 < high - low < math.inf:
        bound = 0.5 * (high - low)
    ways = ((value, ROUND_HALF_EVEN), (low, ROUND_FLOOR), (high, ROUND_CEILING))
    finite = [decimal(number) for number, _ in ways if number is not None and math.isfinite(number)]
    largest = max(map(abs, finite), default=Decimal(0))
    if bound is None or not 0.0 < bound < math.inf:
        if low is None or high is None or low < high:
            places = 3
        else:
            places = MOST_DIGITS
        return tuple(_significant(number, places, how) for number, how in ways)  # type: ignore[return-value]
    size = 0
    if largest:
        size = largest.adjusted()
    place = max(decimal(bound).adjusted() - 1, size - MOST_DIGITS + 1)
    if (place >= -MOST_DECIMALS or size == -1) and size < FIXED.stop:
        power = 0
    else:
        power = size
    central, below, above = (_placed(number, place, power, how) for number, how in ways)
    # For a positive number known to some powers of ten, the place of the width would show nothing.
    if value is not None and low is not None and 0.0 <= low <= value and 0.0 < value < DECADES * bound:
        central = digits(value)
    return central, below, above


def outwards(low: float | None, high: float | None, bound: float | None = None) -> tuple[Number, Number]:
    """The ends of an interval, the lower one rounded down and the upper one up."""
    return interval(None, low, high, bound)[1:]


def to_bound(value: float | None, bound: float | None) -> Number:
    """An estimate to the place of the second digit of its bound; with three digits where it has none."""
    return interval(value, None, None, bound)[0]


def decimal(value: float) -> Decimal:
    """The decimal number that JSON has of a double."""
    return Decimal(repr(float(value)))


def _significant(value: float | None, count: int, how: str) -> Number:
    if value is None or math.isnan(value):
        return NONE
    if math.isinf(value):
        return Number("inf" if value > 0.0 else "-inf")
    number = decimal(value)
    if not number:
        return Number("0")
    rounded = number
    # Rounding may come to the next power of ten, which has one place less.
    for _ in range(2):
        size = rounded.adjusted()
        place = size - count + 1
        if size in FIXED:
            kept_place = min(place, 0)
        else:
            kept_place = place
        rounded = _quantised(rounded, kept_place, how)
    if rounded == number:
        rounded = rounded.normalize(_EXACT)
    size = rounded.adjusted()
    return Number(f"{rounded:f}" if size in FIXED else f"{rounded.scaleb(-size, _EXACT):f}e{size}")


def _placed(value: float | None, place: int, power: int, how: str) -> Number:
    """A number rounded at the power of ten `place` and written in units of 10**power."""
    if value is None or not math.isfinite(value):
        return _significant(value, 1, how)
    if power:
        rounded_place = place
    else:
        rounded_place = min(place, 0)
    rounded = _quantised(decimal(value), rounded_place, how)
    if not rounded:
        rounded = abs(rounded)
    return Number(f"{rounded.scaleb(-power, _EXACT):f}{f'e{power}' if power and rounded else ''}")


def _quantised(number: Decimal, place: int, how: str) -> Decimal:
    return number.quantize(Decimal(1).scaleb(place), rounding=how, context=_EXACT)
