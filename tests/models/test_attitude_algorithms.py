"""The attitude computer with each of its algorithms: exactness, symmetry, and refusals."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from named import Named
from trihedron.fmus import components
from trihedron.models.attitude_algorithms import ALGORITHMS, MAX_INCREMENT, RANGE_ERROR, Algorithm
from trihedron.models.attitude_algorithms.adaptive import OWN, add_products, is_smooth, place_window

COMPUTER = components()["AttitudeComputer"]
BY_NAME = {a.name: a for a in ALGORITHMS}
every = pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)

# Their formulas change only the sign when γ' and γ'' become -γ'' and -γ'.
TIME_SYMMETRIC = {
    *("two-sample-rodrigues", "mean-rate", "two-sample-quaternion", "two-sample-textbook"),
    *("two-sample-textbook-as-run", "two-sample-rotation-vector", "two-sample-fifth-power"),
    *("panov", "panov-series", "panov-cut-off", "four-sample-rotation-vector"),
    *("three-sample-uncompressed", "four-sample-uncompressed"),
    *(a.name for a in ALGORITHMS if a.kernel.__name__.endswith("_iteration")),
}

# Angular rate as a cubic polynomial of time [rad/s].
RATES = np.array([[0.9, -0.4, 0.7], [0.5, 1.1, -0.6], [-1.2, 0.3, 0.8], [0.4, -0.9, 0.5]])


def increments(count: int, span: float = 1.0) -> np.ndarray:
    """Return increments (count, 3) of the polynomial rate over equal parts of `span` seconds."""
    times = np.linspace(0.0, span, count + 1)
    powers = np.array([times ** (k + 1) / (k + 1) for k in range(4)]).T
    return np.diff(powers @ RATES, axis=0)


def computer(algorithm: Algorithm, **parameters) -> Named:
    """Return a computer that is ready to step."""
    return Named(COMPUTER, algorithm=algorithm.number, **parameters).begin()


def feed(model: Named, gamma, begin: float, step: float) -> Named:
    """Feed one increment over (begin, begin + step]."""
    return model.put(increment=gamma).step(begin, step)


def refused(model: Named, gamma, begin: float = 0.0, step: float = 0.1) -> str:
    """Return the refusal of an increment; assert that the attitude stays."""
    before = model["attitude"].tolist()
    message = model.put(increment=gamma).refuses_step(begin, step)
    assert model["attitude"].tolist() == before
    return message


def carry(gammas: np.ndarray, algorithm: Algorithm, step: float = 0.01, **parameters: float) -> np.ndarray:
    """Return the attitude after all increments, from the identity."""
    model = computer(algorithm, **parameters)
    for k, gamma in enumerate(gammas):
        feed(model, gamma, k * step, step)
    assert model["updated"] == 1.0
    return model["attitude"]


def rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


def distance(p: np.ndarray, q: np.ndarray) -> float:
    """Return the angle between two attitudes [rad]."""
    return float((rotation(p).inv() * rotation(q)).magnitude())


def test_the_catalogue_names_each_algorithm_once_by_number() -> None:
    assert [a.number for a in ALGORITHMS] == list(range(1, len(ALGORITHMS) + 1))
    assert len(BY_NAME) == len(ALGORITHMS)
    assert (ALGORITHMS[0].name, ALGORITHMS[1].name) == ("two-sample-rodrigues", "mean-rate")
    assert next(v for v in COMPUTER.variables if v.name == "algorithm").items == tuple(BY_NAME)
    paper = {a.source.split("2016, ")[1] for a in ALGORITHMS if "et al. 2016, (" in a.source}
    assert {"(7.18)", "(7.20)", "(7.22)", "(19)", "(20)", "(21)", "(22)", "(23)", "(24), (25)"} <= paper


@every
def test_an_update_comes_with_the_last_sample_of_a_step(algorithm: Algorithm) -> None:
    model = computer(algorithm)
    outputs = []
    for k, gamma in enumerate(0.05 * increments(24)):
        feed(model, gamma, 0.1 * k, 0.1)
        outputs.append(model["updated"] == 1.0)
    assert outputs == [(k + 1) % algorithm.samples == 0 for k in range(24)]


@every
@example(drift=(0.005859375, -0.010620327846713337, -0.0078125), seed=1)
@settings(max_examples=15)
@given(st.tuples(*[st.floats(-0.03, 0.03)] * 3), st.integers(0, 10**6))
def test_turning_the_body_frame_turns_the_answer(algorithm: Algorithm, drift: tuple, seed: int) -> None:
    """Increments seen in a frame turned by r give the attitude turned by r."""
    r = Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
    gammas = increments(2 * algorithm.samples, 0.02 * algorithm.samples) + np.array(drift)
    plain = rotation(carry(gammas, algorithm))
    turned = rotation(carry(r.inv().apply(gammas), algorithm))
    assert (turned.inv() * (r.inv() * plain * r)).magnitude() < 1e-14


@every
def test_running_back_returns_where_the_formula_is_symmetric_in_time(algorithm: Algorithm) -> None:
    gammas = increments(4 * algorithm.samples, 0.05 * algorithm.samples)
    there_and_back = np.vstack((gammas, -gammas[::-1]))
    remainder = distance(carry(there_and_back, algorithm), np.array([1.0, 0.0, 0.0, 0.0]))
    if algorithm.name in TIME_SYMMETRIC:
        assert remainder < 2e-14
    elif algorithm.name == "adaptive-degree":
        # The turn back is a kink in the rate: the degree falls after it, not before it.
        assert remainder < 1e-8
    else:
        assert remainder > 1e-9


@every
def test_a_constant_rate_is_exact_where_that_is_stated(algorithm: Algorithm) -> None:
    gamma = 0.9 * algorithm.max_increment * np.array([0.3, -0.4, 1.2]) / 1.3
    count = 6 * algorithm.samples
    q = carry(np.tile(gamma, (count, 1)), algorithm)
    true = Rotation.from_rotvec(count * gamma)
    error = (rotation(q).inv() * true).magnitude()
    if algorithm.constant_rate:
        assert error < 1e-12
    else:
        assert error > 1e-5


@every
def test_the_valid_range_is_where_one_update_errs_by_what_is_stated(algorithm: Algorithm) -> None:
    """Test between two updates at a constant rate, so that the previous step is known."""
    direction = np.array([2.0, -3.0, 6.0]) / 7.0

    def error(size: float) -> float:
        model = computer(algorithm)
        attitudes = []
        for k in range(2 * algorithm.samples):
            feed(model, size * direction, 0.1 * k, 0.1)
            if model["updated"] == 1.0:
                attitudes.append(rotation(model["attitude"]))
        turn = attitudes[0].inv() * attitudes[1]
        return float((turn.inv() * Rotation.from_rotvec(algorithm.samples * size * direction)).magnitude())

    if algorithm.constant_rate:
        assert error(algorithm.max_increment * (1 - 1e-12)) < 2e-13
    else:
        assert 0.85 * RANGE_ERROR < error(algorithm.max_increment * (1 - 1e-12)) <= RANGE_ERROR


@every
def test_beyond_the_valid_range_is_refused_by_name(algorithm: Algorithm) -> None:
    size = algorithm.max_increment * 1.0001
    expected = "half a turn" if size > MAX_INCREMENT else f"{algorithm.name} {algorithm.max_increment:.3g}"
    assert expected in refused(computer(algorithm), (0.0, 0.0, size))


@every
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 3.2, 1e300])
def test_what_is_no_increment_is_refused_and_changes_nothing(algorithm: Algorithm, bad: float) -> None:
    assert "half a turn" in refused(computer(algorithm), (0.0, bad, 0.0))


@every
def test_tiny_and_zero_increments_leave_a_unit_quaternion(algorithm: Algorithm) -> None:
    count = 4 * algorithm.samples
    for size in (0.0, 5e-324, 1e-300, 1e-160, 1e-9):
        q = carry(np.full((count, 3), size), algorithm)
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
        half = 0.5 * count * size
        if algorithm.name == "one-sample-rodrigues-symmetric" or size > 5e-324:
            assert q[1] == pytest.approx(half, rel=1e-11)


@every
@pytest.mark.parametrize(
    ("begin", "step"),
    [pytest.param(0.2, 0.1, id="a dropped sample"), pytest.param(0.0, 0.1, id="a repeated time"), (0.1, 0.2)],
)
def test_a_time_that_does_not_follow_is_refused(algorithm: Algorithm, begin: float, step: float) -> None:
    model = computer(algorithm, sample_period=0.1)
    feed(model, (0.01, 0.0, 0.0), 0.0, 0.1)
    assert "one increment for each sample" in refused(model, (0.01, 0.0, 0.0), begin, step)


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0, 0.0), (0.7, 0.7, 0.7, 0.7)])
def test_a_quaternion_off_the_unit_sphere_is_refused(off: tuple) -> None:
    assert "not a unit quaternion" in Named(COMPUTER, initial_attitude=off).refuses_to_begin()


def test_a_quaternion_a_little_off_the_unit_sphere_is_brought_back() -> None:
    model = computer(BY_NAME["mean-rate"], initial_attitude=(0.6004, 0.0, 0.8, 0.0))
    assert np.linalg.norm(model["attitude"]) == pytest.approx(1.0, abs=1e-15)


@every
def test_without_renormalising_only_cut_off_series_leave_the_unit_sphere(algorithm: Algorithm) -> None:
    angle = 0.3 * np.arange(20 * algorithm.samples)
    gammas = 0.06 * np.column_stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)))
    off = abs(np.linalg.norm(carry(gammas, algorithm, renormalise=0.0)) - 1.0)
    if algorithm.norm_order is None:
        assert off < 1e-13
    else:
        assert off > 1e-10
    assert abs(np.linalg.norm(carry(gammas, algorithm)) - 1.0) < 1e-15


def test_one_update_of_22_by_hand() -> None:
    """Equation (22) with γ' = (0.1, 0, 0), γ'' = (0, 0.2, 0)."""
    x = np.array([(0.25 + 0.01 / 48) * 0.1, (0.25 + 0.04 / 48) * 0.2, 0.1 * 0.2 / 6])
    expected = np.array([1 - x @ x, *(2 * x)]) / (1 + x @ x)
    result = carry(np.array([[0.1, 0, 0], [0, 0.2, 0]]), ALGORITHMS[0])
    assert result == pytest.approx(expected, abs=2e-16)


