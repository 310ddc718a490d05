"""Accelerometers by the norm of gravity in any poses: weak prior, covariance, predicted error of an unseen pose.

reading/g = (I + Γ) n + b with |n| = 1 and Γ lower triangular, as in `motion.norm`. Runs of one instrument share Γ.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ...models.arrays import Floats, Ints
from ..motion.determinacy import COLUMNS, OPEN, PRIOR_SD, ROWS, Determinacy
from ..motion.norm import inputs_of, norm_block, norm_equations
from .small_turns import across, cross_matrices, nearest_rotation, rotations

FACE_ERROR = np.radians(2.0)
"""Tilt of a face on a table [rad]."""
SPARE = 6
"""Fewer readings beside the parameters tell no scatter."""
LEAST_SPARE = 0.5
"""With less beside the parameters nothing at all does."""
LARGEST_SCATTER, LEAST_SCATTER = 33.0, 0.1
"""Errors of readings in units of their standard deviation: 10 mg, and of those that nothing measures also 0.03 mg."""
USUAL = 0.9
"""Part of the records whose rests err by no more than their noise."""
ROUNDS = 30


@dataclass(frozen=True, eq=False)
class Forces:
    """Parameters of accelerometers with their covariance: nine, of several runs 6 + 3 R.

    Attributes
    ----------
    x : (9,) or (6 + 3 R,) array
        as of `motion.norm.NAMES`
    covariance : (9, 9) or (6 + 3 R, 6 + 3 R) array
        with the prior
    case : (3, 3) array or None
        turns inputs into the axes of the case; None where no faces are known
    case_error : float
        one standard deviation [rad]
    """

    x: Floats
    covariance: NDArray
    case: Floats | None = None
    case_error: float = 0.0

    @property
    def determinacy(self) -> Determinacy:
        """Return the predicted errors in poses that were not measured."""
        return Determinacy(self.covariance, x=self.x)


@dataclass(frozen=True, eq=False)
class Norms:
    """Mean readings at rest, whose norms are gravity's, of one run or of several with the same Γ.

    Attributes
    ----------
    reading : (K, 3) array
        [g]
    deviation : (K,) array
        standard deviations of their errors [g]
    run : (K,) array of int
        run of each, from 0: each run has biases of its own
    runs : int
        number R of runs; one may be without readings
    """

    reading: Floats
    deviation: Floats
    run: Ints
    runs: int = 1

    @classmethod
    def of(cls, reading: NDArray, deviation: NDArray) -> "Norms":
        """Return the norms of one run."""
        return cls(reading, deviation, np.zeros(len(reading), dtype=int))

    @property
    def prior(self) -> Floats:
        """Standard deviations (6 + 3 R,) of the six of Γ and each run's biases before the readings."""
        return np.concatenate([PRIOR_SD[:6], np.tile(PRIOR_SD[6:], self.runs)])

    def equations(self, x: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Return |n| − 1, its slopes by the parameters, and its sensitivity to errors of the readings."""
        return norm_equations(x, self.reading, self.run)

    def weighted(self, x: NDArray) -> tuple[NDArray, NDArray]:
        """Return |n| − 1 (K,) over its standard deviation, and its slopes (K, 6 + 3 R)."""
        residual, slopes, back = self.equations(x)
        weight = 1.0 / (self.deviation * np.linalg.norm(back, axis=1))
        return residual * weight, slopes * weight[:, None]

    def square(self, x: NDArray) -> float:
        """Return the sum of the squares of |n| − 1 over its standard deviation."""
        return float(np.square(self.weighted(x)[0]).sum())

    def effective(self, forces: Forces) -> float:
        """Return the number of parameters that the readings determine, and the prior does not."""
        return float(len(forces.x)) - float((np.diag(forces.covariance) / self.prior**2).sum())

    def spare(self, forces: Forces) -> float:
        """Return the number of readings beside the parameters that they determine."""
        return len(self.reading) - self.effective(forces)


def fitted_forces(norms: Norms, faces: "Faces | None" = None) -> Forces:
    """Fit the parameters of accelerometers by least squares with the weak prior.

    Parameters
    ----------
    norms : Norms
    faces : Faces, optional
        directions of the vertical in the axes of the case, of one run
    """
    prior, reading = norms.prior, norms.reading
    count = len(prior)
    x, case = np.zeros(count), None
    for _ in range(ROUNDS):
        residual, slopes = norms.weighted(x)
        values = [residual, x / prior]
        rows = [slopes, np.diag(1.0 / prior)]
        if faces is not None and case is None:
            case = faces.case_of(x, reading)
        if faces is not None and case is not None:
            off, by_x, by_case = faces.rows(x, case, reading)
            values.append(off)
            rows = [np.hstack([block, np.zeros((len(block), 3))]) for block in rows]
            rows.append(np.hstack([by_x, by_case]))
        matrix = np.vstack(rows)
        change = np.linalg.lstsq(matrix, -np.concatenate(values), rcond=None)[0]
        x = x + change[:count]
        if case is not None:
            case = rotations(change[count:]) @ case
        if np.abs(change).max() < 1e-12:
            break
    covariance = np.linalg.inv(matrix.T @ matrix)
    covariance[:count, :count] += _curvature(x, covariance[:count, :count], norms)
    if case is None:
        return Forces(x, covariance)
    case_error = float(np.sqrt(np.linalg.eigvalsh(covariance[count:, count:])[-1]))
    return Forces(x, covariance[:count, :count], case, case_error)


def _curvature(x: NDArray, covariance: NDArray, norms: Norms) -> Floats:
    """Return the addition to the covariance by the second order of the norms along open directions.

    A shift by a z², z of a unit normal distribution, has a mean square of 3 a².
    """
    added, prior = np.zeros_like(covariance), norms.prior
    residual, slopes, back = norms.equations(x)
    weight = 1.0 / np.square(norms.deviation * np.linalg.norm(back, axis=1))
    values, vectors = np.linalg.eigh(covariance / np.outer(prior, prior))
    for value, vector in zip(values, vectors.T, strict=True):
        if value > OPEN:
            step = np.sqrt(value) * prior * vector
            ends = norms.equations(x + step)[0] + norms.equations(x - step)[0]
            shift = covariance @ (slopes.T @ (weight * (0.5 * ends - residual)))
            added += 3.0 * np.outer(shift, shift)
    return added


def scatter_of(forces: Forces, norms: Norms, *, known: bool, measured: bool) -> tuple[float, float]:
    """Return the scatter of the norms over that by the readings' deviations, and the probability of a larger one.

    Parameters
    ----------
    forces : Forces
    norms : Norms
    known, measured : bool
        whether the deviations are given, and whether the noise at rest tells them; else the norms alone do. The scatter
        is NaN where they are measured, and too few readings are beside the parameters.
    """
    freedom = norms.spare(forces)
    if measured and freedom < LEAST_SPARE:
        return float("nan"), 1.0
    if not measured or (not known and freedom < SPARE):
        return _probable_scatter(forces, norms, measured), 1.0
    square = norms.square(forces.x)
    return float(np.sqrt(square / freedom)), float(chdtrc(freedom, square))


def _probable_scatter(forces: Forces, norms: Norms, measured: bool) -> float:
    """Return the rms scatter that few norms make probable.

    With J of the slopes, P of the prior and r of the norms without parameters, r has the covariance J P Jᵀ + s² I. Each
    s is as probable as another before, but for the part of measured ones that err by no more than their noise.
    """
    residual, slopes = norms.weighted(forces.x)
    scaled = slopes * norms.prior
    spread, vectors = np.linalg.eigh(scaled @ scaled.T)
    square = np.square((residual - slopes @ forces.x) @ vectors)
    sizes = np.geomspace(1.0 if measured else LEAST_SCATTER, LARGEST_SCATTER, 200)
    before = np.full(len(sizes), (1.0 - USUAL * measured) / len(sizes))
    before[0] += USUAL * measured
    variance = np.maximum(spread, 0.0) + np.square(sizes[:, None])
    likelihood = -0.5 * (np.log(variance) + square / variance).sum(axis=1)
    weight = before * np.exp(likelihood - likelihood.max())
    return float(np.sqrt(weight @ np.square(sizes) / weight.sum()))


@dataclass(frozen=True, eq=False)
class Faces:
    """Known directions of the vertical at rests.

    Attributes
    ----------
    up : (K, 3) array
        unit vectors in the axes of the case, NaN where they are not known
    error : float
        tilt of a face, one standard deviation [rad]
    """

    up: Floats
    error: float = FACE_ERROR

    @property
    def known(self) -> Ints:
        """Return the rests (F,) with a known direction."""
        return np.flatnonzero(np.isfinite(self.up).all(axis=1))

    def case_of(self, x: NDArray, reading: NDArray) -> Floats | None:
        """Return the rotation (3, 3) of inputs into the axes of the case; None where fewer than two axes are known."""
        up = self.up[self.known]
        if not len(up) or np.linalg.matrix_rank(up, tol=0.3) < 2:
            return None
        return nearest_rotation(up.T @ inputs_of(x, reading[self.known]))

    def tilts(self, x: NDArray, case: NDArray, reading: NDArray) -> Floats:
        """Return the angles (F,) between measured and known directions [rad]."""
        up = directions_of(x, reading[self.known])[0] @ case.T
        known = self.up[self.known]
        return np.arctan2(np.linalg.norm(np.cross(up, known), axis=1), np.einsum("ij,ij->i", up, known))

    def rows(self, x: NDArray, case: NDArray, reading: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Return tilts (2 F,) over their error, and slopes by parameters (2 F, 9) and turns of the case (2 F, 3)."""
        up, _, by_x = directions_of(x, reading[self.known])
        turned = up @ case.T
        sideways = across(self.up[self.known]) / self.error
        off = np.einsum("mki,mi->mk", sideways, turned - self.up[self.known])
        by_case = -sideways @ cross_matrices(turned)
        return off.ravel(), (sideways @ case @ by_x).reshape(-1, 9), by_case.reshape(-1, 3)


def directions_of(x: NDArray, reading: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return directions (K, 3) of inputs, and their changes by readings (K, 3, 3) and by parameters (K, 3, 9)."""
    n = inputs_of(x, reading)
    size = np.linalg.norm(n, axis=1)
    up = n / size[:, None]
    inverse = np.linalg.inv(norm_block(x)[0])
    by_reading = (np.eye(3) - up[:, :, None] * up[:, None, :]) / size[:, None, None] @ inverse
    by_x = np.zeros((len(n), 3, 9))
    for number, (row, column) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        by_x[:, :, number] = -by_reading[:, :, row] * n[:, column, None]
    by_x[:, :, 6:] = -by_reading
    return up, by_reading, by_x
