"""RECORD.decisions.toml: rows left out, rests and turns as a person decided, read by every command."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from by_hand import GRAVITY, Instrument, present
from generator.stands import random_bench, simulated
from hand_sessions import directions, hand_moved, poses
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, write_record

SD = 4e-4


def written(folder: Path) -> Path:
    """Return a file of 20 poses with one that is wrong by 0.1 m/s²."""
    rng = np.random.default_rng(5)
    table = poses(Instrument(5), directions(rng, 20), rng.normal(0.0, SD, (20, 3)))
    first = table["f1_mps2"].to_list()
    first[7] += 0.1
    record = folder / "poses.csv"
    table.with_columns(f1_mps2=pl.Series(first)).write_csv(record)
    return record


def decided(record: Path, *lines: str) -> Path:
    """Write decisions about a record beside it."""
    file = record.with_name("poses.decisions.toml")
    head = ['schema = "trihedron.decisions/1"', f'record_sha256 = "{th.read_record(record).sha256}"']
    file.write_text("\n".join([*head, *lines]) + "\n")
    return file


def test_a_position_left_out_gives_the_numbers_of_a_record_without_it(tmp_path: Path, capsys) -> None:
    record = written(tmp_path)
    lines = record.read_text().splitlines(keepends=True)
    (tmp_path / "without.csv").write_text("".join(line for number, line in enumerate(lines, 1) if number != 9))
    expected = th.calibrate(tmp_path / "without.csv", noise_bound=3e-3, gravity=GRAVITY)
    decided(record, "left_out = [8]")
    options = ["--noise-bound", "3e-3", "--gravity", str(GRAVITY)]
    assert main(["calibrate", str(record), *options, "--json", str(tmp_path / "c.json")]) == 0
    content = json.loads((tmp_path / "c.json").read_text())
    assert "position 8 left out" in capsys.readouterr().out
    assert any("poses.decisions.toml" in line for line in content["warnings"])
    values = {row["symbol"]: row["estimate"] for row in content["parameters"]}
    assert values == {row.symbol: row.estimate for row in expected.parameters}


def copied(table: PositionRecord) -> None:
    table.specific_force[11] = table.specific_force[6]


def exchanged(table: PositionRecord) -> None:
    table.specific_force[12:18, :2] = table.specific_force[12:18, 1::-1]


def slipped(table: PositionRecord) -> None:
    table.alpha[13:] += 0.003


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (copied, {"rows": (12,), "where": ("row-12",), "change": {"readings_of_row": 7}}),
        (slipped, {"before_row": 14, "between_rows": (13, 14)}),
        pytest.param(
            exchanged,
            {"rows": (13, 14, 15, 16, 17, 18), "where": ("rows-13-to-18",)},
            marks=pytest.mark.acceptance,
        ),
    ],
)
def test_answers_beside_positions_left_out_count_the_rows_of_the_file(tmp_path: Path, spoil, named) -> None:
    rng = np.random.default_rng(3)
    made = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    spoil(made)
    write_record(made, tmp_path / "poses.csv")
    decided(tmp_path / "poses.csv", "left_out = [3, 5]")
    result = th.diagnose(tmp_path / "poses.csv", noise_bound=1e-5)
    (best,) = present(result.explanations)
    assert {name: getattr(best, name) for name in named} == named
    if "rows" in named:
        without = th.calibrate(tmp_path / "poses.csv", explained_by=result)
        assert without.verdict == "consistent"
        assert str(named["rows"][0]) in " ".join(without.warnings)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("left_out = [21]", "position 21 is left out"),
        ("left_out = ['a']", "left_out: the numbers of positions"),
        ("rows = [9]", "rows is not a decision"),
        ("rests = [[0.0, 1.0]]", "has no rests"),
        ("rests = [[1.0, 0.0]]", "rest 1"),
        ("rests = [[0.0, 1.0, 'up']]", "is not a face"),
        ("turns = 'w:360'", "is not a turn"),
        ("left_out = [", "is not TOML"),
    ],
)
def test_decisions_that_cannot_be_read_are_refused(tmp_path: Path, line: str, message: str) -> None:
    record = written(tmp_path)
    decided(record, line)
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        th.read_record(record)


def test_decisions_about_another_content_are_refused(tmp_path: Path) -> None:
    record = written(tmp_path)
    decided(record, "left_out = [8]")
    record.write_text(record.read_text().replace("1,", "1,", 1) + "\n# a note\n")
    with pytest.raises(InputError, match="to another content"):
        th.read_record(record)


def test_all_positions_cannot_be_left_out(tmp_path: Path) -> None:
    record = written(tmp_path)
    decided(record, f"left_out = {list(range(1, 21))}")
    with pytest.raises(InputError, match="all positions are left out"):
        th.read_record(record)


@pytest.mark.acceptance
def test_rests_as_decided_give_the_numbers_of_the_same_rests_by_option(tmp_path: Path) -> None:
    _, table = hand_moved(3)
    record = tmp_path / "poses.csv"
    table.write_csv(record)
    # A rest lasts 3 s and a move 2 s; the ends lie between two rows.
    spans = [(5.0 * number + 0.205, 5.0 * number + 2.795) for number in range(14)]
    rests = tmp_path / "rests.csv"
    rests.write_text("from_s,to_s\n" + "".join(f"{begin!r},{end!r}\n" for begin, end in spans))
    expected = th.calibrate(record, rests=rests, gravity=GRAVITY)
    decided(record, f"rests = {[list(span) for span in spans]}")
    result = th.calibrate(record, gravity=GRAVITY)
    for parameter in expected.parameters:
        assert result[parameter.symbol].estimate == parameter.estimate
    assert any(f"{len(spans)} rests as marked" in line for line in result.warnings)


@pytest.mark.acceptance
def test_inspect_and_noise_take_the_rests_as_decided(tmp_path: Path) -> None:
    _, table = hand_moved(3)
    record = tmp_path / "poses.csv"
    table.write_csv(record)
    count = len(th.inspect(record).rests)
    spans = [[5.0 * number + 0.205, 5.0 * number + 2.795] for number in range(14) if number != 6]
    decided(record, f"rests = {spans}")
    assert count == 14
    assert len(th.inspect(record).rests) == 13
    assert th.noise(record).stretches == 13
    assert any("13 rests as marked" in line for line in th.diagnose(record).warnings)


COMMANDS = (
    "check {table}",
    "calibrate {table} --noise-bound 1e-5",
    "diagnose {table} --noise-bound 1e-5",
    "apply calibration.json {table} --out corrected.csv",
    "compare {table} {table}",
    "batch {table} --do calibrate --noise-bound 1e-5 --jobs 1 --out lot",
    "check {walk}",
    "inspect {walk}",
    "calibrate {walk} --gravity 9.81",
    "diagnose {walk}",
    "noise {walk}",
    "apply by-hand.json {walk} --out corrected.csv",
    "attitude {walk}",
    "plan hand --measured {walk}",
    "compare {walk} {walk}",
    "plot {walk} walk.html",
)
"""Every command that takes a record, with a table or a series that has decisions beside it."""


@pytest.fixture(scope="module")
def with_decisions_beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a table and a series, their calibrations, and decisions about both."""
    folder = tmp_path_factory.mktemp("decided")
    rng = np.random.default_rng(3)
    made = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    write_record(made, folder / "table.csv")
    _, walk = hand_moved(4, 12)
    walk.write_csv(folder / "walk.csv")
    table = th.calibrate(folder / "table.csv", noise_bound=1e-5)
    by_hand = th.calibrate(folder / "walk.csv", gravity=9.81)
    for name, result in (("calibration", table), ("by-hand", by_hand)):
        (folder / f"{name}.json").write_text(result.json_text())
    spans = [[5.0 * number + 0.205, 5.0 * number + 2.795, "+1" if number == 2 else ""] for number in range(1, 12)]
    for name, line in (("table", "left_out = [12]"), ("walk", f"rests = {spans}")):
        digest = th.read_record(folder / f"{name}.csv").sha256
        head = f'schema = "trihedron.decisions/1"\nrecord_sha256 = "{digest}"\n'
        (folder / f"{name}.decisions.toml").write_text(head + line.replace("'", '"'))
    return folder


@pytest.mark.acceptance
@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_states_the_decisions_about_its_record(
    words: str, with_decisions_beside: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(with_decisions_beside)
    assert main(words.format(table="table.csv", walk="walk.csv").split()) == 0
    output = " ".join("".join(capsys.readouterr()).split())
    for file in (*Path("lot/results").glob("*.json"), Path("walk.html")):
        if words.startswith(("batch", "plot")) and file.exists():
            output += file.read_text()
    expected = "position 12 left out" if "{table}" in words else "11 rests as marked"
    assert expected in output
