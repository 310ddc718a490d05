"""The one check of records with gyros: every command refuses wrong ones and accepts correct ones."""

import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from generator import G
from generator.carried import strapdown_record
from generator.tables import PROGRAMME, Errors, Programme, Truth, bench_record
from generator.wrong_readings import (
    ATTITUDES,
    FORCES,
    GYROS,
    as_increments,
    hand_record,
    spiked,
    with_rates,
    wrong_bench,
    wrong_record,
)
from record_files import measured
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.measured import attitude_of_record, check
from trihedron.tools.motion import trust_of, trusted
from trihedron.tools.records import BenchRecord, StrapdownRecord, read_record, write_record
from trihedron.tools.workbench.desk import Desk, DeskRequest

WRONG = (*GYROS, *ATTITUDES, *FORCES)
PLACE = "--latitude-deg 55.75 --azimuth-deg 20"
BY_HAND = (
    "attitude {}",
    "attitude {} --compare",
    "fmpy-input {}",
    "inspect {} --json out.json",
    "check {} --json out.json",
    "diagnose {}",
    "apply calibration.json {}",
    "calibrate {}",
    "noise {}",
    "plan hand --measured {}",
)
TAKEN = (*BY_HAND[:5], "calibrate {}", "noise {}", "plan hand --measured {}")
ON_TABLE = (
    f"calibrate {{}} --noise-bound 1.2e-5 {PLACE}",
    f"diagnose {{}} --noise-bound 1.2e-5 {PLACE}",
    "apply calibration.json {} --out out.csv",
    "attitude {}",
    "fmpy-input {}",
    "inspect {} --json out.json",
    "check {} --json out.json",
    "noise {}",
    "plan hand --measured {}",
)
OF_SEVERAL = (
    "batch {} --do calibrate --jobs 1 --out out",
    "batch {} --do diagnose --jobs 1 --out out",
    "batch {} --do noise --jobs 1 --out out",
    "batch {} --do apply --with calibration.json --jobs 1 --out out",
    "calibrate {} another.csv",
    "diagnose {} another.csv",
    "noise another.csv {}",
)
WITHOUT_GYROS = ("calibrate {} --noise-bound 1.2e-5", "calibrate {} right-bench.csv --noise-bound 1.2e-5")
SHORT: dict[str, Any] = {"moves": 7, "period": 0.02}
EXPECTED = {
    "degrees": "degrees per second",
    "twice": "a factor of 2 is a wrong range setting",
    "half": "a factor of 2 is a wrong range setting",
    "four-times": "a factor of 4 is a wrong range setting",
    "one-twice": "gyro 2 turns",
    "one-half": "gyro 3 turns",
    "spike": "unlike their neighbours",
    "two-spikes": "unlike their neighbours",
    "overflow": "an overflow",
    "lost": "lost readings",
    "zero-from-start": "stuck at one value",
    "stuck-from-start": "gyro 1: ",
    "scalar-last": "body to reference, scalar last",
    "inverse": "where q0..q3 are reference to body",
    "force-twice": "times gravity: a factor of 2",
    "feet": "times gravity: check their unit",
    "force-one-twice": "times gravity",
    "force-lost": "lost readings",
    "force-spike": "accelerometer 2: row 7",
    "force-overflow": "accelerometer 1: ",
}
SHORT_PROGRAMME = Programme(
    (*PROGRAMME.positions[:24:2], (0.0, 0.0), (360.0, 0.0), (360.0, 90.0), (0.0, 90.0), (90.0, 450.0)),
    dwell=4.0,
    rate=2.0,
    step=0.05,
)


OTHERS = ("degrees", "reversed", "swapped", "inverse", "feet")
ONE_OF_EACH = ("twice", "spike", "scalar-last", "force-one-twice")
"""A wrong size of gyros, rows, attitude, size of accelerometers. What is said of all others is the same for any
command: it is asked of the check itself, and of all commands before a release."""


