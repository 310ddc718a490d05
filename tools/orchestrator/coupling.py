"""Feedback: which FMUs form cycles, and how a cycle is taken."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from typing import Literal

from ..errors import InputError
from .connections import Wire, stepping_order
from .interface import Variable


@dataclass(frozen=True)
class Coupling:
    """How a cycle of connections is taken.

    Attributes
    ----------
    kind : str or None
        None: not at all; "jacobi": within a cycle every input is what the output was at the beginning of the step;
        "iterate": the step is made again from the same state until the values that go around no longer change
    tolerance : float
        a value x that changes by less than tolerance * (1 + |x|) counts as settled
    iterations : int
        so many at most
    """

    kind: Literal["jacobi", "iterate"] | None = None
    tolerance: float = 1e-12
    iterations: int = 50


@dataclass(frozen=True)
class Group:
    """FMUs that step together: one by itself, or those of a cycle, with the outputs that go around in it."""

    members: tuple[str, ...]
    cyclic: bool = False
    around: tuple[tuple[str, Variable], ...] = field(default=())

    def __str__(self) -> str:
        return " -> ".join([*self.members, self.members[0]])


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


def stepping_groups(names: Sequence[str], wires: Sequence[Wire], coupling: Coupling) -> list[Group]:
    """The FMUs so that each steps after those that feed it, cycles in one group; ties as in the file.

    Raises
    ------
    InputError
        a cycle, which is named, where the scenario does not say how to take it
    """
    if coupling.kind is None:
        return [Group((name,)) for name in stepping_order(names, wires)]
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
    order: list[tuple[str, ...]] = []
    ready: set[tuple[str, ...]] = set()
    while sorter.is_active():
        ready |= set(sorter.get_ready())
        following_group = min(ready, key=lambda group: names.index(group[0]))
        ready.remove(following_group)
        order.append(following_group)
        sorter.done(following_group)
    return [_group(members, members[0] in reached[members[0]], wires) for members in order]


def _group(members: tuple[str, ...], cyclic: bool, wires: Sequence[Wire]) -> Group:
    if not cyclic:
        return Group(members)
    inside = [w for w in wires if w.source in members and w.target in members]
    for wire in inside:
        if wire.output.kind == "String":
            raise InputError(f"'{wire.source}.{wire.output.name}' goes around in a cycle; a String cannot")
    around = dict.fromkeys((w.source, w.output) for w in inside)
    return Group(members, True, tuple(around))
