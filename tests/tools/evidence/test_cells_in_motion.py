"""Effects that set in at a time, or fade with a time constant: proofs for a stretch are true within it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from generator.carried import camera_attitude, drawn_motion, strapdown_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Work, apart, chebyshev_radius
from trihedron.tools.diagnosis.procedure import diagnosed
from trihedron.tools.evidence import Carried, Evidence, Rows, carried_evidence, contains
from trihedron.tools.evidence.cells_in_motion import Onsets, TimeConstants, refused
from trihedron.tools.evidence.evidence import limits_of

PERIOD = 0.02
STEP = EffectPlace("gyro-bias-step", "gyro-block")
WARM_UP = EffectPlace("gyro-warm-up", "gyro-block")
DRIFT = EffectPlace("gyro-bias-drift", "gyro-block")
SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
SCALE_STEP = EffectPlace("gyro-scale-step", "gyro-block")


def drawn_evidence(
    *, filmed: bool, step: float = 0.0, scale: float = 0.0, at: float = 0.5, settling: tuple[float, float] = (0.0, 1.0)
) -> Evidence:
    """Return evidence of drawn moves; bias [rad/s] and scale factor of gyro 2 may step at a part of the time.

    The bias of gyro 3 may settle from a size [rad/s] with a time constant that is a part of the time.
    """
    rng = np.random.default_rng(4)
    time, rate, n, attitude = drawn_motion(rng, moves=8 if filmed else 14, rest=2.0, period=PERIOD)
    rate[time > at * time[-1], 1] *= 1.0 + scale
    rate[time > at * time[-1], 1] += step
    rate[:, 2] += settling[0] * np.exp(-time / (settling[1] * time[-1]))
    record = strapdown_record((time, rate, n), seed=4, rate_noise=7e-4)
    if filmed:
        record = replace(record, attitude=camera_attitude(rng, attitude, 1e-4))
    evidence = carried_evidence(record)
    assert isinstance(evidence.model, Carried)
    return evidence


def with_rows(evidence: Evidence, rows: Rows) -> Evidence:
    """Return the evidence of a run with other rows."""
    model = replace(evidence.model, rows=rows)
    return Evidence(model, replace(evidence.reader, model=model))


@cache
def drawn_once(filmed: bool) -> Evidence:
    return drawn_evidence(filmed=filmed)


def stacked(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Return columns (S, d, K) of each group as rows (M, K)."""
    return np.concatenate([part.reshape(-1, part.shape[2]) for part in columns])


