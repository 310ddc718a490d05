"""The word "guaranteed" appears only under the conditions of a correction; else `apply` names the missing one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.carried import strapdown_record
from generator.stands import Stand, random_bench, simulated
from trihedron.models.bench import ELEMENTARY
from trihedron.tools.document import text
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, write_record
from trihedron.tools.reports.calibration import applied_page

SIGMA = 1e-5
MONDAY, TUESDAY = {"serial number": "A-17"}, {"S/N": "a-17"}


def bench_of(seed: int) -> np.ndarray:
    return random_bench(np.random.default_rng(seed))


def measured(bench: np.ndarray, seed: int, about: dict[str, str], degrees: float | None = 21.0) -> PositionRecord:
    """Return a day's record of a bench, with noise of its own."""
    noise = np.random.default_rng(seed).uniform(-SIGMA, SIGMA, (24, 3))
    record = simulated(bench, noise=noise)
    temperature = None if degrees is None else np.full(len(record), degrees)
    return replace(record, about=about, temperature=temperature)


def reasons(calibrated: PositionRecord, record: PositionRecord, noise_bound: float | None = SIGMA) -> list[str]:
    """Return the reasons why the correction of one record by another's calibration is not guaranteed."""
    calibration = th.calibrate(calibrated, noise_bound=noise_bound)
    applied: Any = th.apply(calibration, record)
    page = text(applied_page(applied, None))
    assert ("not guaranteed" in page) == bool(applied.not_guaranteed)
    assert "guaranteed" in page
    return applied.not_guaranteed


@pytest.mark.parametrize("seed", range(6))
def test_the_same_block_on_another_day_and_mounted_anew_is_guaranteed(seed):
    bench = bench_of(seed)
    remounted = bench.copy()
    of_table = ("mounting_error", "kappa", "epsilon", "alpha", "beta")
    names = [k for k, name in enumerate(ELEMENTARY) if name.startswith(of_table)]
    remounted[names] += np.random.default_rng(seed + 50).uniform(-1e-3, 1e-3, len(names))
    monday = measured(bench, seed, MONDAY)
    assert reasons(monday, measured(remounted, seed + 100, TUESDAY, 21.5)) == []
    assert reasons(replace(monday, about={}), measured(remounted, seed + 100, {})) == []


@pytest.mark.parametrize(
    ("about", "degrees", "reason"),
    [
        (TUESDAY, 60.0, "measured at 60 °C, the calibration at 21 °C"),
        (TUESDAY, None, "does not say its temperature"),
        ({"serial number": "B-2"}, 21.0, "of block 'B-2', the calibration of 'A-17'"),
        ({"Instrument": "A-18"}, 21.0, "of block 'A-18'"),
        ({}, 21.0, "does not name its block"),
        (TUESDAY | {"corrected_by": "quadratic accelerometer-1"}, 21.0, "was corrected before"),
    ],
)
def test_another_block_or_temperature_takes_the_word_away(about, degrees, reason):
    bench = bench_of(1)
    (message,) = reasons(measured(bench, 1, MONDAY), measured(bench, 2, about, degrees))
    assert reason in message


@pytest.mark.parametrize("seed", range(6))
def test_a_block_that_nobody_names_is_told_by_gravity(seed):
    message = reasons(measured(bench_of(seed), 1, {}, None), measured(bench_of(seed + 40), 2, {}, None))
    assert any("the corrected reading is" in reason and "g long" in reason for reason in message)


@pytest.mark.parametrize("row", [0, 7, 23])
def test_a_wrong_angle_of_an_encoder_takes_the_word_away(row):
    bench = bench_of(3)
    record = measured(bench, 2, {})
    alpha = record.alpha.copy()
    alpha[row] += 0.02
    (message,) = reasons(measured(bench, 1, {}), replace(record, alpha=alpha))
    assert "miss the directions of the encoders" in message


def test_a_noise_bound_that_the_record_told_guarantees_nothing():
    bench = bench_of(4)
    twice = np.tile(np.arange(24), 2)
    once = measured(bench, 1, {})
    noise = np.random.default_rng(5).uniform(-SIGMA, SIGMA, (48, 3)) * 9.80665
    repeated = once.selected(twice)
    repeated = replace(
        repeated,
        position=np.arange(1, 49),
        time_s=30.0 * np.arange(48),
        row=np.arange(1, 49),
        specific_force=simulated(bench).selected(twice).specific_force + noise,
    )
    (message,) = reasons(repeated, once, None)
    assert "calibrate with --noise-bound" in message


def test_a_record_is_not_corrected_twice_by_calibrations(tmp_path):
    record = measured(bench_of(1), 1, MONDAY)
    calibration = th.calibrate(record, noise_bound=SIGMA)
    applied: Any = th.apply(calibration, record)
    write_record(applied.record, tmp_path / "corrected.csv")
    assert "# corrected_by: the calibration of record" in (tmp_path / "corrected.csv").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="is corrected already"):
        th.apply(calibration, tmp_path / "corrected.csv")


def strapdown_of(bench: np.ndarray, seed: int) -> Any:
    """A record by hand of the block of a bench."""
    stand = Stand.of_elements(bench)
    gamma = stand.gamma + np.diag(stand.plus)
    return strapdown_record(seed=seed, gamma=gamma, bias_g=stand.bias, force_noise=1e-4)


def one_scale_factor(seed: int) -> np.ndarray:
    """A bench whose block has one scale factor for each accelerometer, under the gravity of the model."""
    bench = bench_of(seed)
    bench[12:15] = bench[9:12]
    bench[ELEMENTARY.index("gravity_error")] = 0.0
    return bench


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(4))
def test_the_rests_of_a_block_moved_by_hand_are_held_against_gravity(seed):
    bench = one_scale_factor(seed)
    calibrated = measured(bench, seed, {}, None)
    assert reasons(calibrated, strapdown_of(bench, seed)) == []
    (message,) = reasons(calibrated, strapdown_of(one_scale_factor(seed + 40), seed))
    assert "at the rest at" in message
    assert "g long" in message
