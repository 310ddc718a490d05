"""Position records as laboratories write them: imported, or asked about; never silently misunderstood."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from laboratory_files import Bench, LabFile, position_files, repeated_file
from laboratory_imports import (
    assert_clean,
    import_proposed,
    imported,
    imported_as_asked,
    questions_of,
    refused,
    written,
)
from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.tools import cli
from trihedron.tools.records import PositionRecord, RawRecord, read_record


@pytest.fixture(scope="module")
def bench() -> Bench:
    """Return a run of twenty rests with whole degrees: an ideal table, a block with errors of scale and bias."""
    draw = np.random.default_rng(5)
    alpha, beta = draw.integers(0, 360, (2, 20)).astype(float)
    a, b = np.radians(alpha), np.radians(beta)
    ideal = STANDARD_GRAVITY * np.stack([np.sin(a) * np.sin(b), np.sin(a) * np.cos(b), np.cos(a)], axis=1)
    force = ideal @ (np.eye(3) + 1e-4 * draw.normal(size=(3, 3))) + 1e-3
    return Bench(np.round(np.cumsum(draw.uniform(40.0, 80.0, 20))), alpha, beta, force, np.linspace(21.0, 24.0, 20))


def some_bench() -> Bench:
    """Return a bench of any size, for the names of the files."""
    ones = np.arange(1.0, 41.0)
    return Bench(ones, ones, ones, np.tile(ones[:, None], 3), ones)


NAMES = [file.name for file in position_files(some_bench())]


def file_of(bench: Bench, name: str) -> LabFile:
    return next(file for file in position_files(bench) if file.name == name)


def test_there_are_forty_dialects():
    assert len(NAMES) == len(set(NAMES)) >= 45


@pytest.mark.parametrize("name", NAMES)
def test_a_dialect_is_imported_or_asks_for_what_is_missing(name: str, bench: Bench, tmp_path: Path):
    """Only the missing facts are asked for, at once; with them the record is the clean one, to the last digit
    written."""
    file = file_of(bench, name)
    conversion, record = imported_as_asked(tmp_path, file)
    rows = np.arange(len(bench.time)) if file.rows is None else file.rows
    assert isinstance(record, PositionRecord)
    timed = "dates" not in file.needs and name not in ("no time", "no names")
    assert_clean(record if timed else replace(record, time_s=bench.time[rows]), bench, rows, file.grain)
    if record.temperature is not None:
        assert record.temperature == pytest.approx(bench.temperature[rows], abs=1e-4)
    # the written digits give the resolution: not less, and not ten times more
    assert np.abs(record.specific_force - bench.force[rows]).max() <= 1.001 * record.resolution + 1e-15
    if timed:
        assert np.diff(record.time_s) == pytest.approx(np.diff(bench.time[rows]), abs=1e-5)
    assert conversion.to_json()["rows"] == len(record)


@pytest.mark.parametrize("name", [name for name in NAMES if file_of(some_bench(), name).wrong])
def test_where_a_guess_could_be_wrong_the_other_answer_is_taken_too_or_refused(name: str, bench: Bench, tmp_path: Path):
    """Both answers are possible: the question was necessary."""
    file = file_of(bench, name)
    path = written(tmp_path, file.content)
    if set(file.wrong) & {"units.force", "decimal"}:
        # the size of gravity excludes it
        with pytest.raises(th.InputError, match="gravity"):
            th.import_record(path, answers=file.wrong)
        return
    right, wrong = (th.import_record(path, answers=answers).record for answers in (file.needs, file.wrong))
    assert not np.array_equal(wrong.time_s, right.time_s)


def test_the_proposed_mapping_is_filled_in_and_used_again(bench: Bench, tmp_path: Path, monkeypatch, capsys):
    """One line of the mapping answers; the next file of the same laboratory needs no question."""
    monkeypatch.chdir(tmp_path)
    written(tmp_path, file_of(bench, "g or m/s²?").content)
    assert cli.main(["import", "lab.csv", "--out", "record.csv"]) == 2
    out, err = capsys.readouterr()
    # the open facts, the question, the mapping to fill in
    assert (out, err.count("\n")) == ("", 3)
    assert "--mapping record.import.toml" in err
    assert not Path("record.csv").exists()
    text = Path("record.import.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if '"?"' in line and not line.startswith("#")]
    assert len(lines) == 1
    Path("record.import.toml").write_text(text.replace('force = "?"', 'force = "g"'), encoding="utf-8")
    assert cli.main(["import", "lab.csv", "--out", "record.csv"]) == 2
    assert "was edited; use it with --mapping record.import.toml" in capsys.readouterr().err
    assert cli.main(["import", "lab.csv", "--out", "record.csv", "--mapping", "record.import.toml", "--quiet"]) == 0
    edited = Path("record.import.toml").read_text(encoding="utf-8")
    assert '"?"' not in edited.replace('with "?"', "")
    assert cli.main(["import", "lab.csv", "--out", "next.csv", "--mapping", "record.import.toml", "--quiet"]) == 0
    assert Path("next.csv").read_bytes() == Path("record.csv").read_bytes()
    assert cli.main(["import", "lab.csv", "--out", "third.csv", "--mapping", "next.import.toml", "--quiet"]) == 0
    assert Path("third.csv").read_bytes() == Path("record.csv").read_bytes()


def test_signs_units_and_offsets_of_a_mapping_are_obeyed(bench: Bench, tmp_path: Path):
    path = written(tmp_path, file_of(bench, "other names").content)
    answers = {"columns.f2_mps2.sign": "-1", "columns.f2_mps2.offset": "0.5", "columns.f2_mps2.from": "acc y [m/s²]"}
    record = th.import_record(path, answers=answers).record
    assert record.specific_force[:, 1] == pytest.approx(0.5 - bench.force[:, 1], abs=1e-9)
    assert record.specific_force[:, 0] == pytest.approx(bench.force[:, 0], abs=1e-9)


@pytest.mark.acceptance
@pytest.mark.parametrize("numbered", [True, False])
def test_several_readings_of_a_rest_are_averaged_and_their_scatter_kept(numbered: bool, bench: Bench, tmp_path: Path):
    """The kept standard error is that of the added noise, and bounds the noise if nothing else does."""
    scatter, count = 2e-4, 16
    file = repeated_file(bench, count, scatter, 3, numbered=numbered)
    path = written(tmp_path, file.content)
    if file.needs:
        assert questions_of(path)[0] == {"readings", "kind"}
    conversion = th.import_record(path, out=tmp_path / "record.csv", answers=file.needs)
    record = read_record(tmp_path / "record.csv", PositionRecord)
    error = scatter / np.sqrt(count)
    assert len(record) == len(bench.time)
    assert np.abs(record.specific_force - bench.force).max() < 5.0 * error
    assert record.scatter is not None
    assert record.scatter[0] == pytest.approx([error] * 3, rel=0.15)
    assert conversion.scatter_mps2 == pytest.approx(record.scatter[0], rel=1e-3)
    bound = th.calibrate(record).noise_bound
    assert 2.5 * error < bound * 9.80665 < 4.0 * error


def test_readings_under_one_number_at_other_angles_are_no_readings_of_one_rest(bench: Bench, tmp_path: Path):
    file = repeated_file(bench, 3, 1e-4, 3)
    lines = file.content.decode().splitlines()
    fields = lines[5].split(",")
    fields[2] = "77.0"
    lines[5] = ",".join(fields)
    message = refused(tmp_path, "\n".join(lines))
    assert "row 6: the angles differ from the row before" in message
    assert "--set readings=each" in message


def test_angles_about_zero_are_averaged_round_the_circle(tmp_path: Path):
    rows = ["pos,t [s],alpha [deg],beta [deg],ax [g],ay [g],az [g]"]
    for k in range(4):
        for j, angle in enumerate((359.99, 0.01, 359.99, 0.01)):
            rows.append(f"{k + 1},{10 * k + j},{angle},{(90.0 * k + angle) % 360.0},0.0,0.0,1.0")
    record = imported(tmp_path, "\n".join(rows)).record
    assert np.abs((np.degrees(record.alpha) + 180.0) % 360.0 - 180.0).max() < 1e-9


def test_midnight_passes(tmp_path: Path):
    rows = ["pos,Time of day,alpha [deg],beta [deg],ax [g],ay [g],az [g]"]
    rows += [f"{k},{t},{k},0.0,0.0,0.0,1.0" for k, t in enumerate(("23:59:50", "23:59:58", "00:00:06"), 1)]
    conversion = imported(tmp_path, "\n".join(rows))
    assert conversion.record.time_s == pytest.approx([0.0, 8.0, 16.0])
    assert "midnight passes 1 time" in conversion.notes


def test_decimal_commas_between_commas_are_refused_as_such(bench: Bench, tmp_path: Path):
    file = file_of(bench, "semicolon, decimal comma")
    message = refused(tmp_path, file.content.replace(b";", b","))
    assert "decimal commas between commas cannot be told apart; save it with semicolons" in message


@pytest.mark.parametrize("name", ["German Windows", "German, UTF-16", "tab, decimal point", "other names"])
def test_check_and_diagnose_propose_the_import(name: str, bench: Bench, tmp_path: Path, monkeypatch, capsys):
    """A file that may become a record is answered with the command that makes it one."""
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, file_of(bench, name).content)
    import_proposed(path, capsys)
    assert cli.main(["import", str(path), "--out", "RECORD.csv", "--quiet"]) == 0
    assert th.check("RECORD.csv").good


def test_a_mapping_takes_all_rows_of_a_longer_file(bench: Bench, tmp_path: Path):
    """Lines are searched in each file: the next one has another head and more rows."""
    file = file_of(bench, "footer")
    lines = file.content.decode().splitlines()
    first = imported(tmp_path, "\n".join([*lines[:20], "", "Ende der Messung"]), out=tmp_path / "first.csv")
    assert (first.rows, first.left_out) == (19, ("lines below row 20",))
    long = imported(tmp_path, "\n".join(["Titel", "", *lines]), mapping=tmp_path / "first.import.toml")
    assert long.rows == len(bench.time)


def rows_with(names: str, cells: list[str]) -> str:
    """Return a table of three rests of a level block, with cells of its own in front."""
    return "\n".join([names, *(f"{front};{20 * k};{30 * k};0,0;0,0;1,0" for k, front in enumerate(cells))])


READINGS = "alpha [deg];beta [deg];ax [g];ay [g];az [g]"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            rows_with(f"Nr;t [s];{READINGS}", ["1;0", "2;9.5", "3;20"]),
            "--set decimal=. or --set decimal=, ('9.5' and '0,0'",
        ),
        (rows_with(f"Nr;t [s];{READINGS}", ["1;0", "2;1.234", "3;2.345"]), "--set thousands=. ('1.234' beside '0,0'"),
        (rows_with(f"Nr;t [s];{READINGS}", ["1;0", "2;9,5", "Mittel;20"]), "--set missing=Mittel (row 4, 'Nr'"),
        (rows_with(f"Nr;Zeit;{READINGS}", ["1;früh", "2;später", "3;spät"]), "holds no numbers, but 'früh'"),
        (rows_with(f"Nr;Zeit [s];alpha;{READINGS}", ["1;0;1", "2;9;2", "3;20;3"]), "--set columns.alpha_deg="),
        (
            rows_with(f"Nr;t [foo];{READINGS}", ["1;0", "2;9,5", "3;20"]),
            "'foo' of 't [foo]' is not a known unit of time",
        ),
        (rows_with(f"Nr;t [s];Temp [°C];{READINGS}", ["1;0;", "2;9;", "3;20;21,5"]), "columns.temperature_degC=none"),
        (rows_with(f"Nr;t [s];{READINGS}", ["1;0", "2;", "3;20"]), "incomplete=leave out"),
        (rows_with(f"Nr;t [s];{READINGS}", ["1;0", "2;9", "3;20"]).replace("[g]", "[m/s²]"), "units.force=UNIT states"),
        (rows_with(f"Nr;t [s];{READINGS}", ["1;20", "2;10", "3;0"]), "row 3, column time_s: 10 after 20 runs back"),
    ],
    ids=lambda value: value[:40] if "--set" in value else "",
)
def test_what_is_doubtful_is_asked_and_named(text: str, message: str, tmp_path: Path):
    line = refused(tmp_path, text)
    assert message in line
    assert "facts" not in line


@pytest.mark.parametrize(
    ("text", "time"),
    [
        (rows_with(f"Stellung;t [s];{READINGS}", ["P1;0", "P2;10", "P3;20"]), [0.0, 10.0, 20.0]),
        (rows_with(f"№;Время [мс];{READINGS}", ["1;0", "2;10000", "3;20000"]), [0.0, 10.0, 20.0]),
        (rows_with(f"Nr;Zeit;{READINGS}", ["1;10:00:00:500", "2;10:00:10:500", "3;10:00:20:500"]), [0.0, 10.0, 20.0]),
        (
            rows_with(f"Nr;Date;Time;{READINGS}", [f"{k};02/13/2026;10:00:{10 * k} PM" for k in (1, 2, 3)]),
            [0.0, 10.0, 20.0],
        ),
        (rows_with(f"Nr;Datum;{READINGS}", [f"{k};{k}. Okt 2026" for k in (1, 2, 3)]), [0.0, 86400.0, 172800.0]),
        (rows_with(f"Nr;t [s];Temp;{READINGS}", ["1;0;", "2;10;", "3;20;"]), [0.0, 10.0, 20.0]),
    ],
)
def test_what_is_not_doubtful_is_not_asked(text: str, time: list[float], tmp_path: Path):
    record = imported(tmp_path, text).record
    assert record.time_s == pytest.approx(time)
    assert record.position.tolist() == [1, 2, 3]


def test_a_time_series_of_a_table_is_a_raw_record_where_it_is_said_to_be_one(tmp_path: Path):
    """Stationary rows may be a series or several readings: the file does not tell."""
    count = 60
    alpha = np.repeat([0.0, 90.0, 180.0], 20) + 1e-4 * np.sin(np.arange(count))
    rows = [f"{0.1 * k:.1f};{alpha[k]:.5f};0.0;0.0;{np.cos(np.radians(alpha[k])):.6f};0.1" for k in range(count)]
    names = "t [s];alpha [deg];beta [deg];ax [g];ay [g];az [g]"
    rows = [row.replace(";0.1", f";{np.cos(np.radians(alpha[k])):.6f}") for k, row in enumerate(rows)]
    path = written(tmp_path, "\n".join([names, *rows]))
    assert questions_of(path)[0] == {"readings", "kind"}
    record = th.import_record(path, answers={"kind": "raw record"}).record
    assert isinstance(record, RawRecord)
    assert np.degrees(record.alpha) == pytest.approx(alpha, abs=1e-5)
    assert len(th.import_record(path, answers={"readings": "average"}).record) == 3
    assert len(th.import_record(path, answers={"readings": "each"}).record) == count
