"""A host of FMUs: it calls their functions for the orchestrator, in its process or in one of its own.

The process of a guest runs this file as a script and imports only the standard library, so it starts quickly. A
request is a list of operations. Its reply has the status and the values of each operation up to the first failure, and
the FMU's log. The length of a message precedes it. A request is a Python value in marshal's form. A reply is JSON with
bytes as hexadecimal digits: an FMU may corrupt it, and unlike marshal, JSON cannot request memory that it does not
fill.

| operation | values |
|---|---|
| load, settings of the instance: see `Host.load` | address of the instance, 0 if there is none |
| has, function | whether the library has it |
| call, function, arguments | outputs of the function, for each argument that receives one |
| follow, calls: made after each step from now on | |
| interpolate, setter, references, times and rows: inputs for the solver | |

An argument is a whole number, a real number, bytes (the function gets their address), or a list of bytes (an array of
strings). A tuple asks for an output: `(content,)`, memory with this content; `("texts", n)`, n strings;
`("binaries", n)`, two arrays, of n sizes and of n addresses.
"""

import bisect
import ctypes
import json
import marshal
import math
import mmap
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, MutableSequence, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO
from weakref import WeakValueDictionary

Log = MutableSequence[tuple[int, str]]
"""Log entries: status and message."""
HEAD = struct.Struct("<Q")
"""Format of a message's length."""
PROGRESS = struct.Struct("<I")
"""Format of the index of the operation in progress."""
OK, WARNING, DISCARD, ERROR = range(4)
NEGATIVE = 1 << 31
"""First value reference that stands for the negative of a variable of FMI 1.0."""
MOST_EVENTS = 10_000
"""Largest number of events in one step, and of iterations in one event."""
CLOSE = 1e-13
"""Times that differ by less, relative to the step and the time, are equal."""
MOST_SOLVER_STEPS = 100_000
"""Largest number of solver steps between two events."""
ONE_STEP, ROOT_RETURN = 2, 2
"""CVODE's task of a single step, and its status at a root."""
Clock = tuple[int, float, float, float]
"""A periodic clock: its value reference; shift and interval, both to be divided by a resolution, which follows [s]."""
_BOOLEAN, _INTEGER, _REAL = ctypes.c_bool, ctypes.c_int, ctypes.c_double
_LOG_2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, _INTEGER, ctypes.c_char_p, ctypes.c_char_p)
_LOG_3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, _INTEGER, ctypes.c_char_p, ctypes.c_char_p)


class _Callbacks(ctypes.Structure):
    """Callback functions of FMI 2.0."""

    _fields_ = (
        ("logger", _LOG_2),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    )


class _FirstCallbacks(ctypes.Structure):
    """Callback functions of FMI 1.0."""

    _fields_ = _Callbacks._fields_[:4]


class _FirstEventInfo(ctypes.Structure):
    """Output of fmiInitialize and fmiEventUpdate of FMI 1.0: converged, two unused flags, end, time event, its time."""

    _fields_ = (("flags", _BOOLEAN * 5), ("next", _REAL))


