"""A record corrected by a diagnosis is marked, keeps the correction's uncertainty, and is not corrected twice."""

from functools import cache
from pathlib import Path
from typing import Any

import pytest

import trihedron as th
from trihedron.tools.errors import InputError
from trihedron.tools.records import write_record
from trihedron.tools.records.columns import CORRECTED_BY, CORRECTED_WITHIN

SIGMA = 1e-5
SCALE_FACTORS = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))


@cache
def corrected(seed: int, effect: str) -> tuple[Any, Any, Any]:
    """Return a hidden record, its diagnosis, and the record corrected by it."""
    hidden = th.hide(seed, effect)
    diagnosis = th.diagnose(hidden.record, noise_bound=SIGMA)
    assert diagnosis.verdict == "explained"
    return hidden, diagnosis, th.apply(diagnosis, hidden.record)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [1, 2, 5, 8])
def test_the_true_scale_factors_lie_in_the_intervals_of_a_corrected_record(seed, tmp_path):
    """The intervals from the file and from memory agree."""
    hidden, diagnosis, applied = corrected(seed, "quadratic")
    path = tmp_path / "corrected.csv"
    write_record(applied.record, path)
    result = th.calibrate(path, noise_bound=SIGMA)
    assert result.verdict == "consistent"
    truth = hidden.secret["truth"]
    gravity_error = truth["TurntableMotion"]["gravity_error"]
    axis = int(diagnosis.causes[0].place.title[-1]) - 1
    signs = zip(SCALE_FACTORS[axis], ("scale_error_plus", "scale_error_minus"), strict=True)
    for symbol, name in signs:
        true_value = (1.0 - gravity_error) * (1.0 + truth["AccelerometerBlock"][name][axis]) - 1.0
        assert result[symbol].low <= true_value <= result[symbol].high
    assert any("which may be wrong by" in warning for warning in result.warnings)


@pytest.mark.acceptance
def test_a_corrected_record_says_by_what_and_is_not_corrected_twice(tmp_path):
    _, diagnosis, applied = corrected(1, "quadratic")
    assert diagnosis.causes[0].place.title in applied.record.about[CORRECTED_BY]
    assert len(applied.record.about[CORRECTED_WITHIN].split()) == 3
    path = tmp_path / "corrected.csv"
    write_record(applied.record, path)
    assert path.read_text(encoding="utf-8").startswith(f"# {CORRECTED_BY}: ")
    with pytest.raises(InputError, match="is corrected already"):
        th.apply(diagnosis, path)


@pytest.mark.first(1)
@pytest.mark.parametrize("line", ["1e-4", "1 2", "a b c", "-1 0 0", "nan 0 0"])
def test_a_correction_that_says_no_three_numbers_is_refused(line, tmp_path):
    hidden = th.hide(1, "quadratic")
    path = Path(tmp_path) / "record.csv"
    write_record(hidden.record, path)
    path.write_text(f"# {CORRECTED_WITHIN}: {line}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(InputError, match="three numbers"):
        th.calibrate(path, noise_bound=SIGMA)
