"""A scenario as an .ssp: its system for other tools, of FMUs alone.

Position programmes and timed rows become components, constants become parameters, so that no stimulus is left.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ...fmus import build, components
from ...fmus.archive import write_archive
from ...fmus.component import Component, Type, started
from ...fmus.motions import timed_rows
from ...fmus.native.compile import BuildError, chosen_platforms
from ...fmus.parameters import add_units, parameter_file, xml_bytes
from ...fmus.units import UNITS, Unit, number_text
from ...models.effects import place_from_mapping
from ...models.table_commands import POSITIONS
from ..errors import InputError, said_of
from ..files import json_text, whole_file
from ..locks import own_folder
from ..orchestrator.interface import FmuVariable, Interface, Value, spread
from ..orchestrator.load import Loaded, Sources, interfaces_of, load_fmus, usual_flavour
from ..orchestrator.scenario import Scenario, Stimulus
from ..orchestrator.stimuli import (
    Drive,
    NumberTable,
    StepGrid,
    check_sources,
    make_grid,
    resolve_constant,
    resolve_programme,
    resolve_stimuli,
    stimulus_table,
)
from ..orchestrator.wiring import Wire, resolve_connections
from .documents import declared
from .read import COUPLING, COUPLING_SETTINGS, LEADING, PROGRAMME, RATES, RECORD, STRUCTURE, free_name

OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
"""Namespace of OMSimulator's annotations."""

ROW_KINDS: dict[str, Type] = {"Real": "real", "Integer": "integer", "Boolean": "boolean"}
"""Types of the inputs that rows may feed, as the components have them."""

SET_NAME = "parameters"
"""Name of the parameter set of every FMU: Ecos applies those of one name, in all FMUs at once."""


def write_ssp(
    scenario: Scenario,
    out: Path,
    *,
    flavour: Literal["python", "native"] | None = None,
    fmi: int = 2,
    platform: str | None = None,
    ssp: Literal["1.0", "2.0"] = "1.0",
) -> Path:
    """Write the system of a scenario as an .ssp and return its path; the same scenario gives the same bytes.

    Position programmes become components PositionProgramme, timed rows TimedRows, constants become parameters.

    Parameters
    ----------
    flavour : str, optional
        "python": components run by PythonFMU, which C++ hosts cannot load; "native": compiled, the default where
        there is a compiler
    fmi : int
        2: the tools that open an .ssp take FMI 2.0
    platform : str, optional
        of the native flavour: "host" (the default), "all" or a name
    ssp : str
        version of SSP: "1.0", which more tools read, or "2.0"

    Raises
    ------
    InputError
        a scenario that cannot be carried out, or that an .ssp cannot hold: names that other tools do not take, timed
        rows of enumerations
    """
    if out.suffix.lower() != ".ssp":
        raise InputError(f"{out}: must end in .ssp; other tools know it by that")
    if fmi != 2:
        raise InputError(f"--fmi {fmi}: an .ssp has FMUs of FMI 2.0; FMPy and OMSimulator run no others in it")
    if ssp not in ("1.0", "2.0"):
        raise InputError(f"--ssp {ssp}: must be 1.0 or 2.0")
    if flavour is None:
        flavour = "native"
        if platform is None:
            flavour = usual_flavour()
    if flavour == "python" and platform is not None:
        raise InputError("--platform: belongs to --flavour native; PythonFMU brings its own binaries")
    if platform is None:
        platform = "host"
    try:
        if flavour == "native":
            chosen_platforms(platform)
        with own_folder() as scratch:
            members = _members(scenario, flavour, platform, ssp, scratch)
    except BuildError as error:
        raise InputError(f"--flavour native: {error}") from error
    except InputError as error:
        prefix = ""
        if scenario.source is not None:
            prefix = f"{scenario.source}: "
        raise InputError(f"{prefix}{error}") from error
    with whole_file(out) as incomplete:
        write_archive(incomplete, members, first=STRUCTURE)
    return out


