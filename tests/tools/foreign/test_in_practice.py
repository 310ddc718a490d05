"""Files in practice: counters from 0, comments among the rows, sums below, numbers in another notation."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from laboratory_files import PLAIN, bench_columns, table
from laboratory_imports import assert_clean, ideal_bench, imported, refused

BENCH = ideal_bench(12)
FORCE = BENCH.force
COLUMNS = bench_columns(BENCH)
LATE = datetime(2026, 3, 17, 23, 55, 0)


@pytest.mark.parametrize("name", ["acc{} [m/s²]", "acc_{} [m/s²]", "acc[{}] (m/s²)", "Accel {} [m/s²]"])
def test_channels_that_are_counted_from_0_are_the_three_axes_in_their_order(name: str, tmp_path: Path):
    """acc0 is axis 1, and acc1 is not."""
    names = [*PLAIN[:4], *(name.format(k) for k in range(3))]
    assert_clean(imported(tmp_path, table(names, COLUMNS)).record, BENCH)


def test_four_channels_that_are_counted_from_0_are_no_three_axes(tmp_path: Path):
    names = [*PLAIN[:4], *(f"a{k} [m/s²]" for k in range(4))]
    message = refused(tmp_path, table(names, [*COLUMNS, COLUMNS[6]]))
    assert "which columns are the accelerometers" in message


@pytest.mark.parametrize("mark", ["#", "% ", "//"])
def test_rows_that_are_commented_out_are_left_out_and_said(mark: str, tmp_path: Path):
    lines = table(PLAIN, COLUMNS).decode().splitlines()
    lines[5], lines[8] = mark + lines[5], mark + lines[8]
    conversion = imported(tmp_path, "\n".join(lines).encode())
    assert_clean(conversion.record, BENCH, [k for k in range(12) if k not in (4, 7)])
    assert "2 rows (comments): 6, 9" in conversion.left_out


def test_positions_that_are_named_with_such_a_mark_are_no_comments(tmp_path: Path):
    marked = [[f"#{k}" for k in COLUMNS[0]], *COLUMNS[1:]]
    assert_clean(imported(tmp_path, table(PLAIN, marked)).record, BENCH)


def test_sums_below_the_table_are_asked_of_all_at_once(tmp_path: Path):
    below = ["mean,,180,170,0.1,0.2,0.3", "std,,100,90,5.1,5.2,5.3", "max,,350,350,9.7,9.7,9.7"]
    content = table(PLAIN, COLUMNS, after=below)
    assert "--set missing=mean,std,max" in refused(tmp_path, content)
    assert_clean(imported(tmp_path, content, {"missing": "mean,std,max"}).record, BENCH)


NOTATIONS = {
    "one hexadecimal column": lambda v: f"{int(1e5 * v) & 0xFFFFFFFF:08X}",
    "a minus behind": lambda v: f"{abs(v):.6f}" + ("-" if v < 0 else ""),
    "negative in brackets": lambda v: f"({-v:.6f})" if v < 0 else f"{v:.6f}",
    "powers of ten": lambda v: f"{v:.6f}x10^0",
}


@pytest.mark.parametrize("name", NOTATIONS)
def test_numbers_in_another_notation_are_refused_and_not_left_out(name: str, tmp_path: Path):
    column = [NOTATIONS[name](float(v)) for v in np.tile(FORCE[:, 0], 3)]
    columns = [[str(k + 1) for k in range(36)], *([c[k % 12] for k in range(36)] for c in COLUMNS[1:])]
    message = refused(tmp_path, table(PLAIN, [*columns[:4], column, *columns[5:]]))
    assert "write plain decimal numbers" in message
    assert "--set" not in message


@pytest.mark.parametrize(("form", "bits"), [("0x{:06x}", 24), ("{:08X}", 32), ("{:04x}", 16)])
def test_hexadecimal_counts_are_read_and_their_sign_is_asked(form: str, bits: int, tmp_path: Path):
    counts = np.round(3000.0 * FORCE / 9.80665).astype(int)
    texts = [[form.format(v % 2**bits) for v in axis] for axis in counts.T.tolist()]
    names = [*PLAIN[:4], *(f"a{k} [LSB]" for k in "xyz")]
    content = table(names, [*COLUMNS[:4], *texts])
    assert f"'integers=signed {bits}' or" in refused(tmp_path, content)
    answers = {"integers": f"signed {bits}", "units.force": "3000 LSB/g"}
    record = imported(tmp_path, content, answers).record
    assert record.specific_force == pytest.approx(counts * 9.80665 / 3000.0, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize(("old", "new"), [("E", "D"), ("-", "- "), ("+", "+ ")])
def test_exponents_of_fortran_and_blanks_behind_signs_are_read(old: str, new: str, tmp_path: Path):
    form = "{:.9E}" if old == "E" else "{:+.9f}"
    texts = [[form.format(v).replace(old, new) for v in axis] for axis in FORCE.T]
    assert_clean(imported(tmp_path, table(PLAIN, [*COLUMNS[:4], *texts])).record, BENCH)


@pytest.mark.parametrize(
    "form", ["%Y%m%dT%H%M%S", "%a %b %d %H:%M:%S %Y", "%a, %d %b %Y %H:%M:%S", "%d %B %Y %H:%M:%S"]
)
def test_dates_in_other_forms_are_read_over_midnight(form: str, tmp_path: Path):
    times = [(LATE + timedelta(seconds=float(t))).strftime(form) for t in BENCH.time]
    if "," in form:
        times = [f'"{text}"' for text in times]
    assert_clean(
        imported(tmp_path, table([PLAIN[0], "Time", *PLAIN[2:]], [COLUMNS[0], times, *COLUMNS[2:]])).record, BENCH
    )


def test_days_of_a_workbook_are_offered_where_times_look_like_them(tmp_path: Path):
    days = [f"{46098.99 + t / 86400.0:.9f}" for t in BENCH.time]
    content = table([PLAIN[0], "Timestamp", *PLAIN[2:]], [COLUMNS[0], days, *COLUMNS[2:]])
    assert "--set units.time=d or" in refused(tmp_path, content)
    assert_clean(imported(tmp_path, content, {"units.time": "d"}).record, BENCH)


def test_a_date_that_stands_in_the_first_row_alone_is_asked_of_and_can_be_left(tmp_path: Path):
    clock = [(LATE + timedelta(seconds=float(t))).strftime("%H:%M:%S") for t in BENCH.time]
    names = [PLAIN[0], "Date", "Time", *PLAIN[2:]]
    content = table(names, [COLUMNS[0], ["2026-03-17", *[""] * 11], clock, *COLUMNS[2:]])
    assert "--set columns.date=none" in refused(tmp_path, content)
    assert_clean(imported(tmp_path, content, {"columns.date": "none"}).record, BENCH)


@pytest.mark.parametrize("units", [("deg", "min"), ("°", "'"), ("deg", "arcmin")])
def test_minutes_of_an_angle_in_a_column_of_their_own_are_not_lost(units: tuple[str, str], tmp_path: Path):
    names = [*PLAIN[:2], *(f"{name} [{unit}]" for name in ("alpha", "beta") for unit in units), *PLAIN[4:]]
    columns = [*COLUMNS[:2], COLUMNS[2], ["30"] * 12, COLUMNS[3], ["15"] * 12, *COLUMNS[4:]]
    assert "are parts of one angle" in refused(tmp_path, table(names, columns))


@pytest.mark.parametrize(
    "names",
    [
        ["N°", "Temps (s)", "Axe extérieur (°)", "Axe intérieur (°)", *(f"Accélération {k} (m/s²)" for k in "XYZ")],
        ["% No", "t [s]", "alpha [deg]", "beta [deg]", *(f"a{k} [m*s^-2]" for k in "xyz")],
        ["№", "seconds", "α [°]", "bêta [°]", *(f"a{k} [m/s/s]" for k in "xyz")],
    ],
)
def test_other_names_and_units_are_known(names: list[str], tmp_path: Path):
    conversion = imported(tmp_path, table(names, COLUMNS))
    assert_clean(conversion.record, BENCH)
    assert not conversion.left_out
