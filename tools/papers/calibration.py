"""The published calibration tables beside what is computed here.

Source: Golovan, Matasov, Tarygin 2022, Tables 1 and 2; case A1, Q = I.
"""

import csv
from importlib.resources import files
from typing import Literal

import numpy as np
from pydantic import Field

from ..calibration.model import parametrise
from ..calibration.targets import expression_weights
from ..planning.forms import clearance, sheets, value
from ..planning.plan import plan_targets
from ..result import Result

PRINTED_ROUNDING = 0.005 + 1e-5
"""Half a last digit of a printed cost, and the rounding of six-digit weights."""
UNBIASED = 5e-6
"""Defect that weights of six digits may leave: half a last digit for each of ten readings."""


class PublishedRow(Result):
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
    rows: tuple[PublishedRow, ...]


def published_calibration() -> dict[str, list[dict[str, float]]]:
    """The tables' readings by target: accelerometer, alpha_deg, beta_deg, weight, cost_printed."""
    text = files("trihedron.tools.papers").joinpath("calibration.csv").read_text(encoding="utf-8")
    rows: dict[str, list[dict[str, float]]] = {}
    for row in csv.DictReader(line for line in text.splitlines() if not line.startswith("#")):
        rows.setdefault(row.pop("target"), []).append({name: float(cell) for name, cell in row.items()})
    return rows


def check_published_calibration() -> PublishedCalibration:
    """Every row of the tables: unbiased, admissible, optimal?"""
    p = parametrise({"identity": np.eye(3)})
    tables = published_calibration()
    rules = ("tables", "paper")
    best = {rule: plan_targets(tuple(tables), admissible=rule) for rule in rules}
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
            remarks.append(f"the accuracy is printed as {printed:.2f}; its own weights give {total:.4f}")
        if defect > UNBIASED:
            remarks.append(
                f"the weights estimate -{target}, as the paper's list of targets says, not {target}"
                if negated <= UNBIASED
                else f"the weights are biased by {defect:.1e}"
            )
        if min(margins["tables"]) < 0.0:
            remarks.append("a position is not admissible")
        checked.append(
            PublishedRow(
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
