"""Gyros of several runs together: M, and S where it is fitted, are the instrument's; biases and lag are each run's.

The axes of a true attitude are turned against those of the accelerometers, by a known rotation to within its error or
by any: (I + Mᵢ) = (I + M) Rᵢ. Where no run shows the accelerometers' axes, M is in those of the first true attitude.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..rounding import digits
from .calibration import CHANCE, HandFit
from .gyros import OF_TRUTH, PRIOR, GyroFit
from .moves import MATRIX, SENSITIVITY, Windows
from .run import Run
from .small_turns import cross_matrices, rotations

ROUNDS = 10
ANY = 1e6
"""Error of axes that may be any [rad]."""


@dataclass(frozen=True, eq=False)
class _Gyros:
    """Gyros of one run by their readings alone.

    Attributes
    ----------
    fit : GyroFit
    values : (s,) array
        shared parameters in the axes of the run
    information : (s, s) array
        of the readings, without the prior
    prior : (s,) array
        standard deviations before the readings
    axes_error : float
        error of the run's axes [rad]; 0 of those of the accelerometers
    covariance : (22, 22) array
        in the axes of the run
    """

    fit: GyroFit
    values: NDArray[np.float64]
    information: NDArray[np.float64]
    prior: NDArray[np.float64]
    axes_error: float
    covariance: NDArray[np.float64]

    @classmethod
    def of(cls, run: Run, fit: GyroFit, shared: NDArray[np.int_]) -> "_Gyros":
        """Return the gyros of a run."""
        axes_error, prior = 0.0, PRIOR.copy()
        covariance = fit.covariance.copy()
        if isinstance(run.moves, Windows):
            axes_error = ANY
            if run.moves.case_error is None:
                prior[MATRIX] = OF_TRUTH
            else:
                axes_error = run.moves.case_error
                covariance[MATRIX, MATRIX] -= axes_error**2 * np.eye(9)
        information = np.linalg.inv(covariance[np.ix_(shared, shared)]) - np.diag(1.0 / prior[shared] ** 2)
        return cls(
            fit, fit.values[shared], np.asarray(information, dtype=np.float64), prior[shared], axes_error, covariance
        )

    def predicted(self, values: NDArray, rotation: NDArray) -> tuple[NDArray, NDArray]:
        """Return the parameters (s,) in the axes of the run, and their slopes (s, s + 3) by shared ones and a turn."""
        matrix = np.eye(3) + values[:9].reshape(3, 3)
        of_run = values.copy()
        of_run[:9] = (matrix @ rotation - np.eye(3)).ravel()
        slopes = np.eye(len(values), len(values) + 3)
        slopes[:9, :9] = np.kron(np.eye(3), rotation.T)
        slopes[:9, -3:] = np.stack([(matrix @ turn @ rotation).ravel() for turn in cross_matrices(np.eye(3))], axis=1)
        return of_run, slopes


def with_pooled_gyros(runs: Sequence[Run], fits: Sequence[HandFit]) -> tuple[list[HandFit], list[str]]:
    """Return the fits with the shared parameters of all gyros, and warnings where these differ."""
    moved = [number for number, fit in enumerate(fits) if fit.gyros is not None]
    if len(moved) < 2:
        return list(fits), []
    fitted = [fit.gyros.fitted for fit in fits if fit.gyros is not None]
    shared = np.arange(MATRIX.start, MATRIX.stop)
    if all(SENSITIVITY.start in numbers for numbers in fitted):
        shared = np.arange(MATRIX.start, SENSITIVITY.stop)
    gyros = []
    for number in moved:
        fit = fits[number].gyros
        assert fit is not None
        gyros.append(_Gyros.of(runs[number], fit, shared))
    first = min(gyros, key=lambda gyro: gyro.axes_error)
    if first.axes_error == ANY:
        gyros[gyros.index(first)] = first = replace(first, axes_error=0.0)
    values, turned, covariance, scatter = _solved(gyros, first)
    lines = []
    if scatter > 1.0:
        lines.append(
            f"the gyros of the records differ by {digits(scatter, 2)} times what their errors explain: the standard "
            "errors of M hold that scatter"
        )
    together = list(fits)
    for place, number in enumerate(moved):
        columns = np.append(np.arange(len(shared)), len(shared) + 3 * place + np.arange(3))
        together[number] = _pooled(
            runs[number], fits[number], gyros[place], values, turned[place], covariance[np.ix_(columns, columns)]
        )
    return together, lines


def _solved(gyros: Sequence[_Gyros], first: _Gyros) -> tuple[NDArray, NDArray, NDArray, float]:
    """Return shared values (s,), rotations (R, 3, 3), their covariance, and the scatter over the errors, 1 at least."""
    values, count = first.values.copy(), len(first.values)
    turned = np.tile(np.eye(3), (len(gyros), 1, 1))
    for number, gyro in enumerate(gyros):
        if gyro.axes_error == ANY:
            of_run, of_first = (np.eye(3) + one.values[:9].reshape(3, 3) for one in (gyro, first))
            left, _, right = np.linalg.svd(np.linalg.solve(of_first, of_run), full_matrices=False)
            turned[number] = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    start = turned.copy()
    # Axes that are known exactly are turned by less than any error.
    errors = np.array([max(gyro.axes_error, 1e-9) for gyro in gyros])
    prior = np.concatenate([np.min([gyro.prior for gyro in gyros], axis=0), np.repeat(errors, 3)])
    for _ in range(ROUNDS):
        matrix, right, square = np.diag(prior**-2), np.zeros(len(prior)), 0.0
        right[:count] = -values / prior[:count] ** 2
        for number, gyro in enumerate(gyros):
            of_run, part = gyro.predicted(values, turned[number])
            columns = np.append(np.arange(count), count + 3 * number + np.arange(3))
            slopes = np.zeros((count, len(prior)))
            slopes[:, columns] = part
            off = gyro.values - of_run
            matrix += slopes.T @ gyro.information @ slopes
            right += slopes.T @ gyro.information @ off
            turn = _turn_of(turned[number] @ start[number].T)
            right[columns[count:]] -= turn / errors[number] ** 2
            square += float(off @ gyro.information @ off)
        covariance = np.linalg.inv(matrix)
        change = covariance @ right
        values = values + change[:count]
        turned = rotations(change[count:].reshape(-1, 3)) @ turned
        if np.abs(change).max() < 1e-10:
            break
    freedom = -float(len(prior) - (np.diag(covariance) / prior**2).sum())
    for gyro in gyros:
        own = np.linalg.inv(gyro.information + np.diag(gyro.prior**-2))
        freedom += count - float((np.diag(own) / gyro.prior**2).sum())
    scatter = 1.0
    if freedom > 1.0 and chdtrc(freedom, square) < CHANCE:
        scatter = math.sqrt(square / freedom)
    return values, turned, np.asarray(covariance * scatter**2), scatter


def _turn_of(rotation: NDArray) -> NDArray[np.float64]:
    """Return the vector (3,) of a small turn."""
    skew = 0.5 * (rotation - rotation.T)
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def _pooled(run: Run, fit: HandFit, gyros: _Gyros, values: NDArray, rotation: NDArray, covariance: NDArray) -> HandFit:
    """Return the fit of a run with pooled parameters, and its own ones as they follow from these."""
    old = gyros.fit
    assert run.moves is not None
    count = len(values)
    shared = np.arange(MATRIX.start, MATRIX.start + count)
    own = np.setdiff1d(old.fitted, shared)
    of_run, slopes = gyros.predicted(values, rotation)
    gain = gyros.covariance[np.ix_(own, shared)] @ np.linalg.inv(gyros.covariance[np.ix_(shared, shared)])
    new = old.values.copy()
    new[own] += gain @ (of_run - gyros.values)
    new[shared] = of_run
    missed = run.moves.rows(fit.forces, new).error
    new[shared] = values
    spread = old.covariance.copy()
    left = gyros.covariance[np.ix_(own, own)] - gain @ gyros.covariance[np.ix_(shared, own)]
    by_shared = gain @ slopes @ covariance
    spread[np.ix_(own, own)] = left + by_shared @ slopes.T @ gain.T
    spread[np.ix_(own, shared)] = by_shared[:, :count]
    spread[np.ix_(shared, own)] = by_shared[:, :count].T
    spread[np.ix_(shared, shared)] = covariance[:count, :count]
    forces = fit.forces
    if gyros.axes_error == ANY:
        error = float(np.sqrt(np.linalg.eigvalsh(covariance[count:, count:])[-1]))
        forces = replace(forces, case=rotation.T, case_error=error)
    return replace(fit, forces=forces, gyros=replace(old, values=new, covariance=spread, missed=missed))
