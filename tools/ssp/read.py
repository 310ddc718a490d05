"""A scenario from wherever it is: an .ssp made here or elsewhere, checked before it is unpacked, a file, a mapping."""

import io
import json
import re
import zipfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ...fmus.motions import TIMED_ROWS
from ...fmus.units import Unit
from ..errors import InputError, full, one_line
from ..files import bytes_of
from ..locks import own_folder
from ..orchestrator.adjustments import Adjustments
from ..orchestrator.archive import DAMAGE, check_members, unpack
from ..orchestrator.interface import Interface, Value, between, interface_of
from ..orchestrator.load import alone
from ..orchestrator.scenario import RunOptions, Scenario, read_scenario
from ..result import checked_sections
from .documents import (
    BoundValue,
    child,
    children,
    document_units,
    local_name,
    member,
    number_of,
    read_bindings,
    read_document,
    value_for,
)

STRUCTURE = "SystemStructure.ssd"
"""Name of the description in an .ssp."""
RECORD = "extra/trihedron/record.json"
"""Names that the scenario records, for `trihedron simulate`; other tools do not read them."""
COUPLING = "extra/trihedron/coupling.json"
"""How the scenario takes cycles and different steps, for `trihedron simulate`; there only where it says so."""
COUPLING_SETTINGS = ("coupling", "tolerance", "iterations")
"""What `[run]` says of cycles."""
RATES = ("steps", "between")
"""FMU -> its own step [s]; connection, as "a.x -> b.u" -> rule between different steps."""
PROGRAMME = "PositionProgramme"
"""Name of the component that stands for a position programme."""
LEADING = (PROGRAMME, TIMED_ROWS)
"""Components whose outputs are known before the run."""
NO_OPTIONS, NO_ADJUSTMENTS = RunOptions(), Adjustments()
DICTIONARY = "SignalDictionaryReference"
FMU = "application/x-fmu-sharedlibrary"
Path_ = tuple[str, ...]
"""Names of the systems that an element is in, without the outermost, and its own."""
Node = tuple[Path_, str]
"""A connector: the path of its element, and its name."""


@dataclass(frozen=True)
class ConnectorUnit:
    """Unit of a connector: a name in some scales, `relative` if its offset does not apply."""

    name: str
    scales: Mapping[str, Unit]
    relative: bool = False


