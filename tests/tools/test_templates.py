"""`trihedron new`: its files work as they describe."""

import re
from pathlib import Path

import pytest

import trihedron as th
from trihedron.tools import cli
from trihedron.tools.templates import TEMPLATES


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_new_scenario_runs_and_calibrates_as_it_is():
    """The plan of 24 has a position twice, which makes two rests."""
    assert th.new("scenario", "bench.toml", positions=24) == [Path("bench.toml"), Path("bench-positions.csv")]
    assert th.check("bench.toml").good
    assert th.check("bench-positions.csv").kind == "position programme"
    run = th.simulate("bench.toml")
    assert run.positions is not None
    assert len(run.positions) == 24
    assert th.calibrate(run, noise_bound=1e-5).verdict == "consistent"


def test_the_effect_that_a_new_scenario_suggests_is_one():
    th.new("scenario", "bench.toml")
    text = Path("bench.toml").read_text(encoding="utf-8")
    Path("bench.toml").write_text(re.sub(r"(?m)^# (effects = )", r"\1", text), encoding="utf-8")
    assert "\neffects = " in Path("bench.toml").read_text(encoding="utf-8")
    assert th.check("bench.toml").good


def test_a_new_record_names_each_field_that_is_to_be_filled_in():
    th.new("record", "r.csv", positions=8)
    lines = Path("r.csv").read_text(encoding="utf-8").split("\n")
    problems = th.check("r.csv").problems
    assert len(problems) == 8 * 4
    assert all("the field is empty" in problem.text for problem in problems)
    assert {problem.line for problem in problems} == {k for k, line in enumerate(lines, 1) if re.match(r"\d", line)}


def test_a_record_that_was_filled_in_calibrates():
    """Use angles from the template, and readings of a simulated bench at them."""
    th.new("scenario", "bench.toml", positions=14)
    th.new("record", "r.csv", positions=14)
    positions = th.simulate("bench.toml").positions
    assert positions is not None
    measured = positions.to_polars()[:, :7]
    rows = iter(measured.iter_rows(named=True))
    filled = []
    for line in Path("r.csv").read_text(encoding="utf-8").split("\n"):
        if re.match(r"\d", line):
            row, fields = next(rows), line.split(",")
            assert float(fields[2]) == pytest.approx(row["alpha_deg"] % 360, abs=0.5)
            line = ",".join([fields[0], *(repr(row[c]) for c in measured.columns[1:])])
        filled.append(line)
    Path("r.csv").write_text("\n".join(filled), encoding="utf-8")
    assert th.check("r.csv").good
    assert th.calibrate("r.csv", noise_bound=1e-5).verdict == "consistent"


@pytest.mark.parametrize("kind", TEMPLATES)
def test_each_kind_is_written_checked_and_never_over_a_file(kind: str, capsys):
    assert cli.main(["new", kind]) == 0
    files = capsys.readouterr().out.split()
    assert sorted(files) == sorted(path.name for path in Path().iterdir())
    before = {name: Path(name).read_bytes() for name in files}
    checked = [th.check(name) for name in files]
    assert all(c.good or all("is empty" in p.text for p in c.problems) for c in checked)
    assert cli.main(["new", kind]) == 2
    assert "is there already" in capsys.readouterr().err
    assert before == {path.name: path.read_bytes() for path in Path().iterdir()}


def test_all_or_nothing():
    """If the programme's name is taken, no scenario is written."""
    Path("bench-positions.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(th.InputError, match=r"bench-positions\.csv: is there already"):
        th.new("scenario", "bench.toml")
    assert [path.name for path in Path().iterdir()] == ["bench-positions.csv"]