def self_contained(scenario: Scenario, make: Callable[[str, Component], Path]) -> Scenario:
    """The scenario with FMUs and parameters in place of its stimuli; it gives the same run.

    `make` builds a component under a name and returns the file. An InputError for rows of a variable that no component
    gives, or a programme of too many positions.
    """
    with own_folder() as folder:
        sources = Sources(scenario.base_folder)
        loaded = load_fmus(scenario, sources, folder)
        grid, drives = resolve_stimuli(scenario, sources, loaded)
    interfaces = interfaces_of(loaded)
    own_steps: dict[str, dict[str, float]] = {name: {} for name in scenario.fmus}
    for name, fmu in scenario.fmus.items():
        if fmu.step_s is not None:
            own_steps[name]["step_s"] = fmu.step_s
    written = scenario.model_dump(by_alias=True, exclude_none=True, exclude={"stimuli", "base_folder", "source"})
    fmus, connections = dict(written["fmus"]), list(written["connections"])
    first: dict[str, Any] = {}
    for count, stimulus in enumerate(scenario.stimuli, start=1):
        with said_of(f"stimuli[{count}]"):
            if stimulus.kind == "rows":
                for drive in (drive for name, drive in drives if name == f"stimuli[{count}]"):
                    step = own_steps[drive.fmu].get("step_s", grid.step)
                    for component, ends in _rows(drive, interfaces[drive.fmu], step):
                        name = free_name("rows", fmus.keys() | first.keys())
                        first[name] = {"fmu": str(make(name, component)), **own_steps[drive.fmu]}
                        sources_of = component.interface[-1].elements
                        connections += [
                            {"from": f"{name}.{value}", "to": f"{drive.fmu}.{end.name}"}
                            for value, end in zip(sources_of, ends, strict=True)
                        ]
                continue
            if stimulus.kind == "constant":
                drive = resolve_constant(stimulus, interfaces)
                constants = dict(zip((v.name for v in drive.variables), drive.values[0], strict=True))
                _set(fmus, interfaces[drive.fmu], constants)
                continue
            positions, _ = stimulus_table(stimulus, f"stimuli[{count}]", scenario.base_folder)
            drive, _ = resolve_programme(stimulus, positions, scenario, loaded)
            name = free_name("programme", fmus.keys() | first.keys())
            step = own_steps[drive.fmu].get("step_s", grid.step)
            parameters = _parameters(drive, positions, stimulus, loaded[drive.fmu], step)
            first[name] = {"component": PROGRAMME, "parameters": parameters, **own_steps[drive.fmu]}
            connections.append({"from": f"{name}.command", "to": stimulus.to})
    run = dict(written["run"])
    if scenario.run.stop_s is None:
        run["stop_s"] = grid.time(grid.steps)
    paths = {"base_folder": scenario.base_folder, "source": scenario.source}
    # The programmes come first: some tools step in this order.
    fmus = {**first, **fmus}
    return Scenario.model_validate({**written, **paths, "run": run, "fmus": fmus, "connections": connections})


def _rows(drive: Drive, interface: Interface, step: float) -> Iterator[tuple[Component, list[FmuVariable]]]:
    """Yield components that produce timed rows, one for each unit, with the inputs that their values feed."""
    groups: dict[tuple[str, Type], list[int]] = {}
    for k, variable in enumerate(drive.variables):
        unit = variable.unit or "1"
        if variable.kind not in ROW_KINDS or unit not in UNITS:
            variable_text = f"'{interface.name}.{variable.name}', {variable.kind} in {unit}"
            raise InputError(f"{variable_text}: no component gives such rows")
        groups.setdefault((unit, ROW_KINDS[variable.kind]), []).append(k)
    assert drive.begins is not None
    for (unit, kind), columns in groups.items():
        rows = np.asarray(drive.values, dtype=float)[:, columns].tolist()
        component = timed_rows(drive.begins.tolist(), rows, step, unit=unit, kind=kind)
        yield component, [drive.variables[k] for k in columns]


def _set(fmus: dict[str, Any], interface: Interface, values: Mapping[str, Value]) -> None:
    """Set parameters or inputs, element by element, over the values of the scenario."""
    setting = dict(fmus[interface.name])
    elements: dict[str, Value] = {}
    for name, value in setting.get("parameters", {}).items():
        for variable, item in spread(value, interface.find(name), name):
            elements[variable.name] = item
    fmus[interface.name] = {**setting, "parameters": {**elements, **values}}


