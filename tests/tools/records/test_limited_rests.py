"""Rests in which an accelerometer is at an end of its range: left out by each command that averages them."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from by_hand import present
from generator.runs import PROGRAMME, Bench
from hand_sessions import GRAVITY, hand_moved, written
from trihedron.tools.records import RawRecord
from trihedron.tools.records.rests import find_rests

NOISE = 3e-3 * GRAVITY
"""Of a sample of the accelerometers of `hand_moved` [m/s²]."""


def limited(table: pl.DataFrame, axis: int, step: float, above: float) -> pl.DataFrame:
    """Return a record in steps of some parts of the noise, cut off at so many noises above its largest rest's mean."""
    name = f"f{axis}_mps2"
    force = table[name].to_numpy()
    rests = [force[first : first + 300].mean() for first in range(0, len(force), 500)]
    end = max(rests) + above * NOISE
    if step:
        width = step * NOISE
        force, end = width * np.round(force / width), width * np.round(end / width)
    return table.with_columns(pl.Series(name, np.minimum(force, end)))


@pytest.mark.acceptance
@pytest.mark.parametrize("gyros", [True, False])
@pytest.mark.parametrize(("step", "above"), [(0.0, 0.3), (0.0, -3.0), (0.5, 0.3), (0.5, -3.0), (1.0, 0.0)])
def test_calibrate_by_hand_leaves_out_a_rest_at_the_end_of_the_range(gyros, step, above, tmp_path: Path):
    instrument, table = hand_moved(11)
    table = limited(table, 2, step, above)
    if not gyros:
        table = table.drop("w1_radps", "w2_radps", "w3_radps")
    answer = th.calibrate(written(table, tmp_path / "hand.csv"), gravity=GRAVITY)
    assert any("with f2 at an end of the range: " in line for line in answer.warnings)
    scale = next(one for one in answer.parameters if one.symbol == "gamma_22")
    error = present(scale.estimate) - (instrument.matrix[1, 1] - 1.0)
    assert abs(error) < 4.0 * present(scale.standard_error)


@pytest.mark.first(1)
@pytest.mark.parametrize("step", [0.0, 0.3, 1.0, 2.0])
def test_no_rest_within_the_range_is_left_out(step, tmp_path: Path):
    for seed in (12, 13):
        table = limited(hand_moved(seed)[1], 2, step, 100.0)
        answer = th.calibrate(written(table, tmp_path / "hand.csv"), gravity=GRAVITY)
        assert not any("end of the range" in line for line in answer.warnings)


@pytest.mark.parametrize(("step", "above"), [(0.0, 0.3), (0.5, 0.3), (0.5, -3.0)])
def test_rests_of_a_table_at_the_end_of_the_range_are_refused(step, above):
    raw, _ = Bench(dwell=60.0, step=0.05, encoder_noise=1e-6).run(PROGRAMME[:8])
    noise = 2e-3
    force = raw.specific_force + noise * np.random.default_rng(1).standard_normal(raw.specific_force.shape)
    whole = RawRecord(raw.time_s, raw.alpha, raw.beta, force)
    assert all(rest.refused is None for rest in find_rests(whole))
    largest = float(np.max([force[rest.kept, 2].mean() for rest in find_rests(whole)]))
    end = largest + above * noise
    if step:
        width = step * noise
        force, end = width * np.round(force / width), width * np.round(end / width)
    force[:, 2] = np.minimum(force[:, 2], end)
    refused = [rest.refused for rest in find_rests(RawRecord(raw.time_s, raw.alpha, raw.beta, force))]
    assert 1 <= sum(why == "f3 is at an end of its range" for why in refused) <= 2
