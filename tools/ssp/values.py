"""XML of SSP 1.0, read without entities; the values of parameters in it, with their units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ...fmus.units import Unit
from ..errors import InputError, said_of
from ..orchestrator.fmu import refuse_outside, xml_root
from ..orchestrator.interface import BASE_UNITS, Value, Variable, checked, scale_of

BASE = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssd": f"{BASE}Description",
    "ssv": f"{BASE}ParameterValues",
    "ssm": f"{BASE}ParameterMapping",
    "ssc": f"{BASE}Common",
}
STRUCTURE = "SystemStructure.ssd"
"""Name of the description in an .ssp."""
RECORD = "extra/trihedron/record.json"
"""What the scenario records, for `trihedron simulate`; other tools do not read it."""
COUPLING = "extra/trihedron/coupling.json"
"""How the scenario takes cycles, for `trihedron simulate`; there only where it says so."""
COUPLING_SETTINGS = ("coupling", "tolerance", "iterations")
"""What `[run]` says of cycles."""
PROGRAMME = "PositionProgramme"
"""Name of the component that stands for a position programme."""
MOST_BYTES = 128 << 20
DEEPEST = 200
"""Elements in one another: what nests deeper is meant to hurt."""
KINDS = {kind: kind for kind in ("Real", "Integer", "Boolean", "String", "Enumeration")}
KINDS |= {f"Float{bits}": "Real" for bits in (32, 64)}
KINDS |= {f"{sign}{bits}": "Integer" for sign in ("Int", "UInt") for bits in (8, 16, 32, 64)}
"""Types of values in SSP 1.0 and 2.0, and which of FMI 2.0's each is."""


def children(element: Element, path: str) -> list[Element]:
    """The elements at a path of prefixed names."""
    return element.findall(path, NAMESPACES)


def child(element: Element, path: str) -> Element | None:
    """The first element at a path of prefixed names."""
    return element.find(path, NAMESPACES)


def local_name(element: Element) -> str:
    """An element's name without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def declared(*prefixes: str) -> dict[str, str]:
    """Attributes that declare namespaces."""
    return {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}


def parsed(xml: bytes, label: str, root: str) -> Element:
    """The root element of an XML document; an InputError for a DOCTYPE, nesting too deep, or another root."""
    if len(xml) > MOST_BYTES:
        raise InputError(f"{label}: is larger than {MOST_BYTES >> 20} MiB; not read")
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
    try:
        content = (folder / member(folder, source, label)).read_bytes()
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror})") from error
    return parsed(content, name, root)


def member(folder: Path, source: str, label: str) -> str:
    """The file of the archive that a URI names; what lies elsewhere is refused."""
    try:
        parts = urlsplit(source)
    except ValueError as error:
        raise InputError(f"{label}: source '{source}' is not a URI ({error})") from error
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path:
        raise InputError(f"{label}: source '{source}' is not a file of the archive; nothing else is opened")
    path = unquote(parts.path).removeprefix("./")
    refuse_outside(path, label, ssp=True)
    if not (folder / path).is_file():
        raise InputError(f"{label}: has no file '{path}', which its description names")
    return path


def number_of(element: Element, attribute: str, label: str, default: float | None = None) -> float:
    """A number of an attribute; refused where it is missing without a default, or is none."""
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


def units_of(root: Element, path: str, label: str) -> dict[str, Unit]:
    """The units that a document defines; an InputError for one that is none."""
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
        whole = {key: int(power) for key, power in exponents.items()}
        units[str(unit.get("name"))] = scale_of(whole, factor, number_of(base, "offset", where, 0.0))
    return units


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
