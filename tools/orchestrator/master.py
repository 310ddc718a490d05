"""The master: initialises the FMUs, steps them in order, passes their outputs on, keeps what is recorded.

Inputs that are set before doStep(t, h) hold over (t, t + h]. What an FMU puts out after its step goes at once to
those that step after it (Gauss-Seidel), so an increment over a step is there when its consumer makes the same step.
"""

import ctypes
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from trihedron.errors import InputError
from trihedron.orchestrator.archive import UnpackedFmu
from trihedron.orchestrator.bus import FmuBus, Port
from trihedron.orchestrator.grid import Grid
from trihedron.orchestrator.interface import Value, Variable
from trihedron.orchestrator.interrupts import held_interrupt
from trihedron.orchestrator.slave import WARNING, Slave

Recorded = dict[tuple[str, str], Any]
Ticker = Callable[[range], Iterable[int]]


def run_fmus(
    order: Sequence[str],
    fmus: Mapping[str, UnpackedFmu],
    parameters: Mapping[str, Iterable[tuple[Variable, Value]]],
    buses: Mapping[str, FmuBus],
    grid: Grid,
    every: int,
    ticks: Ticker = iter,
) -> Recorded:
    """Run FMUs together from the grid's start to its end.

    Parameters
    ----------
    order : sequence of str
        the FMUs in the order in which they step
    fmus, parameters, buses : mapping
        by the FMU's name: what to instantiate, what to set before initialisation, its buffers
    grid : Grid
    every : int
        record every n-th communication point, the first one included
    ticks : callable
        wraps the range of ticks, for a progress bar

    Returns
    -------
    dict
        (FMU, variable) -> values at the recorded communication points

    Raises
    ------
    InputError
        a call that does not end with OK or Warning, or an output that is not finite
    KeyboardInterrupt
        Ctrl-C, once the FMUs are closed
    """
    rows = grid.steps // every + 1
    with held_interrupt() as interrupt, ExitStack() as stack:
        slaves: dict[str, Slave] = {}
        for name in order:
            slaves[name] = slave = Slave(name, fmus[name])
            stack.callback(slave.close)
        lines = {name: _Line(slaves[name], buses[name], grid, rows) for name in order}
        _initialise(order, slaves, parameters, lines, grid)
        steppers = [lines[name].stepper() for name in order]
        recorders = [lines[name].record for name in order if any(buses[name].recorded.values())]
        for record in recorders:
            record(0)
        start, step = grid.start, grid.step
        with np.errstate(invalid="ignore"):
            for k in ticks(range(grid.steps)):
                if interrupt:
                    break
                time = start + k * step
                for advance in steppers:
                    advance(k, time)
                if (k + 1) % every == 0:
                    row = (k + 1) // every
                    for record in recorders:
                        record(row)
        for slave in slaves.values():
            slave.close(finished=not interrupt)
        return {key: values for name in order for key, values in lines[name].recorded().items()}


def _initialise(
    order: Sequence[str],
    slaves: Mapping[str, Slave],
    parameters: Mapping[str, Iterable[tuple[Variable, Value]]],
    lines: Mapping[str, "_Line"],
    grid: Grid,
) -> None:
    """Bring all FMUs through initialisation; outputs are passed on in it and after it."""
    stop = grid.time(grid.steps)
    for name in order:
        slaves[name].set_values(parameters[name])
        slaves[name].call("fmi2SetupExperiment", 0, 0.0, grid.start, 1, stop)
    for name in order:
        slaves[name].call("fmi2EnterInitializationMode")
        lines[name].exchange()
    for name in order:
        slaves[name].call("fmi2ExitInitializationMode")
    for name in order:
        lines[name].exchange()


