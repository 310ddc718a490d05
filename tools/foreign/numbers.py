"""Numbers, angles, dates, times of day and units as laboratories write them, and the marks that they prove.

"1,234" may be about one or about a thousand, "01.02.2026" February or January. Each text counts only as proof, never as
a probability.

A unit is a quantity and a linear conversion: value in the record = factor × number + offset. Output of a converter
(volts, counts) needs a sensitivity, such as "16384 LSB/g" or "0.5 g/V".
"""

import math
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime

from ...fmus.units import STANDARD_GRAVITY

MISSING = frozenset(
    ("", "n/a", "#n/a", "n.a.", "na", "nan", "#nv", "#na", "k.a.", "null", "none", "-", "--", "---", "–", "—", "...")
)
"""Texts of a cell without a measurement, in lower case."""
BLANKS = "\u00a0\u2009\u202f '’"
"""Marks that can only separate groups of three digits."""

_NUMERIC = re.compile(rf"[+-]?[\d.,{BLANKS}]*\d[\d.,{BLANKS}]*(?:[eE][+-]?\d+)?")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?", re.ASCII)
_DEGREES = re.compile(
    r"(?P<sign>[+-]?)\s*(?P<deg>\d+)\s*[°º:\sd]\s*(?P<min>\d+(?:[.,]\d+)?)"
    r"(?:\s*['′’:\sm]\s*(?:(?P<sec>\d+(?:[.,]\d+)?)\s*(?:[\"″”s]|''|′′|’’)?)?)?"
)
_UNIT_BEHIND = re.compile(r"(?<=[\d.,])\s*(?![eE][+-]?\d)[^\W\d_]*°?[^\W\d_]{0,5}(?:/[^\s\d]{1,5}[²2]?|°)?$")
_CLOCK = re.compile(r"(\d{1,3}):(\d{1,2})(?::(\d{1,2}(?:[.,:]\d*)?))?\s*(am|pm)?", re.IGNORECASE)
_MINUTES = re.compile(r"(\d{1,3}):(\d{1,2}[.,]\d+)")
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2})\2(\d{1,4})")
_NAMED = re.compile(r"(\d{1,2})[. -]+([^\W\d_]{3,9})[. -]+(\d{4}|\d{2})|([^\W\d_]{3,9})[. ]+(\d{1,2}),? (\d{4})")
_WEEKDAY = re.compile(r"^(?:mon|tue|wed|thu|fri|sat|sun|mo|di|mi|do|fr|sa|so)[a-z]{0,7}\.?,? +(?=\w)", re.IGNORECASE)
_COMPACT = re.compile(r"(\d{4})(\d\d)(\d\d)[T ](\d\d)(\d\d)(\d\d(?:[.,]\d+)?)")
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
    if isinstance(text, Typed):
        return text
    return _UNIT_BEHIND.sub("", text.strip())


def unit_behind(text: str) -> str:
    """Return the unit behind a cell's number; "" if there is none."""
    if isinstance(text, Typed):
        return ""
    return text.strip().removeprefix(bare(text)).strip()


SENSES = {"CW": "CCW", "E": "W", "N": "S", "L": "R"}
"""Marks behind numbers for the sense in which they count, each with its opposite."""
OPPOSITE = SENSES | {second: first for first, second in SENSES.items()}


def sense_behind(text: str, quantity: str = "") -> str:
    """Return the sense behind a cell's number, CW or W; "" if there is none, or if it is a unit of the quantity."""
    mark = unit_behind(text)
    unit = known_unit(mark)
    if unit is not None and unit.quantity == quantity:
        return ""
    mark = mark.upper()
    if mark in OPPOSITE:
        return mark
    return ""


def is_unknown_behind(text: str) -> bool:
    """Return True if the text behind a cell's number is neither a unit nor a sense."""
    mark = unit_behind(text)
    if not mark or mark.upper() in OPPOSITE or spelled_unit(mark).lower() in DOUBTFUL:
        return False
    return known_unit(mark) is None


def is_rate(text: str) -> bool:
    """Return True if a text is a rate, such as 100 Hz or 2 kHz."""
    return re.fullmatch(r"\d[\d.]*(e[+-]?\d+)?[km]?hz", spelled_unit(text), re.IGNORECASE) is not None


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
    return _CLOCK.fullmatch(text.strip()) is not None or _MINUTES.fullmatch(text.strip()) is not None


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
    text = _YEAR_LAST.sub(r"\2 \1 \4 \3", text)
    return _COMPACT.sub(r"\1-\2-\3 \4:\5:\6", text)


