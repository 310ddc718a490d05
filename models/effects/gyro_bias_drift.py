"""Bias of the gyros that grows with time."""

import numpy as np

from ..restricted import HOURS, Vector
from .definition import gyro_columns, gyro_effect, of_each_gyro, sentence_of


def gyro_bias_drift(context: Vector, rate: Vector, rate_1: float, rate_2: float, rate_3: float, added: Vector) -> None:
    """Add rate·hours to each gyro's reading; the rates are in rad/s an hour."""
    added[0] = added[0] + rate_1 * context[HOURS]
    added[1] = added[1] + rate_2 * context[HOURS]
    added[2] = added[2] + rate_3 * context[HOURS]


EFFECT = gyro_effect(
    gyro_bias_drift,
    of_each_gyro("rate", "rad/s/h", "growth of the bias", 0.5),
    lambda place, rows: gyro_columns(np.repeat(rows.hours[:, None], 3, axis=1)),
    sentence_of("the biases of the gyros drift", "rad/s an hour"),
    formula="Δω = ({rate_1}, {rate_2}, {rate_3}) t 'rad/s', t 'in hours'",
)
