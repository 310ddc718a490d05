"""FMU and SSP files: archives with the same bytes on every build, and what accompanies an FMU in one.

That is documentation with equations and variables, licences, icon, terminals.
"""

import inspect
import re
import zipfile
from collections.abc import Mapping
from html import escape
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ..models.effects import CATALOGUE
from .component import Component, Variable

STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;line-height:1.4}"
    "table{border-collapse:collapse;font-size:90%}td,th{border:1px solid #bbb;padding:.2em .5em;text-align:left}"
    "th{background:#eee}code,.equation{font-family:serif;font-style:italic}"
)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.10g}"


def _start(variable: Variable) -> str:
    if variable.causality == "output":
        return ""
    starts = sorted(set(variable.starts))
    values = variable.starts if len(starts) > 1 else starts
    return ", ".join(_number(value) for value in values)


def _cells(tag: str, texts: list[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag}>" for text in texts) + "</tr>"


def documentation(component: Component) -> str:
    """The page of a component: what it is, its equations, its variables, its effects, why it refuses."""
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
            kernel = CATALOGUE[place.effect].at(place).kernel
            said = (inspect.getdoc(kernel) or "").partition("\n\n")[0] if kernel else ""
            lines.append(f"<li>{escape(place.title)}: {escape(' '.join(said.split()))}</li>")
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
    for causality in ("input", "output"):
        members = [v for v in component.interface if v.causality == causality]
        if members:
            terminal = SubElement(group, "Terminal", name=f"{causality}s", matchingRule="bus")
            for v in members:
                SubElement(
                    terminal, "TerminalMemberVariable", variableName=v.name, memberName=v.name, variableKind="signal"
                )
    if not len(group):
        root.remove(group)
    ElementTree.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n"


def licence() -> str:
    """Text of Trihedron's licence: from the checkout, else from what was installed."""
    here = Path(__file__).resolve().parents[1] / "LICENSE"
    if here.is_file():
        return here.read_text(encoding="utf-8")
    texts = [found.read_text("licenses/LICENSE") for found in metadata.distributions(name="trihedron")]
    return next((text for text in texts if text), "BSD-2-Clause, The Trihedron developers\n")


def header_licence(header: str) -> str:
    """The notice at the head of a header of FMI."""
    found = re.search(r"Copyright \(C\).*?(?=\*/)", header, re.DOTALL | re.IGNORECASE)
    return "The headers of FMI in sources/:\n\n" + (found.group().rstrip() if found else "2-Clause BSD") + "\n"


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
    beside = path.with_suffix(path.suffix + ".part")
    try:
        with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for name in sorted(members, key=lambda name: (name != first, name)):
                entry = zipfile.ZipInfo(name.replace("\\", "/"), date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, members[name], compresslevel=9)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
