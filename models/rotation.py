"""Rotations as quaternions, scalar first: q takes body components to the reference, v_ref = q v_body q*.

The second half makes the quaternion of a step from sums of products of increments: by tan(φ/4) e or the rotation vector
φ e. Increments lie in flat arrays, sample after sample: increment i of `g` is g[3 * i] .. g[3 * i + 2].
"""

import math

from .restricted import Vector

SMALL_RATIO = 0.0078125
"""Up to this tangent of half an angle a short series has all its bits."""
MAX_INCREMENT = math.pi
"""Largest increment over one sample [rad] for any algorithm: beyond half a turn its direction is ambiguous."""


def set_quaternion(w: float, x: float, y: float, z: float, result: Vector) -> None:
    """Write four numbers into a quaternion (4,)."""
    result[0] = w
    result[1] = x
    result[2] = y
    result[3] = z


def multiply(p: Vector, q: Vector, result: Vector) -> None:
    """Quaternion product p ∘ q; `result` (4,) may be one of the factors."""
    set_quaternion(
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        result,
    )


def turn(q: Vector, axis: int, angle: float, factor: Vector) -> None:
    """Turn the frame further by `angle` [rad] about its own axis 0, 1 or 2: q becomes q ∘ (cos, sin) of the half angle.

    `factor` (4,) is working space.
    """
    set_quaternion(math.cos(0.5 * angle), 0.0, 0.0, 0.0, factor)
    factor[1 + axis] = math.sin(0.5 * angle)
    multiply(q, factor, q)


def turn_by_vector(q: Vector, x: float, y: float, z: float, factor: Vector) -> None:
    """Turn the frame further by the rotation vector (x, y, z) [rad]; the frame rotation is exp(-[v×])."""
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    if angle < 1e-5:
        scale = 0.5 - half * half / 12.0
    else:
        scale = math.sin(half) / angle
    set_quaternion(math.cos(half), x * scale, y * scale, z * scale, factor)
    multiply(q, factor, q)


def to_body(q: Vector, x: float, y: float, z: float, result: Vector) -> None:
    """Components in the body of a vector (x, y, z) given in the reference: q* v q; `result` (3,)."""
    tx = 2.0 * (q[3] * y - q[2] * z)
    ty = 2.0 * (q[1] * z - q[3] * x)
    tz = 2.0 * (q[2] * x - q[1] * y)
    result[0] = x + q[0] * tx + (q[3] * ty - q[2] * tz)
    result[1] = y + q[0] * ty + (q[1] * tz - q[3] * tx)
    result[2] = z + q[0] * tz + (q[2] * tx - q[1] * ty)


def to_reference(q: Vector, x: float, y: float, z: float, result: Vector) -> None:
    """Components in the reference of a vector (x, y, z) given in the body: q v q*; `result` (3,)."""
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    result[0] = x + q[0] * tx + (q[2] * tz - q[3] * ty)
    result[1] = y + q[0] * ty + (q[3] * tx - q[1] * tz)
    result[2] = z + q[0] * tz + (q[1] * ty - q[2] * tx)


def normalise(q: Vector) -> None:
    """Bring a quaternion (4,) back to the unit sphere."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] = q[i] * scale


def compare(p: Vector, q: Vector, result: Vector) -> None:
    """Write sine and cosine of half the angle between the attitudes p and q, times their norms, into `result` (2,)."""
    x = p[0] * q[1] - q[0] * p[1] - (p[2] * q[3] - p[3] * q[2])
    y = p[0] * q[2] - q[0] * p[2] - (p[3] * q[1] - p[1] * q[3])
    z = p[0] * q[3] - q[0] * p[3] - (p[1] * q[2] - p[2] * q[1])
    result[0] = math.sqrt(x * x + y * y + z * z)
    result[1] = math.fabs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3])


def high_half(value: float) -> float:
    """Return the upper 26 bits of a number; the product of two such halves is exact."""
    scaled = 134217729.0 * value
    return scaled - (scaled - value)


def small_angle(sine: float, cosine: float) -> float:
    """Return the angle 2 atan(sine / cosine) [rad] of a ratio below `SMALL_RATIO`.

    The quotient with its low part, and the series: of a million angles about one is not the nearest double.
    """
    ratio = sine / cosine
    a = high_half(ratio)
    b = high_half(cosine)
    product = ratio * cosine
    below = ((a * b - product) + a * (cosine - b) + (ratio - a) * b) + (ratio - a) * (cosine - b)
    low = ((sine - product) - below) / cosine
    square = ratio * ratio
    series = square * (-1.0 / 3.0 + square * (0.2 + square * (-1.0 / 7.0 + square * (1.0 / 9.0))))
    return 2.0 * (ratio + (low + ratio * series))


def angle_of_half(sine: float, cosine: float) -> float:
    """Return the angle 2 atan2(sine, cosine) [rad] of numbers that are not negative."""
    if sine < SMALL_RATIO * cosine:
        return small_angle(sine, cosine)
    return 2.0 * math.atan2(sine, cosine)


def quaternion_of_matrix(r: Vector, result: Vector) -> None:
    """Quaternion of the frame whose direction-cosine matrix is r: χ_body = r χ_ref, row by row (9,).

    The largest of the four squared components is found first, so that nothing is divided by a small number.
    """
    trace = r[0] + r[4] + r[8]
    if trace >= r[0] and trace >= r[4] and trace >= r[8]:
        set_quaternion(1.0 + trace, r[5] - r[7], r[6] - r[2], r[1] - r[3], result)
    elif r[0] >= r[4] and r[0] >= r[8]:
        set_quaternion(r[5] - r[7], 1.0 + r[0] - r[4] - r[8], r[1] + r[3], r[2] + r[6], result)
    elif r[4] >= r[8]:
        set_quaternion(r[6] - r[2], r[1] + r[3], 1.0 + r[4] - r[0] - r[8], r[5] + r[7], result)
    else:
        set_quaternion(r[1] - r[3], r[2] + r[6], r[5] + r[7], 1.0 + r[8] - r[0] - r[4], result)
    normalise(result)


def is_rotation(r: Vector) -> float:
    """1.0 when the matrix (9,) is orthogonal with determinant +1 to 1e-6, else 0.0."""
    proper = 1.0
    for i in range(3):
        for j in range(3):
            product = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2]
            expected = 0.0
            if i == j:
                expected = 1.0
            if not math.fabs(product - expected) <= 1e-6:
                proper = 0.0
    determinant = (
        r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6])
    )
    if not determinant > 0.0:
        proper = 0.0
    return proper


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
