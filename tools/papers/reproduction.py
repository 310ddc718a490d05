"""Published tables of two papers next to computed ones, and the cost of limited word length.

Sources: Golovan, Matasov, Tarygin 2022, Tables 1 and 2, case A1, Q = I; Chelnokov, Perelyaev, Chelnokova 2016, Tables 1
to 3, section 3.1.1 and the update (22), in 32-bit arithmetic and with 32-bit increments against 64-bit ones.
"""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated, Literal, TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from ...models.arrays import Floats
from ..calibration.model import parametrise
from ..calibration.targets import expression_weights
from ..motion.attitude import algorithm_named, angle_between
from ..motion.compare import ARITHMETICS, ROUNDINGS, rounded_increments, run_algorithm, run_single, sample_motion
from ..planning.certificate import Optimum
from ..planning.forms import SignSheet, clearance, sheets, value
from ..planning.targets import optimal_plans
from ..progress import progress_bar
from ..result import Result
from ..rounding import digits, to_bound, upwards
from .attitude import (
    ANGLES,
    CAUSES,
    EXACT,
    PAPER,
    UNEXPLAINED,
    Conditions,
    PublishedRow,
    paper_motion,
    published_rows,
    table_rows,
)

PRINTED_ROUNDING = 0.005 + 1e-5
"""Half a last digit of a printed cost, and the rounding of six-digit weights."""
UNBIASED = 5e-6
"""Defect that weights of six digits may leave: half a last digit for each of ten readings."""
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
"""Harmonics, sample period and intervals of the trapezoid rule: they determine the increments."""
DOUBLE = "double"
"""64-bit arithmetic on the same rounded increments: only the increments' error remains."""
REPEATING, INCOMMENSURATE = "repeating", "incommensurate"
FIGURES = {
    "published_{}_deg": "published_deg",
    "reproduced_{}_deg": "reproduced_deg",
    "method_{}_deg": "method_error_deg",
    "ratio_{}": "ratio",
}
"""Columns of the table of rows, and the fields of three angles that they show."""
FREQUENCY_FACTORS = (1.01234567, 1.02430827, 1.02718280)
"""Make the frequencies of ψ, ϑ, γ incommensurate with each other and with the samples."""


def _six_digits(values: Sequence[float] | NDArray) -> list[float]:
    """More are rounding of a run of a million steps."""
    return [float(f"{value:.6g}") for value in values]


Angles: TypeAlias = Annotated[
    Floats,
    BeforeValidator(lambda value: np.asarray(value, dtype=np.float64)),
    PlainSerializer(_six_digits),
    WithJsonSchema({"type": "array", "items": {"type": "number"}}),
]
"""Something of ψ, ϑ, γ (3,); six digits in JSON."""


class ReproducedRow(PublishedRow):
    """A published row and its reproduction: largest errors of ψ, ϑ, γ.

    Attributes
    ----------
    reproduced_deg : (3,) array
        under the paper's conditions [deg]
    ratio : (3,) array
        reproduced over published
    method_error_deg : (3,) array
        with exact increments, exact π and normalised quaternions: the method's own error [deg]
    not_reproduced : tuple of str
        the angles that come out more than `TOLERANCE` away from print
    remark : str
        known facts about these; empty where all are reproduced
    """

    reproduced_deg: Angles
    ratio: Angles
    method_error_deg: Angles
    not_reproduced: tuple[str, ...]
    remark: str


class ConditionEffect(Result):
    """Result of a row with one of the causes left out.

    Attributes
    ----------
    cause, sentence : str
        switch of `Conditions`, and the departure
    row : int
    ratio, ratio_without : (3,) array
        reproduced over published, under the paper's conditions and without this cause
    title : str
        title of the row
    """

    cause: str
    sentence: str
    row: int
    ratio: Angles
    ratio_without: Angles
    title: str = Field(default="", exclude=True)


class TableScore(Result):
    """Count of the numbers of some tables that are reproduced within a fraction, and the total."""

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
    effects: tuple[ConditionEffect, ...] = Field(alias="causes")
    scores: tuple[TableScore, ...]

    def to_polars(self) -> pl.DataFrame:
        """One row for each published row; angles in degrees."""
        table = []
        for row in self.rows:
            content = row.to_json()
            line = {name: content[name] for name in ("row", "table", "algorithm", "h_s", "M", "motion")}
            for name, key in FIGURES.items():
                for letter, figure in zip(("psi", "theta", "gamma"), content[key], strict=True):
                    line[name.format(letter)] = figure
            table.append(line)
        return pl.DataFrame(table)


