"""What a step consists of: one flat table of operations on addresses, the memory for it, and the loop that runs it.

The loop stands here once: on memory and functions by their addresses it runs as machine code and as plain Python.
A row is an operation's code and seven whole numbers, with two real numbers beside it. The rows of a step are run from
the first to the last, for every step; what is recorded has a table of its own.

| operation | whole numbers | real numbers |
|---|---|---|
| FEED | steps from which rows hold, their number, first row, bytes of a row, target, its cursor | |
| MOVE | target, source, bytes | |
| MOVE8 | target, source: eight bytes | |
| CONVERT | target, source, type of the target, of the source | factor, offset |
| CALL4 | function, instance, references, their number, values: FMI 2.0's get and set | |
| CALL5 | function, instance, references, their number, values, their number: FMI 3.0's | |
| STEP2, STEP3 | fmi2DoStep or fmi3DoStep, instance, noSetFMUStatePriorToCurrentPoint, place of what it returns | |
| FINITE | first of so many real numbers, their number | |
| STATE | function of a state (get or free), instance, place of the state | |
| BEGIN | a new loop of connections: the first iteration | |
| RESTORE | function that sets a state, instance, place of the state: in all iterations but the first | |
| COMPARE | value, place of its value in the iteration before, its type | tolerance |
| REPEAT | row to go back to while a value changes, most iterations | |
"""

import ctypes
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .fmu import Slave
from .interface import VALUE_TYPES, Interface, Value, Variable
from .load import Group, Wire
from .scenario import RunSetting
from .stimuli import Drive

WIDTH = 8
FEED, MOVE, MOVE8, CONVERT, CALL4, CALL5, STEP2, STEP3, FINITE, STATE, BEGIN, RESTORE, COMPARE, REPEAT = range(14)

# What both loops keep in whole numbers.
STEP, LAST_STEP, ROW, EVERY, ROWS, RECORDS, ITERATION, CHANGING, AT, NEXT, CURSORS = range(11)
"""Step to make, step to stop before, row to record, every which step, rows of both tables, iteration, the row of the
value that changed most, row of the call that failed (-1: none), row to begin a step with, first cursor of a feed."""

# What both loops keep in real numbers.
START, LENGTH, CHANGE = range(3)
"""Start and step [s], the largest change of a value in the last iteration, against what is allowed."""

NOT_FINITE, NOT_SETTLED, ENDED, EARLY = 100, 101, 102, 103
"""Statuses beside FMI's: a value that is not finite, a loop that does not settle, an FMU that asks for the end of the
simulation, or that has returned before the end of the step."""
WARNING = 1
"""The worst status of FMI with which a run goes on."""


class Feed(NamedTuple):
    """A stimulus: from step `begins[i]` on (of `count`, at an address), `width` bytes of row i are at `target`."""

    begins: int
    count: int
    rows: int
    width: int
    target: int


class Move(NamedTuple):
    """Bytes that are passed on as they are."""

    target: int
    source: int
    size: int


@dataclass
class Port:
    """Some variables of one FMU and one type (`access`, a key of `VALUE_TYPES`), read or written in one call.

    They stand in the order of `values`, an array of FMI 3.0 with all its elements; so many of the first ones change
    during the run. Each value reference stands once.
    """

    access: str
    variables: tuple[Variable, ...]
    changing: int

    def __post_init__(self) -> None:
        self.values = np.zeros(len(self.variables), dtype=VALUE_TYPES[self.access].dtype)
        # The elements of an array share their reference; two scalars that share one are two values.
        references = [v.reference for v in self.variables if v.place == 0]
        self.references = (ctypes.c_uint * len(references))(*references)

    @property
    def address(self) -> int:
        """Where the values are."""
        return self.values.ctypes.data

    def address_of(self, variable: Variable) -> int:
        """Where one variable's value is."""
        return self.address + self.values.itemsize * self.variables.index(variable)


