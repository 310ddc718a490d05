"""Changes of a finished reading, its error included; only the outlier is linear in its parameters.

dead_zone
    an accelerometer does not sense a small input
saturation
    an accelerometer reads no more than a level
quantisation, gyro_quantisation
    an accelerometer's reading, the gyros' readings are rounded to a step
exchanged_readings
    from a time on the sign of a channel is reversed, or two channels are exchanged
outlier
    a single wrong reading: it marks a row and has no kernel
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..restricted import HOURS, INPUT, Vector
from .columns import MotionRows, Rows
from .definition import (
    ACCELEROMETERS,
    GYRO_BLOCK,
    Effect,
    EffectParameter,
    EffectPlace,
    last_stage_effect,
    said,
)
from .variants import Variant, at_readings, variant

LARGEST_WIDTH = 0.05


def dead_zone(context: Vector, own: Vector, p: int, width: float, reading: Vector) -> None:
    """Subtract the own input's part from the reading of accelerometer p, if |n_p| is below the width."""
    if math.fabs(context[INPUT + p]) < width:
        reading[p] = reading[p] - own[p]


def dead_zone_variants(place: EffectPlace, rows: Rows, reading: Floats, sigma: float) -> list[Variant]:
    """Return the variants: only the set of readings below the width matters, the smallest input, the two smallest,
    ..."""
    p = place.index
    size = np.abs(rows.n[:, p])
    order = np.argsort(size, kind="stable")
    ways = []
    for count in range(1, int((size < LARGEST_WIDTH).sum()) + 1):
        chosen = np.sort(order[:count])
        below = float(size[order[count - 1]])
        above = min(LARGEST_WIDTH, float(size[order[count]])) if count < len(size) else LARGEST_WIDTH
        if above > below:
            ways.append(_dead_zone_variant(p, rows, chosen, (below, above)))
    return ways


def _dead_zone_variant(p: int, rows: Rows, chosen: Ints, limits: tuple[float, float]) -> Variant:
    lost = at_readings(rows.n.shape, chosen, p)

    def stands(rows_at_fit: Rows, coefficients: Floats) -> bool:
        size = np.abs(rows_at_fit.n[:, p])
        inside = bool(size[chosen].max() < LARGEST_WIDTH)
        return inside and bool(size[chosen].max() < np.delete(size, chosen).min(initial=np.inf))

    def undecided(further: Rows, sigma: float) -> Bools:
        size = np.abs(further.n[:, p])
        return at_readings(further.n.shape, np.flatnonzero((size > limits[0] - sigma) & (size < limits[1] + sigma)), p)

    offset = np.where(lost, -rows.own, 0.0)
    return variant(rows.n.shape, (limits,), offset=offset, lost=lost, stands=stands, undecided=undecided)


DEAD_ZONE = last_stage_effect(
    dead_zone,
    EffectParameter("width", "g", "inputs smaller than it are lost", LARGEST_WIDTH, smallest=0.0),
    dead_zone_variants,
    "accelerometer {p} does not feel inputs below {width:.2e} g",
    degree=-1,
    formula="n_{p} 'counts as' 0 'where' |n_{p}| < {width}",
)


LEAST_LEVEL, LARGEST_LEVEL = 0.5, 10.0


def saturation(context: Vector, own: Vector, p: int, level: float, reading: Vector) -> None:
    """Clip the reading of accelerometer p at ±level; a level of 0 means none."""
    if level > 0.0:
        if reading[p] > level:
            reading[p] = level
        if reading[p] < -level:
            reading[p] = -level


def saturation_variants(place: EffectPlace, rows: Rows, reading: Floats, sigma: float) -> list[Variant]:
    """Return the variants: readings at the level agree within the noise and have the k largest predictions.

    A clipped reading is ±level for any bench, so its change is linear in the level.
    """
    p = place.index
    size = np.abs(reading[:, p])
    largest = float(size.max(initial=0.0))
    room = sigma + rows.resolution
    low, high = max(LEAST_LEVEL, largest - room), min(LARGEST_LEVEL, largest + room)
    if low > high:
        return []
    band = np.flatnonzero(size >= largest - 2.0 * room)
    order = band[np.argsort(-np.abs(rows.prediction[band, p]), kind="stable")]
    ways = []
    for count in range(1, len(band) + 1):
        ways.append(_saturation_variant(p, rows, np.sort(order[:count]), reading, (low, high), sigma))
    return ways


