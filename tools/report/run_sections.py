"""Sections on runs: the bench in time, and the attitude of a measured record."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl

from trihedron.attitude import AttitudeRun
from trihedron.report.page import Section
from trihedron.report.time_pictures import attitude_error, bench_tour


def run_section(table: pl.DataFrame, gravity: float, files: list[Path]) -> Section:
    """The position programme that a run carried out."""
    readings = np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1) / gravity
    hours = float(table["time_s"][-1])
    return Section(
        "The bench, simulated",
        [
            f"Three FMUs, coupled by the orchestrator: the table carries the block through its positions for "
            f"{hours:.0f} s, the block reads, the attitude computer follows the increments."
        ],
        bench_tour(table["time_s"], table["alpha_deg"], table["beta_deg"], readings),
        "Angles of the two axes and readings of the three accelerometers.",
        files=files,
    )


def attitude_section(runs: Sequence[AttitudeRun]) -> Section:
    """Attitude errors of a measured record; the picture is that of the last run."""
    shown = runs[-1]
    return Section(
        "A measured strapdown record",
        [line for k, run in enumerate(runs) for line in run.summary()[min(k, 1) :]],
        attitude_error(shown.time_s, np.degrees(shown.error_rad), np.degrees(shown.error_angle)),
        "Attitude from the measured gyros, "
        + ("" if shown.gyro_bias is None else "their bias at rest taken out, ")
        + "less the true attitude.",
        files=[file for run in runs for file in run.files],
    )
