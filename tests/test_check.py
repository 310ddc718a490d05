"""`trihedron check`: all problems of a file at once, with their lines."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

import trihedron as th
from trihedron.tools import cli
from trihedron.tools.check.findings import json_lines, line_at, toml_lines
from trihedron.tools.records import StrapdownRecord, write_record
from trihedron.tools.result import Result, field_problems

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
STATIC = SCENARIOS / "static-calibration.toml"


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a correct position record."""
    path = tmp_path_factory.mktemp("record") / "measured.csv"
    from generator.positions import write_hidden_record

    write_hidden_record(path, 5)
    return path


def written(folder: Path, text: str, name: str = "file.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def problems_in(path: Path) -> list[tuple[int | None, str]]:
    return [(problem.line, problem.text) for problem in th.check(path).problems]


OURS = [*sorted(SCENARIOS.glob("*.toml")), *sorted(SCENARIOS.glob("campaigns/*.toml"))]


@pytest.mark.parametrize("path", OURS, ids=lambda p: p.stem)
def test_nothing_is_wrong_with_our_own_scenarios_and_campaigns(path: Path):
    checked = th.check(path)
    assert checked.good, str(checked)
    assert checked.kind == ("campaign" if path.parent.name == "campaigns" else "scenario")


def test_a_scenario_with_many_mistakes_has_each_with_its_line(tmp_path: Path):
    """Use mistakes of fields and of their content, in all sections at once."""
    mistakes = {
        "kappa = 3e-3": ("kapa = 3e-3", "did you mean 'kappa'?"),
        "epsilon = -3e-3": ("epsilon = 'small'", "must be a number"),
        "bias = [1e-2, -1e-2, 6e-3]": ("bias = [\n    1e-2,\n    -1e-2,\n]", "bias has 3 elements; 2 are given"),
        'component = "AttitudeComputer"': ('component = "AttitudeComputr"', "did you mean 'AttitudeComputer'?"),
        'from = "table.dwell"': ('from = "table.dwel"', "did you mean 'dwell'?"),
        "dwell_s = 20.0": ("dwell_s = -20.0", "greater than 0"),
        'to = "table.temperature"': ('to = "table.temperatur"', "did you mean 'temperature'?"),
        'f1_mps2 = "block.reading[1]"': ('f1_mps2 = "block.reading[9]"', "elements 1 to 3"),
    }
    text = STATIC.read_text(encoding="utf-8")
    for right, (wrong, _) in mistakes.items():
        assert text.count(right) == 1
        text = text.replace(right, wrong)
    lines = text.split("\n")
    problems = problems_in(written(tmp_path, text))
    assert len(problems) == len(mistakes)
    for wrong, message in mistakes.values():
        # The problem of a list entry may have the line of the entry's header.
        at = lines.index(wrong.split("\n")[0]) + 1
        near = [line for line, message in problems if message in message]
        assert near, message
        assert any(line is not None and at - 2 <= line <= at for line in near), (message, at, near)


def test_steps_of_different_lengths_are_checked_each_at_its_line(tmp_path: Path):
    text = """schema = "trihedron.scenario/1"
[run]
stop_s = 3.0
step_s = 0.1
[fmus.table]
component = "TurntableMotion"
step_s = 0.2
[fmus.block]
component = "AccelerometerBlock"
step_s = 0.25
[[connections]]
from = "table.specific_force"
to = "block.specific_force"
"""
    multiple = (10, "fmus.block.step_s = 0.25 is not a whole multiple of run.step_s = 0.1")
    expected = "'table.specific_force[1]' -> 'block.specific_force[1]': 'table' steps less often; say between"
    problems = problems_in(written(tmp_path, text))
    assert multiple in problems
    assert [message.startswith(expected) for line, message in problems if (line, message) != multiple] == [True]


def test_effects_and_files_of_a_scenario_are_checked(tmp_path: Path):
    text = STATIC.read_text(encoding="utf-8").replace(
        "[fmus.block]\n",
        "[fmus.block]\neffects = [\n"
        '    { effect = "quadratc", where = "accelerometer-3", coefficient = 1e-4 },\n'
        '    { effect = "quadratic", where = "accelerometer-9", coefficient = 1e-4 },\n'
        '    { effect = "quadratic", where = "accelerometer-3", coeficient = 1e-4 },\n]\n',
    )
    message = "\n".join(message for _, message in problems_in(written(tmp_path, text)))
    assert "effects[1]: effect 'quadratc' is not one that extends a component; did you mean 'quadratic'?" in message
    assert "effects[2]: effect 'quadratic' has no place 'accelerometer-9'; did you mean 'accelerometer-" in message
    assert "effects[3]: effect 'quadratic' has no parameter 'coeficient'; did you mean 'coefficient'?" in message
    assert "stimuli[1]: static-calibration-positions.csv: no such file" in message


def test_a_check_runs_nothing_and_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("trihedron.tools.orchestrator.run.run_fmus", lambda *_: 1 / 0)
    assert th.check(STATIC).good
    assert list(tmp_path.iterdir()) == []


@pytest.mark.acceptance
def test_a_check_agrees_with_the_run(tmp_path: Path):
    """A checked file runs; every refusal of a run is also found by the check."""
    for right, wrong in (
        ("step_s = 0.1", "step_s = 0.0"),
        ('to = "block.dwell"', 'to = "block.specific_force"'),
        ('alpha_deg = "table.angle_reading[1]"', 'alpha_s = "table.angle_reading[1]"'),
        ("[[stimuli]]", '[[stimuli]]\nto = "computer.increment"\nconstant = 0.0\n[[stimuli]]'),
    ):
        text = STATIC.read_text(encoding="utf-8").replace(right, wrong, 1)
        text = text.replace("static-calibration-positions.csv", str(SCENARIOS / "static-calibration-positions.csv"))
        path = written(tmp_path, text)
        with pytest.raises(th.InputError) as refused:
            th.simulate(path)
        problems = problems_in(path)
        assert problems
        assert any(str(refused.value).removeprefix(f"{path}: ") == message for _, message in problems)


def test_a_misspelt_file_names_the_nearest(tmp_path: Path):
    written(tmp_path, "", "scenario.toml")
    with pytest.raises(th.InputError, match=r"scenari\.toml: no such file; did you mean 'scenario\.toml'\?"):
        th.check(tmp_path / "scenari.toml")
    with pytest.raises(th.InputError, match=r"record\.csv: no such file$"):
        th.check(tmp_path / "record.csv")


def test_a_file_that_is_not_toml_has_the_line(tmp_path: Path):
    assert problems_in(written(tmp_path, "[run]\nstep_s = 0.1\nstop_s = = 2\n")) == [(3, "is not TOML: Invalid value")]


def test_a_campaign_with_several_mistakes(tmp_path: Path):
    text = (SCENARIOS / "campaigns" / "attitude-60s.toml").read_text(encoding="utf-8")
    text = text.replace("points = 1024", "pionts = 1024").replace("duration_s = 60.0", 'duration_s = "long"')
    lines = text.split("\n")
    problems = problems_in(written(tmp_path, text))
    assert [line for line, _ in problems] == [lines.index('duration_s = "long"') + 1, lines.index("pionts = 1024") + 1]
    assert "did you mean 'points'?" in problems[1][1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('schema = "trihedron.scenari/1"\n', "schema: 'trihedron.scenari/1' is not known; did you mean"),
        ("[a]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1.1]]\n", "[a]: the matrix is not orthogonal"),
        ("x = 1\n", "schema is missing"),
        ("", "schema is missing"),
    ],
)
def test_other_toml_files(text: str, message: str, tmp_path: Path):
    assert message in problems_in(written(tmp_path, text))[0][1]


