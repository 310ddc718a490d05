"""Connections between FMUs, and the order and the pace of their steps.

An FMU steps with each step of the run, or with every n-th. A slow FMU steps at the last step of the run within its own
step. It gets the newest outputs of faster FMUs, and they use its old outputs until then. An FMU whose outputs are
interpolated steps ahead, at the beginning.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from ..errors import InputError, said_of
from .interface import FmuVariable, Interface, between, refer_to
from .load import Loaded
from .scenario import Connection, Scenario

WIDENED = (("Integer", "Real"), ("Integer", "Enumeration"), ("Enumeration", "Integer"))
"""Types of an output and an input that differ, where the input takes every value."""


@dataclass(frozen=True)
class Wire:
    """One scalar output that feeds one scalar input: input = factor * output + offset.

    `between` selects the transfer if one of the two steps less often.
    """

    source: str
    output: FmuVariable
    target: str
    input: FmuVariable
    factor: float = 1.0
    offset: float = 0.0
    between: str | None = None


@dataclass(frozen=True)
class Pace:
    """Pace of an FMU: with every `stride`-th step of the run, each `length` [s] long, and `ahead` or not.

    A `linear` FMU receives the derivatives of its interpolated inputs.
    """

    length: float
    stride: int = 1
    ahead: bool = False
    linear: bool = False

    @property
    def back(self) -> int:
        """Steps of the run between the beginning of its own step and the step with which it steps."""
        if self.ahead:
            return 0
        return self.stride - 1


@dataclass(frozen=True)
class StepGroup:
    """FMUs that step together: one alone, or the members of a cycle with the outputs that go around in it."""

    members: tuple[str, ...]
    cyclic: bool = False
    around: tuple[tuple[str, FmuVariable], ...] = ()

    def __str__(self) -> str:
        return " -> ".join(self.members + self.members[:1])


def resolve_connections(connections: Sequence[Connection], interfaces: Mapping[str, Interface]) -> list[Wire]:
    """Return the connections, element by element.

    Raises InputError for an unknown end, a wrong direction, or ends whose length, type or unit differ.
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
        if output.kind != input_.kind and (output.kind, input_.kind) not in WIDENED:
            raise InputError(f"{ends}: types differ, {output.kind} and {input_.kind}")
        relative = output.relative or input_.relative
        conversion: tuple[float, float] | None = (1.0, 0.0)
        if connection.convert is not False:
            conversion = between(output.unit, input_.unit, source.scales, target.scales, relative=relative)
        if conversion is None:
            raise InputError(f"{ends}: units differ, {output.unit} and {input_.unit}")
        if output.kind == "Integer" and input_.kind != "Real":
            (low, high), (least, most) = output.value_type.whole_span, input_.value_type.whole_span
            if low < least or high > most:
                raise InputError(f"{ends}: {input_.access} does not take every {output.access}")
        factor, offset = conversion
        if output.kind != "Real":
            factor, offset = 1.0, 0.0
        if connection.factor is not None or connection.offset is not None:
            if output.kind != "Real":
                raise InputError(f"{ends}: a linear transformation is for kind Real, not {output.kind}")
            offset += factor * (connection.offset or 0.0)
            factor *= 1.0 if connection.factor is None else connection.factor
        yield Wire(source.name, output, target.name, input_, factor, offset, connection.between)


def overruled_values(loaded: Mapping[str, Loaded], wires: Iterable[Wire], groups: Iterable[StepGroup]) -> list[str]:
    """Return a sentence for each input with a value and a connection from outside of these groups."""
    group_of: dict[str, StepGroup] = {}
    for group in groups:
        group_of.update(dict.fromkeys(group.members, group))
    notes = []
    for wire in wires:
        # Within an iterated cycle the value begins the iteration.
        is_around = wire.source in group_of and group_of[wire.source] is group_of.get(wire.target)
        if wire.input.name in loaded[wire.target].values and not is_around:
            end, start = f"{wire.target}.{wire.input.name}", f"{wire.source}.{wire.output.name}"
            notes.append(f"{end} has a value and a connection: the connection from {start} counts")
    return notes


def stepping_groups(names: Sequence[str], wires: Sequence[Wire], coupling: str | None) -> list[StepGroup]:
    """Order the FMUs so that each steps after its sources, cycles in one group; ties keep the order of the file.

    If every connection is delayed, all FMUs are one group. Raises InputError with the cycle if the scenario does not
    select a treatment.
    """
    if coupling is None:
        _refuse_cycle(names, wires)
    following: dict[str, set[str]] = {name: set() for name in names}
    for wire in wires:
        following[wire.source].add(wire.target)
    # FMUs that each FMU reaches, directly or through others.
    for through in names:
        for name in names:
            if through in following[name]:
                following[name] |= following[through]
    member_of: dict[str, tuple[str, ...]] = {}
    for name in names:
        together = [m for m in names if m == name or (m in following[name] and name in following[m])]
        member_of[name] = tuple(names if coupling == "delayed" else together)
    sorter: TopologicalSorter[tuple[str, ...]] = TopologicalSorter(dict.fromkeys(member_of.values(), ()))
    for wire in wires:
        if member_of[wire.source] != member_of[wire.target]:
            sorter.add(member_of[wire.target], member_of[wire.source])
    sorter.prepare()
    groups: list[StepGroup] = []
    ready: set[tuple[str, ...]] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        members = min(ready, key=lambda group: names.index(group[0]))
        ready.remove(members)
        sorter.done(members)
        inside = [w for w in wires if w.source in members and w.target in members]
        for wire in inside:
            if wire.output.value_type.by_address:
                output = f"'{wire.source}.{wire.output.name}' goes around in a cycle"
                raise InputError(f"{output}; a {wire.output.kind} cannot")
        groups.append(StepGroup(members, bool(inside), tuple(dict.fromkeys((w.source, w.output) for w in inside))))
    return groups


