"""Comparison of two runs or records: every difference is found at its place, and no other."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from browser import Window
from trihedron.tools import cli

TIME = np.linspace(0.0, 10.0, 501)


def run(**columns: object) -> pl.DataFrame:
    return pl.DataFrame({"time_s": TIME, "a_deg": np.sin(TIME), "f1_mps2": 9.8 + 0.0 * TIME, **columns})


def moved(row: int, by: float) -> pl.DataFrame:
    values = run()["f1_mps2"].to_numpy().copy()
    values[row] += by
    return run(f1_mps2=values)


def test_what_is_the_same_is_the_same_and_what_is_not_is_found_where_it_is():
    assert th.compare(run(), run()).verdict == "same"
    result = th.compare(run(), moved(77, -1e-3))
    assert (result.verdict, result.matched, result.rows) == ("different", "rows", 501)
    by_name = {d.column: d for d in result.columns}
    assert by_name["a_deg"].largest == 0.0
    spike = by_name["f1_mps2"]
    assert (spike.time_s, spike.first) == (TIME[77], 9.8)
    assert spike.largest == pytest.approx(1e-3, rel=1e-9)
    assert spike.rms == pytest.approx(1e-3 / np.sqrt(501), rel=1e-9)
    assert th.compare(run(), moved(77, -1e-3), within=["1e-2"]).verdict == "same"
    assert th.compare(run(), moved(77, -1e-3), within=["1e-2", "f1_mps2=1e-4"]).verdict == "different"
    assert th.compare(run(), moved(77, -1e-3), within=["a_deg=1"]).verdict == "different"


def test_other_times_are_interpolated_and_only_what_both_have_counts():
    finer = np.linspace(5.0, 20.0, 15001)
    result = th.compare(run(), pl.DataFrame({"time_s": finer, "a_deg": np.sin(finer), "b": finer}), within=["1e-6"])
    assert (result.matched, result.rows) == ("time", 251)
    assert result.columns[0].largest < 1e-6
    assert (result.only_first, result.only_second, result.verdict) == (["f1_mps2"], ["b"], "different")


def test_rows_that_are_missing_and_values_that_are_not_known_are_differences():
    assert th.compare(run(), run()[:400], within=["1"]).verdict == "different"
    values = run()["a_deg"].to_numpy().copy()
    values[3] = np.nan
    result = th.compare(run(), run(a_deg=values), within=["1"])
    assert (result.verdict, result.columns[0].one_only) == ("different", 1)
    assert th.compare(run(a_deg=values), run(a_deg=values)).verdict == "same"


def test_numbers_near_the_largest_have_a_largest_difference():
    values = np.where(TIME == 0.0, 1.5e308, 0.0)
    result = th.compare(run(f1_mps2=values), run(f1_mps2=-values)).columns[1]
    assert result.largest == np.finfo(float).max
    assert result.rms == pytest.approx(result.largest / np.sqrt(501), rel=1e-9)


def test_positions_belong_together_by_their_numbers():
    table = th.hide(1).record.to_polars()
    result = th.compare(table, table[::-1].with_columns(table["time_s"]))
    assert (result.matched, result.verdict) == ("position", "same")


@pytest.mark.parametrize(
    ("first", "second", "within", "message"),
    [
        (run(), run().drop("time_s"), (), "has no times"),
        (run(), run()[::-1], (), "time_s runs back"),
        (run(), run().with_columns(pl.col("time_s") + 99.0), (), "has no time in common"),
        (run(), pl.DataFrame({"time_s": TIME, "x": TIME}), (), "has no column of numbers in common"),
        (run(), run(), ("-1",), "write a number that is not below 0"),
        (run(), run(), ("f2_mps2=1",), "f2_mps2 is not a column of both; did you mean 'f1_mps2'"),
        (run(), 7, (), "a run or a record is needed, not int"),
    ],
)
def test_what_cannot_be_compared(first, second, within, message):
    with pytest.raises(th.InputError, match=message):
        th.compare(first, second, within=within)


@pytest.mark.acceptance
def test_the_gate_of_the_command_and_its_page(tmp_path: Path, capsys, window: Window):
    for name, table in (("before", run()), ("after", moved(77, -1e-3))):
        (tmp_path / name).mkdir()
        table.write_parquet(tmp_path / name / "run.parquet")
    pair = ["compare", str(tmp_path / "before"), str(tmp_path / "after")]
    page = tmp_path / "page.html"
    assert cli.main([*pair, "--report", str(page)]) == 0
    assert "Different: " in capsys.readouterr().out
    assert cli.main([*pair, "--within", "0.1"]) == 0
    assert cli.main([*pair, "--within", "1e-6"]) == 3
    assert "1 of 2 columns" in capsys.readouterr().err
    for width in (1280, 400):
        observed = window.open(page, width, dark=width == 400)
        assert (observed["scroll"], observed["outside"]) == (width, [])
    assert window.complaints == []


@pytest.mark.acceptance
def test_a_stretch_of_time_that_is_drawn_over_a_picture_is_shown_in_all(tmp_path: Path, window: Window):
    window.open(th.plot(run(), tmp_path / "page.html"), 1280)
    ticks = "[...document.querySelectorAll('svg text')].map(text => text.textContent.trim())"
    lines = "[...document.querySelectorAll('svg path[clip-path]')].map(path => path.getAttribute('d'))"
    complete, drawn = window.page.evaluate(ticks), window.page.evaluate(lines)
    box = window.page.locator(".trihedron-picture").first.bounding_box()
    assert box is not None
    at = box["y"] + box["height"] / 2
    window.page.mouse.move(box["x"] + 0.5 * box["width"], at)
    window.page.mouse.down()
    window.page.mouse.move(box["x"] + 0.6 * box["width"], at)
    window.page.mouse.up()
    times = [float(text) for text in window.page.evaluate(ticks) if text.replace(".", "").isdigit()]
    assert [time for time in times if 4.0 < time < 6.5]
    assert "10" not in window.page.evaluate(ticks)
    assert window.page.evaluate(lines) != drawn
    window.page.mouse.dblclick(box["x"] + 0.5 * box["width"], at)
    assert (window.page.evaluate(ticks), window.page.evaluate(lines)) == (complete, drawn)
    assert window.complaints == []


@pytest.mark.acceptance
def test_no_other_script_runs_in_a_page_of_lines(tmp_path: Path, window: Window):
    page = th.plot(run(), tmp_path / "page.html")
    page.write_text(page.read_text(encoding="utf-8") + "<script>document.title = 'run'</script>", encoding="utf-8")
    window.open(page, 1280)
    assert window.page.title() != "run"
    assert any("Content Security Policy" in output for output in window.complaints)


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("rad", 2.0 * np.pi), ("arcmin", 21_600.0)])
@pytest.mark.parametrize("turns", [-3, 1, 7])
def test_angles_differ_the_shorter_way_round(unit: str, turn: float, turns: int):
    angle = turn * TIME / 4.0
    first = pl.DataFrame({"time_s": TIME, f"heading_{unit}": angle % turn})
    second = pl.DataFrame({"time_s": TIME, f"heading_{unit}": (angle + 1e-3 * turn) % turn + turns * turn})
    [heading] = th.compare(first, second).columns
    assert heading.largest == pytest.approx(1e-3 * turn, rel=1e-6)
    later = second.with_columns(time_s=pl.col("time_s") + 0.004)
    [heading] = th.compare(first, later).columns
    assert heading.largest == pytest.approx(0.0, abs=1e-9 * turn)


def test_rates_and_increments_are_not_taken_the_shorter_way_round():
    columns = {"dtheta1_rad": 0.0 * TIME, "w1_deg_per_s": 0.0 * TIME}
    first = pl.DataFrame({"time_s": TIME, **columns})
    second = pl.DataFrame({"time_s": TIME, "dtheta1_rad": 2.0 * np.pi + 0.0 * TIME, "w1_deg_per_s": 360.0 + 0.0 * TIME})
    assert [round(column.largest, 9) for column in th.compare(first, second).columns] == [6.283185307, 360.0]


def quaternion(angle: np.ndarray, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return turns about (1, 2, 2) / 3 by an angle, q0 first."""
    half = 0.5 * angle
    parts = [np.cos(half), np.sin(half) / 3.0, 2.0 * np.sin(half) / 3.0, 2.0 * np.sin(half) / 3.0]
    return dict(zip(names, parts, strict=True))


