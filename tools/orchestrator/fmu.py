"""An FMU: its archive checked before anything is unpacked; its instance, the status of each call looked at.

What is checked of an archive holds for an .ssp too.
"""

import ctypes
import hashlib
import io
import math
import os
import re
import stat
import struct
import sys
import zipfile
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from weakref import WeakValueDictionary
from xml.parsers import expat

import fmpy
import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription

from ..errors import InputError
from ..files import bytes_of
from ..locks import PREFIX
from .interface import Interface, Value, Variable

MOST_MEMBERS = 20_000
MOST_BYTES = 2 << 30
MOST_DESCRIPTION_BYTES, MOST_ELEMENTS = 32 << 20, 300_000
"""Of a file that describes a model or a system: some hundred thousand variables."""
DESCRIBING = (".ssd", ".ssv", ".ssm", ".ssb")
MOST_TIMES, SMALL = 200, 64 << 20
"""What unpacks to so many times its size and to more than so many bytes is made to fill a disk or a memory."""
LONGEST_SHOWN = 80
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError)
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
DISCARD = 2
FATAL = 4
_LOADED = 1
"""Type of a segment of a library that is mapped into memory (PT_LOAD)."""


@dataclass(frozen=True)
class UnpackedFmu:
    """An FMU on disk, ready to be loaded, with its shared library for this platform and FMPy's reading of it.

    `label` is as the user wrote it, `sha256` is of the archive; where the FMU is one of PythonFMU's, its script is a
    module of the name `python_module`.
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


def shown(name: str) -> str:
    """A member's name for a message: shortened, without characters that would move a terminal's cursor."""
    return repr(name if len(name) <= LONGEST_SHOWN else f"{name[:LONGEST_SHOWN]}...")


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
    for member in members:
        described = member.filename == needed or member.filename.endswith(DESCRIBING)
        if described and member.file_size > MOST_DESCRIPTION_BYTES:
            raise InputError(f"{label}: {member.filename} is larger than {MOST_DESCRIPTION_BYTES >> 20} MiB; not read")
    if sum(m.file_size for m in members) > max(SMALL, MOST_TIMES * sum(m.compress_size for m in members)):
        raise InputError(f"{label}: unpacks to more than {MOST_TIMES} times its size; not unpacked")
    names = [member.filename for member in members]
    # Two names that differ in case only are one file on some systems.
    if len({name.rstrip("/").casefold() if ssp else name for name in names}) != len(names):
        raise InputError(f"{label}: has two members of one name; corrupt archive")
    if needed not in names:
        raise InputError(f"{label}: has no {needed}; it is not {whole}")


def refuse_damaged(content: bytes, label: str) -> None:
    """Refuse an ELF library whose segments do not all lie within the file: the loader of Linux dies of one.

    Other formats are the loader's matter.
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


def xml_root(xml: bytes, name: str, whole: str, deepest: int | None = None) -> tuple[str, dict[str, str]]:
    """The tag of the root of an XML document, and its attributes.

    An InputError for a DOCTYPE or entities, which `whole` must not have, XML that is not well-formed, too deep, or of
    too many elements.
    """
    roots: list[tuple[str, dict[str, str]]] = []
    depth = count = 0

    def doctype(*_: object) -> None:
        raise InputError(f"{name} declares a DOCTYPE; {whole} must not")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth += 1
        count += 1
        if depth == 1:
            roots.append((tag, attributes))
        if count > MOST_ELEMENTS:
            raise InputError(f"{name} has more than {MOST_ELEMENTS:,} elements; not read")
        if deepest is not None and depth > deepest:
            raise InputError(f"{name} is nested more than {deepest} elements deep; not read")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        parser.Parse(xml, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"{name} is not well-formed XML ({error})") from error
    return roots[0]


