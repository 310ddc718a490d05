"""Turns of a bench record: the integrals of the gyros over pieces of it, and their bounds.

A piece is a rest, a move from one rest to the next, or a part of a move. Moves are cut where the table turns steadily:
only there do a lag of the gyros behind the encoders, and errors that return with each whole turn, show. The integral
over a piece errs by the noise of the gyros and by the encoders' errors at its ends and on the way. It also errs by the
motion of both axes between rows, and by a moment at its ends.
"""

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.bench import (
    GYRO_PARAMETERS,
    LAG,
    MATRIX,
    MOMENTS,
    growth_of,
    integrated_jacobian,
    integrated_readings,
    small_turn,
)
from ...models.bench import moments_of as integrated_angles
from ..errors import InputError
from ..motion.increments import mean_rates
from ..motion.rest_noise import factor_for, rest_noise
from ..motion.rests import RecordSampling, quiet_rests, rates_of, sampling_of
from ..records import BenchRecord, PositionRecord, StrapdownRecord
from ..records.kinds import Rest
from ..records.rests import without_turns
from ..records.stamps import grid_of
from ..rounding import digits
from .model import Linearisation

STEADY = 0.02
"""A move is cut where its rate changes by no more than this part of it over a few rows to either side."""
APART = np.radians(50.0)
"""So far a long move turns between two cuts at least; of no harmonic up to the 36th that is a whole period."""
BESIDE = 4
"""Rows to either side of an end, over which the table's rate there is taken."""
SEEN = 4.0
"""Change of an angle that counts as motion [bounds of the encoder]."""
LARGEST = 0.5
"""No gyro has a larger scale-factor error or misalignment."""
PLAUSIBLE = np.array([1e-2] * 3 + [1e-2] * 9 + [1e-2] * 9 + [1e-2])
"""Sizes of gyros' parameters: a direction that moves no reading by its bound at such sizes is not determined."""
ROUNDS, STILL = 8, 1e-10
"""Most steps of least squares, and the relative size of a step that ends them."""
Model = TypeVar("Model", bound=Linearisation)


