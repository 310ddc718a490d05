"""Identification of the noise of an instrument from its readings at rest, and its comparison with a simulation.

The Allan deviation of readings stands beside that of the fitted processes. Held against a simulation, the noise gives
a verdict, the smallest set of changes, and the gain.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.special import chdtri

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ..errors import InputError, InvalidInput
from ..orchestrator.scenario import Scenario
from ..progress import tracked
from ..records.noise import allan_deviation_of_sums, sums_of
from ..room import Room
from .likelihood import Likelihood, NoiseFit
from .pieces import AtRest, ChannelAtRest, TimeSeries, at_rest
from .processes import NUMBERS, PROCESSES, SPECTRAL, Letter, Sensor, difference_gain
from .result import (
    BIAS_TAKEN,
    Against,
    AllanCurve,
    ChannelNoise,
    Coefficient,
    Drift,
    HeldOut,
    Noise,
    NoiseSource,
    SpectralLine,
    variance_after,
)
from .selection import Selection, select
from .simulated import Sizes, simulated_noise
from .spectrum import LineInSpectrum, bins_of

FALSIFIED = 25.0
"""Rise above which a simulation's noise is falsified: the largest of 2400 true channels is 22.5."""
EXPLAINED = 21.0
"""Largest rise of a change that explains a falsified channel: of true ones it is beyond in fewer than one of 500."""
MOST = 2
"""Largest number of processes that change."""
ROOM = Room("the noise", "rows", "give a shorter record", 1.1e8, 220.0)
Verdict = Literal["consistent", "explained", "ambiguous", "falsified"]
VERDICTS: dict[int, Verdict] = {0: "falsified", 1: "explained"}
"""Verdict of a falsified channel by the number of smallest sets."""
CHANGES: tuple[Letter, ...] = (*SPECTRAL, "R")
DRIFTS = (1.0, 10.0, 60.0)
"""Drifts that are predicted [s]."""
FEWEST_WINDOWS = 20
BAND = 1.959964
"""Half-width of a 95 % band in standard deviations."""


@dataclass(frozen=True, eq=False)
class NoiseChange:
    """A set of processes whose coefficients change: the fit of these beside the unchanged ones."""

    letters: tuple[Letter, ...]
    fit: NoiseFit

    @property
    def sizes(self) -> dict[Letter, float]:
        """Return the new coefficients by their letters."""
        return {letter: self.fit.coefficient(letter) for letter in self.letters}


def held_against(channel: ChannelAtRest, step: float, selection: Selection, simulated: Sizes) -> Against:
    """Return the answer for one channel.

    Parameters
    ----------
    channel : ChannelAtRest
        readings at rest
    step : float
        time between readings [s]
    selection : Selection
        the processes of the record
    simulated : dict
        coefficients of the simulation by their letters [SI]
    """
    likelihood = selection.likelihood
    best = _largest(likelihood)
    rise = _changed(likelihood, simulated, ()).fit.cost - best
    verdict: Verdict = "consistent"
    chosen: list[NoiseChange] = []
    if rise > FALSIFIED:
        chosen = smallest_changes(likelihood, simulated, best + EXPLAINED)
        verdict = VERDICTS.get(len(chosen), "ambiguous")
    changed = chosen[0].sizes if chosen else {}
    held_out = []
    if chosen:
        held_out = predicted_drifts(channel, step, simulated, chosen[0].letters)
    return Against(
        channel=channel.name,
        verdict=verdict,
        rise=max(0.0, rise),
        simulated={letter: size for letter, size in simulated.items() if size != 0.0},
        changed=changed,
        alternatives=[" + ".join(change.letters) for change in chosen],
        held_out=held_out,
    )


def _largest(likelihood: Likelihood) -> float:
    """Return the least cost of all processes together."""
    trends: tuple[Letter | None, ...] = (None, "R", "W") if likelihood.bins.has_trends else (None,)
    return min(likelihood.fit(SPECTRAL, trend).cost for trend in trends)


def smallest_changes(likelihood: Likelihood, simulated: Sizes, limit: float) -> list[NoiseChange]:
    """Return all sets of changes of the fewest numbers whose cost is within a limit, the likeliest first."""
    by_size: dict[int, list[tuple[Letter, ...]]] = {}
    for count in range(1, MOST + 1):
        for letters in combinations(CHANGES, count):
            if "R" in letters and not likelihood.bins.has_trends:
                continue
            by_size.setdefault(sum(NUMBERS[letter] for letter in letters), []).append(letters)
    for size in sorted(by_size):
        changes = [_changed(likelihood, simulated, letters) for letters in by_size[size]]
        within = [change for change in changes if change.fit.cost <= limit]
        if within:
            return sorted(within, key=lambda change: change.fit.cost)
    return []


