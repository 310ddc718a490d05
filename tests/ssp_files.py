"""Systems as text, and .ssp files of them."""

import zipfile
from pathlib import Path

from trihedron.tools.ssp.documents import NAMESPACES, declared

HEAD = " ".join(f'{name}="{uri}"' for name, uri in declared(*NAMESPACES).items())
EXPERIMENT = '<ssd:DefaultExperiment startTime="2" stopTime="4"/>'


def values(*parameters: str, units: str = "") -> str:
    """Return a parameter set of `name Type value unit` each."""
    lines = []
    for text in parameters:
        name, kind, value, *unit = text.split("|")
        written = f' unit="{unit[0]}"' if unit else ""
        lines.append(f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{written}/></ssv:Parameter>')
    inside = f"<ssv:Units>{units}</ssv:Units>" if units else ""
    parts = f"<ssv:Parameters>{''.join(lines)}</ssv:Parameters>{inside}"
    return f'<ssv:ParameterSet {HEAD} version="1.0" name="p">{parts}</ssv:ParameterSet>'


def inline(*parameters: str, units: str = "", attributes: str = "", mapping: str = "") -> str:
    inner = f"<ssd:ParameterValues>{values(*parameters, units=units)}</ssd:ParameterValues>"
    return f"<ssd:ParameterBinding {attributes}>{inner}{mapping}</ssd:ParameterBinding>"


def bindings(*elements: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(elements)}</ssd:ParameterBindings>" if elements else ""


def connectors(**kinds: str) -> str:
    elements = "".join(f'<ssd:Connector name="{n.replace("_1", "[1]")}" kind="{k}"/>' for n, k in kinds.items())
    return f"<ssd:Connectors>{elements}</ssd:Connectors>"


def component(name: str, model: str, *bound: str, attributes: str = "", **kinds: str) -> str:
    ends = connectors(**kinds) if kinds else ""
    source = f'source="resources/{model}.fmu"'
    return f'<ssd:Component name="{name}" {source} {attributes}>{ends}{bindings(*bound)}</ssd:Component>'


def system(
    name: str, *elements: str, wires: str = "", bound: tuple[str, ...] = (), after: str = "", **kinds: str
) -> str:
    ends = connectors(**kinds) if kinds else ""
    inner = f"<ssd:Elements>{''.join(elements)}</ssd:Elements>" + (
        f"<ssd:Connections>{wires}</ssd:Connections>" if wires else ""
    )
    return f'<ssd:System name="{name}">{ends}{bindings(*bound)}{inner}{after}</ssd:System>'


def wire(start: str, end: str, inside: str = "") -> str:
    ends = ""
    for side, text in (("start", start), ("end", end)):
        element, dot, name = text.partition(".")
        ends += f' {side}Element="{element}" {side}Connector="{name}"' if dot else f' {side}Connector="{element}"'
    return f"<ssd:Connection{ends}>{inside}</ssd:Connection>"


def packed(folder: Path, fmus: Path, document: str, *models: str, tail: str = EXPERIMENT, **files: str) -> Path:
    """Return an .ssp of a system and FMUs."""
    path = folder / "made.ssp"
    name = "ssd:SystemStructureDescription"
    root = f'<{name} {HEAD} name="made" version="1.0">{document}{tail}</{name}>'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", root)
        for model in models:
            archive.write(fmus / f"{model}.fmu", f"resources/{model}.fmu")
        for name, text in files.items():
            archive.writestr(f"resources/{name.replace('_', '.')}", text)
    return path
