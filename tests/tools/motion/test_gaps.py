"""Bridged gaps: the attitude stays within the bound; gaps that cannot be bridged are refused."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest

import trihedron as th
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.motion import algorithm_named, angle_between, compare_algorithms, increments_from, run_algorithm
from trihedron.tools.motion.increments import without_gaps
from trihedron.tools.records import StrapdownRecord, write_record

PERIOD, COUNT = 0.01, 300


def drawn(seed: int, kind: str) -> tuple[StrapdownRecord, np.random.Generator]:
    """Draw sines of up to a tenth of the sampling frequency about each axis, with noise or without."""
    rng = np.random.default_rng([seed, len(kind)])
    time, highest = PERIOD * np.arange(COUNT), np.exp(rng.uniform(np.log(0.3), np.log(0.1 / PERIOD)))
    rate, mean = np.zeros((COUNT, 3)), np.zeros((COUNT, 3))
    for axis in range(3):
        for _ in range(rng.integers(1, 6)):
            circular, size, phase = (
                2.0 * np.pi * highest * rng.uniform(0.05, 1.0),
                rng.uniform(0.2, 1.0),
                rng.uniform(0, 7),
            )
            rate[:, axis] += size * np.sin(circular * time + phase)
            turn = np.cos(circular * (time - PERIOD) + phase) - np.cos(circular * time + phase)
            mean[:, axis] += size * turn / (circular * PERIOD)
    noise = rng.choice([0.0, 1e-3, 1e-2]) * rng.standard_normal((COUNT, 3))
    force = np.tile([0.0, 0.0, 9.8], (COUNT, 1))
    if kind == "increments":
        return StrapdownRecord(time, None, PERIOD * (mean + noise), force, row=np.arange(COUNT) + 2), rng
    return StrapdownRecord(time, rate + noise, None, force, row=np.arange(COUNT) + 2), rng


def with_lost(record: StrapdownRecord, *lost: tuple[int, int]) -> StrapdownRecord:
    """Return a record without some rows, given by the first and their number."""
    keep = np.ones(len(record), dtype=bool)
    for first, count in lost:
        keep[first : first + count] = False
    arrays = {
        name: getattr(record, name) for name in ("time_s", "rate", "increment", "specific_force", "attitude", "row")
    }
    return replace(record, **{name: None if v is None else v[keep] for name, v in arrays.items()})


def carried(record: StrapdownRecord) -> np.ndarray:
    """Return the attitude at a record's end, (1, 4)."""
    return run_algorithm(algorithm_named("mean-rate"), increments_from(record, 0).angle)[-1:]


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_the_bound_holds_and_is_not_far_from_what_happens(kind):
    part = []
    for seed in range(200):
        record, rng = drawn(seed, kind)
        lost = int(rng.integers(15, COUNT - 25)), int(rng.integers(1, 5))
        bridged, (bridge,) = without_gaps(with_lost(record, lost), 4)
        assert len(bridged) == COUNT
        assert (bridge.time_s, bridge.rows) == (pytest.approx(record.time_s[lost[0] - 1]), lost[1])
        apart = angle_between(carried(bridged), carried(record))[0]
        part.append(apart / bridge.bound)
    assert max(part) <= 1.0
    # Half of the bound is room for motion that the rows around a gap do not show.
    assert max(part) > 0.5
    assert np.median(part) > 0.1


