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

KINDS = {
    "Real": "Real",
    "Float32": "Real",
    "Float64": "Real",
    "Integer": "Integer",
    "Int8": "Integer",
    "Int16": "Integer",
    "Int32": "Integer",
    "Int64": "Integer",
    "UInt8": "Integer",
    "UInt16": "Integer",
    "UInt32": "Integer",
    "UInt64": "Integer",
    "Boolean": "Boolean",
    "String": "String",
    "Enumeration": "Enumeration",
}
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
        values_of_set = []
        for value in _parameter_set(binding, folder, label, units):
            values_of_set.append(replace(value, name=prefix + value.name))
        mapping = child(binding, "ssd:ParameterMapping")
        if mapping is not None:
            root = _document(mapping, folder, label, "ssm:ParameterMapping")
            if root is None:
                root = mapping
            values_of_set = _mapped(values_of_set, children(root, "ssm:MappingEntry"), label)
        values += values_of_set
    return values


def _document(element: Element, folder: Path, label: str, root: str, inside: str = "") -> Element | None:
    """What a binding or mapping is: in a file of the archive, or inside; None where it is neither."""
    if element.get("sourceBase", "SSD") != "SSD":
        raise InputError(f"{label}: a source inside an FMU ('{element.get('source')}') is not supported")
    source = element.get("source")
    if source:
        return read_document(folder, source, label, root)
    return child(element, f"{inside}{root}")


def _parameter_set(binding: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[Given]:
    root = _document(binding, folder, label, "ssv:ParameterSet", "ssd:ParameterValues/")
    where = label
    if binding.get("source"):
        where = f"{label}: {binding.get('source')}"
    if root is None:
        raise InputError(f"{label}: a parameter binding has neither a source nor values")
    scales = {**units, **units_of(root, "ssv:Units", where)}
    values = []
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        namespace = f"{{{NAMESPACES['ssv']}}}"
        typed = [e for e in parameter if local_name(e) in KINDS and e.tag == namespace + local_name(e)][:1]
        if not typed or typed[0].get("value") is None:
            raise InputError(f"{where}: parameter '{name}' has no value of a type that FMI 2.0 has")
        unit, kind = typed[0].get("unit"), KINDS[local_name(typed[0])]
        values.append(Given(name, kind, typed[0].get("value", ""), unit, scales.get(unit or ""), where))
    return values


def _mapped(values: Sequence[Given], entries: Sequence[Element], label: str) -> list[Given]:
    """The values under the names that a mapping gives them; what it does not name keeps its name."""
    mapped = []
    for binding in values:
        renamings = []
        for entry in entries:
            if entry.get("source", "") == binding.name:
                renamings.append(entry)
        mapped += [_transformed(binding, entry, label) for entry in renamings] or [binding]
    return mapped


def _transformed(binding: Given, entry: Element, label: str) -> Given:
    convert = entry.get("suppressUnitConversion") not in ("true", "1")
    binding = replace(binding, name=entry.get("target", ""), convert=convert)
    for step in entry:
        if local_name(step) == "LinearTransformation":
            where = f"{label}: mapping of '{binding.name}'"
            factor, offset = number_of(step, "factor", where, 1.0), number_of(step, "offset", where, 0.0)
            return replace(binding, factor=factor, offset=offset)
        if local_name(step).endswith("MappingTransformation"):
            table = {}
            for e in step:
                if local_name(e) == "MapEntry":
                    table[e.get("source", "")] = e.get("target", "")
            return replace(binding, table=table)
    return binding


def value_for(binding: Given, variable: Variable, scales: Mapping[str, Unit]) -> Value:
    """A binding's value as the variable takes it, in the variable's unit.

    An InputError for a text that is no such value, another type or dimension, or a value outside the variable's limits.
    """
    text = (binding.table or {}).get(binding.text, binding.text)
    with said_of(f"{binding.where}: parameter '{binding.name}'"):
        try:
            value = _value(text, binding, variable)
        except (ValueError, KeyError, OverflowError) as error:
            raise InputError(f"'{text}' is not a value of {variable.name}, which is {variable.kind}") from error
        if variable.kind == "Real" and binding.convert:
            value = _converted(float(value), binding, variable, scales)
        return checked(value, variable)


def _value(text: str, binding: Given, variable: Variable) -> Value:
    """The value of a text by the variable's type, which must be that of the text."""
    kinds = (variable.kind, binding.kind)
    if kinds in (("Real", "Real"), ("Real", "Integer")):
        plain = float(_ascii(text))
        if (binding.factor, binding.offset) == (1.0, 0.0):
            return plain
        return binding.factor * plain + binding.offset
    if kinds == ("Boolean", "Boolean"):
        return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
    if kinds == ("String", "String"):
        return text
    if kinds == ("Enumeration", "Enumeration"):
        items = {item: value for value, item in variable.items}
        if text in items:
            return items[text]
        return int(_ascii(text))
    if kinds in (("Integer", "Integer"), ("Enumeration", "Integer")):
        value = binding.factor * int(_ascii(text)) + binding.offset
        if math.isfinite(value) and value == int(value):
            return int(value)
        return value
    raise InputError(f"is {binding.kind}, but {variable.name} is {variable.kind}")


def _ascii(text: str) -> str:
    """A number as XML writes it: Python would take other digits and 1_000 too."""
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return text


def _converted(value: float, binding: Given, variable: Variable, scales: Mapping[str, Unit]) -> float:
    """A value from the binding's unit into the variable's."""
    if binding.unit is None or variable.unit is None:
        return value
    variable_scale, binding_scale = scales.get(variable.unit), binding.scale or scales.get(binding.unit)
    if binding.unit == variable.unit and (variable_scale is None or binding_scale is None):
        return value
    if variable_scale is None or binding_scale is None or variable_scale.exponents != binding_scale.exponents:
        raise InputError(f"is in {binding.unit}, but {variable.name} is in {variable.unit}")
    if (variable_scale.factor, variable_scale.offset) == (binding_scale.factor, binding_scale.offset):
        return value
    return (binding_scale.factor * value + binding_scale.offset - variable_scale.offset) / variable_scale.factor
