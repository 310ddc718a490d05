"""`trihedron reproduce`: its output and files, and its refusals."""

import json

import pytest

from trihedron.tools import papers
from trihedron.tools.cli import main


@pytest.fixture
def two_rows(monkeypatch):
    """Use two quick rows in place of all 88."""
    every = papers.reproduce_attitude
    monkeypatch.setattr(papers, "reproduce_attitude", lambda **options: every((12, 56), **options))


@pytest.mark.acceptance
def test_reproduce_attitude(two_rows, tmp_path, capsys):
    out, document = tmp_path / "out", tmp_path / "result.json"
    assert main(["reproduce", "attitude", "--out", str(out), "--json", str(document)]) == 0
    output = capsys.readouterr()
    assert "Table 1: 3 of 3 numbers within 0.2 %" in output.out
    assert "this row ran with M = 41" in output.out
    assert output.err == ""
    assert sorted(path.name for path in out.iterdir()) == ["attitude.csv", "attitude.svg"]
    assert [row["row"] for row in json.loads(document.read_text(encoding="utf-8"))["rows"]] == [12, 56]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "FILE"], "is a file"),
        (["--out", "FOLDER", "--json", "FOLDER/attitude.csv"], "is --out (attitude.csv) too"),
    ],
)
def test_refusals(two_rows, tmp_path, capsys, arguments, words):
    (tmp_path / "file").write_text("", encoding="utf-8")
    places = {"FILE": tmp_path / "file", "FOLDER": tmp_path / "folder"}
    for name, path in places.items():
        arguments = [argument.replace(name, str(path)) for argument in arguments]
    assert main(["reproduce", "attitude", *arguments]) == 2
    output = capsys.readouterr()
    assert words in output.err
    assert output.err.count("\n") == 1
    assert output.out == ""
    assert not (tmp_path / "folder").exists()


def test_the_published_tables_and_their_errors(capsys):
    assert main(["reproduce", "calibration"]) == 0
    out = capsys.readouterr().out
    assert "X3: the accuracy is printed as 1.00; its own weights give 1.0311" in out
    assert "X12: the weights estimate -X12" in out
    assert "18 of the 18 optima are lower" in out