class FirstEdition:
    """A library of FMI 1.0 with the functions of FMI 2.0; `settings` are those of `Host.load`.

    Functions with the same arguments are found by their names. The FMU initialises when initialisation mode begins:
    until then it takes parameters, and from then on it gives outputs.
    """

    renamed: Mapping[str, str] = {"GetNominalsOfContinuousStates": "GetNominalContinuousStates"}

    def __init__(self, library: Any, settings: Mapping[str, Any]) -> None:
        self._library, self._prefix = library, settings["first_edition"]
        self._kind = "Model" if settings["solver"] else "Slave"
        self._experiment: Sequence[Any] = ()
        self._initial: _FirstEventInfo | None = None

    def __getattr__(self, name: str) -> Any:
        """Return the function of FMI 1.0 with the same arguments."""
        plain = name.removeprefix("fmi2")
        return self._library[f"{self._prefix}_fmi{self.renamed.get(plain, plain)}"]

    def __getitem__(self, name: str) -> Any:
        return getattr(self, name)

    def instantiate(self, name: bytes, token: bytes, location: bytes | None, callbacks: "_Callbacks") -> Any:
        """Return the address of the instance."""
        # FMI 1.0 takes the callbacks themselves: all but the environment.
        functions = _FirstCallbacks.from_buffer_copy(callbacks)
        logging = _BOOLEAN(True)
        make = self[f"Instantiate{self._kind}"]
        make.restype = ctypes.c_void_p
        if self._kind == "Model":
            return make(name, token, functions, logging)
        mime, no = b"application/x-fmu-sharedlibrary", _BOOLEAN(False)
        return make(name, token, location, mime, _REAL(0.0), no, no, functions, logging)

    def fmi2SetupExperiment(self, _: Any, *experiment: Any) -> int:
        """Keep the times and the tolerance."""
        self._experiment = experiment
        return OK

    def fmi2EnterInitializationMode(self, instance: Any) -> int:
        """Initialise."""
        controlled, tolerance, start, has_stop, stop = self._experiment
        if self._kind == "Slave":
            return self.InitializeSlave(instance, start, _BOOLEAN(has_stop.value), stop)
        status = self.SetTime(instance, start)
        if status > WARNING:
            return status
        self._initial = _FirstEventInfo()
        return self.Initialize(instance, _BOOLEAN(controlled.value), tolerance, ctypes.byref(self._initial))

    def fmi2ExitInitializationMode(self, _: Any) -> int:
        """Do nothing: FMI 1.0 has no modes."""
        return OK

    fmi2EnterEventMode = fmi2EnterContinuousTimeMode = fmi2ExitInitializationMode

    def fmi2NewDiscreteStates(self, instance: Any, place: Any) -> int:
        """Update the discrete states; the initialisation has done it at the start."""
        info, self._initial, status = self._initial, None, OK
        if info is None:
            info = _FirstEventInfo()
            status = self.EventUpdate(instance, _BOOLEAN(False), ctypes.byref(info))
        converged, _, _, terminate, defined = info.flags
        place._obj.flags[:] = (not converged, terminate, 0, 0, defined)
        place._obj.next = info.next
        return status

    def fmi2CompletedIntegratorStep(self, instance: Any, _: int, event: Any, __: Any) -> int:
        """Tell that a step of the solver is complete; `event` receives whether an event is due."""
        is_due = _BOOLEAN()
        status = self.CompletedIntegratorStep(instance, ctypes.byref(is_due))
        event._obj[0] = is_due.value
        return status

    def fmi2GetReal(self, instance: Any, references: bytes, count: Any, values: Any) -> int:
        """Get numbers; a reference from `NEGATIVE` on means the negative of the variable."""
        numbers = (ctypes.c_uint32 * count.value).from_buffer_copy(references)
        negative = [k for k in range(count.value) if numbers[k] >= NEGATIVE]
        for k in negative:
            numbers[k] -= NEGATIVE
        status = self.GetReal(instance, numbers, count, values)
        contents = (_REAL * count.value).from_buffer(values)
        for k in negative:
            contents[k] = -contents[k]
        return status

    def fmi2GetBoolean(self, instance: Any, references: bytes, count: Any, values: Any) -> int:
        """Get booleans, which are bytes in FMI 1.0."""
        flags = (_BOOLEAN * count.value)()
        status = self.GetBoolean(instance, references, count, flags)
        (_INTEGER * count.value).from_buffer(values)[:] = list(flags)
        return status

    def fmi2SetBoolean(self, instance: Any, references: bytes, count: Any, values: bytes) -> int:
        """Set booleans."""
        flags = (_BOOLEAN * count.value)(*memoryview(values).cast("i"))
        return self.SetBoolean(instance, references, count, flags)

    def fmi2Terminate(self, instance: Any) -> int:
        """End the run."""
        return self["Terminate" if self._kind == "Model" else "TerminateSlave"](instance)

    def fmi2FreeInstance(self, instance: Any) -> int:
        """Free the instance."""
        self[f"Free{self._kind}Instance"](instance)
        return OK


class _EventInfo(ctypes.Structure):
    """Output of fmi2NewDiscreteStates."""

    _fields_ = (("flags", _INTEGER * 5), ("next", _REAL))


def _flags(count: int) -> tuple[Any, list[Any]]:
    """Return booleans for outputs of FMI 3.0, and the address of each."""
    flags = (_BOOLEAN * count)()
    return flags, [ctypes.byref(flags, k) for k in range(count)]


