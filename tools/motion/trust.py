"""Plausibility of a record with gyros: the check that every command runs before it uses such a record.

Units, order and signs of axes, the size of gyros and accelerometers, the meaning of the true attitude, and rows that no
motion makes. A fault makes results wrong, a warning does not. What cannot be told from a record is not held against it.
"""

import math
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Bools, Floats
from ..errors import InputError
from ..memory import once
from ..records import BenchRecord, ForceRecord, PoseRecord, PositionRecord, RawRecord, StrapdownRecord
from ..records.limits import runs_of
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
from .rests import FEWEST_ROWS, RecordSampling, Rests, quiet_rests, rates_of, sampling_of
from .truth import downward_warning, truth_check
from .turning import TurningCheck, check_turning

Series = RawRecord | StrapdownRecord | ForceRecord
"""Records of readings in time."""
LONGEST = 3
"""Most rows of a spike."""
UNLIKE = 10.0
"""Distance of a spike from its neighbours over their spread."""
SHARPEST = 300.0
"""Change of a rate from one row to the next and back [rad/s²] that no hand and no table makes; knocks are excluded by
other rules."""
LEAST_TURN = 0.01
"""Rows that turn the attitude by less are not refused [rad]."""
ALONE = 30.0
"""Ratio of an accelerometer's jump to that of each other that excludes a knock."""
RANGE_PART = 0.75
"""Least jump of a reading that overflows, as a part of the range between the channel's extremes."""
STEADY = 0.25
"""Largest change of the readings before and behind this jump, as a part of it."""
TOWARDS = 5.0
"""Least jump over the usual change, towards the end of the range."""
LONGEST_LOSS = 0.5
"""Zeros for longer in a record without noise are no lost readings but a rest [s]."""
STUCK, SELDOM = 6, 0.02
"""Number of equal rows in succession that are stuck, where no larger part of the other rows repeats the one before."""
OVERFLOW = "an overflow to the opposite end of the range and back; choose a larger range"
LOST = "lost readings, exactly 0 between readings that are not"
HELD = "stuck at one value, though the readings change from row to row elsewhere"
SPIKE = "unlike their neighbours, as no motion is (a spike)"


def odd_rows_of_gyros(record: StrapdownRecord) -> tuple[str, ...]:
    """Describe the rows of the gyros that no motion can cause."""
    return _described(record, _odd_gyros(record))


def odd_rows_of_forces(record: Series) -> tuple[str, ...]:
    """Describe the rows of the accelerometers that no motion can cause."""
    return _described(record, _odd_forces(record))


def odd_rows(record: Series) -> dict[str, Bools]:
    """Return the rows (N,) of each channel that no motion can cause, by words; channels without any are left out."""
    gyros = _odd_gyros(record) if isinstance(record, StrapdownRecord) else {}
    return gyros | _odd_forces(record)


def _odd_gyros(record: StrapdownRecord) -> dict[str, Bools]:
    """Rows with a knock of the accelerometers are motion: gyros feel it too."""
    period = float(np.median(np.diff(record.time_s)))
    rates = record.rate
    if rates is None:
        assert record.increment is not None
        rates = record.increment / period
    least = max(SHARPEST * period, LEAST_TURN / period)
    spikes = unlike_rows(rates, least) & ~_beside(record.knocks)[:, None]
    return _odd(record, "gyro", rates, spikes, least)


def _odd_forces(record: Series) -> dict[str, Bools]:
    """A knock is motion: more than one accelerometer feels it."""
    period = float(np.median(np.diff(record.time_s)))
    forces = record.specific_force
    if isinstance(record, StrapdownRecord) and record.velocity_increment is not None:
        forces = record.velocity_increment / period
    spikes = unlike_rows(forces, STANDARD_GRAVITY)
    if spikes.any():
        off = np.abs(forces - scipy.ndimage.median_filter(forces, (2 * LONGEST + 3, 1)))
        spikes &= off > ALONE * np.sort(off, axis=1)[:, 1:2]
    odd = _odd(record, "accelerometer", forces, spikes, STANDARD_GRAVITY)
    lost = lost_rows(np.linalg.norm(forces, axis=1), period, 0.0)
    return {f"all accelerometers: {LOST}": lost} if lost.any() and not odd else odd


def _odd(
    record: Series,
    name: str,
    channels: NDArray,
    spikes: Bools,
    least: float,
) -> dict[str, Bools]:
    """Return each kind of odd rows of each channel (N, 3), by words."""
    period = float(np.median(np.diff(record.time_s)))
    odd, moving = {}, ~_repeated_together(record)
    for axis, values in enumerate(channels.T, start=1):
        overflowed = overflowed_rows(values)
        lost = lost_rows(values, period, least) & ~overflowed
        stuck = stuck_rows(values, moving, least) & ~overflowed & ~lost
        alone = spikes[:, axis - 1] & ~overflowed & ~lost & ~stuck
        for words, rows in ((OVERFLOW, overflowed), (LOST, lost), (HELD, stuck), (SPIKE, alone)):
            if rows.any():
                odd[f"{name} {axis}: {words}"] = rows
    return odd


def _described(record: Series, odd: dict[str, Bools]) -> tuple[str, ...]:
    """Return a line for each kind of odd rows."""
    lines = []
    for words, rows in odd.items():
        channel, _, what = words.partition(": ")
        lines.append(f"{channel}: {_counted(record, rows)}: {what}")
    return tuple(lines)


