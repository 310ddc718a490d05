"""The loop over the steps: FMUs initialised, stepped in order, their outputs passed on, until one fails or all is done.

Inputs that are set before doStep(t, h) hold over (t, t + h]. What an FMU puts out after its step goes at once to
those that step after it (Gauss-Seidel), so an increment over a step is there when its consumer makes the same step.

A program is run by machine code (`trihedron.tools.orchestrator.compiled`, kept as an object file, loaded without
numba) or, operation by operation, by plain Python: before the first step, where strings are recorded, and where
nothing compiles.
"""

import ctypes
import hashlib
import platform
import signal
import threading
import time as clocks
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np

from ...fmus.native.compile import cache_folder
from ..errors import InputError
from . import program as op
from .interface import VALUE_TYPES
from .journal import Blocks, Keep
from .load import Loaded, keep
from .program import Ports, Program, step_program
from .slave import Slave, Slave3
from .stimuli import Grid
from .wiring import Coupling, Group

CALL_SECONDS = 0.05
"""About so long the compiled loop runs before Python looks at Ctrl-C and shows progress."""

Action = Callable[[int, float], int]
"""(step, its time) -> status."""
Row = tuple[int, ...]

_WORD, _REAL, _INT = ctypes.c_size_t, ctypes.c_double, ctypes.c_int
_C_TYPES: dict[int, Any] = {
    t.code: np.ctypeslib.as_ctypes_type(t.dtype) for t in VALUE_TYPES.values() if t.kind != "String"
}
# Functions are called with addresses as plain integers: ctypes passes those fastest.
_PROTOTYPES = {
    op.CALL4: ctypes.CFUNCTYPE(_INT, *[_WORD] * 4),
    op.CALL5: ctypes.CFUNCTYPE(_INT, *[_WORD] * 5),
    op.STEP2: ctypes.CFUNCTYPE(_INT, _WORD, _REAL, _REAL, _INT),
    op.STEP3: ctypes.CFUNCTYPE(_INT, _WORD, _REAL, _REAL, ctypes.c_bool, *[_WORD] * 4),
    op.STATE: ctypes.CFUNCTYPE(_INT, _WORD, _WORD),
    op.RESTORE: ctypes.CFUNCTYPE(_INT, _WORD, _WORD),
}


@dataclass(frozen=True)
class Assembly:
    """What runs together.

    Attributes
    ----------
    groups : sequence of Group
        the FMUs in the order in which they step
    coupling : Coupling
        how cycles of connections are taken
    loaded, ports : mapping
        by the FMU's name: what to instantiate and to set before initialisation, the memory that it reads and writes
    grid : Grid
    """

    groups: Sequence[Group]
    coupling: Coupling
    loaded: Mapping[str, Loaded]
    ports: Mapping[str, Ports]
    grid: Grid

    @property
    def order(self) -> list[str]:
        """The FMUs in the order in which they step."""
        return [name for group in self.groups for name in group.members]


def run_fmus(
    assembly: Assembly,
    every: int,
    keep_rows: Keep,
    *,
    progress: Callable[[int], None] = lambda _: None,
    flush: Callable[[], bool] = lambda: False,
    compiled: bool = True,
) -> None:
    """Run FMUs together from the grid's start to its end.

    Parameters
    ----------
    assembly : Assembly
    every : int
        record every n-th communication point, the first one included
    keep_rows : callable
        takes the recorded values block by block: (ticks, (FMU, variable) -> values)
    progress : callable
        told how many steps are made
    flush : callable
        whether a block is to be handed on before it is full
    compiled : bool
        by machine code, unless strings are recorded; otherwise by plain Python, with the same results

    Raises
    ------
    InputError
        a call that does not end with OK or Warning, an output that is not finite, or a cycle that does not settle
    KeyboardInterrupt
        Ctrl-C, once what was recorded is kept and the FMUs are closed
    """
    with held_interrupt() as pressed, ExitStack() as stack:
        slaves: dict[str, Slave] = {}
        for name in assembly.order:
            entry = assembly.loaded[name]
            slaves[name] = slave = (Slave3 if entry.interface.version == 3 else Slave)(name, entry.fmu)
            stack.callback(slave.close)
        initialise(slaves, assembly)
        blocks = Blocks({name: assembly.ports[name] for name in assembly.order}, assembly.grid, every, keep_rows)
        blocks.record()
        loop = _Loop(assembly, slaves, blocks, every, compiled=compiled)
        try:
            loop.run(pressed, progress, flush)
        finally:
            loop.free_states()
        blocks.flush()
        for slave in slaves.values():
            slave.close(finished=not pressed())


