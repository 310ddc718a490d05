"""Long runs: recorded to disk block by block, whole at their end, readable when they are killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from foreign_fmus import build_foreign
from foreign_fmus.foreign_failing import WAYS
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import journal, simulate
from trihedron.tools.orchestrator.scenario import Scenario

TABLE = {
    "run": {"stop_s": 60.0, "step_s": 0.01},
    "fmus": {"table": {"component": "TurntableMotion", "parameters": {"encoder_fluctuation_bound": 1e-5}}},
    "stimuli": [{"to": "table.command", "table": {"alpha_deg": [20.0, 70.0], "beta_deg": [5.0, 9.0]}, "dwell_s": 9.0}],
}


def scenario(form: str) -> Scenario:
    return Scenario.model_validate({**TABLE, "record": {"format": form}})


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_a_run_in_parts_is_the_run_in_one_piece(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = simulate(scenario(form), tmp_path / "whole")
    monkeypatch.setattr(journal, "WHOLE_BYTES", 0)
    contents = []
    for size in (200_000, 37_777):
        monkeypatch.setattr(journal, "BLOCK_BYTES", size)
        run = simulate(scenario(form), tmp_path / "parts")
        assert run.rows is None
        assert run.columns == whole.columns
        assert run.height == whole.height == 6001
        assert run.table.equals(whole.table) if form == "parquet" else run.table.shape == whole.table.shape
        assert {p.name for p in (tmp_path / "parts").iterdir()} == {f"run.{form}", "run.json"}
        contents.append([p.read_bytes() for p in run.files])
    assert contents[0] == contents[1]
    assert contents[0][1] == whole.files[1].read_bytes()
    if form == "csv":
        assert contents[0][0] == whole.files[0].read_bytes()


def test_a_small_run_in_parts_has_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = simulate(scenario("parquet"), tmp_path / "whole")
    monkeypatch.setattr(journal, "BLOCK_BYTES", 100_000)
    parts = simulate(scenario("parquet"), tmp_path / "parts")
    assert parts.files[0].read_bytes() == whole.files[0].read_bytes()


def test_a_run_that_fails_late_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build_foreign("foreign_failing", tmp_path)
    monkeypatch.setattr(journal, "BLOCK_BYTES", 80)
    parameters = {"way": WAYS["nan"], "after": 5.0}
    data = {"run": {"stop_s": 9.0, "step_s": 0.1}, "fmus": {"f": {"fmu": "Failing.fmu", "parameters": parameters}}}
    failing = Scenario.model_validate({**data, "base_folder": tmp_path})
    for out in (tmp_path / "new" / "run", tmp_path / "old"):
        if out.name == "old":
            out.mkdir()
            (out / "run.csv").write_text("of another run")
        with pytest.raises(InputError, match=r"y is nan at 5\.1 s"):
            simulate(failing, out)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["Failing.fmu", "old", "run.csv"]


KILLED = """
import sys
from pathlib import Path
from trihedron.tools.orchestrator import journal, simulate
from trihedron.tools.orchestrator.scenario import Scenario
journal.BLOCK_BYTES = 1_000_000
data = {table}
data["run"] = {{"stop_s": 1e6, "step_s": 0.01}}
simulate(Scenario.model_validate(data), Path(sys.argv[1]))
"""


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
@pytest.mark.parametrize("way", ["SIGKILL", "SIGINT"])
def test_what_was_recorded_survives(way: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen([sys.executable, "-c", KILLED.format(table=TABLE), str(out)], stderr=subprocess.PIPE)
    last = out / journal.INCOMPLETE / "00000003.parquet"
    waited = time.monotonic()
    while not last.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() - waited < 60.0
        time.sleep(0.01)
    process.send_signal(getattr(signal, way))
    said = process.communicate()[1].decode()
    assert process.returncode != 0
    if way == "SIGKILL":
        folder = out / journal.INCOMPLETE
        table = pl.read_parquet(folder / "*.parquet")
        assert list(out.iterdir()) == [folder]
    else:
        assert "has the run up to" in said
        folder = out
        table = pl.read_parquet(out / "run.parquet")
        assert sorted(p.name for p in out.iterdir()) == ["run.json", "run.parquet"]
    kept = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert kept["complete"] is False
    assert table.height > 4000
    assert (table["time_s"].to_numpy() == 0.01 * np.arange(table.height)).all()
    reference = simulate(scenario("parquet")).table
    assert table.head(reference.height).equals(reference.head(table.height))
    simulate(scenario("parquet"), out)
    assert sorted(p.name for p in out.iterdir()) == ["run.json", "run.parquet"]
    assert "complete" not in json.loads((out / "run.json").read_text(encoding="utf-8"))
