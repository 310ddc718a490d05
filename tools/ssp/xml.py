"""XML of SSP 1.0 and 2.0, read without entities: elements, files of the archive, numbers, units."""

import math
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ...fmus.units import Unit
from ..errors import InputError
from ..files import bytes_of
from ..orchestrator.archive import MOST_DESCRIPTION_BYTES, refuse_outside, xml_root
from ..orchestrator.interface import BASE_UNITS, scale_of

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
        powers = {key: int(power) for key, power in exponents.items()}
        units[str(unit.get("name"))] = scale_of(powers, factor, number_of(base, "offset", where, 0.0))
    return units
