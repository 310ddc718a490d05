"""A component's parameters as an SSP 1.0 parameter set (.ssv), which other tools read."""

from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from .component import Component
from .model_description import number
from .units import UNITS

VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"


def parameter_set(component: Component, values: Mapping[str, float | list[float]], description: str) -> bytes:
    """The SSP 1.0 ParameterSet of some of a component's real parameters.

    Parameters
    ----------
    component : Component
        decides names, units and order
    values : mapping
        variable -> value in the variable's unit, or list of values for an array
    description : str
        where the values come from

    Returns
    -------
    bytes
        XML in UTF-8; the same values give the same bytes

    Raises
    ------
    ValueError
        for what is no real parameter of the component, or an array of another length
    """
    known = {v.name: v for v in component.interface if v.causality == "parameter" and v.type == "real"}
    if unknown := [name for name in values if name not in known]:
        raise ValueError(f"{component.name} has no real parameter {unknown[0]}")
    root = Element(
        "ssv:ParameterSet",
        {"xmlns:ssv": VALUES, "xmlns:ssc": COMMON, "version": "1.0", "name": component.name},
        description=description,
    )
    parameters = SubElement(root, "ssv:Parameters")
    used = []
    for variable in known.values():
        if variable.name not in values:
            continue
        value = values[variable.name]
        scalars = value if isinstance(value, list) else [value]
        if len(scalars) != len(variable.elements):
            raise ValueError(f"{variable.name} has {len(variable.elements)} elements, not {len(scalars)}")
        used += [variable.unit]
        for name, scalar in zip(variable.elements, scalars, strict=True):
            parameter = SubElement(parameters, "ssv:Parameter", name=name)
            SubElement(parameter, "ssv:Real", value=number(scalar), unit=variable.unit)
    units = SubElement(root, "ssv:Units")
    for name in sorted(set(used)):
        unit = UNITS[name]
        base = {key: str(power) for key, power in unit.exponents.items()}
        if unit.factor != 1.0:
            base["factor"] = number(unit.factor)
        if unit.offset != 0.0:
            base["offset"] = number(unit.offset)
        SubElement(SubElement(units, "ssc:Unit", name=name), "ssc:BaseUnit", base)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
