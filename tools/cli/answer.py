"""What a command has to say when it ends: text for a person, an object for a program, an exit status."""

import errno
import json as json_format
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO, TextIOWrapper
from pathlib import Path
from typing import Any

from cyclopts import CycloptsError

from ..errors import InputError
from ..files import write_text

FULL = (errno.ENOSPC, errno.EDQUOT)
NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EEXIST)
"""What the machine says of a file or folder that the user named; everything else is a fault of the program."""

INTERRUPTED = 130
"""128 and the number of the signal, as shells count."""
STANDARD_OUTPUT = Path("-")
"""Where `--json -` writes: the object takes the place of the text."""


@dataclass(frozen=True)
class Answer:
    """What a command prints.

    Attributes
    ----------
    text : str
    wanted : bool
        whether it is printed with --quiet too: it was asked for by name
    complaint : str
        one line for standard error, where the work was done and found something wrong
    status : int
        exit status
    """

    text: str
    wanted: bool = False
    complaint: str = ""
    status: int = 0


def answer(
    said: Any,
    json: Path | None,
    content: str | Mapping[str, Any] | None = None,
    *,
    files: Iterable[Path | str] = (),
    complaint: str = "",
    status: int = 2,
) -> Answer:
    """Write a command's object where it was asked for, and give what is to be printed.

    Parameters
    ----------
    said : result or str
        what a person reads; of a result its text
    json : Path or None
        the option `--json`; "-" is standard output
    content : str or mapping, optional
        the object, as JSON text or as plain values; without it the result's own
    files : iterable of paths
        what was written, a line each behind the text
    complaint : str
        one line for standard error
    status : int
        exit status where there is a complaint

    Raises
    ------
    InputError
        when the file cannot be written
    """
    text = "\n".join([str(said), *map(str, files)])
    ended = {"complaint": complaint, "status": status if complaint else 0}
    if json is None:
        return Answer(text, **ended)
    whole = said.to_json() if content is None else content
    written = whole if isinstance(whole, str) else json_text(whole)
    if json == STANDARD_OUTPUT:
        return Answer(written.rstrip("\n"), wanted=True, **ended)
    write_text(json, written)
    return Answer(text, **ended)


def json_text(content: Mapping[str, Any]) -> str:
    """Plain values as the text of a JSON file."""
    return json_format.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def say(command: Callable[[], object], *, quiet: bool) -> int:
    """Run a command and print its answer.

    Parameters
    ----------
    command : callable
        gives an `Answer`, or prints what it has to say itself
    quiet : bool
        print nothing but what was asked for by name: no text, no bars, no warnings

    Returns
    -------
    int
        exit status
    """
    if quiet:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            said = command()
    else:
        said = command()
    if not isinstance(said, Answer):
        return 0
    if said.text and (said.wanted or not quiet):
        print(said.text)
    if said.complaint:
        print(f"trihedron: {said.complaint}", file=sys.stderr)
    return said.status


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
