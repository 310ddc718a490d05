"""Campaigns are carried out whole, in any order, whatever dies; their bytes do not tell who computed what."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl
import pytest

from campaign_runs import CALIBRATION, ScriptedEngine, content, written
from trihedron.tools import cli
from trihedron.tools.campaign import campaign as campaigns
from trihedron.tools.campaign.campaign import run_campaign
from trihedron.tools.campaign.execution import Batches
from trihedron.tools.campaign.work import KILLED
from trihedron.tools.errors import InputError


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of the campaign, computed by one process."""
    folder = tmp_path_factory.mktemp("unbroken")
    run_campaign(written(folder, CALIBRATION), folder / "out", jobs=1)
    return content(folder / "out")


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> ScriptedEngine:
    """The engine that campaigns of the test get, whatever they ask for."""
    scripted = ScriptedEngine()

    @contextmanager
    def given(*_: object) -> Iterator[ScriptedEngine]:
        yield scripted

    monkeypatch.setattr(campaigns, "engine_of", given)

    def done(futures, _seconds):
        scripted.finish()
        return [future for future in futures if future.done()]

    monkeypatch.setattr("trihedron.tools.campaign.execution.first_done", done)
    return scripted


def test_two_processes_give_the_bytes_of_one(tmp_path, unbroken):
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", jobs=2)
    assert done.runs == done.computed == 14
    assert done.failures == 0
    assert content(tmp_path / "out") == unbroken


def test_a_dask_cluster_of_three_workers_gives_the_bytes_of_one_process(tmp_path, unbroken):
    pytest.importorskip("distributed")
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", engine="dask", jobs=3)
    assert done.computed == 14
    assert content(tmp_path / "out") == unbroken


@pytest.mark.parametrize("seed", range(2))
def test_any_order_of_completion_gives_the_same_bytes(tmp_path, unbroken, engine, seed):
    engine.__init__(size=4, seed=seed)
    run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    assert content(tmp_path / "out") == unbroken


def test_batches_of_killed_workers_are_run_again(tmp_path, unbroken, engine):
    died: Counter[int] = Counter()

    def once(name, what):
        if name == "compute" and what[0] in (1, 4) and not died[what[0]]:
            died[what[0]] += 1
            return True
        return False

    engine.fate = once
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    assert done.tally.kills == 2
    assert content(tmp_path / "out") == unbroken


def test_a_run_that_no_process_survives_is_recorded_and_the_rest_goes_on(tmp_path, unbroken, engine):
    def deadly(name, what):
        if name == "try_run":
            return what == 6
        fatal = engine.calls.count(("try_run", 6)) >= 2
        return 3 in what and not fatal

    engine.fate = deadly
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    assert done.failures == 1
    found = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert found.filter(pl.col("failed").is_not_null())["run"].to_list() == [6]
    assert found["failed"][6] == KILLED
    # Every other file is that of the unbroken campaign.
    other = content(tmp_path / "out")
    changed = {name for name in unbroken if other[name] != unbroken[name]}
    assert changed == {"runs/part-00003.parquet", "summary.json", "index.html"}


def test_a_partition_that_dies_by_chance_is_not_blamed_on_its_runs(tmp_path, unbroken, engine):
    left = [4]

    def unlucky(name, what):
        if name == "compute" and 2 in what and left[0]:
            left[0] -= 1
            return True
        return False

    engine.fate = unlucky
    assert run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out").failures == 0
    assert content(tmp_path / "out") == unbroken


def test_an_interrupted_campaign_is_whole_and_goes_on(tmp_path, unbroken, engine, capsys):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"

    def struck(name, what):
        if 5 in what:
            raise KeyboardInterrupt
        return False

    engine.fate = struck
    assert cli.main(["campaign", str(path), "--out", str(out)]) == 130
    said = capsys.readouterr().err
    assert "interrupted; " in said
    assert "--resume goes on" in said
    there = content(out)
    assert 0 < len([name for name in there if name.startswith("runs/")]) < 7
    assert all(unbroken[name] == there[name] for name in there)
    engine.fate = lambda *_: False
    engine.calls.clear()
    assert cli.main(["campaign", str(path), "--out", str(out), "--resume"]) == 0
    assert "14 runs, 0 failed" in capsys.readouterr().out
    assert content(out) == unbroken
    assert sum(len(what) for _, what in engine.calls) == 7 - len([name for name in there if name.startswith("runs/")])


