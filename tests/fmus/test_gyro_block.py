"""GyroBlock: what it reads, that quanta lose nothing, that errors are bounded, that gyro effects compose."""

import math

import numpy as np
import pytest

from named import Named
from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.fmus.source import flat_source
from trihedron.models.effects import CATALOGUE, Effect, EffectParameter, EffectPlace, parameter_name
from trihedron.models.restricted import HOURS, INPUT, PREVIOUS_RATE, STEP_LENGTH, Vector

G = 9.80665
H = 0.01


def run(inputs: dict[str, np.ndarray], component=None, **settings) -> tuple[np.ndarray, np.ndarray]:
    """Readings of rates and increments (N, 3) for inputs, one row a step."""
    model = Named(component or "GyroBlock", **settings)
    rows = len(next(iter(inputs.values())))
    shown = np.zeros((rows, 6))
    for k in range(-1, rows):
        model.put(**{name: values[max(k, 0)] for name, values in inputs.items()})
        if k < 0:
            model.begin(5.0)
            continue
        model.step(5.0 + k * H, H)
        shown[k] = model.outputs()
    return shown[:, :3], shown[:, 3:]


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
    """The remainder is carried: the integral of the angle does not walk away, as it would with plain rounding."""
    quantum = 1e-3
    w = turning(2000)
    _, increment = run({"increment": w * H}, quantum=quantum)
    assert np.allclose(increment / quantum, np.round(increment / quantum), atol=1e-9)
    left = np.cumsum(w * H - increment, axis=0)
    assert np.abs(left).max() <= 0.5 * quantum * (1.0 + 1e-9)
    plain = np.cumsum(w * H - quantum * np.floor(w * H / quantum + 0.5), axis=0)
    assert np.abs(plain).max() > 10.0 * quantum


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
    other = [block.step(k * H, H)["reading"] for k in range(50)]
    assert np.abs(np.corrcoef(gyro.ravel(), np.ravel(other))[0, 1]) < 0.3


@pytest.mark.parametrize(
    ("name", "said"),
    [("rate", "rate is not finite"), ("increment", "increment is"), ("specific_force", "specific_force is")],
)
def test_an_input_that_is_not_finite_stops_the_step(name, said):
    model = Named("GyroBlock").begin().put(**{f"{name}[2]": math.inf})
    assert said in model.refuses_step(0.0, H)


def drift(context: Vector, rate: Vector, gyro: int, slope: float, added: Vector) -> None:
    """Add slope·hours to a gyro's reading."""
    added[gyro] = added[gyro] + slope * context[HOURS]


def asymmetry(context: Vector, rate: Vector, gyro: int, slope: float, added: Vector) -> None:
    """Add slope·|ω| to a gyro's reading."""
    added[gyro] = added[gyro] + slope * math.fabs(rate[gyro])


def g_sensitivity(context: Vector, rate: Vector, gyro: int, slope: float, added: Vector) -> None:
    """Add slope times the third input [g] to a gyro's reading."""
    added[gyro] = added[gyro] + slope * context[INPUT + 2]


def lag(context: Vector, rate: Vector, gyro: int, delay: float, added: Vector) -> None:
    """Read what the rate was up to one step before, joined by straight lines."""
    added[gyro] = added[gyro] + (context[PREVIOUS_RATE + gyro] - rate[gyro]) * (delay / context[STEP_LENGTH])


def clip(context: Vector, own: Vector, gyro: int, level: float, reading: Vector) -> None:
    """Clip a gyro's reading."""
    if reading[gyro] > level:
        reading[gyro] = level


def composed(monkeypatch, kernel, stage: str = "reading_effects"):
    """The block with an effect on gyro 1 that the catalogue does not have, and the name of its parameter."""
    # Kernels are made once for each name: each has its own.
    name = f"gyro-{kernel.__name__}"
    place = EffectPlace(name, "gyro-block", axes=(1,))
    entry = Effect(
        name=name,
        places=(place,),
        parameters=(EffectParameter("size", "1", "of the effect", 1.0),),
        component="GyroBlock",
        stage=stage,
        kernel=kernel,
        sentence=lambda place, values: "",
    )
    monkeypatch.setitem(CATALOGUE, entry.name, entry)
    return extend(components()["GyroBlock"], [place]), parameter_name(place, "size")


def test_kernels_of_gyro_effects_compose(monkeypatch):
    w = turning()
    force = np.tile([0.0, 3.0, 0.25 * G], (len(w), 1))
    before = np.vstack([w[:1], w[:-1]])
    hours = H * np.arange(1, len(w) + 1) / 3600.0
    for kernel, size, expected in (
        (drift, 0.7, w[:, 0] + 0.7 * hours),
        (asymmetry, 0.02, w[:, 0] + 0.02 * np.abs(w[:, 0])),
        (g_sensitivity, 0.04, w[:, 0] + 0.01),
        (lag, 0.4 * H, 0.6 * w[:, 0] + 0.4 * before[:, 0]),
    ):
        component, name = composed(monkeypatch, kernel)
        rate, increment = run({"increment": w * H, "specific_force": force}, component, **{name: size})
        assert rate[:, 0] == pytest.approx(expected, rel=1e-12, abs=1e-14), kernel.__name__
        assert rate[:, 1:] == pytest.approx(w[:, 1:], rel=1e-13)
        assert increment == pytest.approx(rate * H, rel=1e-14)
        assert kernel.__name__ in flat_source(component)
    component, name = composed(monkeypatch, clip, "final_effects")
    rate, increment = run({"increment": w * H}, component, **{name: 0.5}, bias=[0.1, 0.0, 0.0])
    assert rate[:, 0] == pytest.approx(np.minimum(w[:, 0] + 0.1, 0.5), rel=1e-13)
    assert increment[:, 0] == pytest.approx(rate[:, 0] * H, rel=1e-14)


def test_the_history_has_the_eight_steps_before(monkeypatch):
    w = turning(40)
    for steps in (1, 5, 8):
        component, name = composed(monkeypatch, LATE[steps])
        rate, _ = run({"increment": w * H}, component, **{name: 1.0})
        assert rate[steps:, 0] == pytest.approx(w[:-steps, 0], rel=1e-12, abs=1e-14)
        assert rate[:steps, 0] == pytest.approx(w[0, 0], rel=1e-12)


def late_1(context: Vector, rate: Vector, gyro: int, size: float, added: Vector) -> None:
    added[gyro] = added[gyro] + size * (context[PREVIOUS_RATE + gyro] - rate[gyro])


def late_5(context: Vector, rate: Vector, gyro: int, size: float, added: Vector) -> None:
    added[gyro] = added[gyro] + size * (context[PREVIOUS_RATE + 12 + gyro] - rate[gyro])


def late_8(context: Vector, rate: Vector, gyro: int, size: float, added: Vector) -> None:
    added[gyro] = added[gyro] + size * (context[PREVIOUS_RATE + 21 + gyro] - rate[gyro])


LATE = {1: late_1, 5: late_5, 8: late_8}
