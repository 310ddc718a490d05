"""Values that a process keeps for later questions about the same arrays, as those of a page after each change.

Nothing is kept outside of `kept`: an array that changes would give old values.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    # Commands load this module before they need arrays.
    from numpy.typing import NDArray

MOST = 48
"""Most values of whole records that are kept."""
APART = {"decisions", "warnings", "about"}
"""Fields of a record that change no value of its arrays."""
Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")
Memory = OrderedDict[tuple[Any, ...], tuple[Any, tuple[Any, ...]]]
"""Function and arguments -> value, and the arguments, so that their identities last."""
_present: ContextVar[Memory | None] = ContextVar("memory", default=None)


@contextmanager
def kept(memory: Memory) -> Iterator[None]:
    """Keep the values of `once` and `each` in a memory while the block lasts."""
    before = _present.set(memory)
    try:
        yield
    finally:
        _present.reset(before)


def keeping(function: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
    """Return a function that keeps the values of `once` and `each` until it ends, or in the caller's memory."""

    @wraps(function)
    def called(*arguments: Arguments.args, **options: Arguments.kwargs) -> Value:
        memory = _present.get()
        with kept(Memory() if memory is None else memory):
            return function(*arguments, **options)

    return called


def once(function: Callable[..., Value], *arguments: Any) -> Value:
    """Return the value of a function; where values are kept, that of an earlier call with the same arguments.

    Arrays are the same if they are one object; records, if their arrays are. Nobody may change the value.
    """
    memory = _present.get()
    if memory is None:
        return function(*arguments)
    key = (function, *map(_identity, arguments))
    if key not in memory:
        memory[key] = function(*arguments), arguments
        while len(memory) > MOST:
            memory.popitem(last=False)
    memory.move_to_end(key)
    return memory[key][0]


def each(function: "Callable[[NDArray], Value]", values: "NDArray", pieces: Sequence[slice]) -> list[Value]:
    """Return the values of a function of some pieces of an array, each computed once where values are kept."""
    if _present.get() is None:
        return [function(values[rows]) for rows in pieces]
    known = once(_no_pieces, function, values)
    gathered = []
    for rows in pieces:
        ends = rows.start, rows.stop
        if ends not in known:
            known[ends] = function(values[rows])
        gathered.append(known[ends])
    return gathered


def _no_pieces(_function: Callable[..., Any], _values: "NDArray") -> dict[tuple[int, int], Any]:
    return {}


def _identity(argument: Any) -> Any:
    """Return a key of an argument: its value if it is small, the identities of a record's fields, or its own."""
    if argument is None or isinstance(argument, str | bytes | int | float | Path):
        return argument
    if is_dataclass(argument) and not isinstance(argument, type) and hasattr(argument, "decisions"):
        names = [field.name for field in fields(argument) if field.name not in APART]
        return (type(argument), *(_identity(getattr(argument, name)) for name in names))
    return id(argument)
