"""Units of variables and of columns: what a suffix means, and how a variable's value becomes a column's."""

from collections.abc import Mapping
from dataclasses import dataclass

from ...fmus.units import UNITS, column_units
from ..errors import InputError


@dataclass(frozen=True)
class Scale:
    """How a unit stands to SI: SI value = factor * value + offset, with exponents of the base units."""

    exponents: tuple[tuple[str, int], ...]
    factor: float = 1.0
    offset: float = 0.0


def scale_of(exponents: Mapping[str, int], factor: float = 1.0, offset: float = 0.0) -> Scale:
    """A scale with its exponents in a fixed order, zeros left out."""
    return Scale(tuple(sorted((base, n) for base, n in exponents.items() if n)), factor, offset)


def _known_scales() -> dict[str, Scale]:
    scales = {}
    for unit in UNITS.values():
        for name, display in unit.display.items():
            scales[name] = scale_of(unit.exponents, unit.factor / display)
    for unit in UNITS.values():
        scales[unit.name] = scale_of(unit.exponents, unit.factor, unit.offset)
    return scales


_SCALES = _known_scales()
_SUFFIXES = column_units()


SAME = 1e-6
"""Factors of one unit that agree so far are the same: some tools write few digits."""


def between(
    first: str | None, second: str | None, scales: Mapping[str, Scale], others: Mapping[str, Scale], *, relative: bool
) -> tuple[float, float] | None:
    """How a value in one unit becomes a value in another: factor and offset.

    Parameters
    ----------
    first, second : str or None
        declared units; a variable without a unit goes with every unit
    scales, others : mapping
        what the FMU of the first and that of the second define; what they leave open is as in our table
    relative : bool
        the value is a difference: no offset

    Returns
    -------
    tuple or None
        second value = factor * first value + offset; None where the units are not of one dimension
    """
    if first is None or second is None:
        return 1.0, 0.0
    mine, theirs = scales.get(first) or _SCALES.get(first), others.get(second) or _SCALES.get(second)
    if mine is None or theirs is None:
        return (1.0, 0.0) if first == second else None
    if mine.exponents != theirs.exponents:
        return None
    factor = mine.factor / theirs.factor
    offset = 0.0 if relative else (mine.offset - theirs.offset) / theirs.factor
    if abs(factor - 1.0) <= (SAME if first == second else 1e-12) and abs(offset) <= SAME:
        return 1.0, 0.0
    return factor, offset


def is_angle(unit: str | None, scales: Mapping[str, Scale]) -> bool:
    """Whether a unit is one of angles (and not of rates)."""
    scale = {**scales, **_SCALES}.get(unit or "")
    return scale is not None and scale.exponents == (("rad", 1),)


def suffix_of(column: str) -> str:
    """The unit's suffix of a column's name (`alpha_deg`: `deg`), empty where it has none."""
    tail = column.rpartition("_")[2]
    return tail if "_" in column and tail in _SUFFIXES else ""


def suffix_for(unit: str | None) -> str:
    """The suffix that says a unit in a column's name, empty for a pure number."""
    if unit is None or unit == "1":
        return ""
    for suffix, (name, factor) in _SUFFIXES.items():
        if name == unit and factor == 1.0:
            return suffix
    for suffix, (name, factor) in _SUFFIXES.items():
        if factor != 1.0 and UNITS[name].display.get(unit) == factor:
            return suffix
    spelled = unit.replace("/", "p")
    return "".join(character for character in spelled if character.isalnum())


def conversion(unit: str | None, column: str, scales: Mapping[str, Scale]) -> tuple[float, float]:
    """How the value of a variable becomes the value of a column.

    Parameters
    ----------
    unit : str or None
        the variable's declared unit; without one the column's suffix is believed
    column : str
        name of the column
    scales : mapping
        the units that the variable's FMU defines

    Returns
    -------
    factor, offset : float
        column's value = factor * variable's value + offset

    Raises
    ------
    InputError
        when the suffix is missing or says another dimension
    """
    suffix = suffix_of(column)
    expected = suffix_for(unit)
    if unit is None or suffix == expected or (expected and column.endswith(f"_{expected}")):
        return 1.0, 0.0
    if not suffix:
        raise InputError(f"column '{column}' is in {unit} and must say so: name it '{column}_{expected}'")
    name, factor = _SUFFIXES[suffix]
    if name == unit:
        return factor, 0.0
    mine = _SCALES.get(unit) or scales.get(unit)
    theirs = _SCALES[name]
    if mine is None or mine.exponents != theirs.exponents or unit == "1":
        meant = f"; '{column.removesuffix('_' + suffix)}_{expected}' would be right" if expected else ""
        raise InputError(f"column '{column}' ends in _{suffix}, but the variable is in {unit}{meant}")
    return factor * mine.factor / theirs.factor, factor * (mine.offset - theirs.offset) / theirs.factor
