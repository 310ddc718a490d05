"""Several runs without a table: pooled where they are one instrument, apart where they are not."""

import numpy as np
import polars as pl
import pytest

import trihedron as th
from by_hand import GRAVITY, NAMES, present
from hand_sessions import PERIOD, directions, hand_moved, poses, runs, truth

SD = 4e-4
BOUND = 1e-3
FEW = (7, 7, 8)


def gaussian(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Return errors of readings [g] with the standard deviation SD."""
    return rng.normal(0.0, SD, shape)


def at_the_bound(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Return errors of readings [g] as large as the bound allows."""
    return rng.choice([-BOUND, BOUND], shape)


@pytest.mark.acceptance
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 100), marks=pytest.mark.acceptance)])
def test_runs_of_few_poses_with_errors_at_their_bound_are_one_instrument(seeds: range) -> None:
    ratios = []
    for seed in seeds:
        instruments, tables = runs(seed, FEW, at_the_bound)
        result = th.calibrate_together(*tables, noise_bound=BOUND, gravity=GRAVITY)
        assert result.verdict == "consistent"
        assert present(present(result.by_hand).pooled).one_instrument
        assert present(result.radius) <= 1.0
        for instrument, record in zip(instruments, result.of_record.values(), strict=True):
            known = truth(instrument)
            for p in [*result.parameters, *record.parameters]:
                assert p.bounded
                assert p.possible(known[p.symbol])
                ratios.append((present(p.estimate) - known[p.symbol]) / present(p.standard_error))
    # A standard error is of errors spread evenly over the bound; these are √3 times as large.
    assert np.sqrt(np.mean(np.square(ratios))) < 1.2 * np.sqrt(3.0)


@pytest.mark.parametrize("sd", [3e-4, 2e-3])
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 40), marks=pytest.mark.acceptance)])
def test_the_norms_of_all_runs_tell_the_errors_that_nobody_gave(sd: float, seeds: range) -> None:
    """Nine readings have nine parameters: no run alone tells how much its readings err."""
    ratios, pose_errors = [], []
    for seed in seeds:
        instruments, tables = runs(seed, (9, 9, 9), lambda rng, shape: rng.normal(0.0, sd, shape))
        result = th.calibrate_together(*tables, gravity=GRAVITY)
        assert result.verdict == "usable"
        pose_errors.append(present(result.by_hand).pose_error.worst)
        for instrument, record in zip(instruments, result.of_record.values(), strict=True):
            for p in [*result.parameters, *record.parameters]:
                ratios.append((present(p.estimate) - truth(instrument)[p.symbol]) / present(p.standard_error))
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.2
    assert np.median(pose_errors) < 4.0 * sd


@pytest.mark.acceptance
@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 40), marks=pytest.mark.acceptance)])
def test_a_run_of_another_instrument_breaks_the_bound_of_all(seeds: range) -> None:
    for seed in seeds:
        instruments, tables = runs(seed, (12, 12, 12), at_the_bound, strange=True)
        result = th.calibrate_together(*tables, noise_bound=BOUND, gravity=GRAVITY)
        assert result.verdict == "falsified"
        assert not present(present(result.by_hand).pooled).one_instrument
        assert "Not one instrument: no shared parameters keep every reading within" in str(result)
        assert result.option_to_stand in str(result)
        enough = float(result.option_to_stand.split()[1])
        together = th.calibrate_together(*tables, noise_bound=enough, gravity=GRAVITY)
        assert present(present(together.by_hand).pooled).one_instrument
        for instrument, record in zip(instruments, result.of_record.values(), strict=True):
            assert all(p.possible(truth(instrument)[p.symbol]) for p in record.parameters)


def test_a_shared_interval_is_within_those_of_each_run_alone() -> None:
    _, tables = runs(3, (14, 16), at_the_bound)
    result = th.calibrate_together(*tables, noise_bound=BOUND, gravity=GRAVITY)
    for table in tables:
        alone = th.calibrate(table, noise_bound=BOUND, gravity=GRAVITY)
        for p in result.parameters:
            low, high = alone[p.symbol].ends
            width = high - low
            assert p.ends[0] >= low - 0.05 * width
            assert p.ends[1] <= high + 0.05 * width


def test_a_run_of_too_few_poses_leaves_its_own_biases_open() -> None:
    instruments, tables = runs(3, (24, 2), at_the_bound)
    result = th.calibrate_together(*tables, noise_bound=BOUND, gravity=GRAVITY)
    assert all(p.possible(truth(instruments[0])[p.symbol]) and p.bounded for p in result.parameters)
    of_last = list(result.of_record.values())[-1]
    assert not any(p.bounded for p in of_last.parameters)