@dataclass(frozen=True)
class Transformation:
    """What connections do to a value: factor * value + offset, from the first unit on the way to the last one.

    A step that does not `convert` takes the number as it is into the next unit.
    """

    factor: float = 1.0
    offset: float = 0.0
    convert: bool = True
    first: ConnectorUnit | None = None
    unit: ConnectorUnit | None = None

    def then(self, step: "Transformation", unit: ConnectorUnit | None, where: str) -> "Transformation":
        """Return this transformation with a further step, which ends at a connector with a unit.

        Raises InputError for units of different dimensions.
        """
        factor, offset = step.factor * self.factor, step.factor * self.offset + step.offset
        if step.convert and unit is not None and self.unit is not None:
            relative = self.unit.relative or unit.relative
            scaled = between(self.unit.name, unit.name, self.unit.scales, unit.scales, relative=relative)
            if scaled is None:
                raise InputError(f"{where}: {self.unit.name} cannot be converted to {unit.name}")
            factor, offset = scaled[0] * factor, scaled[0] * offset + scaled[1]
        return Transformation(factor, offset, first=self.first or unit, unit=unit or self.unit)

    def of(self, binding: BoundValue) -> BoundValue:
        """Return a bound value behind these connections."""
        begin = Transformation()
        if binding.unit is not None and self.first is not None:
            scales = dict(self.first.scales)
            if binding.scale is not None:
                scales[binding.unit] = binding.scale
            begin = Transformation(unit=ConnectorUnit(binding.unit, scales))
        mapping = Transformation(binding.factor, binding.offset, binding.convert)
        whole = begin.then(mapping, self.first, f"{binding.where}: parameter '{binding.name}'")
        whole = whole.then(replace(self, convert=False), None, "")
        return replace(binding, factor=whole.factor, offset=whole.offset)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of a connection of the scenario, which converts no unit again."""
        settings: dict[str, Any] = {}
        if (self.factor, self.offset) != (1.0, 0.0):
            settings = {"factor": self.factor, "offset": self.offset}
        if self.first is not None and self.unit is not None:
            settings["convert"] = False
        return settings


@dataclass(frozen=True)
class _Place:
    """Where an element is: its path, and the paths of the signal dictionaries of the systems around it.

    All references to a dictionary have its path, so that they share their signals.
    """

    path: Path_
    dictionaries: Mapping[str, Path_] = field(default_factory=dict)


Edge = tuple[Node, Node, Transformation]
INTERFACES = {"ModelExchange": "me", "CoSimulation": "cs"}


@dataclass
class SystemPart:
    """An FMU, with its file in the archive as `source`, or a system with named elements and connections.

    Connectors are name to kind, and `units` are those that they declare, in the document's `scales`; an edge is (from,
    to, transformation). An FMU has an `interface` if it must be one.
    """

    path: Path_
    source: str | None = None
    scales: Mapping[str, Unit] = field(default_factory=dict)
    connectors: dict[str, str] = field(default_factory=dict)
    units: dict[str, ConnectorUnit] = field(default_factory=dict)
    bindings: list[BoundValue] = field(default_factory=list)
    parts: dict[str, "SystemPart"] = field(default_factory=dict)
    edges: list["Edge"] = field(default_factory=list)
    interface: str | None = None

    def walk(self) -> Iterator["SystemPart"]:
        """Yield all parts, from inside out, and this one last."""
        for part in self.parts.values():
            yield from part.walk()
        yield self


@contextmanager
def opened(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    options: RunOptions,
    adjustments: Adjustments = NO_ADJUSTMENTS,
) -> Iterator[tuple[Scenario, tuple[str, ...]]]:
    """Return the scenario of a file (TOML, .ssp or .fmu) or of its content, as long as its files exist.

    With it come the names of an .ssp's parameters that no variable of its system has: SSP has them ignored. By default
    the step of an .ssp is that of OMSimulator's annotation, or the smallest that an FMU asks for. Its cycles are
    coupled as the exported scenario states.

    Raises
    ------
    InputError
        a file that cannot be used, or an option where the scenario says it itself
    """
    ending = ""
    if isinstance(scenario, str | Path):
        ending = Path(scenario).suffix.lower()
    if isinstance(scenario, str | Path) and ending == ".ssp":
        with scenario_of_ssp(Path(scenario), options) as (system, ignored):
            yield adjustments.on(system, options), ignored
        return
    if isinstance(scenario, str | Path) and ending == ".fmu":
        options.refuse("an .ssp", coupling="an .fmu alone has no cycles")
        yield adjustments.on(alone(Path(scenario), options, adjustments.interface), options), ()
        return
    says = {key: f"a scenario says run.{key}_s" for key in ("start", "stop")}
    options.refuse("an .ssp or an .fmu", **says)
    options.refuse("an .ssp or an .fmu", step="a scenario says run.step_s")
    options.refuse("an .ssp", coupling="a scenario says run.coupling")
    if isinstance(scenario, str | Path):
        yield adjustments.on(read_scenario(scenario), options), ()
    else:
        if isinstance(scenario, Scenario):
            checked = scenario
        else:
            checked = checked_sections(scenario, Scenario)
        yield adjustments.on(checked, options), ()


@contextmanager
def scenario_of_ssp(path: Path, options: RunOptions = NO_OPTIONS) -> Iterator[tuple[Scenario, tuple[str, ...]]]:
    """Unpack an .ssp and read it as a scenario; see `opened`.

    An InputError, with the name of the part, for an archive that is damaged or unsafe, or has parts that are not
    supported.
    """
    with own_folder() as folder:
        _unpack(path, folder)
        try:
            imported = _scenario(path, folder, options)
        except RecursionError as error:
            raise InputError(f"{path}: is not a system that can be read (nested too deeply)") from error
        except InputError as error:
            raise InputError(one_line(str(error))) from error
        yield imported


def _unpack(path: Path, folder: Path) -> None:
    """Check an .ssp and unpack it; nothing is written when it does not pass the checks."""
    label = str(path)
    content = bytes_of(path, "give an .ssp file", archive=True)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            check_members(archive.infolist(), label, STRUCTURE)
            archive.extractall(folder)
    except DAMAGE as error:
        if full(error):
            raise
        raise InputError(f"{label}: is not a readable .ssp archive ({error})") from error


def _scenario(path: Path, folder: Path, options: RunOptions) -> tuple[Scenario, tuple[str, ...]]:
    label = str(path)
    root = read_document(folder, STRUCTURE, label, "ssd:SystemStructureDescription")
    version = root.get("version", "")
    if version.partition(".")[0] not in ("1", "2"):
        raise InputError(f"{label}: is SSP '{version}'; SSP 1.0 and 2.0 are read")
    outermost = child(root, "ssd:System")
    if outermost is None:
        raise InputError(f"{label}: {STRUCTURE} has no System")
    system = _read_part(outermost, _Place(()), folder, label, document_units(root, "ssd:Units", label))
    run = _run(root, label)
    for key, seconds in (("start_s", options.start), ("stop_s", options.stop)):
        if seconds is not None:
            run[key] = seconds
    fmus = [part for part in system.walk() if part.source is not None]
    if not fmus:
        raise InputError(f"{label}: has no FMU")
    names = _names(fmus)
    interfaces, steps = _interfaces(fmus, names, folder, label)
    parameters, ignored = _parameters(system, interfaces)
    coupled = _coupling(folder, label, options.coupling)
    own_steps, rules = (coupled.pop(name, {}) for name in RATES)
    for at, interface in interfaces.items():
        # The master decides how early it puts out commands; ours passes them on at once.
        if coupled.get("coupling") != "delayed" and interface.model in LEADING and "lead_steps" in interface.variables:
            parameters[at]["lead_steps"] = 0
    lengths = []
    for length in (options.step, run.get("step_s"), min(steps, default=None)):
        if length is not None:
            lengths.append(length)
    if not lengths:
        raise InputError(f"{label}: neither it nor its FMUs say how long a step is; give --step")
    settings_of_fmus: dict[str, dict[str, Any]] = {}
    for part in fmus:
        name = names[part.path]
        setting = {"fmu": part.source, "parameters": parameters[part.path], "step_s": own_steps.get(name)}
        setting["interface"] = part.interface
        settings_of_fmus[name] = setting
    connections: list[dict[str, Any]] = []
    notes = []
    if "stop_s" not in run:
        run["stop_s"] = run.get("start_s", 0.0) + 1.0
        notes.append(f"{label} says no stop time: the run ends at {run['stop_s']:g} s; --stop says another")
    for source, targets in _reached(system, _units(system, interfaces)).items():
        for target, transformation in targets if source[0] in names else ():
            start, end = f"{names[source[0]]}.{source[1]}", f"{names[target[0]]}.{target[1]}"
            ends = {"from": start, "to": end, "between": rules.get(f"{start} -> {end}")}
            connections.append({**ends, **transformation.settings})
    settings: dict[str, Any] = {
        "title": "",
        "run": {"start_s": 0.0, **run, "step_s": lengths[0], "shorten": True, **coupled},
        "fmus": settings_of_fmus,
        "connections": connections,
        "notes": notes,
        "base_folder": folder,
        "source": path,
    }
    recorded = _own(folder, label, RECORD)
    if recorded is not None:
        settings["record"] = recorded
    return checked_sections(settings, Scenario, label), tuple(dict.fromkeys(ignored))


def _run(root: Element, label: str) -> dict[str, float]:
    """Return the times of the experiment, and the step of the outermost annotation of OMSimulator or OSP."""
    run: dict[str, float] = {}
    experiment = child(root, "ssd:DefaultExperiment")
    for key, attribute in (("start_s", "startTime"), ("stop_s", "stopTime")):
        if experiment is not None and attribute in experiment.attrib:
            run[key] = number_of(experiment, attribute, label)
    elements = [root]
    for element in elements:
        elements += element
        if "baseStepSize" in element.attrib:
            # The Open Simulation Platform writes it into the experiment.
            return {**run, "step_s": number_of(element, "baseStepSize", label)}
        if local_name(element) in ("FixedStepMaster", "VariableStepMaster"):
            attribute = "maximumStepSize"
            if "stepSize" in element.attrib:
                attribute = "stepSize"
            if attribute in element.attrib:
                return {**run, "step_s": number_of(element, attribute, label)}
    return run


def _read_part(element: Element, place: "_Place", folder: Path, label: str, units: dict[str, Unit]) -> SystemPart:
    path = place.path
    part = SystemPart(path, scales=units)
    for connector in children(element, "ssd:Connectors/ssd:Connector"):
        part.connectors[str(connector.get("name"))] = str(connector.get("kind"))
        for typed in connector:
            if typed.get("unit") in units:
                part.units[str(connector.get("name"))] = ConnectorUnit(typed.get("unit", ""), units)
    part.bindings = read_bindings(element, folder, label, units)
    if local_name(element) == "Component":
        kind = element.get("type", FMU)
        if kind != FMU:
            raise InputError(f"{label}: element '{'.'.join(path)}' is of type {kind}; FMUs are run")
        part.interface = INTERFACES.get(element.get("implementation", "any"))
        part.source = member(folder, element.get("source", ""), label)
        return part
    dictionaries = dict(place.dictionaries)
    for dictionary in children(element, "ssd:SignalDictionaries/ssd:SignalDictionary"):
        name = str(dictionary.get("name"))
        dictionaries[name] = (*path, f"{DICTIONARY} {name}")
    elements = child(element, "ssd:Elements")
    for inner in elements if elements is not None else ():
        name, kind = str(inner.get("name")), local_name(inner)
        at = (*path, name)
        if kind == DICTIONARY:
            dictionary = str(inner.get("dictionary"))
            if dictionary not in dictionaries:
                raise InputError(
                    f"{label}: element '{name}' names a signal dictionary '{dictionary}' that is not there"
                )
            at = dictionaries[dictionary]
        elif kind not in ("Component", "System"):
            raise InputError(f"{label}: element '{name}' is a {kind}, which is not supported")
        if name in part.parts:
            raise InputError(f"{label}: has two elements '{name}'")
        part.parts[name] = _read_part(inner, _Place(at, dictionaries), folder, label, units)
    part.edges = [_edge(connection, part, label) for connection in children(element, "ssd:Connections/ssd:Connection")]
    return part


def _edge(connection: Element, part: SystemPart, label: str) -> Edge:
    """A connection from where its value comes to where it goes, and what happens to it."""
    ends: list[Node] = []
    feeding: list[bool | None] = []
    for side in ("start", "end"):
        # Some tools write an empty element for the system itself.
        element, name = connection.get(f"{side}Element") or None, str(connection.get(f"{side}Connector"))
        if element is not None and element not in part.parts:
            raise InputError(f"{label}: a connection names an element '{element}' that is not there")
        if element is None:
            owner = part
        else:
            owner = part.parts[element]
        kind = owner.connectors.get(name)
        ends.append((owner.path, name))
        # The inputs of a system feed its parts.
        sources = ("output", "calculatedParameter")
        if element is None:
            sources = ("input", "parameter")
        feeding.append(None if kind in (None, "inout") else kind in sources)
    ends_text = " -> ".join(".".join([*path, name]) for path, name in ends)
    convert = connection.get("suppressUnitConversion") not in ("true", "1")
    transformation = Transformation(convert=convert)
    for step in connection:
        kind = local_name(step)
        if not kind.endswith("Transformation"):
            continue
        if kind != "LinearTransformation":
            raise InputError(f"{label}: connection {ends_text} has a {kind}, which is not supported")
        where = f"{label}: connection {ends_text}"
        scaled = number_of(step, "factor", where, 1.0), number_of(step, "offset", where, 0.0)
        transformation = Transformation(*scaled, convert)
    start, end = feeding
    # A signal of a dictionary may be at either end.
    if (start is False and end is not False) or (start is None and end is True):
        ends.reverse()
    return ends[0], ends[1], transformation


def _units(system: SystemPart, interfaces: Mapping[Path_, Interface]) -> dict[Node, ConnectorUnit]:
    """The units of connectors: of the FMUs' variables, otherwise as the system declares them."""
    units: dict[Node, ConnectorUnit] = {}
    for part in system.walk():
        units |= {(part.path, name): unit for name, unit in part.units.items()}
        if part.path in interfaces:
            interface = interfaces[part.path]
            arrays = {base: elements[0] for base, elements in interface.arrays.items()}
            for name, variable in {**arrays, **interface.variables}.items():
                if variable.unit is not None:
                    scales = {**part.scales, **interface.scales}
                    units[part.path, name] = ConnectorUnit(variable.unit, scales, variable.relative)
    return units