@pytest.mark.parametrize("kind", ["campaign", "scenario"])
def test_a_key_that_only_programs_set_is_unknown_in_a_file(kind: str, tmp_path: Path):
    problems = problems_in(written(tmp_path, f'schema = "trihedron.{kind}/1"\nbase_folder = "x"\n'))
    assert (2, "base_folder: unknown key; it is not for files") in problems


def test_a_record_with_many_mistakes_has_each_with_its_row_and_column(record: Path, tmp_path: Path):
    lines = record.read_text(encoding="utf-8").split("\n")
    lines.insert(3, "# a comment moves what follows by a line")
    fields = {k: lines[k].split(",") for k in (5, 7, 9, 11)}
    fields[5][4] = ""
    fields[7][2] = "12,5"
    fields[9][1] = "-1"
    fields[11][-1] = "2"
    for k, row in fields.items():
        lines[k] = ",".join(row)
    assert [
        (line, text.partition(":")[0]) for line, text in problems_in(written(tmp_path, "\n".join(lines), "r.csv"))
    ] == [
        (6, "column f1_mps2"),
        (8, "11 fields, where the header has 10 columns"),
        (10, "column time_s"),
        (12, "column approach_beta"),
    ]


def test_a_good_record_says_what_is_in_it(record: Path):
    checked = th.check(record)
    assert (checked.good, checked.kind) == (True, "position record")
    assert "rows" in checked.summary[0]


