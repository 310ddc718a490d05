"""Without a known σ nothing is guaranteed: the answer says so, and how to find σ."""

import gzip
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.positions import Session
from generator.runs import PROGRAMME, Bench
from trihedron.tools.document import text
from trihedron.tools.records.sigma import deviation_widening
from trihedron.tools.reports import write_report
from trihedron.tools.reports.calibration import applied_page

FIELD = Path(os.environ.get("TRIHEDRON_DATA") or Path(th.__file__).parents[1] / "shared" / "data") / "field"


def raw(white: float) -> Any:
    record, _ = Bench(white=white).run(PROGRAMME)
    return record


def promises(page: str) -> list[str]:
    """Return the clauses of a page that say "guaranteed" other than to deny it."""
    clauses = re.split(r"[.;,<>\n]", page)
    return [c for c in clauses if "guaranteed" in c and not re.search(r"\b(not|nothing|no|No)\b", c)]


def pages_of(result: Any, folder: Path) -> str:
    """Return the text, the page and the sheet of a calibration."""
    write_report(folder / "page.html", result)
    result.sheet(folder / "sheet.html")
    pages = [(folder / name).read_text(encoding="utf-8") for name in ("page.html", "sheet.html")]
    return "\n".join([str(result), *pages])


@pytest.mark.acceptance
@pytest.mark.parametrize("white", [3e-5, 1e-4, 3e-4])
def test_scatter_within_rests_is_no_bound(white, tmp_path):
    """The verdict says so, and how to find a bound; the estimates are given."""
    result = th.calibrate(raw(white))
    assert result.verdict == "noise-unknown"
    content = result.to_json()
    assert content["sigma"]["kind"] == "unknown"
    assert "give --noise-sd or --noise-bound" in content["sigma"]["find"]
    assert all(entry["estimate"] is not None for entry in content["parameters"])
    assert all(entry["guaranteed_error"] is None for entry in content["parameters"])
    assert str(result).startswith("Noise bound unknown: ")
    assert "give --noise-sd or --noise-bound" in str(result)
    assert promises(pages_of(result, tmp_path)) == []


@pytest.mark.acceptance
def test_scatter_that_the_model_exceeds_is_no_bound_either(tmp_path):
    """Errors are constant over a rest, a hundred times its scatter: least squares are given, with positions to
    repeat."""
    record = raw(3e-6)
    off = 5e-3 * np.sin(37.0 * record.alpha + 23.0 * record.beta)
    record = replace(record, specific_force=record.specific_force + off[:, None])
    result = th.calibrate(record)
    assert result.verdict == "noise-unknown"
    assert result.next_positions
    assert all(p.estimate is not None and p.low is None for p in result.targets)
    assert promises(pages_of(result, tmp_path)) == []
    applied: Any = th.apply(result, record)
    assert "the calibration's verdict is noise-unknown" in applied.not_guaranteed[0]
    assert promises(text(applied_page(applied))) == []


@pytest.mark.acceptance
@pytest.mark.parametrize("options", [{}, {"noise_sd": 4e-6}])
def test_an_estimated_bound_guarantees_nothing(options, tmp_path):
    session = Session.drawn(np.random.default_rng(3), 24)
    alpha, beta = np.tile(session.alpha, 2), np.tile(session.beta, 2)
    session = Session.planned(session.stand, alpha, beta)
    record = session.record([], np.random.default_rng(4).normal(0.0, 4e-6, (48, 3)))
    result = th.calibrate(record, **options)
    assert result.sigma.kind == "estimated"
    assert result.verdict == "consistent"
    applied: Any = th.apply(result, record)
    assert applied.not_guaranteed
    assert promises(pages_of(result, tmp_path) + text(applied_page(applied))) == []
    path = tmp_path / "twice.html"
    shown = th.calibrate_together(record, replace(record, time_s=record.time_s + 1.0), **options)
    write_report(path, shown)
    assert promises(str(shown) + path.read_text(encoding="utf-8")) == []


def test_a_bound_that_is_given_is_one():
    result = th.calibrate(raw(1e-4), noise_bound=1e-4)
    assert result.sigma.kind == "bound"
    assert result.verdict == "consistent"
    assert "(guaranteed; `trihedron apply` corrects)" in str(result)


@pytest.mark.acceptance
def test_a_series_from_the_field_without_a_bound_is_not_guaranteed(tmp_path):
    packed = FIELD / "raw_no_sigma.csv.gz"
    if not packed.exists():
        pytest.skip(f"{packed} is absent")
    path = tmp_path / "raw.csv"
    path.write_bytes(gzip.decompress(packed.read_bytes()))
    result = th.calibrate(path)
    assert result.verdict == "noise-unknown"
    assert result.sigma.kind == "unknown"
    assert promises(pages_of(result, tmp_path)) == []


@pytest.mark.parametrize("count", [5, 10, 40])
def test_a_deviation_by_few_rests_is_widened_until_it_covers(count):
    """Nineteen in twenty of the drawn deviations are not below the truth after widening."""
    drawn = np.random.default_rng(count).normal(size=(4000, count))
    widened = deviation_widening(count, 0.05) * np.sqrt(np.mean(drawn**2, axis=1))
    assert np.mean(widened >= 1.0) == pytest.approx(0.95, abs=0.015)