def _reached(system: SystemPart, units: Mapping[Node, ConnectorUnit]) -> dict[Node, list[tuple[Node, Transformation]]]:
    """The FMUs' connectors that each connector feeds, through connectors of systems, each with its transformation."""
    following: dict[Node, list[tuple[Node, Transformation]]] = {}
    for part in system.walk():
        for start, end, transformation in part.edges:
            following.setdefault(start, []).append((end, transformation))

    def beyond(so_far: Transformation, step: Transformation, end: Node) -> tuple[Node, Transformation]:
        """Return the end of a further connection, and the transformation up to it."""
        return end, so_far.then(step, units.get(end), f"a connection to {'.'.join(end[0])}.{end[1]}")

    systems = set()
    for part in system.walk():
        if part.source is None:
            systems.add(part.path)
    targets: dict[Node, list[tuple[Node, Transformation]]] = {}
    for node in following:
        begin = Transformation(first=units.get(node), unit=units.get(node))
        visited, waiting = {node}, [beyond(begin, step, end) for end, step in following[node]]
        targets[node] = []
        while waiting:
            after, so_far = waiting.pop(0)
            if after in visited:
                continue
            visited.add(after)
            if after[0] not in systems:
                targets[node].append((after, so_far))
                continue
            for further, step in following.get(after, []):
                waiting.append(beyond(so_far, step, further))
    return targets