class _Line:
    """One FMU in the loop: its buffers with its C functions, and its rows of the record."""

    def __init__(self, slave: Slave, bus: FmuBus, grid: Grid, rows: int) -> None:
        self.slave, self.bus, self.grid = slave, bus, grid
        self._sets = [(self._bound("Set", port), port.changing, len(port.variables)) for port in bus.inputs.values()]
        self._gets = [self._bound("Get", port) for port in bus.outputs.values()]
        self._text: dict[str, list[str]] = {v.name: [] for v in self._recorded_strings()}
        self._rows = {
            access: np.zeros((rows, count), dtype=bus.outputs[access].values.dtype)
            for access, count in bus.recorded.items()
            if count and access != "String"
        }
        self._kept = [
            (kept.ctypes.data, bus.outputs[access].address, kept.shape[1] * kept.itemsize)
            for access, kept in self._rows.items()
        ]

    def _bound(self, verb: str, port: Port) -> tuple[Any, int, int, int, str]:
        name = f"fmi2{verb}{port.access}"
        references = ctypes.addressof(port.references)
        return self.slave.function(name), references, len(port.variables), port.address, name

    def _recorded_strings(self) -> tuple[Variable, ...]:
        count = self.bus.recorded.get("String", 0)
        return self.bus.outputs["String"].variables[:count] if count else ()

    def exchange(self) -> None:
        """Set every input (row of the first step) and get every output, before the first step."""
        for rows, base, width, target in self.bus.feeds:
            ctypes.memmove(target, base + rows[0] * width, width)
        for target, source, size in self.bus.moves:
            ctypes.memmove(target, source, size)
        for (function, references, count, address, name), _, _ in self._sets:
            status = function(self.slave.component, references, count, address)
            if status > WARNING:
                self.slave.fail(name, status, None)
        for function, references, count, address, name in self._gets:
            status = function(self.slave.component, references, count, address)
            if status > WARNING:
                self.slave.fail(name, status, None)
        self._refuse_not_finite(self.grid.start)

    def _refuse_not_finite(self, time: float) -> None:
        port = self.bus.outputs.get("Real")
        if port is None:
            return
        for variable, value in zip(port.variables, port.values.tolist(), strict=True):
            if not math.isfinite(value):
                raise InputError(f"{self.slave}: {variable.name} is {value} at {time:.9g} s")

    def stepper(self) -> Callable[[int, float], None]:
        """A function (k, t_k) that makes one step: inputs in, doStep, outputs out."""
        slave, component, step = self.slave, self.slave.component, self.grid.step
        feeds, moves, gets = self.bus.feeds, self.bus.moves, self._gets
        sets = [(f, references, n, address, name) for (f, references, _, address, name), n, _ in self._sets if n]
        do_step, memmove = slave.function("fmi2DoStep"), ctypes.memmove
        real = self.bus.outputs.get("Real")
        values = np.zeros(0) if real is None else real.values
        # 0 * inf and 0 * NaN are NaN: one product tells whether all outputs are finite.
        dot, zeros = values.dot, np.zeros(len(values))

        def advance(k: int, time: float) -> None:
            for rows, base, width, target in feeds:
                memmove(target, base + rows[k] * width, width)
            for target, source, size in moves:
                memmove(target, source, size)
            for function, references, count, address, name in sets:
                status = function(component, references, count, address)
                if status > WARNING:
                    slave.fail(name, status, time)
            status = do_step(component, time, step, 1)
            if status > WARNING:
                slave.fail("fmi2DoStep", status, time)
            for function, references, count, address, name in gets:
                status = function(component, references, count, address)
                if status > WARNING:
                    slave.fail(name, status, time + step)
            if dot(zeros) != 0.0:
                self._refuse_not_finite(self.grid.time(k + 1))

        return advance

    def record(self, row: int) -> None:
        """Keep the recorded outputs as a row."""
        for target, source, size in self._kept:
            ctypes.memmove(target + row * size, source, size)
        for index, texts in enumerate(self._text.values()):
            address = int(self.bus.outputs["String"].values[index])
            texts.append(ctypes.string_at(address).decode("utf-8", "replace") if address else "")

    def recorded(self) -> Recorded:
        """All rows, by FMU and variable."""
        name = self.slave.name
        found: Recorded = {(name, variable): texts for variable, texts in self._text.items()}
        for access, kept in self._rows.items():
            for index, variable in enumerate(self.bus.outputs[access].variables[: kept.shape[1]]):
                found[name, variable.name] = kept[:, index]
        return found
