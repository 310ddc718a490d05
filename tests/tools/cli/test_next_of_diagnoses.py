"""The command after a diagnosis runs and leads further: to the record without its fault, or with the named effect."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generator import SIGMA
from generator.laboratory_faults import drawn_fault
from generator.positions import Session, errors
from generator.wrong_rows import with_wrong_rows
from trihedron.models.effects import EffectPlace
from trihedron.tools import cli
from trihedron.tools.cli.next_step import as_ranges
from trihedron.tools.records import PositionRecord, read_record, write_record

LONG = pytest.mark.acceptance
QUADRATIC = EffectPlace("quadratic", "accelerometer-2")


def answered(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    """Run a command; return its answer and the command that follows."""
    words = shlex.split(line)
    assert words[0] == "trihedron"
    assert cli.main(words[1:]) == 0, f"{line}: {capsys.readouterr().err}"
    text, _, following = capsys.readouterr().out.rstrip("\n").rpartition("\n\nNext: ")
    lines = text.splitlines()
    if words[1] == "diagnose":
        assert max(map(len, lines)) <= 80
        assert not any(line.rstrip().endswith("...") for line in lines), text
    return text, following.replace("\\\n      ", "")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.first(1)
@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize(
    ("kind", "seed", "commands"),
    [
        ("rows", 77, 1),
        ("readings", 77, 1),
        ("stretch exchanged", 77, 1),
        ("break", 77, 1),
        ("σ too small", 78, 2),
        ("row and effect", 77, 3),
        pytest.param("two breaks", 78, 1, marks=LONG),
        pytest.param("break and row", 77, 1, marks=LONG),
        pytest.param("break and effect", 77, 3, marks=LONG),
        pytest.param("turn of the block", 78, 2, marks=LONG),
        pytest.param("stretch disturbed", 78, 1, marks=LONG),
        pytest.param("coarse encoder", 78, 1, marks=LONG),
        pytest.param("rows", 79, 1, marks=LONG),
        pytest.param("break", 80, 1, marks=LONG),
    ],
)
def test_the_commands_lead_from_a_fault_to_a_calibration(kind: str, seed: int, commands: int, capsys):
    fault = drawn_fault(seed, kind)
    write_record(fault.record, Path("record.csv"))
    line = f"trihedron diagnose record.csv --noise-bound {fault.options['noise_bound']!r}"
    done = []
    for _ in range(commands):
        done.append(line)
        _, line = answered(line, capsys)
        assert line not in done
    text, _ = answered(line, capsys)
    assert line.startswith("trihedron calibrate record.csv --noise-bound ")
    assert text.startswith("Consistent"), text
    assert json.loads(Path("calibration.json").read_text())["verdict"] == "consistent"


@pytest.mark.acceptance
def test_rows_left_out_before_stay_left_out(capsys):
    wrong = with_wrong_rows(7, "angle", 36, 3)
    write_record(wrong.record, Path("record.csv"))
    first, *others = wrong.rows
    _, following = answered(f"trihedron diagnose record.csv --noise-bound 1e-5 --without {first}", capsys)
    assert f"--without {as_ranges(sorted(wrong.rows))} " in following
    text, _ = answered(following, capsys)
    assert text.startswith("Consistent")
    assert f"left out as asked: rows {as_ranges(sorted(wrong.rows))}" in text
    assert others


def test_rows_are_left_out_by_their_numbers_in_the_file(capsys):
    session = Session.drawn(np.random.default_rng(5), 24)
    write_record(session.record((), np.zeros((24, 3))), Path("record.csv"))
    whole = read_record("record.csv", PositionRecord)
    shorter = read_record("record.csv", PositionRecord, without="3,20-24")
    assert shorter.position.tolist() == np.delete(whole.position, [2, 19, 20, 21, 22, 23]).tolist()
    assert shorter.numbers.tolist() == [1, 2, *range(4, 20)]
    for text, words in (
        ("25", "rows up to 24, and no row 25"),
        ("x", "the numbers of rows are needed, as 42 or 6,19-30"),
        ("7-3", "7-3 is no row or range of rows"),
        ("0", "0 is no row or range of rows"),
        ("1-24", "leaves no row"),
    ):
        assert cli.main(["calibrate", "record.csv", "--noise-bound", "1e-5", "--without", text]) == 2
        message = capsys.readouterr().err
        assert message.startswith(f"trihedron: --without {text}: ")
        assert words in message


@LONG
def test_an_ambiguous_record_shows_whole_explanations_and_a_plan(capsys):
    # The cube and the odd square of an input are alike within the noise.
    session = Session.drawn(np.random.default_rng(3), 24)
    place = EffectPlace("cubic", "accelerometer-1")
    record = session.record([(place, (1.6e-4,))], errors(np.random.default_rng(3), 24)[0])
    write_record(record, Path("record.csv"))
    text, following = answered(f"trihedron diagnose record.csv --noise-bound {SIGMA!r}", capsys)
    assert text.startswith("The record does not tell which of ")
    assert "\n1. " in text
    assert "\n2. " in text
    assert following.startswith("trihedron plan positions 6 --measured record.csv ")
    answered(following, capsys)
    assert Path("plan").is_dir()


@pytest.mark.acceptance
def test_an_unexplained_record_names_the_rows_that_misfit_most(capsys):
    rng = np.random.default_rng(8)
    session = Session.drawn(rng, 36)
    added = errors(rng, 36)[0]
    added[[4, 9, 17, 23, 30]] += 6e-4 * rng.choice([-1.0, 1.0], (5, 3))
    write_record(replace(session.record((), added)), Path("record.csv"))
    text, following = answered("trihedron diagnose record.csv --noise-bound 1e-5", capsys)
    assert "does not explain the record" in text
    advice = " ".join(text[text.index("Advice:") :].split())
    numbers = {int(word.rstrip(",")) for word in advice.split("rows ")[1].split(" again")[0].split()}
    assert numbers <= {5, 10, 18, 24, 31}
    assert following.endswith("--report diagnose.html")
    answered(following, capsys)
    assert Path("diagnose.html").is_file()
