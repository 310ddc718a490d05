"""Plausibility of a record with gyros: the check that every command runs before it uses such a record.

Units, order and signs of axes, the size of gyros and accelerometers, the meaning of the true attitude, and rows that no
motion makes. A fault makes results wrong, a warning does not. What cannot be told from a record is not held against it.
"""

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError
from ..memory import once
from ..records import BenchRecord, ForceRecord, PoseRecord, PositionRecord, RawRecord, StrapdownRecord
from ..result import Result
from ..rounding import digits
from .between_rests import (
    FEWEST_MOVES,
    STANDING,
    TELLING,
    missed_gravity,
    moves_between,
    scales_by_rests,
    ways_beside_gravity,
)
from .odd_rows import odd_rows_of_forces, odd_rows_of_gyros
from .rests import FEWEST_ROWS, RecordSampling, Rests, quiet_rests, rates_of, sampling_of
from .truth import downward_warning, truth_check
from .turning import TurningCheck, check_turning

LARGEST_SCALE = math.sqrt(2.0)
"""Gyros or accelerometers that are off by more are read wrongly: settings of a range step by two."""
USUAL_SCALE = 0.05
"""Larger scale-factor errors are reported."""
UNUSUAL_FORCE = 1.5
"""A larger median specific force [g] is reported where no rest shows the unit."""
WHOLE_POWER = 0.1
"""A factor is a power of two where its logarithm to base 2 is within this distance of a whole number."""
FEW = 0.01
"""Part of the rows."""
FEW_MOVES = 0.2
"""Part of the moves that may miss gravity in a record whose other moves are used."""
LEAST_FORCE = 1e-3
"""Least size for which readings count [g]."""
FEWEST_RESTS, TOLD = 6, 0.1
"""Least number of rests, and least ratio of the smallest to the largest singular value, that tell accelerometers from
each other."""
Measured = TypeVar("Measured", bound=PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord)


class TrustCheck(Result):
    """Evidence against a record: faults and warnings.

    Attributes
    ----------
    faults : tuple of str
        faults that make results wrong, with their remedies
    warnings : tuple of str
        unusual facts that may be right
    of_forces : tuple of str
        the faults of accelerometers: they make results wrong that use no gyros
    of_moves : tuple of str
        the faults of a few moves: they make results wrong that use these
    """

    faults: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    of_forces: tuple[str, ...] = Field(default=(), exclude=True)
    of_moves: tuple[str, ...] = Field(default=(), exclude=True)

    def known(self, trust: bool) -> "TrustCheck":
        """The check where a person may trust the record: then all are warnings."""
        if trust:
            return TrustCheck(warnings=(*self.faults, *self.warnings))
        return self


def trusted(
    record: Measured,
    *,
    trust: bool = False,
    gyros: bool = True,
    moves: bool = True,
    gravity: float = STANDARD_GRAVITY,
) -> Measured:
    """Return a record with what speaks against it among its warnings.

    An InputError for faults, of accelerometers alone where `gyros` are not used, of a few moves only where all `moves`
    are used; with `trust`, where a person knows
    that the record is right, they are warnings.
    """
    check = trust_of(record, gravity).known(trust)
    refused = check.faults if gyros else check.of_forces
    if not moves:
        refused = tuple(line for line in refused if line not in check.of_moves)
    if refused:
        raise InputError(f"{record.path}: {'; '.join(refused)}. If the record is right all the same, add --trust")
    new = tuple(line for line in (*check.faults, *check.warnings) if line not in record.warnings)
    return replace(record, warnings=(*record.warnings, *new)) if new else record


def trust_of(
    record: PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord, gravity: float = STANDARD_GRAVITY
) -> TrustCheck:
    """Return what speaks against a record, of a table or strapdown, averaged or not; gravity in [m/s²]."""
    # a command refuses gravity that is none
    if not 1.0 <= gravity <= 100.0:
        return TrustCheck()
    is_averaged = isinstance(record, PositionRecord | PoseRecord)
    series = record
    if is_averaged:
        series = record.raw if isinstance(record, PositionRecord) else None
    gyros = series.gyros if isinstance(series, BenchRecord) else series
    if isinstance(gyros, StrapdownRecord) and len(gyros) >= FEWEST_ROWS:
        undecided = replace(gyros, decisions=None)
        sampling = once(sampling_of, undecided)
        searched = once(_searched, undecided, sampling)
        rests = searched if gyros.decisions is None else quiet_rests(gyros, sampling, bounds=False)
        # Moves are those of the whole record, whichever rests a person takes.
        turning = once(turning_of, undecided, sampling, searched if len(searched) else rests)
        return judged(gyros, sampling, rests, turning, gravity)
    if isinstance(gyros, StrapdownRecord):
        return TrustCheck(warnings=downward_warning(gyros))
    faults, warnings = list[str](), list[str]()
    if is_averaged:
        _say_force(faults, warnings, record.specific_force, gravity)
    if isinstance(series, RawRecord | StrapdownRecord | ForceRecord) and len(series) >= FEWEST_ROWS:
        faults += odd_rows_of_forces(series)
    return TrustCheck(faults=tuple(faults), warnings=tuple(warnings), of_forces=tuple(faults))


def _searched(record: StrapdownRecord, sampling: RecordSampling) -> Rests:
    return quiet_rests(record, sampling, bounds=False)


