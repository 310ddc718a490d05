"""The reproduction as text, table and JSON."""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..files import whole_folder, write_text
from .published import TABLES
from .reproduction import ReproducedRow, Reproduction
from .unexplained import TOLERANCE, not_reproduced, sentence_for

SCHEMA = "trihedron.attitude-reproduction/1"
LETTERS = ("psi", "theta", "gamma")
SCORED = (
    (("1",), 0.002),
    (("3.1.1",), TOLERANCE),
    (("2", "3"), TOLERANCE),
)
"""Tables that are counted together, and the fraction of the printed number within which one counts."""


def reproduction_summary(result: Reproduction) -> list[str]:
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
        if effect.cause.switch != last:
            lines.append(f"{effect.cause.sentence}")
            last = effect.cause.switch
        lines.append(f"    {effect.row.title:<62} {_ratios(effect.ratio)}  ->  {_ratios(effect.ratio_without)}")
    lines += ["", *_score_lines(result), "", f"not reproduced within {TOLERANCE:.0%}"]
    for row in result.rows:
        if not_reproduced(row):
            lines.append(f"{row.row.number:>3} {row.row.title}: {', '.join(not_reproduced(row))}: {sentence_for(row)}")
    return lines


def _row_line(row: ReproducedRow) -> str:
    r = row.row
    published = " ".join(f"{value:.2e}" for value in r.error_deg)
    method = " ".join(f"{value:.2e}" for value in np.degrees(row.method))
    return (
        f"{r.number:>3} {TABLES[r.table]:<13} {r.print_name:<14} {r.step:>6g} {r.nodes:>3} {r.motion:<6}  "
        f"{published:<27}{_ratios(row.ratio)}  {method}"
    )


def _ratios(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{value:7.4f}" if value >= 1e-3 else f"{value:7.0e}" for value in values)


def _score_lines(result: Reproduction) -> list[str]:
    lines = []
    for tables, within in SCORED:
        hit, of = result.score(tables, within)
        if of:
            names = " and ".join(TABLES[table] for table in tables)
            lines.append(f"{names}: {hit} of {of} numbers within {within:.1%}")
    return lines


def reproduction_json(result: Reproduction) -> str:
    """The reproduction as JSON; angles in degrees, as printed."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "rows": [
            {
                "row": row.row.number,
                **_keys(row),
                "published_deg": list(row.row.error_deg),
                "reproduced_deg": _digits(np.degrees(row.reproduced)),
                "ratio": _digits(row.ratio),
                "method_error_deg": _digits(np.degrees(row.method)),
                "not_reproduced": not_reproduced(row),
                "remark": sentence_for(row),
            }
            for row in result.rows
        ],
        "causes": [
            {
                "cause": effect.cause.switch,
                "sentence": effect.cause.sentence,
                "row": effect.row.number,
                "ratio": _digits(effect.ratio),
                "ratio_without": _digits(effect.ratio_without),
            }
            for effect in result.effects
        ],
        "scores": [
            {"tables": list(tables), "within": within, "numbers": hit, "of": of}
            for tables, within in SCORED
            for hit, of in (result.score(tables, within),)
        ],
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def reproduction_csv(result: Reproduction) -> str:
    """One line for each published row; angles in degrees."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    kinds = ("published", "reproduced", "method")
    columns = [f"{kind}_{letter}_deg" for kind in kinds for letter in LETTERS]
    writer.writerow(
        ["row", "table", "algorithm", "h_s", "M", "motion", *columns, *(f"ratio_{letter}" for letter in LETTERS)]
    )
    for row in result.rows:
        numbers = (*np.degrees(row.reproduced), *np.degrees(row.method), *row.ratio)
        writer.writerow([row.row.number, *_keys(row).values(), *row.row.error_deg, *_digits(numbers)])
    return stream.getvalue()


def write_reproduction(result: Reproduction, out: Path | None, json_file: Path | None = None) -> list[Path]:
    """Write attitude.csv and attitude.svg into a folder, and the JSON where it is asked for; returns the files."""
    from ..report.attitude_pictures import published_and_reproduced

    written = []
    if out is not None:
        with whole_folder(out) as beside:
            write_text(beside / "attitude.csv", reproduction_csv(result))
            write_text(beside / "attitude.svg", published_and_reproduced(result))
        written += [out / "attitude.csv", out / "attitude.svg"]
    if json_file is not None:
        write_text(json_file, reproduction_json(result))
        written.append(json_file)
    return written


def _keys(row: ReproducedRow) -> dict[str, Any]:
    r = row.row
    return {"table": r.table, "algorithm": r.print_name, "h_s": r.step, "M": r.nodes, "motion": r.motion}


def _digits(values: Sequence[float] | np.ndarray) -> list[float]:
    """Six digits: more are rounding of a run of a million steps."""
    return [float(f"{value:.6g}") for value in values]
