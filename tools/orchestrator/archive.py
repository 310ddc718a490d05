"""Check an FMU's archive before unpacking it; an .ssp file passes the same checks."""

import hashlib
import io
import math
import re
import stat
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.parsers import expat

import fmpy
from fmpy.model_description import ModelDescription, ModelVariable

from ..errors import InputError, full
from ..files import bytes_of
from ..locks import own_folder
from .guest_process import NEGATIVE, Clock

MOST_MEMBERS = 20_000
MOST_BYTES = 2 << 30
MOST_DESCRIPTION_BYTES, MOST_ELEMENTS = 32 << 20, 300_000
"""Limits for the XML file that describes a model or a system: enough for some hundred thousand variables."""
DESCRIBING = (".ssd", ".ssv", ".ssm", ".ssb")
MOST_TIMES, SMALL = 200, 64 << 20
"""Largest expansion ratio, and the unpacked size [bytes] above which it applies (protects disk and memory)."""
TOLERANCE = 1e-6
"""Relative tolerance of a solver if neither the user nor the FMU gives one."""
INTERFACES = {"me": "model exchange", "cs": "co-simulation"}
LONGEST_SHOWN = 80
MOST_LIBRARIES = 6
"""Largest number of libraries that a message lists."""
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError)
_LOADED = 1
"""Type of a segment of a library that is mapped into memory (PT_LOAD)."""


@dataclass(frozen=True)
class UnpackedFmu:
    """An FMU on disk, ready to be loaded, with its shared library for this platform and FMPy's reading of it.

    `label` is the name that the user wrote; `sha256` is the hash of the archive. The script of a PythonFMU is the
    module `python_module`. A `guest` runs in a process of its own, where each call may take at most `call_limit_s`. A
    guest of model exchange has a solver; `tolerance` replaces the tolerance of its description. With `event_mode` the
    orchestrator handles the events of a co-simulation FMU.
    """

    label: str
    sha256: str
    folder: Path
    library: Path
    description: ModelDescription
    python_module: str | None
    guest: bool = False
    call_limit_s: float | None = None
    tolerance: float | None = None
    event_mode: bool = False

    @property
    def solver(self) -> tuple[()] | tuple[int, int, float]:
        """Numbers of states and of event indicators, and the tolerance, for model exchange; otherwise empty.

        Raises InputError if the tolerance in its description is not a number.
        """
        if self.description.coSimulation is not None:
            return ()
        tolerance_text = getattr(self.description.defaultExperiment, "tolerance", None)
        try:
            tolerance = self.tolerance or float(tolerance_text or TOLERANCE)
        except ValueError as error:
            raise InputError(f"{self.label}: modelDescription.xml, DefaultExperiment, tolerance: {error}") from error
        return self.description.numberOfContinuousStates, self.description.numberOfEventIndicators, tolerance

    @property
    def clocks(self) -> list[Clock]:
        """Periodic input clocks.

        Raises InputError for an input clock that is not constant, and for any without event mode.
        """
        clocks = []
        for variable in self.description.modelVariables:
            if variable.type != "Clock" or variable.causality != "input":
                continue
            name = f"{self.label}: input clock '{variable.name}'"
            if variable.intervalVariability != "constant":
                how = f"{variable.intervalVariability}; only constant periodic clocks tick"
                raise InputError(f"{name} is {how}")
            if self.description.coSimulation is not None and not self.says("hasEventMode"):
                raise InputError(f"{name} cannot tick: the FMU does not say hasEventMode")
            try:
                clock = _periodic(variable)
            except (ValueError, TypeError, OverflowError) as error:
                raise InputError(f"{name} has no positive interval ({error})") from error
            clocks.append((int(variable.valueReference), *clock))
        return clocks

    @property
    def version(self) -> int:
        """FMI version: 3, or 2, which stands for FMI 1.0 too."""
        return fmi_version(self.description)

    @property
    def first_edition(self) -> str:
        """Prefix of the functions of FMI 1.0, which are called like those of 2.0; empty for later versions."""
        return self.library.stem if self.description.fmiVersion == "1.0" else ""

    @property
    def token(self) -> str:
        """Token with which the library is instantiated."""
        if self.version == 3:
            return str(self.description.instantiationToken)
        return str(self.description.guid)

    def says(self, *flags: str) -> bool:
        """Return True if the description claims one of these capabilities (names of FMI 2.0 or 3.0)."""
        for flag in flags:
            claim = getattr(self.description.coSimulation, flag, None)
            if str(claim).lower() in ("true", "1"):
                return True
        return False