def wrong_file(name: str, files: Path) -> str:
    """Return the name of a record with a wrong reading, by hand, or on a table ("twice-bench")."""
    path = files / f"{name}.csv"
    if not path.exists():
        reading, is_table, _ = name.partition("-bench")
        right = read_record(files / "right-bench.csv", BenchRecord) if is_table else None
        if right is None:
            write_record(wrong_record(reading, 7, truth=False, **SHORT), path)
        else:
            write_record(wrong_bench(reading, right), path)
    return path.name


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with correct records, by hand and on a table; wrong ones are added as they are asked for."""
    folder = tmp_path_factory.mktemp("wrong")
    write_record(hand_record(7, truth=True, **SHORT), folder / "right.csv")
    write_record(hand_record(8, truth=True, **SHORT), folder / "another.csv")
    right = bench_record(Truth.drawn(np.random.default_rng(5)), SHORT_PROGRAMME, Errors(rate=5e-5, encoder=2e-6))
    write_record(right, folder / "right-bench.csv")
    command = f"calibrate {folder / 'right-bench.csv'} --noise-bound 1.2e-5 {PLACE} --quiet"
    assert cli.main([*command.split(), "--json", str(folder / "calibration.json")]) == 0
    return folder


def run(command: str, record: str, files: Path) -> int:
    """Return the exit status of a command for a record; its input files are in that folder."""
    wrong_file(record.removesuffix(".csv"), files)
    words = [str(files / word) if (files / word).is_file() else word for word in command.format(record).split()]
    return cli.main(words)


@pytest.mark.parametrize("name", WRONG)
def test_the_check_names_every_wrong_reading(name):
    assert EXPECTED.get(name, "") in "; ".join(trust_of(wrong_record(name, 7, truth=False, **SHORT)).faults)


@pytest.mark.acceptance
@pytest.mark.parametrize("readings", [ONE_OF_EACH, pytest.param(WRONG, marks=pytest.mark.acceptance)], ids=len)
@pytest.mark.parametrize("command", [*BY_HAND, *(f"{command} bench" for command in ON_TABLE)])
def test_every_command_refuses_every_wrong_reading(command, readings, files, tmp_path, monkeypatch, capsys):
    """In text, in JSON where a result is written all the same, and by exit status 2; nothing else is written."""
    monkeypatch.chdir(tmp_path)
    command, is_table, _ = command.partition(" bench")
    for name in [name for name in readings if not (is_table and name in ATTITUDES)]:
        assert run(command, f"{name}-bench.csv" if is_table else f"{name}.csv", files) == 2, name
        printed = capsys.readouterr()
        assert EXPECTED.get(name, "") in printed.out + printed.err, name
        assert command.startswith("check") or "add --trust" in printed.err, name
        if "--json" in command:
            assert EXPECTED.get(name, "") in (tmp_path / "out.json").read_text(), name
        else:
            assert not list(tmp_path.iterdir()), name


IN_PYTHON = {
    "calibrate": th.calibrate,
    "diagnose": th.diagnose,
    "noise": th.noise,
    "attitude": th.attitude_of_record,
}


@pytest.mark.acceptance
@pytest.mark.parametrize("reading", [*ONE_OF_EACH, *(pytest.param(r, marks=pytest.mark.acceptance) for r in OTHERS)])
def test_python_and_the_page_of_open_say_the_line_of_the_command(reading, files, capsys):
    path = files / wrong_file(reading, files)
    desk = Desk([path])
    try:
        desk.wait_for(0, 60.0)
        for name, function in IN_PYTHON.items():
            assert cli.main([name, str(path)]) == 2
            line = capsys.readouterr().err.strip().removeprefix("trihedron: ")
            for record in (path, read_record(path)):
                with pytest.raises(InputError) as refusal:
                    function(record)
                assert str(refusal.value) == line.replace("--channels ", "channels ").replace("--trust", "trust")
            if name in ("calibrate", "diagnose"):
                answered, end = desk.answered, time.monotonic() + 120.0
                desk.run(DeskRequest(name, (0,), {}))
                while desk.answered == answered and time.monotonic() < end:
                    time.sleep(0.05)
                assert desk.refusal == line
    finally:
        desk.close()


@pytest.mark.first(1)
@pytest.mark.parametrize("command", OF_SEVERAL)
def test_each_of_several_records_is_asked(command, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("twice", "force-twice"):
        assert run(command, f"{name}.csv", files) == 2
        assert EXPECTED[name] in capsys.readouterr().err


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "readings",
    [("degrees", "force-one-twice"), pytest.param((*GYROS, *FORCES), marks=pytest.mark.acceptance)],
    ids=len,
)
def test_an_import_says_what_would_be_wrong(readings, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in readings:
        assert run("import {} --out out.csv --json out.json", f"{name}.csv", files) == 0, name
        for text in (capsys.readouterr().out, (tmp_path / "out.json").read_text()):
            assert "results of this record would be wrong: " in text, name
            assert EXPECTED.get(name, "") in text, name


@pytest.mark.acceptance
@pytest.mark.parametrize("command", WITHOUT_GYROS)
def test_gyros_that_are_not_used_are_a_warning(command, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("twice", "force-spike"):
        status = run(f"{command} --json out.json", f"{name}-bench.csv", files)
        assert status == (2 if name in FORCES else 0), name
        printed = capsys.readouterr()
        text = printed.err if status else (tmp_path / "out.json").read_text()
        assert EXPECTED.get(name, "") in text, name
        (tmp_path / "out.json").unlink(missing_ok=True)


@pytest.mark.acceptance
@pytest.mark.parametrize("command", TAKEN)
def test_every_command_takes_the_right_record_and_what_a_person_trusts(command, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(command, "right.csv", files) == 0
    capsys.readouterr()
    command = command.removesuffix(" --json out.json")
    assert run(f"{command} --trust --json out.json", "twice.csv", files) == 0
    assert "a factor of 2 is a wrong range setting" in Path("out.json").read_text()


@pytest.mark.first(1)
@pytest.mark.parametrize("command", [*ON_TABLE, *WITHOUT_GYROS])
def test_every_command_takes_the_right_record_of_a_table(command, files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "right-bench.csv" not in command and not command.startswith("diagnose"):
        assert run(command, "right-bench.csv", files) == 0


@pytest.mark.acceptance
def test_accelerometers_that_a_person_trusts_are_calibrated(files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = "calibrate {} right-bench.csv --noise-bound 1.2e-5 --trust --json out.json"
    assert run(command, "force-spike-bench.csv", files) == 0
    assert "accelerometer 2: row 7" in Path("out.json").read_text()


@pytest.mark.parametrize("truth", [True, False])
def test_no_right_record_is_refused(truth):
    for right in (hand_record(21, truth=truth, **SHORT), as_increments(hand_record(22, truth=truth, **SHORT))):
        told = trust_of(right)
        assert told.faults == told.warnings == ()


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(20, 22))
@pytest.mark.parametrize("truth", [True, False])
def test_no_right_record_is_refused_and_all_wrong_ones_are(seed, truth):
    measured_as = as_increments if seed % 2 else lambda record: record
    right = trust_of(measured_as(hand_record(seed, truth=truth)))
    assert right.faults == right.warnings == ()
    missed = []
    for name in WRONG:
        if not trust_of(measured_as(wrong_record(name, seed, truth=truth))).faults:
            missed.append(name)
    assert missed == []


@pytest.mark.parametrize("seed", range(2))
def test_spikes_are_named_by_their_row_wherever_they_are(seed):
    right = hand_record(40 + seed, truth=False)
    wrong = with_rates(right, spiked(seed))
    row = int(np.flatnonzero((wrong.rate != right.rate).any(axis=1))[0])
    assert f"row {row + 1} " in "".join(trust_of(wrong).faults)


@pytest.mark.acceptance
def test_scale_factors_are_said_from_five_percent_on_and_refused_from_the_square_root_of_two_on():
    right = hand_record(3, truth=True)
    for factor, message, is_refused in (
        (1.03, False, False),
        (1.12, True, False),
        (1.35, True, False),
        (1.46, True, True),
    ):
        for record in (right, replace(right, attitude=None)):
            stated = trust_of(with_rates(record, lambda rate, factor=factor: factor * rate))
            assert bool(stated.faults) == is_refused, (factor, stated)
            assert ("times as far as" in " ".join((*stated.faults, *stated.warnings))) == message


@pytest.mark.acceptance
def test_a_centrifuge_and_strong_vibration_are_right(tmp_path):
    """Test a steady turn at 5 rad/s with 4 g, from rest and as the whole record; 2 g of vibration without a rest."""
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(3000)
    speed = 5.0 * np.clip((time - 5.0) / 5.0, 0.0, 1.0)
    rate = np.outer(speed, [0.0, 0.0, 1.0]) + rng.normal(0.0, 1e-3, (3000, 3))
    outwards = np.outer(4.0 * G * (speed / 5.0) ** 2, [1.0, 0.0, 0.0])
    force = outwards + np.array([0.0, 0.0, G]) + rng.normal(0.0, 0.02, (3000, 3))
    centrifuge = StrapdownRecord(time, rate, None, force)
    shaken = strapdown_record(seed=6)
    vibration = 2.0 * np.sqrt(2.0) * G * np.sin(2.0 * np.pi * 37.0 * shaken.time_s)
    assert shaken.rate is not None
    vibrating = replace(shaken, specific_force=shaken.specific_force + np.outer(vibration, [0.6, 0.0, 0.8]))
    steady = StrapdownRecord(time[1500:], rate[1500:], None, force[1500:])
    for number, record in enumerate((centrifuge, steady, vibrating)):
        assert trust_of(record).faults == ()
        path = tmp_path / f"{number}.csv"
        write_record(record, path)
        assert check(path).good
        assert attitude_of_record(path).updates > 0


def test_reversed_accelerometers_are_asked_where_they_are_integrated():
    right = hand_record(9, truth=True)
    assert right.rate is not None
    step = 0.01
    turns, speeds = step * right.rate, -step * right.specific_force
    wrong = replace(right, rate=None, increment=turns, velocity_increment=speeds, specific_force=-right.specific_force)
    with pytest.raises(InputError, match=re.escape("(--channels -1,-2,-3)")):
        trusted(wrong)
    assert trusted(replace(wrong, velocity_increment=None)).warnings


@pytest.mark.acceptance
def test_an_unknown_attitude_may_be_written_as_nan(tmp_path):
    record = hand_record(11, truth=True)
    path = tmp_path / "measured.csv"
    write_record(record, path)
    lines = path.read_text().splitlines()
    for number, word in ((500, "nan"), (501, "NaN"), (502, "")):
        fields = lines[number].split(",")
        lines[number] = ",".join([*fields[:-4], *[word] * 4])
    path.write_text("\n".join(lines) + "\n")
    read = read_record(path, StrapdownRecord)
    assert read.attitude is not None
    assert np.flatnonzero(np.isnan(read.attitude).any(axis=1)).tolist() == [499, 500, 501]


# Records from the field


FIELD = {
    "slow_deg_q": "--channels w=deg",
    "q_last": "body to reference, scalar last",
    "q_body90": "--channels w=1,3,-2",
    "dv_neg": "--channels -1,-2,-3",
    "gyros-reversed": "--channels w=-1,-2,-3",
    "sat_wrap": "gyro 3: 15 rows, the first row 4790",
    "sat_spike": "gyro 2: row 4002",
    "gyro-glitch-100radps": "gyro 3: row 601",
    "gs_2.0": "a factor of 2",
    "real_gyros_half": "a factor of 2",
}


@pytest.mark.acceptance
@pytest.mark.parametrize("name", FIELD)
def test_wrong_records_of_the_field_are_refused(name, tmp_path):
    record = read_record(field_file(f"{name}.csv", tmp_path), StrapdownRecord)
    assert FIELD[name] in "; ".join(trust_of(record).faults)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["gyros-right", "q_nan", "sculling_2g_refused"])
def test_right_records_of_the_field_pass(name, tmp_path):
    assert check(field_file(f"{name}.csv", tmp_path)).good


LARGE = [pytest.param(name, marks=pytest.mark.acceptance) for name in ("mpu9150-4", "xsens-imu-tk", "broad-06")]


@pytest.mark.first(1)
@pytest.mark.parametrize("name", ["mpu9150-0", "mpu9150-1", "mpu9150-2", *LARGE])
def test_right_records_that_were_measured_pass(name):
    assert trust_of(measured(name)).faults == ()
