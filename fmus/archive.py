"""FMU and SSP files: the model description, what accompanies it, and archives with the same bytes on every build.

modelDescription.xml of FMI 2.0 and FMI 3.0 (co-simulation) comes from a component's table. In FMI 3.0 arrays are
variables with a dimension, and value references count variables. It is accompanied by documentation with equations and
variables, licences, icon, terminals.
"""

import hashlib
import inspect
import math
import os
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from .component import Component, Variable
from .units import base_unit, has_base, number_text, unit_named
from .versions import version

LOG_CATEGORIES = {
    "logStatusWarning": "what may be wrong",
    "logStatusError": "why a call was refused",
    "logAll": "everything else",
}

QUANTITIES = {
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "m/s2": "Acceleration",
    "degC": "Temperature",
    "Hz": "Frequency",
    "s": "Time",
    "g": "AccelerationInG",
}
"""Quantity of a unit."""

TYPE_NAMES = {
    2: {"real": "Real", "integer": "Integer", "boolean": "Boolean", "enumeration": "Enumeration"},
    3: {"real": "Float64", "integer": "Int32", "boolean": "Boolean", "enumeration": "Enumeration"},
}
"""Elements of the types in each version of FMI."""

FMI2_CAPABILITIES = {
    "canGetAndSetFMUState": "canGetAndSetFMUstate",
    "canSerializeFMUState": "canSerializeFMUstate",
    "providesDirectionalDerivatives": "providesDirectionalDerivative",
}
"""What FMI 2.0 spells otherwise than FMI 3.0."""


def start_text(variable: Variable, value: float) -> str:
    """A start value as its type writes it."""
    if variable.type == "boolean":
        return str(bool(value)).lower()
    return number_text(value) if variable.type == "real" else str(int(value))


def add_unit_definitions(root: Element, component: Component) -> None:
    """UnitDefinitions: the units that the table uses, with base units and display units."""
    unit_names = sorted({v.unit for v in component.interface if v.type == "real"} | {"s"})
    units = SubElement(root, "UnitDefinitions")
    for name in unit_names:
        unit = unit_named(name)
        element = SubElement(units, "Unit", name=name)
        if has_base(unit):
            SubElement(element, "BaseUnit", base_unit(unit))
        for display, factor in unit.display.items():
            SubElement(element, "DisplayUnit", name=display, factor=number_text(factor))


def type_name(variable: Variable) -> str | None:
    """Name of a variable's declared type; pure numbers, integers and booleans have none."""
    if variable.type == "enumeration":
        # A type may not have the name of a variable.
        return "".join(word.capitalize() for word in variable.name.split("_"))
    if variable.type != "real" or variable.unit not in QUANTITIES:
        return None
    unit = variable.display_unit or variable.unit
    return f"{QUANTITIES[variable.unit]}_{unit.replace('/', '_per_')}"


def add_types(root: Element, component: Component, fmi: int) -> None:
    """TypeDefinitions: quantities with their units, and enumerations."""
    declared = {}
    for variable in component.interface:
        name = type_name(variable)
        if name is not None:
            declared[name] = variable
    types = SubElement(root, "TypeDefinitions") if declared else root
    for name, variable in declared.items():
        simple = types if fmi == 3 else SubElement(types, "SimpleType", name=name)
        name_attribute = {"name": name} if fmi == 3 else {}
        if variable.type == "enumeration":
            items = SubElement(simple, "EnumerationType" if fmi == 3 else "Enumeration", name_attribute)
            for value, item in enumerate(variable.items, start=1):
                SubElement(items, "Item", name=item, value=str(value))
        else:
            quantity = name_attribute | {"quantity": QUANTITIES[variable.unit], "unit": variable.unit}
            if variable.display_unit is not None:
                quantity["displayUnit"] = variable.display_unit
            SubElement(simple, "Float64Type" if fmi == 3 else "Real", quantity)


def initially_known(component: Component) -> set[str]:
    """Names of the parameters and inputs on which the outputs depend when the initialisation ends."""
    of_effects = {v.name for v in component.variables[len(component.own) :]}
    arguments = set(component.arguments["initialise"])
    arguments.update(component.arguments.get("respond", ()))
    if "effect" in arguments:
        arguments |= of_effects
    names = set()
    for variable in component.of("parameter", "input"):
        if variable.name in arguments:
            names.add(variable.name)
    return names


