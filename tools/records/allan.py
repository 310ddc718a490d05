"""Allan deviation of readings within the rests of a table, carried on to the length of a rest."""

import math
from collections.abc import Sequence

import numpy as np

from .kinds import DwellNoise, RawRecord

WHITE, WANDERING = 1.0 / math.sqrt(2.0), math.sqrt(2.0)
"""What twice the averaging time makes of the deviation: of white noise, and of a random walk."""


def allan_deviation(pieces: Sequence[np.ndarray], size: int) -> np.ndarray | None:
    """Overlapping Allan deviation of averages over `size` rows, all pieces together, shape (m,).

    Parameters
    ----------
    pieces : sequence of (n, m) arrays
        readings within each rest, equally spaced in time
    size : int
        rows of one average

    Returns
    -------
    ndarray or None
        square root of half the mean square difference of averages side by side; None when no piece holds two
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
    best and a random walk's at worst.

    Returns
    -------
    ndarray or None
        None when the rests are too short to tell
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
