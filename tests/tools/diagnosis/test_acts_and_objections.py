"""A cause acts, and each kind of witness can object by itself."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Cause, Finding, Witness
from trihedron.tools.evidence import Fit, Trial
from trihedron.tools.evidence.evidence import Worst

HYSTERESIS = EffectPlace("hysteresis", "accelerometer-1")
BASE = EffectPlace("base-drift", "base")
HARMONIC = EffectPlace("encoder-harmonic", "outer-axis", 2)
WARM_UP = EffectPlace("warm-up", "accelerometer-1")


@pytest.mark.parametrize(
    ("place", "ends", "acts"),
    [
        (HYSTERESIS, [(0.0, 9e-5)], False),
        (HYSTERESIS, [(1e-9, 9e-5)], True),
        (HYSTERESIS, [(-np.inf, np.inf)], False),
        # The components are not all zero together, though each may be: no single size is certain.
        (BASE, [(-2e-5, 1e-5), (-1e-5, 0.0)], False),
        (BASE, [(-2e-5, 1e-5), (-1e-5, -1e-9)], True),
        # A time constant is not a size, and does not count for one that may be zero.
        (WARM_UP, [(-1e-5, 1e-5), (0.1, 2.0)], False),
        # The phase of an amplitude that may be zero is meaningless.
        (HARMONIC, [(0.0, 1e-5), (0.5, 1.0)], False),
        (HARMONIC, [(1e-7, 1e-5), (-1.0, 1.0)], True),
    ],
)
def test_an_effect_acts_where_zero_is_outside_the_interval_of_some_size(place, ends, acts):
    values = [min(max(5e-6, low), high) for low, high in ends]
    assert Cause.found(place, (), values, ends).acts is acts


def test_every_effect_of_a_set_has_a_size_that_is_not_zero():
    """A set is as good as its weakest effect, and the objection names that one."""
    drift = Cause.found(BASE, (), [0.0, 0.0], [(-2e-5, 1e-5), (-1e-5, 2e-5)])
    surely = Cause.found(BASE, (), [5e-6, 0.0], [(1e-6, 1e-5), (-1e-5, 2e-5)])
    hysteresis = Cause.found(HYSTERESIS, (), [5e-5], [(1e-5, 9e-5)])
    # The fit has no meaning here, but that no effect of it is faint.
    fit = cast("Fit", SimpleNamespace(faint=()))
    assert not Finding((drift,), fit).acts
    assert not Finding((drift, hysteresis), fit).acts
    assert not Finding((hysteresis, drift), fit).acts
    assert Finding((surely, hysteresis), fit).acts
    says = Finding((drift, hysteresis), fit).not_shown
    assert says.startswith(f"{BASE.title} and {HYSTERESIS.title} would do")
    assert f"no size of {BASE.title} is shown" in says


GOOD, BAD = (np.full(8, 2.0), np.full(8, 0.5)), (np.full(8, 2.0), np.full(8, 2.5))
SHUFFLED = tuple(np.full(8, 1.5) for _ in range(60))
AS_GOOD = (*SHUFFLED[:-4], *(np.full(8, 0.4),) * 4)


@pytest.mark.parametrize(
    ("trial", "says"),
    [
        ({"folds": GOOD, "blocks": GOOD, "shuffled": SHUFFLED, "worst": Worst(3, 1, 1.9, 2.0)}, None),
        ({"folds": GOOD, "blocks": GOOD, "shuffled": AS_GOOD[1:4] + AS_GOOD[-3:] + SHUFFLED[6:]}, None),
        ({"folds": BAD, "blocks": GOOD, "shuffled": ()}, "positions that were left out"),
        ({"folds": GOOD, "blocks": BAD, "shuffled": SHUFFLED}, "in time"),
        ({"folds": GOOD, "blocks": GOOD, "shuffled": AS_GOOD}, "4 of 60 shuffles"),
        ({"folds": GOOD, "blocks": None, "shuffled": (), "worst": Worst(3, 1, 2.1, 2.0)}, "position/accelerometer 3/1"),
        ({"folds": None, "blocks": None, "shuffled": ()}, None),
    ],
)
def test_each_kind_of_witness_objects_by_itself(trial, says):
    objections = Witness.of(Trial((HYSTERESIS,), jointly=True, **trial)).objections
    assert len(objections) == (says is not None)
    assert says is None or (says in objections[0] and HYSTERESIS.title in objections[0])
