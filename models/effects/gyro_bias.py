"""Bias of the gyros: what they read at no rate."""

import numpy as np

from ..restricted import Vector
from .definition import gyro_columns, gyro_effect, of_each_gyro, sentence_of


def gyro_bias(context: Vector, rate: Vector, bias_1: float, bias_2: float, bias_3: float, added: Vector) -> None:
    """Add a constant [rad/s] to each gyro's reading."""
    added[0] = added[0] + bias_1
    added[1] = added[1] + bias_2
    added[2] = added[2] + bias_3


EFFECT = gyro_effect(
    gyro_bias,
    of_each_gyro("bias", "rad/s", "bias", 0.2),
    lambda place, rows: gyro_columns(np.ones_like(rows.rate)),
    sentence_of("the gyros have a constant bias", "rad/s"),
    formula="Δω = ({bias_1}, {bias_2}, {bias_3}) 'rad/s'",
)