@pytest.mark.acceptance
def test_three_runs_that_are_too_little_alone_are_enough_together() -> None:
    ratios = []
    for seed in range(20):
        instruments, tables = runs(seed, FEW, gaussian)
        result = th.calibrate_together(*tables, noise_sd=SD, gravity=GRAVITY)
        assert present(present(result.by_hand).pooled).one_instrument
        alone = [
            present(present(th.calibrate(table, noise_sd=SD, gravity=GRAVITY).by_hand).pose_error).worst
            for table in tables
        ]
        assert present(present(result.by_hand).pose_error).worst < 0.5 * max(alone)
        for instrument, record in zip(instruments, result.of_record.values(), strict=True):
            known = truth(instrument)
            for p in [*result.parameters, *record.parameters]:
                ratios.append((present(p.estimate) - known[p.symbol]) / present(p.standard_error))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.15)


def test_a_run_of_another_instrument_is_not_pooled() -> None:
    instruments, tables = runs(5, (14, 14, 14), gaussian, strange=True)
    result = th.calibrate_together(*tables, noise_sd=SD, gravity=GRAVITY)
    assert not present(present(result.by_hand).pooled).one_instrument
    assert result.verdict == "falsified"
    assert result.parameters == []
    last = list(result.of_record.values())[-1]
    assert [p.symbol for p in last.parameters] == list(NAMES)
    for p in last.parameters:
        assert present(p.estimate) == pytest.approx(
            truth(instruments[-1])[p.symbol], abs=5.0 * present(p.standard_error)
        )


def test_biases_are_shared_where_that_is_asked_for() -> None:
    _, tables = runs(6, (9, 9), gaussian)
    result = th.calibrate_together(*tables, noise_sd=SD, gravity=GRAVITY)
    first, second = result.of_record.values()
    assert first.parameters[0].estimate != second.parameters[0].estimate
    with pytest.raises(ValueError, match=r"shared.*bias-\* may be shared"):
        th.calibrate_together(*tables, noise_sd=SD, shared=["gamma-*"])


@pytest.mark.acceptance
def test_a_table_and_a_record_by_hand_are_pooled_by_the_norm_of_gravity() -> None:
    """The record by hand alone has too few rests for the gyros' axes."""
    instrument, hand = hand_moved(21, 7, error=SD)
    rng = np.random.default_rng(21)
    angles = {name: pl.Series(rng.uniform(0.0, 360.0, 24)) for name in ("alpha_deg", "beta_deg")}
    table = poses(instrument, directions(rng, 24), gaussian(rng, (24, 3)))
    table = table.with_columns(time_s=10.0 * pl.col("position"), **angles)
    result = th.calibrate_together(table, hand, noise_sd=SD, gravity=GRAVITY)
    assert present(present(result.by_hand).pooled).one_instrument
    assert any("positions of a table count by the norm of gravity alone" in line for line in result.warnings)
    known = truth(instrument)
    _, of_hand = result.of_record.values()
    for p in [*result.parameters, *of_hand.parameters]:
        assert abs(present(p.estimate) - known[p.symbol]) < 4.0 * present(p.standard_error), p.symbol
    alone = th.calibrate(hand, noise_sd=SD, gravity=GRAVITY)
    assert present(result["gamma_32"].standard_error) < 0.5 * present(alone["gamma_32"].standard_error)
    assert present(result["M11"].standard_error) <= 1.05 * present(alone["M11"].standard_error)


@pytest.mark.acceptance
@pytest.mark.parametrize("count", [7, 20])
def test_gyros_of_one_run_are_there_beside_a_table_of_poses(count: int) -> None:
    """Which run knows its accelerometers worse does not matter."""
    instrument, moved = hand_moved(4, 16, error=SD)
    rng = np.random.default_rng(5)
    table = poses(instrument, directions(rng, count), gaussian(rng, (count, 3)))
    result = th.calibrate_together(table, moved, gravity=GRAVITY)
    known = truth(instrument)
    assert {f"M{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)} < {p.symbol for p in result.parameters}
    for p in result.parameters:
        assert abs(present(p.estimate) - known[p.symbol]) < 4.0 * present(p.standard_error), p.symbol
    assert present(present(result.by_hand).turn_error).worst < 0.01
    few = th.calibrate_together(table, moved[: 18 * round(1.0 / PERIOD)], gravity=GRAVITY)
    assert few.verdict == "insufficient"
    assert any(entry.parameters[0].startswith("M") for entry in few.open)
