"""A diagnosis ends for any record: gross errors of many readings at 24 to 100 positions."""

import time

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.errors import InputError

pytestmark = pytest.mark.acceptance
SIGMA = 1e-5
MOST_SECONDS = 20.0


@pytest.mark.parametrize("positions", [24, 60, 100])
@pytest.mark.parametrize("kind", ["slow walk", "walk", "sign", "white", "shuffled"])
def test_a_diagnosis_of_gross_errors_ends(kind, positions):
    rng = np.random.default_rng([positions, len(kind)])
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, positions))
    noise = rng.uniform(-SIGMA, SIGMA, (positions, 3))
    if kind.endswith("walk"):
        noise[:, 0] += np.cumsum(rng.normal(0.0, 3e-6 if kind == "slow walk" else 3e-5, positions))
    if kind == "white":
        noise += rng.normal(0.0, 100.0 * SIGMA, noise.shape)
    reading = simulated(random_bench(rng), alpha, beta, noise).specific_force / GRAVITY
    if kind == "sign":
        reading[-positions // 4 :, 1] *= -1.0
    if kind == "shuffled":
        reading = reading[rng.permutation(positions)]
    began = time.process_time()
    try:
        result = diagnose(position_record(reading, alpha, beta), noise_bound=SIGMA)
    except InputError:
        if kind == "shuffled":
            return
        raise
    seconds = time.process_time() - began
    print(f"{kind}, {positions} positions: {seconds:.1f} s, {result.verdict}, cut off at {result.cut_off_at}")
    assert seconds < MOST_SECONDS
    # A walk may come near a neighbour, white noise near none; only a reversed sign has a name.
    if kind == "sign":
        assert [cause.place.effect for cause in result.causes] == ["exchanged-readings"]
    elif kind in ("white", "shuffled"):
        assert result.verdict == "unexplained"