class Ports:
    """What goes into and out of one FMU at each step, from all wires of the run and the FMU's own stimuli.

    An input holds its `start_value` before anything is passed on. `inputs` and `outputs` are the ports of each type:
    inputs that change come first, constants last; outputs that are recorded come first, `recorded` is their number.
    `feeds` are copied into the inputs from stimuli, `moves` and `conversions` (the row and numbers of CONVERT) from the
    outputs of each FMU. An InputError for a variable of a type that the orchestrator does not pass on.
    """

    def __init__(
        self,
        interface: Interface,
        wires: Sequence[Wire],
        drives: Sequence[Drive],
        recorded: Sequence[Variable],
        start_value: Callable[[Variable], Value | None],
    ) -> None:
        self.inputs: dict[str, Port] = {}
        self.outputs: dict[str, Port] = {}
        self.recorded: dict[str, int] = {}
        self.feeds: list[Feed] = []
        self.moves: dict[str, list[Move]] = {}
        self.conversions: dict[str, list[tuple[tuple[int, ...], tuple[float, float]]]] = {}
        self._kept: list[Any] = []
        """Memory that addresses point to."""
        driven = [v for drive in drives if drive.begins is not None for v in drive.variables]
        wired = [w.input for w in wires if w.target == interface.name]
        constant = [v for drive in drives if drive.begins is None for v in drive.variables]
        feeding = [w.output for w in wires if w.source == interface.name]
        changing, setting = _whole(interface, driven + wired), _whole(interface, driven + wired + constant)
        first, reading = _whole(interface, recorded), _whole(interface, [*recorded, *feeding])
        kinds = list(dict.fromkeys(v.access for v in setting + reading if v.value_type))
        # An FMU may reuse the memory of its strings at the next call: they are read last.
        for access in sorted(kinds, key="String".__eq__):
            sets, gets = ([v for v in each if v.access == access] for each in (setting, reading))
            if sets:
                self.inputs[access] = port = Port(access, tuple(sets), sum(v.access == access for v in changing))
                if access != "String":
                    port.values[:] = [start_value(v) or 0 for v in sets]
            if gets:
                self.outputs[access] = Port(access, tuple(gets), len(gets))
                self.recorded[access] = sum(v.access == access for v in first)
        for drive in drives:
            self._feed(drive)

    def _feed(self, drive: Drive) -> None:
        """Lay a stimulus on the inputs: for ever, or row by row."""
        for access, port in self.inputs.items():
            mine = [i for i, v in enumerate(drive.variables) if v.access == access]
            if not mine:
                continue
            if not isinstance(drive.values, np.ndarray):
                values = self._encoded(access, [[row[i] for i in mine] for row in drive.values])
            elif len(mine) == drive.values.shape[1]:
                values = self._encoded(access, drive.values)
            else:
                values = self._encoded(access, drive.values[:, mine])
            places = [port.variables.index(drive.variables[i]) for i in mine]
            if drive.begins is None:
                port.values[places] = values[0]
                continue
            begins = np.ascontiguousarray(drive.begins, dtype=np.int64)
            # Columns whose places follow each other are copied together.
            firsts = [i for i, place in enumerate(places) if i == 0 or place != places[i - 1] + 1]
            for first, end in zip(firsts, [*firsts[1:], len(places)], strict=True):
                part = np.ascontiguousarray(values[:, first:end])
                self._kept += [part, begins]
                width, target = part.shape[1] * part.itemsize, port.address + places[first] * part.itemsize
                self.feeds.append(Feed(begins.ctypes.data, len(begins), part.ctypes.data, width, target))

    def _encoded(self, access: str, rows: Any) -> np.ndarray:
        """Rows of values as a port holds them."""
        if access == "String":
            buffers = [[ctypes.create_string_buffer(str(value).encode()) for value in row] for row in rows]
            self._kept.append(buffers)
            rows = [[ctypes.addressof(buffer) for buffer in row] for row in buffers]
        return np.ascontiguousarray(rows, dtype=VALUE_TYPES[access].dtype)

    def connect(self, wires: Sequence[Wire], others: Mapping[str, "Ports"]) -> None:
        """Lay the wires that come from the outputs of FMUs."""
        for wire in wires:
            target, source = self.inputs[wire.input.access], others[wire.source].outputs[wire.output.access]
            codes = wire.input.value_type.code, wire.output.value_type.code
            ends = target.address_of(wire.input), source.address_of(wire.output)
            if codes[0] == codes[1] and (wire.factor, wire.offset) == (1.0, 0.0):
                self.moves.setdefault(wire.source, []).append(Move(*ends, target.values.itemsize))
            else:
                row = ((CONVERT, *ends, *codes), (wire.factor, wire.offset))
                self.conversions.setdefault(wire.source, []).append(row)
        self.moves = {source: _merged(moves) for source, moves in self.moves.items()}


