"""Loops and kernels as machine code where numba is; else as plain Python, with the same results.

Plain Python takes twice as long in a search for causes, and much longer in a run of a million samples.
"""

import hashlib
import pickle
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any

from ..fmus.cache import store, stored

COMPILES = find_spec("numba") is not None
"""Whether there is a compiler; it is imported at the first use of machine code."""
Makers = tuple[Callable[..., Any], Callable[..., Any]]
"""What makes kernels, and what makes the loop over them."""
_KIND = "code"
"""Folder of the cache for machine code that numba loads."""
_MODELS = Path(__file__).parents[1] / "models"
FEW_ROWS = 400
"""Rows of one call up to which plain Python computes it."""
FEW = 2_000
"""Samples that plain Python processes before a compiler is ready."""


def njit(function: Callable[..., Any], **options: Any) -> Any:
    """Return numba's dispatcher of a function; importing numba takes as long as a small calibration."""
    return import_module("numba").njit(**options)(function)


def loop_compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A loop over kernels that are `compiled`; Python may call it. Its machine code is kept in the cache."""
    return _with_kept_code(function, nogil=True, error_model="numpy") if COMPILES else function


def loops_over(rows: int) -> Makers:
    """Machine code where it pays, the functions themselves where it does not."""
    return (compiled, loop_compiled) if rows > FEW else (_plain, _plain)


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


@cache
def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel in the restricted Python of `trihedron.models.restricted` as machine code, with every kernel it calls.

    It is for other functions that numba compiles, not for Python itself: that compiles much faster. It takes float64
    arrays for `Vector`. The arithmetic is the kernel's, operation by operation, except that a division by zero gives an
    infinity, as in C, and no exception.
    """
    if not COMPILES:
        return kernel
    return compile_callee(_linked(kernel, compiled), allocates=False)


def _linked(function: Callable[..., Any], made: Callable[..., Any]) -> Callable[..., Any]:
    """Return a copy of a function that calls a transformed function for each function of its module's names."""
    linked: dict[str, Any] = {"__name__": function.__module__}
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType):
            linked[name] = made(value)
        elif name in function.__globals__:
            linked[name] = value
    return FunctionType(function.__code__, linked, function.__name__)


class _KeptCode:
    """Machine code of one function in the checked cache, in the place of numba's own cache.

    numba keeps code as pickles in a folder that it does not check. Whatever cannot be used is compiled again.
    """

    cache_path = None

    def __init__(self, function: Callable[..., Any]) -> None:
        self._made_from = [*_names_of(function), platform.python_version(), import_module("numba").__version__]
        sources = [Path(function.__code__.co_filename), Path(__file__)]
        if function.__closure__:
            sources += sorted(_MODELS.rglob("*.py"))
        for source in sources:
            self._made_from.append(hashlib.sha256(source.read_bytes()).hexdigest())

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


def _names_of(function: Callable[..., Any]) -> list[str]:
    """Return the names of a function, and of every function or value that it encloses."""
    # The line tells functions of one name in one module apart.
    names = [f"{function.__module__}.{function.__qualname__}.{function.__code__.co_firstlineno}"]
    for cell in function.__closure__ or ():
        value = cell.cell_contents
        inner = value if isinstance(value, FunctionType) else getattr(value, "py_func", None)
        names += [repr(value)] if inner is None else _names_of(inner)
    return names


class _Later:
    """A function that is compiled at its first use, with those of its module that it calls.

    Its first `plain` uses with few rows run as Python: a small calibration ends before a compiler would be loaded.
    """

    def __init__(self, function: Callable[..., Any], plain: int, counted: int | None) -> None:
        self._function, self._plain, self._counted = function, plain, counted

    @cached_property
    def _machine_code(self) -> Callable[..., Any]:
        return _with_kept_code(_linked(self._function, _callee))

    def __call__(self, *arguments: Any) -> Any:
        if self._plain > 0 and len(arguments[0]) <= FEW_ROWS:
            self._plain -= 1 if self._counted is None else len(arguments[self._counted])
            return self._function(*arguments)
        return self._machine_code(*arguments)


@cache
def _callee(function: Callable[..., Any]) -> Callable[..., Any]:
    return compile_callee(_linked(function, _callee))


def compiled_and_kept(function: Callable[..., Any], plain: int = 0, counted: int | None = None) -> Callable[..., Any]:
    """Machine code of a function that calls no kernel, kept in the cache where there is a place for it.

    The first `plain` uses with few rows are Python: with numbers alone in loops both give the same bits. A use counts
    as often as the argument with the number `counted` has rows.
    """
    return _Later(function, plain, counted) if COMPILES else function


def _with_kept_code(function: Callable[..., Any], **options: Any) -> Any:
    dispatcher = njit(function, **options)
    with suppress(OSError):
        dispatcher._cache = _KeptCode(function)
    return dispatcher


@cache
def local_array() -> tuple[Any, Any]:
    """Return `view` and `place`: `view(place(n), n)` is an array of constant size in a compiled loop.

    The compiler keeps it in registers, and runs a loop over several such arrays on several numbers at once.
    """
    numba, ir = import_module("numba"), import_module("llvmlite.ir")

    def place(context: Any, size: Any) -> Any:
        def allocated(_: Any, builder: Any, signature: Any, __: Any) -> Any:
            kind = ir.ArrayType(ir.DoubleType(), signature.args[0].literal_value)
            made = import_module("numba.core.cgutils").alloca_once(builder, kind)
            return builder.bitcast(made, ir.DoubleType().as_pointer())

        if not hasattr(size, "literal_value"):
            raise numba.errors.RequireLiteralValue("the size must be constant")
        return numba.types.CPointer(numba.float64)(size), allocated

    return numba.carray, import_module("numba.extending").intrinsic(place)


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
    return njit(function, nogil=True, error_model="numpy", **options)
