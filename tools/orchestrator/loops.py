"""The loop over the steps: initialise FMUs, step them in order, pass their outputs on and record them.

Inputs that are set before doStep(t, h) hold over (t, t + h]. The outputs of an FMU go at once to the FMUs that step
after it (Gauss-Seidel), so its consumer gets an increment within the same step.

Machine code runs a program (kept as an object file, loaded without numba). Plain Python runs it before the first step,
if strings are recorded, and if no compiler works.
"""

import ctypes
import math
import signal
import threading
import time
import time as clocks
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from types import FrameType
from typing import NoReturn

import numpy as np

from ...models.table_commands import TICK_TOLERANCE
from ..errors import InputError
from . import operations as op
from .fmu import SLAVES, Slave
from .guest_process import DISCARD
from .load import Loaded
from .operations import compiled_march, plain_march
from .program import Ports, Program, order_of, step_program
from .recorded import Blocks, Keep, RecordColumn
from .scenario import Scenario
from .stimuli import StepGrid
from .wiring import Pace, StepGroup

LONGEST_SLEEP = 0.05
"""Time after which a sleeping run looks for Ctrl-C [s]."""
SPIN = 2e-4
"""Last part of a wait, in which the run does not sleep [s]: a sleep ends late."""


class Pacer:
    """The clock of a run whose steps are `step` long [s], `factor` times as fast as real time.

    A step begins when it is due. Its delay is how much later it begins; jitter is the standard deviation of the delays.
    An overrun is a step that ends after the next one is due.
    """

    def __init__(self, step: float, factor: float) -> None:
        self._period, self._factor = step / factor, factor
        self._began = time.perf_counter()
        self._count = self._overruns = 0
        self._sum = self._squares = self._largest = 0.0

    def wait(self, step: int, pressed: Callable[[], bool]) -> None:
        """Wait until a step is due, or until Ctrl-C."""
        due = self._began + step * self._period
        remaining = due - time.perf_counter()
        if step and remaining < 0.0:
            self._overruns += 1
        while remaining > 0.0 and not pressed():
            if remaining > SPIN:
                time.sleep(min(remaining - SPIN, LONGEST_SLEEP))
            remaining = due - time.perf_counter()
        delay = max(-remaining, 0.0)
        self._count += 1
        self._sum += delay
        self._squares += delay * delay
        self._largest = max(self._largest, delay)

    def summary(self) -> str:
        """Return the delays, the jitter and the overruns as a sentence."""
        count = max(self._count, 1)
        mean = self._sum / count
        jitter = math.sqrt(max(self._squares / count - mean * mean, 0.0))
        times = [f"{1e3 * seconds:.3g} ms" for seconds in (mean, jitter, self._largest)]
        counted = f"{self._count} steps of {1e3 * self._period:.6g} ms"
        late = f"delay {times[0]} on average, jitter {times[1]}, largest delay {times[2]}"
        return f"real time times {self._factor:g}: {counted}, {late}, {self._overruns} overruns"


CALL_SECONDS = 0.05
"""Approximate time for which the compiled loop runs before Python checks for Ctrl-C and shows progress [s]."""


@dataclass(frozen=True)
class Assembly:
    """The parts of a run: FMUs in stepping order, and the recorded variables.

    For each name: the loaded FMU, the values to set before initialisation, and its ports (the memory it reads and
    writes). `notes` are sentences for the user about the run.
    """

    groups: Sequence[StepGroup]
    scenario: Scenario
    columns: Sequence[RecordColumn]
    loaded: Mapping[str, Loaded]
    ports: Mapping[str, Ports]
    grid: StepGrid
    notes: list[str] = field(default_factory=list)

    @property
    def order(self) -> list[str]:
        """FMU names in stepping order."""
        return order_of(self.groups)


