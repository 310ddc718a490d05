"""The FMUs of a scenario: built or found, checked before anything is unpacked, their parameters resolved.

A component is native where something compiles here, else PythonFMU's: both give the same bits, the native one is a
hundred times faster. What is built is kept by content.
"""

import hashlib
import io
import json
import os
import platform
import re
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path, PurePosixPath
from typing import Any, Literal
from xml.parsers import expat

import fmpy
from fmpy.model_description import ModelDescription

from ... import fmus, models
from ...fmus import build, component_names
from ...fmus.native.compile import (
    PLATFORMS,
    BuildError,
    cache_folder,
    compiles,
    has_prebuilt,
    host_compiler,
    host_name,
    zig_version,
)
from ...fmus.parameters import bench_parameters
from ...models.effects import CATALOGUE, EffectPlace, parameter_name, place_from_mapping
from ..errors import InputError, nearest, nearest_file, said_of
from .interface import Interface, Value, Variable, interface_of, spread
from .scenario import FmuSetting, Scenario

MOST_MEMBERS = 20_000
MOST_BYTES = 2 << 30
MOST_DESCRIPTION_BYTES = 128 << 20
LONGEST_SHOWN = 80
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError)
SETTABLE = ("parameter", "input")
_LOADED = 1
"""Type of a segment of a library that is mapped into memory (PT_LOAD)."""


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
class UnpackedFmu:
    """An FMU on disk, ready to be loaded.

    Attributes
    ----------
    label : str
        as the user wrote it
    sha256 : str
        of the archive's bytes
    folder, library : Path
        where it was unpacked; the shared library for this platform
    description : ModelDescription
        FMPy's reading of modelDescription.xml
    python_module : str or None
        the script's module name, where the FMU is one of PythonFMU's
    """

    label: str
    sha256: str
    folder: Path
    library: Path
    description: ModelDescription
    python_module: str | None

    def says(self, *flags: str) -> bool:
        """Whether its description claims a capability, by the name of FMI 2.0 or of 3.0."""
        said = [getattr(self.description.coSimulation, flag, None) for flag in flags]
        return any(str(flag).lower() in ("true", "1") for flag in said)


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


def shown(name: str) -> str:
    """A member's name for a message: shortened, without characters that would move a terminal's cursor."""
    return repr(name if len(name) <= LONGEST_SHOWN else f"{name[:LONGEST_SHOWN]}...")


def read_archive(path: Path, label: str, kind: str) -> bytes:
    """The bytes of an archive file, ".fmu" or ".ssp"; an OSError or an InputError where there are none to be had."""
    if path.is_dir():
        raise InputError(f"{label}: is a folder; give an {kind} file")
    if path.exists() and not path.is_file():
        raise InputError(f"{label}: is a pipe or a device; give an {kind} file")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{label}: is larger than {MOST_BYTES >> 30} GiB; not read")
    return path.read_bytes()


def refuse_outside(name: str, label: str, *, ssp: bool) -> None:
    """Refuse a name inside an archive that could land outside the archive's folder."""
    parts = PurePosixPath(name).parts
    forbidden = '\\:\0<>|?*"' if ssp else "\\:\0"
    if ".." in parts or name.startswith("/") or any(c in name for c in forbidden) or (ssp and not parts):
        raise InputError(f"{label}: member {shown(name)} would leave the archive's folder; not unpacked")


