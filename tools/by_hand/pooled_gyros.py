"""Gyros of several runs together: M, and S where it is fitted, are the instrument's; biases and lag are each run's.

The axes of a true attitude are turned against those of the accelerometers, by a known rotation to within its error or
by any: I + Mᵢ = (I + M) Rᵢ. Where no run shows the accelerometers' axes, M is in those of the first true attitude.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ...models.arrays import Floats, Ints
from ...models.bench import MATRIX, SENSITIVITY
from ..rounding import digits
from .calibration import CHANCE, HandFit
from .gyros import OF_TRUTH, PRIOR, GyroFit
from .moves import Windows
from .run import Run
from .small_turns import cross_matrices, nearest_rotation, rotations

ROUNDS = 10
ANY = 1e6
"""Error of axes that may be any [rad]."""
EXACT = 1e-9
"""Error of axes that are known exactly: turned by less than any error [rad]."""


@dataclass(frozen=True, eq=False)
class RunGyros:
    """Gyros of one run by its readings alone, in the axes of the run.

    Attributes
    ----------
    run : Run
    fit : GyroFit
    shared : (s,) array of int
        numbers of the shared parameters
    axes_error : float
        error of the run's axes [rad]; 0 of those of the accelerometers
    prior : (s,) array
        standard deviations of the shared parameters before the readings
    covariance : (22, 22) array
        without the error of the axes
    """

    run: Run
    fit: GyroFit
    shared: Ints
    axes_error: float
    prior: Floats
    covariance: Floats

    @classmethod
    def of(cls, run: Run, fit: GyroFit, shared: Ints) -> "RunGyros":
        """Return the gyros of a run."""
        axes_error, prior, covariance = 0.0, PRIOR.copy(), fit.covariance.copy()
        if isinstance(run.moves, Windows):
            axes_error = ANY if run.moves.case_error is None else run.moves.case_error
            if axes_error == ANY:
                prior[MATRIX] = OF_TRUTH
            else:
                covariance[MATRIX, MATRIX] -= axes_error**2 * np.eye(9)
        return cls(run, fit, shared, axes_error, prior[shared], covariance)

    @property
    def values(self) -> Floats:
        """The shared parameters (s,)."""
        return self.fit.values[self.shared]

    @property
    def information(self) -> Floats:
        """The information (s, s) of the readings on the shared parameters: without the prior's."""
        return np.linalg.inv(self.covariance[np.ix_(self.shared, self.shared)]) - np.diag(self.prior**-2)

    @property
    def matrix(self) -> Floats:
        """I + M (3, 3)."""
        return np.eye(3) + self.fit.values[MATRIX].reshape(3, 3)


@dataclass(frozen=True, eq=False)
class SharedGyros:
    """Shared parameters of gyros of several runs.

    Attributes
    ----------
    values : (s,) array
    rotations : (R, 3, 3) array
        R of each run
    covariance : (s + 3 R, s + 3 R) array
        of the values, and of a small turn of each run's axes [rad]; known turns may err alike in all runs
    scatter : float
        differences between runs in units of their errors, at least 1; the covariance holds them
    """

    values: Floats
    rotations: Floats
    covariance: Floats
    scatter: float


def _columns(count: int, number: int) -> Ints:
    """Return the columns (s + 3,) of the shared parameters, and of the turn of one run's axes."""
    return np.append(np.arange(count), count + 3 * number + np.arange(3))


def _determined(covariance: NDArray, prior: NDArray) -> float:
    """Return the number of parameters that readings determine, and the prior does not."""
    return len(prior) - float((np.diag(covariance) / prior**2).sum())


def share_gyros(runs: Sequence[Run], fits: Sequence[HandFit]) -> tuple[list[HandFit], list[str]]:
    """Return the fits with the shared parameters of all gyros, and warnings where these differ."""
    numbers = [number for number, fit in enumerate(fits) if fit.gyros is not None]
    gyro_fits = [fit.gyros for fit in fits if fit.gyros is not None]
    if len(numbers) < 2:
        return list(fits), []
    sensitive = all(SENSITIVITY.start in fit.fitted for fit in gyro_fits)
    shared = np.arange(MATRIX.start, SENSITIVITY.stop if sensitive else MATRIX.stop)
    gyros = [RunGyros.of(runs[number], fit, shared) for number, fit in zip(numbers, gyro_fits, strict=True)]
    first = min(range(len(gyros)), key=lambda place: gyros[place].axes_error)
    if gyros[first].axes_error == ANY:
        gyros[first] = replace(gyros[first], axes_error=0.0)
    solution = shared_gyros(gyros, gyros[first])
    warnings = []
    if solution.scatter > 1.0:
        warnings.append(
            f"the gyros of the records differ by {digits(solution.scatter, 2)} times what their errors explain: the "
            "standard errors of M hold that scatter"
        )
    fits_together = list(fits)
    for place, number in enumerate(numbers):
        fits_together[number] = _with_shared(fits[number], gyros[place], solution, place)
    return fits_together, warnings


