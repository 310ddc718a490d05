"""Errors and messages for a user whose input cannot be used."""

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


class InputError(Exception):
    """The input cannot be used; the message is the one line that the user reads (exit status 2).

    It names the file, the row and the column, or the option, and says what would be right.
    """

    lines: Sequence[str] = ()
    """The message in several lines, where it asks several questions."""


class NoSuchFileError(InputError):
    """A file that is named does not exist."""


class InvalidInput(InputError, ValueError):
    """Error of a function called from Python for unusable input: a ValueError, too."""


class MissingFile(InputError, FileNotFoundError):
    """Error of a function called from Python for a file that does not exist: a FileNotFoundError, too."""


def as_in_python(error: InputError) -> InputError:
    """Return the same refusal as one of Python's own kinds."""
    if isinstance(error, InvalidInput | MissingFile):
        return error
    arguments = [one_line(text, LONGEST_IN_PYTHON) if isinstance(text, str) else text for text in error.args]
    if isinstance(error, NoSuchFileError):
        return MissingFile(*arguments)
    refusal = InvalidInput(*arguments)
    refusal.lines = error.lines
    return refusal


@contextmanager
def said_of(where: str) -> Iterator[None]:
    """Put the name of a field or file before the message of an error in the block."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"{where}: {error}") from error


LONGEST_MESSAGE, LONGEST_IN_PYTHON = 800, 8000
"""Characters of a line at a terminal, and of an error's message in Python, which holds all questions."""


def printable(text: str) -> str:
    """A text in one line, in which characters that would move a terminal's cursor or hide others are escaped."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line)


def one_line(text: str, most: int = LONGEST_MESSAGE) -> str:
    """Return a message as one line with a limit of characters, for any names and values."""
    line = printable(text)
    if len(line) > most:
        line = f"{line[: most - 200]} ... {line[-190:]}"
    return line


def shortage(error: BaseException) -> str:
    """Return the resource that the machine lacks, and the remedy; empty for other errors."""
    number, text = getattr(error, "errno", None), str(error).lower()
    if isinstance(error, MemoryError) or number == errno.ENOMEM or any(words in text for words in NO_MEMORY):
        return "there is not enough memory; end other programs, raise the limit (ulimit -v), or give fewer rows"
    if number in (errno.EMFILE, errno.ENFILE) or "too many open files" in text:
        return "too many files are open; raise the limit (ulimit -n)"
    if number == errno.EAGAIN or "can't start new thread" in text:
        return "no more processes or threads can be started; end other programs or raise the limit (ulimit -u)"
    return ""


NO_MEMORY = ("cannot allocate memory", "failed to map segment", "bad_alloc")
"""What libraries say that find no memory."""


def nearest_file(path: Path) -> str:
    """Return "; did you mean 'x'?" for a missing file where a file of a similar name exists; else empty."""
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.name != path.name]
    except OSError:
        return ""
    advice = nearest(path.name, names)
    return f"; {advice}" if advice.startswith("did you") else ""


def full(error: BaseException) -> bool:
    """Return true if an error means that a disk is full, or that a file has reached its size limit."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def reason(error: OSError) -> str:
    """Return the system's message for a file error; libraries outside Python put it into the text, with a number."""
    return error.strerror or str(error).partition(" (os error")[0] or type(error).__name__


def unreadable(path: Path, error: OSError) -> str:
    """Return the reason why a file cannot be read, and a file with a similar name."""
    meant = nearest_file(path) if isinstance(error, FileNotFoundError) else ""
    return f"cannot be read ({error.strerror}){meant}"


def nearest(name: str, names: list[str] | tuple[str, ...]) -> str:
    """Return a hint for an unknown name: "did you mean 'x'?" where one is similar, else "known: a, b, c"."""
    from difflib import get_close_matches

    close = get_close_matches(name, names, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{close[0]}'?"
    if not names:
        return "none are known"
    listed = list(names[:12])
    if len(names) > 12:
        listed.append("...")
    return f"known: {', '.join(listed)}"
