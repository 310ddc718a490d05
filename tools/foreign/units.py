"""Units as laboratories write them, and what they are in the columns of a record.

A unit is a quantity and a line: what a record has is factor × number + offset. What a converter gave (volts, counts)
needs a sensitivity beside it, as "16384 LSB/g" or "0.5 g/V".
"""

import math
import re
import unicodedata
from dataclasses import dataclass, replace

from ...fmus.units import STANDARD_GRAVITY

FORCE, RATE, ANGLE, VELOCITY, TIME, TEMPERATURE = "force", "rate", "angle", "velocity", "time", "temperature"
VOLTAGE, COUNTS = "voltage", "counts"
QUANTITIES = (FORCE, RATE, ANGLE, VELOCITY, TIME, TEMPERATURE)
"""Quantities that a mapping has units of."""
DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class LaboratoryUnit:
    """What a number in a file is in a record: force m/s², rate rad/s, angle degrees, velocity m/s, time s, °C.

    `per` is what a sensitivity counts in, volts or counts, with the size of its unit.
    """

    quantity: str
    factor: float
    offset: float = 0.0
    per: "LaboratoryUnit | None" = None

    @property
    def raw(self) -> bool:
        """Whether a converter's output is meant, which says nothing by itself."""
        return self.quantity in (VOLTAGE, COUNTS)


_NAMES = {
    LaboratoryUnit(FORCE, 1.0): "m/s2 ms-2 mps2 m/s/s m/sec2 ms2 m/ss м/с2",
    LaboratoryUnit(FORCE, STANDARD_GRAVITY): "g G g0 gn",
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
"""Words that differ in meaning between languages, and the units that they may mean."""
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
    """A unit's text in one spelling: µ as u, ° as deg, no blanks, brackets or signs of powers."""
    text = unicodedata.normalize("NFKC", text.strip())
    for old, new in (("μ", "u"), ("°", "deg"), ("º", "deg"), ("−", "-"), ("·", ""), ("⋅", ""), ("^", ""), ("*", "")):
        text = text.replace(old, new)
    text = re.sub(r"\s+", "", text)
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "{}", "<>"):
        text = text[1:-1]
    return text


def known_unit(text: str) -> LaboratoryUnit | None:
    """The unit that a text names, None where it names none."""
    name = spelled_unit(text)
    return KNOWN.get(name) or KNOWN.get(_FOLDED.get(name.lower(), ""))


def scaled_unit(text: str) -> LaboratoryUnit | None:
    """The unit of a text that may have a number: "g", "2 mg", "1/16384 g", "0.5 g/V", "131 LSB/(deg/s)", "100 Hz"."""
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
    if name.lower() == "hz":
        return LaboratoryUnit(TIME, 1.0 / number)
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
    """A positive number or quotient of two; 1 where there is none."""
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
    """A sensitivity for numbers in a stated unit of a converter (mV, LSB); None where it counts in something else."""
    if scale.per is None:
        return None
    if stated is None:
        return replace(scale, factor=scale.factor * scale.per.factor)
    if stated.quantity != scale.per.quantity:
        return None
    return replace(scale, factor=scale.factor * stated.factor)
