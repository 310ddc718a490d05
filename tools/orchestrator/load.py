"""Build or find the FMUs of a scenario, unpack them, and resolve their parameters.

A component is native if a compiler works here, otherwise a PythonFMU. Both give the same bits; the native one is a
hundred times faster. The cache of built FMUs is keyed by content.
"""

import hashlib
import json
import math
import os
import platform
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
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
from ..result import checked_sections, parsed_result
from .archive import UnpackedFmu, unpack
from .interface import FmuVariable, Interface, Value, interface_of, spread
from .scenario import FmuSetting, RunOptions, Scenario

if TYPE_CHECKING:
    from ...models.effects import Effect, EffectPlace

SETTABLE = ("parameter", "input")


@dataclass
class Sources:
    """Files that a run reads, with the hash of each."""

    base: Path
    hashes: dict[str, str] = field(default_factory=dict)

    def note(self, label: str, content: bytes) -> None:
        """Keep the hash of a file's content."""
        self.hashes[label] = hashlib.sha256(content).hexdigest()

    def read(self, label: str) -> bytes:
        """Return the bytes of a result's file and keep their hash.

        Raises InputError if the file cannot be read.
        """
        content = bytes_of(self.base / label, label=label, most=LARGEST_RESULT)
        self.note(label, content)
        return content


@dataclass(frozen=True)
class Loaded:
    """An FMU of the scenario, unpacked, with the values to set before initialisation.

    `read` are inputs that its composed effects read, each with the name of such an effect; `caution` says that a
    calibration that gave values does not stand.
    """

    fmu: UnpackedFmu
    interface: Interface
    values: Mapping[str, tuple[FmuVariable, Value]]
    read: Mapping[str, str] = field(default_factory=dict)
    caution: str = ""

    def start_value(self, variable: FmuVariable) -> Value | None:
        """Return a variable's start value: the scenario's, otherwise the model description's."""
        if variable.name in self.values:
            return self.values[variable.name][1]
        return variable.start


def interfaces_of(loaded: Mapping[str, Loaded]) -> dict[str, Interface]:
    """Return the interfaces by FMU name."""
    return {name: entry.interface for name, entry in loaded.items()}


@cache
def usual_flavour() -> Literal["native", "python"]:
    """Return the flavour of a component for which the scenario names none."""
    can = host_name() in PLATFORMS and (compiles(host_name()) or has_prebuilt())
    return "native" if can else "python"


@cache
def _sources() -> str:
    """Return the hash of all files from which components are made."""
    versions = [platform.python_version(), host_name()]
    versions += map(fmus.version, ("trihedron", "fmpy", "pythonfmu"))
    digest = hashlib.sha256(repr(versions).encode())
    for folder in (Path(str(package.__file__)).parent for package in (models, fmus)):
        for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix not in (".pyc", ".fmu")):
            digest.update(hashlib.sha256(path.relative_to(folder).as_posix().encode()).digest())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def component_fmu(name: str, places: "tuple[EffectPlace, ...]", flavour: str | None, folder: Path) -> Path:
    """Return the FMU of a component with effects, from the cache if it was built before.

    The default flavour is that of `usual_flavour`. Raises KeyError for an unknown component, ValueError for an effect
    of another component, and BuildError if "native" is requested and no compiler works here.
    """
    if flavour is None and usual_flavour() == "native":
        with suppress(BuildError):
            return component_fmu(name, places, "native", folder)
    flavour = flavour or "python"
    compiler = (host_compiler() or ("", ""))[1] if flavour == "native" else ""
    made_from = [_sources(), name, repr(list(places)), flavour, compiler, str(zig_version())]
    made_from.append(os.environ.get("SOURCE_DATE_EPOCH", ""))
    if places:
        # An effect may be defined in the user's own file.
        from ...fmus.component import extend
        from ...fmus.source import flat_source

        made_from += [repr(place.definition.parameters) for place in places]
        made_from.append(flat_source(extend(fmus.components()[name], places)))
    path = folder / f"{hashlib.sha256(chr(0).join(made_from).encode()).hexdigest()}.fmu"
    if not path.exists():
        content = kept("fmus", path.name, lambda: fmus.build(name, folder, places, flavour=flavour).read_bytes())
        path.write_bytes(content)
    return path


