"""The suites of hidden effects, whole: `scenarios/hidden/suites.toml` says what is drawn."""

import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from trihedron.tools.calibration.model import PRESETS
from trihedron.tools.trials import (
    NOISE_BOUND,
    Case,
    Outcome,
    diagnosed_case,
    draw_case,
    judged_case,
    named_suite,
    run_suite,
)
from trihedron.tools.trials.bench import STAND_BOUND
from trihedron.tools.trials.suite import detection
from unknown_effects import LEAST_RADIUS, draw_unknown

pytestmark = pytest.mark.acceptance
SHARE = float(os.environ.get("TRIHEDRON_SUITE_SHARE", "1"))
"""A part of each suite is run where somebody only wants to look; limits are parts of what is run."""


def run(name: str, capsys: pytest.CaptureFixture[str]) -> tuple[Sequence[Outcome], Counter[str]]:
    suite = named_suite(name)
    process: Any = run_suite(suite.options, max(1, round(SHARE * suite.cases)), suite.seed)
    say(capsys, str(process))
    return process.results, Counter(process.outcomes)


def say(capsys: pytest.CaptureFixture[str], text: str) -> None:
    with capsys.disabled():
        print(f"\n{text}", file=sys.stderr, flush=True)


def assert_inside(outcomes: Sequence[Outcome]) -> None:
    """The size of the effect is inside its interval in every case that was named rightly."""
    assert [outcome.case for outcome in outcomes if outcome.inside is False] == []


def test_no_effect_is_named_on_clean_records(capsys):
    outcomes, counts = run("clean", capsys)
    assert counts == {"right": len(outcomes)}


def test_single_effects_at_half_again_the_second_size(capsys):
    outcomes, counts = run("single", capsys)
    assert counts["right"] >= 0.97 * len(outcomes)
    assert counts["wrong"] + counts["part"] < 0.005 * len(outcomes)
    assert_inside(outcomes)


def test_between_the_two_sizes(capsys):
    outcomes, counts = run("between", capsys)
    assert counts["wrong"] < 0.01 * len(outcomes)
    assert counts["consistent"] == 0
    assert counts["right"] + counts["candidate"] >= 0.97 * len(outcomes)
    assert_inside(outcomes)


def test_pairs_of_effects(capsys):
    outcomes, counts = run("pairs", capsys)
    assert counts["right"] >= 0.9 * len(outcomes)
    assert counts["wrong"] < 0.02 * len(outcomes)
    assert_inside(outcomes)


def test_from_the_size_of_sure_detection_every_effect_is_detected(capsys):
    outcomes, _ = run("detection", capsys)
    assert all(part.detected == part.cases for part in detection(outcomes) if part.low >= 1.0)
    errors = np.array([error for outcome in outcomes for error in outcome.errors])
    assert abs(errors.mean()) < 3.0 * errors.std() / np.sqrt(len(errors)) + 0.02


def test_effects_that_the_catalogue_lacks_get_no_name(capsys):
    """Where its best set of three leaves a radius of 1.5 or more."""
    counts: Counter[str] = Counter()
    for index in range(max(10, round(SHARE * 100))):
        unknown = draw_unknown(500, index, (24, 48))
        assert unknown.nearest >= LEAST_RADIUS
        counts[diagnosed_case(unknown.case, unknown.record).verdict] += 1
    say(capsys, f"unknown effects: {dict(counts)}")
    assert counts["explained"] + counts["ambiguous"] == 0
    assert counts["unexplained"] >= 0.95 * counts.total()


def measured_too(case: Case, positions: Sequence[Any]) -> Case:
    """The case with more positions at the end of its programme."""
    bench = case.instrument
    alpha, beta = (np.radians([float(p[name]) for p in positions]) for name in ("alpha_deg", "beta_deg"))
    names, errors = list(bench.mountings), list(bench.mounting_errors)
    mounting = []
    for position in positions:
        name = position.get("mounting", names[0])
        if name not in names:
            rng = np.random.default_rng([case.seed, case.index or 0, len(names)])
            names.append(name)
            errors.append(tuple(rng.uniform(-STAND_BOUND, STAND_BOUND, 3).tolist()))
            assert name in PRESETS
        mounting.append(names.index(name))
    further = replace(
        bench,
        mountings=tuple(names),
        mounting_errors=tuple(errors),
        alpha=np.append(bench.alpha, alpha),
        beta=np.append(bench.beta, beta),
        mounting=np.append(bench.mounting, np.array(mounting, dtype=int)),
    )
    return replace(case, instrument=further)


def test_measuring_the_proposed_positions_too_leaves_the_right_one(capsys):
    suite = named_suite("between")
    counts: Counter[str] = Counter()
    options = max(3, round(SHARE * 40))
    for index in range(1000):
        if counts.total() == options:
            break
        case = draw_case(suite.options, suite.seed + 1, index)
        first: Any = diagnosed_case(case, case.measured())
        if judged_case(case, first).outcome != "candidate" or not first.next_positions:
            continue
        longer = measured_too(case, first.next_positions)
        counts[judged_case(longer, diagnosed_case(longer, longer.measured())).outcome] += 1
    say(capsys, f"ambiguous, then measured where it was proposed: {dict(counts)}")
    assert counts["right"] + counts["candidate"] >= 0.95 * options


def test_held_out_errors_fall_to_the_noise(capsys):
    """Of effects that were named: root mean square of the errors at positions that were left out of the fit."""
    suite = named_suite("single")
    ratios, worse = [], 0
    for index in range(max(3, round(SHARE * 40))):
        case = draw_case(suite.options, suite.seed + 2, index)
        result: Any = diagnosed_case(case, case.measured(), rerun=True)
        if result.gain is None:
            continue
        gain = result.gain.to_json()
        ratios.append(gain["held_out_rms_after"] / NOISE_BOUND)
        worse += gain["held_out_rms_after"] > gain["held_out_rms_before"]
    say(capsys, f"held-out rms after, in σ: {np.round(np.sort(ratios), 2).tolist()}")
    # A reading errs by σ at most, and its prediction has the rms of a reading's error at most.
    assert max(ratios) <= np.sqrt(2.0)
    assert worse == 0
