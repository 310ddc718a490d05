"""modelDescription.xml (FMI 2.0 co-simulation) from a component's table."""

import hashlib
import math
import os
from datetime import UTC, datetime
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from trihedron.fmus.component import Component, Variable
from trihedron.fmus.units import UNITS

LOG_CATEGORIES = {
    "logStatusWarning": "what may be wrong",
    "logStatusError": "why a call was refused",
    "logAll": "everything else",
}

TYPE_NAMES = {"real": "Real", "integer": "Integer", "boolean": "Boolean", "enumeration": "Enumeration"}


def number(value: float) -> str:
    """Shortest text that reads back to the same number."""
    return repr(float(value))


def start_text(variable: Variable, value: float) -> str:
    """A start value as its type writes it."""
    if variable.type == "boolean":
        return "true" if value else "false"
    return number(value) if variable.type == "real" else str(int(value))


def add_units(root: Element, component: Component) -> None:
    """UnitDefinitions: the units that the table uses, with base units and display units."""
    used = sorted({v.unit for v in component.interface if v.type == "real"} | {"s"})
    units = SubElement(root, "UnitDefinitions")
    for name in used:
        unit = UNITS[name]
        element = SubElement(units, "Unit", name=name)
        base = {key: str(power) for key, power in unit.exponents.items()}
        if unit.factor != 1.0:
            base["factor"] = number(unit.factor)
        if unit.offset != 0.0:
            base["offset"] = number(unit.offset)
        SubElement(element, "BaseUnit", base)
        for display, factor in unit.display.items():
            SubElement(element, "DisplayUnit", name=display, factor=number(factor))


def add_types(root: Element, component: Component) -> None:
    """TypeDefinitions: one declared type for each enumeration."""
    enumerations = [v for v in component.interface if v.type == "enumeration"]
    if not enumerations:
        return
    types = SubElement(root, "TypeDefinitions")
    for variable in enumerations:
        simple = SubElement(types, "SimpleType", name=variable.name)
        items = SubElement(simple, "Enumeration")
        for value, item in enumerate(variable.items, start=1):
            SubElement(items, "Item", name=item, value=str(value))


def scalar_element(variable: Variable, name: str, reference: int, start: float) -> Element:
    """A ScalarVariable."""
    attributes = {
        "name": name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "output":
        attributes["initial"] = "calculated"
    elif variable.causality == "parameter":
        attributes["initial"] = "exact"
    scalar = Element("ScalarVariable", attributes)
    typed = SubElement(scalar, TYPE_NAMES[variable.type])
    if variable.type == "enumeration":
        typed.set("declaredType", variable.name)
    if variable.type == "real":
        if variable.unit != "1":
            typed.set("unit", variable.unit)
            if variable.display_unit is not None:
                typed.set("displayUnit", variable.display_unit)
        if variable.nominal is not None:
            typed.set("nominal", number(variable.nominal))
    if variable.type in ("real", "integer"):
        for attribute, bound in (("min", variable.minimum), ("max", variable.maximum)):
            if bound is not None:
                typed.set(attribute, start_text(variable, bound))
    if variable.causality != "output":
        typed.set("start", start_text(variable, start))
    return scalar


def model_description(component: Component, content: bytes) -> bytes:
    """The model description; its GUID is the hash of itself and of what the FMU runs.

    Parameters
    ----------
    component : Component
    content : bytes
        what the FMU runs, so that FMUs that compute differently differ in their GUID

    Returns
    -------
    bytes
        XML in UTF-8; the generation date is there only when SOURCE_DATE_EPOCH gives one
    """
    from trihedron.fmus import version

    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=component.name,
        guid="",
        description=component.description,
        author="The Trihedron developers",
        version=version(),
        license="BSD-2-Clause",
        generationTool=f"Trihedron {version()}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=component.name,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        canNotUseMemoryManagementFunctions="true",
        needsExecutionTool="false",
    )
    add_units(root, component)
    add_types(root, component)
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=number(component.stop_time),
        tolerance="1e-9",
        stepSize=number(component.step_size),
    )
    variables = SubElement(root, "ModelVariables")
    time = SubElement(
        variables,
        "ScalarVariable",
        name="time",
        valueReference="0",
        description="simulation time",
        causality="independent",
        variability="continuous",
    )
    SubElement(time, "Real", unit="s")
    index: dict[str, list[int]] = {}
    for variable in component.interface:
        for name, start in zip(variable.elements, variable.starts, strict=True):
            reference = len(variables)
            index.setdefault(variable.name, []).append(reference + 1)
            variables.append(scalar_element(variable, name, reference, start))
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    for variable in component.interface:
        if variable.causality != "output":
            continue
        known = [str(i) for name in variable.follows for i in index[name]]
        for place in index[variable.name]:
            unknown = SubElement(outputs, "Unknown", index=str(place), dependencies=" ".join(known))
            if known:
                unknown.set("dependenciesKind", " ".join(["dependent"] * len(known)))
            SubElement(unknowns, "Unknown", index=str(place))
    digest = hashlib.sha256(ElementTree.tostring(root) + content).hexdigest()
    root.set("guid", f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}")
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdigit():
        moment = datetime.fromtimestamp(math.floor(int(epoch)), UTC)
        root.set("generationDateAndTime", moment.strftime("%Y-%m-%dT%H:%M:%SZ"))
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n"
