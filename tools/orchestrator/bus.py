"""Buffers between the FMUs: laid out once, so that a step moves blocks of memory and builds no lists."""

import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .connections import Wire
from .interface import Interface, Value, Variable
from .stimuli import Drive
from .value_types import VALUE_TYPES

StartValue = Callable[[str, Variable], Value | None]
"""(FMU, variable) -> what it starts with."""


class Feed(NamedTuple):
    """A stimulus: from step `begins[i]` on, `width` bytes of row i are at `target`."""

    begins: np.ndarray
    rows: int
    width: int
    target: int


class Move(NamedTuple):
    """Bytes that are passed on as they are."""

    target: int
    source: int
    size: int


class Conversion(NamedTuple):
    """One value that is passed on as another type or in another unit: target = factor * source + offset."""

    target: int
    source: int
    to_type: int
    from_type: int
    factor: float
    offset: float


@dataclass
class Port:
    """Some variables of one FMU and one type, read or written in one call.

    Attributes
    ----------
    access : str
        a key of `VALUE_TYPES`
    variables : tuple of Variable
        in the order of `values`; an array of FMI 3.0 with all its elements
    values : array
    references : ctypes array
        each value reference once
    changing, changing_references : int
        so many of the first values, and of the first references, change during the run
    """

    access: str
    variables: tuple[Variable, ...]
    values: np.ndarray
    references: Any
    changing: int
    changing_references: int

    @property
    def address(self) -> int:
        """Where the values are."""
        return self.values.ctypes.data

    def address_of(self, variable: Variable) -> int:
        """Where one variable's value is."""
        return self.address + self.values.itemsize * self.variables.index(variable)


@dataclass
class FmuBus:
    """What goes into and out of one FMU at each step.

    Attributes
    ----------
    inputs, outputs : dict
        FMI type to port. Inputs that change come first, constants last; outputs that are recorded come first.
    feeds : list
        what is copied into the inputs from stimuli
    moves, conversions : dict
        what is copied into the inputs from the outputs of each FMU
    recorded : dict
        FMI type to number of recorded values
    kept : list
        memory that addresses point to
    """

    inputs: dict[str, Port]
    outputs: dict[str, Port]
    recorded: dict[str, int]
    feeds: list[Feed] = field(default_factory=list)
    moves: dict[str, list[Move]] = field(default_factory=dict)
    conversions: dict[str, list[Conversion]] = field(default_factory=dict)
    kept: list[Any] = field(default_factory=list)


def _port(access: str, variables: Sequence[Variable], changing: int) -> Port:
    # The elements of an array share their reference; two scalars that share one are two values.
    references = [v.reference for v in variables if v.place == 0]
    return Port(
        access,
        tuple(variables),
        np.zeros(len(variables), dtype=VALUE_TYPES[access].dtype),
        (ctypes.c_uint * len(references))(*references),
        changing,
        sum(1 for v in variables[:changing] if v.place == 0),
    )


def _encoded(access: str, rows: Iterable[Iterable[Value]], kept: list[Any]) -> np.ndarray:
    """Rows of values as the port holds them."""
    if access != "String":
        return np.ascontiguousarray(rows, dtype=VALUE_TYPES[access].dtype)
    addresses = []
    for row in rows:
        buffers = [ctypes.create_string_buffer(str(value).encode()) for value in row]
        kept += buffers
        addresses.append([ctypes.addressof(buffer) for buffer in buffers])
    return np.array(addresses, dtype=VALUE_TYPES[access].dtype)


def _merged(moves: list[Move]) -> list[Move]:
    """Neighbouring moves made into one."""
    merged: list[Move] = []
    for move in sorted(moves):
        last = merged[-1] if merged else None
        if last and last.target + last.size == move.target and last.source + last.size == move.source:
            merged[-1] = last._replace(size=last.size + move.size)
        else:
            merged.append(move)
    return merged


def make_buses(
    interfaces: Mapping[str, Interface],
    wires: Sequence[Wire],
    drives: Sequence[Drive],
    recorded: Mapping[str, Sequence[Variable]],
    start_value: StartValue = lambda _, variable: variable.start,
) -> dict[str, FmuBus]:
    """Lay out the buffers of all FMUs.

    Parameters
    ----------
    interfaces : mapping
        the FMUs
    wires : sequence of Wire
    drives : sequence of Drive
    recorded : mapping
        FMU to its recorded variables
    start_value : callable
        what the inputs hold before anything is passed on

    Raises
    ------
    InputError
        a variable of a type that the orchestrator does not pass on
    """
    buses = {name: _ports(interfaces[name], wires, drives, recorded[name], start_value) for name in interfaces}
    for name, bus in buses.items():
        for drive in drives:
            if drive.fmu == name:
                _feed(bus, drive)
        for wire in wires:
            if wire.target == name:
                _connect(bus, buses[wire.source], wire)
        bus.moves = {source: _merged(moves) for source, moves in bus.moves.items()}
    return buses


