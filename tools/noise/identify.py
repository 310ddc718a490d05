"""Identification of the noise of an instrument from its readings at rest."""

import math
from collections.abc import Sequence

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError, InvalidInput
from ..orchestrator.scenario import Scenario
from ..progress import tracked
from .against import held_against
from .allan import allan_curve
from .likelihood import NoiseFit
from .pieces import AtRest, ChannelAtRest, TimeSeries, at_rest
from .processes import PROCESSES, Letter, Sensor
from .result import Against, AllanCurve, ChannelNoise, Coefficient, Drift, Noise, NoiseSource, SpectralLine
from .selection import Selection, select
from .simulated import simulated_noise
from .spectrum import LineInSpectrum, bins_of

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
