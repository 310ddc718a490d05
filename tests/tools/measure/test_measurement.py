"""A session at a simulated table, fed piece by piece: the record, the rests, the promise; killed and resumed."""

import json
import os
import random
import subprocess
import sys
import time
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

from planning_tasks import planned
from simulated_table import HEADER, SimulatedTable, text_of
from trihedron.tools.errors import InputError
from trihedron.tools.measure import Measurement, Session, SessionOptions, read_programme, source_of
from trihedron.tools.measure.programme import TableProgramme
from trihedron.tools.measure.readings import ByteSource
from trihedron.tools.records import PositionRecord, read_record
from trihedron.tools.reports import promise_text, visit_text

POSITIONS = list(product((20, 65, 110, 155), (25, 145, 265)))
SIGMA = 1e-5


def write_positions(path: Path, shift: int = 0) -> None:
    """Write the positions as a table, with α shifted by this angle [deg]."""
    lines = ["alpha_deg,beta_deg"]
    for alpha, beta in POSITIONS:
        lines.append(f"{alpha + shift},{beta}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plan.csv"
    write_positions(path)
    return path


@pytest.fixture(scope="module")
def programme(plan: Path) -> TableProgramme:
    return read_programme(plan)


@pytest.fixture(scope="module")
def growing(tmp_path_factory) -> Path:
    """Return twelve positions, the fourth knocked and visited again; a comment in between."""
    table = SimulatedTable(tmp_path_factory.mktemp("table") / "growing.csv")
    for k, at in enumerate(POSITIONS):
        table.go(*at, knocked=k == 3)
        if k == 3:
            table.write("# operator: somebody came in\n")
            table.go(at[0] + 2.0, at[1], 1.0)
            table.go(*at)
    return table.file


def begun(programme: TableProgramme, out: Path, *, resume: bool = False, **question) -> Measurement:
    return Measurement.begun(
        programme, SessionOptions(SIGMA, dwell_s=5.0, **question), out, "growing.csv", resume=resume
    )


def closed(measurement: Measurement) -> Session:
    """Return the session of a measurement whose process is gone."""
    measurement.files.close()
    return measurement.session


def fed(measurement: Measurement, readings: bytes, pieces: random.Random | None = None) -> Session:
    """Feed readings, in pieces of any length, and end."""
    while readings:
        size = len(readings) if pieces is None else pieces.randrange(1, 20_000)
        measurement.feed(readings[:size])
        readings = readings[size:]
    measurement.feed(b"", ended=True)
    return closed(measurement)


@pytest.fixture(scope="module")
def finished(programme, growing, tmp_path_factory) -> Session:
    return fed(begun(programme, tmp_path_factory.mktemp("finished") / "m.csv"), growing.read_bytes())


@pytest.mark.acceptance
def test_the_record_and_its_positions_are_those_of_an_ordinary_run(finished: Session, growing: Path):
    assert finished.path.read_bytes() == growing.read_bytes()
    usual = read_record(growing, PositionRecord)
    ours = read_record(finished.path.with_name("m.positions.csv"), PositionRecord)
    assert len(usual) == 12
    for name in ("time_s", "alpha", "beta", "specific_force", "approach_alpha", "approach_beta"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(usual, name), err_msg=name)
    assert ours.resolution == usual.resolution


@pytest.mark.acceptance
def test_the_bad_rest_is_seen_and_its_repetition_counts(finished: Session):
    (bad,) = [visit for visit in finished.visits if visit.bad]
    assert bad.number == 4
    assert "a knock in row" in bad.bad
    assert "come back" in visit_text(finished, bad)
    assert finished.setting_of == (1, 2, 3, 4, 4, 5, 6, 7, 8, 9, 10, 11, 12)
    assert not finished.left


@pytest.mark.acceptance
def test_errors_shrink_to_the_promise_and_it_is_said(finished: Session):
    determined = []
    for standing in finished.history:
        determined.append(18 - list(standing.errors.values()).count(None))
    assert determined == sorted(determined)
    assert determined[0] == 0
    assert determined[-1] == 18
    complete = [standing for standing in finished.history if None not in standing.errors.values()]
    assert len(complete) == 5
    for name in finished.programme.promised:
        for before, after in pairwise(complete):
            largest = 1.01 * (before.errors[name] or 0.0)
            assert 0.0 < (after.errors[name] or 0.0) <= largest
    assert finished.reached
    assert "you can stop" in promise_text(finished)
    for number, standing in enumerate(finished.history, start=1):
        within_promise = True
        for name in standing.errors:
            share = finished.share(name, standing)
            within_promise = within_promise and share is not None and share <= finished.asked.within
        assert within_promise == (number == 12)
    assert len(finished.history) == 12


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(20))
def test_pieces_and_a_kill_at_any_byte_change_nothing(seed: int, finished: Session, growing: Path, programme, tmp_path):
    readings, draw = growing.read_bytes(), random.Random(seed)
    out = tmp_path / "m.csv"
    measurement = begun(programme, out)
    at = draw.randrange(2000, len(readings))
    sent = readings[:at]
    while sent:
        measurement.feed(sent[:7000])
        sent = sent[7000:]
    # the process is gone; its last write may end anywhere
    closed(measurement)
    cut = readings[: readings.rfind(b"\n", 0, at) + 1]
    assert out.read_bytes() == cut
    out.write_bytes(cut[: len(cut) - draw.randrange(0, 60)])
    session = fed(begun(programme, out, resume=True), readings, draw)
    # the comment may precede a skipped row
    rows_expected = [line for line in readings.splitlines() if not line.startswith(b"#")]
    assert [line for line in out.read_bytes().splitlines() if not line.startswith(b"#")] == rows_expected
    assert session.setting_of == finished.setting_of
    assert [v.bad for v in session.visits][:3] == [v.bad for v in finished.visits][:3]
    assert session.standing.errors == finished.standing.errors


