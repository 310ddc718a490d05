"""Connections: checked end by end, and the order of the FMUs that follows from them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from ..errors import InputError, nearest
from ..scenario import Connection
from .interface import Interface, Variable, refer
from .quantities import between
from .stimuli import Drive, input_variables


@dataclass(frozen=True)
class Wire:
    """One scalar output that feeds one scalar input: input = factor * output + offset."""

    source: str
    output: Variable
    target: str
    input: Variable
    factor: float = 1.0
    offset: float = 0.0


def resolve_connections(connections: Sequence[Connection], interfaces: Mapping[str, Interface]) -> list[Wire]:
    """The connections, element by element.

    Raises
    ------
    InputError
        an unknown end, a wrong direction, or ends whose length, type or unit differ
    """
    wires = []
    for number, connection in enumerate(connections, start=1):
        try:
            wires += _wires(connection, interfaces)
        except InputError as error:
            raise InputError(f"connections[{number}]: {error}") from error
    return wires


def _wires(connection: Connection, interfaces: Mapping[str, Interface]) -> Iterable[Wire]:
    source, outputs = refer(connection.source, interfaces, ("output",))
    for variable in outputs:
        if variable.causality != "output":
            known = [v.name for v in source.variables.values() if v.causality == "output"]
            close = nearest(variable.name, known)
            raise InputError(f"'{connection.source}' is not an output ({variable.causality}); {close}")
    target, inputs = input_variables(connection.target, interfaces)
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
            _check_span(ends, output, input_)
        yield Wire(source.name, output, target.name, input_, *(conversion if output.kind == "Real" else (1.0, 0.0)))


def _check_span(ends: str, output: Variable, input_: Variable) -> None:
    """Refuse to pass whole numbers on to a type that does not take them all."""
    (low, high), (least, most) = output.value_type.whole_span, input_.value_type.whole_span
    if low < least or high > most:
        raise InputError(f"{ends}: {input_.access} does not take every {output.access}")


def check_single_sources(wires: Iterable[Wire], drives: Iterable[tuple[str, Drive]]) -> None:
    """Refuse an input that two sources feed.

    Parameters
    ----------
    wires : iterable of Wire
    drives : iterable
        (what the user called the stimulus, drive)
    """
    taken: dict[tuple[str, str], str] = {}
    sources = [(w.target, w.input, f"'{w.source}.{w.output.name}'") for w in wires]
    sources += [(drive.fmu, variable, name) for name, drive in drives for variable in drive.variables]
    for fmu, variable, source in sources:
        before = taken.setdefault((fmu, variable.name), source)
        if taken[fmu, variable.name] is not source:
            raise InputError(f"'{fmu}.{variable.name}' has two sources, {before} and {source}; one is possible")


def stepping_order(names: Sequence[str], wires: Iterable[Wire]) -> list[str]:
    """The FMUs so that each steps after those that feed it; ties as in the file.

    Raises
    ------
    InputError
        a cycle, which is named
    """
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(names, ()))
    for wire in wires:
        sorter.add(wire.target, wire.source)
    try:
        sorter.prepare()
    except CycleError as error:
        cycle = error.args[1][:-1]
        first = min(range(len(cycle)), key=lambda i: names.index(cycle[i]))
        cycle = [*cycle[first:], *cycle[:first]]
        named = " -> ".join([*cycle, cycle[0]])
        say = 'take one out, or say how it is taken: run.coupling = "jacobi" or "iterate" (of an .ssp: --coupling)'
        raise InputError(f"connections form a cycle: {named}; {say}") from error
    order: list[str] = []
    ready: set[str] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        following = min(ready, key=names.index)
        ready.remove(following)
        order.append(following)
        sorter.done(following)
    return order
