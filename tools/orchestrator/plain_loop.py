"""The loop over the steps in plain Python: what the compiled loop does, operation by operation.

It runs what is done before the first step, records that hold strings, and everything where nothing compiles.
"""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from . import operations as op
from .program import Program
from .value_types import VALUE_TYPES

Action = Callable[[int, float], int]
"""(step, its time) -> status."""
Row = tuple[int, ...]

_WORD, _REAL, _INT = ctypes.c_size_t, ctypes.c_double, ctypes.c_int
_C_TYPES: dict[int, Any] = {t.code: t.c_type for t in VALUE_TYPES.values() if t.kind != "String"}
# Functions are called with addresses as plain integers: ctypes passes those fastest.
_PROTOTYPES = {
    op.CALL4: ctypes.CFUNCTYPE(_INT, *[_WORD] * 4),
    op.CALL5: ctypes.CFUNCTYPE(_INT, *[_WORD] * 5),
    op.STEP2: ctypes.CFUNCTYPE(_INT, _WORD, _REAL, _REAL, _INT),
    op.STEP3: ctypes.CFUNCTYPE(_INT, _WORD, _REAL, _REAL, ctypes.c_bool, *[_WORD] * 4),
    op.STATE: ctypes.CFUNCTYPE(_INT, _WORD, _WORD),
    op.RESTORE: ctypes.CFUNCTYPE(_INT, _WORD, _WORD),
}


def actions(program: Program, state: np.ndarray, clock: np.ndarray) -> list[Action]:
    """A function for each row of a program."""
    return [
        _action(row, numbers, at, state, clock)
        for at, (row, numbers) in enumerate(zip(program.rows, program.numbers, strict=True))
    ]


def _action(row: Row, numbers: tuple[float, float], at: int, state: np.ndarray, clock: np.ndarray) -> Action:
    code = row[0]
    if code == op.FEED:
        return _feeding(row, state)
    if code in (op.MOVE, op.MOVE8):
        target, source, size = row[1], row[2], 8 if code == op.MOVE8 else row[3]
        return lambda _k, _t: ctypes.memmove(target, source, size) and 0
    if code == op.CONVERT:
        return _converting(row, *numbers)
    if code in (op.CALL4, op.CALL5):
        function, arguments = _PROTOTYPES[code](row[1]), row[2 : 6 if code == op.CALL4 else 7]
        return lambda _k, _t: function(*arguments)
    if code in (op.STEP2, op.STEP3):
        return _stepping(row, float(clock[op.LENGTH]))
    if code == op.FINITE:
        values = _view(row[1], row[2])
        # 0 * inf and 0 * NaN are NaN: one product tells whether all are finite.
        dot, zeros = values.dot, np.zeros(row[2])
        return lambda _k, _t: 0 if dot(zeros) == 0.0 else op.NOT_FINITE
    if code == op.STATE:
        function, arguments = _PROTOTYPES[code](row[1]), row[2:4]
        return lambda _k, _t: function(*arguments)
    if code == op.COMPARE:
        return _comparing(row, numbers[0], at, state, clock)
    return _iterating(row, state, clock)


def _view(address: int, count: int) -> np.ndarray:
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))


def _feeding(row: Row, state: np.ndarray) -> Action:
    _, begins_at, count, base, width, target, cursor = row[:7]
    begins = list((ctypes.c_int64 * count).from_address(begins_at))
    place = op.CURSORS + cursor

    def feed(k: int, _t: float) -> int:
        at = state[place]
        while at + 1 < count and begins[at + 1] <= k:
            at += 1
        if at != state[place]:
            state[place] = at
            ctypes.memmove(target, base + int(at) * width, width)
        return 0

    return feed


def _converting(row: Row, factor: float, offset: float) -> Action:
    target, source = _C_TYPES[row[3]].from_address(row[1]), _C_TYPES[row[4]].from_address(row[2])
    real = row[3] in (0, 1)

    def convert(_k: int, _t: float) -> int:
        target.value = factor * source.value + offset if real else source.value
        return 0

    return convert


