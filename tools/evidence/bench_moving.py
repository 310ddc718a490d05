"""Readings in motion: what accelerometers read as the table turns, at angles that its encoders tell within a bound.

Over a few rows over which both axes speed up steadily, or not at all, a parabola is fitted to each reading; its value
in the middle is that of one more position, at which the block turns. Beside σ it errs by the rows' own scatter, by what
the encoder and the time stamp of the middle row are off, and by what a parabola cannot follow of a wave of gravity.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace, MotionRows
from ..calibration.model import Linearisation, Positions, linearise, predicted_reading
from ..motion.rest_noise import factor_for
from ..motion.rests import sampling_of
from ..records import BenchRecord, PositionRecord
from ..records.rests import without_turns
from .bench import Bench
from .bench_model import Readings
from .bench_visits import Circumstances
from .fit import coefficient_count

HALF_S, HALF_RAD, FEWEST = 0.08, 0.08, 3
"""To either side of the middle so much time [s] and turn [rad] is taken, and at least so many rows."""
STEADY = 2.5
"""Angles are a parabola of time where they miss it by no more than so many bounds of an encoder."""
APART = 0.8
"""So far [rad] the table turns from one reading in motion to the next, but where its acceleration is another one."""
MOST = 90
SLOW = 0.02
"""An axis that turns by less [rad/s] hardly turns."""
QUARTIC = 3.0 / 35.0 / 24.0 * 1.5
"""What a parabola over angles of -1 to 1 rad lacks of a wave of up to 1.5 g in the middle [g]."""


@dataclass(frozen=True, eq=False)
class Moving:
    """Readings at rest and in motion, in the order of time, as one evidence `read`; the first are at rest.

    `rate`, `acceleration` (N, 2) are those of both axes [rad/s], [rad/s²]; zeros at rest. `to_block` (3, 3): axes of
    the inner frame in those of the block; `lean` ε [rad]; `at_rest` (N,) which are the rests'.
    """

    read: Bench
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    at_rest: NDArray[np.bool_]
    to_block: NDArray[np.float64]
    lean: float

    @staticmethod
    def of(
        rests: Bench, record: PositionRecord, raw: BenchRecord, encoder_bound: float, to_block: NDArray, lean: float
    ) -> "Moving":
        """The rests of a record, and what it says between them; an encoder's error is within a bound [rad]."""
        here, known = rests.here, rests.readings
        time, angles = raw.time_s, np.stack([without_turns(raw.alpha), without_turns(raw.beta)], axis=1)
        sampling = sampling_of(raw.gyros)
        reading = raw.specific_force / rests.calibration.gravity
        rows, half, rate, acceleration = _steady_rows(time, angles, reading, record, encoder_bound)
        value, gain = _parabola(reading, rows, half)
        scatter = _scatter(reading, record)
        off = encoder_bound + sampling.jitter_max * np.abs(rate)
        at = Positions(angles[rows, 0], angles[rows, 1], np.zeros(len(rows), dtype=int))
        slopes = np.abs(_slopes(here, at))
        wave = QUARTIC * (half * sampling.period * np.abs(rate).sum(axis=1)) ** 4
        noise = factor_for(3 * len(rows)) * gain[:, None] * scatter
        bound = float(here.bound.min()) + noise + (slopes * off[:, None]).sum(axis=2) + wave[:, None]
        hours = (time[rows] - known.circumstances.began) / 3600.0
        order = np.argsort(np.append(known.circumstances.hours, hours), kind="stable")

        def joined(first: NDArray, second: NDArray) -> NDArray:
            return np.concatenate([first, second])[order]

        positions = Positions(
            joined(known.at.alpha, at.alpha), joined(known.at.beta, at.beta), np.zeros(len(order), dtype=int)
        )
        every = joined(known.reading, value)
        bounds = joined(here.bound.reshape(-1, 3), bound).ravel()
        both = linearise(here.parametrisation, positions, every, here.point, bounds)
        circumstances = _circumstances(rests, raw, rows, rate, order)
        readings = Readings.of(both, circumstances, known.resolution)
        numbers = joined(rests.numbers, np.zeros(len(rows), dtype=int))
        read = replace(rests, here=both, readings=readings, numbers=numbers)
        none = np.zeros((len(known), 2))
        rates = joined(none, rate), joined(none, acceleration)
        return Moving(read, *rates, joined(np.ones(len(known), bool), np.zeros(len(rows), bool)), to_block, lean)

    def about(self, point: NDArray) -> "Moving":
        """The readings linearised at other parameters (P,)."""
        here = self.read.here
        at = {"residual": here.residual_at(point), "jacobian": here.jacobian_at(point)}
        return replace(self, read=replace(self.read, here=replace(here, point=point, **at)))

    @property
    def motion(self) -> MotionRows:
        """The rows as effects in motion see them."""
        beta, (swing, turn), (faster, quicker) = self.read.readings.at.beta, self.rate.T, self.acceleration.T
        cos_e, sin_e = np.cos(self.lean), np.sin(self.lean)
        cos_b, sin_b = np.cos(beta), np.sin(beta)
        rate = np.stack([cos_e * cos_b * swing, -cos_e * sin_b * swing, sin_e * swing + turn], axis=1)
        change = np.stack(
            [
                cos_e * (cos_b * faster - sin_b * turn * swing),
                -cos_e * (sin_b * faster + cos_b * turn * swing),
                sin_e * faster + quicker,
            ],
            axis=1,
        )
        rate, change = rate @ self.to_block.T, change @ self.to_block.T
        rows = self.read.rows
        ones = np.ones(len(beta))
        return MotionRows(rate, rate - change, rows.n, rows.hours, ones, rows.temperature)

    def columns(self, place: EffectPlace) -> NDArray[np.float64]:
        """What effects of accelerometers that only motion shows add to the readings (3 N, K) [g]; zeros of others."""
        effect = place.definition
        if not (effect.in_motion and effect.component == "AccelerometerBlock"):
            return np.zeros((3 * len(self.rate), coefficient_count(place)))
        return effect.signature(place, self.motion).reshape(3 * len(self.rate), -1)

    def lagging(self, lag: float) -> tuple[Readings, NDArray[np.float64]]:
        """The readings as those of moments that lie a lag [s] earlier, and how they change with it (3 N,) [g/s]."""
        readings, rows = self.read.readings, self.read.rows
        moved = -lag * self.rate + 0.5 * lag**2 * self.acceleration
        at = replace(readings.at, alpha=readings.at.alpha + moved[:, 0], beta=readings.at.beta + moved[:, 1])
        slope = -(rows.by_alpha * self.rate[:, :1] + rows.by_beta * self.rate[:, 1:])
        return replace(readings, at=at), slope.ravel()


