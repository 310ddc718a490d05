"""The search refuses no set of effects that was hidden."""

import pytest

from trihedron.tools.bounded import Work
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.trials import Options, draw_case

PAIRS = Options("pairs", positions=(24, 30), noise="all")
# The input of a reading of the first case hardly changes, so that the pair decides the sense of its change.
CASES = [(414, 0), *(pytest.param(415, index, marks=pytest.mark.acceptance) for index in range(40))]
DRIFTS = {"base-drift", "mounting-drift"}
"""Effects by which an input goes on changing at rest: they turn the sense on which hysteresis depends."""


@pytest.mark.acceptance
@pytest.mark.parametrize(("seed", "index"), CASES)
def test_a_true_pair_is_among_the_candidates(seed, index):
    case = draw_case(PAIRS, seed, index)
    names = {hidden.place.effect for hidden in case.hidden}
    if "hysteresis" in names and names & DRIFTS:
        pytest.skip("a drift turns the sense of the inputs at rest, which no record of positions shows")
    model = bench_evidence(case.measured(), **case.instrument.asked).model
    truth = frozenset(hidden.place for hidden in case.hidden)
    candidates = {frozenset(places) for places in model.search.candidates(len(truth), Work())}
    whole = frozenset(model.classes.whole_class(place)[0] for place in truth)
    assert truth in candidates or whole in candidates
