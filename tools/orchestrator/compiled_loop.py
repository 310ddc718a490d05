"""The loop over the steps for numba: it calls the FMUs' C functions by their addresses.

Everything is an address or a number that is known only when it runs, so one compilation serves all FMUs and wirings.
`trihedron.tools.orchestrator.plain_loop` does the same in plain Python.
"""

import math
from typing import Any

import numba
from numba import types

from .machine_access import (
    LOADERS,
    STORERS,
    call2,
    call4,
    call5,
    call_step2,
    call_step3,
    copy_bytes,
)
from .operations import (
    AT,
    BEGIN,
    CALL4,
    CALL5,
    CHANGE,
    CHANGING,
    COMPARE,
    CONVERT,
    CURSORS,
    EARLY,
    ENDED,
    EVERY,
    FEED,
    FINITE,
    ITERATION,
    LAST_STEP,
    LENGTH,
    MOVE,
    MOVE8,
    NOT_FINITE,
    NOT_SETTLED,
    RECORDS,
    REPEAT,
    RESTORE,
    ROW,
    ROWS,
    START,
    STATE,
    STATUS,
    STEP,
    STEP2,
    STEP3,
    WARNING,
    WIDTH,
)

_load_f64, _load_f32, _load_i8, _load_u8, _load_i16, _load_u16, _load_i32, _load_u32, _load_i64, _load_u64 = LOADERS
(
    _store_f64,
    _store_f32,
    _store_i8,
    _store_u8,
    _store_i16,
    _store_u16,
    _store_i32,
    _store_u32,
    _store_i64,
    _store_u64,
) = STORERS
_OPTIONS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}


@numba.njit(**_OPTIONS)
def _whole(kind, address):
    """A whole number at an address."""
    if kind == 2:
        return types.int64(_load_i8(address))
    if kind == 3:
        return types.int64(_load_u8(address))
    if kind == 4:
        return types.int64(_load_i16(address))
    if kind == 5:
        return types.int64(_load_u16(address))
    if kind == 6:
        return types.int64(_load_i32(address))
    if kind == 7:
        return types.int64(_load_u32(address))
    return _load_i64(address)


@numba.njit(**_OPTIONS)
def _real(kind, address):
    """A number at an address, as a real number."""
    if kind == 0:
        return _load_f64(address)
    if kind == 1:
        return types.float64(_load_f32(address))
    return types.float64(_whole(kind, address))


@numba.njit(**_OPTIONS)
def _convert(target, source, to_type, from_type, factor, offset):
    if to_type == 0:
        _store_f64(target, factor * _real(from_type, source) + offset)
    elif to_type == 1:
        _store_f32(target, factor * _real(from_type, source) + offset)
    elif to_type == 2:
        _store_i8(target, _whole(from_type, source))
    elif to_type == 3:
        _store_u8(target, _whole(from_type, source))
    elif to_type == 4:
        _store_i16(target, _whole(from_type, source))
    elif to_type == 5:
        _store_u16(target, _whole(from_type, source))
    elif to_type == 6:
        _store_i32(target, _whole(from_type, source))
    elif to_type == 7:
        _store_u32(target, _whole(from_type, source))
    else:
        _store_i64(target, _whole(from_type, source))


@numba.njit(**_OPTIONS)
def _step3(operations, at, time, length):
    """fmi3DoStep and what it returns beside its status."""
    place = operations[at + 4]
    status = call_step3(
        operations[at + 1], operations[at + 2], time, length, operations[at + 3], place, place + 1, place + 2, place + 8
    )
    if status <= WARNING:
        if _load_u8(place + 1) != 0:
            return ENDED
        if _load_u8(place + 2) != 0:
            return EARLY
    return status


