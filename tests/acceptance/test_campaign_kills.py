"""Campaigns whose workers, scheduler or main process are killed at random moments."""

import contextlib
import os
import random
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from campaign_runs import (
    CALIBRATION,
    MOST_SECONDS,
    assert_begun,
    cluster,
    command_of,
    content,
    wait_for,
    workers_of,
    written,
)
from trihedron.tools.library import run_campaign

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")]
LONGER = CALIBRATION.replace("points = 7", "points = 60")
"""A hundred and twenty calibrations in sixty files."""


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the files of the campaign, computed by one undisturbed process."""
    folder = tmp_path_factory.mktemp("unbroken")
    run_campaign(written(folder, LONGER), folder / "out", jobs=1)
    return content(folder / "out")


def started(path: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "trihedron.tools.cli", "campaign", str(path), "--out", str(out), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def files_done(out: Path) -> int:
    return len(list(out.glob("runs/part-*.parquet")))


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_a_worker_that_is_killed_costs_no_run_that_is_stored(tmp_path, unbroken, engine):
    """Loky ends the campaign with one line; Dask gives the worker's files to another one."""
    if engine == "dask":
        pytest.importorskip("distributed")
    path, out = written(tmp_path, LONGER), tmp_path / "out"
    main = started(path, out, "--engine", engine, "--jobs", "2")
    wait_for(lambda: files_done(out) > 5 or main.poll() is not None)
    os.kill(next(pid for pid in workers_of(main.pid) if engine == "local" or b"spawn_main" in command_of(pid)), 9)
    _, complaints = main.communicate(timeout=MOST_SECONDS)
    if main.returncode:
        assert re.fullmatch(
            r"trihedron: --jobs: a worker .*; \d+ of 120 runs are in \S+; continue with --resume\n", complaints
        )
        assert engine == "local"
    else:
        assert re.fullmatch(r"a worker of the cluster was lost \(\S+\): its work is done again\n", complaints)
    assert_begun(content(out), unbroken)
    run_campaign(path, out, jobs=2, resume=True)
    assert content(out) == unbroken


def test_the_main_process_killed_at_random_moments(tmp_path, unbroken):
    rng = random.Random(2)
    path, out = written(tmp_path, LONGER), tmp_path / "out"
    kills = 0
    while True:
        before = files_done(out)
        main = started(path, out, "--jobs", "2", "--resume")
        wait_for(lambda m=main, b=before: m.poll() is not None or files_done(out) > b)
        with contextlib.suppress(subprocess.TimeoutExpired):
            main.wait(rng.uniform(0.0, 3.0))
        if main.poll() is not None:
            break
        main.kill()
        # Workers hold the pipe: it ends only when they end with their main process.
        main.communicate(timeout=60.0)
        kills += 1
    _, complaints = main.communicate()
    assert main.returncode == 0, complaints
    print(f"main process killed {kills} times", file=sys.stderr)
    assert kills > 0
    assert content(out) == unbroken


def test_ctrl_c_leaves_a_whole_folder(tmp_path, unbroken):
    path, out = written(tmp_path, LONGER), tmp_path / "out"
    main = started(path, out, "--jobs", "2")
    wait_for(lambda: files_done(out) > 5)
    workers = workers_of(main.pid)
    main.send_signal(signal.SIGINT)
    _, complaints = main.communicate(timeout=30.0)
    assert main.returncode == 130
    assert re.fullmatch(r"trihedron: interrupted; \d+ of 120 runs are in \S+; continue with --resume\n", complaints)
    wait_for(lambda: not any(command_of(pid) for pid in workers))
    present = content(out)
    assert_begun(present, unbroken)
    run_campaign(path, out, jobs=2, resume=True)
    assert content(out) == unbroken


def test_a_dask_cluster_of_three_local_workers_gives_the_same_bytes(tmp_path, unbroken):
    pytest.importorskip("distributed")
    path, out = written(tmp_path, LONGER), tmp_path / "out"
    main = started(path, out, "--engine", "dask", "--jobs", "3")
    _, complaints = main.communicate(timeout=MOST_SECONDS)
    assert main.returncode == 0, complaints
    assert complaints == ""
    assert content(out) == unbroken


def test_a_scheduler_that_is_killed_ends_the_campaign_in_one_line_and_it_goes_on_elsewhere(tmp_path, unbroken):
    pytest.importorskip("distributed")
    path, out = written(tmp_path, LONGER), tmp_path / "out"
    with cluster(tmp_path, 2) as (scheduler, address):
        main = started(path, out, "--engine", "dask", "--scheduler", address)
        wait_for(lambda: files_done(out) > 5 or main.poll() is not None)
        assert main.poll() is None
        scheduler.kill()
        _, complaints = main.communicate(timeout=60.0)
    assert main.returncode == 2
    assert re.fullmatch(r"trihedron: --scheduler: .*; \d+ of 120 runs are in \S+; continue with --resume\n", complaints)
    assert_begun(content(out), unbroken)
    with cluster(tmp_path / "again", 2) as (_, address):
        main = started(path, out, "--engine", "dask", "--scheduler", address, "--resume")
        _, complaints = main.communicate(timeout=MOST_SECONDS)
    assert main.returncode == 0, complaints
    assert content(out) == unbroken


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_a_disk_that_is_full(tmp_path, unbroken, engine):
    if engine == "dask":
        pytest.importorskip("distributed")
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=160k", "tmpfs", str(small)], capture_output=True)
    if mounted.returncode:
        pytest.skip("a small file system cannot be mounted here")
    path, out = written(tmp_path, LONGER), small / "out"
    try:
        main = started(path, out, "--jobs", "2", "--engine", engine)
        _, complaints = main.communicate(timeout=MOST_SECONDS)
        assert main.returncode == 2
        assert "No space left on device" in complaints
        assert "continue with --resume" in complaints
        assert complaints.count("\n") == 1
        present = content(out)
        assert 0 < files_done(out) < 60
        assert_begun(present, unbroken)
        subprocess.run(["mount", "-o", "remount,size=8m", str(small)], check=True)
        main = started(path, out, "--jobs", "2", "--engine", engine, "--resume")
        _, complaints = main.communicate(timeout=MOST_SECONDS)
        assert main.returncode == 0, complaints
        assert content(out) == unbroken
    finally:
        subprocess.run(["umount", "-l", str(small)], check=False)