def reproduce_attitude(numbers: Iterable[int] | None = None, *, progress: bool = False) -> Reproduction:
    """Compute published rows of attitude errors under the paper's conditions and under exact ones.

    Parameters
    ----------
    numbers : iterable of int, optional
        rows to compute; all by default
    progress : bool
        show a bar where standard error is a terminal

    Returns
    -------
    Reproduction
        the errors of each row, and the effect of each condition
    """
    rows = {row.row: row for row in published_rows()}
    chosen = sorted(rows if numbers is None else rows.keys() & set(numbers))
    tasks = []
    for number in chosen:
        tasks += [(rows[number], PAPER), (rows[number], EXACT)]
    left_out = []
    for cause in CAUSES:
        for number in sorted(set(cause.shown_on).intersection(chosen)):
            left_out.append((cause, rows[number]))
            tasks.append((rows[number], PAPER.without(cause.switch)))
    errors = run_tasks(tasks, progress=progress)
    reproduced = tuple(_reproduced(rows[k], errors[rows[k], PAPER], errors[rows[k], EXACT]) for k in chosen)
    effects = []
    for cause, row in left_out:
        published = np.radians(row.published_deg)
        effects.append(
            ConditionEffect(
                cause=cause.switch,
                sentence=cause.sentence,
                row=row.row,
                ratio=errors[row, PAPER] / published,
                ratio_without=errors[row, PAPER.without(cause.switch)] / published,
                title=row.title,
            )
        )
    scores = tuple(_score(reproduced, tables, within) for tables, within in SCORED)
    return Reproduction(rows=reproduced, causes=tuple(effects), scores=scores)


def _reproduced(row: PublishedRow, reproduced: NDArray, method: NDArray) -> ReproducedRow:
    """A row with the largest errors (3,) under the paper's conditions and under exact ones [rad]."""
    ratio = reproduced / np.radians(row.published_deg)
    off = tuple(name for name, r in zip(ANGLES, ratio, strict=True) if not abs(r - 1.0) <= TOLERANCE)
    remark = ""
    if off:
        remark = next((sentence for numbers, sentence in UNEXPLAINED if row.row in numbers), "unknown")
    return ReproducedRow(
        **row.model_dump(),
        reproduced_deg=np.degrees(reproduced),
        ratio=ratio,
        method_error_deg=np.degrees(method),
        not_reproduced=off,
        remark=remark,
    )


def _score(rows: Sequence[ReproducedRow], tables: tuple[str, ...], within: float) -> TableScore:
    ratios = np.array([row.ratio for row in rows if row.table in tables])
    return TableScore(
        tables=tables, within=within, numbers=int((np.abs(ratios - 1.0) <= within).sum()), of=int(ratios.size)
    )


def run_tasks(tasks: Iterable[Task], *, progress: bool = False) -> Mapping[Task, NDArray]:
    """Largest errors of ψ, ϑ, γ [rad] of rows under conditions; rows with the same increments share them.

    The work is spread over the cores by threads: compiled code does not hold Python's lock.
    """
    groups: dict[Stream, list[Task]] = {}
    for row, conditions in dict.fromkeys(tasks):
        period = row.h_s / conditions.algorithm(row).samples
        stream = (paper_motion(row.motion, conditions).tobytes(), period, conditions.intervals(row))
        groups.setdefault(stream, []).append((row, conditions))
    # The longest first, so that no core waits long at the end.
    streams = sorted(groups, key=_cost, reverse=True)
    errors: dict[Task, NDArray] = {}
    with (
        progress_bar("running the published rows", sum(map(_cost, streams)), show=progress) as advance,
        ThreadPoolExecutor(max_workers=os.cpu_count()) as pool,
    ):
        runs = {stream: pool.submit(_run_group, stream, groups[stream]) for stream in streams}
        for stream, run in runs.items():
            errors.update(run.result())
            advance(_cost(stream))
    return errors


def _run_group(stream: Stream, tasks: Sequence[Task]) -> dict[Task, NDArray]:
    harmonics, period, intervals = stream
    samples = sample_motion(np.frombuffer(harmonics), period, round(DURATION / period), intervals)
    errors: dict[Task, NDArray] = {}
    for row, conditions in tasks:
        algorithm = conditions.algorithm(row)
        attitudes = run_algorithm(algorithm, samples.increments)
        true = samples.angles_at_steps(algorithm)
        errors[row, conditions] = angle_errors(attitudes, true, not conditions.not_normalised)
    return errors


