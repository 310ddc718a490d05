"""Lots of few instruments: chance names none more often than stated, and odd ones are named.

A cause of a stretch of serial numbers is named with both its ends.
"""

from datetime import datetime, timedelta

import numpy as np
import pytest

from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis.cause import NamedEffect
from trihedron.tools.lot import InstrumentValue, Lot, Member, lot_of

PARAMETERS = 18


def drawn_lot(
    rng: np.random.Generator,
    count: int,
    moved: float = 0.0,
    step_at: int | None = None,
    per_kelvin: float = 0.0,
    per_year: float = 0.0,
) -> Lot:
    """Return a lot of normal parameters; one of the fourth instrument is moved by a number of standard deviations.

    From the instrument `step_at` on the seventh parameter is larger by 8 standard deviations. The ninth one changes by
    `per_kelvin` and `per_year`. With a change by year the instruments have their dates in order.
    """
    estimates = rng.normal(size=(count, PARAMETERS))
    temperatures = rng.uniform(15.0, 30.0, count)
    estimates[:, 8] += per_kelvin * temperatures + per_year * np.arange(count) / count
    estimates[3, 5] += moved
    estimates[step_at or count :, 6] += 8.0
    members = []
    for number, row in enumerate(estimates):
        values = {}
        for k, value in enumerate(row.tolist()):
            values[f"X{k + 1}"] = InstrumentValue(unit="g", estimate=value, low=value - 1e-3, high=value + 1e-3)
        date = datetime(2026, 1, 1) + timedelta(days=365.25 * number / count)
        if per_year == 0.0:
            date = datetime(2026, 1 + number % 12, 1 + number % 28)
        member = {
            "record": f"{number}.csv",
            "serial": f"U-{number}",
            "date": f"{date:%Y-%m-%d}",
            "temperature_degC": float(temperatures[number]),
        }
        members.append(Member(**member, verdict="consistent", values=values))
    return lot_of(members, "calibrate")


def lots_with_a_name(counts: range | tuple[int, ...], lots: int) -> int:
    """Return the number of lots without anything hidden that name something."""
    rng, named = np.random.default_rng(8), 0
    for number in range(lots):
        lot = drawn_lot(rng, counts[number % len(counts)])
        named += bool(lot.odd or lot.dependences)
    return named


@pytest.mark.acceptance
def test_a_small_lot_without_anything_names_nothing():
    assert lots_with_a_name((8, 9, 12), 45) <= 2


@pytest.mark.acceptance
def test_small_lots_name_nothing_more_often_than_stated():
    """Two searches with a chance of one in a hundred each; three standard deviations more."""
    assert lots_with_a_name(range(8, 20), 1200) <= 0.02 * 1200 + 3.0 * np.sqrt(0.02 * 1200)


@pytest.mark.parametrize("count", [8, 12, 19])
def test_an_odd_instrument_of_a_small_lot_is_named(count: int):
    lot = drawn_lot(np.random.default_rng(count), count, moved=60.0)
    assert [(odd.serial, odd.symbol) for odd in lot.odd] == [("U-3", "X6")]


@pytest.mark.parametrize(("count", "begin", "end"), [(100, 40, 60), (100, 0, 20), (100, 80, 100), (1000, 400, 600)])
def test_a_cause_of_a_stretch_is_named_with_its_ends(count: int, begin: int, end: int):
    """Seven of ten instruments of the stretch have it."""
    place = EffectPlace("quadratic", "accelerometer-2")
    members = []
    for number in range(count):
        has = begin <= number < end and number % 10 not in (2, 5, 8)
        causes = (NamedEffect(**NamedEffect.keys(place)),) if has else ()
        verdict = "explained" if has else "consistent"
        members.append(Member(record=f"{number}.csv", serial=f"U-{number}", verdict=verdict, causes=causes))
    (shared,) = lot_of(members, "diagnose").shared
    assert shared.since == (f"U-{begin}" if begin else None)
    assert shared.until == (f"U-{end - 1}" if end < count else None)
    assert (shared.count, shared.of) == (0.7 * (end - begin), end - begin)


def test_a_step_is_named_at_its_first_instrument():
    """Away from the middle, too, where the sum of ranks alone misses it in a quarter of the lots."""
    for seed in range(10, 20):
        lot = drawn_lot(np.random.default_rng(seed), 100, step_at=80)
        assert [(one.symbol, one.since) for one in lot.dependences if one.against == "serial"] == [("X7", "U-80")]


@pytest.mark.acceptance
@pytest.mark.parametrize(("against", "name", "reach"), [("temperature", "per_kelvin", 15.0), ("date", "per_year", 1.0)])
@pytest.mark.parametrize(("count", "change"), [(16, 15.0), (60, 6.0)])
def test_a_trend_is_named_and_its_interval_holds_the_truth(against: str, name: str, reach: float, count: int, change):
    """A drift of the production is no step, though the dates go with the serial numbers.

    Fewer instruments need a larger change for the same proof: a chance of 1 % shared by 54 trials.
    """
    inside = 0
    slope = change / reach
    for seed in range(20):
        (trend,) = drawn_lot(np.random.default_rng(seed), count, **{name: slope}).dependences
        assert (trend.symbol, trend.against) == ("X9", against)
        assert trend.size == pytest.approx(slope, rel=0.5)
        inside += trend.low <= slope <= trend.high
    # Of 20 intervals of 95 % four miss with a chance of 2 %.
    assert inside >= 16
