"""The FMUs of a scenario: built or found, their parameters resolved; who feeds whom, and in which order they step.

A component is native where something compiles here, else PythonFMU's: both give the same bits, the native one is a
hundred times faster. What is built is kept by content.
"""

import hashlib
import json
import math
import os
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ... import fmus, models
from ...fmus.cache import kept
from ...fmus.native.compile import (
    PLATFORMS,
    BuildError,
    compiles,
    has_prebuilt,
    host_compiler,
    host_name,
    zig_version,
)
from ..errors import InputError, nearest, said_of
from ..files import LARGEST_RESULT, bytes_of
from ..locks import own_folder
from ..result import checked_sections
from .archive import UnpackedFmu, unpack
from .interface import Interface, Value, Variable, between, interface_of, refer_to, spread
from .scenario import Asked, Connection, FmuSetting, Scenario

if TYPE_CHECKING:
    from ...models.effects import Effect, EffectPlace

SETTABLE = ("parameter", "input")


@dataclass
class Sources:
    """Files that a run reads, with the hash of each."""

    base: Path
    hashes: dict[str, str] = field(default_factory=dict)

    def note(self, label: str, content: bytes) -> None:
        """Keep the hash of what a file holds."""
        self.hashes[label] = hashlib.sha256(content).hexdigest()

    def read(self, label: str) -> bytes:
        """The bytes of a result's file, noted; an InputError where it cannot be read."""
        content = bytes_of(self.base / label, label=label, most=LARGEST_RESULT)
        self.note(label, content)
        return content


@dataclass(frozen=True)
class Loaded:
    """An FMU of the scenario, unpacked, with the values to set before it is initialised."""

    fmu: UnpackedFmu
    interface: Interface
    values: Mapping[str, tuple[Variable, Value]]

    def start_value(self, variable: Variable) -> Value | None:
        """What a variable starts with: the scenario's value, else the start value of its model description."""
        return self.values[variable.name][1] if variable.name in self.values else variable.start


def interfaces_of(loaded: Mapping[str, Loaded]) -> dict[str, Interface]:
    """The interfaces by the FMUs' names."""
    return {name: entry.interface for name, entry in loaded.items()}


@cache
def usual_flavour() -> Literal["native", "python"]:
    """What a component runs as where the scenario does not say."""
    can = host_name() in PLATFORMS and (compiles(host_name()) or has_prebuilt())
    return "native" if can else "python"


@cache
def _sources() -> str:
    """Hash of everything that components are made from."""
    said = [platform.python_version(), host_name(), *map(metadata.version, ("trihedron", "fmpy", "pythonfmu"))]
    digest = hashlib.sha256(repr(said).encode())
    for folder in (Path(str(package.__file__)).parent for package in (models, fmus)):
        for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix not in (".pyc", ".fmu")):
            digest.update(hashlib.sha256(path.relative_to(folder).as_posix().encode()).digest())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def component_fmu(name: str, places: "tuple[EffectPlace, ...]", flavour: str | None, folder: Path) -> Path:
    """The FMU of a component, extended by effects, from the cache where it has been built before.

    Without a flavour it is that of `usual_flavour`. A KeyError where there is no such component, a ValueError for an
    effect of another one, a BuildError where "native" was asked for and nothing here compiles.
    """
    if flavour is None and usual_flavour() == "native":
        with suppress(BuildError):
            return component_fmu(name, places, "native", folder)
    flavour = flavour or "python"
    compiler = (host_compiler() or ("", ""))[1] if flavour == "native" else ""
    made_from = [_sources(), name, repr(list(places)), flavour, compiler, str(zig_version())]
    made_from.append(os.environ.get("SOURCE_DATE_EPOCH", ""))
    if places:
        # An effect may stand in a file of the user's own.
        from ...fmus.component import extend
        from ...fmus.source import flat_source

        made_from += [repr(place.definition.parameters) for place in places]
        made_from.append(flat_source(extend(fmus.components()[name], places)))
    path = folder / f"{hashlib.sha256(chr(0).join(made_from).encode()).hexdigest()}.fmu"
    if not path.exists():
        made = kept("fmus", path.name, lambda: fmus.build(name, folder, places, flavour=flavour).read_bytes())
        path.write_bytes(made)
    return path


