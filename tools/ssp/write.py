"""A scenario as an .ssp: its system for other tools, of FMUs alone.

Position programmes become components, constants become parameters, so that no stimulus is left.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ...fmus import build
from ...fmus.archive import write_archive
from ...fmus.native.compile import BuildError, chosen_platforms
from ...fmus.parameters import add_units, parameter_file, xml_bytes
from ...fmus.units import Unit, number
from ...models.effects import place_from_mapping
from ...models.table_commands import POSITIONS
from ..errors import InputError, said_of
from ..files import json_text, whole_file
from ..locks import own_folder
from ..orchestrator.interface import Interface, Value, Variable, spread
from ..orchestrator.load import (
    Loaded,
    Sources,
    Wire,
    calibrated_parameters,
    interfaces_of,
    load,
    resolve_connections,
    usual_flavour,
)
from ..orchestrator.scenario import Scenario, Stimulus
from ..orchestrator.stimuli import (
    Drive,
    Grid,
    NumberTable,
    check_single_sources,
    make_grid,
    resolve_constant,
    resolve_programme,
    table_of,
)
from .read import COUPLING, COUPLING_SETTINGS, PROGRAMME, RECORD, STRUCTURE, free_name
from .xml import declared

OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
"""Namespace of OMSimulator's annotations."""


def export_ssp(
    scenario: Scenario,
    out: Path,
    *,
    flavour: Literal["python", "native"] | None = None,
    fmi: int = 2,
    platform: str | None = None,
) -> Path:
    """Write the system of a scenario as an .ssp of SSP 1.0, whose path is returned; the same scenario, the same bytes.

    Position programmes become components PositionProgramme, constants become parameters.

    Parameters
    ----------
    flavour : str, optional
        "python": components run by PythonFMU, which C++ hosts cannot load; "native": compiled, the default where
        there is a compiler
    fmi : int
        2: the tools that open an .ssp take FMI 2.0
    platform : str, optional
        of the native flavour: "host" (the default), "all" or a name

    Raises
    ------
    InputError
        what the scenario asks for and cannot be done, or what cannot stand in an .ssp: timed rows, names that other
        tools do not take
    """
    if out.suffix.lower() != ".ssp":
        raise InputError(f"{out}: must end in .ssp; other tools know it by that")
    if fmi != 2:
        raise InputError(f"--fmi {fmi}: an .ssp has FMUs of FMI 2.0; FMPy and OMSimulator run no others in it")
    if flavour is None:
        flavour = "native" if platform is not None else usual_flavour()
    if flavour == "python" and platform is not None:
        raise InputError("--platform: belongs to --flavour native; PythonFMU brings its own binaries")
    platform = "host" if platform is None else platform
    try:
        if flavour == "native":
            chosen_platforms(platform)
        with own_folder() as scratch:
            members = _members(scenario, flavour, platform, scratch)
    except BuildError as error:
        raise InputError(f"--flavour native: {error}") from error
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(f"{prefix}{error}") from error
    with whole_file(out) as beside:
        write_archive(beside, members, first=STRUCTURE)
    return out


def self_contained(scenario: Scenario) -> Scenario:
    """The scenario with FMUs and parameters in place of its stimuli; it gives the same run.

    An InputError for timed rows, which no component carries, or a programme of too many positions.
    """
    with own_folder() as folder:
        loaded = load(scenario, Sources(scenario.base_folder), folder)
    interfaces = interfaces_of(loaded)
    written = scenario.model_dump(by_alias=True, exclude_none=True, exclude={"stimuli", "base_folder", "source"})
    fmus, connections = dict(written["fmus"]), list(written["connections"])
    ends, first = [], {}
    for count, stimulus in enumerate(scenario.stimuli, start=1):
        with said_of(f"stimuli[{count}]"):
            if stimulus.kind == "rows":
                raise InputError("timed rows cannot stand in an .ssp; give constants or a position programme")
            if stimulus.kind == "constant":
                drive = resolve_constant(stimulus, interfaces)
                given = dict(zip((v.name for v in drive.variables), drive.values[0], strict=True))
                _set(fmus, interfaces[drive.fmu], given)
                continue
            positions, _ = table_of(stimulus, f"stimuli[{count}]", scenario.base_folder)
            drive, end = resolve_programme(stimulus, positions, scenario.run.step_s, loaded)
            ends.append(end)
            name = free_name("programme", [*fmus, *first])
            parameters = _parameters(drive, positions, stimulus, loaded[drive.fmu], scenario.run.step_s)
            first[name] = {"component": PROGRAMME, "parameters": parameters}
            connections.append({"from": f"{name}.command", "to": stimulus.to})
    run = dict(written["run"])
    if scenario.run.stop_s is None:
        grid = make_grid(scenario.run, ends)
        run["stop_s"] = grid.time(grid.steps)
    paths = {"base_folder": scenario.base_folder, "source": scenario.source}
    # The programmes stand first: some tools step in this order.
    fmus = {**first, **fmus}
    return Scenario.model_validate({**written, **paths, "run": run, "fmus": fmus, "connections": connections})


