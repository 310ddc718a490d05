"""Campaigns are carried out whole, in any order, whatever dies; their bytes do not tell who computed what."""

import hashlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from campaign_runs import CALIBRATION, MOST_SECONDS, assert_begun, content, dies_of_three, workers_of, written
from trihedron.tools import cli
from trihedron.tools.campaign import runs
from trihedron.tools.campaign.kinds import CalibrationRuns, Given
from trihedron.tools.campaign.runs import KILLED, run_campaign
from trihedron.tools.campaign.store import LOCK
from trihedron.tools.errors import InputError
from trihedron.tools.workers import AHEAD, Killed, completed, started


class ScriptedWorkers:
    """Workers in this process; calls are made when their result is asked for, in random order.

    Parameters
    ----------
    fate : callable
        (name of the function, partition or run) -> whether the worker dies of it
    """

    def __init__(self) -> None:
        self.fate: Callable[[str, Any], bool] = lambda *_: False
        self.kills, self.calls = 0, []
        self.most = 0
        self._what: dict[Future, partial] = {}

    def count(self) -> int:
        return 3

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        future: Future = Future()
        future.set_result(None)
        self._what[future] = partial(function, *arguments)
        self.most = max(self.most, len(self._what))
        return future

    def result(self, future: Future) -> Any:
        call = self._what.pop(future)
        name = getattr(call.func, "__name__", "")
        if not call.args:
            return call()
        self.calls.append((name, call.args[-1]))
        if self.fate(name, call.args[-1]):
            self.kills += 1
            raise Killed
        return call()


def use(scripted: ScriptedWorkers, monkeypatch: pytest.MonkeyPatch) -> ScriptedWorkers:
    """Have campaigns get these workers, whatever they ask for."""
    order = random.Random(0)

    @contextmanager
    def given(**_: object) -> Iterator[ScriptedWorkers]:
        yield scripted

    class Shuffled:
        def __init__(self, futures: Any, **_: object) -> None:
            self.done = order.sample(list(futures), len(futures))

    monkeypatch.setattr(runs, "started", given)
    monkeypatch.setattr("trihedron.tools.workers.wait", Shuffled)
    return scripted