def march(operations, numbers, records, state, clock):
    """Make the steps from state[STEP] to state[LAST_STEP], or to the first call that fails.

    Parameters
    ----------
    operations : pointer to int64
        the rows of a step
    numbers : pointer to float64
        their real numbers
    records : pointer to int64
        what is recorded: (target of row 0, source, bytes) each
    state : pointer to int64
    clock : pointer to float64
        as `trihedron.tools.orchestrator.operations` lays them out

    Returns
    -------
    int
        the status of the call that failed, 0 where none has
    """
    rows, length, every = state[ROWS], clock[LENGTH], state[EVERY]
    step = state[STEP]
    row = state[ROW]
    while step < state[LAST_STEP]:
        time = clock[START] + step * length
        pc = 0
        while pc < rows:
            at = pc * WIDTH
            code = operations[at]
            status = 0
            if code == MOVE8:
                _store_i64(operations[at + 1], _load_i64(operations[at + 2]))
            elif code == CALL4:
                status = call4(
                    operations[at + 1], operations[at + 2], operations[at + 3], operations[at + 4], operations[at + 5]
                )
            elif code == CALL5:
                status = call5(
                    operations[at + 1],
                    operations[at + 2],
                    operations[at + 3],
                    operations[at + 4],
                    operations[at + 5],
                    operations[at + 6],
                )
            elif code == STEP2:
                status = call_step2(operations[at + 1], operations[at + 2], time, length, operations[at + 3])
            elif code == STEP3:
                status = _step3(operations, at, time, length)
            elif code == FINITE:
                address = operations[at + 1]
                total = 0.0
                for i in range(operations[at + 2]):
                    # 0 * inf and 0 * NaN are NaN.
                    total += 0.0 * _load_f64(address + 8 * i)
                if total != 0.0:
                    status = NOT_FINITE
            elif code == MOVE:
                copy_bytes(operations[at + 1], operations[at + 2], operations[at + 3])
            elif code == FEED:
                place = CURSORS + operations[at + 6]
                cursor = state[place]
                while cursor + 1 < operations[at + 2] and _load_i64(operations[at + 1] + 8 * (cursor + 1)) <= step:
                    cursor += 1
                if cursor != state[place]:
                    state[place] = cursor
                    width = operations[at + 4]
                    copy_bytes(operations[at + 5], operations[at + 3] + cursor * width, width)
            elif code == CONVERT:
                _convert(
                    operations[at + 1],
                    operations[at + 2],
                    operations[at + 3],
                    operations[at + 4],
                    numbers[2 * pc],
                    numbers[2 * pc + 1],
                )
            elif code == STATE:
                status = call2(operations[at + 1], operations[at + 2], operations[at + 3])
            elif code == BEGIN:
                state[ITERATION] = 0
                clock[CHANGE] = 0.0
            elif code == RESTORE:
                clock[CHANGE] = 0.0
                if state[ITERATION] > 0:
                    status = call2(operations[at + 1], operations[at + 2], _load_i64(operations[at + 3]))
            elif code == COMPARE:
                value = _real(operations[at + 3], operations[at + 1])
                before = _load_f64(operations[at + 2])
                _store_f64(operations[at + 2], value)
                change = math.fabs(value - before) / (numbers[2 * pc] * (1.0 + math.fabs(value)))
                if not change <= clock[CHANGE]:
                    clock[CHANGE] = change
                    state[CHANGING] = pc
            elif code == REPEAT and not clock[CHANGE] <= 1.0:
                state[ITERATION] += 1
                if state[ITERATION] >= operations[at + 2]:
                    status = NOT_SETTLED
                else:
                    pc = operations[at + 1] - 1
            if status > WARNING:
                state[STEP] = step
                state[ROW] = row
                state[STATUS] = status
                state[AT] = pc
                return status
            pc += 1
        step += 1
        if step % every == 0:
            for i in range(state[RECORDS]):
                width = records[3 * i + 2]
                copy_bytes(records[3 * i] + row * width, records[3 * i + 1], width)
            row += 1
    state[STEP] = step
    state[ROW] = row
    return 0


SIGNATURE = types.int64(
    *[types.CPointer(kind) for kind in (types.int64, types.float64, types.int64, types.int64)],
    types.CPointer(types.float64),
)
