"""Sums of products of increments, and the quaternion of a step from tan(φ/4) e or from the rotation vector φ e.

Increments lie in flat arrays, sample after sample: increment i of `g` is g[3 * i] .. g[3 * i + 2].
"""

import math

from ..restricted import Vector


def dot(a: Vector, i: int, b: Vector, j: int) -> float:
    """Scalar product of increment i of `a` and increment j of `b`."""
    return a[3 * i] * b[3 * j] + a[3 * i + 1] * b[3 * j + 1] + a[3 * i + 2] * b[3 * j + 2]


def add_cross(factor: float, a: Vector, i: int, b: Vector, j: int, result: Vector) -> None:
    """Add `factor` times the vector product of increment i of `a` and increment j of `b` to result[1..3]."""
    x = a[3 * i]
    y = a[3 * i + 1]
    z = a[3 * i + 2]
    u = b[3 * j]
    v = b[3 * j + 1]
    w = b[3 * j + 2]
    result[1] = result[1] + factor * (y * w - z * v)
    result[2] = result[2] + factor * (z * u - x * w)
    result[3] = result[3] + factor * (x * v - y * u)


def add_increment(factor: float, a: Vector, i: int, result: Vector) -> None:
    """Add `factor` times increment i of `a` to result[1..3]."""
    for k in range(3):
        result[1 + k] = result[1 + k] + factor * a[3 * i + k]


def clear(result: Vector) -> None:
    """Write zeros into `result` (4,)."""
    for k in range(4):
        result[k] = 0.0


def sum_of_increments(g: Vector, count: int, result: Vector) -> None:
    """Write zero and the sum of the first `count` increments into `result` (4,)."""
    clear(result)
    for i in range(count):
        add_increment(1.0, g, i, result)


def square_of_vector(q: Vector) -> float:
    """Square of the length of q[1..3]."""
    return q[1] * q[1] + q[2] * q[2] + q[3] * q[3]


def scale_vector(factor: float, q: Vector) -> None:
    """Multiply q[1..3] by a factor."""
    for k in range(3):
        q[1 + k] = factor * q[1 + k]


def complete_rodrigues(q: Vector) -> None:
    """Turn x = tan(φ/4) e in q[1..3] into the quaternion λ* = ((1 - x·x), 2x) / (1 + x·x), in place."""
    square = square_of_vector(q)
    scale = 1.0 / (1.0 + square)
    q[0] = (1.0 - square) * scale
    scale_vector(2.0 * scale, q)


def complete_rotation_vector(q: Vector) -> None:
    """Turn the rotation vector φ in q[1..3] into λ* = (cos(φ/2), φ sin(φ/2)/|φ|), in place: equation (25)."""
    angle = math.sqrt(square_of_vector(q))
    half = 0.5 * angle
    if angle < 1e-4:
        scale = 0.5 - half * half / 12.0
    else:
        scale = math.sin(half) / angle
    q[0] = math.cos(half)
    scale_vector(scale, q)


def complete_rotation_vector_by_series(q: Vector) -> None:
    """Turn the rotation vector in q[1..3] into a quaternion by the series of (25) to the fifth power, in place."""
    square = square_of_vector(q)
    q[0] = 1.0 - square / 8.0 + square * square / 384.0
    scale_vector(0.5 - square / 48.0 + square * square / 3840.0, q)
