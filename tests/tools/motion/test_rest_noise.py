"""Noise at rest: white noise and flicker noise are separated, and hardly one of many errors is beyond its bound."""

from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from trihedron.tools.motion import factor_for
from trihedron.tools.motion import rest_noise as module
from trihedron.tools.motion.rest_noise import ANY_BEYOND, rest_noise

PERIOD = 0.01


@pytest.mark.parametrize("part", [0.0, 0.5, 2.0, 8.0])
def test_white_noise_and_flicker_noise_are_told_apart_whatever_their_parts(part):
    """Use Allan deviations of both together: white noise falls with the time, flicker noise does not."""
    rests: Any = SimpleNamespace(rows=[slice(0, 400), slice(500, 900)])
    flicker = np.array([1e-8, 4e-8, 9e-8])
    white = part * flicker * 200 * PERIOD

    def square(_: Any, size: int) -> tuple[np.ndarray, np.ndarray]:
        return white / (size * PERIOD) + flicker, np.full(3, 10.0)

    with mock.patch.object(module, "allan_square", square):
        noise = rest_noise(np.zeros((900, 3)), PERIOD * np.arange(900), rests, PERIOD)
    assert noise is not None
    assert noise.white == pytest.approx(white, rel=1e-9, abs=1e-20)
    assert noise.flicker == pytest.approx(flicker, rel=1e-9)


def test_of_many_errors_hardly_one_is_beyond_its_bound():
    """In records of Gaussian errors the number beyond is the sum of their probabilities; three sigma do for few
    rows."""
    rng = np.random.default_rng(2)
    for rows, least in ((1, 3.0), (2_000, 4.0), (50_000, 5.0)):
        factor = factor_for(rows)
        assert factor >= least
        beyond = sum(np.abs(rng.standard_normal(rows)).max() > factor for _ in range(100))
        assert beyond <= 4 * 100 * ANY_BEYOND