def _changed(likelihood: Likelihood, simulated: Sizes, letters: tuple[Letter, ...]) -> NoiseChange:
    """Return the best fit with the coefficients of some processes free, the others as simulated."""
    fixed = np.zeros(len(likelihood.bins.power))
    for letter, size in simulated.items():
        if letter in SPECTRAL and letter not in letters:
            fixed += size**2 * likelihood.column(letter, 0.0) * likelihood.unit
    spectral: list[Letter] = [letter for letter in SPECTRAL if letter in letters]
    trend = 0.0 if "R" in letters else None
    constants = likelihood.constants.tolist() if "M" in letters else [0.0]
    fits = [likelihood.fit_beside(fixed, tuple(spectral), constant, trend) for constant in constants]
    return NoiseChange(letters, min(fits, key=lambda fit: fit.cost))


def predicted_drifts(channel: ChannelAtRest, step: float, simulated: Sizes, letters: Sequence[Letter]) -> list[HeldOut]:
    """Return how well the second half's drifts are predicted, by the simulation's noise and by the extended one.

    The coefficients that change are those of the first half, with the upper ends of their intervals.
    """
    longest = max(channel.pieces, key=len)
    first, second = np.array_split(longest, 2)
    selection = select(bins_of([first], step)[0])
    change = _changed(selection.likelihood, simulated, tuple(letters))
    extended = dict(simulated)
    for letter in letters:
        extended[letter] = change.fit.coefficient(letter)
        if letter in ("B", "K") and letter in selection.fit.letters:
            extended[letter] = selection.likelihood.interval(selection.fit, letter)[1]
    results = []
    for time in DRIFTS:
        drifts = window_drifts(second, step, time)
        if len(drifts) < FEWEST_WINDOWS:
            continue
        before = drift_deviation(simulated, time, change.fit.constant)
        after = drift_deviation(extended, time, change.fit.constant)
        if not (before > 0.0 and after > 0.0):
            continue
        score = math.log(before / after) + 0.5 * float(np.mean((drifts / before) ** 2 - (drifts / after) ** 2))
        results.append(
            HeldOut(
                time_s=time,
                windows=len(drifts),
                coverage_simulated=float(np.mean(np.abs(drifts) <= BAND * before)),
                coverage_extended=float(np.mean(np.abs(drifts) <= BAND * after)),
                score=score,
            )
        )
    return results


def window_drifts(readings: Floats, step: float, time: float) -> Floats:
    """Return drifts over a time, each less the bias of the minute before, one window after the other."""
    before, behind = round(BIAS_TAKEN / step), round(time / step)
    if behind == 0:
        return np.zeros(0)
    sums = np.concatenate([[0.0], np.cumsum(readings - readings[0])])
    starts = np.arange(before, len(readings) - behind, behind)
    bias = (sums[starts] - sums[starts - before]) / before
    return step * (sums[starts + behind] - sums[starts] - behind * bias)


def drift_deviation(sizes: Mapping[Letter, float], time: float, constant: float) -> float:
    """Return the standard deviation of such a drift by coefficients [SI]."""
    variance = 0.0
    for letter, size in sizes.items():
        if letter in SPECTRAL and size > 0.0:
            variance += size**2 * variance_after(letter, constant or 1.0, time)
    return math.sqrt(variance)


AN_OCTAVE = 2
"""Averaging times in an octave."""
LONGEST = 4
"""The longest averaging time is the longest stretch over this."""
CHANCE = 0.025
"""Chance outside each end of an interval."""


def averaging_rows(longest: int) -> list[int]:
    """Return the averaging times in rows, up to a quarter of the longest stretch (`longest` rows)."""
    rows = []
    exponent = 0
    while 2.0 ** (exponent / AN_OCTAVE) <= longest / LONGEST:
        rows.append(round(2.0 ** (exponent / AN_OCTAVE)))
        exponent += 1
    return sorted(set(rows))


