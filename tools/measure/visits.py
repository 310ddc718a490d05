"""The rests of a table during its measurement: found as they end by the rules of a whole record, judged at once.

Only rows since the previous rest are kept, so hours need no more memory than the longest rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..records import RawRecord
from ..records.kinds import PositionRecord, Rest
from ..records.noise import SCATTER_FACTOR, trend_of
from ..records.rests import (
    GREATEST_TOLERANCE,
    SHORTEST,
    WINDOW,
    angles_of,
    average_rests,
    find_stops,
    quiet_tolerance,
    reading_floor,
    smallest_step,
    tested,
)
from ..rounding import digits, upwards
from .readings import ALPHA, BETA, F1, LINE, TIME, WARMTH

MOST_ROWS = 360_000
"""Largest number of kept rows of a rest and the move before it: the last hour at 100 Hz."""
TAIL = 256
"""Number of kept rows of the previous rest: they show the encoders' noise, and the table's origin."""
SHARE = 0.05
"""Largest share of the time that examining the present rest may take."""
MAGNITUDES = (0.5, 1.5)
"""Limits of |f| over gravity at rest."""


@dataclass(frozen=True)
class RestVisit:
    """A completed rest.

    Attributes
    ----------
    number : int
        number among all rests, from 1
    first_row, last_row : int
        lines of the record
    average : PositionRecord
        average of the rest, one position, good or bad
    sense : (int, int)
        sense of the last move of each axis; 0 if there was none
    lasted_s, kept_s : float
        durations of the rest and of its averaged part [s]
    scatter : float
        bound of the mean's error by the rest's own scatter, over the noise bound
    bad : str
        reason to repeat it; empty if it is good
    remarks : tuple of str
        changes during the rest, as of `Rest`
    """

    number: int
    first_row: int
    last_row: int
    average: PositionRecord
    sense: tuple[int, int]
    lasted_s: float
    kept_s: float
    scatter: float
    bad: str = ""
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Present:
    """The present state of the table: waiting, moving, settling, resting or enough; `why` is the fault."""

    state: str = "waiting"
    alpha: float = 0.0
    beta: float = 0.0
    lasted_s: float = 0.0
    kept_s: float = 0.0
    scatter: float = 0.0
    why: str = ""
    time_s: float = 0.0


class Watch:
    """Cut rows into visits: a fold over rows, independent of the pieces in which they come.

    Parameters
    ----------
    noise_bound : float
        promised σ of one averaged reading, a fraction of g
    gravity : float
        gravity [m/s²]
    dwell_s : float
        time over which a rest should be averaged [s]; a stop shorter than a quarter of it, or of the median rest,
        does not count
    path : Path
        path of the record
    """

    def __init__(self, noise_bound: float, gravity: float, dwell_s: float, path: Path) -> None:
        self.noise_bound, self.gravity, self.dwell_s, self.path = noise_bound, gravity, dwell_s, path
        self._rows: NDArray = np.zeros((1024, 8))
        self._count, self._done = 0, 0
        self._anchor, self._seen = 0, 0
        self._found, self._lasted, self._sense = 0, [], [0, 0]
        self._resolution, self._steps = 0.0, [np.inf, np.inf]
        self._present, self._looked, self._cost = Present(), 0.0, 0.0

    def take(self, rows: NDArray, resolution: float = 0.0) -> list[RestVisit]:
        """Return the visits that end within rows (n, 8), written to half a digit of `resolution` [m/s²]."""
        self._resolution = resolution
        visits: list[RestVisit] = []
        for piece in np.array_split(rows, len(rows) // 65536 + 1):
            self._append(piece)
            while (departure := self._leaves()) is not None:
                if departure - self._anchor >= WINDOW:
                    visits += self._over(departure + 1)
                else:
                    self._anchor = departure
        return visits

    def end(self) -> list[RestVisit]:
        """Return the present rest as a visit if the source ends in one."""
        return self._over(self._count, ended=True)

    def present(self) -> Present:
        """Return the table's state; examine it again only if that takes a small share of the time."""
        began = perf_counter()
        if began - self._looked > self._cost / SHARE:
            self._present = self._look()
            self._looked = perf_counter()
            self._cost = self._looked - began
        return self._present

    def _append(self, rows: NDArray) -> None:
        if self._count + len(rows) > MOST_ROWS:
            self._cut(self._count + len(rows) - MOST_ROWS)
        needed = self._count + len(rows)
        if needed > len(self._rows):
            grown = np.zeros((min(max(2 * len(self._rows), needed), MOST_ROWS), 8))
            grown[: self._count] = self._rows[: self._count]
            self._rows = grown
        self._rows[self._count : needed] = rows
        self._count = needed

    def _cut(self, first: int) -> None:
        """Forget the rows before one."""
        self._rows[: self._count - first] = self._rows[first : self._count].copy()
        self._count -= first
        self._done, self._anchor = max(self._done - first, 0), max(self._anchor - first, 0)
        self._seen = max(self._seen - first, 0)

    def _leaves(self) -> int | None:
        """Return the first row that has left the place of the anchor, None if there is none yet."""
        start, width = max(self._seen, self._anchor), 64
        while start < self._count:
            angles = self._rows[start : min(start + width, self._count), ALPHA : BETA + 1]
            turned = np.remainder(angles - self._rows[self._anchor, ALPHA : BETA + 1] + np.pi, 2.0 * np.pi) - np.pi
            away = np.flatnonzero(np.abs(turned).max(axis=1) > GREATEST_TOLERANCE)
            if len(away):
                return start + int(away[0])
            start += len(angles)
            self._seen, width = start, 4 * width
        return None

    def _raw(self, end: int) -> RawRecord:
        rows = self._rows[:end]
        warmth = rows[:, WARMTH]
        return RawRecord(
            time_s=rows[:, TIME],
            alpha=rows[:, ALPHA],
            beta=rows[:, BETA],
            specific_force=rows[:, F1 : F1 + 3],
            temperature=None if np.isnan(warmth).any() else warmth,
            path=self.path,
            row=rows[:, LINE].astype(int),
            resolution=self._resolution,
        )

    def _stops(self, raw: RawRecord) -> tuple[NDArray, NDArray, list[tuple[int, int]]]:
        """Return angles (n, 2), the tolerance of a rest, and the stops that are not done."""
        angles = angles_of(raw)
        if len(raw) < WINDOW:
            return angles, np.zeros(2), []
        self._steps = [min(step, smallest_step(angles[:, k])) for k, step in enumerate(self._steps)]
        tolerance = np.array([quiet_tolerance(angles[:, k], self._steps[k]) for k in range(2)])
        stops = []
        for stop in find_stops(angles, tolerance):
            if stop[1] >= self._done:
                stops.append(stop)
        return angles, tolerance, stops

    def _over(self, end: int, *, ended: bool = False) -> list[RestVisit]:
        """Return the visits among the rows up to `end`, at which the table has left its place, or the source ended."""
        raw = self._raw(end)
        angles, tolerance, stops = self._stops(raw)
        self._anchor = end - 1
        visits, last = [], None
        for first, stop in stops:
            if stop >= end - 1 and not ended:
                break
            first = max(first, self._done)
            lasted = float(raw.time_s[stop] - raw.time_s[first])
            usual = self.dwell_s
            if self._lasted:
                usual = min(usual, float(np.median(self._lasted)))
            if lasted > SHORTEST * usual:
                self._lasted.append(lasted)
                visits.append(self._visit(raw, tested(raw, angles, tolerance, first, stop)))
            last = (first, stop)
            self._done = stop + 1
        if last is not None:
            self._cut(max(last[0], last[1] + 1 - TAIL))
        return visits

    def _visit(self, raw: RawRecord, rest: Rest) -> RestVisit:
        average = average_rests(raw, [replace(rest, refused=None)])
        self._found += 1
        for k, sense in enumerate((average.approach_alpha, average.approach_beta)):
            if sense is not None:
                self._sense[k] = int(sense[0])
        bad, scatter = self.judged(raw, rest, average)
        average = replace(average, raw=None, rests=(), dwell_noise=None, warnings=())
        return RestVisit(
            number=self._found,
            first_row=int(raw.row[rest.first]),
            last_row=int(raw.row[rest.last]),
            average=average,
            sense=(self._sense[0], self._sense[1]),
            lasted_s=float(raw.time_s[rest.last] - raw.time_s[rest.first]),
            kept_s=float(raw.time_s[rest.kept_last] - raw.time_s[rest.kept_first]),
            scatter=scatter,
            bad=bad,
            remarks=rest.trends,
        )

    def judged(self, raw: RawRecord, rest: Rest, average: PositionRecord) -> tuple[str, float]:
        """Return the reason why a rest is bad (empty if it is good), and the error of its mean by scatter over the
        noise bound.

        Bad is a rest that a whole record leaves out, or that breaks the promise: three standard errors of the mean, or
        half of a drift, exceed the noise bound.
        """
        assert average.scatter is not None
        errors = SCATTER_FACTOR * average.scatter[0] / self.gravity
        axis = int(errors.argmax())
        scatter = float(errors[axis] / self.noise_bound)
        if rest.refused is not None:
            return rest.refused, scatter
        size = float(np.linalg.norm(average.specific_force[0])) / self.gravity
        if not MAGNITUDES[0] <= size <= MAGNITUDES[1]:
            return f"|f| is {digits(size, 4)} times gravity; are the readings in m/s²?", scatter
        rows = rest.kept
        drift = trend_of(raw.time_s[rows], raw.specific_force[rows], reading_floor(raw))
        half = np.where(drift.significant, 0.5 * np.abs(drift.change), 0.0) / self.gravity
        axis = int(half.argmax())
        if half[axis] > self.noise_bound:
            drifting = f"f{axis + 1} drifts by {digits(2.0 * half[axis], 2)} g over the rest"
            return f"{drifting}, half of it more than the {upwards(self.noise_bound, 2)} g that are promised", scatter
        if scatter > 1.0:
            promised = (
                f"{upwards(errors[axis], 2)} g by its scatter, where {upwards(self.noise_bound, 2)} g is promised"
            )
            return f"the mean of f{axis + 1} may be wrong by {promised}: rest longer", scatter
        return "", scatter

    def _look(self) -> Present:
        if not self._count:
            return Present()
        raw = self._raw(self._count)
        angles, tolerance, stops = self._stops(raw)
        present = Present("moving", float(raw.alpha[-1]), float(raw.beta[-1]), time_s=float(raw.time_s[-1]))
        if not stops or stops[-1][1] < self._count - 1:
            return present
        first = max(stops[-1][0], self._done)
        lasted = float(raw.time_s[-1] - raw.time_s[first])
        if self._count - first < 2 * WINDOW:
            return replace(present, state="settling", lasted_s=lasted)
        rest = tested(raw, angles, tolerance, first, self._count - 1)
        average = average_rests(raw, [replace(rest, refused=None)])
        why, scatter = self.judged(raw, rest, average)
        kept_s = float(raw.time_s[rest.kept_last] - raw.time_s[rest.kept_first])
        state = "enough"
        if "settled" in why:
            state = "settling"
        elif why or kept_s < self.dwell_s:
            state = "resting"
        return replace(present, state=state, lasted_s=lasted, kept_s=kept_s, scatter=scatter, why=why)


def record_of_visits(visits: Sequence[RestVisit], path: Path) -> PositionRecord:
    """Return the position record of visits, like that of a whole record, a row for each."""
    averages = [visit.average for visit in visits]
    first = averages[0]

    def joined(name: str) -> NDArray:
        return np.concatenate([getattr(average, name) for average in averages])

    senses = np.array([visit.sense for visit in visits], dtype=float)
    known_senses = np.all(senses != 0, axis=0)
    fields = {name: joined(name) for name in ("time_s", "alpha", "beta", "specific_force", "scatter", "row")}
    return replace(
        first,
        position=np.arange(1, len(visits) + 1),
        **fields,
        temperature=None if first.temperature is None else joined("temperature"),
        approach_alpha=senses[:, 0] if known_senses[0] else None,
        approach_beta=senses[:, 1] if known_senses[1] else None,
        resolution=max(average.resolution for average in averages),
        path=path,
    )
