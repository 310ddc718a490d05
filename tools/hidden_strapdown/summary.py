"""What a suite of strapdown records shows: the table of confusion, false alarms, errors of the sizes."""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_text
from ..hidden_suite.summary import MOST_LISTED, NOTHING, confusion, kinds
from .outcomes import StrapdownOutcome
from .suite import StrapdownSuite

SCHEMA = "trihedron.hidden-strapdown-suite/1"


def suite_json(suite: StrapdownSuite) -> dict[str, Any]:
    """The object of schema trihedron.hidden-strapdown-suite/1."""
    outcomes, options = suite.outcomes, suite.options
    clean = [outcome for outcome in outcomes if not outcome.case.places]
    errors = np.array([outcome.error for outcome in outcomes if outcome.error is not None])
    inside = [outcome.inside for outcome in outcomes if outcome.inside is not None]
    return {
        "schema": SCHEMA,
        "clean": options.clean,
        "effects": list(options.effects),
        "size": None if options.clean else list(options.sizes),
        "seed": suite.seed,
        "cases": len(outcomes),
        "outcomes": kinds(outcomes),
        "false_alarms": {"clean": len(clean), "alarms": sum(outcome.kind != "right" for outcome in clean)},
        "confusion": {name: dict(sorted(row.items())) for name, row in confusion(outcomes).items()},
        "by_reference": {
            reference: kinds(own)
            for reference in ("gravity", "truth")
            if (own := [outcome for outcome in outcomes if outcome.case.reference == reference])
        },
        "size_errors": {
            "estimates": len(errors),
            "rms": float(np.sqrt(np.mean(errors**2))) if len(errors) else None,
            "largest": float(np.abs(errors).max()) if len(errors) else None,
            "cases_with_intervals": len(inside),
            "inside_intervals": sum(inside),
        },
        "results": [outcome.to_json() for outcome in outcomes],
    }


def suite_text(suite: StrapdownSuite) -> str:
    """What a person is told."""
    said = suite_json(suite)
    lines = [
        f"{len(suite.outcomes)} strapdown records, seed {suite.seed}: "
        + ", ".join(f"{kind} {number}" for kind, number in said["outcomes"].items())
    ]
    alarms = said["false_alarms"]
    if alarms["clean"]:
        lines.append(f"false alarms on clean records: {alarms['alarms']} of {alarms['clean']}")
    if alarms["clean"] < len(suite.outcomes):
        lines += ["", f"{'hidden':<28} {'cases':>5}  what was made of it"]
        for name, row in confusion(suite.outcomes).items():
            made = ", ".join(f"{'right' if k == name else k} {n}" for k, n in row.most_common())
            lines.append(f"{name:<28} {sum(row.values()):>5}  {made}")
    errors = said["size_errors"]
    if errors["estimates"]:
        lines += [
            "",
            f"estimated sizes: rms error {errors['rms']:.2%}, largest {errors['largest']:.2%}; inside their intervals "
            f"{errors['inside_intervals']} of {errors['cases_with_intervals']}",
        ]
    others = [outcome for outcome in suite.outcomes if outcome.kind not in ("right", "candidate")]
    lines += [""] if others else []
    lines += [f"case {outcome.case.index}: {in_words(outcome)}" for outcome in others[:MOST_LISTED]]
    return "\n".join(lines)


def in_words(outcome: StrapdownOutcome) -> str:
    """A case in a line: what was hidden, the verdict, what was named."""
    hidden = " and ".join(place.title for place in outcome.case.places) or NOTHING
    named = " and ".join(place.title for place in outcome.named)
    return f"hidden {hidden} ({outcome.case.reference}); {outcome.verdict}" + (f": {named}" if named else "")


def cases_csv(suite: StrapdownSuite) -> str:
    """One row for each case."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        (
            "case",
            "reference",
            "rows",
            "hidden",
            "size_over_detection",
            "radius",
            "verdict",
            "outcome",
            "named",
            "inside",
        )
    )
    for outcome in suite.outcomes:
        case = outcome.case
        writer.writerow(
            (
                case.index,
                case.reference,
                len(case.motion) - 1,
                " + ".join(place.title for place in case.places),
                f"{case.size:.4g}" if case.places else "",
                "" if outcome.radius is None else f"{outcome.radius:.6g}",
                outcome.verdict,
                outcome.kind,
                " + ".join(place.title for place in outcome.named),
                "" if outcome.inside is None else int(outcome.inside),
            )
        )
    return stream.getvalue()


def write_suite(suite: StrapdownSuite, folder: Path) -> list[Path]:
    """Write suite.json, cases.csv and the page index.html into a folder; returns the files."""
    files = [folder / "suite.json", folder / "cases.csv", folder / "index.html"]
    write_text(files[0], json.dumps(suite_json(suite), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(files[1], cases_csv(suite))
    write_text(files[2], suite_page(suite))
    return files


def suite_page(suite: StrapdownSuite) -> str:
    """The page: what was hidden, the table of confusion, every case that was not named rightly."""
    from ...fmus import version
    from ..report.page import Section, Table, render_page
    from ..report.suite_pictures import confusion_picture

    counts = kinds(suite.outcomes)
    told = ", ".join(f"{number} {kind}" for kind, number in counts.items())
    hidden = any(outcome.case.places for outcome in suite.outcomes)
    least, greatest = suite.options.sizes
    sections = [
        Section(
            "What was made of the records",
            [
                "A block is moved by hand from rest to rest; gyro and accelerometer block read, with white and flicker "
                "noise. Every second record has the true attitude, the others have gravity at their rests alone. The "
                "diagnosis gets the record and nothing else.",
                f"Effects are {least:g} to {greatest:g} times the size from which a record surely disproves the model."
                if hidden
                else "Nothing is hidden.",
            ],
            confusion_picture(confusion(suite.outcomes)) if hidden else None,
            "Rows: what was hidden. Columns: what was made of it. Blue is right, grey left open with the truth among "
            "the candidates.",
        )
    ]
    rows = rows_of([outcome for outcome in suite.outcomes if outcome.kind != "right"])
    if rows:
        header = ["case", "reference", "hidden", "verdict", "outcome", "named", "what it says"]
        sections.append(Section("Cases that were not named rightly", table=Table(header, rows)))
    return render_page(
        "Hidden effects in strapdown records",
        f"Of {len(suite.outcomes)} records {told}.",
        sections,
        tone="good" if "wrong" not in counts else "attention",
        provenance={"trihedron": version(), "seed": suite.seed},
    )


def rows_of(outcomes: Sequence[StrapdownOutcome]) -> list[list[Any]]:
    """Rows of the table of cases."""
    return [
        [
            outcome.case.index,
            outcome.case.reference,
            " + ".join(place.title for place in outcome.case.places) or NOTHING,
            outcome.verdict,
            outcome.kind,
            " + ".join(place.title for place in outcome.named),
            outcome.why,
        ]
        for outcome in outcomes
    ]
