"""Guaranteed set of accelerometers by the norm of gravity: linear in ten numbers but for one scalar.

With L the inverse of I + Γ, Q = LᵀL, q = Q b and c = bᵀQb a reading r [g] without error has r Q r − 2 r q + c = 1.
An error of each reading within σ changes that by a bounded amount. Only c = qᵀQ⁻¹q is not free:
0 ≤ c ≤ |q|²/(1 − ‖Q − 1‖). All numbers are about an estimate: Q is near one and q near zero. Runs of one instrument
share Q, and each has q and c of its own.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ...models.arrays import Floats, Ints
from ..bounded.programmes import Polytope, SolverError, chebyshev_radius
from .determinacy import COLUMNS, PRIOR_SD, ROWS
from .norm import LARGEST, norm_block, norm_equations

PAIRS = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""The six entries of Q − 1, in the order of Γ's."""
BOX = 0.1
"""Scale factors, misalignments and biases [g] are looked for so near to the estimate."""
START = np.array([2.0 if row == column else 1.0 for row, column in PAIRS]) * BOX
START_OF_RUN = np.array([1.0, 1.0, 1.0, 0.5]) * BOX
"""Limits of Q − 1, and of q and c of a run, before the readings count."""
ROUNDS = 12
ROUNDING = 1e-12
"""Largest error of the evaluation of a row by rounding."""
INSIDE = 1e-6
"""Part of its bound by which a reading may be off through rounding."""
CENTRINGS, SETTLED = 6, 1e-9
"""Most rounds to the central parameters, and a change that ends them."""
EMPTY = 1e-12
"""Remainder of the nearest point below which there is none."""


@dataclass(frozen=True, eq=False)
class Possible:
    """Possible parameters of accelerometers with readings in bounds.

    Attributes
    ----------
    radius : float
        least largest error of a reading that some parameters make, over its bound; above 1 none are possible
    ends : (2, 6 + 3 R) array or None
        least and largest value of each parameter, NaN of the biases of a run that its readings leave open; None where
        nothing is possible or the readings leave Γ open
    """

    radius: float
    ends: Floats | None = None

    def those(self, columns: Ints) -> "Possible":
        """Return some of the parameters."""
        return self if self.ends is None else replace(self, ends=self.ends[:, columns])


