"""Tables on their side and blocks with a heading for each rest give the record of the upright table."""

from pathlib import Path

import numpy as np
import pytest

from laboratory_files import GERMAN, PLAIN, G, bench_columns
from laboratory_imports import assert_clean, ideal_bench, imported, refused
from laboratory_workbooks import ods

BENCH = ideal_bench(9)
ALPHA, BETA, FORCE = BENCH.alpha, BENCH.beta, BENCH.force
POINT, COMMA = bench_columns(BENCH), bench_columns(BENCH, scale=1.0 / G, decimals=11, mark=",")


def lines(rows: list[list[str]], mark: str = ";") -> str:
    return "\n".join(mark.join(row) for row in rows) + "\n"


TURNED = {
    "plain": lines([[name, *column] for name, column in zip(PLAIN, POINT, strict=True)], ","),
    "German, with a title": lines(
        [
            ["Messung 12"],
            ["Seriennummer", "A-17"],
            ["Nr.", *(f"P{k + 1}" for k in range(9))],
            *([name, *column] for name, column in zip(GERMAN[1:], COMMA[1:], strict=True)),
        ]
    ),
    "units beside the names": lines(
        [
            ["", name.partition(" [")[0], name.partition(" [")[2].rstrip("]"), *column]
            for name, column in zip(PLAIN, POINT, strict=True)
        ]
    ),
    "with remarks": lines(
        [*([name, *column] for name, column in zip(PLAIN, POINT, strict=True)), ["Remark", *["ok"] * 9]]
    ),
}


@pytest.mark.parametrize("name", TURNED)
def test_a_table_with_a_column_for_each_position_is_read(name: str, tmp_path: Path):
    conversion = imported(tmp_path, TURNED[name])
    assert_clean(conversion.record, BENCH)
    assert conversion.record.time_s == pytest.approx(BENCH.time)
    assert "a column for each position, turned" in conversion.written_as
    if "German" in name:
        assert conversion.about["Seriennummer"] == "A-17"


def test_a_workbook_on_its_side_is_read(tmp_path: Path):
    values = [[float(text) for text in column] for column in POINT]
    content = ods({"Data": [[name, *column] for name, column in zip(PLAIN, values, strict=True)]})
    assert_clean(imported(tmp_path, content, name="lab.ods").record, BENCH)


def blocks(heading: str, names: str, readings: int = 4, scatter: float = 0.0, decimal: str = ".") -> str:
    """Return blocks of readings, whose noise is that of a fixed seed."""
    random, rows = np.random.default_rng(5), ["Calibration 12; serial A-17"]
    mark = "," if decimal == "." else ";"
    for k in range(9):
        rows += ["", heading.format(k=k + 1, a=f"{ALPHA[k]:.4f}", b=f"{BETA[k]:.4f}").replace("~", decimal)]
        rows += [names] if names else []
        for j in range(readings):
            noise = random.normal(0.0, scatter, 3)
            noise -= noise if j == 0 and not scatter else 0.0
            values = [f"{BENCH.time[k] + j:.1f}", *(f"{v:.9f}" for v in FORCE[k] + noise)]
            rows.append(mark.join(text.replace(".", decimal) for text in values))
    return "\n".join(rows) + "\n"


NAMES = "t [s],ax [m/s²],ay [m/s²],az [m/s²]"
HEADINGS = {
    "in one line": ("Position {k}: alpha = {a} deg, beta = {b} deg", NAMES),
    "in two lines": ("alpha [deg],{a}\nbeta [deg],{b}", NAMES),
    "in cells": ("Pos,{k},outer [°],{a},inner [°],{b}", NAMES),
    "marked": ("# Pos {k} alpha {a}° beta {b}°", NAMES),
}


@pytest.mark.parametrize("name", HEADINGS)
def test_blocks_with_a_heading_for_each_rest_are_averaged(name: str, tmp_path: Path):
    conversion = imported(tmp_path, blocks(*HEADINGS[name]))
    assert_clean(conversion.record, BENCH)
    assert (conversion.rows, conversion.readings) == (9, 36)
    assert "a block for each rest" in conversion.written_as


def test_scatter_within_the_blocks_is_kept_and_names_may_be_given(tmp_path: Path):
    text = blocks("Position {k}, alpha {a}, beta {b}", "", scatter=1e-4)
    answers = {"columns.time_s": "4", **{f"columns.f{k}_mps2": str(k + 4) for k in (1, 2, 3)}}
    answers |= {"units.angle": "deg", "units.force": "m/s2", "units.time": "s"}
    conversion = imported(tmp_path, text, answers)
    assert conversion.record.specific_force == pytest.approx(FORCE, abs=3e-4)
    assert conversion.scatter_mps2 == pytest.approx([0.5e-4] * 3, rel=0.5)


def test_what_is_wrong_in_a_block_is_said_by_the_row_of_the_file(tmp_path: Path):
    rows = blocks(*HEADINGS["in one line"]).splitlines()
    row = next(k for k, line in enumerate(rows) if line.startswith("62.0"))
    rows[row] = rows[row].replace(",", ",OVL,", 1).rpartition(",")[0]
    message = refused(tmp_path, "\n".join(rows))
    assert f"row {row + 1}, 'ax " in message
    assert ": 'OVL' is not a number" in message


@pytest.mark.parametrize("angle", ["{a}°30'", "{a}:30", "12°34'56\""])
def test_degrees_of_a_sexagesimal_angle_are_not_taken_for_the_whole(angle: str, tmp_path: Path):
    text = blocks(f"Position {{k}}: alpha = {angle}, beta = {{b}} deg".replace("{a}", "20"), NAMES)
    refused(tmp_path, text)


@pytest.mark.parametrize("lost", ["alpha = 48.0000 deg, ", "Position 2: alpha = 48.0000 deg, beta = 108.0000 deg"])
def test_a_block_without_its_angles_is_no_rest_of_the_one_before(lost: str, tmp_path: Path):
    """A lost heading must not silently give its readings to another rest."""
    text = blocks(*HEADINGS["in one line"])
    assert lost in text
    refused(tmp_path, text.replace(lost, ""))
