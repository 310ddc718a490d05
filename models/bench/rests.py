"""The bench at rest: the exact readings of an accelerometer block on a two-axis turntable.

    reading / g = n + Γ n + G(n) n + b,    n = exp(θ̂) Q up(α_true, β_true) (1 − Δg/g)

Two sets of coordinates are used. `ELEMENTARY` are the 24 physical parameters of bench and block, which readings cannot
separate. Readings determine only the 18 `TARGETS`, and the reading is an exact function of these too: Δg and Δβ drop
out. Frames, each by an exact turn of the frame before: base -> κ about axis 2 -> α about the outer axis (1) -> ε about
axis 2 -> β about the inner axis (3) -> mounting Q -> mounting error θ.

Functions of them take any number of positions and complex numbers (for derivatives by a complex step).

The linear model has the paper's numbering. X1 is κ, X2 Δα + α*, X3 ε. X4..X15 are the columns of Γ + θ̂ + QNQᵀΔβ − Δg/g
with two scale factors (plus, minus) for each accelerometer. X16..X18 are the biases. By (1.7) and (1.9) the sign of an
input is certain.

Source: Golovan, Matasov, Tarygin 2022, sections 1 and 3; case (A1), Γ without diagonal lower triangular. To first order
the exact reading is (1.3) and (1.11); the formulas (1.10) and (2.7), which the published text lost, are reconstructed.
"""

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

ELEMENTARY: tuple[str, ...] = (
    "kappa",
    "epsilon",
    "alpha_offset",
    "beta_offset",
    "alpha_star",
    "gravity_error",
    "mounting_error_1",
    "mounting_error_2",
    "mounting_error_3",
    "scale_error_plus_1",
    "scale_error_plus_2",
    "scale_error_plus_3",
    "scale_error_minus_1",
    "scale_error_minus_2",
    "scale_error_minus_3",
    "gamma_21",
    "gamma_31",
    "gamma_12",
    "gamma_32",
    "gamma_13",
    "gamma_23",
    "bias_1",
    "bias_2",
    "bias_3",
)
"""The 24 elementary parameters: κ, ε, Δα, Δβ, α* [rad], Δg/g, θ [rad], Γ⁺ and Γ⁻, the six Γ_ij, the biases [g]."""

TARGETS: tuple[str, ...] = (
    "X1",
    "X2",
    "X3",
    "X4",
    "X5",
    "X9",
    "X10",
    "X14",
    "X15",
    "X6+X8",
    "X7+X12",
    "X11+X13",
    "X8",
    "-X12",
    "X13",
    "X16",
    "X17",
    "X18",
)
"""The 18 targets of case (A1) in the order of the paper, list (a) to (e): all that readings can determine."""

SYMMETRIC_PAIRS = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
"""Scale targets of an accelerometer for positive and negative input, equal for a symmetric block."""

ORTHOGONALITY_TOLERANCE = 1e-9
"""Tolerance to which rows of a mounting's matrix must be unit vectors, perpendicular to one another."""

ASYMMETRIC_SLOTS = ((3, 7, 11), (5, 8, 12), (6, 10, 13))
"""Places of X among the 18 (from 0) that carry Γ_pc n_c in accelerometer p's reading; on the diagonal the plus one."""
SYMMETRIC_SLOTS = ((3, 6, 9), (4, 7, 10), (5, 8, 11))
"""The same among the 15 parameters of the symmetric block."""

_OFF_DIAGONAL = {name: (int(name[6]) - 1, int(name[7]) - 1) for name in ELEMENTARY if name.startswith("gamma_")}
_PLUS, _MINUS = slice(3, 9, 2), slice(4, 9, 2)
_OF_DIRECTION = [0, 1, 2, 12, 13, 14]
"""The targets that turn the vertical: κ, Δα + α*, ε and the three of the mounting."""
_TERMS = 22
_SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(_TERMS))
_COSINE = tuple((-1.0) ** k / factorial(2 * k + 2) for k in range(_TERMS))


