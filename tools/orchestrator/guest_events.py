"""An FMU whose events we handle: between its steps it is in event mode, where its inputs change and its events end.

It is loaded by `guest_process.py`, from its file, and imports nothing but Python's own.
"""

import ctypes
import math
from collections.abc import Callable
from typing import Any

OK, DISCARD, ERROR = 0, 2, 3
MOST_EVENTS = 10_000
"""In one step, and rounds of one event."""
CLOSE = 1e-13
"""Times that differ by less, relative to the step and the time, are one."""


class _EventInfo(ctypes.Structure):
    """What fmi2NewDiscreteStates says."""

    _fields_ = (*((f"flag{k}", ctypes.c_int) for k in range(5)), ("next", ctypes.c_double))


class FailedError(Exception):
    """A call of the FMU, or the solver, has failed: its status and what is to be said."""


class Events:
    """The FMU's steps from event to event; `ended` is when it asked for the end of the run.

    `call` takes a function's name and values of C, `log` is what the FMU logs.
    """

    begins = "EnterStepMode"

    def __init__(self, version: int, call: Callable[..., int], log: list[Any]) -> None:
        self._version, self._plain, self._log = version, call, log
        self._next = math.inf
        self.ended: float | None = None
        self._time = 0.0

    def _call(self, name: str, *arguments: Any) -> None:
        """Call a function of the FMU; FailedError where it gives more than a warning."""
        said = len(self._log)
        status = self._plain(f"fmi{self._version}{name}", *arguments)
        if status > 1:
            words = [text for _, text in self._log[said:] if text]
            own = f": {words[-1]}" if words else ""
            raise FailedError(status, f"fmi{self._version}{name} ended with status {status}{own}")

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

    def step(self, begin: float, length: float) -> tuple[int, float]:
        """Make a step; its status, and up to when it was made."""
        end, self._time = begin + length, begin
        close = CLOSE * (length + abs(end))
        try:
            self._update()
            for _ in range(MOST_EVENTS):
                if self.ended is not None:
                    return DISCARD if self._version == 2 else OK, self.ended
                if self._time >= end - close:
                    return OK, end
                self._call(self.begins)
                self._advance(end, close)
                self._call("EnterEventMode")
                self._update()
            raise FailedError(ERROR, f"more than {MOST_EVENTS} events between {begin:.9g} s and {end:.9g} s")
        except FailedError as error:
            return self._told(error), self._time

    def _advance(self, end: float, close: float) -> None:
        """Step to the next event, or to the end: the FMU returns before where it has one."""
        flags, reached = (ctypes.c_bool * 3)(), ctypes.c_double(self._time)
        places = [ctypes.byref(flags, k) for k in range(3)]
        times = ctypes.c_double(self._time), ctypes.c_double(end - self._time)
        self._call("DoStep", *times, ctypes.c_bool(False), *places, ctypes.byref(reached))
        self._time = reached.value if flags[2] else end
        if flags[1]:
            self.ended = self._time