def load_fmus(scenario: Scenario, sources: Sources, folder: Path) -> dict[str, Loaded]:
    """Build or find, check and unpack every FMU, and resolve its parameters.

    Raises InputError for an FMU or a parameter that cannot be had.
    """
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
        fmu = unpack(path, label, lambda sha256: folder / f"{sha256}-{len(loaded)}", setting.interface)
        # An FMU that this program did not build may damage its process.
        exchange = fmu.description.coSimulation is None
        if setting.event_mode and (exchange or not fmu.says("hasEventMode")):
            raise InputError(f"fmus.{name}.event_mode: {label} does not say hasEventMode for co-simulation (FMI 3.0)")
        # The process that handles its events has the FMU in it.
        event_mode = bool(setting.event_mode) or (bool(fmu.clocks) and not exchange)
        is_trusted = bool(scenario.run.in_process)
        if setting.fmu is not None and scenario.run.call_limit_s is None and scenario.run.in_process is None:
            is_trusted = fmus.is_built_here(fmu.sha256)
        guest = setting.fmu is not None and (not is_trusted or exchange or event_mode or fmu.first_edition != "")
        fmu = replace(fmu, guest=guest, call_limit_s=scenario.run.call_limit_s, tolerance=setting.tolerance)
        fmu = replace(fmu, event_mode=event_mode)
        interface = interface_of(name, label, fmu.description)
        if fmu.says("canBeInstantiatedOnlyOncePerProcess") and not guest:
            if fmu.sha256 in single:
                raise InputError(f"{label}: can be instantiated once only; '{single[fmu.sha256]}' and '{name}' use it")
            single[fmu.sha256] = name
        structural, plain_parameters = _structural(interface, setting.parameters)
        if structural:
            lengths = {variable.name: int(value) for variable, value in structural.values()}
            interface = interface_of(name, label, fmu.description, lengths)
        calibrated, caution = calibrated_parameters(name, setting, interface, sources)
        values = {**structural, **resolve_parameters(interface, plain_parameters, calibrated, of_effects)}
        inputs = _read_by_effects(str(setting.component), places) if places else {}
        loaded[name] = Loaded(fmu, interface, values, inputs, caution)
    return loaded


def _read_by_effects(component: str, places: "tuple[EffectPlace, ...]") -> dict[str, str]:
    from ...fmus.component import inputs_read

    return {name: place.title for name, place in inputs_read(fmus.components()[component], places).items()}


def _structural(
    interface: Interface, parameters: Mapping[str, Any]
) -> tuple[dict[str, tuple[FmuVariable, Value]], dict[str, Any]]:
    """Split a setting into structural parameters, which give array lengths, and the others."""
    structural: dict[str, tuple[FmuVariable, Value]] = {}
    names = []
    for name in parameters:
        if name in interface.variables and interface.variables[name].causality == "structuralParameter":
            names.append(name)
    with said_of(f"fmus.{interface.name}.parameters"):
        for name in names:
            for variable, value in spread(parameters[name], (interface.variables[name],), name):
                structural[variable.name] = (variable, value)
    return structural, {name: value for name, value in parameters.items() if name not in names}


