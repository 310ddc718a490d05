"""Result of `noise`: the coefficients of each channel, with intervals, in SI units and those of data sheets."""

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...fmus import version
from ...models.arrays import Floats
from ..errors import InputError, InvalidInput
from ..quantity import Quantity
from ..result import Result
from .processes import PROCESSES, SPECTRAL, Letter, Sensor, drift_variance

if TYPE_CHECKING:
    from polars import DataFrame

CHANNELS = 3
"""Accelerometers that read each position."""
PROBABILITY = 0.95
"""Probability that a bound holds for all readings of a record."""
NEAR_BEST = 1.1
"""A dwell whose deviation is within this factor of the best one's is as good."""
DWELLS = np.geomspace(1.0, 3600.0, 60)
"""Dwells that are tried [s]."""
LONGEST = 1e6
"""Longest dwell or gap [s]."""
MOST_POSITIONS = 100_000
BIAS_TAKEN = 60.0
"""Time over which a bias is taken before a drift begins [s]."""


class AllanCurve(Result):
    """Overlapping Allan deviation of a channel, beside that of its processes.

    Attributes
    ----------
    tau_s : list of float
        averaging times
    deviation, low, high : list of float
        of the record with its 95 % interval [rad/s or m/s²]
    model, model_low, model_high : list of float
        of the processes, with the band of 95 % of records with them
    """

    tau_s: list[float]
    deviation: list[float]
    low: list[float]
    high: list[float]
    model: list[float]
    model_low: list[float]
    model_high: list[float]


