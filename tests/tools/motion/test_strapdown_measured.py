"""The measured records: what their rests say, and nothing that they do not support."""

import os
from pathlib import Path

import pytest

from trihedron.tools.motion.inspect import Inspection, inspect_record
from trihedron.tools.records import StrapdownRecord, read_record


def inspected(name: str) -> Inspection:
    folder = Path(os.environ.get("TRIHEDRON_DATA", Path(__file__).parents[3] / ".." / "shared" / "data"))
    path = folder / f"{name}.strapdown.csv"
    if not path.exists():
        pytest.skip(f"the real record {path} is not there; set TRIHEDRON_DATA to its folder")
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    return inspect_record(record)


@pytest.mark.parametrize("name", ["mpu9150-0", "mpu9150-1", "mpu9150-2"])
def test_nine_parameters_are_enough_for_the_mpu9150_and_no_behaviour_of_the_gyros_is_named(name):
    found = inspected(name)
    assert 15 <= len(found.rests) <= 25
    assert found.sampling.period == pytest.approx(0.01)
    assert found.turning.said == ()
    assert found.accelerometers is not None
    assert found.accelerometers.verdict == "consistent"
    assert found.accelerometers.least_squares is not None
    assert abs(found.accelerometers.least_squares).max() < 0.05
    assert found.gyros is not None
    assert found.gyros.verdict in ("constant", "wandering", "insufficient")


def test_the_rests_of_broad_03_are_those_before_and_after_the_motion():
    """Slow rotation from 45.7 to 166.1 s, by the source's description; two poses calibrate nothing."""
    found = inspected("broad-03")
    assert len(found.rests) == 2
    ends = [found.record.time_s[[rows.start, rows.stop - 1]] for rows in found.rests.rows]
    assert ends[0][1] < 45.7
    assert ends[1][0] > 166.1
    assert found.turning.said == ()
    assert found.accelerometers is not None
    assert found.accelerometers.verdict == "insufficient"
    assert len(found.accelerometers.missing) >= 5
    assert found.gyros is not None
    assert found.gyros.verdict == "insufficient"
