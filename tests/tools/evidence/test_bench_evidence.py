"""The evidence of a bench: left-out readings, and the contribution of another mounting."""

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from generator import SIGMA
from generator import G as GRAVITY
from generator.fresh import position_record as fresh_record
from generator.positions import drawn_record, hidden_record
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from other_solver import farthest
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Work
from trihedron.tools.calibration import PRESETS, parametrise
from trihedron.tools.diagnosis import Witness, diagnose
from trihedron.tools.diagnosis.cause import excluded_sizes
from trihedron.tools.diagnosis.witness import judgement_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import bench_evidence, bench_left_out, bench_predictions, bench_search
from trihedron.tools.evidence.bench_model import Cast, determined, predicted_errors
from trihedron.tools.evidence.bench_predictions import second_mounting, simulate_rows
from trihedron.tools.records import PositionRecord, read_record
from trihedron.tools.trials import NOISE_BOUND, draw_alone

ENCODER = EffectPlace("encoder-harmonic", "outer-axis", 2)
CUBIC = EffectPlace("cubic", "accelerometer-3")
ODD = EffectPlace("odd-quadratic", "accelerometer-3")
SAG = EffectPlace("sag", "outer-axis")
ONCE = EffectPlace("encoder-harmonic", "outer-axis", 1)
IDENTITY = parametrise({"identity": np.eye(3)})


def judged(seed: int, place: EffectPlace | None = None, rows: int | None = None) -> Any:
    """Return the witness on a present effect (by default), or on an absent one."""
    case = draw_alone(seed, effects=["quadratic", "encoder-harmonic", "cross-product"] if place is None else [])
    record = case.measured()
    evidence = bench_evidence(record if rows is None else record.selected(np.arange(rows)), noise_bound=NOISE_BOUND)
    return judgement_of(evidence, evidence.model.refit(case.places if place is None else [place]))


def test_a_true_effect_improves_what_was_left_out_and_shuffles_do_not():
    witness = judged(501)
    assert witness.folds is not None
    assert witness.folds.rms_after < NOISE_BOUND < witness.folds.rms_before
    assert witness.shuffles is not None
    assert (witness.shuffles.tried, witness.shuffles.as_good) == (60, 0)
    assert witness.objections == ()


def test_shuffles_are_made_only_where_they_are_asked_for(monkeypatch: pytest.MonkeyPatch):
    """Shuffles cost sixty times as much as left-out parts; comparisons of laws do not need them."""
    case, drawn = draw_alone(2, effects=["quadratic"]), []
    evidence = bench_evidence(case.measured(), noise_bound=NOISE_BOUND)
    shuffled = bench_left_out._shuffled
    monkeypatch.setattr(
        bench_left_out, "_shuffled", lambda *args: (drawn.append(shuffle) or shuffle for shuffle in shuffled(*args))
    )
    trial = next(iter(evidence.reader.trials(evidence.model.refit(case.places))))
    assert trial.folds is not None
    assert drawn == []
    assert len(list(trial.shuffled)) == len(drawn) == bench_left_out.SHUFFLES


def test_an_effect_that_is_not_there_is_objected_to():
    """On a clean record about half of the shuffles are as good as the effect in its own place."""
    witness = judged(510, EffectPlace("cubic", "accelerometer-1"))
    assert witness.folds is not None
    assert witness.shuffles is not None
    assert witness.folds.rms_after > 0.9 * witness.folds.rms_before
    assert witness.shuffles.objects
    assert any("shuffles" in objection for objection in witness.objections)


@pytest.mark.acceptance
def test_each_of_two_effects_is_heard_and_one_that_is_not_there_is_objected_to():
    quadratic, cubic = EffectPlace("quadratic", "accelerometer-1"), EffectPlace("cubic", "accelerometer-2")
    record = hidden_record(511, quadratic, (2e-4,))
    evidence = bench_evidence(record, noise_bound=NOISE_BOUND)
    witness: Any = judgement_of(evidence, evidence.model.refit([quadratic, cubic]))
    true_effect, none = witness.each
    assert (true_effect.place, none.place) == (quadratic, cubic)
    assert true_effect.objections == ()
    assert true_effect.rms_with < 1.0 < true_effect.rms_without
    assert none.objections
    assert witness.objections == none.objections


@pytest.mark.acceptance
def test_a_reading_that_was_left_out_misses_by_no_more_than_noise_unless_it_is_wrong():
    """Noise at its very bound is not an objection; a reading that is off by six bounds is one, even if it fits by
    chance."""
    place = EffectPlace("quadratic", "accelerometer-1")
    record = hidden_record(512, place, (2e-4,))
    rng = np.random.default_rng(512)
    clean = bench_evidence(record, noise_bound=NOISE_BOUND)
    exact = 9.80665 * (clean.model.readings.reading.ravel() - clean.model.refit([place]).left).reshape(-1, 3)
    noise = 9.80665 * NOISE_BOUND * rng.choice([-1.0, 1.0], exact.shape)

    def largest(force) -> Any:
        evidence = bench_evidence(replace(record, specific_force=force), noise_bound=NOISE_BOUND)
        return Witness.of(next(evidence.reader.trials(evidence.model.refit([place])))).largest

    assert not largest(exact + noise).objects
    off = exact + noise
    off[7, 2] += 6.0 * 9.80665 * NOISE_BOUND
    worst = largest(off)
    assert (worst.objects, worst.position, worst.accelerometer) == (True, 8, 3)


