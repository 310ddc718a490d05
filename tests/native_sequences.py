"""Legal and illegal sequences of calls on a native FMU: an error status and a log line, never a crash."""

import ctypes as ct
import math
from collections.abc import Callable
from dataclasses import dataclass

from native_driver import ERROR, OK, Library


@dataclass(frozen=True)
class Entry:
    """A variable: what it is and what it starts with."""

    name: str
    kind: str
    causality: str
    variability: str
    references: list[int]
    count: int
    starts: list[float]


@dataclass(frozen=True)
class Subject:
    """A library and the table of its variables."""

    library: Library
    table: list[Entry]

    def find(self, causality: str, *variabilities: str, kind: str = "real") -> Entry | None:
        """The first variable of that kind."""
        for e in self.table:
            if e.causality == causality and e.kind == kind and (not variabilities or e.variability in variabilities):
                return e
        return None

    def refused(self, call: Callable[[], int], *, status: int = ERROR) -> str:
        """The message with which a call is refused; anything else is a failure."""
        before = len(self.library.log)
        given = call()
        assert given == status, f"status {given} instead of {status}"
        said = self.library.log[before:]
        assert len(said) == 1, f"{len(said)} log lines"
        assert said[0][0] == ERROR
        assert said[0][1] == "logStatusError"
        assert said[0][2]
        return said[0][2]

    def new(self) -> int:
        instance = self.library.instantiate()
        assert instance is not None
        return instance

    def fail_step(self, instance: int) -> bool:
        """Bring a stepping instance into the phase after a failed step, where its inputs can do that."""
        for e in self.table:
            if e.causality == "input" and e.kind == "real":
                assert self.library.set(instance, "real", e.references, [math.nan] * e.count) == OK
        return self.library.step(instance, 0.0, 0.01) == ERROR


def at_phase(subject: Subject, phase: str) -> int | None:
    """A new instance in a phase; None where the component cannot get there."""
    library = subject.library
    instance = subject.new()
    if phase == "instantiated":
        return instance
    assert library.enter(instance) == OK
    if phase == "initialising":
        return instance
    assert library.leave(instance) == OK
    if phase == "failed" and not subject.fail_step(instance):
        library.free(instance)
        return None
    if phase == "terminated":
        assert library.call("Terminate", instance) == OK
    return instance


PHASES = ("instantiated", "initialising", "stepping", "failed", "terminated")
GETTING = ("initialising", "stepping", "failed", "terminated")
SETTING = ("instantiated", "initialising", "stepping")
ALLOWED = {
    "enter": ("instantiated",),
    "leave": ("initialising",),
    "step": ("stepping",),
    "terminate": ("stepping", "failed"),
    "reset": PHASES,
    "get": GETTING,
    "set input": SETTING,
    "set tunable": SETTING,
    "set fixed": ("instantiated", "initialising"),
    "set output": (),
    "set time": (),
    "state": PHASES,
    "logging": PHASES,
}


def calls(subject: Subject) -> dict[str, Callable[[int], int]]:
    """The calls whose order the standard rules, those that the component's variables allow."""
    library = subject.library
    found: dict[str, Callable[[int], int]] = {
        "enter": library.enter,
        "leave": library.leave,
        "step": lambda i: library.step(i, 0.0, 0.01),
        "terminate": lambda i: library.call("Terminate", i),
        "reset": lambda i: library.call("Reset", i),
        "get": lambda i: library.get(i, "real", [0], 1)[0],
        "set time": lambda i: library.set(i, "real", [0], [0.0]),
        "state": lambda i: library.discard(i, library.save(i)),
        "logging": lambda i: library.call(
            "SetDebugLogging", i, ct.c_bool(True) if library.fmi == 3 else 1, ct.c_size_t(0), None
        ),
    }
    for name, entry in (
        ("set input", subject.find("input")),
        ("set tunable", subject.find("parameter", "tunable")),
        ("set fixed", subject.find("parameter", "fixed")),
        ("set output", subject.find("output")),
    ):
        if entry is not None:
            found[name] = lambda i, e=entry: library.set(i, e.kind, e.references, e.starts)
    return found


def check_every_call_in_every_phase(subject: Subject) -> None:
    """What the state machine allows is done, what it does not is refused; the instance can be used on."""
    library = subject.library
    for phase in PHASES:
        for name, call in calls(subject).items():
            instance = at_phase(subject, phase)
            if instance is None:
                continue
            if phase in ALLOWED[name]:
                assert call(instance) == OK, f"{name} {phase}: {library.log[-1:]}"
            else:
                subject.refused(lambda call=call, instance=instance: call(instance))
            assert library.call("Reset", instance) == OK
            library.start(instance)
            assert library.step(instance, 0.0, 0.01) == OK
            library.free(instance)


def check_that_the_experiment_is_set_up(subject: Subject) -> None:
    """FMI 2.0 has no start time before fmi2SetupExperiment, nor after a reset."""
    library = subject.library
    if library.fmi == 3:
        return
    instance = subject.new()
    assert "SetupExperiment" in subject.refused(lambda: library.call("EnterInitializationMode", instance))
    assert library.enter(instance) == OK
    assert library.call("Reset", instance) == OK
    assert "SetupExperiment" in subject.refused(lambda: library.call("EnterInitializationMode", instance))
    library.start(instance)
    library.free(instance)


def check_instances(subject: Subject) -> None:
    """A hundred at once, each with a memory of its own; again after they are freed; a missing one is an error."""
    library = subject.library
    shown = [e for e in subject.table if e.causality == "output"]
    for _ in range(2):
        many = [subject.new() for _ in range(100)]
        for k, instance in enumerate(many):
            library.start(instance, float(k))
        for k, instance in enumerate(many):
            assert library.step(instance, float(k), 0.01 * (k + 1)) == OK
        for k, instance in enumerate(many):
            assert library.get(instance, "real", [0], 1) == (OK, [k + 0.01 * (k + 1)])
            for e in shown:
                assert library.get(instance, e.kind, e.references, e.count)[0] == OK
        for instance in many:
            library.free(instance)
    library.free(None)
    for name, call in calls(subject).items():
        if name != "state":
            assert call(0) == ERROR
    assert library.call(f"Get{library.state_word}", None, ct.byref(ct.c_void_p())) == ERROR


def check_instantiation(subject: Subject) -> None:
    """Wrong identity, no name, no callbacks, event mode in co-simulation."""
    library = subject.library
    count = len(library.log)
    assert library.instantiate(token=b"{00000000-0000-0000-0000-000000000000}") is None
    assert "this FMU's is" in library.log[-1][2]
    assert library.instantiate(token=None) is None
    assert library.instantiate(name=None) is None
    assert library.instantiate(name=b" ") is None
    assert "no name" in library.log[-1][2]
    assert len(library.log) == count + 4
    if library.fmi == 3:
        assert library.instantiate(kind=0) is None
    quiet = library.instantiate(callbacks=False)
    if library.fmi == 2:
        assert quiet is None
    else:
        assert quiet is not None
        library.start(quiet)
        assert library.step(quiet, 5.0, 0.1) == ERROR
        library.free(quiet)
