"""Gyros by least squares: mean rates at rest, moves, windows with a true attitude, known turns, and a weak prior.

The accelerometers are known from the norm of gravity: their covariance is a prior of their nine parameters here.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from ...models.arrays import Floats, Ints
from ...models.bench import BIAS, EARTH_RATE, LAG, MATRIX, SENSITIVITY
from ..calibrated import TakenSensitivity
from ..motion.determinacy import TURN_PRIOR_SD, worst_turn
from ..motion.norm import inputs_of
from .forces import LEAST_SPARE, SPARE, Forces
from .moves import GYROS, TURN_BIAS, Moves, PieceRows, Turns, Windows
from .still import StillRests

PRIOR = np.concatenate([np.ones(3), TURN_PRIOR_SD, np.full(9, 0.1), [0.1]])
"""Weak prior, one standard deviation: scale factors 3 %, misalignments 10 mrad; in practice none of biases [rad/s],
sensitivities [rad/s per g] and the lag [s]."""
OF_TRUTH = 1.0
"""The same of M in the axes of a true attitude, which may be any."""
MOVE_ERROR, LEAST_MOVE = 2e-3, 1e-4
"""Error of a move where too few tell it, and the least [rad]."""
CHANCE = 1e-6
"""Sensitivities to gravity are proven where chance explains them with a smaller probability, and they halve the
scatter of the rates at rest."""
DRIFTS = 1e-3 / 3.0
"""The bias of a gyro drifts where chance explains the trend of its mean rates with a smaller probability."""
FEWEST_RESTS = 7
"""Fewer quiet rests prove no sensitivity."""
FAR = 3.0
"""Rates at rest farther from the others, in units of their scatter, count less."""
UNKNOWN_RATE = 1e-3
"""Error of a mean rate where fewer than three tell it [rad/s]."""
ROUNDS = 15


@dataclass(frozen=True, eq=False)
class BiasChange:
    """Change (3,) of the gyros' biases [rad/s], 0 of those that keep theirs: before a rest, or all along (None)."""

    rest: int | None
    size: Floats


@dataclass(frozen=True, eq=False)
class GyroFit:
    """Parameters of gyros with their covariance.

    Attributes
    ----------
    values : (22,) array
        B [rad/s], M, S [rad/s per g], L [s]
    covariance : (22, 22) array
        zero for parameters that are not fitted
    fitted : (G,) array of int
        numbers of the parameters that are fitted
    sensitivity : TakenSensitivity or None
    missed : (M, d) array
        errors of the moves or windows [rad]
    change : BiasChange or None
        where the mean rates at rest prove it
    by_turns : (22,) array
        change of the values where all known turns are wrong alike by their usual error; the covariance holds it
    """

    values: Floats
    covariance: Floats
    fitted: Ints
    sensitivity: TakenSensitivity | None
    missed: Floats
    change: BiasChange | None = None
    by_turns: Floats = field(default_factory=lambda: np.zeros(GYROS))

    @property
    def errors(self) -> Floats:
        """Return standard errors (22,)."""
        return np.sqrt(np.diag(self.covariance))

    def turn_error(self) -> tuple[float, Floats]:
        """Return the predicted error of a turn of 90° [rad], one standard deviation, and its worst axis (3,)."""
        return worst_turn(self.covariance[MATRIX, MATRIX])


def quiet_rests(rests: StillRests) -> Ints:
    """Return the half of the rests whose gyros are quietest; a hand that trembles moves a mean rate."""
    assert rests.unrest is not None
    return np.flatnonzero(rests.unrest <= np.median(rests.unrest))


def sensitivity_of(rests: StillRests, forces: Forces) -> TakenSensitivity | None:
    """Test whether the mean rates at quiet rests depend on gravity; None of too few rests."""
    quiet = quiet_rests(rests)
    if len(quiet) < FEWEST_RESTS or rests.rate is None:
        return None
    rate = rests.rate[quiet]
    design = np.column_stack([np.ones(len(quiet)), inputs_of(forces.x, rests.force[quiet])])
    if np.linalg.svd(design, compute_uv=False)[-1] < 0.3:
        return None
    residual = rate - design @ np.linalg.lstsq(design, rate, rcond=None)[0]
    before, after = np.square(rate - rate.mean(axis=0)).sum(), np.square(residual).sum()
    of_level, of_design = rate.size - 3, rate.size - 12
    if not after > 0.0:
        return None
    f = float((before - after) / 9.0 / (after / of_design))
    p = float(fdtrc(9, of_design, max(f, 0.0)))
    halves = after / of_design <= 0.25 * before / of_level
    return TakenSensitivity(f=f, p=p, taken=bool(p < CHANCE and halves))


