"""Bias of the gyros that depends on the specific force."""

from ..restricted import INPUT, Vector
from .definition import gyro_effect, matrix_columns, matrix_formula, of_a_matrix, sentence_of


def gyro_g_sensitivity(
    context: Vector,
    rate: Vector,
    coefficient_11: float,
    coefficient_12: float,
    coefficient_13: float,
    coefficient_21: float,
    coefficient_22: float,
    coefficient_23: float,
    coefficient_31: float,
    coefficient_32: float,
    coefficient_33: float,
    added: Vector,
) -> None:
    """Add G n, with the inputs n of the accelerometers in g."""
    x = context[INPUT]
    y = context[INPUT + 1]
    z = context[INPUT + 2]
    added[0] = added[0] + coefficient_11 * x + coefficient_12 * y + coefficient_13 * z
    added[1] = added[1] + coefficient_21 * x + coefficient_22 * y + coefficient_23 * z
    added[2] = added[2] + coefficient_31 * x + coefficient_32 * y + coefficient_33 * z


EFFECT = gyro_effect(
    gyro_g_sensitivity,
    of_a_matrix("coefficient", "rad/s/g", "bias for each g of specific force", 0.05),
    lambda place, rows: matrix_columns(rows.specific_force),
    sentence_of("the biases of the gyros depend on the specific force, row by row", "rad/s for each g"),
    formula=f"Δω = {matrix_formula('coefficient', '123')} n 'rad/s'",
)