@pytest.mark.acceptance
@pytest.mark.parametrize("filmed", [False, True])
def test_a_stretch_holds_what_each_time_within_it_does(filmed):
    """Columns of an effect that sets in within a stretch lie in those of the stretch, if these are known."""
    evidence = drawn_evidence(filmed=filmed)
    for cells in evidence.model.cells.values():
        if not isinstance(cells, Onsets):
            continue
        edges = cells.edges
        for low, high in ((5, 6), (5, 9), (len(edges) // 2, len(edges) - 1)):
            begin, end = int(edges[low]), int(edges[high])
            within, missed = replace(cells, over_bounds=stacked).range(begin, end, np.ones(3))
            assert missed == 0.0
            known_rows = np.isfinite(within).all(axis=1)
            assert known_rows.any()
            for row in (begin, (begin + end) // 2, end - 1):
                target = stacked(cells.columns(row)[0])[known_rows]
                scale = np.linalg.norm(within[known_rows], axis=0)
                basis = within[known_rows][:, scale > 0.0] / scale[scale > 0.0]
                remaining = target - basis @ np.linalg.lstsq(basis, target, rcond=1e-12)[0]
                assert np.abs(remaining).max() < 1e-7 * np.abs(target).max()


@pytest.mark.acceptance
@pytest.mark.parametrize("filmed", [False, True])
def test_time_constants_between_those_that_are_tried_are_missed_by_no_more_than_is_said(filmed):
    """Compare straight lines between neighbours, and the few columns of a stretch, with the exponential itself."""
    evidence, rng = drawn_evidence(filmed=filmed), np.random.default_rng(2)
    cells = evidence.model.cells[WARM_UP]
    assert isinstance(cells, TimeConstants)

    def exactly(number: float) -> np.ndarray:
        return evidence.model.with_onset(WARM_UP, number).rows.columns_of([WARM_UP])

    size, worst, rows_of_errors = limits_of([WARM_UP])[1], 0.0, slice(len(evidence.rows.residual))
    for begin, parts in ((0, 1), (1200, 1), (1200, 5), (len(cells.times) - 81, 1)):
        numbers = begin + np.arange(80 * parts + 1) / parts
        rows, error = evidence.model._rows_of_times(WARM_UP, (), numbers)
        rows, error = rows.chosen(rows_of_errors), error[rows_of_errors]
        columns, missed = evidence.model._range(WARM_UP, begin, begin + 80)
        assert missed < 2e-3
        far = apart(rows, error)
        for single in rng.uniform(0.0, 80.0 * parts, 6):
            between, first = exactly(begin + single / parts), int(single)
            ways = (first + 1 - single) * rows.ways[first] + (single - first) * rows.ways[first + 1]
            off = np.abs(rows.moving @ ways - between)
            assert (off <= error + 1e-12 * np.abs(between).max()).all()
            worst = max(worst, (off / error).max())
            away = np.abs(rows.moving @ rows.ways[round(single)] - between)
            assert (away <= far + 1e-12 * np.abs(between).max()).all()
            assert chebyshev_radius(columns, between @ size, np.ones(len(between)))[0] <= missed
    assert worst > 0.5


@pytest.mark.acceptance
def test_a_large_effect_with_a_time_constant_between_those_that_are_tried_is_found():
    """The bounds are so small that no time constant a thousandth away would fit."""
    clean, number = drawn_evidence(filmed=True), 3200.5
    clean = with_rows(clean, clean.rows.with_bounds([0.02 * part.bound for part in clean.rows.parts]))
    with_onset = clean.model.with_onset(WARM_UP, number)
    unit, sizes = with_onset.rows.columns_of([WARM_UP]), np.array([1.0, -0.4, 0.3])
    sizes *= 5000.0 / np.abs(unit @ sizes).max()
    noise = 0.9 * np.sign(np.random.default_rng(3).normal(size=len(unit)))
    evidence = with_rows(clean, clean.rows.with_errors(clean.rows.split(unit @ sizes + noise)))
    assert all(evidence.model.with_onset(WARM_UP, near).refit([WARM_UP]).radius > 1.2 for near in (3200, 3201))
    (fit,) = evidence.model.mended([WARM_UP], Work())
    for true, (low, high) in zip((*sizes, with_onset.set_in[WARM_UP]), fit.intervals()[0], strict=True):
        assert low <= true <= high
    low, high = fit.intervals()[0][-1]
    assert high / low < 1.002


@pytest.mark.acceptance
@pytest.mark.parametrize("filmed", [False, True])
def test_an_effect_that_sets_in_at_the_beginning_is_the_one_that_always_acts(filmed):
    evidence = drawn_evidence(filmed=filmed)
    latency, step = EffectPlace("latency", "gyro-block"), EffectPlace("latency-step", "gyro-block")
    first = evidence.model.with_onset(step, 0)
    assert first.rows.columns_of([step]) == pytest.approx(evidence.rows.columns_of([latency]), abs=1e-9)
    assert contains([step], [latency])
    assert not contains([latency], [step])
    last = evidence.model.with_onset(step, len(evidence.model.motion) - 2)
    assert np.abs(last.rows.columns_of([step])).max() < 1e-2 * np.abs(first.rows.columns_of([step])).max()


@pytest.mark.acceptance
@pytest.mark.parametrize("at", [0.23, *(pytest.param(at, marks=pytest.mark.acceptance) for at in (0.5, 0.71))])
def test_the_time_of_a_change_is_found_and_held_by_its_interval(at):
    evidence = drawn_evidence(filmed=True, step=2e-3, at=at)
    (fit,) = evidence.model.mended([STEP], Work())
    ((*sizes, start),) = fit.values()
    (intervals,) = fit.intervals()
    hours = evidence.model.motion.time_s[-1] / 3600.0
    assert sizes[1] == pytest.approx(2e-3, rel=0.2)
    assert start == pytest.approx(at * hours, abs=4.0 / 3600.0)
    for true, (low, high) in zip((0.0, 2e-3, 0.0, at * hours), intervals, strict=True):
        assert low <= true <= high
    assert evidence.model.with_onsets(fit).values_of([STEP], fit.estimate)[STEP][-1] == pytest.approx(start, abs=1e-9)
    assert not evidence.model.mended([EffectPlace("latency-step", "gyro-block")], Work())


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("filmed", "part", "size"),
    [
        (0, 0.1, 0.1),
        pytest.param(0, 0.35, 3e-2, marks=pytest.mark.acceptance),
        pytest.param(1, 0.1, 6e-3, marks=pytest.mark.acceptance),
        (1, 0.35, 6e-3),
    ],
)
def test_the_time_constant_of_what_settles_is_found_and_held_by_its_interval(filmed, part, size):
    evidence = drawn_evidence(filmed=bool(filmed), settling=(size, part))
    assert evidence.model.radius > evidence.model.limit
    (fit,) = evidence.model.mended([WARM_UP], Work())
    (intervals,) = fit.intervals()
    hours = evidence.model.motion.time_s[-1] / 3600.0
    ((*sizes, constant),) = fit.values()
    assert sizes[2] == pytest.approx(size, rel=0.3)
    assert constant == pytest.approx(part * hours, rel=0.5)
    for true, (low, high) in zip((0.0, 0.0, size, part * hours), intervals, strict=True):
        assert low <= true <= high
    again = evidence.model.with_onsets(fit).values_of([WARM_UP], fit.estimate)[WARM_UP]
    assert again[-1] == pytest.approx(constant, rel=1e-9)


@pytest.mark.acceptance
def test_what_settles_slowly_is_a_drift_and_no_rival_of_it():
    """An exponential with ten times the record's length is nearly straight; its mean is subtracted."""
    evidence = drawn_evidence(filmed=True)
    cells = evidence.model.cells[WARM_UP]
    assert isinstance(cells, TimeConstants)
    assert cells.times[-1] == pytest.approx(10.0 * cells.hours[-1])
    slow = evidence.model.with_onset(WARM_UP, len(cells.times) - 1).rows.columns_of([WARM_UP])
    drift = evidence.rows.columns_of([DRIFT])
    remaining = slow - drift @ np.linalg.lstsq(drift, slow, rcond=None)[0]
    assert 0.0 < np.abs(remaining).max() < 0.02 * np.abs(slow).max()
    assert contains([WARM_UP], [DRIFT])
    assert not contains([DRIFT], [WARM_UP])
    drifting = drawn_evidence(filmed=True, settling=(0.04, 10.0))
    assert drifting.model.radius > drifting.model.limit
    result = diagnosed(drifting, rerun=False)
    assert (result.verdict, [cause.place for cause in result.causes]) == ("explained", [DRIFT])
    assert (WARM_UP,) in (result.containing_sets or ())


@pytest.mark.acceptance
@pytest.mark.parametrize("at", [0.0, pytest.param(0.5, marks=pytest.mark.acceptance)])
def test_what_can_act_from_the_beginning_on_is_not_said_to_set_in(at):
    """The first moves hardly show a scale factor: a permanent one looks like one that sets in after them."""
    evidence, places = drawn_evidence(filmed=True, scale=0.01, at=at), [SCALE, SCALE_STEP]
    by_place = {place: evidence.model.mended([place], Work()) for place in places}
    ((*_, (start, _)),) = by_place[SCALE_STEP][0].intervals()
    assert (start == 0.0) == (at == 0.0)
    result = diagnosed(evidence, rerun=False)
    (cause,) = result.causes
    if at == 0.0:
        assert cause.place == SCALE
    else:
        # One gyro alone changes: a formula of it needs fewer numbers.
        assert cause.place == SCALE_STEP or "step(hours" in cause.place.law
    assert (result.verdict, result.containing_sets) == ("explained", ((SCALE_STEP,),) if at == 0.0 else ())


def test_what_is_refused_has_no_fit():
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(400, 5))
    inside = matrix @ rng.normal(size=5) + rng.uniform(-1.0, 1.0, 400)
    assert not refused(matrix, inside, 1.0, Work())
    beyond = inside + 3.0 * np.sign(rng.normal(size=400))
    assert refused(matrix, beyond, 1.0, Work())
    assert not refused(matrix[:0], inside[:0], 1.0, Work())


LATENCY_STEP = EffectPlace("latency-step", "gyro-block")


@pytest.mark.first(2)
@settings(max_examples=3, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**20), part=st.floats(0.0, 1.0))
@example(seed=7071, part=3.9317730243195524e-38)
@pytest.mark.parametrize(
    ("filmed", "place"),
    [(True, STEP), (False, STEP), (True, SCALE_STEP), (True, LATENCY_STEP), (True, WARM_UP)],
)
def test_a_truth_at_any_row_or_time_constant_is_within_the_intervals(filmed, place, seed, part):
    """Noise fills the bounds; the onset is anywhere in a window, and a time constant has any value between."""
    clean, rng = drawn_once(filmed), np.random.default_rng(seed)
    rows, cells = clean.rows, clean.model.cells[place]
    low, high = (1000, 2400) if isinstance(cells, TimeConstants) else cells.edges[[2, -3]]
    with_onset = clean.model.with_onset(place, low + part * (high - low))
    unit = with_onset.rows.columns_of([place])
    sizes = rng.normal(size=unit.shape[1])
    # Some eight bounds, of sizes that are possible.
    sizes *= min(8.0 / np.abs(unit @ sizes).max(), float((0.9 * limits_of([place])[1] / np.abs(sizes)).min()))
    steps = 0.1 * rng.normal(size=rows.nominal.shape[1]) / np.abs(rows.nominal).max(axis=0)
    noise = np.sign(rng.normal(size=len(unit))) * 0.999
    evidence = with_rows(clean, rows.with_errors(rows.split(unit @ sizes + rows.nominal @ steps + noise)))
    (fit,) = evidence.model.mended([place], Work())
    most_rows = evidence.model.effort.most_rows
    intervals, ends = fit.intervals(most_rows=most_rows)[0], fit.ends(0.0, most_rows)
    for true, (least, most) in zip((*sizes, with_onset.set_in[place]), intervals, strict=True):
        assert least <= true <= most
    assert ((ends[:, 0] <= rows.point + steps) & (rows.point + steps <= ends[:, 1])).all()


