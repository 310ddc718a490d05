"""Suites of hidden effects for a person: text, page and files."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...fmus import version
from ..campaign.summary import rate
from ..document.blocks import Page, Section, Table
from ..document.page import write_page
from ..files import write_text
from ..trials.outcome import NOTHING
from ..trials.suite import Detection, Suite, cases_csv, confusion
from .pictures.suites import confusion_picture, rates_picture, size_errors_picture

MOST_LISTED = 20
SHOWN = {
    "clean": "clean records, nothing hidden",
    "single": "one effect hidden, at 1.5 times the size from which every rival is surely excluded",
    "between": "one effect hidden, larger than what is surely detected, smaller than what surely excludes every rival",
    "pairs": "two effects hidden, each at 1.5 times the size at which nothing can stand for it",
}
"""What each mode hides, in words."""
CAPTION = (
    "Rows: what was hidden. Columns: what was made of it. Blue is right, grey left open with the truth among the "
    "candidates."
)


def write_suite(suite: Suite, folder: Path) -> list[Path]:
    """Write suite.json, cases.csv and the page index.html into a folder; returns the files."""
    files = [folder / "suite.json", folder / "cases.csv", folder / "index.html"]
    write_text(files[0], json.dumps(suite.to_json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(files[1], cases_csv(suite))
    write_page(files[2], suite_page(suite))
    return files


def suite_lines(suite: Suite) -> list[str]:
    """What a person is told."""
    bench = not suite.strapdown
    what = f"{suite.cases} cases ({suite.mode})" if bench else f"{suite.cases} strapdown records"
    lines = [f"{what}, seed {suite.seed}: " + ", ".join(f"{kind} {number}" for kind, number in suite.outcomes.items())]
    if bench and suite.redrawn:
        lines.append(f"{suite.redrawn} effects were put aside, as no possible size would do at their positions")
    alarms = suite.false_alarms
    if alarms["clean"]:
        lines.append(f"false alarms on clean records: {alarms['alarms']} of {alarms['clean']}")
    if alarms["clean"] < suite.cases:
        width = 44 if bench else 28
        lines += ["", f"{'hidden':<{width}} {'cases':>5}  what was made of it"]
        for name, row in confusion(suite.results).items():
            made = ", ".join(f"{'right' if k == name else k} {n}" for k, n in row.most_common())
            lines.append(f"{name:<{width}} {sum(row.values()):>5}  {made}")
    if bench and suite.detection:
        lines += ["", "size / sure detection   cases  falsified  named"]
        lines += [
            f"{b.low:>6.2f} to {_top(b):>6.2f}        {b.cases:>6}  {b.detected / b.cases:>9.0%}  "
            f"{b.named / b.cases:>5.0%}"
            for b in suite.detection
        ]
    errors = suite.size_errors
    if errors["estimates"]:
        mean = f"mean error {errors['mean']:+.2%}, rms" if bench else "rms error"
        lines += [
            "",
            f"estimated sizes: {mean} {errors['rms']:.2%}, largest {errors['largest']:.2%}; inside their intervals "
            f"{errors['inside_intervals']} of {errors['cases_with_intervals']}",
        ]
    if bench:
        told = [outcome for outcome in suite.results if outcome.outcome in ("wrong", "part")]
    else:
        told = [outcome for outcome in suite.results if outcome.outcome not in ("right", "candidate")]
    lines += [""] if told else []
    for outcome in told[:MOST_LISTED]:
        hidden = outcome.titles(named=False, between=" and ") or NOTHING
        named = outcome.titles(named=True, between=" and ")
        where = f" ({outcome.reference})" if suite.strapdown else ""
        made = f"{outcome.verdict}: {named}" if bench or named else outcome.verdict
        lines.append(f"case {outcome.case}: hidden {hidden}{where}; {made}")
    return lines


def _top(bin_: Detection) -> float:
    return math.inf if bin_.high is None else bin_.high


def suite_page(suite: Suite) -> Page:
    """The page: what was hidden, the table of confusion, errors of the sizes, every case that was not named rightly."""
    bench = not suite.strapdown
    told = ", ".join(f"{number} {kind}" for kind, number in suite.outcomes.items())
    hidden = any(outcome.places for outcome in suite.results)
    picture = confusion_picture(confusion(suite.results)) if hidden else None
    about = _about_bench(suite, told) if bench else _about_block(suite, hidden=hidden)
    sections = [Section("What was made of the records", about, picture, CAPTION)]
    if bench:
        sections += _sizes(suite)
    header = ["case", "positions" if bench else "reference", "hidden", "verdict", "outcome", "named"]
    header += [] if bench else ["what it says"]
    rows: list[list[Any]] = []
    for outcome in suite.results:
        if outcome.outcome != "right":
            words = [outcome.titles(named=False) or NOTHING, outcome.verdict, outcome.outcome]
            words.append(outcome.titles(named=True))
            if suite.strapdown:
                rows.append([outcome.case, outcome.reference, *words, outcome.why])
            else:
                rows.append([outcome.case, outcome.positions, *words])
    if rows:
        sections.append(Section("Cases that were not named rightly", table=Table(header, rows)))
    return Page(
        f"Hidden effects: {suite.mode}" if bench else "Hidden effects in strapdown records",
        f"Of {suite.cases} {'cases' if bench else 'records'} {told}.",
        sections,
        tone="attention" if "wrong" in suite.outcomes else "good",
        provenance={"trihedron": version(), "seed": suite.seed} | ({"mode": suite.mode} if bench else {}),
    )


def _about_bench(suite: Suite, told: str) -> list[str]:
    what = SHOWN[suite.mode] if suite.size is None else "effects of drawn sizes"
    fewest, most = suite.positions
    return [
        f"{suite.cases} cases: {what}; {fewest} to {most} positions in random order, noise {suite.noise}.",
        "The bench runs in time, with its slews, dwells and temperature; the diagnosis gets the record, σ and the "
        f"mountings, and nothing else. {told.capitalize()}.",
        f"{suite.redrawn} drawn effects were put aside, as no possible size would do at their positions.",
    ]


def _about_block(suite: Suite, *, hidden: bool) -> list[str]:
    sizes = "Nothing is hidden."
    if hidden and suite.size is not None:
        least, greatest = suite.size
        sizes = f"Effects are {least:g} to {greatest:g} times the size from which a record surely disproves the model."
    return [
        "A block is moved by hand from rest to rest; gyro and accelerometer block read, with white and flicker noise. "
        "Every second record has the true attitude, the others have gravity at their rests alone. The diagnosis gets "
        "the record and nothing else.",
        sizes,
    ]


def _sizes(suite: Suite) -> list[Section]:
    """From which size effects are seen, and how right the estimated sizes are."""
    sections = []
    if suite.detection:
        curves: dict[str, list[dict[str, Any]]] = {"falsified": [], "named rightly": []}
        for b in suite.detection:
            high = b.low * 1.19**2 if b.high is None else b.high
            for label, count in zip(curves, (b.detected, b.named), strict=True):
                counted = rate(np.arange(b.cases) < count)
                curves[label].append({"low": max(b.low, 0.18), "high": high, **counted})
        sections.append(
            Section(
                "From which size it is seen",
                [],
                rates_picture(curves, "size over that of sure detection", "cases", "surely detected from here"),
                "Sizes are relative to that from which the effect is surely detected at its positions, whatever the "
                "noise within σ.",
            )
        )
    pairs = [
        (secret.relative_size, error)
        for outcome in suite.results
        if len(outcome.errors) == len(outcome.secrets)
        for secret, error in zip(outcome.secrets, outcome.errors, strict=True)
    ]
    if pairs:
        errors = suite.size_errors
        sections.append(
            Section(
                "How right the sizes are",
                [
                    f"In {errors['inside_intervals']} of {errors['cases_with_intervals']} cases named by their own "
                    "name the true parameters are inside their intervals."
                ],
                size_errors_picture([size for size, _ in pairs], [error for _, error in pairs]),
                "Relative error of each estimated size; the band is the mean with twice its standard error.",
            )
        )
    return sections
