"""Scale-factor asymmetry of the gyros: the scale factor depends on the sense of the turn."""

import math

import numpy as np

from ..restricted import Vector
from .definition import gyro_columns, gyro_effect, of_each_gyro, sentence_of


def gyro_scale_asymmetry(
    context: Vector, rate: Vector, coefficient_1: float, coefficient_2: float, coefficient_3: float, added: Vector
) -> None:
    """Add c |ω_p| to the reading of each gyro p."""
    added[0] = added[0] + coefficient_1 * math.fabs(rate[0])
    added[1] = added[1] + coefficient_2 * math.fabs(rate[1])
    added[2] = added[2] + coefficient_3 * math.fabs(rate[2])


EFFECT = gyro_effect(
    gyro_scale_asymmetry,
    of_each_gyro("coefficient", "1", "c of c |ω|: half the difference of the scale factors", 0.05),
    lambda place, rows: gyro_columns(np.abs(rows.rate)),
    sentence_of("the scale factors of the gyros differ between the senses of the turn, c of c |ω|", ""),
    formula="Δω = ({coefficient_1} |ω_1|, {coefficient_2} |ω_2|, {coefficient_3} |ω_3|)",
)
