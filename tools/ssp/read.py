"""A scenario from wherever it is: an .ssp made here or elsewhere, checked before it is unpacked, a file, a mapping.

XML of SSP 1.0 is read without entities; values of parameters are taken with their units.
"""

import io
import json
import math
import re
import tempfile
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ...fmus.units import Unit
from ..errors import InputError, one_line, said_of, unreadable
from ..orchestrator.fmu import DAMAGE, check_members, read_archive, refuse_outside, unpack, xml_root
from ..orchestrator.interface import BASE_UNITS, Interface, Value, Variable, checked, interface_of, scale_of
from ..orchestrator.scenario import Scenario, read_scenario
from ..result import checked_sections

BASE = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssd": f"{BASE}Description",
    "ssv": f"{BASE}ParameterValues",
    "ssm": f"{BASE}ParameterMapping",
    "ssc": f"{BASE}Common",
}
STRUCTURE = "SystemStructure.ssd"
"""Name of the description in an .ssp."""
RECORD = "extra/trihedron/record.json"
"""What the scenario records, for `trihedron simulate`; other tools do not read it."""
COUPLING = "extra/trihedron/coupling.json"
"""How the scenario takes cycles, for `trihedron simulate`; there only where it says so."""
COUPLING_SETTINGS = ("coupling", "tolerance", "iterations")
"""What `[run]` says of cycles."""
PROGRAMME = "PositionProgramme"
"""Name of the component that stands for a position programme."""
MOST_BYTES = 128 << 20
DEEPEST = 200
"""Elements in one another: what nests deeper is meant to hurt."""
KINDS = {kind: kind for kind in ("Real", "Integer", "Boolean", "String", "Enumeration")}
KINDS |= {f"Float{bits}": "Real" for bits in (32, 64)}
KINDS |= {f"{sign}{bits}": "Integer" for sign in ("Int", "UInt") for bits in (8, 16, 32, 64)}
"""Types of values in SSP 1.0 and 2.0, and which of FMI 2.0's each is."""
FMU = "application/x-fmu-sharedlibrary"
Path_ = tuple[str, ...]
"""Names of the systems that an element is in, without the outermost, and its own."""
Node = tuple[Path_, str]
"""A connector: the path of its element, and its name."""


@dataclass(frozen=True)
class Given:
    """A value that a binding gives, as it is written, under a name seen from the element that has the binding.

    `scale` is what the documents define of the unit; the mapping has a linear transformation, or one value by value in
    a table, and may suppress the conversion of units.
    """

    name: str
    kind: str
    text: str
    unit: str | None
    scale: Unit | None
    where: str
    factor: float = 1.0
    offset: float = 0.0
    table: Mapping[str, str] | None = None
    convert: bool = True


@dataclass
class Part:
    """An FMU, whose `source` is its file in the archive, or a system with its elements by name and its connections.

    Connectors are name to kind; an edge is (from, to).
    """

    path: Path_
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


@contextmanager
def opened(
    scenario: str | Path | Mapping[str, Any] | Scenario, *, step: float | None = None, coupling: str | None = None
) -> Iterator[tuple[Scenario, tuple[str, ...]]]:
    """The scenario of a file (TOML or .ssp), or of what would stand in it, as long as its files are there.

    With it come the names of an .ssp's parameters that no variable of its system has: SSP has them ignored. A `step` of
    an .ssp [s] that is not given is that of OMSimulator's annotation, or the smallest that an FMU asks for; `coupling`
    is as the exported scenario says.

    Raises
    ------
    InputError
        a file that cannot be used, or `step` and `coupling` where the scenario says them itself
    """
    if isinstance(scenario, str | Path) and Path(scenario).suffix.lower() == ".ssp":
        with scenario_of_ssp(Path(scenario), step=step, coupling=coupling) as imported:
            yield imported
        return
    for option, given, key in (("--step", step, "run.step_s"), ("--coupling", coupling, "run.coupling")):
        if given is not None:
            raise InputError(f"{option}: belongs to an .ssp; a scenario says {key}")
    if isinstance(scenario, str | Path):
        yield read_scenario(scenario), ()
    else:
        yield (scenario if isinstance(scenario, Scenario) else checked_sections(scenario, Scenario)), ()


