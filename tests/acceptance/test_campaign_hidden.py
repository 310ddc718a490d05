"""The ready-made campaign of hidden effects gives the detection curves of docs/hidden-effects.md."""

import json
import os
from pathlib import Path

import pytest

from trihedron.tools import cli
from trihedron.tools.trials import Suite, named_suite, run_suite

pytestmark = pytest.mark.acceptance
CASES = max(10, round(200 * float(os.environ.get("TRIHEDRON_SUITE_SHARE", "0.1"))))


def test_the_campaign_of_hidden_effects_counts_as_the_suite_does(tmp_path, capsys):
    """Part of `scenarios/campaigns/hidden-effects.toml`: detection against size, case for case that of the suite."""
    ready = Path(__file__).resolve().parents[2] / "scenarios" / "campaigns" / "hidden-effects.toml"
    (tmp_path / "c.toml").write_text(ready.read_text(encoding="utf-8").replace("repeats = 200", f"repeats = {CASES}"))
    assert cli.main(["campaign", str(tmp_path / "c.toml"), "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    suite = named_suite("detection")
    process = run_suite(suite.options, CASES, suite.seed)
    assert isinstance(process, Suite)
    computed = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["computed"]
    falsified, right, confusion, inside = (item["result"] for item in computed)
    expected = {b.low: (b.cases, b.detected, b.named) for b in process.detection}
    result = {
        f["low"]: (f["cases"], f["count"], r["count"]) for f, r in zip(falsified, right, strict=True) if f["cases"]
    }
    assert result == expected
    assert confusion == process.confusion
    assert inside[0]["count"] == process.size_errors["inside_intervals"]
