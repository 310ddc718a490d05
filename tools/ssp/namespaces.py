"""Namespaces of SSP 1.0, and XML with them, written in one way."""

from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ...fmus.description import number
from ..orchestrator.quantities import Scale

BASE = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssd": f"{BASE}Description",
    "ssv": f"{BASE}ParameterValues",
    "ssm": f"{BASE}ParameterMapping",
    "ssc": f"{BASE}Common",
}
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
"""Namespace of OMSimulator's annotations."""

STRUCTURE = "SystemStructure.ssd"
"""Name of the description in an .ssp."""


def declared(*prefixes: str) -> dict[str, str]:
    """Attributes that declare namespaces."""
    return {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}


def xml_bytes(root: Element) -> bytes:
    """XML in UTF-8; the same element gives the same bytes."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def add_units(parent: Element, name: str, units: Mapping[str, Scale]) -> None:
    """An element of SSP's units; nothing where there are none."""
    if not units:
        return
    element = SubElement(parent, name)
    for unit, scale in sorted(units.items()):
        base = {key: str(power) for key, power in scale.exponents}
        if scale.factor != 1.0:
            base["factor"] = number(scale.factor)
        if scale.offset != 0.0:
            base["offset"] = number(scale.offset)
        SubElement(SubElement(element, "ssc:Unit", name=unit), "ssc:BaseUnit", base)
