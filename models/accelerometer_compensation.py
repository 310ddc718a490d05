"""The inverse of the accelerometer block: readings to specific force, sign-dependent scale factors included.

The block reads r = A(s) n + b, with A = I + Γ and the scale factor of each accelerometer chosen by the sign s of its
own input. Source: Golovan, Matasov, Tarygin 2022, (1.1), solved for the input.
"""

import math

from .restricted import Vector


def is_invertible(
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
) -> float:
    """1.0 when each accelerometer follows its own input more than the two others together, for both signs, else 0.0.

    Then the readings grow with the inputs along every line, whichever scale factors hold: each reading has exactly
    one input, whose signs choose the very scale factors that it was solved with.
    """
    certain = 1.0
    for p in range(3):
        others = math.fabs(gamma_12) + math.fabs(gamma_13)
        if p == 1:
            others = math.fabs(gamma_21) + math.fabs(gamma_23)
        if p == 2:
            others = math.fabs(gamma_31) + math.fabs(gamma_32)
        if not 1.0 + scale_error_plus[p] > others:
            certain = 0.0
        if not 1.0 + scale_error_minus[p] > others:
            certain = 0.0
    return certain


def solve_signs(
    right: Vector,
    signs: Vector,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
    diagonal: Vector,
    n: Vector,
) -> float:
    """Solve A(signs) n = right by Cramer's rule; returns how far n (3,) [g] is from having these signs."""
    for p in range(3):
        diagonal[p] = 1.0 + scale_error_minus[p]
        if signs[p] > 0.0:
            diagonal[p] = 1.0 + scale_error_plus[p]
    minor_1 = diagonal[1] * diagonal[2] - gamma_23 * gamma_32
    minor_2 = gamma_21 * diagonal[2] - gamma_23 * gamma_31
    minor_3 = gamma_21 * gamma_32 - diagonal[1] * gamma_31
    determinant = diagonal[0] * minor_1 - gamma_12 * minor_2 + gamma_13 * minor_3
    n[0] = (
        right[0] * minor_1
        + right[1] * (gamma_13 * gamma_32 - gamma_12 * diagonal[2])
        + right[2] * (gamma_12 * gamma_23 - gamma_13 * diagonal[1])
    ) / determinant
    n[1] = (
        right[1] * (diagonal[0] * diagonal[2] - gamma_13 * gamma_31)
        - right[0] * minor_2
        + right[2] * (gamma_13 * gamma_21 - diagonal[0] * gamma_23)
    ) / determinant
    n[2] = (
        right[2] * (diagonal[0] * diagonal[1] - gamma_12 * gamma_21)
        + right[0] * minor_3
        + right[1] * (gamma_12 * gamma_31 - diagonal[0] * gamma_32)
    ) / determinant
    missed = 0.0
    for p in range(3):
        # An input of zero counts as negative, as in the block.
        wrong = n[p]
        if signs[p] > 0.0:
            wrong = -n[p]
        if wrong > missed:
            missed = wrong
    return missed


def respond(
    reading: Vector,
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
    bias: Vector,
    specific_force: Vector,
    right: Vector,
    signs: Vector,
    best: Vector,
    diagonal: Vector,
    n: Vector,
) -> None:
    """Specific force (3,) [m/s²] that the block answers with these readings (3,) [m/s²].

    The signs of the readings less bias are tried first; where the inputs that they give have other signs, all eight
    patterns are, in a fixed order. One fits when `is_invertible`; at an input that is zero to rounding none may fit
    exactly: then the pattern that misses least is taken, which both scale factors agree on to rounding.
    """
    for p in range(3):
        right[p] = reading[p] / gravity - bias[p]
        signs[p] = -1.0
        if right[p] > 0.0:
            signs[p] = 1.0
    least = solve_signs(
        right,
        signs,
        scale_error_plus,
        scale_error_minus,
        gamma_21,
        gamma_31,
        gamma_12,
        gamma_32,
        gamma_13,
        gamma_23,
        diagonal,
        n,
    )
    for p in range(3):
        best[p] = n[p]
    if least > 0.0:
        for pattern in range(8):
            rest = pattern
            for p in range(3):
                signs[p] = -1.0
                if rest >= 4:
                    signs[p] = 1.0
                    rest = rest - 4
                rest = 2 * rest
            missed = solve_signs(
                right,
                signs,
                scale_error_plus,
                scale_error_minus,
                gamma_21,
                gamma_31,
                gamma_12,
                gamma_32,
                gamma_13,
                gamma_23,
                diagonal,
                n,
            )
            if missed < least:
                least = missed
                for p in range(3):
                    best[p] = n[p]
    for p in range(3):
        specific_force[p] = gravity * best[p]


def initialise(
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
) -> int:
    """Check the parameters; returns 0 or the number of a message."""
    if not gravity > 0.0:
        return 1
    certain = is_invertible(
        scale_error_plus, scale_error_minus, gamma_21, gamma_31, gamma_12, gamma_32, gamma_13, gamma_23
    )
    if not certain > 0.0:
        return 2
    return 0


def step(
    reading: Vector,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
) -> int:
    """Check readings and parameters, which may have been tuned; returns 0 or the number of a message."""
    certain = is_invertible(
        scale_error_plus, scale_error_minus, gamma_21, gamma_31, gamma_12, gamma_32, gamma_13, gamma_23
    )
    if not certain > 0.0:
        return 2
    for p in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(reading[p]) < 1e300:
            return 3
    return 0
