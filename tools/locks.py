"""Resources of one process: a lock that ends with the process, and a folder.

The folder of a process that was killed is taken away by the next one that makes one.
"""

import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from .errors import InputError, full, reason

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PREFIX, LOCK = "trihedron-scratch-", "lock"


class Taken(Exception):
    """Another process has the lock."""


def refuse_irregular(path: Path) -> None:
    """Refuse a pipe, a device or a folder in the place of a file: opening it could wait for ever."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        # Another process may have removed it; what else is wrong shows when it is opened.
        return
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: is not a regular file; remove it, or give another place")


@contextmanager
def locked(path: Path, *, make: bool = True) -> Iterator[None]:
    """Hold the lock of a file, which stays: a lock that is taken away while it is held would not keep anybody out.

    Without `make` the file has to be there. Taken where another process holds it; on a file system that knows no locks
    nobody is kept out. An InputError where it is not a regular file.
    """
    refuse_irregular(path)
    with path.open("ab" if make else "r+b") as file:
        try:
            if sys.platform == "win32":
                file.seek(0)
                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            raise Taken(path) from None
        except OSError:
            pass
        yield


@contextmanager
def own_folder() -> Iterator[Path]:
    """A folder for temporary files of this process and of those that it starts; it goes when the block ends.

    An InputError where the block finds the disk full; a file elsewhere is the caller's to name.
    """
    _take_away_left(Path(tempfile.gettempdir()))
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        inside = folder / "files"
        with ExitStack() as stack:
            # Another process may have taken it for one that is left, until the lock is held.
            with suppress(Taken, FileNotFoundError):
                stack.enter_context(locked(folder / LOCK))
                inside.mkdir()
            if not inside.is_dir():
                continue
            try:
                yield inside
            except OSError as error:
                if full(error) and (error.filename is None or str(error.filename).startswith(str(folder))):
                    message = f"{folder.parent}: temporary files cannot be written ({reason(error)})"
                    raise InputError(message) from error
                raise
            finally:
                shutil.rmtree(inside, ignore_errors=True)
                # If the system does not remove an open file, the lock goes first.
                stack.close()
                shutil.rmtree(folder, ignore_errors=True)
        return


def _take_away_left(base: Path) -> None:
    """Remove folders whose processes are gone, except those of other users."""
    for folder in base.glob(f"{PREFIX}*"):
        with suppress(OSError, Taken):
            if hasattr(os, "geteuid") and folder.lstat().st_uid != os.geteuid():
                continue
            if not (folder / LOCK).exists():
                # Killed before it had its lock: nothing is in it.
                folder.rmdir()
                continue
            with locked(folder / LOCK, make=False):
                shutil.rmtree(folder, ignore_errors=True)