@pytest.fixture(scope="module", autouse=True)
def _each_calibration_once() -> Iterator[None]:
    """What a run gives depends on the campaign's text, its values and its seed alone: who makes it is tested here."""
    run, known = CalibrationRuns.run, {}

    def once(self: CalibrationRuns, number: int, values: Any, seed: np.random.SeedSequence) -> Given:
        what = (self.setting.model_dump_json(), number, tuple(values.items()), seed.entropy, seed.spawn_key)
        if what not in known:
            known[what] = run(self, number, values, seed)
        return known[what]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(CalibrationRuns, "run", once)
        yield


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of the campaign, computed by this process alone."""
    folder = tmp_path_factory.mktemp("unbroken")
    with pytest.MonkeyPatch.context() as patched:
        use(ScriptedWorkers(), patched)
        run_campaign(written(folder, CALIBRATION), folder / "out")
    return content(folder / "out")


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> ScriptedWorkers:
    """The workers that campaigns of the test get."""
    return use(ScriptedWorkers(), monkeypatch)


@pytest.mark.acceptance
def test_several_processes_give_the_bytes_of_one(tmp_path, unbroken):
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", jobs=2)
    assert (done.runs, done.failed) == (14, 0)
    assert done.cost is not None
    assert done.cost.runs == 14
    assert content(tmp_path / "out") == unbroken


def test_few_calls_are_under_way_and_a_lost_one_is_made_again(tmp_path, unbroken, workers):
    died: Counter[int] = Counter()

    def once(name, what):
        died[what] += what in (1, 4)
        return died[what] == 1

    workers.fate = once
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    assert done.cost is not None
    assert done.cost.kills == 2
    assert workers.most <= AHEAD * workers.count()
    assert content(tmp_path / "out") == unbroken


def test_a_run_that_no_process_survives_is_recorded_and_the_rest_goes_on(tmp_path, unbroken, workers):
    def deadly(name, what):
        return what == 6 if name == "try_run" else what == 3 and workers.calls.count(("try_run", 6)) < 2

    workers.fate = deadly
    assert run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out").failed == 1
    found = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert found.filter(pl.col("failed").is_not_null()).select("run", "failed").rows() == [(6, KILLED)]
    # Every other file is that of the unbroken campaign.
    other = content(tmp_path / "out")
    changed = {name for name in unbroken if other[name] != unbroken[name]}
    assert changed == {"runs/part-00003.parquet", "summary.json", "SHA256SUMS"}


def test_a_file_that_dies_by_chance_is_not_blamed_on_its_runs(tmp_path, unbroken, workers):
    left = [4]

    def unlucky(name, what):
        left[0] -= (bad := name == "compute" and what == 2 and left[0] > 0)
        return bad

    workers.fate = unlucky
    assert run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out").failed == 0
    assert content(tmp_path / "out") == unbroken


def test_an_interrupted_campaign_is_whole_and_goes_on(tmp_path, unbroken, workers, capsys):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"

    def struck(name, what):
        if len(workers.calls) == 4:
            raise KeyboardInterrupt
        return False

    workers.fate = struck
    assert cli.main(["campaign", str(path), "--out", str(out)]) == 130
    said = capsys.readouterr().err
    assert "interrupted; " in said
    assert "--resume goes on" in said
    there = content(out)
    assert len([name for name in there if name.startswith("runs/")]) == 3
    assert there["SHA256SUMS"].count(b"\n") == 4
    assert_begun(there, unbroken)
    workers.fate = lambda *_: False
    workers.calls.clear()
    assert cli.main(["campaign", str(path), "--out", str(out), "--resume"]) == 0
    assert "14 runs, 0 failed" in capsys.readouterr().out
    there = content(out)
    assert there.pop("index.html")
    assert there == unbroken
    assert len(workers.calls) == 4


def test_a_damaged_file_is_computed_again(tmp_path, unbroken, workers):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out)
    damaged = out / "runs" / "part-00002.parquet"
    damaged.write_bytes(damaged.read_bytes()[:100])
    (out / "runs" / "part-00004.parquet").write_bytes(b"")
    (out / "runs" / ".part-00005-xyz.parquet").write_bytes(b"half")
    done = run_campaign(path, out, resume=True)
    assert done.cost is not None
    assert done.cost.runs == 4
    assert str(done.cost).endswith("; 2 damaged files were made again")
    assert content(out) == unbroken


@pytest.mark.parametrize("name", ["runs/part-00002.parquet", "campaign.json", "SHA256SUMS"])
def test_one_flipped_bit_is_noticed_and_mended(name, tmp_path, unbroken, workers, capsys):
    """In a value of a partition, in the manifest, and in a digest itself, of a partition's."""
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out)
    data = bytearray((out / name).read_bytes())
    place = data.index(b"runs/") - 10 if name == "SHA256SUMS" else len(data) // 3
    data[place] ^= 1
    (out / name).write_bytes(data)
    assert cli.main(["campaign-report", str(out)]) == 2
    said = capsys.readouterr().err
    assert "is damaged: it is not what was written" in said
    assert "--resume" in said
    assert cli.main(["campaign", str(path), "--out", str(out), "--resume"]) == 0
    assert ("1 damaged file was made again" in capsys.readouterr().out) == (name != "campaign.json")
    there = content(out)
    assert there.pop("index.html")
    assert there == unbroken


def test_digests_are_as_other_programs_check_them(unbroken, tmp_path, workers):
    run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    lines = (tmp_path / "out" / "SHA256SUMS").read_text().splitlines()
    assert len(lines) == 1 + len([name for name in unbroken if name.startswith(("runs/", "records/"))])
    for line in lines:
        digest, _, name = line.partition("  ")
        assert hashlib.sha256((tmp_path / "out" / name).read_bytes()).hexdigest() == digest


def test_a_folder_with_results_is_not_written_over_or_mixed(tmp_path, workers, capsys):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    assert cli.main(["campaign", str(path), "--out", str(out)]) == 0
    before = content(out)
    assert cli.main(["campaign", str(path), "--out", str(out)]) == 2
    assert "holds a campaign already; --resume goes on with it" in capsys.readouterr().err
    path.write_text(CALIBRATION.replace("points = 7", "points = 8"), encoding="utf-8")
    assert cli.main(["campaign", str(path), "--out", str(out), "--resume"]) == 2
    said = capsys.readouterr().err
    assert "campaign.toml is another one than when it was begun; results would be mixed" in said
    assert said.count("\n") == 1
    assert content(out) == before


def test_results_and_workers_of_other_code_are_refused(tmp_path, workers, monkeypatch):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out)
    with monkeypatch.context() as patched:
        patched.setattr("trihedron.tools.campaign.store.code_hash", lambda: "other")
        with pytest.raises(InputError, match="is another version than when it was begun"):
            run_campaign(path, out, resume=True)
    monkeypatch.setattr("trihedron.tools.campaign.store.code_hash", lambda: "of this process")
    monkeypatch.setattr("trihedron.tools.campaign.runs.code_hash", lambda: "of a worker")
    with pytest.raises(InputError, match="a worker has another version of Trihedron"):
        run_campaign(path, tmp_path / "another")


