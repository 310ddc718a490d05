"""A search that is cut off says so: earlier findings remain, and untried sets may do as well."""

from typing import Any

import numpy as np
import pytest

from diagnoses import flowing
from generator import SIGMA
from generator.positions import drawn_record
from generator.stands import random_bench, simulated
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis.procedure import diagnosed
from trihedron.tools.diagnosis.search import search
from trihedron.tools.evidence import bench_evidence

WARNING = "the search was cut off: single effects were not all tried"


def walking(seed: int, step: float = 1e-5):
    """Return evidence of a bench whose first accelerometer's bias walks: no effect of the catalogue."""
    rng = np.random.default_rng(seed)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, 24))
    noise = rng.uniform(-SIGMA, SIGMA, (24, 3))
    noise[:, 0] += np.cumsum(rng.normal(0.0, step, 24))
    return bench_evidence(simulated(random_bench(rng), alpha, beta, noise), noise_bound=SIGMA)


@pytest.mark.acceptance
def test_a_search_is_cut_off_by_the_work_that_it_does_and_says_among_which_sets():
    evidence = walking(1)
    searches = [search(evidence.model, most_work=limit) for limit in (8e5, 8e5, 1e3)]
    assert [(outcome.complete, outcome.size) for outcome in searches] == [(False, 3), (False, 3), (False, 1)]
    assert [fit.title for fit in searches[0].fits] == [fit.title for fit in searches[1].fits]
    result = diagnosed(evidence, most_work=1e3)
    assert (result.verdict, result.complete, result.cut_off_at) == ("unexplained", False, 1)
    assert result.to_json()["cut_off_at"] == 1
    assert "the search was cut off" in flowing(result).partition("Evidence:")[0].lower()
    assert WARNING in flowing(result).lower()
    (warning,) = result.warnings
    assert "since the work has a limit: " in warning
    assert "functions of one quantity" in warning
    assert "pairs of faults of the record" in warning


@pytest.mark.acceptance
def test_what_was_found_before_the_search_was_cut_off_stands():
    drift = EffectPlace("bias-drift", "accelerometer-2")
    evidence = bench_evidence(drawn_record(3, [(drift, (9e-4,))], 16), noise_bound=SIGMA)
    complete = {fit.title for fit in search(evidence.model).fits}
    limits = np.geomspace(3e4, 1e6, 8)
    limit, titles = next(
        (limit, {fit.title for fit in outcome.fits})
        for limit in limits
        if (outcome := search(evidence.model, most_work=limit)).fits and not outcome.complete
    )
    assert titles < complete
    result = diagnosed(evidence, most_work=limit)
    assert (result.verdict, result.complete, result.cut_off_at) == ("ambiguous", False, 1)
    assert WARNING in flowing(result).lower()


@pytest.mark.acceptance
def test_some_of_many_sets_are_no_answer_beside_one_function_as_simple():
    """Sets of unrelated effects fit a walk at one accelerometer, too, and the search finds some of them."""
    result: Any = diagnosed(walking(2, 1.3e-5), most_work=4e6)
    assert (result.verdict, result.complete, result.cut_off_at) == ("unexplained", False, 3)
    assert (result.causes, bool(result.not_named)) == ((), True)
    assert all(
        "would fit; so may sets that were not tried and, equally simple, a function" in s for s in result.not_named
    )
    assert str(result).startswith("The model without effects does not explain the record")
    assert "\nNot certain: " in str(result)