def test_one_update_of_panov_by_hand() -> None:
    """Equation (24) with increments along 1, 2, 1, 2: (22/45)(g1 + g2) x (g3 + g4) is zero here, (32/45) is not."""
    g = np.array([[0.1, 0, 0], [0, 0.1, 0], [0.1, 0, 0], [0, 0.1, 0]])
    expected = Rotation.from_rotvec([0.2, 0.2, 2 * 32 / 45 * 0.01])
    assert (rotation(carry(g, BY_NAME["panov"])).inv() * expected).magnitude() < 1e-15


def test_increments_of_no_smooth_rate_are_a_verdict_not_a_number() -> None:
    model = computer(BY_NAME["functional-iteration-8"])
    for k in range(7):
        feed(model, (0.0, 0.0, 0.36 * (-1) ** k), 0.1 * k, 0.1)
    assert "smooth rate" in model.put(increment=(0.0, 0.0, -0.36)).refuses_step(0.7, 0.1)
    # The algorithm that chooses its degree takes them two at a time.
    alternating = np.array([(0.0, 0.0, 0.36 * (-1) ** k) for k in range(8)])
    assert distance(carry(alternating, BY_NAME["adaptive-degree"]), np.array([1.0, 0.0, 0.0, 0.0])) < 1e-15


