"""The bench in motion: the exact integrals of the gyros of a block on a two-axis turntable between two moments.

    ∫ reading dt = (I + Γ) γ + b T + S φ,    γ = ∫ ω dt,  φ = ∫ (specific force / g) dt,  both in block axes

The frames are those of `trihedron.models.bench`. In the axes of the inner frame the block turns with

    ω = R₃(β) R₂(ε) e₁ α' + e₃ β' + R₃(β) R₂(ε) R₁(α − X2) R₂(κ) Ω,

Ω Earth's rotation in axes of the base; the vertical transforms like Ω. Only the angles depend on time. A few integrals
over a piece of motion, its `MOMENTS`, therefore give γ and φ for any parameters: no attitude is integrated, and the
unknowns enter as one linear system. The angles are the encoders' readings; Δβ is part of the mounting (X13, −X12, X8),
as in the readings at rest. Readings that lag by τ are those of moments τ earlier.

The block is assumed at the crossing of the axes, so its specific force is gravity's also in motion.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from .rests import small_turn
from .table import EARTH_RATE

GYRO_PARAMETERS = (
    "B1", "B2", "B3",
    "M11", "M12", "M13", "M21", "M22", "M23", "M31", "M32", "M33",
    "S11", "S12", "S13", "S21", "S22", "S23", "S31", "S32", "S33",
    "L",
)  # fmt: skip
"""Biases b [rad/s], scale factors and misalignments Γ, sensitivities S to specific force [rad/s per g], lag τ [s]."""

MOMENTS = (
    "turn_1_cos", "turn_1_sin", "turn_1", "turn_3",
    "one_one", "one_cos", "one_sin", "cos_one", "cos_cos", "cos_sin", "sin_one", "sin_cos", "sin_sin",
)  # fmt: skip
"""Integrals over a piece: cos β, sin β and 1 over dα; 1 over dβ; products of 1, cos, sin of α and of β over time."""

BIAS, MATRIX, SENSITIVITY, LAG = slice(0, 3), slice(3, 12), slice(12, 21), 21
_KAPPA, _ALPHA, _EPSILON, _TURN = 0, 1, 2, slice(14, 11, -1)
_BENT = (_KAPPA, _ALPHA, _EPSILON, 12, 13, 14)
"""Targets on which the gyros' readings depend."""


def earth_in_base(latitude: float, azimuth: float) -> Floats:
    """Return Earth's rotation (3,) [rad/s] in axes of the base: 1 along the outer axis, 3 up.

    `latitude` [rad] and `azimuth` [rad] of the outer axis, from north towards east.
    """
    level, up = EARTH_RATE * math.cos(latitude), EARTH_RATE * math.sin(latitude)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), up])


def moments_of(time: NDArray, alpha: NDArray, beta: NDArray) -> Floats:
    """Return the moments (N, 13) from the first row up to each, from angles (N,) [rad] without jumps, at times (N,)
    [s].

    Between two rows both axes turn at constant rates: then the integrals over dα are exact.
    """
    step, turn, swing = np.diff(time), np.diff(alpha), np.diff(beta)
    middle, shrunk = 0.5 * (beta[1:] + beta[:-1]), np.sinc(0.5 * swing / np.pi)
    products = _products(_harmonics(alpha), _harmonics(beta))
    pieces = [turn * np.cos(middle) * shrunk, turn * np.sin(middle) * shrunk, turn, swing]
    pieces += [0.5 * (values[1:] + values[:-1]) * step for values in products]
    sums = np.zeros((len(time), len(MOMENTS)))
    np.cumsum(np.stack(pieces, axis=1), axis=0, out=sums[1:])
    return sums


def growth_of(angles: NDArray, rates: NDArray, accelerations: NDArray) -> Floats:
    """Return first and second derivatives of the moments by time (2, N, 13), from angles (2, N) and theirs."""
    (turn, swing), (faster, quicker), (alpha, beta) = rates, accelerations, angles
    cos, sin, none = np.cos(beta), np.sin(beta), np.zeros_like(beta)
    first = [turn * cos, turn * sin, turn, swing]
    second = [faster * cos - turn * swing * sin, faster * sin + turn * swing * cos, faster, quicker]
    outer, outer_rates = _harmonics(alpha), (none, -turn * np.sin(alpha), turn * np.cos(alpha))
    inner, inner_rates = _harmonics(beta), (none, -swing * sin, swing * cos)
    first += _products(outer, inner)
    for growing, steady in zip(_products(outer_rates, inner), _products(outer, inner_rates), strict=True):
        second.append(growing + steady)
    return np.stack([np.stack(first, axis=1), np.stack(second, axis=1)])


def _products(first: Sequence[NDArray], second: Sequence[NDArray]) -> list[NDArray]:
    """Return each of the first harmonics times each of the second."""
    products = []
    for outer in first:
        products += [outer * inner for inner in second]
    return products