class FailedError(Exception):
    """A call of the FMU, or the solver, has failed: the status and the message."""


class Events:
    """Step an FMU from event to event and handle its events; `ended` is the time at which it asked for the end of the
    run.

    Between steps the FMU is in event mode: its inputs change and its events end. `call` takes a function's name and C
    values; `log` is the FMU's log.
    """

    mode = "EnterStepMode"

    def __init__(self, version: int, call: Callable[..., int], log: Log, clocks: Sequence[Clock]) -> None:
        self.version, self.plain_call, self._log = version, call, log
        self._clocks, self._ticks = clocks, [0] * len(clocks)
        self._next_event = math.inf
        self._start = self.time = 0.0
        self.ended: float | None = None

    @property
    def next_instant(self) -> float:
        """Time of the FMU's next event or of the next tick of a clock."""
        return min(self._next_event, self.next_tick)

    @property
    def next_tick(self) -> float:
        """Time of the next tick of a clock."""
        return min(map(self._tick_time, range(len(self._clocks))), default=math.inf)

    def _tick_time(self, number: int) -> float:
        """Return the time of the next tick of a clock, from whole numbers of intervals."""
        _, shift, interval, resolution = self._clocks[number]
        return self._start + (shift + self._ticks[number] * interval) / resolution

    def _tick(self) -> None:
        """Activate the clocks that are due."""
        for number, (reference, *_) in enumerate(self._clocks):
            due = self._tick_time(number)
            if due <= self.time + CLOSE * (1.0 + abs(self.time)):
                self._ticks[number] += 1
                one = ctypes.c_size_t(1)
                self.call("SetClock", (ctypes.c_uint32 * 1)(reference), one, (_BOOLEAN * 1)(True))

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the FMU.

        Raises FailedError for a status above Warning.
        """
        logged = len(self._log)
        status = self.plain_call(f"fmi{self.version}{name}", *arguments)
        if status > WARNING:
            words = [text for _, text in list(self._log)[logged:] if text]
            reason = f": {words[-1]}" if words else ""
            raise FailedError(status, f"fmi{self.version}{name} ended with status {status}{reason}")

    def _logged(self, error: FailedError) -> int:
        """Log a failure's message and return its status."""
        self._log.append(error.args)
        return error.args[0]

    def enter(self, start: float) -> int:
        """Handle the event that ends the initialisation; return its status."""
        self.time = self._start = start
        try:
            self._update()
        except FailedError as error:
            return self._logged(error)
        return OK

    def _update(self) -> None:
        """Activate clocks, and update discrete states until they no longer change."""
        self._tick()
        for _ in range(MOST_EVENTS):
            if self.version == 2:
                info = _EventInfo()
                self.call("NewDiscreteStates", ctypes.byref(info))
                flags, following = info.flags, info.next
            else:
                flags, places = _flags(5)
                event = _REAL()
                self.call("UpdateDiscreteStates", *places, ctypes.byref(event))
                following = event.value
            again, terminate, defined = flags[0], flags[1], flags[4]
            self._next_event = following if defined else math.inf
            if terminate:
                self.ended = self.time
            if terminate or not again:
                return
        raise FailedError(ERROR, f"an event at {self.time:.9g} s does not come to its end")

    def step(self, begin: float, length: float) -> tuple[int, float]:
        """Make a step; return its status and the time that it reached."""
        end, self.time = begin + length, begin
        close = CLOSE * (length + abs(end))
        try:
            self._update()
            for _ in range(MOST_EVENTS):
                if self.ended is not None:
                    return DISCARD if self.version == 2 else OK, self.ended
                if self.time >= end - close:
                    return OK, end
                self.call(self.mode)
                self.advance(end, close)
                self.call("EnterEventMode")
                self._update()
            raise FailedError(ERROR, f"more than {MOST_EVENTS} events between {begin:.9g} s and {end:.9g} s")
        except FailedError as error:
            return self._logged(error), self.time

    def advance(self, end: float, close: float) -> None:
        """Step to the next tick or to the end; the FMU returns early at an event."""
        end = min(end, max(self.next_tick, self.time + close))
        flags, places = _flags(3)
        reached = _REAL(self.time)
        times = _REAL(self.time), _REAL(end - self.time)
        self.call("DoStep", *times, _BOOLEAN(False), *places, ctypes.byref(reached))
        self.time = reached.value if flags[2] else end
        if flags[1]:
            self.ended = self.time

    def prepare(self, name: str, arguments: Sequence[Any]) -> bool:
        """Return True if the FMU is ready to take inputs: between steps it is in event mode."""
        return True

    def answer(self, name: str, arguments: Sequence[Any]) -> tuple[int, list[bytes]]:
        """Stand in for a function of co-simulation: a step, or the step query of FMI 2.0."""
        if name.endswith("DoStep"):
            begin, length = arguments[:2]
            status, reached = self.step(begin, length)
            flags = (False, self.ended is not None, reached < begin + length)
            contents = [bytes([flag]) for flag in flags]
            contents.append(struct.pack("d", reached))
            return status, contents
        if "Real" in name:
            return OK, [struct.pack("d", self.ended or 0.0)]
        return OK, [struct.pack("i", self.ended is not None)]


