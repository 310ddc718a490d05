"""The loop over the steps as machine code: made once by numba; it calls the FMUs' C functions by their addresses.

Everything is an address or a number that is known only when it runs, so one compilation serves all FMUs and wirings.
`trihedron.tools.orchestrator.loops` loads it from the cache; nothing of this module, nor numba, is needed then.
"""

from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .program import loop_of

# Its calls have other arguments than its definition: the first one is numba's own.
_intrinsic: Any = intrinsic
_BYTE, _WORD = ir.IntType(8), ir.IntType(64)
_OPTIONS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}
_KINDS = ("float64", "float32", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
"""By the codes of `trihedron.tools.orchestrator.interface.ValueType`."""
_REALS = 2
"""So many of them are real."""
_MACHINE = {getattr(types, kind): ir.IntType(int(kind.lstrip("uint"))) for kind in _KINDS[_REALS:]}
_MACHINE |= {types.float64: ir.DoubleType(), types.float32: ir.FloatType()}


def _call(*arguments: Any) -> Any:
    """Signature and code of a call of int f(arguments) at an address."""
    machine = ir.FunctionType(ir.IntType(32), [_MACHINE[a] for a in arguments])

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


def _loader(kind: str) -> Any:
    """What reads a number of a kind at an address."""
    number = getattr(types, kind)

    @_intrinsic
    def load(_context: Any, _address: Any) -> Any:
        def code(_inner: Any, builder: Any, _signature: Any, values: Any) -> Any:
            return builder.load(builder.inttoptr(values[0], _MACHINE[number].as_pointer()), align=1)

        return number(types.int64), code

    return load


def _storer(kind: str) -> Any:
    """What writes a number of a kind to an address."""
    number = getattr(types, kind)

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


_load_i64, _store_i64 = _loader("int64"), _storer("int64")


def _compiled(function: Any) -> Any:
    return numba.njit(**_OPTIONS)(function)


def _reader(as_number: Any, codes: range) -> Any:
    """What reads a number by the code of its kind, an int64 where it is none of these codes."""

    def if_it_is(this: int, load: Any, otherwise: Any) -> Any:
        return _compiled(lambda code, at: as_number(load(at)) if code == this else otherwise(code, at))

    read = _compiled(lambda _code, at: as_number(_load_i64(at)))
    for this in reversed(codes):
        read = if_it_is(this, _loader(_KINDS[this]), read)
    return read


def _converter() -> Any:
    """What turns a number of one kind into one of another: factor * value + offset where that is real."""

    def if_it_is_real(this: int, store: Any, otherwise: Any) -> Any:
        return _compiled(
            lambda code, to, at, of, factor, offset: (
                store(to, factor * _real(of, at) + offset)
                if code == this
                else otherwise(code, to, at, of, factor, offset)
            )
        )

    def if_it_is(this: int, store: Any, otherwise: Any) -> Any:
        return _compiled(
            lambda code, to, at, of, factor, offset: (
                store(to, _whole(of, at)) if code == this else otherwise(code, to, at, of, factor, offset)
            )
        )

    convert = _compiled(lambda _code, to, at, of, _factor, _offset: _store_i64(to, _whole(of, at)))
    for this in reversed(range(len(_KINDS) - 2)):
        convert = (if_it_is_real if this < _REALS else if_it_is)(this, _storer(_KINDS[this]), convert)
    return convert


_whole = _reader(types.int64, range(_REALS, len(_KINDS) - 2))
_real = _reader(types.float64, range(len(_KINDS) - 2))
_convert = _converter()


class _Machine:
    """The primitives of the loop as machine code."""

    copy, convert, real_of = copy_bytes, _convert, _real
    load_word, load_byte, load_real = _load_i64, _loader("uint8"), _loader("float64")
    store_word, store_real = _store_i64, _storer("float64")
    call2, call4, call5, step2, step3 = call2, call4, call5, call_step2, call_step3


def object_code(machine: Any, name: str) -> bytes:
    """The loop as an object file in which it has this name; everything that belongs to Python is taken out of it.

    Raises
    ------
    RuntimeError
        something of Python remains
    """
    pointers = [types.CPointer(kind) for kind in (types.int64, types.float64, types.int64, types.int64, types.float64)]
    options: dict[str, Any] = {"nopython": True, "error_model": "numpy"}
    made: Any = numba.cfunc(types.int64(*pointers), **options)(loop_of(_Machine))
    module = llvm.parse_assembly(made.inspect_llvm())
    inner = made.native_name.removeprefix("cfunc.")
    for function in module.functions:
        if function.name == inner:
            function.name = name
        elif not function.is_declaration:
            function.linkage = "internal"
    for value in module.global_variables:
        if not value.is_declaration:
            value.linkage = "internal"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(3)))
    needed = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    needed += [v.name for v in module.global_variables if v.is_declaration]
    if needed:
        raise RuntimeError(f"the compiled loop needs {', '.join(needed)}")
    return machine.emit_object(module)
