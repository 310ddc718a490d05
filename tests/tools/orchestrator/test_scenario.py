"""Scenario files: accepted ones, and the one line about the fault of the others."""

import hashlib
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario, read_scenario

GOOD = """\
schema = "trihedron.scenario/1"
title = "a table and a block"

[run]
stop_s = 600
step_s = 0.1

[fmus.table]
component = "TurntableMotion"
parameters_from = "calibration.json"
parameters = { kappa = 1e-3, mounting = [1, 0, 0, 0, 1, 0, 0, 0, 1] }
effects = [{ effect = "encoder-harmonic", where = "outer-axis", order = 2, amplitude = 1e-5, phase = 0.3 }]

[fmus.other]
fmu = "other.fmu"

[[connections]]
from = "table.specific_force"
to = "other.input"

[[stimuli]]
to = "table.temperature"
constant = 20.0

[[stimuli]]
csv = "rates.csv"
stamp = "end"
columns = { "other.u[1]" = "dtheta1_rad" }

[[stimuli]]
to = "table.command"
programme = "positions.csv"
dwell_s = 20

[record]
every = 2
format = "csv"
columns = { alpha_deg = "table.angle_reading[1]" }
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "s.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_scenario_is_read_as_it_is_written(tmp_path: Path) -> None:
    scenario = read_scenario(written(tmp_path, GOOD))
    assert (scenario.run.start_s, scenario.run.stop_s, scenario.run.step_s) == (0.0, 600.0, 0.1)
    assert scenario.fmus["table"].parameters["mounting"] == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert scenario.connections[0].source == "table.specific_force"
    assert [s.kind for s in scenario.stimuli] == ["constant", "rows", "programme"]
    assert scenario.base_folder == tmp_path


def test_a_scenario_as_run_can_be_read_again(tmp_path: Path) -> None:
    """The scenario in run.json is a valid scenario, with its defaults filled in."""
    first = read_scenario(written(tmp_path, GOOD.replace('stamp = "end"\n', "")))
    described = first.as_written()
    assert described["stimuli"][1]["stamp"] == "start"
    again = Scenario.model_validate({**described, "base_folder": tmp_path, "source": first.source})
    assert again == first


def test_a_list_of_fmus_is_answered_with_the_form_of_a_table(tmp_path) -> None:
    text = 'schema = "trihedron.scenario/1"\n[run]\nstep_s = 0.1\nstop_s = 1\n[[fmus]]\ncomponent = "TurntableMotion"\n'
    with pytest.raises(InputError, match=r"fmus: is a list; write \[fmus\.NAME\] in place of \[\[fmus\]\]$"):
        read_scenario(written(tmp_path, text))


REFUSED = [
    ("stop_s = 600\n", "stop_s = 600\nstep = 1\n", r"run\.step: unknown key; did you mean 'step_s'\?"),
    ('title = "a', 'tittle = "a', r"tittle: unknown key; did you mean 'title'\?"),
    ("[record]", "[recording]", r"recording: unknown key; did you mean 'record'\?"),
    ('component = "T', 'componant = "T', r"fmus\.table\.componant: unknown key; did you mean 'component'\?"),
    ('from = "table', 'form = "table', r"connections\[1\]\.(from: is missing|form: unknown key)"),
    ('from = "table', 'source = "table', r"connections\[1\]\.(from: is missing|source: unknown key)"),
    ("every = 2", "evry = 2", r"record\.evry: unknown key; did you mean 'every'\?"),
    ("every = 2", "every = 0", r"record\.every: .*greater than or equal to 1"),
    ("every = 2", "every = 10000000000", r"record\.every: .*less than or equal to"),
    ("every = 2", "every = 1.5", r"record\.every: .*integer"),
    ('format = "csv"', 'format = "xlsx"', r"record\.format: .*'parquet' or 'csv', not 'xlsx'"),
    ("step_s = 0.1", "step_s = 0", r"run\.step_s: .*greater than 0"),
    ("step_s = 0.1", 'step_s = "0.1"', r"run\.step_s: .*number, not '0\.1'"),
    ("step_s = 0.1", "step_s = nan", r"run\.step_s: "),
    ("step_s = 0.1", "", r"run\.step_s: is missing"),
    ("stop_s = 600", "stop_s = 0", r"run: stop_s = 0\.0 must be after start_s = 0\.0"),
    ("kappa = 1e-3", "kappa = inf", r"fmus\.table\.parameters\.kappa: inf is not a finite number"),
    ("kappa = 1e-3", "kappa = { a = 1 }", r"fmus\.table\.parameters\.kappa: give a number"),
    ('fmu = "other.fmu"', 'fmu = "other.fmu"\ncomponent = "X"', r"fmus\.other: give either component"),
    ('fmu = "other.fmu"', 'fmu = "o.fmu"\neffects = [{}]', r"fmus\.other: effects can be added to a component"),
    ("[fmus.other]", '[fmus."o.t"]', r"fmus: 'o\.t' cannot name an FMU"),
    ("constant = 20.0", "", r"stimuli\[1\]: give one of constant, csv, programme and table; here: none"),
    ("constant = 20.0", 'constant = 1\ncsv = "a"', r"stimuli\[1\]: give one of .*; here: constant and csv"),
    ('to = "table.temperature"', "", r'stimuli\[1\]: give to = "fmu\.variable"'),
    ('stamp = "end"', 'stamp = "middle"', r"stimuli\[2\]\.stamp: .*'start' or 'end'"),
    ("dwell_s = 20", "dwell_s = -20", r"stimuli\[3\]\.dwell_s: .*greater than 0"),
    ('fmu = "other.fmu"', 'fmu = "o.fmu"\nflavour = "native"', r"fmus\.other: flavour belongs to a component"),
    ("step_s = 0.1", "step_s = 0.1\ntolerance = 1e-6", r'run: tolerance goes with coupling = "iterate"'),
    ("constant = 20.0", "constant = 20.0\ndwell_s = 1", r"stimuli\[1\]: dwell_s goes with a programme"),
    ('schema = "trihedron.scenario/1"', "", r"schema is missing; write schema = "),
    ("scenario/1", "scenario/9", r"schema: .*'trihedron\.scenario/1', not 'trihedron\.scenario/9'"),
    ("[run]", 'base_folder = "/"\n[run]', r"base_folder: unknown key"),
    ("[run]", "[run", r"is not TOML: .*line 4"),
    ("stop_s = 600", "stop_s = 600\nstop_s = 700", r"is not TOML: .*line 6"),
]


@pytest.mark.parametrize(("old", "new", "says"), REFUSED)
def test_a_wrong_scenario_is_refused_in_one_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(InputError, match=says) as refused:
        read_scenario(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


def test_what_is_no_text_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_scenario(tmp_path / "missing.toml")
    with pytest.raises(InputError, match="is a directory; the file of a scenario is needed"):
        read_scenario(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'title = "gr\xf6\xdfe"')
    with pytest.raises(InputError, match=r"not UTF-8 text \(byte 12\)"):
        read_scenario(tmp_path / "latin.toml")


@pytest.mark.acceptance
@given(st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_file_gives_anything_but_a_scenario_or_one_line(tmp_path: Path, draws: st.DataObject) -> None:
    content = bytearray(GOOD.encode())
    for _ in range(draws.draw(st.integers(1, 6))):
        at = draws.draw(st.integers(0, len(content) - 1))
        content[at : at + draws.draw(st.integers(0, 12))] = draws.draw(st.binary(max_size=6))
    path = tmp_path / "s.toml"
    path.write_bytes(bytes(content))
    message = ""
    try:
        assert isinstance(read_scenario(path), Scenario)
    except InputError as error:
        message = str(error)
    assert "\n" not in message


def test_a_table_in_memory_stands_for_a_file_and_is_known_by_the_hash_of_its_text() -> None:
    base = {"run": {"step_s": 1e-3, "stop_s": 1.0}, "fmus": {"t": {"component": "TurntableMotion"}}}
    rows = {"alpha_deg": [0, 45.0], "beta_deg": [90.0, 0]}
    built = Scenario.model_validate({**base, "stimuli": [{"to": "t.command", "table": rows, "dwell_s": 5.0}]})
    assert built.stimuli[0].kind == "programme"
    described = built.as_written()["stimuli"][0]["table"]
    assert (described["columns"], described["rows"]) == (["alpha_deg", "beta_deg"], 2)
    rates = np.random.default_rng(0).normal(size=120_001)
    long = pl.DataFrame({"time_s": np.arange(120_001) * 1e-3, "rate_radps": rates})
    stimulus = {"table": long, "columns": {"t.command[1]": "rate_radps"}}
    described = Scenario.model_validate({**base, "stimuli": [stimulus]}).as_written()["stimuli"][0]["table"]
    assert described["sha256_of_csv"] == hashlib.sha256(long.write_csv().encode()).hexdigest()
