"""Predicted error of an accelerometer calibration in a pose that was not measured, and the poses that lessen it.

The nine parameters are those of `norm`: Γ lower triangular, row by row, then the biases [g]. Rests at poses with slopes
J (K, 9) of |n| and standard deviations s (K,) leave the covariance C = (Jᵀ diag(1/s²) J + P⁻¹)⁻¹. P is the prior
covariance of any instrument. The error of |f| in a pose u has the variance j(u) C j(u)ᵀ. It judges a calibration of any
number of poses by its use; a count of poses or a singular value does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats

ROWS, COLUMNS = np.tril_indices(3)
"""Indices of the six elements of Γ."""
PRIOR_SD = np.array([0.05, 0.03, 0.05, 0.03, 0.03, 0.05, 0.1, 0.1, 0.1])
"""Standard deviations of the parameters of an unknown instrument: scale factors 5 %, misalignments 30 mrad, biases 0.1
g."""
LEAST_SD = 3e-4
"""A mean at rest errs by this [g] even where its noise is lower: the residuals of 13 real records are 1.1e-4 to
4.1e-4 g."""
OPEN = 0.25
"""A direction of the parameters is open where the rests leave more than this part of the variance before."""
DETERMINED, USABLE = 1e-3, 1e-2
"""Predicted standard errors of |f| [g] in the worst pose up to which a calibration is determined, and of use."""
USABLE_TURN = np.radians(1.0)
"""Largest predicted error of a turn of 90° of gyros that are usable [rad]."""
POWER = 8
"""Power of the predicted errors whose mean a further pose is to lessen."""
MOST_POSES = 24
"""Largest number of poses that are asked for."""


def _directions(count: int) -> Floats:
    """Return unit vectors (count, 3) spread evenly over the sphere (a Fibonacci lattice)."""
    number = np.arange(count) + 0.5
    height = 1.0 - 2.0 * number / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * number
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])


UNSEEN = _directions(400)
"""Poses over which the error is predicted: directions up (400, 3)."""
TURN_PRIOR_SD = np.where(np.eye(3) > 0.0, 0.03, 0.01).ravel()
"""Standard deviations of scale factors and misalignments M of unknown gyros, row by row."""
TURN_AXES = np.vstack([np.eye(3), UNSEEN[::5]])
"""Axes over which the error of a turn is predicted."""


def worst_turn(covariance: NDArray) -> tuple[float, Floats]:
    """Return the largest standard error of a turn of 90° [rad], and its axis (3,), by the covariance (9, 9) of M."""
    block = covariance.reshape(3, 3, 3, 3)
    of_axes = np.einsum("iakb,na,nb->nik", block, TURN_AXES, TURN_AXES)
    variances = np.linalg.eigvalsh(of_axes)[:, -1]
    worst = int(variances.argmax())
    return 0.5 * np.pi * float(np.sqrt(variances[worst])), TURN_AXES[worst]


def slopes_of(up: NDArray, x: NDArray | None = None) -> Floats:
    """Return the derivatives (K, 9) of |n| by the parameters in poses `up` (K, 3), at parameters x (9,) or nominal."""
    matrix = np.eye(3)
    if x is not None:
        matrix[ROWS, COLUMNS] += x[:6]
    back = up @ np.linalg.inv(matrix)
    return -np.hstack([back[:, ROWS] * up[:, COLUMNS], back]).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Determinacy:
    """Determinacy of the nine parameters by rests.

    Attributes
    ----------
    covariance : (9, 9) array
        of the parameters, with the prior of any instrument
    prior_sd : (9,) array
        standard deviations before the rests
    x : (9,) array or None
        the parameters; None of a nominal instrument
    """

    covariance: Floats
    prior_sd: Floats = field(default_factory=PRIOR_SD.copy)
    x: Floats | None = None

    @classmethod
    def of(cls, slopes: NDArray, sd: NDArray | float, prior_sd: NDArray = PRIOR_SD) -> Self:
        """Return the determinacy by rests with slopes (K, 9) of |n| and standard deviations (K,) [g]."""
        weights = 1.0 / np.broadcast_to(np.asarray(sd, dtype=float), (len(slopes),)) ** 2
        information = (slopes * weights[:, None]).T @ slopes + np.diag(1.0 / prior_sd**2)
        scaled = information * np.outer(prior_sd, prior_sd)
        covariance = np.linalg.inv(scaled) * np.outer(prior_sd, prior_sd)
        return cls(covariance.astype(np.float64), prior_sd)

    @classmethod
    def before(cls, prior_sd: NDArray = PRIOR_SD) -> Self:
        """Return the determinacy before any rest."""
        return cls(np.diag(prior_sd**2), prior_sd)

    @property
    def standard_errors(self) -> Floats:
        """Standard errors (9,) of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def determined(self) -> Bools:
        """The parameters (9,) whose variance is less than the part `OPEN` of that before the rests."""
        return self.standard_errors < np.sqrt(OPEN) * self.prior_sd

    def pose_errors(self, up: NDArray = UNSEEN) -> Floats:
        """Return the standard error (M,) [g] of |f| in poses `up` (M, 3)."""
        slopes = slopes_of(up, self.x)
        return np.sqrt(np.einsum("ki,ij,kj->k", slopes, self.covariance, slopes))

    @property
    def worst(self) -> float:
        """The largest standard error of |f| [g] over all poses."""
        return float(self.pose_errors().max())

    @property
    def rms(self) -> float:
        """The root mean square of the standard error [g] over all poses."""
        return float(np.sqrt(np.mean(self.pose_errors() ** 2)))

    @property
    def open(self) -> Floats:
        """The open directions (m, 9): combinations of the parameters, in units of their standard deviations before.

        The most open is the first; a row's largest element is positive.
        """
        part = self.covariance / np.outer(self.prior_sd, self.prior_sd)
        values, vectors = np.linalg.eigh(part)
        rows = vectors.T[::-1][values[::-1] > OPEN]
        largest = np.abs(rows).argmax(axis=1)
        return rows * np.sign(rows[np.arange(len(rows)), largest])[:, None]

    def with_pose(self, up: NDArray, sd: float) -> Self:
        """Return the determinacy after one more rest, with direction `up` (3,) and standard deviation `sd` [g]."""
        slopes = slopes_of(up[None, :], self.x)[0]
        change = self.covariance @ slopes
        covariance = self.covariance - np.outer(change, change) / (sd**2 + slopes @ change)
        return replace(self, covariance=covariance)


