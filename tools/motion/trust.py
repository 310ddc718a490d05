"""Whether a record with gyros can be what it says: the one check that every command asks before it uses such a record.

Units, order and signs of axes, the size of gyros and accelerometers, the meaning of the true attitude, and rows that no
motion makes. A fault makes results wrong, a warning does not. What cannot be told from a record is not held against it.
"""

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError
from ..records import BenchRecord, PositionRecord, RawRecord, StrapdownRecord
from ..result import Result
from ..rounding import digits
from .between_rests import (
    STANDING,
    missed_gravity,
    scale_by_rests,
    turns_between_rests,
    ways_beside_gravity,
)
from .odd_rows import odd_rows
from .rests import FEWEST_ROWS, RecordSampling, Rests, quiet_rests, rates_of, sampling_of
from .truth import TruthCheck, downward_warning, truth_check
from .turning import TurningCheck, check_turning

LARGEST_SCALE = math.sqrt(2.0)
"""Gyros or accelerometers that are off by more are read wrongly: settings of a range step by two."""
USUAL_SCALE = 0.05
"""Scale factors that are off by more are said."""
UNUSUAL_FORCE = 1.5
"""A median specific force of more gravities is said where no rest tells the unit."""
WHOLE_POWER = 0.1
"""A factor is a power of two where its logarithm to base 2 is so near a whole number."""
FEW = 0.01
"""Part of the rows."""
Measured = TypeVar("Measured", bound=PositionRecord | RawRecord | StrapdownRecord)


class TrustCheck(Result):
    """What speaks against a record.

    Attributes
    ----------
    faults : tuple of str
        what would make results wrong, and what mends it
    warnings : tuple of str
        what is unusual, and may be right
    """

    faults: tuple[str, ...] = Field(default=())
    warnings: tuple[str, ...] = Field(default=())


def trusted(record: Measured, *, trust: bool = False, gravity: float = STANDARD_GRAVITY) -> Measured:
    """Return a record with what speaks against it among its warnings; of a record without gyros nothing is asked.

    An InputError for faults; with `trust`, where a person knows that the record is right, they are warnings.
    """
    check = trust_of(record, gravity)
    if check.faults and not trust:
        what = "; ".join(check.faults)
        raise InputError(f"{record.path}: {what}. If the record is right all the same, add --trust")
    lines = (*check.faults, *check.warnings)
    new = tuple(line for line in lines if line not in record.warnings)
    if not new:
        return record
    return replace(record, warnings=(*record.warnings, *new))


def trust_of(record: PositionRecord | RawRecord | StrapdownRecord, gravity: float = STANDARD_GRAVITY) -> TrustCheck:
    """Return what speaks against a record with gyros, strapdown or of a bench, averaged or not."""
    source = record.raw if isinstance(record, PositionRecord) else record
    if isinstance(source, BenchRecord):
        source = source.gyros
    # a command refuses gravity that is none
    if not (isinstance(source, StrapdownRecord) and 1.0 <= gravity <= 100.0):
        return TrustCheck()
    if len(source) < FEWEST_ROWS:
        return TrustCheck(warnings=downward_warning(source))
    sampling = sampling_of(source)
    rests = quiet_rests(source, sampling)
    return judged(source, sampling, rests, turning_of(source, sampling, rests), gravity)


def turning_of(record: StrapdownRecord, sampling: RecordSampling, rests: Rests) -> TurningCheck:
    """The gyros beside the accelerometers over moves."""
    level, noise = np.zeros(3), np.zeros(3)
    if len(rests):
        level, noise = np.median(rests.rate, axis=0), rests.noise[:3]
    # Where many turns are more than half a turn they are no glitches: the unit is wrong.
    broken = record.knocks
    if sampling.wrapped < FEW * len(record):
        broken = sampling.broken
    return check_turning(record.time_s, rates_of(record) - level, record.specific_force, noise, broken, record.channels)


def judged(
    record: StrapdownRecord, sampling: RecordSampling, rests: Rests, turning: TurningCheck, gravity: float
) -> TrustCheck:
    """Return what speaks against a record whose sampling, rests and turning are known; gravity in [m/s²]."""
    faults, warnings = list[str](), list[str]()
    turns = turns_between_rests(record, sampling, rests)
    truth = truth_check(record, sampling, rests)
    ways = ways_beside_gravity(turns, record.channels)
    mends = turning.of_forces or (ways[1] if ways else "")
    if truth is not None and truth.faults:
        faults += truth.faults
    elif truth is not None and mends:
        faults.append(
            "the gyros turn as the true attitude does and not as gravity: the accelerometers are exchanged, read them "
            f"with {mends}"
        )
    elif truth is None and turning.said:
        faults += turning.said
    elif truth is None and ways:
        faults.append(ways[0])
    scale = 1.0
    if not faults:
        scale = _say_gyro_scale(faults, warnings, truth, turning, scale_by_rests(turns))
    _say_force(faults, warnings, record, rests, gravity)
    lines = odd_rows(record)
    if not (faults or lines):
        faults += missed_gravity(turns, scale)
    faults += lines
    downward = downward_warning(record)
    if record.velocity_increment is not None:
        faults += downward
    else:
        warnings += downward
    return TrustCheck(faults=tuple(faults), warnings=tuple(warnings))


def _say_gyro_scale(
    faults: list[str],
    warnings: list[str],
    truth: TruthCheck | None,
    turning: TurningCheck,
    by_rests: float | None,
) -> float:
    """Add what the gyros' size is, and return how many times as far as they read they turn; 1 where nothing tells it.

    Moves that are not between rests tell a wrong setting alone, as accelerations add to gravity there.
    """
    words = "the gyros turn {} times as far as gravity turns"
    if truth is not None:
        _say_scale(faults, warnings, truth.scale, "the gyros turn {} times as far as the true attitude turns")
        return truth.scale
    if by_rests is not None:
        _say_scale(faults, warnings, by_rests, words)
        return by_rests
    if turning.scale is not None:
        _say_scale(faults, warnings, turning.scale, words, exact=False)
    return 1.0


def _say_force(faults: list[str], warnings: list[str], record: StrapdownRecord, rests: Rests, gravity: float) -> None:
    """Add what the size of the specific force says of the accelerometers: at rest, or else over the record."""
    standing = np.linalg.norm(rests.rate, axis=1) < STANDING if len(rests) else np.zeros(0, dtype=bool)
    if not (standing.any() and rests.force[standing].any()):
        usual = float(np.median(np.linalg.norm(record.specific_force, axis=1))) / gravity
        if not 1.0 / UNUSUAL_FORCE < usual < UNUSUAL_FORCE:
            warnings.append(
                f"the median of |f| is {digits(usual, 3)} times gravity, and no rest tells whether that is so"
            )
        return
    size = float(np.median(np.linalg.norm(rests.force[standing], axis=1))) / gravity
    _say_scale(faults, warnings, 1.0 / size, "at rest the accelerometers read {} times gravity")


def _say_scale(faults: list[str], warnings: list[str], scale: float, words: str, *, exact: bool = True) -> None:
    """Add a line where readings, to be multiplied by `scale`, are far from right, or unusual and told exactly."""
    power = math.log2(scale)
    line = words.format(digits(1.0 / scale, 3))
    if abs(power) > math.log2(LARGEST_SCALE):
        mends = "check their unit"
        if abs(power - round(power)) < WHOLE_POWER:
            mends = f"a factor of {2 ** abs(round(power))} is a wrong range setting; check that and their unit"
        faults.append(f"{line}: {mends}")
    elif exact and abs(scale - 1.0) > USUAL_SCALE:
        warnings.append(line)
