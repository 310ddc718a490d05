"""A day at 1 kHz in bounded memory."""

import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

DAY = """
import resource
import sys
import time
from pathlib import Path
from trihedron.tools.orchestrator import run_scenario
from trihedron.tools.orchestrator.scenario import Scenario

def run(steps, out):
    began = time.perf_counter()
    run_scenario(Scenario.model_validate({
        "run": {"stop_s": steps * 1e-3, "step_s": 1e-3},
        "fmus": {"block": {"component": "AccelerometerBlock"}},
        "stimuli": [{"to": "block.specific_force", "constant": [0.0, 0.0, 9.8]}],
        "record": {"columns": {"f1_mps2": "block.reading[1]", "f3_mps2": "block.reading[3]"}},
    }), out)
    return time.perf_counter() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

run(20_000_000, Path(sys.argv[1]) / "short")
seconds, before = run(20_000_000, Path(sys.argv[1]) / "short")
seconds, after = run(int(sys.argv[2]), Path(sys.argv[1]) / "long")
print(seconds, before, after)
"""


@pytest.mark.acceptance
def test_a_day_at_1_khz_needs_no_more_memory_than_a_quarter_of_it(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    steps = 86_400_000
    process = subprocess.run(
        [sys.executable, "-c", DAY, tmp_path, str(steps)], capture_output=True, text=True, check=True
    )
    seconds, before, after = (float(word) for word in process.stdout.split())
    print(
        f"\n{steps} steps in {seconds:.0f} s; memory {before:.0f} MB after 20 million steps, {after:.0f} MB after all"
    )
    assert after < before + 150.0
    rows = pl.scan_parquet(tmp_path / "long" / "run.parquet")
    assert rows.select(pl.len()).collect().item() == steps + 1
    assert rows.select(pl.col("time_s").max()).collect().item() == pytest.approx(86_400.0, rel=1e-12)