def load(scenario: Scenario, sources: Sources, folder: Path) -> dict[str, Loaded]:
    """Build or find, check and unpack every FMU; resolve its parameters; an InputError for what cannot be had."""
    built: dict[object, Path] = {}
    loaded: dict[str, Loaded] = {}
    single: dict[str, str] = {}
    for name, setting in scenario.fmus.items():
        places, of_effects = _effects(name, setting)
        label = setting.fmu or str(setting.component)
        if setting.fmu is not None:
            path = scenario.base_folder / setting.fmu
        else:
            key = (label, places, setting.flavour)
            if key not in built:
                target = folder / f"built-{len(built)}"
                target.mkdir()
                built[key] = _component(name, setting, places, target)
            path = built[key]
        fmu = unpack(path, label, lambda sha256: folder / f"{sha256}-{len(loaded)}")
        # What this run has not built itself may do what it likes to its process.
        guest = setting.fmu is not None and not scenario.run.in_process
        fmu = replace(fmu, guest=guest, call_limit_s=scenario.run.call_limit_s)
        interface = interface_of(name, label, fmu.description)
        if fmu.says("canBeInstantiatedOnlyOncePerProcess") and not guest:
            if fmu.sha256 in single:
                raise InputError(f"{label}: can be instantiated once only; '{single[fmu.sha256]}' and '{name}' use it")
            single[fmu.sha256] = name
        structural, others = _structural(interface, setting.parameters)
        if structural:
            lengths = {variable.name: int(value) for variable, value in structural.values()}
            interface = interface_of(name, label, fmu.description, lengths)
        calibrated = calibrated_parameters(name, setting, interface, sources)
        values = {**structural, **resolve_parameters(interface, others, calibrated, of_effects)}
        loaded[name] = Loaded(fmu, interface, values)
    return loaded


def _structural(
    interface: Interface, parameters: Mapping[str, Any]
) -> tuple[dict[str, tuple[Variable, Value]], dict[str, Any]]:
    """The structural parameters among a setting's, which say how long arrays are, and the others."""
    there = [n for n in parameters if n in interface.variables]
    names = [n for n in there if interface.variables[n].causality == "structuralParameter"]
    with said_of(f"fmus.{interface.name}.parameters"):
        pairs = [pair for n in names for pair in spread(parameters[n], (interface.variables[n],), n)]
    return {v.name: (v, x) for v, x in pairs}, {n: x for n, x in parameters.items() if n not in names}


def alone(path: Path, asked: Asked) -> Scenario:
    """The scenario in which an FMU runs by itself, with the times of its default experiment where none are asked for.

    What that leaves open is as FMPy has it: a second, in steps of about a thousandth.
    """
    with own_folder() as folder:
        fmu = unpack(path, str(path), lambda sha256: folder / sha256)
    default, simulation = fmu.description.defaultExperiment, fmu.description.coSimulation
    inside = getattr(simulation, "fixedInternalStepSize", None)
    with said_of(f"{path}: modelDescription.xml, DefaultExperiment"):
        said = [_number(getattr(default, key, None), key) for key in ("startTime", "stopTime", "stepSize")]
        start = asked.start if asked.start is not None else said[0] or 0.0
        stop = asked.stop if asked.stop is not None else start + 1.0 if said[1] is None else said[1]
        step = asked.step or said[2] or _number(inside, "fixedInternalStepSize")
    if not stop > start:
        raise InputError(f"{path}: the stop time of {stop!r} s must be after the start time of {start!r} s")
    step = step or 10.0 ** (round(math.log10(stop - start)) - 3)
    name = re.sub(r"[^A-Za-z0-9_]", "_", path.stem)
    data = {
        "title": fmu.description.modelName or path.stem,
        "run": {"start_s": start, "stop_s": stop, "step_s": step},
        "fmus": {name if name[:1].isalpha() else f"fmu_{name}": {"fmu": str(path.absolute())}},
        "record": {"format": "csv"},
    }
    return checked_sections({**data, "base_folder": path.parent, "source": path}, Scenario)