def smooth(gammas: np.ndarray) -> int:
    flat, space = gammas.ravel().tolist(), [0.0] * 96
    place_window(flat[:24], flat[24:], OWN, space)
    return is_smooth(1.0, OWN, math.pi, space)


@given(st.integers(0, 10**6))
def test_eight_at_a_time_are_taken_of_a_smooth_rate_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    slow = 0.01 * np.outer(np.sin(0.1 * np.arange(16) + rng.uniform(0, 6)), axis)
    assert smooth(slow)
    noise = rng.normal(size=(16, 3))
    assert not smooth(slow + 1e-3 * noise)
    assert not smooth(slow + 1e-3 * np.outer(np.sin(2.5 * np.arange(16)), axis))
    assert smooth(np.tile(axis * 0.01, (16, 1)))
    # The differences contain only rounding.
    assert smooth(0.01 * np.outer(1.0 + 1e-5 * np.arange(16) / 7.0, axis))
    # One polynomial gets no more than half a turn.
    assert not smooth(np.tile(0.5 * axis / np.linalg.norm(axis), (16, 1)))


def test_products_with_the_eight_before_carry_every_cone_and_every_slow_rate() -> None:
    def products(rates: Callable[[float], np.ndarray]) -> np.ndarray:
        """Return the products of the last of 16 increments of two rates."""
        pairs = np.array([rates(float(k)) for k in range(-15, 1)])
        space, result = [0.0] * 96, [0.0] * 4
        place_window(pairs[:8].ravel().tolist(), pairs[8:].ravel().tolist(), OWN, space)
        add_products(OWN + 15, OWN + 15, space, result)
        return np.array(result[1:])

    for phase in (0.05, 0.3, 0.8, 1.2, 1.57, 1.8):
        # In the mean over the turn, differences from step to step cancel.
        begins = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        cones = (lambda k, p=phase, c=c: np.array([math.cos(p * k + c), math.sin(p * k + c), 0.0]) for c in begins)
        motion = np.mean([products(cone)[2] for cone in cones])
        assert motion * 4.0 * math.sin(phase / 2.0) ** 2 == pytest.approx((phase - math.sin(phase)) / 2.0, rel=4.1e-5)
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2)):

        def of_powers(k: float, a: int = a, b: int = b) -> np.ndarray:
            return np.array([*(((k + 1.0) ** (n + 1) - k ** (n + 1)) / (n + 1) for n in (a, b)), 0.0])

        # Half the integral of α × ω over the step, for ω = (t^a, t^b, 0).
        exact = 0.5 * (1.0 / (a + 1) - 1.0 / (b + 1)) / (a + b + 2)
        assert products(of_powers)[2] == pytest.approx(exact, abs=1e-11)


@every
def test_three_radians_in_a_sample_are_exact_or_refused(algorithm: Algorithm) -> None:
    model = computer(algorithm)
    if algorithm.name == "mean-rate":
        feed(model, (0.0, 3.0, 0.0), 0.0, 0.1)
        assert distance(model["attitude"], np.array([math.cos(1.5), 0.0, math.sin(1.5), 0.0])) < 1e-15
    else:
        assert "valid range" in refused(model, (0.0, 3.0, 0.0))
