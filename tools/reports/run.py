"""Sections on a run of the bench and of the attitude computer."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..document.blocks import Section, Table
from ..document.numbers import Cell, minus, significant
from ..motion.attitude import AttitudeRun
from ..orchestrator.run import Simulation
from .inspection import attitude_lines, split_lines
from .pictures.time import attitude_error, bench_tour


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
        [f"{attitude_lines(shown)[0]}.", *(f"{line[0].upper()}{line[1:]}." for line in split_lines(shown))],
        attitude_error(shown.time_s, np.degrees(shown.error_rad), np.degrees(shown.error_angle)),
        "Attitude from the measured gyros, "
        + ("" if shown.gyro_bias is None else "their bias at rest taken out, ")
        + "less the true attitude.",
        error_table(runs) if shown.rms is not None else None,
        files=[file for run in runs for file in run.files],
    )


def error_table(runs: Sequence[AttitudeRun]) -> Table:
    """Errors of the attitude, a row for each run: with the gyros' bias as it is, or taken out."""
    rows: list[list[Cell]] = []
    for run in runs:
        bias = "none" if run.gyro_bias is None else ", ".join(f"{np.degrees(value):.3f}" for value in run.gyro_bias)
        parts = [None if part is None else rms_of(part[run.judged]) for part in (run.heading, run.tilt)]
        drift = None if run.drift is None else 60.0 * run.drift
        figures = (run.rms, run.maximum, run.final, drift, *parts)
        rows.append([minus(bias), *(None if v is None else significant(float(np.degrees(v)), 3) for v in figures)])
    names = ["rms [deg]", "largest [deg]", "at the end [deg]", "drift [deg/min]", "heading rms [deg]", "tilt rms [deg]"]
    return Table(["gyro bias taken out [deg/s]", *names], rows)


def rms_of(values: NDArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def simulation_lines(result: Simulation) -> list[str]:
    """What was run, what it recorded, and where that is."""
    lines = [f"{result.title or 'a scenario without a title'}: {result.rows} rows of {', '.join(result.columns)}"]
    if result.rests is not None:
        lines.append(f"{result.rests} rests averaged")
    elif result.no_positions:
        lines.append(f"no position record: {result.no_positions}")
    return lines + [str(file) for file in result.files]
