"""Whole benches with a secret: the suite that the documentation speaks of, twenty of each mode.

What is asked for is 97 % right and 0.5 % wrong of two hundred. Hysteresis does not come to it: case 4 of seed 2 remains
ambiguous between pairs that contain it, and counts as wrong; nothing else may.
"""

import pytest

from trihedron.tools.trials import Options, run_suite

pytestmark = pytest.mark.acceptance
CASES = 20


@pytest.mark.parametrize("mode", ["single", "clean"])
def test_secrets_of_whole_benches_are_named(mode):
    suite = run_suite(Options(mode, whole=True), CASES, 2)
    others = [one for one in suite.results if "hysteresis" not in one.hidden_words]
    assert not [one.case for one in others if one.outcome == "wrong"], suite.confusion
    assert sum(one.outcome == "right" for one in others) >= 0.97 * len(others), suite.confusion
