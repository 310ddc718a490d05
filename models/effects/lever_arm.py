"""Size effect: an accelerometer that is not at the block's centre feels the block's turning."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import ANGULAR_ACCELERATION, GRAVITY, RATE, Vector
from .definition import (
    Effect,
    EffectParameter,
    EffectPlace,
    accelerometer_number,
    all_coefficients,
    on_accelerometers,
)
from .motion_rows import MotionRows


def lever_arm(context: Vector, n: Vector, p: int, r_1: float, r_2: float, r_3: float, added: Vector) -> None:
    """Add component p of ω × (ω × r) + ω' × r, over g, to the reading of accelerometer p.

    Source: P. Savage, "Strapdown inertial navigation integration algorithm design", part 2, 1998: the size effect.
    """
    x = context[RATE]
    y = context[RATE + 1]
    z = context[RATE + 2]
    along = x * r_1 + y * r_2 + z * r_3
    square = x * x + y * y + z * z
    arm = r_1
    axis = x
    turned = context[ANGULAR_ACCELERATION + 1] * r_3 - context[ANGULAR_ACCELERATION + 2] * r_2
    if p == 1:
        arm = r_2
        axis = y
        turned = context[ANGULAR_ACCELERATION + 2] * r_1 - context[ANGULAR_ACCELERATION] * r_3
    if p == 2:
        arm = r_3
        axis = z
        turned = context[ANGULAR_ACCELERATION] * r_2 - context[ANGULAR_ACCELERATION + 1] * r_1
    added[p] = added[p] + (axis * along - square * arm + turned) / context[GRAVITY]


def signature(place: EffectPlace, rows: MotionRows) -> NDArray[np.float64]:
    """Signature (N, 3, 3) in g for each metre of the arm: row p of ω ωᵀ − |ω|² + [ω' ×], over g."""
    w, p = rows.rate, place.index
    acceleration = (w - rows.rate_before) / rows.step[:, None]
    columns = np.zeros((len(w), 3, 3))
    columns[:, p] = w[:, p, None] * w
    columns[:, p, p] -= (w**2).sum(axis=1)
    # ω' × e_k, its component p.
    columns[:, p] += np.cross(acceleration[:, None, :], np.eye(3))[:, :, p]
    return columns / rows.gravity


EFFECT = Effect(
    name="lever-arm",
    places=on_accelerometers("lever-arm"),
    parameters=tuple(
        EffectParameter(f"r_{k}", "m", f"position of the accelerometer along axis {k}, from the block's centre", 0.5)
        for k in (1, 2, 3)
    ),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=lever_arm,
    place_numbers=accelerometer_number,
    signature=signature,
    from_coefficients=all_coefficients,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} is off the block's centre: "
        + ", ".join(f"{1e3 * value:+.1f}" for value in values.values())
        + " mm along the axes"
    ),
    in_motion=True,
)
