"""Static records whose readings are cut off at an end of the range: refused, as their noise looks too small."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from trihedron.tools.errors import InputError

NOISE = {"f": 0.02, "w": 1e-3}
UNITS = {"f": "mps2", "w": "radps"}


def static(path: Path, cut: Mapping[str, tuple[float, ...]], step: float = 0.0) -> Path:
    """Write a static record in steps of some parts of the noise; `cut` ends channels at quantiles of their readings."""
    rng = np.random.default_rng(5)
    count = 12_000
    table = {"time_s": np.arange(count) / 100.0}
    for axis, force in enumerate((0.0, 0.0, 9.80665), start=1):
        for letter, mean in (("f", force), ("w", 0.0)):
            values = mean + NOISE[letter] * rng.standard_normal(count)
            ends = [np.quantile(values, quantile) for quantile in cut.get(f"{letter}{axis}", ())]
            width = step * NOISE[letter]
            if width:
                values, ends = width * np.round(values / width), [width * np.round(end / width) for end in ends]
            for end in ends:
                values = np.maximum(values, end) if end < np.median(values) else np.minimum(values, end)
            table[f"{letter}{axis}_{UNITS[letter]}"] = values
    pl.DataFrame(table).write_csv(path)
    return path


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("cut", "step", "name"),
    [
        ({"f3": (0.7,)}, 0.0, "accelerometer 3"),
        ({"f1": (0.2,)}, 0.0, "accelerometer 1"),
        ({"w2": (0.8,)}, 0.0, "gyro 2"),
        ({"f3": (0.7,)}, 0.5, "accelerometer 3"),
        ({"f3": (0.95,)}, 0.5, "accelerometer 3"),
        ({"f2": (0.5,)}, 1.0, "accelerometer 2"),
        ({"w3": (0.1, 0.9)}, 0.1, "gyro 3"),
        ({"w1": (0.7,), "f1": (0.3,)}, 0.7, "gyro 1"),
        ({"w1": (0.6,), "w2": (0.6,), "w3": (0.6,)}, 1.3, "gyro 1"),
    ],
)
def test_readings_that_are_cut_off_are_refused(cut, step: float, name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{name}: .* are at an end of its range"):
        th.noise(static(tmp_path / "static.csv", cut, step))


@pytest.mark.first(1)
@pytest.mark.parametrize("step", [0.0, 0.25, 1.0])
def test_whole_readings_in_steps_are_taken(step: float, tmp_path: Path) -> None:
    result = th.noise(static(tmp_path / "static.csv", {}, step))
    assert len(result.channels) == 6
    assert result.warnings == []


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("cut", "step", "words"),
    [({}, 3.0, "gyro 1: its steps are wider"), ({"f1": (0.2, 0.8)}, 0.7, "accelerometer 1: its readings end")],
)
def test_few_steps_that_may_hide_a_limit_are_named(cut, step: float, words: str, tmp_path: Path) -> None:
    result = th.noise(static(tmp_path / "static.csv", cut, step))
    assert any(line.startswith(words) for line in result.warnings)
