"""A comment line that widens the bounds is reported; one that the digits disprove is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.runs import PROGRAMME, Bench
from generator.stands import random_bench, simulated
from trihedron.tools.records import RawRecord, read_record, write_record

SIGMA = 1e-5


def positions(folder: Path, *comments: str) -> Path:
    record = simulated(random_bench(np.random.default_rng(1)))
    return written(record, folder, comments)


def written(record, folder: Path, comments: tuple[str, ...]) -> Path:
    path = folder / "record.csv"
    about = dict(comment.split(": ") for comment in comments)
    write_record(replace(record, about=about), path)
    return path


def raw(resolution: float) -> RawRecord:
    """Return a raw record whose readings are multiples of twice a resolution [m/s²]."""
    record, _ = Bench(white=1e-4).run(PROGRAMME[:3])
    if resolution:
        step = 2.0 * resolution
        record = replace(record, specific_force=step * np.round(record.specific_force / step))
    return record


@pytest.mark.parametrize("line", ["resolution_mps2: 1e-4", "resolution_mps2: 5e-2", "resolution_mps2: 2e-5"])
def test_a_comment_line_that_widens_the_bounds_is_named(line, tmp_path):
    result = th.calibrate(positions(tmp_path, line), noise_bound=SIGMA)
    assert any(f"`# {line}` counts" in warning for warning in result.warnings)
    assert result.verdict == "consistent"


@pytest.mark.parametrize("line", ["resolution_mps2: 1e-6", "resolution_deg: 1e-6", "operator: A"])
def test_one_that_adds_next_to_nothing_is_not(line, tmp_path):
    warnings = th.calibrate(positions(tmp_path, line), noise_bound=SIGMA).warnings
    assert not any("counts" in warning for warning in warnings)


@pytest.mark.parametrize("size", ["1", "0.2", "30"])
def test_a_resolution_that_the_digits_disprove_is_refused(size, tmp_path):
    with pytest.raises(th.InputError, match="comment resolution_mps2: all columns are written more finely than to"):
        read_record(positions(tmp_path, f"resolution_mps2: {size}"))


def test_one_column_of_fewer_digits_disproves_nothing(tmp_path):
    record = raw(0.0)
    force = record.specific_force.copy()
    force[:, 0] = np.round(force[:, 0], 1)
    path = written(replace(record, specific_force=force), tmp_path, ("resolution_mps2: 0.05",))
    record = read_record(path)
    assert isinstance(record, RawRecord)
    assert record.resolution == pytest.approx(0.05)


@pytest.mark.parametrize("size", ["0.09", "0.07"])
def test_a_resolution_that_the_rows_of_a_series_disprove_is_refused(size, tmp_path):
    with pytest.raises(th.InputError, match="do not differ by"):
        read_record(written(raw(0.0), tmp_path, (f"resolution_mps2: {size}",)))


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1e-2])
def test_a_resolution_that_is_true_passes(size, tmp_path):
    kind: Any = RawRecord
    record = read_record(written(raw(size), tmp_path, (f"resolution_mps2: {size}",)), kind)
    assert record.resolution == pytest.approx(size, rel=0.5)