def change_of_bias(rests: StillRests, x: NDArray, values: NDArray) -> BiasChange | None:
    """Return the change that divides the mean rates at quiet rests best, or their drift.

    The result is None where chance explains both, or the rests are few.
    """
    quiet = quiet_rests(rests)
    if len(quiet) < FEWEST_RESTS or rests.rate is None or rests.rate_deviation is None:
        return None
    off = rests.rate[quiet] - inputs_of(x, rests.force[quiet]) @ values[SENSITIVITY].reshape(3, 3).T
    least = np.maximum(np.median(rests.rate_deviation[quiet], axis=0), 0.3 * EARTH_RATE)
    count = len(quiet)
    off = off - off.mean(axis=0)
    # Sums and squares of the rests before each change, from the third rest on, and of those after it.
    first = np.arange(2, count - 1)[:, None]
    before, squares = np.cumsum(off, axis=0)[1:-2], np.square(off).sum(axis=0)
    after = off.sum(axis=0) - before
    within = (squares - np.square(before) / first - np.square(after) / (count - first)) / (count - 2)
    size = after / (count - first) - before / first
    error = np.sqrt(np.maximum(within, least**2) * (1.0 / first + 1.0 / (count - first)))
    chance = 2.0 * stdtr(count - 2, -np.abs(size) / error)
    limit = CHANCE / (3.0 * count)
    best = int(np.argmin(chance.min(axis=1)))
    if chance[best].min() < limit:
        return BiasChange(int(quiet[best + 2]), np.where(chance[best] < limit, size[best], 0.0))
    time = np.array([rests.rows[number].start for number in quiet.tolist()], dtype=float)
    time = (time - time.mean()) / np.ptp(time)
    drift, spread = time @ off / (time @ time), float(time @ time)
    within = np.square(off - np.outer(time, drift)).sum(axis=0) / (count - 2)
    chance = 2.0 * stdtr(count - 2, -np.abs(drift) / np.sqrt(np.maximum(within, least**2) / spread))
    if not chance.min() < DRIFTS:
        return None
    return BiasChange(None, np.where(chance < DRIFTS, drift, 0.0))


