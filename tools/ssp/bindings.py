"""Parameter bindings, read: inline or from .ssv, with or without a mapping; values as an FMU's variables take them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

from ..errors import InputError, said_of
from ..orchestrator.interface import Value, Variable, checked
from ..orchestrator.quantities import Scale
from .document import child, children, local_name, number_of, qualified, read_document, units_of

KINDS = {"Real": "Real", "Integer": "Integer", "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration"}
KINDS |= {f"Float{bits}": "Real" for bits in (32, 64)}
KINDS |= {f"{sign}{bits}": "Integer" for sign in ("Int", "UInt") for bits in (8, 16, 32, 64)}
"""Types of values in SSP 1.0 and 2.0, and which of FMI 2.0's each is."""

TRUTHS = {"true": True, "1": True, "false": False, "0": False}


@dataclass(frozen=True)
class Given:
    """A value that a binding gives.

    Attributes
    ----------
    name : str
        of the parameter, seen from the element that has the binding
    kind, text : str
        type and value as they are written
    unit : str or None
    scale : Scale or None
        of the unit, where the documents define it
    factor, offset : float
        of the mapping's linear transformation
    table : mapping or None
        of a mapping's transformation value by value
    convert : bool
        False where the mapping suppresses the conversion of units
    where : str
        for messages
    """

    name: str
    kind: str
    text: str
    unit: str | None
    scale: Scale | None
    where: str
    factor: float = 1.0
    offset: float = 0.0
    table: Mapping[str, str] | None = None
    convert: bool = True


def read_bindings(element: Element, folder: Path, label: str, units: Mapping[str, Scale]) -> list[Given]:
    """The values of an element's bindings in their order: a later one wins over an earlier one.

    Raises
    ------
    InputError
        a source that is not a file of the archive, or what is not a parameter set of SSP
    """
    values: list[Given] = []
    for binding in children(element, "ssd:ParameterBindings/ssd:ParameterBinding"):
        if binding.get("type", "application/x-ssp-parameter-set") != "application/x-ssp-parameter-set":
            raise InputError(f"{label}: a parameter binding has type '{binding.get('type')}', which is not supported")
        found = _parameter_set(binding, folder, label, units)
        prefix = binding.get("prefix", "")
        found = [replace(given, name=prefix + given.name) for given in found]
        mapping = child(binding, "ssd:ParameterMapping")
        values += found if mapping is None else _mapped(found, _entries(mapping, folder, label), label)
    return values


def _outside(element: Element, label: str) -> str | None:
    """The source of a binding or mapping; None where it stands inside."""
    if element.get("sourceBase", "SSD") != "SSD":
        raise InputError(f"{label}: a source inside an FMU ('{element.get('source')}') is not supported")
    return element.get("source") or None


def _parameter_set(binding: Element, folder: Path, label: str, units: Mapping[str, Scale]) -> list[Given]:
    source = _outside(binding, label)
    if source is not None:
        root, where = read_document(folder, source, label, "ssv:ParameterSet"), f"{label}: {source}"
    else:
        inside = child(binding, "ssd:ParameterValues/ssv:ParameterSet")
        if inside is None:
            raise InputError(f"{label}: a parameter binding has neither a source nor values")
        root, where = inside, label
    scales = {**units, **units_of(root, "ssv:Units", where)}
    values = []
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        typed = next(
            (e for e in parameter if local_name(e) in KINDS and e.tag == qualified(f"ssv:{local_name(e)}")), None
        )
        if typed is None or typed.get("value") is None:
            raise InputError(f"{where}: parameter '{name}' has no value of a type that FMI 2.0 has")
        unit = typed.get("unit")
        scale = scales.get(unit or "")
        values.append(Given(name, KINDS[local_name(typed)], typed.get("value", ""), unit, scale, where))
    return values


