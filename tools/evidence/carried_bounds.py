"""Bounds of the errors that a record's own noise makes: of gyros over a time, of accelerometers and truth at rest."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from ..motion.carry import matrices_of
from ..motion.inspect import Inspection
from ..motion.rests import Rests, rates_of
from ..records.noise import SCATTER_FACTOR, allan_deviation

FLICKER_TO_ALLAN = 2.0 * math.log(2.0)
"""Square of flicker noise's Allan deviation over its coefficient: a mean over τ wanders about the mean over T by the
coefficient times ln(T/τ), mean square."""
ANY_BEYOND = 5e-3
"""Probability that any of a record's errors of one kind is beyond its bound, were they Gaussian."""
BY_CHANCE = 0.25
"""Probability that the rests show less wandering than is taken for it."""
SPARE = 4
"""So many rests more than terms are wanted."""
LEAST_RATE = 1e-12
"""Bounds of rates are not taken for less [rad/s]: arithmetic has errors too."""


@dataclass(frozen=True, eq=False)
class RestNoise:
    """Noise of three gyros, or accelerometers, at rest: white noise and flicker noise of each.

    Attributes
    ----------
    white : (3,) array
        mean square of a mean over one second [rad²/s]
    flicker : (3,) array
        square of the flat part of the Allan deviation [rad²/s²]
    wander : (3,) array
        mean square of what the means at rest differ by from one rest to the next beside white noise [rad²/s²]
    span : float
        length of the record [s]
    """

    white: NDArray[np.float64]
    flicker: NDArray[np.float64]
    wander: NDArray[np.float64]
    span: float

    def rate_square(self, seconds: NDArray) -> NDArray[np.float64]:
        """Mean square (S, 3) of a mean rate's error over times (S,) [rad²/s²]."""
        seconds = np.maximum(np.asarray(seconds, dtype=float), 1e-9)[:, None]
        wandering = np.maximum(1.0, np.log(np.maximum(self.span / seconds, 1.0)) / FLICKER_TO_ALLAN)
        slow = np.where(np.isfinite(self.wander), np.maximum(self.wander, self.flicker), self.flicker * wandering)
        return np.maximum(self.white / seconds + slow, LEAST_RATE**2)

    def angle_square(self, seconds: NDArray) -> NDArray[np.float64]:
        """Mean square (S,) of the turn about any axis over times (S,) that is noise [rad²]."""
        return self.rate_square(seconds).max(axis=1) * np.asarray(seconds, dtype=float) ** 2


def factor_for(rows: int) -> float:
    """A bound over its standard deviation such that hardly one of so many errors exceeds it; at least three."""
    return max(SCATTER_FACTOR, float(norm.isf(0.5 * ANY_BEYOND / max(rows, 1))))


def gyro_noise(found: Inspection, up: NDArray | None) -> RestNoise | None:
    """Noise of the gyros from the rests; None where these are too few or too short to tell.

    White noise falls with the averaging time and flicker noise does not: the Allan deviations of a quarter and of half
    of the median rest tell them apart. What differs between the rests' means, and no drift, no dependence on gravity
    or on temperature explains, counts as noise too.

    Parameters
    ----------
    found : Inspection
    up : (K, 3) array or None
        directions of gravity at the rests; None where they are not known
    """
    rests, period = found.rests, found.sampling.period
    told = white_and_flicker(rates_of(found.record), rests, period)
    if told is None:
        return None
    white, flicker = told
    wander = rest_wander(rests, up, white / rest_lengths(rests, period)[:, None])
    return RestNoise(white, flicker, wander, span_of(found))


def force_deviation(found: Inspection) -> NDArray[np.float64]:
    """Standard deviation (K, 3) of the accelerometers' means at rest [m/s²], flicker over the whole record included."""
    rests, period = found.rests, found.sampling.period
    assert rests.force_bound is not None
    deviation = rests.force_bound / SCATTER_FACTOR
    told = white_and_flicker(found.record.specific_force, rests, period)
    if told is None:
        return deviation
    # What wanders from rest to rest may be an effect: only the rests themselves tell.
    noise = RestNoise(*told, np.full(3, np.nan), span_of(found))
    return np.maximum(deviation, np.sqrt(noise.rate_square(rest_lengths(rests, period))))


def span_of(found: Inspection) -> float:
    """Length of a record [s]."""
    return float(found.record.time_s[-1] - found.record.time_s[0])


def white_and_flicker(readings: NDArray, rests: Rests, period: float) -> tuple[NDArray, NDArray] | None:
    """Of readings (N, 3) at rest: mean square of a mean over one second, and of the flat part, each (3,)."""
    pieces = [readings[rows] for rows in rests.rows]
    rows = int(np.median([len(piece) for piece in pieces])) if pieces else 0
    if rows < 8:
        return None
    half, quarter = allan_deviation(pieces, rows // 2), allan_deviation(pieces, rows // 4)
    if half is None or quarter is None:
        return None
    # At a quarter white noise has twice the mean square that it has at half.
    part = np.clip(2.0 * (quarter**2 - half**2), 0.0, quarter**2)
    return part * (rows // 4) * period, np.maximum(half**2 - 0.5 * part, 0.0)


def rest_lengths(rests: Rests, period: float) -> NDArray[np.float64]:
    """Length (K,) of each rest [s]."""
    return np.array([rows.stop - rows.start for rows in rests.rows], dtype=float) * period


def rest_wander(rests: Rests, up: NDArray | None, white: NDArray) -> NDArray[np.float64]:
    """Mean square (3,) of the means at rest beside white noise (K, 3) [rad²/s²]; NaN if it cannot be told.

    Everything that an effect could do at rest is fitted and taken away: what grows with time, with temperature, with
    gravity and, where there are enough rests, with its products.
    """
    columns = [np.ones(len(rests)), rests.time_s - rests.time_s[0]]
    if rests.temperature is not None:
        columns.append(rests.temperature)
    if up is not None:
        columns += list(up.T)
        products = [up[:, i] * up[:, j] for i in range(3) for j in range(i, 3)]
        # One product follows from the others and the constant.
        if len(rests) < len(columns) + len(products) - 1 + SPARE:
            return np.full(3, np.nan)
        columns += products
    design = np.stack(columns, axis=1)
    design = design / np.maximum(np.abs(design).max(axis=0), 1e-300)
    free = len(design) - np.linalg.matrix_rank(design, tol=1e-6)
    if free < SPARE:
        return np.full(3, np.nan)
    left = rests.rate - design @ np.linalg.lstsq(design, rests.rate, rcond=1e-8)[0]
    # So few rests may show too little of it by chance.
    surely = free / chi2.ppf(BY_CHANCE, free)
    return np.maximum(surely * (left**2).sum(axis=0) / free - white.mean(axis=0), 0.0)


def truth_scatter(attitude: NDArray, rests: Rests, period: float, seconds: float) -> float:
    """Largest turn of the true attitude (N, 4) between rows so far apart at rest [rad]; 0 where no rest is so long."""
    apart = max(1, round(seconds / period))
    largest = 0.0
    for rows in rests.rows:
        inside = attitude[rows]
        if len(inside) <= apart:
            continue
        first, second = inside[:-apart], inside[apart:]
        known = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
        if known.any():
            turns = matrices_of(first[known]).transpose(0, 2, 1) @ matrices_of(second[known])
            largest = max(largest, float(np.abs(Rotation.from_matrix(turns).as_rotvec()).max()))
    return largest