@dataclass(frozen=True, eq=False)
class GyroRows:
    """Everything that tells of the gyros of a run.

    Attributes
    ----------
    rests : StillRests
    deviation : float
        standard deviation of a mean reading's error [g]
    pieces : Moves or Windows
    turns : Turns or None
    fitted : (G,) array of int
        numbers of the parameters to be fitted
    prior : (22,) array
        standard deviations before the record
    """

    rests: StillRests
    deviation: float
    pieces: Moves | Windows
    turns: Turns | None
    fitted: Ints
    prior: Floats

    def solved(self, forces: Forces, values: NDArray) -> GyroFit:
        """Return the fit by least squares."""
        x, piece_error = forces.x, MOVE_ERROR
        triangle = np.linalg.cholesky(np.linalg.inv(forces.covariance)).T
        width = 9 + len(self.fitted)
        for _ in range(ROUNDS):
            current = Forces(x, forces.covariance)
            pieces = self.pieces.rows(current, values)
            blocks = [self._of_pieces(pieces, piece_error), self._of_rests(x, values), self._of_turns(values)]
            of_x = np.zeros((9, width))
            of_x[:, :9] = triangle
            blocks.append((triangle @ (x - forces.x), of_x))
            prior = np.zeros((len(self.fitted), width))
            prior[:, 9:] = np.diag(1.0 / self.prior[self.fitted])
            blocks.append((values[self.fitted] / self.prior[self.fitted], prior))
            matrix = np.vstack([rows for _, rows in blocks])
            right = np.concatenate([residual for residual, _ in blocks])
            change = np.linalg.lstsq(matrix, -right, rcond=None)[0]
            inverse = np.linalg.inv(matrix.T @ matrix)
            before = piece_error
            piece_error = self._piece_error(pieces, np.diag(inverse)[9:])
            x = x + change[:9]
            values = values.copy()
            values[self.fitted] += change[9:]
            if np.abs(change).max() < 1e-7 and abs(piece_error - before) < 0.01 * before:
                break
        covariance = np.zeros((GYROS, GYROS))
        covariance[np.ix_(self.fitted, self.fitted)] = inverse[9:, 9:]
        by_turns = np.zeros(GYROS)
        if self.turns is not None:
            by_turns[self.fitted] = (inverse @ blocks[2][1].sum(axis=0))[9:] * TURN_BIAS / self.turns.error
        covariance += np.outer(by_turns, by_turns)
        missed = self.pieces.rows(forces, values).error
        return GyroFit(values, covariance, self.fitted, None, missed, by_turns=by_turns)

    def _piece_error(self, pieces: PieceRows, variance: NDArray) -> float:
        """Return the standard deviation of a piece's own error by the residuals [rad]."""
        if not len(self.pieces):
            return MOVE_ERROR
        determined = 1.0 - variance / self.prior[self.fitted] ** 2
        freedom = pieces.error.size - float(determined[self.fitted >= MATRIX.start].sum())
        if freedom < LEAST_SPARE:
            return MOVE_ERROR
        shown = float(np.square(pieces.error).sum()) / freedom
        if freedom < SPARE:
            return max(MOVE_ERROR, float(np.sqrt(shown)))
        by_readings = float(pieces.by_readings.mean()) * self.deviation**2
        return float(np.sqrt(max(shown - by_readings, LEAST_MOVE**2)))

    def _of_pieces(self, pieces: PieceRows, piece_error: float) -> tuple[NDArray, NDArray]:
        """Return the pieces' errors over their standard deviations, and their slopes."""
        weight = 1.0 / np.sqrt(piece_error**2 + pieces.by_readings * self.deviation**2).ravel()
        rows = np.concatenate([pieces.by_forces, pieces.by_gyros[:, :, self.fitted]], axis=2)
        return pieces.error.ravel() * weight, rows.reshape(len(weight), rows.shape[2]) * weight[:, None]

    def _of_rests(self, x: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return the mean rates at quiet rests over their scatter, and their slopes."""
        rests = self.rests
        quiet = quiet_rests(rests) if len(rests) else np.zeros(0, dtype=int)
        if not len(quiet) or rests.rate is None or rests.rate_deviation is None:
            return np.zeros(0), np.zeros((0, 9 + len(self.fitted)))
        n = inputs_of(x, rests.force[quiet])
        off = values[BIAS] + n @ values[SENSITIVITY].reshape(3, 3).T - rests.rate[quiet]
        middle = np.median(off, axis=0)
        error = np.maximum(1.4826 * np.median(np.abs(off - middle), axis=0), EARTH_RATE)
        error = np.maximum(error, np.median(rests.rate_deviation[quiet], axis=0))
        if len(quiet) < 3:
            error = np.maximum(error, UNKNOWN_RATE)
        weight = 1.0 / error / np.maximum(1.0, np.abs(off - middle) / (FAR * error))
        slopes = np.zeros((len(quiet), 3, GYROS))
        slopes[:, :, BIAS] = np.eye(3)
        slopes[:, :, SENSITIVITY] = np.kron(np.eye(3), n[:, None, :])
        rows = np.concatenate([np.zeros((len(quiet), 3, 9)), slopes[:, :, self.fitted]], axis=2)
        return (off * weight).ravel(), (rows * weight[:, :, None]).reshape(-1, rows.shape[2])

    def _of_turns(self, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return the errors of known turns over that of an angle, and their slopes."""
        if self.turns is None or not len(self.turns):
            return np.zeros(0), np.zeros((0, 9 + len(self.fitted)))
        error, by_gyros = self.turns.rows(values)
        return error, np.hstack([np.zeros((len(error), 9)), by_gyros[:, self.fitted]])


def fitted_gyros(
    rests: StillRests,
    deviation: float,
    forces: Forces,
    pieces: Moves | Windows,
    turns: Turns | None = None,
    near: GyroFit | None = None,
) -> GyroFit:
    """Fit the gyros of a run.

    Parameters
    ----------
    rests : StillRests
        with rates
    deviation : float
        standard deviation of a mean reading's error [g]
    forces : Forces
        the accelerometers
    pieces : Moves or Windows
    turns : Turns, optional
    near : GyroFit, optional
        of much the same pieces: the iteration begins there
    """
    sensitivity = sensitivity_of(rests, forces) if len(rests) else None
    chosen: list[int] = [*range(MATRIX.stop)]
    if sensitivity is not None and sensitivity.taken:
        chosen += range(SENSITIVITY.start, SENSITIVITY.stop)
    if isinstance(pieces, Windows):
        chosen.append(LAG)
    values = np.zeros(GYROS)
    if near is not None:
        values[chosen] = near.values[chosen]
    elif len(rests) and rests.rate is not None:
        values[BIAS] = np.median(rests.rate[quiet_rests(rests)], axis=0)
    prior = PRIOR.copy()
    if isinstance(pieces, Windows) and pieces.case_error is None:
        prior[MATRIX] = OF_TRUTH
    fit = GyroRows(rests, deviation, pieces, turns, np.array(chosen), prior).solved(forces, values)
    covariance = fit.covariance
    if isinstance(pieces, Windows) and pieces.case_error is not None:
        covariance[MATRIX, MATRIX] += pieces.case_error**2 * np.eye(9)
    # Turns over lost rows read too small.
    covariance[MATRIX, MATRIX] += pieces.way.series.lost**2 * np.outer(np.eye(3), np.eye(3))
    change = change_of_bias(rests, forces.x, fit.values) if len(rests) else None
    if len(rests) and rests.rate_steps is not None:
        covariance[BIAS, BIAS] += np.diag(np.square(np.median(rests.rate_steps, axis=0)))
    if change is not None:
        covariance[BIAS, BIAS] += np.diag(np.square(0.5 * change.size))
    return replace(fit, sensitivity=sensitivity, change=change)
