"""Two workers against one, side by side under the same load of the machine."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from trihedron.tools.workers import usable_cores

pytestmark = pytest.mark.benchmark_ratio
FILES = 40
CAMPAIGN = f"""
schema = "trihedron.campaign/1"
partition = 5
repeats = {5 * FILES}
[calibration]
"""


@pytest.mark.skipif(usable_cores() < 2, reason="two workers need two cores")
def test_two_workers_do_nearly_twice_the_work_of_one(tmp_path):
    """Run static calibrations, from the first files of both to the end of the faster one; at least 0.85 of linear."""
    (tmp_path / "c.toml").write_text(CAMPAIGN, encoding="utf-8")
    command = [sys.executable, "-m", "trihedron.tools.cli", "campaign", str(tmp_path / "c.toml")]
    alone, pair = tmp_path / "alone", tmp_path / "both"
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    started = [
        subprocess.Popen(
            [*command, "--jobs", jobs, "--out", str(out)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
        for jobs, out in (("1", alone), ("2", pair))
    ]
    try:
        while done(alone) < 1 or done(pair) < 2:
            assert all(process.poll() is None for process in started)
            time.sleep(0.05)
        before = done(alone), done(pair)
        # At the end one of the two workers is idle.
        while done(pair) < FILES - 2:
            time.sleep(0.05)
        ratio = (done(pair) - before[1]) / (done(alone) - before[0])
    finally:
        for process in started:
            process.kill()
            process.wait()
    print(f"two workers make {ratio:.2f} times as many files as one")
    assert ratio >= 2.0 * 0.85


def done(folder: Path) -> int:
    """Return the number of stored files."""
    return len(list(folder.glob("runs/part-*.parquet")))