@contextmanager
def scenario_of_ssp(
    path: Path, *, step: float | None = None, coupling: str | None = None
) -> Iterator[tuple[Scenario, tuple[str, ...]]]:
    """Unpack an .ssp and read it as a scenario; `opened` says more.

    An InputError for an archive that is damaged or unsafe, or what is not supported, by its name.
    """
    with tempfile.TemporaryDirectory(prefix="trihedron-ssp-", ignore_cleanup_errors=True) as name:
        folder = Path(name) / "unpacked"
        folder.mkdir()
        _unpack(path, folder)
        try:
            imported = _scenario(path, folder, step, coupling)
        except RecursionError as error:
            raise InputError(f"{path}: is not a system that can be read (nested too deeply)") from error
        except InputError as error:
            raise InputError(one_line(str(error))) from error
        yield imported


def _unpack(path: Path, folder: Path) -> None:
    """Check an .ssp and unpack it; nothing is written when it does not pass the checks."""
    label = str(path)
    try:
        content = read_archive(path, label, ".ssp")
    except OSError as error:
        raise InputError(f"{label}: {unreadable(path, error)}") from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            check_members(archive.infolist(), label, STRUCTURE)
            archive.extractall(folder)
    except DAMAGE as error:
        raise InputError(f"{label}: is not a readable .ssp archive ({error})") from error


def _scenario(path: Path, folder: Path, step: float | None, coupling: str | None) -> tuple[Scenario, tuple[str, ...]]:
    label = str(path)
    root = read_document(folder, STRUCTURE, label, "ssd:SystemStructureDescription")
    version = root.get("version", "")
    if version.partition(".")[0] not in ("1", "2"):
        raise InputError(f"{label}: is SSP '{version}'; SSP 1.0 and 2.0 are read")
    outermost = child(root, "ssd:System")
    if outermost is None:
        raise InputError(f"{label}: {STRUCTURE} has no System")
    system = _read_part(outermost, (), folder, label, units_of(root, "ssd:Units", label))
    run = _run(root, outermost, label)
    fmus = [part for part in system.walk() if part.source is not None]
    if not fmus:
        raise InputError(f"{label}: has no FMU")
    names = _names(fmus)
    interfaces, steps = _interfaces(fmus, names, folder, label)
    parameters, ignored = _parameters(system, interfaces)
    for at, interface in interfaces.items():
        # How far ahead commands are put out is a matter of the master; ours passes them on at once.
        if interface.model == PROGRAMME and "lead_steps" in interface.variables:
            parameters[at]["lead_steps"] = 0
    if "stop_s" not in run:
        raise InputError(f"{label}: DefaultExperiment has no stopTime, so nothing says when the run ends")
    lengths = [length for length in (step, run.get("step_s"), min(steps, default=None)) if length is not None]
    if not lengths:
        raise InputError(f"{label}: neither it nor its FMUs say how long a step is; give --step")
    data: dict[str, Any] = {
        "title": "",
        "run": {"start_s": 0.0, **run, "step_s": lengths[0], **_coupling(folder, label, coupling)},
        "fmus": {names[p.path]: {"fmu": p.source, "parameters": parameters[p.path]} for p in fmus},
        "connections": [
            {"from": f"{names[source[0]]}.{source[1]}", "to": f"{names[target[0]]}.{target[1]}"}
            for source, targets in _reached(system).items()
            if source[0] in names
            for target in targets
        ],
        "base_folder": folder,
        "source": path,
    }
    recorded = _own(folder, label, RECORD)
    if recorded is not None:
        data["record"] = recorded
    return checked_sections(data, Scenario, label), tuple(dict.fromkeys(ignored))


