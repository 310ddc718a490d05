"""The gallery of the site: a page for each verdict, from the records in docs/gallery."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import trihedron as th
from trihedron.tools.document.blocks import Page

SIGMA = 1e-5
RECORDS = Path(__file__).resolve().parents[1] / "gallery"
CALIBRATIONS = {"insufficient": "insufficient", "explained": "falsified", "consistent": "consistent"}
"""Record -> verdict of its calibration."""
DIAGNOSES = ("consistent", "explained", "ambiguous", "unexplained", "insufficient")
"""Records, named by the verdict of their diagnosis."""


def pages(*, quick: bool = False) -> Iterator[tuple[str, str]]:
    """Yield name and content of every page; `quick`: only the first."""
    from trihedron.tools.document.page import html

    for record, verdict in list(CALIBRATIONS.items())[: 1 if quick else None]:
        result = th.calibrate(RECORDS / f"{record}.csv", noise_bound=SIGMA)
        yield _named("calibrate", verdict), html(_page(result, verdict))
    for verdict in () if quick else DIAGNOSES:
        found = th.diagnose(RECORDS / f"{verdict}.csv", noise_bound=SIGMA)
        yield _named("diagnose", verdict), html(_page(found, verdict))


def _named(command: str, verdict: str) -> str:
    return f"gallery/{command}-{verdict}.html"


def _page(result: Any, verdict: str) -> Page:
    """Return the page of a result.

    Raises ValueError if its verdict is not that of its record.
    """
    from trihedron.tools.reports import page_of

    if result.verdict != verdict:
        raise ValueError(f"the gallery's record of the verdict {verdict} is {result.verdict}")
    page = page_of(result)
    assert page is not None
    return page


SAID = {
    "calibrate consistent": "The model explains every reading; 18 numbers with guaranteed errors.",
    "calibrate falsified": "No parameters explain the readings; a few of these prove it. Nothing is guaranteed.",
    "calibrate insufficient": "The readings leave numbers open; where to measure next.",
    "diagnose consistent": "The simulation can be true of the record, and nothing is named without need.",
    "diagnose explained": "One smallest set of effects makes the model consistent: cause, size, evidence, gain.",
    "diagnose ambiguous": "Several sets would; what to measure to tell them apart.",
    "diagnose unexplained": "Nothing in the catalogue mends it: the place and quantity that are proven, and the band.",
    "diagnose insufficient": "Too little to falsify anything; what to add.",
}
"""Command and verdict -> description of its page."""


def gallery_page() -> str:
    """Return the list of the pages, in Markdown."""
    lines = [
        "# Gallery",
        "",
        "Each verdict with its page, as `--report` writes it. The records are simulated, with seven decimals, in "
        "`docs/gallery` of the checkout; the pages are made from them when the site is built.",
        "",
        "| Verdict | What its page shows | Made by |",
        "|---|---|---|",
    ]
    by_verdict = {verdict: record for record, verdict in CALIBRATIONS.items()}
    for name, sentence in SAID.items():
        command, verdict = name.split()
        record = by_verdict[verdict] if command == "calibrate" else verdict
        maker = f"`trihedron {command} {record}.csv --noise-bound 1e-5 --report page.html`"
        maker += f" of [{record}.csv](gallery/{record}.csv)"
        lines.append(f'| <a href="{_named(command, verdict)}">{command}: **{verdict}**</a> | {sentence} | {maker} |')
    return "\n".join([*lines, ""])
