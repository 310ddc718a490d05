"""Guaranteed set of accelerometers by the norm of gravity: linear in ten numbers but for one scalar.

With L the inverse of I + Γ, Q = LᵀL, q = Q b and c = bᵀQb a reading r [g] without error has r Q r − 2 r q + c = 1.
An error of each reading within σ changes that by a bounded amount. Only c = qᵀQ⁻¹q is not free:
0 ≤ c ≤ |q|²/(1 − ‖Q − 1‖). All numbers are about an estimate: Q is near one and q near zero.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import Polytope, SolverError, chebyshev_radius
from ..motion.norm import COLUMNS, LARGEST, ROWS, norm_block

PAIRS = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""The six entries of Q − 1, in the order of Γ's."""
BOX = 0.1
"""Scale factors, misalignments and biases [g] are looked for so near to the estimate."""
START = np.array([2.0 if row == column else 1.0 for row, column in PAIRS] + [1.0, 1.0, 1.0, 0.5]) * BOX
"""Limits (10,) of Q − 1, q and c before the readings count."""
ROUNDS = 12
ROUNDING = 1e-12
"""Largest error of the evaluation of a row by rounding."""


@dataclass(frozen=True, eq=False)
class Possible:
    """Possible parameters of accelerometers with readings in bounds.

    Attributes
    ----------
    radius : float
        least largest error of a reading that some parameters make, over its bound; above 1 none are possible
    low, high : (9,) array or None
        ends of each parameter; None where nothing is possible or the readings leave the set open
    """

    radius: float
    low: NDArray[np.float64] | None
    high: NDArray[np.float64] | None


def possible_forces(x: NDArray, reading: NDArray, bound: float) -> Possible:
    """Return the possible parameters near an estimate.

    Parameters
    ----------
    x : (9,) array
        estimate
    reading : (K, 3) array
        mean readings [g]
    bound : float
        σ: no reading errs by more [g]
    """
    matrix, bias = norm_block(x)
    inverse = np.linalg.inv(matrix)
    # Readings about the estimate; an error of a reading is the inverse times as large there.
    about = (reading - bias) @ inverse.T
    equations = _Equations(about, inverse, bound)
    limit, radius, ends = START, np.inf, None
    for _ in range(ROUNDS):
        radius = equations.radius(limit)
        ends = equations.ends(limit, np.eye(10)) if radius <= 1.0 else None
        if ends is None:
            return Possible(radius, None, None)
        tighter = np.minimum(limit, np.abs(ends).max(axis=0) + ROUNDING)
        tighter[9] = min(tighter[9], _largest_c(tighter))
        if (tighter > 0.99 * limit).all():
            break
        limit = tighter
    if ends is None or (np.abs(ends[:, :9]).max(axis=0) > 0.999 * START[:9]).any():
        return Possible(radius, None, None)
    return _of_parameters(x, matrix, equations, limit, radius)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Equations about an estimate: readings (K, 3) there, L (3, 3) of the estimate, and σ [g]."""

    about: NDArray[np.float64]
    inverse: NDArray[np.float64]
    bound: float

    def radius(self, limit: NDArray) -> float:
        """Return the least largest error over its bound, within limits (10,) of the ten numbers."""
        rows, middle = _rows(self.about)
        low = np.append(-limit[:9], 0.0)
        size, slopes = self._sizes(limit)
        largest = 2.0 * self.bound * (size + np.abs(slopes) @ limit) + self._square(limit) + ROUNDING
        return float(chebyshev_radius(rows, middle, largest, low=low, high=limit)[0])

    def ends(self, limit: NDArray, weights: NDArray) -> NDArray[np.float64] | None:
        """Return the least and the largest value (2, T) of weights (T, 10) times the ten numbers within limits (10,).

        None where a programme was not solved. A row is F = 1 + 2 (Q r − q)ρ − ρQρ, and |Q r − q| is below a linear
        function of the ten numbers.
        """
        rows, middle = _rows(self.about)
        size, slopes = self._sizes(limit)
        least = middle - 2.0 * self.bound * size - self._square(limit) - ROUNDING
        most = middle + 2.0 * self.bound * size + ROUNDING
        matrix = np.vstack([np.eye(10), rows - 2.0 * self.bound * slopes, rows + 2.0 * self.bound * slopes])
        free = np.full(len(rows), np.inf)
        low, high = np.append(-limit[:9], 0.0), limit
        scale = np.concatenate([np.maximum(limit, ROUNDING), np.full(2 * len(rows), self.bound)])
        polytope = Polytope(matrix, scale, begin=np.arange(len(matrix)))
        polytope.confine(np.concatenate([low, -free, least]), np.concatenate([high, most, free]))
        ends = np.zeros((2, len(weights)))
        try:
            for number, weight in enumerate(weights):
                ends[0, number] = -polytope.maximise(-weight)[0]
                ends[1, number] = polytope.maximise(weight)[0]
        except SolverError:
            return None
        return ends

    def _sizes(self, limit: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a linear function above |Lᵀ(Q r − q)|₁ of each row: its value (K,) at zero and its slopes (K, 10)."""
        at_zero = self.about @ self.inverse
        slopes = np.zeros((len(self.about), 3, 10))
        for number, (row, column) in enumerate(PAIRS):
            slopes[:, :, number] += self.inverse[row] * self.about[:, column, None]
            if row != column:
                slopes[:, :, number] += self.inverse[column] * self.about[:, row, None]
        slopes[:, :, 6:9] = -self.inverse.T
        reach = np.abs(slopes) @ limit
        least, most = at_zero - reach, at_zero + reach
        # The chord of the absolute value between the ends; the value itself where its sign is certain.
        gain = np.where(
            least >= 0.0, 1.0, np.where(most <= 0.0, -1.0, (most + least) / np.maximum(most - least, 1e-300))
        )
        level = np.where((least >= 0.0) | (most <= 0.0), 0.0, most - gain * most)
        return (gain * at_zero + level).sum(axis=1), np.einsum("ki,kin->kn", gain, slopes)

    def _square(self, limit: NDArray) -> float:
        """Return the largest ρQρ."""
        size = 1.0 + float(np.linalg.norm(_matrix_of(limit), 2))
        return size * float(np.square(np.abs(self.inverse) @ np.full(3, self.bound)).sum())


