"""A user's script: `make lint` checks its types, a test runs it. It uses public names only."""

from pathlib import Path
from typing import assert_type

import numpy as np
import polars as pl
from matplotlib.figure import Figure

import trihedron as th


def bench(folder: Path) -> float:
    """Simulate, calibrate, correct, compare; return the bound of the first accelerometer's bias [g]."""
    th.new("scenario", folder / "bench.toml")
    run = th.simulate(folder / "bench.toml", out=folder / "run")
    assert_type(run.table, pl.DataFrame)
    calibration = th.calibrate(run, noise_bound=1e-5)
    low, high = calibration["X16"].low, calibration["X16"].high
    assert low is not None
    assert high is not None
    assert_type(low, float)
    assert_type(calibration.figure("residuals"), Figure)
    assert_type(calibration.sheet(folder / "sheet.html", about={"serial number": "AB-17"}), Path)
    table: dict[str, list[float]] = run.table.to_dict(as_series=False)
    again = th.calibrate(table, noise_bound=1e-5)
    assert (again.verdict, again == calibration) == ("consistent", False)
    corrected = th.apply(calibration, folder / "run" / "positions.csv", noise_bound=1e-5)
    assert corrected.to_json()["schema"].startswith("trihedron.")
    compared = th.compare(folder / "run", run, within=["0"])
    assert_type(compared.columns[0].largest, float)
    assert compared.verdict == "same"
    assert np.isfinite(high - low)
    return high - low


def wrong() -> str:
    """Return the refusal of a missing file."""
    try:
        th.calibrate("missing.csv")
    except th.InputError as error:
        return str(error)
    return ""