def alone(path: Path, options: RunOptions, interface: str | None = None) -> Scenario:
    """Return the scenario in which an FMU runs alone, by default with the times of its default experiment.

    Times that are still missing are FMPy's defaults: one second, in steps of about a thousandth.
    """
    with own_folder() as folder:
        fmu = unpack(path, str(path), lambda sha256: folder / sha256, interface)
    default, simulation = fmu.description.defaultExperiment, fmu.description.coSimulation
    inside = getattr(simulation, "fixedInternalStepSize", None)
    with said_of(f"{path}: modelDescription.xml, DefaultExperiment"):
        times = [_number(getattr(default, key, None), key) for key in ("startTime", "stopTime", "stepSize")]
        start, stop = times[0] or 0.0, times[1]
        if options.start is not None:
            start = options.start
        if stop is None:
            stop = start + 1.0
        if options.stop is not None:
            stop = options.stop
        step = times[2] or _number(inside, "fixedInternalStepSize")
    if options.step is not None:
        step = options.step
    if not stop > start:
        raise InputError(f"{path}: the stop time of {stop!r} s must be after the start time of {start!r} s")
    step = step or 10.0 ** (round(math.log10(stop - start)) - 3)
    name = re.sub(r"[^A-Za-z0-9_]", "_", path.stem)
    settings = {
        "title": fmu.description.modelName or path.stem,
        "run": {"start_s": start, "stop_s": stop, "step_s": step, "shorten": True},
        "fmus": {name if name[:1].isalpha() else f"fmu_{name}": {"fmu": str(path.absolute())}},
        "record": {"format": "csv"},
    }
    return checked_sections({**settings, "base_folder": path.parent, "source": path}, Scenario)


def _number(text: object, key: str) -> float | None:
    if text is None:
        return None
    try:
        value = float(str(text))
    except ValueError as error:
        raise InputError(f"{key} {text!r} is not a number") from error
    if not math.isfinite(value):
        raise InputError(f"{key} {text!r} is not a finite number")
    return value


def _component(name: str, setting: FmuSetting, places: "tuple[EffectPlace, ...]", folder: Path) -> Path:
    component = str(setting.component)
    try:
        return component_fmu(component, places, setting.flavour, folder)
    except KeyError as error:
        suggestion = nearest(component, fmus.component_names())
        raise InputError(f"fmus.{name}.component: there is no component '{component}'; {suggestion}") from error
    except ValueError as error:
        raise InputError(f"fmus.{name}.effects: {error}") from error
    except BuildError as error:
        raise InputError(f"fmus.{name}.flavour: {error}") from error


def _effects(name: str, setting: FmuSetting) -> "tuple[tuple[EffectPlace, ...], dict[str, float]]":
    """Return the places of an FMU's effects and the values of their parameters."""
    if not setting.effects:
        return (), {}
    # Most scenarios have no effects, and the catalogue is slow to import.
    from ...models import effects

    extending = {}
    for effect in effects.CATALOGUE.values():
        if effect.kernel is not None or effect.of_law:
            extending[effect.name] = effect
    places: list[EffectPlace] = []
    values: dict[str, float] = {}
    for number, entry in enumerate(setting.effects, start=1):
        where = f"fmus.{name}.effects[{number}]"
        try:
            _check_names(entry, extending)
            place, parameters = effects.place_from_mapping(entry)
            effect_values = {effects.parameter_name(place, key): value for key, value in parameters.items()}
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise InputError(f"{where}: {error}") from error
        if place in places:
            raise InputError(f"{where}: the same effect stands twice at the same place")
        places.append(place)
        values |= effect_values
    return tuple(places), values


def _check_names(entry: Mapping[str, Any], extending: "Mapping[str, Effect]") -> None:
    """Refuse a misspelt effect, place or parameter, with the nearest name."""
    name, where = entry.get("effect"), entry.get("where")
    if not isinstance(name, str) or name not in extending:
        raise InputError(f"effect {name!r} is not one that extends a component; {nearest(str(name), list(extending))}")
    if extending[name].of_law:
        return
    places = list(dict.fromkeys(place.where for place in extending[name].places))
    if where not in places:
        raise InputError(f"effect '{name}' has no place {where!r}; {nearest(str(where), places)}")
    keys = ["order", "axes"]
    for place in reversed(extending[name].places):
        keys[:0] = [p.name for p in extending[name].at(place).parameters]
    for key in entry:
        if key not in ("effect", "where") and key not in keys:
            close = nearest(str(key), list(dict.fromkeys(keys)))
            raise InputError(f"effect '{name}' has no parameter '{key}'; {close}")


