"""Values that the parameter bindings of an .ssp give: read with their mappings, taken with their units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

from ...fmus.units import Unit
from ..errors import InputError, said_of
from ..orchestrator.interface import Value, Variable, checked
from .xml import NAMESPACES, child, children, local_name, number_of, read_document, units_of

KINDS = {kind: kind for kind in ("Real", "Integer", "Boolean", "String", "Enumeration")}
KINDS |= {f"Float{bits}": "Real" for bits in (32, 64)}
KINDS |= {f"{sign}{bits}": "Integer" for sign in ("Int", "UInt") for bits in (8, 16, 32, 64)}
"""Types of values in SSP 1.0 and 2.0, and which of FMI 2.0's each is."""


@dataclass(frozen=True)
class Given:
    """A value that a binding gives, as it is written, under a name seen from the element that has the binding.

    `scale` is what the documents define of the unit; the mapping has a linear transformation, or one value by value in
    a table, and may suppress the conversion of units.
    """

    name: str
    kind: str
    text: str
    unit: str | None
    scale: Unit | None
    where: str
    factor: float = 1.0
    offset: float = 0.0
    table: Mapping[str, str] | None = None
    convert: bool = True


def read_bindings(element: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[Given]:
    """The values of an element's bindings in their order: a later one wins over an earlier one.

    An InputError for a source that is not a file of the archive, or what is not a parameter set of SSP.
    """
    values: list[Given] = []
    for binding in children(element, "ssd:ParameterBindings/ssd:ParameterBinding"):
        if binding.get("type", "application/x-ssp-parameter-set") != "application/x-ssp-parameter-set":
            raise InputError(f"{label}: a parameter binding has type '{binding.get('type')}', which is not supported")
        prefix = binding.get("prefix", "")
        found = [replace(given, name=prefix + given.name) for given in _parameter_set(binding, folder, label, units)]
        mapping = child(binding, "ssd:ParameterMapping")
        if mapping is not None:
            root = _document(mapping, folder, label, "ssm:ParameterMapping")
            entries = children(mapping if root is None else root, "ssm:MappingEntry")
            found = _mapped(found, entries, label)
        values += found
    return values


def _document(element: Element, folder: Path, label: str, root: str, inside: str = "") -> Element | None:
    """What a binding or mapping is: in a file of the archive, or inside; None where it is neither."""
    if element.get("sourceBase", "SSD") != "SSD":
        raise InputError(f"{label}: a source inside an FMU ('{element.get('source')}') is not supported")
    source = element.get("source")
    return read_document(folder, source, label, root) if source else child(element, f"{inside}{root}")


def _parameter_set(binding: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[Given]:
    root = _document(binding, folder, label, "ssv:ParameterSet", "ssd:ParameterValues/")
    where = f"{label}: {binding.get('source')}" if binding.get("source") else label
    if root is None:
        raise InputError(f"{label}: a parameter binding has neither a source nor values")
    scales = {**units, **units_of(root, "ssv:Units", where)}
    values = []
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        typed = [e for e in parameter if e.tag in {f"{{{NAMESPACES['ssv']}}}{kind}" for kind in KINDS}][:1]
        if not typed or typed[0].get("value") is None:
            raise InputError(f"{where}: parameter '{name}' has no value of a type that FMI 2.0 has")
        unit, kind = typed[0].get("unit"), KINDS[local_name(typed[0])]
        values.append(Given(name, kind, typed[0].get("value", ""), unit, scales.get(unit or ""), where))
    return values


def _mapped(values: Sequence[Given], entries: Sequence[Element], label: str) -> list[Given]:
    """The values under the names that a mapping gives them; what it does not name keeps its name."""
    mapped = []
    for given in values:
        mine = [entry for entry in entries if entry.get("source", "") == given.name]
        mapped += [_transformed(given, entry, label) for entry in mine] if mine else [given]
    return mapped


def _transformed(given: Given, entry: Element, label: str) -> Given:
    convert = entry.get("suppressUnitConversion") not in ("true", "1")
    given = replace(given, name=entry.get("target", ""), convert=convert)
    for step in entry:
        if local_name(step) == "LinearTransformation":
            where = f"{label}: mapping of '{given.name}'"
            factor, offset = number_of(step, "factor", where, 1.0), number_of(step, "offset", where, 0.0)
            return replace(given, factor=factor, offset=offset)
        if local_name(step).endswith("MappingTransformation"):
            table = {e.get("source", ""): e.get("target", "") for e in step if local_name(e) == "MapEntry"}
            return replace(given, table=table)
    return given


def value_for(given: Given, variable: Variable, scales: Mapping[str, Unit]) -> Value:
    """A binding's value as the variable takes it, in the variable's unit.

    An InputError for a text that is no such value, another type or dimension, or a value outside the variable's limits.
    """
    text = given.text if given.table is None else given.table.get(given.text, given.text)
    with said_of(f"{given.where}: parameter '{given.name}'"):
        try:
            value = _value(text, given, variable)
        except (ValueError, KeyError, OverflowError) as error:
            raise InputError(f"'{text}' is not a value of {variable.name}, which is {variable.kind}") from error
        if variable.kind == "Real" and given.convert:
            value = _converted(float(value), given, variable, scales)
        return checked(value, variable)


def _value(text: str, given: Given, variable: Variable) -> Value:
    """The value of a text by the variable's type, which must be that of the text."""
    kinds = (variable.kind, given.kind)
    if kinds in (("Real", "Real"), ("Real", "Integer")):
        plain = float(_ascii(text))
        return given.factor * plain + given.offset if given.factor != 1.0 or given.offset else plain
    if kinds == ("Boolean", "Boolean"):
        return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
    if kinds == ("String", "String"):
        return text
    if kinds == ("Enumeration", "Enumeration"):
        named = {item: value for value, item in variable.items}
        return named[text] if text in named else int(_ascii(text))
    if kinds in (("Integer", "Integer"), ("Enumeration", "Integer")):
        value = given.factor * int(_ascii(text)) + given.offset
        return int(value) if math.isfinite(value) and value == int(value) else value
    raise InputError(f"is {given.kind}, but {variable.name} is {variable.kind}")


def _ascii(text: str) -> str:
    """A number as XML writes it: Python would take other digits and 1_000 too."""
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return text


def _converted(value: float, given: Given, variable: Variable, scales: Mapping[str, Unit]) -> float:
    """A value from the binding's unit into the variable's."""
    if given.unit is None or variable.unit is None:
        return value
    mine, theirs = scales.get(variable.unit), given.scale or scales.get(given.unit)
    if given.unit == variable.unit and (mine is None or theirs is None):
        return value
    if mine is None or theirs is None or mine.exponents != theirs.exponents:
        raise InputError(f"is in {given.unit}, but {variable.name} is in {variable.unit}")
    if (mine.factor, mine.offset) == (theirs.factor, theirs.offset):
        return value
    return (theirs.factor * value + theirs.offset - mine.offset) / mine.factor
