"""What has not settled is dropped, what drifts is stated, what creeps is refused."""

from dataclasses import replace

import numpy as np
import pytest

from table_runs import ARCSEC, PROGRAMME, Bench, averaged, mean_errors
from trihedron.tools.errors import InputError
from trihedron.tools.records.rests import average_rests, find_rests
from trihedron.tools.records.settling import scatter_of_mean


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
    assert "f2 drifts linearly by 4.9e-05 g in 19.8 s" in str(rests[5].refused)
    assert "f2 drifts linearly" in average_rests(drifting, rests).warnings[0]
    kept = np.delete(truth, 5, axis=0)
    assert np.abs(mean_errors(average_rests(drifting, rests), kept)).max() < 1.5e-6


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
