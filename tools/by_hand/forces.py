"""Accelerometers by the norm of gravity in any poses: weak prior, covariance, predicted error of an unseen pose.

reading/g = (I + Γ) n + b with |n| = 1 and Γ lower triangular, as in `motion.norm`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..motion.norm import COLUMNS, NAMES, ROWS, candidate_poses, inputs_of, norm_block, norm_equations
from ..rounding import upwards
from .small_turns import across, cross_matrices, rotations

PRIOR = np.array([0.05, 0.03, 0.05, 0.03, 0.03, 0.05, 0.1, 0.1, 0.1])
"""Weak prior, one standard deviation: scale factors 5 %, misalignments 30 mrad, biases 100 mg."""
FLOOR = 3e-4
"""Mean readings at rest err by so much whatever their noise [g]: what full fits of real records leave."""
FACE_ERROR = np.radians(2.0)
"""A face on a table is tilted by so much [rad]."""
SPARE = 6
"""Fewer readings beside the parameters tell no scatter."""
DIRECTIONS = 400
"""Directions of the unseen poses."""
OPEN_PART = 0.25
"""A direction is open where its variance is more than this part of the prior's."""
ROUNDS = 30
WORDS = ((1e-3, "determined"), (3e-3, "determined to {}"), (1e-2, "usable"), (3e-2, "near the poses seen"))
"""Largest predicted error of an unseen pose [g], and its word."""
UNDETERMINED = "not determined"
USABLE = 1e-2
"""Largest predicted error of an unseen pose of accelerometers that are usable [g]."""
POWER = 8
"""Power of the predicted errors whose mean a further pose is to lessen."""
MAIN_PART = 0.3
"""Parts of a direction below this, of its largest, are not named."""
MOST_POSES = 6
"""Largest number of poses that are asked for."""


def sphere(count: int = DIRECTIONS) -> NDArray[np.float64]:
    """Return directions (count, 3) spread evenly over the sphere, along a spiral."""
    steps = np.arange(count) + 0.5
    height = 1.0 - 2.0 * steps / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * steps
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


SPHERE = sphere()


@dataclass(frozen=True, eq=False)
class Forces:
    """Nine parameters of accelerometers with their covariance.

    Attributes
    ----------
    x : (9,) array
        as of `motion.norm.NAMES`
    covariance : (9, 9) array
        with the prior
    case : (3, 3) array or None
        turns inputs into the axes of the case; None where no faces are known
    case_error : float
        one standard deviation [rad]
    """

    x: NDArray[np.float64]
    covariance: NDArray
    case: NDArray[np.float64] | None = None
    case_error: float = 0.0

    @property
    def errors(self) -> NDArray[np.float64]:
        """Return standard errors (9,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Return the parameters (9,) whose error is less than half of the prior's."""
        return self.errors < np.sqrt(OPEN_PART) * PRIOR

    def pose_errors(self, directions: NDArray = SPHERE) -> NDArray[np.float64]:
        """Return the predicted errors (K,) of the norm [g] in poses with the vertical along directions (K, 3)."""
        slopes = slopes_at(self.x, directions)
        return np.sqrt(np.einsum("ki,ij,kj->k", slopes, self.covariance, slopes))

    def with_pose(self, direction: NDArray, deviation: float) -> "Forces":
        """Return the parameters as one further rest would leave them, with the vertical along a direction (3,)."""
        slope = slopes_at(self.x, direction[None, :])[0]
        gain = self.covariance @ slope
        return Forces(self.x, self.covariance - np.outer(gain, gain) / (slope @ gain + deviation**2))


def slopes_at(x: NDArray, directions: NDArray) -> NDArray[np.float64]:
    """Return the change (K, 9) of the norm by each parameter in poses with the vertical along directions (K, 3)."""
    matrix, bias = norm_block(x)
    return norm_equations(x, directions @ matrix.T + bias)[1]


def fitted_forces(reading: NDArray, deviation: NDArray, faces: "Faces | None" = None) -> Forces:
    """Fit the nine parameters by least squares with the weak prior.

    Parameters
    ----------
    reading : (K, 3) array
        mean readings [g]
    deviation : (K,) array
        standard deviations of their errors [g]
    faces : Faces, optional
        directions of the vertical in the axes of the case
    """
    x, case = np.zeros(9), None
    for _ in range(ROUNDS):
        residual, slopes, back = norm_equations(x, reading)
        weight = 1.0 / (deviation * np.linalg.norm(back, axis=1))
        values = [residual * weight, x / PRIOR]
        rows = [slopes * weight[:, None], np.diag(1.0 / PRIOR)]
        if faces is not None and case is None:
            case = faces.case_of(x, reading)
        if faces is not None and case is not None:
            off, by_x, by_case = faces.rows(x, case, reading)
            values.append(off)
            rows = [np.hstack([block, np.zeros((len(block), 3))]) for block in rows]
            rows.append(np.hstack([by_x, by_case]))
        matrix = np.vstack(rows)
        change = np.linalg.lstsq(matrix, -np.concatenate(values), rcond=None)[0]
        x = x + change[:9]
        if case is not None:
            case = rotations(change[9:]) @ case
        if np.abs(change).max() < 1e-12:
            break
    covariance = np.linalg.inv(matrix.T @ matrix)
    covariance[:9, :9] += _curvature(x, covariance[:9, :9], reading, deviation)
    if case is None:
        return Forces(x, covariance)
    return Forces(x, covariance[:9, :9], case, float(np.sqrt(np.linalg.eigvalsh(covariance[9:, 9:])[-1])))