def _parameters(
    commands: Drive, positions: NumberTable, stimulus: Stimulus, table: Loaded, step: float
) -> dict[str, Any]:
    """Return the parameters of the component that commands the motion of the programme."""
    count = len(commands.values)
    if count > POSITIONS:
        raise InputError(f"{positions.label}: has {count} positions; the component {PROGRAMME} takes {POSITIONS}")
    dwell = positions.columns.get("dwell_s", np.full(count, stimulus.dwell_s))
    values: dict[str, Any] = {"positions": count, "period": step}
    for name in ("max_rate", "max_acceleration", "initial_angle"):
        values[name] = [table.start_value(v) for v in table.interface.find(name)]
    for name, numbers in zip(("alpha", "beta", "dwell_time"), (*np.transpose(commands.values), dwell), strict=True):
        for i, value in enumerate(numbers):
            values[f"{name}[{i + 1}]"] = float(value)
    return values


def _members(
    scenario: Scenario, flavour: Literal["python", "native"], platform: str, version: str, folder: Path
) -> dict[str, bytes]:
    """The files of the archive."""
    for name in scenario.fmus:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            raise InputError(f"fmus.{name}: other tools take names of letters, digits and _ only; rename it")
    system = self_contained(
        scenario, lambda name, rows: build(rows, folder / name, flavour=flavour, fmi=2, platform=platform)
    )
    sources = Sources(system.base_folder)
    (folder / "loaded").mkdir()
    loaded = load_fmus(system, sources, folder / "loaded")
    wires = resolve_connections(system.connections, interfaces_of(loaded))
    check_sources(wires, [], loaded)
    grid = make_grid(system, [])
    files: dict[str, str] = {}
    members: dict[str, bytes] = {}
    for name, setting in system.fmus.items():
        if setting.fmu is not None:
            stem, content = PurePosixPath(setting.fmu).stem, (system.base_folder / setting.fmu).read_bytes()
        else:
            places, stem = [place_from_mapping(entry)[0] for entry in setting.effects], str(setting.component)
            # Ecos and libcosim pass over enumerations of parameter sets: the FMU starts with them.
            values = loaded[name].values.values()
            component = started(components()[stem], {v.name: int(x) for v, x in values if v.kind == "Enumeration"})
            content = build(component, folder / name, places, flavour=flavour, fmi=2, platform=platform).read_bytes()
        # FMUs with the same content share a file.
        file, count = f"resources/{stem}.fmu", 2
        while members.get(file, content) != content:
            file, count = f"resources/{stem}_{count}.fmu", count + 1
        files[name] = file
        members[file] = content
    sets = {name: _parameter_set(name, system, entry, version) for name, entry in loaded.items()}
    members |= {f"resources/{name}.ssv": content for name, content in sets.items() if content}
    stem = "scenario"
    if scenario.source is not None:
        stem = scenario.source.stem
    about = {"name": re.sub(r"\W", "_", stem, flags=re.ASCII), "title": scenario.title, "version": version}
    elements = {name: (files[name], entry.interface, bool(sets[name])) for name, entry in loaded.items()}
    members[STRUCTURE] = _structure(about, elements, wires, grid)
    written = scenario.as_written()
    members[RECORD] = json_text(written["record"]).encode()
    coupling: dict[str, Any] = {name: written["run"][name] for name in COUPLING_SETTINGS if name in written["run"]}
    steps = {name: setting.step_s for name, setting in system.fmus.items() if setting.step_s is not None}
    ends = {f"{w.source}.{w.output.name} -> {w.target}.{w.input.name}": w.between for w in wires if w.between}
    coupling |= {name: settings for name, settings in zip(RATES, (steps, ends), strict=True) if settings}
    if coupling:
        members[COUPLING] = json_text(coupling).encode()
    return members