@dataclass(frozen=True, eq=False)
class Turns:
    """Pieces of a bench record.

    `first`, `last` (S,) are rows of the raw record; `integral` (S, 3) [rad] are the gyros' integrals from one to the
    other. `moments` (S, 13), `growth` (2, S, 13) are as in `models.bench`. `noise` (S,) [rad] bounds the gyros' errors.
    `swept` (S, 3) [rad] bounds the errors by encoders and stamps of the turn about each axis of the inner frame.
    `coning` (S, 3) are sums of γ' × γ over the gyros' increments γ of the rows, where γ' is the increment before.
    `period` [s] is the time from row to row.
    """

    first: Ints
    last: Ints
    integral: Floats
    moments: Floats
    growth: Floats
    noise: Floats
    swept: Floats
    coning: Floats
    mounting: Floats
    earth: Floats
    basis: str
    period: float

    @property
    def _rest(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        return self.moments, self.growth, self.mounting, self.earth

    def residual(self, targets: NDArray, gyros: NDArray) -> Floats:
        """Return the residuals (3 S,) of the integrals [rad]."""
        return (self.integral - integrated_readings(targets, gyros, *self._rest)).ravel()

    def jacobian(self, targets: NDArray, gyros: NDArray) -> Floats:
        """Derivatives (3 S, 40) of the model's integrals."""
        return integrated_jacobian((targets, gyros), self._rest).reshape(-1, len(targets) + len(gyros))

    def bound(self, targets: NDArray, gyros: NDArray) -> Floats:
        """Return the bounds (3 S,) of the residuals about a point [rad]."""
        from_inner = self.jacobian_of_axes(targets, gyros)
        smeared = _smear(float(gyros[LAG]), self.period) * np.abs(self.growth[1][:, [0, 1, 3]])
        return (self.noise[:, None] + (self.swept + smeared) @ np.abs(from_inner).T).ravel()

    def block_axes(self, targets: NDArray) -> Floats:
        """Axes (3, 3) of the inner frame in those of the block."""
        return small_turn(targets[14:11:-1]) @ self.mounting

    def jacobian_of_axes(self, targets: NDArray, gyros: NDArray) -> Floats:
        """Gyros' readings (3, 3) of turns about the axes of the inner frame."""
        turns = np.zeros((3, len(MOMENTS)))
        turns[0, 0], turns[1, 1], turns[2, 3] = 1.0, -1.0, 1.0
        still = gyros.copy()
        still[LAG] = 0.0
        readings = integrated_readings(targets, still, turns, np.zeros((2, *turns.shape)), self.mounting, self.earth)
        return readings.T


def turns_of(
    record: PositionRecord,
    *,
    mounting: NDArray,
    earth: NDArray,
    encoder_bound: float,
    noise_bound: float | None = None,
    rates: str = "instantaneous",
) -> Turns:
    """The pieces of a bench record whose rests are averaged.

    Parameters
    ----------
    record : PositionRecord
        of rests, made from a BenchRecord
    mounting, earth : (3, 3), (3,) array
        Q; Earth's rotation in axes of the base [rad/s]
    encoder_bound : float
        bound of an encoder's error, without its constant part [rad]
    noise_bound : float or None
        bound of a gyro's mean over one second [rad/s]; over T it falls as 1/√T; None: from the rests
    rates : str
        meaning of a rate in the record

    Raises
    ------
    InputError
        fewer than two rests, or rests that leave the noise open
    """
    raw = record.raw
    assert isinstance(raw, BenchRecord)
    gyros = raw.gyros
    sampling = sampling_of(gyros)
    rests = [rest for rest in record.rests if rest.refused is None]
    if len(rests) < 2:
        raise InputError(f"{raw.path}: has {len(rests)} rest that can be used; turns go from one rest to another")
    time = raw.time_s
    alpha, beta = without_turns(raw.alpha), without_turns(raw.beta)
    angle = np.zeros((len(time), 3))
    if raw.increment is not None:
        steps = raw.increment[1:]
    else:
        steps = mean_rates(gyros, rates) * np.diff(time)[:, None]
    np.cumsum(steps, axis=0, out=angle[1:])
    coning = np.zeros_like(angle)
    np.cumsum(np.cross(steps[:-1], steps[1:]), axis=0, out=coning[2:])
    sums = integrated_angles(time, alpha, beta)
    swung = np.cumsum([motion_of(values, encoder_bound) for values in (alpha, beta)], axis=1)
    ends = [_within(rest) for rest in rests]
    for (_, begin), (end, _) in pairwise(list(ends)):
        ends.append((begin, end))
        if cuts := _steady_rows(time, alpha, beta, begin, end):
            ends += pairwise([begin, *cuts, end])
    gap = np.append(False, grid_of(time).is_gap)
    faults = np.cumsum([sampling.broken, gap, sampling.limits.of("w")], axis=1)
    first, last = np.array(ends, dtype=int).T
    sound = (faults[:, first] == faults[:, last]).all(axis=0)
    first, last = first[sound], last[sound]
    turning = [slopes_of(values, time) for values in (alpha, beta)]
    faster = [slopes_of(values, time) for values in turning]
    growth = growth_of(np.stack([alpha, beta]), np.stack(turning), np.stack(faster))
    seconds = time[last] - time[first]
    per_root_second, basis = noise_bound, "given"
    if per_root_second is None:
        noise = _noise(gyros, sampling, seconds)
        basis = "Allan deviation of the gyros at rest"
    else:
        noise = per_root_second * np.sqrt(seconds)
    path = np.abs(swung[:, last] - swung[:, first])
    ends_off, way = 2.0 * encoder_bound, encoder_bound * path.sum(axis=0)
    bends = np.stack([_bends(values) for values in (alpha, beta)])
    between = np.cumsum(_between_rows(np.stack([alpha, beta]), bends))
    if rates == "instantaneous" and raw.rate is not None:
        # Each of the eight corners of a move's rates is cut by an eighth of a bend at most.
        noise = noise + [bends[:, a : b + 1].max(axis=1).sum() for a, b in zip(first, last, strict=True)]
    moment = sampling.jitter_max * (np.abs(growth[0, last]) + np.abs(growth[0, first]))
    across = ends_off + way + between[last] - between[first] + moment[:, 2]
    swept = np.stack([across, across, ends_off + moment[:, 3]], axis=1)
    return Turns(
        first,
        last,
        angle[last] - angle[first],
        sums[last] - sums[first],
        growth[:, last] - growth[:, first],
        noise,
        swept,
        coning[last] - coning[first],
        np.asarray(mounting),
        np.asarray(earth),
        basis,
        sampling.period,
    )


def _smear(lag: float, period: float) -> float:
    """Return the largest change of an integral by a lag that is made between rows, per unit growth of a rate [s²].

    An interpolation between two rows is late by the lag in the mean, but takes one row or the other. For a lag τ and a
    period h the integral is off by τ (h - τ)/2. A lead extrapolates the last two rows, and is off by τ (h + τ)/2.
    """
    size = abs(lag)
    if lag < 0.0:
        return 0.5 * size * (period + size)
    return min(0.5 * size * period, period**2 / 8.0)


def _noise(gyros: StrapdownRecord, sampling: RecordSampling, seconds: NDArray) -> Floats:
    """Return the bounds (S,) of the gyros' noise over pieces [rad], from the noise within rests."""
    noise = rest_noise(rates_of(gyros), gyros.time_s, quiet_rests(gyros, sampling), sampling.period)
    if noise is None:
        raise InputError(
            f"{gyros.path}: its rests are too few or too short to tell the gyros' noise; give --gyro-noise, the bound "
            "of a mean over one second [rad/s]"
        )
    return factor_for(3 * len(seconds)) * np.sqrt(noise.angle_square(seconds))


def _within(rest: Rest) -> tuple[int, int]:
    """Return the first and last row of a rest within which the table is still, without the longest possible lag."""
    margin = min(2 * BESIDE, (rest.kept_last - rest.kept_first) // 6)
    return rest.kept_first + margin, rest.kept_last - margin


def motion_of(angle: NDArray, bound: float) -> Floats:
    """Return the travel of an axis since the row before (N,) [rad]; moves within an encoder's error count as zero."""
    travel, at = np.zeros(len(angle)), angle[0]
    far = np.flatnonzero(np.abs(np.diff(angle, prepend=at)) > 0.0)
    for k in far.tolist():
        if abs(angle[k] - at) > SEEN * bound:
            travel[k], at = abs(angle[k] - at), angle[k]
    return travel


def _bends(angle: NDArray) -> Floats:
    """Return the bend of an angle (N,) about each row: the largest second difference there and beside it [rad]."""
    second = np.abs(np.diff(angle, 2, prepend=angle[0], append=angle[-1]))
    return np.maximum(second, np.maximum(np.append(second[1:], 0.0), np.append(0.0, second[:-1])))


def _between_rows(angles: NDArray, bends: NDArray) -> Floats:
    """Return the error of the turn about a transverse axis since the row before (N,) [rad], as axes speed up in a step.

    The error is the area between the path of both angles (2, N) and its chord. It is a twelfth of a bend times the
    other's step, and more for a bend that begins within the step.
    """
    step = np.abs(np.diff(angles, prepend=angles[:, :1]))
    return (step[0] * bends[1] + step[1] * bends[0]) / 8.0


def slopes_of(values: NDArray, time: NDArray) -> Floats:
    """Return the slope of an angle (N,) at each row, over a few rows to either side [1/s]."""
    rows = np.arange(len(time))
    low, high = np.maximum(rows - BESIDE, 0), np.minimum(rows + BESIDE, len(time) - 1)
    return (values[high] - values[low]) / (time[high] - time[low])


def _steady_rows(time: NDArray, alpha: NDArray, beta: NDArray, begin: int, end: int) -> list[int]:
    """Rows between two rests where both axes turn steadily, `APART` or farther; the middle one of a short move."""
    rows = np.arange(begin + 4 * BESIDE, end - 4 * BESIDE)
    if not len(rows):
        return []

    def rate(shift: int) -> NDArray:
        low, high = rows + shift - BESIDE, rows + shift + BESIDE
        return np.stack([(a[high] - a[low]) / (time[high] - time[low]) for a in (alpha, beta)])

    # Where a short move is fastest the rates to either side are alike, and less.
    middle = rate(0)
    changes = np.ptp([rate(-2 * BESIDE), middle, rate(2 * BESIDE)], axis=0).max(axis=0)
    fast = np.abs(middle).max(axis=0)
    steady = (changes <= STEADY * fast) & (fast > 0.5 * fast.max())
    good = rows[steady]
    if not len(good):
        return []
    travel = np.abs(alpha[good] - alpha[good[0]]) + np.abs(beta[good] - beta[good[0]])
    parts = max(2, int(travel[-1] / APART))
    at = np.searchsorted(travel, np.linspace(0.0, travel[-1], parts + 1)[1:-1])
    return np.unique(good[np.minimum(at, len(good) - 1)]).tolist()


@dataclass(frozen=True)
class WithTurns(Linearisation):
    """A linearisation of accelerometers' readings and, behind them, of gyros' integrals, with the gyros' parameters.

    `point`, `jacobian` and `span` count the gyros' `GYRO_PARAMETERS` behind those of the bench.
    """

    turns: Turns

    @property
    def own(self) -> int:
        """Number of parameters of the bench and the accelerometers."""
        return len(self.parametrisation.symbols)

    @property
    def sizes(self) -> Floats:
        """Plausible sizes (P,) of the parameters."""
        return np.append(np.full(self.own, 1e-2), PLAUSIBLE)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.parametrisation.symbols + tuple(GYRO_PARAMETERS)

    def residuals_at(self, points: NDArray) -> NDArray:
        """Exact residuals (K, M) of readings [g] and integrals [rad] at other points."""
        selection = self.parametrisation.selection[0]
        of_turns = [self.turns.residual(selection @ point[: self.own], point[self.own :]) for point in points]
        return np.hstack((super().residuals_at(points[:, : self.own]), of_turns))

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Exact derivatives at another point."""
        return _joined(super().jacobian_at(point[: self.own]), self, point)


def _joined(of_readings: NDArray, system: WithTurns, point: NDArray) -> NDArray:
    selection = system.parametrisation.selection[0]
    turned = system.turns.jacobian(selection @ point[: system.own], point[system.own :])
    columns = np.hstack([turned[:, : len(selection)] @ selection, turned[:, len(selection) :]])
    return np.vstack([np.pad(of_readings, ((0, 0), (0, len(GYRO_PARAMETERS)))), columns])


def with_turns(linearised: Linearisation, turns: Turns, where: str) -> WithTurns:
    """Readings and integrals fitted together by least squares, and linearised at the fit.

    An InputError that begins with `where` for gyros that do not follow the table.
    """
    count = len(linearised.point)
    point = np.append(linearised.point, np.zeros(len(GYRO_PARAMETERS)))
    for _ in range(ROUNDS):
        fitted, step = beside_turns(linearised, turns, point)
        point = point + step
        matrix = point[count:][MATRIX]
        if np.abs(matrix).max() > LARGEST:
            worst = int(np.argmax(np.abs(matrix)))
            raise InputError(
                f"{where}: gyro {worst // 3 + 1} does not follow the table: it reads "
                f"{digits(float(matrix[worst] + (worst % 4 == 0)), 2)} times the turn about axis {worst % 3 + 1}; give "
                "order, signs or units by --channels, as w=2,1,-3 or w=deg"
            )
        if np.abs(step / fitted.sizes).max() < STILL:
            break
    return fitted


def beside_turns(linearised: Linearisation, turns: Turns, point: NDArray) -> tuple[WithTurns, NDArray]:
    """Return readings and integrals linearised at a point (P,), and the step (P,) from there to the least squares."""
    count = len(linearised.point)
    values = {field.name: getattr(linearised, field.name) for field in fields(linearised)}
    both = WithTurns(**values, turns=turns)
    of_turns = turns.bound(linearised.parametrisation.selection[0] @ point[:count], point[count:])
    return fitted_step(both, point, np.append(linearised.bound, of_turns), both.sizes)


def fitted_step(model: Model, point: NDArray, bound: NDArray, sizes: NDArray) -> tuple[Model, NDArray]:
    """Return a model linearised at a point (P,) with bounds (M,), and the step (P,) from there to the least squares.

    A direction that moves no reading by its bound, at parameters of these sizes (P,), is left unchanged.
    """
    residual, jacobian = model.residual_at(point), model.jacobian_at(point)
    rows = np.asarray(np.linalg.qr(np.column_stack([jacobian, residual]) / bound[:, None], mode="r"))
    span = _determined(rows[:, :-1], sizes)
    at_point = replace(model, point=point, bound=bound, residual=residual, jacobian=jacobian, span=span)
    return at_point, span @ np.linalg.lstsq(rows[:, :-1] @ span, rows[:, -1], rcond=None)[0]


def _determined(rows: NDArray, sizes: NDArray) -> NDArray:
    """Return a basis (n, rank) of the directions that rows (M, n) over their bounds determine, for sizes (n,).

    The identity where they determine everything.
    """
    _, values, directions = np.linalg.svd(np.linalg.qr(rows * sizes, mode="r"), full_matrices=False)
    large = values > 1.0
    if large.all() and len(values) == len(sizes):
        return np.eye(len(sizes))
    return np.linalg.qr(directions[large].T / sizes[:, None])[0]