def possible_forces(x: NDArray, reading: NDArray, bound: NDArray, run: NDArray) -> Possible:
    """Return the possible parameters near an estimate.

    Parameters
    ----------
    x : (6 + 3 R,) array
        estimate
    reading : (K, 3) array
        mean readings [g]
    bound : (K, 3) array
        largest errors of the readings [g]
    run : (K,) array of int
        run of each reading
    """
    matrix = norm_block(x)[0]
    inverse = np.linalg.inv(matrix)
    # Readings about the estimate; an error of a reading is the inverse times as large there.
    about = (reading - x[6:].reshape(-1, 3)[run]) @ inverse.T
    equations = _Equations(about, run, inverse, bound)
    start = np.concatenate([START, np.tile(START_OF_RUN, (len(x) - 6) // 3)])
    limit, radius, ends = start, np.inf, None
    for _ in range(ROUNDS):
        radius = equations.radius(limit)
        ends = equations.ends(limit, np.eye(len(limit))) if radius <= 1.0 else None
        if ends is None:
            return Possible(radius)
        tighter = np.minimum(limit, np.abs(ends).max(axis=0) + ROUNDING)
        for square in range(9, len(limit), 4):
            tighter[square] = min(tighter[square], _largest_c(tighter[:6], tighter[square - 3 : square]))
        if (tighter > 0.99 * limit).all():
            break
        limit = tighter
    if ends is None:
        return Possible(radius)
    is_open = np.abs(ends).max(axis=0) > 0.999 * start
    if is_open[:6].any():
        return Possible(radius)
    ends = _ends_of_parameters(x, matrix, equations, limit)
    if ends is not None:
        of_run = is_open[6:].reshape(-1, 4)[:, :3].any(axis=1)
        ends[:, 6:][:, np.repeat(of_run, 3)] = np.nan
    return Possible(radius, ends)


def central_parameters(x: NDArray, reading: NDArray, bound: NDArray, run: NDArray) -> tuple[float, Floats]:
    """Return the least largest error of a reading over its bound, and parameters that make no larger one.

    The arguments are those of `possible_forces`.
    """
    radius, limit = np.inf, np.concatenate([PRIOR_SD[:6], np.tile(PRIOR_SD[6:], (len(x) - 6) // 3)])
    for _ in range(CENTRINGS):
        residual, slopes, _ = norm_equations(x, reading, run)
        low, high = _ends_of_residual(x, reading, bound, run)
        target, allowed = 0.5 * (low + high) - residual, 0.5 * (high - low)
        radius, step, _ = chebyshev_radius(slopes, target, allowed, low=-limit, high=limit)
        x = x + step
        if np.abs(step).max() < SETTLED:
            break
    return float(radius), x


def nearest_possible(
    x: NDArray, covariance: NDArray, centre: NDArray, reading: NDArray, bound: NDArray, run: NDArray
) -> Floats:
    """Return the parameters nearest to an estimate by its covariance that keep each reading within its bound.

    They are sought from the central parameters, which are returned where there are no others or the solver fails. The
    nearest point of a polyhedron comes from nonnegative least squares (C. L. Lawson, R. J. Hanson, 1974). The other
    arguments are those of `possible_forces`.
    """
    if _least_room(x, reading, bound, run) >= 0.0:
        return x
    triangle, nearest = np.linalg.cholesky(covariance), centre
    for _ in range(ROUNDS):
        residual, slopes, _ = norm_equations(nearest, reading, run)
        low, high = _ends_of_residual(nearest, reading, bound, run)
        residual = residual + slopes @ (x - nearest)
        rows = np.vstack([slopes, -slopes]) @ triangle
        ends = np.concatenate([low - residual, residual - high])
        scale = np.linalg.norm(rows, axis=1)
        target = np.append(np.zeros(len(x)), 1.0)
        system = np.vstack([(rows / scale[:, None]).T, ends / scale])
        try:
            remainder = system @ nnls(system, target)[0] - target
        except RuntimeError:
            # The rounds of the solver are limited.
            return centre
        if not remainder[-1] < -EMPTY:
            return centre
        before, nearest = nearest, x - triangle @ (remainder[:-1] / remainder[-1])
        if np.abs(nearest - before).max() < SETTLED:
            break
    return nearest if _least_room(nearest, reading, bound, run) >= 0.0 else centre


def _ends_of_residual(x: NDArray, reading: NDArray, bound: NDArray, run: NDArray) -> tuple[NDArray, NDArray]:
    """Return the least and the largest |n| − 1 (K,) that errors of the readings within their bounds explain."""
    _, _, back = norm_equations(x, reading, run)
    allowed = (np.abs(back) * bound).sum(axis=1)
    # The errors that change a norm most turn the input, too, which lengthens it.
    errors = (np.sign(back) * bound) @ np.linalg.inv(norm_block(x)[0]).T
    longer = 0.5 * (np.square(errors).sum(axis=1) - allowed**2)
    return -allowed - longer, allowed - longer


def _least_room(x: NDArray, reading: NDArray, bound: NDArray, run: NDArray) -> float:
    """Return the least distance of |n| − 1 from its ends over its bound, and a part of it for rounding."""
    residual = norm_equations(x, reading, run)[0]
    low, high = _ends_of_residual(x, reading, bound, run)
    return float((np.minimum(residual - low, high - residual) / -low).min()) + INSIDE


@dataclass(frozen=True, eq=False)
class _Equations:
    """Equations about an estimate: readings (K, 3) there, the run (K,) of each, L (3, 3), and bounds (K, 3) [g].

    The numbers are six of Q − 1, then three of q and one of c of each run.
    """

    about: Floats
    run: Ints
    inverse: Floats
    bound: Floats

    def radius(self, limit: NDArray) -> float:
        """Return the least largest error over its bound, within limits (6 + 4 R,) of the numbers."""
        rows, middle = self._rows(len(limit))
        low = _least(limit)
        size, slopes = self._sizes(limit)
        largest = 2.0 * (size + np.abs(slopes) @ limit) + self._square(limit) + ROUNDING
        return float(chebyshev_radius(rows, middle, largest, low=low, high=limit)[0])

    def ends(self, limit: NDArray, weights: NDArray) -> Floats | None:
        """Return the least and the largest value (2, T) of weights (T, 6 + 4 R) times the numbers within limits.

        None where a programme was not solved. A row is F = 1 + 2 (Q r − q)ρ − ρQρ, and |Q r − q| is below a linear
        function of the numbers.
        """
        rows, middle = self._rows(len(limit))
        size, slopes = self._sizes(limit)
        least = middle - 2.0 * size - self._square(limit) - ROUNDING
        most = middle + 2.0 * size + ROUNDING
        matrix = np.vstack([np.eye(len(limit)), rows - 2.0 * slopes, rows + 2.0 * slopes])
        free = np.full(len(rows), np.inf)
        low, high = _least(limit), limit
        scale = np.concatenate([np.maximum(limit, ROUNDING), np.tile(self.bound.max(axis=1), 2)])
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

    def _sizes(self, limit: NDArray) -> tuple[Floats, Floats]:
        """Return a linear function above σ |Lᵀ(Q r − q)| of each row: its value (K,) at zero and its slopes."""
        at_zero = self.about @ self.inverse
        slopes = np.zeros((len(self.about), 3, len(limit)))
        for number, (row, column) in enumerate(PAIRS):
            slopes[:, :, number] += self.inverse[row] * self.about[:, column, None]
            if row != column:
                slopes[:, :, number] += self.inverse[column] * self.about[:, row, None]
        of_run = 6 + 4 * self.run[:, None, None] + np.arange(3)
        np.put_along_axis(slopes, of_run, -self.inverse.T[None], axis=2)
        reach = np.abs(slopes) @ limit
        least, most = at_zero - reach, at_zero + reach
        # The chord of the absolute value between the ends; the value itself where its sign is certain.
        gain = np.where(
            least >= 0.0, 1.0, np.where(most <= 0.0, -1.0, (most + least) / np.maximum(most - least, 1e-300))
        )
        level = np.where((least >= 0.0) | (most <= 0.0), 0.0, most - gain * most)
        size = (self.bound * (gain * at_zero + level)).sum(axis=1)
        return size, np.einsum("ki,kin->kn", self.bound * gain, slopes)

    def _square(self, limit: NDArray) -> Floats:
        """Return the largest ρQρ of each row (K,)."""
        size = 1.0 + float(np.linalg.norm(_matrix_of(limit), 2))
        return size * np.square(self.bound @ np.abs(self.inverse).T).sum(axis=1)

    def _rows(self, width: int) -> tuple[NDArray, NDArray]:
        """Return rows (K, 6 + 4 R) of the equations, and their right-hand sides (K,)."""
        rows = np.zeros((len(self.about), width))
        for number, (row, column) in enumerate(PAIRS):
            rows[:, number] = self.about[:, row] * self.about[:, column] * (1.0 if row == column else 2.0)
        of_run = 6 + 4 * self.run[:, None] + np.arange(4)
        np.put_along_axis(rows, of_run, np.insert(-2.0 * self.about, 3, 1.0, axis=1), axis=1)
        return rows, 1.0 - np.square(self.about).sum(axis=1)


def _least(limit: NDArray) -> Floats:
    """Return the least values of the numbers within limits (6 + 4 R,): no c is below zero."""
    low = -limit
    low[9::4] = 0.0
    return low


def _matrix_of(limit: NDArray) -> Floats:
    """Return the limits (3, 3) of the entries of Q − 1."""
    full = np.zeros((3, 3))
    for number, (row, column) in enumerate(PAIRS):
        full[row, column] = full[column, row] = limit[number]
    return full


def _largest_c(limit: NDArray, bias: NDArray) -> float:
    """Return the largest c = qᵀQ⁻¹q within limits (6,) of Q − 1 and (3,) of q."""
    size = float(np.linalg.norm(_matrix_of(limit), 2))
    return float(bias @ bias) / (1.0 - size) if size < 0.9 else float(START_OF_RUN[3])


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


def _ends_of_parameters(x: NDArray, matrix: NDArray, equations: _Equations, limit: NDArray) -> Floats | None:
    """Return the ends of Γ and b: to first order exactly, and the rest by interval arithmetic."""
    largest, beyond = _triangle(limit)
    square = _matrix_of(limit)
    if np.linalg.norm(largest, 2) >= 0.9 or np.linalg.norm(square, 2) >= 0.9:
        return None
    # (I + Λ)⁻¹ = I − Λ + Λ²(I + Λ)⁻¹ and Q⁻¹q = q + (Q⁻¹ − 1) q
    rest = np.abs(matrix) @ (beyond + largest @ largest @ np.linalg.inv(np.eye(3) - largest))
    of_bias = np.abs(matrix) @ (square @ np.linalg.inv(np.eye(3) - square))
    weights, room = np.zeros((len(x), len(limit))), np.zeros(len(x))
    room[:6] = rest[ROWS, COLUMNS]
    for number, (row, column) in enumerate(PAIRS):
        part = np.zeros((3, 3))
        part[row, column] = 0.5 if row == column else 1.0
        weights[:6, number] = -(matrix @ part)[ROWS, COLUMNS]
    for run in range((len(x) - 6) // 3):
        bias, q = 6 + 3 * run + np.arange(3), 6 + 4 * run + np.arange(3)
        weights[np.ix_(bias, q)] = matrix
        room[bias] = of_bias @ limit[q]
    ends = equations.ends(limit, weights)
    if ends is None:
        return None
    ends = x + ends + np.array([-room, room])
    return None if (np.abs(ends) > LARGEST).any() else ends
