"""Effects of gyros that set in at a time on a whole bench: sizes and times hold the hidden values."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Work, chebyshev_radius
from trihedron.tools.evidence import Evidence, Fit, whole_evidence
from trihedron.tools.evidence.bench_in_time import SLACK, SLIP
from trihedron.tools.evidence.evidence import limits_of
from trihedron.tools.trials import Hidden, draw_whole

SIGMA = 1e-5
BIAS_STEP, SCALE_STEP, LATENCY_STEP, WARM_UP = (
    EffectPlace(name, "gyro-block") for name in ("gyro-bias-step", "gyro-scale-step", "latency-step", "gyro-warm-up")
)
DRAWN = draw_whole(np.random.default_rng([5, 5]))
BENCH = replace(DRAWN, alpha=DRAWN.alpha[-28:], beta=DRAWN.beta[-28:])


CASES = [
    (BIAS_STEP, (3e-6, -2e-5, 1e-5, 0.041)),
    (LATENCY_STEP, (5e-5, 0.045)),
    pytest.param(SCALE_STEP, (3e-5, -1e-4, 2e-5, 0.052), marks=pytest.mark.acceptance),
    pytest.param(WARM_UP, (3e-5, -5e-5, 2e-5, 0.02), marks=pytest.mark.acceptance),
]


@cache
def evidence_with(*hidden: Hidden) -> Evidence:
    return whole_evidence(BENCH.measured(5, None, hidden), BENCH.place, noise_bound=SIGMA)


def holds(fit: Fit, true: Sequence[float]) -> bool:
    """Return True if the intervals of a fit's only effect hold the true values."""
    (ends,) = fit.intervals()
    return all(low <= value <= high for value, (low, high) in zip(true, ends, strict=True))


@pytest.mark.acceptance
def test_a_slip_is_not_lost_where_the_time_next_to_the_best_parts_a_reading():
    """A slip of 13 arcmin near the end of a move: its reading shows nothing of it at that time, and all of an
    earlier one."""
    drawn = draw_whole(np.random.default_rng([5, 6]))
    bench = replace(drawn, alpha=drawn.alpha[-28:], beta=drawn.beta[-28:])
    values = -3.1027e-3, -4.1974e-4, 1.88724e-3, 0.051250382
    record = bench.measured(5, None, (Hidden(SLIP, values),))
    evidence = whole_evidence(record, bench.place, noise_bound=SIGMA)
    (fit,) = evidence.model.mended([SLIP], Work())
    assert holds(fit, (*values[:-1], values[-1] - began_of(evidence) / 3600.0))


@pytest.mark.acceptance
@settings(max_examples=3, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**20), part=st.floats(0.0, 0.999))
def test_a_range_of_numbers_holds_what_each_within_it_does(seed, part):
    """Steps, a slip and a settling effect on a table: a refused range refuses each number in it."""
    rng, model = np.random.default_rng(seed), evidence_with().model
    for place, cells in model.cells.items():
        edges, width = cells.edges, int(rng.integers(1, 4))
        low = int(rng.integers(0, len(edges) - width))
        begin, end = int(edges[low]), int(edges[low + width])
        held, missed = model._range(place, begin, end)
        number = begin + part * (end - begin)
        exact = model.over_bounds(cells.columns(number if place == WARM_UP else int(number))[0])
        target = exact @ (limits_of([place])[1] * rng.uniform(-1.0, 1.0, exact.shape[1]))
        rows = np.isfinite(held).all(axis=1)
        assert rows.any()
        assert np.isfinite(target[rows]).all()
        radius = chebyshev_radius(held[rows], target[rows], np.ones(rows.sum()))[0]
        assert radius <= missed + 1e-9 * np.abs(target[rows]).max()


def began_of(evidence: Evidence) -> float:
    """Return the time at which a bench's record begins [s]."""
    reader: Any = evidence.reader
    return reader.circumstances.began


def title(value: object) -> str:
    return value.effect if isinstance(value, EffectPlace) else ""


@pytest.mark.first(1)
@pytest.mark.parametrize(("place", "values"), CASES, ids=title)
def test_turns_change_as_the_extended_component_says(place, values):
    """Compare the integrals of the gyro block's own component, with the effect less without, piece by piece."""
    clean, moved = evidence_with(), evidence_with(Hidden(place, values))
    changed = (moved.model.whole.turns.integral - clean.model.whole.turns.integral).ravel()
    number = clean.model.cells[place].number(values[-1])
    columns = clean.model.with_onset(place, number).columns_set_in(place)[clean.model.of_readings :]
    assert np.abs(columns @ values[:-1] - changed).max() <= 5e-3 * np.abs(changed).max()


