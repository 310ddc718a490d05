"""The memory of each FMU's inputs and outputs, and the operations of a step in their order.

A step has three kinds of operations: values move from stimuli and outputs to inputs, FMUs step, and cycles of
connections repeat until their values settle. `operations.py` defines each operation.
"""

import ctypes
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Variables of one FMU and one type (`access`, a key of `VALUE_TYPES`) that are read or written in one call.

    Their order is that of `values`, an array of FMI 3.0 with all its elements; the first `changing` ones change during
    the run. Each value reference occurs once. `shown` are the values for other FMUs and for the record: for an FMU that
    steps ahead, the values of its previous step.
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
        """Address of the values."""
        return self.values.ctypes.data

    def address_of(self, variable: FmuVariable, *, shown: bool = False) -> int:
        """Return the address of one variable's value, or of its shown value."""
        first = self.shown if shown else self.values
        return first.ctypes.data + self.values.itemsize * self.variables.index(variable)


class Ports:
    """Inputs and outputs of one FMU at each step, from all wires of the run and the FMU's own stimuli.

    An input holds its `start_value` until a value is passed on. `inputs` and `outputs` are the ports of each type.
    Changing inputs come first, constants last; recorded outputs come first, `recorded` is their number. `feeds` copy
    stimuli into the inputs, `transfers` pass on the outputs of each FMU, `sums` add its outputs after its step.
    `slopes` are inputs whose derivatives the FMU receives, `tables` those that its solver interpolates: variables,
    times and rows. Raises InputError for a variable of a type that the
    orchestrator does not pass on, and for a String or Binary of an FMU that steps ahead.
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
        self.tables: list[tuple[tuple[FmuVariable, ...], NDArray, NDArray]] = []
        self._memory: list[Any] = []
        """Objects to which addresses point; kept alive here."""
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
        for drive in drives:
            if drive.times is not None:
                self._interpolate(interface, drive, drive.times)

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
        """Lay a stimulus on the inputs: permanently, or row by row."""
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
                # Columns with consecutive places are copied together.
                if end < len(places) and places[end] == places[end - 1] + 1:
                    continue
                part = np.ascontiguousarray(values[:, first:end])
                self._memory += [part, begins]
                width, target = part.shape[1] * part.itemsize, port.address + places[first] * part.itemsize
                words = (begins.ctypes.data, len(begins), part.ctypes.data, width, target)
                self.feeds.append(Operation(op.FEED, words))
                first = end

    def _interpolate(self, interface: Interface, drive: Drive, times: NDArray) -> None:
        """Lay out a table for the FMU's solver; the other elements of an array of FMI 3.0 are constant."""
        (access,) = {variable.access for variable in drive.variables}
        port, variables = self.inputs[access], tuple(_whole(interface, drive.variables))
        places = [port.variables.index(variable) for variable in variables]
        if min(places) < port.changing:
            raise InputError(f"'{interface.name}': a table feeds some elements of an array, something else the others")
        rows = np.tile(port.values[places], (len(times), 1)).astype(np.float64)
        rows[:, [variables.index(variable) for variable in drive.variables]] = drive.values
        self.tables.append((variables, times, rows))

    def _encoded(self, port: Port, rows: Any, columns: Sequence[int]) -> NDArray:
        """Return columns of rows of values in the form of a port."""
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
        """Return the address of a real number that is zero."""
        self._memory.append(np.zeros(1))
        return self._memory[-1].ctypes.data

    def connect(self, wires: Sequence[Wire], ports_of: Mapping[str, "Ports"]) -> None:
        """Lay the wires that come from the outputs of FMUs."""
        moves: dict[str, list[Operation]] = {}
        for wire in wires:
            source = ports_of[wire.source]
            target, output = self.inputs[wire.input.access], source.outputs[wire.output.access]
            # FMUs that step ahead together exchange their newest values.
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
    """Group variables by type, strings last: an FMU may reuse the memory of its strings at the next call."""
    groups: dict[str, list[FmuVariable]] = {}
    for variable in variables:
        _ = variable.value_type
        groups.setdefault(variable.access, []).append(variable)
    ordered = sorted(groups, key=lambda access: VALUE_TYPES[access].by_address)
    return {access: groups[access] for access in ordered}


def _merged(moves: Iterable[Operation]) -> list[Operation]:
    """Merge neighbouring moves; a move of eight bytes has a faster operation."""
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
    """Return the variables, each once; an element of an array of FMI 3.0 brings the whole array."""
    variables_of_arrays: dict[FmuVariable, None] = {}
    for variable in variables:
        elements = (variable,)
        if variable.size > 1:
            elements = interface.arrays[variable.name.rpartition("[")[0]]
        variables_of_arrays.update(dict.fromkeys(elements))
    return list(variables_of_arrays)


@dataclass(frozen=True)
class Place:
    """The owner of a row: the FMU, the function that it calls, the port or the value that it reads."""

    fmu: str
    call: str = ""
    port: Port | None = None
    variable: FmuVariable | None = None
    group: StepGroup | None = None


