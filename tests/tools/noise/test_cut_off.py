"""Static records whose readings are cut off at an end of the range: refused, as their noise looks too small."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from trihedron.tools.errors import InputError


def static(path: Path, channel: str, quantile: float, step: float = 0.0) -> Path:
    """Write a static record, one channel of which ends at a quantile of its readings, in steps of the logger."""
    rng = np.random.default_rng(5)
    count = 12_000
    table = {"time_s": np.arange(count) / 100.0}
    for axis, force in enumerate((0.0, 0.0, 9.80665), start=1):
        table[f"f{axis}_mps2"] = force + 0.02 * rng.standard_normal(count)
        table[f"w{axis}_radps"] = 1e-3 * rng.standard_normal(count)
    values = table[channel]
    if step:
        values = step * np.round(values / step)
    end = np.quantile(values, quantile)
    table[channel] = np.maximum(values, end) if quantile < 0.5 else np.minimum(values, end)
    pl.DataFrame(table).write_csv(path)
    return path


@pytest.mark.parametrize(
    ("channel", "quantile", "name"),
    [("f3_mps2", 0.7, "accelerometer 3"), ("f1_mps2", 0.2, "accelerometer 1"), ("w2_radps", 0.8, "gyro 2")],
)
def test_readings_that_are_cut_off_are_refused(channel: str, quantile: float, name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{name}: .* are at an end of its range"):
        th.noise(static(tmp_path / "static.csv", channel, quantile))


@pytest.mark.parametrize("step", [0.0, 0.005, 0.02])
def test_whole_readings_in_steps_are_taken(step: float, tmp_path: Path) -> None:
    table = th.noise(static(tmp_path / "static.csv", "f3_mps2", 1.0, step)).to_json()
    assert len(table["channels"]) == 6
