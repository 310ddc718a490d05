"""The demonstration, run like `make demo`."""

import json
import re
from pathlib import Path

import pytest

from trihedron.tools.demo import IMU_CALIBRATION, MEASURED_RECORD, SHORTER, find_record, run_demo
from trihedron.tools.records import BenchRecord, read_record


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo")
    return out, run_demo(out, seed=2026, show=False)


def test_the_demo_holds_the_truth_names_the_effect_and_measures_the_gain(demo):
    out, page = demo
    text = page.read_text(encoding="utf-8")
    assert "42 of 42 true values lie inside their guaranteed intervals" in text
    # It is the shipped scenario, with every change that makes it shorter.
    scenario = (out / "scenario" / IMU_CALIBRATION).read_text(encoding="utf-8")
    assert [shorter for shorter in SHORTER.values() if shorter not in scenario] == []
    diagnosis = json.loads((out / "diagnosis.json").read_text())
    hidden = json.loads((out / "hidden-answer.json").read_text())["hidden"]
    assert diagnosis["verdict"] == "explained"
    assert diagnosis["causes"][0]["effect"] == hidden["effect"]
    assert diagnosis["causes"][0]["where"] == hidden["where"]
    gain = diagnosis["gain"]
    assert gain["held_out_rms_after"] < 0.6 * gain["held_out_rms_before"]
    # Its record is one of a whole bench, with both witnesses.
    assert isinstance(read_record(out / "measured.csv"), BenchRecord)
    (parameter,) = diagnosis["causes"][0]["parameters"]
    assert parameter["low"] < hidden["parameters"]["coefficient"] < parameter["high"]
    assert parameter["low"] > 0.0


def test_the_page_is_whole_and_links_to_what_was_written(demo):
    out, page = demo
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") >= (6 if find_record(MEASURED_RECORD) else 5)
    links = re.findall(r'href="\./([^"]+)"', text)
    assert links
    assert all((out / link).is_file() for link in links)
    assert "http://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert not list(Path(out).rglob(".*"))


def test_the_record_of_the_demo_says_where_to_get_what_is_missing(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("trihedron.tools.demo.find_record", lambda _: None)
    from trihedron.tools.demo import attitude_of_measured_record

    section = attitude_of_measured_record(tmp_path)
    assert "doi 10.3390/data6070072" in capsys.readouterr().out
    assert "doi 10.3390/data6070072" in section.paragraphs[0]
