"""What a suite shows: the table of confusion, false alarms, detection against size, bias."""

import csv
import io
import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_text
from .outcomes import KINDS, Counted, Outcome
from .suite import Suite

SCHEMA = "trihedron.hidden-suite/1"
BINS = (0.0, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 16.0, math.inf)
"""Edges of the sizes, relative to that of sure detection, over which detection is counted."""
NOTHING = "nothing"
"""Stands for the secret of a clean record."""
MOST_LISTED = 20


@dataclass(frozen=True)
class DetectionBin:
    """Cases within a range of sizes relative to that of sure detection.

    Attributes
    ----------
    low, high : float
        of the range
    cases, detected, named : int
        how many; in how many the model was falsified; in how many the effect was named rightly
    """

    low: float
    high: float
    cases: int
    detected: int
    named: int


def hidden_name(outcome: Counted) -> str:
    """The secret in words: the names of the effects."""
    return " + ".join(sorted(place.effect for place in outcome.case.places)) or NOTHING


def named_name(outcome: Counted) -> str:
    """What was made of it in words: names of the effects, or the verdict where there is none."""
    if outcome.kind == "candidate":
        return "ambiguous, among them"
    if outcome.verdict == "ambiguous":
        return "ambiguous, not among them"
    if outcome.verdict == "explained":
        return hidden_name(outcome) if outcome.kind == "right" else " + ".join(sorted(p.effect for p in outcome.named))
    return NOTHING if outcome.verdict == "consistent" else outcome.verdict


def confusion(outcomes: Sequence[Counted]) -> dict[str, Counter[str]]:
    """Secret in words -> what was made of it -> how often."""
    table: dict[str, Counter[str]] = {}
    for outcome in sorted(outcomes, key=hidden_name):
        table.setdefault(hidden_name(outcome), Counter())[named_name(outcome)] += 1
    return table


def detection(outcomes: Sequence[Outcome]) -> list[DetectionBin]:
    """Single effects counted by their size relative to that of sure detection; ranges without cases are left out."""
    singles = [outcome for outcome in outcomes if len(outcome.case.hidden) == 1]
    found = []
    for low, high in pairwise(BINS):
        own = [o for o in singles if low <= o.case.hidden[0].relative_size < high]
        if own:
            detected = sum(o.verdict not in ("consistent", "insufficient") for o in own)
            found.append(DetectionBin(low, high, len(own), detected, sum(o.kind == "right" for o in own)))
    return found


def part(count: int, of: DetectionBin) -> str:
    """A part of a range's cases, in words."""
    return f"{count / of.cases:.0%}"


def kinds(outcomes: Sequence[Counted]) -> dict[str, int]:
    """How many of each kind, in the order of `KINDS`."""
    counts = Counter(outcome.kind for outcome in outcomes)
    return {kind: counts[kind] for kind in KINDS if counts[kind]}


def suite_json(suite: Suite) -> dict[str, Any]:
    """The object of schema trihedron.hidden-suite/1."""
    outcomes = suite.outcomes
    errors = np.array([error for outcome in outcomes for error in outcome.errors])
    inside = [outcome.inside for outcome in outcomes if outcome.inside is not None]
    clean = [outcome for outcome in outcomes if not outcome.case.hidden]
    options = suite.options
    return {
        "schema": SCHEMA,
        "mode": options.mode,
        "effects": list(options.effects),
        "positions": list(options.positions),
        "noise": options.noise,
        "size": None if options.size is None else list(options.size),
        "seed": suite.seed,
        "cases": len(outcomes),
        "redrawn": sum(outcome.case.redrawn for outcome in outcomes),
        "outcomes": kinds(outcomes),
        "false_alarms": {"clean": len(clean), "alarms": sum(outcome.kind != "right" for outcome in clean)},
        "confusion": {name: dict(sorted(row.items())) for name, row in confusion(outcomes).items()},
        "detection": [
            {
                "low": b.low,
                "high": b.high if math.isfinite(b.high) else None,
                "cases": b.cases,
                "detected": b.detected,
                "named": b.named,
            }
            for b in detection(outcomes)
        ],
        "size_errors": {
            "estimates": len(errors),
            "mean": float(errors.mean()) if len(errors) else None,
            "rms": float(np.sqrt(np.mean(errors**2))) if len(errors) else None,
            "largest": float(np.abs(errors).max()) if len(errors) else None,
            "cases_with_intervals": len(inside),
            "inside_intervals": sum(inside),
        },
        "results": [outcome.to_json() for outcome in outcomes],
    }


