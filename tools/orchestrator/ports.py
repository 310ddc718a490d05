"""The memory that goes into and out of each FMU at its steps, and what is copied between it from FMU to FMU."""

import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from .interface import VALUE_TYPES, Interface, Value, Variable, in_memory
from .operations import BLEND, CONVERT, MOVE8, SUM
from .stimuli import Drive
from .wiring import Pace, Wire

Operation = tuple[tuple[int, ...], tuple[float, float]]
"""A row and its real numbers."""


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
    during the run. Each value reference stands once. `shown` is what others see and what is recorded: the values, but
    of an FMU that is ahead those of its step before.
    """

    access: str
    variables: tuple[Variable, ...]
    changing: int

    def __post_init__(self) -> None:
        self.values = self.shown = np.zeros(len(self.variables), dtype=VALUE_TYPES[self.access].dtype)
        # The elements of an array share their reference; two scalars that share one are two values.
        references = [v.reference for v in self.variables if v.place == 0]
        self.references = (ctypes.c_uint * len(references))(*references)

    @property
    def address(self) -> int:
        """Where the values are."""
        return self.values.ctypes.data

    def address_of(self, variable: Variable, *, shown: bool = False) -> int:
        """Where one variable's value is, or what is shown of it."""
        first = self.shown if shown else self.values
        return first.ctypes.data + self.values.itemsize * self.variables.index(variable)


class Ports:
    """What goes into and out of one FMU at each step, from all wires of the run and the FMU's own stimuli.

    An input holds its `start_value` before anything is passed on. `inputs` and `outputs` are the ports of each type:
    inputs that change come first, constants last; outputs that are recorded come first, `recorded` is their number.
    `feeds` are copied into the inputs from stimuli, `moves` and `conversions` (rows with their numbers) from the
    outputs of each FMU; `sums` are made of its outputs when it has stepped, `slopes` are inputs whose derivatives are
    told. An InputError for a variable of a type that the orchestrator does not pass on, or a String or Binary of an FMU
    that steps ahead.
    """

    def __init__(
        self,
        interface: Interface,
        wires: Sequence[Wire],
        drives: Sequence[Drive],
        recorded: Sequence[Variable],
        start_value: Callable[[Variable], Value | None],
        pace: Pace,
    ) -> None:
        self.pace = pace
        self.inputs: dict[str, Port] = {}
        self.outputs: dict[str, Port] = {}
        self.recorded: dict[str, int] = {}
        self.feeds: list[Feed] = []
        self.moves: dict[str, list[Move]] = {}
        self.conversions: dict[str, list[Operation]] = {}
        self.sums: dict[str, list[Operation]] = {}
        self.slopes: list[Variable] = []
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
        for access in sorted(kinds, key=lambda access: VALUE_TYPES[access].by_address):
            sets, gets = ([v for v in each if v.access == access] for each in (setting, reading))
            if sets:
                self.inputs[access] = port = Port(access, tuple(sets), sum(v.access == access for v in changing))
                if not VALUE_TYPES[access].by_address:
                    port.values[:] = [start_value(v) or 0 for v in sets]
            if gets:
                self.outputs[access] = port = Port(access, tuple(gets), len(gets))
                if pace.ahead:
                    port.shown = port.values.copy()
                if pace.ahead and VALUE_TYPES[access].by_address:
                    said = "which is no longer there when others may have it; record other columns"
                    raise InputError(f"'{interface.name}' is interpolated and has a {access} '{gets[0].name}', {said}")
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
            begins = np.ascontiguousarray(drive.begins, dtype=np.int64) * self.pace.stride
            # Columns whose places follow each other are copied together.
            firsts = [i for i, place in enumerate(places) if i == 0 or place != places[i - 1] + 1]
            for first, end in zip(firsts, [*firsts[1:], len(places)], strict=True):
                part = np.ascontiguousarray(values[:, first:end])
                self._kept += [part, begins]
                width, target = part.shape[1] * part.itemsize, port.address + places[first] * part.itemsize
                self.feeds.append(Feed(begins.ctypes.data, len(begins), part.ctypes.data, width, target))

    def _encoded(self, access: str, rows: Any) -> np.ndarray:
        """Rows of values as a port holds them."""
        if VALUE_TYPES[access].by_address:
            buffers = [[in_memory(access, str(value)) for value in row] for row in rows]
            self._kept.append(buffers)
            rows = [[ctypes.addressof(buffer) for buffer in row] for row in buffers]
        return np.ascontiguousarray(rows, dtype=VALUE_TYPES[access].dtype)

    def connect(self, wires: Sequence[Wire], others: Mapping[str, "Ports"]) -> None:
        """Lay the wires that come from the outputs of FMUs."""
        for wire in wires:
            target, source = self.inputs[wire.input.access], others[wire.source].outputs[wire.output.access]
            mine, theirs = self.pace, others[wire.source].pace
            # Those that are ahead together hear each other's newest values.
            shown = not (mine.ahead and mine.stride == theirs.stride)
            at, new = target.address_of(wire.input), source.address_of(wire.output)
            old, code = source.address_of(wire.output, shown=shown), wire.output.value_type.code
            between = None if mine.stride == theirs.stride else wire.between
            laid = self.conversions.setdefault(wire.source, [])
            if wire.between == "interpolate" and mine.linear and wire.input.kind == "Real":
                self.slopes.append(wire.input)
            if between in ("interpolate", "sum"):
                self._kept.append(np.zeros(1))
                place = self._kept[-1].ctypes.data
                if between == "interpolate":
                    laid.append(((BLEND, place, old, new, code, theirs.stride), (0.0, 0.0)))
                else:
                    self.sums.setdefault(wire.source, []).append(((SUM, place, new, code), (0.0, 0.0)))
                laid.append(((CONVERT, at, place, wire.input.value_type.code, 0), (wire.factor, wire.offset)))
                if between == "sum":
                    self._kept.append(np.zeros(1))
                    laid.append(((MOVE8, place, self._kept[-1].ctypes.data), (0.0, 0.0)))
            elif wire.input.value_type.code == code and (wire.factor, wire.offset) == (1.0, 0.0):
                self.moves.setdefault(wire.source, []).append(Move(at, old, target.values.itemsize))
            else:
                laid.append(((CONVERT, at, old, wire.input.value_type.code, code), (wire.factor, wire.offset)))
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