def _saturation_variant(
    p: int,
    rows: Rows,
    chosen: Ints,
    reading: Floats,
    limits: tuple[float, float],
    sigma: float,
) -> Variant:
    fixed = at_readings(rows.n.shape, chosen, p)

    def stands(rows_at_fit: Rows, coefficients: Floats) -> bool:
        size = np.abs(rows_at_fit.prediction[:, p])
        largest_other = np.delete(size, chosen).max(initial=0.0)
        return bool(size[chosen].min() >= coefficients[0] - sigma and largest_other <= coefficients[0] + sigma)

    return variant(
        rows.n.shape,
        (limits,),
        offset=np.where(fixed, -rows.prediction, 0.0),
        columns=np.where(fixed, np.sign(reading), 0.0)[..., None],
        low=np.array([limits[0]]),
        high=np.array([limits[1]]),
        values=lambda coefficients: (float(coefficients[0]),),
        fixed=fixed,
        stands=stands,
    )


SATURATION = last_stage_effect(
    saturation,
    EffectParameter("level", "g", "largest reading", LARGEST_LEVEL, smallest=LEAST_LEVEL),
    saturation_variants,
    "accelerometer {p} saturates at {level:.6g} g",
    formula="|f_{p}|/g ≤ {level}",
)


LEAST_STEP, LARGEST_STEP = 1e-7, 1e-2
LEAST_PART = 0.2
"""Step, relative to σ, below which it widens no bound that matters."""
FINEST = 1e-10
"""Size [g] below which digits of a reading are rounding."""
SHARE = 0.7
"""Share of the readings that are multiples of the step; the others are means over rests between two of them."""
COARSE = 20.0
"""Least ratio of a step to the error of its multiples."""
FEWEST_NOISY = 10
"""Least number of different readings that prove a step whose multiples have errors of their own."""
FEWEST = 6
"""Least number of readings that prove a step."""
AT_ONCE = 1 << 18
"""Number of steps that are tried at once: a fast gyro without noise has hundreds of millions."""


def quantisation(context: Vector, own: Vector, p: int, step: float, reading: Vector) -> None:
    """Round the reading of accelerometer p to a multiple of the step; a step of 0 means none."""
    if step > 0.0:
        reading[p] = step * math.floor(reading[p] / step + 0.5)


def quantisation_variants(place: EffectPlace, rows: Rows, reading: Floats, sigma: float) -> list[Variant]:
    """Return the variants of the largest steps whose multiples the readings are, exactly and to σ.

    Readings lie within half a step of the inputs. Noise after the rounding, at its very bound or in steps, makes
    readings that are exact multiples of a fine step and to σ of a coarse one: both are tried. Most of few multiples of
    a step may be even by chance, and a mean over a rest may lie in the middle of two. If all are multiples of half or a
    third of it, that is tried, too.
    """
    p, limits_of_ways = place.index, []
    tolerance = max(FINEST, rows.resolution)
    step = common_step(reading[:, p], tolerance, max(LEAST_STEP, LEAST_PART * sigma, COARSE * tolerance))
    if step is not None:
        limits_of_ways.append((step - tolerance, step + tolerance))
        if share(reading[:, p], step, tolerance) < 1.0:
            for fine in (step / 2, step / 3):
                if share(reading[:, p], fine, tolerance) == 1.0:
                    limits_of_ways.append((fine - tolerance, fine + tolerance))
    noisy = noisy_step(reading[:, p], sigma + tolerance)
    if noisy is not None and (step is None or noisy[0] > 1.5 * step):
        limits_of_ways.append(noisy)
    return [_quantisation_variant(p, rows, limits) for limits in limits_of_ways]


def _quantisation_variant(p: int, rows: Rows, limits: tuple[float, float]) -> Variant:
    step = 0.5 * (limits[0] + limits[1])
    rounded = at_readings(rows.n.shape, np.arange(len(rows.n)), p)

    def undecided(further: Rows, sigma: float) -> Bools:
        steps = further.prediction[:, p] / step
        from_edge = step * np.abs(steps - np.floor(steps) - 0.5)
        # The bench was fitted to readings that rounding had moved, by some part of a step.
        return at_readings(further.n.shape, np.flatnonzero(from_edge < 2.0 * sigma + 0.25 * step), p)

    return variant(rows.n.shape, (limits,), widening=np.where(rounded, 0.5 * step, 0.0), undecided=undecided)