@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "seed"), [("thermal-lag", 8), ("bias-step", 1)])
def test_the_extended_model_runs_at_one_possible_point(tmp_path: Path, kind: str, seed: int):
    """Two lags nearly cancel in least squares, with biases of hundreds of bounds: that point is impossible."""
    fresh = fresh_record(tmp_path / "record.csv", kind, seed)
    record = read_record(fresh.path)
    assert isinstance(record, PositionRecord)
    evidence = bench_evidence(record, noise_bound=SIGMA)
    ((name, where),) = fresh.hidden
    fit = evidence.model.mended([EffectPlace(name, where)], Work())[0]
    rows = np.arange(1, len(record))
    misses = evidence.model.readings.reading[rows] - simulate_rows(
        evidence.model.readings, fit, rows, evidence.model.calibration.gravity
    )
    assert np.abs(misses / fit.allowed.reshape(-1, 3)[rows]).max() < 1.01


@pytest.mark.acceptance
def test_a_search_that_would_fill_the_memory_is_refused_before_it_begins(monkeypatch: pytest.MonkeyPatch):
    record = drawn_record(5, [(EffectPlace("cubic", "accelerometer-1"), (6e-4,))], 40)
    monkeypatch.setattr(bench_search, "MOST_BYTES", 100_000)
    with pytest.raises(
        InputError, match=r"^40 positions: the search for effects needs [0-9.e-]+ GiB, .* give a part of"
    ):
        diagnose(record, noise_bound=SIGMA)


def test_too_few_positions_cannot_be_judged_and_that_is_said():
    witness = judged(520, EffectPlace("quadratic", "accelerometer-1"), rows=8)
    assert witness.folds is None
    assert witness.objections == ()
    assert witness.not_judged is not None
    assert "could not be judged" in witness.not_judged


def test_leaving_one_out_agrees_with_the_closed_form():
    """The error of one left-out reading is its residual over 1 − its leverage."""
    rng = np.random.default_rng(0)
    jacobian, residual, bound = rng.normal(size=(30, 4)), rng.normal(size=30), np.ones(30)
    hat = jacobian @ np.linalg.pinv(jacobian)
    residuals = residual - hat @ residual
    for row in (0, 13):
        retained = np.delete(np.arange(30), row)
        errors = predicted_errors(jacobian, determined(jacobian), residual, bound, retained, np.array([row]))
        assert errors is not None
        assert errors[0][0] == pytest.approx(residuals[row] / (1.0 - hat[row, row]), rel=1e-12)
        # Its prediction's variance is h / (1 − h) of a reading's.
        assert errors[1][0] ** 2 == pytest.approx(hat[row, row] / (1.0 - hat[row, row]), rel=1e-12)


def test_a_second_mounting_tells_an_encoder_harmonic_from_a_cubic_term():
    """At the identity mounting the encoder's second harmonic looks like the third accelerometer's cubic term."""
    mounting = second_mounting(IDENTITY, [CUBIC], [ENCODER], (CUBIC.title, ENCODER.title))
    assert mounting is not None
    assert mounting["correlation_before"] == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert mounting["correlation_after"] < 0.1


@pytest.mark.acceptance
def test_no_mounting_tells_apart_what_belongs_to_one_accelerometer_or_one_axis():
    """Cubic and odd quadratic terms need inputs beyond 1 g; sag and the encoder's first harmonic another instrument."""
    assert second_mounting(IDENTITY, [CUBIC], [ODD], ("", "")) is None
    assert second_mounting(IDENTITY, [ONCE], [SAG], ("", "")) is None
    assert second_mounting(parametrise(PRESETS), [CUBIC], [ENCODER], ("", "")) is None


@pytest.mark.acceptance
def test_a_mounting_is_proposed_for_sets_that_remain_or_not_at_all():
    record = hidden_record(4, ENCODER, (1.2e-4, 0.7)).selected(np.arange(0, 40, 3))
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    if result.second_mounting is not None:
        assert result.verdict == "ambiguous"
        assert set(result.second_mounting.separates) <= {finding.title for finding in result.findings}


@pytest.fixture(scope="module")
def coarse():
    """Return a clean bench whose readings are written to 3e-6 g."""
    record = draw_alone(31, effects=[]).measured()
    force = 9.80665 * 3e-6 * np.round(record.specific_force / 9.80665 / 3e-6)
    rounded = replace(record, specific_force=force, resolution=0.5 * 9.80665 * 3e-6)
    return bench_evidence(rounded, noise_bound=NOISE_BOUND, bounds=(3e-3, 0.0))


