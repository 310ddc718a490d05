"""An accelerometer at its limit in two rests, and gyros that depend on gravity: both are named."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator import G
from generator.carried import strapdown_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose

pytestmark = pytest.mark.acceptance


def test_a_limit_stands_beside_what_the_other_rests_show():
    """What is named without the limit is named with it, too."""
    sensitivity = 3e-3 * np.array([[1.0, 0.0, 0.5], [0.0, -1.0, 0.0], [0.0, 0.5, 1.0]])
    record = strapdown_record(seed=8, bias_g=np.array([0.01, -0.02, 0.015]), force_noise=0.01, sensitivity=sensitivity)
    force = np.array(record.specific_force)
    force[:, 1] = np.clip(force[:, 1], -0.8 * G, 0.8 * G)
    of_gyros = EffectPlace("gyro-g-sensitivity", "gyro-block")
    for measured, expected in (
        (record, [of_gyros]),
        (replace(record, specific_force=force), [EffectPlace("saturation", "accelerometer-2"), of_gyros]),
    ):
        result: Any = diagnose(measured)
        assert result.verdict == "explained"
        assert [cause.place for cause in result.causes] == expected
        assert result.gain.held_out_rms_after < result.gain.held_out_rms_before