@pytest.mark.parametrize(
    "comment", ["# " + "x" * 120_000, "#\tschema " + "y" * 99_990, "# a\n" * 60_000, "# a\x85b\x0bc"]
)
def test_comments_of_any_length_and_letters_stand_before_a_record(comment: str, record: Path, tmp_path: Path):
    text = record.read_text(encoding="utf-8")
    checked = th.check(written(tmp_path, f"{comment}\n{text}", "record.csv"))
    assert checked.good, str(checked)
    assert checked.summary == th.check(record).summary
    assert checked.kind == "position record"


def test_a_channel_at_its_limit_is_a_warning_of_series_of_every_kind(tmp_path: Path):
    """Clip a sine at 80 %; without the clip there is no warning."""
    time = 0.01 * np.arange(3000)
    rate = np.sin(np.outer(time, [1.0, 1.3, 0.7]) + np.array([0.0, 1.0, 2.0]))
    force = 9.8 * np.stack([np.sin(0.4 * time), np.cos(0.4 * time), 0.1 * np.sin(0.9 * time)], axis=1)
    clipped = np.column_stack([np.minimum(rate[:, 0], 0.8), rate[:, 1:]])
    rows = np.flatnonzero(clipped[:, 0] == 0.8)
    message = f"w1: {len(rows)} rows are saturated, at 0.8 rad/s, the first at {time[rows[0]]:g} s"
    for name, gyros, warned in (("whole.csv", rate, ()), ("clipped.csv", clipped, (message,))):
        write_record(StrapdownRecord(time, gyros, None, force), tmp_path / name, decimals=7)
        checked = th.check(tmp_path / name)
        assert checked.good
        assert checked.warnings == warned


@pytest.mark.acceptance
def test_results_are_as_their_schemas_say(record: Path, tmp_path: Path):
    """The check passes the program's own files; changes by hand are found, with the line."""
    results = {
        "calibration": th.calibrate(record, noise_bound=1e-5).json_text(),
        "diagnosis": th.diagnose(record, noise_bound=1e-5).json_text(),
        "plan": th.plan("X4", grid=5.0).json_text(),
    }
    for kind, text in results.items():
        checked = th.check(written(tmp_path, text, f"{kind}.json"))
        assert (checked.kind, str(checked.problems)) == (kind, "()")
    text = results["calibration"]
    wrong = text.replace('"radius":', '"radus":').replace('"convention": "A1"', '"convention": "A3"')
    at = 1 + wrong[: wrong.index('"A3"')].count("\n")
    assert problems_in(written(tmp_path, wrong, "wrong.json")) == [
        (None, "radius: is missing (is 'radus' meant?)"),
        (at, "convention: Input should be 'A1' or 'A2', not 'A3'"),
    ]
    first = json.loads(text)
    first["parameters"][3]["estimate"] = 2.0
    problems = problems_in(written(tmp_path, json.dumps(first, indent=1), "edited.json"))
    assert len(problems) == 1
    assert "exclude one another" in problems[0][1]
    emptied = json.loads(text) | {"reading_errors": []}
    problems = problems_in(written(tmp_path, json.dumps(emptied, indent=1), "emptied.json"))
    assert len(problems) == 1
    assert "reading_errors are not complete" in problems[0][1]


class Part(Result):
    size: float


class Either(Result):
    part: Part
    one: Part | tuple[Part, ...] | None = None


@pytest.mark.parametrize(
    ("one", "message"),
    [
        ({}, "one.size: is missing"),
        ([{}], "one[1].size: is missing"),
        ({"size": []}, "one.size: Input should be a valid number, not []"),
        ([{"size": 1.0}, 2], "one[2]: Input should be an object, not 2"),
    ],
)
def test_of_what_may_be_one_or_several_the_kind_that_is_meant_is_told_and_stands_in_the_file(one: object, message: str):
    content = {"part": {"size": 1.0}, "one": one}
    with pytest.raises(ValidationError) as raised:
        Either.model_validate_json(json.dumps(content), strict=True)
    ((where, text),) = field_problems(raised.value, Either)
    assert text == message
    at: Any = content
    for part in where[:-1]:
        at = at[part]


