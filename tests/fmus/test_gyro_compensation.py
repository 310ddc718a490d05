"""GyroCompensation undoes GyroBlock: exactly without effects, to second order with them, and stably for any lag."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description

from gyro_readings import PERIOD, gyro_readings, lively_motion
from named import Named
from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.models.effects import STRAPDOWN_EFFECTS, EffectPlace
from trihedron.models.effects.columns import TIME_CONSTANT
from trihedron.tools.errors import InputError
from trihedron.tools.exporting import export_components

ERRORS: dict[str, Any] = {
    "scale_misalignment": np.array([1e-2, 2e-2, -3e-2, 4e-2, -5e-2, 6e-3, 7e-3, -8e-2, 9e-2]),
    "bias": np.array([0.01, -0.02, 0.03]),
}
LATENCY = EffectPlace("latency", "gyro-block")
FADES_IN = 0.01
"""Time constant [h] of fading effects."""
INVERTIBLE = [e.places[0] for e in STRAPDOWN_EFFECTS.values() if e.stage == "reading_effects"]


def undone(effects, rows, *, regular: bool = False, calibrated=None) -> np.ndarray:
    """Return rates (N, 3) that the compensation with `calibrated` effects recovers from the readings of a block."""
    readings = gyro_readings(effects, rows, regular=regular, **ERRORS)
    readings = replace(rows, rate=readings)
    return gyro_readings(
        effects if calibrated is None else calibrated, readings, "GyroCompensation", regular=regular, **ERRORS
    )


def test_it_undoes_scale_misalignment_and_bias():
    rows = lively_motion()
    assert undone([], rows) == pytest.approx(rows.rate, abs=1e-14)


@pytest.mark.parametrize("place", INVERTIBLE, ids=lambda p: p.title)
def test_it_undoes_effects_to_second_order(place):
    """The remainder falls with the third power of an effect's size, or is only rounding."""
    effect, rows = STRAPDOWN_EFFECTS[place.effect], lively_motion()
    regular = place.effect == "jitter"
    scale = 0.2 * PERIOD if place.effect in ("latency", "latency-step", "lag") else 0.02
    direction = np.linspace(1.0, 0.4 if place.effect == "lag" else -0.8, len(effect.parameters))
    misfit, size = [], []
    for part in (1.0, 0.5):
        values = effect.from_coefficients(part * scale * direction)
        if effect.searched == TIME_CONSTANT:
            values = (*values[:-1], FADES_IN)
        misfit.append(np.abs(undone([(place, values)], rows, regular=regular) - rows.rate).max())
        size.append(np.abs(undone([(place, values)], rows, regular=regular, calibrated=[]) - rows.rate).max())
    assert misfit[0] < 0.1 * size[0]
    assert misfit[1] < misfit[0] / 7.0 or misfit[1] < 1e-13


def test_a_lag_of_a_step_and_a_fifth_is_taken_out_of_a_hand_like_motion():
    """Rates of 3 rad/s that swing once in 0.7 s; uncompensated, the lag leaves a fifth of a radian a second."""
    rows = lively_motion(even=True)
    effects = [(LATENCY, [1.2 * PERIOD])]
    lag = np.abs(undone(effects, rows, calibrated=[]) - rows.rate)[10:].max()
    misfit = np.abs(undone(effects, rows) - rows.rate)[10:].max()
    assert lag > 0.15
    assert misfit < 0.02 * lag


@pytest.mark.parametrize("steps", [0.5, 1.3, 4.0, 8.0])
def test_no_lag_makes_it_unstable(steps):
    """A reading that jumps up and down is the worst case: a series of two terms cannot exceed 1 + 2 + 4."""
    rows = lively_motion(even=True)
    jumping = replace(rows, rate=np.where(np.arange(len(rows.rate)) % 2 == 0, 1.0, -1.0)[:, None] * np.ones(3))
    response = gyro_readings([(LATENCY, [steps * PERIOD])], jumping, "GyroCompensation")
    assert np.abs(response).max() <= 7.0 + 1e-12
    # Two lags after a jump, the earlier motion is forgotten.
    step = replace(rows, rate=np.where(np.arange(len(rows.rate)) < 10, 0.0, 1.0)[:, None] * np.ones(3))
    response = gyro_readings([(LATENCY, [steps * PERIOD])], step, "GyroCompensation")
    assert response[30:] == pytest.approx(np.ones_like(response[30:]), abs=1e-12)


def test_effects_without_an_inverse_and_of_others_are_refused():
    compensation = components()["GyroCompensation"]
    with pytest.raises(ValueError, match="has no inverse"):
        extend(compensation, [EffectPlace("gyro-quantisation", "gyro-block")])
    with pytest.raises(ValueError, match="extends AttitudeComputer, not GyroCompensation"):
        extend(compensation, [EffectPlace("undersampling", "attitude-computer")])
    with pytest.raises(ValueError, match="extends AccelerometerBlock, not GyroCompensation"):
        extend(compensation, [EffectPlace("quadratic", "accelerometer-1")])


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"increment_reading[2]": math.inf}, "increment_reading is not"),
        ({"specific_force[1]": math.nan}, "specific_force is not"),
        ({"interval": math.inf}, "interval is not"),
        ({"scale_misalignment[2]": 0.45, "scale_misalignment[3]": 0.45, "scale_misalignment[1]": -0.3}, "too large"),
    ],
)
def test_what_it_cannot_use_stops_the_step(inputs, message):
    model = Named("GyroCompensation").begin().step(0.0, PERIOD).put(**inputs)
    assert message in model.refuses_step(PERIOD, PERIOD)


def test_the_inverse_is_exported_with_the_effects_that_it_takes_out(tmp_path):
    titles = ["latency gyro-block", "gyro-g-sensitivity gyro-block"]
    export_components(["GyroBlock", "GyroCompensation"], tmp_path, effects=titles)
    for name in ("GyroBlock", "GyroCompensation"):
        described = {v.name for v in read_model_description(tmp_path / f"{name}.fmu").modelVariables}
        assert {"latency.gyro_block.delay", "gyro_g_sensitivity.gyro_block.coefficient_31"} <= described
    with pytest.raises(InputError, match="extends GyroBlock, not exported here"):
        export_components(["GyroCompensation"], tmp_path, effects=["gyro-quantisation gyro-block"])