def _described(xml: bytes, label: str) -> ModelDescription:
    """FMPy's reading of modelDescription.xml; what it cannot read is refused with its first complaint."""
    name = f"{label}: modelDescription.xml"
    root, attributes = xml_root(xml, name, "an FMU")
    if root != "fmiModelDescription":
        raise InputError(f"{name} does not describe an FMU (root is <{root}>)")
    version = attributes.get("fmiVersion", "")
    if not re.fullmatch(r"2\.0(\.\d+)?|3\.\d+(\.\d+)?(-.*)?", version):
        raise InputError(f"{label}: is FMI {version or 'of no stated version'}; export as FMI 2.0 or 3.0")
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as alone:
        alone.writestr("modelDescription.xml", xml)
    try:
        description = fmpy.read_model_description(archive, validate=False)
    except Exception as error:  # FMPy raises whatever its parsing meets
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, KeyError):
            reason = f"it refers to {error.args[0]!r}, which is not there"
        raise InputError(f"{name} cannot be used ({reason})") from error
    if description.coSimulation is None:
        raise InputError(f"{label}: is for model exchange only; export it for co-simulation")
    if not description.coSimulation.modelIdentifier:
        raise InputError(f"{name} gives no modelIdentifier for co-simulation")
    return description


def _library(names: set[str], description: ModelDescription, label: str) -> str:
    """The member that holds the library for this platform."""
    assert description.coSimulation is not None
    # fmpy.platform says linux64 on every 64-bit processor; only the tuple tells ARM from Intel.
    platforms = [fmpy.platform_tuple]
    if str(description.fmiVersion).startswith("2") and (fmpy.architecture != "aarch64" or fmpy.system == "darwin"):
        platforms.insert(0, fmpy.platform)
    for platform in platforms:
        member = f"binaries/{platform}/{description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        if member in names:
            return member
    there = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    has = f"it has {', '.join(there)}" if there else "it has none at all"
    raise InputError(f"{label}: has no binary for this platform ({platforms[0]}); {has}")


def unpack(path: Path, label: str, make_folder: Callable[[str], Path]) -> UnpackedFmu:
    """Check an FMU archive and unpack it into the folder for its SHA-256, which is made when all checks are passed.

    An InputError where it is missing, damaged, unsafe, not co-simulation of FMI 2.0 or 3.0, or not for this platform.
    """
    content = bytes_of(path, "give an .fmu file", label=label, archive=True)
    sha256 = hashlib.sha256(content).hexdigest()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            check_members(members, label, "modelDescription.xml")
            xml = archive.read("modelDescription.xml")
            description = _described(xml, label)
            library = _library({m.filename for m in members}, description, label)
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


def forget_script(fmu: UnpackedFmu) -> None:
    """Make Python forget a module of the name of a PythonFMU script.

    The FMU's library imports its script by name: a module that the process already has under this name (another
    FMU's script, an older version) would be run instead of it, without a word.
    """
    if fmu.python_module:
        sys.modules.pop(fmu.python_module, None)
        resources = fmu.folder / "resources"
        for script in resources.glob("*.py"):
            loaded = sys.modules.get(script.stem)
            if loaded is not None and PREFIX in str(getattr(loaded, "__file__", "")):
                del sys.modules[script.stem]


def _listen(environment: int | None, status: int, text: bytes | None, name: bytes | None = None) -> None:
    """Give a message to the instance that it comes from: by its environment, else by its name, else to all."""
    message = " ".join((text or b"").decode("utf-8", "replace").split())
    slave, called = LISTENING.get(environment or 0), (name or b"").decode("utf-8", "replace")
    heard = [slave] if slave else [s for s in LISTENING.values() if s.name == called] or list(LISTENING.values())
    for instance in heard:
        instance.hear(status, message)


LISTENING: "WeakValueDictionary[int, Slave]" = WeakValueDictionary()
# One logger for all instances, never freed: FMPy's proxy knows only the logger that it was given last.
_LOGGER_2 = fmi2.fmi2CallbackLoggerTYPE(lambda at, name, status, _, text: _listen(at, status, text, name))
_LOGGER_3 = fmi3.fmi3LogMessageCallback(lambda at, status, _, text: _listen(at, status, text))
_NO_UPDATE = fmi3.fmi3IntermediateUpdateCallback()


