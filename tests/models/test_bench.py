"""The exact model of the bench, its targets and its linear regressors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from generator.stands import ALPHA, BETA, random_bench
from trihedron.models.bench import (
    ELEMENTARY,
    TARGETS,
    admissible,
    elementary,
    elementary_reading,
    input_direction,
    input_jacobian,
    nominal_input,
    regressors,
    sign_margin,
    small_turn,
    target_jacobian,
    target_reading,
    target_values,
    up,
    vector_of_rotation,
)
from trihedron.tools.calibration import PRESETS

MOUNTINGS = [
    np.eye(3),
    Rotation.random(rng=np.random.default_rng(1)).as_matrix(),
    Rotation.random(rng=np.random.default_rng(2)).as_matrix(),
]
A, B = np.random.default_rng(3).uniform(0, 2 * np.pi, (2, 40))


def paper_parameters(mounting: np.ndarray) -> np.ndarray:
    """Return X1..X18 (18, 24) as linear functions of the elementary parameters, as the paper defines them."""
    q = mounting
    c12, c13, c23 = (q[i, 0] * q[j, 1] - q[i, 1] * q[j, 0] for i, j in ((0, 1), (0, 2), (1, 2)))
    definitions = {
        1: {"kappa": 1},
        2: {"alpha_offset": 1, "alpha_star": 1},
        3: {"epsilon": 1},
        4: {"scale_error_plus_1": 1, "gravity_error": -1},
        5: {"scale_error_minus_1": 1, "gravity_error": -1},
        6: {"gamma_21": 1, "mounting_error_3": -1, "beta_offset": c12},
        7: {"gamma_31": 1, "mounting_error_2": 1, "beta_offset": c13},
        8: {"gamma_12": 1, "mounting_error_3": 1, "beta_offset": -c12},
        9: {"scale_error_plus_2": 1, "gravity_error": -1},
        10: {"scale_error_minus_2": 1, "gravity_error": -1},
        11: {"gamma_32": 1, "mounting_error_1": -1, "beta_offset": c23},
        12: {"gamma_13": 1, "mounting_error_2": -1, "beta_offset": -c13},
        13: {"gamma_23": 1, "mounting_error_1": 1, "beta_offset": -c23},
        14: {"scale_error_plus_3": 1, "gravity_error": -1},
        15: {"scale_error_minus_3": 1, "gravity_error": -1},
        16: {"bias_1": 1},
        17: {"bias_2": 1},
        18: {"bias_3": 1},
    }
    matrix = np.zeros((18, len(ELEMENTARY)))
    for number, terms in definitions.items():
        for name, factor in terms.items():
            matrix[number - 1, ELEMENTARY.index(name)] = factor
    return matrix


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_regressors_are_the_derivatives_of_the_exact_model_by_all_elementary_parameters(mounting):
    sign = np.sign(nominal_input(A, B, mounting))

    def difference(name, step):
        plus, minus = (elementary_reading(elementary(**{name: s}), A, B, mounting, sign) for s in (step, -step))
        return (plus - minus) / (2 * step)

    linear = regressors(A, B, mounting) @ paper_parameters(mounting)
    for k, name in enumerate(ELEMENTARY):
        richardson = (4 * difference(name, 5e-4) - difference(name, 1e-3)) / 3
        np.testing.assert_allclose(richardson, linear[..., k], rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_symmetric_regressors_add_the_columns_of_both_signs(mounting):
    f, columns = regressors(A, B, mounting, symmetric=True), regressors(A, B, mounting)
    merged = np.delete(columns, [4, 9, 14], axis=-1)
    merged[..., [3, 7, 11]] += columns[..., [4, 9, 14]]
    np.testing.assert_array_equal(f, merged)


@pytest.mark.parametrize("mounting", MOUNTINGS)
@pytest.mark.parametrize("seed", range(3))
def test_eighteen_targets_reproduce_the_reading_of_all_elementary_parameters(mounting, seed):
    bench = random_bench(np.random.default_rng(seed))
    exact = elementary_reading(bench, A, B, mounting)
    np.testing.assert_allclose(
        target_reading(target_values(bench, mounting), A, B, mounting), exact, rtol=0, atol=1e-15
    )


def test_targets_are_those_of_a_lower_triangular_matrix_only():
    with pytest.raises(ValueError, match="gamma_12"):
        target_values(elementary(gamma_12=1e-3), np.eye(3))


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_inputs_agree_with_an_independent_composition_of_rotations(mounting):
    bench = random_bench(np.random.default_rng(7), u=0.1, v=0.3)
    p = dict(zip(ELEMENTARY, bench, strict=True))
    theta = [p[f"mounting_error_{i}"] for i in (1, 2, 3)]
    for k, (alpha, beta) in enumerate(zip(A, B, strict=True)):
        turns = [p["kappa"], alpha - p["alpha_offset"] - p["alpha_star"], p["epsilon"], beta - p["beta_offset"]]
        inner = Rotation.from_euler("YXYZ"[:3], turns[:3]) * Rotation.from_euler("Z", turns[3])
        vertical = inner.inv().apply([0.0, 0.0, 1.0])
        n = Rotation.from_rotvec(theta).inv().apply(mounting @ vertical)
        targets = target_values(bench, mounting)
        ours = input_direction(targets, A[k : k + 1], B[k : k + 1], mounting)[0]
        np.testing.assert_allclose(ours, n, rtol=0, atol=2e-15)


def test_a_perfect_level_block_reads_gravity_on_its_third_axis():
    np.testing.assert_array_equal(elementary_reading(np.zeros(24), [0.0], [0.3], np.eye(3)), [[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(up(np.pi / 2, np.pi / 2), [1.0, 0.0, 0.0], atol=1e-16)


def test_positive_tilt_puts_the_outer_axis_below_the_horizon():
    level_with_outer_axis_along_first = elementary_reading(elementary(kappa=0.01), [0.0], [0.0], np.eye(3))
    assert level_with_outer_axis_along_first[0, 0] == pytest.approx(-np.sin(0.01), abs=1e-16)


@given(st.tuples(*[st.floats(-1.7, 1.7)] * 3))
def test_small_turn_is_a_frame_rotation_and_rotation_vector_its_inverse(theta):
    matrix = small_turn(np.array(theta))
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(theta).inv().as_matrix(), rtol=0, atol=3e-15)
    np.testing.assert_allclose(vector_of_rotation(matrix), theta, rtol=0, atol=3e-13)


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_jacobians_agree_with_differences_at_a_point_far_from_zero(mounting):
    x = target_values(random_bench(np.random.default_rng(5), u=0.03, v=0.1), mounting)
    sign = np.sign(input_direction(x, A, B, mounting))
    step = 1e-5
    for k, name in enumerate(TARGETS):
        up_x, down_x = (x + s * np.eye(18)[k] for s in (step, -step))
        reading = (target_reading(up_x, A, B, mounting, sign) - target_reading(down_x, A, B, mounting, sign)) / (
            2 * step
        )
        direction = (input_direction(up_x, A, B, mounting) - input_direction(down_x, A, B, mounting)) / (2 * step)
        jacobian = target_jacobian(x, A, B, mounting, sign)[..., k]
        np.testing.assert_allclose(jacobian, reading, rtol=0, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(input_jacobian(x, A, B, mounting)[..., k], direction, rtol=0, atol=1e-9)


def test_published_weights_for_x4_are_unbiased_and_cost_2_0549():
    alpha, beta = np.radians([[2, 90, 178, 182, 270, 358], [310, 270, 230, 50, 270, 130]])
    weights = np.array([-0.256867, 0.027469, -0.256867, -0.256867, 1.000000, -0.256867])
    moments = weights @ regressors(alpha, beta, np.eye(3))[:, 0, :]
    np.testing.assert_allclose(moments, np.eye(18)[3], atol=2e-6)
    assert np.abs(weights).sum() == pytest.approx(2.0549378711, abs=2e-6)


def test_sign_is_certain_one_degree_from_the_axes_by_the_printed_rule_and_not_by_the_tables():
    alpha, beta = np.radians([[1.0, 91.0, 9.0], [64.0, 45.0, 9.0]])
    printed, tables = (admissible(alpha, beta, np.eye(3), rule=rule) for rule in ("paper", "tables"))
    assert printed[0, 0]
    assert printed[1, 2]
    assert printed[2, 0]
    assert not tables[[0, 1, 2], [0, 2, 0]].any()
    difference = sign_margin(alpha, beta, np.eye(3), rule="tables") - sign_margin(alpha, beta, np.eye(3))
    np.testing.assert_allclose(difference, 1e-2, atol=1e-17)
    with pytest.raises(ValueError, match="'paper' or 'tables'"):
        sign_margin(alpha, beta, np.eye(3), rule="other")


def test_all_signs_are_certain_at_the_24_positions():
    assert admissible(ALPHA, BETA, np.eye(3)).all()


def test_certain_signs_hold_for_every_bench_within_the_bounds():
    rng = np.random.default_rng(11)
    alpha, beta = rng.uniform(0, 2 * np.pi, (2, 4000))
    for mounting in (PRESETS["identity"], PRESETS["skew"]):
        certain = admissible(alpha, beta, mounting)
        nominal = np.sign(nominal_input(alpha, beta, mounting))
        for _ in range(20):
            x = target_values(random_bench(rng), mounting)
            assert (np.sign(input_direction(x, alpha, beta, mounting)) == nominal)[certain].all()
