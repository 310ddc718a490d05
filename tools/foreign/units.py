"""Units as laboratories write them, as one table of words and factors, and the senses behind numbers.

A unit is a quantity and a linear conversion: value in the record = factor × number + offset. Output of a converter
(volts, counts) needs a sensitivity, such as "16384 LSB/g" or "0.5 g/V".
"""

import math
import re
import unicodedata
from dataclasses import dataclass, replace

from ...fmus.units import STANDARD_GRAVITY
from .numbers import unit_behind
from .tables import TABLES

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


KNOWN = {symbol: LaboratoryUnit(*row) for symbol, row in TABLES["units"].items()}
"""Symbol of a unit -> the unit."""
for _name, _size in TABLES["gravities"].items():
    KNOWN[_name] = LaboratoryUnit(FORCE, _size * STANDARD_GRAVITY)
for _name, _size in TABLES["times"].items():
    KNOWN[_name] = LaboratoryUnit(TIME, _size)
    for _turn, _degrees in TABLES["turns"].items():
        KNOWN[_turn] = LaboratoryUnit(ANGLE, _degrees)
        KNOWN[f"{_turn}/{_name}"] = LaboratoryUnit(RATE, math.radians(_degrees) / _size)
for _name, _size in TABLES["lengths"].items():
    KNOWN[f"{_name}/s"] = LaboratoryUnit(VELOCITY, _size)
    KNOWN[f"{_name}/s2"] = LaboratoryUnit(FORCE, _size)
_SYMBOLS: dict[str, str] = {}
for _name, _words in TABLES["words"].items():
    _SYMBOLS |= dict.fromkeys(_words.split(), _name)
_FOLDED = {word.lower(): symbol for word, symbol in reversed(_SYMBOLS.items())}
_FOLDED |= {symbol.lower(): symbol for symbol in reversed(KNOWN)}
DOUBTFUL: dict[str, list[str]] = TABLES["doubtful"]
"""Words with different meanings in different languages, and the units that they may mean."""
EXAMPLES: dict[str, list[str]] = TABLES["examples"]
"""Quantity -> usual units."""
_SPLIT = re.compile(r"^(?P<number>[+]?\d[\d.]*(?:e[+-]?\d+)?(?:/\d[\d.]*)?)?[*x]?(?P<unit>.*)$", re.IGNORECASE)

_FACTOR = r"(?:10(?:\^|\*\*)-?\d+|\d[\d.]*(?:e[+-]?\d+)?)"
_BESIDE_FACTOR = re.compile(
    rf"(?P<mark>[*x×])?(?P<number>{_FACTOR})[*x×]?(?P<unit>[^\d*x×].*)|(?P<name>.*[^\d.])[*x×/](?P<by>{_FACTOR})",
    re.IGNORECASE,
)


def spelled_unit(text: str) -> str:
    """Return a unit's text in one spelling: µ as u, ° as deg, no blanks, brackets or signs of powers."""
    text = unicodedata.normalize("NFKC", text.strip())
    for old, new in (("μ", "u"), ("°", "deg"), ("º", "deg"), ("−", "-"), ("·", ""), ("⋅", ""), ("^", ""), ("*", "")):
        text = text.replace(old, new)
    text = re.sub(r"\s+", "", text)
    # m/(s^2)
    text = re.sub(r"/\((\w+)\)$", r"/\1", text)
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "{}", "<>"):
        text = text[1:-1]
    return text


def known_unit(text: str) -> LaboratoryUnit | None:
    """Return the unit that a text names, None if it names none: "m/s2", "millis", "degrees per second"."""
    return KNOWN.get(_symbol(text))


def _symbol(text: str) -> str:
    """Return the symbol of a unit that a text names; any other text is returned in one spelling."""
    plain = re.sub(r"[\s/]*\bsquared$", "2", " ".join(text.split()).replace("_", "/"))
    plain = re.sub(r"[\s/]*\bper\b[\s/]*", "/", plain)
    name = re.sub(r"(?<=[a-z])[-.](?=[a-z])", "", spelled_unit(plain))
    whole = _one_symbol(name)
    if whole in KNOWN or "/" not in name:
        return whole
    above, *below = map(_one_symbol, name.split("/"))
    if below in (["s", "s"], ["s", "2"]):
        below = ["s2"]
    return "/".join([above, *below])


def _one_symbol(name: str) -> str:
    """Return the symbol of a word, or of a power of one: "sec2" is "s2"."""
    if name in KNOWN:
        return name
    word = name.removesuffix("2")
    return _SYMBOLS.get(name) or _FOLDED.get(name.lower()) or _SYMBOLS.get(word, word) + name[len(word) :]


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


def units_beside_factor(text: str, quantity: str = "") -> list[str]:
    """Return the units of a quantity, or of any, that a unit beside a factor may mean: "x100 deg/s" is 0.01 deg/s."""
    beside = _BESIDE_FACTOR.fullmatch(re.sub(r"\s+", "", text))
    if beside is None:
        return []
    name = spelled_unit(beside["unit"] or beside["name"])
    base, _, power = re.sub(r"\^|\*\*", "^", beside["number"] or beside["by"]).partition("^")
    number = _fraction(f"{base}e{int(power) - 1}" if power else base)
    unit = known_unit(name)
    if number is None or unit is None or unit.raw or unit.offset or quantity not in ("", unit.quantity):
        return []
    answers = [f"{1.0 / number:.12g} {name}", f"{number:.12g} {name}"]
    is_multiplied = beside["mark"] or beside["by"]
    return answers if is_multiplied else answers[::-1]


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