class Slave:
    """An instance of an FMU of FMI 2.0, under its name in the scenario.

    A failing call is an InputError with FMU, call, time and the FMU's own words.
    """

    prefix = "fmi2"
    fmpy_class: Any = fmi2.FMU2Slave
    token = "guid"
    set_state, get_state, free_state = "fmi2SetFMUstate", "fmi2GetFMUstate", "fmi2FreeFMUstate"

    def __init__(self, name: str, fmu: UnpackedFmu) -> None:
        self.name = name
        self.label = fmu.label
        self._log: deque[tuple[int, str]] = deque(maxlen=64)
        LISTENING[id(self)] = self
        self._dead = False
        self._instance: Any = None
        forget_script(fmu)
        here = Path.cwd()
        assert fmu.description.coSimulation is not None
        try:
            self._fmu: Any = self.fmpy_class(
                instanceName=self.name,
                guid=getattr(fmu.description, self.token),
                modelIdentifier=fmu.description.coSimulation.modelIdentifier,
                unzipDirectory=str(fmu.folder),
                libraryPath=str(fmu.library),
            )
        except Exception as error:  # FMPy raises plain Exception, AttributeError or OSError here
            raise InputError(f"{self}: its library cannot be loaded ({' '.join(str(error).split())})") from error
        finally:
            os.chdir(here)
        try:
            self._instantiate(fmu)
        except Exception as error:  # FMPy raises plain Exception when it gets no instance
            self._unload()
            raise InputError(f"{self}: {self.prefix}Instantiate failed{self._said()}") from error
        self._instance = self._fmu
        self.component: int = self._fmu.component

    def _instantiate(self, fmu: UnpackedFmu) -> None:
        callbacks = self._callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = _LOGGER_2
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        callbacks.componentEnvironment = id(self)
        # FMPy's proxy expands printf patterns. PythonFMU hands over finished text in which "%s" may stand (of an
        # exception, say): expanding it would read memory that is nobody's.
        if fmu.python_module is None:
            with suppress(ImportError, OSError, AttributeError):
                from fmpy.logging import addLoggerProxy

                addLoggerProxy(ctypes.byref(callbacks))
        self._fmu.instantiate(callbacks=callbacks, loggingOn=True)

    def __str__(self) -> str:
        return f"FMU '{self.name}' ({self.label})"

    def hear(self, status: int, message: str) -> None:
        """Keep a message of the FMU."""
        self._log.append((status, message))

    def _said(self) -> str:
        """What the FMU said of its failure."""
        serious = [text for status, text in self._log if status >= DISCARD and text]
        # PythonFMU may lose the exception that it reports; what the script logged before says more.
        telling = [text for text in serious if not text.endswith("PyObject_CallMethod unknown error")]
        messages = telling or serious or [text for _, text in self._log if text]
        return f": {messages[-1]}" if messages else " (its log says nothing)"

    def fail(self, call: str, status: int, time: float | None) -> NoReturn:
        """Refuse the run because `call` returned `status`."""
        self._dead = self._dead or status == FATAL
        ended = STATUSES[status] if 0 <= status < len(STATUSES) else f"status {status}"
        when = "before the first step" if time is None else f"at {time:.9g} s"
        raise InputError(f"{self}: {call} {when} ended with {ended}{self._said()}")

    def refuse_not_finite(self, variables: Iterable[Variable], values: Iterable[float], time: float) -> NoReturn:
        """Refuse the run because one of these outputs is not finite."""
        found = [(v.name, float(x)) for v, x in zip(variables, values, strict=True) if not math.isfinite(x)]
        raise InputError(f"{self}: {found[0][0]} is {found[0][1]} at {time:.9g} s")

    def call(self, name: str, *arguments: Any) -> None:
        """Call an FMI function by name with this instance; a status above Warning is an InputError."""
        try:
            getattr(self._fmu, name)(self.component, *arguments)
        except FMICallException as error:
            self.fail(name, error.status, None)

    def address(self, name: str) -> int:
        """Where a C function of the library is."""
        try:
            found = ctypes.cast(self._fmu.dll[name], ctypes.c_void_p).value
        except AttributeError as error:
            raise InputError(f"{self}: its library has no function {name}") from error
        assert found is not None
        return found

    def accessor(self, verb: str, access: str) -> str:
        """Name of the function that gets or sets values of a type."""
        return f"{self.prefix}{verb}{'Boolean' if access == 'Boolean2' else access}"

    def set_values(self, values: Iterable[tuple[Variable, Value]], _: Interface) -> None:
        """Set variables one by one, as is done before the run."""
        for variable, value in values:
            self._set(variable, [value], f"{variable.name} = {value!r}")

    def _set(self, variable: Variable, values: list[Any], said: str) -> None:
        """Set a variable, or an array of FMI 3.0."""
        name, reference = self.accessor("Set", variable.access), ctypes.c_uint(variable.reference)
        sizes = () if self.prefix == "fmi2" else (len(values),)
        # Its prototype is FMPy's, which knows no memory of numpy.
        words = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, *[ctypes.c_size_t] * len(sizes))
        function = ctypes.CFUNCTYPE(ctypes.c_int, *words)(self.address(name))
        if variable.kind == "String":
            values = [ctypes.create_string_buffer(str(value).encode()) for value in values]
            memory = np.array([ctypes.addressof(text) for text in values], dtype=np.uint64)
        else:
            memory = np.array(values, dtype=variable.value_type.dtype)
        status = function(self.component, ctypes.addressof(reference), 1, memory.ctypes.data, *sizes)
        if status > 1:
            try:
                self.fail(name, status, None)
            except InputError as error:
                raise InputError(f"{error} [setting {said}]") from error

    def begin(self, start: float, stop: float) -> None:
        """Tell the times of the run and enter initialisation."""
        self.call("fmi2SetupExperiment", 0, 0.0, start, 1, stop)
        self.call("fmi2EnterInitializationMode")

    def free_state_at(self, place: int) -> None:
        """Free a state that stands at an address."""
        if self._instance is not None and not self._dead:
            free = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(self.address(self.free_state))
            free(self.component, place)

    def close(self, *, finished: bool = False) -> None:
        """Terminate (after a run that came to its end), free, unload; may be called twice."""
        instance, self._instance = self._instance, None
        if instance is None or self._dead:
            # After Fatal, FMI allows no further call.
            return
        try:
            if finished:
                self.call(f"{self.prefix}Terminate")
        finally:
            if not self._dead:
                getattr(instance, f"{self.prefix}FreeInstance")(self.component)
                self._unload()

    def _unload(self) -> None:
        """Unload the library; PythonFMU's lets go of its interpreter first.

        At the end of the process it would do so in memory that it has freed, which corrupts the heap: that library of
        C++ is not really unloaded before.
        """
        with suppress(AttributeError):
            self._fmu.dll["finalizePythonInterpreter"]()
        self._fmu.freeLibrary()


