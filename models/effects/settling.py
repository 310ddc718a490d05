"""What settles with a time constant that is found.

warm_up
    the bias of an accelerometer settles exponentially after the start
thermal_lag
    the bias of an accelerometer depends on a temperature that follows the measured one through a first-order lag

A time constant is sought in cells that cover all from the shortest to the longest that a record can show. Within a cell
the response is a mean of those at its two ends, with weights of one sign, up to an error that is bounded by the second
derivative by the constant's logarithm; the bounds of the readings grow by it, so that no time constant is missed.

Where a lag is at the first row follows from temperatures before it, which no record has. It is taken to lie within the
range of the record's temperatures, widened by `BEFORE` of that range on both sides: its response is a mean, again with
weights of one sign, of those from these two ends.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..restricted import HOURS, KEPT, TEMPERATURE, Vector
from .accelerometer import NOMINAL_TEMPERATURE
from .columns import Rows
from .definition import EffectParameter, EffectPlace, accelerometer_column, last_stage_effect
from .last_stage import LAST_HOUR
from .variants import Variant, variant

LARGEST_OF_BIAS = 1e-1
LARGEST_PER_KELVIN = 1e-3
CELL = 0.15
"""Width of a cell of time constants, as a difference of their logarithms."""
LONGEST = 10.0
"""Time constants up to so many times a record's length are sought: a longer one cannot be told from a drift."""
SHORTEST_ROW = 2
"""What settles before this row is an outlier of the first."""
SHORTER = 0.05
"""A lag of so small a part of the time of that row is still sought; a shorter one is none."""
BEFORE = 0.5
"""By so many times the range of a record's temperatures those before it may be beyond it, on both sides."""
MOST_THIRD = 0.43
"""The largest third derivative of e^(−x) by the logarithm of x."""


def warm_up(context: Vector, n: Vector, p: int, size: float, time_constant: float, added: Vector) -> None:
    """Add size (1 − e^(−t/τ)) to the reading of accelerometer p; a time constant of 0 stands for none."""
    if time_constant > 0.0:
        added[p] = added[p] + size * (1.0 - math.exp(-context[HOURS] / time_constant))


def thermal_lag(
    context: Vector, n: Vector, p: int, coefficient: float, settling: float, time_constant: float, added: Vector
) -> None:
    """Add c (T_lag − 20) + s e^(−t/τ) to the reading of accelerometer p; T_lag is what `lagging_temperature` keeps."""
    added[p] = added[p] + coefficient * (context[KEPT + p] - NOMINAL_TEMPERATURE)
    if time_constant > 0.0:
        added[p] = added[p] + settling * math.exp(-context[HOURS] / time_constant)


def lagging_temperature(
    context: Vector, before: Vector, p: int, coefficient: float, settling: float, time_constant: float, kept: Vector
) -> None:
    """Let the temperature that is kept for accelerometer p follow: τ T_lag' = T − T_lag.

    `before` are hours and temperature [degC] of the step before: between, the temperature is taken as linear in time,
    for which this is exact. It begins with the temperature at the start: another beginning is what settles.
    """
    temperature = context[TEMPERATURE]
    hours = context[HOURS] - before[0]
    if time_constant > 0.0 and hours > 0.0:
        left = math.exp(-hours / time_constant)
        behind = time_constant * (temperature - before[1]) / hours
        kept[p] = temperature - behind + (kept[p] - before[1] + behind) * left
    elif time_constant <= 0.0 or context[HOURS] <= 0.0:
        kept[p] = temperature


def above_nominal(rows: Rows) -> NDArray[np.float64]:
    """Temperature of the rows (N,) above the nominal one [K]; ValueError where it is not known."""
    if rows.temperature is None:
        raise ValueError("effects of temperature need the temperature of the rows")
    return rows.temperature - NOMINAL_TEMPERATURE


def time_constants(hours: NDArray[np.float64], part: float = 1.0) -> NDArray[np.float64]:
    """Ends (C + 1,) of the cells of time constants [h] for rows at some hours (N,); none where these are too few.

    The shortest is a `part` of the time of the third row.
    """
    times = np.unique(hours)
    if len(times) <= SHORTEST_ROW:
        return np.zeros(0)
    shortest, longest = part * (times[SHORTEST_ROW] - times[0]), LONGEST * (times[-1] - times[0])
    count = int(np.ceil(np.log(longest / shortest) / CELL))
    return np.geomspace(shortest, longest, count + 1)


