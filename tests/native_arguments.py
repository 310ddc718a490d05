"""Wrong values, times and states on a native FMU; what it has not, and what it logs."""

import ctypes as ct
import math

from native_driver import DISCARD, ERROR, OK
from native_sequences import Subject


def check_values(subject: Subject) -> None:
    """Wrong references, types, sizes, missing arrays, values out of range: refused, and nothing is changed."""
    library = subject.library
    instance = subject.new()
    assert library.enter(instance) == OK
    last = subject.table[-1].references[-1]
    for beyond in (last + 1, last + 2, 100_000):
        assert "no value reference" in subject.refused(lambda r=beyond: library.get(instance, "real", [r], 1)[0])
    assert "no value reference" in subject.refused(lambda: library.set(instance, "real", [2**32 - 1], [1.0]))
    assert "another type" in subject.refused(lambda: library.get(instance, "boolean", [0], 1)[0])
    counts = [ct.c_size_t(1)] if library.fmi == 3 else []
    texts = ((ct.c_uint * 1)(1), ct.c_size_t(1), (ct.c_char_p * 1)(b"text"), *counts)
    for call in ("GetString", "SetString"):
        assert "no variable" in subject.refused(lambda call=call: library.call(call, instance, *texts))
    name = "Real" if library.fmi == 2 else "Float64"
    for arrays in (
        (None, ct.c_size_t(1), (ct.c_double * 1)(), *counts),
        ((ct.c_uint * 1)(0), ct.c_size_t(1), None, *counts),
    ):
        assert "missing" in subject.refused(lambda arrays=arrays: library.call(f"Get{name}", instance, *arrays))
        assert "missing" in subject.refused(lambda arrays=arrays: library.call(f"Set{name}", instance, *arrays))
    assert library.call(f"Get{name}", instance, None, ct.c_size_t(0), None, *[ct.c_size_t(0)] * len(counts)) == OK
    array = next((e for e in subject.table if e.count > 1 and e.kind == "real"), None)
    if library.fmi == 3 and array is not None:
        for wrong in (array.count - 1, array.count + 1, 0):
            said = subject.refused(lambda wrong=wrong: library.get(instance, "real", array.references, wrong)[0])
            assert f"{wrong} values are given for {array.count} elements" in said
    parameter = subject.find("parameter")
    if parameter is not None:
        for value in (math.nan, math.inf):
            values = [*parameter.starts[:-1], value]
            said = subject.refused(lambda v=values: library.set(instance, "real", parameter.references, v))
            assert "not a finite number" in said
        status, kept = library.get(instance, "real", parameter.references, parameter.count)
        assert (status, kept) == (OK, parameter.starts)
    choice = subject.find("parameter", kind="enumeration")
    if choice is not None:
        assert "outside" in subject.refused(lambda: library.set(instance, "enumeration", choice.references, [0]))
        assert "outside" in subject.refused(lambda: library.set(instance, "enumeration", choice.references, [10**6]))
    library.free(instance)


def check_time(subject: Subject) -> None:
    """Steps that are none, from elsewhere, past the end; a last step of nothing does no harm."""
    library = subject.library
    instance = subject.new()
    assert "before the start" in subject.refused(lambda: library.enter(instance, 2.0, 1.0))
    assert "not a finite number" in subject.refused(lambda: library.enter(instance, math.nan))
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
        subject.refused(lambda t=time, h=step: library.step(instance, t, h))
    for k in range(10):
        assert library.step(instance, 1.0 + k * 0.1, 0.1) == OK, library.log
    shown = [e for e in subject.table if e.causality == "output"]
    before = [library.get(instance, e.kind, e.references, e.count) for e in shown if e.variability == "discrete"]
    assert library.step(instance, 2.0, 1e-14) == OK
    assert [
        library.get(instance, e.kind, e.references, e.count) for e in shown if e.variability == "discrete"
    ] == before
    if library.fmi == 3:
        places = [ct.c_bool(True), None, None, None, None]
        assert "no place" in subject.refused(
            lambda: library.call("DoStep", instance, ct.c_double(2.0), ct.c_double(0.1), *places)
        )
    library.free(instance)


def run_on(subject: Subject, instance: int, start: float) -> list[list[float]]:
    """Ten steps and all outputs after each."""
    library, seen = subject.library, []
    shown = [e for e in subject.table if e.causality == "output"]
    for k in range(10):
        assert library.step(instance, start + k * 0.01, 0.01) == OK, library.log
        seen += [library.get(instance, e.kind, e.references, e.count)[1] for e in shown]
    return seen


