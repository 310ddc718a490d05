"""Three hundred fresh records, by a generator that shares no code with the product: nothing that is printed misleads.

Read are JSON, the terminal's text and, of one record in four, the page as HTML. `TRIHEDRON_SUITE_SHARE` runs a part of
them. Verdicts, wrong names and processor seconds are reported, not asserted.
"""

import os
import re
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from generator import SIGMA
from generator.fresh import POSITION_KINDS, STRAPDOWN_KINDS, Fresh, position_record, strapdown_record
from shown_bounds import wrong_on_page
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.document.page import html
from trihedron.tools.records import PositionRecord, StrapdownRecord, read_record
from trihedron.tools.reports import page_of

pytestmark = pytest.mark.acceptance
SHARE = float(os.environ.get("TRIHEDRON_SUITE_SHARE", "1"))
OF_POSITIONS, OF_STRAPDOWN, SEED = 20, 9, 4000
"""Records of each kind, and the seed of the first."""
PAGES = 4
"""Of one record in so many the page is read, too."""
WITHIN = re.compile(r"^  (\S+) .*within \[([^,\]]+), ([^\]]+)\]")


@dataclass
class Said:
    """What was said of a record, and what of it misleads, each with the record that it was said of."""

    fresh: Fresh
    seed: int
    verdict: str
    named: str
    seconds: float
    rows: int
    zero: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    rounded: list[str] = field(default_factory=list)
    untrue: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        output = f"{self.fresh.kind} {self.seed}: {self.verdict}, {self.seconds:.1f} s, {self.named}"
        for name in ("zero", "outside", "rounded", "untrue"):
            output += f"; {name}: {', '.join(getattr(self, name))}" if getattr(self, name) else ""
        return output


def judged(fresh: Fresh, seed: int) -> Said:
    """A record's diagnosis, and of one of positions its calibration, held against themselves and the truth."""
    record = read_record(fresh.path)
    options: dict[str, Any] = {}
    positions = isinstance(record, PositionRecord)
    if positions:
        options = {"noise_bound": SIGMA}
    assert isinstance(record, PositionRecord | StrapdownRecord)
    began = time.process_time()
    result = diagnose(record, **options)
    seconds = time.process_time() - began
    content = result.to_json()
    sets = [first["causes"] for first in content["explanations"] if result.best and not first.get("extension")]
    outcome = Said(fresh, seed, content["verdict"], "", seconds, len(record))
    right = [any((c["effect"], c["where"]) in fresh.hidden for c in causes) for causes in sets if causes]
    if content["verdict"] == "explained":
        outcome.named = "right" if right[0] and len(sets[0]) == 1 else "wrong"
        if right[0]:
            outcome.untrue += untrue_sizes(fresh, sets[0])
    elif content["verdict"] == "ambiguous":
        outcome.named = "among" if any(right) else "not among"
    for cause in (cause for causes in sets for cause in causes):
        title = f"{cause['effect']} {cause['where']}"
        if may_be_zero(cause["parameters"]):
            outcome.zero.append(title)
        outcome.outside += [f"{title} {name}" for name in outside(cause["parameters"])]
    outcome.outside += outside(result.stated.to_json()["parameters"])
    targets = [{**entry, "name": entry["symbol"], "estimate": entry["after"]} for entry in content.get("targets") or []]
    outcome.outside += outside(targets)
    outcome.rounded += rounded_inwards(
        str(result), [p for cause in content["causes"] or next(iter(sets), []) for p in cause["parameters"]]
    )
    if seed % PAGES == 0:
        page = page_of(result, record)
        assert page is not None
        outcome.rounded += wrong_on_page(html(page), content)
    if positions:
        calibration = calibrate(record, noise_bound=SIGMA).to_json()
        if calibration["verdict"] == "consistent":
            parameters = [{**entry, "name": entry["symbol"]} for entry in calibration["parameters"]]
            outcome.outside += [f"calibration {name}" for name in outside(parameters)]
            if fresh.kind == "clean":
                truth = [{**p, "estimate": fresh.targets[p["name"]]} for p in parameters]
                outcome.untrue += [f"calibration {name}" for name in outside(truth)]
    return outcome