def check_members(members: Sequence[zipfile.ZipInfo], label: str, needed: str) -> None:
    """Refuse an archive that is not safe to unpack, or has not what makes it an FMU (an .ssp: an .ssd)."""
    ssp = needed.endswith(".ssd")
    whole, standard, other = ("an .ssp", "SSP", "a link or a device") if ssp else ("an FMU", "FMI", "a link")
    for member in members:
        # orig_filename still has the backslashes and what stands after a zero, which zipfile takes away.
        for name in (member.orig_filename, member.filename):
            refuse_outside(name, label, ssp=ssp)
        named, kind = f"{label}: member {shown(member.filename)}", stat.S_IFMT(member.external_attr >> 16)
        if kind == stat.S_IFLNK or (ssp and kind not in (0, stat.S_IFREG, stat.S_IFDIR)):
            raise InputError(f"{named} is {other}; not unpacked")
        if member.flag_bits & 1:
            raise InputError(f"{named} is encrypted; {whole} must not be")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{named} is compressed in a way that {standard} does not have")
    if len(members) > MOST_MEMBERS or sum(m.file_size for m in members) > MOST_BYTES:
        raise InputError(f"{label}: unpacks to more than {MOST_BYTES >> 30} GiB or {MOST_MEMBERS} files")
    names = [member.filename for member in members]
    # Two names that differ in case only are one file on some systems.
    if len({name.rstrip("/").casefold() if ssp else name for name in names}) != len(names):
        raise InputError(f"{label}: has two members of one name; corrupt archive")
    if needed not in names:
        raise InputError(f"{label}: has no {needed}; it is not {whole}")


def refuse_damaged(content: bytes, label: str) -> None:
    """Refuse an ELF library whose segments do not all lie within the file: the loader of Linux dies of one.

    Other formats are the loader's matter.

    Raises
    ------
    InputError
        the file ends before a segment does, or its headers make no sense
    """
    if not content.startswith(b"\x7fELF"):
        return
    try:
        wide, order = content[4] == 2, "<" if content[5] == 1 else ">"
        (start,) = struct.unpack_from(f"{order}{'Q' if wide else 'I'}", content, 32 if wide else 28)
        size, count = struct.unpack_from(f"{order}HH", content, 54 if wide else 42)
        for k in range(count):
            fields = struct.unpack_from(f"{order}{'IIQQQQ' if wide else 'IIIII'}", content, start + k * size)
            kind, offset, length = fields[0], fields[2 if wide else 1], fields[-1]
            if kind == _LOADED and offset + length > len(content):
                raise InputError(f"{label}: its library ends too early ({len(content)} bytes); it is damaged")
    except (struct.error, IndexError, OverflowError) as error:
        raise InputError(f"{label}: its library's headers make no sense ({error}); it is damaged") from error


def _version(xml: bytes, label: str) -> str:
    """The version of FMI; refuses a DOCTYPE, entities, XML that is not well-formed and what is neither FMI 2 nor 3."""
    roots: list[tuple[str, dict[str, str]]] = []

    def doctype(*_: object) -> None:
        raise InputError(f"{label}: modelDescription.xml declares a DOCTYPE; an FMU must not")

    def element(tag: str, attributes: dict[str, str]) -> None:
        if not roots:
            roots.append((tag, attributes))

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = doctype
    parser.StartElementHandler = element
    try:
        parser.Parse(xml, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"{label}: modelDescription.xml is not well-formed XML ({error})") from error
    root, attributes = roots[0]
    if root != "fmiModelDescription":
        raise InputError(f"{label}: modelDescription.xml does not describe an FMU (root is <{root}>)")
    version = attributes.get("fmiVersion", "")
    if not re.fullmatch(r"2\.0(\.\d+)?|3\.\d+(\.\d+)?(-.*)?", version):
        raise InputError(f"{label}: is FMI {version or 'of no stated version'}; export as FMI 2.0 or 3.0")
    return version