def suite_text(suite: Suite) -> str:
    """What a person is told."""
    said = suite_json(suite)
    count = len(suite.outcomes)
    lines = [
        f"{count} cases ({suite.options.mode}), seed {suite.seed}: "
        + ", ".join(f"{kind} {number}" for kind, number in said["outcomes"].items())
    ]
    if said["redrawn"]:
        lines.append(f"{said['redrawn']} effects were put aside, as no possible size would do at their positions")
    alarms = said["false_alarms"]
    if alarms["clean"]:
        lines.append(f"false alarms on clean records: {alarms['alarms']} of {alarms['clean']}")
    if any(outcome.case.hidden for outcome in suite.outcomes):
        lines += ["", f"{'hidden':<44} {'cases':>5}  what was made of it"]
        for name, row in confusion(suite.outcomes).items():
            made = ", ".join(f"{'right' if k == name else k} {n}" for k, n in row.most_common())
            lines.append(f"{name:<44} {sum(row.values()):>5}  {made}")
    curve = detection(suite.outcomes)
    if curve:
        lines += ["", "size / sure detection   cases  falsified  named"]
        lines += [
            f"{b.low:>6.2f} to {b.high:>6.2f}        {b.cases:>6}  {part(b.detected, b):>9}  {part(b.named, b):>5}"
            for b in curve
        ]
    errors = said["size_errors"]
    if errors["estimates"]:
        lines += [
            "",
            f"estimated sizes: mean error {errors['mean']:+.2%}, rms {errors['rms']:.2%}, largest "
            f"{errors['largest']:.2%}; inside their intervals {errors['inside_intervals']} of "
            f"{errors['cases_with_intervals']}",
        ]
    wrong = [outcome for outcome in suite.outcomes if outcome.kind in ("wrong", "part")]
    lines += [""] if wrong else []
    for outcome in wrong[:MOST_LISTED]:
        hidden = " and ".join(place.title for place in outcome.case.places) or NOTHING
        named = " and ".join(place.title for place in outcome.named)
        lines.append(f"case {outcome.case.index}: hidden {hidden}; {outcome.verdict}: {named}")
    return "\n".join(lines)


def cases_csv(suite: Suite) -> str:
    """One row for each case."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    header = ("case", "positions", "mountings", "baseline", "noise", "hidden", "size_over_detection")
    writer.writerow((*header, "exclusion_over_detection", "radius", "verdict", "outcome", "named", "inside", "error"))
    for o in suite.outcomes:
        bench = o.case.bench
        first = o.case.hidden[0] if o.case.hidden else None
        writer.writerow(
            (
                o.case.index,
                len(bench.alpha),
                " ".join(bench.mountings),
                bench.baseline,
                o.case.noise,
                " + ".join(place.title for place in o.case.places),
                "" if first is None else f"{first.relative_size:.4g}",
                "" if first is None else f"{first.sizes.excluded / first.sizes.detected:.4g}",
                f"{o.radius:.6g}",
                o.verdict,
                o.kind,
                " + ".join(place.title for place in o.named),
                "" if o.inside is None else int(o.inside),
                " ".join(f"{error:.4g}" for error in o.errors),
            )
        )
    return stream.getvalue()


def write_suite(suite: Suite, folder: Path) -> list[Path]:
    """Write suite.json, cases.csv and the page index.html into a folder; returns the files."""
    from ..report.suite_page import suite_page

    files = [folder / "suite.json", folder / "cases.csv", folder / "index.html"]
    write_text(files[0], json.dumps(suite_json(suite), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(files[1], cases_csv(suite))
    write_text(files[2], suite_page(suite))
    return files
