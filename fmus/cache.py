"""Cache of binaries, FMUs and the compiled loop, each with its digest, in a folder that only its owner can write."""

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_DIGEST = hashlib.sha256().digest_size


def cache_folder() -> Path:
    """Return the folder of the cache: TRIHEDRON_CACHE, or the system's folder for caches."""
    folder = os.environ.get("TRIHEDRON_CACHE")
    if folder:
        return Path(folder)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "trihedron"


def others_can_write(folder: Path) -> Path | None:
    """The folder itself, or the first above it, in which other users can put files; None where there is none.

    A digest shows damage, but no manipulation, and the kept files are machine code. In a folder above with the sticky
    bit nobody can remove the files of other users. Where the system has no owners of files (Windows) it answers for its
    folders.
    """
    if not hasattr(os, "geteuid"):
        return None
    for place in (folder.resolve(), *folder.resolve().parents):
        try:
            status = place.stat()
        except OSError:
            continue
        sticky = place != folder.resolve() and status.st_mode & stat.S_ISVTX
        if _of_others(status, sticky=bool(sticky)):
            return place
    return None


def _of_others(status: os.stat_result, *, sticky: bool = False) -> bool:
    """Return True if a file or folder belongs to a user other than this one and root, or if others can write to it."""
    if not hasattr(os, "geteuid"):
        return False
    open_to_others = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not sticky
    return bool(open_to_others) or status.st_uid not in (os.geteuid(), 0)


def _trusted_folder(kind: str) -> Path | None:
    """A folder of the cache, made where it is missing; None where there can be none, or others can write to it."""
    folder = cache_folder() / kind
    with suppress(OSError):
        for place in (folder.parent, folder):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.is_dir() and others_can_write(folder) is None:
            return folder
    return None


def _content_of(path: Path) -> bytes:
    """The bytes of a regular file of this user's; an OSError for a link, another kind of file, or another's file."""
    flags = 0
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY", "O_CLOEXEC"):
        flags |= getattr(os, name, 0)
    handle = os.open(path, os.O_RDONLY | flags)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode) or _of_others(status):
            raise PermissionError(path)
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read()
    finally:
        os.close(handle)


def stored(kind: str, name: str) -> bytes | None:
    """Return the content of a name in a folder of the cache; None if it is missing, damaged or not trusted."""
    folder = _trusted_folder(kind)
    if folder is None:
        return None
    try:
        content = _content_of(folder / name)
    except (OSError, MemoryError):
        return None
    if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
        return None
    return content[_DIGEST:]


def store(kind: str, name: str, content: bytes) -> None:
    """Keep a content under a name, where there is a trusted place for it; else do nothing."""
    folder = _trusted_folder(kind)
    if folder is None:
        return
    with suppress(OSError):
        handle, incomplete = tempfile.mkstemp(dir=folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            Path(incomplete).replace(folder / name)
        finally:
            Path(incomplete).unlink(missing_ok=True)


def kept(kind: str, name: str, make: Callable[[], bytes]) -> bytes:
    """Return the content of a name in the cache; make and store it if it is missing or damaged.

    Parameters
    ----------
    kind : str
        a folder of the cache
    name : str
        the hash of all that the content follows from, with its ending
    make : callable
        gives the content
    """
    content = stored(kind, name)
    if content is None:
        content = make()
        store(kind, name, content)
    return content