def common_step(values: Floats, tolerance: float, least: float) -> float | None:
    """Return the largest step, up to 1e-2, with at least seven in ten values (N,) as whole multiples.

    Each of some values is tried as m steps, for all m. If most of some others are multiples too, the step remains; the
    rest of the values judge the few remaining steps.

    Parameters
    ----------
    values : (N,) array
        the values
    tolerance : float
        largest distance of a value from its multiple
    least : float
        least step that is tried; more than ten times the tolerance

    Returns
    -------
    float or None
        None if there is no such step, or too few different values
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
    # Most of few multiples of a step may be even by chance.
    usual = share(values, best, tolerance)
    for finer in (best / 2, best / 3):
        if share(values, finer, tolerance) >= usual + 0.15:
            return finer
    return best


def likely_steps(base: float, probes: Floats, tolerance: float, least: float) -> Iterator[float]:
    """Yield the steps, the largest first, for which a value and most of some others (K,) are whole multiples."""
    last = math.floor(base / least)
    for first in range(math.ceil(base / LARGEST_STEP), last + 1, AT_ONCE):
        steps = base / np.arange(first, min(first + AT_ONCE, last + 1))
        for some in (probes[:4], probes):
            hits = sum((misses(probe, steps) <= 2.0 * tolerance) * 1.0 for probe in some)
            steps = steps[hits >= SHARE * len(some) - 1.0]
        yield from steps.tolist()


def noisy_step(values: Floats, sigma: float) -> tuple[float, float] | None:
    """Return least and largest step [g] for which all values (N,) are multiples to an error of σ after the rounding.

    Few different values, or steps that are not many times σ, prove nothing: a tenth of all values lie that near a
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


def share(values: Floats, step: float, tolerance: float) -> float:
    """Return the part of the values that are multiples of a step."""
    return float(np.mean(misses(values, np.full(len(values), step)) <= 2.0 * tolerance))


def refine(values: Floats, step: float) -> float:
    """Return the step that fits the multiples best, in the least-squares sense, if most values are multiples."""
    for _ in range(3):
        counts = np.round(values / step)
        remainder = np.abs(values - counts * step)
        fitting = remainder <= 3.0 * np.median(remainder)
        if (counts[fitting] ** 2).sum() == 0.0:
            return step
        step = float((values[fitting] * counts[fitting]).sum() / (counts[fitting] ** 2).sum())
    return step


def misses(values: Floats | float, steps: Floats) -> Floats:
    """Return distances of values from the nearest multiples of steps."""
    return np.abs(values - np.round(values / steps) * steps)


QUANTISATION = last_stage_effect(
    quantisation,
    EffectParameter("step", "g", "readings are multiples of it", LARGEST_STEP, smallest=LEAST_STEP),
    quantisation_variants,
    "accelerometer {p} reads in steps of {step:.3e} g",
    formula="f_{p}/g 'in multiples of' {step}",
    rounds=True,
)


FINEST_RATE = 1e-9
"""Size [rad/s] below which digits of a rate are rounding."""
MOST_RATES = 3000
"""Largest number of a gyro's readings that are examined, spread over the record."""


def gyro_quantisation(context: Vector, own: Vector, step: float, reading: Vector) -> None:
    """Round each gyro's reading to a multiple of the step; a step of 0 means none."""
    if step > 0.0:
        for p in range(3):
            reading[p] = step * math.floor(reading[p] / step + 0.5)


