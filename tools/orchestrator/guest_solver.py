"""An FMU of model exchange as one that steps: SUNDIALS' CVODE integrates it, in its guest's process."""

import ctypes
from collections.abc import Callable
from typing import Any

from fmpy.sundials import CVodeSolver
from fmpy.sundials.libraries import sundials_cvode

from .guest_events import ERROR, Events, FailedError

_set_stop = sundials_cvode.CVodeSetStopTime
_set_stop.argtypes, _set_stop.restype = [ctypes.c_void_p, ctypes.c_double], ctypes.c_int
MOST_STEPS = 100_000
"""Of the solver from event to event."""


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


class Solver(Events):
    """The FMU's steps, by a solver with a relative tolerance."""

    begins = "EnterContinuousTimeMode"

    def __init__(
        self, version: int, call: Callable[..., int], log: list[Any], states: int, indicators: int, tolerance: float
    ) -> None:
        super().__init__(version, call, log)
        self._states, self._indicators, self._tolerance = states, indicators, tolerance
        self._cvode: _Cvode | None = None

    def _several(self, name: str, values: Any, count: int) -> None:
        """Get or set numbers."""
        self._call(name, ctypes.cast(values, ctypes.c_void_p), ctypes.c_size_t(count))

    def _set_time(self, time: float) -> None:
        self._call("SetTime", ctypes.c_double(time))

    def step(self, begin: float, length: float) -> tuple[int, float]:
        """Make a step; its status, and up to when it was made."""
        status = self._plain(f"fmi{self._version}SetTime", ctypes.c_double(begin))
        return (status, begin) if status > 1 else super().step(begin, length)

    def _begin(self) -> None:
        """Begin an integration from here on."""
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

    def _integrate(self, goal: float) -> bool:
        """Integrate towards a time; whether CVODE says where it has stopped, at a state event or there."""
        assert self._cvode is not None
        # Beyond the event, or the end of the step, other equations may hold.
        _set_stop(self._cvode.cvode_mem, goal)
        try:
            met, _, self._time = self._cvode.step(self._time, goal)
        except RuntimeError as error:
            raise self._cvode.failed or FailedError(ERROR, f"CVODE: {error.args[0].rpartition(': ')[2]}") from error
        return bool(met)

    def _advance(self, end: float, close: float) -> None:
        """Integrate to the next event, or to the end of the step."""
        self._begin()
        goal = min(end, max(self._next, self._time))
        met = self._integrate(goal) if goal - self._time > close else False
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
