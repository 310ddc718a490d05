"""A run in real time: each step waits for the clock of the machine; delays, jitter and overruns are measured."""

import math
import time
from collections.abc import Callable

LONGEST_SLEEP = 0.05
"""Time after which a sleeping run looks for Ctrl-C [s]."""
SPIN = 2e-4
"""Last part of a wait, in which the run does not sleep [s]: a sleep ends late."""


class Pacer:
    """The clock of a run whose steps are `step` long [s], `factor` times as fast as real time.

    A step begins when it is due. Its delay is how much later it begins; jitter is the standard deviation of the delays.
    An overrun is a step that ends after the next one is due.
    """

    def __init__(self, step: float, factor: float) -> None:
        self._period, self._factor = step / factor, factor
        self._began = time.perf_counter()
        self._count = self._overruns = 0
        self._sum = self._squares = self._largest = 0.0

    def wait(self, step: int, pressed: Callable[[], bool]) -> None:
        """Wait until a step is due, or until Ctrl-C."""
        due = self._began + step * self._period
        remaining = due - time.perf_counter()
        if step and remaining < 0.0:
            self._overruns += 1
        while remaining > 0.0 and not pressed():
            if remaining > SPIN:
                time.sleep(min(remaining - SPIN, LONGEST_SLEEP))
            remaining = due - time.perf_counter()
        delay = max(-remaining, 0.0)
        self._count += 1
        self._sum += delay
        self._squares += delay * delay
        self._largest = max(self._largest, delay)

    def summary(self) -> str:
        """Return the delays, the jitter and the overruns as a sentence."""
        count = max(self._count, 1)
        mean = self._sum / count
        jitter = math.sqrt(max(self._squares / count - mean * mean, 0.0))
        times = [f"{1e3 * seconds:.3g} ms" for seconds in (mean, jitter, self._largest)]
        counted = f"{self._count} steps of {1e3 * self._period:.6g} ms"
        late = f"delay {times[0]} on average, jitter {times[1]}, largest delay {times[2]}"
        return f"real time times {self._factor:g}: {counted}, {late}, {self._overruns} overruns"
