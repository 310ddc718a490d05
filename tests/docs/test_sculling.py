"""The figures of the drift under sculling are true."""

from pathlib import Path

import pytest

from costs import between_marks
from sculling import PAGE, drift_table, measured, nearest_phase, theory
from trihedron.models.attitude_algorithms import ALGORITHMS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_component_drifts_as_theory_says() -> None:
    """Compare in doubles where they can show 1e-3 of it."""
    for algorithm in ALGORITHMS:
        phase = nearest_phase(algorithm, 0.8)
        assert measured(algorithm, phase) == pytest.approx(theory(algorithm, phase), rel=1e-3)


@pytest.mark.acceptance
def test_table_of_drifts_in_the_page_is_what_comes_out() -> None:
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    assert between_marks(page, "drifts", drift_table()) == page
