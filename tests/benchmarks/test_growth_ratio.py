"""Growth of cost with the size of a record, and the cost of one more record beside that of a command of its own."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from generator.carried import POSES, strapdown_record, true_motion
from generator.lots import SIGMA, write_lot
from generator.positions import drawn_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.records import StrapdownRecord

pytestmark = pytest.mark.benchmark_ratio
ONE_EFFECT = ((EffectPlace("cubic", "accelerometer-1"), (6e-4,)),)
MOST_GROWTH = 8.0
"""Most time of a diagnosis of 1,000 positions over that of 100: with a cubic effect 6.0 was measured, once."""
MOST_GROWTH_OF_ROWS = 7.0
"""Most time of a strapdown record of 500,000 rows over that of 50,000, with ten times as many moves."""
LIBRARIES = "import numpy, scipy.linalg, polars, pydantic, cyclopts"
MOST_START = 2.5
"""Most time of a command that calibrates 12 positions over that of loading the libraries that it needs: 1.3 to 1.8 were
measured. A start of 0.4 s is asked; the libraries alone take that."""
LEAST_OF_A_BATCH = 15.0
"""Least time of 500 commands over that of a batch of 500 records."""
LEAST_OF_ATTITUDES = 10.0
"""Least time of attitude runs, each in a campaign by itself, over that of the same number in one campaign."""
CAMPAIGN = """
schema = "trihedron.campaign/1"
repeats = {runs}
[attitude]
motion = "5"
rate_hz = 1000.0
duration_s = 60.0
noise_bound_radps = 1e-5
"""


def processor_seconds(*command: str) -> float:
    """Return the processor time of a command and the processes that it starts."""
    return processor_seconds_of("-m", "trihedron.tools.cli", *command)


def processor_seconds_of(*arguments: str) -> float:
    """Return the processor time of Python with these arguments and of the processes that it starts."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    before = os.times()
    subprocess.run(
        [sys.executable, *arguments],
        check=True,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    after = os.times()
    return after.children_user - before.children_user + after.children_system - before.children_system


def growth(before: float, after: float) -> tuple[str, str]:
    """Return the cells of a record and of one with a tenth of its rows, by their times [s of processor]."""
    return f"{after:.1f}", f"{after / before:.1f}"


def test_a_diagnosis_of_ten_times_as_many_positions(capsys, cost_row):
    seconds = {}
    for count in (100, 1000):
        record = drawn_record(7, ONE_EFFECT, count)
        # The first diagnosis of a process loads compiled code.
        diagnose(drawn_record(7, ONE_EFFECT, 40), noise_bound=SIGMA)
        begun = time.process_time()
        result = diagnose(record, noise_bound=SIGMA)
        seconds[count] = time.process_time() - begun
        assert [cause.effect for cause in result.causes] == ["cubic"]
    with capsys.disabled():
        print(f"\ndiagnosis of positions: {seconds} s of processor, {seconds[1000] / seconds[100]:.1f} times")
    cost_row("growth", "`diagnose`, 1,000 positions, one effect", *growth(seconds[100], seconds[1000]))
    assert seconds[1000] < MOST_GROWTH * seconds[100]


def test_a_command_and_a_batch_against_the_calibration_itself(tmp_path: Path, capsys, cost_row):
    count = 500
    table = write_lot(tmp_path / "records", count, 1, positions=12)
    record = tmp_path / "records" / "record-3.csv"
    command = "calibrate", str(record), "--noise-bound", "1e-5"
    processor_seconds(*command)
    # The load of the machine changes: commands before and after the batch stand for those beside it.
    singles = [processor_seconds(*command) for _ in range(3)]
    own = []
    for _ in range(5):
        begun = time.process_time()
        th.calibrate(record, noise_bound=SIGMA)
        own.append(time.process_time() - begun)
    libraries = min(processor_seconds_of("-c", LIBRARIES) for _ in range(3))
    many = processor_seconds("batch", str(table), "--do", "calibrate", "--noise-bound", "1e-5", "--jobs", "1",
                             "--out", str(tmp_path / "lot"))  # fmt: skip
    singles += [processor_seconds(*command) for _ in range(3)]
    single = float(np.mean(singles))
    with capsys.disabled():
        print(
            f"\ncalibrate, 12 positions: a command {single:.2f} s, in the process {min(own):.3f} s "
            f"({single / min(own):.0f} times), the libraries {libraries:.2f} s ({min(singles) / libraries:.1f} times); "
            f"{count} in a batch {many:.1f} s ({single * count / many:.1f} times)"
        )
    cost_row("many", "calibration of 12 positions, in Python", f"{1e3 * min(own):.0f}", "")
    cost_row("many", "a command", f"{1e3 * single:.0f}", f"libraries alone {1e3 * libraries:.0f}")
    ratio = f"1/{single * count / many:.1f} of a command"
    cost_row("many", "one of a batch of 500", f"{1e3 * many / count:.0f}", ratio)
    assert single * count > LEAST_OF_A_BATCH * many
    assert min(singles) < MOST_START * libraries


def test_attitudes_of_one_campaign_against_a_campaign_for_each(tmp_path: Path, capsys, cost_row):
    seconds, most = {}, 2001
    for runs in (1, most):
        path = tmp_path / f"{runs}.toml"
        path.write_text(CAMPAIGN.format(runs=runs), encoding="utf-8")
        # The first campaign compiles: a run alone, and many together. The start varies by as much as 200 runs take.
        times = []
        for number in range(3):
            out = str(tmp_path / f"{runs}-{number}")
            times.append(processor_seconds("campaign", str(path), "--jobs", "1", "--out", out))
        seconds[runs] = min(times)
    more = (seconds[most] - seconds[1]) / (most - 1)
    with capsys.disabled():
        print(
            f"\nattitude, 60 s at 1 kHz: {1e3 * more:.1f} ms a run in one campaign, "
            f"{seconds[1]:.1f} s in one of its own"
        )
    ratio = f"1/{seconds[1] / more:.0f} of one alone"
    cost_row("many", "attitude, 60 s at 1 kHz, in a campaign", f"{1e3 * more:.1f}", ratio)
    assert seconds[1] > LEAST_OF_ATTITUDES * seconds[most] / most


def test_positions_of_no_effect_grow_no_faster(capsys, cost_row):
    """A consistent record: a calibration, and the excluded size of each effect."""
    seconds = []
    for count in (100, 1000):
        record = drawn_record(8, (), count)
        begun = time.process_time()
        assert diagnose(record, noise_bound=SIGMA).verdict == "consistent"
        seconds.append(time.process_time() - begun)
    with capsys.disabled():
        print(f"\nconsistent positions: {np.round(seconds, 2)} s of processor")
    cost_row("growth", "`diagnose`, 1,000 positions, no effect", *growth(seconds[0], seconds[1]))
    assert seconds[1] < MOST_GROWTH * seconds[0]


def carried_record(rows: int, sensitivity: float) -> StrapdownRecord:
    """Return moves between drawn poses; one gyro may feel the force along another axis [rad/s/g]."""
    rng = np.random.default_rng(0)
    poses = [POSES[0]]
    while len(poses) < rows / 450 + 1:
        apart = [pose for pose in POSES if abs(pose @ poses[-1]) < 0.95]
        poses.append(apart[rng.integers(len(apart))])
    matrix = np.zeros((3, 3))
    matrix[1, 0] = sensitivity
    return strapdown_record(true_motion(np.array(poses)), sensitivity=matrix)


@pytest.mark.parametrize("sensitivity", [0.0, 3e-3], ids=["consistent", "one effect"])
def test_a_strapdown_record_of_ten_times_as_many_rows(sensitivity: float, capsys, cost_row):
    diagnose(carried_record(10_000, sensitivity))
    for what in (diagnose, th.calibrate):
        seconds, verdicts = [], []
        for rows in (50_000, 500_000):
            record = carried_record(rows, sensitivity)
            begun = time.process_time()
            verdicts.append(what(record).verdict)
            seconds.append(time.process_time() - begun)
        with capsys.disabled():
            print(
                f"\n{what.__name__}, 50,000 and 500,000 rows: {np.round(seconds, 1)} s of processor "
                f"({seconds[1] / seconds[0]:.1f} times), {' and '.join(verdicts)}"
            )
        effects = "one effect" if sensitivity else "no effect"
        cost_row("growth", f"`{what.__name__}`, 500,000 strapdown rows, {effects}", *growth(*seconds))
        assert seconds[1] <= MOST_GROWTH_OF_ROWS * seconds[0]
