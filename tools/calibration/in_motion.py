"""Readings in motion: the accelerometers' readings as the table turns, at angles that its encoders give within a bound.

Over a few rows over which both axes speed up steadily, or not at all, a parabola is fitted to each reading. Its value
in the middle is that of one more position, at which the block turns. Its error is σ plus the scatter of the rows, the
error of the encoder and of the middle row's time stamp, and the difference between a wave of gravity and a parabola.

Together with rests and turns these readings make one system. In it all accelerometers lag by one time behind the
encoders, and the place of each in the block follows from the dependence of its reading on rate and acceleration. The
interval of the lag is guaranteed; the intervals of all other parameters remain those of rests and turns.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.bench import GYRO_PARAMETERS, LAG, SYMMETRIC_PAIRS, TARGETS, rates_of_turning
from ...models.effects import CATALOGUE, MotionRows
from ..calibrated import LATENCIES
from ..motion.rest_noise import factor_for
from ..motion.rests import sampling_of
from ..records import BenchRecord, PositionRecord
from ..records.rests import without_turns
from .model import Linearisation, Parametrisation, Positions, predicted_input, predicted_reading, reading_jacobian
from .targets import MOTION_NAMES, Target
from .turns import ROUNDS, STILL, WithTurns, fitted_step

HALF_S, HALF_RAD, FEWEST = 0.08, 0.08, 3
"""Time [s] and turn [rad] that are taken to either side of the middle, and the least number of rows."""
STEADY = 2.5
"""Largest distance of angles from a parabola of time [bounds of an encoder]."""
UNSEEN = 4.0
"""An acceleration that changes by a goes unseen for √(4 · 2.5 bounds / a) at most, near the end of a window."""
APART = 0.8
"""So far [rad] the table turns from one reading in motion to the next, but where its acceleration is another one."""
MOST = 90
CERTAIN = 5e-3
"""Error of an input [g] up to which the sense of its change by a radian of turning is uncertain."""
SURE = 6e-3
"""An input nearer to zero [g] may change its sign during a reading, by errors of the bench or by turning."""
UNTOLD = 1.0
"""Bound of a reading without information, as where the input's sign is not certain [g]."""
SLOW = 0.02
"""An axis that turns by less [rad/s] hardly turns."""
FURTHER = ("A", "r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33")
"""Lag of the accelerometers [s]; places of each of them from where the axes cross [m]."""
PLAUSIBLE = np.array([1e-2] + [0.1] * 9)
NEAR = 1e-4
"""So far [s] before and after a moment."""
QUARTIC = 3.0 / 35.0 / 24.0 * 1.5
"""Difference in the middle [g] of a parabola over angles of -1 to 1 rad from a wave of up to 1.5 g."""