def _connect(bus: FmuBus, source_bus: FmuBus, wire: Wire) -> None:
    """Lay a wire from an output to an input."""
    target, source = bus.inputs[wire.input.access], source_bus.outputs[wire.output.access]
    to_type, from_type = wire.input.value_type.code, wire.output.value_type.code
    ends = target.address_of(wire.input), source.address_of(wire.output)
    if to_type == from_type and (wire.factor, wire.offset) == (1.0, 0.0):
        bus.moves.setdefault(wire.source, []).append(Move(*ends, target.values.itemsize))
    else:
        conversion = Conversion(*ends, to_type, from_type, wire.factor, wire.offset)
        bus.conversions.setdefault(wire.source, []).append(conversion)


def _whole(interface: Interface, variables: Iterable[Variable]) -> list[Variable]:
    """The variables, each once; where one is an element of an array of FMI 3.0, the whole array."""
    found: dict[Variable, None] = {}
    for variable in variables:
        base = variable.name.rpartition("[")[0]
        found.update(dict.fromkeys(interface.arrays[base] if variable.size > 1 else (variable,)))
    return list(found)


def _ports(
    interface: Interface,
    wires: Sequence[Wire],
    drives: Sequence[Drive],
    recorded: Sequence[Variable],
    start_value: StartValue,
) -> FmuBus:
    name = interface.name
    driven = [v for d in drives if d.fmu == name and d.begins is not None for v in d.variables]
    wired = [w.input for w in wires if w.target == name]
    constant = [v for d in drives if d.fmu == name and d.begins is None for v in d.variables]
    feeding = [w.output for w in wires if w.source == name]
    changing, setting = _whole(interface, driven + wired), _whole(interface, driven + wired + constant)
    first, reading = _whole(interface, recorded), _whole(interface, [*recorded, *feeding])
    bus = FmuBus({}, {}, {})
    for access in dict.fromkeys(v.access for v in setting + reading if v.value_type):
        sets = [v for v in setting if v.access == access]
        if sets:
            bus.inputs[access] = _port(access, sets, sum(1 for v in changing if v.access == access))
            if access != "String":
                bus.inputs[access].values[:] = [start_value(name, v) or 0 for v in sets]
        gets = [v for v in reading if v.access == access]
        if gets:
            bus.outputs[access] = _port(access, gets, len(gets))
            bus.recorded[access] = sum(1 for v in first if v.access == access)
    for ports in (bus.inputs, bus.outputs):
        if "String" in ports:
            # An FMU may reuse the memory of its strings at the next call: they are read last.
            ports["String"] = ports.pop("String")
    return bus


def _feed(bus: FmuBus, drive: Drive) -> None:
    """Lay a stimulus on the inputs: for ever, or row by row."""
    for access in bus.inputs:
        mine = [i for i, v in enumerate(drive.variables) if v.access == access]
        if not mine:
            continue
        chosen = (
            (drive.values if len(mine) == drive.values.shape[1] else drive.values[:, mine])
            if isinstance(drive.values, np.ndarray)
            else [[row[i] for i in mine] for row in drive.values]
        )
        values = _encoded(access, chosen, bus.kept)
        port = bus.inputs[access]
        places = [port.variables.index(drive.variables[i]) for i in mine]
        if drive.begins is None:
            port.values[places] = values[0]
            continue
        begins = np.ascontiguousarray(drive.begins, dtype=np.int64)
        for column, place in _runs(places):
            part = np.ascontiguousarray(values[:, column])
            bus.kept += [part, begins]
            bus.feeds.append(
                Feed(begins, part.ctypes.data, part.shape[1] * part.itemsize, port.address + place * part.itemsize)
            )


def _runs(places: Sequence[int]) -> list[tuple[slice, int]]:
    """Columns whose places follow each other, with the place of the first."""
    starts = [i for i, place in enumerate(places) if i == 0 or place != places[i - 1] + 1]
    ends = [*starts[1:], len(places)]
    return [(slice(start, end), places[start]) for start, end in zip(starts, ends, strict=True)]