def _rows(about: NDArray) -> tuple[NDArray, NDArray]:
    """Return rows (K, 10) of the equations, and their right-hand sides (K,)."""
    rows = np.zeros((len(about), 10))
    for number, (row, column) in enumerate(PAIRS):
        rows[:, number] = about[:, row] * about[:, column] * (1.0 if row == column else 2.0)
    rows[:, 6:9] = -2.0 * about
    rows[:, 9] = 1.0
    return rows, 1.0 - np.square(about).sum(axis=1)


def _matrix_of(limit: NDArray) -> NDArray[np.float64]:
    """Return the limits (3, 3) of the entries of Q − 1."""
    full = np.zeros((3, 3))
    for number, (row, column) in enumerate(PAIRS):
        full[row, column] = full[column, row] = limit[number]
    return full


def _largest_c(limit: NDArray) -> float:
    """Return the largest c = qᵀQ⁻¹q within limits (10,) of the others."""
    size = float(np.linalg.norm(_matrix_of(limit), 2))
    return float(limit[6:9] @ limit[6:9]) / (1.0 - size) if size < 0.9 else float(START[9])


def _triangle(limit: NDArray) -> tuple[NDArray, NDArray]:
    """Return limits (3, 3) of Λ, with Q = (I + Λ)ᵀ(I + Λ), and of its part beyond the first order in Q − 1."""
    entries = _matrix_of(limit)
    first = np.tril(entries, -1) + np.diag(0.5 * np.diag(entries))
    largest, beyond = first, np.zeros((3, 3))
    for _ in range(60):
        square = largest.T @ largest
        beyond = np.tril(square, -1) + np.diag(0.5 * np.diag(square))
        largest = np.minimum(first + beyond, 10.0)
    return largest, beyond


def _of_parameters(x: NDArray, matrix: NDArray, equations: _Equations, limit: NDArray, radius: float) -> Possible:
    """Return the ends of Γ and b: to first order exactly, and the rest by interval arithmetic."""
    largest, beyond = _triangle(limit)
    bias, square = limit[6:9], _matrix_of(limit)
    if np.linalg.norm(largest, 2) >= 0.9 or np.linalg.norm(square, 2) >= 0.9:
        return Possible(radius, None, None)
    # (I + Λ)⁻¹ = I − Λ + Λ²(I + Λ)⁻¹ and Q⁻¹q = q + (Q⁻¹ − 1) q
    rest = np.abs(matrix) @ (beyond + largest @ largest @ np.linalg.inv(np.eye(3) - largest))
    rest_of_bias = np.abs(matrix) @ (square @ np.linalg.inv(np.eye(3) - square)) @ bias
    weights = np.zeros((9, 10))
    for number, (row, column) in enumerate(PAIRS):
        part = np.zeros((3, 3))
        part[row, column] = 0.5 if row == column else 1.0
        weights[:6, number] = -(matrix @ part)[ROWS, COLUMNS]
    weights[6:, 6:9] = matrix
    ends = equations.ends(limit, weights)
    if ends is None:
        return Possible(radius, None, None)
    room = np.concatenate([rest[ROWS, COLUMNS], rest_of_bias])
    low, high = x + ends[0] - room, x + ends[1] + room
    if (np.maximum(np.abs(low), np.abs(high)) > LARGEST).any():
        return Possible(radius, None, None)
    return Possible(radius, low, high)
