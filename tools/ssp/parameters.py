"""Parameter sets (.ssv) and their mappings (.ssm), written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement

from ...fmus.description import number
from ..orchestrator.interface import Value, Variable
from ..orchestrator.quantities import Scale
from .namespaces import add_units, declared, xml_bytes


@dataclass
class WrittenSet:
    """A parameter set to be written.

    Attributes
    ----------
    name, description : str
    values : dict
        name in the set -> (variable whose type and unit it has, value)
    units : dict
        the units that the values have
    mapping : dict
        name in the set -> names that it has in the system; empty where they are the same
    """

    name: str
    description: str
    values: dict[str, tuple[Variable, Value]] = field(default_factory=dict)
    units: dict[str, Scale] = field(default_factory=dict)
    mapping: dict[str, list[str]] = field(default_factory=dict)

    def add(self, name: str, variable: Variable, value: Value, scales: Mapping[str, Scale]) -> None:
        """Add a value in its variable's unit."""
        self.values[name] = (variable, value)
        if variable.unit is not None and variable.unit in scales:
            self.units[variable.unit] = scales[variable.unit]

    @property
    def file(self) -> str:
        """Where it stands in the archive."""
        return f"resources/{self.name}.ssv"

    @property
    def mapping_file(self) -> str | None:
        """Where its mapping stands, if it has one."""
        return f"resources/{self.name}.ssm" if self.mapping else None


def typed_value(parent: Element, variable: Variable, value: Value, units: Mapping[str, Scale]) -> None:
    """The element of a parameter's value.

    An enumeration goes out as the whole number that FMI passes: neither OMSimulator nor FMPy reads an item's name.
    """
    if variable.kind == "Real":
        unit = {"unit": variable.unit} if variable.unit in units else {}
        SubElement(parent, "ssv:Real", {"value": number(float(value)), **{k: str(v) for k, v in unit.items()}})
    elif variable.kind == "Boolean":
        SubElement(parent, "ssv:Boolean", value="true" if value else "false")
    elif variable.kind == "String":
        SubElement(parent, "ssv:String", value=str(value))
    else:
        SubElement(parent, "ssv:Integer", value=str(int(value)))


def parameter_set_xml(values: WrittenSet) -> bytes:
    """The .ssv of a parameter set."""
    attributes = {"version": "1.0", "name": values.name, "description": values.description}
    root = Element("ssv:ParameterSet", {**declared("ssv", "ssc"), **attributes})
    parameters = SubElement(root, "ssv:Parameters")
    for name, (variable, value) in values.values.items():
        typed_value(SubElement(parameters, "ssv:Parameter", name=name), variable, value, values.units)
    add_units(root, "ssv:Units", values.units)
    return xml_bytes(root)


def mapping_xml(mapping: Mapping[str, Sequence[str]]) -> bytes:
    """The .ssm that gives names of a parameter set their names in the system."""
    root = Element("ssm:ParameterMapping", {**declared("ssm", "ssc"), "version": "1.0"})
    for source, targets in mapping.items():
        for target in targets:
            SubElement(root, "ssm:MappingEntry", source=source, target=target)
    return xml_bytes(root)