def in_axes_of_run(values: NDArray, rotation: NDArray) -> tuple[NDArray, NDArray]:
    """Return shared parameters (s,) in axes with I + Mᵢ = (I + M) R, and their slopes (s, s + 3) by M, S and a turn."""
    matrix = np.eye(3) + values[:9].reshape(3, 3)
    of_run = values.copy()
    of_run[:9] = (matrix @ rotation - np.eye(3)).ravel()
    slopes = np.eye(len(values), len(values) + 3)
    slopes[:9, :9] = np.kron(np.eye(3), rotation.T)
    slopes[:9, -3:] = np.stack([(matrix @ turn @ rotation).ravel() for turn in cross_matrices(np.eye(3))], axis=1)
    return of_run, slopes


def shared_gyros(gyros: Sequence[RunGyros], first: RunGyros) -> SharedGyros:
    """Return the shared parameters by least squares, beginning with those of one run.

    With N of a run's information, v of its values and p of the shared ones in its axes, the sum of (v − p)ᵀ N (v − p)
    over the runs is least, beside the prior and the errors of the axes.
    """
    values, count = first.values, len(first.shared)
    start = np.tile(np.eye(3), (len(gyros), 1, 1))
    for number, one in enumerate(gyros):
        if one.axes_error == ANY:
            start[number] = nearest_rotation(np.linalg.solve(first.matrix, one.matrix))
    turned, information = start, [one.information for one in gyros]
    axes_errors = np.repeat([max(one.axes_error, EXACT) for one in gyros], 3)
    prior = np.concatenate([np.min([one.prior for one in gyros], axis=0), axes_errors])
    for _ in range(ROUNDS):
        turns = [_small_turn(now @ before.T) for now, before in zip(turned, start, strict=True)]
        normal, gradient = np.diag(prior**-2), -np.concatenate([values, *turns]) / prior**2
        square, by_turns = 0.0, np.zeros(len(prior))
        for number, one in enumerate(gyros):
            of_run, slopes = in_axes_of_run(values, turned[number])
            columns, off = _columns(count, number), one.values - of_run
            normal[np.ix_(columns, columns)] += slopes.T @ information[number] @ slopes
            gradient[columns] += slopes.T @ information[number] @ off
            by_turns[columns] += slopes.T @ information[number] @ one.fit.by_turns[one.shared]
            square += float(off @ information[number] @ off)
        covariance = np.linalg.inv(normal)
        change = covariance @ gradient
        values = values + change[:count]
        turned = rotations(change[count:].reshape(-1, 3)) @ turned
        if np.abs(change).max() < 1e-10:
            break
    alone = [_determined(one.covariance[np.ix_(one.shared, one.shared)], one.prior) for one in gyros]
    freedom = sum(alone) - _determined(covariance, prior)
    scatter = 1.0
    if freedom > 1.0 and chdtrc(freedom, square) < CHANCE:
        scatter = math.sqrt(square / freedom)
    # The runs' own covariances hold that error as if it were another in each.
    alike, count_turned = np.dot(covariance, by_turns), sum(bool(one.fit.by_turns.any()) for one in gyros)
    covariance = covariance * scatter**2 + (1.0 - 1.0 / max(count_turned, 1)) * np.outer(alike, alike)
    return SharedGyros(values, turned, covariance, scatter)


def _small_turn(rotation: NDArray) -> Floats:
    """Return the vector (3,) of a small turn."""
    skew = 0.5 * (rotation - rotation.T)
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def _with_shared(fit: HandFit, gyros: RunGyros, solution: SharedGyros, number: int) -> HandFit:
    """Return the fit of a run with the shared parameters, and with its biases and lag as they follow from these.

    With v, C of the run alone, s its shared and o its other parameters, K = C_os C_ss⁻¹: o becomes
    v_o + K (p − v_s), p of the shared parameters in its axes, and keeps the covariance C_oo − K C_so beside p's.
    """
    moves = gyros.run.moves
    assert moves is not None
    shared, others = gyros.shared, np.setdiff1d(gyros.fit.fitted, gyros.shared)
    columns = _columns(len(shared), number)
    of_solution = solution.covariance[np.ix_(columns, columns)]
    in_axes, slopes = in_axes_of_run(solution.values, solution.rotations[number])
    across = gyros.covariance[np.ix_(others, shared)]
    follow = across @ np.linalg.inv(gyros.covariance[np.ix_(shared, shared)])
    values = gyros.fit.values.copy()
    values[others] += follow @ (in_axes - gyros.values)
    values[shared] = in_axes
    missed = moves.rows(fit.forces, values).error
    values[shared] = solution.values
    by_solution = np.vstack([np.eye(len(shared), len(columns)), follow @ slopes])
    joint = by_solution @ of_solution @ by_solution.T
    joint[len(shared) :, len(shared) :] += gyros.covariance[np.ix_(others, others)] - follow @ across.T
    covariance = gyros.fit.covariance.copy()
    every = np.append(shared, others)
    covariance[np.ix_(every, every)] = joint
    forces = fit.forces
    if gyros.axes_error == ANY:
        turn = of_solution[len(shared) :, len(shared) :]
        error = float(np.sqrt(np.linalg.eigvalsh(turn)[-1]))
        forces = replace(forces, case=solution.rotations[number].T, case_error=error)
    return replace(fit, forces=forces, gyros=replace(gyros.fit, values=values, covariance=covariance, missed=missed))