def variable_attributes(variable: Variable, name: str, reference: int) -> dict[str, str]:
    """Return the attributes of a variable that both versions of FMI have, for any type."""
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
    return attributes


def type_attributes(variable: Variable) -> dict[str, str]:
    """Return the attributes of a variable's type that both versions have: name, units, limits."""
    attributes: dict[str, str] = {}
    declared = type_name(variable)
    if declared is not None:
        attributes["declaredType"] = declared
    if variable.type == "real":
        if variable.unit != "1":
            attributes["unit"] = variable.unit
            if variable.display_unit is not None:
                attributes["displayUnit"] = variable.display_unit
        if variable.nominal is not None:
            attributes["nominal"] = number_text(variable.nominal)
    if variable.type in ("real", "integer"):
        for attribute, bound in zip(("min", "max"), variable.within, strict=True):
            if bound is not None:
                attributes[attribute] = start_text(variable, bound)
    return attributes


def _described_head(component: Component, fmi: int, sources: Sequence[str]) -> Element:
    """The root element, without identity and date, and all that stands before the variables."""
    attributes = {
        "modelName": component.name,
        "description": component.description,
        "author": "The Trihedron developers",
        "version": version(),
        "license": "BSD-2-Clause",
        "generationTool": f"Trihedron {version()}",
        "variableNamingConvention": "structured",
    }
    if fmi == 2:
        root = Element(
            "fmiModelDescription", {"fmiVersion": "2.0", "guid": "", **attributes, "numberOfEventIndicators": "0"}
        )
        spelt = {"canNotUseMemoryManagementFunctions": "true"}
    else:
        root = Element("fmiModelDescription", {"fmiVersion": "3.0", **attributes, "instantiationToken": ""})
        spelt = {}
    for name, can in component.capabilities(native=bool(sources)).items():
        spelt[FMI2_CAPABILITIES.get(name, name) if fmi == 2 else name] = str(can).lower()
    about = {"modelIdentifier": component.name, "needsExecutionTool": "false"}
    kinds = ["CoSimulation"]
    if component.exchange and sources:
        kinds.insert(0, "ModelExchange")
    for kind in kinds:
        extra = dict(spelt)
        if kind != "CoSimulation":
            # Capabilities of steps concern co-simulation alone.
            extra.pop("canHandleVariableCommunicationStepSize", None)
        interface = SubElement(root, kind, about | extra)
        if kind == "ModelExchange" and fmi == 3:
            interface.set("needsCompletedIntegratorStep", "true")
        if sources and fmi == 2:
            files = SubElement(interface, "SourceFiles")
            for name in sources:
                SubElement(files, "File", name=name)
    add_unit_definitions(root, component)
    add_types(root, component, fmi)
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=number_text(component.stop_time),
        tolerance="1e-9",
        stepSize=number_text(component.step_size),
    )
    return root


def description_element(component: Component, fmi: int, sources: Sequence[str]) -> Element:
    """The model description of a version of FMI, without identity and date; `sources` are files under sources/."""
    root = _described_head(component, fmi, sources)
    variables = SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "description": "simulation time", "causality": "independent"}
    time["variability"] = "continuous"
    if fmi == 2:
        SubElement(SubElement(variables, "ScalarVariable", time), "Real", unit="s")
    else:
        SubElement(variables, "Float64", time, unit="s")
    references: dict[str, list[int]] = {}
    for variable in component.interface:
        numbers_of_variable = references[variable.name] = []
        for name, starts in _values(variable, fmi):
            numbers_of_variable.append(len(variables))
            variables.append(variable_element(variable, fmi, name, numbers_of_variable[-1], starts))
    _add_structure(root, component, fmi, references)
    return root


def _values(variable: Variable, fmi: int) -> list[tuple[str, tuple[float, ...]]]:
    """Return the items with a value reference: variables, in FMI 2.0 their elements, with start values."""
    if fmi == 3:
        return [(variable.name, variable.starts)]
    return [(name, (start,)) for name, start in zip(variable.elements, variable.starts, strict=True)]


