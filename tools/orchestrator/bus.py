"""Buffers between the FMUs: laid out once, so that a step moves blocks of memory and builds no lists."""

import ctypes
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trihedron.orchestrator.connections import Wire
from trihedron.orchestrator.interface import Value, Variable
from trihedron.orchestrator.stimuli import Drive

ACCESSES = ("Real", "Integer", "Boolean", "String")
# A String is passed as the address of its bytes; strings come last, for an FMU may reuse their memory
# at the next call.
_DTYPES = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32, "String": np.uintp}

Feed = tuple[Sequence[int], int, int, int]
"""Row of each step, address of the first row, bytes of a row, where it goes."""
Move = tuple[int, int, int]
"""Where it goes, where it comes from, bytes."""


@dataclass
class Port:
    """Some variables of one FMU and one type, read or written in one call."""

    access: str
    variables: tuple[Variable, ...]
    values: np.ndarray
    references: Any
    changing: int

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
    feeds, moves : list
        what is copied into the inputs before a step: from stimuli, from outputs of others
    recorded : dict
        FMI type to number of recorded outputs
    kept : list
        memory that addresses point to
    """

    inputs: dict[str, Port]
    outputs: dict[str, Port]
    recorded: dict[str, int]
    feeds: list[Feed] = field(default_factory=list)
    moves: list[Move] = field(default_factory=list)
    kept: list[Any] = field(default_factory=list)


def _port(access: str, variables: Sequence[Variable], changing: int) -> Port:
    references = (ctypes.c_uint * len(variables))(*(v.reference for v in variables))
    return Port(access, tuple(variables), np.zeros(len(variables), dtype=_DTYPES[access]), references, changing)


def _of(access: str, variables: Iterable[Variable]) -> list[Variable]:
    return [v for v in variables if v.access == access]


def _encoded(access: str, rows: Iterable[Iterable[Value]], kept: list[Any]) -> np.ndarray:
    """Rows of values as the port holds them."""
    if access != "String":
        return np.ascontiguousarray(rows, dtype=_DTYPES[access])
    addresses = []
    for row in rows:
        buffers = [ctypes.create_string_buffer(str(value).encode()) for value in row]
        kept += buffers
        addresses.append([ctypes.addressof(buffer) for buffer in buffers])
    return np.array(addresses, dtype=_DTYPES[access])


def _merged(moves: list[Move]) -> list[Move]:
    """Neighbouring moves made into one."""
    merged: list[Move] = []
    for target, source, size in sorted(moves):
        if merged and merged[-1][0] + merged[-1][2] == target and merged[-1][1] + merged[-1][2] == source:
            merged[-1] = (*merged[-1][:2], merged[-1][2] + size)
        else:
            merged.append((target, source, size))
    return merged


def make_buses(
    names: Sequence[str],
    wires: Sequence[Wire],
    drives: Sequence[Drive],
    recorded: Mapping[str, Sequence[Variable]],
) -> dict[str, FmuBus]:
    """Lay out the buffers of all FMUs.

    Parameters
    ----------
    names : sequence of str
        the FMUs
    wires : sequence of Wire
    drives : sequence of Drive
    recorded : mapping
        FMU to its recorded variables
    """
    buses = {name: _ports(name, wires, drives, recorded[name]) for name in names}
    for name, bus in buses.items():
        for drive in drives:
            if drive.fmu == name:
                _feed(bus, drive)
        for wire in wires:
            if wire.target == name:
                target, source = bus.inputs[wire.input.access], buses[wire.source].outputs[wire.output.access]
                bus.moves.append(
                    (target.address_of(wire.input), source.address_of(wire.output), target.values.itemsize)
                )
        bus.moves = _merged(bus.moves)
    return buses


def _ports(name: str, wires: Sequence[Wire], drives: Sequence[Drive], recorded: Sequence[Variable]) -> FmuBus:
    driven = [v for d in drives if d.fmu == name and d.rows is not None for v in d.variables]
    wired = [w.input for w in wires if w.target == name]
    constant = [v for d in drives if d.fmu == name and d.rows is None for v in d.variables]
    feeding = dict.fromkeys(w.output for w in wires if w.source == name)
    inputs, outputs, counts = {}, {}, {}
    for access in ACCESSES:
        changing = _of(access, driven + wired)
        everything = [*changing, *_of(access, constant)]
        if everything:
            inputs[access] = _port(access, everything, len(changing))
        first = _of(access, recorded)
        rest = [v for v in _of(access, feeding) if v not in first]
        if first or rest:
            outputs[access] = _port(access, [*first, *rest], len(first) + len(rest))
            counts[access] = len(first)
    return FmuBus(inputs, outputs, counts)


def _feed(bus: FmuBus, drive: Drive) -> None:
    """Lay a stimulus on the inputs: for ever, or row by row."""
    for access in ACCESSES:
        mine = [i for i, v in enumerate(drive.variables) if v.access == access]
        if not mine:
            continue
        chosen = (
            np.asarray(drive.values)[:, mine]
            if isinstance(drive.values, np.ndarray)
            else [[row[i] for i in mine] for row in drive.values]
        )
        values = _encoded(access, chosen, bus.kept)
        port = bus.inputs[access]
        at = port.variables.index(drive.variables[mine[0]])
        if drive.rows is None:
            port.values[at : at + len(mine)] = values[0]
            continue
        bus.kept.append(values)
        width = values.itemsize * len(mine)
        bus.feeds.append(
            (
                array("q", drive.rows.astype(np.int64).tobytes()),
                values.ctypes.data,
                width,
                port.address + at * values.itemsize,
            )
        )
