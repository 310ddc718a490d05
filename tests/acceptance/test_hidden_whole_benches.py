"""Whole benches with a secret: the suite that the documentation speaks of, twenty of each mode, and slips of the block.

What is asked for is 97 % right and 0.5 % wrong of two hundred.
"""

import pytest

from trihedron.tools.trials import Options, run_suite

pytestmark = pytest.mark.acceptance
CASES = 20
SLIPS = ("single", ("mounting-slip",), 6)
"""By readings and turns, at any time but near the ends."""


@pytest.mark.parametrize(("mode", "effects", "cases"), [("single", (), CASES), ("clean", (), CASES), SLIPS])
def test_secrets_of_whole_benches_are_named(mode, effects, cases):
    suite = run_suite(Options(mode, effects, whole=True), cases, 2)
    assert not [entry.case for entry in suite.results if entry.outcome == "wrong"], suite.confusion
    assert sum(entry.outcome == "right" for entry in suite.results) >= 0.97 * cases, suite.confusion
