"""Size effect: an accelerometer that is not at the block's centre feels the block's turning."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import ANGULAR_ACCELERATION, GRAVITY, RATE, Vector
from .definition import EffectParameter, EffectPlace, accelerometer_effect
from .rows import MotionRows


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


def values(place: EffectPlace, rows: MotionRows) -> NDArray[np.float64]:
    """What a metre of the arm adds (N, 3) [g]: row p of ω ωᵀ − |ω|² + [ω' ×], over g."""
    w, p = rows.rate, place.index
    acceleration = (w - rows.rate_before) / rows.step[:, None]
    columns = w[:, p, None] * w
    columns[:, p] -= (w**2).sum(axis=1)
    # ω' × e_k, its component p.
    columns += np.cross(acceleration[:, None, :], np.eye(3))[:, :, p]
    return columns / rows.gravity


EFFECT = accelerometer_effect(
    lever_arm,
    tuple(
        EffectParameter(f"r_{k}", "m", f"position of the accelerometer along axis {k}, from the block's centre", 0.5)
        for k in (1, 2, 3)
    ),
    values,
    lambda place, values: (
        f"accelerometer {place.index + 1} is off the block's centre: "
        + ", ".join(f"{1e3 * value:+.1f}" for value in values.values())
        + " mm along the axes"
    ),
    in_motion=True,
)
