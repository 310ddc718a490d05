"""Kernels in restricted Python and other loops, compiled by numba."""

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numba


@cache
def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as machine code, with every kernel that it calls.

    Parameters
    ----------
    kernel : callable
        in the restricted Python of `trihedron.models.restricted`

    Returns
    -------
    callable
        for other functions that numba compiles, not for Python itself: that compiles much faster. Takes float64 arrays
        for `Vector`; the same arithmetic as the kernel's, operation by operation, but that a division by zero gives an
        infinity, as in C, and no exception
    """
    names = {name: kernel.__globals__[name] for name in kernel.__code__.co_names if name in kernel.__globals__}
    linked = {name: compiled(value) if isinstance(value, FunctionType) else value for name, value in names.items()}
    return compile_callee(FunctionType(kernel.__code__, linked, kernel.__name__))


def compiled_and_kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code of a function that calls no kernel, kept on disk where there is a place for it."""
    try:
        return numba.njit(cache=True)(function)
    except RuntimeError:
        return numba.njit(function)


def compile_callee(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code that only compiled code can call."""
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return numba.njit(nogil=True, error_model="numpy", **options)(function)
