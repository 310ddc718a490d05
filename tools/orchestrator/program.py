"""What a step consists of: the memory of each FMU's inputs and outputs, and the operations on it in their order.

Three kinds of operations make a step: values move from stimuli and outputs to inputs, FMUs step, and cycles of
connections repeat until their values settle. `operations.py` says what each operation does.
"""

import ctypes
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from . import operations as op
from .fmu import Slave
from .interface import VALUE_TYPES, FmuVariable, Interface, Value, in_memory
from .scenario import RunSetting
from .stimuli import Drive
from .wiring import Pace, StepGroup, Wire


class Operation(NamedTuple):
    """One operation: its code, its whole numbers and its real numbers, as the table of operations lays them out."""

    code: int
    words: tuple[int, ...]
    numbers: tuple[float, float] = (0.0, 0.0)


@dataclass
class Port:
    """Some variables of one FMU and one type (`access`, a key of `VALUE_TYPES`), read or written in one call.

    They stand in the order of `values`, an array of FMI 3.0 with all its elements; the first `changing` ones change
    during the run. Each value reference stands once. `shown` is what others see and what is recorded: the values, but
    of an FMU that is ahead those of its step before.
    """

    access: str
    variables: tuple[FmuVariable, ...]
    changing: int

    def __post_init__(self) -> None:
        self.values = self.shown = np.zeros(len(self.variables), dtype=VALUE_TYPES[self.access].dtype)
        # The elements of an array share their reference; two scalars that share one are two values.
        references = [v.reference for v in self.variables if v.place == 0]
        self.references = (ctypes.c_uint * len(references))(*references)
        self.by_address = VALUE_TYPES[self.access].by_address

    @property
    def address(self) -> int:
        """Where the values are."""
        return self.values.ctypes.data

    def address_of(self, variable: FmuVariable, *, shown: bool = False) -> int:
        """Where one variable's value is, or what is shown of it."""
        first = self.shown if shown else self.values
        return first.ctypes.data + self.values.itemsize * self.variables.index(variable)


