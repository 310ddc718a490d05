"""What the orchestrator's numbers mean: time, order, what is passed on when, what is recorded and written."""

import hashlib
import json
import math
import sys
import types
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foreign_fmus import build_foreign, declaring, rewritten
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.interface import Variable
from trihedron.tools.orchestrator.scenario import Scenario, read_scenario
from trihedron.tools.orchestrator.wiring import Coupling, Wire, stepping_groups

SCRIPTS = ("foreign_clock", "foreign_gain", "foreign_accumulator")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the foreign FMUs Clock.fmu, Gain.fmu and Accumulator.fmu."""
    folder = tmp_path_factory.mktemp("foreign")
    for script in SCRIPTS:
        build_foreign(script, folder)
    return folder


def scenario(folder: Path, fmus: dict[str, dict], **sections) -> Scenario:
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": fmus, **sections}
    return Scenario.model_validate({**data, "base_folder": folder})


CLOCK = {"fmu": "Clock.fmu"}
GAIN = {"fmu": "Gain.fmu"}
ACCUMULATOR = {"fmu": "Accumulator.fmu"}


def test_time_is_counted_and_not_accumulated(folder: Path) -> None:
    start, step, steps = 0.3, 0.1, 1000
    run = {"start_s": start, "stop_s": start + steps * step, "step_s": step}
    table = simulate(scenario(folder, {"clock": CLOCK}, run=run)).table
    k = np.arange(steps)
    assert table["time_s"].to_list() == [start + i * step for i in range(steps + 1)]
    assert table["clock.began"].to_list()[1:] == (start + k * step).tolist()
    assert set(table["clock.step"].to_list()[1:]) == {step}
    assert table["clock.count"].to_list() == list(range(steps + 1))
    assert table["clock.start"][-1] == start
    assert table["clock.stop"][-1] == start + steps * step


@pytest.mark.parametrize("order", [("clock", "sum"), ("sum", "clock")])
def test_an_output_reaches_its_consumer_in_the_same_step(folder: Path, order: tuple[str, str]) -> None:
    fmus = {name: {"clock": CLOCK, "sum": ACCUMULATOR}[name] for name in order}
    connections = [{"from": "clock.ended", "to": "sum.increment"}]
    run = simulate(scenario(folder, fmus, connections=connections))
    ended = run.table["clock.ended"].to_numpy()
    # What the clock says after step k is in the sum after step k: nothing is a step late.
    assert run.table["sum.total"].to_list() == list(np.cumsum(ended))
    assert run.provenance["order"] == ["clock", "sum"]


def test_initial_outputs_are_passed_on_in_initialisation_and_before_the_first_step(folder: Path) -> None:
    fmus = {"sum": ACCUMULATOR, "second": GAIN, "first": {**GAIN, "parameters": {"gain": 3.0}}}
    connections = [
        {"from": "first.y[1]", "to": "second.u[1]"},
        {"from": "second.y[1]", "to": "sum.increment"},
    ]
    stimuli = [{"to": "first.u[1]", "constant": 2.0}]
    table = simulate(scenario(folder, fmus, connections=connections, stimuli=stimuli)).table
    assert table["second.y[1]"][0] == 6.0
    assert table["sum.at_first"][0] == 6.0
    assert table["sum.total"].to_list() == [6.0 * k for k in range(11)]


def test_every_type_is_set_passed_on_and_recorded(folder: Path) -> None:
    parameters = {"gain": 2, "times": 3, "inverted": True, "label": "größe "}
    fmus = {"first": {**GAIN, "parameters": parameters}, "second": GAIN}
    connections = [
        {"from": "first.y", "to": "second.u"},
        {"from": "first.counted", "to": "second.count"},
        {"from": "first.marked", "to": "second.mark"},
        {"from": "first.said", "to": "second.word"},
    ]
    stimuli = [
        {"to": "first.u", "constant": [1.5, -2.0]},
        {"to": "first.count", "constant": 7},
        {"to": "first.mark", "constant": False},
        {"to": "first.word", "constant": "µ"},
    ]
    table = simulate(scenario(folder, fmus, connections=connections, stimuli=stimuli)).table
    for row in (0, 1, 10):
        found = table.row(row, named=True)
        assert (found["second.y[1]"], found["second.y[2]"]) == (-9.0, 12.0)
        assert (found["second.counted"], found["second.marked"]) == (21, True)
        assert (found["first.said"], found["second.said"]) == ("größe µ", "nonegröße µ")
    assert table.schema["second.counted"] == pl.Int32
    assert table.schema["second.marked"] == pl.Boolean


def test_two_instances_of_one_file_are_independent(folder: Path) -> None:
    fmus = {f"g{i}": {**GAIN, "parameters": {"gain": float(i), "u": [1.0, 1.0]}} for i in range(4)}
    table = simulate(scenario(folder, fmus)).table
    assert [table[f"g{i}.y[1]"][-1] for i in range(4)] == [0.0, 1.0, 2.0, 3.0]


def test_a_script_of_the_same_name_is_never_mistaken_for_another(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python keeps modules by name; an FMU whose script is changed must run what it carries."""

    def doubled(name: str, content: bytes) -> tuple[str, bytes]:
        return name, content.replace(b"self.total += self.increment", b"self.total += 2.0 * self.increment")

    rewritten(folder / "Accumulator.fmu", tmp_path / "Other.fmu", doubled)
    (tmp_path / "Accumulator.fmu").write_bytes((folder / "Accumulator.fmu").read_bytes())
    fmus = {"one": {**ACCUMULATOR, "parameters": {"increment": 1.0}}}
    fmus["two"] = {"fmu": "Other.fmu", "parameters": {"increment": 1.0}}
    monkeypatch.setitem(sys.modules, "foreign_accumulator", types.ModuleType("foreign_accumulator"))
    for _ in range(2):
        table = simulate(scenario(tmp_path, fmus)).table
        assert (table["one.total"][-1], table["two.total"][-1]) == (10.0, 20.0)