def angle_errors(attitudes: NDArray, angles: NDArray, normalised: bool) -> NDArray:
    """Largest errors (3,) of ψ, ϑ, γ [rad] of quaternions (N, 4), scalar first, against the true angles (N, 3).

    The quaternions may be brought to the unit sphere first: the formulas are those of the paper, C11 = 2(λ0² + λ1²) - 1
    and so on, which hold on it.
    """
    if normalised:
        attitudes = attitudes / np.linalg.norm(attitudes, axis=1)[:, None]
    l0, l1, l2, l3 = attitudes.T
    c11, c22 = 2.0 * (l0 * l0 + l1 * l1) - 1.0, 2.0 * (l0 * l0 + l2 * l2) - 1.0
    c31, c23, c21 = 2.0 * (l1 * l3 - l0 * l2), 2.0 * (l2 * l3 - l0 * l1), 2.0 * (l1 * l2 + l0 * l3)
    computed = np.column_stack((np.arctan2(-c31, c11), np.arctan2(c21, np.hypot(c11, c31)), np.arctan2(-c23, c22)))
    apart = np.abs(computed - angles)
    return np.minimum(apart, np.abs(apart - 2.0 * math.pi)).max(axis=0)


def _cost(stream: Stream) -> float:
    """Return a rough relative cost of a stream."""
    _, period, intervals = stream
    return (10.0 + max(intervals, 6)) / period


class PublishedEstimator(Result):
    """A published estimator, checked.

    Attributes
    ----------
    target : str
        as printed
    readings : int
    printed : float
        its cost as printed [σ]
    total : float
        Σ|Φ| of its weights [σ]
    defect, defect_negated : float
        max |Σ Φ F − a| for the target, and for its negative
    clearance : float
        least |m_p| − s_p^max over its readings with the bias rows [g]
    clearance_paper : float
        the same by (1.7) as printed
    best_tables, best_paper : float
        optimal costs on the 1° grid [σ]: with the bias rows, and by (1.7) as printed
    gap : float
        to which `best_tables` is proven
    remarks : tuple of str
        faults of the row as printed
    """

    target: str
    readings: int
    printed: float
    total: float
    defect: float
    defect_negated: float
    clearance: float
    clearance_paper: float
    best_tables: float
    best_paper: float
    gap: float
    remarks: tuple[str, ...]


class PublishedCalibration(Result):
    """Every row of the tables."""

    schema_: Literal["trihedron.published-calibration/1"] = Field(
        default="trihedron.published-calibration/1", alias="schema"
    )
    rows: tuple[PublishedEstimator, ...]


def published_calibration() -> dict[str, list[dict[str, float]]]:
    """The tables' readings by target: accelerometer, alpha_deg, beta_deg, weight, cost_printed."""
    rows: dict[str, list[dict[str, float]]] = {}
    for row in table_rows("calibration"):
        rows.setdefault(row.pop("target"), []).append({name: float(cell) for name, cell in row.items()})
    return rows


def check_published_calibration() -> PublishedCalibration:
    """Check each published plan: unbiased, admissible, optimal.

    Returns
    -------
    PublishedCalibration
        the rows of Tables 1 and 2
    """
    tables = published_calibration()
    with_bias = optimal_plans(tuple(tables), admissible="tables")
    as_printed = optimal_plans(tuple(tables), admissible="paper")
    rows = []
    for k, (target, readings) in enumerate(tables.items()):
        rows.append(_checked(target, readings, with_bias[k].optimum, as_printed[k].optimum))
    return PublishedCalibration(rows=tuple(rows))