def settled(hours: NDArray[np.float64], ends: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """1 − e^(−t/τ) (N, C + 1) at the ends of cells, and by how much (N, C) means of two ends may err within a cell."""
    x = hours[:, None] / ends
    return 1.0 - np.exp(-x), most_bent(x) * np.log(ends[1:] / ends[:-1]) ** 2 / 8.0


def most_bent(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest second derivatives (N, C) of e^(−x) by log x, each between two neighbours of falling x (N, C + 1)."""
    by_log = np.abs(x * x - x) * np.exp(-x)
    largest = np.maximum(by_log[:, :-1], by_log[:, 1:])
    # Where it has its two extremes.
    for peak in (0.5 * (3.0 - 5.0**0.5), 0.5 * (3.0 + 5.0**0.5)):
        inside = (x[:, 1:] <= peak) & (x[:, :-1] >= peak)
        largest = np.where(inside, abs(peak * peak - peak) * np.exp(-peak), largest)
    return largest


def lagged(
    hours: NDArray[np.float64], temperature: NDArray[np.float64], ends: NDArray[np.float64]
) -> tuple[NDArray, NDArray]:
    """As `settled` of a temperature (N,) that is linear between the rows and that its lag begins with; in its unit."""
    ages = np.maximum(0.0, hours[:, None] - hours)
    slopes = np.diff(temperature) / np.where(np.diff(hours) > 0.0, np.diff(hours), np.inf)
    values, by_log = np.zeros((2, len(hours), len(ends)))
    for k, end in enumerate(ends):
        x = ages / end
        faded = np.exp(-x)
        # Of a slope that began so long ago: how far the lag is behind, and its second derivative by log τ.
        behind = end * (1.0 - faded)
        bent = end * (1.0 - faded * (1.0 + x + x * x))
        values[:, k] = temperature - (behind[:, :-1] - behind[:, 1:]) @ slopes
        by_log[:, k] = np.abs((bent[:, :-1] - bent[:, 1:]) @ slopes)
    travelled = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(temperature)))))
    width = np.log(ends[1:] / ends[:-1])
    largest = np.maximum(by_log[:, :-1], by_log[:, 1:]) + 0.5 * width * MOST_THIRD * travelled[:, None]
    return values, largest * width**2 / 8.0


def warm_up_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> Sequence[Variant]:
    """Each cell of time constants."""
    return _cells_of(place, rows.hours.tobytes(), b"", 0.0)


def thermal_lag_variants(
    place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float
) -> Sequence[Variant]:
    """Each cell of time constants; what half a last digit of the temperature makes of it is paid for, too."""
    return _cells_of(place, rows.hours.tobytes(), above_nominal(rows).tobytes(), rows.temperature_resolution)


@lru_cache(maxsize=32)
def _cells_of(place: EffectPlace, hours: bytes, temperature: bytes, resolution: float) -> Sequence[Variant]:
    """The cells of rows at some hours (N,), with a temperature (N,) above the nominal one or without."""
    when = np.frombuffer(hours)
    ends = time_constants(when, SHORTER if temperature else 1.0)
    if not temperature:
        values, error = settled(when, ends)
        return _cells(place, ends, (values[..., None], error[..., None]), lambda rows, two: settled(rows.hours, two)[0])
    warmth = np.frombuffer(temperature)
    ahead = beginnings(warmth)
    values, error = _begun_of(hours, temperature)

    def later(rows: Rows, two: NDArray[np.float64]) -> NDArray[np.float64]:
        """Each row as if it were the next after the record."""
        responses, kelvins = np.zeros((len(rows.hours), 2, len(ahead))), above_nominal(rows)
        for time, kelvin in np.unique(np.stack((rows.hours, kelvins), axis=1), axis=0).tolist():
            now, times = (rows.hours == time) & (kelvins == kelvin), np.append(when, time)
            lag = lagged(times, np.append(warmth, kelvin), two)
            responses[now] = begun(lag, settled(times, two), ahead)[0][-1]
        return responses.reshape(len(responses), -1)

    return _cells(place, ends, (values, error + resolution), later, ahead)


@lru_cache(maxsize=4)
def _begun_of(hours: bytes, temperature: bytes) -> tuple[NDArray, NDArray]:
    """What `begun` says of a record: it is the same of each accelerometer."""
    when, warmth = np.frombuffer(hours), np.frombuffer(temperature)
    ends = time_constants(when, SHORTER)
    return begun(lagged(when, warmth, ends), settled(when, ends), beginnings(warmth))


def beginnings(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much (2,) [K] a lag is above the first of some temperatures (N,) at the least, and at the most."""
    low, high = float(temperature.min()), float(temperature.max())
    return np.array([low - BEFORE * (high - low), high + BEFORE * (high - low)]) - temperature[0]


def begun(
    lag: tuple[NDArray, NDArray], settling: tuple[NDArray, NDArray], ahead: NDArray[np.float64]
) -> tuple[NDArray, NDArray]:
    """Responses (N, C + 1, B) and errors (N, C, B) of a lag that is ahead by some (B,) [K] at the first row.

    Of one that is not, and of what settles, as `lagged` and `settled` give them.
    """
    values = lag[0][..., None] + (1.0 - settling[0])[..., None] * ahead
    return values, lag[1][..., None] + settling[1][..., None] * np.abs(ahead)


def _cells(
    place: EffectPlace,
    ends: NDArray[np.float64],
    responses: tuple[NDArray[np.float64], NDArray[np.float64]],
    later: Callable[[Rows, NDArray[np.float64]], NDArray[np.float64]],
    ahead: NDArray[np.float64] | None = None,
) -> Sequence[Variant]:
    """Cells of time constants with these ends (C + 1,).

    What is known of them: responses (N, C + 1, B) at the ends, and errors (N, C, B) within them, from each of B
    beginnings; `later`: other rows, two ends -> responses (n, 2 B) there. By `ahead` (B,) [K] a lag begins above the
    first temperature: what settles is a parameter then.
    """
    largest = place.definition.parameters[0].largest
    values, error = responses
    count = 2 * values.shape[2]
    # Sums of coefficients, which are in the order of the ends, and of the beginnings at each.
    second = np.repeat([0.0, 1.0], count // 2)
    sizes = np.ones((1, count)) if ahead is None else np.stack((np.ones(count), np.tile(ahead, 2)))
    free = [(-p.largest, p.largest) for p in place.definition.parameters[:-1]]
    # What the record shows at an end of all that is sought it does not tell from what is beyond.
    limits = np.append(0.0, np.append(ends[1:-1], LAST_HOUR)).tolist()
    cells = []
    for k in range(len(ends) - 1):

        def parameters(coefficients: NDArray[np.float64], k: int = k) -> tuple[float, ...]:
            size, *rest = (sizes @ coefficients).tolist()
            share = float(second @ coefficients) / size if size != 0.0 else 0.5
            return size, *rest, float(ends[k] * (ends[k + 1] / ends[k]) ** share)

        paid = np.tile(error[:, k], 2)
        cells.append(
            variant(
                (len(values), 3),
                (*free, (limits[k], limits[k + 1])),
                columns=accelerometer_column(place, values[:, k : k + 2].reshape(len(values), -1)),
                low=np.full(count, -largest),
                high=np.full(count, largest),
                values=parameters,
                paid=accelerometer_column(place, paid),
                sizes=sizes,
                elsewhere=lambda rows, two=ends[k : k + 2]: accelerometer_column(place, later(rows, two)),
            )
        )
    return cells


WARM_UP = last_stage_effect(
    warm_up,
    (
        EffectParameter("size", "g", "by how much the bias changes until it has settled", LARGEST_OF_BIAS),
        EffectParameter("time_constant", "h", "τ of 1 − e^(−t/τ)", LAST_HOUR, smallest=0.0),
    ),
    warm_up_variants,
    "the bias of accelerometer {p} settles after the start: it changes by {size:+.2e} g with a time constant of "
    "{time_constant:.3g} h",
    stage="reading_effects",
    contains=("bias-drift",),
    formula="Δf_{p}/g = {size} (1 − exp(−t/{time_constant}))",
)

THERMAL_LAG = last_stage_effect(
    thermal_lag,
    (
        EffectParameter("coefficient", "g/K", "c of c (T_lag - 20 degC)", LARGEST_PER_KELVIN),
        EffectParameter("settling", "g", "what fades of a lag that begins at another temperature", LARGEST_OF_BIAS),
        EffectParameter("time_constant", "h", "τ of the lag", LAST_HOUR, smallest=0.0),
    ),
    thermal_lag_variants,
    "the bias of accelerometer {p} follows the temperature with a lag of {time_constant:.3g} h: {coefficient:+.2e} g "
    "per kelvin; {settling:+.2e} g of it, from before the first row, fade",
    stage="reading_effects",
    memory=lagging_temperature,
    contains=("temperature-bias", "bias-drift"),
    formula="Δf_{p}/g = {coefficient} (T_lag − 20 °C) + {settling} e^(−t/{time_constant}), "
    "{time_constant} dT_lag/dt = T − T_lag",
)

EFFECTS = (WARM_UP, THERMAL_LAG)