def small_turn(vector: ArrayLike) -> NDArray:
    """Return exp(θ̂): the frame turned by the rotation vector θ [rad] (..., 3), as direction cosines (..., 3, 3).

    θ̂ is that of (1.2): [[0, θ3, −θ2], [−θ3, 0, θ1], [θ2, −θ1, 0]].

    The power series of sin(θ)/θ and (1 − cos θ)/θ² in θ² are good to rounding for turns up to 2π. Zero is not a special
    case, and complex steps pass through.
    """
    vector = np.asarray(vector)
    square = (vector * vector).sum(axis=-1)
    if vector.ndim > 1:
        square = square[..., None, None]
    # Terms below rounding for the largest of these turns are left out.
    largest = float(np.abs(square).max(initial=0.0) if square.ndim else abs(square))
    last = next((k for k in range(1, _TERMS) if largest**k * abs(_SINE[k]) < 1e-19), _TERMS - 1)
    sine, cosine = _SINE[last], _COSINE[last]
    for s, c in zip(reversed(_SINE[:last]), reversed(_COSINE[:last]), strict=True):
        sine = sine * square + s
        cosine = cosine * square + c
    generator = np.zeros((*vector.shape, 3), vector.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        generator[..., i, j] = vector[..., k]
        generator[..., j, i] = -vector[..., k]
    return np.eye(3) + sine * generator + cosine * (generator @ generator)


def checked_rotation(matrix: Any) -> NDArray:
    """Return a proper rotation (3, 3) from nested sequences of numbers.

    Raises
    ------
    ValueError
        for any other matrix, with its fault
    """
    rows = matrix.tolist() if isinstance(matrix, np.ndarray) else matrix
    if isinstance(rows, list | tuple):
        rows = [row.tolist() if isinstance(row, np.ndarray) else row for row in rows]
    shaped = isinstance(rows, list | tuple) and len(rows) == 3
    if not (shaped and all(isinstance(row, list | tuple) and len(row) == 3 for row in rows)):
        raise ValueError("the matrix must be three rows of three numbers")
    if any(isinstance(x, bool) or not isinstance(x, int | float) for row in rows for x in row):
        raise ValueError("the matrix must hold numbers only")
    # compared as they are: an integer may be too large for a float
    if not all(abs(x) <= 2 for row in rows for x in row):
        raise ValueError("every element of a rotation matrix lies between -1 and 1")
    q = np.array(rows, dtype=float)
    defect = np.abs(q @ q.T - np.eye(3))
    i, j = np.unravel_index(int(defect.argmax()), (3, 3))
    if defect[i, j] > ORTHOGONALITY_TOLERANCE:
        what = f"row {i + 1} has length {np.linalg.norm(q[i]):.10g}" if i == j else f"rows {i + 1} and {j + 1} are not"
        what = what if i == j else f"{what} perpendicular (product {float(q[i] @ q[j]):.3g})"
        raise ValueError(f"the matrix is not orthogonal to {ORTHOGONALITY_TOLERANCE:g}: {what}; give more digits?")
    if np.linalg.det(q) < 0:
        raise ValueError("the matrix has determinant -1, a reflection; a mounting is a rotation")
    return q


def up(alpha: ArrayLike, beta: ArrayLike, kappa: ArrayLike = 0.0, epsilon: ArrayLike = 0.0) -> NDArray:
    """Return the vertical, upwards, in the axes j of the inner frame.

    Parameters
    ----------
    alpha, beta : array (...)
        true angles of the outer and the inner axis [rad], α less α*
    kappa, epsilon : array (...)
        κ, the outer axis below the horizon, and ε, the inner axis towards the positive outer one [rad]

    Returns
    -------
    (..., 3) array
        unit vectors; (sin α sin β, sin α cos β, cos α) for a perfect table
    """
    sin_k, cos_k = np.sin(kappa), np.cos(kappa)
    return _on_inner(-sin_k, cos_k * np.sin(alpha), cos_k * np.cos(alpha), _trigonometry(beta), _trigonometry(epsilon))


def _trigonometry(angle: ArrayLike) -> tuple[NDArray, NDArray]:
    return np.sin(angle), np.cos(angle)


def _on_inner(
    first: NDArray, second: NDArray, third: NDArray, beta: tuple[NDArray, NDArray], epsilon: tuple[NDArray, NDArray]
) -> NDArray:
    """Return a vector in the axes of the outer frame as (..., 3) in those of the inner one; angles as sine and
    cosine."""
    (sin_b, cos_b), (sin_e, cos_e) = beta, epsilon
    first, third = first * cos_e - third * sin_e, first * sin_e + third * cos_e
    across = first * cos_b + second * sin_b
    vector = np.empty((*across.shape, 3), across.dtype)
    vector[..., 0], vector[..., 1], vector[..., 2] = across, second * cos_b - first * sin_b, third
    return vector


def _up_and_derivatives(
    alpha: NDArray, beta: ArrayLike, kappa: NDArray, epsilon: NDArray
) -> tuple[NDArray, tuple[NDArray, NDArray, NDArray]]:
    """Return `up`, and its derivatives (..., 3) by κ, by the angle subtracted from α, and by ε."""
    (sin_a, cos_a), (sin_k, cos_k) = _trigonometry(alpha), _trigonometry(kappa)
    b, e = _trigonometry(beta), _trigonometry(epsilon)
    vertical = _on_inner(-sin_k, cos_k * sin_a, cos_k * cos_a, b, e)
    by_kappa = _on_inner(-cos_k, -sin_k * sin_a, -sin_k * cos_a, b, e)
    by_alpha = _on_inner(np.zeros_like(sin_k), -cos_k * cos_a, cos_k * sin_a, b, e)
    third = vertical[..., 2]
    by_epsilon = np.stack((-third * b[1], third * b[0], vertical[..., 0] * b[1] - vertical[..., 1] * b[0]), axis=-1)
    return vertical, (by_kappa, by_alpha, by_epsilon)


def elementary(**values: float) -> NDArray:
    """Return the vector (24,) of elementary parameters with these values and zeros elsewhere."""
    vector = np.zeros(len(ELEMENTARY))
    for name, value in values.items():
        vector[ELEMENTARY.index(name)] = value
    return vector


def elementary_reading(
    parameters: ArrayLike,
    alpha: ArrayLike,
    beta: ArrayLike,
    mounting: ArrayLike,
    sign: ArrayLike | None = None,
) -> NDArray:
    """Return the exact reading of the block over the model's g, from the elementary parameters.

    Parameters
    ----------
    parameters : (24,) array
        in the order of `ELEMENTARY`
    alpha, beta : (N,) array
        encoder readings [rad]
    mounting : (3, 3) or (N, 3, 3) array
        Q: components in the block's axes from those in the inner frame
    sign : (N, 3) array, optional
        signs of the inputs that choose between Γ⁺ and Γ⁻; by default those of the exact inputs (zero counts as plus)

    Returns
    -------
    (N, 3) array
    """
    p = dict(zip(ELEMENTARY, np.asarray(parameters), strict=True))
    theta = np.stack([p["mounting_error_1"], p["mounting_error_2"], p["mounting_error_3"]])
    vertical = up(
        np.asarray(alpha) - p["alpha_offset"] - p["alpha_star"],
        np.asarray(beta) - p["beta_offset"],
        p["kappa"],
        p["epsilon"],
    )
    turned = small_turn(theta) @ np.asarray(mounting)
    n = (1.0 - p["gravity_error"]) * np.squeeze(turned @ vertical[..., None], -1)
    plus = np.stack([p[f"scale_error_plus_{i}"] for i in (1, 2, 3)])
    minus = np.stack([p[f"scale_error_minus_{i}"] for i in (1, 2, 3)])
    gamma = np.zeros((3, 3), n.dtype)
    for name, place in _OFF_DIAGONAL.items():
        gamma[place] = p[name]
    positive = np.real(n) >= 0.0 if sign is None else np.asarray(sign) >= 0
    return n + n @ gamma.T + np.where(positive, plus, minus) * n + np.stack([p[f"bias_{i}"] for i in (1, 2, 3)])


def target_values(parameters: ArrayLike, mounting: ArrayLike) -> NDArray:
    """Return the true values of the 18 targets, exact, from elementary parameters of case (A1).

    Parameters
    ----------
    parameters : (24,) array
        in the order of `ELEMENTARY`, gamma_12, gamma_13 and gamma_23 zero
    mounting : (3, 3) array
        Q

    Returns
    -------
    (18,) array in the order of `TARGETS`: X1 = κ, X2 = Δα + α*, X3 = ε. Then (1 + Γ±)(1 − Δg/g) − 1; Γ21, Γ31, Γ32
    times (1 − Δg/g); (X13, −X12, X8) = rotation vector of exp(θ̂) Q R₃(−Δβ) Qᵀ; the biases

    Raises
    ------
    ValueError
        when Γ is not lower triangular
    """
    p = dict(zip(ELEMENTARY, np.asarray(parameters, dtype=float), strict=True))
    if any(p[name] != 0.0 for name in ("gamma_12", "gamma_13", "gamma_23")):
        raise ValueError("the exact targets are those of a lower triangular Γ: gamma_12, gamma_13, gamma_23 must be 0")
    mounting = np.asarray(mounting, dtype=float)
    theta = np.array([p["mounting_error_1"], p["mounting_error_2"], p["mounting_error_3"]])
    offset = small_turn(np.array([0.0, 0.0, -p["beta_offset"]]))
    turn = vector_of_rotation(small_turn(theta) @ mounting @ offset @ mounting.T)
    true_g = 1.0 - p["gravity_error"]
    scale = [
        p[f"scale_error_{sense}_{i}"] * true_g - p["gravity_error"] for i in (1, 2, 3) for sense in ("plus", "minus")
    ]
    shear = [true_g * p[name] for name in ("gamma_21", "gamma_31", "gamma_32")]
    bias = [p["bias_1"], p["bias_2"], p["bias_3"]]
    return np.array([p["kappa"], p["alpha_offset"] + p["alpha_star"], p["epsilon"], *scale, *shear, *turn[::-1], *bias])


def vector_of_rotation(matrix: ArrayLike) -> NDArray:
    """Return the rotation vector θ [rad] (3,) with exp(θ̂) equal to a matrix of direction cosines (3, 3); |θ| < π."""
    r = np.asarray(matrix, dtype=float)
    twice_sine = np.array([r[1, 2] - r[2, 1], r[2, 0] - r[0, 2], r[0, 1] - r[1, 0]])
    sine = 0.5 * np.linalg.norm(twice_sine)
    angle = np.arctan2(sine, 0.5 * (np.trace(r) - 1.0))
    return 0.5 * twice_sine * (angle / sine if sine > 1e-8 else 1.0)


def input_direction(
    targets: ArrayLike, alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike, further: NDArray | None = None
) -> NDArray:
    """Return the unit vector of the specific force in the block's axes: the accelerometers' inputs n over (1 − Δg/g).

    Parameters
    ----------
    targets : (18,) or (N, 18) array
        in the order of `TARGETS`, one for all positions or one for each
    alpha, beta : (N,) array
        encoder readings [rad]
    mounting : (3, 3) or (N, 3, 3) array
        Q
    further : (N, 3) array, optional
        rotation vectors [rad], in block axes, by which the block is turned on the table beside θ

    Returns
    -------
    (N, 3) array
    """
    x = np.asarray(targets)
    vertical = up(np.asarray(alpha) - x[..., 1], np.asarray(beta), x[..., 0], x[..., 2])
    turned = _mounted(x, mounting, further)
    return np.squeeze(turned @ vertical[..., None], -1)


def _mounted(x: NDArray, mounting: ArrayLike, further: NDArray | None) -> NDArray:
    """Return block axes from those of the inner frame, (3, 3) or (N, 3, 3)."""
    turned = small_turn(x[..., 14:11:-1]) @ np.asarray(mounting)
    if further is None:
        return turned
    return small_turn(further) @ turned


def target_reading(
    targets: ArrayLike,
    alpha: ArrayLike,
    beta: ArrayLike,
    mounting: ArrayLike,
    sign: ArrayLike | None = None,
    further: NDArray | None = None,
) -> NDArray:
    """Return the exact reading over the model's g (N, 3) from the 18 targets; arguments as `input_direction`.

    `sign` (N, 3) chooses between the targets of positive and negative input; by default the exact inputs' own signs.
    """
    return reading_of_input(targets, input_direction(targets, alpha, beta, mounting, further), sign)


def reading_of_input(targets: ArrayLike, m: NDArray, sign: ArrayLike | None = None) -> NDArray:
    """Return `target_reading` at given inputs m (N, 3)."""
    x = np.asarray(targets)
    positive = np.real(m) >= 0.0 if sign is None else np.asarray(sign) >= 0
    reading = m + np.where(positive, x[..., _PLUS], x[..., _MINUS]) * m + x[..., 15:18]
    reading[..., 1] += x[..., 9] * m[..., 0]
    reading[..., 2] += x[..., 10] * m[..., 0] + x[..., 11] * m[..., 1]
    return reading


def target_jacobian(
    targets: ArrayLike,
    alpha: ArrayLike,
    beta: ArrayLike,
    mounting: ArrayLike,
    sign: ArrayLike | None = None,
    further: NDArray | None = None,
) -> NDArray:
    """Return derivatives (N, 3, 18) of `target_reading` by the targets, exact to rounding.

    The reading is linear in scale factors, shears and biases; the rest comes through the direction.
    """
    x = np.asarray(targets)
    m, direction = _input_and_jacobian(x, alpha, beta, mounting, further)
    positive = m >= 0.0 if sign is None else np.asarray(sign) >= 0
    jacobian = direction * (1.0 + np.where(positive, x[..., _PLUS], x[..., _MINUS]))[..., None]
    jacobian[..., 1, :] += x[..., 9, None] * direction[..., 0, :]
    jacobian[..., 2, :] += x[..., 10, None] * direction[..., 0, :] + x[..., 11, None] * direction[..., 1, :]
    for p in range(3):
        jacobian[..., p, 3 + 2 * p] = np.where(positive[..., p], m[..., p], 0.0)
        jacobian[..., p, 4 + 2 * p] = np.where(positive[..., p], 0.0, m[..., p])
        jacobian[..., p, 15 + p] = 1.0
    jacobian[..., 1, 9] = jacobian[..., 2, 10] = m[..., 0]
    jacobian[..., 2, 11] = m[..., 1]
    return jacobian


def input_jacobian(
    targets: ArrayLike, alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike, further: NDArray | None = None
) -> NDArray:
    """Return derivatives (N, 3, 18) of `input_direction` by the targets, exact to rounding (complex step)."""
    return _input_and_jacobian(targets, alpha, beta, mounting, further)[1]


def _input_and_jacobian(
    targets: ArrayLike, alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike, further: NDArray | None
) -> tuple[NDArray, NDArray]:
    """Return `input_direction` and `input_jacobian`."""
    x, step = np.asarray(targets), 1e-30
    # The targets that turn the block, three at once.
    turned = x + 1j * step * np.eye(len(TARGETS))[_OF_DIRECTION[3:], None]
    turns = np.imag(_mounted(turned, mounting, further)) / step
    straight = _mounted(x, mounting, further)
    up, vertical = _up_and_derivatives(np.asarray(alpha) - x[..., 1], beta, x[..., 0], x[..., 2])
    jacobian = np.zeros((*up.shape, len(TARGETS)))
    for k, tilt, turn in zip(range(3), vertical, turns, strict=True):
        jacobian[..., _OF_DIRECTION[k]] = np.squeeze(straight @ tilt[..., None], -1)
        jacobian[..., _OF_DIRECTION[3 + k]] = np.squeeze(turn @ up[..., None], -1)
    return np.squeeze(straight @ up[..., None], -1), jacobian


def stand_regressors(alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike) -> NDArray:
    """Return Q B: derivatives (N, 3, 3) of the readings by κ, Δα + α*, ε at zero errors."""
    alpha, beta = np.broadcast_arrays(np.asarray(alpha, dtype=float), np.asarray(beta, dtype=float))
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    zero = np.zeros_like(sin_a)
    rows = [
        [-cos_b, -cos_a * sin_b, -cos_a * cos_b],
        [sin_b, -cos_a * cos_b, cos_a * sin_b],
        [zero, sin_a, zero],
    ]
    matrix = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.asarray(mounting) @ matrix


def nominal_input(alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike) -> NDArray:
    """Return m = Q s (N, 3), (1.8): inputs in g of an ideal bench."""
    return np.squeeze(np.asarray(mounting) @ up(alpha, beta)[..., None], -1)


def regressors(alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike, *, symmetric: bool = False) -> NDArray:
    """Return F of (1.10): the readings' derivatives by the parameters X at zero errors.

    Parameters
    ----------
    alpha, beta : (N,) array
        angles of the outer and the inner axis [rad]
    mounting : (3, 3) or (N, 3, 3) array
        Q
    symmetric : bool
        15 parameters, one scale factor for each accelerometer, in place of 18

    Returns
    -------
    (N, 3, 18) or (N, 3, 15) array
        row p belongs to accelerometer p + 1; the scale factor of a nominal input of zero is the plus one
    """
    m = nominal_input(alpha, beta, mounting)
    slots = SYMMETRIC_SLOTS if symmetric else ASYMMETRIC_SLOTS
    size = 15 if symmetric else 18
    f = np.zeros((*m.shape, size))
    f[..., :3] = stand_regressors(alpha, beta, mounting)
    for p in range(3):
        f[..., p, size - 3 + p] = 1.0
        for c in range(3):
            f[..., p, slots[p][c]] = m[..., c]
        if not symmetric:
            negative = m[..., p] < 0.0
            f[..., p, slots[p][p]] = np.where(negative, 0.0, m[..., p])
            f[..., p, slots[p][p] + 1] = np.where(negative, m[..., p], 0.0)
    return f


def sign_margin(
    alpha: ArrayLike,
    beta: ArrayLike,
    mounting: ArrayLike,
    *,
    bounds: tuple[float, float] = (3e-3, 1e-2),
    rule: str = "paper",
) -> NDArray:
    """Return s_p^max of (1.7): the largest shift of each input by errors within the bounds [g].

    Parameters
    ----------
    alpha, beta, mounting
        as for `regressors`
    bounds : (float, float)
        u^max [rad] of X1..X3 and v^0max of X4..X12 (of the 15)
    rule : {"paper", "tables"}
        (1.7) as printed, or with the bias row too, as the published tables were computed

    Returns
    -------
    (N, 3) array

    Raises
    ------
    ValueError
        for another rule
    """
    if rule not in ("paper", "tables"):
        raise ValueError(f"rule is '{rule}'; it must be 'paper' or 'tables'")
    u, v = bounds
    m = np.abs(nominal_input(alpha, beta, mounting)).sum(axis=-1, keepdims=True)
    margin = u * np.abs(stand_regressors(alpha, beta, mounting)).sum(axis=-1) + v * m
    return margin + v if rule == "tables" else margin


def admissible(
    alpha: ArrayLike,
    beta: ArrayLike,
    mounting: ArrayLike,
    *,
    bounds: tuple[float, float] = (3e-3, 1e-2),
    rule: str = "paper",
) -> NDArray:
    """Return a mask (N, 3) of the inputs whose sign is certain a priori, (1.9); arguments as `sign_margin`."""
    return np.abs(nominal_input(alpha, beta, mounting)) > sign_margin(alpha, beta, mounting, bounds=bounds, rule=rule)
