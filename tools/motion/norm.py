"""Accelerometers calibrated by the norm of gravity over rests: least squares and guaranteed bounds side by side.

Reading/g = (I + Γ) n + b with |n| = 1 and Γ lower triangular: a turn of the block against its axes cannot be seen in
the norm, so the first axis is the first accelerometer's and the second lies in the plane of the first two. With an
error |ρ| ≤ σ of each reading the residual |n| − 1 is within the sum of σ |(I + Γ)⁻ᵀ u|, u = n/|n|.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..bounded.programmes import Polytope, SolverError, chebyshev_radius
from ..result import Array, Result

NAMES = ("gamma_11", "gamma_21", "gamma_22", "gamma_31", "gamma_32", "gamma_33", "bias_1", "bias_2", "bias_3")
"""The nine parameters; Γ [1] row by row, then the biases [g]."""
ROWS, COLUMNS = np.tril_indices(3)
LARGEST = 0.3
"""Beyond this a parameter is not one of an instrument, and the linearisation says nothing."""
LEAST_SINGULAR = 0.1
"""Least singular value of the norm equations, of parameters of size one, that counts as determined."""
ITERATIONS = 30


class NormParameter(Result):
    """One of the nine parameters, as `NormCalibration` has them; its ends are None where they are not bounded."""

    name: str
    unit: str
    least_squares: float | None
    standard_error: float | None
    low: float | None
    high: float | None


class NormCalibration(Result):
    """What the norm of gravity says of the accelerometers.

    Attributes
    ----------
    verdict : str
        "consistent", "falsified": no parameters keep every rest within its bound; "insufficient": poses are missing
    radius : float or None
        least possible largest residual over its bound
    missing : tuple of str
        poses that would determine what is not, in words
    parameters : tuple of NormParameter
        in the order of NAMES: least squares with its standard error, from its residuals, and the guaranteed ends: the
        sets of parameters that errors within the bounds leave possible lie between them
    residual : (K,) array or None
        |n| − 1 of least squares [g]
    bound : (K,) array or None
        of each residual [g]
    """

    verdict: str
    radius: float | None = None
    missing: tuple[str, ...] = ()
    parameters: tuple[NormParameter, ...]
    residual: Array | None = Field(default=None, exclude=True)
    bound: Array | None = Field(default=None, exclude=True)

    def column(self, name: str) -> NDArray[np.float64] | None:
        """A figure (9,) of all the parameters, by its name; None where one has none."""
        values = [getattr(parameter, name) for parameter in self.parameters]
        return None if None in values else np.array(values)

    @property
    def least_squares(self) -> NDArray[np.float64] | None:
        """The nine parameters (9,)."""
        return self.column("least_squares")


def _parameters(*columns: NDArray | None) -> tuple[NormParameter, ...]:
    """The parameters of least squares, standard errors, low and high ends (9,), as far as there are any."""
    figures = ("least_squares", "standard_error", "low", "high")
    found = {name: column for name, column in zip(figures, columns, strict=False) if column is not None}
    missing = dict.fromkeys(figures)
    return tuple(
        NormParameter(
            name=name,
            unit="g" if name.startswith("bias") else "1",
            **(missing | {figure: float(column[k]) for figure, column in found.items()}),
        )
        for k, name in enumerate(NAMES)
    )


def block_of(x: NDArray) -> tuple[NDArray, NDArray]:
    """I + Γ (3, 3) and b (3,) [g] of the nine parameters."""
    matrix = np.eye(3)
    matrix[ROWS, COLUMNS] += x[:6]
    return matrix, x[6:]


def inputs_of(x: NDArray, reading: NDArray) -> NDArray:
    """Inputs n (K, 3) [g] that readings (K, 3) [g] of a block with the nine parameters show."""
    matrix, bias = block_of(x)
    return np.linalg.solve(matrix, (reading - bias).T).T


def norm_equations(x: NDArray, reading: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """|n| − 1 (K,), its slopes (K, 9) by the parameters and how it takes errors of the readings (K, 3)."""
    n = inputs_of(x, reading)
    norm = np.linalg.norm(n, axis=1)
    back = np.linalg.solve(block_of(x)[0].T, (n / norm[:, None]).T).T
    return norm - 1.0, -np.hstack([back[:, ROWS] * n[:, COLUMNS], back]), back


def calibrate_by_norm(reading: NDArray, bound: NDArray) -> NormCalibration:
    """Calibrate the accelerometers from rests whose directions are not known.

    Parameters
    ----------
    reading : (K, 3) array
        mean readings at the rests [g]
    bound : (K, 3) array
        bounds of their errors [g], positive

    Returns
    -------
    NormCalibration
    """
    x = np.zeros(9)
    _, slopes, _ = norm_equations(x, reading)
    missing = missing_poses(slopes)
    if missing:
        return NormCalibration(verdict="insufficient", missing=missing, parameters=_parameters())
    for _ in range(ITERATIONS):
        residual, slopes, _ = norm_equations(x, reading)
        change = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        x = x + change
        if np.abs(x).max() > LARGEST:
            return NormCalibration(verdict="falsified", parameters=_parameters(x))
        if np.abs(change).max() < 1e-14:
            break
    residual, slopes, back = norm_equations(x, reading)
    allowed = (np.abs(back) * bound).sum(axis=1)
    free = len(reading) - 9
    inverse = np.linalg.inv(slopes.T @ slopes)
    error = np.sqrt(np.diag(inverse) * (residual @ residual) / free) if free else None
    ends, radius = _guaranteed(x, reading, bound, allowed)
    verdict = "falsified" if radius > 1.0 else "insufficient" if ends is None else "consistent"
    return NormCalibration(
        verdict=verdict,
        radius=radius,
        missing=_best_pose(slopes)[:1] if verdict == "insufficient" else (),
        parameters=_parameters(x, error, *(ends if ends is not None and verdict == "consistent" else ())),
        residual=residual,
        bound=allowed,
    )


def _guaranteed(
    x: NDArray, reading: NDArray, bound: NDArray, allowed: NDArray
) -> tuple[tuple[NDArray, NDArray] | None, float]:
    """Ends of the parameters and the radius.

    What linearisation leaves out is taken from the exact equations at the 18 solutions that are the ends, and added to
    the bounds until these hold it; that other corners of the set leave out no more is not proven.
    """
    residual, slopes, _ = norm_equations(x, reading)
    shift = float(np.linalg.norm(bound, axis=1).max())
    left_out, ends = np.full(len(reading), shift**2), None
    for _ in range(10):
        widened = allowed + left_out
        radius = chebyshev_radius(slopes, -residual, widened)[0]
        corners = _corners(slopes, -residual, widened) if radius <= 1.0 else None
        if corners is None or np.abs(corners).max() > LARGEST:
            return None, radius
        ends = (x + corners.min(axis=0), x + corners.max(axis=0))
        exact = np.array([norm_equations(x + corner, reading)[0] for corner in corners])
        needed = np.abs(exact - residual - corners @ slopes.T).max(axis=0) + shift**2
        if (needed <= left_out * 1.01).all():
            return ends, radius
        left_out = np.maximum(needed, left_out)
    return ends, radius


def _corners(slopes: NDArray, target: NDArray, bound: NDArray) -> NDArray | None:
    """Points (18, 9) of {x: |target − slopes x| ≤ bound} where each parameter is least, largest; None if unbounded."""
    polytope = Polytope(slopes, bound)
    polytope.confine(target - bound, target + bound)
    try:
        return np.array([polytope.maximise(objective)[1] for objective in np.vstack([-np.eye(9), np.eye(9)])])
    except SolverError:
        return None


def candidate_poses() -> dict[str, NDArray]:
    """Poses that a person can set by hand: an axis up or down, or two axes at 45°; name to n (3,) [g]."""
    words = ((1.0, "up"), (-1.0, "down"))
    poses = {f"axis {p + 1} {word}": sign * np.eye(3)[p] for p in range(3) for sign, word in words}
    for p, q in combinations(range(3), 2):
        for first, one in words:
            for second, other in words:
                direction = (first * np.eye(3)[p] + second * np.eye(3)[q]) / np.sqrt(2.0)
                poses[f"axis {p + 1} {one} and axis {q + 1} {other}, both at 45°"] = direction
    return poses


def missing_poses(slopes: NDArray) -> tuple[str, ...]:
    """Poses, chosen one after the other for what they add, that make norm equations (K, 9) determine all parameters."""
    missing: list[str] = []
    while len(slopes) < 9 or np.linalg.svd(slopes, compute_uv=False)[8] < LEAST_SINGULAR:
        name, slopes = _best_pose(slopes)
        missing.append(name)
    return tuple(missing)


def _best_pose(slopes: NDArray) -> tuple[str, NDArray]:
    """The pose that adds most to norm equations (K, 9), and the equations with it."""

    def information(equations: NDArray) -> float:
        return float(np.linalg.slogdet(equations.T @ equations + 1e-6 * np.eye(9))[1])

    poses = candidate_poses().items()
    tried = {name: np.vstack([slopes, norm_equations(np.zeros(9), n[None, :])[1]]) for name, n in poses}
    best = max(tried, key=lambda name: (information(tried[name]), name))
    return best, tried[best]
