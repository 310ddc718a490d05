"""What a step consists of: the operations of all FMUs in their order, made once for both loops."""

import ctypes
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import operations as op
from .bus import FmuBus, Port
from .coupling import Coupling, Group
from .interface import Variable
from .slave import Slave
from .value_types import VALUE_TYPES


@dataclass(frozen=True)
class Place:
    """Whose operation a row is: the FMU, the function that it calls, the port or the value that it looks at."""

    fmu: str
    call: str = ""
    port: Port | None = None
    variable: Variable | None = None
    group: Group | None = None


@dataclass
class Program:
    """The operations of a step, with what a message needs of each.

    Attributes
    ----------
    rows, numbers : list
        of `trihedron.tools.orchestrator.operations`
    places : list of Place
    kept : list
        memory that addresses point to
    cursors : int
        how many feeds there are
    """

    rows: list[tuple[int, ...]] = field(default_factory=list)
    numbers: list[tuple[float, float]] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    kept: list[Any] = field(default_factory=list)
    cursors: int = 0

    def add(self, place: Place, *row: int, numbers: tuple[float, float] = (0.0, 0.0)) -> None:
        """Append an operation."""
        self.rows.append((*row, *(0,) * (op.WIDTH - len(row))))
        self.numbers.append(numbers)
        self.places.append(place)

    def reserve(self, words: int) -> int:
        """Address of so many words of memory, zero."""
        memory = np.zeros(words, dtype=np.int64)
        self.kept.append(memory)
        return memory.ctypes.data

    def add_transfers(self, name: str, bus: FmuBus, sources: Collection[str]) -> None:
        """Pass the outputs of some FMUs on to the inputs of one."""
        for source in sources:
            for move in bus.moves.get(source, ()):
                if move.size == 8:
                    self.add(Place(name), op.MOVE8, move.target, move.source)
                else:
                    self.add(Place(name), op.MOVE, move.target, move.source, move.size)
            for c in bus.conversions.get(source, ()):
                row = (op.CONVERT, c.target, c.source, c.to_type, c.from_type)
                self.add(Place(name), *row, numbers=(c.factor, c.offset))

    def add_feeds(self, name: str, bus: FmuBus) -> None:
        """Stimuli."""
        for feed in bus.feeds:
            row = (feed.begins.ctypes.data, len(feed.begins), feed.rows, feed.width, feed.target, self.cursors)
            self.add(Place(name), op.FEED, *row)
            self.cursors += 1

    def _add_access(self, slave: Slave, verb: str, port: Port, references: int, values: int) -> None:
        name = slave.accessor(verb, port.access)
        row = (slave.address(name), slave.component, ctypes.addressof(port.references), references, port.address)
        if slave.prefix == "fmi2":
            self.add(Place(slave.name, name, port), op.CALL4, *row)
        else:
            self.add(Place(slave.name, name, port), op.CALL5, *row, values)

    def add_sets(self, slave: Slave, bus: FmuBus, *, constants: bool) -> None:
        """Set the inputs that change, or all of them."""
        for port in bus.inputs.values():
            references = len(port.references) if constants else port.changing_references
            if references:
                self._add_access(slave, "Set", port, references, len(port.variables) if constants else port.changing)

    def add_gets(self, slave: Slave, bus: FmuBus) -> None:
        """Get the outputs and look whether they are finite."""
        for port in bus.outputs.values():
            self._add_access(slave, "Get", port, len(port.references), len(port.variables))
        for access, port in bus.outputs.items():
            if VALUE_TYPES[access].dtype is np.float64:
                self.add(Place(slave.name, port=port), op.FINITE, port.address, len(port.variables))

    def add_step(self, slave: Slave, *, final: bool) -> None:
        """doStep; `final`: no state from before will be set again."""
        name = f"{slave.prefix}DoStep"
        place = 0 if slave.prefix == "fmi2" else self.reserve(2)
        code = op.STEP2 if slave.prefix == "fmi2" else op.STEP3
        self.add(Place(slave.name, name), code, slave.address(name), slave.component, int(final), place)


def step_program(
    groups: Sequence[Group], slaves: Mapping[str, Slave], buses: Mapping[str, FmuBus], coupling: Coupling
) -> Program:
    """The operations of one step of all FMUs.

    Parameters
    ----------
    groups : sequence of Group
        the FMUs in their order, those that form a cycle together
    slaves, buses : mapping
        by the FMU's name
    coupling : Coupling
        how cycles are taken
    """
    program = Program()
    for group in groups:
        everybody = [name for g in groups for name in g.members]
        if group.cyclic and coupling.kind == "jacobi":
            for name in group.members:
                program.add_transfers(name, buses[name], group.members)
            sources = [name for name in everybody if name not in group.members]
            for name in group.members:
                _add_member(program, slaves[name], buses[name], sources, final=True)
        elif group.cyclic:
            _add_iteration(program, group, slaves, buses, everybody, coupling)
        else:
            _add_member(program, slaves[group.members[0]], buses[group.members[0]], everybody, final=True)
    return program


def _add_member(program: Program, slave: Slave, bus: FmuBus, sources: Sequence[str], *, final: bool) -> None:
    """Inputs in, step, outputs out."""
    program.add_feeds(slave.name, bus)
    program.add_transfers(slave.name, bus, sources)
    program.add_sets(slave, bus, constants=False)
    program.add_step(slave, final=final)
    program.add_gets(slave, bus)


def _add_iteration(
    program: Program,
    group: Group,
    slaves: Mapping[str, Slave],
    buses: Mapping[str, FmuBus],
    everybody: Sequence[str],
    coupling: Coupling,
) -> None:
    """Make the step again from the same state until the values that go around no longer change."""
    states = {name: program.reserve(1) for name in group.members}
    for name, state in states.items():
        _add_state(program, slaves[name], slaves[name].get_state, op.STATE, state)
    program.add(Place(group.members[0]), op.BEGIN)
    again = len(program.rows)
    for name, state in states.items():
        _add_state(program, slaves[name], slaves[name].set_state, op.RESTORE, state)
    for name in group.members:
        _add_member(program, slaves[name], buses[name], everybody, final=False)
    add_comparisons(program, group, buses, coupling)
    place = Place(group.members[0], group=group)
    program.add(place, op.REPEAT, again, coupling.iterations)
    nothing = program.reserve(1)
    for name, state in states.items():
        _add_state(program, slaves[name], slaves[name].free_state, op.STATE, state)
        # FMI wants it to be NULL then; PythonFMU leaves it.
        program.add(Place(name), op.MOVE8, state, nothing)


def _add_state(program: Program, slave: Slave, name: str, code: int, state: int) -> None:
    program.add(Place(slave.name, name), code, slave.address(name), slave.component, state)


def add_comparisons(program: Program, group: Group, buses: Mapping[str, FmuBus], coupling: Coupling) -> None:
    """Compare each value that goes around with what it was before."""
    for fmu, variable in group.around:
        port = buses[fmu].outputs[variable.access]
        row = (port.address_of(variable), program.reserve(1), variable.value_type.code)
        program.add(Place(fmu, variable=variable), op.COMPARE, *row, numbers=(coupling.tolerance, 0.0))