def _run(root: Element, system: Element, label: str) -> dict[str, float]:
    """The times of the experiment, and the step of OMSimulator's annotation, as far as they are said."""
    run: dict[str, float] = {}
    experiment = child(root, "ssd:DefaultExperiment")
    for key, attribute in (("start_s", "startTime"), ("stop_s", "stopTime")):
        if experiment is not None and attribute in experiment.attrib:
            run[key] = number_of(experiment, attribute, label)
    for element in system.iter():
        if local_name(element) in ("FixedStepMaster", "VariableStepMaster"):
            attribute = "stepSize" if "stepSize" in element.attrib else "maximumStepSize"
            if attribute in element.attrib:
                return {**run, "step_s": number_of(element, attribute, label)}
    return run


def _read_part(element: Element, path: Path_, folder: Path, label: str, units: dict[str, Unit]) -> Part:
    part = Part(path)
    for connector in children(element, "ssd:Connectors/ssd:Connector"):
        part.connectors[str(connector.get("name"))] = str(connector.get("kind"))
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
        # A system's own inputs feed what is inside it.
        sources = ("input", "parameter") if element is None else ("output", "calculatedParameter")
        feeding.append(None if kind is None else kind in sources)
    named = " -> ".join(".".join([*path, name]) for path, name in ends)
    for step in connection:
        kind = local_name(step)
        if not kind.endswith("Transformation"):
            continue
        scaled = number_of(step, "factor", label, 1.0), number_of(step, "offset", label, 0.0)
        if kind != "LinearTransformation" or scaled != (1.0, 0.0):
            raise InputError(f"{label}: connection {named} has a {kind}, which is not supported")
    backwards = feeding[0] is False and feeding[1] is not False
    return (ends[1], ends[0]) if backwards else (ends[0], ends[1])


def _reached(system: Part) -> dict[Node, list[Node]]:
    """The FMUs' connectors that each connector feeds, through connectors of systems."""
    following: dict[Node, list[Node]] = {}
    for start, end in (edge for part in system.walk() for edge in part.edges):
        following.setdefault(start, []).append(end)
    systems = {part.path for part in system.walk() if part.source is None}
    found: dict[Node, list[Node]] = {}
    for node in following:
        seen, waiting = {node}, list(following[node])
        found[node] = []
        while waiting:
            after = waiting.pop(0)
            if after in seen:
                continue
            seen.add(after)
            if after[0] in systems:
                waiting += following.get(after, [])
            else:
                found[node].append(after)
    return found


def _names(fmus: list[Part]) -> dict[Path_, str]:
    """Names in the scenario: the element's own; those of nested systems before it where there are any."""
    names: dict[Path_, str] = {}
    for part in fmus:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", "_".join(part.path))
        names[part.path] = free_name(name if re.match(r"[A-Za-z_]", name) else f"_{name}", names.values())
    return names


def free_name(wanted: str, taken: Collection[str]) -> str:
    """A name that is not taken: with a number from 2 on where the wanted one is."""
    return next(name for name in (wanted, *(f"{wanted}_{i}" for i in range(2, len(taken) + 3))) if name not in taken)


def _interfaces(
    fmus: list[Part], names: Mapping[Path_, str], folder: Path, label: str
) -> tuple[dict[Path_, Interface], list[float]]:
    """The interfaces of the FMUs, and the steps that they ask for."""
    interfaces: dict[Path_, Interface] = {}
    steps: list[float] = []
    for number, part in enumerate(fmus):
        where = f"{label}: {part.source}"
        unpacked = unpack(folder / str(part.source), where, lambda _, n=number: folder.with_name(f"fmu-{n}"))
        interfaces[part.path] = interface_of(names[part.path], where, unpacked.description)
        experiment = unpacked.description.defaultExperiment
        text = experiment.stepSize if experiment is not None else None
        if text:
            try:
                steps.append(float(str(text)))
            except ValueError:
                steps.append(float("nan"))
            if not 0.0 < steps[-1] < float("inf"):
                raise InputError(f"{where}: stepSize is {text!r}, not a positive number")
    return interfaces, steps


