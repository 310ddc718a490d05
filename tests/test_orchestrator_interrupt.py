"""Ctrl-C in the middle of a run."""

import json
import os
import signal
import tempfile
from pathlib import Path

import polars as pl
import pytest

from trihedron.tools.orchestrator import loops, simulate
from trihedron.tools.orchestrator.scenario import Scenario

RUN = {
    "run": {"stop_s": 1.0, "step_s": 0.1},
    "fmus": {"table": {"component": "TurntableMotion", "flavour": "python"}},
    "record": {"format": "csv", "columns": {"alpha_deg": "table.angle[1]"}},
}


def test_ctrl_c_inside_an_fmu_is_an_interruption_not_a_failure_of_the_fmu(tmp_path: Path, monkeypatch):
    """The signal comes while the component's Python runs: it must not strike there as an exception."""
    from trihedron.fmus import source

    struck = "import os, signal\n            os.kill(os.getpid(), signal.SIGINT)\n            "
    monkeypatch.setattr(
        source,
        "SCRIPT",
        source.SCRIPT.replace(
            "        return self.report(self.model.do_step(current_time, step_size))",
            f"        if 0.45 < current_time < 0.55:\n            {struck}\n"
            "        return self.report(self.model.do_step(current_time, step_size))",
        ),
    )
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "cache"))
    scenario = Scenario.model_validate({**RUN, "base_folder": tmp_path})
    with pytest.raises(KeyboardInterrupt, match=r"interrupted; .*run\.csv has the run up to 0\.\d s"):
        simulate(scenario, tmp_path / "out")
    assert not any((tmp_path / "temporary").iterdir())
    # What there is so far is whole, and says that it is not all.
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["run.csv", "run.json"]
    said = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert said["complete"] is False
    assert 6 <= said["steps"] < 10
    found = pl.read_csv(tmp_path / "out" / "run.csv")
    assert found["time_s"].to_list() == [0.1 * k for k in range(said["steps"] + 1)]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_before_the_first_row_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def struck(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(loops, "initialise", struck)
    with pytest.raises(KeyboardInterrupt):
        simulate(Scenario.model_validate({**RUN, "base_folder": tmp_path}), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_the_second_ctrl_c_acts_at_once():
    """An FMU that never returns to the loop must not make the program immortal."""

    def stuck() -> None:
        with loops.held_interrupt() as pressed:
            assert not pressed()
            os.kill(os.getpid(), signal.SIGINT)
            assert pressed()
            os.kill(os.getpid(), signal.SIGINT)
            pytest.fail("the second signal was held back too")

    with pytest.raises(KeyboardInterrupt):
        stuck()


def test_a_hosts_own_handler_stays_in_force():
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append("host"))
    try:
        with loops.held_interrupt() as pressed:
            os.kill(os.getpid(), signal.SIGINT)
        assert heard == ["host"]
        assert not pressed()
    finally:
        signal.signal(signal.SIGINT, before)
