"""Two workers against one, side by side under the same load of the machine."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from generator.lots import write_lot
from trihedron.tools.workers import usable_cores

pytestmark = pytest.mark.benchmark_ratio
FILES = 40
CAMPAIGN = f"""
schema = "trihedron.campaign/1"
partition = 5
repeats = {5 * FILES}
[calibration]
"""
MOST_OF_DASK = 1.2
"""Most time of 80 calibrations by `--engine dask` over that of Dask's own calls of the same function."""
OWN_CALLS = """
import sys
from pathlib import Path
from trihedron.tools.batch.jobs import jobs_of
from trihedron.tools.batch.work import worked
from trihedron.tools.workers import made

def main(engine, table):
    jobs = jobs_of([Path(table)], "calibrate", {"noise_bound": 1e-5})
    if engine == "dask":
        assert len(list(made(worked, jobs, engine="dask", jobs=2))) == 80
        return
    from distributed import Client, LocalCluster
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        assert len(client.gather(client.map(worked, jobs, pure=False))) == 80

if __name__ == "__main__":
    main(*sys.argv[1:])
"""
"""A batch's command also writes its page, which no engine does; so the calls are compared, not commands."""


@pytest.mark.skipif(usable_cores() < 2, reason="two workers need two cores")
def test_two_workers_do_nearly_twice_the_work_of_one(tmp_path, cost_row):
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
    cost_row("engines", "two workers over one", f"{ratio:.2f}")
    assert ratio >= 2.0 * 0.85


def test_eighty_calibrations_by_dask_against_its_own_calls(tmp_path, capsys, cost_row):
    pytest.importorskip("distributed")
    table = write_lot(tmp_path / "records", 80, 1, positions=12)
    program = tmp_path / "calls.py"
    program.write_text(OWN_CALLS, encoding="utf-8")
    seconds: dict[str, list[float]] = {"dask": [], "calls": []}
    for _ in range(3):
        for engine, times in seconds.items():
            times.append(processor_seconds(str(program), engine, str(table)))
    ours, own = min(seconds["dask"]), min(seconds["calls"])
    with capsys.disabled():
        print(f"\n80 calibrations by Dask: {ours:.1f} s of processor, by its own calls {own:.1f} s ({ours / own:.2f})")
    cost_row("engines", "`--engine dask` over Dask's own calls", f"{ours / own:.2f}")
    assert ours < MOST_OF_DASK * own


def processor_seconds(*arguments: str) -> float:
    """Return the processor time of Python with these arguments and of all processes that it starts."""
    before = os.times()
    subprocess.run([sys.executable, *arguments], check=True, stderr=subprocess.DEVNULL)
    after = os.times()
    return after.children_user - before.children_user + after.children_system - before.children_system


def done(folder: Path) -> int:
    """Return the number of stored files."""
    return len(list(folder.glob("runs/part-*.parquet")))
