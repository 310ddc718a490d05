"""Documents of SSP 1.0 and 2.0, read without entities: elements, files of the archive, units, values of parameters."""

import math
import posixpath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ...fmus.units import Unit
from ..errors import InputError, said_of
from ..files import bytes_of
from ..orchestrator.archive import MOST_DESCRIPTION_BYTES, refuse_outside, xml_root
from ..orchestrator.interface import BASE_UNITS, FmuVariable, Value, checked, scale_of

BASE = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssd": f"{BASE}Description",
    "ssv": f"{BASE}ParameterValues",
    "ssm": f"{BASE}ParameterMapping",
    "ssc": f"{BASE}Common",
}
DEEPEST = 200
"""Elements in one another: what nests deeper is meant to hurt."""


def children(element: Element, path: str) -> list[Element]:
    """The elements at a path of prefixed names."""
    return element.findall(path, NAMESPACES)


def child(element: Element, path: str) -> Element | None:
    """The first element at a path of prefixed names."""
    return element.find(path, NAMESPACES)


def local_name(element: Element) -> str:
    """An element's name without its namespace."""
    if not isinstance(element.tag, str):
        return ""
    return element.tag.rpartition("}")[2]


def declared(*prefixes: str) -> dict[str, str]:
    """Attributes that declare namespaces."""
    return {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}


def parsed(xml: bytes, label: str, root: str) -> Element:
    """The root element of an XML document; an InputError for a DOCTYPE, nesting too deep, or another root."""
    xml_root(xml, f"{label}:", "an .ssp", DEEPEST)
    try:
        element = ElementTree.fromstring(xml)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{label}: is not well-formed XML ({error})") from error
    prefix, _, name = root.partition(":")
    if element.tag != f"{{{NAMESPACES[prefix]}}}{name}":
        raise InputError(f"{label}: its root is <{local_name(element)}>, not <{root}> of SSP")
    return element


def read_document(folder: Path, source: str, label: str, root: str) -> Element:
    """The root element, of this prefixed name, of a file that a URI relative to the unpacked archive names."""
    name = f"{label}: {source}"
    path = folder / member(folder, source, label)
    return parsed(bytes_of(path, label=name, most=MOST_DESCRIPTION_BYTES), name, root)


def member(folder: Path, source: str, label: str) -> str:
    """Return the file of the archive that a URI names; refuse files outside it."""
    try:
        parts = urlsplit(source)
    except ValueError as error:
        raise InputError(f"{label}: source '{source}' is not a URI ({error})") from error
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path:
        raise InputError(f"{label}: source '{source}' is not a file of the archive; nothing else is opened")
    path = posixpath.normpath(unquote(parts.path))
    refuse_outside(path, label, ssp=True)
    if not (folder / path).is_file():
        raise InputError(f"{label}: has no file '{path}', which its description names")
    return path


def number_of(element: Element, attribute: str, label: str, default: float | None = None) -> float:
    """Return the number of an attribute; refuse it if invalid, or missing without a default."""
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = float(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{label}: {attribute} of <{local_name(element)}> is {text!r}, not a finite number")
    return value


def document_units(root: Element, path: str, label: str) -> dict[str, Unit]:
    """Return the units that a document defines; an InputError for an invalid one."""
    units: dict[str, Unit] = {}
    for unit in children(root, f"{path}/ssc:Unit"):
        base = child(unit, "ssc:BaseUnit")
        if base is None:
            continue
        where = f"{label}: unit '{unit.get('name')}'"
        exponents = {key: number_of(base, key, where, 0.0) for key in BASE_UNITS}
        factor = number_of(base, "factor", where, 1.0)
        if factor == 0.0:
            raise InputError(f"{where}: factor is 0")
        for key, power in exponents.items():
            if not power.is_integer():
                raise InputError(f"{where}: the exponent of {key} is {power:g}, not a whole number")
        powers = {key: int(power) for key, power in exponents.items()}
        units[str(unit.get("name"))] = scale_of(powers, factor, number_of(base, "offset", where, 0.0))
    return units


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
class BoundValue:
    """A value that a binding gives, as it is written, under a name seen from the element that has the binding.

    `scale` is the documents' definition of the unit. The mapping has a linear transformation, or one value by value in
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


def read_bindings(element: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[BoundValue]:
    """The values of an element's bindings in their order: a later one wins over an earlier one.

    An InputError for a source that is not a file of the archive, or is not a parameter set of SSP.
    """
    values: list[BoundValue] = []
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
    """Return the document of a binding or mapping, from a file of the archive or inline; None if neither exists."""
    if element.get("sourceBase", "SSD") != "SSD":
        raise InputError(f"{label}: a source inside an FMU ('{element.get('source')}') is not supported")
    source = element.get("source")
    if source:
        return read_document(folder, source, label, root)
    return child(element, f"{inside}{root}")


def _parameter_set(binding: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[BoundValue]:
    root = _document(binding, folder, label, "ssv:ParameterSet", "ssd:ParameterValues/")
    where = label
    if binding.get("source"):
        where = f"{label}: {binding.get('source')}"
    if root is None:
        raise InputError(f"{label}: a parameter binding has neither a source nor values")
    scales = {**units, **document_units(root, "ssv:Units", where)}
    values = []
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        namespace = f"{{{NAMESPACES['ssv']}}}"
        typed = [e for e in parameter if local_name(e) in KINDS and e.tag == namespace + local_name(e)][:1]
        if not typed or typed[0].get("value") is None:
            raise InputError(f"{where}: parameter '{name}' has no value of a type that FMI 2.0 has")
        unit, kind = typed[0].get("unit") or None, KINDS[local_name(typed[0])]
        values.append(BoundValue(name, kind, typed[0].get("value", ""), unit, scales.get(unit or ""), where))
    return values


def _mapped(values: Sequence[BoundValue], entries: Sequence[Element], label: str) -> list[BoundValue]:
    """Return the values under the names that a mapping gives them; names without an entry stay."""
    mapped = []
    for binding in values:
        renamings = []
        for entry in entries:
            if entry.get("source", "") == binding.name:
                renamings.append(entry)
        mapped += [_transformed(binding, entry, label) for entry in renamings] or [binding]
    return mapped


def _transformed(binding: BoundValue, entry: Element, label: str) -> BoundValue:
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


def value_for(binding: BoundValue, variable: FmuVariable) -> Value:
    """A binding's value as the variable takes it.

    An InputError for a text that is no such value, another type, or a value outside the variable's limits.
    """
    text = (binding.table or {}).get(binding.text, binding.text)
    with said_of(f"{binding.where}: parameter '{binding.name}'"):
        try:
            value = _value(text, binding, variable)
        except (ValueError, KeyError, OverflowError) as error:
            raise InputError(f"'{text}' is not a value of {variable.name}, which is {variable.kind}") from error
        return checked(value, variable)


def _value(text: str, binding: BoundValue, variable: FmuVariable) -> Value:
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
