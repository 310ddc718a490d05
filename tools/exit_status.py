"""How a command ends: its exit status, and one line on standard error where something went wrong."""

import errno
import os
import sys
from collections.abc import Callable
from io import TextIOWrapper

from cyclopts import CycloptsError

from .errors import InputError

FULL = (errno.ENOSPC, errno.EDQUOT)
NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EEXIST)
"""What the machine says of a file or folder that the user named; everything else is a fault of the program."""

INTERRUPTED = 130
"""128 and the number of the signal, as shells count."""


def exit_status(command: Callable[[], int]) -> int:
    """Run a command.

    Parameters
    ----------
    command : callable
        prints its results; gives 0, or another status where it has found something wrong

    Returns
    -------
    int
        0: the work was done; 2: the input cannot be used, said in one line; 1: a fault of the program's own;
        130: interrupted
    """
    if isinstance(sys.stdout, TextIOWrapper):
        # A terminal or pipe that knows no Greek gets \u03c3 for σ instead of nothing at all.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = command()
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except InputError as error:
        return refuse(str(error))
    except CycloptsError as error:
        return refuse(str(error))
    except KeyboardInterrupt as error:
        print(f"trihedron: {str(error) or 'interrupted'}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        drop_output()
        return 0
    except OSError as error:
        if error.filename is not None and error.errno in (*FULL, *NOT_ALLOWED):
            return refuse(f"{error.filename}: cannot be used ({error.strerror})")
        if error.errno not in FULL:
            return fault(error)
        drop_output()
        return refuse(f"standard output: cannot be written ({error.strerror})")
    except SystemExit as stop:
        return int(stop.code or 0)
    except Exception as error:
        return fault(error)


def drop_output() -> None:
    """Let what is left in the buffer of standard output go nowhere: Python would try, and complain, at its end."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def refuse(message: str) -> int:
    """Say in one line on standard error why the input cannot be used."""
    print(f"trihedron: {' '.join(message.split())}", file=sys.stderr)
    return 2


def fault(error: Exception) -> int:
    """Say in one line on standard error what went wrong in the program itself."""
    if os.environ.get("TRIHEDRON_TRACEBACK"):
        raise error
    said = " ".join(str(error).split())
    print(
        f"trihedron: a fault of the program: {type(error).__name__}: {said} (TRIHEDRON_TRACEBACK=1 shows where)",
        file=sys.stderr,
    )
    return 1
