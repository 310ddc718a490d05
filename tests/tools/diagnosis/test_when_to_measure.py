"""Candidates that differ in time: the proposal repeats positions at given hours, and these decide.

In records without temperatures a lag of many hours behind temperatures can nearly imitate a step or a drift.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator.stands import random_bench, simulated
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.records import PositionRecord
from trihedron.tools.reports import page_of
from trihedron.tools.trials import NOISE_BOUND

SPAN = 1.0
"""Length of a record [h]."""


def measured(bench: np.ndarray, angles: np.ndarray, hours: np.ndarray, added: np.ndarray, seed: int) -> PositionRecord:
    """Return a record of a bench at angles (2, N) [rad] and times (N,), with an addition to accelerometer 2 [g]."""
    noise = np.random.default_rng(seed).uniform(-NOISE_BOUND, NOISE_BOUND, (len(hours), 3))
    noise[:, 1] += added
    return replace(simulated(bench, angles[0], angles[1], noise), time_s=3600.0 * hours)


def joined(first: PositionRecord, then: PositionRecord) -> PositionRecord:
    """Return one record after another."""
    arrays = ("time_s", "alpha", "beta", "specific_force")
    columns = {name: np.concatenate((getattr(first, name), getattr(then, name))) for name in arrays}
    return replace(
        first,
        position=np.arange(1, len(columns["time_s"]) + 1),
        row=np.arange(1, len(columns["time_s"]) + 1),
        **columns,
    )


def diagnosed(record: PositionRecord) -> Diagnosis:
    return diagnose(record, noise_bound=NOISE_BOUND, rerun=False)


def in_time(effect: str, hours: np.ndarray) -> np.ndarray:
    """Return the change by an effect at times (N,) [g]."""
    size = 4.5 * NOISE_BOUND
    return size * (hours / SPAN if effect == "bias-drift" else (hours > 0.5 * SPAN).astype(float))


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("effect", "seed"), [pytest.param("bias-drift", 1, marks=pytest.mark.acceptance), ("bias-step", 5)]
)
def test_what_is_ambiguous_in_time_is_decided_by_repeats_at_the_hours_that_are_proposed(effect, seed):
    rng = np.random.default_rng([seed, 29])
    bench, angles = random_bench(rng), rng.uniform(0.0, 2.0 * np.pi, (2, 20))
    hours = np.linspace(0.0, SPAN, 20)
    record = measured(bench, angles, hours, in_time(effect, hours), seed)
    first = diagnosed(record)
    assert first.verdict == "ambiguous"
    next_positions: list[Any] = list(first.next_positions or ())
    again = [position for position in next_positions if "repeats" in position]
    assert again
    for position in again:
        assert SPAN < position["hours"] <= 2.1 * SPAN
        at = angles[:, position["repeats"] - 1]
        assert np.radians([position["alpha_deg"], position["beta_deg"]]) == pytest.approx(at, abs=1e-8)
    times = np.array([float(position["hours"]) for position in next_positions])
    assert np.all(np.diff(times) >= 0.0)
    page = page_of(first)
    assert page is not None
    (table,) = [section.table for section in page.answer if section.title == "Where and when to measure next"]
    assert table is not None
    proposals = [dict(zip(table.header, row, strict=True)) for row in table.rows]
    repeats = [row for row in proposals if row["again"] is not None]
    assert len(repeats) == len(again)
    assert all(row["t [h]"] is not None and row["by [σ]"] is not None for row in repeats)
    proposed = np.radians([[p["alpha_deg"], p["beta_deg"]] for p in next_positions]).T
    times = times + 1e-3 * np.arange(len(times))
    then = diagnosed(joined(record, measured(bench, proposed, times, in_time(effect, times), seed + 1)))
    assert then.verdict == "explained"
    assert [cause.place for cause in then.causes] == [EffectPlace(effect, "accelerometer-2")]
