"""The sheet of effects: every effect is visible in its defined form."""

import numpy as np
import pytest

from reference import change_along, effect_sheet, shown_place, sweep_of
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS


@pytest.mark.parametrize("effect", POSITION_EFFECTS.values(), ids=lambda effect: effect.name)
def test_each_effect_shows_along_its_sweep(effect):
    place = shown_place(effect)
    sweep = sweep_of(effect, place)
    change = change_along(effect, place, sweep)
    assert change.shape == (len(sweep.along), 3)
    assert np.ptp(change) > 0.0


def test_effects_of_the_input_are_drawn_as_the_contract_defines_them():
    """On a perfect bench with α at 90° the first input is the abscissa."""
    for name, function in (("cubic", lambda n: n**3), ("odd-quadratic", lambda n: n * np.abs(n))):
        effect = CATALOGUE[name]
        sweep = sweep_of(effect, shown_place(effect))
        assert change_along(effect, shown_place(effect), sweep)[:, 0] == pytest.approx(function(sweep.along), abs=1e-14)
    saturation = CATALOGUE["saturation"]
    sweep = sweep_of(saturation, shown_place(saturation))
    clipped = np.clip(sweep.along, -0.8, 0.8) - sweep.along
    assert change_along(saturation, shown_place(saturation), sweep)[:, 0] == pytest.approx(clipped, abs=1e-14)


@pytest.mark.acceptance
def test_the_sheet_is_the_same_bytes_each_time():
    some = [CATALOGUE["quadratic"], CATALOGUE["hysteresis"]]
    sheet = effect_sheet(some)
    assert sheet == effect_sheet(some)
    assert "hysteresis" in sheet
