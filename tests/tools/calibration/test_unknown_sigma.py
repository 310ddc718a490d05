"""Without a known σ nothing is guaranteed: the answer says so, and how to find σ."""

import gzip
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.runs import PROGRAMME, Bench
from trihedron.tools.records.sigma import deviation_widening

FIELD = Path(os.environ.get("TRIHEDRON_DATA") or Path(th.__file__).parents[1] / "shared" / "data") / "field"


def raw(white: float) -> Any:
    record, _ = Bench(white=white).run(PROGRAMME)
    return record


@pytest.mark.parametrize("white", [3e-5, 1e-4, 3e-4])
def test_scatter_within_rests_is_no_bound(white):
    result = th.calibrate(raw(white))
    assert result.sigma.kind == "unknown"
    assert "guaranteed (" not in str(result)
    assert "(guaranteed" not in str(result)
    if result.verdict == "consistent":
        assert str(result).startswith("Noise bound unknown: ")
        assert "give --noise-sd or --noise-bound" in str(result)


def test_a_bound_that_is_given_is_one():
    result = th.calibrate(raw(1e-4), noise_bound=1e-4)
    assert result.sigma.kind == "bound"
    assert result.verdict == "consistent"
    assert "(guaranteed; `trihedron apply` corrects)" in str(result)


def test_a_series_from_the_field_without_a_bound_is_not_guaranteed(tmp_path):
    packed = FIELD / "raw_no_sigma.csv.gz"
    if not packed.exists():
        pytest.skip(f"{packed} is absent")
    path = tmp_path / "raw.csv"
    path.write_bytes(gzip.decompress(packed.read_bytes()))
    result = th.calibrate(path)
    assert result.sigma.kind == "unknown"
    assert "(guaranteed" not in str(result)


@pytest.mark.parametrize("count", [5, 10, 40])
def test_a_deviation_by_few_rests_is_widened_until_it_covers(count):
    """Nineteen in twenty of the drawn deviations are not below the truth after widening."""
    drawn = np.random.default_rng(count).normal(size=(4000, count))
    widened = deviation_widening(count, 0.05) * np.sqrt(np.mean(drawn**2, axis=1))
    assert np.mean(widened >= 1.0) == pytest.approx(0.95, abs=0.015)