class Slave3(Slave):
    """An instance of an FMU of FMI 3.0."""

    prefix = "fmi3"
    fmpy_class = fmi3.FMU3Slave
    token = "instantiationToken"
    set_state, get_state, free_state = "fmi3SetFMUState", "fmi3GetFMUState", "fmi3FreeFMUState"

    def _instantiate(self, fmu: UnpackedFmu) -> None:
        resources = fmu.folder / "resources"
        where = f"{resources}/".encode() if resources.is_dir() else None
        token = str(fmu.description.instantiationToken).encode()
        visible, logging, events, early = False, True, False, False
        self._fmu.component = self._fmu.fmi3InstantiateCoSimulation(
            self.name.encode(), token, where, visible, logging, events, early,
            (fmi3.fmi3ValueReference * 0)(), 0, id(self), _LOGGER_3, _NO_UPDATE,
        )  # fmt: skip
        if not self._fmu.component:
            raise RuntimeError("no instance")

    def set_values(self, values: Iterable[tuple[Variable, Value]], interface: Interface) -> None:
        """Set variables, arrays as a whole: what is not given of an array keeps its start value."""
        arrays: dict[int, dict[Variable, Value]] = {}
        for variable, value in values:
            arrays.setdefault(variable.reference, {})[variable] = value
        for given in arrays.values():
            first = next(iter(given))
            name = first.name.rpartition("[")[0] if first.size > 1 else first.name
            elements = interface.find(name)
            whole = [given.get(v, v.start) for v in elements]
            if None in whole:
                raise InputError(f"{self}: {name} has no start values; give all its {len(whole)} elements")
            self._set(first, whole, f"{name} = {whole[0] if len(whole) == 1 else whole!r}")

    def begin(self, start: float, stop: float) -> None:
        """Enter initialisation with the times of the run."""
        self.call("fmi3EnterInitializationMode", False, 0.0, start, True, stop)
