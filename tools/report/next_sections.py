"""Where to measure next: on the page, and as a file to take to the table."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..calibration.model import Linearisation
from .cells import Cell
from .direction_pictures import next_directions
from .page import Download, Section, Table
from .rounding import Written, minus

OPTIONAL = ("mounting", "approach_alpha", "approach_beta")
MOST_LABELS = 24
"""Up to so many positions are numbered in the picture."""
SENSES = {1: "forwards", -1: "backwards"}


def next_positions_csv(positions: Sequence[Mapping[str, Any]]) -> str:
    """Positions as CSV: their number, both angles [deg], and mounting and senses of the approach where they matter."""
    names = ["position", "alpha_deg", "beta_deg", *(name for name in OPTIONAL if any(name in p for p in positions))]
    rows = [
        ",".join([str(k), *(str(position.get(name, "")) for name in names[1:])])
        for k, position in enumerate(positions, start=1)
    ]
    return "\n".join([",".join(names), *rows, ""])


def next_sections(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Section]:
    """The proposed positions on the sphere, as a table and as a file; a section, or none."""
    if not positions:
        return []
    at = here.positions
    alpha, beta = (np.radians([float(p[name]) for p in positions]) for name in ("alpha_deg", "beta_deg"))
    header = ["no.", "α [deg]", "β [deg]"]
    columns = [name for name in OPTIONAL if any(name in p for p in positions)]
    header += [name.replace("approach_alpha", "α turned").replace("approach_beta", "β turned") for name in columns]
    separates = any(p.get("separates") for p in positions)
    header += ["tells apart", "by [σ]"] if separates else []
    rows: list[list[Cell]] = []
    for k, p in enumerate(positions, start=1):
        row: list[Cell] = [k, *(Written(minus(f"{float(p[name]):g}")) for name in ("alpha_deg", "beta_deg"))]
        row += [SENSES.get(p[name], str(p[name])) if name in p else "" for name in columns]
        if separates:
            apart = p.get("apart_g")
            told = None if apart is None else Written(f"{max(apart, 0.0) / sigma(here) + 0.0:.2g}")
            row += [", ".join(p.get("separates", ())), told]
        rows.append(row)
    said = ["Readings at these positions besides would determine what is open."]
    if separates:
        sure = len(deciding(here, positions))
        said = [
            "Predictions of the two candidates that a position is for differ there, or at another of the positions for "
            "the same two, by at least the last column, whatever their parameters. More than 2 σ decides between them "
            f"in any noise: {sure or 'none'} of {len(positions)} positions do."
        ]
    labels = [str(k) for k in range(1, len(positions) + 1)]
    return [
        Section(
            "Where to measure next",
            said,
            next_directions(at.alpha, at.beta, alpha, beta, labels if len(labels) <= MOST_LABELS else [""]),
            "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
            Table(header, rows),
            download=Download(
                "next-positions.csv", next_positions_csv(positions), "next-positions.csv, to take to the table"
            ),
        )
    ]


def deciding(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The positions at which two candidates surely differ."""
    return [p for p in positions if p.get("apart_g") is not None and p["apart_g"] > 2.0 * sigma(here)]


def sigma(here: Linearisation) -> float:
    """σ as a fraction of g."""
    return float(here.bound.min())