def gyro_quantisation_variants(place: EffectPlace, rows: MotionRows, reading: Floats, sigma: float) -> list[Variant]:
    """Return the variant of the largest step whose multiples the readings (N, 3) [rad/s] are.

    Readings lie within half a step of the truth. `sigma` [rad/s] is the noise of a reading; a step far below it widens
    no bound that matters.
    """
    some = reading[:: max(1, len(reading) // MOST_RATES)]
    least = max(LEAST_STEP, 0.2 * sigma, 20.0 * FINEST_RATE)
    steps = np.array([common_step(some[:, p], FINEST_RATE, least) or 0.0 for p in range(3)])
    step = float(steps.max())
    if step == 0.0:
        return []
    widening = np.tile(0.5 * steps, (len(reading), 1))
    limits = ((step - FINEST_RATE, step + FINEST_RATE),)
    return [variant(reading.shape, limits, widening=widening, values=lambda coefficients: (step,))]


GYRO_QUANTISATION = last_stage_effect(
    gyro_quantisation,
    EffectParameter("step", "rad/s", "readings are multiples of it", LARGEST_STEP, smallest=LEAST_STEP),
    gyro_quantisation_variants,
    "the gyros read in steps of {step:.3e} rad/s",
    places=(EffectPlace("gyro-quantisation", GYRO_BLOCK),),
    component="GyroBlock",
    rounds=True,
)


LAST_HOUR = 1e4
SURELY = 0.1
"""Largest error of an input for any bench [g]: a reading that fits only another channel is exchanged."""
FEWEST_EXCHANGED = 2
"""Least number of rows on each side of a time; of these one must be surely exchanged, or surely not."""


def exchanged_readings(context: Vector, own: Vector, p: int, i: int, start: float, reading: Vector) -> None:
    """After `start` hours exchange the readings of p and i, or reverse that of p if i is p; 0 means none."""
    if start > 0.0 and context[HOURS] > start:
        if i == p:
            reading[p] = -reading[p]
        else:
            kept = reading[p]
            reading[p] = reading[i]
            reading[i] = kept


def exchanged_variants(place: EffectPlace, rows: Rows, reading: Floats, sigma: float) -> list[Variant]:
    """Return a variant for each time that separates surely unexchanged readings from surely exchanged ones.

    Any aligned bench reads each input to a few hundredths of g: that decides most rows.
    """
    matrix = _exchange(place)
    straight = np.abs(reading - rows.n).max(axis=1)
    exchanged = np.abs(reading - rows.n @ matrix.T).max(axis=1)
    after = np.flatnonzero((exchanged < SURELY) & (straight > 2.0 * SURELY))
    before = np.flatnonzero((straight < SURELY) & (exchanged > 2.0 * SURELY))
    if not len(before) or not len(after) or before[-1] > after[0]:
        return []
    ways = []
    first, last = max(before[-1] + 1, FEWEST_EXCHANGED), min(after[0], len(reading) - FEWEST_EXCHANGED)
    for row in range(first, last + 1):
        mixed = np.where((np.arange(len(reading)) >= row)[:, None, None], matrix, np.eye(3))
        limits = ((float(rows.hours[row - 1]), float(rows.hours[row])),)
        ways.append(variant(rows.n.shape, limits, mixed=mixed))
    return ways


def _exchange(place: EffectPlace) -> Floats:
    """Return the matrix (3, 3) that exchanges channels of the three readings."""
    p, i = place.index, place.axes[0] - 1
    matrix = np.eye(3)
    if p == i:
        matrix[p, p] = -1.0
    else:
        matrix[[p, i]] = matrix[[i, p]]
    return matrix


def exchanged_sentence(place: EffectPlace, values: Mapping[str, float]) -> str:
    """Return a sentence on the reversed or exchanged channels."""
    p, i = place.index + 1, place.axes[0]
    what = f"the sign of accelerometer {p} is reversed" if p == i else f"accelerometers {p} and {i} are exchanged"
    return f"{what} from {values['start']:.4g} h on"


EXCHANGED_READINGS = last_stage_effect(
    exchanged_readings,
    EffectParameter(
        "start", "h", "time after which channels are exchanged, or a sign reversed", LAST_HOUR, smallest=0.0
    ),
    exchanged_variants,
    exchanged_sentence,
    places=tuple(
        EffectPlace("exchanged-readings", where, axes=(i,))
        for p, where in enumerate(ACCELEROMETERS, start=1)
        for i in range(p, 4)
    ),
    formula="f_{p} ↔ ±f_{i} 'from' t = {start} 'on'",
)


def place_of(position: int, accelerometer: int) -> EffectPlace:
    """Return the place of an outlier: the row's index from 1 in the record, and the accelerometer from 1."""
    return EffectPlace("outlier", f"position-{position}", axes=(accelerometer,))


def outlier_columns(place: EffectPlace, rows: Rows) -> Floats:
    """Return a column with one at one reading; the row is counted from 1 within `rows`."""
    columns = np.zeros((len(rows.alpha), 3, 1))
    columns[int(place.where.removeprefix("position-")) - 1, place.axes[0] - 1, 0] = 1.0
    return columns


OUTLIER = Effect(
    name="outlier",
    places=(),
    parameters=(EffectParameter("size", "g", "by how much the reading is off", 10.0),),
    columns=outlier_columns,
    sentence=said("the reading of accelerometer {i} at {axis} is off by {size:+.2e} g"),
    formula="Δf_{i}/g = {size} 'at position' {p}",
)

EFFECTS = (DEAD_ZONE, SATURATION, QUANTISATION, GYRO_QUANTISATION, EXCHANGED_READINGS, OUTLIER)
