"""Loops and kernels as machine code where numba is; else as plain Python, with the same results.

Plain Python takes twice as long in a search for causes, and much longer in a run of a million samples.
"""

import hashlib
import pickle
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any

from ..fmus.cache import store, stored

COMPILES = find_spec("numba") is not None
"""Whether there is a compiler."""
numba: Any = import_module("numba") if COMPILES else None
Makers = tuple[Callable[..., Any], Callable[..., Any]]
"""What makes kernels, and what makes the loop over them."""
_KIND = "code"
"""Folder of the cache for machine code that numba loads."""
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


class _KeptCode:
    """Machine code of one function in the checked cache, in the place of numba's own cache.

    numba keeps code as pickles in a folder that it does not check. Whatever cannot be used is compiled again.
    """

    cache_path = None

    def __init__(self, function: Callable[..., Any]) -> None:
        self._made_from = [function.__qualname__, platform.python_version(), numba.__version__]
        for source in (function.__code__.co_filename, __file__):
            self._made_from.append(hashlib.sha256(Path(source).read_bytes()).hexdigest())

    def _name(self, signature: Any, codegen: Any) -> str:
        made_from = repr([*self._made_from, signature, codegen.magic_tuple()])
        return f"{hashlib.sha256(made_from.encode()).hexdigest()}.code"

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the compiled code for a signature, or None if it must be compiled."""
        target.refresh()
        content = stored(_KIND, self._name(signature, target.codegen()))
        if content is None:
            return None
        try:
            return import_module("numba.core.compiler").CompileResult._rebuild(target, *pickle.loads(content))
        except Exception:  # pickles and LLVM raise whatever they meet
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the compiled code for a signature."""
        if not result.library.has_dynamic_globals:
            content = import_module("numba.core.serialize").dumps(result._reduce())
            store(_KIND, self._name(signature, result.codegen), content)

    def flush(self) -> None:
        """Do nothing: the name of each kept entry already covers its inputs."""


def compiled_and_kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code of a function that calls no kernel, kept in the cache where there is a place for it."""
    if not COMPILES:
        return function
    dispatcher = numba.njit(function)
    with suppress(OSError):
        dispatcher._cache = _KeptCode(function)
    return dispatcher


def compile_callee(function: Callable[..., Any], *, allocates: bool = True) -> Callable[..., Any]:
    """Machine code that only compiled code can call.

    A function without allocation is inlined into its caller: counting references and calling would cost several times
    as much as a short kernel.
    """
    if not COMPILES:
        return function
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    if not allocates:
        options |= {"_nrt": False, "forceinline": True}
    return numba.njit(nogil=True, error_model="numpy", **options)(function)