def _number(text: object, key: str) -> float | None:
    try:
        value = None if text is None else float(str(text))
    except ValueError as error:
        raise InputError(f"{key} {text!r} is not a number") from error
    if value is not None and not math.isfinite(value):
        raise InputError(f"{key} {text!r} is not a finite number")
    return value


def _component(name: str, setting: FmuSetting, places: "tuple[EffectPlace, ...]", folder: Path) -> Path:
    component = str(setting.component)
    try:
        return component_fmu(component, places, setting.flavour, folder)
    except KeyError as error:
        known = nearest(component, fmus.component_names())
        raise InputError(f"fmus.{name}.component: there is no component '{component}'; {known}") from error
    except ValueError as error:
        raise InputError(f"fmus.{name}.effects: {error}") from error
    except BuildError as error:
        raise InputError(f"fmus.{name}.flavour: {error}") from error


def _effects(name: str, setting: FmuSetting) -> "tuple[tuple[EffectPlace, ...], dict[str, float]]":
    """The places of an FMU's effects and the values of the parameters that they bring."""
    if not setting.effects:
        return (), {}
    # Most scenarios have none, and the catalogue takes time to read.
    from ...models import effects

    known = {effect.name: effect for effect in effects.CATALOGUE.values() if effect.kernel is not None or effect.of_law}
    places: list[EffectPlace] = []
    values: dict[str, float] = {}
    for number, entry in enumerate(setting.effects, start=1):
        where = f"fmus.{name}.effects[{number}]"
        try:
            _check_names(entry, known)
            place, parameters = effects.place_from_mapping(entry)
            named = {effects.parameter_name(place, key): value for key, value in parameters.items()}
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise InputError(f"{where}: {error}") from error
        if place in places:
            raise InputError(f"{where}: the same effect stands twice at the same place")
        places.append(place)
        values |= named
    return tuple(places), values


def _check_names(entry: Mapping[str, Any], known: "Mapping[str, Effect]") -> None:
    """Refuse a misspelt effect, place or parameter by the name that is nearest to it."""
    name, where = entry.get("effect"), entry.get("where")
    if not isinstance(name, str) or name not in known:
        raise InputError(f"effect {name!r} is not one that extends a component; {nearest(str(name), list(known))}")
    if known[name].of_law:
        return
    places = list(dict.fromkeys(place.where for place in known[name].places))
    if where not in places:
        raise InputError(f"effect '{name}' has no place {where!r}; {nearest(str(where), places)}")
    parameters = {p.name: None for place in known[name].places for p in known[name].at(place).parameters}
    for key in entry:
        if key not in ("effect", "where", "order", "axes", *parameters):
            close = nearest(str(key), [*parameters, "order", "axes"])
            raise InputError(f"effect '{name}' has no parameter '{key}'; {close}")


def calibrated_parameters(name: str, setting: FmuSetting, interface: Interface, sources: Sources) -> Mapping[str, Any]:
    """What the calibration result that a setting names says of the component's parameters; nothing where it names none.

    An InputError where it is no such file, has no estimate, or says nothing about this component.
    """
    if setting.parameters_from is None:
        return {}
    from ...fmus.parameters import bench_parameters

    label, component = setting.parameters_from, setting.component or interface.model
    content = sources.read(label)
    with said_of(f"fmus.{name}.parameters_from: {label}"):
        try:
            data = json.loads(content.decode("utf-8"))
        except (ValueError, RecursionError) as error:
            raise InputError(f"is not JSON ({error})") from error
        if not isinstance(data, dict):
            raise InputError("is not a calibration result (schema trihedron.calibration/2)")
        try:
            found = bench_parameters(data)
        except ValueError as error:
            raise InputError(str(error)) from error
        if component not in found:
            raise InputError(f"says nothing about {component}; {nearest(component, list(found))}")
    return found[component]