def parsed_moment(text: str, order: str, form: str = "") -> float | None:
    """Return the seconds since the start of 2020 for a date, or a date and time in one cell; None for any other
    text."""
    text = _spelled(text)
    on, seconds = day(text, order), 0.0
    if on is None and ("T" in text or " " in text):
        parts = _BEFORE_CLOCK.split(text.rstrip("Z"), maxsplit=1)
        if len(parts) == 2:
            on, seconds = day(parts[0], order), clock(parts[1], form)
    if on is None or seconds is None:
        try:
            instant = datetime.fromisoformat(text)
        except ValueError:
            return None
        if instant.tzinfo is not None:
            instant = instant.astimezone(UTC)
        on = instant
        seconds = instant.hour * 3600.0 + instant.minute * 60.0 + instant.second + instant.microsecond * 1e-6
    # few enough digits for microseconds
    return (on.toordinal() - date(2020, 1, 1).toordinal()) * 86400.0 + seconds


def date_of(text: str) -> str | None:
    """Return the part of a cell that is a date of three numbers or with a month's name; None if there is none."""
    first = _BEFORE_CLOCK.split(_spelled(text), maxsplit=1)[0]
    if any(day(first, order) is not None for order in ORDERS):
        return first
    return None


FORCE, RATE, ANGLE, VELOCITY, TIME, TEMPERATURE = "force", "rate", "angle", "velocity", "time", "temperature"
VOLTAGE, COUNTS = "voltage", "counts"
QUANTITIES = (FORCE, RATE, ANGLE, VELOCITY, TIME, TEMPERATURE)
"""Quantities for which a mapping has units."""
DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class LaboratoryUnit:
    """Conversion of a number in a file to a record: force m/s², rate rad/s, angle degrees, velocity m/s, time s, °C.

    `per` is the unit in which a sensitivity counts, volts or counts, with its size.
    """

    quantity: str
    factor: float
    offset: float = 0.0
    per: "LaboratoryUnit | None" = None

    @property
    def raw(self) -> bool:
        """True for the output of a converter, which needs a sensitivity."""
        return self.quantity in (VOLTAGE, COUNTS)


_NAMES = {
    LaboratoryUnit(FORCE, 1.0): "m/s2 ms-2 mps2 m/s/s m/sec2 ms2 m/ss mss м/с2",
    LaboratoryUnit(FORCE, STANDARD_GRAVITY): "g G g0 gn gs",
    LaboratoryUnit(FORCE, 1e-3 * STANDARD_GRAVITY): "mg mG milli-g",
    LaboratoryUnit(FORCE, 1e-6 * STANDARD_GRAVITY): "ug uG",
    LaboratoryUnit(FORCE, 1e-2): "cm/s2 Gal",
    LaboratoryUnit(FORCE, 1e-3): "mm/s2",
    LaboratoryUnit(FORCE, 1e-5): "mGal",
    LaboratoryUnit(FORCE, 0.3048): "ft/s2",
    LaboratoryUnit(RATE, 1.0): "rad/s radps rad/sec rads-1 рад/с",
    LaboratoryUnit(RATE, 1e-3): "mrad/s",
    LaboratoryUnit(RATE, DEGREE): "deg/s degps dps degs-1 deg/sec град/с",
    LaboratoryUnit(RATE, 1e-3 * DEGREE): "mdps mdeg/s",
    LaboratoryUnit(RATE, DEGREE / 3600.0): "deg/h deg/hr degh-1 dph град/ч",
    LaboratoryUnit(RATE, 2.0 * math.pi / 60.0): "rpm",
    LaboratoryUnit(ANGLE, 1.0): "deg degree degrees град",
    LaboratoryUnit(ANGLE, 1.0 / DEGREE): "rad radian radians рад",
    LaboratoryUnit(ANGLE, 1e-3 / DEGREE): "mrad",
    LaboratoryUnit(ANGLE, 1e-6 / DEGREE): "urad",
    LaboratoryUnit(ANGLE, 1.0 / 60.0): "arcmin ' ′",
    LaboratoryUnit(ANGLE, 1.0 / 3600.0): "arcsec \" ″ ''",
    LaboratoryUnit(ANGLE, 0.9): "gon",
    LaboratoryUnit(ANGLE, 360.0): "turn turns rev",
    LaboratoryUnit(VELOCITY, 1.0): "m/s ms-1 mps м/с",
    LaboratoryUnit(VELOCITY, 1e-3): "mm/s",
    LaboratoryUnit(VELOCITY, 1e-2): "cm/s",
    LaboratoryUnit(VELOCITY, 0.3048): "ft/s",
    LaboratoryUnit(TIME, 1.0): "s sec second seconds sek sekunden с",
    LaboratoryUnit(TIME, 1e-3): "ms msec мс",
    LaboratoryUnit(TIME, 1e-6): "us usec мкс",
    LaboratoryUnit(TIME, 1e-9): "ns",
    LaboratoryUnit(TIME, 60.0): "min minutes minuten мин",
    LaboratoryUnit(TIME, 3600.0): "h hr hours ч",
    LaboratoryUnit(TIME, 86400.0): "d day days",
    LaboratoryUnit(VOLTAGE, 1.0): "V volt volts В",
    LaboratoryUnit(VOLTAGE, 1e-3): "mV мВ",
    LaboratoryUnit(VOLTAGE, 1e-6): "uV",
    LaboratoryUnit(COUNTS, 1.0): "LSB lsb counts count cnt cts digit digits raw inc adc",
    LaboratoryUnit(TEMPERATURE, 1.0): "degC C celsius degcelsius",
    LaboratoryUnit(TEMPERATURE, 1.0, -273.15): "K kelvin",
    LaboratoryUnit(TEMPERATURE, 5.0 / 9.0, -160.0 / 9.0): "degF F fahrenheit",
}
KNOWN: dict[str, LaboratoryUnit] = {}
"""Name of a unit -> the unit."""
for _unit, _names in _NAMES.items():
    KNOWN |= dict.fromkeys(_names.split(), _unit)
