"""Heads in two lines, readings side by side, names that may belong to other fields: the truth is the written table."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from laboratory_imports import imported, refused

COUNT = 6
TIME = 30.0 * np.arange(COUNT)
ALPHA, BETA = 20.0 * np.arange(COUNT), 50.0 * np.arange(COUNT)
FORCE = np.array([[0.001 * k, -0.002 * k, 0.99 - 0.01 * k] for k in range(COUNT)])
"""Specific force [g] of a table, beside angles [deg]."""
G = 9.80665


def table(head: Sequence[str], rows: Sequence[Sequence[object]], mark: str = ";") -> str:
    """Return lines of a file: the given head, its rows."""
    return "\n".join([*head, *(mark.join(map(str, row)) for row in rows)])


def rows_of(force: np.ndarray, *further: Sequence[object]) -> list[list[object]]:
    """Return rows: number, time, angles, readings, further columns."""
    return [
        [k + 1, TIME[k], ALPHA[k], BETA[k], *np.ravel(force[k]).round(6).tolist(), *(column[k] for column in further)]
        for k in range(COUNT)
    ]


@pytest.mark.parametrize(
    "head",
    [
        ["Nr.;Zeit;Drehtisch;;Beschleunigung;;;Temp", ";;außen;innen;x;y;z;", ";s;°;°;g;g;g;°C"],
        ["Titel;;;;;;;", "", "Pos;Time;Table;;Acc [g];;;T [°C]", ";[s];outer [deg];inner [deg];x;y;z;"],
        ["Pos;Time;Alpha;Beta;Acc;Acc;Acc;Temp", ";s;deg;deg;x [g];y [g];z [g];°C"],
        [";;Table;;Accelerometers;;;", "Pos;t [s];alpha [deg];beta [deg];x [g];y [g];z [g];Temp [°C]"],
        ["Serial;A-17;;;;;;", "Pos;t [s];alpha [deg];beta [deg];ax [g];ay [g];az [g];Temp [°C]"],
    ],
)
def test_names_in_two_lines_are_read_together(head: list[str], tmp_path: Path):
    record = imported(tmp_path, table(head, rows_of(FORCE, [20.5] * COUNT))).record
    assert record.specific_force == pytest.approx(G * FORCE, abs=1e-9)
    assert np.degrees(record.alpha) == pytest.approx(ALPHA)
    assert np.degrees(record.beta) == pytest.approx(BETA)
    assert record.time_s == pytest.approx(TIME)
    assert record.temperature == pytest.approx([20.5] * COUNT)
    # a line without column names is kept with the record
    assert record.about.get("Serial") == ("A-17" if head[0].startswith("Serial") else None)


def test_gyros_and_accelerometers_under_their_names(tmp_path: Path):
    """The same x, y, z are below both."""
    head = ["Sample;Acc;;;Gyro;;;", ";x;y;z;x;y;z;", "#;g;g;g;°/s;°/s;°/s;°C"]
    rows = [[k, 0.0, 0.0, 1.0, 0.1 * k, 0.2, -0.3, 25.0] for k in range(50)]
    record = imported(tmp_path, table(head, rows), {"units.time": "100 Hz"}).record
    assert record.rate == pytest.approx(np.radians([[0.1 * k, 0.2, -0.3] for k in range(50)]))
    assert record.specific_force == pytest.approx(np.tile([0.0, 0.0, G], (50, 1)))


READ = np.stack([FORCE + offset for offset in (-2e-4, 0.0, 2e-4, 0.0)], axis=1)
"""Four readings of each rest (rests, readings, axes): their standard error is 8.2e-5 g."""
PLACES = "Pos;t [s];alpha [deg];beta [deg];"


@pytest.mark.parametrize(
    ("names", "by_axis", "asks"),
    [
        (";".join(f"a{axis}_r{k} [g]" for axis in "xyz" for k in range(1, 5)), True, False),
        (";".join(f"{axis} Messung {k} [g]" for k in range(1, 5) for axis in "xyz"), False, False),
        (";".join(f"Reading {k} {axis} (g)" for k in range(1, 5) for axis in "xyz"), False, False),
        (";".join(f"a{axis}{k} [g]" for k in range(1, 5) for axis in "xyz"), False, True),
        (";".join(f"acc{k}_{axis}_g" for k in range(1, 5) for axis in "xyz"), False, True),
    ],
)
def test_readings_side_by_side_are_averaged_where_they_are_known_to_be_such(
    names: str, by_axis: bool, asks: bool, tmp_path: Path
):
    """Columns with mere numbers may be other sensors: the import asks; the mapping answers for the next file."""
    text = table([PLACES + names], rows_of(np.swapaxes(READ, 1, 2) if by_axis else READ))
    answers = {"beside": "average"} if asks else {}
    if asks:
        assert "one fact is missing: --set beside=average or --set beside=none" in refused(tmp_path, text)
        assert "columns.f1_mps2=" in refused(tmp_path, text, {"beside": "none"})
    conversion = imported(tmp_path, text, answers, out=tmp_path / "record.csv")
    assert (conversion.rows, conversion.readings) == (COUNT, 4 * COUNT)
    assert conversion.record.specific_force == pytest.approx(G * FORCE, abs=1e-9)
    assert conversion.scatter_mps2 == pytest.approx([G * 1e-4 * np.sqrt(8.0 / 3.0) / 2.0] * 3, rel=1e-6)
    again = imported(tmp_path, text, mapping=tmp_path / "record.import.toml")
    assert again.readings == 4 * COUNT
    assert again.record.specific_force == pytest.approx(G * FORCE, abs=1e-9)


def test_a_missing_reading_leaves_the_others_of_its_rest(tmp_path: Path):
    names = ";".join(f"a{axis}_r{k} [g]" for k in range(1, 5) for axis in "xyz")
    rows = rows_of(READ)
    rows[2][4 + 3 * 2] = "n/a"
    conversion = imported(tmp_path, table([PLACES + names], rows))
    assert (conversion.rows, conversion.readings) == (COUNT, 4 * COUNT - 1)
    assert conversion.left_out == ("1 row (a number is missing): 4",)


def test_readings_side_by_side_without_numbers_of_positions(tmp_path: Path):
    """Each row is a rest: nothing is asked, though all its readings are at one place."""
    names = ";".join(f"a{axis}_r{k} [g]" for k in range(1, 5) for axis in "xyz")
    rows = [row[1:] for row in rows_of(READ)]
    conversion = imported(tmp_path, table([PLACES.removeprefix("Pos;") + names], rows))
    assert (conversion.rows, conversion.readings) == (COUNT, 4 * COUNT)


def test_names_that_are_numbers(tmp_path: Path):
    """Use three readings of each axis under one name, 1 to 3 in the line below."""
    head = [";;;;Acc X [g];;;Acc Y [g];;;Acc Z [g];;", PLACES + "1;2;3;1;2;3;1;2;3"]
    text = table(head, rows_of(np.swapaxes(READ[:, :3], 1, 2)))
    conversion = imported(tmp_path, text, {"beside": "average"})
    assert conversion.record.specific_force == pytest.approx(G * FORCE, abs=1e-9)


NAMES = ["t[s]", "alpha[deg]", "beta[deg]", "ax[g]", "ay[g]", "az[g]", "T[degC]"]
ROWS = [[*row[1:], 20.5] for row in rows_of(FORCE)]


def test_the_mark_of_a_comment_is_no_name(tmp_path: Path):
    """Otherwise every name would belong to the field of the next."""
    record = imported(tmp_path, table(["# " + " ".join(NAMES)], ROWS, " ")).record
    assert record.time_s == pytest.approx(TIME)
    assert record.temperature == pytest.approx([20.5] * COUNT)


@pytest.mark.parametrize(
    ("head", "rows", "mark"),
    [
        ("#;" + ";".join(NAMES), ROWS, ";"),
        (" ".join(NAMES), [[k + 1, *row] for k, row in enumerate(ROWS)], " "),
        (";".join(NAMES), [[k + 1, *row] for k, row in enumerate(ROWS)], ";"),
    ],
)
def test_names_that_may_stand_over_other_fields_are_refused(
    head: str, rows: list[list[object]], mark: str, tmp_path: Path
):
    message = refused(tmp_path, table([head], rows, mark))
    assert "which name stands over which field is not known" in message
    assert "row 2 has" in message


def test_units_that_change_behind_numbers_are_refused(tmp_path: Path):
    """A meter that changes its range writes g in one row and mg in the next."""
    rows = [
        [*row[:4], *(f"{f} g" if abs(f) > 0.1 else f"{1e3 * f:.3f} mg" for f in FORCE[k])]
        for k, row in enumerate(rows_of(FORCE))
    ]
    rows[3][4] = "0.003 g"
    message = refused(tmp_path, table([PLACES + "X;Y;Z"], rows))
    assert "row 5: '0.003 g' is in another unit than 'X' or the rows before" in message
    rows[3][4] = "3.000 mg"
    record = imported(tmp_path, table([PLACES + "X;Y;Z"], rows)).record
    assert record.specific_force == pytest.approx(G * FORCE, abs=1e-8)
    assert "another unit than 'X [m/s²]'" in refused(tmp_path, table([PLACES + "X [m/s²];Y;Z"], rows))


def test_minutes_and_seconds_with_decimals(tmp_path: Path):
    """10:15.5 can only be minutes and seconds."""
    rows = [[k + 1, f"{int(TIME[k] // 60)}:{TIME[k] % 60:04.1f}", *row[2:]] for k, row in enumerate(rows_of(FORCE))]
    record = imported(tmp_path, table(["Pos;time;alpha [deg];beta [deg];ax [g];ay [g];az [g]"], rows)).record
    assert record.time_s == pytest.approx(TIME)


@pytest.mark.parametrize(
    ("names", "option"),
    [
        ("acc_x_raw;acc_y_raw;acc_z_raw", "'units.force=16384 raw/g'"),
        ("ax [mV];ay [mV];az [mV]", "'units.force=0.5 g/mV'"),
        ("Ux(V);Uy(V);Uz(V)", "'units.force=0.5 g/V'"),
    ],
)
def test_what_a_converter_gave_is_asked_as_a_sensitivity(names: str, option: str, tmp_path: Path):
    message = refused(tmp_path, table([PLACES + names], rows_of(FORCE)))
    assert option in message
    assert "units.force=g " not in message


def test_times_that_are_too_coarse_or_begin_again_say_what_helps(tmp_path: Path):
    rows = [[k + 1, f"10:{k // 2:02d} PM", *row[2:]] for k, row in enumerate(rows_of(FORCE))]
    text = table(["Pos;time;alpha [deg];beta [deg];ax [g];ay [g];az [g]"], rows)
    assert "--set columns.time_s=none and --set time=order" in refused(tmp_path, text)
    assert len(imported(tmp_path, text, {"columns.time_s": "none", "time": "order"}).record) == COUNT
    rows = [[k % 16, 0.0, 0.0, 1.0, 0.1 * k, 0.2, -0.3] for k in range(50)]
    text = table(["counter;ax [g];ay [g];az [g];wx [dps];wy [dps];wz [dps]"], rows)
    answers = {"units.time": "100 Hz"}
    assert "--set columns.sample=none" in refused(tmp_path, text, answers)
    assert len(imported(tmp_path, text, answers | {"columns.sample": "none"}).record) == 50