def unlike_rows(channels: Floats, least: float) -> Bools:
    """Rows (N, K) of channels (N, K) far from their neighbours on both sides, by `least` and more; up to three."""
    count = len(channels)
    spikes = np.zeros(channels.shape, dtype=bool)
    if count < LONGEST + 5:
        return spikes
    # A spike is farther from the row before it than from the median of its neighbours, less their spread.
    steps = (np.abs(np.diff(channels, axis=0)) > (1.0 - 1.0 / UNLIKE) * least).any(axis=1)
    jumps = 1 + np.flatnonzero(steps)
    if not len(jumps):
        return spikes
    scatter = np.median(np.abs(np.diff(channels, 2, axis=0)), axis=0)
    for length in range(1, LONGEST + 1):
        starts = jumps[(jumps >= 2) & (jumps < count - length - 1)]
        around = channels[starts + np.array([[-2], [-1], [length], [length + 1]])]
        inside = channels[starts + np.arange(length)[:, None]]
        off = np.abs(inside - np.median(around, axis=0)).min(axis=0)
        far = (off > UNLIKE * np.maximum(np.ptp(around, axis=0), scatter)) & (off > least)
        for ahead in range(length):
            spikes[starts + ahead] |= far
    return spikes


def overflowed_rows(values: Floats) -> Bools:
    """Rows (N,) of a channel between two jumps from one end of its range to the other, towards which it was moving."""
    overflowed = np.zeros(len(values), dtype=bool)
    change = np.diff(values)
    if len(change) < 3 or not values.min() < 0.0 < values.max():
        return overflowed
    before, jump, behind = change[:-2], change[1:-1], change[2:]
    is_jump = np.abs(jump) > RANGE_PART * np.ptp(values)
    if not is_jump.any():
        return overflowed
    steps = np.abs([before, behind])
    is_jump &= (steps.max(axis=0) < STEADY * np.abs(jump)) & (steps.min(axis=0) > TOWARDS * np.median(np.abs(change)))
    # an overflow goes on as it came, from the other end
    is_jump &= (np.sign(before) == -np.sign(jump)) & (np.sign(behind) == -np.sign(jump))
    at = np.flatnonzero(is_jump)
    for first, stop in pairwise(at):
        if jump[first] * jump[stop] < 0.0:
            rows = slice(first + 2, stop + 2)
            overflowed[rows] |= np.sign(values[rows]) == np.sign(jump[first])
    return overflowed


def lost_rows(values: Floats, period: float, least: float) -> Bools:
    """Rows (N,) that are exactly 0 between readings far from 0, which times the rows are `least` and more."""
    lost = np.zeros(len(values), dtype=bool)
    if values.all():
        return lost
    scatter = float(np.median(np.abs(np.diff(values, 2)))) if len(values) > 2 else 0.0
    begins, ends = runs_of(values == 0.0)
    inner = (begins >= 2) & (ends <= len(values) - 2)
    if scatter == 0.0:
        inner &= (ends - begins) * period <= LONGEST_LOSS
    for begin, end in zip(begins[inner], ends[inner], strict=True):
        before, after = values[begin - 1], values[end]
        usual = max(abs(before - values[begin - 2]), abs(values[end + 1] - after), scatter)
        nearest = min(abs(before), abs(after))
        lost[begin:end] = before * after > 0.0 and nearest > UNLIKE * usual and nearest * (end - begin) > least
    return lost


def stuck_rows(values: Floats, moving: Bools, least: float) -> Bools:
    """Rows (N,) at one value while others change, from which the channel jumps by what times the rows is `least`.

    `moving` (N,): rows in which some channel does not repeat the row before. A channel that often repeats a value is
    coarse, and one at its largest or least value is at its limit.
    """
    stuck = np.zeros(len(values), dtype=bool)
    repeated = np.append(False, np.diff(values) == 0.0) & moving
    begins, ends = runs_of(repeated)
    is_long = ends - begins >= STUCK - 1
    usual = repeated.copy()
    for begin, end in zip(begins[is_long], ends[is_long], strict=True):
        usual[begin:end] = False
    if not is_long.any() or usual.mean() > SELDOM:
        return stuck
    scatter = float(np.median(np.abs(np.diff(values, 2))))
    extremes = (values.min(), values.max())
    for begin, end in zip(begins[is_long], ends[is_long], strict=True):
        value = values[begin]
        around = values[[max(begin - 2, 0), min(end, len(values) - 1)]]
        jump = float(np.abs(around - value).max())
        if value not in extremes and jump > UNLIKE * scatter and jump * (end - begin) > least:
            stuck[begin - 1 : end] = True
    return stuck


def _repeated_together(record: Series) -> Bools:
    """Rows (N,) in which all channels repeat the row before: a rest without noise, or a row that is held."""
    channels = [record.specific_force]
    if isinstance(record, StrapdownRecord):
        turning = record.increment if record.rate is None else record.rate
        assert turning is not None
        channels.append(turning)
    changes = np.diff(np.hstack(channels), axis=0)
    return np.append(False, np.all(changes == 0.0, axis=1))


def _beside(rows: Bools) -> Bools:
    """These rows (N,) and their neighbours."""
    return np.convolve(rows, np.ones(3), "same") > 0.0


def _counted(record: Series, rows: Bools) -> str:
    """Return the number of rows, and the first of them with its time."""
    first = int(np.argmax(rows))
    where = f"row {int(record.row[first])} ({digits(float(record.time_s[first]), 9)} s)"
    count = int(rows.sum())
    if count == 1:
        return where
    return f"{count} rows, the first {where}"


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
