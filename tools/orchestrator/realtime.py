"""A run in real time: each step waits for the clock of the machine, and delays and overruns are counted."""

import time
from collections.abc import Callable

import numpy as np

LONGEST_SLEEP = 0.05
"""Time after which a sleeping run looks for Ctrl-C [s]."""
SPIN = 2e-4
"""Last part of a wait, in which the run does not sleep [s]: a sleep ends late."""


class Pacer:
    """The clock of a run of `steps` steps, each `step` [s] long, `factor` times as fast as real time.

    A step begins when it is due. Its delay is how much later it begins; an overrun is a step that ends after the next
    one is due.
    """

    def __init__(self, step: float, factor: float, steps: int) -> None:
        self._period, self._factor = step / factor, factor
        self._delays = np.zeros(steps)
        self._began = time.perf_counter()
        self._count = self.overruns = 0

    def wait(self, step: int, pressed: Callable[[], bool]) -> None:
        """Wait until a step is due, or until Ctrl-C."""
        due = self._began + step * self._period
        remaining = due - time.perf_counter()
        if step and remaining < 0.0:
            self.overruns += 1
        while remaining > 0.0 and not pressed():
            if remaining > SPIN:
                time.sleep(min(remaining - SPIN, LONGEST_SLEEP))
            remaining = due - time.perf_counter()
        self._delays[self._count] = max(-remaining, 0.0)
        self._count += 1

    def summary(self) -> str:
        """Return the delays and overruns as a sentence."""
        delays = 1e3 * self._delays[: max(self._count, 1)]
        usual, worst = np.median(delays), delays.max()
        counted = f"{self._count} steps of {1e3 * self._period:.6g} ms"
        late = f"delays {usual:.3g} ms (median), {worst:.3g} ms (largest)"
        return f"real time times {self._factor:g}: {counted}, {late}, {self.overruns} overruns"
