"""Two breaks, a break and an effect, a break and a wrong row: both are named if one alone is not enough."""

from dataclasses import replace

import pytest

from diagnoses import diagnosed
from generator.broken import two_things
from trihedron.models.effects import EffectPlace

QUADRATIC = EffectPlace("quadratic", "accelerometer-1")
PRODUCT = EffectPlace("cross-product", "accelerometer-3", axes=(1, 2))
STEPS = EffectPlace("quantisation", "accelerometer-2")
HYSTERESIS = EffectPlace("hysteresis", "accelerometer-1")
WARM_UP = EffectPlace("warm-up", "accelerometer-2")
LONG = pytest.mark.acceptance


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("seed", "groups", "count"),
    [
        (1, ("outer zero", "biases"), 48),
        (2, ("bias", "bias"), 36),
        pytest.param(6, ("common scale", "bias"), 48, marks=LONG),
        pytest.param(3, ("scale factors", "inner zero"), 100, marks=LONG),
        pytest.param(4, ("mounting angle", "outer zero"), 48, marks=LONG),
        pytest.param(5, ("mounting", "bias"), 60, marks=LONG),
    ],
)
def test_two_breaks_are_named(seed, groups, count):
    two = two_things(seed, groups, count)
    result = diagnosed(two.record)
    first = result.explanations[0]
    assert (result.verdict, first.kind, first.before_row) == ("explained", "break", two.before_row)
    assert f"rows {two.before_row - 1} and {two.before_row} " in first.sentence
    assert f"rows {two.further_row - 1} and {two.further_row} " in first.sentence
    assert any(key.endswith(f"_from_row_{two.further_row}") for key in first.change)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("seed", "group", "place", "sizes"),
    [
        (1, "outer zero", QUADRATIC, (1.5e-4,)),
        pytest.param(2, "biases", PRODUCT, (-2e-4,), marks=LONG),
        pytest.param(3, "inner zero", PRODUCT, (2e-4,), marks=LONG),
        (4, "outer zero", STEPS, (4e-4,)),
        pytest.param(5, "biases", STEPS, (4e-4,), marks=LONG),
        pytest.param(6, "biases", HYSTERESIS, (2e-4,), marks=LONG),
        pytest.param(7, "biases and mounting", QUADRATIC, (4e-4,), marks=LONG),
        # Both set in: a size and a time constant [h].
        (21, "outer zero", WARM_UP, (6e-4, 0.3)),
        pytest.param(22, "biases", WARM_UP, (6e-4, 0.5), marks=LONG),
        pytest.param(25, "bias", WARM_UP, (8e-4, 0.4), marks=LONG),
        pytest.param(27, "mounting", WARM_UP, (8e-4, 0.4), marks=LONG),
    ],
)
def test_a_break_and_an_effect_are_named(seed, group, place, sizes):
    two = two_things(seed, (group,), 48, ((place, sizes),))
    # The drawn senses of approach are not those in which the inputs change.
    record = replace(two.record, approach_alpha=None, approach_beta=None) if place == HYSTERESIS else two.record
    result = diagnosed(record)
    assert result.verdict == "explained", str(result)
    first, (cause,) = result.explanations[0], result.causes
    assert (first.kind, first.before_row, cause.place) == ("break", two.before_row, place)
    for size, (low, high) in zip(sizes, cause.intervals, strict=True):
        assert low <= size <= high


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("seed", "group", "count"),
    [
        (1, "biases", 36),
        # Breaks that the catalogue has as effects, too: each is named once.
        (3, "bias", 24),
        (12, "scale factor", 36),
        (13, "mounting", 30),
        pytest.param(2, "mounting angle", 48, marks=LONG),
        pytest.param(14, "scale factor", 24, marks=LONG),
        pytest.param(15, "mounting", 48, marks=LONG),
    ],
)
def test_a_break_and_a_wrong_row_are_named(seed, group, count):
    two = two_things(seed, (group,), count, wrong_row=True)
    result = diagnosed(two.record)
    first = result.explanations[0]
    assert (result.verdict, first.kind) == ("explained", "break"), str(result)
    assert (first.before_row, first.rows) == (two.before_row, (two.further_row,))


@pytest.mark.acceptance
def test_two_things_that_change_at_one_gap_are_named():
    two = two_things(1, ("outer zero", "biases"), 48, at_once=True)
    result = diagnosed(two.record)
    first = result.explanations[0]
    assert (result.verdict, first.kind, first.before_row) == ("explained", "break", two.before_row)
    assert set(first.where) == {"outer-axis", "accelerometer-1", "accelerometer-2", "accelerometer-3"}


@pytest.mark.acceptance
def test_two_effects_are_no_break():
    two = two_things(7, (), 48, ((QUADRATIC, (1.2e-4,)), (PRODUCT, (1.5e-4,))))
    assert {cause.place for cause in diagnosed(two.record).causes} == {QUADRATIC, PRODUCT}