@dataclass(frozen=True)
class Pose:
    """A pose to set by hand.

    Attributes
    ----------
    words : str
        how it is set
    up : (3,) array
        direction up, in axes of the instrument
    after : Determinacy
        after its rest
    """

    words: str
    up: Floats
    after: Determinacy


def candidate_poses() -> dict[str, NDArray]:
    """Poses that a person can set by hand: an axis up or down, or two axes at 45°; name to n (3,) [g]."""
    words = ((1.0, "up"), (-1.0, "down"))
    poses = {}
    for p in range(3):
        for sign, word in words:
            poses[f"axis {p + 1} {word}"] = sign * np.eye(3)[p]
    for p, q in combinations(range(3), 2):
        for first, first_word in words:
            for second, second_word in words:
                direction = (first * np.eye(3)[p] + second * np.eye(3)[q]) / np.sqrt(2.0)
                poses[f"axis {p + 1} {first_word} and axis {q + 1} {second_word}, both at 45°"] = direction
    return poses


def closing_poses(
    determinacy: Determinacy, wanted: float, sd: float = LEAST_SD, most: int = MOST_POSES
) -> Sequence[Pose]:
    """Return the poses that bring the worst predicted error down to `wanted` [g], the most useful first.

    Each is the candidate that lessens the predicted errors most; after each they are predicted again. There are at most
    `most`: `after` of the last one is the error that all of them reach.
    """
    poses: list[Pose] = []
    while determinacy.worst > wanted and len(poses) < most:
        trials = []
        for words, up in candidate_poses().items():
            trials.append(Pose(words, up, determinacy.with_pose(up, sd)))
        best = min(trials, key=_size)
        poses.append(best)
        determinacy = best.after
    return poses


def _size(pose: Pose) -> tuple[float, str]:
    """Return the size of the errors after a pose: the worst, and others where several directions are equally open."""
    return float(f"{np.mean(pose.after.pose_errors() ** POWER):.9g}"), pose.words