def variable_element(variable: Variable, fmi: int, name: str, reference: int, starts: tuple[float, ...]) -> Element:
    """A variable: of FMI 2.0 a scalar, of FMI 3.0 with its dimension where it is an array."""
    attributes, typed = variable_attributes(variable, name, reference), type_attributes(variable)
    if fmi == 2:
        element = Element("ScalarVariable", attributes)
        valued = SubElement(element, TYPE_NAMES[2][variable.type], typed)
    else:
        element = valued = Element(TYPE_NAMES[3][variable.type], attributes | typed)
    if variable.causality != "output":
        valued.set("start", " ".join(start_text(variable, start) for start in starts))
    if variable.size and fmi == 3:
        SubElement(element, "Dimension", start=str(variable.size))
    return element


def _add_structure(root: Element, component: Component, fmi: int, references: Mapping[str, list[int]]) -> None:
    """Add ModelStructure: dependencies of the outputs in a step, and at the end of the initialisation."""
    structure = SubElement(root, "ModelStructure")
    if fmi == 2:
        # The standard counts variables from 1 here, the time too.
        outputs, unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
        key, shift, tags = "index", 1, ("Unknown", "Unknown")
    else:
        outputs = unknowns = structure
        key, shift, tags = "valueReference", 0, ("Output", "InitialUnknown")

    def numbers(names: Iterable[str]) -> list[str]:
        shifted: list[str] = []
        for name in names:
            shifted += [str(reference + shift) for reference in references[name]]
        return shifted

    initial = initially_known(component)
    at_start = " ".join(numbers(v.name for v in component.interface if v.name in initial))
    for variable in component.of("output"):
        inputs = numbers(variable.follows)
        for place in numbers([variable.name]):
            output = SubElement(outputs, tags[0], {key: place}, dependencies=" ".join(inputs))
            if inputs:
                output.set("dependenciesKind", " ".join(["dependent"] * len(inputs)))
    for place in numbers(v.name for v in component.of("output")):
        SubElement(unknowns, tags[1], {key: place}, dependencies=at_start)


def identity(component: Component, content: bytes, *, fmi: int = 2, sources: Sequence[str] = ()) -> str:
    """Return the GUID or instantiation token: the hash of the model description and of the FMU's code.

    Parameters
    ----------
    component : Component
    content : bytes
        code of the FMU, so that FMUs that compute differently differ in their identity
    fmi : int
        2 or 3
    sources : sequence of str
        files under sources/ that are compiled
    """
    digest = hashlib.sha256(ElementTree.tostring(description_element(component, fmi, sources)) + content).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def model_description(component: Component, content: bytes, *, fmi: int = 2, sources: Sequence[str] = ()) -> bytes:
    """The model description; parameters as those of `identity`.

    Returns
    -------
    bytes
        XML in UTF-8; the generation date is there only when SOURCE_DATE_EPOCH gives one
    """
    root = description_element(component, fmi, sources)
    token = identity(component, content, fmi=fmi, sources=sources)
    root.set("guid" if fmi == 2 else "instantiationToken", token)
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdigit():
        moment = datetime.fromtimestamp(math.floor(int(epoch)), UTC)
        root.set("generationDateAndTime", moment.strftime("%Y-%m-%dT%H:%M:%SZ"))
    return document_bytes(root)


def document_bytes(root: Element) -> bytes:
    """An XML document of an FMU in UTF-8; the same element gives the same bytes."""
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n"


STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;line-height:1.4}"
    "table{border-collapse:collapse;font-size:90%}td,th{border:1px solid #bbb;padding:.2em .5em;text-align:left}"
    "th{background:#eee}code,.equation{font-family:serif;font-style:italic}"
)


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.10g}"


def _start(variable: Variable) -> str:
    if variable.causality == "output":
        return ""
    starts = sorted(set(variable.starts))
    values = variable.starts if len(starts) > 1 else starts
    return ", ".join(_number(value) for value in values)


