"""Records of a block moved by hand, and wrong readings of it: units, signs, ranges, lost rows."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from generator import G
from generator.carried import drawn_motion
from trihedron.tools.records import BenchRecord, StrapdownRecord
from trihedron.tools.records.limits import runs_of

RATE_NOISE, FORCE_NOISE = 2e-3, 0.02
"""Noise of a sample [rad/s], [m/s²]."""


def hand_record(seed: int, *, truth: bool, moves: int = 12, period: float = 0.01) -> StrapdownRecord:
    """Return a correct record with usual errors: scale factors and misalignments of 1 %, biases of 0.01 rad/s."""
    rng = np.random.default_rng(seed)
    time, rate, up, attitude = drawn_motion(rng, moves=moves, rest=2.5, period=period)
    gyros = rate @ (np.eye(3) + rng.normal(0.0, 0.01, (3, 3))).T + rng.normal(0.0, 0.01, 3)
    quaternion = None
    if truth:
        quaternion = np.roll(attitude.as_quat(), 1, axis=1)
    return StrapdownRecord(
        time_s=time,
        rate=gyros + rng.normal(0.0, RATE_NOISE, rate.shape),
        increment=None,
        specific_force=G * up + rng.normal(0.0, FORCE_NOISE, up.shape),
        attitude=quaternion,
    )


def with_rates(record: StrapdownRecord, change: Callable[[np.ndarray], np.ndarray]) -> StrapdownRecord:
    """Return the record with changed rates."""
    assert record.rate is not None
    return replace(record, rate=change(record.rate.copy()))


def fastest_row(rate: np.ndarray, axis: int) -> int:
    """Return the middle of the longest stretch of nearly fastest turning."""
    begins, ends = runs_of(np.abs(rate[:, axis]) > 0.8 * np.abs(rate[:, axis]).max())
    longest = int(np.argmax(ends - begins))
    return int(begins[longest] + ends[longest]) // 2


def spiked(seed: int, rows: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    """Make one reading, or a few in a row, of 10 to 100 rad/s, at rest or in a move."""

    def change(rate: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(seed)
        first = int(rng.integers(100, len(rate) - 100))
        rate[first : first + rows, rng.integers(3)] = rng.choice([-1.0, 1.0]) * rng.uniform(10.0, 100.0)
        return rate

    return change


def overflowing(part: float) -> Callable[[np.ndarray], np.ndarray]:
    """Make readings of 16 bits whose range is this part of a gyro's largest reading."""

    def change(rate: np.ndarray) -> np.ndarray:
        limit = part * float(np.abs(rate).max())
        return (rate + limit) % (2.0 * limit) - limit

    return change


def losing(rows: int) -> Callable[[np.ndarray], np.ndarray]:
    """Make zeros of this number of readings of all gyros in the middle of a fast turn."""

    def change(rate: np.ndarray) -> np.ndarray:
        middle = fastest_row(rate, 0)
        rate[middle - rows // 2 : middle - rows // 2 + rows] = 0.0
        return rate

    return change


def stuck_from_start(rows: int, *, at_zero: bool, axes: slice = slice(0, 3)) -> Callable[[np.ndarray], np.ndarray]:
    """Make gyros repeat one value, that of the rest or zero, from the start of the fastest turn on."""

    def change(rate: np.ndarray) -> np.ndarray:
        middle = fastest_row(rate, axes.start)
        still = np.flatnonzero(np.linalg.norm(rate[:middle], axis=1) < 0.05)
        start = int(still[-1])
        end = max(start + rows, (start + middle) // 2)
        rate[start:end, axes] = 0.0 if at_zero else rate[start, axes]
        return rate

    return change


GYROS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "degrees": np.degrees,
    "reversed": np.negative,
    "one-sign": lambda rate: rate * [1.0, -1.0, 1.0],
    "swapped": lambda rate: rate[:, [1, 0, 2]],
    "twice": lambda rate: 2.0 * rate,
    "half": lambda rate: 0.5 * rate,
    "four-times": lambda rate: 4.0 * rate,
    "one-twice": lambda rate: rate * [1.0, 2.0, 1.0],
    "one-half": lambda rate: rate * [1.0, 1.0, 0.5],
    "by-1.5": lambda rate: 1.5 * rate,
    "spike": spiked(1),
    "two-spikes": spiked(2, rows=2),
    "overflow": overflowing(0.85),
    "lost": losing(20),
    "zero-from-start": stuck_from_start(30, at_zero=True),
    "stuck-from-start": stuck_from_start(30, at_zero=False, axes=slice(0, 1)),
}
"""Wrongly read gyros: each makes results wrong, with and without a true attitude."""
ATTITUDES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "scalar-last": lambda q: np.roll(q, -1, axis=1),
    "inverse": lambda q: q * [1.0, -1.0, -1.0, -1.0],
}
"""True attitudes of another meaning."""


def with_force_lost(force: np.ndarray) -> np.ndarray:
    """Make three rows at rest in which all accelerometers read zero."""
    force[70:73] = 0.0
    return force


def with_force_spike(force: np.ndarray) -> np.ndarray:
    """Make one reading of one accelerometer 4 g wrong, at rest."""
    force[70, 1] += 4.0 * G
    return force


def shaken_beyond(limit: float) -> Callable[[np.ndarray], np.ndarray]:
    """Make readings of 16 bits with this limit [g], with the block shaken by 2.5 g in its first rest."""

    def change(force: np.ndarray) -> np.ndarray:
        rows = np.arange(100)
        force[60:160, 0] += 2.5 * G * np.sin(0.2 * rows) * np.sin(np.pi * rows / 100.0)
        return (force + limit * G) % (2.0 * limit * G) - limit * G

    return change


FORCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "force-twice": lambda force: 1.99 * force,
    "force-half": lambda force: 0.505 * force,
    "feet": lambda force: force / 0.3048,
    "force-one-twice": lambda force: force * [1.0, 1.0, 2.0],
    "force-lost": with_force_lost,
    "force-spike": with_force_spike,
    "force-overflow": shaken_beyond(2.0),
}
"""Accelerometers in another range or unit."""


def as_increments(record: StrapdownRecord) -> StrapdownRecord:
    """Return the record with increments of angle and velocity in place of rates, over the steps between rows."""
    assert record.rate is not None
    period = float(np.median(np.diff(record.time_s)))
    return replace(record, rate=None, increment=period * record.rate, velocity_increment=period * record.specific_force)


def wrong_bench(name: str, right: BenchRecord) -> BenchRecord:
    """Return a record of a table that is wrong in this way."""
    assert right.increment is not None
    if name in FORCES:
        return replace(right, specific_force=FORCES[name](right.specific_force.copy()))
    period = float(np.median(np.diff(right.time_s)))
    return replace(right, increment=period * GYROS[name](right.increment / period))


def wrong_record(name: str, seed: int, *, truth: bool, **motion: Any) -> StrapdownRecord:
    """Return a record that is wrong in this way."""
    record = hand_record(seed, truth=truth or name in ATTITUDES, **motion)
    if name in ATTITUDES:
        assert record.attitude is not None
        return replace(record, attitude=ATTITUDES[name](record.attitude))
    if name in FORCES:
        return replace(record, specific_force=FORCES[name](record.specific_force.copy()))
    return with_rates(record, GYROS[name])
