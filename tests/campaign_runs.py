"""Campaigns for the tests: small files, folders as bytes, the processes of a campaign."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

MOST_SECONDS = 300.0

CALIBRATION = """
schema = "trihedron.campaign/1"
seed = 3
partition = 2
[calibration]
[sampling]
method = "latin-hypercube"
points = 7
[parameters]
kappa = { uniform = [-3e-3, 3e-3] }
noise_part = { values = [0.5, 1.0] }
[keep]
scalars = ["verdict", "radius", "misses", "X4_error", "X4_guaranteed"]
[[compute]]
quantiles = ["radius"]
[[compute]]
rate = "verdict"
is = ["falsified"]
"""
"""Fourteen calibrations in seven files."""
PARTS = (
    *("make_order", "opened", "missing", "compute", "write", "summarise", "write_summary"),
    *("campaign_page", "write_page"),
)
"""Functions of the main process that mark the progress of a campaign."""


def written(folder: Path, text: str, name: str = "campaign.toml") -> Path:
    """Write a campaign file into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def content(folder: Path) -> dict[str, bytes]:
    """Return every file of a campaign's folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_begun(present: dict[str, bytes], unbroken: dict[str, bytes]) -> None:
    """Assert that every file in a campaign's folder is that of the whole campaign, except for half files (.*)."""
    assert all(unbroken[name] == value for name, value in present.items() if name.rpartition("/")[2][0] != ".")


def children(pid: int) -> list[int]:
    """Return the child processes of a process."""
    pids = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            words = path.read_text().rpartition(")")[2].split()
            if int(words[1]) == pid:
                pids.append(int(path.parent.name))
    return pids


def workers_of(pid: int) -> list[int]:
    """Return the working processes below a process, at any depth (without the trackers of resources)."""
    below = [child for pid_below in children(pid) for child in (pid_below, *workers_of(pid_below))]
    return [pid_below for pid_below in below if b"resource_tracker" not in command_of(pid_below)]


def command_of(pid: int) -> bytes:
    """Return the command line of a process; empty if it is gone."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def wait_for(what: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + MOST_SECONDS
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@contextlib.contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[subprocess.Popen[Any], str]]:
    """Yield the scheduler and its address, with workers as processes of their own."""
    folder.mkdir(exist_ok=True)
    scheduler_file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with contextlib.ExitStack() as stack:
        words = ["--port", "0", "--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(scheduler_file)]
        scheduler = stack.enter_context(ended(subprocess.Popen([*dask, *words], **quiet)))
        wait_for(scheduler_file.exists)
        address = re.findall(r"tcp://[\d.:]+", scheduler_file.read_text())[0]
        for _ in range(workers):
            worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
            stack.enter_context(ended(subprocess.Popen([*worker, "--death-timeout", "120"], cwd=folder, **quiet)))
        yield scheduler, address


@contextlib.contextmanager
def ended(process: subprocess.Popen[Any]) -> Iterator[subprocess.Popen[Any]]:
    """End a process, with those below it, when the block ends."""
    try:
        yield process
    finally:
        below = workers_of(process.pid)
        process.kill()
        process.wait()
        for pid in below:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
