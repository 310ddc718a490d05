"""The loop over the steps: FMUs initialised, stepped in order, their outputs passed on and recorded, until all is done.

Inputs that are set before doStep(t, h) hold over (t, t + h]. What an FMU puts out after its step goes at once to
those that step after it (Gauss-Seidel), so an increment over a step is there when its consumer makes the same step.

A program is run by machine code (`machine_code`, kept as an object file, loaded without
numba) or by plain Python: before the first step, where strings are recorded, and where nothing compiles.
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
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np

from ...fmus import version
from ...fmus.cache import kept
from ...models.table_commands import TICK_TOLERANCE
from ..errors import InputError
from . import operations as op
from .fmu import DISCARD, Slave, Slave3
from .interface import VALUE_TYPES
from .load import Loaded
from .operations import loop_of
from .ports import Ports
from .program import Program, step_program
from .recorded import Blocks, Column, Keep
from .scenario import Scenario
from .stimuli import Grid
from .wiring import Group, Pace

CALL_SECONDS = 0.05
"""About so long the compiled loop runs before Python looks at Ctrl-C and shows progress."""
_C_TYPES: dict[int, Any] = {
    t.code: np.ctypeslib.as_ctypes_type(t.dtype) for t in VALUE_TYPES.values() if not t.by_address
}


@dataclass(frozen=True)
class Assembly:
    """What runs together: FMUs in the order in which they step, and what is recorded.

    By its name each is loaded, with what to set before initialisation, and has ports: the memory it reads and writes.
    """

    groups: Sequence[Group]
    scenario: Scenario
    columns: Sequence[Column]
    loaded: Mapping[str, Loaded]
    ports: Mapping[str, Ports]
    grid: Grid

    @property
    def order(self) -> list[str]:
        """The FMUs in the order in which they step."""
        return [name for group in self.groups for name in group.members]


def run_fmus(
    assembly: Assembly,
    keep_rows: Keep,
    *,
    progress: Callable[[int], None] = lambda _: None,
    flush: Callable[[], bool] = lambda: False,
    compiled: bool = True,
) -> str:
    """Run FMUs together from the grid's start to its end; `keep_rows` takes what is recorded, block by block.

    What it gives is who has asked for the end of the run before, as an FMU may; else nothing.

    `progress` is told how many more steps are made, `flush` says whether a block is handed on before it is full. Where
    it is not `compiled`, or strings are recorded, plain Python gives the same results. An InputError for a call that
    does not end with OK or Warning, an output that is not finite, a cycle that does not settle; a KeyboardInterrupt
    after Ctrl-C, once what was recorded is kept and the FMUs are closed.
    """
    with held_interrupt() as pressed, ExitStack() as stack:
        slaves: dict[str, Slave] = {}
        for name in assembly.order:
            entry = assembly.loaded[name]
            slaves[name] = slave = (Slave3 if entry.interface.version == 3 else Slave)(name, entry.fmu)
            stack.callback(slave.close)
        initialise(slaves, assembly)
        grid, program = assembly.grid, step_program(assembly.groups, assembly.scenario.run, slaves, assembly.ports)
        every, ports = assembly.scenario.record.every, {name: assembly.ports[name] for name in assembly.order}
        blocks = Blocks(assembly.columns, ports, grid, every, keep_rows)
        blocks.record()
        loop = _Loop(program, grid, blocks, compiled=compiled)
        made, stretch, ended, goal = 0, 1, "", grid.steps
        try:
            while made < goal and not pressed():
                room = (blocks.rows - blocks.row) * every - made % every
                last = min(goal, made + min(stretch, room))
                began = clocks.perf_counter()
                status = loop.march(last)
                while status and (ended := loop.asks_to_end(status, slaves)):
                    # Nobody is left behind: the others make this step too.
                    blocks.advance(int(loop.state[op.ROW]))
                    goal = int(loop.state[op.STEP])
                    if loop.state[op.NEXT]:
                        pace = loop.pace()
                        goal += pace.stride - pace.back
                    last = min(goal, last)
                    status = loop.march(last)
                elapsed = clocks.perf_counter() - began
                blocks.advance(int(loop.state[op.ROW]))
                if status:
                    loop.refuse(status, slaves)
                stretch = min(2 * stretch, max(1, int(stretch * CALL_SECONDS / max(elapsed, 1e-9))))
                if flush():
                    blocks.flush()
                progress(last - made)
                made = last
        except BaseException:
            # What was recorded until then is not lost.
            blocks.flush()
            raise
        finally:
            # A step that failed has left them.
            for row, place in zip(program.rows, program.places, strict=True):
                if row[0] == op.RESTORE and ctypes.c_size_t.from_address(row[3]).value:
                    slaves[place.fmu].free_state_at(row[3])
        blocks.flush()
        for slave in slaves.values():
            slave.close(None if pressed() else grid.time(made))
        return ended


@contextmanager
def held_interrupt() -> Iterator[Callable[[], bool]]:
    """Hold the first Ctrl-C back until the block looks at it or ends; the second one acts at once.

    An FMU that runs Python in this process would be struck by the exception itself, and report it as its own failure.
    The block is told whether Ctrl-C was pressed: it should then end, and KeyboardInterrupt follows.
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