def _stepping(row: Row, length: float) -> Action:
    code, address, instance, final, place = row[:5]
    function = _PROTOTYPES[code](address)
    if code == op.STEP2:
        return lambda _k, time: function(instance, time, length, final)
    event, end, early, last = place, place + 1, place + 2, place + 8

    def step(_k: int, time: float) -> int:
        status = function(instance, time, length, bool(final), event, end, early, last)
        if status <= op.WARNING:
            if ctypes.c_uint8.from_address(end).value:
                return op.ENDED
            if ctypes.c_uint8.from_address(early).value:
                return op.EARLY
        return status

    return step


def _comparing(row: Row, tolerance: float, at: int, state: np.ndarray, clock: np.ndarray) -> Action:
    value, before = _C_TYPES[row[3]].from_address(row[1]), ctypes.c_double.from_address(row[2])

    def compare(_k: int, _t: float) -> int:
        now = float(value.value)
        change = abs(now - before.value) / (tolerance * (1.0 + abs(now)))
        before.value = now
        if not change <= clock[op.CHANGE]:
            clock[op.CHANGE], state[op.CHANGING] = change, at
        return 0

    return compare


def _iterating(row: Row, state: np.ndarray, clock: np.ndarray) -> Action:
    """BEGIN, RESTORE and REPEAT; REPEAT answers with the row to go back to as -1 - row."""

    def begin(_k: int, _t: float) -> int:
        state[op.ITERATION] = 0
        clock[op.CHANGE] = 0.0
        return 0

    def repeat(_k: int, _t: float) -> int:
        if clock[op.CHANGE] <= 1.0:
            return 0
        state[op.ITERATION] += 1
        return op.NOT_SETTLED if state[op.ITERATION] >= row[2] else -1 - row[1]

    if row[0] == op.BEGIN:
        return begin
    if row[0] == op.REPEAT:
        return repeat
    function, instance = _PROTOTYPES[op.RESTORE](row[1]), row[2]
    saved = ctypes.c_size_t.from_address(row[3])

    def restore(_k: int, _t: float) -> int:
        clock[op.CHANGE] = 0.0
        return function(instance, saved.value) if state[op.ITERATION] > 0 else 0

    return restore


def run_once(todo: Sequence[Action], state: np.ndarray, k: int, time: float) -> int:
    """Run the rows of one step; the status of the row that fails, its number in the state."""
    at, end = 0, len(todo)
    while at < end:
        status = todo[at](k, time)
        if status > op.WARNING:
            state[op.STATUS], state[op.AT] = status, at
            return status
        at = at + 1 if status >= 0 else -1 - status
    return 0


def plain_march(
    program: Program, records: np.ndarray, texts: Callable[[], None], state: np.ndarray, clock: np.ndarray
) -> int:
    """Make the steps from state[STEP] to state[LAST_STEP], as `compiled_loop.march` does.

    Parameters
    ----------
    program : Program
    records : (N, 3) int64
        what is recorded: target of row 0, source, bytes
    texts : callable
        keeps the recorded strings
    state, clock : array
        as `trihedron.tools.orchestrator.operations` lays them out
    """
    todo = actions(program, state, clock)
    start, length, every = float(clock[op.START]), float(clock[op.LENGTH]), int(state[op.EVERY])
    row, copies = int(state[op.ROW]), records.tolist()
    with np.errstate(invalid="ignore"):
        for k in range(int(state[op.STEP]), int(state[op.LAST_STEP])):
            status = run_once(todo, state, k, start + k * length)
            if status:
                state[op.STEP], state[op.ROW] = k, row
                return status
            if (k + 1) % every == 0:
                for target, source, size in copies:
                    ctypes.memmove(target + row * size, source, size)
                texts()
                row += 1
    state[op.STEP], state[op.ROW] = state[op.LAST_STEP], row
    return 0
