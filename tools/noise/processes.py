"""Noise processes of an inertial sensor: their spectra, and their coefficients in the units of the field.

Two-sided spectral densities S(f) of the readings y(t), in the unit u of the readings (IEEE Std 952 and 1293):

========  ======================  ==========================  ======================
letter    process                 S(f)                        Allan variance
========  ======================  ==========================  ======================
N         white                   N²                          N²/τ
Q         quantisation            Q²(2πf)²                    3Q²/τ²
B         flicker                 B²/(2πf)                    (2 ln 2/π) B²
K         random walk             K²/(2πf)²                   K²τ/3
M         Markov                  2σ²Tc/(1 + (2πfTc)²)        falls off on both sides
R         ramp                    a trend                     R²τ²/2
W         warm-up                 an exponential trend        -
========  ======================  ==========================  ======================

A record of n readings has the coefficients c_j of the cosine transform (DCT-II, orthonormal) at ω = πj/n per reading.
Their variances are the templates s(ω) below times N², Q², B², K², σ².
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats

Letter = Literal["N", "Q", "B", "K", "M", "R", "W"]
Sensor = Literal["gyro", "accelerometer"]
SPECTRAL: tuple[Letter, ...] = ("N", "Q", "B", "K", "M")
"""Processes with a spectrum."""
TRENDS: tuple[Letter, ...] = ("R", "W")
"""Processes that are a trend of the mean."""
NUMBERS = {"N": 1, "Q": 1, "B": 1, "K": 1, "M": 2, "R": 1, "W": 2}
"""Count of numbers of each process: Markov and warm-up have a time constant besides."""
DEGREES = 180.0 / np.pi
HOUR, ROOT_HOUR = 3600.0, 60.0
MICRO_G = 1e6 / STANDARD_GRAVITY


@dataclass(frozen=True)
class CoefficientUnit:
    """A coefficient's SI unit, its unit on data sheets, and the factor from the first to the second."""

    si: str
    data_sheet: str
    factor: float


@dataclass(frozen=True)
class Process:
    """A process: its names and the units of its coefficient, for gyros and for accelerometers."""

    names: dict[Sensor, str]
    units: dict[Sensor, CoefficientUnit]


def _process(gyro: str, accelerometer: str, of_gyro: CoefficientUnit, of_accelerometer: CoefficientUnit) -> Process:
    return Process({"gyro": gyro, "accelerometer": accelerometer}, {"gyro": of_gyro, "accelerometer": of_accelerometer})


OF_BIAS = (CoefficientUnit("rad/s", "deg/h", DEGREES * HOUR), CoefficientUnit("m/s²", "µg", MICRO_G))
"""Units of a gyro's and an accelerometer's bias."""
PROCESSES: dict[Letter, Process] = {
    "N": _process(
        "angle random walk",
        "velocity random walk",
        CoefficientUnit("rad/s/√Hz", "deg/√h", DEGREES * ROOT_HOUR),
        CoefficientUnit("m/s²/√Hz", "µg/√Hz", MICRO_G),
    ),
    "Q": _process(
        "angle quantisation",
        "velocity quantisation",
        CoefficientUnit("rad", "arcsec", DEGREES * 3600.0),
        CoefficientUnit("m/s", "mm/s", 1e3),
    ),
    "B": _process("bias instability", "bias instability", *OF_BIAS),
    "K": _process(
        "rate random walk",
        "acceleration random walk",
        CoefficientUnit("rad/s²/√Hz", "deg/h/√h", DEGREES * HOUR * ROOT_HOUR),
        CoefficientUnit("m/s³/√Hz", "µg/√h", MICRO_G * ROOT_HOUR),
    ),
    "M": _process("correlated noise", "correlated noise", *OF_BIAS),
    "R": _process(
        "rate ramp",
        "acceleration ramp",
        CoefficientUnit("rad/s²", "deg/h/h", DEGREES * HOUR * HOUR),
        CoefficientUnit("m/s³", "µg/h", MICRO_G * HOUR),
    ),
    "W": _process("warm-up", "warm-up", *OF_BIAS),
}
"""Processes in the order in which they are named."""


def template(letter: Letter, angle: Floats, step: float, constant: float = 1.0) -> Floats:
    """Return the variance of cosine coefficients of a process of size one.

    Parameters
    ----------
    letter : str
        one of `SPECTRAL`
    angle : ndarray
        ω, angle per reading [rad], above 0
    step : float
        time between readings [s]
    constant : float
        correlation time of the Markov process [s]
    """
    sine = 4.0 * np.sin(0.5 * angle) ** 2
    if letter == "N":
        return np.full(angle.shape, 1.0 / step)
    if letter == "Q":
        return sine / step**2
    if letter == "B":
        return 1.0 / np.sqrt(sine)
    if letter == "K":
        return step / sine
    decay = np.exp(-step / constant)
    # (1 - φ)² + φ (2 sin ω/2)² keeps its digits where φ is close to 1
    return -np.expm1(-2.0 * step / constant) / (np.expm1(-step / constant) ** 2 + decay * sine)


def difference_gain(angle: Floats, rows: int) -> Floats:
    """Return the gain from the spectrum at ω to half the squared difference of neighbouring means of `rows` readings.

    The mean of gain times spectrum over the frequencies of a record is its Allan variance.
    """
    return 2.0 * np.sin(0.5 * rows * angle) ** 4 / (rows * np.sin(0.5 * angle)) ** 2


def drift_variance(letter: Letter, time: Floats, constant: float = 1.0) -> Floats:
    """Return the generalised variogram V(t) of the integral of a process of size one.

    The variance of a contrast Σ w_i I(t_i) with Σ w_i = 0 is -½ ΣΣ w_i w_j V(t_i - t_j). Where the process wanders, Σ
    w_i t_i = 0 must hold too.

    Parameters
    ----------
    letter : str
        one of `SPECTRAL`
    time : ndarray
        t [s], 0 or above
    constant : float
        correlation time of the Markov process [s]
    """
    time = np.abs(np.asarray(time, dtype=np.float64))
    if letter == "N":
        return time
    if letter == "Q":
        return np.where(time > 0.0, 2.0, 0.0)
    if letter == "K":
        return -(time**3) / 6.0
    if letter == "B":
        logarithm = np.log(time, out=np.zeros_like(time), where=time > 0.0)
        return -(time**2) * logarithm / np.pi
    return 2.0 * constant * (time + constant * np.expm1(-time / constant))