class Program:
    """Operations on running FMUs and their ports, with the text that a message needs for each operation.

    `cursors` is the number of feeds.
    """

    def __init__(self, slaves: Mapping[str, Slave], ports: Mapping[str, Ports], *, allow_nan: bool = False) -> None:
        self._slaves, self._ports, self._allow_nan = slaves, ports, allow_nan
        self.operations: list[Operation] = []
        self.places: list[Place] = []
        self._memory: list[Any] = []
        self.cursors = 0

    def __len__(self) -> int:
        return len(self.operations)

    def tables(self) -> tuple[NDArray, NDArray]:
        """Return the whole numbers of all operations, a row each, and their real numbers."""
        rows = np.zeros((len(self), op.WIDTH), dtype=np.int64)
        numbers = np.zeros((len(self), 2))
        for k, operation in enumerate(self.operations):
            rows[k, 0] = operation.code
            rows[k, 1 : 1 + len(operation.words)] = operation.words
            numbers[k] = operation.numbers
        return rows.ravel(), numbers.ravel()

    def pace_of(self, name: str) -> Pace:
        """Return the pace of an FMU."""
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
        """Return the address of this many words of memory, zero."""
        self._memory.append(np.zeros(words, dtype=np.int64))
        return self._memory[-1].ctypes.data

    def add_transfers(self, name: str, sources: Collection[str], later: int = 0) -> None:
        """Pass outputs of some FMUs on to the inputs of one, as they are this many steps of the run later."""
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
        """Set the changing inputs, or all inputs."""
        for port in self._ports[name].inputs.values():
            values = len(port.variables) if constants else port.changing
            references = sum(v.place == 0 for v in port.variables[:values])
            if references:
                self._add_access(name, "Set", port, references, values)

    @contextmanager
    def every(self, name: str, phase: int) -> Iterator[None]:
        """Restrict the operations added in the block to one step of the run within each step of an FMU."""
        stride, at = self.pace_of(name).stride, len(self)
        if stride == 1:
            yield
            return
        self._add(Place(name), op.SKIP)
        yield
        self.operations[at] = Operation(op.SKIP, (stride, phase, len(self)))

    def add_shows(self, names: Iterable[str]) -> None:
        """Show the new outputs of FMUs that step ahead, and add their outputs to sums."""
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
        """Get the outputs and check that they are finite, unless others are allowed."""
        ports = self._ports[name].outputs.values()
        for port in ports:
            self._add_access(name, "Get", port, len(port.references), len(port.variables))
        for port in ports:
            if port.values.dtype == np.float64 and not self._allow_nan:
                self._add(Place(name, port=port), op.FINITE, port.address, len(port.variables))

    def _add_derivatives(self, name: str) -> None:
        """Begin interpolated inputs at their previous values, and set their derivatives."""
        ports = self._ports[name]
        count = len(ports.slopes)
        derivatives = self._reserve(count)
        for k, variable in enumerate(ports.slopes):
            at, before = ports.inputs[variable.access].address_of(variable), self._reserve(1)
            # The value at the end of the initialisation.
            ctypes.memmove(before, at, 8)
            self._add(Place(name), op.SLOPE, at, before, derivatives + 8 * k, number=ports.pace.length)
        self.add_sets(name, constants=False)
        references = np.array([v.reference for v in ports.slopes], dtype=np.uint32)
        orders = np.ones(count, dtype=np.int32)
        self._memory += [references, orders]
        words = (references.ctypes.data, count, orders.ctypes.data, derivatives)
        self._add_call(Place(name, "fmi2SetRealInputDerivatives"), op.CALL5, *words)

    def add_member(self, name: str, sources: Collection[str], *, final: bool) -> None:
        """Pass stimuli and others' outputs in, step, get outputs; `final`: no earlier state will be restored."""
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
        """Repeat a step of a cycle from the same state until the values that go around no longer change."""
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
            # FMI requires NULL then; PythonFMU leaves it unchanged.
            self._add(Place(name), op.MOVE8, state, nothing)

    def add_comparisons(self, group: StepGroup, run: RunSetting) -> None:
        """Compare each value that goes around with its previous value."""
        for fmu, variable in group.around:
            address = self._ports[fmu].outputs[variable.access].address_of(variable)
            words = (address, self._reserve(1), variable.value_type.code)
            self._add(Place(fmu, variable=variable), op.COMPARE, *words, number=run.allowed_change)


def order_of(groups: Iterable[StepGroup]) -> list[str]:
    """Return the FMU names in stepping order."""
    names: list[str] = []
    for group in groups:
        names += group.members
    return names


def step_program(
    groups: Sequence[StepGroup], run: RunSetting, slaves: Mapping[str, Slave], ports: Mapping[str, Ports]
) -> Program:
    """Return the operations of one step of all FMUs, in the order of the groups."""
    program = Program(slaves, ports, allow_nan=bool(run.allow_nan))
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
            # FMUs of an iterated cycle have the same pace.
            first = group.members[0]
            with program.every(first, ports[first].pace.back):
                if group.cyclic:
                    program.add_iteration(group, order, run)
                else:
                    program.add_member(first, order, final=True)
        program.add_shows(group.members)
    return program