class InputTable:
    """Inputs for a solver: numbers of double precision, linear between rows; two rows of one time are a jump."""

    def __init__(self, setter: str, references: bytes, times: bytes, rows: bytes) -> None:
        self.times, self._rows = memoryview(times).cast("d"), memoryview(rows).cast("d")
        self._width = len(self._rows) // len(self.times)
        self._setter, self._references = setter[4:], references
        self._type = ctypes.c_float if setter.endswith("Float32") else _REAL

    def call_at(self, instant: float, *, after: bool) -> tuple[Any, ...]:
        """Return the call that sets the inputs at a time, just before or just after a jump."""
        last = len(self.times) - 1
        end = bisect.bisect_right(self.times, instant) if after else bisect.bisect_left(self.times, instant)
        begin, end = max(end - 1, 0), min(end, last)
        span = self.times[end] - self.times[begin]
        share = (instant - self.times[begin]) / span if span else 0.0
        values = (self._type * self._width)()
        for k in range(self._width):
            first, second = self._rows[begin * self._width + k], self._rows[end * self._width + k]
            values[k] = first + share * (second - first)
        count = ctypes.c_size_t(len(self._references) // 4)
        return self._setter, self._references, count, values, ctypes.c_size_t(self._width)

    def next_row(self, instant: float) -> tuple[float, bool]:
        """Return the time of the first row after a time, and whether it is a jump."""
        at = bisect.bisect_right(self.times, instant)
        if at == len(self.times):
            return math.inf, False
        return self.times[at], at + 1 < len(self.times) and self.times[at + 1] == self.times[at]


class ExchangeSolver(Events):
    """Step an FMU of model exchange: SUNDIALS' CVODE integrates it with a relative tolerance.

    CVODE continues over the steps of the run. It starts anew after an event, and after a change of an input, which is
    an event too. It ends a step of its own at each row of a table of inputs. Between steps the FMU stays in
    continuous-time mode unless there was an event.
    """

    mode = "EnterContinuousTimeMode"

    def __init__(
        self,
        version: int,
        call: Callable[..., int],
        log: Log,
        clocks: Sequence[Clock],
        solver: tuple[int, int, float],
    ) -> None:
        super().__init__(version, call, log, clocks)
        self._sizes, self._tolerance = solver[:2], solver[2]
        self._cvode: Any = None
        self._in_event = self._fresh = True
        self._changed = False
        self._inputs: dict[tuple[str, Any], Sequence[Any]] = {}
        self._began = -math.inf
        """Time of the last event, at which inputs have the values after a jump."""
        self.tables: list[InputTable] = []

    def _vector(self, name: str, values: Any, count: int) -> None:
        """Get or set numbers."""
        if count:
            self.call(name, ctypes.cast(values, ctypes.c_void_p), ctypes.c_size_t(count))

    def _set_time(self, instant: float) -> None:
        self.call("SetTime", _REAL(instant))
        self._set_inputs(instant)

    def _set_inputs(self, instant: float) -> None:
        for table in self.tables:
            name, *arguments, width = table.call_at(instant, after=instant <= self._began)
            self.call(name, *arguments, *[width] * (self.version - 2))

    def prepare(self, name: str, arguments: Sequence[Any]) -> bool:
        """Return True if inputs change; the FMU takes them in event mode."""
        key = name, arguments[0]
        if self._inputs.get(key) == arguments:
            return False
        if not self._in_event:
            self.call("EnterEventMode")
            self._in_event = True
        self._inputs[key] = arguments
        self._changed = True
        return True

    def step(self, begin: float, length: float) -> tuple[int, float]:
        """Make a step; return its status and the time that it reached."""
        end = begin + length
        close = CLOSE * (length + abs(end))
        try:
            if self._changed:
                self._update()
                self._changed = False
            for _ in range(MOST_EVENTS):
                if self.ended is not None:
                    return DISCARD if self.version == 2 else OK, self.ended
                if self.time >= end - close:
                    return OK, end
                if self._in_event:
                    self.call(self.mode)
                    self._in_event, self._fresh = False, True
                if self._advance_to_event(end, close):
                    self.call("EnterEventMode")
                    self._in_event, self._began = True, self.time
                    self._set_inputs(self.time)
                    self._update()
            raise FailedError(ERROR, f"more than {MOST_EVENTS} events between {begin:.9g} s and {end:.9g} s")
        except FailedError as error:
            return self._logged(error), self.time

    def _advance_to_event(self, end: float, close: float) -> bool:
        """Integrate to the next event, or to the end of the step; return True at an event."""
        for _ in range(MOST_SOLVER_STEPS):
            is_event = False
            rows = [table.next_row(self.time + close) for table in self.tables]
            goal = min([end, max(self.next_instant, self.time), *(instant for instant, _ in rows)])
            jumps = any(instant <= goal + close and is_jump for instant, is_jump in rows)
            if goal - self.time <= close or not any(self._sizes):
                self.time = goal
                self._set_time(goal)
            else:
                is_event = self._integrate(goal)
            if self._complete_step() or is_event or self.ended is not None:
                return True
            is_event = jumps and self.time >= goal - close
            if is_event or self.time >= min(end, self.next_instant) - close:
                return is_event or self.next_instant <= self.time + close
        raise FailedError(ERROR, f"CVODE: more than {MOST_SOLVER_STEPS} steps before {end:.9g} s")

    def _integrate(self, goal: float) -> bool:
        """Make one step of CVODE towards a time; return True at a state event."""
        if self._cvode is None:
            self._cvode = self._new_solver()
        elif self._fresh:
            self._cvode.reset(self.time)
        self._fresh = False
        try:
            is_event, self.time = self._cvode.step_towards(goal)
        except RuntimeError as error:
            raise self._cvode.failed or FailedError(ERROR, f"CVODE: {error.args[0]}") from error
        return is_event

    def _new_solver(self) -> Any:
        rates = "GetDerivatives" if self.version == 2 else "GetContinuousStateDerivatives"
        return cvode_class()(
            nx=self._sizes[0],
            nz=self._sizes[1],
            get_x=lambda x, n: self._vector("GetContinuousStates", x, n),
            set_x=lambda x, n: self._vector("SetContinuousStates", x, n),
            get_dx=lambda x, n: self._vector(rates, x, n),
            get_z=lambda z, n: self._vector("GetEventIndicators", z, n),
            get_nominals=self._nominals,
            set_time=self._set_time,
            input=_Inputs(),
            startTime=self.time,
            relativeTolerance=self._tolerance,
            maxNumSteps=MOST_SOLVER_STEPS,
        )

    def _nominals(self, values: Any, count: int) -> None:
        """Get the states' nominal values; some exporters write 0 for one that they do not know."""
        self._vector("GetNominalsOfContinuousStates", values, count)
        for k in range(count):
            size = abs(values[k])
            values[k] = size if 0.0 < size < math.inf else 1.0

    def _complete_step(self) -> bool:
        """Tell the FMU that a step of the solver is complete; return True if it asks for an event."""
        if self.version == 2:
            flags: Any = (_INTEGER * 2)()
            self.call("CompletedIntegratorStep", 1, ctypes.byref(flags, 0), ctypes.byref(flags, 4))
        else:
            flags, places = _flags(2)
            self.call("CompletedIntegratorStep", _BOOLEAN(True), *places)
        if flags[1]:
            self.ended = self.time
        return bool(flags[0])


class _Inputs:
    """Inputs for FMPy's solver: constant over a step."""

    def apply(self, time: float) -> None:
        """Change nothing."""


def cvode_class() -> type:
    """Return FMPy's CVODE, changed to stop when the FMU cannot evaluate; only model exchange needs FMPy."""
    from fmpy.sundials import CVodeSolver
    from fmpy.sundials.libraries import sundials_cvode

    set_stop = sundials_cvode.CVodeSetStopTime
    set_stop.argtypes, set_stop.restype = [ctypes.c_void_p, _REAL], _INTEGER

    class Cvode(CVodeSolver):
        """The solver; `failed` is the first failed call of the FMU."""

        failed: FailedError | None = None

        def f(self, *arguments: Any) -> int:
            return self._guarded(super().f, arguments)

        def g(self, *arguments: Any) -> int:
            return self._guarded(super().g, arguments)

        def _guarded(self, function: Callable[..., int], arguments: Iterable[Any]) -> int:
            try:
                return function(*arguments)
            except FailedError as error:
                self.failed = self.failed or error
                return -1

        def step_towards(self, goal: float) -> tuple[bool, float]:
            """Make one step of the solver, at most to a time; return True at a state event, and the time reached."""
            # Beyond the event, or the end of the step, other equations may hold.
            set_stop(self.cvode_mem, goal)
            reached = _REAL()
            flag = sundials_cvode.CVode(self.cvode_mem, goal, self.x, ctypes.byref(reached), ONE_STEP)
            if flag < 0:
                raise RuntimeError(self.error_info[-1] if self.error_info else f"error {flag}")
            self.set_time(reached.value)
            if not self.discrete:
                self.set_x(self.px, self.nx)
            return flag == ROOT_RETURN, reached.value

        def __del__(self) -> None:
            """Keep the memory: it is freed with the process."""

    return Cvode


def _hear(environment: int | None, status: int, text: bytes | None, name: bytes | None = None) -> None:
    """Pass a message to its instance, found by environment, else by name; else pass it to all."""
    host = HOSTS.get(environment or 0)
    hosts = list(HOSTS.values())
    if host is not None:
        hosts = [host]
    for listener in [listener for listener in hosts if listener.name == name] or hosts:
        listener.log.append((status, " ".join((text or b"").decode("utf-8", "replace").split())))


HOSTS: "WeakValueDictionary[int, Host]" = WeakValueDictionary()
# One logger serves all instances and is never freed: FMPy's proxy keeps only the last logger.
_LOGGER_2 = _LOG_2(lambda at, name, status, _, text: _hear(at, status, text, name))
_LOGGER_3 = _LOG_3(lambda at, status, _, text: _hear(at, status, text))


class Host:
    """An FMU in this process and its operations; `log` collects statuses and messages."""

    name = b""

    def __init__(self, log: Log) -> None:
        self.log = log
        HOSTS[id(self)] = self
        self.follows: list[tuple[str, Sequence[Any], list[Any]]] = []
        """Name, arguments and memory of each call that follows a step."""
        self.progress: Any = bytearray(PROGRESS.size)
        """Index of the operation in progress."""
        self._events: Events | None = None
        """Steps an FMU if this process handles its events."""
        self._start = 0.0
        self._initialised = False
        self._functions: dict[str, Any] = {}
        self._alive: list[Any] = []
        """Objects whose addresses the library holds; kept alive here."""

    def load(self, settings: Mapping[str, Any]) -> tuple[int, int]:
        """Load the library and make the instance.

        Keys of `settings`: the library's file, version (of FMI), name, token, resources, logger (FMPy's library, or
        ""), progress (a file, or ""), `clocks` and `has_events` (this process handles the events). `solver` has, for
        model exchange, the numbers of states and event indicators and a tolerance; otherwise it is empty.
        `first_edition` is the prefix of the functions of FMI 1.0; otherwise it is empty.
        """
        version, clocks, solver = settings["version"], settings["clocks"], settings["solver"]
        if solver:
            self._events = ExchangeSolver(version, self._plain_call, self.log, clocks, solver)
        elif settings["has_events"]:
            self._events = Events(version, self._plain_call, self.log, clocks)
        if settings["progress"]:
            with Path(settings["progress"]).open("r+b") as file:
                self.progress = mmap.mmap(file.fileno(), PROGRESS.size)
        library, folder = settings["library"], Path.cwd()
        # The loader finds libraries in the same folder.
        os.chdir(Path(library).parent)
        try:
            self.library = ctypes.CDLL(library)
        finally:
            os.chdir(folder)
        self.name, token = settings["name"].encode(), settings["token"].encode()
        resources = settings["resources"].encode() or None
        if settings["first_edition"]:
            self.library = FirstEdition(self.library, settings)
            made = self.library.instantiate(self.name, token, resources, self._callbacks(settings["logger"]))
            self._instance = ctypes.c_void_p(made)
            return OK, made or 0
        if version == 2:
            callbacks = ctypes.byref(self._callbacks(settings["logger"]))
            make = self._function("fmi2Instantiate")
            arguments = (self.name, 0 if solver else 1, token, resources, callbacks, 0, 1)
        else:
            environment = ctypes.c_void_p(id(self))
            arguments = (self.name, token, resources, _BOOLEAN(False), _BOOLEAN(True))
            if solver:
                make = self._function("fmi3InstantiateModelExchange")
                arguments += (environment, _LOGGER_3)
            else:
                make = self._function("fmi3InstantiateCoSimulation")
                events = _BOOLEAN(settings["has_events"])
                arguments += (events, events, None, ctypes.c_size_t(0), environment, _LOGGER_3, None)
        make.restype = ctypes.c_void_p
        self._instance = ctypes.c_void_p(make(*arguments))
        return OK, self._instance.value or 0

    def _callbacks(self, logger: str) -> _Callbacks:
        """Return the callbacks for an FMU of FMI 2.0: memory, and a logger that formats like printf."""
        memory = ctypes.CDLL("msvcrt" if os.name == "nt" else None)
        allocate, free = ctypes.cast(memory.calloc, ctypes.c_void_p), ctypes.cast(memory.free, ctypes.c_void_p)
        callbacks = _Callbacks(_LOGGER_2, allocate.value, free.value, None, id(self))
        self._alive += [memory, callbacks]
        if logger:
            proxy = ctypes.CDLL(logger).addLoggerProxy
            proxy.argtypes, proxy.restype = [ctypes.c_void_p], None
            proxy(ctypes.byref(callbacks))
        return callbacks

    def _function(self, name: str) -> Any:
        if name not in self._functions:
            self._functions[name] = self.library[name]
        return self._functions[name]

    def _plain_call(self, name: str, *arguments: Any) -> int:
        """Call a function with C values."""
        return self._function(name)(self._instance, *arguments)

    def has(self, name: str) -> tuple[int, bool]:
        """Return True if the library has a function, or this class stands in for it."""
        stands_in = self._events is not None and name.endswith(("DoStep", "Status"))
        return OK, stands_in or hasattr(self.library, name)

    def call(self, name: str, arguments: Sequence[Any] = ()) -> tuple[int, list[Any]]:
        """Call a function."""
        if self._events is not None and name.endswith(("DoStep", "Status")):
            return self._events.answer(name, arguments)
        memory = _memory(arguments)
        if name.endswith("FreeInstance"):
            self._plain_call(name, *memory)
            return OK, []
        if self._initialised and self._events is not None and name[4:7] == "Set":
            try:
                if not self._events.prepare(name, arguments):
                    return OK, []
            except FailedError as error:
                self.log.append(error.args)
                return error.args[0], []
        status = self._plain_call(name, *memory)
        self._initialised = self._initialised or name.endswith("ExitInitializationMode")
        if name.endswith(("SetupExperiment", "EnterInitializationMode")) and arguments:
            self._start = arguments[2]
        if self._events is not None and status <= WARNING and name.endswith("ExitInitializationMode"):
            return self._events.enter(self._start), []
        return status, _written(arguments, memory, status)

    def follow(self, calls: list[tuple[str, Sequence[Any]]]) -> tuple[int, None]:
        """Make these calls after each step from now on."""
        self.follows = [(name, arguments, _memory(arguments)) for name, arguments in calls]
        return OK, None

    def interpolate(self, *table: Any) -> tuple[int, None]:
        """Take a table of inputs for the solver."""
        assert isinstance(self._events, ExchangeSolver)
        self._events.tables.append(InputTable(*table))
        return OK, None

    def answer(self, request: Sequence[tuple[Any, ...]]) -> list[tuple[int, Any]]:
        """Run the operations of a request up to the first failure; return their values and those of the calls after a
        step."""
        answers: list[tuple[int, Any]] = []
        for at, operation in enumerate(request):
            PROGRESS.pack_into(self.progress, 0, at)
            verb = operation[0]
            answers.append(getattr(self, verb)(*operation[1:]))
            if answers[-1][0] > WARNING:
                return answers
            if verb == "call" and operation[1].endswith("DoStep"):
                for following, (name, outputs, memory) in enumerate(self.follows, at + 1):
                    PROGRESS.pack_into(self.progress, 0, following)
                    status = self._plain_call(name, *memory)
                    answers.append((status, _written(outputs, memory, status)))
        return answers


def _memory(arguments: Sequence[Any]) -> list[Any]:
    """Convert arguments to C."""
    memory: list[Any] = []
    for argument in arguments:
        memory += _of_c(argument)
    return memory


def _of_c(argument: Any) -> list[Any]:
    """Convert one argument to C."""
    if isinstance(argument, bool):
        return [_BOOLEAN(argument)]
    if isinstance(argument, int):
        return [ctypes.c_size_t(argument)]
    if isinstance(argument, float):
        return [_REAL(argument)]
    if isinstance(argument, bytes):
        return [argument]
    if isinstance(argument, list):
        return [(ctypes.c_char_p * len(argument))(*argument)]
    if argument[0] == "texts":
        return [(ctypes.c_char_p * argument[1])()]
    if argument[0] == "binaries":
        return [(ctypes.c_size_t * argument[1])(), (ctypes.c_void_p * argument[1])()]
    return [ctypes.create_string_buffer(argument[0], len(argument[0]))]


def _written(arguments: Sequence[Any], memory: Sequence[Any], status: int) -> list[Any]:
    """Return the outputs of a function: bytes of memory, strings, or binaries."""
    contents: list[Any] = []
    for at, argument in enumerate(arguments):
        if not isinstance(argument, tuple):
            continue
        content = memory[at]
        if argument[0] == "texts":
            contents.append([text or b"" for text in content])
        elif argument[0] == "binaries":
            places = memory[at + 1] if status <= WARNING else ()
            pairs = zip(places, content, strict=False)
            contents.append([ctypes.string_at(place, size) if place else b"" for place, size in pairs])
        else:
            contents.append(content.raw)
    return contents


def end_with(parent: int) -> None:
    """End this process, and the processes that the FMU started, when the parent process is gone."""
    while os.getppid() == parent:
        time.sleep(1.0)
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


def limit_memory(most: int) -> None:
    """Limit the memory of this process [bytes], if the system supports such a limit."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        _, highest = resource.getrlimit(resource.RLIMIT_DATA)
        if highest != resource.RLIM_INFINITY:
            most = min(most, highest)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def serve(read: Callable[[int], bytes], write: Callable[[bytes], object], flush: Callable[[], object]) -> None:
    """Answer requests until the stream ends."""
    log: list[tuple[int, str]] = []
    host = Host(log)
    while head := read(HEAD.size):
        answers, failure = [], ""
        try:
            answers = host.answer(marshal.loads(read(*HEAD.unpack(head))))
        except (OSError, AttributeError, ImportError, MemoryError) as error:
            failure = " ".join(str(error).split()) or type(error).__name__
        reply = json.dumps((answers, log, failure), default=bytes.hex).encode()
        log.clear()
        write(HEAD.pack(len(reply)) + reply)
        flush()


def own_streams() -> tuple[BinaryIO, BinaryIO]:
    """Return standard input and output for this module alone: an FMU reads nothing, and its output is an error's.

    The process ends with its parent, and not by Ctrl-C.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    threading.Thread(target=end_with, args=(os.getppid(),), daemon=True).start()
    return requests, replies


def run_guest() -> None:
    """Serve on standard input and output, which are hidden from the FMU."""
    limit_memory(int(sys.argv[1]))
    requests, replies = own_streams()
    serve(requests.read, replies.write, replies.flush)
    sys.stdout.flush()
    # Do not wait for the FMU's threads.
    os._exit(0)


if __name__ == "__main__":
    run_guest()