@pytest.mark.parametrize(
    "content",
    [b"", b"\0\1\2\3", b"PK\3\4 not an archive", b"\xff\xfe\0", b"{", b"[", b'{"a": NaN}', b'{"schema": [1]}'],
)
@pytest.mark.parametrize("ending", [".toml", ".csv", ".json", ".fmu", ".ssp", ".parquet", ".txt"])
def test_rubbish_is_a_problem_never_a_fault(content: bytes, ending: str, tmp_path: Path, capsys):
    path = tmp_path / f"rubbish{ending}"
    path.write_bytes(content)
    assert cli.main(["check", str(path)]) == 2
    message = capsys.readouterr()
    assert message.err.count("\n") == 1
    assert "problem" in message.err
    assert message.out.partition("\n\nNext: ")[0].count("\n") == 1


@pytest.mark.acceptance
def test_fmus_and_ssp_archives(fmu_folder: Path, tmp_path: Path):
    checked = th.check(fmu_folder / "AccelerometerBlock.fmu")
    assert (checked.good, checked.kind) == (True, "FMU")
    assert checked.summary[1] == "inputs: specific_force[1..3], temperature, dwell, rate[1..3], angle[1..2]"
    assert checked.summary[2].startswith("parameters: gravity, scale_error_plus[1..3], ")
    assert checked.summary[3] == "outputs: reading[1..3], increment_reading[1..3]"
    assert max(map(len, str(checked).splitlines()[1:])) <= 80
    from trihedron.tools.orchestrator import read_scenario
    from trihedron.tools.ssp import write_ssp

    archive = tmp_path / "static.ssp"
    write_ssp(read_scenario(STATIC), archive, flavour="python")
    checked = th.check(archive)
    assert (checked.good, checked.kind) == (True, "SSP archive"), str(checked)


def test_lines_of_toml_are_those_of_every_table_and_key():
    """Compare with the structure of tomllib: every location is found, and its line has the key."""
    text = (
        'a = 1\n# comment\n[b.c]\n"d e" = """\n[not.a.table]\n"""\nf.g = [\n  1,\n  [2, 3],\n]\n'
        "[[h]]\ni = { j = 1, k = [1, { l = 2 }] }\n[[h]]\ni = 2\n[h.m]\nn = 1\n[[h.o]]\np = 1\n"
    )
    lines = toml_lines(text)
    assert lines[("a",)] == 1
    assert lines[("b", "c", "d e")] == 4
    assert lines[("b", "c", "f", "g", 1, 0)] == 7
    assert lines[("h", 0, "i", "k", 1, "l")] == 12
    assert lines[("h", 1)] == 13
    assert lines[("h", 1, "m", "n")] == 16
    assert lines[("h", 1, "o", 0, "p")] == 18

    def locations(value, before=()):
        inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, item in inner:
            yield (*before, key)
            yield from locations(item, (*before, key))

    assert set(locations(tomllib.loads(text))) == set(lines)
    assert line_at(lines, ("h", 1, "m", "unknown")) == 15
    assert line_at(lines, ("unknown",)) is None


def test_lines_of_json_are_those_of_every_member():
    text = json.dumps({"a": [1, {"b": 'x"\n{', "c": [[], {}]}], "d": None}, indent=1)
    lines = json_lines(text)
    for location, line in lines.items():
        if isinstance(location[-1], str):
            assert f'"{location[-1]}":' in text.split("\n")[line - 1]
    assert {("a",), ("a", 0), ("a", 1), ("a", 1, "b"), ("a", 1, "c"), ("a", 1, "c", 1), ("d",)} <= set(lines)


def test_a_name_with_control_characters_is_shown_escaped(tmp_path: Path, capsys) -> None:
    (tmp_path / "table.csv").write_text("time_s,\x1b[2Jw1,b\n1,2,3\n")
    assert cli.main(["check", str(tmp_path / "table.csv")]) == 0
    shown = capsys.readouterr().out
    assert "\x1b" not in shown
    assert "\\x1b[2Jw1" in shown
