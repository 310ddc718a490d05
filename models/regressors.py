"""The linear model of the bench: regressors F of (1.10), and where the sign of an input is certain, (1.7), (1.9).

Numbering is the paper's: X1 κ, X2 Δα + α*, X3 ε, X4..X15 the columns of Γ + θ̂ + QNQᵀΔβ − Δg/g with two scale factors
(plus, minus) for each accelerometer, X16..X18 the biases. Source: Golovan, Matasov, Tarygin 2022, sections 1 and 3;
the formulas (1.10) and (2.7), which the published text lost, are reconstructed.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .bench import up

ASYMMETRIC_SLOTS = ((3, 7, 11), (5, 8, 12), (6, 10, 13))
"""Places of X among the 18 (from 0) that carry Γ_pc n_c in accelerometer p's reading; on the diagonal the plus one."""
SYMMETRIC_SLOTS = ((3, 6, 9), (4, 7, 10), (5, 8, 11))
"""The same among the 15 parameters of the symmetric block."""


def stand_regressors(alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike) -> NDArray:
    """Q B: derivatives (N, 3, 3) of the readings by κ, Δα + α*, ε at zero errors."""
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
    """m = Q s (N, 3), (1.8): inputs in g that an ideal bench would give."""
    return np.squeeze(np.asarray(mounting) @ up(alpha, beta)[..., None], -1)


def regressors(alpha: ArrayLike, beta: ArrayLike, mounting: ArrayLike, *, symmetric: bool = False) -> NDArray:
    """F of (1.10): the readings' derivatives by the parameters X at zero errors.

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
    """s_p^max of (1.7): how far errors within the bounds can move each input [g].

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
    """Where the sign of each input is certain before anything is known, (1.9); (N, 3) of bool; as `sign_margin`."""
    return np.abs(nominal_input(alpha, beta, mounting)) > sign_margin(alpha, beta, mounting, bounds=bounds, rule=rule)