def test_a_slip_is_seen_by_readings_and_by_gyros_as_the_extended_component_says():
    """In the middle of a move, the turn with the slip contains it; a rest of both sides shows nothing."""
    values = (2e-4, -1e-4, 3e-4, 152.303 / 3600.0)
    clean, moved = evidence_with(), evidence_with(Hidden(SLIP, values))
    turns = clean.model.whole.turns
    assert np.array_equal(turns.first, moved.model.whole.turns.first)
    number = clean.model.cells[SLIP].number(values[-1] - began_of(clean) / 3600.0)
    with_slip = clean.model.with_onset(SLIP, number)
    columns, of = np.nan_to_num(with_slip.columns_set_in(SLIP)), clean.model.of_readings
    by_gyros = (moved.model.whole.turns.integral - turns.integral).ravel()
    across = np.repeat((turns.first <= number) & (number < turns.last), 3)
    assert np.abs(by_gyros[across]).max() > 1e-4
    assert np.abs(columns[of:] @ values[:-1] - by_gyros).max() <= 3e-6
    by_readings = (moved.model.moving.seen.reading - clean.model.moving.seen.reading).ravel()
    # The selected rows of a move may change with the slip.
    same = np.repeat(moved.model.moving.seen.rows == clean.model.moving.seen.rows, 3)
    remaining = (columns[:of] @ values[:-1] - by_readings)[same & with_slip.says[:of]]
    assert np.abs(remaining).max() <= 3e-6 < 1e-4 < np.abs(by_readings[same]).max()
    rested = clean.model.moving.seen.span[clean.model.moving.at_rest][3].mean()
    assert (~clean.model.with_onset(SLIP, rested).says).sum() == 3


@pytest.mark.acceptance
@pytest.mark.parametrize("factor", [0.1, 1.0, 20.0])
def test_a_slip_is_found_with_its_angles_and_its_time(factor):
    """Test slips in a move and at rest, by 8 arcseconds or a quarter of a degree; no other effect would do."""
    for start in (0.0411, 0.04231):
        values = *(factor * theta for theta in (2e-4, -1e-4, 3e-4)), start
        evidence = evidence_with(Hidden(SLIP, values))
        standing = {
            place: fits for place in evidence.model.starting if (fits := evidence.model.mended([place], Work()))
        }
        assert list(standing) == [SLIP]
        ((fit,),) = standing.values()
        (ends,) = fit.intervals()
        assert holds(fit, (*values[:-1], start - began_of(evidence) / 3600.0))
        assert all(high - low < 10.0 * SIGMA for low, high in ends[:-1])
        # Within a move, or a rest with its moves.
        assert ends[-1][1] - ends[-1][0] < 20.0 / 3600.0


@pytest.mark.acceptance
def test_what_sets_in_beside_another_effect_is_sought_and_found_with_it():
    """Bounds leave few of all pairs, the true one among them; its intervals hold the hidden values."""
    hidden = Hidden(EffectPlace("encoder-harmonic", "outer-axis", 3), (6e-5, 1.0)), Hidden(BIAS_STEP, CASES[0][1])
    evidence, work = evidence_with(*hidden), Work()
    remaining = list(evidence.model.sets_in_time(2, work, SLACK))
    assert tuple(effect.place for effect in hidden) in remaining
    assert len(remaining) <= 5
    (fit,) = evidence.model.mended([effect.place for effect in hidden], work)
    for effect, ends in zip(hidden, fit.intervals(), strict=True):
        assert all(low <= value <= high for value, (low, high) in zip(effect.values, ends, strict=True))


@pytest.mark.acceptance
@pytest.mark.parametrize(("place", "values"), CASES, ids=title)
def test_what_sets_in_is_found_with_its_time(place, values):
    """No other effect that sets in would do, and none that always acts; intervals hold the hidden values."""
    evidence = evidence_with(Hidden(place, values))
    assert evidence.model.falsified
    standing = {
        place_sought: fits
        for place_sought in evidence.model.starting
        if (fits := evidence.model.mended([place_sought], Work()))
    }
    assert list(standing) == [place]
    ((fit,),) = standing.values()
    (ends,) = fit.intervals()
    for value, stated, (low, high) in zip(values, fit.values()[0], ends, strict=True):
        assert low <= value <= high
        assert low <= stated <= high
    assert ends[-1][0] > 0.0
    if place is not WARM_UP:
        # Within a move, or a rest with its moves.
        assert ends[-1][1] - ends[-1][0] < 20.0 / 3600.0
    always = EffectPlace("gyro-bias-drift", "gyro-block"), EffectPlace("gyro-scale-drift", "gyro-block")
    assert all(evidence.model.refit([place_sought]).radius > evidence.model.limit for place_sought in always)
