"""Compile the orchestrator's loop with numba into an object file that needs no Python.

Loading the object file needs neither this module nor numba.
"""

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..compiled import compile_callee

# Its calls have other arguments than its definition: numba's own comes first.
_intrinsic: Any = intrinsic
_BYTE, _WORD = ir.IntType(8), ir.IntType(64)
_KINDS = (
    types.float64,
    types.float32,
    types.int8,
    types.uint8,
    types.int16,
    types.uint16,
    types.int32,
    types.uint32,
    types.int64,
    types.uint64,
)
"""Number types, indexed by the codes of the orchestrator's `ValueType`."""


@_intrinsic
def call(_context: Any, _function: Any, arguments: Any) -> Any:
    """Call int f(arguments) at an address; a boolean is passed as an int, whose lowest byte is used."""

    def code(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        machine = ir.FunctionType(ir.IntType(32), [context.get_value_type(kind) for kind in arguments])
        call_arguments = [builder.extract_value(values[1], k) for k in range(len(arguments))]
        return builder.call(builder.inttoptr(values[0], machine.as_pointer()), call_arguments)

    return types.int32(types.int64, arguments), code


@_intrinsic
def load_number(_context: Any, _address: Any, kind: Any) -> Any:
    """Return the number of a kind at an address."""
    number = kind.instance_type

    def code(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], context.get_value_type(number).as_pointer()), align=1)

    return number(types.int64, kind), code


@_intrinsic
def store(_context: Any, _address: Any, number: Any) -> Any:
    """Write a number to an address."""

    def code(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        builder.store(values[1], builder.inttoptr(values[0], values[1].type.as_pointer()), align=1)
        return context.get_dummy_value()

    return types.void(types.int64, number), code


@_intrinsic
def copy_bytes(_context: Any, _target: Any, _source: Any, _size: Any) -> Any:
    """Copy bytes, as memcpy does."""

    def code(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        pointer = _BYTE.as_pointer()
        copy = builder.module.declare_intrinsic("llvm.memcpy", [pointer, pointer, _WORD])
        target, source = builder.inttoptr(values[0], pointer), builder.inttoptr(values[1], pointer)
        builder.call(copy, [target, source, values[2], ir.Constant(ir.IntType(1), 0)])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), code


def _real_reader() -> Any:
    """Return a function that reads a number as a real one, by the code of its kind."""

    def if_it_is(this: int, kind: Any, otherwise: Any) -> Any:
        return compile_callee(
            lambda code, at: types.float64(load_number(at, kind)) if code == this else otherwise(code, at)
        )

    reader = compile_callee(lambda _code, at: types.float64(load_number(at, types.int64)))
    for this in reversed(range(len(_KINDS) - 2)):
        reader = if_it_is(this, _KINDS[this], reader)
    return reader


def _real_writer() -> Any:
    """Return a function that writes a real number as a number of a kind, by its code."""

    def if_it_is(this: int, kind: Any, otherwise: Any) -> Any:
        return compile_callee(
            lambda code, at, value: store(at, kind(value)) if code == this else otherwise(code, at, value)
        )

    writer = compile_callee(lambda _code, at, value: store(at, types.int64(value)))
    for this in reversed(range(len(_KINDS) - 2)):
        writer = if_it_is(this, _KINDS[this], writer)
    return writer


class _Machine:
    """The primitives of the loop as machine code."""

    copy, real_of, store_as = copy_bytes, _real_reader(), _real_writer()
    load_word = compile_callee(lambda at: load_number(at, types.int64))
    load_byte = compile_callee(lambda at: load_number(at, types.uint8))
    load_real = compile_callee(lambda at: load_number(at, types.float64))
    store_word = compile_callee(lambda at, value: store(at, types.int64(value)))
    store_real = compile_callee(lambda at, value: store(at, types.float64(value)))
    call2 = compile_callee(lambda f, a, b: call(f, (a, b)))
    call4 = compile_callee(lambda f, a, b, c, d: call(f, (a, b, c, d)))
    call5 = compile_callee(lambda f, a, b, c, d, e: call(f, (a, b, c, d, e)))
    step2 = compile_callee(lambda f, a, time, step, final: call(f, (a, time, step, types.int32(final))))
    step3 = compile_callee(
        lambda f, a, time, step, final, *places: call(
            f, (a, time, step, types.int32(final), places[0], places[1], places[2], places[3])
        )
    )


def object_code(loop_of: Callable[[Any], Any], machine: Any, name: str) -> bytes:
    """Return the orchestrator's loop as an object file that exports this name and contains nothing of Python.

    All addresses and numbers are arguments, so one compilation serves all FMUs and wirings; the loop calls the FMUs' C
    functions by address. Raises RuntimeError if a reference to Python remains.
    """
    pointers = [types.CPointer(kind) for kind in (types.int64, types.float64, types.int64, types.int64, types.float64)]
    options: dict[str, Any] = {"nopython": True, "error_model": "numpy"}
    compiled: Any = numba.cfunc(types.int64(*pointers), **options)(loop_of(_Machine))
    module = llvm.parse_assembly(compiled.inspect_llvm())
    inner = compiled.native_name.removeprefix("cfunc.")
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
