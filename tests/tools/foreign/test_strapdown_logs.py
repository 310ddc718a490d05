"""Logs of gyros and accelerometers as laboratories and LabVIEW write them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from generator.carried import POSES, strapdown_record, true_motion
from laboratory_files import Block, LabFile, strapdown_files, table
from laboratory_imports import imported, imported_as_asked, refused
from trihedron.tools.records import StrapdownRecord


def some_block() -> Block:
    """Return a block of any length, for the names of the files."""
    return Block(np.arange(3) * 0.01, np.zeros((3, 3)), np.ones((3, 3)))


TURNED = slice(450, 650)
"""Rows in which the block is turned: the format of a log does not depend on their number."""
NAMES = [file.name for file in strapdown_files(some_block())]


@pytest.fixture(scope="module")
def block() -> Block:
    record = strapdown_record(true_motion(POSES[:3]))
    assert record.rate is not None
    period = float(np.median(np.diff(record.time_s)))
    return Block(np.arange(len(record.time_s)) * period, record.rate, record.specific_force)


def file_of(block: Block, name: str) -> LabFile:
    return next(file for file in strapdown_files(block) if file.name == name)


@pytest.mark.first(4)
@pytest.mark.parametrize("name", NAMES)
def test_a_log_is_imported_or_asks_for_what_is_missing(name: str, block: Block, tmp_path: Path):
    block = Block(*(values[TURNED] for values in (block.time, block.rate, block.force)))
    file = file_of(block, name)
    conversion, record = imported_as_asked(tmp_path, file)
    assert isinstance(record, StrapdownRecord)
    assert record.rate is not None
    assert record.specific_force == pytest.approx(block.force, abs=1e-6)
    assert record.rate == pytest.approx(block.rate, abs=1e-6)
    assert np.diff(record.time_s) == pytest.approx(np.diff(block.time), abs=2e-6)
    assert conversion.kind == "strapdown record"


def leaves(value: object) -> Iterator[float]:
    """Return the numbers of a JSON value, in order."""
    if isinstance(value, bool | int | float):
        yield float(value)
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from leaves(inner)


@pytest.mark.acceptance
def test_what_is_inspected_is_what_is_inspected_of_the_clean_record(block: Block, tmp_path: Path):
    record = imported(tmp_path, file_of(block, "LabVIEW").content).record
    clean = StrapdownRecord(block.time, block.rate, None, block.force)
    ours, theirs = (th.inspect(one).to_json() for one in (record, clean))
    assert list(leaves(ours)) == pytest.approx(list(leaves(theirs)), rel=1e-4, abs=1e-7)
    assert len(list(leaves(ours))) > 30


def test_a_labview_file_of_several_parts_is_refused(block: Block, tmp_path: Path):
    content = file_of(block, "LabVIEW").content
    message = refused(tmp_path, content + content.partition(b"\r\n\t\r\n")[2])
    assert "2 parts with a header; one is read" in message


@pytest.mark.acceptance
def test_rows_that_lack_a_number_are_a_gap_and_said(block: Block, tmp_path: Path):
    lines = file_of(block, "log in ms").content.decode().splitlines()
    for k in (50, 51):
        lines[k] = lines[k].rpartition(",")[0] + ",n/a"
    conversion = imported(tmp_path, "\n".join(lines))
    assert len(conversion.record) == len(block.time) - 2
    assert conversion.left_out == ("2 rows (a number is missing): 51, 52",)


@pytest.mark.parametrize("second", ["std", "gyro2"])
def test_three_columns_are_told_by_their_unit_only_where_no_others_have_it(second: str, block: Block, tmp_path: Path):
    """Columns of scatter, or of another sensor, are not taken for gyros."""
    rates = [[f"{v:.6f}" for v in column] for column in block.rate[TURNED].T]
    forces = [[f"{v:.6f}" for v in column] for column in block.force[TURNED].T]
    time = [f"{v:.4f}" for v in block.time[TURNED]]
    of_rates = [f"{second}_{k} [rad/s]" for k in "xyz"] + ([f"w_b_{k} [rad/s]" for k in "xyz"] * (second != "std"))
    names = ["time_s", *of_rates, *(f"acc {k} [m/s2]" for k in "xyz")]
    columns = [time, *rates * (len(of_rates) // 3), *forces]
    message = refused(tmp_path, table(names, columns))
    assert ("columns.rate=" if second == "gyro2" else "which column is w1_radps") in message


@pytest.mark.parametrize(
    ("angle", "velocity", "turn", "gain"),
    [("dtheta_{} [mrad]", "dv_{} [mm/s]", 1e-3, 1e-3), ("Delta Theta {} (deg)", "Delta-V {} (m/s)", np.pi / 180, 1.0)],
)
def test_increments_come_in_their_units(angle: str, velocity: str, turn: float, gain: float, tmp_path: Path):
    """Test units of angle and of velocity; forces at the rows are made from these, and the file says so."""
    draw = np.random.default_rng(3)
    angles, gains = (
        draw.uniform(-0.1, 0.1, (20, 3)),
        (draw.uniform(-0.1, 0.1, (20, 3)) + np.array([0.0, 0.0, 9.81])) * 0.01 / gain,
    )
    names = ["time [s]", *(form.format(axis) for form in (angle, velocity) for axis in "xyz")]
    lines = [",".join(map(repr, [0.01 * k, *angles[k].tolist(), *gains[k].tolist()])) for k in range(20)]
    imported(tmp_path, "\n".join([",".join(names), *lines]), out=tmp_path / "record.csv")
    record = th.read_record(tmp_path / "record.csv")
    assert isinstance(record, StrapdownRecord)
    assert record.increment is not None
    assert record.velocity_increment is not None
    np.testing.assert_allclose(record.increment, turn * angles, rtol=1e-15)
    np.testing.assert_allclose(record.velocity_increment, gain * gains, rtol=1e-15)
    assert "means of dv1_mps to dv3_mps" in record.about["f1_mps2 to f3_mps2"]