def _entries(mapping: Element, folder: Path, label: str) -> list[Element]:
    source = _outside(mapping, label)
    if source is not None:
        root = read_document(folder, source, label, "ssm:ParameterMapping")
    else:
        inside = child(mapping, "ssm:ParameterMapping")
        root = mapping if inside is None else inside
    return children(root, "ssm:MappingEntry")


def _mapped(values: list[Given], entries: list[Element], label: str) -> list[Given]:
    """The values under the names that a mapping gives them; what it does not name keeps its name."""
    targets: dict[str, list[Element]] = {}
    for entry in entries:
        targets.setdefault(entry.get("source", ""), []).append(entry)
    mapped = []
    for given in values:
        if given.name not in targets:
            mapped.append(given)
        for entry in targets.get(given.name, []):
            renamed = replace(
                given, name=entry.get("target", ""), convert=entry.get("suppressUnitConversion") not in ("true", "1")
            )
            mapped.append(_transformed(renamed, entry, label))
    return mapped


def _transformed(given: Given, entry: Element, label: str) -> Given:
    for step in entry:
        if local_name(step) == "LinearTransformation":
            where = f"{label}: mapping of '{given.name}'"
            return replace(
                given,
                factor=number_of(step, "factor", where, 1.0),
                offset=number_of(step, "offset", where, 0.0),
            )
        if local_name(step).endswith("MappingTransformation"):
            table = {e.get("source", ""): e.get("target", "") for e in step if local_name(e) == "MapEntry"}
            return replace(given, table=table)
    return given


def value_for(given: Given, variable: Variable, scales: Mapping[str, Scale]) -> Value:
    """A binding's value as the variable takes it, in the variable's unit.

    Parameters
    ----------
    given : Given
    variable : Variable
    scales : mapping
        the units that the variable's FMU defines

    Raises
    ------
    InputError
        a text that is no such value, another type, another dimension, or a value outside the variable's limits
    """
    text = given.text if given.table is None else given.table.get(given.text, given.text)
    with said_of(f"{given.where}: parameter '{given.name}'"):
        value = _value(text, given, variable)
        if variable.kind == "Real" and given.convert:
            value = _converted(float(value), given, variable, scales)
        return checked(value, variable)


def _value(text: str, given: Given, variable: Variable) -> Value:
    """The value of a text by the variable's type, which must be that of the text."""
    kind = variable.kind
    try:
        if kind == "Real" and given.kind in ("Real", "Integer"):
            plain = _real(text)
            return given.factor * plain + given.offset if given.factor != 1.0 or given.offset else plain
        if kind == "Boolean" and given.kind == "Boolean":
            return TRUTHS[text.strip()]
        if kind == "String" and given.kind == "String":
            return text
        if kind == "Enumeration" and given.kind == "Enumeration":
            named = {item: number for number, item in variable.items}
            return named[text] if text in named else _whole(text)
        if kind in ("Integer", "Enumeration") and given.kind == "Integer":
            number = given.factor * _whole(text) + given.offset
            return int(number) if math.isfinite(number) and number == int(number) else number
    except (ValueError, KeyError, OverflowError) as error:
        raise InputError(f"'{text}' is not a value of {variable.name}, which is {kind}") from error
    raise InputError(f"is {given.kind}, but {variable.name} is {kind}")


def _real(text: str) -> float:
    """A number as XML writes it: Python would take other digits and 1_000 too."""
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return float(text)


def _whole(text: str) -> int:
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return int(text)


def _converted(value: float, given: Given, variable: Variable, scales: Mapping[str, Scale]) -> float:
    """A value from the binding's unit into the variable's."""
    if given.unit is None or variable.unit is None:
        return value
    mine = scales.get(variable.unit)
    theirs = given.scale or scales.get(given.unit)
    if given.unit == variable.unit and (mine is None or theirs is None or mine == theirs):
        return value
    if mine is None or theirs is None or mine.exponents != theirs.exponents:
        raise InputError(f"is in {given.unit}, but {variable.name} is in {variable.unit}")
    if mine == theirs:
        return value
    return (theirs.factor * value + theirs.offset - mine.offset) / mine.factor