@pytest.mark.acceptance
def test_an_excluded_size_is_nearly_possible_and_none_beyond_it_is(coarse):
    """Test 96 directions of amplitude and phase, by another solver, with the bounds' growth by rounding."""
    fit, room = coarse.model.baseline, 1.5e-6 + 2e-15
    assert coarse.model.room == pytest.approx(room, rel=1e-9)
    above = {(e["effect"], e["where"], e.get("order")): e["above"] for e in excluded_sizes(coarse, fit)}
    for place, columns in coarse.model.beside(fit):
        if place not in (ENCODER, CUBIC, ODD):
            continue
        directions = (
            [np.ones(1)]
            if columns.shape[1] == 1
            else [np.array([np.cos(t), np.sin(t)]) for t in 2.0 * np.pi * np.arange(96) / 96]
        )
        reached = 0.0
        for direction in (*directions, *(-d for d in directions)):
            jacobian = np.column_stack((fit.jacobian, columns @ direction))
            unit = np.eye(jacobian.shape[1])[-1]
            reached = max(reached, farthest(jacobian, fit.left, fit.bound + room, unit))
        limit = above[place.effect, place.where, place.order]
        assert reached <= limit * (1.0 + 1e-9)
        assert limit <= reached / np.cos(np.pi / 16) * (1.0 + 1e-3)


def test_what_the_readings_do_not_tell_of_gravity_widens_an_interval_by_no_more():
    """Inputs are known up to the factor 1 − Δg/g: at its largest the ends are the true coefficients."""
    bench = bench_evidence(draw_alone(31, effects=[]).measured(), noise_bound=NOISE_BOUND)
    error = bench.model.bounds[1]
    low, high = bench.reader.told(CUBIC, [(2e-4, 3e-4)])[0]
    assert low == pytest.approx(2e-4 / (1.0 + error) ** 3, rel=1e-12)
    assert high == pytest.approx(3e-4 / (1.0 - error) ** 3, rel=1e-12)


@pytest.mark.first(2)
@pytest.mark.parametrize(("seed", "axis"), [(32, 2), (35, 2), (41, 2), (38, 2), (39, 0)])
def test_a_limit_that_many_readings_reach_is_no_scale_factor(seed, axis):
    """Clipped at 0.6 g, more than half of one accelerometer's readings are off, by up to 0.4 g, in one sense."""
    rng = np.random.default_rng(seed)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(-np.pi, np.pi, (2, 48))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (48, 3))
    reading = simulated(bench, alpha, beta, noise=noise).specific_force / GRAVITY
    reading[:, axis] = np.clip(reading[:, axis], -0.6, 0.6)
    evidence = bench_evidence(position_record(reading, alpha, beta), noise_bound=NOISE_BOUND)
    assert np.abs(evidence.model.search.centre.point).max() < 0.02


@pytest.mark.acceptance
def test_positions_that_separate_put_candidates_further_apart_than_both_bounds():
    """A reading may be within σ of two predictions that are less than 2 σ apart, rounded as it is written."""
    quadratic = EffectPlace("quadratic", "accelerometer-1")
    product = EffectPlace("cross-product", "accelerometer-1", None, (1, 2))
    evidence = bench_evidence(drawn_record(2, [(quadratic, (2e-4,))], 14), noise_bound=NOISE_BOUND)
    fits = [evidence.model.refit([place]) for place in (quadratic, product)]
    assert all(fit.radius < 1.0 for fit in fits)
    readings, room = evidence.model.readings, 3e-7
    with mock.patch.object(bench_predictions, "decide", wraps=bench_predictions.decide) as decide:
        positions = bench_predictions.separating_positions(
            readings, evidence.model.search.centre.point, fits, (3e-3, 1e-2), room
        )
    assert positions
    assert all(position["apart_g"] > 2.0 * (NOISE_BOUND + room) for position in positions)
    assert [call.args[-1] for call in decide.call_args_list] == [pytest.approx(2.0 * (NOISE_BOUND + room))]


def test_from_where_a_sag_counts_is_within_what_the_bounds_grow_by():
    """The record does not show whether the sine counts from the encoder's zero or from the vertical."""
    place, part = EffectPlace("sag", "inner-axis"), np.array([3e-3, 4e-3])
    evidence = bench_evidence(hidden_record(4), noise_bound=NOISE_BOUND)
    readings, point = evidence.model.readings, evidence.model.search.centre.point
    model, without = Cast((place,)).model(readings, point, part), Cast(()).model(readings, point, np.zeros(0))
    assert model is not None
    assert without is not None
    grown = (model.bound - without.bound).reshape(-1, 3)
    rows = readings.rows(point, readings.disturbed(point, [(place, part)]))
    amplitude, phase = place.definition.from_coefficients(part)
    moved = amplitude * (np.sin(rows.alpha + rows.from_vertical) - np.sin(rows.alpha)) * np.cos(rows.beta + phase)
    change = np.abs(rows.by_beta * moved[:, None])
    assert np.all(change <= grown + 1e-12)
    assert change.max() > 0.1 * grown.max() > 0.0
