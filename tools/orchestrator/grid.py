"""Time of a run: counted in whole steps, never accumulated."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import InputError
from ..scenario import RunSetting

MOST_STEPS = 10**9


@dataclass(frozen=True)
class Grid:
    """The communication points: t_k = start + k step, k = 0 to steps."""

    start: float
    step: float
    steps: int

    def time(self, tick: int) -> float:
        """t_k [s]."""
        return self.start + tick * self.step


def make_grid(run: RunSetting, programme_ends: Sequence[int]) -> Grid:
    """Count the run's steps; without a stop time the longest programme says when it ends.

    Raises
    ------
    InputError
        the step does not divide the run, or nothing says when it ends
    """
    grid = _counted(run, programme_ends)
    if grid.steps > MOST_STEPS:
        raise InputError(f"run.step_s = {run.step_s!r} makes {grid.steps} steps; at most {MOST_STEPS} are possible")
    return grid


def _counted(run: RunSetting, programme_ends: Sequence[int]) -> Grid:
    if run.stop_s is None:
        if not programme_ends:
            raise InputError("run.stop_s is missing (only a position programme says by itself when a run ends)")
        return Grid(run.start_s, run.step_s, max(programme_ends))
    span = run.stop_s - run.start_s
    ratio = span / run.step_s
    if not ratio < 2**53:
        raise InputError(f"run.step_s = {run.step_s!r} makes {ratio:.3g} steps; at most {MOST_STEPS} are possible")
    steps = round(ratio)
    if steps < 1 or abs(steps * run.step_s - span) > 1e-9 * span:
        fewer, more = span / max(1, math.floor(ratio)), span / max(1, math.ceil(ratio))
        fits = f"{more!r} would" if fewer == more else f"{more:.9g} or {fewer:.9g} would"
        raise InputError(
            f"run.step_s = {run.step_s!r} does not divide the run of {span!r} s ({ratio:.9g} steps); {fits}"
        )
    return Grid(run.start_s, run.step_s, steps)
