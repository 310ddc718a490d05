"""A step as one flat table of operations on addresses, and the loop that runs it.

The loop is defined once. It works on memory and functions by their addresses, as machine code and as plain Python. A
row has an operation's code, seven whole numbers and two real numbers. Every step runs the rows from first to last; a
second table lists the recorded values.

| operation | whole numbers | real numbers |
|---|---|---|
| FEED | steps from which rows hold, their number, first row, bytes of a row, target, its cursor | |
| MOVE | target, source, bytes | |
| MOVE8 | target, source: eight bytes | |
| CONVERT | target, source, type of the target, of the source | factor, offset |
| CALL4 | function, instance, references, their number, values: get and set of FMI 2.0 | |
| CALL5 | function, instance, references, their number, values, their number: FMI 3.0 | |
| STEP2, STEP3 | fmi2DoStep or fmi3DoStep, instance, final, place of returns, steps since its begin, in all | length |
| FINITE | first of several real numbers, their number | |
| STATE | function of a state (get or free), instance, place of the state | |
| BEGIN | a new loop of connections: the first iteration | |
| RESTORE | function that sets a state, instance, place of the state: in all iterations but the first | |
| COMPARE | value, place of its value in the previous iteration, its type | tolerance |
| REPEAT | row to go back to while a value changes, most iterations | |
| SKIP | stride, the step within it that is made, row to go on with in the others | |
| BLEND | target, value before a stride, after it, its type, the stride, steps that are added | |
| SLOPE | real number: it becomes its previous value, place of that, place of its derivative | length |
| SUM | target, source, type of the source: a real number is added | |
"""

import ctypes
import hashlib
import math
import platform
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...fmus import version
from ...fmus.cache import kept
from .interface import VALUE_TYPES

WIDTH = 8
FEED, MOVE, MOVE8, CONVERT, CALL4, CALL5, STEP2, STEP3, FINITE, STATE, BEGIN, RESTORE, COMPARE, REPEAT = range(14)
SKIP, BLEND, SUM, SLOPE = range(14, 18)

# Whole numbers that both loops keep.
STEP, LAST_STEP, ROW, EVERY, ROWS, RECORDS, ITERATION, CHANGING, AT, NEXT, CURSORS = range(11)
"""Indices: step to make, step to stop before, row to record, recording interval, rows of both tables, iteration. Then
row of the value that changed most, row of the failed call (-1: none), row to begin a step with, first cursor of a
feed."""

# Real numbers that both loops keep.
START, CHANGE, STOP = range(3)
"""Indices: start [s], largest change of a value in the last iteration relative to the allowed change, time at which a
shortened last step ends [s]."""

NOT_FINITE, NOT_SETTLED, ENDED, EARLY = 100, 101, 102, 103
"""Statuses beyond FMI's: a value that is not finite; a loop that does not settle; an FMU that asks for the end of the
simulation; an FMU that returned before the end of the step."""
BELOW_ONE = 1.0 - 2.0**-52
WARNING = 1
"""Worst status of FMI with which a run continues."""


def loop_of(on: Any) -> Callable[..., int]:
    """Return the loop over the steps, in restricted Python that numba can compile.

    Parameters
    ----------
    on : class
        the loop's access to memory and C functions, all by address: copy(target, source, bytes), load_byte, load_word,
        load_real(address), store_word, store_real(address, value), real_of(type, address) and store_as(type, address,
        real number). Calls of functions are call2, call4, call5 of words, and step2 and step3 with the arguments of
        FMI's doStep

    Returns
    -------
    callable
        takes the rows of a step, their real numbers, the recorded values ((target of row 0, source, bytes) each), and
        the whole and real numbers of the state, laid out as above. It makes the steps from state[STEP] to
        state[LAST_STEP], or to the first call that fails, and returns the status of that call, otherwise 0
    """
    copy, load_word, load_byte, load_real = on.copy, on.load_word, on.load_byte, on.load_real
    store_real, store_word, real_of, store_as = on.store_real, on.store_word, on.real_of, on.store_as
    call2, call4, call5, step2, step3 = on.call2, on.call4, on.call5, on.step2, on.step3

    def march(operations, numbers, records, state, clock):
        rows, every = state[ROWS], state[EVERY]
        step = state[STEP]
        row = state[ROW]
        while step < state[LAST_STEP]:
            pc = state[NEXT]
            state[NEXT] = 0
            while pc < rows:
                at = pc * WIDTH
                code, a, b, c = operations[at], operations[at + 1], operations[at + 2], operations[at + 3]
                d, e = operations[at + 4], operations[at + 5]
                status = 0
                if code == MOVE8:
                    store_word(a, load_word(b))
                elif code == CALL4:
                    status = call4(a, b, c, d, e)
                elif code == CALL5:
                    status = call5(a, b, c, d, e, operations[at + 6])
                elif code in (STEP2, STEP3):
                    size = numbers[2 * pc]
                    time = clock[START] + (step - e) // operations[at + 6] * size
                    if time + size > clock[STOP]:
                        size = clock[STOP] - time
                        if time + size > clock[STOP]:
                            size = size * BELOW_ONE
                    if code == STEP2:
                        status = step2(a, b, time, size, c)
                    else:
                        status = step3(a, b, time, size, c, d, d + 1, d + 2, d + 8)
                        if status <= WARNING and load_byte(d + 1) != 0:
                            status = ENDED
                        elif status <= WARNING and load_byte(d + 2) != 0:
                            status = EARLY
                elif code == FINITE:
                    total = 0.0
                    for i in range(b):
                        # 0 * inf and 0 * NaN are NaN.
                        total += 0.0 * load_real(a + 8 * i)
                    if total != 0.0:
                        status = NOT_FINITE
                elif code == MOVE:
                    copy(a, b, c)
                elif code == FEED:
                    place = CURSORS + operations[at + 6]
                    cursor = state[place]
                    while cursor + 1 < b and load_word(a + 8 * (cursor + 1)) <= step:
                        cursor += 1
                    if cursor != state[place]:
                        state[place] = cursor
                        copy(e, c + cursor * d, d)
                elif code == CONVERT:
                    # Whole numbers that change their type have at most 32 bits, so a real number can hold them.
                    store_as(c, a, numbers[2 * pc] * real_of(d, b) + numbers[2 * pc + 1])
                elif code == SKIP:
                    if step % a != b:
                        pc = c - 1
                elif code == BLEND:
                    old, new, part = real_of(d, b), real_of(d, c), (step % e + operations[at + 6]) / e
                    store_real(a, old + part * (new - old) if part < 1.0 else new)
                elif code == SUM:
                    store_real(a, load_real(a) + real_of(c, b))
                elif code == SLOPE:
                    value = load_real(a)
                    store_real(a, load_real(b))
                    store_real(c, (value - load_real(b)) / numbers[2 * pc])
                    store_real(b, value)
                elif code == STATE:
                    status = call2(a, b, c)
                elif code == BEGIN:
                    state[ITERATION] = 0
                    clock[CHANGE] = 0.0
                elif code == RESTORE:
                    clock[CHANGE] = 0.0
                    if state[ITERATION] > 0:
                        status = call2(a, b, load_word(c))
                elif code == COMPARE:
                    value = real_of(c, a)
                    change = math.fabs(value - load_real(b)) / (numbers[2 * pc] * (1.0 + math.fabs(value)))
                    store_real(b, value)
                    if not change <= clock[CHANGE]:
                        clock[CHANGE] = change
                        state[CHANGING] = pc
                elif code == REPEAT and not clock[CHANGE] <= 1.0:
                    state[ITERATION] += 1
                    if state[ITERATION] >= b:
                        status = NOT_SETTLED
                    else:
                        pc = a - 1
                if status > WARNING:
                    state[STEP] = step
                    state[ROW] = row
                    state[AT] = pc
                    return status
                pc += 1
            step += 1
            if step % every == 0:
                for i in range(state[RECORDS]):
                    width = records[3 * i + 2]
                    copy(records[3 * i] + row * width, records[3 * i + 1], width)
                row += 1
        state[STEP] = step
        state[ROW] = row
        return 0

    return march


