"""Arguments of the public functions, as Python gives them: their types, and messages that name them, not options."""

import builtins
import ctypes
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache, wraps
from itertools import product
from pathlib import Path
from threading import Event, Lock
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BeforeValidator, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from .errors import InputError, InvalidInput, as_in_python, nearest
from .files import inputs_kept
from .options import completed, option_of

P = ParamSpec("P")
R = TypeVar("R")

PLAIN = (bool, int, float, str, Path, type(None), Any)
UNIONS = (Union, type(int | str))
NUMBERS = (int, float)


def in_python(function: Callable[P, R], name: str = "") -> Callable[P, R]:
    """Return a public function as Python calls it; `name` is its public name, where that is another one.

    Arguments of plain types (numbers, words, paths, sequences and mappings of them) are of these types; what an
    InputError says of an option it says of the argument. Arrays of NumPy stand for sequences. Linear algebra has one
    thread meanwhile. A refusal is a ValueError, or a FileNotFoundError. The docstring has the words of shared options.
    """
    signature = inspect.signature(function)
    name = name or function.__name__

    @wraps(function)
    def called(*positional: P.args, **keywords: P.kwargs) -> R:
        if _THREADS_LOST.is_set():
            raise InputError(FORKED)
        bound = _bound(f"{name}()", signature, positional, keywords)
        try:
            for argument, value in bound.arguments.items():
                _refuse_nul(argument, value)
                adapter = _adapters(function).get(argument)
                if adapter is not None:
                    bound.arguments[argument] = _checked(name, argument, value, adapter)
            with one_thread(), inputs_kept():
                return function(*bound.args, **bound.kwargs)
        except InputError as error:
            renamed = options_of(signature)
            error.args = (_of_arguments(str(error), list(signature.parameters), renamed), *error.args[1:])
            refusal = as_in_python(error)
            raise refusal from error.__cause__

    called.__doc__ = completed(function)
    return called


def _refuse_nul(name: str, value: Any) -> None:
    """Refuse the character NUL in a path or word, or in a sequence of these: no system has such a path."""
    for word in value if isinstance(value, tuple | list) else (value,):
        if isinstance(word, str | os.PathLike) and "\0" in os.fspath(word):
            raise InputError(f"{name}: {os.fspath(word)!r} holds the character NUL, which no path or word has")


def options_of(signature: inspect.Signature) -> dict[str, str]:
    """Return the arguments of options that have another name at a terminal, by that name."""
    renamed = {}
    for name, parameter in signature.parameters.items():
        option = option_of(parameter.annotation)
        if option is not None and option.name:
            renamed[option.name.removeprefix("--")] = name
    return renamed


def _bound(
    name: str, signature: inspect.Signature, positional: Sequence[Any], keywords: Mapping[str, Any]
) -> inspect.BoundArguments:
    """Return the arguments by name; a TypeError names the function, and for an unknown argument the nearest."""
    try:
        return signature.bind(*positional, **keywords)
    except TypeError as error:
        for word, parameter in signature.parameters.items():
            if parameter.kind is parameter.VAR_POSITIONAL and word in keywords:
                raise TypeError(f"{name}: write the {word} one after another, without {word}=") from None
        unknown = [word for word in keywords if word not in signature.parameters]
        if not unknown:
            raise TypeError(f"{name}: {error}") from None
        meant = options_of(signature).get(unknown[0].replace("_", "-"), unknown[0])
        advice = nearest(meant, list(signature.parameters))
        raise TypeError(f"{name}: unexpected argument {unknown[0]}; {advice}") from None


class _Names(dict[str, Any]):
    """The names of a module; a name that only type checkers know resolves to any type."""

    def __missing__(self, name: str) -> Any:
        return Any


@cache
def _adapters(function: Callable[..., Any]) -> dict[str, TypeAdapter[Any]]:
    """Return the type adapters of the arguments that have plain types, by argument name."""
    hints = get_type_hints(function, localns=_Names(vars(inspect.getmodule(function)) | vars(builtins)))
    adapters = {}
    for name, p in inspect.signature(function).parameters.items():
        if p.kind is not p.VAR_KEYWORD and name in hints and _plain(hints[name]):
            hint = _without_text(hints[name])
            if p.kind is p.VAR_POSITIONAL:
                hint = tuple[hint, ...]  # pyright: ignore[reportInvalidTypeForm]
            adapters[name] = TypeAdapter(hint)
    return adapters


def _plain(hint: Any) -> bool:
    """Return true if a type is made of plain types only."""
    origin = get_origin(hint)
    if origin is Literal or hint is ... or hint in PLAIN:
        return True
    return origin in (*UNIONS, tuple, Sequence, Mapping) and all(map(_plain, get_args(hint)))