@dataclass(frozen=True, eq=False)
class InMotion:
    """Readings (W, 3) over g at rows (W,) of a bench record at which the table turns, and their bounds (W, 3).

    `span` (W, 2): a reading covers the rows after the first of these, up to the last. `angles`, `rate`, `acceleration`
    (W, 2) are those of both axes [rad], [rad/s], [rad/s²]. `senses` (W, 3) are the senses of change of the inputs over
    all rows of a reading, 0 where the sense is not certain.
    """

    rows: Ints
    span: Ints
    angles: Floats
    reading: Floats
    bound: Floats
    rate: Floats
    acceleration: Floats
    senses: Floats

    @staticmethod
    def of(record: PositionRecord, linearised: Linearisation, gravity: float, encoder_bound: float) -> "InMotion":
        """Return the readings of a bench record between its rests, linearised; encoder errors within a bound [rad]."""
        raw = record.raw
        assert isinstance(raw, BenchRecord)
        time, angles = raw.time_s, np.stack([without_turns(raw.alpha), without_turns(raw.beta)], axis=1)
        sampling = sampling_of(raw.gyros)
        reading = raw.specific_force / gravity
        rows, half, rate, acceleration = _steady_rows(time, angles, reading, record, encoder_bound)
        value, gain = _parabola(reading, rows, half)
        off = encoder_bound + sampling.jitter_max * np.abs(rate)
        at = Positions(angles[rows, 0], angles[rows, 1], np.zeros(len(rows), dtype=int))
        slopes = np.abs(slopes_by_angles(linearised.parametrisation, linearised.point, at))
        wave = QUARTIC * (half * sampling.period * np.abs(rate).sum(axis=1)) ** 4
        noise = factor_for(3 * len(rows)) * gain[:, None] * _scatter(reading, record)
        bound = float(linearised.bound.min()) + noise + (slopes * off[:, None]).sum(axis=2) + wave[:, None]
        bound[~_one_sign(linearised, angles, rows, half)] = UNTOLD
        # A reading may be a mean since the row before.
        span = rows[:, None] + np.array([-half - 1, half])
        unsigned = InMotion(rows, span, angles[rows], value, bound, rate, acceleration, np.zeros_like(value))
        lags, point = (
            (half + 1.0) * sampling.period * np.array([1.0, 0.0, -1.0]),
            (linearised.parametrisation, linearised.point),
        )
        grown = np.stack([-unsigned.by_lag(*point, lag).reshape(-1, 3) for lag in lags.tolist()])
        least = CERTAIN * np.abs(rate).max(axis=1, initial=0.0)[:, None]
        rising, falling = (grown > least).all(axis=0), (grown < -least).all(axis=0)
        return replace(unsigned, senses=rising.astype(float) - falling)

    def at(self, lag: float) -> Positions:
        """Return the position of the table a lag [s] earlier."""
        alpha, beta = (self.angles - lag * self.rate + 0.5 * lag**2 * self.acceleration).T
        return Positions(alpha, beta, np.zeros(len(alpha), dtype=int))

    def by_lag(self, parametrisation: Parametrisation, point: NDArray, lag: float) -> Floats:
        """Return the derivative (3 W,) of the readings by the lag [g/s], at a point (P,)."""
        earlier = lag * self.acceleration - self.rate
        return (slopes_by_angles(parametrisation, point, self.at(lag)) * earlier[:, None, :]).sum(axis=2).ravel()

    def motion(self, to_block: NDArray, lean: float, gravity: float, lag: float = 0.0) -> MotionRows:
        """The rows as effects in motion see them, a lag [s] earlier.

        `to_block` (3, 3): axes of the inner frame in those of the block; `lean` ε [rad].
        """
        rates = self.rate - lag * self.acceleration
        rate, change = rates_of_turning(self.at(lag).beta, rates, self.acceleration, lean) @ to_block.T
        count = len(rate)
        return MotionRows(rate, rate - change, self.reading, np.zeros(count), np.ones(count), gravity=gravity)

    def beyond_rest(
        self, system: WithTurns, point: NDArray, gravity: float
    ) -> tuple[Positions, NDArray, Floats, Floats]:
        """Return what lag and places of the accelerometers do at a point that ends with `FURTHER`; gravity [m/s²].

        The result is the table's positions, the inputs' signs (W, 3), the places' additions (3 W,) [g] to readings,
        and the derivatives (3 W, 10) of the readings by `FURTHER`.
        """
        x, lag, places = point[: system.own], float(point[-len(FURTHER)]), point[-9:]
        at, sign, arms = self._off_centre(system, point, gravity, lag)
        later, earlier = (self._off_centre(system, point, gravity, lag + change)[2] for change in (NEAR, -NEAR))
        by_lag = self.by_lag(system.parametrisation, x, lag) + (later - earlier) @ places / (2.0 * NEAR)
        return at, sign, arms @ places, np.column_stack([by_lag, arms])

    def _off_centre(
        self, system: WithTurns, point: NDArray, gravity: float, lag: float
    ) -> tuple[Positions, NDArray, Floats]:
        """Return positions a lag [s] earlier, the inputs' signs (W, 3), and the change (3 W, 9) [g] by each place [m].

        An accelerometer reads the addition of its own place along its axis and, misaligned, along the others'.
        """
        places, p = point[-9:].reshape(3, 3), system.parametrisation
        targets, at = p.selection[0] @ point[: system.own], self.at(lag)
        rows = self.motion(system.turns.block_axes(targets), float(targets[2]), gravity, lag)
        effect = CATALOGUE["lever-arm"]
        by_place = np.stack([effect.signature(place, rows)[:, k] for k, place in enumerate(effect.places)], axis=1)
        n = predicted_input(p, point[: system.own], at) + np.einsum("wpk,pk->wp", by_place, places)
        slopes = responses(p, point[: system.own], n)
        arms = np.zeros((len(n), 3, 3, 3))
        for k in range(3):
            arms[:, k, k] = np.einsum("wq,wqk->wk", slopes[:, k], by_place)
        return at, np.where(n >= 0.0, 1, -1), arms.reshape(-1, 9)


