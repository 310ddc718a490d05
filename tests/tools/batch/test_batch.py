"""Batches of records: rows with reasons, folders of instruments, resume, and properties that the instruments of a lot
share."""

import json
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

import trihedron as th
from generator.lots import SIGMA, serial_of, write_lot
from generator.stands import Stand
from trihedron.models.effects import EffectPlace
from trihedron.tools.cli import main

COUNT, STEP_AT, ODD = 36, 20, 5
TOLERANCE = """schema = "trihedron.tolerance/1"
[parameters]
X16 = { low = -2e-2, high = 2e-2 }
"""


def changed(number: int, stand: Stand) -> Stand:
    """Move the bias of accelerometer 1 from a serial number on, and that of accelerometer 3 of one instrument."""
    bias = stand.bias.copy()
    bias[0] += 0.04 * (number >= STEP_AT)
    bias[2] += 0.09 * (number == ODD)
    return replace(stand, bias=bias)


@pytest.fixture(scope="module")
def lot(tmp_path_factory) -> Path:
    """Write a lot with a step and an odd instrument, and two records that cannot be used; calibrate it."""
    folder = tmp_path_factory.mktemp("lot")
    table = write_lot(folder, COUNT, 3, changed=changed, positions=24)
    (folder / "broken.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    with table.open("a", encoding="utf-8") as stream:
        stream.write("broken.csv,U-500,,\nmissing.csv,U-501,,\n")
    (folder / "tolerance.toml").write_text(TOLERANCE, encoding="utf-8")
    command = ["batch", str(table), "--do", "calibrate", "--noise-bound", "1e-5", "--out", str(folder / "out")]
    assert main([*command, "--jobs", "1", "--tolerance", str(folder / "tolerance.toml")]) == 0
    return folder


def contents_of(folder: Path) -> dict[str, bytes]:
    """Return every file of a batch, by its path."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_results_equal_single_commands(lot):
    content = json.loads((lot / "out" / "lot.json").read_text(encoding="utf-8"))
    for member in content["members"][:3]:
        alone = th.calibrate(lot / member["record"], noise_bound=SIGMA)
        result = json.loads((lot / "out" / member["result"]).read_text(encoding="utf-8"))
        alone_json = alone.to_json()
        assert result["parameters"] == alone_json["parameters"]
        assert result["verdict"] == alone_json["verdict"] == member["verdict"]


@pytest.mark.acceptance
def test_bad_records_are_rows_with_reasons(lot):
    table = pl.read_parquet(lot / "out" / "records.parquet")
    assert table.height == COUNT + 2
    failed = table.filter(pl.col("failed").is_not_null())
    assert failed["record"].to_list() == ["broken.csv", "missing.csv"]
    assert "no such file" in failed["failed"][1]
    assert str(lot) not in failed["failed"][1]
    assert table["X16"].null_count() == 2


def test_step_and_odd_instrument_are_named(lot):
    content = json.loads((lot / "out" / "lot.json").read_text(encoding="utf-8"))
    assert [(odd["serial"], odd["symbol"]) for odd in content["odd"]] == [(serial_of(ODD), "X18")]
    (dependence,) = content["dependences"]
    assert dependence["symbol"] == "X16"
    assert dependence["against"] == "serial"
    assert dependence["since"] == serial_of(STEP_AT)
    assert dependence["low"] < 0.04 < dependence["high"]


def test_tolerance_gives_pass_or_fail_with_reason(lot):
    content = json.loads((lot / "out" / "lot.json").read_text(encoding="utf-8"))
    for member in content["members"]:
        if "failed" in member:
            assert member["status"] == "undecided"
            continue
        value = member["values"]["X16"]
        inside = value["low"] >= -2e-2 and value["high"] <= 2e-2
        assert member["status"] == ("pass" if inside else "fail")
        assert inside or member["reason"].startswith("X16 = ")
    assert content["first_out"] == serial_of(STEP_AT)


def test_folder_is_one_of_instruments(lot):
    entries = th.instrument_list(lot / "out" / "instruments" / serial_of(4)).entries
    assert [entry.serial for entry in entries] == [serial_of(4)]
    assert entries[0].kind == "calibration"


@pytest.mark.acceptance
def test_resume_works_on_missing_records_alone(lot, tmp_path, monkeypatch):
    files = [lot / f"record-{k}.csv" for k in range(4)]
    whole = th.batch(*files, do="calibrate", noise_bound=SIGMA, out=tmp_path / "whole", jobs=1)
    th.batch(*files[:2], do="calibrate", noise_bound=SIGMA, out=tmp_path / "part", jobs=1)
    present = {path: path.stat().st_mtime_ns for path in (tmp_path / "part" / "results").iterdir()}
    resumed = th.batch(*files, do="calibrate", noise_bound=SIGMA, out=tmp_path / "part", jobs=1, resume=True)
    assert resumed == whole
    assert contents_of(tmp_path / "part") == contents_of(tmp_path / "whole")
    assert {path: path.stat().st_mtime_ns for path in present} == present


@pytest.mark.acceptance
def test_resume_works_again_on_what_its_files_no_longer_tell(lot, tmp_path):
    """A calibration, a mounting or decisions that changed since change the result."""
    record = tmp_path / "record.csv"
    record.write_bytes((lot / "record-0.csv").read_bytes())
    options = {"do": "calibrate", "noise_bound": SIGMA, "out": tmp_path / "calibrated", "jobs": 1}
    before = th.batch(record, **options)
    decisions = tmp_path / "record.decisions.toml"
    digest = th.read_record(record).sha256
    decisions.write_text(f'schema = "trihedron.decisions/1"\nrecord_sha256 = "{digest}"\nleft_out = [3]\n')
    after = th.batch(record, **options, resume=True)
    expected = th.calibrate(record, noise_bound=SIGMA)
    assert after.members[0].values["X16"].low == expected["X16"].low != before.members[0].values["X16"].low
    calibration = tmp_path / "calibration.json"
    calibration.write_text(th.calibrate(lot / "record-0.csv", noise_bound=SIGMA).json_text())
    applied = {"do": "apply", "calibration": calibration, "out": tmp_path / "applied", "jobs": 1}
    first = th.batch(record, **applied).members[0].result
    calibration.write_text(th.calibrate(lot / "record-1.csv", noise_bound=SIGMA).json_text())
    assert th.batch(record, **applied, resume=True).members[0].result != first


@pytest.mark.acceptance
def test_processes_give_the_same_bytes(lot, tmp_path):
    files = [lot / f"record-{k}.csv" for k in range(6)]
    for jobs in (1, 2):
        th.batch(*files, do="calibrate", noise_bound=SIGMA, out=tmp_path / str(jobs), jobs=jobs)
    assert contents_of(tmp_path / "1") == contents_of(tmp_path / "2")


def test_next_command_opens_a_record_of_the_table(lot, tmp_path, capsys):
    (tmp_path / "lot.csv").write_text(f"file,serial\nmissing.csv,\n{lot}/record-2.csv,{serial_of(2)}\n", "utf-8")
    command = ["batch", str(tmp_path / "lot.csv"), "--do", "apply", "--with", str(lot / "out"), "--jobs", "1"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    # A long path is on a line of its own.
    shown = " ".join(capsys.readouterr().out.replace("\\\n", " ").split())
    assert shown.endswith(f"Next: trihedron open {lot}/record-2.csv")


@pytest.mark.acceptance
def test_apply_takes_each_instruments_own_calibration(lot, tmp_path):
    applied = th.batch(lot / "lot.csv", do="apply", calibration=lot / "out", out=tmp_path / "applied", jobs=1)
    for member in applied.members[:2]:
        assert member.failed is None
    assert [member.record for member in applied.members if member.failed] == ["broken.csv", "missing.csv"]
    assert len(list((tmp_path / "applied" / "corrected").iterdir())) == COUNT


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["lot.csv", "--do", "calibrate", "--with", "x.json", "--out", "new"], "--with: is not an option of"),
        (["record-0.csv", "record-0.csv", "--do", "calibrate", "--out", "new"], "is given twice"),
        (["lot.csv", "record-0.csv", "--do", "calibrate", "--out", "new"], "give it alone"),
        (["record-0.csv", "--do", "apply", "--out", "new"], "needs a calibration"),
        (["record-0.csv", "--do", "calibrate", "--out", "out"], "--resume"),
        (["record-0.csv", "--do", "diagnose", "--out", "out", "--resume"], "is a batch of calibrate"),
    ],
)
def test_refusals(lot, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(lot)
    assert main(["batch", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not (lot / "new").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("file,serail\na.csv,1\n", "column 'serail' is unknown"),
        ("file,noise_bound\na.csv,small\n", "row 1, column 'noise_bound': 'small' is not a number"),
        ("file,date\na.csv,yesterday\n", "write a date as 2026-11-23"),
        ("file,serial\n,3\n", "row 1, column 'file': is empty"),
        ("file,serial\n", "no record"),
    ],
)
def test_faults_of_a_table(tmp_path, content, words):
    (tmp_path / "table.csv").write_text(content, encoding="utf-8")
    with pytest.raises(th.InputError, match=words):
        th.batch(tmp_path / "table.csv", do="calibrate", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_table_of_another_language_is_read(lot, tmp_path):
    text = (lot / "lot.csv").read_text(encoding="utf-8").splitlines()[:3]
    (lot / "german.csv").write_text("\ufeff" + "\r\n".join(text).replace(",", ";"), encoding="utf-8")
    result = th.batch(lot / "german.csv", do="calibrate", noise_bound=SIGMA, out=tmp_path / "out", jobs=1)
    assert result.verdicts == {"consistent": 2}


@pytest.mark.acceptance
def test_a_lot_tells_the_shared_cause_and_the_odd_one(tmp_path):
    shared = EffectPlace("quadratic", "accelerometer-2"), (4e-4,)
    hidden = {number: [shared] for number in range(40, 60) if number % 10 not in (2, 5, 8)}
    hidden[11] = [(EffectPlace("bias-drift", "accelerometer-3"), (2e-3,))]
    table = write_lot(tmp_path, 60, 7, hidden=hidden, positions=24)
    result = th.batch(table, do="diagnose", noise_bound=SIGMA, out=tmp_path / "out", jobs=2)
    (cause,) = result.shared
    assert cause.cause.place == shared[0]
    assert cause.since == serial_of(40)
    assert cause.until is None
    assert (cause.count, cause.of) == (14, 20)
    assert cause.sentence == f"since serial {serial_of(40)}: {cause.cause.title} in 14 of 20"
    assert [odd.serial for odd in result.odd] == [serial_of(11)]
    assert not result.dependences
    text = str(result)
    assert cause.sentence in text


@pytest.mark.acceptance
def test_a_lot_without_causes_names_none(tmp_path):
    table = write_lot(tmp_path, 30, 8, positions=24)
    result = th.batch(table, do="diagnose", noise_bound=SIGMA, out=tmp_path / "out", jobs=2)
    assert result.verdicts == {"consistent": 30}
    assert (result.shared, result.odd, result.dependences) == ((), (), ())