def check_states(subject: Subject) -> None:
    """Complete across get, set, serialise and other instances; wrong, damaged and missing ones are refused."""
    library = subject.library
    first, other = subject.new(), subject.new()
    library.start(first)
    library.start(other)
    run_on(subject, first, 0.0)
    state = library.save(first)
    block = library.serialise(first, state)
    rest = run_on(subject, first, 0.1)
    assert library.restore(first, state) == OK
    assert run_on(subject, first, 0.1) == rest
    assert library.restore(other, state) == OK
    assert run_on(subject, other, 0.1) == rest
    status, carried = library.deserialise(other, block)
    assert status == OK
    assert library.serialise(other, carried) == block
    assert library.restore(other, carried) == OK
    assert run_on(subject, other, 0.1) == rest
    assert library.call(f"Get{library.state_word}", other, ct.byref(carried)) == OK
    assert library.discard(other, carried) == OK
    assert carried.value is None
    assert library.discard(other, carried) == OK
    for wrong in (b"", block[:-1], block + b"\0", bytes(len(block)), block[:-8] + b"damaged!", b"\xff" * len(block)):
        subject.refused(lambda wrong=wrong: library.deserialise(first, wrong)[0])
    for at in (0, 9, 17, 25, 33, 40, len(block) - 1):
        flipped = block[:at] + bytes([block[at] ^ 4]) + block[at + 1 :]
        subject.refused(lambda flipped=flipped: library.deserialise(first, flipped)[0])
    blob = ct.create_string_buffer(block[:32] + bytes(len(block) - 32), len(block))
    subject.refused(lambda: library.restore(first, ct.cast(blob, ct.c_void_p)))
    subject.refused(lambda: library.restore(first, ct.c_void_p(None)))
    subject.refused(lambda: library.call(f"Get{library.state_word}", first, None))
    subject.refused(lambda: library.call(f"Serialize{library.state_word}", first, state, None, ct.c_size_t(len(block))))
    subject.refused(lambda: library.call(f"Serialize{library.state_word}", first, state, blob, ct.c_size_t(3)))
    subject.refused(lambda: library.call(f"Serialized{library.state_word}Size", first, state, None))
    assert library.discard(first, state) == OK
    library.free(first)
    library.free(other)


def check_logging(subject: Subject) -> None:
    """Told is what is of a chosen category; unknown ones are refused; FMI 3.0 is silent with logging off."""
    library = subject.library
    instance = subject.new()
    yes, no = (ct.c_bool(True), ct.c_bool(False)) if library.fmi == 3 else (1, 0)
    for names, told in (
        ((b"logStatusWarning",), False),
        ((b"logStatusError",), True),
        ((b"logStatusWarning", b"logStatusError"), True),
        ((b"logStatusWarning", b"logAll"), True),
        ((b"logStatusWarning",), False),
        ((), True),
    ):
        known = (ct.c_char_p * len(names))(*names)
        assert library.call("SetDebugLogging", instance, yes, ct.c_size_t(len(names)), known) == OK
        before = len(library.log)
        assert library.step(instance, 0.0, 0.1) == ERROR
        assert len(library.log) == before + told, names
    for wrong in ((ct.c_char_p * 1)(b"logNothing"), (ct.c_char_p * 1)(None), None):
        subject.refused(lambda w=wrong: library.call("SetDebugLogging", instance, yes, ct.c_size_t(1), w))
    assert library.call("SetDebugLogging", instance, no, ct.c_size_t(0), None) == OK
    before = len(library.log)
    assert library.step(instance, 0.0, 0.1) == ERROR
    assert len(library.log) == before + (library.fmi == 2)
    library.free(instance)


def check_what_is_lacking(subject: Subject) -> None:
    """Functions of what the FMU has not refuse."""
    library = subject.library
    instance = subject.new()
    library.start(instance)
    one = (ct.c_uint * 1)(1)
    if library.fmi == 2:
        real = (ct.c_double * 1)()
        order = (ct.c_int * 1)(1)
        for name in ("SetRealInputDerivatives", "GetRealOutputDerivatives"):
            subject.refused(lambda n=name: library.call(n, instance, one, ct.c_size_t(1), order, real))
        size = ct.c_size_t(1)
        subject.refused(lambda: library.call("GetDirectionalDerivative", instance, one, size, one, size, real, real))
        subject.refused(lambda: library.call("CancelStep", instance))
        for name in ("GetStatus", "GetIntegerStatus", "GetStringStatus"):
            subject.refused(lambda n=name: library.call(n, instance, 0, real), status=DISCARD)
        last = ct.c_double()
        assert library.call("GetRealStatus", instance, 2, ct.byref(last)) == OK
        assert last.value == 0.0
        subject.refused(lambda: library.call("GetRealStatus", instance, 0, ct.byref(last)), status=DISCARD)
    else:
        for name in ("EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "EnterContinuousTimeMode"):
            subject.refused(lambda n=name: library.call(n, instance))
        count = ct.c_size_t()
        subject.refused(lambda: library.call("GetNumberOfContinuousStates", instance, ct.byref(count)))
        for kind in ("Float32", "Int8", "UInt64", "Binary"):
            subject.refused(
                lambda k=kind: library.call(f"Get{k}", instance, one, ct.c_size_t(1), None, None, ct.c_size_t(1))
            )
    library.free(instance)