@pytest.mark.acceptance
def test_words_are_written_and_followed_again(growing: Path, programme, tmp_path):
    measurement = begun(programme, tmp_path / "m.csv")
    measurement.feed(growing.read_bytes())
    assert not measurement.hear({"word": "repeat", "visit": 2})
    for refused in ({"word": "repeat", "visit": 4}, {"word": "repeat"}, {"word": "add", "settings": []}):
        assert not measurement.hear(refused), "a bad rest is repeated anyway"
        assert measurement.news.pop()[0] == "refused"
    before = closed(measurement)
    assert before.state_of(before.programme.settings[1]) == "repeat"
    assert [setting.number for setting in before.left] == [2, 12], "the table is at the twelfth still"
    lines = (tmp_path / "m.session.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line).get("word") for line in lines] == [None, "repeat"]
    again = closed(begun(programme, tmp_path / "m.csv", resume=True))
    assert again.dropped == before.dropped == frozenset({2})
    assert again.standing == before.standing


@pytest.mark.acceptance
def test_what_is_no_row_is_left_out_and_counted(growing: Path, programme, tmp_path):
    lines = growing.read_text(encoding="utf-8").splitlines(keepends=True)
    last = lines[60].split(",")
    wrong = [",".join([time, *last[1:]]) for time in ("1e300", "0.25", "nan", "14 .0")]
    wrong += ["1.5,2,3\n", "\x00\x01garbage\n"]
    spoilt = [*lines[:61], *wrong, HEADER, *lines[61:]]
    measurement = begun(programme, tmp_path / "m.csv")
    session = fed(measurement, "".join(spoilt).encode())
    assert measurement.left_out == len(wrong)
    assert (tmp_path / "m.csv").read_bytes() == growing.read_bytes()
    assert session.reached


@pytest.mark.acceptance
def test_numbers_without_a_header_have_the_usual_columns(growing: Path, programme, tmp_path):
    readings = growing.read_bytes()
    fed(begun(programme, tmp_path / "m.csv"), readings.partition(b"\n")[2])
    assert (tmp_path / "m.csv").read_bytes() == readings


@pytest.mark.parametrize(
    ("readings", "message"),
    [
        (b"time,alpha\n1,2\n", "missing for a raw record"),
        (b"position," + HEADER.encode() + b"1,2\n", "holds averaged positions"),
        (b"\xff\xfe\n", "is not UTF-8"),
        (b"\0\0\n", "is binary"),
        (b"a;b;c\n", "use commas"),
    ],
)
def test_another_table_is_refused_and_nothing_is_written(readings: bytes, message: str, programme, tmp_path):
    measurement = begun(programme, tmp_path / "m.csv")
    with pytest.raises(InputError, match=message):
        measurement.feed(readings)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.acceptance
def test_scatter_and_drift_beyond_the_promise_are_bad(programme, tmp_path):
    table = SimulatedTable(tmp_path / "growing.csv")
    noise = np.random.default_rng(3)
    rows = table.rows(*POSITIONS[0])
    rows[-24:, 3:] += noise.normal(0.0, 3e-4, (24, 3))
    shaken = text_of(rows)
    rows = table.rows(*POSITIONS[1])
    rows[-24:, 5] += np.linspace(0.0, 4e-4, 24)
    drifting = text_of(rows)
    table.write(shaken + drifting)
    table.go(*POSITIONS[2])
    table.go(*POSITIONS[1])
    session = fed(begun(programme, tmp_path / "m.csv"), table.file.read_bytes())
    bad = [visit.bad for visit in session.visits]
    assert "by its scatter" in bad[0]
    assert "f3 drifts by 3.8e-5 g" in bad[1]
    assert bad[2:] == ["", ""]
    assert session.setting_of == (1, 2, 3, 2)
    assert [setting.number for setting in session.left[:2]] == [1, 4]


def test_another_plan_or_another_process_is_refused(growing, programme, tmp_path):
    measurement = begun(programme, tmp_path / "m.csv")
    measurement.feed(growing.read_bytes()[:5000])
    with pytest.raises(InputError, match="is there already"):
        begun(programme, tmp_path / "m.csv")
    with pytest.raises(InputError, match="another process"):
        begun(programme, tmp_path / "m.csv", resume=True)
    closed(measurement)
    write_positions(tmp_path / "other.csv", shift=1)
    with pytest.raises(InputError, match="another plan"):
        begun(read_programme(tmp_path / "other.csv"), tmp_path / "m.csv", resume=True)
    with pytest.raises(InputError, match="another gravity"):
        begun(programme, tmp_path / "m.csv", resume=True, gravity=9.81)


def test_positions_that_are_all_to_be_repeated_leave_no_file_of_positions(programme, tmp_path):
    table = SimulatedTable(tmp_path / "growing.csv")
    for at in POSITIONS[:2]:
        table.go(*at)
    measurement = begun(programme, tmp_path / "m.csv")
    measurement.feed(table.file.read_bytes())
    assert (tmp_path / "m.positions.csv").exists()
    measurement.hear({"word": "repeat", "visit": 1})
    closed(measurement)
    assert not (tmp_path / "m.positions.csv").exists()


@pytest.mark.parametrize("word", ['"word": 3', '"visit": 1', '"word": "add", "settings": 3', '"word": "repeat"'])
def test_a_word_that_cannot_be_followed_again_is_refused_in_a_line(word: str, growing, programme, tmp_path):
    measurement = begun(programme, tmp_path / "m.csv")
    measurement.feed(growing.read_bytes()[:5000])
    closed(measurement)
    with (tmp_path / "m.session.jsonl").open("a", encoding="utf-8") as file:
        file.write(f'{{"rows": 3, {word}}}\n')
    with pytest.raises(InputError, match=r"m\.session\.jsonl: .* cannot be followed"):
        begun(programme, tmp_path / "m.csv", resume=True)


def test_positions_that_determine_nothing_are_no_plan(tmp_path):
    path = tmp_path / "few.csv"
    path.write_text("alpha_deg,beta_deg\n20,25\n65,145\n", encoding="utf-8")
    with pytest.raises(InputError, match="its 2 positions do not determine X1"):
        read_programme(path)


@pytest.mark.first(1)
@pytest.mark.parametrize("number", [0, 9])
def test_a_programme_with_a_position_that_the_plan_lacks_is_refused(number: int, tmp_path):
    plan = planned(8).to_json()
    plan["programme"][0] = number
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan), encoding="utf-8")
    with pytest.raises(InputError, match=f"programme: {number} is not a position of the plan"):
        read_programme(path)


