"""The one check of records with gyros: every command refuses wrong ones and accepts correct ones."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from field_files import field_file
from generator import G
from generator.carried import strapdown_record
from generator.wrong_readings import ATTITUDES, FORCES, GYROS, hand_record, spiked, with_rates, wrong_record
from record_files import measured
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.measured import attitude_of_record, check, inspect
from trihedron.tools.motion import trust_of, trusted
from trihedron.tools.records import StrapdownRecord, read_record, write_record

WRONG = (*GYROS, *ATTITUDES, *FORCES)
COMMANDS = ("attitude", "attitude --compare", "fmpy-input", "inspect", "check", "diagnose")
SHORT: dict[str, Any] = {"moves": 7, "period": 0.02}
EXPECTED = {
    "degrees": "degrees per second",
    "twice": "a factor of 2 is a wrong range setting",
    "half": "a factor of 2 is a wrong range setting",
    "four-times": "a factor of 4 is a wrong range setting",
    "spike": "unlike their neighbours",
    "two-spikes": "unlike their neighbours",
    "overflow": "an overflow",
    "lost": "lost readings",
    "scalar-last": "body to reference, scalar last",
    "inverse": "where q0..q3 are reference to body",
    "force-twice": "accelerometers read 1.99 times gravity: a factor of 2",
    "feet": "accelerometers read 3.28 times gravity: check their unit",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a record for every wrong reading, and a right one."""
    folder = tmp_path_factory.mktemp("wrong")
    for name in WRONG:
        write_record(wrong_record(name, 7, truth=False, **SHORT), folder / f"{name}.csv")
    write_record(hand_record(7, truth=True, **SHORT), folder / "right.csv")
    return folder


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", WRONG)
def test_every_command_refuses_every_wrong_reading(name, command, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words, *options = command.split()
    assert cli.main([words, str(files / f"{name}.csv"), *options]) == 2
    printed = capsys.readouterr()
    assert EXPECTED.get(name, "") in printed.out + printed.err
    if words != "check":
        assert "add --trust" in printed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", COMMANDS[:5])
def test_every_command_takes_the_right_record_and_what_a_person_trusts(command, files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words, *options = command.split()
    assert cli.main([words, str(files / "right.csv"), *options]) == 0
    capsys.readouterr()
    assert cli.main([words, str(files / "twice.csv"), *options, "--trust", "--json", "out.json"]) == 0
    assert "a factor of 2 is a wrong range setting" in Path("out.json").read_text()


@pytest.mark.parametrize("seed", range(20, 22))
@pytest.mark.parametrize("truth", [True, False])
def test_no_right_record_is_refused_and_all_wrong_ones_are(seed, truth):
    right = trust_of(hand_record(seed, truth=truth))
    assert right.faults == right.warnings == ()
    assert [name for name in WRONG if not trust_of(wrong_record(name, seed, truth=truth)).faults] == []


@pytest.mark.parametrize("seed", range(5))
def test_spikes_are_named_by_their_row_wherever_they_are(seed):
    right = hand_record(40 + seed, truth=False)
    wrong = with_rates(right, spiked(seed))
    row = int(np.flatnonzero((wrong.rate != right.rate).any(axis=1))[0])
    assert f"row {row + 1} " in "".join(trust_of(wrong).faults)


def test_scale_factors_are_said_from_five_percent_on_and_refused_from_the_square_root_of_two_on():
    right = hand_record(3, truth=True)
    for factor, said, is_refused in (
        (1.03, False, False),
        (1.12, True, False),
        (1.35, True, False),
        (1.46, True, True),
    ):
        for record in (right, replace(right, attitude=None)):
            told = trust_of(with_rates(record, lambda rate, factor=factor: factor * rate))
            assert bool(told.faults) == is_refused, (factor, told)
            assert ("times as far as" in " ".join((*told.faults, *told.warnings))) == said


def test_a_centrifuge_and_strong_vibration_are_right(tmp_path):
    """A steady turn at 5 rad/s with 4 g, from rest and as the whole record; 2 g of vibration without a rest."""
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


@pytest.mark.parametrize("name", FIELD)
def test_wrong_records_of_the_field_are_refused(name, tmp_path):
    path = field_file(f"{name}.csv", tmp_path)
    with pytest.raises(InputError, match=re.escape(FIELD[name])):
        attitude_of_record(path)
    assert not check(path).good
    assert inspect(path).trust.faults


@pytest.mark.parametrize("name", ["gyros-right", "q_nan", "sculling_2g_refused"])
def test_right_records_of_the_field_pass(name, tmp_path):
    path = field_file(f"{name}.csv", tmp_path)
    assert check(path).good
    assert attitude_of_record(path).updates > 0


@pytest.mark.parametrize("name", ["mpu9150-0", "mpu9150-1", "mpu9150-2", "mpu9150-4", "xsens-imu-tk", "broad-06"])
def test_right_records_that_were_measured_pass(name):
    assert trust_of(measured(name)).faults == ()