def allan_curve(pieces: Sequence[Floats], step: float, likelihood: Likelihood, fit: NoiseFit) -> AllanCurve:
    """Return the overlapping Allan deviation of a channel with 95 % intervals, and the band of the fitted processes.

    The degrees of freedom are those of the processes, by the spectrum: the Allan variance is a weighted mean of the
    squares of the cosine coefficients.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        readings of each stretch
    step : float
        time between readings [s]
    likelihood, fit
        the spectrum, and the processes fitted to it
    """
    sums = [sums_of(piece[:, None]) for piece in pieces]
    longest = max(map(len, pieces))
    times, deviations, models, lows, highs, model_lows, model_highs = [], [], [], [], [], [], []
    for rows in averaging_rows(longest):
        deviation = allan_deviation_of_sums(sums, rows)
        if deviation is None:
            continue
        model, freedom = of_processes(likelihood, fit, rows, longest, len(pieces))
        low = math.sqrt(freedom / float(chdtri(freedom, CHANCE)))
        high = math.sqrt(freedom / float(chdtri(freedom, 1.0 - CHANCE)))
        times.append(rows * step)
        deviations.append(float(deviation[0]))
        lows.append(low * float(deviation[0]))
        highs.append(high * float(deviation[0]))
        models.append(model)
        model_lows.append(model / high)
        model_highs.append(model / low)
    return AllanCurve(
        tau_s=times,
        deviation=deviations,
        low=lows,
        high=highs,
        model=models,
        model_low=model_lows,
        model_high=model_highs,
    )


def of_processes(
    likelihood: Likelihood, fit: NoiseFit, rows: int, longest: int, pieces: int = 1
) -> tuple[float, float]:
    """Return the Allan deviation that fitted processes have in a stretch, and the degrees of freedom of its square.

    Parameters
    ----------
    likelihood, fit
        the spectrum, and the processes fitted to it
    rows : int
        averaging time
    longest : int
        rows of the stretch
    pieces : int
        number of such stretches
    """
    number = _numbers(longest)
    angle = math.pi * number / longest
    share = np.gradient(number)
    power = likelihood.spectrum(fit, angle) * difference_gain(angle, rows) * share / longest
    variance = float(power.sum())
    # a bin of `share` coefficients has `share` degrees of freedom
    freedom = 2.0 * variance**2 / float(np.sum(2.0 * power**2 / share)) * pieces
    trend = 0.0
    if fit.trend is not None and fit.trend.letter == "R":
        trend = 0.5 * (fit.trend.size * rows * likelihood.bins.step) ** 2
    return math.sqrt(variance + trend), max(1.0, freedom)


def _numbers(longest: int) -> Floats:
    """Return the numbers of cosine coefficients at which a spectrum is added up: the lowest all, then 200 an octave."""
    if longest <= 512:
        return np.arange(1, longest, dtype=np.float64)
    wide = np.geomspace(512, longest - 1, 1 + math.ceil(200.0 * math.log2((longest - 1) / 512)))
    return np.concatenate([np.arange(1, 512), np.unique(np.round(wide))]).astype(np.float64)


UNITS: dict[Sensor, str] = {"gyro": "rad/s", "accelerometer": "m/s²"}
NOT_TOLD = 300.0
"""A stretch shorter than this tells little of bias instability and random walks [s]."""
DRIFT_TIMES = (60.0, 600.0, 3600.0)
"""Times for which the growth of errors is computed [s]."""
LONGER = 10.0
"""A growth is computed up to this multiple of the longest stretch."""


def identify(
    records: Sequence[TimeSeries],
    *,
    gravity: float = STANDARD_GRAVITY,
    skip: float = 0.0,
    scenario: Scenario | None = None,
    progress: bool = False,
) -> Noise:
    """Return the noise processes of records of one instrument at rest, with their coefficients.

    Parameters
    ----------
    records : sequence of StrapdownRecord, ForceRecord, RawRecord or BenchRecord
        records of one sampling rate
    gravity : float
        model value [m/s²]
    skip : float
        time at the start of each record that is left out: warm-up [s]
    scenario : Scenario, optional
        the simulation whose noise the record's is held against
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Noise
        the coefficients

    Raises
    ------
    InputError
        for a record without a rest, or records that do not go together
    """
    if not 1.0 <= gravity <= 100.0:
        raise InvalidInput(f"--gravity {gravity!r}: gravity in m/s2 is needed, 1 to 100")
    if not skip >= 0.0:
        raise InvalidInput(f"--skip {skip!r}: a time in seconds is needed, 0 or more")
    ROOM.check(sum(len(record) for record in records), records[0].path)
    still = at_rest(records, skip)
    simulated = {} if scenario is None else simulated_noise(scenario, gravity)
    if all(channel.is_constant for channel in still.channels):
        raise InputError(f"{records[0].path}: no channel changes at rest: its noise is unknown")
    channels, against = [], []
    for channel in tracked(still.channels, "noise", show=progress):
        if channel.is_constant:
            channels.append(_unchanging(channel))
            if channel.name in simulated:
                against.append(Against.unknown(channel.name, simulated[channel.name]))
            continue
        bins, lines = bins_of(channel.pieces, still.step)
        selection = select(bins)
        channels.append(_of_channel(channel, still.step, selection, lines))
        if channel.name in simulated:
            against.append(held_against(channel, still.step, selection, simulated[channel.name]))
    sources, warnings = [], list[str]()
    for record in records:
        sources.append(NoiseSource(record=record.path.name, sha256=record.sha256))
        warnings += [f"{record.path.name}: {line}" for line in record.warnings]
    cautions = [channel.caution for channel in still.channels]
    warnings += [line for line in cautions if line]
    return Noise(
        records=sources,
        rate_hz=1.0 / still.step,
        duration_s=still.duration,
        stretches=len(still.channels[0].pieces),
        static=still.static,
        gravity_mps2=gravity,
        channels=channels,
        drifts=_drifts(channels, still.longest),
        too_short_for=_too_short_for(still),
        scenario="" if scenario is None or scenario.source is None else scenario.source.name,
        against=against,
        warnings=warnings,
    )


