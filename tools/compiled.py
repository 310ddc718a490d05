"""Kernels in restricted Python, compiled by numba for long runs."""

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numba


@cache
def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as machine code, with every kernel that it calls; it lets other threads run.

    Parameters
    ----------
    kernel : callable
        in the restricted Python of `trihedron.models.restricted`

    Returns
    -------
    callable
        takes float64 arrays for `Vector`; the same arithmetic as the kernel's, operation by operation
    """
    return numba.njit(nogil=True)(_linked(kernel))


@cache
def compiled_callee(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """The same for a kernel that only compiled code calls: it compiles faster, and Python cannot call it."""
    return numba.njit(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(_linked(kernel))


def _linked(kernel: Any) -> FunctionType:
    """The kernel's own code over compiled callees."""
    names = {name: kernel.__globals__[name] for name in kernel.__code__.co_names if name in kernel.__globals__}
    found = {
        name: compiled_callee(value) if isinstance(value, FunctionType) else value for name, value in names.items()
    }
    return FunctionType(kernel.__code__, found, kernel.__name__)
