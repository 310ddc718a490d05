"""Campaigns run whole, in any order; their bytes do not depend on the process."""

import json
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from campaign_runs import CALIBRATION, assert_begun, content, written
from trihedron import run_campaign
from trihedron.tools import cli
from trihedron.tools.campaign.kinds import CalibrationRuns, RunOutputs
from trihedron.tools.errors import InputError
from trihedron.tools.workers import made

PARTS = [f"part-{partition:05d}.parquet" for partition in range(7)]


@pytest.fixture(scope="module", autouse=True)
def _each_calibration_once() -> Iterator[None]:
    """Cache each calibration: a run's scalars follow from the campaign's text, its values and its seed."""
    run, remembered = CalibrationRuns.run, {}

    def once(self: CalibrationRuns, number: int, values: Any, seed: np.random.SeedSequence) -> RunOutputs:
        key = (self.setting.model_dump_json(), number, tuple(values.items()), seed.entropy, seed.spawn_key)
        if key not in remembered:
            remembered[key] = run(self, number, values, seed)
        return remembered[key]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(CalibrationRuns, "run", once)
        yield


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the files of the campaign, computed by this process alone."""
    folder = tmp_path_factory.mktemp("unbroken")
    run_campaign(written(folder, CALIBRATION), folder / "out", jobs=1)
    return content(folder / "out")


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch):
    """Make the run of a number raise an error, once."""

    def at(number: int, error: BaseException) -> None:
        run, errors = CalibrationRuns.run, [error]

        def raising(self: CalibrationRuns, run_number: int, values: Any, seed: Any) -> RunOutputs:
            if run_number == number and errors:
                raise errors.pop()
            return run(self, run_number, values, seed)

        monkeypatch.setattr(CalibrationRuns, "run", raising)

    return at


@pytest.mark.acceptance
@pytest.mark.parametrize("engine", ["local", "dask"])
def test_several_processes_give_the_bytes_of_one(engine, tmp_path, unbroken):
    if engine == "dask":
        pytest.importorskip("distributed")
    summary = run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", jobs=2, engine=engine)
    assert (summary.runs, summary.failed) == (14, 0)
    assert summary.cost is not None
    assert summary.cost.runs == 14
    assert content(tmp_path / "out") == unbroken


def test_an_interrupted_campaign_is_whole_and_goes_on(tmp_path, unbroken, stopped, capsys):
    command = ["campaign", str(written(tmp_path, CALIBRATION)), "--out", str(tmp_path / "out"), "--jobs", "1"]
    stopped(7, KeyboardInterrupt())
    assert cli.main(command) == 130
    assert "interrupted; 6 of 14 runs are in" in (text := capsys.readouterr().err)
    assert "continue with --resume" in text
    assert sorted(path.name for path in (tmp_path / "out" / "runs").iterdir()) == PARTS[:3]
    assert_begun(content(tmp_path / "out"), unbroken)
    assert cli.main([*command, "--resume"]) == 0
    assert "14 runs, 0 failed" in (text := capsys.readouterr().out)
    assert re.search(r"^8 runs in ", text, re.MULTILINE)
    assert content(tmp_path / "out") == unbroken


@pytest.mark.acceptance
def test_what_is_not_whole_is_computed_again(tmp_path, unbroken):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run_campaign(path, out, jobs=1)
    (out / "runs" / PARTS[2]).write_bytes((out / "runs" / PARTS[2]).read_bytes()[:100])
    (out / "runs" / PARTS[4]).unlink()
    (out / "runs" / ".part-00005-xyz.parquet").write_bytes(b"half")
    summary = run_campaign(path, out, jobs=1, resume=True)
    assert summary.cost is not None
    assert summary.cost.runs == 4
    assert content(out) == unbroken


def test_a_folder_with_results_is_not_written_over_or_mixed(tmp_path, monkeypatch, capsys):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    command = ["campaign", str(path), "--out", str(out), "--jobs", "1"]
    assert cli.main(command) == 0
    before = content(out)

    def refused(message: str, *words: str) -> None:
        capsys.readouterr()
        assert cli.main([*command, *words]) == 2
        text = capsys.readouterr().err
        assert message in text
        assert text.count("\n") == 1
        assert content(out) == before

    refused("already has a campaign; continue it with --resume")
    with monkeypatch.context() as patched:
        patched.setattr("trihedron.tools.campaign.store.code_hash", lambda: "other")
        refused("is another version than when it was begun", "--resume")
    path.write_text(CALIBRATION.replace("points = 7", "points = 8"), encoding="utf-8")
    refused("campaign.toml is another one than when it was begun; results would be mixed", "--resume")


def test_workers_of_other_code_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("trihedron.tools.campaign.store.code_hash", lambda: "of this process")
    monkeypatch.setattr("trihedron.tools.campaign.runs.code_hash", lambda: "of a worker")
    with pytest.raises(InputError, match="a worker has another version of Trihedron"):
        run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", jobs=1)


@pytest.mark.acceptance
def test_two_processes_do_not_work_in_one_folder(tmp_path, monkeypatch):
    path, out = written(tmp_path, CALIBRATION), tmp_path / "out"
    run, locks = CalibrationRuns.run, []

    def another_resumes(self: CalibrationRuns, number: int, *arguments: Any) -> RunOutputs:
        if number == 5 and not locks:
            locks.append((out / "campaign.lock").stat().st_ino)
            with pytest.raises(InputError, match=f"^--out {re.escape(str(out))}: another process uses it$"):
                run_campaign(path, out, jobs=1, resume=True)
        return run(self, number, *arguments)

    monkeypatch.setattr(CalibrationRuns, "run", another_resumes)
    run_campaign(path, out, jobs=1)
    # A process that waits at a removed file holds no lock.
    run_campaign(path, out, jobs=1, resume=True)
    assert locks == [(out / "campaign.lock").stat().st_ino]


def test_a_full_disk_leaves_whole_files_and_the_campaign_goes_on(tmp_path, unbroken, monkeypatch, capsys):
    command = ["campaign", str(written(tmp_path, CALIBRATION)), "--out", str(tmp_path / "out"), "--jobs", "1"]
    write_bytes, room = Path.write_bytes, [3]

    def full(self: Path, data: bytes) -> int:
        if self.name.startswith(".part-"):
            room[0] -= 1
            if room[0] < 0:
                write_bytes(self, data[: len(data) // 2])
                raise OSError(28, "No space left on device", str(self))
        return write_bytes(self, data)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        assert cli.main(command) == 2
    assert re.search("No space left on device.*continue with --resume", capsys.readouterr().err)
    assert sorted(path.name for path in (tmp_path / "out" / "runs").iterdir()) == PARTS[:3]
    assert_begun(content(tmp_path / "out"), unbroken)
    assert cli.main([*command, "--resume"]) == 0
    assert content(tmp_path / "out") == unbroken


def test_failing_runs_are_recorded_with_their_message(tmp_path, stopped):
    stopped(7, InputError("the 7th\nis bad"))
    stopped(8, ZeroDivisionError("by nought"))
    assert run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", jobs=1).failed == 2
    table = pl.read_parquet(tmp_path / "out" / "runs" / "*.parquet")
    assert table["failed"][7:9].to_list() == ["the 7th is bad", "ZeroDivisionError: by nought"]
    assert table["run"].to_list() == list(range(14))
    assert table["radius"].null_count() == 2
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert {"message": "the 7th is bad", "runs": 1, "first_run": 7} in summary["failures"]


@pytest.mark.parametrize(
    ("workers", "message"),
    [
        ({"jobs": 0}, "jobs 0"),
        ({"scheduler": "tcp://nowhere:1"}, "scheduler: goes with"),
        ({"engine": "dask", "jobs": 2, "scheduler": "tcp://127.0.0.1:9"}, "one of the two"),
        ({"engine": "dsk", "jobs": 1}, "engine should be 'local' or 'dask', not 'dsk'"),
    ],
)
def test_workers_that_there_cannot_be_are_refused(workers, message, tmp_path):
    with pytest.raises(InputError, match=re.escape(message)):
        run_campaign(written(tmp_path, CALIBRATION), tmp_path / "out", **workers)


def ends_its_process(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.acceptance
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("engine", ["local", pytest.param("dask", marks=pytest.mark.acceptance)])
def test_a_call_that_ends_its_process_ends_all_in_one_line(engine):
    if engine == "dask":
        pytest.importorskip("distributed")
    with pytest.raises(InputError, match=r"a worker process ended|all those workers died"):
        list(made(ends_its_process, range(5), engine=engine, jobs=2))
