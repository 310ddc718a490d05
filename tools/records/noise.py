"""The bound σ on a reading's error from the record itself: repeated positions, the Allan deviation within rests."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fmus.units import STANDARD_GRAVITY
from .kinds import DwellNoise, PositionRecord, RawRecord

SAME_ANGLE = math.radians(1 / 60)
"""Positions whose angles agree so far are repeats of one [rad]."""

CONFIDENCE = 0.95
"""With which the bound taken from few repeats holds, for errors that are uniform within it."""

SCATTER_FACTOR = 3.0
"""The bound on a mean's error over its standard error."""


WHITE, WANDERING = 1.0 / math.sqrt(2.0), math.sqrt(2.0)
"""What twice the averaging time makes of the deviation: of white noise, and of a random walk."""


@dataclass(frozen=True)
class NoiseBound:
    """σ as a fraction of g, and a sentence on what it rests.

    `complete` says whether errors that hold over a rest show in it: only repeats of a position show them.
    """

    value: float
    basis: str
    complete: bool = True


def noise_bound_from(record: PositionRecord) -> NoiseBound | None:
    """Take the bound on one averaged reading's error from the record.

    Repeats of a position show everything that changes from one visit to the next, the encoders' errors
    included; half their range, widened for their number, is the bound. The scatter within rests does not show
    an error that holds over a rest: where there are no repeats the basis says so. None when the record has neither
    repeats nor a scatter (as one made from rests has), or shows no error at all.
    """
    repeats = _from_repeats(record)
    scatter = _from_scatter(record)
    found = repeats if repeats is not None else scatter
    if repeats is not None and scatter is not None and scatter.value > repeats.value:
        found = replace(scatter, complete=True)
    if found is None:
        return None
    written = record.resolution / STANDARD_GRAVITY
    if written > found.value:
        text = "half a last digit of the readings as written, more than their scatter"
        return NoiseBound(written, text, found.complete)
    return found if found.value > 0.0 else None


def uniform_range_quantile(counts: np.ndarray, probability: float) -> float:
    """Quantile of the largest of several half ranges, each of `counts` errors uniform in [-1, 1].

    The half range of n such errors, at least 2, is below t with the probability n tⁿ⁻¹ - (n - 1) tⁿ.
    """

    def excess(t: float) -> float:
        logs = (counts - 1) * math.log(t) + np.log(counts - (counts - 1) * t)
        return float(np.sum(logs)) - math.log(probability)

    # late: a record is read without it
    from scipy.optimize import brentq

    root: Any = brentq(excess, 1e-12, 1.0)
    return float(root)


def _from_repeats(record: PositionRecord) -> NoiseBound | None:
    labels = _same_positions(record)
    residual, slack = _without_angle_differences(record)
    half_ranges, counts = [], []
    for label in np.flatnonzero(np.bincount(labels) > 1):
        rows = labels == label
        spread = np.ptp(np.stack([record.alpha[rows], record.beta[rows]], axis=1) % (2.0 * math.pi), axis=0)
        spread = np.minimum(spread, 2.0 * math.pi - spread)
        half_ranges.append(0.5 * np.ptp(residual[rows], axis=0) + slack * float(spread.sum()))
        counts.append(int(np.count_nonzero(rows)))
    if not counts:
        return None
    largest = float(np.max(half_ranges))
    # three accelerometers for each group of repeats
    widening = 1.0 / uniform_range_quantile(np.repeat(counts, 3), 1.0 - CONFIDENCE)
    visits = f"{sum(counts)} visits to {len(counts)} repeated position{'s' if len(counts) > 1 else ''}"
    basis = (
        f"{visits}: half range {largest:.3g} g, widened by {widening:.3g} for their number "
        f"({100 * CONFIDENCE:.0f} % confidence)"
    )
    return NoiseBound(largest * widening, basis)


def _from_scatter(record: PositionRecord) -> NoiseBound | None:
    if record.scatter is None:
        return None
    unseen = "an error that holds over a rest does not show: repeat positions, or give --noise-bound"
    if record.dwell_noise is not None:
        pooled = max(record.dwell_noise.deviation) / STANDARD_GRAVITY
        basis = (
            f"scatter within {len(record)} rests: {SCATTER_FACTOR:.0f} times the Allan deviation at their dwell of "
            f"{record.dwell_noise.dwell_s:.3g} s, {pooled:.2g} g; {unseen}"
        )
        return NoiseBound(SCATTER_FACTOR * pooled, basis, complete=False)
    pooled = float(np.sqrt(np.max(np.mean(record.scatter**2, axis=0)))) / STANDARD_GRAVITY
    basis = f"scatter within {len(record)} rests: {SCATTER_FACTOR:.0f} standard errors of a mean; {unseen}"
    return NoiseBound(SCATTER_FACTOR * pooled, basis, complete=False)