def _without_text(hint: Any) -> Any:
    """Return a plain type that rejects numbers written as text: "1e-5" is not a number."""
    if hint in NUMBERS:
        return Annotated[hint, BeforeValidator(_no_text)]
    origin, parts = get_origin(hint), get_args(hint)
    if origin is None or origin is Literal:
        return hint
    parts = tuple(_without_text(part) for part in parts)
    if origin in UNIONS:
        return Union[parts]  # noqa: UP007
    return origin[parts]


def _no_text(value: Any) -> Any:
    if isinstance(value, str | bytes | bool):
        raise PydanticCustomError("number", "Input should be a valid number")
    return value


def _checked(function: str, name: str, value: Any, adapter: TypeAdapter[Any]) -> Any:
    """Return a valid argument; an InputError names function and argument."""
    try:
        return adapter.validate_python(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)
    except ValidationError as error:
        kinds = dict.fromkeys(fault["msg"].removeprefix("Input should be ") for fault in error.errors())
        text = repr(value)
        if len(text) >= 60:
            text = type(value).__name__
        advice = ""
        if isinstance(value, str) and _is_number(value) and "a valid number" in kinds:
            advice = f"; write {name}={value.strip()}, without quotation marks"
        raise InvalidInput(f"{function}(): {name} should be {' or '.join(kinds)}, not {text}{advice}") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _of_arguments(text: str, names: Sequence[str], options: dict[str, str]) -> str:
    """A message with arguments in place of options, and functions in place of commands.

    `options` are those with a name of their own at a terminal, and their arguments.
    """
    by_option = {name.replace("_", "-"): name for name in names} | options

    def argument(match: re.Match[str]) -> str:
        option = match[1]
        for form in (option, f"{option}s", f"{option}-deg", re.sub("is$", "es", option)):
            if form in by_option:
                return by_option[form]
        # of another function, or of the command alone
        return match[0]

    text = re.sub(r"`trihedron (plan|instrument|reproduce) (?=[a-z])", r"`trihedron \1-", text)
    text = re.sub(r"`trihedron ([a-z]+(?:-[a-z]+)*)(?: ([^\s`]+))?`", _call, text)
    text = re.sub(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)", argument, text)
    if "answers" in names and "--set " in text:
        text += "; in Python, answers={'units.force': 'g'} stands for such an option"
    return text


def _call(match: re.Match[str]) -> str:
    """Return a command, with its file if it has one, as a function."""
    function = "import_record" if match[1] == "import" else match[1].replace("-", "_")
    return f"`th.{function}({match[2]!r})`" if match[2] else f"`th.{function}`"


# A fork copies one thread: what waits for the others of polars waits for ever

FORKED = (
    "this process was forked after its parent had used Trihedron, and polars has lost its threads: start processes by "
    "multiprocessing.get_context('spawn') or 'forkserver', or fork before the first use"
)
_THREADS_RUN, _THREADS_LOST = Event(), Event()


def _note_threads() -> None:
    """Note before a fork whether polars' threads run, or whether it is loaded if the system lists no threads."""
    names = []
    for path in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):
            names.append(path.read_text("utf-8", "replace"))
    run = any(re.match(r"polars-\d", name) for name in names) if names else "polars" in sys.modules
    if run:
        _THREADS_RUN.set()


def _lose_threads() -> None:
    """Note in the forked process that it has none of the threads that ran before."""
    if _THREADS_RUN.is_set():
        _THREADS_LOST.set()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_note_threads, after_in_child=_lose_threads)


# One thread for the linear algebra of a call from Python

_LOCK, _BEFORE = Lock(), list[list[int]]()
PREFIXES, SUFFIXES = ("scipy_openblas", "openblas"), ("64_", "")


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the OpenBLAS libraries of NumPy and SciPy to one thread; other libraries keep their settings.

    With parallel calls, the last one restores the numbers that the first one found.
    """
    with _LOCK:
        _BEFORE.append([get() for get, _ in _libraries()])
        for _, set_to in _libraries():
            set_to(1)
    try:
        yield
    finally:
        with _LOCK:
            # The first entry comes from a time without a call, whichever call ends last.
            counts = _BEFORE.pop()
            if not _BEFORE:
                for (_, set_to), count in zip(_libraries(), counts, strict=True):
                    set_to(count)


@cache
def _libraries() -> list[tuple[Callable[[], int], Callable[[int], None]]]:
    """Return the calls that get and set the number of threads of each OpenBLAS among the installed packages."""
    packages = Path(np.__file__).parent.parent
    paths = []
    for folder in ("numpy.libs", "numpy/.dylibs", "scipy.libs", "scipy/.dylibs"):
        paths.extend((packages / folder).glob("*openblas*"))
    calls = []
    for path in sorted(paths):
        try:
            library = ctypes.CDLL(str(path))
        except OSError:
            continue
        for prefix, suffix in product(PREFIXES, SUFFIXES):
            get = getattr(library, f"{prefix}_get_num_threads{suffix}", None)
            set_to = getattr(library, f"{prefix}_set_num_threads{suffix}", None)
            if get is not None and set_to is not None:
                calls.append((get, set_to))
                break
    return calls