def _set(fmus: dict[str, Any], interface: Interface, values: Mapping[str, Value]) -> None:
    """Give parameters or inputs, element by element, over what the scenario says of them."""
    setting = dict(fmus[interface.name])
    elements: dict[str, Value] = {}
    for name, value in setting.get("parameters", {}).items():
        elements |= {variable.name: item for variable, item in spread(value, interface.find(name), name)}
    fmus[interface.name] = {**setting, "parameters": {**elements, **values}}


def _parameters(
    commands: Drive, positions: NumberTable, stimulus: Stimulus, table: Loaded, step: float
) -> dict[str, Any]:
    """The parameters of the component that commands what the programme does."""
    count = len(commands.values)
    if count > POSITIONS:
        raise InputError(f"{positions.label}: has {count} positions; the component {PROGRAMME} takes {POSITIONS}")
    dwell = positions.columns.get("dwell_s", np.full(count, stimulus.dwell_s))
    values: dict[str, Any] = {"positions": count, "period": step}
    for name in ("max_rate", "max_acceleration", "initial_angle"):
        values[name] = [table.start_value(v) for v in table.interface.find(name)]
    for name, numbers in zip(("alpha", "beta", "dwell_time"), (*np.transpose(commands.values), dwell), strict=True):
        values |= {f"{name}[{i + 1}]": float(value) for i, value in enumerate(numbers)}
    return values


def _members(scenario: Scenario, flavour: Literal["python", "native"], platform: str, folder: Path) -> dict[str, bytes]:
    """The files of the archive."""
    for name in scenario.fmus:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            raise InputError(f"fmus.{name}: other tools take names of letters, digits and _ only; rename it")
    whole = self_contained(scenario)
    sources = Sources(whole.base_folder)
    (folder / "loaded").mkdir()
    loaded = load(whole, sources, folder / "loaded")
    wires = resolve_connections(whole.connections, interfaces_of(loaded))
    check_single_sources(wires, [])
    grid = make_grid(whole.run, [])
    files: dict[str, str] = {}
    members: dict[str, bytes] = {}
    for name, setting in whole.fmus.items():
        if setting.fmu is not None:
            stem, content = PurePosixPath(setting.fmu).stem, (whole.base_folder / setting.fmu).read_bytes()
        else:
            places, stem = [place_from_mapping(entry)[0] for entry in setting.effects], str(setting.component)
            content = build(stem, folder / name, places, flavour=flavour, fmi=2, platform=platform).read_bytes()
        # FMUs with the same content share a file.
        names = [f"resources/{stem}.fmu", *(f"resources/{stem}_{i}.fmu" for i in range(2, len(members) + 3))]
        files[name] = next(n for n in names if members.get(n, content) == content)
        members[files[name]] = content
    sets = _parameter_sets(whole, loaded, sources)
    stem = scenario.source.stem if scenario.source is not None else "scenario"
    about = {"name": re.sub(r"\W", "_", stem, flags=re.ASCII), "title": scenario.title}
    elements = {name: (files[name], entry.interface) for name, entry in loaded.items()}
    set_files = {each.name: each.files() for each in sets}
    members[STRUCTURE] = _structure(about, elements, wires, [list(each) for each in set_files.values()], grid)
    for each in set_files.values():
        members |= each
    written = scenario.as_written()
    members[RECORD] = json_text(written["record"]).encode()
    coupling = {name: written["run"][name] for name in COUPLING_SETTINGS if name in written["run"]}
    if coupling:
        members[COUPLING] = json_text(coupling).encode()
    return members


@dataclass
class WrittenSet:
    """A parameter set to be written: by the name in the set, each value's type and attributes, and the units of all.

    The mapping has the names that each has in the system, and nothing where they are the same.
    """

    name: str
    description: str
    values: dict[str, tuple[str, dict[str, str]]] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)
    mapping: dict[str, list[str]] = field(default_factory=dict)

    def add(self, name: str, variable: Variable, value: Value, scales: Mapping[str, Unit]) -> None:
        """Add a value in its variable's unit."""
        # An enumeration goes out as the whole number that FMI passes: neither OMSimulator nor FMPy reads its name.
        kind = "Integer" if variable.kind == "Enumeration" else variable.kind
        text = {"Real": lambda v: number(float(v)), "Boolean": lambda v: str(bool(v)).lower(), "String": str}
        attributes = {"value": text.get(kind, lambda v: str(int(v)))(value)}
        if variable.unit is not None and variable.unit in scales:
            self.units[variable.unit] = scales[variable.unit]
        if kind == "Real" and variable.unit in self.units:
            attributes["unit"] = str(variable.unit)
        self.values[name] = (kind, attributes)

    def files(self) -> dict[str, bytes]:
        """The .ssv of the set, and the .ssm that gives its names those of the system where they differ."""
        name = f"resources/{self.name}"
        rows = [(key, *value) for key, value in self.values.items()]
        written = {f"{name}.ssv": parameter_file(self.name, self.description, rows, self.units)}
        if self.mapping:
            root = Element("ssm:ParameterMapping", {**declared("ssm", "ssc"), "version": "1.0"})
            for source, target in ((source, target) for source, targets in self.mapping.items() for target in targets):
                SubElement(root, "ssm:MappingEntry", source=source, target=target)
            written[f"{name}.ssm"] = xml_bytes(root)
        return written