def _names(fmus: list[SystemPart]) -> dict[Path_, str]:
    """Return names in the scenario: the element's own, preceded by those of nested systems."""
    names: dict[Path_, str] = {}
    for part in fmus:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", "_".join(part.path))
        if re.match(r"[A-Za-z_]", name):
            plain_name = name
        else:
            plain_name = f"_{name}"
        names[part.path] = free_name(plain_name, names.values())
    return names


def free_name(stem: str, names: Collection[str]) -> str:
    """A name that is not taken: with a number from 2 on where the wanted one is."""
    name, number = stem, 2
    while name in names:
        name, number = f"{stem}_{number}", number + 1
    return name


def _interfaces(
    fmus: list[SystemPart], names: Mapping[Path_, str], folder: Path, label: str
) -> tuple[dict[Path_, Interface], list[float]]:
    """The interfaces of the FMUs, and the steps that they ask for."""
    interfaces: dict[Path_, Interface] = {}
    steps: list[float] = []
    for number, part in enumerate(fmus):
        where = f"{label}: {part.source}"
        unpacked = unpack(
            folder / str(part.source), where, lambda _, n=number: folder.with_name(f"fmu-{n}"), part.interface
        )
        interfaces[part.path] = interface_of(names[part.path], where, unpacked.description)
        experiment = unpacked.description.defaultExperiment
        text = None
        if experiment is not None:
            text = experiment.stepSize
        if text:
            try:
                steps.append(float(str(text)))
            except ValueError:
                steps.append(float("nan"))
            if not 0.0 < steps[-1] < float("inf"):
                raise InputError(f"{where}: stepSize is {text!r}, not a positive number")
    return interfaces, steps