def resolve_parameters(
    interface: Interface,
    explicit: Mapping[str, Any],
    calibrated: Mapping[str, Any] | None = None,
    of_effects: Mapping[str, float] | None = None,
) -> dict[str, tuple[Variable, Value]]:
    """The values to set before initialisation, one for each variable by its name.

    Each mapping has the values of variables, or lists for arrays: what a calibration says, over it the parameters that
    effects bring, over both the scenario's own. An InputError for an unknown variable, one that is neither parameter
    nor input, or a value that it does not take.
    """
    resolved: dict[str, tuple[Variable, Value]] = {}
    origins = {"parameters_from": calibrated, "effects": of_effects, "parameters": explicit}
    for origin, values in origins.items():
        named: dict[str, str] = {}
        for name, value in (values or {}).items():
            with said_of(f"fmus.{interface.name}.{origin}"):
                variables = interface.find(name, SETTABLE)
                for variable in variables:
                    _check_settable(interface, variable)
                    if variable.name in named:
                        raise InputError(f"{variable.name} is given twice, by '{named[variable.name]}' and '{name}'")
                    named[variable.name] = name
                resolved |= {variable.name: (variable, item) for variable, item in spread(value, variables, name)}
    return resolved


def _check_settable(interface: Interface, variable: Variable) -> None:
    constant = variable.variability == "constant"
    if variable.causality in SETTABLE and not constant:
        return
    what = "a constant" if constant else f"{variable.causality}, not a parameter or an input"
    close = nearest(variable.name, [v.name for v in interface.variables.values() if v.causality in SETTABLE])
    meant = f"; {close}" if close.startswith("did you") else ""
    raise InputError(f"{variable.name} of '{interface.name}' is {what}{meant}")


def check_steps(loaded: Mapping[str, Loaded], step: float) -> None:
    """Refuse a step that is no multiple of the one which an FMU of FMI 3.0 says that it makes inside."""
    for name, entry in loaded.items():
        said = getattr(entry.fmu.description.coSimulation, "fixedInternalStepSize", None)
        try:
            inside = 0.0 if said is None else float(said)
        except ValueError as error:
            raise InputError(f"{entry.fmu.label}: modelDescription.xml, fixedInternalStepSize: {error}") from error
        if inside > 0.0 and (round(step / inside) < 1 or abs(step / inside - round(step / inside)) > 1e-9):
            whom = f"'{name}' ({entry.fmu.label})"
            raise InputError(f"run.step_s = {step!r} is no multiple of the {inside!r} s by which {whom} steps inside")


@dataclass(frozen=True)
class Wire:
    """One scalar output that feeds one scalar input: input = factor * output + offset."""

    source: str
    output: Variable
    target: str
    input: Variable
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Group:
    """FMUs that step together: one by itself, or those of a cycle, with the outputs that go around in it."""

    members: tuple[str, ...]
    cyclic: bool = False
    around: tuple[tuple[str, Variable], ...] = ()

    def __str__(self) -> str:
        return " -> ".join([*self.members, self.members[0]])


def resolve_connections(connections: Sequence[Connection], interfaces: Mapping[str, Interface]) -> list[Wire]:
    """The connections, element by element.

    An InputError for an unknown end, a wrong direction, or ends whose length, type or unit differ.
    """
    wires: list[Wire] = []
    for number, connection in enumerate(connections, start=1):
        with said_of(f"connections[{number}]"):
            wires += _wires(connection, interfaces)
    return wires