def test_only_every_nth_step_is_recorded(folder: Path) -> None:
    whole = simulate(scenario(folder, {"clock": CLOCK})).table
    thinned = simulate(scenario(folder, {"clock": CLOCK}, record={"every": 3})).table
    assert thinned.equals(whole.gather_every(3))


def test_columns_are_converted_to_the_unit_in_their_name(folder: Path, tmp_path: Path) -> None:
    units = {"ended": 'unit="rad"', "began": 'unit="degC"'}
    fmu = declaring(folder / "Clock.fmu", tmp_path / "Turned.fmu", units)
    columns = {"a_rad": "c.ended", "a_deg": "c.ended", "a_arcsec": "c.ended", "t_degC": "c.began", "n": "c.count"}
    table = simulate(scenario(tmp_path, {"c": {"fmu": fmu.name}}, record={"columns": columns})).table
    assert table.columns == ["time_s", *columns]
    angle = table["a_rad"].to_numpy()
    np.testing.assert_allclose(table["a_deg"].to_numpy(), np.degrees(angle), rtol=1e-15)
    np.testing.assert_allclose(table["a_arcsec"].to_numpy(), np.degrees(angle) * 3600.0, rtol=1e-15)
    assert table["t_degC"][-1] == pytest.approx(0.9, rel=1e-15)
    default = simulate(scenario(tmp_path, {"c": {"fmu": fmu.name}})).table
    assert {"c.ended_rad", "c.began_degC", "c.step"} <= set(default.columns)
    for name in ("a_mps2", "a_degps", "a", "a_s"):
        with pytest.raises(InputError, match=r"column.*rad|column.*'a_rad'"):
            simulate(scenario(tmp_path, {"c": {"fmu": fmu.name}}, record={"columns": {name: "c.ended"}}))


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_the_same_scenario_gives_the_same_bytes(folder: Path, tmp_path: Path, form: str) -> None:
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
    path = folder / f"twice-{form}.toml"
    path.write_text(text, encoding="utf-8")
    (folder / "u.csv").write_text("time_s,u\n0,1\n1,2\n", encoding="utf-8")
    runs = [simulate(read_scenario(path), tmp_path / name) for name in ("a", "b")]
    assert [p.name for p in runs[0].files] == [f"run.{form}", "run.json"]
    for one, other in zip(runs[0].files, runs[1].files, strict=True):
        assert one.read_bytes() == other.read_bytes()
    read = pl.read_csv(runs[0].files[0]) if form == "csv" else pl.read_parquet(runs[0].files[0])
    assert read["gain.y[1]"].to_list() == runs[0].table["gain.y[1]"].to_list()
    said = json.loads(runs[0].files[1].read_text(encoding="utf-8"))
    assert said["schema"] == "trihedron.run/1"
    assert (said["steps"], said["final_time_s"]) == (200, 2.0)
    assert said["scenario"]["run"] == {"start_s": 0.0, "stop_s": 2.0, "step_s": 0.01}
    assert said["scenario"]["record"] == {"every": 1, "format": form}
    assert said["scenario"]["stimuli"] == [{"csv": "u.csv", "stamp": "start", "columns": {"gain.u[2]": "u"}}]
    digest = hashlib.sha256((folder / "Gain.fmu").read_bytes()).hexdigest()
    assert said["fmus"]["gain"] == {"source": "Gain.fmu", "model": "Gain", "sha256": digest}
    assert said["files"] == {"u.csv": hashlib.sha256((folder / "u.csv").read_bytes()).hexdigest()}
    assert set(said["versions"]) == {"trihedron", "fmpy", "pythonfmu", "polars", "python"}
    assert str(folder) not in runs[0].files[1].read_text(encoding="utf-8")
    assert {p.name for p in tmp_path.iterdir()} == {"a", "b"}