class Ports:
    """What goes into and out of one FMU at each step, from all wires of the run and the FMU's own stimuli.

    An input holds its `start_value` before anything is passed on. `inputs` and `outputs` are the ports of each type:
    inputs that change come first, constants last; outputs that are recorded come first, `recorded` is their number.
    `feeds` copy stimuli into the inputs, `transfers` pass on the outputs of each FMU, `sums` add its outputs when it
    has stepped; `slopes` are inputs whose derivatives the FMU is told. An InputError for a variable of a type that the
    orchestrator does not pass on, or a String or Binary of an FMU that steps ahead.
    """

    def __init__(
        self,
        interface: Interface,
        wires: Sequence[Wire],
        drives: Sequence[Drive],
        recorded: Sequence[FmuVariable],
        start_value: Callable[[FmuVariable], Value | None],
        pace: Pace,
    ) -> None:
        self.pace = pace
        self.inputs: dict[str, Port] = {}
        self.outputs: dict[str, Port] = {}
        self.recorded: dict[str, int] = {}
        self.feeds: list[Operation] = []
        self.transfers: dict[str, list[Operation]] = {}
        self.sums: dict[str, list[Operation]] = {}
        self.slopes: list[FmuVariable] = []
        self._memory: list[Any] = []
        """What addresses point to."""
        changing = [w.input for w in wires if w.target == interface.name]
        constant: list[FmuVariable] = []
        for drive in drives:
            if drive.begins is None:
                constant += drive.variables
            else:
                changing += drive.variables
        feeding = [w.output for w in wires if w.source == interface.name]
        self._add_inputs(_whole(interface, changing), _whole(interface, changing + constant), start_value)
        self._add_outputs(interface, _whole(interface, recorded), _whole(interface, list(recorded) + feeding))
        for drive in drives:
            self._feed(drive)

    def _add_inputs(
        self,
        changing: Sequence[FmuVariable],
        variables: Sequence[FmuVariable],
        start_value: Callable[[FmuVariable], Any],
    ) -> None:
        for access, group in _by_access(variables).items():
            port = Port(access, tuple(group), len(_by_access(changing).get(access, ())))
            if not port.by_address:
                port.values[:] = [start_value(v) or 0 for v in group]
            self.inputs[access] = port

    def _add_outputs(
        self, interface: Interface, recorded: Sequence[FmuVariable], variables: Sequence[FmuVariable]
    ) -> None:
        for access, group in _by_access(variables).items():
            port = Port(access, tuple(group), len(group))
            if self.pace.ahead:
                port.shown = port.values.copy()
            if self.pace.ahead and port.by_address:
                output = f"'{interface.name}' is interpolated and has a {access} '{group[0].name}'"
                raise InputError(f"{output}, which is no longer there when others may have it; record other columns")
            self.outputs[access] = port
            self.recorded[access] = len(_by_access(recorded).get(access, ()))

    def _feed(self, drive: Drive) -> None:
        """Lay a stimulus on the inputs: for ever, or row by row."""
        for access, port in self.inputs.items():
            columns = [i for i, v in enumerate(drive.variables) if v.access == access]
            if not columns:
                continue
            values = self._encoded(port, drive.values, columns)
            places = [port.variables.index(drive.variables[i]) for i in columns]
            if drive.begins is None:
                port.values[places] = values[0]
                continue
            begins = np.ascontiguousarray(drive.begins, dtype=np.int64) * self.pace.stride
            first = 0
            for end in range(1, len(places) + 1):
                # Columns whose places follow each other are copied together.
                if end < len(places) and places[end] == places[end - 1] + 1:
                    continue
                part = np.ascontiguousarray(values[:, first:end])
                self._memory += [part, begins]
                width, target = part.shape[1] * part.itemsize, port.address + places[first] * part.itemsize
                words = (begins.ctypes.data, len(begins), part.ctypes.data, width, target)
                self.feeds.append(Operation(op.FEED, words))
                first = end

    def _encoded(self, port: Port, rows: Any, columns: Sequence[int]) -> np.ndarray:
        """Columns of rows of values as a port holds them."""
        if isinstance(rows, np.ndarray):
            every_column = len(columns) == rows.shape[1]
            return np.ascontiguousarray(rows if every_column else rows[:, columns], dtype=port.values.dtype)
        if not port.by_address:
            chosen = []
            for row in rows:
                chosen.append([row[column] for column in columns])
            return np.array(chosen, dtype=port.values.dtype)
        addresses = np.zeros((len(rows), len(columns)), dtype=port.values.dtype)
        for i, row in enumerate(rows):
            for k, column in enumerate(columns):
                buffer = in_memory(port.access, str(row[column]))
                self._memory.append(buffer)
                addresses[i, k] = ctypes.addressof(buffer)
        return addresses

    def _reserve(self) -> int:
        """Address of a real number that is zero."""
        self._memory.append(np.zeros(1))
        return self._memory[-1].ctypes.data

    def connect(self, wires: Sequence[Wire], ports_of: Mapping[str, "Ports"]) -> None:
        """Lay the wires that come from the outputs of FMUs."""
        moves: dict[str, list[Operation]] = {}
        for wire in wires:
            source = ports_of[wire.source]
            target, output = self.inputs[wire.input.access], source.outputs[wire.output.access]
            # Those that are ahead together hear each other's newest values.
            together = self.pace.ahead and self.pace.stride == source.pace.stride
            at, before = target.address_of(wire.input), output.address_of(wire.output, shown=not together)
            code, own_code = wire.output.value_type.code, wire.input.value_type.code
            scaling = (wire.factor, wire.offset)
            if wire.between == "interpolate" and self.pace.linear and wire.input.kind == "Real":
                self.slopes.append(wire.input)
            conversions = self.transfers.setdefault(wire.source, [])
            if self.pace.stride != source.pace.stride and wire.between in ("interpolate", "sum"):
                number, after = self._reserve(), output.address_of(wire.output)
                convert = Operation(op.CONVERT, (at, number, own_code, 0), scaling)
                if wire.between == "interpolate":
                    blend = Operation(op.BLEND, (number, before, after, code, source.pace.stride))
                    conversions += [blend, convert]
                else:
                    self.sums.setdefault(wire.source, []).append(Operation(op.SUM, (number, after, code)))
                    conversions += [convert, Operation(op.MOVE8, (number, self._reserve()))]
            elif own_code == code and scaling == (1.0, 0.0):
                move = Operation(op.MOVE, (at, before, target.values.itemsize))
                moves.setdefault(wire.source, []).append(move)
            else:
                conversions.append(Operation(op.CONVERT, (at, before, own_code, code), scaling))
        for name, operations in moves.items():
            self.transfers[name] = _merged(operations) + self.transfers[name]


def _by_access(variables: Iterable[FmuVariable]) -> dict[str, list[FmuVariable]]:
    """Variables by their types; an FMU may reuse the memory of its strings at the next call, so they are read last."""
    groups: dict[str, list[FmuVariable]] = {}
    for variable in variables:
        _ = variable.value_type
        groups.setdefault(variable.access, []).append(variable)
    ordered = sorted(groups, key=lambda access: VALUE_TYPES[access].by_address)
    return {access: groups[access] for access in ordered}


def _merged(moves: Iterable[Operation]) -> list[Operation]:
    """Neighbouring moves made into one; of eight bytes there is a faster operation."""
    merged: list[tuple[int, int, int]] = []
    for target, source, size in sorted(move.words for move in moves):
        if merged:
            last_target, last_source, last_size = merged[-1]
            if last_target + last_size == target and last_source + last_size == source:
                merged[-1] = (last_target, last_source, last_size + size)
                continue
        merged.append((target, source, size))
    return [Operation(op.MOVE8, words[:2]) if words[2] == 8 else Operation(op.MOVE, words) for words in merged]