DOUBTFUL = {"grad": ("deg", "gon"), "grad/s": ("deg/s",)}
"""Words with different meanings in different languages, and the units that they may mean."""
EXAMPLES = {
    FORCE: ("g", "m/s2", "mg", "ug"),
    RATE: ("deg/s", "rad/s", "deg/h"),
    ANGLE: ("deg", "rad", "arcmin"),
    VELOCITY: ("m/s", "mm/s", "ft/s"),
    TIME: ("s", "ms", "us", "min", "h"),
    TEMPERATURE: ("degC", "degF", "K"),
}
_FOLDED = {name.lower(): name for name in reversed(KNOWN)}
_SPLIT = re.compile(r"^(?P<number>[+]?\d[\d.]*(?:e[+-]?\d+)?(?:/\d[\d.]*)?)?[*x]?(?P<unit>.*)$", re.IGNORECASE)


def spelled_unit(text: str) -> str:
    """Return a unit's text in one spelling: µ as u, ° as deg, no blanks, brackets or signs of powers."""
    text = unicodedata.normalize("NFKC", text.strip())
    for old, new in (("μ", "u"), ("°", "deg"), ("º", "deg"), ("−", "-"), ("·", ""), ("⋅", ""), ("^", ""), ("*", "")):
        text = text.replace(old, new)
    text = re.sub(r"\s+", "", text).replace("/per/", "/")
    # m/(s^2)
    text = re.sub(r"/\((\w+)\)$", r"/\1", text)
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "{}", "<>"):
        text = text[1:-1]
    return text


def known_unit(text: str) -> LaboratoryUnit | None:
    """Return the unit that a text names, None if it names none."""
    name = spelled_unit(text)
    return KNOWN.get(name) or KNOWN.get(_FOLDED.get(name.lower(), ""))


def scaled_unit(text: str) -> LaboratoryUnit | None:
    """Return the unit of a text that may have a number: "g", "2 mg", "1/16384 g", "0.5 g/V", "131 LSB/(deg/s)", "100
    Hz"."""
    simple = known_unit(text)
    if simple is not None:
        return simple
    split = _SPLIT.match(spelled_unit(text))
    number = None
    if split:
        number = _fraction(split["number"])
    if split is None or number is None:
        return None
    name = split["unit"]
    if name.lower() in ("hz", "khz"):
        size = 1.0 if name.lower() == "hz" else 1e3
        return LaboratoryUnit(TIME, 1.0 / (size * number))
    unit = known_unit(name)
    if unit is not None:
        if unit.offset:
            return None
        return replace(unit, factor=number * unit.factor)
    for slash in re.finditer("/", name):
        above, below = known_unit(name[: slash.start()]), known_unit(name[slash.end() :])
        if above is None or below is None or above.raw == below.raw or above.offset or below.offset:
            continue
        if below.raw:
            return LaboratoryUnit(above.quantity, number * above.factor / below.factor, per=below)
        return LaboratoryUnit(below.quantity, below.factor / (number * above.factor), per=above)
    return None


def _fraction(text: str | None) -> float | None:
    """Return a positive number or a quotient of two; 1 if there is none."""
    if not text:
        return 1.0
    above, _, below = text.partition("/")
    try:
        value = float(above) / float(below or "1")
    except (ValueError, ZeroDivisionError):
        return None
    if 0.0 < value < math.inf:
        return value
    return None


def of_converter(scale: LaboratoryUnit, stated: LaboratoryUnit | None) -> LaboratoryUnit | None:
    """Return a sensitivity for numbers in a given unit of a converter (mV, LSB); None if it counts in another unit."""
    if scale.per is None:
        return None
    if stated is None:
        return replace(scale, factor=scale.factor * scale.per.factor)
    if stated.quantity != scale.per.quantity:
        return None
    return replace(scale, factor=scale.factor * stated.factor)