@cache
def compiled_march() -> Callable[..., int]:
    """Return the compiled loop for ctypes; it takes addresses and lets other Python threads run."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )
    name = "trihedron_march"
    versions = [version("numba"), version("llvmlite"), platform.python_version()]
    digest = hashlib.sha256(repr([llvm.get_default_triple(), cpu, features, name, versions]).encode())
    for source in ("../compiled.py", "machine_code.py", "operations.py"):
        digest.update(hashlib.sha256((Path(__file__).parent / source).read_bytes()).digest())

    def make() -> bytes:
        from .machine_code import object_code

        return object_code(loop_of, machine, name)

    code = kept("loops", f"{digest.hexdigest()}.o", make)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    # numba's functions return their value through a pointer; the second pointer is for exceptions, which never occur.
    function = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 7)(engine.get_function_address(name))

    def march(*arguments: int, _engine: Any = engine) -> int:
        status = ctypes.c_int64()
        function(ctypes.addressof(status), None, *arguments)
        return status.value

    return march


def _c_types() -> dict[int, Any]:
    """Return the C types by the codes of `ValueType`."""
    types = {}
    for value_type in VALUE_TYPES.values():
        if not value_type.by_address:
            types[value_type.code] = np.ctypeslib.as_ctypes_type(value_type.dtype)
    return types


_C_TYPES = _c_types()


def _function(types: Sequence[Any]) -> Callable[..., int]:
    """Return a call of int f(types) at an address; ctypes passes plain integers fastest."""
    prototype = cache(ctypes.CFUNCTYPE(ctypes.c_int, *types))
    return lambda function, *arguments: prototype(function)(*arguments)


def _loader(c_type: Any) -> Callable[[int], Any]:
    """Return a function that reads the number at an address."""
    return lambda at: c_type.from_address(at).value


def _storer(c_type: Any) -> Callable[[int, Any], None]:
    """Return a function that writes a number to an address."""

    def store(at: int, value: Any) -> None:
        c_type.from_address(at).value = value

    return store


class _Plain:
    """The primitives of the loop in plain Python."""

    copy = ctypes.memmove
    load_byte, load_word, load_real = _loader(ctypes.c_uint8), _loader(ctypes.c_int64), _loader(ctypes.c_double)
    store_word, store_real = _storer(ctypes.c_int64), _storer(ctypes.c_double)
    call2, call4, call5 = (_function([ctypes.c_size_t] * count) for count in (2, 4, 5))
    step2 = _function([ctypes.c_size_t, ctypes.c_double, ctypes.c_double, ctypes.c_int])
    step3 = _function([ctypes.c_size_t, ctypes.c_double, ctypes.c_double, ctypes.c_bool] + [ctypes.c_size_t] * 4)

    @staticmethod
    def real_of(code: int, at: int) -> float:
        return float(_C_TYPES[code].from_address(at).value)

    @staticmethod
    def store_as(code: int, at: int, value: float) -> None:
        number = _C_TYPES[code].from_address(at)
        number.value = type(number.value)(value)


plain_march = loop_of(_Plain)
