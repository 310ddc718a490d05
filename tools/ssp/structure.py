"""SystemStructure.ssd, written: FMUs, connections, parameter bindings, units, experiment."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from ...fmus.description import number
from ..orchestrator.interface import Interface, Variable
from ..orchestrator.quantities import Scale
from .namespaces import OMS, add_units, declared, xml_bytes
from .parameters import WrittenSet

Ends = tuple[str, Variable, str, Variable]
"""A connection: element and output, element and input."""


@dataclass(frozen=True)
class Structure:
    """What a system structure description says.

    Attributes
    ----------
    name, title : str
        of the system; the title may be empty
    elements : mapping
        FMU's name -> (file in the archive, interface)
    connections : sequence
        element by element
    sets : sequence of WrittenSet
        parameter sets, the later over the earlier
    start, stop, step : float
        of the experiment [s]
    """

    name: str
    title: str
    elements: Mapping[str, tuple[str, Interface]]
    connections: Sequence[Ends]
    sets: Sequence[WrittenSet]
    start: float
    stop: float
    step: float


def structure_xml(structure: Structure) -> bytes:
    """SystemStructure.ssd of SSP 1.0, its elements in the order that OMSimulator wants."""
    root = Element(
        "ssd:SystemStructureDescription",
        {**declared("ssd", "ssc", "ssv", "ssm"), "xmlns:oms": OMS, "name": structure.name, "version": "1.0"},
    )
    about = {"description": structure.title} if structure.title else {}
    system = SubElement(root, "ssd:System", {"name": "root", **about})
    _bindings(system, structure.sets)
    elements = SubElement(system, "ssd:Elements")
    connected = {(target, variable.name) for _, _, target, variable in structure.connections}
    enumerations: dict[str, Variable] = {}
    units: dict[str, Scale] = {}
    for name, (file, interface) in structure.elements.items():
        component = SubElement(
            elements, "ssd:Component", name=name, type="application/x-fmu-sharedlibrary", source=file
        )
        shown = [
            variable
            for variable in interface.variables.values()
            if variable.causality == "output" or (name, variable.name) in connected
        ]
        units |= {u: interface.scales[u] for u in (v.unit for v in shown) if u is not None and u in interface.scales}
        enumerations |= _connectors(component, name, shown, units)
    connections = SubElement(system, "ssd:Connections")
    for source, output, target, given in structure.connections:
        ends = {"startElement": source, "startConnector": output.name}
        SubElement(connections, "ssd:Connection", {**ends, "endElement": target, "endConnector": given.name})
    _master(system, structure.step)
    # OMSimulator knows no empty ones.
    if enumerations:
        _enumerations(root, enumerations)
    add_units(root, "ssd:Units", units)
    SubElement(root, "ssd:DefaultExperiment", startTime=number(structure.start), stopTime=number(structure.stop))
    return xml_bytes(root)


def _bindings(system: Element, sets: Iterable[WrittenSet]) -> None:
    bindings = [each for each in sets if each.values]
    if not bindings:
        return
    parent = SubElement(system, "ssd:ParameterBindings")
    for each in bindings:
        binding = SubElement(parent, "ssd:ParameterBinding", source=each.file)
        if each.mapping_file is not None:
            SubElement(binding, "ssd:ParameterMapping", source=each.mapping_file)


def _connectors(
    component: Element, name: str, variables: Sequence[Variable], units: Mapping[str, Scale]
) -> dict[str, Variable]:
    """The connectors of an FMU; returns the enumerations that they need."""
    needed: dict[str, Variable] = {}
    if not variables:
        return needed
    connectors = SubElement(component, "ssd:Connectors")
    for variable in variables:
        connector = SubElement(connectors, "ssd:Connector", name=variable.name, kind=variable.causality)
        if variable.kind == "Enumeration":
            needed[f"{name}.{variable.name}"] = variable
            SubElement(connector, "ssc:Enumeration", name=f"{name}.{variable.name}")
            continue
        typed = SubElement(connector, f"ssc:{variable.kind}")
        if variable.kind == "Real" and variable.unit in units:
            typed.set("unit", str(variable.unit))
    return needed


def _master(system: Element, step: float) -> None:
    """OMSimulator's annotation: without it there is no master that steps the system."""
    annotations = SubElement(system, "ssd:Annotations")
    annotation = SubElement(annotations, "ssc:Annotation", type="org.openmodelica")
    information = SubElement(SubElement(annotation, "oms:Annotations"), "oms:SimulationInformation")
    attributes = {"stepSize": number(step), "absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}
    SubElement(information, "oms:FixedStepMaster", {"description": "oms-ma", **attributes})


def _enumerations(root: Element, enumerations: Mapping[str, Variable]) -> None:
    parent = SubElement(root, "ssd:Enumerations")
    for name, variable in enumerations.items():
        enumeration = SubElement(parent, "ssc:Enumeration", name=name)
        for value, item in variable.items:
            SubElement(enumeration, "ssc:Item", name=item, value=str(value))
