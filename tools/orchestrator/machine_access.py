"""Memory and C functions by their addresses, for code that numba compiles."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

# Its calls have other arguments than its definition: the first one is numba's own.
_intrinsic: Any = intrinsic
_BYTE, _INT, _WORD = ir.IntType(8), ir.IntType(32), ir.IntType(64)
_MACHINE = {
    types.float64: ir.DoubleType(),
    types.float32: ir.FloatType(),
    **{getattr(types, f"{sign}int{bits}"): ir.IntType(bits) for sign in ("", "u") for bits in (8, 16, 32, 64)},
}


def _call(*arguments: Any) -> Any:
    """Signature and code of a call of int f(arguments) at an address."""
    machine = ir.FunctionType(_INT, [_MACHINE[a] for a in arguments])

    def code(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.call(builder.inttoptr(values[0], machine.as_pointer()), values[1:])

    return types.int32(types.int64, *arguments), code


@_intrinsic
def call2(_context: Any, _function: Any, _a: Any, _b: Any) -> Any:
    """A function of two words."""
    return _call(types.int64, types.int64)


@_intrinsic
def call4(_context: Any, _function: Any, _a: Any, _b: Any, _c: Any, _d: Any) -> Any:
    """A function of four words."""
    return _call(*[types.int64] * 4)


@_intrinsic
def call5(_context: Any, _function: Any, _a: Any, _b: Any, _c: Any, _d: Any, _e: Any) -> Any:
    """A function of five words."""
    return _call(*[types.int64] * 5)


@_intrinsic
def call_step2(_context: Any, _function: Any, _instance: Any, _time: Any, _step: Any, _final: Any) -> Any:
    """fmi2DoStep."""
    return _call(types.int64, types.float64, types.float64, types.int32)


@_intrinsic
def call_step3(
    _context: Any, _function: Any, _instance: Any, _time: Any, _step: Any, _final: Any,
    _event: Any, _end: Any, _early: Any, _last: Any,
) -> Any:  # fmt: skip
    """fmi3DoStep; its boolean is passed as an int, of which it takes the lowest byte."""
    return _call(types.int64, types.float64, types.float64, types.int32, *[types.int64] * 4)


def _loader(number: Any) -> Any:
    """What reads a number of a type at an address."""

    @_intrinsic
    def load(_context: Any, _address: Any) -> Any:
        def code(_inner: Any, builder: Any, _signature: Any, values: Any) -> Any:
            return builder.load(builder.inttoptr(values[0], _MACHINE[number].as_pointer()), align=1)

        return number(types.int64), code

    return load


def _storer(number: Any) -> Any:
    """What writes a number of a type to an address."""

    @_intrinsic
    def store(_context: Any, _address: Any, _value: Any) -> Any:
        def code(_inner: Any, builder: Any, _signature: Any, values: Any) -> Any:
            builder.store(values[1], builder.inttoptr(values[0], _MACHINE[number].as_pointer()), align=1)
            return _inner.get_dummy_value()

        return types.void(types.int64, number), code

    return store


@_intrinsic
def copy_bytes(_context: Any, _target: Any, _source: Any, _size: Any) -> Any:
    """memcpy."""

    def code(_inner: Any, builder: Any, _signature: Any, values: Any) -> Any:
        pointer = _BYTE.as_pointer()
        copy = builder.module.declare_intrinsic("llvm.memcpy", [pointer, pointer, _WORD])
        ends = [builder.inttoptr(value, pointer) for value in values[:2]]
        builder.call(copy, [*ends, values[2], ir.Constant(ir.IntType(1), 0)])
        return _inner.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), code


_KINDS = ("float64", "float32", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
LOADERS = tuple(_loader(getattr(types, kind)) for kind in _KINDS)
STORERS = tuple(_storer(getattr(types, kind)) for kind in _KINDS)
"""By the codes of `trihedron.tools.orchestrator.value_types`."""