def _harmonics(angle: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    return np.ones_like(angle), np.cos(angle), np.sin(angle)


def turning_of(beta: NDArray, swing: NDArray, turn: NDArray, lean: float) -> Floats:
    """Return turns (N, 3) of the inner frame, in its axes, by turns (N,) about the outer and the inner axis; lean ε."""
    along = np.cos(lean) * swing
    return np.stack([along * np.cos(beta), -along * np.sin(beta), np.sin(lean) * swing + turn], axis=1)


def rates_of_turning(beta: NDArray, rates: NDArray, accelerations: NDArray, lean: float) -> Floats:
    """Return rates and their changes (2, N, 3) of the inner frame, in its axes, by those (N, 2) of both axes."""
    rate, change = (turning_of(beta, values[:, 0], values[:, 1], lean) for values in (rates, accelerations))
    across = np.cos(lean) * rates[:, 0] * rates[:, 1]
    change[:, 0] -= across * np.sin(beta)
    change[:, 1] -= across * np.cos(beta)
    return np.stack([rate, change])


def axes_of_turns(alpha: NDArray, beta: NDArray, lean: float) -> Floats:
    """Return the axes (4, N, 3) of small turns in those of the inner frame, at angles (N,) from the vertical; lean ε.

    About κ's axis, which α, ε and β turn; about the outer axis, about that of ε, about the inner one.
    """
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    sin_e, cos_e, none = np.sin(lean), np.cos(lean), np.zeros(len(beta))
    axes = [
        (sin_e * sin_a * cos_b + cos_a * sin_b, cos_a * cos_b - sin_e * sin_a * sin_b, -cos_e * sin_a),
        (cos_e * cos_b, -cos_e * sin_b, none + sin_e),
        (sin_b, cos_b, none),
        (none, none, none + 1.0),
    ]
    return np.array(axes).swapaxes(1, 2)


def integrated_readings(
    targets: ArrayLike,
    gyros: ArrayLike,
    moments: NDArray,
    growth: NDArray,
    mounting: ArrayLike,
    earth: ArrayLike,
) -> NDArray:
    """Return the integrals (S, 3) [rad] of the gyros' readings over pieces; complex parameters give derivatives.

    Parameters
    ----------
    targets : (18,) array
        in the order of `trihedron.models.bench.TARGETS`
    gyros : (22,) array
        in the order of `GYRO_PARAMETERS`
    moments : (S, 13) array
        moments of the pieces
    growth : (2, S, 13) array
        their derivatives when a piece moves on in time: first [1/s] and second [1/s²]. The error is below 1e-7 rad for
        a lag of some milliseconds, while both axes turn by some rad/s
    mounting : (3, 3) array
        Q
    earth : (3,) array
        `earth_in_base`

    Returns
    -------
    (S, 3) array
        integrals [rad]
    """
    g = np.asarray(gyros)
    time, turned, vertical = _inputs(np.asarray(targets), g[LAG], moments, growth, mounting, earth)
    matrix, sensitivity = np.eye(3) + g[MATRIX].reshape(3, 3), g[SENSITIVITY].reshape(3, 3)
    return turned @ matrix.T + g[BIAS] * time + vertical @ sensitivity.T


def _inputs(
    x: NDArray, lag: complex, moments: NDArray, growth: NDArray, mounting: ArrayLike, earth: ArrayLike
) -> tuple[NDArray, NDArray, NDArray]:
    """Return the gyros' integrated inputs over pieces: time (S, 1), turns and the vertical (S, 3) in axes of the
    block."""
    moments = moments - lag * (growth[0] - 0.5 * lag * growth[1])
    block = small_turn(x[_TURN]) @ np.asarray(mounting)
    lean = np.cos(x[_EPSILON]), np.sin(x[_EPSILON])
    tilts = [lean[0] * moments[:, 0], -lean[0] * moments[:, 1], lean[1] * moments[:, 2] + moments[:, 3]]
    turned = (np.stack(tilts, axis=-1) + _carried(x, moments, np.asarray(earth))) @ block.T
    return moments[:, 4:5], turned, _carried(x, moments, np.array([0.0, 0.0, 1.0])) @ block.T


def _carried(x: NDArray, moments: NDArray, vector: NDArray) -> NDArray:
    """Return the integral (S, 3), in axes of the inner frame, of a vector (3,) that is constant in the base."""
    products = moments[:, 4:].reshape(-1, 3, 3)
    cos_shift, sin_shift = np.cos(x[_ALPHA]), np.sin(x[_ALPHA])
    first_column, cos_a = products[:, 0], cos_shift * products[:, 1] + sin_shift * products[:, 2]
    sin_a = cos_shift * products[:, 2] - sin_shift * products[:, 1]
    cos_k, sin_k = np.cos(x[_KAPPA]), np.sin(x[_KAPPA])
    cos_e, sin_e = np.cos(x[_EPSILON]), np.sin(x[_EPSILON])
    first, third = vector[0] * cos_k - vector[2] * sin_k, vector[0] * sin_k + vector[2] * cos_k
    across, up = vector[1] * cos_a + third * sin_a, third * cos_a - vector[1] * sin_a
    along, inner = first * cos_e * first_column - sin_e * up, first * sin_e * first_column + cos_e * up
    return np.stack([along[:, 1] + across[:, 2], across[:, 1] - along[:, 2], inner[:, 0]], axis=-1)


def integrated_jacobian(arguments: Sequence[ArrayLike], rest: tuple[NDArray, NDArray, NDArray, NDArray]) -> Floats:
    """Return derivatives (S, 3, 40) of `integrated_readings` by the 18 targets and the gyros' parameters.

    `arguments` are targets and gyros, `rest` the following arguments. Nonlinear parts use complex steps.
    """
    x, g = (np.asarray(values, dtype=float) for values in arguments)
    at, step, count = np.concatenate([x, g]), 1e-30, len(x)
    jacobian = np.zeros((len(rest[0]), 3, len(at)))
    for k in (*_BENT, count + LAG):
        moved = at.astype(complex)
        moved[k] += 1j * step
        jacobian[:, :, k] = np.imag(integrated_readings(moved[:count], moved[count:], *rest)) / step
    angle_columns, (time, turned, vertical) = jacobian[:, :, count:], _inputs(x, g[LAG], *rest)
    for p in range(3):
        for part, inputs in ((BIAS, time), (MATRIX, turned), (SENSITIVITY, vertical)):
            width = inputs.shape[1]
            first = part.start + width * p
            angle_columns[:, p, first : first + width] = inputs
    return jacobian