def calibrated_parameters(
    name: str, setting: FmuSetting, interface: Interface, sources: Sources
) -> tuple[Mapping[str, Any], str]:
    """Return the component's parameters from the calibration result that a setting names, and a sentence of caution.

    Both are empty if it names none, the sentence also of a calibration that stands. Raises InputError if the file is
    not such a result, has no estimate, or has nothing about this component.
    """
    if setting.parameters_from is None:
        return {}, ""
    from ...fmus.parameters import CALIBRATIONS, bench_parameters, calibrated_effects, of_one_record
    from ...models.effects import parameter_name
    from ..calibrated import Calibration

    label, component = setting.parameters_from, setting.component or interface.model
    content = sources.read(label)
    with said_of(f"fmus.{name}.parameters_from: {label}"):
        try:
            document = json.loads(content.decode("utf-8"))
        except (ValueError, RecursionError) as error:
            raise InputError(f"is not JSON ({error})") from error
        if isinstance(document, dict):
            parsed_result(document, dict.fromkeys(CALIBRATIONS, Calibration), "the calibration")
        try:
            parameters, effects = bench_parameters(document), calibrated_effects(of_one_record(document))
        except ValueError as error:
            raise InputError(str(error)) from error
        if component not in parameters:
            raise InputError(f"says nothing about {component}; {nearest(component, list(parameters))}")
        for place, (values, _) in effects.items():
            names = [parameter_name(place, parameter.name) for parameter in place.definition.parameters]
            if place.definition.component != component:
                continue
            if not interface.variables.keys() >= set(names):
                raise InputError(
                    f"was solved beside {place.title}, which this FMU does not have; add it to its effects"
                )
            parameters[component] |= dict(zip(names, values, strict=True))
    verdict = str(document.get("verdict"))
    caution = ""
    if verdict in ("falsified", "insufficient"):
        caution = f"fmus.{name}.parameters_from: {label}: the calibration is {verdict}; its estimates are used"
    return parameters[component], caution


def resolve_parameters(
    interface: Interface,
    explicit: Mapping[str, Any],
    calibrated: Mapping[str, Any] | None = None,
    of_effects: Mapping[str, float] | None = None,
) -> dict[str, tuple[FmuVariable, Value]]:
    """Return the values to set before initialisation, one for each variable by its name.

    Each mapping has values of variables, or lists for arrays. The scenario's own values (`explicit`) override the
    parameters of effects, which override the calibration. Raises InputError for an unknown variable, for one that is
    neither parameter nor input, and for a value that the variable does not accept.
    """
    resolved: dict[str, tuple[FmuVariable, Value]] = {}
    origins = {"parameters_from": calibrated, "effects": of_effects, "parameters": explicit}
    for origin, values in origins.items():
        origin_of: dict[str, str] = {}
        for name, value in (values or {}).items():
            with said_of(f"fmus.{interface.name}.{origin}"):
                variables = interface.find(name, SETTABLE)
                for variable in variables:
                    _check_settable(interface, variable)
                    if variable.name in origin_of:
                        raise InputError(
                            f"{variable.name} is given twice, by '{origin_of[variable.name]}' and '{name}'"
                        )
                    origin_of[variable.name] = name
                for variable, item in spread(value, variables, name):
                    resolved[variable.name] = (variable, item)
    return resolved


def _check_settable(interface: Interface, variable: FmuVariable) -> None:
    if variable.is_settable:
        return
    what = f"{variable.causality}, not a parameter or an input"
    if variable.variability == "constant":
        what = "a constant"
    close = nearest(variable.name, [v.name for v in interface.variables.values() if v.is_settable])
    if close.startswith("did you"):
        what += f"; {close}"
    raise InputError(f"{variable.name} of '{interface.name}' is {what}")
