"""FMU files: checked before anything is unpacked, then unpacked into a folder of our own."""

import hashlib
import io
import re
import stat
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.parsers import expat

import fmpy
from fmpy.model_description import ModelDescription

from ..errors import InputError, nearest_file
from .shared_library import refuse_damaged

MOST_MEMBERS = 20_000
MOST_BYTES = 2 << 30
MOST_DESCRIPTION_BYTES = 128 << 20
LONGEST_SHOWN = 80
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How FMI and SSP let members be compressed."""
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError)


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


def shown(name: str) -> str:
    """A member's name for a message: shortened, without characters that would move a terminal's cursor."""
    return repr(name if len(name) <= LONGEST_SHOWN else f"{name[:LONGEST_SHOWN]}...")


def _check_member(member: zipfile.ZipInfo, label: str) -> None:
    """Refuse a name that could land outside the folder, a link and an encrypted member."""
    # orig_filename still has the backslashes that zipfile turns into slashes on some platforms.
    for name in (member.orig_filename, member.filename):
        parts = PurePosixPath(name).parts
        if ".." in parts or name.startswith("/") or "\\" in name or ":" in name or "\0" in name:
            raise InputError(f"{label}: member {shown(name)} would leave the archive's folder; not unpacked")
    if stat.S_ISLNK(member.external_attr >> 16):
        raise InputError(f"{label}: member {shown(member.filename)} is a link; not unpacked")
    if member.flag_bits & 1:
        raise InputError(f"{label}: member {shown(member.filename)} is encrypted; an FMU must not be")
    if member.compress_type not in METHODS:
        raise InputError(f"{label}: member {shown(member.filename)} is compressed in a way that FMI does not have")


def _root_attributes(xml: bytes, label: str) -> dict[str, str]:
    """Attributes of the root element; refuses a DOCTYPE, entities and XML that is not well-formed."""
    root: dict[str, str] = {}
    name: list[str] = []

    def doctype(*_: object) -> None:
        raise InputError(f"{label}: modelDescription.xml declares a DOCTYPE; an FMU must not")

    def element(tag: str, attributes: dict[str, str]) -> None:
        if not name:
            name.append(tag)
            root.update(attributes)

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    parser.StartElementHandler = element
    try:
        parser.Parse(xml, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"{label}: modelDescription.xml is not well-formed XML ({error})") from error
    if name != ["fmiModelDescription"]:
        raise InputError(f"{label}: modelDescription.xml does not describe an FMU (root is <{name[0]}>)")
    return root


def _check_version(version: str, label: str) -> None:
    if not re.fullmatch(r"2\.0(\.\d+)?|3\.\d+(\.\d+)?(-.*)?", version):
        raise InputError(f"{label}: is FMI {version or 'of no stated version'}; export as FMI 2.0 or 3.0")


def _library(names: set[str], identifier: str, label: str, version: str) -> str:
    """The member that holds the library for this platform."""
    # fmpy.platform says linux64 on every 64-bit processor; only the tuple tells ARM from Intel.
    platforms = [fmpy.platform_tuple]
    if version.startswith("2") and (fmpy.architecture != "aarch64" or fmpy.system == "darwin"):
        platforms.insert(0, fmpy.platform)
    for platform in platforms:
        member = f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}"
        if member in names:
            return member
    there = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    has = f"it has {', '.join(there)}" if there else "it has none at all"
    raise InputError(f"{label}: has no binary for this platform ({platforms[0]}); {has}")


def _read(path: Path, label: str) -> bytes:
    try:
        if path.is_dir():
            raise InputError(f"{label}: is a folder; give an .fmu file")
        if path.exists() and not path.is_file():
            raise InputError(f"{label}: is a pipe or a device; give an .fmu file")
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{label}: is larger than {MOST_BYTES >> 30} GiB; not read")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{label}: there is no such file (looked for {path}){nearest_file(path)}") from error
    except OSError as error:
        raise InputError(f"{label}: cannot be read ({error.strerror})") from error


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
    content = _read(path, label)
    sha256 = hashlib.sha256(content).hexdigest()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            for member in members:
                _check_member(member, label)
            if len(members) > MOST_MEMBERS or sum(m.file_size for m in members) > MOST_BYTES:
                raise InputError(f"{label}: unpacks to more than {MOST_BYTES >> 30} GiB or {MOST_MEMBERS} files")
            sizes = {m.filename: m.file_size for m in members}
            if len(sizes) != len(members):
                raise InputError(f"{label}: has two members of one name; corrupt archive")
            if "modelDescription.xml" not in sizes:
                raise InputError(f"{label}: has no modelDescription.xml; it is not an FMU")
            if sizes["modelDescription.xml"] > MOST_DESCRIPTION_BYTES:
                raise InputError(f"{label}: modelDescription.xml is too large")
            xml = archive.read("modelDescription.xml")
            version = _root_attributes(xml, label).get("fmiVersion", "")
            _check_version(version, label)
            description = _described(xml, label)
            assert description.coSimulation is not None
            library = _library(set(sizes), str(description.coSimulation.modelIdentifier), label, version)
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