def check_states(groups: Sequence[StepGroup], loaded: Mapping[str, Loaded], coupling: str | None) -> None:
    """Refuse to iterate over an FMU whose state cannot be restored."""
    if coupling != "iterate":
        return
    for group in groups:
        for name in group.members if group.cyclic else ():
            fmu = loaded[name].fmu
            if not fmu.says("canGetAndSetFMUstate", "canGetAndSetFMUState"):
                raise InputError(
                    f"run.coupling = \"iterate\": '{name}' ({fmu.label}) cannot get and set its state; "
                    'coupling = "jacobi" needs no state'
                )


def _refuse_cycle(names: Sequence[str], wires: Iterable[Wire]) -> None:
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(names, ()))
    for wire in wires:
        sorter.add(wire.target, wire.source)
    try:
        sorter.prepare()
    except CycleError as error:
        cycle = error.args[1][:-1]
        first = min(range(len(cycle)), key=lambda i: names.index(cycle[i]))
        cycle_text = str(StepGroup(tuple(cycle[first:] + cycle[:first])))
        ways = 'run.coupling = "jacobi", "iterate" or "delayed" (of an .ssp: --coupling)'
        say = f"take one out, or say how it is taken: {ways}"
        raise InputError(f"connections form a cycle: {cycle_text}; {say}") from error


def paces_of(
    scenario: Scenario, loaded: Mapping[str, Loaded], wires: Sequence[Wire], groups: Sequence[StepGroup]
) -> dict[str, Pace]:
    """Return the pace of each FMU.

    Raises InputError in these cases:

    - A connection between different steps selects no transfer, or an impossible one.
    - FMUs of an iterated cycle have different steps.
    - A step is not a multiple of the FMU's internal step.
    """
    strides = {name: scenario.stride(name) for name in loaded}
    for wire in wires:
        _check_between(wire, strides[wire.source], strides[wire.target])
    iterated = scenario.run.coupling == "iterate"
    for group in groups:
        if iterated and len({strides[name] for name in group.members}) > 1:
            raise InputError(f"the cycle {group} is iterated, so its FMUs step together; give them one step_s")
    # Within a cycle of delayed connections no FMU waits for another.
    prompt = []
    for wire in wires:
        (group,) = [group for group in groups if wire.target in group.members]
        if wire.source not in group.members or iterated:
            prompt.append(wire)
    ahead = {w.source for w in wires if w.between == "interpolate" and strides[w.source] > strides[w.target]}
    while earlier := {w.source for w in prompt if w.target in ahead and strides[w.source] == strides[w.target]} - ahead:
        ahead |= earlier
    for wire in prompt:
        if wire.between == "sum" and wire.target in ahead and strides[wire.source] < strides[wire.target]:
            ends = f"'{wire.source}.{wire.output.name}' -> '{wire.target}.{wire.input.name}'"
            raise InputError(f"{ends}: outputs of '{wire.target}' are interpolated, so it steps before there is a sum")
    paces = {}
    for name, entry in loaded.items():
        length = scenario.fmus[name].step_s or scenario.run.step_s
        linear = entry.fmu.version == 2 and entry.fmu.says("canInterpolateInputs")
        paces[name] = Pace(length, strides[name], name in ahead, linear)
        _check_inside(name, entry, paces[name].length, scenario)
    return paces


def _check_between(wire: Wire, source: int, target: int) -> None:
    if source == target:
        return
    ends = f"'{wire.source}.{wire.output.name}' -> '{wire.target}.{wire.input.name}'"
    ways, slower = ("hold", "sum"), wire.target
    if source > target:
        ways, slower = ("hold", "interpolate"), wire.source
    choices = " or ".join(f'"{way}"' for way in ways)
    if wire.between not in ways:
        raise InputError(f"{ends}: '{slower}' steps less often; say between = {choices}")
    if wire.between != "hold" and wire.output.kind != "Real":
        raise InputError(f'{ends}: between = "{wire.between}" is for numbers of kind Real, not {wire.output.kind}')
    if max(source, target) % min(source, target):
        raise InputError(f"{ends}: the longer of their steps must be a whole multiple of the shorter")


def _check_inside(name: str, entry: Loaded, step: float, scenario: Scenario) -> None:
    """Refuse a step that is not a multiple of the internal step that an FMU of FMI 3.0 declares."""
    length_text = getattr(entry.fmu.description.coSimulation, "fixedInternalStepSize", None)
    try:
        inside = 0.0 if length_text is None else float(length_text)
    except ValueError as error:
        raise InputError(f"{entry.fmu.label}: modelDescription.xml, fixedInternalStepSize: {error}") from error
    if inside > 0.0 and (round(step / inside) < 1 or abs(step / inside - round(step / inside)) > 1e-9):
        whom = f"'{name}' ({entry.fmu.label})"
        key = "run.step_s" if scenario.fmus[name].step_s is None else f"fmus.{name}.step_s"
        raise InputError(f"{key} = {step!r} is not a multiple of the {inside!r} s by which {whom} steps inside")