def _checked(
    target: str, readings: Sequence[Mapping[str, float]], with_bias: Optimum, as_printed: Optimum
) -> PublishedEstimator:
    """Compare a published estimator with the optima with the bias rows and by (1.7) as printed."""
    p = parametrise({"identity": np.eye(3)})
    a = expression_weights(target, p)
    weights = np.array([reading["weight"] for reading in readings])
    margin, _ = _margin_and_regressors(sheets(p, rule="tables"), readings)
    margin_paper, regressors = _margin_and_regressors(sheets(p, rule="paper"), readings)
    sums = weights @ regressors
    printed, total = readings[0]["cost_printed"], float(np.abs(weights).sum())
    defect, negated = float(np.abs(sums - a).max()), float(np.abs(sums + a).max())
    remarks = []
    if abs(printed - total) > PRINTED_ROUNDING:
        remarks.append(f"the accuracy is printed as {to_bound(printed, 0.1)}; its own weights give {digits(total, 5)}")
    if defect > UNBIASED:
        remark = f"the weights are biased by {upwards(defect)}"
        if negated <= UNBIASED:
            remark = f"the weights estimate -{target}, as the paper's list of targets says, not {target}"
        remarks.append(remark)
    if margin < 0.0:
        remarks.append("a position is not admissible")
    return PublishedEstimator(
        target=target,
        readings=len(readings),
        printed=printed,
        total=total,
        defect=defect,
        defect_negated=negated,
        clearance=margin,
        clearance_paper=margin_paper,
        best_tables=with_bias.cost,
        best_paper=as_printed.cost,
        gap=with_bias.gap,
        remarks=tuple(remarks),
    )


def _margin_and_regressors(block: Sequence[SignSheet], readings: Sequence[Mapping[str, float]]) -> tuple[float, Floats]:
    """The least clearance [g] of readings, each on its accelerometer's better sheet, and their F (N, 18)."""
    margin, regressors = math.inf, []
    for reading in readings:
        at = np.radians(reading["alpha_deg"]), np.radians(reading["beta_deg"])
        signs = [sheet for sheet in block if sheet.accelerometer == int(reading["accelerometer"]) - 1]
        best = max(signs, key=lambda sheet, at=at: float(clearance(sheet, *at)))
        margin = min(margin, float(clearance(best, *at)))
        regressors.append(value(best.regressor, *at))
    return margin, np.array(regressors)


class WordLengthError(Result):
    """Largest angle between an attitude in short words and the 64-bit one.

    Attributes
    ----------
    motion : str
        `REPEATING`: variant 1 of Table 1, which repeats exactly after 2 s; `INCOMMENSURATE`: it never repeats
    arithmetic : str
        one of `ARITHMETICS`, or `DOUBLE`
    rounding : str
        one of `ROUNDINGS`
    error : float
        [rad]
    """

    motion: str
    arithmetic: str
    rounding: str
    error: float


class WordLength(Result):
    """The errors of every arithmetic and every rounding of the increments."""

    schema_: Literal["trihedron.word-length/1"] = Field(default="trihedron.word-length/1", alias="schema")
    errors: tuple[WordLengthError, ...] = Field(alias="errors_rad")


def word_length_errors(
    duration: float = 600.0,
    period: float = 1e-3,
    motions: Sequence[str] = (REPEATING, INCOMMENSURATE),
    arithmetics: Sequence[str] = (*ARITHMETICS, DOUBLE),
    *,
    progress: bool = False,
) -> WordLength:
    """Compute errors of update (22) on variant 1 of Table 1, for every arithmetic and rounding of the increments.

    Parameters
    ----------
    duration, period : float
        length of the run and gyro sample period [s]
    motions, arithmetics : sequence of str
        names
    progress : bool
        show a bar where standard error is a terminal

    Returns
    -------
    WordLength
        the errors
    """
    errors = []
    algorithm = algorithm_named("two-sample-rodrigues")
    steps = len(motions) * len(ROUNDINGS) * len(arithmetics)
    with progress_bar("running in short words", steps, show=progress) as advance:
        for motion in motions:
            exact = _increments(motion, duration, period)
            reference = run_algorithm(algorithm, exact)
            for rounding in ROUNDINGS:
                high, low = rounded_increments(exact, rounding)
                for arithmetic in arithmetics:
                    if arithmetic == DOUBLE:
                        attitudes = run_algorithm(algorithm, high.astype(np.float64) + low)
                    else:
                        attitudes = run_single(high, low, arithmetic)
                    error = float(angle_between(attitudes, reference).max())
                    errors.append(WordLengthError(motion=motion, arithmetic=arithmetic, rounding=rounding, error=error))
                    advance(1)
    return WordLength(errors_rad=tuple(errors))


def _increments(motion: str, duration: float, period: float) -> NDArray:
    harmonics = paper_motion("1", EXACT)
    if motion == INCOMMENSURATE:
        axes = harmonics.reshape(3, -1, 3)
        axes[:, :, 1] *= np.array(FREQUENCY_FACTORS)[:, None]
    return sample_motion(harmonics, period, round(duration / period)).increments
