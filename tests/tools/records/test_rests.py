"""Rests in simulated table runs: averages against the simulated values; unsettled, drifting and creeping rests."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import stdtrit

from generator import G as GRAVITY
from generator.runs import ARCSEC, PROGRAMME, Bench, mean_errors, up
from trihedron.tools.errors import InputError
from trihedron.tools.records import RawRecord, average_rests, find_rests, position_record_of, without_turns
from trihedron.tools.records.noise import scatter_of_mean, student_quantile


def averaged(raw: RawRecord) -> Any:
    """Return the position record of a raw record, with all possible columns."""
    return position_record_of(raw)


def test_a_run_without_errors_gives_its_positions_exactly():
    raw, truth = Bench().run(PROGRAMME)
    record = averaged(raw)
    np.testing.assert_allclose(np.stack([record.alpha, record.beta], axis=1), np.array(PROGRAMME), rtol=0, atol=1e-15)
    np.testing.assert_allclose(record.specific_force, GRAVITY * truth, rtol=0, atol=1e-14)
    assert record.position.tolist() == list(range(1, 25))
    assert record.scatter.max() < 1e-15
    assert record.warnings == ()


def test_time_is_the_middle_and_row_the_start_of_the_averaging_interval():
    raw, _ = Bench().run(PROGRAMME[:3])
    rests = find_rests(raw)
    record = average_rests(raw, rests)
    for k, rest in enumerate(rests):
        assert rest.first <= rest.kept_first < rest.kept_last <= rest.last
        assert rest.last - rest.first + 1 == pytest.approx(200, abs=2)
        assert record.time_s[k] == 0.5 * (raw.time_s[rest.kept_first] + raw.time_s[rest.kept_last])
        assert record.row[k] == raw.row[rest.kept_first]


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_the_bench_is_averaged_and_what_is_held_stays(seed):
    bench = Bench(white=5e-6, held=5e-6, encoder_held=ARCSEC, seed=seed)
    raw, truth = bench.run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    error = mean_errors(record, truth)
    # uniform white noise: 5e-6/√3 over the root of 198 rows
    assert np.sqrt(np.mean(error**2)) == pytest.approx(5e-6 / np.sqrt(3 * 198), rel=0.4)
    assert np.abs(error).max() < 4.5 * 5e-6 / np.sqrt(3 * 198)
    assert np.abs(np.stack([record.alpha, record.beta], axis=1) - PROGRAMME).max() <= ARCSEC * (1 + 1e-9)
    assert 1.0 < np.median(record.scatter) / (GRAVITY * 5e-6 / np.sqrt(3 * 198)) < 2.0


@pytest.mark.parametrize("noise", [0.3 * ARCSEC, ARCSEC, 10 * ARCSEC])
def test_the_tolerance_follows_the_encoders_own_scatter(noise):
    raw, truth = Bench(white=5e-6, encoder_noise=noise).run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    angle_error = np.stack([record.alpha, record.beta], axis=1) - PROGRAMME
    assert np.abs(angle_error).max() < 5 * noise / np.sqrt(150)
    assert np.abs(mean_errors(record, truth)).max() < 1.5e-6


@pytest.mark.parametrize("digit", [5 * ARCSEC, 36 * ARCSEC])
def test_an_encoder_with_a_coarse_last_digit(digit):
    raw, truth = Bench(white=5e-6, encoder_noise=0.2 * digit, encoder_digit=digit).run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    assert np.abs(np.stack([record.alpha, record.beta], axis=1) - PROGRAMME).max() < 0.5 * digit
    assert np.abs(mean_errors(record, truth)).max() < 1.5e-6


def test_a_stop_that_is_too_short_is_refused_with_its_reason():
    long, _ = Bench(dwell=20.0).run(PROGRAMME[:4])
    short, _ = Bench(dwell=2.0).run([PROGRAMME[4]])
    names = ("alpha", "beta", "specific_force")
    joined: dict[str, Any] = {name: np.concatenate([getattr(long, name), getattr(short, name)]) for name in names}
    time = np.concatenate([long.time_s, long.time_s[-1] + 0.1 + short.time_s])
    record = averaged(RawRecord(time_s=time, **joined))
    assert [rest.refused is None for rest in record.rests] == [True] * 4 + [False]
    assert "quarter of the median rest" in str(record.rests[-1].refused)
    assert len(record) == 4
    assert "left out" in record.warnings[0]


@pytest.mark.parametrize("mean_rate", [np.deg2rad(0.5), np.deg2rad(180)])
def test_slow_and_sudden_moves(mean_rate):
    raw, truth = Bench(white=5e-6, mean_rate=mean_rate).run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    assert np.abs(mean_errors(record, truth)).max() < 2e-6


def test_a_motion_too_slow_for_a_window_is_no_rest():
    raw, truth = Bench(white=5e-6, step=0.01, mean_rate=np.deg2rad(0.05)).run([(0.0, 0.1), (0.3, 0.2), (0.5, 0.4)])
    rests = find_rests(raw)
    assert len(rests) == 3
    assert np.abs(mean_errors(average_rests(raw, rests), truth)).max() < 1e-6


def test_positions_one_row_apart_are_two_rests():
    raw = RawRecord(
        0.1 * np.arange(100),
        np.repeat([0.2, 0.8], 50),
        np.full(100, 0.5),
        GRAVITY * up(np.repeat([0.2, 0.8], 50), np.full(100, 0.5)),
    )
    record = averaged(raw)
    assert record.alpha.tolist() == [0.2, 0.8]


def test_one_axis_may_stay_and_a_position_may_be_repeated_without_a_move():
    programme = [(0.5, 0.5), (0.5, 1.5), (0.5, 1.5), (1.5, 1.5)]
    raw, _ = Bench(white=5e-6, encoder_held=ARCSEC).run(programme)
    record = averaged(raw)
    assert len(record) == 3
    assert np.abs(record.alpha - [0.5, 0.5, 1.5]).max() < 2 * ARCSEC
    assert np.abs(record.beta - [0.5, 1.5, 1.5]).max() < 2 * ARCSEC


def test_the_sense_of_the_last_move_of_each_axis():
    programme = [(0.5, -0.5), (1.0, -0.5), (0.7, -1.0), (0.7, 0.3)]
    record = averaged(Bench(white=5e-6, encoder_noise=ARCSEC).run(programme)[0])
    assert record.approach_alpha.tolist() == [1, 1, -1, -1]
    assert record.approach_beta.tolist() == [-1, -1, -1, 1]


def test_the_sense_after_an_overshoot_is_that_of_the_return():
    stop = Bench(dwell=20.0)
    raw, _ = stop.run([(0.5, 0.5), (1.0, 1.0)])
    over = np.concatenate([np.linspace(1.0, 1.2, 20), np.linspace(1.2, 1.0, 20)[1:]])
    back = RawRecord(
        0.1 * np.arange(len(raw) + 39 + 200),
        np.concatenate([raw.alpha, over, np.full(200, 1.0)]),
        np.concatenate([raw.beta, np.full(239, 1.0)]),
        GRAVITY * up(*np.ones((2, len(raw) + 239))),
    )
    record = averaged(back)
    assert record.approach_alpha.tolist() == [1, 1, -1]


def test_without_a_move_before_it_there_is_no_sense():
    record = averaged(Bench().run([(0.0, 0.5), (1.0, 0.7)])[0])
    assert record.approach_alpha is None


def test_an_encoder_that_starts_again_at_zero():
    raw, truth = Bench(white=5e-6, encoder_noise=ARCSEC).run([(1.0, 0.5), (0.0, 0.2), (-0.5, -0.2), (0.0, 0.5)])
    turned = replace(raw, alpha=raw.alpha % (2 * np.pi), beta=raw.beta % (2 * np.pi))
    record = averaged(turned)
    assert len(record) == 4
    assert np.abs(mean_errors(record, truth)).max() < 2e-6
    straight = averaged(raw)
    np.testing.assert_allclose(up(record.alpha, record.beta), up(straight.alpha, straight.beta), rtol=0, atol=1e-12)
    assert record.approach_alpha.tolist() == [1, -1, -1, 1]


def test_whole_turns_are_taken_out_exactly():
    angle = np.array([6.2, 6.28, 0.01, 0.1, 6.28, 0.0])
    np.testing.assert_allclose(np.diff(without_turns(angle)), [0.08, 0.0132, 0.09, -0.1032, 0.0032], atol=1e-4)
    straight = np.array([0.0, 3.0, 0.5])
    assert without_turns(straight).tolist() == straight.tolist()


def test_temperature_is_averaged_with_the_readings():
    raw, _ = Bench().run(PROGRAMME[:2])
    raw = replace(raw, temperature=20.0 + raw.time_s / 100)
    record = averaged(raw)
    np.testing.assert_allclose(record.temperature, 20.0 + record.time_s / 100, atol=1e-12)


def test_a_table_that_never_stops_has_no_rests():
    time = 0.1 * np.arange(500)
    raw = RawRecord(time, 0.1 * time, np.sin(time), GRAVITY * up(0.1 * time, np.sin(time)))
    with pytest.raises(InputError, match="no rest of the table"):
        averaged(raw)
    few = RawRecord(time[:5], np.zeros(5), np.zeros(5), np.full((5, 3), 5.0))
    with pytest.raises(InputError, match="no rest of the table"):
        averaged(few)


@pytest.mark.acceptance
def test_a_million_rows_are_no_loop():
    raw, truth = Bench(white=5e-6, encoder_noise=ARCSEC, step=0.0006).run(PROGRAMME)
    assert len(raw) > 900_000
    record = averaged(raw)
    assert len(record) == 24
    assert np.abs(mean_errors(record, truth)).max() < 2e-7


@pytest.mark.parametrize(
    ("transient", "time_constant"), [(1e-3, 0.5), (1e-3, 1.0), (1e-3, 2.0), (1e-5, 3.0), (1e-2, 1.0)]
)
def test_the_unsettled_start_is_dropped(transient, time_constant):
    bench = Bench(white=5e-6, transient=transient, time_constant=time_constant)
    raw, truth = bench.run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    # a fifth of a noise bound of 1e-5; the plain mean would be wrong by transient·τ/20 s
    assert np.abs(mean_errors(record, truth)).max() < min(2.1e-6, transient * time_constant / 12)


def test_what_is_dropped_is_no_constant_time():
    quick = find_rests(Bench(white=5e-6, transient=1e-3, time_constant=0.5).run(PROGRAMME)[0])
    slow = find_rests(Bench(white=5e-6, transient=1e-3, time_constant=2.0).run(PROGRAMME)[0])
    none = find_rests(Bench(white=5e-6).run(PROGRAMME)[0])
    dropped = [np.median([rest.kept_first - rest.first for rest in rests]) for rests in (none, quick, slow)]
    assert dropped[0] <= 2
    assert 15 < dropped[1] < 45
    assert 70 < dropped[2] < 140


def test_a_rest_that_does_not_settle_is_refused():
    raw, _ = Bench(white=5e-6, transient=1e-3, time_constant=6.0).run(PROGRAMME)
    rests = find_rests(raw)
    assert len(rests) == 24
    assert all(rest.refused is not None and "not settled" in rest.refused for rest in rests)
    with pytest.raises(InputError, match=r"record: no rest .* row \d+: has not settled") as caught:
        average_rests(raw, rests)
    assert "\n" not in str(caught.value)


def test_a_small_drift_is_left_in_the_record():
    raw, truth = Bench(white=5e-6, drift_per_hour=1e-4).run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    assert np.abs(mean_errors(record, truth, 1e-4)).max() < 1.2e-6
    assert record.warnings == ()


def test_a_linear_trend_is_stated_with_its_size():
    raw, truth = Bench(white=2e-7, drift_per_hour=2e-4).run(PROGRAMME)
    rests = find_rests(raw)
    stated = [text for rest in rests for text in rest.trends]
    assert stated
    assert all("drifts by" in text for text in stated)
    record = average_rests(raw, rests)
    assert len(record) == 24
    assert np.abs(mean_errors(record, truth, 2e-4)).max() < 1e-7
    assert len(record.warnings) == 1
    assert "a linear trend in" in record.warnings[0]


@pytest.mark.parametrize("drift", [3e-3, 3e-2])
def test_a_drift_through_whole_rests_is_no_settling(drift):
    raw, truth = Bench(white=5e-6, drift_per_hour=drift).run(PROGRAMME)
    rests = find_rests(raw)
    assert all(rest.refused is None and rest.kept_first - rest.first <= 2 for rest in rests)
    assert all("drifts by" in text for rest in rests for text in rest.trends)
    record = average_rests(raw, rests)
    assert np.abs(mean_errors(record, truth, drift)).max() < 1.5e-6


def test_a_transient_is_dropped_from_the_drift_that_follows_it():
    raw, truth = Bench(white=5e-6, drift_per_hour=3e-3, transient=1e-3, time_constant=0.5).run(PROGRAMME)
    rests = find_rests(raw)
    assert all(rest.refused is None for rest in rests)
    assert np.mean([15 < rest.kept_first - rest.first < 60 for rest in rests]) > 0.9
    assert np.abs(mean_errors(average_rests(raw, rests), truth, 3e-3)).max() < 1.5e-6


def test_a_trend_that_one_rest_has_alone_is_refused_by_name():
    raw, truth = Bench(white=5e-6).run(PROGRAMME)
    rest = find_rests(raw)[5]
    force = raw.specific_force.copy()
    rows = slice(rest.first, rest.last + 1)
    force[rows, 1] += 9.80665 * 5e-5 * np.linspace(0, 1, rest.last + 1 - rest.first)
    drifting = replace(raw, specific_force=force)
    rests = find_rests(drifting)
    assert [k for k, r in enumerate(rests) if r.refused is not None] == [5]
    assert "f2 drifts linearly by 4.9e-5 g in 19.8 s" in str(rests[5].refused)
    assert "f2 drifts linearly" in average_rests(drifting, rests).warnings[0]
    rest_truth = np.delete(truth, 5, axis=0)
    assert np.abs(mean_errors(average_rests(drifting, rests), rest_truth)).max() < 1.5e-6


def test_without_noise_a_drift_keeps_mean_and_time_together():
    raw, truth = Bench(drift_per_hour=1e-3).run(PROGRAMME)
    record = averaged(raw)
    assert len(record) == 24
    assert np.abs(mean_errors(record, truth, 1e-3)).max() < 1e-12


def test_an_axis_that_creeps_is_refused():
    raw, _ = Bench(creep=2 * ARCSEC).run(PROGRAMME[:4])
    with pytest.raises(InputError, match=r"outer axis turns by 20 arcsec in its last 9\.\d+ s"):
        averaged(raw)


def test_the_scatter_of_a_mean_covers_flicker():
    rng = np.random.default_rng(7)
    white = rng.normal(0, 1, (400, 200))
    expected = np.std(white.mean(axis=0))
    assert 1.0 < np.median(scatter_of_mean(white)) / expected < 1.6
    walk = np.cumsum(rng.normal(0, 1, (400, 200)), axis=0)
    assert np.median(scatter_of_mean(walk)) > 10 * np.median(np.std(walk, axis=0) / 20) / 4


def test_equal_readings_have_no_scatter():
    assert scatter_of_mean(np.full((20, 3), 0.1)).tolist() == [0.0, 0.0, 0.0]
    assert scatter_of_mean(np.full((6, 3), 0.1)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("chance", [1e-4, 1e-3, 0.05])
@pytest.mark.parametrize("freedom", [1, 2, 5, 38, 1000, 100_000])
def test_the_quantile_is_that_of_scipy(freedom: int, chance: float) -> None:
    expected = float(stdtrit(freedom, 1.0 - 0.5 * chance))
    assert student_quantile(freedom, chance) == pytest.approx(expected, rel=1e-10)
