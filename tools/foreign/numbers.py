"""Numbers, angles, dates and times of day as laboratories write them, and the marks that they prove.

"1,234" may be about one or about a thousand, "01.02.2026" February or January. Each text counts only as proof, never as
a probability.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import date, datetime

MISSING = frozenset(
    ("", "n/a", "#n/a", "n.a.", "na", "nan", "#nv", "#na", "k.a.", "null", "none", "-", "--", "---", "–", "—", "...")
)
"""Texts of a cell without a measurement, in lower case."""
BLANKS = "\u00a0\u2009\u202f '’"
"""Marks that can only separate groups of three digits."""

_NUMERIC = re.compile(rf"[+-]?[\d.,{BLANKS}]*\d[\d.,{BLANKS}]*(?:[eE][+-]?\d+)?")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?", re.ASCII)
_HEXADECIMAL = re.compile(r"0[xX][\dA-Fa-f]{1,8}")
_DEGREES = re.compile(
    r"(?P<sign>[+-]?)\s*(?P<deg>\d+)\s*[°º:\sd]\s*(?P<min>\d+(?:[.,]\d+)?)"
    r"(?:\s*['′’:\sm]\s*(?:(?P<sec>\d+(?:[.,]\d+)?)\s*(?:[\"″”s]|''|′′|’’)?)?)?"
)
_UNIT_BEHIND = re.compile(r"(?<=[\d.,])\s*(?![eE][+-]?\d)[^\W\d_]*°?[^\W\d_]{0,5}(?:/[^\s\d]{1,5}[²2]?|°)?$")
_CLOCK = re.compile(r"(\d{1,3}):(\d{1,2})(?::(\d{1,2}(?:[.,:]\d*)?))?\s*(am|pm)?", re.IGNORECASE)
_DAYS = re.compile(r"^(\d{1,5}) days? (?=\d+:)")
_ZONE = re.compile(r"(?<=\d) ?(?:Z|(?P<sign>[+-])(?P<hours>\d\d):?(?P<minutes>\d\d))$")
_MINUTES = re.compile(r"(\d{1,3}):(\d{1,2}[.,]\d+)")
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2})\2(\d{1,4})")
_NAMED = re.compile(r"(\d{1,2})[. -]+([^\W\d_]{3,9})[. -]+(\d{4}|\d{2})|([^\W\d_]{3,9})[. ]+(\d{1,2}),? (\d{4})")
_WEEKDAY = re.compile(r"^(?:mon|tue|wed|thu|fri|sat|sun|mo|di|mi|do|fr|sa|so)[a-z]{0,7}\.?,? +(?=\w)", re.IGNORECASE)
_COMPACT = re.compile(r"(\d{4})(\d\d)(\d\d)[T ](\d\d)(\d\d)(\d\d(?:[.,]\d+)?)")
_POINTS = re.compile(r"(?<=\dT)(\d\d)\.(\d\d)\.(\d\d)(?=\.|$)")
_YEAR_LAST = re.compile(r"([^\W\d_]{3,9}) +(\d{1,2}) +(\S+:\S+) +(\d{4})")
_BEFORE_CLOCK = re.compile(r"(?<=\d)[T\s,;]+(?=\d+:)")
MONTHS = ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez")
ORDERS = {"day-first": (2, 1, 0), "month-first": (2, 0, 1), "year-first": (0, 1, 2)}
"""Indices of year, month and day in a date of three numbers."""


class Typed(str):
    """The text of a number from a numeric cell of a workbook: its marks are certain."""


def is_missing(text: str, also: Iterable[str] = ()) -> bool:
    """Return True if a cell marks a missing measurement; `also`: further texts with this meaning."""
    if text[:1].isdigit() and not also:
        return False
    return text.strip().casefold() in MISSING or text.strip() in also


@dataclass
class Marks:
    """Decimal marks and marks between thousands that the numbers of a file prove, each with a cell as proof."""

    decimal: dict[str, str] = field(default_factory=dict)
    thousands: dict[str, str] = field(default_factory=dict)
    doubtful: dict[str, str] = field(default_factory=dict)

    def see(self, text: str) -> None:
        """Take the evidence of a cell."""
        if isinstance(text, Typed):
            return
        text = text.strip().replace("−", "-")
        if not _NUMERIC.fullmatch(text):
            return
        digits, exponent, _ = re.split(r"([eE].*|$)", text.lstrip("+-"), maxsplit=1)
        points = re.findall(r"[.,]", digits)
        if len(set(points)) == 2:
            if points.count(points[-1]) == 1:
                self.decimal.setdefault(points[-1], text)
                self.thousands.setdefault(points[0], text)
        elif len(points) > 1:
            self.thousands.setdefault(points[0], text)
        elif points:
            before, _, after = digits.partition(points[0])
            grouped = 1 <= len(before) <= 3 and before[0] != "0" and len(after) == 3 and not exponent
            if grouped and before.isdigit():
                proof = self.doubtful
            else:
                proof = self.decimal
            proof.setdefault(points[0], text)


def parsed_number(text: str, decimal: str = ".", thousands: str = "") -> float | None:
    """Return a finite number; None if the text is not a number.

    Ignores blanks, apostrophes and `thousands` between groups of three digits.
    """
    if isinstance(text, Typed):
        return float(text)
    plain = _with_point(text, decimal)
    if _PLAIN.fullmatch(plain):
        return float(plain)
    if _HEXADECIMAL.fullmatch(text.strip()):
        return float(int(text, 16))
    text = re.sub(r"^([+-]) (?=[\d.,])", r"\1", text.strip().replace("−", "-"))
    # Fortran's exponents
    text = re.sub(r"(?<=[\d.,])[dD](?=[+-]?\d{1,3}$)", "e", text)
    between = BLANKS + thousands
    if any(mark in text for mark in between):
        integer, mark, fraction = text.partition(decimal)
        if not re.fullmatch(rf"[+-]?(?:\d*|[1-9]\d{{0,2}}(?:([{re.escape(between)}])\d{{3}}(?:\1\d{{3}})*))", integer):
            return None
        text = re.sub(f"[{re.escape(between)}]", "", integer) + mark + fraction
    text = _with_point(text, decimal)
    if not _PLAIN.fullmatch(text):
        return None
    value = float(text)
    if math.isfinite(value):
        return value
    return None


def _with_point(text: str, decimal: str) -> str:
    """Return a number with a decimal point; "" if it has a point that is not a decimal mark."""
    if decimal == ".":
        return text
    if "." in text:
        return ""
    return text.replace(decimal, ".")


def numbers_of(texts: list[str], decimal: str) -> list[float] | None:
    """Convert texts that are all plain numbers; return None if any may not be."""
    if not set("".join(texts)) <= set("0123456789+-eE " + decimal):
        return None
    try:
        values = [float(text.replace(decimal, ".")) for text in texts]
    except ValueError:
        return None
    if all(map(math.isfinite, values)):
        return values
    return None


def sexagesimal(text: str) -> float | None:
    """Return the degrees of 12°34'56", 12:34:56 or 12 34.5; None for any other text."""
    angle = _DEGREES.fullmatch(text.strip().replace("−", "-"))
    if angle is None:
        return None
    minutes, seconds = float(angle["min"].replace(",", ".")), float((angle["sec"] or "0").replace(",", "."))
    if minutes >= 60.0 or seconds >= 60.0 or (angle["sec"] and not minutes.is_integer()):
        return None
    value = float(angle["deg"]) + minutes / 60.0 + seconds / 3600.0
    if angle["sign"] == "-":
        return -value
    return value


