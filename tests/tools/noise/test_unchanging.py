"""Channels that never change at rest: their noise is unknown, and no number stands for it."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from generator.noise import known
from trihedron.tools.errors import InputError
from trihedron.tools.noise import kalibr_yaml

SCENARIO = """
schema = "trihedron.scenario/1"
[run]
step_s = 0.01
stop_s = 10.0
[fmus.gyro]
component = "GyroBlock"
[fmus.gyro.parameters]
angle_random_walk = [2e-4, 1e-4, 1e-4]
"""


def static(path: Path, constant: tuple[str, ...]) -> Path:
    """Write a static record of 120 s whose named channels repeat one value."""
    rng = np.random.default_rng(8)
    table = {"time_s": np.arange(12_000) / 100.0}
    for axis, force in enumerate((0.0, 0.0, 9.80665), start=1):
        for name, mean, scatter in ((f"f{axis}_mps2", force, 0.01), (f"w{axis}_radps", 0.013, 1e-3)):
            table[name] = mean + (0.0 if name[:2] in constant else scatter) * rng.standard_normal(12_000)
    pl.DataFrame(table).write_csv(path)
    return path


@pytest.mark.acceptance
def test_a_gyro_that_never_changes_has_no_coefficient(tmp_path, recwarn):
    (tmp_path / "bench.toml").write_text(SCENARIO)
    record = static(tmp_path / "static.csv", ("w2",))
    result = th.noise(record, against=tmp_path / "bench.toml", dwell=10.0, positions=12)
    still = result.channels[1]
    assert (still.channel, still.coefficients, still.processes) == ("gyro 2", [], "unknown")
    assert result.warnings == ["gyro 2: never changes at rest; its noise is unknown, and no result below counts it"]
    assert [one.verdict for one in result.against] == ["explained", "unknown", "consistent"]
    assert known(result.drifts[0].attitude_deg) > 0.0
    assert known(result.averaged).sigma > 0.0
    page = result.report(tmp_path / "noise.html").read_text()
    assert "never changes at rest" in page
    assert "e-25" not in page
    assert kalibr_yaml(result)
    assert not recwarn.list


@pytest.mark.acceptance
def test_accelerometers_that_never_change_give_no_sigma(tmp_path):
    record = static(tmp_path / "static.csv", ("f1", "f2", "f3"))
    result = th.noise(record)
    assert [drift.velocity_mps for drift in result.drifts] == [None] * len(result.drifts)
    with pytest.raises(InputError, match="no accelerometer changes at rest"):
        th.noise(record, dwell=10.0, positions=12)


def test_a_record_in_which_nothing_changes_is_refused(tmp_path):
    with pytest.raises(InputError, match="no channel changes at rest: its noise is unknown"):
        th.noise(static(tmp_path / "static.csv", ("f1", "f2", "f3", "w1", "w2", "w3")))
