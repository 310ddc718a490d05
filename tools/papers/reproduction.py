"""The published errors of attitude algorithms again: under the paper's conditions, exact ones, without one cause."""

import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated, Literal, TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from ..motion.attitude_error import angle_errors
from ..motion.compare import run_algorithm, sample_motion
from ..progress import progress_bar
from ..result import ABSENT, Result
from .attitude import ANGLES, CAUSES, EXACT, PAPER, UNEXPLAINED, Conditions, PublishedRow, paper_motion, published_rows

DURATION = 600.0
"""Length of every run [s]."""

TOLERANCE = 0.05
"""A number is reproduced when it comes out within this fraction of the printed one."""

SCORED = (
    (("1",), 0.002),
    (("3.1.1",), TOLERANCE),
    (("2", "3"), TOLERANCE),
)
"""Tables that are counted together, and the fraction of the printed number within which one counts."""

Task: TypeAlias = tuple[PublishedRow, Conditions]
Stream: TypeAlias = tuple[bytes, float, int]
"""Harmonics, sample period and intervals of the trapezoid rule: what the increments depend on."""


def _six_digits(values: Sequence[float] | NDArray) -> list[float]:
    """More are rounding of a run of a million steps."""
    return [float(f"{value:.6g}") for value in values]


Angles: TypeAlias = Annotated[
    NDArray[np.float64],
    BeforeValidator(lambda value: np.asarray(value, dtype=np.float64)),
    PlainSerializer(_six_digits),
    WithJsonSchema({"type": "array", "items": {"type": "number"}}),
]
"""Something of ψ, ϑ, γ (3,); six digits in JSON."""


class ReproducedRow(Result):
    """A published row and what comes out: largest errors of ψ, ϑ, γ.

    Attributes
    ----------
    row : int
        its number, from 1
    reproduced_deg : (3,) array
        under the paper's conditions [deg]
    ratio : (3,) array
        reproduced over published
    method_error_deg : (3,) array
        with exact increments, exact π and normalised quaternions: the method's own error [deg]
    not_reproduced : tuple of str
        the angles that come out more than `TOLERANCE` away from print
    remark : str
        what is known of these; empty where all come out
    printed : PublishedRow
    """

    row: int
    table: str
    algorithm: str
    h_s: float
    nodes: int = Field(alias="M")
    motion: str
    published_deg: tuple[float, float, float]
    reproduced_deg: Angles
    ratio: Angles
    method_error_deg: Angles
    not_reproduced: tuple[str, ...]
    remark: str
    printed: PublishedRow = Field(default=ABSENT, exclude=True)


class Effect(Result):
    """What a row becomes when one of the causes is left out.

    Attributes
    ----------
    cause, sentence : str
        switch of `Conditions`, and what was done
    row : int
    ratio, ratio_without : (3,) array
        reproduced over published, under the paper's conditions and without this cause
    title : str
        of the row
    """

    cause: str
    sentence: str
    row: int
    ratio: Angles
    ratio_without: Angles
    title: str = Field(default="", exclude=True)


class Score(Result):
    """How many numbers of some tables are reproduced within a fraction, and how many there are."""

    tables: tuple[str, ...]
    within: float
    numbers: int
    of: int


class Reproduction(Result):
    """All rows, the effects of the causes, and the scores; angles in degrees, as printed."""

    schema_: Literal["trihedron.attitude-reproduction/1"] = Field(
        default="trihedron.attitude-reproduction/1", alias="schema"
    )
    rows: tuple[ReproducedRow, ...]
    effects: tuple[Effect, ...] = Field(alias="causes")
    scores: tuple[Score, ...]

    def to_polars(self) -> pl.DataFrame:
        """One row for each published row; angles in degrees."""
        columns = {
            "row": [row.row for row in self.rows],
            "table": [row.table for row in self.rows],
            "algorithm": [row.algorithm for row in self.rows],
            "h_s": [row.h_s for row in self.rows],
            "M": [row.nodes for row in self.rows],
            "motion": [row.motion for row in self.rows],
        }
        values = {
            "published_{}_deg": [row.published_deg for row in self.rows],
            "reproduced_{}_deg": [_six_digits(row.reproduced_deg) for row in self.rows],
            "method_{}_deg": [_six_digits(row.method_error_deg) for row in self.rows],
            "ratio_{}": [_six_digits(row.ratio) for row in self.rows],
        }
        for name, found in values.items():
            for k, letter in enumerate(("psi", "theta", "gamma")):
                columns[name.format(letter)] = [angles[k] for angles in found]
        return pl.DataFrame(columns)


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
    found = tuple(_reproduced(row, errors[row, PAPER], errors[row, EXACT]) for row in rows)
    return Reproduction(
        rows=found,
        causes=tuple(
            Effect(
                cause=cause.switch,
                sentence=cause.sentence,
                row=row.number,
                ratio=errors[row, PAPER] / row.error,
                ratio_without=errors[row, PAPER.without(cause.switch)] / row.error,
                title=row.title,
            )
            for cause, row in left_out
        ),
        scores=tuple(_score(found, tables, within) for tables, within in SCORED),
    )


def _reproduced(row: PublishedRow, reproduced: NDArray, method: NDArray) -> ReproducedRow:
    """A row with the largest errors (3,) under the paper's conditions and under exact ones [rad]."""
    ratio = reproduced / row.error
    off = tuple(name for name, r in zip(ANGLES, ratio, strict=True) if not abs(r - 1.0) <= TOLERANCE)
    known = [sentence for numbers, sentence in UNEXPLAINED if row.number in numbers]
    return ReproducedRow(
        row=row.number,
        table=row.table,
        algorithm=row.print_name,
        h_s=row.step,
        M=row.nodes,
        motion=row.motion,
        published_deg=row.error_deg,
        reproduced_deg=np.degrees(reproduced),
        ratio=ratio,
        method_error_deg=np.degrees(method),
        not_reproduced=off,
        remark=(known[0] if known else "unknown") if off else "",
        printed=row,
    )


def _score(rows: Sequence[ReproducedRow], tables: tuple[str, ...], within: float) -> Score:
    ratios = [row.ratio for row in rows if row.table in tables]
    hit = int((np.abs(np.array(ratios).reshape(-1, 3) - 1.0) <= within).sum())
    return Score(tables=tables, within=within, numbers=hit, of=3 * len(ratios))


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
