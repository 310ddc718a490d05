"""Calls on a native FMU, legal and illegal sequences, values, times and states: a status and a log line, no crash.

As a program (python native_checks.py SUBJECT.json) it runs all checks, for memory checkers.
"""

import ctypes as ct
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from native_driver import DISCARD, ERROR, OK, Library


@dataclass(frozen=True)
class Entry:
    """A variable: its kind and its start value."""

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
        """Return the first variable of that kind."""
        for e in self.table:
            if e.causality == causality and e.kind == kind and (not variabilities or e.variability in variabilities):
                return e
        return None

    def refused(self, call: Callable[..., Any], *arguments: Any, status: int = ERROR) -> str:
        """Return the message of a refused call; anything else is a failure. A status may precede values."""
        before = len(self.library.log)
        answer = call(*arguments)
        actual = answer[0] if isinstance(answer, tuple) else answer
        assert actual == status, f"status {actual} instead of {status}"
        lines = self.library.log[before:]
        assert len(lines) == 1, f"{len(lines)} log lines"
        assert lines[0][0] == ERROR
        assert lines[0][1] == "logStatusError"
        assert lines[0][2]
        return lines[0][2]

    def new(self) -> int:
        instance = self.library.instantiate()
        assert instance is not None
        return instance

    def fail_step(self, instance: int) -> bool:
        """Bring a stepping instance into the phase after a failed step, if its inputs can."""
        for e in self.table:
            if e.causality == "input" and e.kind == "real":
                assert self.library.set(instance, "real", e.references, [math.nan] * e.count) == OK
        return self.library.step(instance, 0.0, 0.01) == ERROR


