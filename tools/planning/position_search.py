"""The search for a common set of positions: many starts, each improved locally, and the best ones changed in part.

Random numbers come from the seed, and the budget is counted in starts: the same options find the same plan.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import progress_bar
from .improvement import improve, merit
from .places import Places, Task, allowed, free_arcs
from .position_costs import NOT_DETERMINED, Costs, costs

ELITE = 6
"""So many of the best sets are kept and changed."""
ALIKE = 1e-6
"""Sets whose merit differs by less count as one."""
FRESH = 0.2
"""Share of starts that begin anew when there is something to change."""
DRAWS = 6
"""Of so many random sets the best one is improved."""
SPREAD_DEG = 8.0
"""How far from the axes' multiples of 90° a start looks, where it does."""
GIVE_UP = ((8, 0.05), (15, 0.01))
"""After so many steps an improvement must be so near the best sets [ratio], relative to what they lose themselves."""
REDRAWS = 200


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    best : Costs
    starts : int
        how many were made
    interrupted : bool
        whether Ctrl-C ended it before its budget was spent
    """

    best: Costs
    starts: int
    interrupted: bool


def search(
    task: Task,
    count: int,
    *,
    criterion: str = "worst",
    seed: int = 0,
    starts: int = 60,
    given: Sequence[Places] = (),
    progress: bool = False,
) -> Found | None:
    """Look for the best set of so many positions; Ctrl-C ends the search and keeps the best so far.

    Parameters
    ----------
    task : Task
    count : int
        N
    criterion : {"worst", "mean"}
    seed, starts : int
        of the random numbers; how many local improvements
    given : sequence of Places
        sets to begin with, beside the random ones
    progress : bool
        show a bar on a terminal

    Returns
    -------
    Found or None
        None when no set was found that determines all targets

    Raises
    ------
    KeyboardInterrupt
        when Ctrl-C came before there was any set to keep
    """
    rng = np.random.default_rng(seed)
    elite: list[tuple[float, Costs]] = []
    done, interrupted = 0, False
    with progress_bar(f"{count} positions", len(given) + starts, show=progress) as advance:
        try:
            for places in [*given, *([None] * starts)]:
                start = _start(task, count, rng, elite) if places is None else costs(task, places)
                found = improve(task, start, criterion=criterion, hopeless=_hopeless(elite))
                done += 1
                _keep(elite, merit(found, criterion), found)
                state = f"{count} positions, ratio {elite[0][1].worst:.5f}" if elite[0][1].determined.all() else None
                advance(1, state)
        except KeyboardInterrupt:
            if not elite:
                raise
            interrupted = True
    if not elite or not elite[0][1].determined.all():
        return None
    return Found(elite[0][1], done, interrupted)


def _hopeless(elite: Sequence[tuple[float, Costs]]) -> Callable[[int, float], bool]:
    if len(elite) < ELITE:
        return lambda step, value: False
    last = elite[-1][0]
    room = max(1.0, last - 1.0)
    return lambda step, value: any(step == at and value > last + share * room for at, share in GIVE_UP)


def _keep(elite: list[tuple[float, Costs]], value: float, found: Costs) -> None:
    if all(abs(value - other) > ALIKE for other, _ in elite):
        elite.append((value, found))
        elite.sort(key=lambda pair: pair[0])
        del elite[ELITE:]


def _start(task: Task, count: int, rng: np.random.Generator, elite: Sequence[tuple[float, Costs]]) -> Costs:
    """A set to improve: random, or one of the best with one or two positions drawn anew."""
    if len(elite) < ELITE or rng.random() < FRESH:
        return _best(costs(task, drawn(task, count, rng)) for _ in range(DRAWS))
    base = elite[int(rng.integers(len(elite)))][1].places
    return _best(costs(task, _changed(task, base, rng)) for _ in range(2))


def _changed(task: Task, base: Places, rng: np.random.Generator) -> Places:
    rows = rng.choice(len(base), min(len(base), int(rng.integers(1, 3))), replace=False)
    new = drawn(task, len(rows), rng)
    angle, mounting = base.angle.copy(), base.mounting.copy()
    angle[rows], mounting[rows] = new.angle, new.mounting
    return Places(angle, mounting)


def _best(trials: Iterable[Costs]) -> Costs:
    return min(trials, key=lambda found: (min(found.worst, NOT_DETERMINED), found.mean))


def drawn(task: Task, count: int, rng: np.random.Generator) -> Places:
    """Random positions outside the keep-outs: anywhere, or near multiples of 90° of both axes."""
    angle = _random_angles(count, rng, bool(rng.integers(2)))
    for _ in range(REDRAWS):
        wrong = ~allowed(task, angle)
        if not wrong.any():
            break
        angle[wrong] = _random_angles(int(wrong.sum()), rng, False)
    else:
        wrong = ~allowed(task, angle)
        angle[wrong] = _free_angles(task, int(wrong.sum()), rng)
    return Places(angle, rng.integers(0, len(task.parametrisation.mountings), count))


def _free_angles(task: Task, count: int, rng: np.random.Generator) -> NDArray:
    """Random angles outside keep-outs that leave little: an arc by its width, then anywhere on it."""
    angle = np.zeros((count, 2))
    for axis, intervals in enumerate(task.keep_out):
        low, high = np.array(free_arcs(intervals)).T
        arc = rng.choice(len(low), count, p=(high - low) / (high - low).sum())
        angle[:, axis] = rng.uniform(low[arc], high[arc])
    return angle


def _random_angles(count: int, rng: np.random.Generator, near_axes: bool) -> NDArray:
    if not near_axes:
        return rng.uniform(0.0, 2.0 * np.pi, (count, 2))
    return np.radians(90.0 * rng.integers(0, 4, (count, 2)) + rng.normal(0.0, SPREAD_DEG, (count, 2)))