def _whole(interface: Interface, variables: Iterable[FmuVariable]) -> list[FmuVariable]:
    """The variables, each once; where one is an element of an array of FMI 3.0, the whole array."""
    variables_of_arrays: dict[FmuVariable, None] = {}
    for variable in variables:
        elements = (variable,)
        if variable.size > 1:
            elements = interface.arrays[variable.name.rpartition("[")[0]]
        variables_of_arrays.update(dict.fromkeys(elements))
    return list(variables_of_arrays)


@dataclass(frozen=True)
class Place:
    """Whose operation a row is: the FMU, the function that it calls, the port or the value that it looks at."""

    fmu: str
    call: str = ""
    port: Port | None = None
    variable: FmuVariable | None = None
    group: StepGroup | None = None


class Program:
    """Operations on running FMUs and what goes into and out of each, with what a message needs of each operation.

    `cursors` is the number of feeds.
    """

    def __init__(self, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]) -> None:
        self._slaves, self._ports = slaves, ports
        self.operations: list[Operation] = []
        self.places: list[Place] = []
        self._memory: list[Any] = []
        self.cursors = 0

    def __len__(self) -> int:
        return len(self.operations)

    def tables(self) -> tuple[np.ndarray, np.ndarray]:
        """The whole numbers of all operations, a row each, and their real numbers."""
        rows = np.zeros((len(self), op.WIDTH), dtype=np.int64)
        numbers = np.zeros((len(self), 2))
        for k, operation in enumerate(self.operations):
            rows[k, 0] = operation.code
            rows[k, 1 : 1 + len(operation.words)] = operation.words
            numbers[k] = operation.numbers
        return rows.ravel(), numbers.ravel()

    def pace_of(self, name: str) -> Pace:
        """How an FMU steps."""
        return self._ports[name].pace

    def _add(self, place: Place, code: int, *words: int, number: float = 0.0) -> None:
        self._insert(place, [Operation(code, words, (number, 0.0))])

    def _insert(self, place: Place, operations: Sequence[Operation]) -> None:
        self.operations += operations
        self.places += [place] * len(operations)

    def _add_call(self, place: Place, code: int, *words: int, number: float = 0.0) -> None:
        """Call a function of the FMU with its instance."""
        slave = self._slaves[place.fmu]
        self._add(place, code, slave.address(place.call), slave.component, *words, number=number)

    def _reserve(self, words: int) -> int:
        """Address of this many words of memory, zero."""
        self._memory.append(np.zeros(words, dtype=np.int64))
        return self._memory[-1].ctypes.data

    def add_transfers(self, name: str, sources: Collection[str], later: int = 0) -> None:
        """Pass the outputs of some FMUs on to the inputs of one, as they are this many steps of the run later."""
        for source in sources:
            for operation in self._ports[name].transfers.get(source, ()):
                if operation.code == op.BLEND:
                    operation = operation._replace(words=(*operation.words, later))
                self._insert(Place(name), [operation])

    def _add_access(self, name: str, verb: str, port: Port, references: int, values: int) -> None:
        slave = self._slaves[name]
        place = Place(name, slave.accessor(verb, port.access), port)
        words = (ctypes.addressof(port.references), references, port.address)
        if slave.prefix == "fmi2":
            self._add_call(place, op.CALL4, *words)
        else:
            self._add_call(place, op.CALL5, *words, values)

    def add_sets(self, name: str, *, constants: bool) -> None:
        """Set the inputs that change, or all of them."""
        for port in self._ports[name].inputs.values():
            values = len(port.variables) if constants else port.changing
            references = sum(v.place == 0 for v in port.variables[:values])
            if references:
                self._add_access(name, "Set", port, references, values)

    @contextmanager
    def every(self, name: str, phase: int) -> Iterator[None]:
        """What is added is done in this step of the run within each step of an FMU."""
        stride, at = self.pace_of(name).stride, len(self)
        if stride == 1:
            yield
            return
        self._add(Place(name), op.SKIP)
        yield
        self.operations[at] = Operation(op.SKIP, (stride, phase, len(self)))

    def add_shows(self, names: Iterable[str]) -> None:
        """Show what those have put out that were ahead, and add their outputs to sums."""
        for name in names:
            operations: list[Operation] = []
            if self.pace_of(name).ahead:
                for port in self._ports[name].outputs.values():
                    words = (port.shown.ctypes.data, port.address, port.values.nbytes)
                    operations.append(Operation(op.MOVE, words))
            for ports in self._ports.values():
                operations += ports.sums.get(name, ())
            if operations:
                with self.every(name, self.pace_of(name).stride - 1):
                    self._insert(Place(name), operations)

    def add_gets(self, name: str) -> None:
        """Get the outputs and look whether they are finite."""
        ports = self._ports[name].outputs.values()
        for port in ports:
            self._add_access(name, "Get", port, len(port.references), len(port.variables))
        for port in ports:
            if port.values.dtype == np.float64:
                self._add(Place(name, port=port), op.FINITE, port.address, len(port.variables))

    def _add_derivatives(self, name: str) -> None:
        """Begin inputs that are interpolated with what they were, and tell their derivatives."""
        ports = self._ports[name]
        count = len(ports.slopes)
        derivatives = self._reserve(count)
        for k, variable in enumerate(ports.slopes):
            at, before = ports.inputs[variable.access].address_of(variable), self._reserve(1)
            # As it is when the initialisation has ended.
            ctypes.memmove(before, at, 8)
            self._add(Place(name), op.SLOPE, at, before, derivatives + 8 * k, number=ports.pace.length)
        self.add_sets(name, constants=False)
        references = np.array([v.reference for v in ports.slopes], dtype=np.uint32)
        orders = np.ones(count, dtype=np.int32)
        self._memory += [references, orders]
        words = (references.ctypes.data, count, orders.ctypes.data, derivatives)
        self._add_call(Place(name, "fmi2SetRealInputDerivatives"), op.CALL5, *words)

    def add_member(self, name: str, sources: Collection[str], *, final: bool) -> None:
        """Stimuli and outputs of others in, step, outputs out; `final`: no state from before will be set again."""
        ports, slave = self._ports[name], self._slaves[name]
        pace = ports.pace
        for feed in ports.feeds:
            self._add(Place(name), op.FEED, *feed.words, self.cursors)
            self.cursors += 1
        self.add_transfers(name, sources, pace.stride if pace.ahead else 1)
        if ports.slopes and final:
            self._add_derivatives(name)
        else:
            self.add_sets(name, constants=False)
        code, returns = op.STEP2, 0
        if slave.prefix == "fmi3":
            code, returns = op.STEP3, self._reserve(2)
        words = (int(final), returns, pace.back, pace.stride)
        self._add_call(Place(name, f"{slave.prefix}DoStep"), code, *words, number=pace.length)
        self.add_gets(name)

    def add_iteration(self, group: StepGroup, sources: Collection[str], run: RunSetting) -> None:
        """Make the step of a cycle again from the same state until the values that go around no longer change."""
        states = {name: self._reserve(1) for name in group.members}
        for name, state in states.items():
            self._add_call(Place(name, self._slaves[name].get_state), op.STATE, state)
        self._add(Place(group.members[0]), op.BEGIN)
        again = len(self)
        for name, state in states.items():
            self._add_call(Place(name, self._slaves[name].set_state), op.RESTORE, state)
        for name in group.members:
            self.add_member(name, sources, final=False)
        self.add_comparisons(group, run)
        self._add(Place(group.members[0], group=group), op.REPEAT, again, run.most_iterations)
        nothing = self._reserve(1)
        for name, state in states.items():
            self._add_call(Place(name, self._slaves[name].free_state), op.STATE, state)
            # FMI wants it to be NULL then; PythonFMU leaves it.
            self._add(Place(name), op.MOVE8, state, nothing)

    def add_comparisons(self, group: StepGroup, run: RunSetting) -> None:
        """Compare each value that goes around with what it was before."""
        for fmu, variable in group.around:
            address = self._ports[fmu].outputs[variable.access].address_of(variable)
            words = (address, self._reserve(1), variable.value_type.code)
            self._add(Place(fmu, variable=variable), op.COMPARE, *words, number=run.allowed_change)


def order_of(groups: Iterable[StepGroup]) -> list[str]:
    """The FMUs in the order in which they step."""
    names: list[str] = []
    for group in groups:
        names += group.members
    return names


def step_program(
    groups: Sequence[StepGroup], run: RunSetting, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]
) -> Program:
    """The operations of one step of all FMUs, in the order of the groups."""
    program = Program(slaves, ports)
    order = order_of(groups)
    for group in groups:
        if group.cyclic and run.coupling != "iterate":
            for name in group.members:
                with program.every(name, 0):
                    program.add_transfers(name, group.members)
            sources = [name for name in order if name not in group.members]
            for name in group.members:
                with program.every(name, ports[name].pace.back):
                    program.add_member(name, sources, final=True)
        else:
            # Those of a cycle that is iterated step alike.
            first = group.members[0]
            with program.every(first, ports[first].pace.back):
                if group.cyclic:
                    program.add_iteration(group, order, run)
                else:
                    program.add_member(first, order, final=True)
        program.add_shows(group.members)
    return program