def _periodic(variable: ModelVariable) -> tuple[float, float, float]:
    """Return shift and interval of a periodic clock, and the resolution by which both are divided."""
    if variable.intervalCounter is not None:
        shift, interval, resolution = variable.shiftCounter, variable.intervalCounter, variable.resolution
    else:
        shift, interval, resolution = variable.shiftDecimal or 0.0, variable.intervalDecimal, 1.0
    numbers = float(shift or 0.0), float(str(interval)), float(str(resolution))
    if not (min(numbers[1:]) > 0.0 and all(map(math.isfinite, numbers))):
        raise ValueError(f"{interval} / {resolution}")
    return numbers


def _read_intervals(xml: bytes, description: ModelDescription) -> None:
    """Add the intervals of clocks to the description: FMPy does not read them."""
    variables = {variable.name: variable for variable in description.modelVariables if variable.type == "Clock"}
    if not variables:
        return
    for element in ElementTree.fromstring(xml).iter("Clock"):
        for key in ("intervalDecimal", "shiftDecimal", "intervalCounter", "shiftCounter", "resolution"):
            if key in element.attrib and element.get("name") in variables:
                setattr(variables[str(element.get("name"))], key, element.get(key))


def _complete_first(xml: bytes, description: ModelDescription, label: str) -> None:
    """Add to a description of FMI 1.0 what FMPy does not read: capabilities, start values of states, aliases.

    A number that is the negative of another variable has a reference from `NEGATIVE` on. Raises InputError for an input
    that is a negative, and for an output that is none of a number.
    """
    root = ElementTree.fromstring(xml)
    for element in root.iter("Capabilities"):
        for flag, claim in element.attrib.items():
            # FMPy's reading has the capabilities that FMI 2.0 has too.
            if hasattr(description.coSimulation, flag):
                setattr(description.coSimulation, flag, claim)
    elements = root.iter("ScalarVariable")
    negative = {element.get("name") for element in elements if element.get("alias") == "negatedAlias"}
    variables = []
    for variable in description.modelVariables:
        is_negative = variable.name in negative
        if is_negative and variable.type == "Real" and variable.causality != "input":
            variable.valueReference = int(variable.valueReference) | NEGATIVE
            variable.start = None
        if not is_negative or variable.valueReference >= NEGATIVE:
            variables.append(variable)
        elif variable.causality in ("input", "output"):
            raise InputError(f"{label}: {variable.causality} '{variable.name}' is the negative of another variable")
        if variable.start is not None and variable.causality in ("local", "output"):
            variable.initial = "approx"
    description.modelVariables[:] = variables


def fmi_version(description: ModelDescription) -> int:
    """Return the FMI version: 3, or 2, which stands for FMI 1.0 too."""
    return int(str(description.fmiVersion).startswith("3")) + 2


def member_label(name: str) -> str:
    """Return a member's name for a message: shortened, without characters that move a terminal's cursor."""
    if len(name) > LONGEST_SHOWN:
        name = f"{name[:LONGEST_SHOWN]}..."
    return repr(name)


def refuse_outside(name: str, label: str, *, ssp: bool) -> None:
    """Refuse a name inside an archive that could land outside the archive's folder."""
    parts = PurePosixPath(name).parts
    forbidden = "\\:\0"
    if ssp:
        forbidden += '<>|?*"'
    if ".." in parts or name.startswith("/") or any(c in name for c in forbidden) or (ssp and not parts):
        raise InputError(f"{label}: member {member_label(name)} would leave the archive's folder; not unpacked")
    if not parts and not name.endswith("/"):
        raise InputError(f"{label}: has a member without a name ({member_label(name)}); not unpacked")