def _same_positions(record: PositionRecord) -> np.ndarray:
    """A label for each row, the same for repeats of a position in the same mounting."""
    names = record.mounting or ("",) * len(record)
    keys = np.stack(
        [
            np.unique(np.array(names), return_inverse=True)[1],
            _angle_labels(record.alpha),
            _angle_labels(record.beta),
        ],
        axis=1,
    )
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)


def _angle_labels(angle: np.ndarray) -> np.ndarray:
    """A label for each angle, the same where angles agree within SAME_ANGLE, whole turns apart or not."""
    turned = angle % (2.0 * math.pi)
    order = np.argsort(turned, kind="stable")
    gap = np.diff(turned[order])
    # cut the circle at its widest gap, so that no cluster lies across the cut
    gaps = np.append(gap, 2.0 * math.pi - (turned[order[-1]] - turned[order[0]]))
    order = np.roll(order, -(int(np.argmax(gaps)) + 1))
    distance = (turned[order] - turned[order[0]]) % (2.0 * math.pi)
    labels = np.zeros(len(angle), dtype=np.int64)
    start, label = 0, 0
    for index in np.append(np.flatnonzero(np.diff(distance) > SAME_ANGLE) + 1, len(angle)).tolist():
        if distance[index - 1] - distance[start] <= SAME_ANGLE:
            labels[order[start:index]] = label
            label += 1
        else:
            # a dense sweep of angles has no repeats
            labels[order[start:index]] = np.arange(label, label + index - start)
            label += index - start
        start = index
    return labels


def _without_angle_differences(record: PositionRecord) -> tuple[np.ndarray, float]:
    """Readings in g less what a block fitted to the record reads at the same angles, and a slack.

    Repeats are not set to the same angle exactly: an arcminute is 3e-4 g. The fit (three readings affine in
    the vertical of the ideal table) takes that away to a part in a thousand. Where the positions do not
    determine it, the readings stay, and the slack [g/rad] says how much a difference of angles may matter.
    """
    reading = record.specific_force / STANDARD_GRAVITY
    up = np.stack(
        [
            np.sin(record.alpha) * np.sin(record.beta),
            np.sin(record.alpha) * np.cos(record.beta),
            np.cos(record.alpha),
            np.ones(len(record)),
        ],
        axis=1,
    )
    residual = np.array(reading)
    names = np.array(record.mounting or ("",) * len(record))
    for name in np.unique(names):
        rows = names == name
        if np.linalg.matrix_rank(up[rows], tol=1e-2 * math.sqrt(np.count_nonzero(rows))) < 4:
            return reading, 0.5
        solution = np.linalg.lstsq(up[rows], reading[rows], rcond=None)[0]
        residual[rows] = reading[rows] - up[rows] @ solution
    return residual, 0.0


def allan_deviation(pieces: Sequence[np.ndarray], size: int) -> np.ndarray | None:
    """Overlapping Allan deviation of averages over `size` rows, all pieces together, shape (m,).

    It is the square root of half the mean square difference of averages side by side; None when no piece holds two. The
    pieces (n, m) are readings within each rest, equally spaced in time.
    """
    total, count = 0.0, 0
    for piece in pieces:
        if len(piece) < 2 * size:
            continue
        # the sums stay small beside the first row: nothing is lost where readings hardly differ
        sums = np.concatenate([np.zeros((1, piece.shape[1])), np.cumsum(piece - piece[0], axis=0)])
        means = (sums[size:] - sums[:-size]) / size
        difference = means[size:] - means[:-size]
        total = total + np.sum(difference**2, axis=0)
        count += len(difference)
    return np.sqrt(0.5 * total / count) if count else None


def deviation_at_dwell(pieces: Sequence[np.ndarray]) -> np.ndarray | None:
    """Allan deviation of an average over a whole rest (the median one), shape (m,).

    A rest shows it up to half its length; one octave more is taken by the slope of the last octave, white noise's at
    best and a random walk's at worst. None when the rests are too short to tell.
    """
    rows = int(np.median([len(piece) for piece in pieces])) if len(pieces) else 0
    if rows < 4:
        return None
    half, quarter = allan_deviation(pieces, rows // 2), allan_deviation(pieces, rows // 4)
    if half is None or quarter is None:
        return None
    slope = np.divide(half, quarter, out=np.full_like(half, WHITE), where=quarter > 0.0)
    return half * np.clip(slope, WHITE, WANDERING)


def dwell_noise(raw: RawRecord, kept: Sequence[slice]) -> DwellNoise | None:
    """The noise of a record's averages, from the rows kept of each rest; None when these are too short to tell."""
    deviation = deviation_at_dwell([raw.specific_force[rows] for rows in kept])
    if deviation is None:
        return None
    first, second, third = deviation.tolist()
    dwell = float(np.median([raw.time_s[rows.stop - 1] - raw.time_s[rows.start] for rows in kept]))
    return DwellNoise(dwell, (first, second, third))
