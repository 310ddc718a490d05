"""The memory that a calculation takes is estimated before, and refused beyond the budget."""

import subprocess
import sys
from pathlib import Path

import pytest

import trihedron as th
from generator import SIGMA
from generator.carried import strapdown_record
from generator.lots import write_lot
from generator.positions import drawn_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration.calibration import ROOM as OF_CALIBRATION
from trihedron.tools.cli import main
from trihedron.tools.diagnosis.kinds import OF_POSITIONS, OF_STRAPDOWN
from trihedron.tools.errors import InputError
from trihedron.tools.noise.identify import ROOM as OF_NOISE
from trihedron.tools.records import write_record
from trihedron.tools.room import BUDGET_GB, VARIABLE

TESTS = Path(__file__).parents[1]
ONE_EFFECT = [(EffectPlace("cubic", "accelerometer-1"), (6e-4,))]
PROGRAM = """
import pathlib, sys
import numpy as np
import trihedron as th
from trihedron.tools.records import StrapdownRecord
def peak():
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
sys.path.insert(0, {tests!r})
{call}
print(peak())
"""
DRAWN = """
from generator.positions import drawn_record
from trihedron.models.effects import EffectPlace
record = drawn_record(7, [(EffectPlace("cubic", "accelerometer-1"), (6e-4,))], {count})
th.{task}(record, noise_bound=1e-5)
"""
CARRIED = """
from generator.carried import POSES, strapdown_record, true_motion
poses = [POSES[k % len(POSES)] for k in range({count} // 450 + 1)]
matrix = np.zeros((3, 3))
matrix[1, 0] = 3e-3
th.diagnose(strapdown_record(true_motion(np.array(poses)), sensitivity=matrix))
"""
STILL = """
draws = np.random.default_rng(0)
force = draws.normal(0.0, 0.03, ({count}, 3)) + [0.0, 0.0, 9.8]
time, rate = 0.005 * np.arange({count}), draws.normal(0.0, 1e-3, ({count}, 3))
th.noise(StrapdownRecord(time_s=time, rate=rate, increment=None, specific_force=force))
"""


def peak_of(call: str) -> float:
    """Return the largest memory [bytes] of a process that makes a call."""
    program = PROGRAM.format(tests=str(TESTS), call=call)
    process = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return float(process.stdout.split()[-1])


@pytest.mark.skipif(sys.platform != "linux", reason="the largest memory is read from /proc")
@pytest.mark.parametrize(
    ("task", "count"),
    [
        pytest.param("diagnose", 300, marks=pytest.mark.acceptance),
        pytest.param("diagnose", 1000, marks=pytest.mark.acceptance),
        pytest.param("diagnose", 2000, marks=pytest.mark.acceptance),
        pytest.param("calibrate", 5000, marks=pytest.mark.acceptance),
        pytest.param("calibrate", 100_000, marks=pytest.mark.acceptance),
        pytest.param("carried", 20_000, marks=pytest.mark.acceptance),
        pytest.param("carried", 500_000, marks=pytest.mark.acceptance),
        ("noise", 100_000),
        pytest.param("noise", 2_000_000, marks=pytest.mark.acceptance),
    ],
)
def test_the_estimate_is_within_half_as_much_again_of_the_memory(task: str, count: int):
    room = {"diagnose": OF_POSITIONS, "calibrate": OF_CALIBRATION, "carried": OF_STRAPDOWN, "noise": OF_NOISE}[task]
    program = {"carried": CARRIED, "noise": STILL}.get(task, DRAWN)
    peak = peak_of(program.format(task=task, count=count))
    print(f"\n{task} of {count}: {peak / 1e6:.0f} MB, estimated {room.needed(count) / 1e6:.0f} MB")
    assert peak / 1.5 <= room.needed(count) <= 1.5 * peak


def test_the_budget_is_one_number_for_all_machines():
    assert BUDGET_GB == 4.0
    assert OF_POSITIONS.needed(3000) < 4e9 < OF_POSITIONS.needed(6000)


@pytest.mark.parametrize("task", ["diagnose", "calibrate", "noise"])
def test_a_record_beyond_the_budget_is_refused_in_a_line(task: str, tmp_path, monkeypatch, capsys):
    path = tmp_path / "record.csv"
    record = strapdown_record() if task == "noise" else drawn_record(7, ONE_EFFECT, 40)
    write_record(record, path)
    monkeypatch.setenv(VARIABLE, "0.1")
    options = () if task == "noise" else ("--noise-bound", "1e-5")
    assert main([task, str(path), *options]) == 2
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    assert "GB of memory, and the budget is 0.1 GB" in line
    assert f"set {VARIABLE}=1" in line


def test_too_many_positions_are_refused_before_any_work(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    record = drawn_record(7, (), 20_000)
    with pytest.raises(InputError, match=r"a diagnosis of 20000 positions needs about .* GB of memory"):
        th.diagnose(record, noise_bound=SIGMA)


def test_several_records_are_refused_by_all_their_positions(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    records = [drawn_record(seed, (), 3_000) for seed in (7, 8)]
    with pytest.raises(InputError, match="a diagnosis of 6000 positions needs about"):
        th.diagnose_together(*records, noise_bound=SIGMA)


def test_a_kind_of_record_that_is_absent_needs_no_memory(monkeypatch):
    monkeypatch.setenv(VARIABLE, "0.3")
    assert th.diagnose(drawn_record(7, (), 20), noise_bound=SIGMA).verdict == "consistent"


def test_too_long_a_strapdown_record_is_refused(monkeypatch):
    monkeypatch.setenv(VARIABLE, "0.3")
    with pytest.raises(InputError, match=r"rows needs about .* GB of memory, and the budget is 0\.3 GB; cut"):
        th.diagnose(strapdown_record())


def test_a_record_of_a_batch_beyond_the_budget_is_a_row_with_its_reason(tmp_path, monkeypatch):
    table = write_lot(tmp_path / "records", 2, 1, positions=12)
    write_record(drawn_record(7, (), 20_000), tmp_path / "records" / "record-1.csv")
    monkeypatch.delenv(VARIABLE, raising=False)
    lot = th.batch(table, do="diagnose", noise_bound=SIGMA, jobs=1, out=tmp_path / "lot")
    assert [bool(member.failed) for member in lot.members].count(True) == 1
    assert any("GB of memory" in (member.failed or "") for member in lot.members)


@pytest.mark.parametrize("text", ["much", "0", "-1", "inf", "nan", ""])
def test_a_budget_that_is_no_size_is_refused(text: str, monkeypatch):
    monkeypatch.setenv(VARIABLE, text)
    with pytest.raises(InputError, match=f"{VARIABLE}="):
        th.calibrate(drawn_record(7, (), 20), noise_bound=SIGMA)