def _wires(connection: Connection, interfaces: Mapping[str, Interface]) -> Iterator[Wire]:
    source, outputs = refer_to("output", connection.source, interfaces)
    target, inputs = refer_to("input", connection.target, interfaces)
    ends = f"'{connection.source}' -> '{connection.target}'"
    if len(outputs) != len(inputs):
        raise InputError(f"{ends}: {len(outputs)} and {len(inputs)} elements; their lengths must agree")
    for output, input_ in zip(outputs, inputs, strict=True):
        if output.kind != input_.kind:
            raise InputError(f"{ends}: types differ, {output.kind} and {input_.kind}")
        relative = output.relative or input_.relative
        conversion = between(output.unit, input_.unit, source.scales, target.scales, relative=relative)
        if conversion is None:
            raise InputError(f"{ends}: units differ, {output.unit} and {input_.unit}")
        if output.kind == "Integer":
            (low, high), (least, most) = output.value_type.whole_span, input_.value_type.whole_span
            if low < least or high > most:
                raise InputError(f"{ends}: {input_.access} does not take every {output.access}")
        yield Wire(source.name, output, target.name, input_, *(conversion if output.kind == "Real" else (1.0, 0.0)))


def stepping_groups(names: Sequence[str], wires: Sequence[Wire], coupling: str | None) -> list[Group]:
    """The FMUs so that each steps after those that feed it, cycles in one group; ties as in the file.

    Where every connection is delayed, all are one group.
    An InputError names a cycle where the scenario does not say how to take it.
    """
    if coupling is None:
        _refuse_cycle(names, wires)
    following: dict[str, set[str]] = {name: set() for name in names}
    for wire in wires:
        following[wire.source].add(wire.target)
    # Whom each reaches, directly or through others.
    for through in names:
        for name in names:
            if through in following[name]:
                following[name] |= following[through]
    member_of = {n: tuple(m for m in names if m == n or (m in following[n] and n in following[m])) for n in names}
    if coupling == "delayed":
        member_of = dict.fromkeys(names, tuple(names))
    sorter: TopologicalSorter[tuple[str, ...]] = TopologicalSorter(dict.fromkeys(member_of.values(), ()))
    for wire in wires:
        if member_of[wire.source] != member_of[wire.target]:
            sorter.add(member_of[wire.target], member_of[wire.source])
    sorter.prepare()
    groups: list[Group] = []
    ready: set[tuple[str, ...]] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        members = min(ready, key=lambda group: names.index(group[0]))
        ready.remove(members)
        sorter.done(members)
        inside = [w for w in wires if w.source in members and w.target in members]
        for wire in inside:
            if wire.output.kind == "String":
                raise InputError(f"'{wire.source}.{wire.output.name}' goes around in a cycle; a String cannot")
        groups.append(Group(members, bool(inside), tuple(dict.fromkeys((w.source, w.output) for w in inside))))
    return groups


def check_states(groups: Sequence[Group], loaded: Mapping[str, Loaded], coupling: str | None) -> None:
    """Refuse to iterate over an FMU whose state cannot be set back."""
    for name in (name for group in groups if group.cyclic and coupling == "iterate" for name in group.members):
        fmu = loaded[name].fmu
        if not fmu.says("canGetAndSetFMUstate", "canGetAndSetFMUState"):
            raise InputError(
                f"run.coupling = \"iterate\": '{name}' ({fmu.label}) cannot get and set its state; "
                'coupling = "jacobi" needs no state'
            )


def _refuse_cycle(names: Sequence[str], wires: Iterable[Wire]) -> None:
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(names, ()))
    for wire in wires:
        sorter.add(wire.target, wire.source)
    try:
        sorter.prepare()
    except CycleError as error:
        cycle = error.args[1][:-1]
        first = min(range(len(cycle)), key=lambda i: names.index(cycle[i]))
        named = " -> ".join([*cycle[first:], *cycle[:first], cycle[first]])
        ways = 'run.coupling = "jacobi", "iterate" or "delayed" (of an .ssp: --coupling)'
        say = f"take one out, or say how it is taken: {ways}"
        raise InputError(f"connections form a cycle: {named}; {say}") from error
