"""The published tables of two papers beside what is computed here, and what limited word length costs.

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

from ..calibration.model import parametrise
from ..calibration.targets import expression_weights
from ..motion.attitude import algorithm_named, angle_between
from ..motion.compare import ARITHMETICS, ROUNDINGS, rounded_increments, run_algorithm, run_single, sample_motion
from ..planning.forms import clearance, sheets, value
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
"""Harmonics, sample period and intervals of the trapezoid rule: what the increments depend on."""
DOUBLE = "double"
"""64-bit arithmetic on the same rounded increments: what is left is the increments' own error."""
REPEATING, INCOMMENSURATE = "repeating", "incommensurate"
FREQUENCY_FACTORS = (1.01234567, 1.02430827, 1.02718280)
"""Make the frequencies of ψ, ϑ, γ incommensurate with each other and with the samples."""


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


class ReproducedRow(PublishedRow):
    """A published row and what comes out: largest errors of ψ, ϑ, γ.

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
        what is known of these; empty where all come out
    """

    reproduced_deg: Angles
    ratio: Angles
    method_error_deg: Angles
    not_reproduced: tuple[str, ...]
    remark: str


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
        names = ("row", "table", "algorithm", "h_s", "M", "motion")
        columns = {name: [row.to_json()[name] for row in self.rows] for name in names}
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
    """Run published rows, all or by number: under the paper's conditions, exact ones, and without each cause shown."""
    chosen = set(numbers) if numbers is not None else None
    rows = [row for row in published_rows() if chosen is None or row.row in chosen]
    left_out = [(cause, row) for row in rows for cause in CAUSES if row.row in cause.shown_on]
    tasks = [(row, conditions) for row in rows for conditions in (PAPER, EXACT)]
    tasks += [(row, PAPER.without(cause.switch)) for cause, row in left_out]
    errors = run_tasks(tasks, progress=progress)
    order = {cause.switch: k for k, cause in enumerate(CAUSES)}
    left_out.sort(key=lambda pair: (order[pair[0].switch], pair[1].row))
    found = tuple(_reproduced(row, errors[row, PAPER], errors[row, EXACT]) for row in rows)
    return Reproduction(
        rows=found,
        causes=tuple(
            Effect(
                cause=cause.switch,
                sentence=cause.sentence,
                row=row.row,
                ratio=errors[row, PAPER] / np.radians(row.published_deg),
                ratio_without=errors[row, PAPER.without(cause.switch)] / np.radians(row.published_deg),
                title=row.title,
            )
            for cause, row in left_out
        ),
        scores=tuple(_score(found, tables, within) for tables, within in SCORED),
    )