class Coefficient(Result):
    """Coefficient of one process: the estimate, and its 95 % interval.

    Attributes
    ----------
    process : str
        letter of IEEE Std 952: N, Q, B, K, R; M and W for correlated noise and warm-up
    name : str
        in words
    detected : bool
        true if the record needs the process
    estimate : float or None
        None of a process that is not detected
    low, high : float or None
        ends of the interval; `high` alone, where the process is not detected
    unit : str
        of these three
    data_sheet_estimate, data_sheet_low, data_sheet_high : float or None
        the same in the unit of data sheets
    data_sheet_unit : str
        that unit
    time_constant_s : float or None
        of correlated noise and warm-up
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"time_constant_s"})

    process: Annotated[Letter, Quantity("process")]
    name: Annotated[str, Quantity("name")]
    detected: bool
    estimate: float | None
    low: float | None
    high: float | None
    unit: str
    data_sheet_estimate: Annotated[float | None, Quantity("estimate", "", "nearest")]
    data_sheet_low: Annotated[float | None, Quantity("low", "", "down")]
    data_sheet_high: Annotated[float | None, Quantity("high", "", "up")]
    data_sheet_unit: Annotated[str, Quantity("unit")]
    time_constant_s: Annotated[float | None, Quantity("time constant", "s", "nearest")] = None

    @staticmethod
    def of(
        letter: Letter, sensor: Sensor, estimate: float | None, ends: tuple[float, float], constant: float | None
    ) -> "Coefficient":
        """Return a coefficient in both units; `ends` in SI units, an infinite one where nothing bounds it."""
        unit = PROCESSES[letter].units[sensor]
        low, high = (value if math.isfinite(value) else None for value in ends)
        if estimate is None:
            low = None
        shown = [None if value is None else value * unit.factor for value in (estimate, low, high)]
        return Coefficient(
            process=letter,
            name=PROCESSES[letter].names[sensor],
            detected=estimate is not None,
            estimate=estimate,
            low=low,
            high=high,
            unit=unit.si,
            data_sheet_estimate=shown[0],
            data_sheet_low=shown[1],
            data_sheet_high=shown[2],
            data_sheet_unit=unit.data_sheet,
            time_constant_s=constant,
        )


class SpectralLine(Result):
    """A line of the spectrum, as of mains or vibration: frequency, amplitude in the unit of the channel."""

    frequency_hz: Annotated[float, Quantity("frequency", "Hz", "nearest")]
    amplitude: float


class ChannelNoise(Result):
    """Noise of one channel.

    Attributes
    ----------
    channel : str
        "gyro 1" to "accelerometer 3"
    sensor : str
        "gyro" or "accelerometer"
    unit : str
        unit of its readings
    coefficients : list of Coefficient
        detected and not detected
    admissible : list of str
        all smallest sets of processes that explain the spectrum, the likeliest first: "N + B"
    band_hz : float
        upper end of the band in which they are fitted
    filtered : bool
        true if the spectrum above the band is not that of the processes: a filter, or vibration
    worst_bin : float
        largest deviation of the spectrum from them, in standard deviations
    lines : list of SpectralLine
        lines, which are no part of the processes
    allan : AllanCurve
        Allan deviation
    """

    channel: str
    sensor: Sensor
    unit: str
    coefficients: list[Coefficient]
    admissible: list[str]
    band_hz: float
    filtered: bool
    worst_bin: float
    lines: list[SpectralLine]
    allan: AllanCurve

    @property
    def processes(self) -> str:
        """Return the likeliest of the smallest sets; "unknown" of a channel that never changes."""
        return self.admissible[0] if self.admissible else "unknown"

    def coefficient(self, letter: Letter) -> Coefficient | None:
        """Return the coefficient of a process; None where it was not fitted."""
        for coefficient in self.coefficients:
            if coefficient.process == letter:
                return coefficient
        return None

    def total(self, variance_of_size_one: Callable[[Letter, float], float], *, detected_alone: bool = False) -> float:
        """Return the variance that all processes give, by that of a process of size one and its time constant.

        Detected processes count with their upper ends; of the others only the one counts that adds most.
        """
        detected, missed = 0.0, 0.0
        for one in self.coefficients:
            size = one.estimate if one.process == "M" or one.high is None else one.high
            if one.process not in SPECTRAL or size is None:
                continue
            variance = size**2 * variance_of_size_one(one.process, one.time_constant_s or 1.0)
            if one.detected:
                detected += variance
            elif not detected_alone:
                missed = max(missed, variance)
        return detected + missed

    def deviation_of_means(
        self, dwell_s: float, count: int, gap_s: float = 0.0, *, detected_alone: bool = False
    ) -> float:
        """Return the standard deviation of means over a dwell, about the mean of `count` of them, gaps between.

        It is the root mean square over all means.
        """
        apart: Floats = (dwell_s + gap_s) * np.arange(count, dtype=np.float64)
        pairs = np.concatenate([[count], 2.0 * np.arange(count - 1, 0, -1)]) / count**2

        def of_one(letter: Letter, constant: float) -> float:
            beside = drift_variance(letter, apart + dwell_s, constant)
            beside += drift_variance(letter, apart - dwell_s, constant)
            shared = (0.5 * beside - drift_variance(letter, apart, constant)) / dwell_s**2
            return float(shared[0] - pairs @ shared)

        return math.sqrt(self.total(of_one, detected_alone=detected_alone))

    def drift(self, time_s: float, bias_taken_s: float = BIAS_TAKEN, *, detected_alone: bool = False) -> float:
        """Return the standard deviation of the integral after a time [rad or m/s], less a bias taken before.

        The bias is the mean over the time before: it is the attitude or velocity error that noise alone makes.
        """

        def of_one(letter: Letter, constant: float) -> float:
            return variance_after(letter, constant, time_s, bias_taken_s)

        return math.sqrt(self.total(of_one, detected_alone=detected_alone))


def variance_after(letter: Letter, constant: float, time_s: float, bias_taken_s: float = BIAS_TAKEN) -> float:
    """Return the variance of the integral of a process of size one after a time, less a bias taken before [s²]."""
    weights = np.array([1.0, -1.0 - time_s / bias_taken_s, time_s / bias_taken_s])
    times = np.array([time_s, 0.0, -bias_taken_s])
    apart = times[:, None] - times[None, :]
    return -0.5 * float(weights @ drift_variance(letter, apart, constant) @ weights)


class Drift(Result):
    """Growth of the error that noise makes in integrated readings, the bias taken over the minute before.

    Attributes
    ----------
    time_s : float
        time since the start
    attitude_deg, velocity_mps : float
        standard deviation of the worst axis, with processes that the record is too short to exclude; None where no
        gyro, or no accelerometer, changes at rest
    attitude_detected_deg, velocity_detected_mps : float
        the same by the detected processes alone
    """

    time_s: Annotated[float, Quantity("time", "s", "exact")]
    attitude_detected_deg: Annotated[float | None, Quantity("attitude", "deg", "up")]
    attitude_deg: Annotated[float | None, Quantity("at most", "deg", "up")]
    velocity_detected_mps: Annotated[float | None, Quantity("velocity", "m/s", "up")]
    velocity_mps: Annotated[float | None, Quantity("at most", "m/s", "up")]


class Dwell(Result):
    """Bound σ of averaged readings for a dwell and a number of positions.

    Attributes
    ----------
    dwell_s, gap_s : float
        averaging time, and time between rests
    positions : int
        number of positions
    probability : float
        that all readings of a record keep the bound
    deviation : float
        standard deviation of a mean, by the detected processes [g]
    not_excluded : float
        the same with processes that the record is too short to exclude [g]
    sigma : float
        σ [g], by `not_excluded`
    best_dwell_s, enough_s : float or None
        dwell with the least deviation, and the shortest one that is within 10 % of it; None where longer is better
        throughout
    """

    dwell_s: float
    gap_s: float
    positions: int
    probability: float
    deviation: float
    not_excluded: float
    sigma: float
    best_dwell_s: float | None
    enough_s: float | None


class HeldOut(Result):
    """Prediction of drifts in the second half of a record by the noise of the first, the bias taken over a minute.

    Attributes
    ----------
    time_s : float
        time of the drift
    windows : int
        drifts that were predicted
    coverage_simulated, coverage_extended : float
        part of them within the 95 % band of the simulation's noise, and of the extended one
    score : float
        gain of the mean logarithm of their probability density
    """

    time_s: Annotated[float, Quantity("drift", "s", "exact")]
    windows: Annotated[int, Quantity("windows")]
    coverage_simulated: Annotated[float, Quantity("simulated band holds", "", "nearest", 3)]
    coverage_extended: Annotated[float, Quantity("extended holds", "", "nearest", 3)]
    score: Annotated[float, Quantity("log score", "", "nearest", 2)]


class Against(Result):
    """One channel's noise held against the simulation's.

    Attributes
    ----------
    channel : str
    verdict : str
        "consistent"; "falsified": no set of up to two changes explains it; "explained"; "ambiguous"; "unknown" of a
        channel that never changes
    rise : float
        rise of twice the negative logarithm of the likelihood from the best processes to the simulation's
    simulated, changed : dict
        coefficients by their letters, in SI units: of the simulation, and those that change
    alternatives : list of str
        all smallest sets of changes, the likeliest first
    held_out : list of HeldOut
        gain of the extended noise on the half of the record that was not used
    """

    channel: Annotated[str, Quantity("channel")]
    verdict: Annotated[Literal["consistent", "explained", "ambiguous", "falsified", "unknown"], Quantity("verdict")]
    rise: float
    simulated: dict[Letter, float]
    changed: dict[Letter, float]
    alternatives: list[str]
    held_out: list[HeldOut]

    @staticmethod
    def unknown(channel: str, simulated: dict[Letter, float]) -> "Against":
        """Return the answer for a channel that never changes."""
        return Against(
            channel=channel, verdict="unknown", rise=0.0, simulated=simulated, changed={}, alternatives=[], held_out=[]
        )

    @property
    def is_wrong(self) -> bool:
        """Return true if the simulation's noise is not that of the channel."""
        return self.verdict not in ("consistent", "unknown")