def _merged(moves: Iterable[Move]) -> list[Move]:
    """Neighbouring moves made into one."""
    merged: list[Move] = []
    for move in sorted(moves):
        last = merged[-1] if merged else None
        if last and last.target + last.size == move.target and last.source + last.size == move.source:
            merged[-1] = last._replace(size=last.size + move.size)
        else:
            merged.append(move)
    return merged


def _whole(interface: Interface, variables: Iterable[Variable]) -> list[Variable]:
    """The variables, each once; where one is an element of an array of FMI 3.0, the whole array."""
    found: dict[Variable, None] = {}
    for variable in variables:
        base = variable.name.rpartition("[")[0]
        found.update(dict.fromkeys(interface.arrays[base] if variable.size > 1 else (variable,)))
    return list(found)


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

    `rows` and `numbers` are as the table above says; `cursors` is the number of feeds.
    """

    def __init__(self, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]) -> None:
        self._slaves, self._ports = slaves, ports
        self.rows: list[tuple[int, ...]] = []
        self.numbers: list[tuple[float, float]] = []
        self.places: list[Place] = []
        self._kept: list[np.ndarray] = []
        self.cursors = 0

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

    def add_transfers(self, name: str, sources: Collection[str]) -> None:
        """Pass the outputs of some FMUs on to the inputs of one."""
        ports = self._ports[name]
        for source in sources:
            for move in ports.moves.get(source, ()):
                self._add(Place(name), *((MOVE8, *move[:2]) if move.size == 8 else (MOVE, *move)))
            for row, numbers in ports.conversions.get(source, ()):
                self._add(Place(name), *row, numbers=numbers)

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

    def add_gets(self, name: str) -> None:
        """Get the outputs and look whether they are finite."""
        ports = self._ports[name].outputs.values()
        for port in ports:
            self._add_access(name, "Get", port, len(port.references), len(port.variables))
        for port in ports:
            if port.values.dtype == np.float64:
                self._add(Place(name, port=port), FINITE, port.address, len(port.variables))

    def add_member(self, name: str, sources: Collection[str], *, final: bool) -> None:
        """Stimuli and outputs of others in, step, outputs out; `final`: no state from before will be set again."""
        for feed in self._ports[name].feeds:
            self._add(Place(name), FEED, *feed, self.cursors)
            self.cursors += 1
        self.add_transfers(name, sources)
        self.add_sets(name, constants=False)
        prefix = self._slaves[name].prefix
        code, place = (STEP2, 0) if prefix == "fmi2" else (STEP3, self._reserve(2))
        self._add_call(name, code, f"{prefix}DoStep", int(final), place)
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
                program.add_transfers(name, group.members)
            sources = [name for name in everybody if name not in group.members]
            for name in group.members:
                program.add_member(name, sources, final=True)
        elif group.cyclic:
            program.add_iteration(group, everybody, run)
        else:
            program.add_member(group.members[0], everybody, final=True)
    return program


def loop_of(on: Any) -> Callable[..., int]:
    """The loop over the steps, in restricted Python: numba compiles it.

    Parameters
    ----------
    on : class
        what the loop needs of memory and of C functions, all by their addresses: copy(target, source, bytes),
        load_byte, load_word, load_real(address), store_word, store_real(address, value), real_of(type, address),
        convert(type, target, source, its type, factor, offset), and calls of functions: call2, call4, call5 with so
        many words, step2 and step3 as FMI has doStep

    Returns
    -------
    callable
        takes the rows of a step, their real numbers, what is recorded ((target of row 0, source, bytes) each), and the
        whole and real numbers that are kept, laid out as above; makes the steps from state[STEP] to state[LAST_STEP],
        or to the first call that fails, and returns its status, else 0
    """
    copy, load_word, load_byte, load_real = on.copy, on.load_word, on.load_byte, on.load_real
    store_real, store_word, real_of, convert = on.store_real, on.store_word, on.real_of, on.convert
    call2, call4, call5, step2, step3 = on.call2, on.call4, on.call5, on.step2, on.step3

    def march(operations, numbers, records, state, clock):
        rows, length, every = state[ROWS], clock[LENGTH], state[EVERY]
        step = state[STEP]
        row = state[ROW]
        while step < state[LAST_STEP]:
            time = clock[START] + step * length
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
                elif code == STEP2:
                    status = step2(a, b, time, length, c)
                elif code == STEP3:
                    status = step3(a, b, time, length, c, d, d + 1, d + 2, d + 8)
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
                    convert(c, a, b, d, numbers[2 * pc], numbers[2 * pc + 1])
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
