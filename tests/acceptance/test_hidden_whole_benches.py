"""Whole benches with a secret: the suite that the documentation speaks of, twenty of each mode.

What is asked for is 97 % right and 0.5 % wrong of two hundred.
"""

import pytest

from trihedron.tools.trials import Options, run_suite

pytestmark = pytest.mark.acceptance
CASES = 20


@pytest.mark.parametrize("mode", ["single", "clean"])
def test_secrets_of_whole_benches_are_named(mode):
    suite = run_suite(Options(mode, whole=True), CASES, 2)
    assert not [one.case for one in suite.results if one.outcome == "wrong"], suite.confusion
    assert sum(one.outcome == "right" for one in suite.results) >= 0.97 * CASES, suite.confusion
