"""Pages of published tables that were computed again."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..document.blocks import Page, Section, Table
from ..document.notation import Cell
from ..files import whole_folder, write_text
from ..motion.compare import ARITHMETICS, ROUNDINGS
from ..papers.attitude import TABLES
from ..papers.reproduction import (
    DOUBLE,
    INCOMMENSURATE,
    REPEATING,
    TOLERANCE,
    PublishedCalibration,
    Reproduction,
    WordLength,
)
from ..rounding import digits, downwards, exactly, to_bound, upwards
from .pictures.suites import published_and_reproduced

AS_PRINTED = 0.1
"""Bound that fixes the digits of a printed number: the paper has two decimals."""


def published_page(result: PublishedCalibration) -> Page:
    """Return the published tables, ours beside them, and the paper's errors."""
    rows = []
    remarks = []
    better = 0
    for row in result.rows:
        bias = min(row.defect, row.defect_negated)
        rows.append(
            [
                row.target,
                row.readings,
                to_bound(row.printed, AS_PRINTED),
                upwards(row.total, 7),
                upwards(bias, 1),
                upwards(row.best_tables, 11),
                upwards(row.gap, 1),
                upwards(row.best_paper, 11),
            ]
        )
        better += row.total - row.best_paper > 1e-5
        for remark in row.remarks:
            remarks.append(f"- {row.target}: {remark}")
    clearance = min(row.clearance for row in result.rows)
    remarks.append(
        f"- the tables do not follow from (1.7) as printed: by it {better} of the {len(rows)} optima are lower "
        "(last column). Every row is optimal with the bias rows in s_p^max (no position closer than "
        f"{downwards(clearance, 1)} g)."
    )
    header = ["target", "readings", "printed", "Σ|Φ|", "bias", "optimum", "gap", "by (1.7)"]
    note = "bias: what Σ Φ F misses of the target, with six digits in a weight; optimum: with the bias rows in s_p^max."
    return Page(
        "Published plans",
        "Golovan, Matasov, Tarygin 2022, Tables 1 and 2; case A1, Q = I, 1° grid, u = 0.003, v = 0.01; costs in σ",
        [Section("Tables", [note], table=Table(header, rows)), Section("Errors", ["the paper's errors:", *remarks])],
    )


def reproduction_page(result: Reproduction) -> Page:
    """Return every row, the effect of each cause, scores, and rows that are not reproduced."""
    rows = []
    not_reproduced = [f"not reproduced within {digits(100.0 * TOLERANCE)} %"]
    for row in result.rows:
        cells: list[Cell] = [row.row, TABLES[row.table], row.algorithm, exactly(row.h_s), row.nodes, row.motion]
        cells += [_angles_text(row.published_deg), _ratios(row.ratio), _angles_text(row.method_error_deg)]
        rows.append(cells)
        if row.not_reproduced:
            not_reproduced.append(f"{row.row:>3} {row.title}: {', '.join(row.not_reproduced)}: {row.remark}")
    causes = ["what the simulation got wrong: ratio with everything, and with this one thing put right"]
    cause = ""
    for effect in result.effects:
        if effect.cause != cause:
            causes.append(effect.sentence)
            cause = effect.cause
        causes.append(f"    {effect.title:<62} {_ratios(effect.ratio)}  ->  {_ratios(effect.ratio_without)}")
    scores = []
    for score in result.scores:
        if score.of:
            names = " and ".join([TABLES[table] for table in score.tables])
            scores.append(f"{names}: {score.numbers} of {score.of} numbers within {digits(100.0 * score.within)} %")

    header = ["row", "table", "algorithm", "h [s]", "M", "motion", "published", "ratio", "method"]
    verdict = (
        "Largest errors over 600 s of ψ, ϑ, γ [deg]; ratio: reproduced over published; method: with exact increments, "
        "exact π and normalised quaternions"
    )
    answer = [
        Section("Rows", table=Table(header, rows)),
        Section("Causes", causes),
        Section("Scores", scores),
        Section("Not reproduced", not_reproduced),
    ]
    return Page("Published attitude errors", verdict, answer)


def _angles_text(angles: Sequence[float] | NDArray) -> str:
    return " ".join([digits(angle) for angle in angles])


def _ratios(values: Sequence[float] | NDArray) -> str:
    texts = [f"{digits(value, 5 if value >= 1e-3 else 1):>7}" for value in values]
    return " ".join(texts)


def write_reproduction(result: Reproduction, out: Path) -> list[Path]:
    """Write attitude.csv and attitude.svg into a folder; return the files."""
    with whole_folder(out) as beside:
        write_text(beside / "attitude.csv", result.to_polars().write_csv())
        write_text(beside / "attitude.svg", published_and_reproduced(result).svg())
    return [out / "attitude.csv", out / "attitude.svg"]


def word_length_page(result: WordLength) -> Page:
    """Return a table of attitude errors for each motion, and its result."""
    errors = {}
    for entry in result.errors:
        errors[entry.motion, entry.rounding, entry.arithmetic] = 1e6 * np.degrees(entry.error)
    columns: list[str] = list(ARITHMETICS)
    columns.append(DOUBLE)
    header = ["increments rounded"]
    header += columns
    answer = []
    for motion, sentence in (
        (REPEATING, "The motion repeats exactly in samples. Rounding errors add up. Largest errors [µdeg]:"),
        (INCOMMENSURATE, "The frequencies are incommensurate. Rounding errors do not repeat. Largest errors [µdeg]:"),
    ):
        rows = []
        for rounding in ROUNDINGS:
            row: list[Cell] = [rounding]
            for name in columns:
                row.append(digits(errors[motion, rounding, name], 2))
            rows.append(row)
        answer.append(Section(f"Motion: {motion}", [sentence], table=Table(header, rows)))
    floor = errors[REPEATING, "independently", DOUBLE]
    feedback = errors[REPEATING, "feedback", "pairs"]
    pairs = errors[REPEATING, "pairs", "pairs"]
    lines = [
        f"Increments that are rounded one by one cost {digits(floor, 2)} µdeg, in 64-bit arithmetic too.",
        f"An attitude in pairs of 32-bit numbers errs by {digits(feedback, 2)} µdeg if each increment takes over the "
        f"rounding error of the one before, and by {digits(pairs, 2)} µdeg with increments in pairs.",
        f"To carry 1 - λ0* in place of λ0* divides the error by {digits(_gain(errors, 'carried'), 2)}; to keep the low "
        f"part of the attitude, too, by {digits(_gain(errors, 'compensated'), 2)}.",
        "single: all in 32 bits. carried: with 1 - λ0*. compensated: with the low part of λ, too. pairs: λv* a pair. "
        "double: 64 bits.",
    ]
    answer.append(Section("Result", lines))
    worst = digits(errors[REPEATING, "independently", "single"], 2)
    verdict = f"In 32-bit words, update (22) errs by {worst} µdeg in variant 1 of Table 1; pairs of words mend it."
    return Page("Word length", verdict, answer)


def _gain(errors: dict[tuple[str, str, str], float], arithmetic: str) -> float:
    """Return the gain of an arithmetic over plain single, over the roundings: geometric mean."""
    ratios = []
    for rounding in ROUNDINGS:
        ratios.append(errors[REPEATING, rounding, "single"] / errors[REPEATING, rounding, arithmetic])
    return float(np.exp(np.mean(np.log(ratios))))