def bare(text: str) -> str:
    """Return a cell without the unit behind its number: "9,81" of "9,81 m/s²"."""
    if isinstance(text, Typed) or _HEXADECIMAL.fullmatch(text.strip()):
        return text
    return _UNIT_BEHIND.sub("", text.strip())


def unit_behind(text: str) -> str:
    """Return the unit behind a cell's number; "" if there is none."""
    if isinstance(text, Typed):
        return ""
    return text.strip().removeprefix(bare(text)).strip()


BITS = (16, 24, 32)


def bits_of_signed(values: Iterable[float]) -> int:
    """Return the bits of signed counts written as unsigned: all near 0 or near 2^bits; 0 otherwise."""
    counts = list(values)
    if not counts or min(counts) < 0.0 or not all(value.is_integer() for value in counts):
        return 0
    for bits in BITS:
        size = 2.0**bits
        if max(counts) >= size:
            continue
        ends = min(counts) < 0.25 * size and max(counts) >= 0.75 * size
        between = any(0.375 * size <= value < 0.625 * size for value in counts)
        return bits if ends and not between else 0
    return 0


def has_degree_mark(text: str) -> bool:
    """Return True if an angle certainly has degrees and minutes."""
    return ("°" in text or "º" in text) and sexagesimal(text) is not None


def clock(text: str, form: str = "") -> float | None:
    """Return the seconds of a time of day, "10:15:30,5 pm"; `form`, h:m or m:s, defines a time of two parts."""
    text = text.strip()
    after = _DAYS.match(text)
    if after:
        since = clock(text[after.end() :], form)
        return None if since is None else int(after[1]) * 86400.0 + since
    short, time = _MINUTES.fullmatch(text), _CLOCK.fullmatch(text)
    if short:
        # only seconds have decimals
        return _seconds("0", short[1], short[2], most=1000)
    if time is None:
        return None
    first, second, third, half = time.groups()
    if third is None:
        if form == "m:s":
            return _seconds("0", first, second, most=1000)
        if form != "h:m" and not half:
            return None
    if half:
        if not 1 <= int(first) <= 12:
            return None
        first = str(int(first) % 12 + 12 * (half.lower() == "pm"))
    return _seconds(first, second, third or "0", most=60)