def stepping_order(names: list[str], wires: list[Wire]) -> list[str]:
    return [name for group in stepping_groups(names, wires, Coupling()) for name in group.members]


def _wire(source: int, target: int) -> Wire:
    port = Variable("x", "Real", "Real", 0, "output", "continuous")
    return Wire(f"f{source}", port, f"f{target}", port)


@given(st.integers(1, 7), st.data())
def test_fmus_step_after_those_that_feed_them_and_else_as_in_the_file(count: int, data: st.DataObject) -> None:
    names = [f"f{i}" for i in range(count)]
    rank = data.draw(st.permutations(range(count)))
    pairs = [(a, b) for a in range(count) for b in range(count) if rank[a] < rank[b]]
    edges = data.draw(st.lists(st.sampled_from(pairs), max_size=10)) if pairs else []
    order = stepping_order(names, [_wire(a, b) for a, b in edges])
    assert sorted(order) == names
    place = {name: i for i, name in enumerate(order)}
    assert all(place[f"f{a}"] < place[f"f{b}"] for a, b in edges)
    for i, name in enumerate(order):
        # Whoever steps earlier although it stands later in the file does so because it had to wait for nobody
        # while the other still waited for someone.
        for later in order[i + 1 :]:
            if names.index(later) < names.index(name):
                assert any(f"f{b}" == later and place[f"f{a}"] >= i for a, b in edges)


@given(st.lists(st.integers(0, 5), min_size=1, max_size=5, unique=True))
def test_a_cycle_is_named_whole(members: list[int]) -> None:
    names = [f"f{i}" for i in range(6)]
    around = [*members, members[0]]
    with pytest.raises(InputError) as refused:
        stepping_order(names, [_wire(a, b) for a, b in pairwise(around)])
    said = str(refused.value).split(": ")[1].split(";")[0].split(" -> ")
    assert said[0] == said[-1] == f"f{min(members)}"
    edges = {(f"f{a}", f"f{b}") for a, b in pairwise(around)}
    assert set(pairwise(said)) == edges


def test_a_long_run_keeps_its_last_tick(folder: Path) -> None:
    """0.1 is no binary fraction; the last row is at the stop time all the same."""
    run = {"stop_s": 2000.0, "step_s": 0.1}
    table = simulate(scenario(folder, {"clock": CLOCK}, run=run, record={"every": 20_000})).table
    assert math.isclose(table["time_s"][-1], 2000.0, rel_tol=1e-15)
    assert table["clock.count"][-1] == 20_000
