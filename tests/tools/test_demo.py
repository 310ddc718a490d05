"""The demonstration, run like `make demo`."""

import contextlib
import io
import json
import re
from pathlib import Path

import pytest

from trihedron.tools.demo import IMU_CALIBRATION, SHORTER, run_demo


@pytest.fixture(
    scope="module",
    params=[pytest.param(2026, id="accelerometer"), pytest.param(7, id="encoder", marks=pytest.mark.acceptance)],
)
def demo(request, tmp_path_factory):
    """Return the folder, the page and the lines of a demonstration for each hidden effect."""
    out = tmp_path_factory.mktemp("demo")
    screen = io.StringIO()
    with contextlib.redirect_stdout(screen):
        page = run_demo(out, seed=request.param, show=False)
    return out, page.read_text(encoding="utf-8"), screen.getvalue().splitlines()


@pytest.mark.acceptance
def test_the_terminal_tells_one_story_on_one_screen(demo):
    out, _, lines = demo
    assert len(lines) <= 40
    names_of_files = [line for line in lines if str(out) in line]
    assert all(len(line) <= 80 for line in lines if line not in names_of_files)
    text = " ".join(" ".join(lines).split())
    steps = (
        "Simulated",
        "42 of 42 true values",
        "Found",
        "Better",
        "The hidden error is named",
        "Next: trihedron diagnose",
    )
    places = [text.index(step) for step in steps]
    assert places == sorted(places)
    for word in ("caution", "certain", "not here", "NOT", "->"):
        assert word not in text


@pytest.mark.acceptance
def test_the_effect_is_named_within_its_interval_and_the_error_falls_five_times(demo):
    out, page, lines = demo
    # It is the shipped scenario, with every change that makes it shorter.
    scenario = (out / "scenario" / IMU_CALIBRATION).read_text(encoding="utf-8")
    assert [shorter for shorter in SHORTER.values() if shorter not in scenario] == []
    diagnosis = json.loads((out / "diagnosis.json").read_text())
    hidden = json.loads((out / "hidden-answer.json").read_text())["hidden"]
    assert diagnosis["verdict"] == "explained"
    assert not diagnosis.get("caution")
    (cause,) = diagnosis["causes"]
    assert (cause["effect"], cause["where"]) == (hidden["effect"], hidden["where"])
    for parameter in cause["parameters"]:
        assert parameter["low"] < hidden["parameters"][parameter["name"]] < parameter["high"]
    gain = diagnosis["gain"]
    factor = gain["held_out_rms_before"] / gain["held_out_rms_after"]
    assert factor > 10.0
    ratio = re.search(r"errs (\d+) times less", " ".join(" ".join(lines).split()))
    assert ratio is not None
    assert float(ratio[1]) == pytest.approx(factor, abs=0.5)
    assert ratio[0] in page


@pytest.mark.acceptance
def test_the_page_has_three_cards_with_a_picture_each_and_its_links_are_whole(demo):
    out, page, _ = demo
    cards = page[page.index('<div class="cards">') : page.index("<nav")]
    assert re.findall(r"<h2>(.*?)</h2>", cards) == ["Calibrated", "Found", "Better"]
    assert cards.count("<svg") == 3
    links = re.findall(r'href="\./([^"]+)"', page)
    assert {"measured.csv", "calibration.html", "diagnosis.html", "extended/scenario.toml"} <= set(links)
    assert all((out / link).is_file() for link in links)
    assert "http://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", page)
    paragraphs = re.findall(r"<p>(.*?)</p>", page)
    assert len(paragraphs) == len(set(paragraphs))
    assert not list(Path(out).rglob(".*"))