def _cells(tag: str, texts: list[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag}>" for text in texts) + "</tr>"


def documentation(component: Component) -> str:
    """Return the page of a component: description, equations, variables, effects, refused inputs."""
    lines = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        f"<title>{escape(component.name)}</title>\n<style>{STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(component.name)}</h1>\n<p>{escape(component.description)}.</p>",
        "<h2>Equations</h2>",
        *(f'<p class="equation">{escape(equation)}</p>' for equation in component.equations),
        f"<p>Source: {escape(component.source)}.</p>",
    ]
    if component.effects:
        lines.append("<h2>Effects</h2>\n<ul>")
        for place in component.effects:
            kernel = place.definition.kernel
            summary = (inspect.getdoc(kernel) or "").partition("\n\n")[0] if kernel else ""
            lines.append(f"<li>{escape(place.title)}: {escape(' '.join(summary.split()))}</li>")
        lines.append("</ul>")
    lines.append("<h2>Variables</h2>\n<table>")
    heads = ["name", "size", "causality", "variability", "type", "unit", "start", "min", "max", "description"]
    lines.append(_cells("th", heads))
    for v in component.interface:
        lower, upper = v.limits
        size = str(v.size) if v.size else ""
        texts = [v.name, size, v.causality, v.variability, v.type, v.unit, _start(v), _number(lower), _number(upper)]
        lines.append(_cells("td", [*texts, v.description]))
    lines.append("</table>")
    if component.messages:
        lines.append("<h2>What is refused</h2>\n<ul>")
        lines += [f"<li>{escape(message)}</li>" for message in component.messages]
        lines.append("</ul>")
    lines.append(
        f"<p>Inputs that are set before a step from t of length h hold over (t, t + h]. Default step: "
        f"{_number(component.step_size)} s. Made by Trihedron; licence: BSD-2-Clause.</p>\n</body>\n</html>\n"
    )
    return "\n".join(lines)


def terminals(component: Component) -> bytes:
    """terminalsAndIcons.xml (FMI 3.0): the inputs and the outputs as one terminal each, and the icon."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    SubElement(picture, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", corners)
    group = SubElement(root, "Terminals")
    for name, members in (("inputs", component.of("input")), ("outputs", component.of("output"))):
        if members:
            terminal = SubElement(group, "Terminal", name=name, matchingRule="bus")
            for v in members:
                SubElement(
                    terminal, "TerminalMemberVariable", variableName=v.name, memberName=v.name, variableKind="signal"
                )
    if not len(group):
        root.remove(group)
    return document_bytes(root)


def licence() -> str:
    """Return the text of Trihedron's licence, from the checkout or the installed package."""
    path = Path(__file__).resolve().parents[1] / "LICENSE"
    if path.is_file():
        return path.read_text(encoding="utf-8")
    for distribution in metadata.distributions(name="trihedron"):
        text = distribution.read_text("licenses/LICENSE")
        if text:
            return text
    return "BSD-2-Clause, The Trihedron developers\n"


def header_licence(header: str) -> str:
    """The notice at the head of a header of FMI."""
    notice = re.search(r"Copyright \(C\).*?(?=\*/)", header, re.DOTALL | re.IGNORECASE)
    return "The headers of FMI in sources/:\n\n" + (notice.group().rstrip() if notice else "2-Clause BSD") + "\n"


def accompanying_files(component: Component, fmi: int, header: str | None = None) -> dict[str, bytes]:
    """The files that an FMU ships beside its model description and its code, by their names in the archive.

    Parameters
    ----------
    component : Component
    fmi : int
        2 or 3: where the icon lies, and whether there are terminals
    header : str, optional
        a header of FMI whose notice has to go along
    """
    icon = (Path(__file__).parent / "icon.png").read_bytes()
    files = {
        "documentation/index.html": documentation(component).encode(),
        "documentation/licenses/license.txt": licence().encode(),
    }
    if header is not None:
        files["documentation/licenses/fmi-headers.txt"] = header_licence(header).encode()
    if fmi == 2:
        return files | {"model.png": icon}
    return files | {"terminalsAndIcons/terminalsAndIcons.xml": terminals(component), "terminalsAndIcons/icon.png": icon}


def write_archive(path: Path, members: Mapping[str, bytes], first: str = "modelDescription.xml") -> None:
    """Write an archive in a fixed order with fixed dates, whole or not at all.

    Parameters
    ----------
    path : Path
        the file
    members : mapping
        name inside the archive to content
    first : str
        name of the member that stands first
    """
    incomplete = path.with_suffix(path.suffix + ".part")
    try:
        with zipfile.ZipFile(incomplete, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for name in sorted(members, key=lambda name: (name != first, name)):
                entry = zipfile.ZipInfo(name.replace("\\", "/"), date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, members[name], compresslevel=9)
        incomplete.replace(path)
    finally:
        incomplete.unlink(missing_ok=True)
