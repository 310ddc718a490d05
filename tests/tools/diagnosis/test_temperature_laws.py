"""Hidden laws of temperature are named with their order: the simplest that the record allows."""

from dataclasses import replace

import numpy as np
import pytest

from diagnoses import assert_named, diagnosed, sets_of
from generator import SIGMA
from generator.positions import Session
from trihedron.models.effects import EffectPlace

BIAS, SCALE = "temperature-bias", "temperature-scale"
HIDDEN = [
    (BIAS, (3e-5,)),
    (SCALE, (4e-5,)),
    (f"{BIAS}-quadratic", (2e-4, 3e-4)),
    (f"{BIAS}-quadratic", (0.0, -4e-4)),
    (f"{SCALE}-quadratic", (2e-4, -4e-4)),
    (f"{BIAS}-cubic", (-2e-4, 1e-4, 5e-4)),
    (f"{SCALE}-cubic", (1e-4, 3e-4, -5e-4)),
]
"""Effects with their sizes: some ten to fifty σ over the temperatures of the record."""
QUICK = [0]
MORE = [pytest.param(seed, marks=pytest.mark.acceptance) for seed in (1, 2, 3, 4)]


def warm_record(seed: int, place: EffectPlace | None = None, sizes=()):
    """Return a record of 40 positions anywhere, at temperatures from 5 to 35 °C in any order."""
    rng = np.random.default_rng([seed, 46])
    session = Session.drawn(rng, 40)
    session = replace(session, temperature=np.round(rng.uniform(5.0, 35.0, 40), 2))
    hidden = [] if place is None else [(place, sizes)]
    record = session.record(hidden, rng.uniform(-SIGMA, SIGMA, (40, 3)))
    return replace(record, temperature_resolution=0.005)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [*QUICK, *MORE])
@pytest.mark.parametrize(("effect", "sizes"), HIDDEN)
def test_a_law_of_temperature_is_named_with_its_order(effect, sizes, seed):
    place = EffectPlace(effect, f"accelerometer-{1 + seed % 3}")
    assert_named(diagnosed(warm_record(seed, place, sizes)), {place: sizes})


@pytest.mark.parametrize("seed", [*QUICK, *MORE])
def test_no_law_is_named_in_a_clean_record(seed):
    result = diagnosed(warm_record(seed))
    assert (result.verdict, sets_of(result)) == ("consistent", [])