def turning_of(record: StrapdownRecord, sampling: RecordSampling, rests: Rests) -> TurningCheck:
    """Compare the gyros with the accelerometers over moves."""
    level, noise = np.zeros(3), np.zeros(3)
    if len(rests):
        level, noise = np.median(rests.rate, axis=0), rests.noise[:3]
    # Many turns of more than half a revolution are no glitches: the unit is wrong.
    broken = record.knocks
    if sampling.wrapped < FEW * len(record):
        broken = sampling.broken
    return check_turning(record.time_s, rates_of(record) - level, record.specific_force, noise, broken, record.channels)


def judged(
    record: StrapdownRecord, sampling: RecordSampling, rests: Rests, turning: TurningCheck, gravity: float
) -> TrustCheck:
    """Return what speaks against a record whose sampling, rests and turning are known; gravity in [m/s²]."""
    faults, of_forces, warnings = list[str](), list[str](), list[str]()
    moves = moves_between(record, sampling, rests)
    truth = truth_check(record, sampling, rests)
    by_rests = scales_by_rests(moves)
    # gyros that meet gravity at the rests when multiplied are in order
    is_sure = by_rests is not None and (moves.allowed(float(by_rests.max())) <= TELLING).sum() >= FEWEST_MOVES
    ways = None if is_sure else ways_beside_gravity(moves, record.channels)
    mends = turning.of_forces or (ways[1] if ways else "")
    if truth is not None and truth.faults:
        faults += truth.faults
    elif truth is not None and mends:
        of_forces.append(
            "the gyros turn as the true attitude does and not as gravity: the accelerometers are exchanged, read them "
            f"with {mends}"
        )
    elif truth is None and not is_sure and turning.said:
        faults += turning.said
    elif truth is None and ways:
        faults.append(ways[0])
    scale = np.ones(3)
    if not (faults or of_forces):
        words = "{} {} times as far as gravity turns"
        if truth is not None:
            scale = truth.scale
            _say_gyros(faults, warnings, scale, "{} {} times as far as the true attitude turns")
        elif by_rests is not None:
            scale = by_rests
            _say_gyros(faults, warnings, scale, words)
        elif turning.scale is not None:
            # moves that are not between rests tell a wrong setting alone: accelerations add to gravity there
            _say_gyros(faults, [], turning.scale, words)
    standing = np.linalg.norm(rests.rate, axis=1) < STANDING if len(rests) else np.zeros(0, dtype=bool)
    if standing.any() and rests.force[standing].any():
        _say_force(of_forces, warnings, rests.force[standing], gravity)
    else:
        usual = float(np.median(np.linalg.norm(record.specific_force, axis=1))) / gravity
        if not 1.0 / UNUSUAL_FORCE < usual < UNUSUAL_FORCE:
            warnings.append(
                f"the median of |f| is {digits(usual, 3)} times gravity, and no rest tells whether that is so"
            )
    odd = once(odd_rows_of_gyros, record)
    of_forces += once(odd_rows_of_forces, record)
    of_moves: tuple[str, ...] = ()
    if not (faults or of_forces or odd):
        lines = missed_gravity(moves, scale)
        faults += lines
        if moves.missing(scale).sum() <= FEW_MOVES * len(moves):
            of_moves = lines
    faults += odd
    downward = downward_warning(record)
    if record.velocity_increment is not None:
        of_forces += downward
    else:
        warnings += downward
    checked = {"of_forces": tuple(of_forces), "of_moves": of_moves}
    return TrustCheck(faults=(*faults, *of_forces), warnings=tuple(warnings), **checked)


def _say_gyros(faults: list[str], warnings: list[str], scale: NDArray, words: str) -> None:
    """Add a line on the gyros, to be multiplied by a scale (3,), or on each where they differ by a wrong setting."""
    if scale.max() < LARGEST_SCALE * scale.min():
        line = words.format("the gyros turn", "{}")
        _say_scale(faults, warnings, float(np.exp(np.log(scale).mean())), line, "their unit and the sampling rate")
        return
    for axis, single in enumerate(scale.tolist(), start=1):
        _say_scale(faults, warnings, single, words.format(f"gyro {axis} turns", "{}"))


def _say_force(faults: list[str], warnings: list[str], force: NDArray, gravity: float) -> None:
    """Add faults of the size of the accelerometers from readings (R, 3) at rest [m/s²], together or each."""
    squares = np.square(force / gravity)
    sizes = np.sqrt(squares.sum(axis=1))
    if sizes.max() > LARGEST_SCALE * sizes.min() and len(force) >= FEWEST_RESTS:
        solution, _, _, singular = np.linalg.lstsq(squares, np.ones(len(force)), rcond=None)
        fits = np.abs(squares @ solution - 1.0).max() < LARGEST_SCALE - 1.0
        if fits and solution.min() > 0.0 and singular[-1] > TOLD * singular[0]:
            for axis, scale in enumerate(np.sqrt(solution).tolist(), start=1):
                _say_scale(faults, warnings, scale, f"at rest accelerometer {axis} reads {{}} times gravity")
            return
    size = max(float(np.median(sizes)), LEAST_FORCE)
    _say_scale(faults, warnings, 1.0 / size, "at rest the accelerometers read {} times gravity")


def _say_scale(faults: list[str], warnings: list[str], scale: float, words: str, suspects: str = "their unit") -> None:
    """Add a line where readings, to be multiplied by `scale`, are far from right, or unusual."""
    power = math.log2(scale)
    line = words.format(digits(1.0 / scale, 3))
    if abs(power) > math.log2(LARGEST_SCALE):
        mends = f"check {suspects}"
        if abs(power - round(power)) < WHOLE_POWER:
            mends = f"a factor of {2 ** abs(round(power))} is a wrong range setting; else {mends}"
        faults.append(f"{line}: {mends}")
    elif abs(scale - 1.0) > USUAL_SCALE:
        warnings.append(line)
