"""Bounds are rounded up, ends of intervals outwards, and no nonzero number is shown as zero."""

import math
from decimal import Decimal

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from trihedron.tools.rounding import (
    Number,
    digits,
    downwards,
    exactly,
    interval,
    outwards,
    residual,
    to_bound,
    upwards,
)

doubles = st.floats(allow_nan=False, allow_infinity=False)
sizes = st.floats(-18.0, 12.0).map(lambda power: 10.0**power)
counts = st.integers(1, 12)


def stored(value: float) -> Decimal:
    """Return the value in JSON."""
    return Decimal(repr(value))


@given(doubles, counts)
@example(3.541e-5, 2)
@example(0.30000000000000004, 2)
@example(-3.541e-5, 2)
@example(9.999e-4, 2)
@example(999999.5, 2)
@example(5e-324, 1)
@example(-0.0, 2)
def test_a_bound_is_never_less_and_what_is_at_least_never_more(value, count):
    above, below = Decimal(upwards(value, count)), Decimal(downwards(value, count))
    assert below <= stored(value) <= above
    # The text read as a double is a bound too.
    assert float(downwards(value, count)) <= value <= float(upwards(value, count))
    # No looser than the last digit.
    step = Decimal(1).scaleb(stored(value).adjusted() - count + 1) if value else Decimal(0)
    assert above - below <= step


@given(st.integers(1, 99), st.integers(-12, 12))
def test_a_number_of_two_digits_stays_what_it_is(number, power):
    value = float(f"{number}e{power}")
    for text in (upwards(value), downwards(value), digits(value), exactly(value), downwards(-value)):
        assert abs(float(text)) == value
    assert len(upwards(value).partition("e")[0].replace(".", "").strip("0")) <= 2


@given(doubles.filter(lambda value: abs(value) < 1e300), counts)
def test_nothing_that_is_not_zero_is_shown_as_zero(value, count):
    texts = (digits(value, count), exactly(value))
    assert all((float(text) == 0.0) == (value == 0.0) for text in texts)
    assert float(digits(value, count)) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - count))
    assert float(exactly(value)) == value


@given(doubles.filter(lambda value: abs(value) < 1e12), sizes, st.floats(0.0, 1.0))
@example(0.00393096, 6e-5, 0.5)
@example(0.0, 1.0, 0.0)
def test_an_interval_is_shown_outwards_and_an_estimate_within(low, width, part):
    high = low + width
    value = min(max(low + part * width, low), high)
    assume(low < high)
    inside, *ends = (Decimal(text) for text in interval(value, low, high))
    assert ends[0] <= stored(low)
    assert stored(high) <= ends[1]
    assert ends[0] <= inside <= ends[1]
    assert tuple(outwards(low, high)) == interval(value, low, high)[1:]
    # Two digits of half of it, and no more than a double has.
    loose = max(stored(high - low) * Decimal("0.2"), Decimal(max(abs(low), abs(high))) * Decimal("4e-16"), 0)
    assert ends[1] - ends[0] <= stored(high - low) + max(loose, 2 * (width >= 20.0))


@given(doubles, doubles)
@example(0.9994, 1.003)
@example(-10.04, -9.99)
@example(9.995, 10.01)
def test_an_estimate_is_shown_within_an_interval_that_is_open(one, other):
    low, value = sorted((one, other))
    text, below, above = interval(value, low, math.inf)
    assert Decimal(below) <= min(Decimal(text), stored(low))
    assert above == "inf"
    text, below, above = interval(low, -math.inf, value)
    assert Decimal(above) >= max(Decimal(text), stored(value))
    assert below == "-inf"


@given(st.floats(0.0, 50.0))
@example(1.0)
@example(1.0 + 2.0**-52)
@example(0.99996)
@example(1.00004)
def test_a_radius_is_shown_on_its_side_of_one(radius):
    text = Decimal(residual(radius))
    assert (text > 1) == (radius > 1.0)
    assert text <= stored(radius) if radius > 1.0 else text >= stored(radius)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (upwards(3.541e-5), "3.6e-5"),
        (upwards(1e-5), "1e-5"),
        (upwards(0.0999), "0.10"),
        (upwards(9.96e-4), "0.0010"),
        (upwards(12345.6), "12346"),
        (upwards(-3.541e-5), "-3.5e-5"),
        (upwards(math.inf), "inf"),
        (upwards(math.nan), ""),
        (upwards(None), ""),
        (downwards(-math.inf), "-inf"),
        (downwards(None, above=1.0), ""),
        (digits(2.2e-5), "2.2e-5"),
        (digits(12.3456), "12.3"),
        (exactly(0.07), "0.07"),
        (exactly(30.0), "30"),
        (exactly(math.nan), "nan"),
        (residual(None), ""),
        (to_bound(0.00393096, 2.4e-5), "0.003931"),
        (to_bound(-0.00062534, 1.06e-5), "-0.000625"),
        (to_bound(0.0, 1e-5), "0.000000"),
        (to_bound(-1e-9, 1e-5), "0.000000"),
        (to_bound(3.14159, 12.0), "3"),
        (to_bound(0.00393096, 0.0), "0.00393"),
        (to_bound(0.00393096, None), "0.00393"),
        (to_bound(None, 1.0), ""),
        (to_bound(1.5e-12, 1e-12), "1.5e-12"),
    ],
)
def test_numbers_as_they_are_shown(text, wanted):
    assert isinstance(text, Number)
    assert text == wanted


def test_intervals_as_they_are_shown():
    assert interval(0.00393096, 0.0039, 0.00396) == ("0.003931", "0.003900", "0.003960")
    assert interval(0.5, None, 1.0) == ("0.5", "", "1")
    assert interval(0.5, -math.inf, 0.75) == ("0.5", "-inf", "0.75")
    assert interval(0.25, 0.25, 0.25) == ("0.25", "0.25", "0.25")
    assert interval(None, None, None) == ("", "", "")
    assert outwards(-3.541e-5, 3.541e-5) == ("-0.000036", "0.000036")


def test_a_positive_number_known_to_some_powers_of_ten_keeps_its_digits():
    """A time constant between a twentieth of an hour and 3000 h is not shown as 0."""
    assert [str(number) for number in interval(0.2051, 0.05123, 2996.7)] == ["0.205", "0", "2997"]