@pytest.mark.parametrize("lost", [1, 2, 3, 5, 10])
def test_a_slow_turn_errs_by_half_of_the_bound(lost):
    """If motion bends as much in the gap as around it, the bound's only margin is its factor of two."""
    time = PERIOD * np.arange(COUNT)
    rate = np.outer(np.cos(2.0 * np.pi * 0.1 * (time - 1.5)), [0.0, 1.0, 0.0])
    record = StrapdownRecord(time, rate, None, np.tile([0.0, 0.0, 9.8], (COUNT, 1)))
    bridged, (bridge,) = without_gaps(with_lost(record, (150 - lost // 2, lost)), lost)
    assert angle_between(carried(bridged), carried(record))[0] / bridge.bound == pytest.approx(0.5, rel=0.02)


def test_bounds_of_several_gaps_add_up_from_their_times_on(tmp_path):
    record, _ = drawn(3, "rates")
    hurt = with_lost(record, (60, 1), (180, 2))
    run, unbroken = (
        th.attitude_of_record(hurt, bridge_gaps=2, algorithm="mean-rate"),
        th.attitude_of_record(record, algorithm="mean-rate"),
    )
    assert [bridge.rows for bridge in run.bridges] == [1, 2]
    assert run.bridged_bound == pytest.approx(sum(bridge.bound for bridge in run.bridges), rel=1e-15)
    bound = run.to_polars()["bridged_bound_rad"].to_numpy()
    assert bound[58] == 0.0 < bound[60] == bound[178] < bound[182] == bound[-1] == run.bridged_bound
    assert (angle_between(run.attitude, unbroken.attitude) <= bound + 1e-14).all()
    assert run.trusted.all()


@pytest.mark.acceptance
def test_a_gap_is_refused_with_the_option_that_would_bridge_it(tmp_path, capsys):
    record, _ = drawn(5, "rates")
    path = tmp_path / "record.csv"
    write_record(with_lost(record, (100, 3)), path)
    assert main(["attitude", str(path)]) == 2
    assert "row 102, column 'time_s': a gap of 0.04" in (message := capsys.readouterr().err)
    assert "--bridge-gaps 3" in message
    assert main(["attitude", str(path), "--bridge-gaps", "2"]) == 2
    capsys.readouterr()
    result_file = tmp_path / "found.json"
    assert (
        main(["attitude", str(path), "--bridge-gaps", "3", "--json", str(result_file), "--out", str(tmp_path / "out")])
        == 0
    )
    assert "bridged gaps turn the attitude by at most" in capsys.readouterr().out
    result = json.loads(result_file.read_text(encoding="utf-8"))
    assert result["bridged_gaps"] == [{"time_s": 0.99, "rows": 3, "bound_rad": result["bridged_bound_rad"]}]
    assert result["bridged_bound_rad"] > 0.0
    assert len(pl.read_csv(tmp_path / "out" / "attitude.csv")) == result["updates"] + 1
    assert main(["attitude", str(path), "--compare", "--bridge-gaps", "3"]) == 0
    assert "bridged gaps turn" in capsys.readouterr().out


def test_what_cannot_be_bridged_is_refused_in_one_line():
    record, _ = drawn(7, "rates")
    for hurt, most, message in (
        (with_lost(record, (100, 30)), 10, "give a record without gaps$"),
        (with_lost(record, (2, 1), (6, 295)), 2, "too few rows around a gap"),
        (record, 11, "--bridge-gaps 11: give a whole number of rows from 0 to 10"),
        (record, -1, "--bridge-gaps -1"),
    ):
        with pytest.raises(InputError, match=message):
            without_gaps(hurt, most)
    assert without_gaps(record, 3) == (record, ())


def test_an_increment_that_holds_the_whole_gap_is_not_taken_for_that_of_one_row():
    time = PERIOD * np.arange(COUNT)
    turn = 0.01 * np.stack([np.sin(time), 1.0 + 0.2 * np.cos(time), np.cos(2.0 * time)], axis=1)
    record = StrapdownRecord(time, None, turn, np.tile([0.0, 0.0, 9.8], (COUNT, 1)))
    summed = turn.copy()
    summed[103] = turn[100:104].sum(axis=0)
    with pytest.raises(InputError, match="seems to hold the turn over all of it"):
        without_gaps(with_lost(replace(record, increment=summed), (100, 3)), 3)
    assert len(without_gaps(with_lost(record, (100, 3)), 3)[0]) == COUNT


@pytest.mark.acceptance
def test_truth_is_not_known_in_a_bridged_gap_and_rows_keep_their_numbers():
    record, _ = drawn(9, "rates")
    hurt = with_lost(replace(record, attitude=np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1))), (50, 2))
    bridged: Any = without_gaps(hurt, 2)[0]
    assert np.flatnonzero(np.isnan(bridged.attitude).any(axis=1)).tolist() == [50, 51]
    assert bridged.row[48:54].tolist() == [50, 51, 54, 54, 54, 55]
    assert compare_algorithms(hurt, bridge_gaps=2).algorithms[0].updates > 0