def _described(xml: bytes, label: str) -> ModelDescription:
    """FMPy's reading; what it cannot read is refused with its first complaint."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as alone:
        alone.writestr("modelDescription.xml", xml)
    try:
        description = fmpy.read_model_description(archive, validate=False)
    except Exception as error:  # FMPy raises whatever its parsing meets
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, KeyError):
            reason = f"it refers to {error.args[0]!r}, which is not there"
        raise InputError(f"{label}: modelDescription.xml cannot be used ({reason})") from error
    if description.coSimulation is None:
        raise InputError(f"{label}: is for model exchange only; export it for co-simulation")
    if not description.coSimulation.modelIdentifier:
        raise InputError(f"{label}: modelDescription.xml gives no modelIdentifier for co-simulation")
    return description


def _library(names: set[str], identifier: str, label: str, version: str) -> str:
    """The member that holds the library for this platform."""
    # fmpy.platform says linux64 on every 64-bit processor; only the tuple tells ARM from Intel.
    platforms = [fmpy.platform_tuple]
    if version.startswith("2") and (fmpy.architecture != "aarch64" or fmpy.system == "darwin"):
        platforms.insert(0, fmpy.platform)
    for platform_ in platforms:
        member = f"binaries/{platform_}/{identifier}{fmpy.sharedLibraryExtension}"
        if member in names:
            return member
    there = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    has = f"it has {', '.join(there)}" if there else "it has none at all"
    raise InputError(f"{label}: has no binary for this platform ({platforms[0]}); {has}")


def unpack(path: Path, label: str, make_folder: Callable[[str], Path]) -> UnpackedFmu:
    """Check an FMU archive and unpack it.

    Parameters
    ----------
    path : Path
        the file
    label : str
        what to call it in messages
    make_folder : callable
        sha256 -> an empty folder to unpack into; called only when the archive has passed all checks

    Raises
    ------
    InputError
        missing, damaged, unsafe, not co-simulation of FMI 2.0 or 3.0, or without a binary for this platform
    """
    try:
        content = read_archive(path, label, ".fmu")
    except FileNotFoundError as error:
        raise InputError(f"{label}: there is no such file (looked for {path}){nearest_file(path)}") from error
    except OSError as error:
        raise InputError(f"{label}: cannot be read ({error.strerror})") from error
    sha256 = hashlib.sha256(content).hexdigest()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            check_members(members, label, "modelDescription.xml")
            if archive.getinfo("modelDescription.xml").file_size > MOST_DESCRIPTION_BYTES:
                raise InputError(f"{label}: modelDescription.xml is too large")
            xml = archive.read("modelDescription.xml")
            version, description = _version(xml, label), _described(xml, label)
            assert description.coSimulation is not None
            identifier = str(description.coSimulation.modelIdentifier)
            library = _library({m.filename for m in members}, identifier, label, version)
            refuse_damaged(archive.read(library), label)
            folder = make_folder(sha256)
            # Sources and documentation are nothing that an FMU may read when it runs.
            needed = [m for m in members if not m.filename.startswith(("sources/", "documentation/"))]
            archive.extractall(folder, needed)
    except DAMAGE as error:
        raise InputError(f"{label}: is not a readable FMU archive ({error})") from error
    script = folder / "resources" / "slavemodule.txt"
    module = script.read_text("utf-8", errors="replace").strip() if script.is_file() else None
    return UnpackedFmu(label, sha256, folder, folder / library, description, module)


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


def keep(path: Path, content: bytes) -> None:
    """Put a file into the cache, whole; where that cannot be written, the run goes on without it."""
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(beside).replace(path)


def component_fmu(name: str, places: Sequence[EffectPlace], flavour: str | None, folder: Path) -> Path:
    """The FMU of a component, extended by effects, from the cache where it has been built before.

    Parameters
    ----------
    name : str
        of the component
    places : sequence of EffectPlace
    flavour : str or None
        "native", "python"; None: as `usual_flavour` says
    folder : Path
        where it is built

    Raises
    ------
    ValueError
        an effect that belongs to another component
    BuildError
        "native" was asked for, and nothing here compiles
    """
    if flavour is None and usual_flavour() == "native":
        with suppress(BuildError):
            return component_fmu(name, places, "native", folder)
    flavour = flavour or "python"
    compiler = (host_compiler() or ("", ""))[1] if flavour == "native" else ""
    made_from = [_sources(), name, repr(list(places)), flavour, compiler, str(zig_version())]
    made_from.append(os.environ.get("SOURCE_DATE_EPOCH", ""))
    kept = cache_folder() / "fmus" / hashlib.sha256("\0".join(made_from).encode()).hexdigest()
    for path in kept.glob("*.fmu"):
        # Its name is the hash of its bytes: a damaged one is built again.
        if hashlib.sha256(path.read_bytes()).hexdigest() == path.stem:
            return path
    path = build(name, folder, places, flavour=flavour)
    content = path.read_bytes()
    keep(kept / f"{hashlib.sha256(content).hexdigest()}.fmu", content)
    return path


def load(scenario: Scenario, sources: Sources, folder: Path) -> dict[str, Loaded]:
    """Build or find, check and unpack every FMU; resolve its parameters; an InputError for what cannot be had."""
    built: dict[tuple[str, tuple[EffectPlace, ...], str | None], Path] = {}
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
        interface = interface_of(name, label, fmu.description)
        if fmu.says("canBeInstantiatedOnlyOncePerProcess"):
            if fmu.sha256 in single:
                raise InputError(f"{label}: can be instantiated once only; '{single[fmu.sha256]}' and '{name}' use it")
            single[fmu.sha256] = name
        calibrated: Mapping[str, Any] = {}
        if setting.parameters_from is not None:
            calibrated = calibrated_parameters(name, setting, interface, sources)
        values = resolve_parameters(interface, setting.parameters, calibrated, of_effects)
        loaded[name] = Loaded(fmu, interface, values)
    return loaded


def _component(name: str, setting: FmuSetting, places: tuple[EffectPlace, ...], folder: Path) -> Path:
    component = str(setting.component)
    if component not in component_names():
        known = nearest(component, list(component_names()))
        raise InputError(f"fmus.{name}.component: there is no component '{component}'; {known}")
    try:
        return component_fmu(component, places, setting.flavour, folder)
    except ValueError as error:
        raise InputError(f"fmus.{name}.effects: {error}") from error
    except BuildError as error:
        raise InputError(f"fmus.{name}.flavour: {error}") from error


def _effects(name: str, setting: FmuSetting) -> tuple[tuple[EffectPlace, ...], dict[str, float]]:
    """The places of an FMU's effects and the values of the parameters that they bring."""
    places: list[EffectPlace] = []
    values: dict[str, float] = {}
    for number, entry in enumerate(setting.effects, start=1):
        where = f"fmus.{name}.effects[{number}]"
        try:
            _check_names(entry)
            place, parameters = place_from_mapping(entry)
            named = {parameter_name(place, key): value for key, value in parameters.items()}
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise InputError(f"{where}: {error}") from error
        if place in places:
            raise InputError(f"{where}: the same effect stands twice at the same place")
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