def test_two_processes_do_not_work_in_one_folder(tmp_path, workers):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    first = []

    def another_resumes(*_):
        """While the first one works."""
        if not first:
            first.append((out / LOCK).stat().st_ino)
            with pytest.raises(InputError, match=f"^--out {re.escape(str(out))}: another process works there$"):
                run_campaign(path, out, resume=True)
        return False

    workers.fate = another_resumes
    run_campaign(path, out)
    # Who waits at a file that is taken away holds the lock of nothing.
    run_campaign(path, out, resume=True)
    assert first == [(out / LOCK).stat().st_ino]


def test_a_full_disk_leaves_whole_files_and_the_campaign_goes_on(tmp_path, unbroken, workers, monkeypatch, capsys):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    write_bytes = Path.write_bytes
    left = [3]

    def full(self, data):
        if self.name.startswith(".part-"):
            left[0] -= 1
            if left[0] < 0:
                write_bytes(self, data[: len(data) // 2])
                raise OSError(28, "No space left on device", str(self))
        return write_bytes(self, data)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        assert cli.main(["campaign", str(path), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "No space left on device" in said
    assert "--resume goes on" in said
    assert len(list((out / "runs").iterdir())) == 3
    assert_begun(content(out), unbroken)
    run_campaign(path, out, resume=True)
    assert content(out) == unbroken


def test_failing_runs_are_recorded_with_their_message(tmp_path, workers, monkeypatch):
    run = CalibrationRuns.run

    def failing(self, number, values, seed):
        if number == 7:
            raise InputError("the 7th\nis bad")
        if number == 8:
            raise ZeroDivisionError("by nought")
        return run(self, number, values, seed)

    monkeypatch.setattr(CalibrationRuns, "run", failing)
    assert run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out").failed == 2
    found = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert found["failed"][7:9].to_list() == ["the 7th is bad", "ZeroDivisionError: by nought"]
    assert found["run"].to_list() == list(range(14))
    assert found["radius"].null_count() == 2
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert {"message": "the 7th is bad", "runs": 1, "first_run": 7} in summary["failures"]


@pytest.mark.parametrize(
    ("engine", "jobs", "scheduler", "message"),
    [
        ("local", 0, None, "--jobs 0"),
        ("local", None, "tcp://nowhere:1", "--scheduler: goes with --engine dask"),
        ("dask", 2, "tcp://127.0.0.1:9", "one of the two"),
        ("dsk", 1, None, "engine 'dsk' is not known; did you mean 'dask'"),
    ],
)
def test_workers_that_there_cannot_be_are_refused(engine, jobs, scheduler, message):
    with pytest.raises(InputError) as caught, started(engine, jobs, scheduler):
        pass
    assert message in str(caught.value)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("engine", ["local", pytest.param("dask", marks=pytest.mark.acceptance)])
def test_a_deadly_call_is_named_and_the_others_are_made(engine):
    if engine == "dask":
        pytest.importorskip("distributed")
    with started(engine, 2) as workers:
        found = dict(completed(workers, dies_of_three, range(5), instead=lambda number: -number))
        assert found == {0: 0, 1: 1, 2: 4, 3: -3, 4: 16}
        assert workers.kills > 0


def test_what_is_interrupted_while_a_call_is_handed_out_ends_without_a_traceback(capfd, monkeypatch):
    """Loky had the call's number when Ctrl-C came, and no longer the call when it ended."""
    monkeypatch.setattr(threading, "excepthook", threading.__excepthook__)

    def interrupted() -> None:
        with started("local", 1) as workers:
            workers.submit(os.getpid).result()
            workers.pool._work_ids.put(99)  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capfd.readouterr().err == ""
    assert threading.excepthook is threading.__excepthook__


def test_a_call_that_no_process_survives_is_said_where_nothing_stands_for_it(workers):
    workers.fate = lambda name, what: what == 3
    with pytest.raises(Killed, match="given 3"):
        dict(completed(workers, abs, range(5)))
    assert workers.calls.count(("abs", 3)) == 4


@pytest.mark.acceptance
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_main_process_that_is_killed_leaves_no_workers_and_can_go_on(tmp_path, unbroken, workers):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    command = [sys.executable, "-m", "trihedron.tools.cli", "campaign", str(path), "--out", str(out), "--jobs", "2"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as main:
        deadline = time.monotonic() + MOST_SECONDS
        while not list(out.glob("runs/part-*.parquet")):
            assert main.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        below = workers_of(main.pid)
        main.send_signal(signal.SIGKILL)
    assert below
    while any(Path(f"/proc/{pid}").exists() for pid in below):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert_begun(content(out), unbroken)
    run_campaign(path, out, resume=True)
    assert content(out) == unbroken
