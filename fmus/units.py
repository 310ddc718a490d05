"""Units: one table for the model descriptions, the names of columns and the checks of connections."""

import math
import re
from dataclasses import dataclass, field
from typing import Any

STANDARD_GRAVITY = 9.80665
"""Standard gravity [m/s²]; the default of every gravity parameter."""
ARCMIN = math.radians(1.0 / 60.0)
"""[rad]"""


@dataclass(frozen=True)
class Unit:
    """A unit of a variable: exponents of SI base units and the units in which a person likes to read it.

    Attributes
    ----------
    name : str
        as FMI writes it ("m/s2")
    suffix : str
        how it stands in a column's name ("mps2"); empty for a pure number
    exponents : dict
        base unit to exponent, as in FMI's BaseUnit (kg, m, s, A, K, mol, cd, rad)
    factor, offset : float
        SI value = factor * value + offset
    display : dict
        display unit's name to factor: displayed value = factor * value
    """

    name: str
    suffix: str
    exponents: dict[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0
    display: dict[str, float] = field(default_factory=dict)


def number_text(value: float) -> str:
    """Shortest text that reads back to the same number."""
    return repr(float(value))


def has_base(unit: Unit) -> bool:
    """Return true if a unit is a product of whole powers of base units; the densities of noise are none."""
    return bool(unit.exponents) or unit.name == "1"


def base_unit(unit: Unit) -> dict[str, str]:
    """Attributes of a BaseUnit: exponents, factor and offset where they are others than 1 and 0."""
    base = {key: str(power) for key, power in unit.exponents.items()}
    if unit.factor != 1.0:
        base["factor"] = number_text(unit.factor)
    if unit.offset != 0.0:
        base["offset"] = number_text(unit.offset)
    return base


UNITS = {
    unit.name: unit
    for unit in (
        Unit("1", ""),
        Unit("s", "s", {"s": 1}),
        Unit("m", "m", {"m": 1}),
        Unit("h", "h", {"s": 1}, factor=3600.0),
        Unit("Hz", "Hz", {"s": -1}),
        Unit("m/s", "mps", {"m": 1, "s": -1}),
        Unit("rad", "rad", {"rad": 1}, display={"deg": 180.0 / math.pi, "arcsec": 648000.0 / math.pi}),
        Unit("rad/s", "radps", {"rad": 1, "s": -1}, display={"deg/s": 180.0 / math.pi}),
        Unit("rad/s2", "radps2", {"rad": 1, "s": -2}, display={"deg/s2": 180.0 / math.pi}),
        Unit("rad/h", "radph", {"rad": 1, "s": -1}, factor=1.0 / 3600.0),
        Unit("rad/g", "radpg", {"rad": 1, "s": 2, "m": -1}, factor=1.0 / STANDARD_GRAVITY),
        Unit("rad/K", "radpK", {"rad": 1, "K": -1}),
        Unit("rad/s/h", "radpsph", {"rad": 1, "s": -2}, factor=1.0 / 3600.0),
        Unit("rad/s/g", "radpspg", {"rad": 1, "s": 1, "m": -1}, factor=1.0 / STANDARD_GRAVITY),
        Unit("rad/s/K", "radpspK", {"rad": 1, "s": -1, "K": -1}),
        Unit("rad/s/g2", "radpspg2", {"rad": 1, "s": 3, "m": -2}, factor=1.0 / STANDARD_GRAVITY**2),
        Unit("s/rad", "sprad", {"s": 1, "rad": -1}),
        Unit("s2/rad2", "s2prad2", {"s": 2, "rad": -2}),
        Unit("rad/sqrt(s)", ""),
        Unit("m/s/sqrt(s)", ""),
        Unit("rad/s/sqrt(s)", ""),
        Unit("m/s2/sqrt(s)", ""),
        Unit("m/s3", "mps3", {"m": 1, "s": -3}),
        Unit("m/s2", "mps2", {"m": 1, "s": -2}, display={"g": 1.0 / STANDARD_GRAVITY}),
        Unit("degC", "degC", {"K": 1}, offset=273.15),
        Unit("g", "g", {"m": 1, "s": -2}, factor=STANDARD_GRAVITY),
        Unit("g/h", "gph", {"m": 1, "s": -3}, factor=STANDARD_GRAVITY / 3600.0),
        Unit("g/K", "gpK", {"m": 1, "s": -2, "K": -1}, factor=STANDARD_GRAVITY),
        Unit("1/g", "pg", {"m": -1, "s": 2}, factor=1.0 / STANDARD_GRAVITY),
        Unit("1/g2", "pg2", {"m": -2, "s": 4}, factor=1.0 / STANDARD_GRAVITY**2),
        Unit("1/h", "ph", {"s": -1}, factor=1.0 / 3600.0),
        Unit("1/K", "pK", {"K": -1}),
    )
}
"""The units of the components' variables, by their FMI names; effects may have composed ones, of `unit_named`."""

_WORDS = {"1": "1", "g": "g", "rad": "rad", "s": "s", "h": "h", "K": "1/K"}
"""Units that compose others, as `UNITS` has them; the kelvin as its inverse."""


def unit_named(name: str) -> Unit:
    """A unit of `UNITS`, or one composed of g, rad, s, h and K, such as "1/g4" or "rad.s2/K"; a KeyError for others."""
    if name in UNITS:
        return UNITS[name]
    powers: dict[str, int] = {}
    for k, part in enumerate(name.split("/")):
        for word in part.split("."):
            match = re.fullmatch(r"([a-zA-Z]+|1)([0-9]*)", word)
            if match is None or match[1] not in _WORDS or (match[1] == "1" and match[2]):
                raise KeyError(name)
            powers[match[1]] = powers.get(match[1], 0) + int(match[2] or 1) * (1 if k == 0 else -1)
    exponents: dict[str, int] = {}
    factor = 1.0
    for word, power in powers.items():
        unit, power = UNITS[_WORDS[word]], -power if word == "K" else power
        factor *= unit.factor**power
        for base, exponent in unit.exponents.items():
            exponents[base] = exponents.get(base, 0) + exponent * power
    return Unit(name, "", {base: power for base, power in exponents.items() if power}, factor)


FORCE: dict[str, Any] = {"size": 3, "unit": "m/s2", "display_unit": "g", "nominal": 10.0}
RATE: dict[str, Any] = {"size": 3, "unit": "rad/s", "display_unit": "deg/s"}
INCREMENT: dict[str, Any] = {"size": 3, "unit": "rad", "display_unit": "arcsec", "variability": "discrete"}
VELOCITY: dict[str, Any] = {"size": 3, "unit": "m/s", "variability": "discrete"}
AXES: dict[str, Any] = {"size": 2, "unit": "rad", "display_unit": "deg"}
COMMAND: dict[str, Any] = AXES | {"variability": "discrete"}
ATTITUDE: dict[str, Any] = {"size": 4, "start": (1.0, 0.0, 0.0, 0.0), "within": (-1.001, 1.001)}
"""Quantities: common attributes of their variables, for the tables of the components."""


def column_units() -> dict[str, tuple[str, float]]:
    """Suffix of a column's name -> (unit, column's value = factor * value in that unit)."""
    table = {unit.suffix: (unit.name, 1.0) for unit in UNITS.values() if unit.suffix}
    spelling = {"deg": "deg", "arcsec": "arcsec", "degps": "deg/s", "degps2": "deg/s2"}
    for suffix, display in spelling.items():
        for unit in UNITS.values():
            if display in unit.display:
                table[suffix] = (unit.name, unit.display[display])
    return table