def check_members(members: Sequence[zipfile.ZipInfo], label: str, needed: str) -> None:
    """Refuse an archive that is unsafe to unpack or lacks the file `needed` (an FMU's description, an .ssp's .ssd)."""
    ssp = needed.endswith(".ssd")
    kind_of_file, standard, forbidden_kind = "an FMU", "FMI", "a link"
    if ssp:
        kind_of_file, standard, forbidden_kind = "an .ssp", "SSP", "a link or a device"
    for member in members:
        # orig_filename keeps the backslashes and the text after a zero byte, which zipfile removes.
        for name in (member.orig_filename, member.filename):
            refuse_outside(name, label, ssp=ssp)
        where = f"{label}: member {member_label(member.filename)}"
        kind = stat.S_IFMT(member.external_attr >> 16)
        if kind == stat.S_IFLNK or (ssp and kind not in (0, stat.S_IFREG, stat.S_IFDIR)):
            raise InputError(f"{where} is {forbidden_kind}; not unpacked")
        if member.flag_bits & 1:
            raise InputError(f"{where} is encrypted; {kind_of_file} must not be")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{where} is compressed in a way that {standard} does not have")
    if len(members) > MOST_MEMBERS or sum(m.file_size for m in members) > MOST_BYTES:
        raise InputError(f"{label}: unpacks to more than {MOST_BYTES >> 30} GiB or {MOST_MEMBERS} files")
    for member in members:
        described = member.filename == needed or member.filename.endswith(DESCRIBING)
        if described and member.file_size > MOST_DESCRIPTION_BYTES:
            raise InputError(f"{label}: {member.filename} is larger than {MOST_DESCRIPTION_BYTES >> 20} MiB; not read")
    if sum(m.file_size for m in members) > max(SMALL, MOST_TIMES * sum(m.compress_size for m in members)):
        raise InputError(f"{label}: unpacks to more than {MOST_TIMES} times its size; not unpacked")
    # Identical members count once.
    members = list({(m.orig_filename, m.CRC, m.file_size): m for m in members}.values())
    names = [member.filename for member in members]
    # Some systems treat two names that differ only in case as one file.
    files = {name.rstrip("/").casefold() for name in names} if ssp else set(names)
    if len(files) != len(names):
        raise InputError(f"{label}: has two members of one name; corrupt archive")
    if needed not in names:
        raise InputError(f"{label}: has no {needed}; it is not {kind_of_file}")


def refuse_damaged(content: bytes, label: str) -> None:
    """Refuse an ELF library with a segment outside the file: the loader of Linux crashes on one.

    The loader itself checks other formats.
    """
    if not content.startswith(b"\x7fELF"):
        return
    try:
        order = "<" if content[5] == 1 else ">"
        word, segment, offset_field, places = "I", "IIIII", 1, (28, 42)
        if content[4] == 2:
            word, segment, offset_field, places = "Q", "IIQQQQ", 2, (32, 54)
        (start,) = struct.unpack_from(order + word, content, places[0])
        size, count = struct.unpack_from(f"{order}HH", content, places[1])
        for k in range(count):
            fields = struct.unpack_from(order + segment, content, start + k * size)
            if fields[0] == _LOADED and fields[offset_field] + fields[-1] > len(content):
                raise InputError(f"{label}: its library ends too early ({len(content)} bytes); it is damaged")
    except (struct.error, IndexError, OverflowError) as error:
        raise InputError(f"{label}: its library's headers make no sense ({error}); it is damaged") from error


def xml_root(xml: bytes, name: str, kind_of_file: str, deepest: int | None = None) -> tuple[str, dict[str, str]]:
    """Return the tag and the attributes of the root of an XML document.

    Raises InputError for a DOCTYPE, for entities, and for XML that is not well-formed, too deep, or has too many
    elements.
    """
    roots: list[tuple[str, dict[str, str]]] = []
    depth = count = 0

    def doctype(*_: object) -> None:
        raise InputError(f"{name} declares a DOCTYPE; {kind_of_file} must not")

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


