"""AccelerometerCompensation undoes AccelerometerBlock at every sign and at zero, and reports an uncertain inverse."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from component_kinds import elements_of
from named import Named
from trihedron.fmus import components
from trihedron.fmus.instruments import CALIBRATED

BLOCK, INVERSE = components()["AccelerometerBlock"], components()["AccelerometerCompensation"]
GRAVITY = 9.80665
SMALL = st.floats(-0.05, 0.05)
FORCE = st.one_of(st.floats(-30.0, 30.0), st.sampled_from([0.0, -0.0, 1e-300, -1e-300, 1e-12, -1e-12]))


def there_and_back(parameters: dict[str, float], force) -> tuple[np.ndarray, np.ndarray]:
    """Return the block's readings of a force, and the forces that its inverse recovers [m/s²]."""
    block, inverse = (Named(component, **parameters).begin() for component in (BLOCK, INVERSE))
    reading = block.put(specific_force=force)["reading"]
    return reading, inverse.put(reading=reading)["specific_force"]


def names() -> list[str]:
    return [name for name in elements_of(INVERSE, "parameter") if name != "gravity"]


def test_it_has_the_parameters_of_the_calibrated_block():
    ours = {v.name: v for v in INVERSE.interface if v.causality == "parameter"}
    assert tuple(ours) == CALIBRATED
    assert ours == {v.name: v for v in BLOCK.interface if v.name in CALIBRATED}


@pytest.mark.acceptance
@given(st.lists(SMALL, min_size=15, max_size=15), st.tuples(FORCE, FORCE, FORCE))
def test_the_inverse_of_the_block_for_every_force(values, force):
    _, recovered = there_and_back(dict(zip(names(), values, strict=True)), force)
    # the bias is added to the reading and subtracted again: only its rounding remains
    np.testing.assert_allclose(recovered, force, rtol=0, atol=4e-15 * (GRAVITY + np.abs(force).max()))


def test_signs_that_the_readings_do_not_show():
    """Biases and crossed axes reverse the signs of readings; the inverse finds those of the inputs."""
    parameters = {"bias[1]": 0.02, "gamma_21": 0.3, "gamma_23": -0.3, "scale_error_plus[2]": 0.1}
    parameters |= {"scale_error_minus[2]": -0.1, "scale_error_plus[1]": 0.2, "scale_error_minus[1]": -0.2}
    for force in ((-0.01, 0.05, -9.8), (9.0, -1.0, 3.0), (-9.0, 1.0, 3.0), (-0.1, -0.1, -0.1)):
        reading, recovered = there_and_back(parameters, force)
        np.testing.assert_allclose(recovered, force, rtol=0, atol=1e-13)
    assert (np.sign(reading) == np.sign(force)).tolist() == [False, True, True]


def test_errors_without_a_certain_inverse_are_refused():
    model = Named(INVERSE, gamma_31=0.5, gamma_32=-0.5)
    assert "too large for one inverse" in model.refuses_to_begin()
    model.put(gamma_32=0.4).begin().step(0.0, 0.1).put(**{"scale_error_minus[3]": -0.2})
    assert "too large for one inverse" in model.refuses_step(0.1, 0.1)
    model.put(**{"scale_error_minus[3]": 0.0, "reading[1]": math.nan})
    assert "not finite" in model.refuses_step(0.2, 0.1)


def test_the_scale_factor_of_each_sign_counts():
    for sign, scale in ((1.0, 0.01), (-1.0, -0.02)):
        parameters = {"scale_error_plus[3]": 0.01, "scale_error_minus[3]": -0.02}
        reading, recovered = there_and_back(parameters, (0.0, 0.0, sign * GRAVITY))
        assert reading[2] == pytest.approx(sign * GRAVITY * (1 + scale), rel=1e-15)
        assert recovered[2] == pytest.approx(sign * GRAVITY, rel=1e-15)
