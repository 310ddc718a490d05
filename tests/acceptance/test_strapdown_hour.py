"""A strapdown record of an hour at 1 kHz: two minutes of one processor, two gigabytes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

SECONDS, GIGABYTES = 120.0, 2.0
TESTS = Path(__file__).parents[1]
PROGRAM = """
import json, pathlib, resource, sys
from trihedron.tools.cli import main
status = main(["diagnose", sys.argv[1], "--json", sys.argv[2]])
used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
seconds = sum(u.ru_utime + u.ru_stime for u in used)
# resource counts the largest size of the process that started this one
peak = next(line for line in pathlib.Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
print(json.dumps({"status": status, "seconds": seconds, "bytes": 1024 * int(peak.split()[1])}))
"""


@pytest.mark.acceptance
def test_an_hour_at_a_kilohertz_is_diagnosed_in_two_minutes_and_two_gigabytes(tmp_path):
    """Diagnose from the CSV file, with an effect that is named and simulated again."""
    sys.path.insert(0, str(TESTS))
    from generator.carried import POSES, strapdown_record, true_motion

    rng = np.random.default_rng(0)
    poses = [POSES[0]]
    while len(poses) < 801:
        apart = [pose for pose in POSES if abs(pose @ poses[-1]) < 0.95]
        poses.append(apart[rng.integers(len(apart))])
    sensitivity = np.zeros((3, 3))
    sensitivity[1, 0] = 1e-3
    record = strapdown_record(true_motion(np.array(poses), period=1e-3), sensitivity=sensitivity)
    assert record.rate is not None
    columns = {"time_s": np.round(record.time_s, 6)}
    columns |= {f"w{p + 1}_radps": np.round(record.rate[:, p], 8) for p in range(3)}
    columns |= {f"f{p + 1}_mps2": np.round(record.specific_force[:, p], 7) for p in range(3)}
    path, out = tmp_path / "hour.csv", tmp_path / "hour.json"
    pl.DataFrame(columns).write_csv(path)
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path), str(out)], capture_output=True, text=True, check=True
    )
    peak = json.loads(process.stdout.strip().split("\n")[-1])
    result = json.loads(out.read_text(encoding="utf-8"))
    print(f"\nan hour at 1 kHz: {peak['seconds']:.0f} s of a processor, {peak['bytes'] / 1e9:.2f} GB")
    assert peak["status"] == 0
    assert result["verdict"] == "explained"
    assert [cause["effect"] for cause in result["causes"]] == ["gyro-g-sensitivity"]
    assert result["gain"]["held_out_rms_after"] < result["gain"]["held_out_rms_before"]
    assert peak["bytes"] < GIGABYTES * 1e9
    assert peak["seconds"] < SECONDS
