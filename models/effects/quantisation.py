"""Quantisation: an accelerometer's reading is rounded to a step."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import EffectParameter, EffectPlace, last_stage_effect
from .rows import Rows, Variant, at_readings, variant

LEAST_STEP, LARGEST_STEP = 1e-7, 1e-2
LEAST_PART = 0.2
"""A step below this part of σ widens no bound that matters."""
FINEST = 1e-10
"""Digits of a reading [g] finer than this are rounding."""
SHARE = 0.7
"""Part of the readings that are multiples of the step; the others are means over rests between two of them."""
COARSE = 20.0
"""A step is at least so many times the error of its multiples."""
FEWEST_NOISY = 10
"""Fewer different readings prove no step whose multiples have errors of their own."""
FEWEST = 6
"""Fewer readings prove no step."""
AT_ONCE = 1 << 18
"""So many steps are tried at once: a fast gyro without noise has hundreds of millions."""


def quantisation(context: Vector, own: Vector, p: int, step: float, reading: Vector) -> None:
    """Round the reading of accelerometer p to a multiple of the step; a step of 0 stands for none."""
    if step > 0.0:
        reading[p] = step * math.floor(reading[p] / step + 0.5)


def variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """The largest step of which the readings are multiples; they lie within half a step of what they would be."""
    p = place.index
    tolerance = max(FINEST, rows.resolution)
    step = common_step(reading[:, p], tolerance, max(LEAST_STEP, LEAST_PART * sigma, COARSE * tolerance))
    limits = None if step is None else (step - tolerance, step + tolerance)
    if limits is None:
        limits = noisy_step(reading[:, p], sigma + tolerance)
    if limits is None:
        return []
    step = 0.5 * (limits[0] + limits[1])
    rounded = at_readings(rows.n.shape, np.arange(len(rows.n)), p)

    def undecided(others: Rows, sigma: float) -> NDArray[np.bool_]:
        steps = others.prediction[:, p] / step
        from_edge = step * np.abs(steps - np.floor(steps) - 0.5)
        # The bench was fitted to readings that rounding had moved, by some part of a step.
        return at_readings(others.n.shape, np.flatnonzero(from_edge < 2.0 * sigma + 0.25 * step), p)

    return [variant(rows.n.shape, (limits,), widening=np.where(rounded, 0.5 * step, 0.0), undecided=undecided)]


def common_step(values: NDArray[np.float64], tolerance: float, least: float) -> float | None:
    """The largest step, up to 1e-2, of which at least seven in ten values (N,) are whole multiples.

    Each of some values is tried as m steps, for all m: where it is, most of some others are multiples too, and few
    steps are left for the rest to judge.

    Parameters
    ----------
    values : (N,) array
    tolerance : float
        by which a value may miss its multiple
    least : float
        of the steps that are tried; more than ten times the tolerance

    Returns
    -------
    float or None
        None where there is no such step, or too few different values
    """
    distinct = np.unique(np.round(np.abs(values[np.abs(values) > least]) / tolerance)) * tolerance
    if len(distinct) < FEWEST:
        return None
    # Spread over the range, the largest first: its multiples pin the step down best.
    probes = distinct[np.unique(np.linspace(0, len(distinct) - 1, 12).round().astype(int))][::-1]
    best: float | None = None
    for base in probes[:4]:
        for step in likely_steps(base, probes[probes != base], tolerance, least):
            if best is not None and step <= best:
                break
            refined = refine(values, step)
            if share(values, refined, tolerance) >= SHARE:
                best = refined
                break
    if best is None:
        return None
    # Of few multiples of a step most may be even by chance.
    finer = [best / k for k in (2, 3) if share(values, best / k, tolerance) >= share(values, best, tolerance) + 0.15]
    return finer[0] if finer else best


def likely_steps(base: float, others: NDArray[np.float64], tolerance: float, least: float) -> Iterator[float]:
    """Steps, the largest first, of which a value is a whole multiple and most of some others (K,) are too."""
    last = math.floor(base / least)
    for first in range(math.ceil(base / LARGEST_STEP), last + 1, AT_ONCE):
        steps = base / np.arange(first, min(first + AT_ONCE, last + 1))
        for tried in (others[:4], others):
            hits = sum((misses(other, steps) <= 2.0 * tolerance) * 1.0 for other in tried)
            steps = steps[hits >= SHARE * len(tried) - 1.0]
        yield from steps.tolist()


def noisy_step(values: NDArray[np.float64], sigma: float) -> tuple[float, float] | None:
    """Least and largest step [g] of which all values (N,) are multiples up to an error of σ, made after the rounding.

    Few different values, or steps that are not many times σ, prove nothing: a tenth of all values lie so near a
    multiple by chance. Readings of the same input, which differ by their errors, count as one.
    """
    apart = np.sort(np.abs(values[np.abs(values) > COARSE * sigma]))
    if 1 + np.count_nonzero(np.diff(apart) > 2.0 * sigma) < FEWEST_NOISY:
        return None
    step = common_step(values, sigma, max(LEAST_STEP, COARSE * sigma))
    if step is None:
        return None
    counts = np.round(np.abs(values) / step)
    if np.abs(np.abs(values) - counts * step)[counts == 0.0].max(initial=0.0) > sigma:
        return None
    size, counts = np.abs(values)[counts > 0.0], counts[counts > 0.0]
    low, high = float(((size - sigma) / counts).max()), float(((size + sigma) / counts).min())
    return (low, high) if low <= high and high <= LARGEST_STEP else None


def share(values: NDArray[np.float64], step: float, tolerance: float) -> float:
    """Part of the values that are multiples of a step."""
    return float(np.mean(misses(values, np.full(len(values), step)) <= 2.0 * tolerance))


def refine(values: NDArray[np.float64], step: float) -> float:
    """The step that fits the multiples best, in the least-squares sense, where most values are multiples."""
    for _ in range(3):
        counts = np.round(values / step)
        left = np.abs(values - counts * step)
        kept = left <= 3.0 * np.median(left)
        if (counts[kept] ** 2).sum() == 0.0:
            return step
        step = float((values[kept] * counts[kept]).sum() / (counts[kept] ** 2).sum())
    return step


def misses(values: NDArray[np.float64] | float, steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of values from the nearest multiples of steps."""
    return np.abs(values - np.round(values / steps) * steps)


EFFECT = last_stage_effect(
    quantisation,
    EffectParameter("step", "g", "readings are multiples of it", LARGEST_STEP, smallest=LEAST_STEP),
    variants,
    "accelerometer {p} reads in steps of {step:.3e} g",
    formula="f_{p}/g 'in multiples of' {step}",
)
