"""Hysteresis of an accelerometer: its reading lags the last change of its input."""

from trihedron.models.effects.definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)
from trihedron.models.restricted import SENSE_INPUT, Vector


def hysteresis(context: Vector, n: Vector, p: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of accelerometer p; the sense is that of the last change of its input."""
    added[p] = added[p] - 0.5 * width * context[SENSE_INPUT + p]


EFFECT = Effect(
    name="hysteresis",
    places=on_accelerometers("hysteresis"),
    parameters=(
        EffectParameter(
            "width", "g", "difference between readings after falling and after rising input", 1e-2, smallest=0.0
        ),
    ),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=hysteresis,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, -0.5 * rows.input_sense[:, place.index]),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} reads {values['width']:.2e} g less after a rising input than after a "
        "falling one"
    ),
)