def _reproduced(row: PublishedRow, reproduced: NDArray, method: NDArray) -> ReproducedRow:
    """A row with the largest errors (3,) under the paper's conditions and under exact ones [rad]."""
    ratio = reproduced / np.radians(row.published_deg)
    off = tuple(name for name, r in zip(ANGLES, ratio, strict=True) if not abs(r - 1.0) <= TOLERANCE)
    known = [sentence for numbers, sentence in UNEXPLAINED if row.row in numbers]
    return ReproducedRow(
        **row.model_dump(),
        reproduced_deg=np.degrees(reproduced),
        ratio=ratio,
        method_error_deg=np.degrees(method),
        not_reproduced=off,
        remark=(known[0] if known else "unknown") if off else "",
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
        period = row.h_s / conditions.algorithm(row).samples
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


def angle_errors(attitudes: np.ndarray, angles: np.ndarray, normalised: bool) -> np.ndarray:
    """Largest errors (3,) of ψ, ϑ, γ [rad] of quaternions (N, 4), scalar first, against the true angles (N, 3).

    The quaternions may be brought to the unit sphere first: the formulas are those of the paper, C11 = 2(λ0² + λ1²) - 1
    and so on, which hold on it.
    """
    l0, l1, l2, l3 = attitudes.T / np.linalg.norm(attitudes, axis=1) if normalised else attitudes.T
    c11, c22 = 2.0 * (l0 * l0 + l1 * l1) - 1.0, 2.0 * (l0 * l0 + l2 * l2) - 1.0
    c31, c23, c21 = 2.0 * (l1 * l3 - l0 * l2), 2.0 * (l2 * l3 - l0 * l1), 2.0 * (l1 * l2 + l0 * l3)
    found = np.column_stack((np.arctan2(-c31, c11), np.arctan2(c21, np.hypot(c11, c31)), np.arctan2(-c23, c22)))
    apart = np.abs(found - angles)
    return np.minimum(apart, np.abs(apart - 2.0 * math.pi)).max(axis=0)


def _cost(stream: Stream) -> float:
    """About how long a stream takes, in no unit."""
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
        what is wrong with the row as printed
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
    """Every row of the tables: unbiased, admissible, optimal?"""
    p = parametrise({"identity": np.eye(3)})
    tables = published_calibration()
    rules = ("tables", "paper")
    best = {rule: optimal_plans(tuple(tables), admissible=rule) for rule in rules}
    sheets_by = {rule: sheets(p, rule=rule) for rule in rules}
    checked = []
    for k, (target, rows) in enumerate(tables.items()):
        weights = np.array([row["weight"] for row in rows])
        a = expression_weights(target, p)
        regressors = []
        margins: dict[str, list[float]] = {rule: [] for rule in rules}
        for row in rows:
            alpha, beta = np.radians(row["alpha_deg"]), np.radians(row["beta_deg"])
            for rule in rules:
                own = [s for s in sheets_by[rule] if s.accelerometer == int(row["accelerometer"]) - 1]
                clear = [float(clearance(s, alpha, beta)) for s in own]
                margins[rule].append(max(clear))
                if rule == "paper":
                    # F (18,) of the reading, in the targets' order
                    regressors.append(value(own[int(np.argmax(clear))].regressor, alpha, beta))
        sums = weights @ np.array(regressors)
        printed, total = rows[0]["cost_printed"], float(np.abs(weights).sum())
        defect, negated = float(np.abs(sums - a).max()), float(np.abs(sums + a).max())
        remarks = []
        if abs(printed - total) > PRINTED_ROUNDING:
            remarks.append(
                f"the accuracy is printed as {to_bound(printed, 0.1)}; its own weights give {digits(total, 5)}"
            )
        if defect > UNBIASED:
            remarks.append(
                f"the weights estimate -{target}, as the paper's list of targets says, not {target}"
                if negated <= UNBIASED
                else f"the weights are biased by {upwards(defect)}"
            )
        if min(margins["tables"]) < 0.0:
            remarks.append("a position is not admissible")
        checked.append(
            PublishedEstimator(
                target=target,
                readings=len(rows),
                printed=printed,
                total=total,
                defect=defect,
                defect_negated=negated,
                clearance=min(margins["tables"]),
                clearance_paper=min(margins["paper"]),
                best_tables=best["tables"][k].optimum.cost,
                best_paper=best["paper"][k].optimum.cost,
                gap=best["tables"][k].optimum.gap,
                remarks=tuple(remarks),
            )
        )
    return PublishedCalibration(rows=tuple(checked))


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
    """Errors of update (22) on variant 1 of Table 1, for every arithmetic and every rounding of the increments.

    Parameters
    ----------
    duration, period : float
        length of the run and gyro sample period [s]
    motions, arithmetics : sequence of str
        which ones
    progress : bool
        show a bar where standard error is a terminal
    """
    found = []
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
                    found.append(WordLengthError(motion=motion, arithmetic=arithmetic, rounding=rounding, error=error))
                    advance(1)
    return WordLength(errors_rad=tuple(found))


def _increments(motion: str, duration: float, period: float) -> np.ndarray:
    harmonics = paper_motion("1", EXACT)
    if motion == INCOMMENSURATE:
        axes = harmonics.reshape(3, -1, 3)
        axes[:, :, 1] *= np.array(FREQUENCY_FACTORS)[:, None]
    return sample_motion(harmonics, period, round(duration / period)).increments