class _Loop:
    """A program on its way: by machine code or by plain Python."""

    def __init__(self, program: Program, grid: Grid, blocks: Blocks | None = None, *, compiled: bool = False) -> None:
        self.program, self.grid, self.blocks = program, grid, blocks
        self.state = np.zeros(op.CURSORS + program.cursors, dtype=np.int64)
        self.clock = np.array([grid.start, 0.0])
        self.state[op.EVERY] = grid.steps + 1 if blocks is None else blocks.every
        self.state[op.ROWS], self.state[op.AT] = len(program.rows), -1
        records = np.zeros((0, 3), dtype=np.int64) if blocks is None else blocks.records
        self.state[op.RECORDS] = len(records)
        self._tables = [
            np.array(program.rows, dtype=np.int64).ravel(),
            np.array(program.numbers, dtype=np.float64).ravel(),
            records.ravel(),
        ]
        self._lists = [table.tolist() for table in self._tables]
        self._compiled = None
        if compiled and blocks is not None and not blocks.has_text:
            # Where nothing can be compiled plain Python does the same.
            with suppress(ImportError, RuntimeError):
                self._compiled = compiled_march()

    def march(self, last: int) -> int:
        """Make the steps up to the last one; the status of the call that failed, 0 where none has."""
        self.state[op.LAST_STEP], self.state[op.ROW] = last, self.blocks.row if self.blocks else 0
        if self._compiled is not None:
            return self._compiled(*(table.ctypes.data for table in (*self._tables, self.state, self.clock)))
        state, clock, every, status = self.state.tolist(), self.clock.tolist(), int(self.state[op.EVERY]), 0
        # What Python keeps itself, a string, it keeps after each step that is recorded.
        while state[op.STEP] < last and not status:
            state[op.LAST_STEP] = min(last, (state[op.STEP] // every + 1) * every)
            status = _plain_march(*self._lists, state, clock)
            if self.blocks is not None and not status and state[op.STEP] % every == 0:
                self.blocks.keep_texts()
        self.state[:], self.clock[:] = state, clock
        return status

    def pace(self) -> Pace:
        """Of the FMU whose call has failed."""
        return self.program.pace_of(self.program.places[int(self.state[op.AT])].fmu)

    def _span(self) -> tuple[float, float]:
        """When the step of the FMU whose call has failed begins and ends."""
        begin = self.grid.time(int(self.state[op.STEP]) - self.pace().back)
        return begin, begin + self.pace().length

    def asks_to_end(self, status: int, slaves: Mapping[str, Slave]) -> str:
        """Who asks for the end of the run, and when, where this is what the status means; else nothing.

        The loop then goes on behind that FMU's step, if it was made to its end.
        """
        at, (begin, end) = int(self.state[op.AT]), self._span()
        row, place = self.program.rows[at], self.program.places[at]
        reached = None
        if status == op.ENDED:
            early, last = ctypes.c_bool.from_address(row[4] + 2).value, ctypes.c_double.from_address(row[4] + 8).value
            reached = last if early else end
        elif status == DISCARD and row[0] == op.STEP2:
            reached = slaves[place.fmu].ended_at(begin)
        if reached is None:
            return ""
        if abs(reached - end) <= TICK_TOLERANCE * self.grid.step:
            self.state[op.NEXT], reached = at + 1, end
        return f"{slaves[place.fmu]} ended the run at {reached:.9g} s ({place.call} asked for it)"

    def refuse(self, status: int, slaves: Mapping[str, Slave], *, started: bool = True) -> NoReturn:
        """Say which FMU failed, when (before the first step where the run has not started) and why."""
        at = int(self.state[op.AT])
        place, (begin, end) = self.program.places[at], self._span()
        slave = slaves[place.fmu]
        if status == op.NOT_SETTLED and place.group is not None:
            self.refuse_unsettled(place.group, f"in {int(self.state[op.ITERATION])} iterations at {begin:.9g} s")
        if status == op.NOT_FINITE and place.port is not None:
            slave.refuse_not_finite(place.port.variables, place.port.values, end if started else self.grid.start)
        if status == op.EARLY:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s returned before the end of the step")
        got = self.program.rows[at][0] in (op.CALL4, op.CALL5) and "Get" in place.call
        slave.fail(place.call, status, (end if got else begin) if started else None)

    def refuse_unsettled(self, group: Group, when: str) -> NoReturn:
        """Name the value of a cycle that changes most."""
        value = self.program.places[int(self.state[op.CHANGING])]
        assert value.variable is not None
        raise InputError(
            f"the cycle {group} does not settle {when}: '{value.fmu}.{value.variable.name}' still changes by "
            f"{float(self.clock[op.CHANGE]):.3g} times the tolerance"
        )


def initialise(slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Bring all FMUs through initialisation; outputs are passed on in it and after it."""
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
    program = Program(slaves, assembly.ports)
    program.add_transfers(name, sources)
    program.add_sets(name, constants=True)
    program.add_gets(name)
    loop = _Loop(program, assembly.grid)
    status = loop.march(1)
    for port in assembly.ports[name].outputs.values():
        port.shown[:] = port.values
    if status:
        loop.refuse(status, slaves, started=False)


def _settle(group: Group, slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Pass the first outputs of a cycle around: once, or until they no longer change."""
    if not group.cyclic:
        return
    compare = Program(slaves, assembly.ports)
    compare.add_comparisons(group, assembly.scenario.run)
    loop = _Loop(compare, assembly.grid)
    loop.march(1)
    for _ in range(assembly.scenario.run.most_iterations):
        for name in group.members:
            _exchange(name, slaves, assembly, assembly.order)
        loop.clock[op.CHANGE], loop.state[op.STEP] = 0.0, 0
        loop.march(1)
        if assembly.scenario.run.coupling != "iterate" or loop.clock[op.CHANGE] <= 1.0:
            return
    loop.refuse_unsettled(group, f"in {assembly.scenario.run.most_iterations} iterations before the first step")


@cache
def compiled_march() -> Callable[..., int]:
    """The compiled loop, of addresses, as ctypes calls it: it lets other threads of Python run."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )
    name = "trihedron_march"
    made_from = [llvm.get_default_triple().encode(), cpu.encode(), features.encode(), name.encode()]
    made_from += [version(package).encode() for package in ("numba", "llvmlite")]
    sources = ("../compiled.py", "machine_code.py", "operations.py", "loops.py")
    made_from += [(Path(__file__).parent / source).read_bytes() for source in sources]
    made_from.append(platform.python_version().encode())
    key = hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in made_from)).hexdigest()

    def make() -> bytes:
        from .machine_code import object_code

        return object_code(loop_of, machine, name)

    code = kept("loops", f"{key}.o", make)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    # numba's functions give their value through a pointer, the second is for exceptions, of which there are none.
    function = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 7)(engine.get_function_address(name))

    def march(*arguments: int, _engine: Any = engine) -> int:
        result = ctypes.c_int64()
        function(ctypes.addressof(result), None, *arguments)
        return result.value

    return march


def _called(*types: Any) -> Callable[..., int]:
    """A call of int f(types) at an address; plain integers are what ctypes passes fastest."""
    prototype = cache(ctypes.CFUNCTYPE(ctypes.c_int, *types))
    return lambda function, *arguments: prototype(function)(*arguments)


def _loaded(kind: Any) -> Callable[[int], Any]:
    """What reads a number at an address."""
    return lambda at: kind.from_address(at).value


def _stored(kind: Any) -> Callable[[int, Any], None]:
    """What writes a number to an address."""

    def store(at: int, value: Any) -> None:
        kind.from_address(at).value = value

    return store


class _Plain:
    """The primitives of the loop in plain Python."""

    copy = ctypes.memmove
    call2, call4, call5 = (_called(*[ctypes.c_size_t] * words) for words in (2, 4, 5))
    step2 = _called(ctypes.c_size_t, ctypes.c_double, ctypes.c_double, ctypes.c_int)
    step3 = _called(ctypes.c_size_t, ctypes.c_double, ctypes.c_double, ctypes.c_bool, *[ctypes.c_size_t] * 4)

    load_byte, load_word, load_real = map(_loaded, (ctypes.c_uint8, ctypes.c_int64, ctypes.c_double))
    store_word, store_real = map(_stored, (ctypes.c_int64, ctypes.c_double))

    @staticmethod
    def real_of(code: int, at: int) -> float:
        return float(_C_TYPES[code].from_address(at).value)

    @staticmethod
    def convert(to_code: int, to: int, at: int, code: int, factor: float, offset: float) -> None:
        value = _C_TYPES[code].from_address(at).value
        _C_TYPES[to_code].from_address(to).value = factor * value + offset if to_code < 2 else value


_plain_march = loop_of(_Plain)
