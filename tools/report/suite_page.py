"""The page of a suite of hidden effects."""

import math

from ...fmus import version
from ..hidden_suite.outcomes import KINDS
from ..hidden_suite.suite import Suite
from ..hidden_suite.summary import confusion, detection, kinds, suite_json
from .page import Section, Table, render_page
from .suite_pictures import confusion_picture, detection_picture, size_errors_picture

SHOWN = {
    "clean": "clean records, nothing hidden",
    "single": "one effect hidden, at 1.5 times the size from which every rival is surely excluded",
    "between": "one effect hidden, larger than what is surely detected, smaller than what surely excludes every rival",
    "pairs": "two effects hidden, each at 1.5 times the size at which nothing can stand for it",
}
"""What each mode hides, in words."""


def suite_page(suite: Suite) -> str:
    """The page: what was hidden, the table of confusion, detection against size, errors of the sizes, every case."""
    counts = kinds(suite.outcomes)
    total = len(suite.outcomes)
    told = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if kind in counts)
    hidden = [outcome for outcome in suite.outcomes if outcome.case.hidden]
    what = SHOWN[suite.options.mode] if suite.options.size is None else "effects of drawn sizes"
    fewest, most = suite.options.positions
    said = suite_json(suite)
    about = f"{total} cases: {what}; {fewest} to {most} positions in random order, noise {suite.options.noise}."
    sections = [
        Section(
            "What was made of the records",
            [
                about,
                "The bench runs in time, with its slews, dwells and temperature; the diagnosis gets the record, σ and "
                f"the mountings, and nothing else. {told.capitalize()}.",
                f"{said['redrawn']} drawn effects were put aside, as no possible size would do at their positions.",
            ],
            confusion_picture(confusion(suite.outcomes)) if hidden else None,
            "Rows: what was hidden. Columns: what was made of it. Blue is right, grey left open with the truth among "
            "the candidates.",
        )
    ]
    curve = detection(suite.outcomes)
    if curve:
        middles = [b.low * 1.19 if not math.isfinite(b.high) else math.sqrt(max(b.low, 0.18) * b.high) for b in curve]
        sections.append(
            Section(
                "From which size it is seen",
                [],
                detection_picture(
                    middles,
                    [b.detected / b.cases for b in curve],
                    [b.named / b.cases for b in curve],
                    [b.cases for b in curve],
                ),
                "Sizes are relative to that from which the effect is surely detected at its positions, whatever the "
                "noise within σ.",
            )
        )
    pairs = [
        (h.relative_size, error)
        for outcome in suite.outcomes
        if len(outcome.errors) == len(outcome.case.hidden)
        for h, error in zip(outcome.case.hidden, outcome.errors, strict=True)
    ]
    if pairs:
        errors = said["size_errors"]
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
    wrong = [outcome for outcome in suite.outcomes if outcome.kind != "right"]
    rows = [
        [
            outcome.case.index,
            len(outcome.case.bench.alpha),
            " + ".join(place.title for place in outcome.case.places) or "nothing",
            outcome.verdict,
            outcome.kind,
            " + ".join(place.title for place in outcome.named),
        ]
        for outcome in wrong
    ]
    if rows:
        header = ["case", "positions", "hidden", "verdict", "outcome", "named"]
        sections.append(Section("Cases that were not named rightly", table=Table(header, rows)))
    return render_page(
        f"Hidden effects: {suite.options.mode}",
        f"Of {total} cases {told}.",
        sections,
        tone="good" if not any(outcome.kind == "wrong" for outcome in suite.outcomes) else "attention",
        provenance={"trihedron": version(), "seed": suite.seed, "mode": suite.options.mode},
    )
