"""GyroBlock: its readings, quanta without loss, bounded errors."""

import math

import numpy as np
import pytest

from named import Named

G = 9.80665
H = 0.01


def run(inputs: dict[str, np.ndarray], **settings) -> tuple[np.ndarray, np.ndarray]:
    """Return readings of rates and increments (N, 3) for inputs, one row a step."""
    model = Named("GyroBlock", **settings)
    rows = len(next(iter(inputs.values())))
    outputs = np.zeros((rows, 6))
    for k in range(-1, rows):
        model.put(**{name: values[max(k, 0)] for name, values in inputs.items()})
        if k < 0:
            model.begin(5.0)
            continue
        model.step(5.0 + k * H, H)
        outputs[k] = model.outputs()
    return outputs[:, :3], outputs[:, 3:]


def turning(rows: int = 200) -> np.ndarray:
    t = H * np.arange(1, rows + 1)
    return np.stack([np.sin(3.0 * t), 0.5 * np.cos(2.0 * t), -0.3 + 0.2 * t], axis=1)


def test_a_perfect_block_reads_its_input_whichever_it_is():
    w = turning()
    for kind, inputs, expected in (
        (1, {"increment": w * H}, w),
        (2, {"rate": w}, w),
        (3, {"rate": w}, 0.5 * (w + np.vstack([w[:1], w[:-1]]))),
    ):
        rate, increment = run(inputs, input_kind=kind)
        assert rate == pytest.approx(expected, rel=1e-14, abs=1e-16)
        assert increment == pytest.approx(expected * H, rel=1e-14, abs=1e-16)


def test_scale_misalignment_and_bias_enter_as_the_equation_says():
    w, gamma, bias = (
        turning(),
        np.array([[1e-2, 2e-3, -3e-3], [4e-3, -5e-3, 6e-3], [7e-3, 8e-3, 9e-3]]),
        [0.01, -0.02, 0.03],
    )
    rate, increment = run({"increment": w * H}, scale_misalignment=gamma.ravel(), bias=bias)
    assert rate == pytest.approx(w @ (np.eye(3) + gamma).T + bias, rel=1e-13, abs=1e-15)
    assert increment == pytest.approx(rate * H, rel=1e-14)


def test_quanta_are_whole_and_their_sum_stays_within_half_of_one():
    """The remainder is carried: the integral of the angle does not drift, as it would with plain rounding."""
    quantum = 1e-3
    w = turning(2000)
    _, increment = run({"increment": w * H}, quantum=quantum)
    assert np.allclose(increment / quantum, np.round(increment / quantum), atol=1e-9)
    remainder = np.cumsum(w * H - increment, axis=0)
    assert np.abs(remainder).max() <= 0.5 * quantum * (1.0 + 1e-9)
    plain = np.cumsum(w * H - quantum * np.floor(w * H / quantum + 0.5), axis=0)
    assert np.abs(plain).max() > 10.0 * quantum


@pytest.mark.acceptance
def test_errors_stay_within_their_bound_fill_it_and_repeat_with_the_seed():
    still = {"rate": np.zeros((3000, 3))}
    settings = {"input_kind": 2, "noise_bound": 1e-3}
    first, increment = run(still, **settings, seed=3)
    assert np.abs(first).max() <= 1e-3
    assert np.all(np.abs(first).max(axis=0) > 0.99e-3)
    assert np.abs(first.mean(axis=0)).max() < 5.0 * 1e-3 / math.sqrt(3.0 * 3000)
    assert increment == pytest.approx(first * H, rel=1e-14)
    assert np.array_equal(first, run(still, **settings, seed=3)[0])
    assert not np.array_equal(first, run(still, **settings, seed=4)[0])


def test_its_errors_are_not_those_of_the_accelerometers_with_the_same_seed():
    gyro = run({"rate": np.zeros((50, 3))}, input_kind=2, noise_bound=1.0)[0]
    block = Named("AccelerometerBlock", noise_bound=0.5, held_fraction=0.0).begin()
    accelerometers = [block.step(k * H, H)["reading"] for k in range(50)]
    assert np.abs(np.corrcoef(gyro.ravel(), np.ravel(accelerometers))[0, 1]) < 0.3


@pytest.mark.parametrize(
    ("name", "message"),
    [("rate", "rate is not finite"), ("increment", "increment is"), ("specific_force", "specific_force is")],
)
def test_an_input_that_is_not_finite_stops_the_step(name, message):
    model = Named("GyroBlock").begin().put(**{f"{name}[2]": math.inf})
    assert message in model.refuses_step(0.0, H)
