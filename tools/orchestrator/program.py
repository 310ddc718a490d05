"""The operations of a step, of FMUs that run, in the order in which they are made."""

import ctypes
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from .fmu import Slave
from .interface import Variable
from .operations import (
    BEGIN,
    BLEND,
    CALL4,
    CALL5,
    COMPARE,
    FEED,
    FINITE,
    MOVE,
    MOVE8,
    REPEAT,
    RESTORE,
    SKIP,
    SLOPE,
    STATE,
    STEP2,
    STEP3,
    WIDTH,
)
from .ports import Port, Ports
from .scenario import RunSetting
from .wiring import Group, Pace


@dataclass(frozen=True)
class Place:
    """Whose operation a row is: the FMU, the function that it calls, the port or the value that it looks at."""

    fmu: str
    call: str = ""
    port: Port | None = None
    variable: Variable | None = None
    group: Group | None = None


class Program:
    """Operations on running FMUs and what goes into and out of each, with what a message needs of each operation.

    `rows` and `numbers` are as the table of operations says; `cursors` is the number of feeds.
    """

    def __init__(self, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]) -> None:
        self._slaves, self._ports = slaves, ports
        self.rows: list[tuple[int, ...]] = []
        self.numbers: list[tuple[float, float]] = []
        self.places: list[Place] = []
        self._kept: list[np.ndarray] = []
        self._held: list[Any] = []
        self.cursors = 0

    def pace_of(self, name: str) -> Pace:
        """How an FMU steps."""
        return self._ports[name].pace

    def _add(self, place: Place, *row: int, numbers: tuple[float, float] = (0.0, 0.0)) -> None:
        self.rows.append((*row, *(0,) * (WIDTH - len(row))))
        self.numbers.append(numbers)
        self.places.append(place)

    def _add_call(self, name: str, code: int, function: str, *more: int, port: Port | None = None) -> None:
        slave = self._slaves[name]
        self._add(Place(name, function, port), code, slave.address(function), slave.component, *more)

    def _reserve(self, words: int) -> int:
        """Address of so many words of memory, zero."""
        self._kept.append(np.zeros(words, dtype=np.int64))
        return self._kept[-1].ctypes.data

    def add_transfers(self, name: str, sources: Collection[str], later: int = 0) -> None:
        """Pass the outputs of some FMUs on to the inputs of one, as they are so many steps of the run later."""
        ports = self._ports[name]
        for source in sources:
            for move in ports.moves.get(source, ()):
                self._add(Place(name), *((MOVE8, *move[:2]) if move.size == 8 else (MOVE, *move)))
            for row, numbers in ports.conversions.get(source, ()):
                self._add(Place(name), *row, *((later,) if row[0] == BLEND else ()), numbers=numbers)

    def _add_access(self, name: str, verb: str, port: Port, references: int, values: int) -> None:
        slave = self._slaves[name]
        code, more = (CALL4, ()) if slave.prefix == "fmi2" else (CALL5, (values,))
        row = (ctypes.addressof(port.references), references, port.address, *more)
        self._add_call(name, code, slave.accessor(verb, port.access), *row, port=port)

    def add_sets(self, name: str, *, constants: bool) -> None:
        """Set the inputs that change, or all of them."""
        for port in self._ports[name].inputs.values():
            values = len(port.variables) if constants else port.changing
            references = sum(v.place == 0 for v in port.variables[:values])
            if references:
                self._add_access(name, "Set", port, references, values)

    @contextmanager
    def every(self, name: str, phase: int) -> Iterator[None]:
        """What is added is done in so manyth step of the run within each step of an FMU."""
        stride, at = self._ports[name].pace.stride, len(self.rows)
        if stride > 1:
            self._add(Place(name))
        yield
        if stride > 1:
            self.rows[at] = (SKIP, stride, phase, len(self.rows), *(0,) * (WIDTH - 4))

    def add_shows(self, names: Iterable[str]) -> None:
        """Show what those have put out that were ahead, and add their outputs to sums."""
        for name in names:
            if self._ports[name].pace.ahead:
                with self.every(name, self._ports[name].pace.stride - 1):
                    for port in self._ports[name].outputs.values():
                        self._add(Place(name), MOVE, port.shown.ctypes.data, port.address, port.values.nbytes)
            sums = [operation for ports in self._ports.values() for operation in ports.sums.get(name, ())]
            if sums:
                with self.every(name, self._ports[name].pace.stride - 1):
                    for row, numbers in sums:
                        self._add(Place(name), *row, numbers=numbers)

    def add_gets(self, name: str) -> None:
        """Get the outputs and look whether they are finite."""
        ports = self._ports[name].outputs.values()
        for port in ports:
            self._add_access(name, "Get", port, len(port.references), len(port.variables))
        for port in ports:
            if port.values.dtype == np.float64:
                self._add(Place(name, port=port), FINITE, port.address, len(port.variables))

    def _add_derivatives(self, name: str) -> None:
        """Begin inputs that are interpolated with what they were, and tell their derivatives."""
        ports, pace = self._ports[name], self._ports[name].pace
        inputs = [(v, ports.inputs[v.access].address_of(v)) for v in ports.slopes]
        told = self._reserve(len(inputs))
        for k, (_, at) in enumerate(inputs):
            before = self._reserve(1)
            # As it is when the initialisation has ended.
            ctypes.memmove(before, at, 8)
            self._add(Place(name), SLOPE, at, before, told + 8 * k, numbers=(pace.length, 0.0))
        self.add_sets(name, constants=False)
        references = (ctypes.c_uint * len(inputs))(*(v.reference for v, _ in inputs))
        orders = (ctypes.c_int * len(inputs))(*[1] * len(inputs))
        self._held += [references, orders]
        row = (ctypes.addressof(references), len(inputs), ctypes.addressof(orders), told)
        self._add_call(name, CALL5, "fmi2SetRealInputDerivatives", *row)

    def add_member(self, name: str, sources: Collection[str], *, final: bool) -> None:
        """Stimuli and outputs of others in, step, outputs out; `final`: no state from before will be set again."""
        pace = self._ports[name].pace
        for feed in self._ports[name].feeds:
            self._add(Place(name), FEED, *feed, self.cursors)
            self.cursors += 1
        self.add_transfers(name, sources, pace.stride if pace.ahead else 1)
        if self._ports[name].slopes and final:
            self._add_derivatives(name)
        else:
            self.add_sets(name, constants=False)
        slave = self._slaves[name]
        code, place = (STEP2, 0) if slave.prefix == "fmi2" else (STEP3, self._reserve(2))
        function = f"{slave.prefix}DoStep"
        row = (code, slave.address(function), slave.component, int(final), place, pace.back, pace.stride)
        self._add(Place(name, function), *row, numbers=(pace.length, 0.0))
        self.add_gets(name)

    def add_iteration(self, group: Group, sources: Collection[str], run: RunSetting) -> None:
        """Make the step of a cycle again from the same state until the values that go around no longer change."""
        states = {name: self._reserve(1) for name in group.members}
        for name, state in states.items():
            self._add_call(name, STATE, self._slaves[name].get_state, state)
        self._add(Place(group.members[0]), BEGIN)
        again = len(self.rows)
        for name, state in states.items():
            self._add_call(name, RESTORE, self._slaves[name].set_state, state)
        for name in group.members:
            self.add_member(name, sources, final=False)
        self.add_comparisons(group, run)
        self._add(Place(group.members[0], group=group), REPEAT, again, run.most_iterations)
        nothing = self._reserve(1)
        for name, state in states.items():
            self._add_call(name, STATE, self._slaves[name].free_state, state)
            # FMI wants it to be NULL then; PythonFMU leaves it.
            self._add(Place(name), MOVE8, state, nothing)

    def add_comparisons(self, group: Group, run: RunSetting) -> None:
        """Compare each value that goes around with what it was before."""
        for fmu, variable in group.around:
            address = self._ports[fmu].outputs[variable.access].address_of(variable)
            row = (COMPARE, address, self._reserve(1), variable.value_type.code)
            self._add(Place(fmu, variable=variable), *row, numbers=(run.allowed_change, 0.0))


def step_program(
    groups: Sequence[Group], run: RunSetting, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]
) -> Program:
    """The operations of one step of all FMUs, in the order of the groups."""
    program = Program(slaves, ports)
    everybody = [name for group in groups for name in group.members]
    for group in groups:
        if group.cyclic and run.coupling != "iterate":
            for name in group.members:
                with program.every(name, 0):
                    program.add_transfers(name, group.members)
            sources = [name for name in everybody if name not in group.members]
            for name in group.members:
                with program.every(name, ports[name].pace.back):
                    program.add_member(name, sources, final=True)
        else:
            # Those of a cycle that is iterated step alike.
            first = group.members[0]
            with program.every(first, ports[first].pace.back):
                if group.cyclic:
                    program.add_iteration(group, everybody, run)
                else:
                    program.add_member(first, everybody, final=True)
        program.add_shows(group.members)
    return program
