"""Numbers with the digits that their bounds justify: two digits of the bound, and the value to the same place."""

import math
import re

from ..summaries import unit_of
from .cells import Written

_POWER = re.compile(r"(?<=\d)e\+?(−?)0*(?=\d)(\d+)")

MOST_DECIMALS = 12
NOTHING = 1e-14
"""A figure below that is rounding of doubles."""
FAR = 1e6
"""Numbers that differ from their bound by more than that, or are as large, are written with a power of ten."""


def places_of(bound: float | None) -> int:
    """Decimals with which a bound shows two digits; `MOST_DECIMALS` at most and where there is no bound."""
    if bound is None or not math.isfinite(bound) or bound == 0.0:
        return MOST_DECIMALS
    return min(max(1 - math.floor(math.log10(abs(bound))), 0), MOST_DECIMALS)


def minus(text: str) -> str:
    """A number's text with the sign of typography, and no zeros that are only there for a computer."""
    return _POWER.sub(r"e\1\2", text.replace("-", "−"))


def symbol_text(symbol: str) -> str:
    """A target's symbol with signs of typography; the name of its mounting stays as it is."""
    head, at, mounting = symbol.partition("@")
    return head.replace("-", "−") + at + mounting


def unit_text(unit: str) -> str:
    """A unit as people write it: m/s² for m/s2, nothing for 1."""
    return unit_of(unit).replace("2", "²").replace("3", "³")


def to_bound(value: float | None, bound: float | None) -> Written | None:
    """An estimate to the place of the second digit of its bound; None stays None."""
    if value is None or not math.isfinite(value):
        return None
    if bound is None or not math.isfinite(bound) or bound <= 0.0:
        return significant(value, 3)
    if abs(value) > FAR * bound:
        return significant(value, 7)
    return Written(minus(f"{value:z.{places_of(bound)}f}"))


def upwards(bound: float | None, digits: int = 2) -> Written | None:
    """A bound with two digits, rounded up: what is guaranteed stays so."""
    if bound is None or not math.isfinite(bound):
        return None
    return Written(minus(_compact(_away(abs(bound), digits, up=True), digits)))


def outwards(low: float | None, high: float | None, bound: float | None) -> tuple[Written | None, Written | None]:
    """Ends of an interval to the place of the second digit of a bound, the low one down and the high one up."""
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return None, None
    places = places_of(0.5 * (high - low) if bound is None else bound)
    scale = 10.0**places
    # An end that is a whole number of last places but for rounding stays what it is.
    ends = math.floor(low * scale + 1e-6) / scale, math.ceil(high * scale - 1e-6) / scale
    return Written(minus(f"{ends[0]:z.{places}f}")), Written(minus(f"{ends[1]:z.{places}f}"))


def significant(value: float | None, digits: int = 2) -> Written | None:
    """A figure that no bound belongs to, as a root mean square."""
    if value is None or not math.isfinite(value):
        return None
    return Written(minus(_compact(value if abs(value) > NOTHING else 0.0, digits)))


def _away(value: float, digits: int, *, up: bool) -> float:
    if value == 0.0:
        return 0.0
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    return (math.ceil(value * scale - 1e-9) if up else math.floor(value * scale + 1e-9)) / scale


def _compact(value: float, digits: int) -> str:
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -3 <= size < 6:
        return f"{value:.{max(digits - 1 - size, 0)}f}"
    return f"{value:.{digits - 1}e}"
