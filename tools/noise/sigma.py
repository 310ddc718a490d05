"""Standard deviation of averaged readings for a record, by the noise of its instrument."""

from pathlib import Path

from ..errors import InputError
from ..files import LARGEST_RESULT, bytes_of
from ..records import PositionRecord
from ..result import Result, object_of, parsed_result
from .result import Noise

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
    if isinstance(noise, str | Path):
        noise = read_noise(noise)
    if not isinstance(noise, Noise):
        raise InputError(f"--noise: is a {type(noise).__name__}; {LEAST}")
    result = noise
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