def test_a_damaged_file_is_computed_again(tmp_path, unbroken, engine):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out)
    damaged = out / "runs" / "part-00002.parquet"
    damaged.write_bytes(damaged.read_bytes()[:100])
    (out / "runs" / "part-00004.parquet").write_bytes(b"")
    (out / "runs" / ".part-00005-xyz.parquet").write_bytes(b"half")
    assert run_campaign(path, out, resume=True).computed == 4
    assert content(out) == unbroken


def test_a_folder_with_results_is_not_written_over_or_mixed(tmp_path, engine, capsys):
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


def test_results_of_other_code_are_not_mixed(tmp_path, engine, monkeypatch):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out)
    monkeypatch.setattr("trihedron.tools.campaign.order.code_hash", lambda: "other")
    with pytest.raises(InputError, match="is another version than when it was begun"):
        run_campaign(path, out, resume=True)


def test_a_worker_with_other_code_is_refused(tmp_path, engine, monkeypatch):
    monkeypatch.setattr("trihedron.tools.campaign.work.code_hash", lambda: "other")
    with pytest.raises(InputError, match="a worker has another version of Trihedron"):
        run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")


def test_two_processes_do_not_work_in_one_folder(tmp_path, engine):
    fcntl = pytest.importorskip("fcntl")
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    out.mkdir()
    with (out / ".lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="another process works there"):
            run_campaign(path, out)


def test_a_full_disk_leaves_whole_files_and_the_campaign_goes_on(tmp_path, unbroken, engine, monkeypatch, capsys):
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
    assert sorted(p.name for p in (out / "runs").iterdir()) != []
    assert all(unbroken[name] == value for name, value in content(out).items())
    run_campaign(path, out, resume=True)
    assert content(out) == unbroken


def test_failing_runs_are_recorded_with_their_message(tmp_path, engine, monkeypatch):
    from trihedron.tools.campaign.calibration_runs import CalibrationRuns

    run = CalibrationRuns.run

    def failing(self, number, values, seed):
        if number == 7:
            raise InputError("the 7th\nis bad")
        if number == 8:
            raise ZeroDivisionError("by nought")
        return run(self, number, values, seed)

    monkeypatch.setattr(CalibrationRuns, "run", failing)
    done = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out")
    assert done.failures == 2
    found = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert found["failed"][7] == "the 7th is bad"
    assert found["failed"][8] == "ZeroDivisionError: by nought"
    assert found["run"].to_list() == list(range(14))
    assert found["radius"].null_count() == 2
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["failed"] == 2
    assert {"message": "the 7th is bad", "runs": 1, "first_run": 7} in summary["failures"]


def test_batches_take_about_two_seconds_and_get_shorter_at_the_end():
    from collections import deque

    batches = Batches(deque(range(1000)))
    assert batches.next(2) == [0]
    batches.measured(0.1)
    sizes = []
    while batches.waiting:
        sizes.append(len(batches.next(2)))
    assert sizes[0] == 20
    assert sizes[-1] == 1
    assert sum(sizes) == 999
    assert sorted(sizes, reverse=True) == sizes


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--jobs", "0"], "--jobs 0"),
        (["--scheduler", "tcp://nowhere:1"], "--scheduler: goes with --engine dask"),
        (["--engine", "dask", "--scheduler", "tcp://127.0.0.1:9", "--jobs", "2"], "one of the two"),
    ],
)
def test_options_that_do_not_go_together_are_refused(tmp_path, words, message, capsys):
    path = written(tmp_path, CALIBRATION)
    assert cli.main(["campaign", str(path), "--out", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_an_unknown_engine_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"engine 'dsk' is not known; did you mean 'dask'\?"):
        run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", engine="dsk")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_main_process_that_is_killed_leaves_no_workers_and_can_go_on(tmp_path, unbroken):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    command = [sys.executable, "-m", "trihedron.tools.cli", "campaign", str(path), "--out", str(out), "--jobs", "2"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as main:
        deadline = time.monotonic() + 60.0
        while not list(out.glob("runs/part-*.parquet")):
            assert main.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        workers = children(main.pid)
        main.send_signal(signal.SIGKILL)
    assert workers
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert all(unbroken[name] == value for name, value in content(out).items() if name.rpartition("/")[2][0] != ".")
    run_campaign(path, out, jobs=1, resume=True)
    assert content(out) == unbroken


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(words[1]) == pid:
            found.append(int(path.parent.name))
    return found
