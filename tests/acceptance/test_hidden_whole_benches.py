"""Whole benches with a secret: the suite that the documentation speaks of, twenty of each mode."""

import pytest

from trihedron.tools.trials import Options, run_suite

pytestmark = pytest.mark.acceptance
CASES = 20


@pytest.mark.parametrize("mode", ["single", "clean"])
def test_secrets_of_whole_benches_are_named(mode):
    suite = run_suite(Options(mode, whole=True), CASES, 2)
    assert suite.outcomes.get("wrong", 0) == 0, suite.confusion
    assert suite.outcomes["right"] >= 0.97 * CASES - 1, suite.confusion
