"""The master: initialises the FMUs, steps them in order, passes their outputs on, keeps what is recorded.

Inputs that are set before doStep(t, h) hold over (t, t + h]. What an FMU puts out after its step goes at once to
those that step after it (Gauss-Seidel), so an increment over a step is there when its consumer makes the same step.
"""

import ctypes
import time as clocks
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from typing import NoReturn

import numpy as np

from ..errors import InputError
from . import operations as op
from .blocks import Blocks, Keep
from .ensemble import Ensemble
from .grid import Grid
from .initialisation import initialise
from .interrupts import Interrupt, held_interrupt
from .plain_loop import plain_march
from .program import Program, step_program
from .slave import Slave
from .slave_3 import Slave3

Progress = Callable[[int], None]
"""Told how many steps are made."""

CALL_SECONDS = 0.05
"""About so long the compiled loop runs before Python looks at Ctrl-C and shows progress."""


def run_fmus(
    ensemble: Ensemble,
    grid: Grid,
    every: int,
    keep: Keep,
    *,
    progress: Progress = lambda _: None,
    flush: Callable[[], bool] = lambda: False,
    compiled: bool = True,
) -> None:
    """Run FMUs together from the grid's start to its end.

    Parameters
    ----------
    ensemble : Ensemble
    grid : Grid
    every : int
        record every n-th communication point, the first one included
    keep : callable
        takes the recorded values block by block: (ticks, (FMU, variable) -> values)
    progress : callable
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
    with held_interrupt() as interrupt, ExitStack() as stack:
        slaves: dict[str, Slave] = {}
        for name in ensemble.order:
            fmu = ensemble.fmus[name]
            kind = Slave3 if ensemble.interfaces[name].version == 3 else Slave
            slaves[name] = slave = kind(name, fmu)
            stack.callback(slave.close)
        initialise(slaves, ensemble, grid)
        blocks = Blocks(ensemble.order, ensemble.buses, grid, every, keep)
        blocks.record()
        program = step_program(ensemble.groups, slaves, ensemble.buses, ensemble.coupling)
        loop = _Loop(program, slaves, grid, every, blocks, compiled=compiled)
        try:
            loop.run(interrupt, progress, flush)
        finally:
            loop.free_states()
        blocks.flush()
        for slave in slaves.values():
            slave.close(finished=not interrupt)


class _Loop:
    """The steps, a stretch at a time."""

    def __init__(
        self, program: Program, slaves: Mapping[str, Slave], grid: Grid, every: int, blocks: Blocks, *, compiled: bool
    ) -> None:
        self.program, self.slaves, self.grid, self.blocks = program, slaves, grid, blocks
        self.operations = np.array(program.rows, dtype=np.int64).reshape(-1, op.WIDTH)
        self.numbers = np.array(program.numbers, dtype=np.float64).reshape(-1, 2)
        self.state = np.zeros(op.CURSORS + program.cursors, dtype=np.int64)
        self.clock = np.array([grid.start, grid.step, 0.0])
        self.state[op.EVERY], self.state[op.ROWS], self.state[op.AT] = every, len(program.rows), -1
        self.state[op.RECORDS] = len(blocks.records)
        self._march = self._plain
        if compiled and not blocks.has_text:
            # Where nothing can be compiled the plain loop does the same.
            with suppress(ImportError, RuntimeError):
                self._march = self._compiled()

    def _compiled(self) -> Callable[[], int]:
        from .machine_code import compiled_march

        march = compiled_march()
        tables = (self.operations, self.numbers, self.blocks.records, self.state, self.clock)
        addresses = [table.ctypes.data for table in tables]
        return lambda: march(*addresses)

    def _plain(self) -> int:
        return plain_march(self.program, self.blocks.records, self.blocks.keep_texts, self.state, self.clock)

    def run(self, interrupt: Interrupt, progress: Progress, flush: Callable[[], bool]) -> None:
        """All steps, until one fails or Ctrl-C is pressed; what was recorded is in the blocks."""
        made, stretch, every = 0, 1, int(self.state[op.EVERY])
        while made < self.grid.steps and not interrupt:
            room = (self.blocks.rows - self.blocks.row) * every - made % every
            last = min(self.grid.steps, made + min(stretch, room))
            self.state[op.LAST_STEP], self.state[op.ROW] = last, self.blocks.row
            began = clocks.perf_counter()
            status = self._march()
            elapsed = clocks.perf_counter() - began
            self.blocks.advance(int(self.state[op.ROW]))
            if status:
                self._refuse()
            made = last
            stretch = min(2 * stretch, max(1, int(stretch * CALL_SECONDS / max(elapsed, 1e-9))))
            if flush():
                self.blocks.flush()
            progress(made)

    def _refuse(self) -> NoReturn:
        """Say which FMU failed, when and why."""
        at, status = int(self.state[op.AT]), int(self.state[op.STATUS])
        place, code = self.program.places[at], self.program.rows[at][0]
        k = int(self.state[op.STEP])
        begin, end = self.grid.time(k), self.grid.time(k) + self.grid.step
        if status == op.NOT_SETTLED and place.group is not None:
            value = self.program.places[int(self.state[op.CHANGING])]
            assert value.variable is not None
            changes = float(self.clock[op.CHANGE])
            raise InputError(
                f"the cycle {place.group} does not settle in {int(self.state[op.ITERATION])} iterations at "
                f"{begin:.9g} s: '{value.fmu}.{value.variable.name}' still changes by {changes:.3g} times the tolerance"
            )
        slave = self.slaves[place.fmu]
        if status == op.NOT_FINITE:
            assert place.port is not None
            slave.refuse_not_finite(place.port.variables, place.port.values, self.grid.time(k + 1))
        if status == op.ENDED:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s asks for the end of the simulation")
        if status == op.EARLY:
            raise InputError(f"{slave}: {place.call} at {begin:.9g} s returned before the end of the step")
        got = code in (op.CALL4, op.CALL5) and "Get" in place.call
        slave.fail(place.call, status, end if got else begin)

    def free_states(self) -> None:
        """Free the states that a step left when it failed."""
        for row, place in zip(self.program.rows, self.program.places, strict=True):
            if row[0] == op.RESTORE:
                state = ctypes.c_size_t.from_address(row[3])
                if state.value:
                    self.slaves[place.fmu].free_state_at(row[3])
