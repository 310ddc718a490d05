"""Kernels written by a program: functions with a readable source, so they are carried like any other."""

import ast
import linecache
import math
from collections.abc import Callable
from functools import cache

from . import restricted


@cache
def written_kernel(source: str) -> Callable[..., None]:
    """Return a kernel from the source of one function in restricted Python, which the caller has generated.

    It knows only `math` and the constants of the restricted language.
    """
    (function,) = ast.parse(source).body
    assert isinstance(function, ast.FunctionDef)
    # Without a file, the source is looked up by a name in angle brackets.
    origin = f"<{function.name}>"
    linecache.cache[origin] = (len(source), None, source.splitlines(keepends=True), origin)
    constants = {name: value for name, value in vars(restricted).items() if name.isupper()}
    names_of_python = {
        "__name__": __name__,
        "__builtins__": {"range": range},
        "math": math,
        "Vector": restricted.Vector,
    }
    names = names_of_python | {"int": int, "float": float} | constants
    exec(compile(ast.parse(source), origin, "exec"), names)
    return names[function.name]
