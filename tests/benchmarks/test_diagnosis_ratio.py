"""The search for causes: sets of three over the whole catalogue, proven, against a linear programme for each set."""

import math
import time
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.sets import EffectSet, linear_radius, sets_of_size
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.trials.bench import NOISE_BOUND, draw_bench
from trihedron.tools.trials.case import Case
from trihedron.tools.trials.outcome import diagnosed
from trihedron.tools.trials.sizes import Hidden

pytestmark = pytest.mark.benchmark_ratio
EFFECTS = {
    EffectPlace("cubic", "accelerometer-1"): (6e-4,),
    EffectPlace("axis-wobble", "outer-axis", 2): (4e-4, 0.7),
    EffectPlace("bias-drift", "accelerometer-2"): (2e-3,),
}
LEAST_RATIO = 100.0


def three_effects(positions: int) -> Case:
    bench = draw_bench(np.random.default_rng(1), (positions, positions))
    return Case(1, 0, bench, tuple(Hidden(place, values) for place, values in EFFECTS.items()))


def test_proof_against_a_programme_for_each_set(capsys):
    case = three_effects(100)
    record = case.measured()
    result: Any = diagnosed(case, record)
    assert {cause.place for cause in result.causes} == set(EFFECTS)
    evidence = result.evidence
    places = evidence.classes.places
    problem = evidence.search.problem(evidence.search.centre, places)
    effects, readings = len(places), len(evidence.residual)
    count = math.comb(effects, 3) + math.comb(effects, 2) * readings + effects * math.comb(readings, 2)
    begun = time.perf_counter()
    found = list(sets_of_size(problem, 3, evidence.search.slack(evidence.search.centre)))
    searched = time.perf_counter() - begun
    some = list(combinations(range(effects), 3))[:: max(1, math.comb(effects, 3) // 20)]
    begun = time.perf_counter()
    for effects_of_one in some:
        linear_radius(problem, EffectSet(effects_of_one))
    one = (time.perf_counter() - begun) / len(some)
    with capsys.disabled():
        print(
            f"\n{count} sets of three on 100 positions: {searched:.2f} s with proof, {len(found)} left; "
            f"a programme for each: {one * count:.0f} s ({one * count / searched:.0f} times)"
        )
    assert one * count > LEAST_RATIO * searched


@pytest.mark.parametrize("positions", [100, 1000])
def test_a_whole_diagnosis(positions, capsys):
    """Falsified, searched to sets of three, judged on what was left out; not simulated again."""
    case = three_effects(positions)
    record = case.measured()
    begun = time.process_time()
    result = diagnose(
        record,
        noise_bound=NOISE_BOUND,
        baseline=case.instrument.baseline,
        mounting=case.instrument.matrices,
        rerun=False,
    )
    taken = time.process_time() - begun
    with capsys.disabled():
        print(f"\n{positions} positions, three effects: {result.verdict} after {taken:.1f} s of processor")
    assert {cause.place for cause in result.causes} == set(EFFECTS)
