"""An FMU of model exchange as one that steps: SUNDIALS' CVODE integrates it in its guest's process, events are met.

Between steps it is in event mode: inputs change there as at an event, and the integration begins anew. It is loaded by
`guest_process.py`, from its file.
"""

import ctypes
import math
from collections.abc import Callable
from typing import Any

from fmpy.sundials import CVodeSolver
from fmpy.sundials.libraries import sundials_cvode

_set_stop = sundials_cvode.CVodeSetStopTime
_set_stop.argtypes, _set_stop.restype = [ctypes.c_void_p, ctypes.c_double], ctypes.c_int

OK, DISCARD, ERROR = 0, 2, 3
MOST_EVENTS = 10_000
"""In one step, and rounds of one event."""
MOST_STEPS = 100_000
"""Of the solver from event to event."""
CLOSE = 1e-13
"""Times that differ by less, relative to the step and the time, are one."""


class _EventInfo(ctypes.Structure):
    """What fmi2NewDiscreteStates says."""

    _fields_ = (*((f"flag{k}", ctypes.c_int) for k in range(5)), ("next", ctypes.c_double))


class FailedError(Exception):
    """A call of the FMU, or the solver, has failed: its status and what is to be said."""


class _Cvode(CVodeSolver):
    """CVODE, told when the FMU cannot give what it asks for."""

    failed: FailedError | None = None

    def f(self, *given: Any) -> int:
        """Give the derivatives."""
        return self._asked(super().f, *given)

    def g(self, *given: Any) -> int:
        """Give the event indicators."""
        return self._asked(super().g, *given)

    def _asked(self, function: Callable[..., int], *given: Any) -> int:
        try:
            return function(*given)
        except FailedError as error:
            self.failed = self.failed or error
            return -1

    def __del__(self) -> None:
        """Leave its memory: it goes with the process."""


class _Inputs:
    """Inputs as CVodeSolver asks for them: they hold over a step."""

    def apply(self, time: float) -> None:
        """Change nothing."""


class Solver:
    """The FMU's steps; `ended` is when it asked for the end of the run."""

    def __init__(
        self, version: int, states: int, indicators: int, tolerance: float, call: Callable[..., int], log: list[Any]
    ) -> None:
        self._version, self._states, self._indicators = version, states, indicators
        self._tolerance, self._plain, self._log = tolerance, call, log
        self._next = math.inf
        self.ended: float | None = None
        self._time = 0.0
        self._cvode: _Cvode | None = None

    def _call(self, name: str, *arguments: Any) -> None:
        """Call a function of the FMU; FailedError where it gives more than a warning."""
        said = len(self._log)
        status = self._plain(f"fmi{self._version}{name}", *arguments)
        if status > 1:
            words = [text for _, text in self._log[said:] if text]
            own = f": {words[-1]}" if words else ""
            raise FailedError(status, f"fmi{self._version}{name} ended with status {status}{own}")

    def _several(self, name: str, values: Any, count: int) -> None:
        """Get or set numbers."""
        self._call(name, ctypes.cast(values, ctypes.c_void_p), ctypes.c_size_t(count))

    def _set_time(self, time: float) -> None:
        self._call("SetTime", ctypes.c_double(time))

    def enter(self, time: float) -> int:
        """Make the event with which the initialisation ends; its status."""
        self._time = time
        try:
            self._update()
        except FailedError as error:
            return self._told(error)
        return OK

    def _told(self, error: FailedError) -> int:
        """The status of a failure, which is told."""
        status, said = error.args
        self._log.append((status, said))
        return status

    def _update(self) -> None:
        """Update discrete states until they no longer change."""
        for _ in range(MOST_EVENTS):
            if self._version == 2:
                info = _EventInfo()
                self._call("NewDiscreteStates", ctypes.byref(info))
                again, terminate, defined = info.flag0, info.flag1, info.flag4
                following = info.next
            else:
                flags, place = (ctypes.c_bool * 5)(), ctypes.c_double()
                self._call("UpdateDiscreteStates", *(ctypes.byref(flags, k) for k in range(5)), ctypes.byref(place))
                again, terminate, defined, following = flags[0], flags[1], flags[4], place.value
            self._next = following if defined else math.inf
            if terminate:
                self.ended = self._time
                return
            if not again:
                return
        raise FailedError(ERROR, f"an event at {self._time:.9g} s does not come to its end")

    def _integrate(self) -> None:
        """Leave event mode for an integration from here on."""
        self._call("EnterContinuousTimeMode")
        if self._cvode is None:
            get, put = ("GetContinuousStates", "SetContinuousStates")
            rates = "GetDerivatives" if self._version == 2 else "GetContinuousStateDerivatives"
            self._cvode = _Cvode(
                nx=self._states,
                nz=self._indicators,
                get_x=lambda x, n: self._several(get, x, n),
                set_x=lambda x, n: self._several(put, x, n),
                get_dx=lambda x, n: self._several(rates, x, n),
                get_z=lambda z, n: self._several("GetEventIndicators", z, n) if n else None,
                get_nominals=lambda x, n: self._several("GetNominalsOfContinuousStates", x, n),
                set_time=self._set_time,
                input=_Inputs(),
                startTime=self._time,
                relativeTolerance=self._tolerance,
                maxNumSteps=MOST_STEPS,
            )
        else:
            self._cvode.reset(self._time)

    def _advance(self, goal: float) -> bool:
        """Integrate towards a time; whether CVODE says where it has stopped, at a state event or there."""
        assert self._cvode is not None
        # Beyond the event, or the end of the step, other equations may hold.
        _set_stop(self._cvode.cvode_mem, goal)
        try:
            met, _, self._time = self._cvode.step(self._time, goal)
        except RuntimeError as error:
            raise self._cvode.failed or FailedError(ERROR, f"CVODE: {error.args[0].rpartition(': ')[2]}") from error
        return bool(met)

    def step(self, begin: float, length: float) -> tuple[int, float]:
        """Make a step; its status, and up to when it was made."""
        end, self._time = begin + length, begin
        close = CLOSE * (length + abs(end))
        try:
            self._set_time(begin)
            self._update()
            for _ in range(MOST_EVENTS):
                if self.ended is not None:
                    return DISCARD if self._version == 2 else OK, self.ended
                if self._time >= end - close:
                    return OK, end
                self._integrate()
                self._until(end, close)
                self._call("EnterEventMode")
                self._update()
            raise FailedError(ERROR, f"more than {MOST_EVENTS} events between {begin:.9g} s and {end:.9g} s")
        except FailedError as error:
            return self._told(error), self._time

    def _until(self, end: float, close: float) -> None:
        """Integrate to the next event, or to the end of the step."""
        goal = min(end, max(self._next, self._time))
        met = self._advance(goal) if goal - self._time > close else False
        if not met:
            self._time = goal
        self._set_time(self._time)
        if self._version == 2:
            flags: Any = (ctypes.c_int * 2)()
            places = [ctypes.byref(flags, 4 * k) for k in range(2)]
            self._call("CompletedIntegratorStep", 1, *places)
        else:
            flags = (ctypes.c_bool * 2)()
            places = [ctypes.byref(flags, k) for k in range(2)]
            self._call("CompletedIntegratorStep", ctypes.c_bool(True), *places)
        if flags[1]:
            self.ended = self._time
