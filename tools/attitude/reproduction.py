"""The published errors again: under the paper's conditions, under exact ones, and with single causes left out."""

import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ..progress import progress_bar
from .angles import angle_errors
from .compiled_runs import run_algorithm, sample_motion
from .conditions import CAUSES, EXACT, PAPER, Cause, Conditions
from .paper_motions import paper_motion
from .published import PublishedRow, published_rows

DURATION = 600.0
"""Length of every run [s]."""

Task = tuple[PublishedRow, Conditions]
Stream = tuple[bytes, float, int]
"""Harmonics, sample period and intervals of the trapezoid rule: what the increments depend on."""


@dataclass(frozen=True)
class ReproducedRow:
    """A published row and what comes out.

    Attributes
    ----------
    row : PublishedRow
    reproduced : ndarray, shape (3,)
        largest errors of ψ, ϑ, γ under the paper's conditions [rad]
    method : ndarray, shape (3,)
        the same with exact increments, exact π and normalised quaternions: the method's own error [rad]
    """

    row: PublishedRow
    reproduced: np.ndarray
    method: np.ndarray

    @property
    def ratio(self) -> np.ndarray:
        """Reproduced over published, for ψ, ϑ, γ."""
        return self.reproduced / self.row.error


@dataclass(frozen=True)
class Effect:
    """What a row becomes when one of the causes is left out.

    Attributes
    ----------
    cause : Cause
    row : PublishedRow
    ratio, ratio_without : ndarray, shape (3,)
        reproduced over published, under the paper's conditions and without this cause
    """

    cause: Cause
    row: PublishedRow
    ratio: np.ndarray
    ratio_without: np.ndarray


@dataclass(frozen=True)
class Reproduction:
    """All rows and the effects of the causes."""

    rows: tuple[ReproducedRow, ...]
    effects: tuple[Effect, ...]

    def score(self, tables: Sequence[str], within: float) -> tuple[int, int]:
        """How many numbers of some tables are reproduced within a fraction, and how many there are."""
        ratios = [row.ratio for row in self.rows if row.row.table in tables]
        return int((np.abs(np.array(ratios).reshape(-1, 3) - 1.0) <= within).sum()), 3 * len(ratios)


def reproduce_attitude(numbers: Iterable[int] | None = None, *, progress: bool = False) -> Reproduction:
    """Run published rows under the paper's conditions, under exact ones, and without each cause that they show.

    Parameters
    ----------
    numbers : iterable of int, optional
        rows by their number; all when it is not given
    progress : bool
        show a bar where standard error is a terminal
    """
    chosen = set(numbers) if numbers is not None else None
    rows = [row for row in published_rows() if chosen is None or row.number in chosen]
    left_out = [(cause, row) for row in rows for cause in CAUSES if row.number in cause.shown_on]
    tasks = [(row, conditions) for row in rows for conditions in (PAPER, EXACT)]
    tasks += [(row, PAPER.without(cause.switch)) for cause, row in left_out]
    errors = run_tasks(tasks, progress=progress)
    order = {cause.switch: k for k, cause in enumerate(CAUSES)}
    left_out.sort(key=lambda pair: (order[pair[0].switch], pair[1].number))
    return Reproduction(
        tuple(ReproducedRow(row, errors[row, PAPER], errors[row, EXACT]) for row in rows),
        tuple(
            Effect(cause, row, errors[row, PAPER] / row.error, errors[row, PAPER.without(cause.switch)] / row.error)
            for cause, row in left_out
        ),
    )


def run_tasks(tasks: Iterable[Task], *, progress: bool = False) -> Mapping[Task, np.ndarray]:
    """Largest errors of ψ, ϑ, γ [rad] of rows under conditions; rows with the same increments share them.

    The work is spread over the cores by threads: compiled code does not hold Python's lock.
    """
    groups: dict[Stream, list[Task]] = {}
    for row, conditions in dict.fromkeys(tasks):
        period = row.step / conditions.algorithm(row).samples
        stream = (paper_motion(row.motion, conditions).tobytes(), period, conditions.intervals(row))
        groups.setdefault(stream, []).append((row, conditions))
    # The longest first, so that no core waits long at the end.
    ordered = sorted(groups, key=lambda stream: -_cost(stream))
    found: dict[Task, np.ndarray] = {}
    with (
        progress_bar("running the published rows", sum(map(_cost, ordered)), show=progress) as advance,
        ThreadPoolExecutor(max_workers=os.cpu_count()) as pool,
    ):
        for stream, errors in zip(ordered, pool.map(lambda key: _run_group(key, groups[key]), ordered), strict=True):
            found.update(errors)
            advance(_cost(stream))
    return found


def _run_group(stream: Stream, tasks: Sequence[Task]) -> dict[Task, np.ndarray]:
    harmonics, period, intervals = stream
    samples = sample_motion(np.frombuffer(harmonics), period, round(DURATION / period), intervals)
    found: dict[Task, np.ndarray] = {}
    for row, conditions in tasks:
        algorithm = conditions.algorithm(row)
        attitudes = run_algorithm(algorithm, samples.increments)
        true = samples.angles_at_steps(algorithm)
        found[row, conditions] = angle_errors(attitudes, true, not conditions.not_normalised)
    return found


def _cost(stream: Stream) -> float:
    """About how long a stream takes, in no unit."""
    _, period, intervals = stream
    return (10.0 + max(intervals, 6)) / period
