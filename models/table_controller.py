"""Feedback from a computed attitude to the commands of a two-axis table: the block holds its attitude in space.

The rotation vector from the initial to the computed attitude, seen along each axis of the table, turns that axis back
at a rate of the gain times the error. What neither axis can turn is left as it is.
"""

import math

from .restricted import Vector

NORM_TOLERANCE = 1e-3


def square(quaternion: Vector) -> float:
    """Square of the norm of a quaternion (4,)."""
    total = 0.0
    for k in range(4):
        total = total + quaternion[k] * quaternion[k]
    return total


def initialise(initial_command: Vector, initial_attitude: Vector, held: Vector, command: Vector) -> int:
    """Begin with the table where it stands; 1 when the initial attitude is no unit quaternion."""
    if not math.fabs(square(initial_attitude) - 1.0) <= 2.0 * NORM_TOLERANCE:
        return 1
    for axis in range(2):
        held[axis] = initial_command[axis]
        command[axis] = held[axis]
    return 0


def step(
    attitude: Vector,
    inner_angle: float,
    initial_attitude: Vector,
    gain: float,
    held: Vector,
    command: Vector,
    step: float,
) -> int:
    """Turn both commands back by what the block is off.

    Parameters
    ----------
    attitude, initial_attitude : (4,)
        body to reference, scalar first; the body's axis 3 is the inner axis
    inner_angle : float
        angle of the inner axis [rad]: where the outer axis stands in the body
    gain : float
        [1/s]
    held, command : (2,)
        commands [rad], changed
    step : float
        length of the step [s]

    Returns
    -------
    int
        2 when the attitude is zero or not finite, else 0
    """
    norm = math.sqrt(square(attitude))
    if not norm > 0.0:
        return 2
    if norm - norm != 0.0:
        return 2
    # Vector part of conj(initial) ∘ attitude: half the rotation vector, to third order.
    x = initial_attitude[0] * attitude[1] - initial_attitude[1] * attitude[0]
    x = x - initial_attitude[2] * attitude[3] + initial_attitude[3] * attitude[2]
    y = initial_attitude[0] * attitude[2] - initial_attitude[2] * attitude[0]
    y = y - initial_attitude[3] * attitude[1] + initial_attitude[1] * attitude[3]
    z = initial_attitude[0] * attitude[3] - initial_attitude[3] * attitude[0]
    z = z - initial_attitude[1] * attitude[2] + initial_attitude[2] * attitude[1]
    scalar = 0.0
    for k in range(4):
        scalar = scalar + initial_attitude[k] * attitude[k]
    twice = 2.0 / norm
    if scalar < 0.0:
        twice = -twice
    share = gain * step
    # The outer axis in body axes is (cos β, −sin β, 0).
    held[0] = held[0] - share * twice * (x * math.cos(inner_angle) - y * math.sin(inner_angle))
    held[1] = held[1] - share * twice * z
    for axis in range(2):
        command[axis] = held[axis]
    return 0