@pytest.mark.parametrize("names", [("q0", "q1", "q2", "q3"), ("true_q0", "true_q1", "true_q2", "true_q3")])
@pytest.mark.parametrize("shift", [0.0, 0.005])
def test_a_quaternion_and_its_negative_are_one_attitude(names: tuple[str, ...], shift: float):
    rng = np.random.default_rng(1)
    first = pl.DataFrame({"time_s": TIME, **quaternion(TIME, names)})
    signs = rng.choice([-1.0, 1.0], TIME.size)
    values = {name: signs * value for name, value in quaternion(TIME + shift, names).items()}
    second = pl.DataFrame({"time_s": TIME + shift, **values})
    assert max(column.largest for column in th.compare(first, second).columns) < 1e-4
    turned = th.compare(first, pl.DataFrame({"time_s": TIME, **quaternion(TIME + 0.02, names)}))
    assert max(column.largest for column in turned.columns) == pytest.approx(0.01, rel=0.01)


@pytest.mark.acceptance
def test_four_columns_that_are_no_quaternion_keep_their_signs():
    first = pl.DataFrame({"time_s": TIME, **{f"v{k}": np.full(TIME.size, 2.0) for k in range(4)}})
    second = pl.DataFrame({"time_s": TIME, **{f"v{k}": np.full(TIME.size, -2.0) for k in range(4)}})
    assert [column.largest for column in th.compare(first, second).columns] == [4.0] * 4