@contextmanager
def held_interrupt() -> Iterator[Callable[[], bool]]:
    """Hold the first Ctrl-C back until the block looks at it or ends; the second one acts at once.

    An FMU that runs Python in this process would be struck by the exception itself, and report it as its own failure.

    Yields
    ------
    callable
        whether Ctrl-C was pressed: the block should then end

    Raises
    ------
    KeyboardInterrupt
        at the end of the block, when Ctrl-C was pressed
    """
    pressed = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        # Handlers belong to the main thread; and what a host program does about Ctrl-C is its own affair.
        yield pressed.is_set
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        pressed.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed.is_set():
        raise KeyboardInterrupt


def initialise(slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Bring all FMUs through initialisation; outputs are passed on in it and after it.

    Raises
    ------
    InputError
        a call that fails, an output that is not finite, or a cycle that does not settle
    """
    grid, order = assembly.grid, assembly.order
    for name in order:
        slaves[name].set_values(assembly.loaded[name].values.values(), assembly.loaded[name].interface)
    # Within a cycle nobody has the outputs of those that come later: inputs keep their start values.
    entered: list[str] = []
    for group in assembly.groups:
        for name in group.members:
            slaves[name].begin(grid.start, grid.time(grid.steps))
            _exchange(name, slaves, assembly, entered)
            entered.append(name)
        _settle(group, slaves, assembly)
    for name in order:
        slaves[name].call(f"{slaves[name].prefix}ExitInitializationMode")
    for group in assembly.groups:
        for name in group.members:
            _exchange(name, slaves, assembly, order)
        _settle(group, slaves, assembly)


def _exchange(name: str, slaves: Mapping[str, Slave], assembly: Assembly, sources: Collection[str]) -> None:
    """Set every input of an FMU (stimuli as in the first step) and get every output."""
    for feed in assembly.ports[name].feeds:
        ctypes.memmove(feed.target, feed.rows, feed.width)
    program, start = Program(slaves, assembly.ports), assembly.grid.start
    program.add_transfers(name, sources)
    program.add_sets(name, constants=True)
    program.add_gets(name)
    state = np.zeros(op.CURSORS, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        status = _run_once(_actions(program, state, np.zeros(3)), state, 0, start)
    place = program.places[int(state[op.AT])]
    if status == op.NOT_FINITE and place.port is not None:
        slaves[name].refuse_not_finite(place.port.variables, place.port.values, start)
    if status:
        slaves[name].fail(place.call, status, None)


def _settle(group: Group, slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Pass the first outputs of a cycle around: once, or until they no longer change."""
    if not group.cyclic:
        return
    coupling = assembly.coupling
    compare = Program(slaves, assembly.ports)
    compare.add_comparisons(group, coupling)
    state, clock = np.zeros(op.CURSORS, dtype=np.int64), np.zeros(3)
    todo = _actions(compare, state, clock)
    _run_once(todo, state, 0, 0.0)
    for _ in range(coupling.iterations):
        for name in group.members:
            _exchange(name, slaves, assembly, assembly.order)
        clock[op.CHANGE] = 0.0
        _run_once(todo, state, 0, 0.0)
        if coupling.kind != "iterate" or clock[op.CHANGE] <= 1.0:
            return
    when = f"in {coupling.iterations} iterations before the first step"
    _refuse_unsettled(group, compare, state, clock, when)


def _refuse_unsettled(group: Group, program: Program, state: np.ndarray, clock: np.ndarray, when: str) -> NoReturn:
    value = program.places[int(state[op.CHANGING])]
    assert value.variable is not None
    raise InputError(
        f"the cycle {group} does not settle {when}: '{value.fmu}.{value.variable.name}' still changes by "
        f"{float(clock[op.CHANGE]):.3g} times the tolerance"
    )


class _Loop:
    """The steps, a stretch at a time."""

    def __init__(
        self, assembly: Assembly, slaves: Mapping[str, Slave], blocks: Blocks, every: int, *, compiled: bool
    ) -> None:
        self.grid, self.slaves, self.blocks, self.every = assembly.grid, slaves, blocks, every
        self.program = program = step_program(assembly.groups, assembly.coupling, slaves, assembly.ports)
        self.state = np.zeros(op.CURSORS + program.cursors, dtype=np.int64)
        self.clock = np.array([self.grid.start, self.grid.step, 0.0])
        self.state[op.EVERY], self.state[op.ROWS], self.state[op.AT] = every, len(program.rows), -1
        self.state[op.RECORDS] = len(blocks.records)
        self._march: Callable[[], int] = self._plain
        if compiled and not blocks.has_text:
            # Where nothing can be compiled the plain loop does the same.
            with suppress(ImportError, RuntimeError):
                self._march = self._compiled()

    def _compiled(self) -> Callable[[], int]:
        march = compiled_march()
        operations = np.array(self.program.rows, dtype=np.int64).reshape(-1, op.WIDTH)
        numbers = np.array(self.program.numbers, dtype=np.float64).reshape(-1, 2)
        tables = (operations, numbers, self.blocks.records, self.state, self.clock)
        return lambda: march(*(table.ctypes.data for table in tables))

    def _plain(self) -> int:
        return plain_march(self.program, self.blocks.records, self.blocks.keep_texts, self.state, self.clock)

    def run(self, pressed: Callable[[], bool], progress: Callable[[int], None], flush: Callable[[], bool]) -> None:
        """All steps, until one fails or Ctrl-C is pressed; what was recorded is in the blocks."""
        made, stretch = 0, 1
        while made < self.grid.steps and not pressed():
            room = (self.blocks.rows - self.blocks.row) * self.every - made % self.every
            last = min(self.grid.steps, made + min(stretch, room))
            self.state[op.LAST_STEP], self.state[op.ROW] = last, self.blocks.row
            began = clocks.perf_counter()
            status = self._march()
            elapsed = clocks.perf_counter() - began
            self.blocks.advance(int(self.state[op.ROW]))
            if status:
                self._refuse(status)
            made = last
            stretch = min(2 * stretch, max(1, int(stretch * CALL_SECONDS / max(elapsed, 1e-9))))
            if flush():
                self.blocks.flush()
            progress(made)

    def _refuse(self, status: int) -> NoReturn:
        """Say which FMU failed, when and why."""
        at, step = int(self.state[op.AT]), int(self.state[op.STEP])
        place = self.program.places[at]
        begin, end = self.grid.time(step), self.grid.time(step) + self.grid.step
        if status == op.NOT_SETTLED and place.group is not None:
            when = f"in {int(self.state[op.ITERATION])} iterations at {begin:.9g} s"
            _refuse_unsettled(place.group, self.program, self.state, self.clock, when)
        slave = self.slaves[place.fmu]
        if status == op.NOT_FINITE and place.port is not None:
            slave.refuse_not_finite(place.port.variables, place.port.values, self.grid.time(step + 1))
        if status == op.ENDED:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s asks for the end of the simulation")
        if status == op.EARLY:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s returned before the end of the step")
        got = self.program.rows[at][0] in (op.CALL4, op.CALL5) and "Get" in place.call
        slave.fail(place.call, status, end if got else begin)

    def free_states(self) -> None:
        """Free the states that a step left when it failed."""
        for row, place in zip(self.program.rows, self.program.places, strict=True):
            if row[0] == op.RESTORE and ctypes.c_size_t.from_address(row[3]).value:
                self.slaves[place.fmu].free_state_at(row[3])


@cache
def compiled_march() -> Callable[..., int]:
    """The compiled loop, as ctypes calls it: it lets other threads of Python run.

    Returns
    -------
    callable
        takes the addresses that `trihedron.tools.orchestrator.compiled.march` takes
    """
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )
    name = "trihedron_march"
    made_from = [llvm.get_default_triple().encode(), cpu.encode(), features.encode(), name.encode()]
    made_from += [metadata.version(package).encode() for package in ("numba", "llvmlite")]
    made_from += [(Path(__file__).parent / source).read_bytes() for source in ("compiled.py", "program.py", "loops.py")]
    made_from.append(platform.python_version().encode())
    key = hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in made_from)).hexdigest()
    path = cache_folder() / "loops" / f"{key}.o"
    content = b""
    with suppress(OSError):
        content = path.read_bytes()
    digest, code = content[:32], content[32:]
    if hashlib.sha256(code).digest() != digest:
        from .compiled import object_code

        code = object_code(machine, name)
        keep(path, hashlib.sha256(code).digest() + code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    # numba's functions give their value through a pointer, the second is for exceptions, of which there are none.
    function = ctypes.CFUNCTYPE(_INT, *[ctypes.c_void_p] * 7)(engine.get_function_address(name))

    def march(*arguments: int, _engine: Any = engine) -> int:
        result = ctypes.c_int64()
        function(ctypes.addressof(result), None, *arguments)
        return result.value

    return march


def plain_march(
    program: Program, records: np.ndarray, texts: Callable[[], None], state: np.ndarray, clock: np.ndarray
) -> int:
    """Make the steps from state[STEP] to state[LAST_STEP], as `compiled.march` does.

    Parameters
    ----------
    program : Program
    records : (N, 3) int64
        what is recorded: target of row 0, source, bytes
    texts : callable
        keeps the recorded strings
    state, clock : array
        as `trihedron.tools.orchestrator.program` lays them out
    """
    todo = _actions(program, state, clock)
    start, length, every = float(clock[op.START]), float(clock[op.LENGTH]), int(state[op.EVERY])
    row, copies = int(state[op.ROW]), records.tolist()
    with np.errstate(invalid="ignore"):
        for k in range(int(state[op.STEP]), int(state[op.LAST_STEP])):
            status = _run_once(todo, state, k, start + k * length)
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


def _run_once(todo: Sequence[Action], state: np.ndarray, k: int, time: float) -> int:
    """Run the rows of one step; the status of the row that fails, its number in the state."""
    at, end = 0, len(todo)
    while at < end:
        status = todo[at](k, time)
        if status > op.WARNING:
            state[op.STATUS], state[op.AT] = status, at
            return status
        at = at + 1 if status >= 0 else -1 - status
    return 0


def _actions(program: Program, state: np.ndarray, clock: np.ndarray) -> list[Action]:
    """A function for each row of a program; that of REPEAT answers with the row to go back to as -1 - row."""
    made = []
    for at, (row, numbers) in enumerate(zip(program.rows, program.numbers, strict=True)):
        if row[0] in (op.STATE, op.BEGIN, op.RESTORE, op.COMPARE, op.REPEAT):
            made.append(_of_cycle(row, numbers[0], at, state, clock))
        elif row[0] in (op.STEP2, op.STEP3):
            made.append(_stepping(row, float(clock[op.LENGTH])))
        elif row[0] == op.FEED:
            made.append(_feeding(row, state))
        else:
            made.append(_passing(row, *numbers))
    return made


def _passing(row: Row, factor: float, offset: float) -> Action:
    """MOVE, MOVE8, CONVERT, CALL4, CALL5 and FINITE."""
    code = row[0]
    if code in (op.MOVE, op.MOVE8):
        target, source, size = row[1], row[2], 8 if code == op.MOVE8 else row[3]
        return lambda _k, _t: ctypes.memmove(target, source, size) and 0
    if code in (op.CALL4, op.CALL5):
        function, arguments = _PROTOTYPES[code](row[1]), row[2 : 6 if code == op.CALL4 else 7]
        return lambda _k, _t: function(*arguments)
    if code == op.FINITE:
        # 0 * inf and 0 * NaN are NaN: one product tells whether all are finite.
        dot, zeros = np.ctypeslib.as_array((_REAL * row[2]).from_address(row[1])).dot, np.zeros(row[2])
        return lambda _k, _t: 0 if dot(zeros) == 0.0 else op.NOT_FINITE
    to, value = _C_TYPES[row[3]].from_address(row[1]), _C_TYPES[row[4]].from_address(row[2])
    real = row[3] in (0, 1)

    def convert(_k: int, _t: float) -> int:
        to.value = factor * value.value + offset if real else value.value
        return 0

    return convert


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


def _of_cycle(row: Row, tolerance: float, at: int, state: np.ndarray, clock: np.ndarray) -> Action:
    """STATE, BEGIN, RESTORE, COMPARE and REPEAT."""
    code = row[0]

    def begin(_k: int, _t: float) -> int:
        state[op.ITERATION] = 0
        clock[op.CHANGE] = 0.0
        return 0

    def repeat(_k: int, _t: float) -> int:
        if clock[op.CHANGE] <= 1.0:
            return 0
        state[op.ITERATION] += 1
        return op.NOT_SETTLED if state[op.ITERATION] >= row[2] else -1 - row[1]

    if code in (op.BEGIN, op.REPEAT):
        return begin if code == op.BEGIN else repeat
    if code == op.COMPARE:
        value, before = _C_TYPES[row[3]].from_address(row[1]), _REAL.from_address(row[2])

        def compare(_k: int, _t: float) -> int:
            now = float(value.value)
            change = abs(now - before.value) / (tolerance * (1.0 + abs(now)))
            before.value = now
            if not change <= clock[op.CHANGE]:
                clock[op.CHANGE], state[op.CHANGING] = change, at
            return 0

        return compare
    function, instance = _PROTOTYPES[code](row[1]), row[2]
    if code == op.STATE:
        return lambda _k, _t: function(instance, row[3])
    saved = _WORD.from_address(row[3])

    def restore(_k: int, _t: float) -> int:
        clock[op.CHANGE] = 0.0
        return function(instance, saved.value) if state[op.ITERATION] > 0 else 0

    return restore
