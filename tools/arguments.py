"""Arguments of the public functions, as Python gives them: their types, and messages that name them, not options."""

import builtins
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import TypeAdapter, ValidationError

from .errors import InputError
from .options import completed
from .threads import one_thread

P = ParamSpec("P")
R = TypeVar("R")

PLAIN = (bool, int, float, str, Path, type(None), Any)
UNIONS = (Union, type(int | str))


def in_python(function: Callable[P, R]) -> Callable[P, R]:
    """A public function as one calls it from Python.

    Arguments of plain types (numbers, words, paths, sequences and mappings of them) are of these types; what an
    InputError says of an option it says of the argument. Arrays of NumPy stand for sequences. Linear algebra has one
    thread meanwhile. The docstring has the words of shared options.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def called(*arguments: P.args, **named: P.kwargs) -> R:
        bound = signature.bind(*arguments, **named)
        for name, value in bound.arguments.items():
            adapter = _adapters(function).get(name)
            if adapter is not None:
                bound.arguments[name] = _checked(name, value, adapter)
        try:
            with one_thread():
                return function(*bound.args, **bound.kwargs)
        except InputError as error:
            error.args = (_of_arguments(str(error), list(signature.parameters)), *error.args[1:])
            raise

    called.__doc__ = completed(function)
    return called


class _Names(dict[str, Any]):
    """The names of a module; what is known to those alone who check types stands for anything."""

    def __missing__(self, name: str) -> Any:
        return Any


@cache
def _adapters(function: Callable[..., Any]) -> dict[str, TypeAdapter[Any]]:
    """What looks at the arguments of plain types, by their names."""
    hints = get_type_hints(function, localns=_Names(vars(inspect.getmodule(function)) | vars(builtins)))
    many = {
        p.name for p in inspect.signature(function).parameters.values() if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    }
    return {
        name: TypeAdapter(hint)
        for name, hint in hints.items()
        if name != "return" and name not in many and _plain(hint)
    }


def _plain(hint: Any) -> bool:
    """Whether a type is made of plain ones."""
    origin = get_origin(hint)
    if origin is Literal or hint is ... or hint in PLAIN:
        return True
    return origin in (*UNIONS, tuple, Sequence, Mapping) and all(map(_plain, get_args(hint)))


def _checked(name: str, value: Any, adapter: TypeAdapter[Any]) -> Any:
    """An argument, or an InputError that names it."""
    given = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    try:
        return adapter.validate_python(given)
    except ValidationError as error:
        said = " or ".join(dict.fromkeys(one["msg"].removeprefix("Input should be ") for one in error.errors()))
        shown = repr(value)
        shown = shown if len(shown) < 60 else type(value).__name__
        raise InputError(f"{name}: should be {said}, not {shown}") from None


def _of_arguments(text: str, names: Sequence[str]) -> str:
    """A message with arguments in place of options."""
    known = {name.replace("_", "-"): name for name in names}

    def argument(match: re.Match[str]) -> str:
        option = match[1]
        forms = (option, f"{option}s", f"{option}-deg", re.sub("is$", "es", option))
        return next((known[form] for form in forms if form in known), match[0])

    return re.sub(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)", argument, text)