def _own(folder: Path, label: str, name: str) -> Any:
    """What Trihedron's own export says beside the system, None where it says nothing."""
    file = folder / name
    if not file.is_file():
        return None
    try:
        return json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(f"{label}: {name}: is not JSON ({error})") from error


def _coupling(folder: Path, label: str, given: str | None) -> dict[str, Any]:
    """How cycles are taken: as asked for, else as the scenario that was exported says."""
    own = {"coupling": given} if given is not None else _own(folder, label, COUPLING)
    if own is None:
        return {}
    if not isinstance(own, dict) or not set(own) <= set(COUPLING_SETTINGS):
        raise InputError(f"{label}: {COUPLING}: has other things than {', '.join(COUPLING_SETTINGS)}")
    return own


def _parameters(system: Part, interfaces: Mapping[Path_, Interface]) -> tuple[dict[Path_, dict[str, Value]], list[str]]:
    """The values of all bindings by FMU, those of outer systems over those of inner ones; names that mean nothing."""
    feeds = _reached(system)
    values: dict[Path_, dict[str, Value]] = {at: {} for at in interfaces}
    ignored: list[str] = []
    for part in system.walk():
        for given in part.bindings:
            targets = _targets(part, given.name, interfaces, feeds)
            if not targets:
                ignored.append(given.name)
            for at, name in targets:
                interface = interfaces[at]
                values[at][name] = value_for(given, interface.variables[name], interface.scales)
    return values, ignored


def _targets(
    part: Part, name: str, interfaces: Mapping[Path_, Interface], feeds: Mapping[Node, list[Node]]
) -> list[Node]:
    """The variables of FMUs that a parameter's hierarchical name means."""
    if part.source is not None:
        return [(part.path, name)] if name in interfaces[part.path].variables else []
    if name in part.connectors:
        fed = feeds.get((part.path, name), [])
        return [(at, variable) for at, variable in fed if variable in interfaces[at].variables]
    for inner, below in part.parts.items():
        if name.startswith(f"{inner}."):
            found = _targets(below, name[len(inner) + 1 :], interfaces, feeds)
            if found:
                return found
    return []