def _curvature(x: NDArray, covariance: NDArray, reading: NDArray, deviation: NDArray) -> NDArray[np.float64]:
    """Return the addition (9, 9) to the covariance by the second order of the norms along open directions.

    A shift by a z², z of a unit normal distribution, has a mean square of 3 a².
    """
    added = np.zeros((9, 9))
    residual, slopes, back = norm_equations(x, reading)
    weight = 1.0 / np.square(deviation * np.linalg.norm(back, axis=1))
    values, vectors = np.linalg.eigh(covariance / np.outer(PRIOR, PRIOR))
    for value, vector in zip(values, vectors.T, strict=True):
        if value > OPEN_PART:
            step = np.sqrt(value) * PRIOR * vector
            ends = norm_equations(x + step, reading)[0] + norm_equations(x - step, reading)[0]
            shift = covariance @ (slopes.T @ (weight * (0.5 * ends - residual)))
            added += 3.0 * np.outer(shift, shift)
    return added


def scatter_of(forces: Forces, reading: NDArray, deviation: NDArray) -> tuple[float, float]:
    """Return the scatter of the norms over that by the readings' deviations, and the probability of a larger one.

    The scatter is NaN where too few readings are beside the parameters.
    """
    residual, _, back = norm_equations(forces.x, reading)
    ratio = residual / (deviation * np.linalg.norm(back, axis=1))
    freedom = len(reading) - 9.0 + float((np.diag(forces.covariance) / PRIOR**2).sum())
    if freedom < SPARE:
        return float("nan"), 1.0
    square = float(ratio @ ratio)
    return float(np.sqrt(square / freedom)), float(chdtrc(freedom, square))


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

    up: NDArray[np.float64]
    error: float = FACE_ERROR

    @property
    def known(self) -> NDArray[np.int_]:
        """Return the rests (F,) with a known direction."""
        return np.flatnonzero(np.isfinite(self.up).all(axis=1))

    def case_of(self, x: NDArray, reading: NDArray) -> NDArray[np.float64] | None:
        """Return the rotation (3, 3) of inputs into the axes of the case; None where fewer than two axes are known."""
        up = self.up[self.known]
        if not len(up) or np.linalg.matrix_rank(up, tol=0.3) < 2:
            return None
        left, _, right = np.linalg.svd(up.T @ inputs_of(x, reading[self.known]))
        sense = float(np.sign(np.linalg.det(left @ right)))
        return left @ np.diag([1.0, 1.0, sense]) @ right

    def tilts(self, x: NDArray, case: NDArray, reading: NDArray) -> NDArray[np.float64]:
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


def grade(worst: float) -> str:
    """Return the word for a predicted error of an unseen pose [g]."""
    for limit, word in WORDS:
        if worst <= limit:
            return word.format(f"{upwards(1e3 * worst)} mg")
    return UNDETERMINED


@dataclass(frozen=True)
class ClosingPose:
    """A pose in words, the parameters that a rest in it makes known, and the worst predicted error behind it [g]."""

    words: str
    parameters: tuple[str, ...]
    left: float


def poses_to_close(forces: Forces, deviation: float, least: float) -> list[ClosingPose]:
    """Return poses, each that lessens the predicted errors most.

    Parameters
    ----------
    forces : Forces
    deviation : float
        of a further rest [g]
    least : float
        the predicted error that needs no further pose [g]
    """
    poses: Mapping[str, NDArray] = candidate_poses()
    chosen: list[ClosingPose] = []
    while len(chosen) < MOST_POSES and forces.pose_errors().max() > least:
        after = {name: forces.with_pose(direction, deviation) for name, direction in poses.items()}
        # A high power stands for the worst case, and tells poses apart where several directions are equally open.
        size = {name: float(np.mean(other.pose_errors() ** POWER)) for name, other in after.items()}
        best = min(size, key=lambda name: (float(f"{size[name]:.9g}"), name))
        gain = (np.diag(forces.covariance) - np.diag(after[best].covariance)) / PRIOR**2
        known = tuple(name for name, part in zip(NAMES, gain, strict=True) if part > MAIN_PART * gain.max())
        forces = after[best]
        chosen.append(ClosingPose(best, known, float(forces.pose_errors().max())))
    return chosen


def open_directions(covariance: NDArray, prior: NDArray, names: Sequence[str] = NAMES) -> list[list[str]]:
    """Return the names of the parameters in each direction whose variance is more than a quarter of the prior's."""
    scaled = covariance / np.outer(prior, prior)
    values, vectors = np.linalg.eigh(scaled)
    directions = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value <= OPEN_PART:
            break
        parts = np.abs(vector)
        moved = [name for name, part in zip(names, parts, strict=True) if part > MAIN_PART * parts.max()]
        directions.append(moved)
    return directions