def _unchanging(channel: ChannelAtRest) -> ChannelNoise:
    """Return a channel without coefficients: it never changes, so nothing of its noise is known."""
    return ChannelNoise(
        channel=channel.name,
        sensor=channel.sensor,
        unit=UNITS[channel.sensor],
        coefficients=[],
        admissible=[],
        band_hz=0.0,
        filtered=False,
        worst_bin=0.0,
        lines=[],
        allan=AllanCurve(tau_s=[], deviation=[], low=[], high=[], model=[], model_low=[], model_high=[]),
    )


def _of_channel(
    channel: ChannelAtRest, step: float, selection: Selection, lines: Sequence[LineInSpectrum]
) -> ChannelNoise:
    """Return the noise of one channel."""
    return ChannelNoise(
        channel=channel.name,
        sensor=channel.sensor,
        unit=UNITS[channel.sensor],
        coefficients=_coefficients(channel, selection),
        admissible=[" + ".join(fit.all_letters) for fit in selection.admissible],
        band_hz=selection.band_hz,
        filtered=selection.filtered,
        worst_bin=selection.worst_bin,
        lines=_lines(lines),
        allan=allan_curve(channel.pieces, step, selection.likelihood, selection.fit),
    )


def _lines(lines: Sequence[LineInSpectrum]) -> list[SpectralLine]:
    return [SpectralLine(frequency_hz=line.frequency_hz, amplitude=line.amplitude) for line in lines]


def _coefficients(channel: ChannelAtRest, selection: Selection) -> list[Coefficient]:
    """Return the coefficients of a channel: of all processes but a trend or correlated noise that is not detected."""
    fit, likelihood = selection.fit, selection.likelihood
    coefficients = []
    for letter in PROCESSES:
        detected = letter in fit.all_letters
        if not detected and letter in ("M", "R", "W"):
            continue
        if not detected and letter == "Q" and selection.filtered:
            # above the band the spectrum is a filter's, or vibration's
            continue
        coefficients.append(
            Coefficient.of(
                letter,
                channel.sensor,
                fit.coefficient(letter) if detected else None,
                likelihood.interval(fit, letter),
                _time_constant(fit, letter),
            )
        )
    return coefficients


def _time_constant(fit: NoiseFit, letter: Letter) -> float | None:
    """Return the time constant of correlated noise or a warm-up [s]; None of any other process."""
    if letter == "M":
        return fit.constant
    if letter == "W" and fit.trend is not None:
        return fit.trend.constant
    return None


def _drifts(channels: Sequence[ChannelNoise], longest: float) -> list[Drift]:
    """Return the growth of attitude and velocity errors at some times, not far beyond the length of a stretch."""
    drifts = []
    for time in DRIFT_TIMES:
        if time > LONGER * longest:
            break
        drifts.append(
            Drift(
                time_s=time,
                attitude_detected_deg=_in_degrees(_worst(channels, "gyro", time, detected_alone=True)),
                attitude_deg=_in_degrees(_worst(channels, "gyro", time, detected_alone=False)),
                velocity_detected_mps=_worst(channels, "accelerometer", time, detected_alone=True),
                velocity_mps=_worst(channels, "accelerometer", time, detected_alone=False),
            )
        )
    return drifts


def _worst(channels: Sequence[ChannelNoise], sensor: Sensor, time: float, *, detected_alone: bool) -> float | None:
    """Return the largest standard deviation of the integrals of a sensor's axes [rad or m/s]; None without any."""
    changing = [channel for channel in channels if channel.sensor == sensor and channel.coefficients]
    return max((channel.drift(time, detected_alone=detected_alone) for channel in changing), default=None)


def _in_degrees(angle: float | None) -> float | None:
    if angle is None:
        return None
    return math.degrees(angle)


def _too_short_for(still: AtRest) -> list[str]:
    """Return the quantities for which the stretches are too short."""
    if still.longest >= NOT_TOLD:
        return []
    return ["bias instability and random walks: record the block at rest for an hour"]
