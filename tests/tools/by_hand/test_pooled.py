"""Several runs without a table: pooled where they are one instrument, apart where they are not."""

import numpy as np
import polars as pl
import pytest

import trihedron as th
from by_hand import GRAVITY, NAMES, Instrument, present
from hand_sessions import directions, poses, truth

SD = 4e-4


def runs(seed: int, counts: tuple[int, ...], *, strange: bool = False) -> tuple[list[Instrument], list[pl.DataFrame]]:
    """Return runs of an instrument, each with its own biases; the last of another instrument where it is strange."""
    rng = np.random.default_rng(seed)
    instruments, tables = [], []
    for number, count in enumerate(counts):
        instrument = Instrument(seed + (1000 if strange and number == len(counts) - 1 else 0))
        instrument.bias = instrument.bias + rng.normal(0.0, 2e-3, 3)
        instruments.append(instrument)
        tables.append(poses(instrument, directions(rng, count), rng.normal(0.0, SD, (count, 3))))
    return instruments, tables


def test_three_runs_that_are_too_little_alone_are_enough_together() -> None:
    ratios = []
    for seed in range(20):
        instruments, tables = runs(seed, (7, 7, 8))
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
    instruments, tables = runs(5, (14, 14, 14), strange=True)
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
    _, tables = runs(6, (9, 9))
    result = th.calibrate_together(*tables, noise_sd=SD, gravity=GRAVITY)
    first, second = result.of_record.values()
    assert first.parameters[0].estimate != second.parameters[0].estimate
    with pytest.raises(ValueError, match=r"shared.*bias-\* may be shared"):
        th.calibrate_together(*tables, noise_sd=SD, shared=["gamma-*"])