def _parameter_set(name: str, scenario: Scenario, entry: Loaded, version: str) -> bytes:
    """Return the .ssv of an FMU with the values of scenario and calibration; empty where they set none."""
    setting, interface = scenario.fmus[name], entry.interface
    values = dict(entry.values)
    if interface.model in LEADING:
        # Other tools pass outputs on after all FMUs have stepped: the table's next command must be out by then.
        values["lead_steps"] = (interface.variables["lead_steps"], 1)
    rows: list[tuple[str, str, dict[str, str]]] = []
    units: dict[str, Unit] = {}
    text = {"Real": lambda v: number_text(float(v)), "Boolean": lambda v: str(bool(v)).lower(), "String": str}
    for element, (variable, value) in values.items():
        # An enumeration goes out as the whole number that FMI passes: neither OMSimulator nor FMPy reads its name.
        kind = "Integer"
        if variable.kind != "Enumeration":
            kind = variable.kind
        attributes = {"value": text.get(kind, lambda v: str(int(v)))(value)}
        if variable.unit is not None and variable.unit in interface.scales:
            units[variable.unit] = interface.scales[variable.unit]
            if kind == "Real":
                attributes["unit"] = variable.unit
        rows.append((element, kind, attributes))
    origin = ""
    if setting.parameters_from is not None:
        origin = f", calibration {setting.parameters_from}"
    description = f"parameters of {name}{origin}"
    if not rows:
        return b""
    return parameter_file(SET_NAME, description, rows, units, version=version)


def _structure(
    about: Mapping[str, str],
    fmus: Mapping[str, tuple[str, Interface, bool]],
    wires: Iterable[Wire],
    grid: StepGrid,
) -> bytes:
    """SystemStructure.ssd, its elements in the order that OMSimulator wants.

    The system has a name, a version of SSP and a title, which may be empty. An FMU has its file in the archive, its
    interface, and whether it has a set of parameters. The sets are bound at the FMUs: not every tool looks at those of
    the system.
    """
    versions = {**declared("ssd", "ssc", "ssv", "ssm"), "xmlns:oms": OMS}
    root = Element("ssd:SystemStructureDescription", {**versions, "name": about["name"], "version": about["version"]})
    system = SubElement(root, "ssd:System", {"name": "root"})
    if about["title"]:
        system.set("description", about["title"])
    elements, connections = SubElement(system, "ssd:Elements"), Element("ssd:Connections")
    connected = set()
    for wire in wires:
        connected.add((wire.target, wire.input.name))
        ends = {"startElement": wire.source, "startConnector": wire.output.name}
        ends |= {"endElement": wire.target, "endConnector": wire.input.name}
        SubElement(connections, "ssd:Connection", ends)
    enumerations: dict[str, FmuVariable] = {}
    units: dict[str, Unit] = {}
    for name, (file, interface, bound) in fmus.items():
        component = SubElement(
            elements, "ssd:Component", name=name, type="application/x-fmu-sharedlibrary", source=file
        )
        variables = interface.variables.values()
        connectors = []
        for v in variables:
            if v.causality == "output" or (name, v.name) in connected:
                connectors.append(v)
        for variable in connectors:
            if variable.unit is not None and variable.unit in interface.scales:
                units[variable.unit] = interface.scales[variable.unit]
        enumerations |= _connectors(component, name, connectors, units)
        if bound:
            SubElement(
                SubElement(component, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=f"resources/{name}.ssv"
            )
    system.append(connections)
    # OMSimulator's annotation: without it there is no master that steps the system.
    annotation = SubElement(SubElement(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    information = SubElement(SubElement(annotation, "oms:Annotations"), "oms:SimulationInformation")
    tolerances = {"absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}
    attributes = {"description": "oms-ma", "stepSize": number_text(grid.step), **tolerances}
    SubElement(information, "oms:FixedStepMaster", attributes)
    parent = SubElement(root, "ssd:Enumerations") if enumerations else root
    for name, variable in enumerations.items():
        enumeration = SubElement(parent, "ssc:Enumeration", name=name)
        for value, item in variable.items:
            SubElement(enumeration, "ssc:Item", name=item, value=str(value))
    add_units(root, "ssd:Units", units)
    times = {"startTime": number_text(grid.start), "stopTime": number_text(grid.time(grid.steps))}
    SubElement(root, "ssd:DefaultExperiment", times)
    return xml_bytes(root)


def _connectors(
    component: Element, name: str, variables: Sequence[FmuVariable], units: Mapping[str, Unit]
) -> dict[str, FmuVariable]:
    """The connectors of an FMU; returns the enumerations that they need."""
    needed: dict[str, FmuVariable] = {}
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