def _seconds(hours: str, minutes: str, seconds: str, most: int) -> float | None:
    """Return the seconds of hours, minutes below `most`, and seconds below 60; None if these are more."""
    last = float(seconds.replace(",", ".").replace(":", "."))
    if int(minutes) >= most or last >= 60.0:
        return None
    return int(hours) * 3600.0 + int(minutes) * 60.0 + last


def is_clock(text: str) -> bool:
    """Return True if a text has the form of a time of day."""
    text = _DAYS.sub("", text.strip(), count=1)
    return _CLOCK.fullmatch(text) is not None or _MINUTES.fullmatch(text) is not None


def two_parts(text: str) -> bool:
    """Return True if a time of day has two parts that may be h:m or m:s."""
    time = _CLOCK.fullmatch(text.strip())
    return time is not None and time[3] is None and not time[4]


def day(text: str, order: str) -> date | None:
    """Return the day of a date; one of three numbers has the given order unless its numbers prove another."""
    text = text.strip()
    with_month = _NAMED.fullmatch(text)
    if with_month:
        name = (with_month[2] or with_month[4])[:3].casefold()
        month = next((k for k, names in enumerate(MONTHS, 1) if name in names.split()), 0)
        return _date(with_month[3] or with_month[6], month, with_month[1] or with_month[5])
    numbers = _DATE.fullmatch(text)
    if numbers is None:
        return None
    parts = (numbers[1], numbers[3], numbers[4])
    if len(parts[0]) == 4:
        order = "year-first"
    elif len(parts[2]) == 4 and order == "year-first":
        return None
    year, month, on = ORDERS[order]
    return _date(parts[year], int(parts[month]), parts[on])


def _date(year: str, month: int, on: str) -> date | None:
    """Return a day from a year of two or four digits; None if there is no such day."""
    century = 0
    if len(year) <= 2:
        century = 2000
    try:
        return date(int(year) + century, month, int(on))
    except ValueError:
        return None


def date_orders(texts: Iterable[str]) -> list[str]:
    """Return the orders of day, month and year in which all texts are dates."""
    orders = list(ORDERS)
    for text in texts:
        orders = [order for order in orders if day(text, order) is not None]
    return orders


def _spelled(text: str) -> str:
    """Return a date and time without a weekday, the date first, with marks between their parts."""
    text = _WEEKDAY.sub("", text.strip(), count=1)
    text = _POINTS.sub(r"\1:\2:\3", text)
    text = _YEAR_LAST.sub(r"\2 \1 \4 \3", text)
    return _COMPACT.sub(r"\1-\2-\3 \4:\5:\6", text)


def moment(text: str, order: str, form: str = "") -> tuple[int, float] | None:
    """Return the days since the start of 2020 and the seconds of the day (UTC if a zone is written) of a date, or of a
    date and time in one cell; None for any other text."""
    text = _spelled(text)
    zone = _ZONE.search(text)
    if zone is not None and ":" in text[: zone.start()]:
        text = text[: zone.start()]
        if zone["hours"]:
            shift = int(zone["hours"]) * 3600.0 + int(zone["minutes"]) * 60.0
        else:
            shift = 0.0
        if zone["sign"] == "-":
            shift = -shift
    else:
        shift = 0.0
    on, seconds = day(text, order), 0.0
    if on is None and ("T" in text or " " in text):
        parts = _BEFORE_CLOCK.split(text, maxsplit=1)
        if len(parts) == 2:
            on, seconds = day(parts[0], order), clock(parts[1], form)
    if on is None or seconds is None:
        try:
            on = datetime.fromisoformat(text)
        except ValueError:
            return None
        seconds = on.hour * 3600.0 + on.minute * 60.0 + on.second + on.microsecond * 1e-6
    return on.toordinal() - date(2020, 1, 1).toordinal(), seconds - shift


def parsed_moment(text: str, order: str) -> float | None:
    """Return the seconds since the start of 2020 for a date, or a date and time in one cell; None for any other
    text."""
    at = moment(text, order)
    return None if at is None else at[0] * 86400.0 + at[1]


def date_of(text: str) -> str | None:
    """Return the part of a cell that is a date of three numbers or with a month's name; None if there is none."""
    first = _BEFORE_CLOCK.split(_spelled(text), maxsplit=1)[0]
    if any(day(first, order) is not None for order in ORDERS):
        return first
    return None