def all_of(source: ByteSource, size: int) -> bytes:
    """Return this number of bytes, as they come."""
    readings, ends = b"", time.monotonic() + 20.0
    while len(readings) < size and time.monotonic() < ends:
        readings += source.read() or b""
    return readings


@pytest.mark.acceptance
def test_a_file_that_does_not_come_is_told_without_a_terminal_too(plan: Path, tmp_path: Path):
    words = ["measure", str(plan), "--from", "later.csv", "--out", "out.csv", "--noise-bound", "1e-5"]
    command = [sys.executable, "-m", "trihedron.tools.cli", *words, "--patience", "6"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert run.stderr.splitlines() == [
        "later.csv: no such file yet; waiting for it",
        "trihedron: later.csv: no such file",
    ]


def test_a_file_may_come_later_and_grow_but_not_shrink(tmp_path: Path):
    file = tmp_path / "later.csv"
    source = source_of(str(file))
    assert source.read() == b""
    assert source.trouble.endswith("later.csv: no such file yet")
    file.write_bytes(b"one\ntw")
    assert source.read() == b"one\ntw"
    assert source.trouble == ""
    with file.open("ab") as grown:
        grown.write(b"o\n")
    assert [source.read(), source.read()] == [b"o\n", b""]
    file.write_bytes(b"new\n")
    with pytest.raises(InputError, match="has become shorter"):
        source.read()
    source.close()


@pytest.mark.skipif(sys.platform == "win32", reason="a pipe with a name")
def test_a_pipe_with_a_name_is_read_to_its_end(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    # A reader waits for a writer, unless one process does both.
    write = os.open(tmp_path / "pipe", os.O_RDWR)
    source = source_of(str(tmp_path / "pipe"))
    assert source.read() == b""
    os.write(write, b"a,b\n")
    assert all_of(source, 4) == b"a,b\n"
    os.close(write)
    ends = time.monotonic() + 20.0
    while source.read() is not None:
        assert time.monotonic() < ends
    source.close()


@pytest.mark.parametrize(
    ("name", "message"),
    [("none/x.csv", "there is no folder"), ("/dev/null", "is a device"), (".", "is not a regular file")],
)
def test_what_is_no_source_is_refused(name: str, message: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        source_of(name).read()
