"""SystemStructure.ssd, read: the FMUs, what connects them, the bindings of parameters."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from ..errors import InputError
from ..orchestrator.quantities import Scale
from .bindings import Given, read_bindings
from .document import child, children, local_name, member, number_of, read_document, units_of
from .namespaces import STRUCTURE

FMU = "application/x-fmu-sharedlibrary"
SOURCES_INSIDE = ("input", "parameter")
"""Kinds of a system's own connectors that feed what is inside it."""

Node = tuple[tuple[str, ...], str]
"""A connector: the path of its element, and its name."""


@dataclass
class Part:
    """An FMU or a system.

    Attributes
    ----------
    path : tuple of str
        names of the systems that it is in, without the outermost, and its own
    source : str or None
        the FMU's file in the archive; None for a system
    connectors : dict
        name to kind
    bindings : list of Given
    parts : dict
        a system's elements by name
    edges : list
        a system's connections, (from, to)
    """

    path: tuple[str, ...]
    source: str | None = None
    connectors: dict[str, str] = field(default_factory=dict)
    bindings: list[Given] = field(default_factory=list)
    parts: dict[str, "Part"] = field(default_factory=dict)
    edges: list[tuple[Node, Node]] = field(default_factory=list)

    def walk(self) -> Iterator["Part"]:
        """What it holds, from inside out, and itself last."""
        for part in self.parts.values():
            yield from part.walk()
        yield self


@dataclass(frozen=True)
class Description:
    """A system structure: its outermost system and its experiment; None for what it does not say."""

    system: Part
    units: dict[str, Scale]
    start: float | None
    stop: float | None
    step: float | None


def read_description(folder: Path, label: str) -> Description:
    """Read SystemStructure.ssd of an unpacked archive.

    Raises
    ------
    InputError
        what is not SSP 1 or 2, or an element that is not supported, by its name
    """
    root = read_document(folder, STRUCTURE, label, "ssd:SystemStructureDescription")
    version = root.get("version", "")
    if version.partition(".")[0] not in ("1", "2"):
        raise InputError(f"{label}: is SSP '{version}'; SSP 1.0 and 2.0 are read")
    system = child(root, "ssd:System")
    if system is None:
        raise InputError(f"{label}: {STRUCTURE} has no System")
    units = units_of(root, "ssd:Units", label)
    whole = _read_part(system, (), folder, label, units)
    experiment = child(root, "ssd:DefaultExperiment")
    times: dict[str, float | None] = {"startTime": None, "stopTime": None}
    if experiment is not None:
        times = {key: number_of(experiment, key, label) if key in experiment.attrib else None for key in times}
    return Description(whole, units, times["startTime"], times["stopTime"], _step(system, label))


def _step(system: Element, label: str) -> float | None:
    """The step of OMSimulator's annotation, where there is one."""
    for element in system.iter():
        if local_name(element) in ("FixedStepMaster", "VariableStepMaster"):
            attribute = "stepSize" if "stepSize" in element.attrib else "maximumStepSize"
            if attribute in element.attrib:
                return number_of(element, attribute, label)
    return None


def _read_part(element: Element, path: tuple[str, ...], folder: Path, label: str, units: dict[str, Scale]) -> Part:
    part = Part(path)
    part.connectors = {
        str(c.get("name")): str(c.get("kind")) for c in children(element, "ssd:Connectors/ssd:Connector")
    }
    part.bindings = read_bindings(element, folder, label, units)
    if local_name(element) == "Component":
        kind = element.get("type", FMU)
        if kind != FMU or element.get("implementation") == "ModelExchange":
            what = "model exchange" if kind == FMU else kind
            raise InputError(f"{label}: element '{'.'.join(path)}' is for {what}; co-simulation FMUs are run")
        part.source = member(folder, element.get("source", ""), label)
        return part
    held = child(element, "ssd:Elements")
    for inner in held if held is not None else ():
        name = str(inner.get("name"))
        if local_name(inner) not in ("Component", "System"):
            raise InputError(f"{label}: element '{name}' is a {local_name(inner)}, which is not supported")
        if name in part.parts:
            raise InputError(f"{label}: has two elements '{name}'")
        part.parts[name] = _read_part(inner, (*path, name), folder, label, units)
    part.edges = [_edge(connection, part, label) for connection in children(element, "ssd:Connections/ssd:Connection")]
    return part


def _edge(connection: Element, part: Part, label: str) -> tuple[Node, Node]:
    """A connection from where its value comes to where it goes."""
    ends: list[Node] = []
    feeding: list[bool | None] = []
    for side in ("start", "end"):
        element, name = connection.get(f"{side}Element"), str(connection.get(f"{side}Connector"))
        if element is not None and element not in part.parts:
            raise InputError(f"{label}: a connection names an element '{element}' that is not there")
        owner = part if element is None else part.parts[element]
        kind = owner.connectors.get(name)
        ends.append((owner.path, name))
        outwards = kind in ("output", "calculatedParameter")
        feeding.append(None if kind is None else kind in SOURCES_INSIDE if element is None else outwards)
    named = " -> ".join(".".join([*path, name]) for path, name in ends)
    for transformation in connection:
        if local_name(transformation).endswith("Transformation") and not _identity(transformation, label):
            raise InputError(f"{label}: connection {named} has a {local_name(transformation)}, which is not supported")
    backwards = feeding[0] is False and feeding[1] is not False
    return (ends[1], ends[0]) if backwards else (ends[0], ends[1])


def _identity(transformation: Element, label: str) -> bool:
    factor, offset = number_of(transformation, "factor", label, 1.0), number_of(transformation, "offset", label, 0.0)
    return local_name(transformation) == "LinearTransformation" and (factor, offset) == (1.0, 0.0)


def reached(system: Part) -> dict[Node, list[Node]]:
    """The FMUs' connectors that each connector feeds, through connectors of systems.

    Parameters
    ----------
    system : Part
        the outermost

    Returns
    -------
    dict
        connector of an FMU or a system -> connectors of FMUs
    """
    following: dict[Node, list[Node]] = {}
    for part in system.walk():
        for start, end in part.edges:
            following.setdefault(start, []).append(end)
    systems = {part.path for part in system.walk() if part.source is None}
    found: dict[Node, list[Node]] = {}
    for node in following:
        seen, waiting, ends = {node}, list(following[node]), []
        while waiting:
            following_node = waiting.pop(0)
            if following_node in seen:
                continue
            seen.add(following_node)
            if following_node[0] in systems:
                waiting += following.get(following_node, [])
            else:
                ends.append(following_node)
        found[node] = ends
    return found
