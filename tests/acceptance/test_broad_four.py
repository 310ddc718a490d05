"""The matrix of docs/case-study-broad-four.md: effects found in one BROAD record, applied to another by the FMUs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from record_files import measured
from trihedron.tools.diagnosis.helps import order_of_effects
from trihedron.tools.evidence import ARCMIN, blocks_of, carried_evidence, rms_size

pytestmark = pytest.mark.acceptance
PAGE = Path(__file__).resolve().parents[2] / "docs" / "case-study-broad-four.md"


def test_figures_of_the_page_are_those_of_the_records():
    """Compare two of four records, both ways: without effects, with their own, with the other's."""
    catalogue = {n: carried_evidence(measured(f"broad-{n}")) for n in ("06", "21")}
    sizes = {}
    for label, evidence in catalogue.items():
        order = order_of_effects(evidence.rows.select(len(evidence.rows.scored) // 2), evidence.model.classes.places)
        places = [step.place for step in order.steps]
        result = evidence.rows.estimate(places)[len(evidence.rows.names) :]
        sizes[label] = {place: result[block] for place, block in zip(places, blocks_of(places), strict=True)}
    table = re.findall(r"^\| (\d\d) \| ([\d.| ]+) \|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[:4]
    page = {
        on: dict(zip(("without", "03", "06", "08", "21"), map(float, row.split(" | ")), strict=True))
        for on, row in table
    }
    for on, evidence in catalogue.items():
        rerun: Any = evidence.reader.rerun
        assert rms_size(np.array(rerun.errors({}))) / ARCMIN == pytest.approx(page[on]["without"], rel=5e-3)
        for source, result in sizes.items():
            assert rms_size(np.array(rerun.errors(result))) / ARCMIN == pytest.approx(page[on][source], rel=5e-3)
