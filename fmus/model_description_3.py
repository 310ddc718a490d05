"""modelDescription.xml of FMI 3.0: arrays are variables with a dimension, value references count variables."""

from xml.etree.ElementTree import Element, SubElement

from .component import Component, Variable
from .model_description import (
    add_categories,
    add_units,
    declared_types,
    experiment,
    initially_known,
    quantity_attributes,
    root_attributes,
    start_text,
    type_attributes,
    variable_attributes,
)

TYPE_NAMES = {"real": "Float64", "integer": "Int32", "boolean": "Boolean", "enumeration": "Enumeration"}


def add_types(root: Element, component: Component) -> None:
    """TypeDefinitions: quantities with their units, and enumerations."""
    declared = declared_types(component)
    if not declared:
        return
    types = SubElement(root, "TypeDefinitions")
    for name, variable in declared.items():
        if variable.type == "enumeration":
            items = SubElement(types, "EnumerationType", name=name)
            for value, item in enumerate(variable.items, start=1):
                SubElement(items, "Item", name=item, value=str(value))
        else:
            SubElement(types, "Float64Type", {"name": name, **quantity_attributes(variable)})


def variable_element(variable: Variable, reference: int) -> Element:
    """A variable, with its dimension where it is an array."""
    attributes = variable_attributes(variable, variable.name, reference) | type_attributes(variable)
    element = Element(TYPE_NAMES[variable.type], attributes)
    if variable.causality != "output":
        element.set("start", " ".join(start_text(variable, value) for value in variable.starts))
    if variable.size:
        SubElement(element, "Dimension", start=str(variable.size))
    return element


def description_3(component: Component) -> Element:
    """The model description of FMI 3.0, without token and date."""
    root = Element("fmiModelDescription", {"fmiVersion": "3.0", **root_attributes(component), "instantiationToken": ""})
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=component.name,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        needsExecutionTool="false",
    )
    add_units(root, component)
    add_types(root, component)
    add_categories(root)
    SubElement(root, "DefaultExperiment", experiment(component))
    variables = SubElement(root, "ModelVariables")
    SubElement(
        variables,
        "Float64",
        name="time",
        valueReference="0",
        description="simulation time",
        causality="independent",
        variability="continuous",
        unit="s",
    )
    references = {v.name: i for i, v in enumerate(component.interface, start=1)}
    for variable in component.interface:
        variables.append(variable_element(variable, references[variable.name]))
    structure = SubElement(root, "ModelStructure")
    outputs = [v for v in component.interface if v.causality == "output"]
    for variable in outputs:
        known = [str(references[name]) for name in variable.follows]
        output = SubElement(
            structure, "Output", valueReference=str(references[variable.name]), dependencies=" ".join(known)
        )
        if known:
            output.set("dependenciesKind", " ".join(["dependent"] * len(known)))
    initial = initially_known(component)
    at_start = " ".join(str(references[v.name]) for v in component.interface if v.name in initial)
    for variable in outputs:
        SubElement(structure, "InitialUnknown", valueReference=str(references[variable.name]), dependencies=at_start)
    return root
