"""SSP files: checked before anything is unpacked, then unpacked into a folder of our own."""

import hashlib
import io
import stat
import zipfile
from pathlib import Path, PurePosixPath

from ..errors import InputError, unreadable
from ..orchestrator.archive import DAMAGE, METHODS, MOST_BYTES, MOST_MEMBERS, shown
from .namespaces import STRUCTURE


def refuse_outside(name: str, label: str) -> None:
    """Refuse a name inside an archive that could land outside the archive's folder."""
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or name.startswith("/") or any(c in name for c in '\\:\0<>|?*"'):
        raise InputError(f"{label}: member {shown(name)} would leave the archive's folder; not unpacked")


def _check_member(member: zipfile.ZipInfo, label: str) -> None:
    # orig_filename still has the backslashes and what stands after a zero, which zipfile takes away.
    for name in (member.orig_filename, member.filename):
        refuse_outside(name, label)
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise InputError(f"{label}: member {shown(member.filename)} is a link or a device; not unpacked")
    if member.flag_bits & 1:
        raise InputError(f"{label}: member {shown(member.filename)} is encrypted; an .ssp must not be")
    if member.compress_type not in METHODS:
        raise InputError(f"{label}: member {shown(member.filename)} is compressed in a way that SSP does not have")


def _check_members(members: list[zipfile.ZipInfo], label: str) -> None:
    for member in members:
        _check_member(member, label)
    if len(members) > MOST_MEMBERS or sum(m.file_size for m in members) > MOST_BYTES:
        raise InputError(f"{label}: unpacks to more than {MOST_BYTES >> 30} GiB or {MOST_MEMBERS} files")
    files = [m.filename for m in members]
    # Two names that differ in case only are one file on some systems.
    if len({name.rstrip("/").casefold() for name in files}) != len(files):
        raise InputError(f"{label}: has two members of one name; corrupt archive")
    if STRUCTURE not in files:
        raise InputError(f"{label}: has no {STRUCTURE}; it is not an .ssp")


def unpack_ssp(path: Path, folder: Path) -> str:
    """Check an .ssp and unpack it.

    Parameters
    ----------
    path : Path
        the file
    folder : Path
        empty; nothing is written when the archive does not pass the checks

    Returns
    -------
    str
        sha256 of the file

    Raises
    ------
    InputError
        missing, damaged, unsafe, or without a SystemStructure.ssd
    """
    label = str(path)
    try:
        if path.is_dir():
            raise InputError(f"{label}: is a folder; give an .ssp file")
        if path.exists() and not path.is_file():
            raise InputError(f"{label}: is a pipe or a device; give an .ssp file")
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{label}: is larger than {MOST_BYTES >> 30} GiB; not read")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{label}: {unreadable(path, error)}") from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _check_members(archive.infolist(), label)
            archive.extractall(folder)
    except DAMAGE as error:
        raise InputError(f"{label}: is not a readable .ssp archive ({error})") from error
    return hashlib.sha256(content).hexdigest()
