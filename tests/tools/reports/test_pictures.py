"""Pictures: well-formed, the same bytes each time, for any labels and very few data."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy import stats

from reference import interval_picture, strips_picture
from trihedron.tools.calibration import Positions
from trihedron.tools.motion import AttitudeRun
from trihedron.tools.reports import (
    attitude_picture,
    bench_tour,
    confusion_picture,
    distributions_picture,
    held_out,
    likeness_picture,
    rates_picture,
    size_errors_picture,
)
from trihedron.tools.reports.pictures import COLOURS
from trihedron.tools.reports.pictures.records import MOST_POINTS, thinned
from trihedron.tools.reports.pictures.residuals import (
    candidates,
    errors_of_turns,
    matrix_picture,
    residuals,
    truth_in_intervals,
)
from trihedron.tools.reports.pictures.suites import chance_of

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "<script>alert('x')</script> & \"$\\frac{1}{$ ]]> \x00\x1b \ud800 漢字\n"


def tour(count: int = 500) -> str:
    time = np.linspace(0.0, 60.0, count)
    readings = np.column_stack([np.sin(time / 9), np.cos(time / 9), 0.2 * np.ones(count)])
    return bench_tour(time, (6.0 * time, 360.0 - 6.0 * time), readings).svg()


def run(count: int, error: float) -> AttitudeRun:
    """Return a run with this error at every moment."""
    arrays = {"time_s": np.arange(count), "error_rad": np.full((count, 3), error), "error_angle": np.full(count, error)}
    return AttitudeRun.model_construct(**arrays)


def at(alpha: ArrayLike, beta: ArrayLike) -> Positions:
    """Return positions of a table in one mounting."""
    angles = np.array([alpha, beta], dtype=float)
    return Positions(angles[0], angles[1], np.zeros(angles.shape[1], dtype=int))


def residual_picture() -> str:
    generator = np.random.default_rng(0)
    values = generator.uniform(-2.0, 2.0, (24, 3))
    return residuals(at(np.arange(24) / 4, np.arange(24) / 6), values, 0.4 * values, np.abs(values) > 1.8).svg()


PICTURES: dict[str, Callable[[], str]] = {
    "tour": tour,
    "residuals": residual_picture,
    "strips": strips_picture,
    "what intervals are": interval_picture,
    "likeness": lambda: likeness_picture(["cubic", "sag"], np.array([[1.0, 0.95], [0.95, 1.0]])).svg(),
    "held_out": lambda: held_out(np.ones((5, 3)), np.zeros((5, 3)), range(1, 6)).svg(),
    "attitude": lambda: attitude_picture(run(90, 1.0)).svg(),
    "confusion": lambda: confusion_picture({"cubic": {"cubic": 3, "odd-quadratic": 1}, "sag": {"sag": 2}}).svg(),
    "rates": lambda: rates_picture(
        {"falsified": [{"low": 0.5, "high": 1.2, "cases": 12, "rate": 0.5, "interval": [0.3, 0.7]}]}, "size"
    ).svg(),
    "size errors": lambda: size_errors_picture([1.2, 3.0], [0.01, -0.02]).svg(),
    "candidates": lambda: candidates(["quadratic accelerometer-3", "none"], [0.7, 3.1]).svg(),
    "truths": lambda: truth_in_intervals(np.array([-1.2, -0.7]), np.array([0.8, 1.3])).svg(),
    "matrix": lambda: matrix_picture(np.eye(3), np.eye(3) - 0.5, np.eye(3) + 0.5, ("x", "y", "z"), "rad/s/g").svg(),
    "turns": lambda: errors_of_turns(np.arange(5.0), 9.0 * np.ones(5), np.ones(5)).svg(),
}
UNKNOWN = np.full((2, 3), np.nan)
NOTHING: dict[str, Callable[[], str]] = {
    "tour of one row": lambda: bench_tour(np.zeros(1), (np.ones(1), np.ones(1)), np.ones((1, 3))).svg(),
    "residuals of NaN": lambda: residuals(at([1, 2], [3, 4]), UNKNOWN, UNKNOWN, np.isfinite(UNKNOWN)).svg(),
    "one accelerometer missing": lambda: residuals(
        at([1.0], [2.0]), np.array([[0.1, np.nan, 3.0]]), None, np.array([[False, True, True]])
    ).svg(),
    "unknown attitude error": lambda: attitude_picture(run(2, np.nan)).svg(),
    "nothing hidden": lambda: confusion_picture({}).svg(),
    "nothing detected": lambda: rates_picture({"falsified": []}, "size").svg(),
    "no radius": lambda: candidates(["a", "b"], [np.nan, np.inf]).svg(),
}


def texts(svg: str) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.first(1)
@pytest.mark.parametrize("name", [*PICTURES, *NOTHING])
def test_a_picture_stands_alone_on_light_and_dark_pages(name: str) -> None:
    svg = (PICTURES | NOTHING)[name]()
    root = ElementTree.fromstring(svg)
    assert root.tag == f"{SVG}svg"
    assert root.get("aria-label")
    assert "viewBox" in root.attrib
    assert texts(svg)
    ids = re.findall(r' id="([^"]*)"', svg)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg)) == set(ids)
    drawn = re.sub(r"<style>.*?</style>", "", svg)
    assert "nan" not in drawn
    colours = set(re.findall(r"#[0-9a-fA-F]{6}(?![0-9a-zA-Z-])", drawn))
    assert colours
    assert colours <= {colour.light for colour in COLOURS}
    assert all(f"{colour.dark}!important" in svg for colour in COLOURS)
    # The original of a marker would keep its own colour: a page's rule does not reach its copies.
    assert not any("#" in original for original in re.findall(r'<path id="[^"]*" d="[^"]*" style="([^"]*)"', drawn))


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["residuals", "tour"])
def test_a_picture_repeats_to_the_byte_whatever_the_settings_of_the_user(name: str) -> None:
    first = PICTURES[name]()
    with matplotlib.rc_context({"lines.linewidth": 9.0, "font.size": 30.0, "svg.hashsalt": None}):
        before = dict(matplotlib.rcParams)
        assert PICTURES[name]() == first
        assert dict(matplotlib.rcParams) == before


@pytest.mark.acceptance
def test_hostile_labels_are_shown_cut_and_nothing_else() -> None:
    hostile = [f"{HOSTILE} {k} {'effect ' * 200}" for k in range(40)]
    for svg in (
        candidates(hostile, np.linspace(0.1, 5.0, 40).tolist()).svg(),
        held_out(np.ones((40, 3)), np.ones((40, 3)), hostile).svg(),
    ):
        assert not list(ElementTree.fromstring(svg).iter(f"{SVG}script"))
        assert any("<script>" in text for text in texts(svg))
        assert max(len(text) for text in texts(svg)) < 64


@pytest.mark.acceptance
@given(st.text(), st.floats())
@settings(max_examples=8)
def test_any_text_and_any_number_give_a_picture(text: str, value: float) -> None:
    ElementTree.fromstring(candidates([text], [value if abs(value) < 1e9 else np.nan]).svg())


def test_what_a_picture_shows_is_what_it_was_given() -> None:
    shown = texts(candidates(["worse", "better", "impossible"], [2.5, 0.25, np.nan]).svg())
    assert [text for text in shown if text in ("worse", "better", "impossible")] == ["better", "worse", "impossible"]
    assert {"0.25", "2.5", "not possible"} <= set(shown)


@pytest.mark.acceptance
def test_angles_of_several_turns_are_drawn_within_one() -> None:
    values = np.zeros((3, 3))
    figure = residuals(at([-1.0, 13.0, 40.0], [0.5, -20.0, 7.0]), values, None, values > 1.0).figure()
    for axes in figure.axes:
        angles = np.concatenate([line.get_xdata() for line in axes.lines if line.get_marker() == "o"])
        assert ((angles >= 0.0) & (angles < 360.0)).all()
    np.testing.assert_allclose(angles, np.degrees([0.5, -20.0, 7.0]) % 360.0)


def test_a_matrix_frames_what_cannot_be_zero() -> None:
    low = np.array([[0.1, -1.0, -1.0], [-1.0, -1.0, -1.0], [-1.0, -1.0, -3.0]])
    (axes,) = matrix_picture(low + 0.5, low, low + 1.0, ("x", "y", "z"), "").figure().axes
    bold = [text.get_text() for text in axes.texts if text.get_fontweight() == "bold"]
    assert bold == ["0.60", "−2.50"]


def test_thinning_keeps_peaks_gaps_and_ends() -> None:
    generator = np.random.default_rng(1)
    value = generator.normal(size=50_000)
    value[20_000:21_000] = np.nan
    value[37_123] = 99.0
    time = np.arange(50_000.0)
    thin_time, thin = thinned(time, value)
    assert len(thin) < 2.2 * MOST_POINTS
    assert np.nanmax(thin) == 99.0
    assert np.nanmin(thin) == np.nanmin(value)
    assert (thin_time[0], thin_time[-1]) == (0.0, 49_999.0)
    assert np.isnan(thin[np.searchsorted(thin_time, 20_500.0)])
    assert len(tour(200_000)) < 200_000
    assert len(thinned(time[:10], value[:10])[0]) == 10


@pytest.mark.acceptance
def test_the_band_of_chance_holds_95_of_100_rank_correlations_of_nothing():
    rng = np.random.default_rng(5)
    x = np.arange(60.0)
    result = [stats.spearmanr(x, rng.permutation(x)).statistic for _ in range(2000)]  # type: ignore[attr-defined]
    assert np.mean(np.abs(result) <= chance_of(60)) == pytest.approx(0.95, abs=0.015)
    assert chance_of(1) == 1.0


@pytest.mark.acceptance
def test_a_scalar_that_never_changes_is_told_and_not_drawn():
    svg = distributions_picture(
        {
            ("misses", ""): np.zeros(20),
            ("radius", ""): np.linspace(0.1, 0.5, 20),
            ("error of X1", "rad"): np.linspace(2.671e-7, 2.694e-7, 20),
        },
        {("misses", ""): [0.0]},
    ).svg()
    assert "mathdefault" not in svg
    assert {"10⁻⁷ rad", "2.69", "runs"} <= set(texts(svg))
    assert "always 0" in texts(svg)
    assert "−0.50" not in svg
