"""Anisoelasticity of the gyros: a bias that depends on the product of two components of the specific force."""

from ..restricted import INPUT, Vector
from .definition import EffectParameter, gyro_effect, matrix_columns, matrix_formula, sentence_of

PRODUCTS = ((1, 2), (1, 3), (2, 3))
"""The two axes of each product, in the order of the parameters."""


def gyro_g_squared(
    context: Vector,
    rate: Vector,
    coefficient_1_12: float,
    coefficient_1_13: float,
    coefficient_1_23: float,
    coefficient_2_12: float,
    coefficient_2_13: float,
    coefficient_2_23: float,
    coefficient_3_12: float,
    coefficient_3_13: float,
    coefficient_3_23: float,
    added: Vector,
) -> None:
    """Add c n_i n_j for each gyro and each pair of axes, with the inputs n of the accelerometers in g."""
    xy = context[INPUT] * context[INPUT + 1]
    xz = context[INPUT] * context[INPUT + 2]
    yz = context[INPUT + 1] * context[INPUT + 2]
    added[0] = added[0] + coefficient_1_12 * xy + coefficient_1_13 * xz + coefficient_1_23 * yz
    added[1] = added[1] + coefficient_2_12 * xy + coefficient_2_13 * xz + coefficient_2_23 * yz
    added[2] = added[2] + coefficient_3_12 * xy + coefficient_3_13 * xz + coefficient_3_23 * yz


EFFECT = gyro_effect(
    gyro_g_squared,
    tuple(
        EffectParameter(
            f"coefficient_{p}_{i}{j}",
            "rad/s/g2",
            f"c of c n_i n_j: bias of gyro {p} by the product of axes {i}, {j}",
            0.05,
        )
        for p in (1, 2, 3)
        for i, j in PRODUCTS
    ),
    lambda place, rows: matrix_columns(
        rows.specific_force[:, [i - 1 for i, _ in PRODUCTS]] * rows.specific_force[:, [j - 1 for _, j in PRODUCTS]]
    ),
    sentence_of("the biases of the gyros depend on products of two specific forces, gyro by gyro", "rad/s for each g²"),
    formula=f"Δω = {matrix_formula('coefficient', ('_12', '_13', '_23'))} (n_1 n_2, n_1 n_3, n_2 n_3) 'rad/s'",
)