def read_bindings(element: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[Given]:
    """The values of an element's bindings in their order: a later one wins over an earlier one.

    An InputError for a source that is not a file of the archive, or what is not a parameter set of SSP.
    """
    values: list[Given] = []
    for binding in children(element, "ssd:ParameterBindings/ssd:ParameterBinding"):
        if binding.get("type", "application/x-ssp-parameter-set") != "application/x-ssp-parameter-set":
            raise InputError(f"{label}: a parameter binding has type '{binding.get('type')}', which is not supported")
        prefix = binding.get("prefix", "")
        found = [replace(given, name=prefix + given.name) for given in _parameter_set(binding, folder, label, units)]
        mapping = child(binding, "ssd:ParameterMapping")
        if mapping is not None:
            root = _document(mapping, folder, label, "ssm:ParameterMapping")
            entries = children(mapping if root is None else root, "ssm:MappingEntry")
            found = _mapped(found, entries, label)
        values += found
    return values


def _document(element: Element, folder: Path, label: str, root: str, inside: str = "") -> Element | None:
    """What a binding or mapping is: in a file of the archive, or inside; None where it is neither."""
    if element.get("sourceBase", "SSD") != "SSD":
        raise InputError(f"{label}: a source inside an FMU ('{element.get('source')}') is not supported")
    source = element.get("source")
    return read_document(folder, source, label, root) if source else child(element, f"{inside}{root}")


def _parameter_set(binding: Element, folder: Path, label: str, units: Mapping[str, Unit]) -> list[Given]:
    root = _document(binding, folder, label, "ssv:ParameterSet", "ssd:ParameterValues/")
    where = f"{label}: {binding.get('source')}" if binding.get("source") else label
    if root is None:
        raise InputError(f"{label}: a parameter binding has neither a source nor values")
    scales = {**units, **units_of(root, "ssv:Units", where)}
    values = []
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        typed = [e for e in parameter if e.tag in {f"{{{NAMESPACES['ssv']}}}{kind}" for kind in KINDS}][:1]
        if not typed or typed[0].get("value") is None:
            raise InputError(f"{where}: parameter '{name}' has no value of a type that FMI 2.0 has")
        unit, kind = typed[0].get("unit"), KINDS[local_name(typed[0])]
        values.append(Given(name, kind, typed[0].get("value", ""), unit, scales.get(unit or ""), where))
    return values


def _mapped(values: Sequence[Given], entries: Sequence[Element], label: str) -> list[Given]:
    """The values under the names that a mapping gives them; what it does not name keeps its name."""
    mapped = []
    for given in values:
        mine = [entry for entry in entries if entry.get("source", "") == given.name]
        mapped += [_transformed(given, entry, label) for entry in mine] if mine else [given]
    return mapped


def _transformed(given: Given, entry: Element, label: str) -> Given:
    convert = entry.get("suppressUnitConversion") not in ("true", "1")
    given = replace(given, name=entry.get("target", ""), convert=convert)
    for step in entry:
        if local_name(step) == "LinearTransformation":
            where = f"{label}: mapping of '{given.name}'"
            factor, offset = number_of(step, "factor", where, 1.0), number_of(step, "offset", where, 0.0)
            return replace(given, factor=factor, offset=offset)
        if local_name(step).endswith("MappingTransformation"):
            table = {e.get("source", ""): e.get("target", "") for e in step if local_name(e) == "MapEntry"}
            return replace(given, table=table)
    return given


def value_for(given: Given, variable: Variable, scales: Mapping[str, Unit]) -> Value:
    """A binding's value as the variable takes it, in the variable's unit.

    An InputError for a text that is no such value, another type or dimension, or a value outside the variable's limits.
    """
    text = given.text if given.table is None else given.table.get(given.text, given.text)
    with said_of(f"{given.where}: parameter '{given.name}'"):
        try:
            value = _value(text, given, variable)
        except (ValueError, KeyError, OverflowError) as error:
            raise InputError(f"'{text}' is not a value of {variable.name}, which is {variable.kind}") from error
        if variable.kind == "Real" and given.convert:
            value = _converted(float(value), given, variable, scales)
        return checked(value, variable)


def _value(text: str, given: Given, variable: Variable) -> Value:
    """The value of a text by the variable's type, which must be that of the text."""
    kinds = (variable.kind, given.kind)
    if kinds in (("Real", "Real"), ("Real", "Integer")):
        plain = float(_ascii(text))
        return given.factor * plain + given.offset if given.factor != 1.0 or given.offset else plain
    if kinds == ("Boolean", "Boolean"):
        return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
    if kinds == ("String", "String"):
        return text
    if kinds == ("Enumeration", "Enumeration"):
        named = {item: value for value, item in variable.items}
        return named[text] if text in named else int(_ascii(text))
    if kinds in (("Integer", "Integer"), ("Enumeration", "Integer")):
        value = given.factor * int(_ascii(text)) + given.offset
        return int(value) if math.isfinite(value) and value == int(value) else value
    raise InputError(f"is {given.kind}, but {variable.name} is {variable.kind}")


def _ascii(text: str) -> str:
    """A number as XML writes it: Python would take other digits and 1_000 too."""
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return text


def _converted(value: float, given: Given, variable: Variable, scales: Mapping[str, Unit]) -> float:
    """A value from the binding's unit into the variable's."""
    if given.unit is None or variable.unit is None:
        return value
    mine, theirs = scales.get(variable.unit), given.scale or scales.get(given.unit)
    if given.unit == variable.unit and (mine is None or theirs is None):
        return value
    if mine is None or theirs is None or mine.exponents != theirs.exponents:
        raise InputError(f"is in {given.unit}, but {variable.name} is in {variable.unit}")
    if (mine.factor, mine.offset) == (theirs.factor, theirs.offset):
        return value
    return (theirs.factor * value + theirs.offset - mine.offset) / mine.factor


def children(element: Element, path: str) -> list[Element]:
    """The elements at a path of prefixed names."""
    return element.findall(path, NAMESPACES)


def child(element: Element, path: str) -> Element | None:
    """The first element at a path of prefixed names."""
    return element.find(path, NAMESPACES)


def local_name(element: Element) -> str:
    """An element's name without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def declared(*prefixes: str) -> dict[str, str]:
    """Attributes that declare namespaces."""
    return {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}


def parsed(xml: bytes, label: str, root: str) -> Element:
    """The root element of an XML document; an InputError for a DOCTYPE, nesting too deep, or another root."""
    if len(xml) > MOST_BYTES:
        raise InputError(f"{label}: is larger than {MOST_BYTES >> 20} MiB; not read")
    xml_root(xml, f"{label}:", "an .ssp", DEEPEST)
    try:
        element = ElementTree.fromstring(xml)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{label}: is not well-formed XML ({error})") from error
    prefix, _, name = root.partition(":")
    if element.tag != f"{{{NAMESPACES[prefix]}}}{name}":
        raise InputError(f"{label}: its root is <{local_name(element)}>, not <{root}> of SSP")
    return element


def read_document(folder: Path, source: str, label: str, root: str) -> Element:
    """The root element, of this prefixed name, of a file that a URI relative to the unpacked archive names."""
    name = f"{label}: {source}"
    try:
        content = (folder / member(folder, source, label)).read_bytes()
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror})") from error
    return parsed(content, name, root)


def member(folder: Path, source: str, label: str) -> str:
    """The file of the archive that a URI names; what lies elsewhere is refused."""
    try:
        parts = urlsplit(source)
    except ValueError as error:
        raise InputError(f"{label}: source '{source}' is not a URI ({error})") from error
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path:
        raise InputError(f"{label}: source '{source}' is not a file of the archive; nothing else is opened")
    path = unquote(parts.path).removeprefix("./")
    refuse_outside(path, label, ssp=True)
    if not (folder / path).is_file():
        raise InputError(f"{label}: has no file '{path}', which its description names")
    return path


def number_of(element: Element, attribute: str, label: str, default: float | None = None) -> float:
    """A number of an attribute; refused where it is missing without a default, or is none."""
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = float(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{label}: {attribute} of <{local_name(element)}> is {text!r}, not a finite number")
    return value


def units_of(root: Element, path: str, label: str) -> dict[str, Unit]:
    """The units that a document defines; an InputError for one that is none."""
    units: dict[str, Unit] = {}
    for unit in children(root, f"{path}/ssc:Unit"):
        base = child(unit, "ssc:BaseUnit")
        if base is None:
            continue
        where = f"{label}: unit '{unit.get('name')}'"
        exponents = {key: number_of(base, key, where, 0.0) for key in BASE_UNITS}
        factor = number_of(base, "factor", where, 1.0)
        if factor == 0.0:
            raise InputError(f"{where}: factor is 0")
        for key, power in exponents.items():
            if not power.is_integer():
                raise InputError(f"{where}: the exponent of {key} is {power:g}, not a whole number")
        whole = {key: int(power) for key, power in exponents.items()}
        units[str(unit.get("name"))] = scale_of(whole, factor, number_of(base, "offset", where, 0.0))
    return units