def at_phase(subject: Subject, phase: str) -> int | None:
    """Return a new instance in a phase; None if the component cannot reach it."""
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
    """Return the calls in the standard's order that the component's variables allow."""
    library = subject.library
    by_name: dict[str, Callable[[int], int]] = {
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
            by_name[name] = lambda i, e=entry: library.set(i, e.kind, e.references, e.starts)
    return by_name


def check_every_call_in_every_phase(subject: Subject) -> None:
    """Allowed calls are done, others refused; the instance remains usable."""
    library = subject.library
    for phase in PHASES:
        for name, call in calls(subject).items():
            instance = at_phase(subject, phase)
            if instance is None:
                continue
            if phase in ALLOWED[name]:
                assert call(instance) == OK, f"{name} {phase}: {library.log[-1:]}"
            else:
                subject.refused(call, instance)
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
    assert "SetupExperiment" in subject.refused(library.call, "EnterInitializationMode", instance)
    assert library.enter(instance) == OK
    assert library.call("Reset", instance) == OK
    assert "SetupExperiment" in subject.refused(library.call, "EnterInitializationMode", instance)
    library.start(instance)
    library.free(instance)


def check_instances(subject: Subject) -> None:
    """Make a hundred at once, each with memory of its own; again after they are freed; a missing one is an error."""
    library = subject.library
    outputs = [e for e in subject.table if e.causality == "output"]
    for _ in range(2):
        many = [subject.new() for _ in range(100)]
        for k, instance in enumerate(many):
            library.start(instance, float(k))
        for k, instance in enumerate(many):
            assert library.step(instance, float(k), 0.01 * (k + 1)) == OK
        for k, instance in enumerate(many):
            assert library.get(instance, "real", [0], 1) == (OK, [k + 0.01 * (k + 1)])
            for e in outputs:
                assert library.get(instance, e.kind, e.references, e.count)[0] == OK
        for instance in many:
            library.free(instance)
    library.free(None)
    for name, call in calls(subject).items():
        if name != "state":
            assert call(0) == ERROR
    assert library.call(f"Get{library.state_word}", None, ct.byref(ct.c_void_p())) == ERROR


def check_instantiation(subject: Subject) -> None:
    """Try a wrong identity, no name, no callbacks, event mode in co-simulation."""
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


def check_values(subject: Subject) -> None:
    """Wrong references, types, sizes, missing arrays, values out of range are refused, and nothing changes."""
    library = subject.library
    instance = subject.new()
    assert library.enter(instance) == OK
    last = subject.table[-1].references[-1]
    for beyond in (last + 1, last + 2, 100_000):
        assert "no value reference" in subject.refused(library.get, instance, "real", [beyond], 1)
    assert "no value reference" in subject.refused(library.set, instance, "real", [2**32 - 1], [1.0])
    assert "another type" in subject.refused(library.get, instance, "boolean", [0], 1)
    counts = [ct.c_size_t(1)] if library.fmi == 3 else []
    texts = ((ct.c_uint * 1)(1), ct.c_size_t(1), (ct.c_char_p * 1)(b"text"), *counts)
    for call in ("GetString", "SetString"):
        assert "no variable" in subject.refused(library.call, call, instance, *texts)
    name = "Real" if library.fmi == 2 else "Float64"
    for arrays in (
        (None, ct.c_size_t(1), (ct.c_double * 1)(), *counts),
        ((ct.c_uint * 1)(0), ct.c_size_t(1), None, *counts),
    ):
        assert "missing" in subject.refused(library.call, f"Get{name}", instance, *arrays)
        assert "missing" in subject.refused(library.call, f"Set{name}", instance, *arrays)
    assert library.call(f"Get{name}", instance, None, ct.c_size_t(0), None, *[ct.c_size_t(0)] * len(counts)) == OK
    array = next((e for e in subject.table if e.count > 1 and e.kind == "real"), None)
    if library.fmi == 3 and array is not None:
        for wrong in (array.count - 1, array.count + 1, 0):
            message = subject.refused(library.get, instance, "real", array.references, wrong)
            assert f"{wrong} values are given for {array.count} elements" in message
    parameter = subject.find("parameter")
    if parameter is not None:
        for value in (math.nan, math.inf):
            values = [*parameter.starts[:-1], value]
            message = subject.refused(library.set, instance, "real", parameter.references, values)
            assert "not a finite number" in message
        status, current = library.get(instance, "real", parameter.references, parameter.count)
        assert (status, current) == (OK, parameter.starts)
    choice = subject.find("parameter", kind="enumeration")
    if choice is not None:
        assert "outside" in subject.refused(library.set, instance, "enumeration", choice.references, [0])
        assert "outside" in subject.refused(library.set, instance, "enumeration", choice.references, [10**6])
    library.free(instance)


def check_time(subject: Subject) -> None:
    """Try steps of length zero or less, from elsewhere, past the end; a last step of zero does no harm."""
    library = subject.library
    instance = subject.new()
    assert "before the start" in subject.refused(library.enter, instance, 2.0, 1.0)
    assert "not a finite number" in subject.refused(library.enter, instance, math.nan)
    assert library.enter(instance, 1.0, 2.0) == OK
    assert library.leave(instance) == OK
    for time, step in (
        (1.0, 0.0),
        (1.0, -0.1),
        (math.nan, 0.1),
        (1.0, math.inf),
        (1.0, math.nan),
        (1.5, 0.1),
        (0.0, 0.1),
        (1.0, 1.5),
    ):
        subject.refused(library.step, instance, time, step)
    for k in range(10):
        assert library.step(instance, 1.0 + k * 0.1, 0.1) == OK, library.log
    outputs = [e for e in subject.table if e.causality == "output"]
    before = [library.get(instance, e.kind, e.references, e.count) for e in outputs if e.variability == "discrete"]
    assert library.step(instance, 2.0, 1e-14) == OK
    assert [
        library.get(instance, e.kind, e.references, e.count) for e in outputs if e.variability == "discrete"
    ] == before
    if library.fmi == 3:
        places = [ct.c_bool(True), None, None, None, None]
        assert "no place" in subject.refused(
            library.call, "DoStep", instance, ct.c_double(2.0), ct.c_double(0.1), *places
        )
    library.free(instance)


def run_on(subject: Subject, instance: int, start: float) -> list[list[float]]:
    """Run ten steps and get all outputs after each."""
    library, values = subject.library, []
    outputs = [e for e in subject.table if e.causality == "output"]
    for k in range(10):
        assert library.step(instance, start + k * 0.01, 0.01) == OK, library.log
        values += [library.get(instance, e.kind, e.references, e.count)[1] for e in outputs]
    return values


def check_states(subject: Subject) -> None:
    """States are complete across get, set, serialise and other instances; wrong, damaged and missing ones are
    refused."""
    library = subject.library
    first, second = subject.new(), subject.new()
    library.start(first)
    library.start(second)
    run_on(subject, first, 0.0)
    state = library.save(first)
    block = library.serialise(first, state)
    rest = run_on(subject, first, 0.1)
    assert library.restore(first, state) == OK
    assert run_on(subject, first, 0.1) == rest
    assert library.restore(second, state) == OK
    assert run_on(subject, second, 0.1) == rest
    status, carried = library.deserialise(second, block)
    assert status == OK
    assert library.serialise(second, carried) == block
    assert library.restore(second, carried) == OK
    assert run_on(subject, second, 0.1) == rest
    assert library.call(f"Get{library.state_word}", second, ct.byref(carried)) == OK
    assert library.discard(second, carried) == OK
    assert carried.value is None
    assert library.discard(second, carried) == OK
    for wrong in (b"", block[:-1], block + b"\0", bytes(len(block)), block[:-8] + b"damaged!", b"\xff" * len(block)):
        subject.refused(library.deserialise, first, wrong)
    for at in (0, 9, 17, 25, 33, 40, len(block) - 1):
        flipped = block[:at] + bytes([block[at] ^ 4]) + block[at + 1 :]
        subject.refused(library.deserialise, first, flipped)
    blob = ct.create_string_buffer(block[:32] + bytes(len(block) - 32), len(block))
    subject.refused(library.restore, first, ct.cast(blob, ct.c_void_p))
    subject.refused(library.restore, first, ct.c_void_p(None))
    subject.refused(library.call, f"Get{library.state_word}", first, None)
    subject.refused(library.call, f"Serialize{library.state_word}", first, state, None, ct.c_size_t(len(block)))
    subject.refused(library.call, f"Serialize{library.state_word}", first, state, blob, ct.c_size_t(3))
    subject.refused(library.call, f"Serialized{library.state_word}Size", first, state, None)
    assert library.discard(first, state) == OK
    library.free(first)
    library.free(second)


def check_logging(subject: Subject) -> None:
    """Only chosen categories are logged; unknown ones are refused; FMI 3.0 is silent with logging off."""
    library = subject.library
    instance = subject.new()
    yes, no = (ct.c_bool(True), ct.c_bool(False)) if library.fmi == 3 else (1, 0)
    for names, logged in (
        ((b"logStatusWarning",), False),
        ((b"logStatusError",), True),
        ((b"logStatusWarning", b"logStatusError"), True),
        ((b"logStatusWarning", b"logAll"), True),
        ((b"logStatusWarning",), False),
        ((), True),
    ):
        categories = (ct.c_char_p * len(names))(*names)
        assert library.call("SetDebugLogging", instance, yes, ct.c_size_t(len(names)), categories) == OK
        before = len(library.log)
        assert library.step(instance, 0.0, 0.1) == ERROR
        assert len(library.log) == before + logged, names
    for wrong in ((ct.c_char_p * 1)(b"logNothing"), (ct.c_char_p * 1)(None), None):
        subject.refused(library.call, "SetDebugLogging", instance, yes, ct.c_size_t(1), wrong)
    assert library.call("SetDebugLogging", instance, no, ct.c_size_t(0), None) == OK
    before = len(library.log)
    assert library.step(instance, 0.0, 0.1) == ERROR
    assert len(library.log) == before + (library.fmi == 2)
    library.free(instance)


def check_what_is_lacking(subject: Subject) -> None:
    """Functions for missing features refuse."""
    library = subject.library
    instance = subject.new()
    library.start(instance)
    reference = (ct.c_uint * 1)(1)
    if library.fmi == 2:
        real = (ct.c_double * 1)()
        order = (ct.c_int * 1)(1)
        for name in ("SetRealInputDerivatives", "GetRealOutputDerivatives"):
            subject.refused(library.call, name, instance, reference, ct.c_size_t(1), order, real)
        size = ct.c_size_t(1)
        subject.refused(
            library.call, "GetDirectionalDerivative", instance, reference, size, reference, size, real, real
        )
        subject.refused(library.call, "CancelStep", instance)
        for name in ("GetStatus", "GetIntegerStatus", "GetStringStatus"):
            subject.refused(library.call, name, instance, 0, real, status=DISCARD)
        last = ct.c_double()
        assert library.call("GetRealStatus", instance, 2, ct.byref(last)) == OK
        assert last.value == 0.0
        subject.refused(library.call, "GetRealStatus", instance, 0, ct.byref(last), status=DISCARD)
    else:
        for name in ("EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "EnterContinuousTimeMode"):
            subject.refused(library.call, name, instance)
        count = ct.c_size_t()
        subject.refused(library.call, "GetNumberOfContinuousStates", instance, ct.byref(count))
        for kind in ("Float32", "Int8", "UInt64", "Binary"):
            subject.refused(library.call, f"Get{kind}", instance, reference, ct.c_size_t(1), None, None, ct.c_size_t(1))
    library.free(instance)


CHECKS = {name: check for name, check in list(globals().items()) if name.startswith("check_")}


def main(path: Path) -> int:
    """Run all checks on the library of a description; print the failures."""
    subject = json.loads(path.read_text())
    table = [Entry(**row) for row in subject["table"]]
    failures = 0
    for name, check in CHECKS.items():
        try:
            check(Subject(Library(Path(subject["binary"]), subject["fmi"], subject["token"]), table))
        except AssertionError as error:
            failures += 1
            print(f"{name}: {error}")
    print(f"{len(CHECKS)} checks, {failures} failures")
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
