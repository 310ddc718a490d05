"""Who feeds whom, in which unit, checked end by end; in which order the FMUs step, and how a cycle is taken."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from ..errors import InputError, said_of
from .interface import Interface, Variable, between, refer_to
from .load import Loaded
from .scenario import Connection
from .stimuli import Drive


@dataclass(frozen=True)
class Wire:
    """One scalar output that feeds one scalar input: input = factor * output + offset."""

    source: str
    output: Variable
    target: str
    input: Variable
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Group:
    """FMUs that step together: one by itself, or those of a cycle, with the outputs that go around in it."""

    members: tuple[str, ...]
    cyclic: bool = False
    around: tuple[tuple[str, Variable], ...] = ()

    def __str__(self) -> str:
        return " -> ".join([*self.members, self.members[0]])


def resolve_connections(connections: Sequence[Connection], interfaces: Mapping[str, Interface]) -> list[Wire]:
    """The connections, element by element.

    An InputError for an unknown end, a wrong direction, or ends whose length, type or unit differ.
    """
    wires: list[Wire] = []
    for number, connection in enumerate(connections, start=1):
        with said_of(f"connections[{number}]"):
            wires += _wires(connection, interfaces)
    return wires


def _wires(connection: Connection, interfaces: Mapping[str, Interface]) -> Iterator[Wire]:
    source, outputs = refer_to("output", connection.source, interfaces)
    target, inputs = refer_to("input", connection.target, interfaces)
    ends = f"'{connection.source}' -> '{connection.target}'"
    if len(outputs) != len(inputs):
        raise InputError(f"{ends}: {len(outputs)} and {len(inputs)} elements; their lengths must agree")
    for output, input_ in zip(outputs, inputs, strict=True):
        if output.kind != input_.kind:
            raise InputError(f"{ends}: types differ, {output.kind} and {input_.kind}")
        relative = output.relative or input_.relative
        conversion = between(output.unit, input_.unit, source.scales, target.scales, relative=relative)
        if conversion is None:
            raise InputError(f"{ends}: units differ, {output.unit} and {input_.unit}")
        if output.kind == "Integer":
            (low, high), (least, most) = output.value_type.whole_span, input_.value_type.whole_span
            if low < least or high > most:
                raise InputError(f"{ends}: {input_.access} does not take every {output.access}")
        yield Wire(source.name, output, target.name, input_, *(conversion if output.kind == "Real" else (1.0, 0.0)))


def check_single_sources(wires: Iterable[Wire], drives: Iterable[tuple[str, Drive]]) -> None:
    """Refuse an input that two sources feed; a drive comes with what the user called its stimulus."""
    taken: dict[tuple[str, str], str] = {}
    sources = [(w.target, w.input, f"'{w.source}.{w.output.name}'") for w in wires]
    sources += [(drive.fmu, variable, name) for name, drive in drives for variable in drive.variables]
    for fmu, variable, source in sources:
        before = taken.setdefault((fmu, variable.name), source)
        if before is not source:
            raise InputError(f"'{fmu}.{variable.name}' has two sources, {before} and {source}; one is possible")


def stepping_groups(names: Sequence[str], wires: Sequence[Wire], coupling: str | None) -> list[Group]:
    """The FMUs so that each steps after those that feed it, cycles in one group; ties as in the file.

    An InputError names a cycle where the scenario does not say how to take it.
    """
    if coupling is None:
        _refuse_cycle(names, wires)
    following: dict[str, set[str]] = {name: set() for name in names}
    for wire in wires:
        following[wire.source].add(wire.target)
    reached = {name: _reached(name, following) for name in names}
    member_of = {n: tuple(m for m in names if m == n or (m in reached[n] and n in reached[m])) for n in names}
    sorter: TopologicalSorter[tuple[str, ...]] = TopologicalSorter(dict.fromkeys(member_of.values(), ()))
    for wire in wires:
        if member_of[wire.source] != member_of[wire.target]:
            sorter.add(member_of[wire.target], member_of[wire.source])
    sorter.prepare()
    groups: list[Group] = []
    ready: set[tuple[str, ...]] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        members = min(ready, key=lambda group: names.index(group[0]))
        ready.remove(members)
        sorter.done(members)
        inside = [w for w in wires if w.source in members and w.target in members]
        for wire in inside:
            if wire.output.kind == "String":
                raise InputError(f"'{wire.source}.{wire.output.name}' goes around in a cycle; a String cannot")
        groups.append(Group(members, bool(inside), tuple(dict.fromkeys((w.source, w.output) for w in inside))))
    return groups


def check_states(groups: Sequence[Group], loaded: Mapping[str, Loaded], coupling: str | None) -> None:
    """Refuse to iterate over an FMU whose state cannot be set back."""
    for name in (name for group in groups if group.cyclic and coupling == "iterate" for name in group.members):
        fmu = loaded[name].fmu
        if not fmu.says("canGetAndSetFMUstate", "canGetAndSetFMUState"):
            raise InputError(
                f"run.coupling = \"iterate\": '{name}' ({fmu.label}) cannot get and set its state; "
                'coupling = "jacobi" needs no state'
            )


def _reached(name: str, following: dict[str, set[str]]) -> set[str]:
    """Whom the outputs of an FMU reach, directly or through others."""
    found: set[str] = set()
    waiting = list(following[name])
    while waiting:
        other = waiting.pop()
        if other not in found:
            found.add(other)
            waiting += following[other]
    return found


def _refuse_cycle(names: Sequence[str], wires: Iterable[Wire]) -> None:
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(names, ()))
    for wire in wires:
        sorter.add(wire.target, wire.source)
    try:
        sorter.prepare()
    except CycleError as error:
        cycle = error.args[1][:-1]
        first = min(range(len(cycle)), key=lambda i: names.index(cycle[i]))
        named = " -> ".join([*cycle[first:], *cycle[:first], cycle[first]])
        say = 'take one out, or say how it is taken: run.coupling = "jacobi" or "iterate" (of an .ssp: --coupling)'
        raise InputError(f"connections form a cycle: {named}; {say}") from error
