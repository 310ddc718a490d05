"""Averaged readings by the noise of their instrument: their standard deviation in a record, σ of a plan."""

from pathlib import Path

from ..errors import InputError
from ..files import LARGEST_RESULT, bytes_of
from ..records import PositionRecord
from ..result import Result, object_of, parsed_result
from .result import Dwell, Noise

LEAST = "run `trihedron noise STATIC.csv --dwell SECONDS --json noise.json`"


def read_noise(path: str | Path) -> Noise:
    """Return the noise result of a file.

    Raises
    ------
    InputError
        where the file cannot be read, or holds another result
    """
    content = bytes_of(Path(path), most=LARGEST_RESULT)
    result = parsed_result(object_of(content, str(path)), {"trihedron.noise/1": Noise}, f"--noise {path}")
    if result is None:
        raise InputError(f"--noise {path}: is not a result of `trihedron noise`; {LEAST}")
    return result


def deviation_for(noise: Result | str | Path, record: PositionRecord) -> float:
    """Return the standard deviation of a mean of a record's positions [g], by the noise of its instrument.

    The dwell is that of the record's rests; of a table of positions it is the one for which the noise was told.

    Raises
    ------
    InputError
        where no dwell is known
    """
    result = _noise_of(noise)
    dwell, gap = None, 0.0
    if record.dwell_noise is not None:
        dwell = record.dwell_noise.dwell_s
        if len(record) > 1:
            gap = max(0.0, float(record.time_s[-1] - record.time_s[0]) / (len(record) - 1) - dwell)
    elif result.averaged is not None:
        dwell, gap = result.averaged.dwell_s, result.averaged.gap_s
    if dwell is None:
        raise InputError(f"--noise: the dwell of a position is not known; {LEAST}")
    return result.deviation(dwell, len(record), gap)


def bound_for(
    noise: Result | str | Path, noise_bound: float | None, positions: int | None = None, dwell_s: float | None = None
) -> Dwell:
    """Return σ of a plan for its number of positions and its dwell [s], else for those of the noise.

    Raises
    ------
    InputError
        where no dwell is known, or σ is given twice
    """
    if noise_bound is not None:
        raise InputError("--noise: σ is given twice; leave out --noise-bound")
    result = _noise_of(noise)
    averaged = result.averaged
    if averaged is None:
        raise InputError(f"--noise: the dwell of a position is not known; {LEAST}")
    dwell, count = dwell_s or averaged.dwell_s, positions or averaged.positions
    return result.average(dwell, count, gap_s=averaged.gap_s, probability=averaged.probability)


def gyro_bound_for(noise: Result | str | Path, averaged: Dwell) -> float:
    """Return the bound of the mean noise of a gyro over one second [rad/s], as likely as that of averaged readings.

    Raises
    ------
    InputError
        where no gyro changes at rest
    """
    deviations = []
    for gyro in _noise_of(noise).of("gyro"):
        if gyro.coefficients:
            deviations.append(gyro.deviation_of_means(1.0, averaged.positions, averaged.dwell_s))
    if not deviations:
        raise InputError("--noise: no gyro changes at rest; give --gyro-noise")
    return max(deviations) * averaged.sigma / averaged.not_excluded


def _noise_of(noise: Result | str | Path) -> Noise:
    result = read_noise(noise) if isinstance(noise, str | Path) else noise
    if not isinstance(result, Noise):
        raise InputError(f"--noise: is a {type(result).__name__}; {LEAST}")
    return result
