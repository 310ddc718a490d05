"""Rests with known directions of gravity, from any source: a hidden effect is named, with its size inside."""

import numpy as np
import pytest

from trihedron.tools.diagnosis import KnownDirections, diagnose
from trihedron.tools.errors import InputError

SIGMA = 1e-5
NONLINEAR = {"quadratic": np.square, "cubic": lambda n: n**3}


def rests(seed: int, effect: str = "", size: float = 0.0, accelerometer: int = 1, count: int = 30) -> KnownDirections:
    """Return rests of a drawn block in drawn directions, with noise that fills its bound and a nonlinear
    accelerometer."""
    rng = np.random.default_rng([76, seed])
    n = rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    reading = n + n @ rng.uniform(-2e-3, 2e-3, (3, 3)) + rng.uniform(-5e-3, 5e-3, 3)
    if effect:
        reading[:, accelerometer - 1] += size * NONLINEAR[effect](n[:, accelerometer - 1])
    return KnownDirections(n, reading + rng.uniform(-SIGMA, SIGMA, reading.shape), SIGMA)


@pytest.mark.first(2)
@pytest.mark.parametrize("seed", range(4))
def test_a_nonlinear_scale_factor_is_named_with_its_true_size_inside(seed, tmp_path):
    rng = np.random.default_rng([77, seed])
    effect, accelerometer = str(rng.choice(list(NONLINEAR))), int(rng.integers(1, 4))
    size = float(rng.uniform(2e-4, 8e-4) * rng.choice([-1.0, 1.0]))
    result = diagnose(rests(seed, effect, size, accelerometer))
    assert result.verdict == "explained"
    (cause,) = result.causes
    assert (cause.effect, cause.where) == (effect, f"accelerometer-{accelerometer}")
    ((low, high),) = cause.intervals
    assert low <= size <= high
    assert high - low < 0.5 * abs(size)
    assert result.stated.verdict == "consistent"
    assert str(result).startswith(f"One effect explains the record: {cause.sentence[0].lower()}")
    assert "None" not in str(result)
    assert result.report(tmp_path / "page.html").stat().st_size > 10_000


@pytest.mark.parametrize("seed", range(3))
def test_a_clean_block_is_consistent_and_its_parameters_are_inside(seed):
    record = rests(seed)
    result = diagnose(record)
    assert result.verdict == "consistent"
    rng = np.random.default_rng([76, seed])
    rng.normal(size=(30, 3))
    scale = rng.uniform(-2e-3, 2e-3, (3, 3))
    parameters = {p.symbol: p for p in result.calibration.parameters}
    for row in range(3):
        for column in range(3):
            parameter = parameters[f"accelerometer gamma_{row + 1}{column + 1}"]
            assert parameter.low <= scale[column, row] <= parameter.high


@pytest.mark.acceptance
def test_what_no_catalogue_lists_is_proven_by_place_and_quantity():
    record = rests(5)
    reading = record.reading.copy()
    reading[:, 1] += 4e-4 * np.tanh(record.direction[:, 1] / 0.3)
    result = diagnose(KnownDirections(record.direction, reading, SIGMA))
    assert result.proven is not None
    assert result.proven.place == "accelerometer-2"


def test_directions_that_prove_nothing_or_are_none_are_refused():
    record = rests(0)
    assert diagnose(KnownDirections(record.direction[:3], record.reading[:3], SIGMA)).verdict == "insufficient"
    with pytest.raises(InputError, match="not a unit vector"):
        KnownDirections(2.0 * record.direction, record.reading, SIGMA)
    with pytest.raises(InputError, match="N x 3"):
        KnownDirections(record.direction[:5], record.reading, SIGMA)
    with pytest.raises(InputError, match="noise bound"):
        KnownDirections(record.direction, record.reading, 0.0)