def _own(folder: Path, label: str, name: str) -> Any:
    """Return the data that Trihedron's own export adds to the system, or None."""
    file = folder / name
    if not file.is_file():
        return None
    try:
        return json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(f"{label}: {name}: is not JSON ({error})") from error


def _coupling(folder: Path, label: str, choice: str | None) -> dict[str, Any]:
    """Return the coupling of cycles, from the option or else from the exported scenario, and its different steps."""
    exported = _own(folder, label, COUPLING) or {}
    keys = COUPLING_SETTINGS + RATES
    if not isinstance(exported, dict) or not set(exported) <= set(keys):
        raise InputError(f"{label}: {COUPLING}: has other things than {', '.join(keys)}")
    for name in RATES:
        if not isinstance(exported.get(name, {}), dict):
            raise InputError(f"{label}: {COUPLING}: {name} must be a mapping")
    if choice is None:
        return exported
    return {"coupling": choice, **{name: exported[name] for name in RATES if name in exported}}


def _parameters(
    system: SystemPart, interfaces: Mapping[Path_, Interface]
) -> tuple[dict[Path_, dict[str, Value]], list[str]]:
    """Return the values of all bindings by FMU, where outer systems override inner ones, and the unknown names."""
    units = _units(system, interfaces)
    feeds = _reached(system, units)
    values: dict[Path_, dict[str, Value]] = {at: {} for at in interfaces}
    ignored: list[str] = []
    for part in system.walk():
        for binding in part.bindings:
            targets = _targets(part, binding.name, interfaces, feeds, units)
            if not targets:
                ignored.append(binding.name)
            for (at, name), transformation in targets:
                interface = interfaces[at]
                transformed = transformation.of(binding)
                values[at][name] = value_for(transformed, interface.variables[name])
    return values, ignored


def _targets(
    part: SystemPart,
    name: str,
    interfaces: Mapping[Path_, Interface],
    feeds: Mapping[Node, list[tuple[Node, Transformation]]],
    units: Mapping[Node, ConnectorUnit],
) -> list[tuple[Node, Transformation]]:
    """The variables of FMUs that a parameter's hierarchical name means, and what connections do to the value."""
    if part.source is not None:
        if name not in interfaces[part.path].variables:
            return []
        unit = units.get((part.path, name))
        return [((part.path, name), Transformation(first=unit, unit=unit))]
    if name in part.connectors:
        fed = feeds.get((part.path, name), [])
        variables = []
        for (at, variable), transformation in fed:
            if variable in interfaces[at].variables:
                variables.append(((at, variable), transformation))
        return variables
    for inner, below in part.parts.items():
        if name.startswith(f"{inner}."):
            variables = _targets(below, name[len(inner) + 1 :], interfaces, feeds, units)
            if variables:
                return variables
    return []
