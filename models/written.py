"""Kernels that are written by a program: functions with a source to be read, so they are carried like any other."""

import ast
import linecache
import math
from collections.abc import Callable
from functools import cache

from . import restricted


@cache
def written_kernel(source: str) -> Callable[..., None]:
    """A kernel from the source of one function in restricted Python, which the caller has made, not read.

    It knows `math` and the constants of the restricted language and nothing else.
    """
    (function,) = ast.parse(source).body
    assert isinstance(function, ast.FunctionDef)
    # Where no file is, the source is looked up by a name in angle brackets.
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
