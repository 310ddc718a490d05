"""False alarms with an estimated σ: 200 clean records a cell."""

import pytest

from gaussian_records import false_alarms

pytestmark = pytest.mark.acceptance
SEEDS = range(1000, 1200)
CHANCE = 6
"""Limit for 200 records with a chance of 1 % each: more are falsified once in 200 times."""


@pytest.mark.parametrize("repeated", [0, 3])
@pytest.mark.parametrize("count", [12, 24, 48, 100, 300, 1000])
def test_gaussian_errors_falsify_one_record_of_a_hundred(count, repeated):
    assert false_alarms(SEEDS, count, "Gaussian", repeated) <= CHANCE


@pytest.mark.parametrize("repeated", [0, 3])
@pytest.mark.parametrize("count", [12, 24, 48, 100, 300, 1000])
def test_uniform_errors_falsify_none(count, repeated):
    assert false_alarms(SEEDS, count, "uniform", repeated) <= CHANCE


# shares that five degrees of freedom cannot reach, for a known standard deviation and for six repeats
HEAVY_TAILS = {12: (0.08, 0.05), 24: (0.16, 0.06), 48: (0.26, 0.16), 100: (0.50, 0.28)}


@pytest.mark.parametrize("count", HEAVY_TAILS)
def test_heavy_tails_falsify_no_more_than_the_docs_say(count):
    known, repeats = HEAVY_TAILS[count]
    assert false_alarms(SEEDS, count, "t(5)") <= known * len(SEEDS)
    assert false_alarms(SEEDS, count, "t(5)", min(6, count // 3)) <= repeats * len(SEEDS)