class NoiseSource(Result):
    """A record: its file, its SHA-256 (empty without a file)."""

    record: str
    sha256: str


class Noise(Result):
    """Noise of the channels of one instrument.

    Attributes
    ----------
    records : list of NoiseSource
        the records
    rate_hz, duration_s, stretches : float, float, int
        sampling rate; length of all stretches at rest, and their number
    static : bool
        true if whole records stand still
    gravity : float
        model value [m/s²]
    channels : list of ChannelNoise
        gyros, if there are any, then accelerometers
    drifts : list of Drift
        growth of the errors of attitude and velocity
    too_short_for : list of str
        quantities for which the records are too short
    averaged : Dwell or None
        bound of averaged readings, for the dwell and the positions that were asked for
    scenario, against : str, list of Against
        the simulation that the noise was held against, and the answer for each channel
    warnings : list of str
        unusual facts about the records
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"averaged", "scenario", "against", "warnings"})

    schema_: Literal["trihedron.noise/1"] = Field(default="trihedron.noise/1", alias="schema")
    trihedron: str = Field(default_factory=version)
    records: list[NoiseSource]
    rate_hz: float
    duration_s: float
    stretches: int
    static: bool
    gravity: float = Field(alias="gravity_mps2")
    channels: list[ChannelNoise]
    drifts: list[Drift]
    too_short_for: list[str]
    averaged: Dwell | None = None
    scenario: str = ""
    against: list[Against] = Field(default=[])
    warnings: list[str] = Field(default=[])

    def of(self, sensor: Sensor) -> list[ChannelNoise]:
        """Return the channels of a sensor."""
        return [channel for channel in self.channels if channel.sensor == sensor]

    def deviation(self, dwell_s: float, positions: int, gap_s: float = 0.0, *, detected_alone: bool = False) -> float:
        """Return the standard deviation of a mean over a dwell [g], of the worst accelerometer.

        Raises
        ------
        InputError
            where no accelerometer changes at rest
        """
        deviations = [
            one.deviation_of_means(dwell_s, positions, gap_s, detected_alone=detected_alone)
            for one in self.of("accelerometer")
            if one.coefficients
        ]
        if not deviations:
            raise InputError("no accelerometer changes at rest: σ of its means is unknown; give --noise-bound")
        return max(deviations) / self.gravity

    def average(self, dwell_s: float, positions: int, *, gap_s: float = 0.0, probability: float = PROBABILITY) -> Dwell:
        """Return σ, the bound of averaged readings, for a dwell and a number of positions.

        The bound holds for all 3 x `positions` readings with the probability. Processes count with their upper ends.

        Parameters
        ----------
        dwell_s, gap_s : float
            averaging time, and time between rests [s]
        positions : int
            number of positions
        probability : float
            between 0 and 1

        Returns
        -------
        Dwell
            the bound, and the best dwell
        """
        of_times = 0.0 < dwell_s <= LONGEST and 0.0 <= gap_s <= LONGEST
        if not (of_times and 1 <= positions <= MOST_POSITIONS and 0.0 < probability < 1.0):
            raise InvalidInput(
                f"--dwell {dwell_s!r}, --gap {gap_s!r}, --positions {positions!r}, --probability {probability!r}: give "
                f"a dwell above 0 s, a gap of 0 s or more, both up to {LONGEST:g} s, 1 to {MOST_POSITIONS} positions, "
                "and a probability between 0 and 1"
            )
        deviation = self.deviation(dwell_s, positions, gap_s, detected_alone=True)
        not_excluded = self.deviation(dwell_s, positions, gap_s)
        quantile = NormalDist().inv_cdf(0.5 * (1.0 + probability ** (1.0 / (CHANNELS * positions))))
        best, enough = self._best_dwell(positions, gap_s)
        return Dwell(
            dwell_s=dwell_s,
            gap_s=gap_s,
            positions=positions,
            probability=probability,
            deviation=deviation,
            not_excluded=not_excluded,
            sigma=quantile * not_excluded,
            best_dwell_s=best,
            enough_s=enough,
        )

    def _best_dwell(self, positions: int, gap_s: float) -> tuple[float | None, float | None]:
        """Return the dwell with the least deviation and the shortest that is as good; None where longer is better."""
        deviations = np.array([self.deviation(float(dwell), positions, gap_s, detected_alone=True) for dwell in DWELLS])
        place = int(np.argmin(deviations))
        if place == len(DWELLS) - 1:
            return None, None
        enough = int(np.argmax(deviations <= NEAR_BEST * deviations[place]))
        return float(DWELLS[place]), float(DWELLS[enough])

    def to_polars(self) -> "DataFrame":
        """Return a row for each coefficient: channel, process, estimate, low, high, unit, detected."""
        import polars as pl

        rows = []
        for channel in self.channels:
            for one in channel.coefficients:
                rows.append({"channel": channel.channel, **one.to_json()})
        return pl.DataFrame(rows)
