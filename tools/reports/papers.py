"""What is said of published tables that were computed again."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..files import whole_folder, write_text
from ..motion.compare import ARITHMETICS, ROUNDINGS
from ..papers.attitude import TABLES
from ..papers.reproduction import (
    DOUBLE,
    INCOMMENSURATE,
    REPEATING,
    TOLERANCE,
    PublishedCalibration,
    ReproducedRow,
    Reproduction,
    WordLength,
)
from ..rounding import digits, downwards, exactly, to_bound, upwards
from .pictures.suites import published_and_reproduced

AS_PRINTED = 0.1
"""The paper has two decimals, as of an accuracy that is known to so much."""


def published_lines(found: PublishedCalibration) -> list[str]:
    """The tables, ours beside them, and the paper's errors."""
    rows = found.rows
    lines = [
        "Golovan, Matasov, Tarygin 2022, Tables 1 and 2; case A1, Q = I, 1° grid, u = 0.003, v = 0.01; costs in σ",
        "",
        f"{'target':<9} {'readings':>8} {'printed':>8} {'Σ|Φ|':>9} {'bias':>8} | {'optimum':>13} {'gap':>7} "
        f"| {'by (1.7)':>13}",
    ]
    for row in rows:
        defect = min(row.defect, row.defect_negated)
        lines.append(
            f"{row.target:<9} {row.readings:>8} {to_bound(row.printed, AS_PRINTED):>8} {upwards(row.total, 7):>9} "
            f"{upwards(defect, 1):>8} | {upwards(row.best_tables, 11):>13} {upwards(row.gap, 1):>7} | "
            f"{upwards(row.best_paper, 11):>13}"
        )
    better = [row for row in rows if row.total - row.best_paper > 1e-5]
    slack = min(row.clearance for row in rows)
    lines += [
        "",
        "bias: what Σ Φ F misses of the target, with six digits in a weight; optimum: with the bias rows in s_p^max.",
        "",
        "the paper's errors:",
        *(f"- {row.target}: {remark}" for row in rows for remark in row.remarks),
        f"- the tables do not follow from (1.7) as printed: by it {len(better)} of the {len(rows)} optima are lower "
        f"(last column). Every row is optimal with the bias rows in s_p^max (no position closer than "
        f"{downwards(slack, 1)} g).",
    ]
    return lines


def reproduction_lines(result: Reproduction) -> list[str]:
    """Lines for people: every row, what each cause does, scores, and what is not reproduced."""
    lines = [
        "largest errors over 600 s of ψ, ϑ, γ [deg]; ratio: reproduced over published; method: with exact increments, "
        "exact π and normalised quaternions",
        f"{'':>3} {'':<13} {'':<14} {'h [s]':>6} {'M':>3} {'motion':<6}  {'published':<27} {'ratio':<23} method",
    ]
    lines += [_row_line(row) for row in result.rows]
    lines += ["", "what the simulation got wrong: ratio with everything, and with this one thing put right"]
    last = ""
    for effect in result.effects:
        if effect.cause != last:
            lines.append(effect.sentence)
            last = effect.cause
        lines.append(f"    {effect.title:<62} {_ratios(effect.ratio)}  ->  {_ratios(effect.ratio_without)}")
    lines.append("")
    for score in result.scores:
        if score.of:
            names = " and ".join(TABLES[table] for table in score.tables)
            lines.append(f"{names}: {score.numbers} of {score.of} numbers within {digits(100.0 * score.within)} %")
    lines += ["", f"not reproduced within {digits(100.0 * TOLERANCE)} %"]
    lines += [
        f"{row.row:>3} {row.title}: {', '.join(row.not_reproduced)}: {row.remark}"
        for row in result.rows
        if row.not_reproduced
    ]
    return lines


def _row_line(row: ReproducedRow) -> str:
    published = " ".join(map(digits, row.published_deg))
    method = " ".join(map(digits, row.method_error_deg))
    return (
        f"{row.row:>3} {TABLES[row.table]:<13} {row.algorithm:<14} {exactly(row.h_s):>6} {row.nodes:>3} "
        f"{row.motion:<6}  {published:<27}{_ratios(row.ratio)}  {method}"
    )


def _ratios(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{digits(value, 5 if value >= 1e-3 else 1):>7}" for value in values)


def write_reproduction(result: Reproduction, out: Path) -> list[Path]:
    """Write attitude.csv and attitude.svg into a folder; returns the files."""
    with whole_folder(out) as beside:
        write_text(beside / "attitude.csv", result.to_polars().write_csv())
        write_text(beside / "attitude.svg", published_and_reproduced(result))
    return [out / "attitude.csv", out / "attitude.svg"]


def word_length_lines(result: WordLength) -> list[str]:
    """Lines for people: a table for each motion [deg], and what it shows."""
    found = {(e.motion, e.rounding, e.arithmetic): np.degrees(e.error) for e in result.errors}
    lines = ["update (22), variant 1 of Table 1: largest attitude error against 64-bit words [deg]"]
    columns = (*ARITHMETICS, DOUBLE)
    for motion, said in (
        (REPEATING, "the motion repeats exactly in samples: rounding errors repeat with it and add up"),
        (INCOMMENSURATE, "incommensurate frequencies: rounding errors do not repeat"),
    ):
        lines += ["", said, f"{'increments rounded':<20}" + "".join(f"{name:>13}" for name in columns)]
        for rounding in ROUNDINGS:
            cells = (found[motion, rounding, name] for name in columns)
            lines.append(f"{rounding:<20}" + "".join(f"{digits(cell, 2):>13}" for cell in cells))
    floor = found[REPEATING, "independently", DOUBLE]
    feedback, pairs = (found[REPEATING, rounding, "pairs"] for rounding in ("feedback", "pairs"))
    lines += [
        "",
        f"independently rounded increments alone cost {digits(floor, 2)} deg, in 64-bit arithmetic too",
        f"an attitude in pairs of 32-bit numbers comes to {digits(feedback, 2)} deg with error feedback of the "
        f"increments, to {digits(pairs, 2)} with increments in pairs",
        f"carrying 1 - λ0* instead of λ0* alone buys {digits(_gain(found, 'carried'), 2)} times, "
        f"keeping the low part of the attitude {digits(_gain(found, 'compensated'), 2)} times",
    ]
    return lines


def _gain(found: dict[tuple[str, str, str], float], arithmetic: str) -> float:
    """How many times an arithmetic betters plain single, over the roundings: geometric mean."""
    ratios = [found[REPEATING, r, "single"] / found[REPEATING, r, arithmetic] for r in ROUNDINGS]
    return float(np.exp(np.mean(np.log(ratios))))
