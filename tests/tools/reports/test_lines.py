"""The page of a table of columns: every number is drawn unchanged, in the panel of its unit."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import polars as pl
import pytest

import trihedron as th
from trihedron.tools.reports import lines_page, page_of, write_plot
from trihedron.tools.reports.lines import spread_over_time
from trihedron.tools.reports.pictures.records import MOST_LINES, TRUTH

TIME = np.linspace(0.0, 9.0, 5001)


def table() -> pl.DataFrame:
    spike = np.zeros(5001)
    spike[2345] = -7.0
    columns = {"a_deg": 30.0 * np.sin(TIME), "w_degps": spike, "w1_rad": TIME, "speed_mps": 2.0 * TIME, "n": spike}
    flags = {"on": TIME > 4.0, "said": ["x"] * 5001}
    return pl.DataFrame({"time_s": TIME, **columns, **{f"f{k}_mps2": k * TIME for k in range(8)}, **flags})


@pytest.mark.acceptance
def test_a_panel_for_each_unit_and_every_extreme() -> None:
    page = lines_page("<run>", "said", table().lazy(), {"speed_mps": "m/s"})
    titles = [section.title for section in page.sections]
    assert titles == [
        "Columns in deg",
        "Columns in deg/s",
        "Columns in rad",
        "Columns in m/s",
        "Columns without unit",
        "Columns in m/s²",
        TRUTH,
        "All columns",
        "Not drawn",
    ]
    assert page.sections[-2].table is not None
    rows = {row[0]: [str(cell) for cell in row[1:]] for row in page.sections[-2].table.rows}
    assert rows["w_degps"] == ["0", "-7", "0", "0"]
    assert rows["speed_mps"][-1] == "18"
    assert page.sections[-1].paragraphs[0].startswith("said: texts")
    pictures = [section.picture.svg() for section in page.sections[:-2] if section.picture is not None]
    assert {ElementTree.fromstring(picture).get("role") for picture in pictures} == {"img"}
    # A panel has only lines that can be distinguished, and no constant; one point is not lost among thousands.
    assert pictures[5].count(">f") == 7 > MOST_LINES
    assert rows["f0_mps2"] == ["0", "0", "0", "0"]
    assert len(pictures[1]) < 60_000


@pytest.mark.acceptance
def test_the_page_of_a_run_is_the_same_each_time(tmp_path: Path) -> None:
    write_plot(tmp_path / "a.html", "<script>", "said", table())
    write_plot(tmp_path / "b.html", "<script>", "said", table())
    text = (tmp_path / "a.html").read_text()
    assert text == (tmp_path / "b.html").read_text()
    assert "<script>" not in text
    given = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": {"table": {"component": "TurntableMotion"}}}
    th.simulate(given, plot=tmp_path / "run.html")
    text = (tmp_path / "run.html").read_text()
    assert "table.specific_force[3]" in text
    assert "Columns that are constant throughout are not drawn." in text


def test_a_number_that_no_axis_can_show_is_a_gap_and_stands_in_the_table() -> None:
    value = np.where(TIME > 4.0, 1.7e308, TIME)
    with np.errstate(over="raise"):
        page = lines_page("<run>", "said", pl.DataFrame({"time_s": TIME, "w1_rad": value}).lazy(), {})
    assert page.sections[-1].table is not None
    assert "1.7e308" in [str(cell) for cell in page.sections[-1].table.rows[0]]


def test_the_spread_over_runs_is_that_of_the_values_at_each_time(monkeypatch) -> None:
    drawn: list[list[list]] = []
    monkeypatch.setattr("trihedron.tools.reports.lines.lines_picture", lambda panels, unit: drawn.append(panels))
    runs = [pl.DataFrame({"run": k, "time_s": [2.0, 1.0], "error_rad": [k * 2.0, k * 1.0]}) for k in range(5)]
    (section,) = spread_over_time(pl.concat(runs).lazy(), "said")
    assert (section.title, section.caption) == ("Over time, in rad", "said")
    ((panel,),) = drawn
    assert [line.name for line in panel] == [
        "error, smallest",
        "error, 5 %",
        "error, median",
        "error, 95 %",
        "error, largest",
    ]
    assert [line.time.tolist() for line in panel] == [[1.0, 2.0]] * 5
    assert np.allclose([line.value for line in panel], [[0, 0], [0.2, 0.4], [2, 4], [3.8, 7.6], [4, 8]])


@pytest.mark.acceptance
def test_the_page_of_a_campaign_draws_the_records_that_it_kept(tmp_path: Path) -> None:
    text = 'schema = "trihedron.campaign/1"\n[attitude]\nduration_s = 0.5\n[parameters]\n'
    text += "bias_1_radps = { values = [1e-4, 2e-4] }\n"
    for name, keep in {"kept": "[keep]\nrecord = true\n", "bare": ""}.items():
        (tmp_path / f"{name}.toml").write_text(text + keep, encoding="utf-8")
        th.run_campaign(tmp_path / f"{name}.toml", tmp_path / name, jobs=1)
        page = (tmp_path / name / "index.html").read_text(encoding="utf-8")
        assert ("Records of 2 runs: quantiles over the runs at each time." in page) == (name == "kept")
        assert ("Over time, in rad" in page) == (name == "kept")


def test_a_comparison_draws_the_columns_that_differ_and_nothing_else(tmp_path: Path) -> None:
    columns = {"time_s": TIME[:50], "a_deg": TIME[:50], "f1_mps2": TIME[:50], "f2_mps2": TIME[:50]}
    pl.DataFrame(columns).write_csv(tmp_path / "first.csv")
    pl.DataFrame({**columns, "f2_mps2": TIME[:50] + 0.5}).write_csv(tmp_path / "second.csv")
    page = page_of(th.compare(tmp_path / "first.csv", tmp_path / "second.csv"))
    assert page is not None
    (pictured,) = [section for section in page.sections if section.picture is not None]
    assert pictured.title == "Second minus first, in m/s²"
    assert pictured.picture is not None
    (axes,) = pictured.picture.figure().axes
    (line,) = axes.lines
    np.testing.assert_allclose(np.asarray(line.get_ydata()), 0.5)
    same = page_of(th.compare(tmp_path / "first.csv", tmp_path / "first.csv"))
    assert same is not None
    assert [section for section in same.sections if section.picture is not None] == []