def calibrated_parameters(name: str, setting: FmuSetting, interface: Interface, sources: Sources) -> Mapping[str, Any]:
    """What the calibration result that a setting names says of the component's parameters.

    Raises
    ------
    InputError
        not such a file, a calibration that has no estimate, or nothing about this component
    """
    label, component = str(setting.parameters_from), setting.component or interface.model
    content = sources.read(label)
    with said_of(f"fmus.{name}.parameters_from: {label}"):
        try:
            data = json.loads(content.decode("utf-8"))
        except (ValueError, RecursionError) as error:
            raise InputError(f"is not JSON ({error})") from error
        if not isinstance(data, dict):
            raise InputError("is not a calibration result (schema trihedron.calibration/1)")
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
    calibrated: Mapping[str, Any],
    of_effects: Mapping[str, float],
) -> dict[str, tuple[Variable, Value]]:
    """The values to set before initialisation, one for each variable by its name; the later over the earlier.

    Parameters
    ----------
    interface : Interface
    explicit : mapping
        the scenario's `parameters`: name to value, or to a list for an array
    calibrated : mapping
        what a calibration says, in the same form; explicit values win
    of_effects : mapping
        the parameters that effects bring

    Raises
    ------
    InputError
        an unknown variable, one that is neither parameter nor input, or a value that it does not take
    """
    resolved: dict[str, tuple[Variable, Value]] = {}
    for origin, values in {"parameters_from": calibrated, "effects": of_effects, "parameters": explicit}.items():
        named: dict[str, str] = {}
        for name, value in values.items():
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