def _steady_rows(
    time: NDArray, angles: NDArray, reading: NDArray, record: PositionRecord, encoder_bound: float
) -> tuple[NDArray, int, NDArray, NDArray]:
    """Rows (W,) in motion, rows to either side, and rates and accelerations (W, 2) of both axes there."""
    rests = [rest for rest in record.rests if rest.refused is None]
    period = float(np.median(np.diff(time)))
    fastest = float(np.quantile(np.abs(np.diff(angles, axis=0)).sum(axis=1), 0.99)) / period
    half = max(FEWEST, int(min(HALF_S, HALF_RAD / max(fastest, SLOW)) / period))
    # An axis that speeds up otherwise from near the end on still seems steady, and a reading may be a mean since the
    # row before: angles are looked at farther.
    bent = np.abs(np.diff(angles, 2, axis=0)).max(initial=0.0) - 4.0 * encoder_bound
    unseen = (UNSEEN * STEADY * encoder_bound / max(bent / period**2, SLOW)) ** 0.5
    wide = half + 1 + int(np.ceil(unseen / period))
    if len(rests) < 2 or len(time) < 4 * wide:
        return np.zeros(0, int), half, np.zeros((0, 2)), np.zeros((0, 2))
    lags = period * np.arange(-wide, wide + 1)
    inverse = np.linalg.pinv(np.vander(lags, 3, increasing=True))
    windows = np.lib.stride_tricks.sliding_window_view(angles, 2 * wide + 1, axis=0)
    turning = np.abs(angles[2 * wide :] - angles[: -2 * wide]).max(axis=1) > SLOW * 2 * wide * period
    for rest in rests:
        turning[max(rest.first - 2 * wide, 0) : rest.last + 1] = False
    even = np.abs(time[2 * wide :] - time[: -2 * wide] - 2 * wide * period) < 0.5 * period
    # Windows that overlap by three quarters add hardly any information.
    first = np.flatnonzero(turning & even)[:: max(half // 2, 1)]
    terms = windows[first] @ inverse.T
    misfit = windows[first] - terms @ np.vander(lags, 3, increasing=True).T
    forces = np.lib.stride_tricks.sliding_window_view(reading, 2 * wide + 1, axis=0)[first]
    one_sign = (np.abs(np.sign(forces).sum(axis=2)) == 2 * wide + 1).all(axis=1)
    good = (np.abs(misfit).max(axis=(1, 2)) <= STEADY * encoder_bound) & one_sign
    rows, rate, acceleration = first[good] + wide, terms[good, :, 1], 2.0 * terms[good, :, 2]
    between = np.searchsorted([rest.first for rest in rests], rows)
    travel = np.floor(np.append(0.0, np.abs(np.diff(angles, axis=0)).sum(axis=1)).cumsum()[rows] / APART)
    largest = np.abs(acceleration).max(initial=0.0)
    kinds = np.column_stack([between, travel, np.round(2.0 * acceleration / max(largest, 1e-9))])
    _, chosen = np.unique(kinds, axis=0, return_index=True)
    chosen = np.sort(chosen)
    if len(chosen) > MOST:
        chosen = chosen[np.unique(np.linspace(0, len(chosen) - 1, MOST).round().astype(int))]
    return rows[chosen], half, rate[chosen], acceleration[chosen]


def _one_sign(linearised: Linearisation, angles: NDArray, rows: NDArray, half: int) -> Bools:
    """Return whether inputs (W, 3) surely keep one sign over the rows averaged in the readings at rows (W,)."""
    inputs = np.zeros((3, len(rows), 3))
    for number, shift in enumerate((-half - 1, 0, half)):
        alpha, beta = angles[rows + shift].T
        at = Positions(alpha, beta, np.zeros(len(rows), dtype=int))
        inputs[number] = predicted_input(linearised.parametrisation, linearised.point, at)
    return np.all(inputs > SURE, axis=0) | np.all(inputs < -SURE, axis=0)


def _parabola(reading: NDArray, rows: NDArray, half: int) -> tuple[NDArray, NDArray]:
    """Values (W, 3) in the middle of parabolas through readings, and how they add up noise (W,), rms."""
    lags = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(lags.astype(float), 3, increasing=True))[0]
    value = np.einsum("k,wkp->wp", weights, reading[rows[:, None] + lags])
    return value, np.full(len(rows), float(np.linalg.norm(weights)))


def _scatter(reading: NDArray, record: PositionRecord) -> Floats:
    """Standard deviation (3,) of single readings about the means of their rests."""
    variances = [np.var(reading[rest.kept], axis=0) for rest in record.rests if rest.refused is None]
    return np.sqrt(np.median(variances, axis=0))


def responses(parametrisation: Parametrisation, point: NDArray, n: NDArray) -> Floats:
    """Return I + Γ (N, 3, 3) of the accelerometers at a point (P,), for inputs (N, 3) [g]."""
    x = dict(zip(TARGETS, parametrisation.selection[0] @ point, strict=True))
    slopes = np.tile(np.eye(3), (len(n), 1, 1))
    slopes[:, 1, 0], slopes[:, 2, 0], slopes[:, 2, 1] = x["X6+X8"], x["X7+X12"], x["X11+X13"]
    for k, (plus, minus) in enumerate(SYMMETRIC_PAIRS):
        slopes[:, k, k] += np.where(n[:, k] >= 0.0, x[plus], x[minus])
    return slopes


def slopes_by_angles(parametrisation: Parametrisation, point: NDArray, at: Positions) -> Floats:
    """Derivatives (N, 3, 2) of readings by the angles, at a point (P,)."""
    step = 1j * 1e-30
    by_alpha = predicted_reading(parametrisation, point, replace(at, alpha=at.alpha + step))
    by_beta = predicted_reading(parametrisation, point, replace(at, beta=at.beta + step))
    return np.stack([np.imag(by_alpha) / 1e-30, np.imag(by_beta) / 1e-30], axis=2)


@dataclass(frozen=True)
class WithMotion(WithTurns):
    """Rests, turns and, behind them, readings in motion, with the parameters `FURTHER` behind those of the gyros.

    `gravity` is the model value [m/s²].
    """

    moving: InMotion
    gravity: float

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return super().symbols + FURTHER

    def residuals_at(self, points: NDArray) -> NDArray:
        """Exact residuals (K, M) at other points: readings at rest [g], integrals [rad], readings in motion [g]."""
        in_motion = []
        for point in points:
            at, sign, added, _ = self.moving.beyond_rest(self, point, self.gravity)
            predicted = predicted_reading(self.parametrisation, point[: self.own], at, sign)
            in_motion.append((self.moving.reading - predicted).ravel() - added)
        return np.hstack((super().residuals_at(points[:, : -len(FURTHER)]), in_motion))

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Return the derivatives at another point; exact, but with the places' additions constant in scale factors."""
        at, sign, _, further = self.moving.beyond_rest(self, point, self.gravity)
        by_bench = reading_jacobian(self.parametrisation, point[: self.own], at, sign).reshape(-1, self.own)
        by_gyros = np.zeros((len(by_bench), len(GYRO_PARAMETERS)))
        before = np.pad(super().jacobian_at(point[: -len(FURTHER)]), ((0, 0), (0, len(FURTHER))))
        return np.vstack([before, np.hstack([by_bench, by_gyros, further])])


def with_motion(system: WithTurns, moving: InMotion, gravity: float) -> WithMotion:
    """The model of rests and turns with readings in motion, fitted together by least squares; gravity [m/s²]."""
    point, bound = np.append(system.point, np.zeros(len(FURTHER))), np.append(system.bound, moving.bound)
    fitted, sizes = WithMotion(**vars(system), moving=moving, gravity=gravity), np.append(system.sizes, PLAUSIBLE)
    for _ in range(ROUNDS):
        fitted, step = fitted_step(fitted, point, bound, sizes)
        point = point + step
        if np.abs(step / sizes).max() < STILL:
            break
    return fitted


def lag_targets(count: int) -> list[Target]:
    """The accelerometers' lag behind the encoders, and the gyros' behind the accelerometers.

    That many parameters are those of bench, accelerometers and gyros.
    """
    behind = np.zeros(count + len(FURTHER))
    behind[count] = 1.0
    between = -behind
    between[count - len(GYRO_PARAMETERS) + LAG] = 1.0
    lags = zip(LATENCIES, (behind, between), strict=True)
    return [Target(symbol, *MOTION_NAMES[symbol], weights) for symbol, weights in lags]
