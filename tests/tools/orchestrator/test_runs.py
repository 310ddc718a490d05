"""The meaning of a run's numbers: time, order, times of transfer; recorded and written rows, also of a cut run."""

import hashlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import types
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from foreign_fmus import declaring, rewritten
from foreign_fmus.foreign_failing import WAYS
from scenario_runs import ACCUMULATOR, CLOCK, FAILING, GAIN, refusal, run, scenario, wires
from trihedron.fmus import source
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario, loops, read_scenario, recorded, run_scenario
from trihedron.tools.orchestrator.run import INCOMPLETE


def test_time_is_counted_and_not_accumulated(foreign: Path) -> None:
    start, step, steps = 0.3, 0.1, 1000
    setting = {"start_s": start, "stop_s": start + steps * step, "step_s": step}
    table = run(foreign, {"clock": CLOCK}, run=setting).table
    k = np.arange(steps)
    assert table["time_s"].to_list() == [start + i * step for i in range(steps + 1)]
    assert table["clock.began"].to_list()[1:] == (start + k * step).tolist()
    assert set(table["clock.step"].to_list()[1:]) == {step}
    assert table["clock.count"].to_list() == list(range(steps + 1))
    assert table["clock.start"][-1] == start
    assert table["clock.stop"][-1] == start + steps * step


@pytest.mark.parametrize("order", [("clock", "sum"), ("sum", "clock")])
def test_an_output_reaches_its_consumer_in_the_same_step(foreign: Path, order: tuple[str, str]) -> None:
    fmus = {name: {"clock": CLOCK, "sum": ACCUMULATOR}[name] for name in order}
    simulation = run(foreign, fmus, connections=wires("clock.ended -> sum.increment"))
    ended = simulation.table["clock.ended"].to_numpy()
    # The clock's value after step k is in the sum after step k: nothing is a step late.
    assert simulation.table["sum.total"].to_list() == list(np.cumsum(ended))
    assert simulation.provenance["order"] == ["clock", "sum"]


def test_initial_outputs_are_passed_on_in_initialisation_and_before_the_first_step(foreign: Path) -> None:
    fmus = {"sum": ACCUMULATOR, "second": GAIN, "first": {**GAIN, "parameters": {"gain": 3.0}}}
    connections = wires("first.y[1] -> second.u[1]", "second.y[1] -> sum.increment")
    stimuli = [{"to": "first.u[1]", "constant": 2.0}]
    table = run(foreign, fmus, connections=connections, stimuli=stimuli).table
    assert table["second.y[1]"][0] == 6.0
    assert table["sum.at_first"][0] == 6.0
    assert table["sum.total"].to_list() == [6.0 * k for k in range(11)]


def test_two_instances_of_one_file_are_independent(foreign: Path) -> None:
    fmus = {f"g{i}": {**GAIN, "parameters": {"gain": float(i), "u": [1.0, 1.0]}} for i in range(4)}
    table = run(foreign, fmus).table
    assert [table[f"g{i}.y[1]"][-1] for i in range(4)] == [0.0, 1.0, 2.0, 3.0]


