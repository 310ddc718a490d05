"""Loops and kernels as machine code where numba is; else as plain Python, with the same results.

Plain Python takes twice as long in a search for causes, and much longer in a run of a million samples.
"""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import FunctionType
from typing import Any

COMPILES = find_spec("numba") is not None
"""Whether there is a compiler."""
numba: Any = import_module("numba") if COMPILES else None
Makers = tuple[Callable[..., Any], Callable[..., Any]]
"""What makes kernels, and what makes the loop over them."""
FEW = 2_000
"""So many samples plain Python has gone through before a compiler is ready."""


def loop_compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A loop over kernels that are `compiled`; Python may call it."""
    return numba.njit(nogil=True, error_model="numpy")(function) if COMPILES else function


def loops_over(rows: int) -> Makers:
    """Machine code where it pays, the functions themselves where it does not."""
    return (compiled, loop_compiled) if rows > FEW else (_plain, _plain)


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


@cache
def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel in the restricted Python of `trihedron.models.restricted` as machine code, with every kernel it calls.

    It is for other functions that numba compiles, not for Python itself: that compiles much faster. It takes float64
    arrays for `Vector`; the same arithmetic as the kernel's, operation by operation, but that a division by zero gives
    an infinity, as in C, and no exception.
    """
    if not COMPILES:
        return kernel
    linked = {}
    for name in kernel.__code__.co_names:
        value = kernel.__globals__.get(name)
        if isinstance(value, FunctionType):
            linked[name] = compiled(value)
        elif name in kernel.__globals__:
            linked[name] = value
    return compile_callee(FunctionType(kernel.__code__, linked, kernel.__name__), allocates=False)


def compiled_and_kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code of a function that calls no kernel, kept on disk where there is a place for it."""
    if not COMPILES:
        return function
    try:
        return numba.njit(cache=True)(function)
    except RuntimeError:
        return numba.njit(function)


def compile_callee(function: Callable[..., Any], *, allocates: bool = True) -> Callable[..., Any]:
    """Machine code that only compiled code can call.

    What allocates nothing is written into who calls it: to count references and to call would cost several times what a
    short kernel does.
    """
    if not COMPILES:
        return function
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    if not allocates:
        options |= {"_nrt": False, "forceinline": True}
    return numba.njit(nogil=True, error_model="numpy", **options)(function)
