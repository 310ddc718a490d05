"""Scale factors and misalignment of the gyros."""

from ..restricted import Vector
from .definition import gyro_effect, matrix_columns, matrix_formula, of_a_matrix, sentence_of


def gyro_scale_misalignment(
    context: Vector,
    rate: Vector,
    gamma_11: float,
    gamma_12: float,
    gamma_13: float,
    gamma_21: float,
    gamma_22: float,
    gamma_23: float,
    gamma_31: float,
    gamma_32: float,
    gamma_33: float,
    added: Vector,
) -> None:
    """Add Γ ω."""
    added[0] = added[0] + gamma_11 * rate[0] + gamma_12 * rate[1] + gamma_13 * rate[2]
    added[1] = added[1] + gamma_21 * rate[0] + gamma_22 * rate[1] + gamma_23 * rate[2]
    added[2] = added[2] + gamma_31 * rate[0] + gamma_32 * rate[1] + gamma_33 * rate[2]


EFFECT = gyro_effect(
    gyro_scale_misalignment,
    of_a_matrix("gamma", "1", "Γ: response", 0.2),
    lambda place, rows: matrix_columns(rows.rate),
    sentence_of("the gyros have errors of scale (diagonal) and misalignment, row by row", ""),
    formula=f"Δω = {matrix_formula('gamma', '123')} ω",
)
