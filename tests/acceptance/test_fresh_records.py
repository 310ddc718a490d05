"""Three hundred fresh records, by a generator that shares no code with the product: no output misleads.

The test reads JSON, the terminal's text and, for one record in four, the page as HTML. `TRIHEDRON_SUITE_SHARE` runs a
part of them. Verdicts, wrong names and processor seconds are reported, not asserted.
"""

import os
import re
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from generator import SIGMA
from generator.fresh import POSITION_KINDS, STRAPDOWN_KINDS, Fresh, position_record, strapdown_record
from shown_bounds import sets_shown, wrong_on_page
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.document import html
from trihedron.tools.records import PositionRecord, read_record
from trihedron.tools.reports import page_of

pytestmark = pytest.mark.acceptance
SHARE = float(os.environ.get("TRIHEDRON_SUITE_SHARE", "1"))
SEED = 4000
PAGES = 4
"""Interval of the records whose page is read too."""
WITHIN = re.compile(r"^  (\S+) .*within \[([^,\]]+), ([^\]]+)\]")
NO_SIZES = ("phase", "start", "time_constant")
Numbers = list[dict[str, Any]]


def ends_of(parameter: dict[str, Any]) -> tuple[float, float]:
    low, high = parameter["low"], parameter["high"]
    return -float("inf") if low is None else low, float("inf") if high is None else high


def may_be_zero(parameters: Numbers) -> bool:
    """Return True if every size of a cause may be zero.

    A cause without a size, such as readings exchanged from a time on, is not zero.
    """
    sizes = [ends_of(p) for p in parameters if not p["name"].endswith(NO_SIZES)]
    return bool(sizes) and all(low <= 0.0 <= high for low, high in sizes)


def outside(parameters: Numbers, label: str, values: dict[str, float] | None = None) -> list[str]:
    """Return the names of numbers, by default the estimates, that are outside their own intervals."""
    wrong = []
    for p in parameters:
        value = p["estimate"] if values is None else values.get(p["name"])
        low, high = ends_of(p)
        if value is not None and not low <= value <= high:
            wrong.append(f"{label} {p['name']} outside")
    return wrong


def rounded_inwards(text: str, parameters: Numbers) -> list[str]:
    """Return the names of parameters whose printed ends cut off part of the interval; the causes' come first."""
    printed = [match.groups() for line in text.splitlines() if (match := WITHIN.match(line))]
    wrong = []
    for (name, low, high), p in zip(printed, parameters, strict=False):
        assert name == p["name"], (name, p["name"])
        least, most = ends_of(p)
        if float(low) > least or float(high) < most:
            wrong.append(f"{name} rounded inwards")
    return wrong


def misleading(fresh: Fresh, seed: int) -> tuple[str, list[str]]:
    """Return the verdict on a record, and the contradictions in its diagnosis and calibration."""
    record: Any = read_record(fresh.path)
    options: dict[str, Any] = {"noise_bound": SIGMA} if isinstance(record, PositionRecord) else {}
    result: Any = diagnose(record, **options)
    content, text = result.to_json(), str(result)
    sets = sets_shown(content)
    right = []
    for causes in sets:
        right += [cause for cause in causes if (cause["effect"], cause["where"]) in fresh.hidden]
    verdict = f"{content['verdict']}, {'right' if right else 'not'} among {len(sets)}"
    wrong = []
    for cause in (cause for causes in sets for cause in causes):
        title = f"{cause['effect']} {cause['where']}"
        wrong += [f"{title} may be zero"] if may_be_zero(cause["parameters"]) else []
        wrong += outside(cause["parameters"], title)
    if content["verdict"] == "explained" and right:
        wrong += outside(right[0]["parameters"], "true", fresh.values)
    wrong += outside(result.stated.to_json()["parameters"], "stated")
    targets = [{**entry, "name": entry["symbol"], "estimate": entry["after"]} for entry in content.get("targets") or []]
    wrong += outside(targets, "target")
    first_shown = content["causes"] or next(iter(sets), [])
    wrong += rounded_inwards(text, [p for cause in first_shown for p in cause["parameters"]])
    if seed % PAGES == 0:
        page = page_of(result, record)
        assert page is not None
        wrong += wrong_on_page(html(page), content)
    if options:
        calibration = calibrate(record, noise_bound=SIGMA).to_json()
        if calibration["verdict"] == "consistent":
            parameters = [{**entry, "name": entry["symbol"]} for entry in calibration["parameters"]]
            wrong += outside(parameters, "calibration")
            if fresh.kind == "clean":
                wrong += outside(parameters, "true calibration", fresh.targets)
    return verdict, wrong


@pytest.mark.parametrize(
    ("kind", "make", "count"),
    [
        *((kind, position_record, 20) for kind in POSITION_KINDS),
        *((kind, strapdown_record, 9) for kind in STRAPDOWN_KINDS),
    ],
)
def test_fresh_records_do_not_mislead(kind, make, count, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No cause may be zero, nothing is outside its interval, no end is rounded inwards, no true size is left out."""
    wrong = {}
    for seed in range(SEED, SEED + max(1, round(SHARE * count))):
        began = time.process_time()
        verdict, wrong[seed] = misleading(make(tmp_path / "record.csv", kind, seed), seed)
        with capsys.disabled():
            seconds = time.process_time() - began
            print(f"{kind} {seed}: {verdict}, {seconds:.1f} s, {wrong[seed]}", file=sys.stderr, flush=True)
    assert not any(wrong.values()), wrong
