"""The FMUs of a scenario: built or found, unpacked, their parameters resolved."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...fmus import component_names
from ...fmus.native.compile import BuildError
from ...models.effects import CATALOGUE, EffectPlace, parameter_name, place_from_mapping
from ..errors import InputError, nearest, said_of
from ..scenario import FmuSetting, Scenario
from .archive import UnpackedFmu, unpack
from .built import component_fmu
from .coupling import Coupling, Group
from .interface import Interface, Value, Variable, interface_of
from .parameters import calibrated_parameters, resolve_parameters


@dataclass
class Sources:
    """Files that a run reads, with the hash of each."""

    base: Path
    hashes: dict[str, str] = field(default_factory=dict)

    def note(self, label: str, content: bytes) -> None:
        """Keep the hash of what a file holds."""
        self.hashes[label] = hashlib.sha256(content).hexdigest()

    def read(self, label: str) -> bytes:
        """The bytes of a file, noted; an InputError where it cannot be read."""
        try:
            content = (self.base / label).read_bytes()
        except OSError as error:
            raise InputError(f"{label}: cannot be read ({error.strerror}; looked for {self.base / label})") from error
        self.note(label, content)
        return content


@dataclass(frozen=True)
class Loaded:
    """An FMU of the scenario, unpacked, with the values to set before it is initialised."""

    fmu: UnpackedFmu
    interface: Interface
    values: Mapping[str, tuple[Variable, Value]]


def load(scenario: Scenario, sources: Sources, folder: Path) -> dict[str, Loaded]:
    """Build or find, check and unpack every FMU; resolve its parameters; an InputError for what cannot be had."""
    unpacked: dict[str, UnpackedFmu] = {}
    built: dict[tuple[str, tuple[EffectPlace, ...], str | None], Path] = {}
    loaded: dict[str, Loaded] = {}
    single: dict[str, str] = {}
    for name, setting in scenario.fmus.items():
        places, of_effects = _effects(name, setting)
        if setting.fmu is not None:
            path, label = scenario.base_folder / setting.fmu, setting.fmu
        else:
            label = str(setting.component)
            if label not in component_names():
                known = nearest(label, list(component_names()))
                raise InputError(f"fmus.{name}.component: there is no component '{label}'; {known}")
            key = (label, places, setting.flavour)
            if key not in built:
                target = folder / f"built-{len(built)}"
                target.mkdir()
                try:
                    built[key] = component_fmu(label, places, setting.flavour, target)
                except ValueError as error:
                    raise InputError(f"fmus.{name}.effects: {error}") from error
                except BuildError as error:
                    raise InputError(f"fmus.{name}.flavour: {error}") from error
            path = built[key]
        fmu = unpack(path, label, lambda sha256: folder / f"{sha256}-{len(unpacked)}")
        unpacked[name] = fmu
        interface = interface_of(name, label, fmu.description)
        once = getattr(fmu.description.coSimulation, "canBeInstantiatedOnlyOncePerProcess", None)
        if str(once).lower() in ("true", "1"):
            if fmu.sha256 in single:
                raise InputError(f"{label}: can be instantiated once only; '{single[fmu.sha256]}' and '{name}' use it")
            single[fmu.sha256] = name
        calibrated: Mapping[str, Any] = {}
        if setting.parameters_from is not None:
            content = sources.read(setting.parameters_from)
            component = setting.component or interface.model
            with said_of(f"fmus.{name}.parameters_from"):
                calibrated = calibrated_parameters(content, setting.parameters_from, component)
        values = resolve_parameters(interface, setting.parameters, calibrated, of_effects)
        loaded[name] = Loaded(fmu, interface, values)
    return loaded


def check_states(groups: Sequence[Group], loaded: Mapping[str, Loaded], coupling: Coupling) -> None:
    """Refuse to iterate over an FMU whose state cannot be set back."""
    for name in (name for group in groups if group.cyclic and coupling.kind == "iterate" for name in group.members):
        described = loaded[name].fmu.description.coSimulation
        flags = [getattr(described, flag, None) for flag in ("canGetAndSetFMUstate", "canGetAndSetFMUState")]
        if not any(str(flag).lower() in ("true", "1") for flag in flags):
            raise InputError(
                f"run.coupling = \"iterate\": '{name}' ({loaded[name].fmu.label}) cannot get and set its state; "
                'coupling = "jacobi" needs no state'
            )


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


def _effects(name: str, setting: FmuSetting) -> tuple[tuple[EffectPlace, ...], dict[str, float]]:
    """The places of an FMU's effects and the values of the parameters that they bring."""
    places: list[EffectPlace] = []
    values: dict[str, float] = {}
    for number, entry in enumerate(setting.effects, start=1):
        try:
            _check_names(entry)
            place, parameters = place_from_mapping(entry)
            named = {parameter_name(place, key): value for key, value in parameters.items()}
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise InputError(f"fmus.{name}.effects[{number}]: {error}") from error
        if place in places:
            raise InputError(f"fmus.{name}.effects[{number}]: the same effect stands twice at the same place")
        places.append(place)
        values |= named
    return tuple(places), values


def _check_names(entry: Mapping[str, Any]) -> None:
    """Refuse a misspelt effect, place or parameter by the name that is nearest to it."""
    known = {effect.name: effect for effect in CATALOGUE.values() if effect.kernel is not None}
    name, where = entry.get("effect"), entry.get("where")
    if not isinstance(name, str) or name not in known:
        raise InputError(f"effect {name!r} is not one that extends a component; {nearest(str(name), list(known))}")
    places = list(dict.fromkeys(place.where for place in known[name].places))
    if where not in places:
        raise InputError(f"effect '{name}' has no place {where!r}; {nearest(str(where), places)}")
    parameters = {p.name: None for place in known[name].places for p in known[name].at(place).parameters}
    for key in entry:
        if key not in ("effect", "where", "order", "axes", *parameters):
            close = nearest(str(key), [*parameters, "order", "axes"])
            raise InputError(f"effect '{name}' has no parameter '{key}'; {close}")
