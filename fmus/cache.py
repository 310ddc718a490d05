"""What was made once is kept: binaries, FMUs, the compiled loop; each with its digest, where nobody else can write."""

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
    """Where things are kept: TRIHEDRON_CACHE, or the folder that the system has for such things."""
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

    A digest tells damage, not a stranger's hand: what is kept is machine code. A folder above with the sticky bit lets
    nobody take away what is another's. Where the system has no owners of files (Windows) it answers for its folders.
    """
    if not hasattr(os, "geteuid"):
        return None
    owners = (os.geteuid(), 0)
    for place in (folder.resolve(), *folder.resolve().parents):
        try:
            status = place.stat()
        except OSError:
            continue
        open_to_all = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        sticky = place != folder.resolve() and status.st_mode & stat.S_ISVTX
        if status.st_uid not in owners or (open_to_all and not sticky):
            return place
    return None


def kept(kind: str, name: str, make: Callable[[], bytes]) -> bytes:
    """What is kept under a name; where it is not, or is damaged, it is made, and kept where that can be.

    Parameters
    ----------
    kind : str
        a folder of the cache
    name : str
        the hash of all that the content follows from, with its ending
    make : callable
        gives the content
    """
    folder = cache_folder() / kind
    with suppress(OSError):
        for place in (folder.parent, folder):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
    trusted = folder.is_dir() and others_can_write(folder) is None
    if trusted:
        with suppress(OSError):
            stored = (folder / name).read_bytes()
            if hashlib.sha256(stored[_DIGEST:]).digest() == stored[:_DIGEST]:
                return stored[_DIGEST:]
    content = make()
    if trusted:
        with suppress(OSError):
            handle, incomplete = tempfile.mkstemp(dir=folder)
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            Path(incomplete).replace(folder / name)
    return content