def may_be_zero(parameters: list[dict[str, Any]]) -> bool:
    """Whether every size of a cause may be nothing at all; a phase, a time and a time constant are no sizes.

    What has none, as readings that are exchanged from a time on, is not nothing.
    """
    sizes = [p for p in parameters if not p["name"].endswith(("phase", "start", "time_constant"))]
    low = [-float("inf") if p["low"] is None else p["low"] for p in sizes]
    high = [float("inf") if p["high"] is None else p["high"] for p in sizes]
    return bool(sizes) and all(a <= 0.0 <= b for a, b in zip(low, high, strict=True))


def outside(parameters: list[dict[str, Any]]) -> list[str]:
    """Names of what is stated outside its own interval."""
    return [
        p["name"]
        for p in parameters
        if p["estimate"] is not None
        and (
            (p["low"] is not None and p["estimate"] < p["low"]) or (p["high"] is not None and p["estimate"] > p["high"])
        )
    ]


def untrue_sizes(fresh: Fresh, causes: list[dict[str, Any]]) -> list[str]:
    """Names of true sizes that are outside the intervals of what was named rightly."""
    cause = next(c for c in causes if (c["effect"], c["where"]) in fresh.hidden)
    sizes = [{**p, "estimate": fresh.values[p["name"]]} for p in cause["parameters"] if p["name"] in fresh.values]
    return [f"true {name}" for name in outside(sizes)]


def rounded_inwards(text: str, parameters: list[dict[str, Any]]) -> list[str]:
    """Names of parameters whose printed ends leave out some of the interval; the causes' are printed first."""
    printed = [match.groups() for line in text.splitlines() if (match := WITHIN.match(line))]
    wrong = []
    for (name, low, high), p in zip(printed, parameters, strict=False):
        assert name == p["name"], (name, p["name"])
        if p["low"] is not None and float(low) > p["low"]:
            wrong.append(f"low end of {name}")
        if p["high"] is not None and float(high) < p["high"]:
            wrong.append(f"high end of {name}")
    return wrong


def table(every: list[Said]) -> str:
    """Verdicts by kind, processor seconds, and each record that misleads."""
    heads = ("right", "wrong", "among", "not among", "unexplained", "consistent", "insufficient")
    lines = [f"{'kind':<15}" + "".join(f"{head:>13}" for head in heads) + f"{'most s':>9}"]
    for kind in dict.fromkeys(judgement.fresh.kind for judgement in every):
        group = [judgement for judgement in every if judgement.fresh.kind == kind]
        counts = Counter(judgement.named or judgement.verdict for judgement in group)
        most = max(judgement.seconds for judgement in group)
        lines.append(f"{kind:<15}" + "".join(f"{counts[head]:>13}" for head in heads) + f"{most:>9.1f}")
    large = max((judgement.seconds for judgement in every if judgement.rows == 100), default=0.0)
    lines.append(f"{len(every)} records; processor seconds of a diagnosis of 100 positions at most {large:.1f}")
    lines += [
        str(s) for s in every if s.named in ("wrong", "not among") or s.zero or s.outside or s.rounded or s.untrue
    ]
    return "\n".join(lines)


def test_fresh_records_do_not_mislead(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No cause may be zero, nothing stands outside its interval, no end is rounded inwards, no true size left out."""
    every = []
    for kinds, make, count in (
        (POSITION_KINDS, position_record, OF_POSITIONS),
        (STRAPDOWN_KINDS, strapdown_record, OF_STRAPDOWN),
    ):
        for kind in kinds:
            for seed in range(SEED, SEED + max(1, round(SHARE * count))):
                fresh = make(tmp_path / f"{kind}-{seed}.csv", kind, seed)
                every.append(judged(fresh, seed))
                with capsys.disabled():
                    print(every[-1], file=sys.stderr, flush=True)
                fresh.path.unlink()
    with capsys.disabled():
        print(f"\n{table(every)}", file=sys.stderr, flush=True)
    assert [str(judgement) for judgement in every if judgement.zero] == []
    assert [str(judgement) for judgement in every if judgement.outside] == []
    assert [str(judgement) for judgement in every if judgement.rounded] == []
    assert [str(judgement) for judgement in every if judgement.untrue] == []