@pytest.mark.acceptance
@pytest.mark.parametrize("at", [0.23, pytest.param(0.5, marks=pytest.mark.acceptance)])
def test_intervals_of_what_sets_in_are_those_of_all_rows_of_the_windows_that_stand(at):
    evidence = drawn_evidence(filmed=True, step=2e-3, at=at)
    (fit,) = evidence.model.mended([STEP], Work())
    (intervals,) = fit.intervals()
    start, end = (np.searchsorted(evidence.model.cells[STEP].hours, hour) for hour in intervals[-1])
    single = [evidence.model.with_onset(STEP, int(row)).refit([STEP]) for row in range(start, end)]
    reached = []
    for at_row in single:
        if at_row.radius <= evidence.model.limit:
            possible = at_row.possible()
            reached.append([np.add(possible.ends(k), at_row.central[k]) for k in range(3)])
    low, high = np.min(reached, axis=0)[:, 0], np.max(reached, axis=0)[:, 1]
    assert np.array(intervals)[:3].ravel() == pytest.approx(np.stack((low, high), axis=1).ravel(), abs=1e-9)


@pytest.mark.acceptance
def test_a_gain_that_needs_gyros_that_nobody_has_is_none():
    """Nothing can be run beyond the limits of the components."""
    evidence = drawn_evidence(filmed=True, step=2e-3)
    fit = evidence.model.refit([DRIFT])
    assert evidence.gain(fit) is not None
    assert (
        with_rows(evidence, evidence.rows.with_errors([1e6 * part.error for part in evidence.rows.parts])).gain(fit)
        is None
    )