def _parameter_sets(scenario: Scenario, loaded: Mapping[str, Loaded], sources: Sources) -> list[WrittenSet]:
    """One set for each calibration, mapped to the FMUs that take it; over them the scenario's own values."""
    sets: dict[str, WrittenSet] = {}
    own = WrittenSet("parameters", "parameters of the scenario")
    for name, entry in loaded.items():
        setting, interface = scenario.fmus[name], entry.interface
        calibrated: set[str] = set()
        if setting.parameters_from is not None:
            label, component = setting.parameters_from, setting.component or interface.model
            taken = ["parameters", *(each.name for each in sets.values())]
            if label not in sets:
                sets[label] = WrittenSet(free_name(PurePosixPath(label).stem, taken), f"calibration {label}")
            for key, given in calibrated_parameters(name, setting, interface, sources).items():
                for variable, value in spread(given, interface.find(key), key):
                    calibrated.add(variable.name)
                    shown = f"{component}.{variable.name}"
                    sets[label].add(shown, variable, value, interface.scales)
                    sets[label].mapping.setdefault(shown, []).append(f"{name}.{variable.name}")
        explicit = {v.name for key in setting.parameters for v in interface.find(key)}
        for element, (variable, value) in entry.values.items():
            if element in explicit or element not in calibrated:
                own.add(f"{name}.{element}", variable, value, interface.scales)
        if setting.component == PROGRAMME:
            # Other tools pass outputs on when all FMUs have stepped: what the table does next must be out by then.
            own.add(f"{name}.lead_steps", interface.variables["lead_steps"], 1, interface.scales)
    return [each for each in (*sets.values(), own) if each.values]


def _structure(
    about: Mapping[str, str],
    fmus: Mapping[str, tuple[str, Interface]],
    wires: Iterable[Wire],
    sets: Sequence[Sequence[str]],
    grid: Grid,
) -> bytes:
    """SystemStructure.ssd of SSP 1.0, its elements in the order that OMSimulator wants.

    The system has a name and a title, which may be empty; an FMU its file in the archive and its interface; a set is
    the files of the parameters and of their mapping, the later set over the earlier.
    """
    versions = {**declared("ssd", "ssc", "ssv", "ssm"), "xmlns:oms": OMS}
    root = Element("ssd:SystemStructureDescription", {**versions, "name": about["name"], "version": "1.0"})
    system = SubElement(root, "ssd:System", {"name": "root"})
    if about["title"]:
        system.set("description", about["title"])
    # OMSimulator knows no empty ones.
    bindings = SubElement(system, "ssd:ParameterBindings") if sets else system
    for source, *mapping in sets:
        binding = SubElement(bindings, "ssd:ParameterBinding", source=source)
        for file in mapping:
            SubElement(binding, "ssd:ParameterMapping", source=file)
    elements, connections = SubElement(system, "ssd:Elements"), Element("ssd:Connections")
    connected = set()
    for wire in wires:
        connected.add((wire.target, wire.input.name))
        ends = {"startElement": wire.source, "startConnector": wire.output.name}
        ends |= {"endElement": wire.target, "endConnector": wire.input.name}
        SubElement(connections, "ssd:Connection", ends)
    enumerations: dict[str, Variable] = {}
    units: dict[str, Unit] = {}
    for name, (file, interface) in fmus.items():
        component = SubElement(
            elements, "ssd:Component", name=name, type="application/x-fmu-sharedlibrary", source=file
        )
        variables = interface.variables.values()
        shown = [v for v in variables if v.causality == "output" or (name, v.name) in connected]
        units |= {u: interface.scales[u] for u in (v.unit for v in shown) if u is not None and u in interface.scales}
        enumerations |= _connectors(component, name, shown, units)
    system.append(connections)
    # OMSimulator's annotation: without it there is no master that steps the system.
    annotation = SubElement(SubElement(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    information = SubElement(SubElement(annotation, "oms:Annotations"), "oms:SimulationInformation")
    tolerances = {"absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}
    attributes = {"description": "oms-ma", "stepSize": number(grid.step), **tolerances}
    SubElement(information, "oms:FixedStepMaster", attributes)
    parent = SubElement(root, "ssd:Enumerations") if enumerations else root
    for name, variable in enumerations.items():
        enumeration = SubElement(parent, "ssc:Enumeration", name=name)
        for value, item in variable.items:
            SubElement(enumeration, "ssc:Item", name=item, value=str(value))
    add_units(root, "ssd:Units", units)
    times = {"startTime": number(grid.start), "stopTime": number(grid.time(grid.steps))}
    SubElement(root, "ssd:DefaultExperiment", times)
    return xml_bytes(root)


def _connectors(
    component: Element, name: str, variables: Sequence[Variable], units: Mapping[str, Unit]
) -> dict[str, Variable]:
    """The connectors of an FMU; returns the enumerations that they need."""
    needed: dict[str, Variable] = {}
    connectors = SubElement(component, "ssd:Connectors") if variables else component
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
