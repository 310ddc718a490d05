"""Wrong rows and breaks as secrets: drawn, added to a record, and compared with the diagnosis."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Explanation
from trihedron.tools.trials import (
    Hidden,
    Options,
    Suite,
    diagnosed_case,
    draw_case,
    faultless_record,
    judged_case,
    named_suite,
    run_suite,
)
from trihedron.tools.trials.faults import BREAKS, SPOILED, Fault

OPTIONS = Options("faults", positions=(24, 30))


def judged(case: Any, verdict: str, *explanations: Explanation) -> str:
    """Return the outcome of a case whose diagnosis has these explanations."""

    class Said:
        """A diagnosis."""

        findings = equal_sets = containing_sets = ()
        causes = explanations[0].causes if verdict == "explained" else ()
        radius = 3.0
        sources = type("Reader", (), {"circumstances": type("At", (), {"began": 0.0, "temperature": None})})

    message: Any = Said()
    message.verdict, message.explanations = verdict, explanations
    return judged_case(case, message).outcome


def rows(*numbers: int) -> Explanation:
    """Return the explanation that these rows are wrong."""
    return Explanation(kind="rows", numbers=4, where=(), causes=(), radius=0.9, sentence="rows", rows=numbers)


def broken(between: tuple[int, int], *names: str) -> Explanation:
    """Return a break between two rows at which these numbers change."""
    change = dict.fromkeys(names, 1e-4)
    keys = {"kind": "break", "numbers": 2, "where": (), "causes": (), "radius": 0.9, "sentence": "a break"}
    return Explanation(**keys, change=change, between_rows=between)


@pytest.fixture(scope="module")
def case():
    return draw_case(Options("clean", positions=(24, 30), noise="uniform"), 5, 0)


def test_the_right_row_is_right_and_another_one_wrong(case):
    hidden = replace(case, fault=Fault(kind="rows", what="a copied row", row=7, numbers=(2.0,)))
    assert judged(hidden, "explained", rows(7)) == "right"
    assert judged(hidden, "explained", rows(8)) == "wrong"
    assert judged(hidden, "explained", rows(7, 8)) == "wrong"
    assert judged(hidden, "explained", broken((6, 7), "alpha_zero_rad")) == "wrong"
    assert judged(hidden, "ambiguous", broken((6, 7), "alpha_zero_rad"), rows(7)) == "candidate"
    assert judged(hidden, "unexplained", rows(7)) == "unexplained"
    outlier = replace(case, hidden=(Hidden(EffectPlace("outlier", "position-7", axes=(2,)), (1e-3,)),))
    assert judged(outlier, "explained", rows(7)) == "right"
    assert judged(outlier, "explained", rows(6)) == "wrong"


def test_a_break_is_right_with_its_gap_and_all_that_changes(case):
    hidden = replace(
        case, fault=Fault(kind="break", what="biases", row=12, change=dict.fromkeys(BREAKS["biases"], 1e-4))
    )
    assert judged(hidden, "explained", broken((11, 12), *BREAKS["biases"])) == "right"
    assert judged(hidden, "explained", broken((10, 13), *BREAKS["biases"])) == "right"
    assert judged(hidden, "explained", broken((12, 13), *BREAKS["biases"])) == "wrong"
    assert judged(hidden, "explained", broken((11, 12), "bias_1_g")) == "wrong"
    assert judged(hidden, "explained", rows(12)) == "wrong"


def test_a_fault_alone_is_a_part_of_a_fault_and_an_effect(case):
    place = EffectPlace("quadratic", "accelerometer-2")
    fault = Fault(kind="rows", what="a copied row", row=7, numbers=(2.0,))
    both = replace(case, fault=fault, hidden=(Hidden(place, (3e-4,)),))
    assert judged(both, "explained", rows(7)) == "part"
    assert judged(both, "explained", rows(9)) == "wrong"


def test_a_step_of_the_catalogue_beside_a_wrong_row_is_right_as_a_break(case):
    fault = Fault(kind="rows", what="a copied row", row=7, numbers=(2.0,))
    step = Hidden(EffectPlace("scale-step", "accelerometer-2"), (1e-4, 0.05))
    both = replace(case, fault=fault, hidden=(step,))
    named = broken((11, 12), "scale_factor_2").model_copy(update={"rows": (7,)})
    assert judged(both, "explained", named) == "right"
    assert judged(both, "explained", named.model_copy(update={"rows": (8,)})) == "wrong"
    assert judged(both, "explained", broken((11, 12), "scale_factor_1").model_copy(update={"rows": (7,)})) == "wrong"


def test_a_clean_record_with_a_larger_bound_is_a_false_alarm(case):
    sigma = Explanation(kind="sigma", numbers=1, where=(), causes=(), radius=0.9, sentence="a larger σ")
    assert judged(case, "explained", sigma) == "wrong"


@pytest.mark.parametrize("what", SPOILED)
def test_a_spoiled_row_changes_only_itself(what):
    record = faultless_record(draw_case(OPTIONS, 3, 0).instrument)
    numbers = {"an angle": (1.0, 3.0), "the sign of an angle": (0.0,), "two readings exchanged": (0.0, 2.0),
               "a copied row": (9.0,), "a disturbed rest": (1e-3, 0.0, 0.0)}.get(what, ())  # fmt: skip
    spoiled = SPOILED[what](record, 5, numbers)
    changed = np.zeros(len(record), dtype=bool)
    for name in ("alpha", "beta", "specific_force"):
        apart = np.abs(getattr(spoiled, name) - getattr(record, name)).reshape(len(record), -1)
        changed |= apart.max(axis=1) > 0.0
    assert changed.nonzero()[0].tolist() == [5]


def test_a_break_of_biases_moves_the_readings_after_it_by_its_sizes():
    case = draw_case(OPTIONS, 3, 0)
    record = faultless_record(case.instrument)
    change = {"bias_1_g": 1e-4, "bias_2_g": -2e-4, "bias_3_g": 3e-4}
    moved = Fault(kind="break", what="biases", row=9, change=change).done_to(record, case.instrument)
    after = np.arange(len(record)) >= 8
    expected = STANDARD_GRAVITY * after[:, None] * np.array(list(change.values()))
    assert moved.specific_force - record.specific_force == pytest.approx(expected, abs=1e-8)


@pytest.mark.acceptance
def test_a_suite_counts_the_right_fault_as_right():
    suite = run_suite(replace(OPTIONS, noise="uniform"), 2, 1)
    assert suite.outcomes == {"right": 2}, suite.confusion
    assert suite.false_alarms["clean"] == 0
    assert all(outcome.fault is not None and outcome.named_fault for outcome in suite.results)
    assert Suite.model_validate_json(suite.json_text()) == suite


@pytest.mark.acceptance
def test_a_break_is_no_coarse_encoder_where_the_programme_has_round_angles():
    """All angles are multiples of 0.1°, as commanded; the errors are far smaller than half a step."""
    suite = named_suite("faults")
    case = draw_case(suite.options, suite.seed, 10)
    assert case.fault is not None
    assert case.fault.what == "biases and mounting"
    diagnosis = diagnosed_case(case, case.measured())
    assert not any("in steps of" in line for line in diagnosis.warnings)
    assert judged_case(case, diagnosis).outcome in ("right", "candidate")


def test_a_hidden_break_and_a_step_of_the_catalogue_are_named_as_two_breaks(case):
    fault = Fault(kind="break", what="scale factors", row=12, change=dict.fromkeys(BREAKS["scale factors"], 1e-4))
    hidden = Hidden(EffectPlace("bias-step", "accelerometer-2"), (1e-4, 0.02))
    both = replace(case, fault=fault, hidden=(hidden,))
    later = [f"{name}_from_row_12" for name in BREAKS["scale factors"]]
    assert judged(both, "explained", broken((4, 5), "bias_2_g", *later)) == "right"
    assert judged(both, "explained", broken((4, 5), "bias_1_g", *later)) == "wrong"
    elsewhere = [f"{name}_from_row_20" for name in BREAKS["scale factors"]]
    assert judged(both, "explained", broken((4, 5), "bias_2_g", *elsewhere)) == "wrong"


def test_a_part_of_a_hidden_step_is_a_part_of_the_secret(case):
    fault = Fault(kind="rows", what="a copied row", row=5, numbers=(7.0,))
    hidden = Hidden(EffectPlace("mounting-slip", "mounting"), (1e-6, 1e-4, 1e-6, 0.02))
    both = replace(case, fault=fault, hidden=(hidden,))
    of_row = {"rows": (5,), "where": ("mounting", "row-5")}
    one = broken((9, 10), "mounting_2_rad").model_copy(update=of_row)
    assert judged(both, "explained", one) == "part"
    other = broken((9, 10), "bias_2_g").model_copy(update=of_row)
    assert judged(both, "explained", other) == "wrong"


LONG = pytest.mark.acceptance


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("seed", "index", "outcome"),
    [
        # A row that errs by several steps of round angles, or by one; a dead zone in which two readings lie.
        (5001, 8, "right"),
        pytest.param(6001, 8, "right", marks=LONG),
        pytest.param(6001, 6, "right", marks=LONG),
        # Breaks and a row beside effects that are not linear.
        pytest.param(5001, 37, "right", marks=LONG),
        pytest.param(6001, 11, "right", marks=LONG),
        pytest.param(6001, 26, "right", marks=LONG),
        pytest.param(6001, 33, "right", marks=LONG),
        # Of three scale factors that change one by far more than the noise shows.
        pytest.param(409, 15, "part", marks=LONG),
    ],
)
def test_no_other_cause_is_named_beside_a_fault(seed, index, outcome):
    case = draw_case(Options("beside", positions=(24, 100)), seed, index)
    assert judged_case(case, diagnosed_case(case, case.measured())).outcome == outcome