def _described(xml: bytes, label: str, interface: str | None) -> ModelDescription:
    """Return FMPy's reading of modelDescription.xml, with one interface, or refuse it with FMPy's first complaint."""
    name = f"{label}: modelDescription.xml"
    root, attributes = xml_root(xml, name, "an FMU")
    if root != "fmiModelDescription":
        raise InputError(f"{name} does not describe an FMU (root is <{root}>)")
    version = attributes.get("fmiVersion", "")
    if not re.fullmatch(r"1\.0|2\.0(\.\d+)?|3\.\d+(\.\d+)?(-.*)?", version):
        raise InputError(f"{label}: is FMI {version or 'of no stated version'}; export as FMI 2.0 or 3.0")
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as alone:
        alone.writestr("modelDescription.xml", xml)
    try:
        description = fmpy.read_model_description(archive, validate=False)
    except Exception as error:  # FMPy lets any exception of its parsing through.
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, KeyError):
            reason = f"it refers to {error.args[0]!r}, which is not there"
        raise InputError(f"{name} cannot be used ({reason})") from error
    _read_intervals(xml, description)
    if version == "1.0":
        _complete_first(xml, description, label)
    if interface is not None:
        kinds = {"me": description.modelExchange, "cs": description.coSimulation}
        if kinds[interface] is None:
            other = {"me": "--interface cs", "cs": "--interface me"}[interface]
            raise InputError(f"{label}: has no {INTERFACES[interface]}; {other} may be there")
        if interface == "me":
            description.coSimulation = None
    kind = description.coSimulation or description.modelExchange
    if kind is None:
        what = "neither co-simulation nor model exchange"
        if getattr(description, "scheduledExecution", None) is not None:
            what = "scheduled execution only"
        raise InputError(f"{label}: is for {what}; export it for co-simulation")
    if not kind.modelIdentifier:
        what = "model exchange"
        if kind is description.coSimulation:
            what = "co-simulation"
        raise InputError(f"{name} gives no modelIdentifier for {what}")
    return description


def _library(names: set[str], description: ModelDescription, label: str) -> str:
    """Return the archive member that holds the library for this platform."""
    kind = description.coSimulation or description.modelExchange
    assert kind is not None
    # fmpy.platform says linux64 on every 64-bit processor; only the tuple tells ARM from Intel.
    platforms = [fmpy.platform_tuple]
    if fmi_version(description) == 2 and (fmpy.architecture != "aarch64" or fmpy.system == "darwin"):
        platforms.insert(0, fmpy.platform)
    for platform in platforms:
        member = f"binaries/{platform}/{kind.modelIdentifier}{fmpy.sharedLibraryExtension}"
        if member in names:
            return member
    inside = []
    for name in sorted(names):
        if name.startswith("binaries/") and name.endswith((".so", ".dll", ".dylib")):
            inside.append(member_label(name)[1:-1])
    if len(inside) > MOST_LIBRARIES:
        inside[MOST_LIBRARIES:] = ["..."]
    missing = f"binaries/{platforms[0]}/{kind.modelIdentifier}{fmpy.sharedLibraryExtension}"
    there = ", ".join(inside) or "no library at all"
    raise InputError(f"{label}: has no binary for this platform: {missing} is missing; it has {there}")


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder for unpacked FMUs; afterwards remove their scripts' modules and search paths from Python."""
    before = set(sys.modules)
    with own_folder() as folder:
        name = str(folder)
        try:
            yield folder
        finally:
            sys.path[:] = [entry for entry in sys.path if not str(entry).startswith(name)]
            for module in sys.modules.keys() - before:
                if str(getattr(sys.modules.get(module), "__file__", None)).startswith(name):
                    sys.modules.pop(module, None)


def unpack(path: Path, label: str, make_folder: Callable[[str], Path], interface: str | None = None) -> UnpackedFmu:
    """Check an FMU archive and unpack it into the folder for its SHA-256, which is made after all checks pass.

    `interface` is "me" or "cs"; None takes co-simulation if it is there.

    Raises InputError if it is missing, damaged, unsafe, not for this platform, or neither co-simulation nor model
    exchange of FMI 1.0, 2.0 or 3.0.
    """
    content = bytes_of(path, "give an .fmu file", label=label, archive=True)
    sha256 = hashlib.sha256(content).hexdigest()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            check_members(members, label, "modelDescription.xml")
            xml = archive.read("modelDescription.xml")
            description = _described(xml, label, interface)
            library = _library({m.filename for m in members}, description, label)
            refuse_damaged(archive.read(library), label)
            folder = make_folder(sha256)
            # An FMU may not read its sources and documentation at run time.
            for member in members:
                if not member.filename.startswith(("sources/", "documentation/")):
                    archive.extract(member, folder)
    except DAMAGE as error:
        if full(error):
            raise
        raise InputError(f"{label}: is not a readable FMU archive ({error})") from error
    script = folder / "resources" / "slavemodule.txt"
    module = None
    if script.is_file():
        module = script.read_text("utf-8", errors="replace").strip()
    return UnpackedFmu(label, sha256, folder, folder / library, description, module)