def test_a_script_of_the_same_name_is_never_mistaken_for_another(
    foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python keeps modules by name; an FMU with a changed script must run its own."""

    def doubled(name: str, content: bytes) -> tuple[str, bytes]:
        return name, content.replace(b"self.total += self.increment", b"self.total += 2.0 * self.increment")

    rewritten(foreign / "Accumulator.fmu", tmp_path / "Other.fmu", doubled)
    (tmp_path / "Accumulator.fmu").write_bytes((foreign / "Accumulator.fmu").read_bytes())
    fmus = {"one": {**ACCUMULATOR, "parameters": {"increment": 1.0}}}
    fmus["two"] = {"fmu": "Other.fmu", "parameters": {"increment": 1.0}}
    monkeypatch.setitem(sys.modules, "foreign_accumulator", types.ModuleType("foreign_accumulator"))
    for _ in range(2):
        table = run(tmp_path, fmus).table
        assert (table["one.total"][-1], table["two.total"][-1]) == (10.0, 20.0)


def test_only_every_nth_step_is_recorded(foreign: Path) -> None:
    complete = run(foreign, {"clock": CLOCK}).table
    thinned = run(foreign, {"clock": CLOCK}, record={"every": 3}).table
    assert thinned.equals(complete.gather_every(3))


def test_columns_are_converted_to_the_unit_in_their_name(foreign: Path, tmp_path: Path) -> None:
    units = {"ended": 'unit="rad"', "began": 'unit="degC"'}
    fmu = declaring(foreign / "Clock.fmu", tmp_path / "Turned.fmu", units)
    columns = {"a_rad": "c.ended", "a_deg": "c.ended", "a_arcsec": "c.ended", "t_degC": "c.began", "n": "c.count"}
    table = run(tmp_path, {"c": {"fmu": fmu.name}}, record={"columns": columns}).table
    assert table.columns == ["time_s", *columns]
    angle = table["a_rad"].to_numpy()
    np.testing.assert_allclose(table["a_deg"].to_numpy(), np.degrees(angle), rtol=1e-15)
    np.testing.assert_allclose(table["a_arcsec"].to_numpy(), np.degrees(angle) * 3600.0, rtol=1e-15)
    assert table["t_degC"][-1] == pytest.approx(0.9, rel=1e-15)
    default = run(tmp_path, {"c": {"fmu": fmu.name}}).table
    assert {"c.ended_rad", "c.began_degC", "c.step"} <= set(default.columns)
    for name in ("a_mps2", "a_degps", "a", "a_s"):
        with pytest.raises(InputError, match=r"column.*rad|column.*'a_rad'"):
            run(tmp_path, {"c": {"fmu": fmu.name}}, record={"columns": {name: "c.ended"}})


@pytest.mark.acceptance
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_the_same_scenario_gives_the_same_bytes(foreign: Path, tmp_path: Path, form: str) -> None:
    text = f"""
        schema = "trihedron.scenario/1"
        title = "twice"
        [run]
        stop_s = 2.0
        step_s = 0.01
        [fmus.clock]
        fmu = "Clock.fmu"
        [fmus.gain]
        fmu = "Gain.fmu"
        parameters = {{ gain = 0.1 }}
        [[connections]]
        from = "clock.ended"
        to = "gain.u[1]"
        [[stimuli]]
        csv = "u.csv"
        columns = {{ "gain.u[2]" = "u" }}
        [record]
        format = "{form}"
    """
    path = foreign / f"twice-{form}.toml"
    path.write_text(text, encoding="utf-8")
    (foreign / "u.csv").write_text("time_s,u\n0,1\n1,2\n", encoding="utf-8")
    runs = [run_scenario(read_scenario(path), tmp_path / name) for name in ("a", "b")]
    assert [p.name for p in runs[0].files] == [f"run.{form}", "run.json"]
    for first, second in zip(runs[0].files, runs[1].files, strict=True):
        assert first.read_bytes() == second.read_bytes()
    rows = pl.read_csv(runs[0].files[0]) if form == "csv" else pl.read_parquet(runs[0].files[0])
    assert rows["gain.y[1]"].to_list() == runs[0].table["gain.y[1]"].to_list()
    provenance = json.loads(runs[0].files[1].read_text(encoding="utf-8"))
    assert provenance["schema"] == "trihedron.run/1"
    assert (provenance["steps"], provenance["final_time_s"]) == (200, 2.0)
    assert provenance["scenario"]["run"] == {"start_s": 0.0, "stop_s": 2.0, "step_s": 0.01}
    assert provenance["scenario"]["record"] == {"every": 1, "format": form}
    assert provenance["scenario"]["stimuli"] == [{"csv": "u.csv", "stamp": "start", "columns": {"gain.u[2]": "u"}}]
    digest = hashlib.sha256((foreign / "Gain.fmu").read_bytes()).hexdigest()
    assert provenance["fmus"]["gain"] == {"source": "Gain.fmu", "model": "Gain", "sha256": digest}
    assert provenance["files"] == {"u.csv": hashlib.sha256((foreign / "u.csv").read_bytes()).hexdigest()}
    assert set(provenance["versions"]) == {"trihedron", "fmpy", "pythonfmu", "polars", "python"}
    assert str(foreign) not in runs[0].files[1].read_text(encoding="utf-8")
    assert {p.name for p in tmp_path.iterdir()} == {"a", "b"}


@pytest.mark.parametrize(
    ("way", "says"),
    [
        ("error", "fmi2DoStep at 0.3 s ended with Discard: the pump has stopped, 100% of it"),
        ("silent", "fmi2DoStep at 0.3 s ended with Discard (its log says nothing)"),
        ("raises", "fmi2DoStep at 0.3 s ended with Fatal: .*ZeroDivisionError.*the gear ratio is zero"),
        ("exits", "fmi2DoStep at 0.3 s ended with Fatal: "),
        ("format", "fmi2DoStep at 0.3 s ended with Fatal: .*%s%s%n of %d"),
        ("initialisation", "fmi2ExitInitializationMode before the first step ended with Fatal: .*the seal is broken"),
        ("nan", "y is nan at 0.4 s"),
        ("infinity", "y is -inf at 0.4 s"),
    ],
)
def test_an_fmu_that_fails(foreign: Path, way: str, says: str) -> None:
    parameters = {"way": WAYS[way], "after": 0.25}
    message = refusal(foreign, {"clock": CLOCK, "pump": {**FAILING, "parameters": parameters}})
    assert message.startswith("FMU 'pump' (Failing.fmu): ")
    pattern = says if ".*" in says else re.escape(says)
    assert re.search(pattern, message), message


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"x": "clock.endet"}, "record.columns.x: 'clock' has no variable 'endet'; did you mean 'ended'?"),
        ({"time_s": "clock.ended"}, "time_s is there by itself"),
        ({"x": "gain.u"}, "record.columns.x: 'gain.u' has 2 elements"),
    ],
)
def test_a_wrong_column(foreign: Path, columns: dict, says: str) -> None:
    assert says in refusal(foreign, {"clock": CLOCK, "gain": GAIN}, record={"columns": columns})


def test_an_output_folder_that_cannot_be_made(foreign: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="taken: is a file"):
        run_scenario(scenario(foreign, {"clock": CLOCK}), tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "a file"


TABLE = {
    "run": {"stop_s": 60.0, "step_s": 0.01},
    "fmus": {"table": {"component": "TurntableMotion", "parameters": {"encoder_fluctuation_bound": 1e-5}}},
    "stimuli": [{"to": "table.command", "table": {"alpha_deg": [20.0, 70.0], "beta_deg": [5.0, 9.0]}, "dwell_s": 9.0}],
}


def table_run(form: str) -> Scenario:
    return Scenario.model_validate({**TABLE, "record": {"format": form}})


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_a_run_in_parts_is_the_run_in_one_piece(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    complete = run_scenario(table_run(form), tmp_path / "whole")
    monkeypatch.setattr("trihedron.tools.orchestrator.run.WHOLE_BYTES", 0)
    contents = []
    for size in (200_000, 37_777):
        monkeypatch.setattr(recorded, "BLOCK_BYTES", size)
        parts = run_scenario(table_run(form), tmp_path / "parts")
        assert parts.held is None
        assert parts.columns == complete.columns
        assert parts.height == complete.height == 6001
        assert parts.table.equals(complete.table) if form == "parquet" else parts.table.shape == complete.table.shape
        assert {p.name for p in (tmp_path / "parts").iterdir()} == {f"run.{form}", "run.json"}
        contents.append([p.read_bytes() for p in parts.files])
    assert contents[0] == contents[1]
    assert contents[0][1] == complete.files[1].read_bytes()
    if form == "csv":
        assert contents[0][0] == complete.files[0].read_bytes()


def test_a_small_run_in_parts_has_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    complete = run_scenario(table_run("parquet"), tmp_path / "whole")
    monkeypatch.setattr(recorded, "BLOCK_BYTES", 100_000)
    parts = run_scenario(table_run("parquet"), tmp_path / "parts")
    assert parts.files[0].read_bytes() == complete.files[0].read_bytes()


@pytest.mark.acceptance
@pytest.mark.parametrize("block", [80, 1 << 20])
def test_a_run_that_fails_late_keeps_its_rows(
    foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    monkeypatch.setattr(recorded, "BLOCK_BYTES", block)
    fmus = {"f": {**FAILING, "parameters": {"way": WAYS["nan"], "after": 5.0}}}
    failing = scenario(foreign, fmus, run={"stop_s": 9.0, "step_s": 0.1})
    for out in (tmp_path / "new" / "run", tmp_path / "old"):
        if out.name == "old":
            out.mkdir()
            (out / "run.csv").write_text("of another run")
        with pytest.raises(InputError) as refused:
            run_scenario(failing, out)
        failure, _, place = str(refused.value).rpartition("; ")
        assert failure == "FMU 'f' (Failing.fmu): y is nan at 5.1 s; to run all the same: --allow-nan"
        assert place == f"{out / 'run.parquet'} has the run up to 5 s"
        assert sorted(p.name for p in out.iterdir()) == ["run.json", "run.parquet"]
        table = pl.read_parquet(out / "run.parquet")
        # Until it fails its output is 0, then the time at which a step begins.
        assert table["time_s"].to_list() == pytest.approx([0.1 * k for k in range(51)])
        provenance = json.loads((out / "run.json").read_text())
        assert (provenance["complete"], provenance["steps"], provenance["failure"]) == (False, 50, failure)


KILLED = """
import sys
from pathlib import Path
from trihedron.tools.orchestrator import recorded, run_scenario
from trihedron.tools.orchestrator.scenario import Scenario
recorded.BLOCK_BYTES = 1_000_000
data = {table}
data["run"] = {{"stop_s": 1e6, "step_s": 0.01}}
run_scenario(Scenario.model_validate(data), Path(sys.argv[1]))
"""


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
@pytest.mark.parametrize("way", ["SIGKILL", "SIGINT"])
def test_what_was_recorded_survives(way: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen([sys.executable, "-c", KILLED.format(table=TABLE), str(out)], stderr=subprocess.PIPE)
    last = out / INCOMPLETE / "00000003.parquet"
    waited = time.monotonic()
    while not last.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() - waited < 300.0
        time.sleep(0.01)
    process.send_signal(getattr(signal, way))
    message = process.communicate()[1].decode()
    assert process.returncode != 0
    if way == "SIGKILL":
        folder = out / INCOMPLETE
        table = pl.read_parquet(folder / "*.parquet")
        assert list(out.iterdir()) == [folder]
    else:
        assert "has the run up to" in message
        folder = out
        table = pl.read_parquet(out / "run.parquet")
        assert sorted(p.name for p in out.iterdir()) == ["run.json", "run.parquet"]
    provenance = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert provenance["complete"] is False
    assert table.height > 4000
    assert (table["time_s"].to_numpy() == 0.01 * np.arange(table.height)).all()
    reference = run_scenario(table_run("parquet")).table
    assert table.head(reference.height).equals(reference.head(table.height))
    run_scenario(table_run("parquet"), out)
    assert sorted(p.name for p in out.iterdir()) == ["run.json", "run.parquet"]
    assert "complete" not in json.loads((out / "run.json").read_text(encoding="utf-8"))


RUN = {
    "run": {"stop_s": 1.0, "step_s": 0.1},
    "fmus": {"table": {"component": "TurntableMotion", "flavour": "python"}},
    "record": {"format": "csv", "columns": {"alpha_deg": "table.angle[1]"}},
}


def test_ctrl_c_inside_an_fmu_is_an_interruption_not_a_failure_of_the_fmu(tmp_path: Path, monkeypatch):
    """The signal comes while the component's Python runs: it must not strike there as an exception."""
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
        run_scenario(scenario, tmp_path / "out")
    assert not any((tmp_path / "temporary").iterdir())
    # The present rows are whole, and marked as incomplete.
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["run.csv", "run.json"]
    provenance = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert provenance["complete"] is False
    assert 6 <= provenance["steps"] < 10
    rows = pl.read_csv(tmp_path / "out" / "run.csv")
    assert rows["time_s"].to_list() == [0.1 * k for k in range(provenance["steps"] + 1)]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_before_the_first_row_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def struck(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(loops, "initialise_fmus", struck)
    with pytest.raises(KeyboardInterrupt):
        run_scenario(Scenario.model_validate({**RUN, "base_folder": tmp_path}), tmp_path / "out")
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
    signals = []
    before = signal.signal(signal.SIGINT, lambda *_: signals.append("host"))
    try:
        with loops.held_interrupt() as pressed:
            os.kill(os.getpid(), signal.SIGINT)
        assert signals == ["host"]
        assert not pressed()
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_long_run_keeps_its_last_tick(foreign: Path) -> None:
    """0.1 is not a binary fraction; the last row is at the stop time all the same."""
    setting = {"stop_s": 2000.0, "step_s": 0.1}
    table = run(foreign, {"clock": CLOCK}, run=setting, record={"every": 20_000}).table
    assert math.isclose(table["time_s"][-1], 2000.0, rel_tol=1e-15)
    assert table["clock.count"][-1] == 20_000


def test_an_fmu_runs_again_after_it_has_failed(foreign: Path) -> None:
    for way in ("raises", "nan"):
        refusal(foreign, {"pump": {**FAILING, "parameters": {"way": WAYS[way]}}})
    assert run(foreign, {"pump": FAILING}).table["pump.y"][-1] == pytest.approx(0.9)