def _steady_rows(
    time: NDArray, angles: NDArray, reading: NDArray, record: PositionRecord, encoder_bound: float
) -> tuple[NDArray, int, NDArray, NDArray]:
    """Rows (W,) in motion, rows to either side, and rates and accelerations (W, 2) of both axes there."""
    used = [rest for rest in record.rests if rest.refused is None]
    period = float(np.median(np.diff(time)))
    fastest = float(np.quantile(np.abs(np.diff(angles, axis=0)).sum(axis=1), 0.99)) / period
    half = max(FEWEST, int(min(HALF_S, HALF_RAD / max(fastest, SLOW)) / period))
    if len(used) < 2 or len(time) < 4 * half:
        return np.zeros(0, int), half, np.zeros((0, 2)), np.zeros((0, 2))
    lags = period * np.arange(-half, half + 1)
    inverse = np.linalg.pinv(np.vander(lags, 3, increasing=True))
    windows = np.lib.stride_tricks.sliding_window_view(angles, 2 * half + 1, axis=0)
    seen = np.abs(angles[2 * half :] - angles[: -2 * half]).max(axis=1) > SLOW * 2 * half * period
    for rest in used:
        seen[max(rest.first - 2 * half, 0) : rest.last + 1] = False
    even = np.abs(time[2 * half :] - time[: -2 * half] - 2 * half * period) < 0.5 * period
    # Windows that overlap by three quarters say hardly more than each other.
    first = np.flatnonzero(seen & even)[:: max(half // 2, 1)]
    terms = windows[first] @ inverse.T
    left = windows[first] - terms @ np.vander(lags, 3, increasing=True).T
    forces = np.lib.stride_tricks.sliding_window_view(reading, 2 * half + 1, axis=0)[first]
    one_sign = (np.abs(np.sign(forces).sum(axis=2)) == 2 * half + 1).all(axis=1)
    good = (np.abs(left).max(axis=(1, 2)) <= STEADY * encoder_bound) & one_sign
    rows, rate, acceleration = first[good] + half, terms[good, :, 1], 2.0 * terms[good, :, 2]
    between = np.searchsorted([rest.first for rest in used], rows)
    gone = np.floor(np.append(0.0, np.abs(np.diff(angles, axis=0)).sum(axis=1)).cumsum()[rows] / APART)
    largest = np.abs(acceleration).max(initial=0.0)
    kinds = np.column_stack([between, gone, np.round(2.0 * acceleration / max(largest, 1e-9))])
    _, chosen = np.unique(kinds, axis=0, return_index=True)
    chosen = np.sort(chosen)
    if len(chosen) > MOST:
        chosen = chosen[np.unique(np.linspace(0, len(chosen) - 1, MOST).round().astype(int))]
    return rows[chosen], half, rate[chosen], acceleration[chosen]


def _parabola(reading: NDArray, rows: NDArray, half: int) -> tuple[NDArray, NDArray]:
    """Values (W, 3) in the middle of parabolas through readings, and how they add up noise (W,), rms."""
    lags = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(lags.astype(float), 3, increasing=True))[0]
    value = np.einsum("k,wkp->wp", weights, reading[rows[:, None] + lags])
    return value, np.full(len(rows), float(np.linalg.norm(weights)))


def _scatter(reading: NDArray, record: PositionRecord) -> NDArray[np.float64]:
    """Standard deviation (3,) of single readings about the means of their rests."""
    kept = [reading[rest.kept] for rest in record.rests if rest.refused is None]
    return np.sqrt(np.median([np.var(own, axis=0) for own in kept], axis=0))


def _slopes(here: Linearisation, at: Positions) -> NDArray[np.float64]:
    """Derivatives (N, 3, 2) of readings by the angles."""
    from_angles = [replace(at, **{name: getattr(at, name) + 1j * 1e-30}) for name in ("alpha", "beta")]
    read = [np.imag(predicted_reading(here.parametrisation, here.point, one)) / 1e-30 for one in from_angles]
    return np.stack(read, axis=2)


def _circumstances(rests: Bench, raw: BenchRecord, rows: NDArray, rate: NDArray, order: NDArray) -> Circumstances:
    """Circumstances of rests and of rows in motion, in this order."""
    known = rests.readings.circumstances
    angles = np.stack([without_turns(raw.alpha), without_turns(raw.beta)], axis=1)[rows]
    hours = (raw.time_s[rows] - known.began) / 3600.0
    rest = np.clip(np.searchsorted(known.hours, hours), 1, len(known.hours) - 1)
    senses = np.where(
        np.abs(rate) > SLOW, np.sign(rate), np.stack([known.sense_alpha, known.sense_beta], axis=1)[rest - 1]
    )
    before = None
    if known.before is not None:
        before = np.concatenate([known.before, angles - np.where(np.abs(rate) > SLOW, rate, 0.0)])[order]
    warm = None
    if known.temperature is not None and raw.temperature is not None:
        warm = np.append(known.temperature, raw.temperature[rows])[order]
    return replace(
        known,
        hours=np.append(known.hours, hours)[order],
        temperature=warm,
        sense_alpha=np.append(known.sense_alpha, senses[:, 0])[order],
        sense_beta=np.append(known.sense_beta, senses[:, 1])[order],
        before=before,
        axis_rates=np.concatenate([np.zeros((len(known.hours), 2)), rate])[order],
    )