def run_fmus(
    assembly: Assembly,
    keep_rows: Keep,
    *,
    progress: Callable[[int], None] = lambda _: None,
    flush: Callable[[], bool] = lambda: False,
    compiled: bool = True,
) -> str:
    """Run FMUs together from the grid's start to its end; `keep_rows` receives the recorded rows, block by block.

    Returns the FMU that asked for an earlier end of the run, with the time; otherwise an empty string.

    `progress` receives the number of further steps; `flush` returns True to hand a block on before it is full. Plain
    Python gives the same results if `compiled` is False or strings are recorded. Raises InputError for a call that ends
    with neither OK nor Warning, for an output that is not finite, and for a cycle that does not settle. Raises
    KeyboardInterrupt after Ctrl-C, once the recorded rows are kept and the FMUs are closed.
    """
    with held_interrupt() as pressed, ExitStack() as stack:
        slaves: dict[str, Slave] = {}
        for name in assembly.order:
            entry = assembly.loaded[name]
            slaves[name] = SLAVES[entry.interface.version](name, entry.fmu)
            stack.callback(slaves[name].close)
        initialise_fmus(slaves, assembly)
        for name, slave in slaves.items():
            for table in assembly.ports[name].tables:
                slave.interpolate(*table)
        program = step_program(assembly.groups, assembly.scenario.run, slaves, assembly.ports)
        ports = {name: assembly.ports[name] for name in assembly.order}
        blocks = Blocks(assembly.columns, ports, assembly.grid, assembly.scenario.record.every, keep_rows)
        blocks.record()
        loop = _Loop(program, slaves, assembly.grid, blocks, compiled=compiled)
        stretch, factor = 1, assembly.scenario.run.realtime
        pacer = None
        if factor is not None:
            pacer = Pacer(assembly.grid.step, factor)
        try:
            while loop.step < loop.goal and not pressed():
                if pacer is not None:
                    pacer.wait(loop.step, pressed)
                    stretch = 1
                first, began = loop.step, clocks.perf_counter()
                loop.go_on(min(stretch, blocks.room(first)))
                elapsed = clocks.perf_counter() - began
                stretch = min(2 * stretch, max(1, int(stretch * CALL_SECONDS / max(elapsed, 1e-9))))
                if flush():
                    blocks.flush()
                progress(loop.step - first)
        except BaseException:
            # Keep the rows that were recorded so far.
            blocks.flush()
            raise
        finally:
            loop.free_states()
        blocks.flush()
        if pacer is not None:
            assembly.notes.append(pacer.summary())
        for slave in slaves.values():
            slave.close(None if pressed() else assembly.grid.time(loop.step))
        return loop.ended


@contextmanager
def held_interrupt() -> Iterator[Callable[[], bool]]:
    """Hold the first Ctrl-C back until the block checks for it or ends; the second one acts at once.

    Otherwise the exception would strike an FMU that runs Python in this process, which would report it as its own
    failure. The block can ask whether Ctrl-C was pressed. It should then end, and KeyboardInterrupt follows.
    """
    pressed = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        # Only the main thread may have handlers, and a host program may handle Ctrl-C itself.
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
    """A running program, in machine code or plain Python, up to the step `goal`.

    `ended` names the FMU that asked for the end of the run.
    """

    def __init__(
        self,
        program: Program,
        slaves: Mapping[str, Slave],
        grid: StepGrid,
        blocks: Blocks | None = None,
        *,
        compiled: bool = False,
    ) -> None:
        self.program, self.slaves, self.grid, self.blocks = program, slaves, grid, blocks
        self.goal, self.ended = grid.steps, ""
        self.state = np.zeros(op.CURSORS + program.cursors, dtype=np.int64)
        self.clock = np.array([grid.start, 0.0, grid.stop])
        self.state[op.ROWS], self.state[op.AT] = len(program), -1
        self.state[op.EVERY] = grid.steps + 1
        records = np.zeros((0, 3), dtype=np.int64)
        if blocks is not None:
            self.state[op.EVERY], records = blocks.every, blocks.records
        self.state[op.RECORDS] = len(records)
        rows, numbers = program.tables()
        self._tables = [rows, numbers, records.ravel()]
        self._lists = [table.tolist() for table in self._tables]
        self._addresses = [table.ctypes.data for table in self._tables]
        self._addresses += [self.state.ctypes.data, self.clock.ctypes.data]
        self._compiled = None
        if compiled and blocks is not None and not blocks.has_text:
            # Plain Python does the same if no compiler works.
            with suppress(ImportError, RuntimeError):
                self._compiled = compiled_march()

    @property
    def step(self) -> int:
        """Index of the next step."""
        return int(self.state[op.STEP])

    def march(self, last: int) -> int:
        """Run the steps up to the last one; return the status of the call that failed, 0 if none has."""
        self.state[op.LAST_STEP] = last
        self.state[op.ROW] = self.blocks.row if self.blocks else 0
        if self._compiled is not None:
            return self._compiled(*self._addresses)
        state, clock, every, status = self.state.tolist(), self.clock.tolist(), int(self.state[op.EVERY]), 0
        # Python keeps strings itself, after each recorded step.
        while state[op.STEP] < last and not status:
            state[op.LAST_STEP] = min(last, (state[op.STEP] // every + 1) * every)
            status = plain_march(*self._lists, state, clock)
            if self.blocks is not None and not status and state[op.STEP] % every == 0:
                self.blocks.keep_texts()
        self.state[:], self.clock[:] = state, clock
        return status

    def go_on(self, count: int) -> None:
        """Run at most this many steps, none after the step in which an FMU asks for the end of the run."""
        assert self.blocks is not None
        last = min(self.goal, self.step + count)
        status = self.march(last)
        while status and self._asks_to_end(status):
            # All other FMUs make this step too.
            self.blocks.advance(int(self.state[op.ROW]))
            self.goal = self.step
            if self.state[op.NEXT]:
                self.goal += self._pace.stride - self._pace.back
            last = min(self.goal, last)
            status = self.march(last)
        self.blocks.advance(int(self.state[op.ROW]))
        if status:
            self.refuse(status)

    @property
    def _pace(self) -> Pace:
        """Pace of the FMU whose call failed."""
        return self.program.pace_of(self.program.places[int(self.state[op.AT])].fmu)

    def _span(self) -> tuple[float, float]:
        """Begin and end of the step of the FMU whose call failed."""
        begin = self.grid.time(self.step - self._pace.back)
        return begin, min(begin + self._pace.length, self.grid.stop)

    def _asks_to_end(self, status: int) -> bool:
        """Return True if the status means that an FMU asks for the end of the run; set `ended`.

        The loop then continues behind that FMU's step, if the step was completed.
        """
        at, (begin, end) = int(self.state[op.AT]), self._span()
        operation, place = self.program.operations[at], self.program.places[at]
        slave = self.slaves[place.fmu]
        reached = None
        if status == op.ENDED:
            returns = operation.words[3]
            reached = end
            if ctypes.c_bool.from_address(returns + 2).value:
                reached = ctypes.c_double.from_address(returns + 8).value
        elif status == DISCARD and operation.code == op.STEP2:
            reached = slave.ended_at(begin)
        if reached is None:
            return False
        if abs(reached - end) <= TICK_TOLERANCE * self.grid.step:
            self.state[op.NEXT], reached = at + 1, end
        self.ended = f"{slave} ended the run at {reached:.9g} s ({place.call} asked for it)"
        return True

    def refuse(self, status: int, *, started: bool = True) -> NoReturn:
        """Refuse the run: name the FMU that failed, the time (or "before the first step") and the reason."""
        at = int(self.state[op.AT])
        place, (begin, end) = self.program.places[at], self._span()
        slave = self.slaves[place.fmu]
        if status == op.NOT_SETTLED and place.group is not None:
            self.refuse_unsettled(place.group, f"in {int(self.state[op.ITERATION])} iterations at {begin:.9g} s")
        if status == op.NOT_FINITE and place.port is not None:
            slave.refuse_not_finite(place.port.variables, place.port.values, end if started else self.grid.start)
        if status == op.EARLY:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s returned before the end of the step")
        if not started:
            slave.fail(place.call, status, None)
        if self.program.operations[at].code in (op.CALL4, op.CALL5) and "Get" in place.call:
            slave.fail(place.call, status, end)
        slave.fail(place.call, status, begin)

    def refuse_unsettled(self, group: StepGroup, when: str) -> NoReturn:
        """Refuse the run: name the value of a cycle that changes most."""
        place = self.program.places[int(self.state[op.CHANGING])]
        assert place.variable is not None
        raise InputError(
            f"the cycle {group} does not settle {when}: '{place.fmu}.{place.variable.name}' still changes by "
            f"{float(self.clock[op.CHANGE]):.3g} times the tolerance"
        )

    def free_states(self) -> None:
        """Free the states of a failed step."""
        for operation, place in zip(self.program.operations, self.program.places, strict=True):
            if operation.code == op.RESTORE and ctypes.c_size_t.from_address(operation.words[2]).value:
                self.slaves[place.fmu].free_state_at(operation.words[2])


def initialise_fmus(slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Initialise all FMUs; pass outputs on during and after initialisation."""
    grid, order = assembly.grid, assembly.order
    for name in order:
        slaves[name].set_values(assembly.loaded[name].values.values(), assembly.loaded[name].interface)
    # Within a cycle no FMU has the outputs of later ones yet: inputs keep their start values.
    entered: list[str] = []
    for group in assembly.groups:
        for name in group.members:
            slaves[name].begin(grid.start, grid.end, assembly.loaded[name].fmu.tolerance)
            _set_late(slaves[name], assembly.loaded[name])
            _exchange(name, slaves, assembly, entered)
            entered.append(name)
        _settle(group, slaves, assembly)
    for name in order:
        slaves[name].call(f"{slaves[name].prefix}ExitInitializationMode")
    for name in order:
        _check_held(slaves[name], assembly)
    for group in assembly.groups:
        for name in group.members:
            _exchange(name, slaves, assembly, order)
        _settle(group, slaves, assembly)


def _set_late(slave: Slave, entry: Loaded) -> None:
    """Set the values again in initialisation mode that the FMU has not taken before it."""
    given = [(variable, value) for variable, value in entry.values.values() if variable.is_settable]
    late = slave.not_held(given)
    if late:
        references = {variable.reference for variable, _, _ in late}
        again = [(variable, value) for variable, value in given if variable.reference in references]
        slave.set_values(again, entry.interface)


def _check_held(slave: Slave, assembly: Assembly) -> None:
    """Read every given parameter back; refuse the run if one has another value, unless the user accepts it."""
    parameters = []
    is_resized = False
    for variable, value in assembly.loaded[slave.name].values.values():
        is_resized = is_resized or variable.causality == "structuralParameter"
        if variable.causality != "input" and variable.initial != "approx":
            parameters.append((variable, value))
    lost = []
    unread = []
    for variable, value, held in slave.not_held(parameters):
        # The Reference FMU with arrays of other lengths returns them in another order.
        if held is None or (is_resized and variable.size > 1):
            unread.append(variable.name)
        else:
            lost.append(f"{variable.name} is {held!r} after {value!r} was set")
    if unread:
        assembly.notes.append(f"{slave}: cannot be read back: {_few(unread)}")
    if lost:
        message = f"{slave}: {len(lost)} of {len(parameters)} given values are not held: {_few(lost)}"
        if not assembly.scenario.run.accept_lost:
            raise InputError(f"{message}; to run all the same: --accept-lost")
        assembly.notes.append(message)


def _few(texts: Sequence[str]) -> str:
    """Return the first texts as a list."""
    shown = list(texts[:3])
    if len(texts) > 3:
        shown.append("...")
    return ", ".join(shown)


def _exchange(name: str, slaves: Mapping[str, Slave], assembly: Assembly, sources: Collection[str]) -> None:
    """Set every input of an FMU (stimuli of the first step) and get every output."""
    for feed in assembly.ports[name].feeds:
        _, _, rows, width, target = feed.words
        ctypes.memmove(target, rows, width)
    program = Program(slaves, assembly.ports, allow_nan=bool(assembly.scenario.run.allow_nan))
    program.add_transfers(name, sources)
    program.add_sets(name, constants=True)
    program.add_gets(name)
    loop = _Loop(program, slaves, assembly.grid)
    status = loop.march(1)
    for port in assembly.ports[name].outputs.values():
        port.shown[:] = port.values
    if status:
        loop.refuse(status, started=False)


def _settle(group: StepGroup, slaves: Mapping[str, Slave], assembly: Assembly) -> None:
    """Pass the first outputs of a cycle around: once, or until they no longer change."""
    if not group.cyclic:
        return
    run = assembly.scenario.run
    compare = Program(slaves, assembly.ports)
    compare.add_comparisons(group, run)
    loop = _Loop(compare, slaves, assembly.grid)
    loop.march(1)
    for _ in range(run.most_iterations):
        for name in group.members:
            _exchange(name, slaves, assembly, assembly.order)
        loop.clock[op.CHANGE], loop.state[op.STEP] = 0.0, 0
        loop.march(1)
        if run.coupling != "iterate" or loop.clock[op.CHANGE] <= 1.0:
            return
    loop.refuse_unsettled(group, f"in {run.most_iterations} iterations before the first step")
