"""Measurements of one record without a table: rests, moves, faces, turns, and the errors of the readings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fmus.parameters import GRAVITIES
from ...models.arrays import Bools, Floats, Ints
from ..errors import InputError
from ..memory import once
from ..motion.determinacy import LEAST_SD
from ..motion.rests import QUIET, mean_rates, rates_of, sampling_of
from ..motion.truth import known_rows, usable_in, windows_between
from ..records import ForceRecord, PoseRecord, StrapdownRecord
from ..records.columns import face_of, part_of, turn_of
from ..records.cut_off import limited_rests
from ..records.decisions import Decisions, decisions_of, rows_of_rests
from ..records.limits import channel_limits
from ..records.noise import noise_bound_of
from ..rounding import digits, exactly
from .forces import FACE_ERROR, Faces
from .moves import Moves, Turns, Way, Windows, moves_of
from .still import StillRests, TimedReadings, averaged, still_rests

HandRecord: TypeAlias = StrapdownRecord | ForceRecord | PoseRecord
Measured = TypeVar("Measured", bound=HandRecord)
NOISE = (1e-9, 5e-2)
"""Noise bounds that can be used, fractions of g."""
RATIOS = (1.001, 100.0)
"""Largest scatters of accelerometers at rest that can be asked for, in units of their noise."""
CUT = 0.2
"""A move is a cut if gravity turns over it by this much more than the gyros [rad]."""
GAP, MOST_CUT = 10.0, 5.0
"""Length of the gap at a cut, and of the longest move that is a cut [s]."""
EQUAL = 1e-9
"""Means that differ by less are equal, but for rounding [g]."""
FEWEST_TOLD = 4
"""Least number of rests that prove that an accelerometer with equal readings is dead."""
FEWEST_ROWS = 16
"""Fewer rows have no rests."""
LEAST = 0.6
"""A move that reads less than this part of a known turn is another one, as a flip of 180° is of a whole turn."""
HALF, STEADY = 0.5, 0.8
"""A known turn reads at least this part of its angle, and this part of its way about one axis."""
WINDOW, FEWEST_WINDOWS = 2.0, 12
"""Length of a window with a true attitude [s], and the fewest."""
TRUTH_ERROR = np.radians(0.5)
"""Error of a vertical by a true attitude [rad]."""


@dataclass(frozen=True)
class HandRequest:
    """Request of a calibration without a table: options of `trihedron.calibrate`.

    `noise_bound`, `noise_sd` are fractions of g; `rests` is a file of rests; `faces` and `turns` are words in the order
    of the rests and of the turns.
    """

    noise_bound: float | None = None
    noise_sd: float | None = None
    gravity: float = 9.80665
    rates: str = "instantaneous"
    rest_scatter: float | None = None
    rests: Path | None = None
    faces: Sequence[str] = ()
    turns: Sequence[str] = ()

    @staticmethod
    def told(
        *, rests: str | Path | None = None, faces: str | None = None, turns: str | None = None, **known: Any
    ) -> "HandRequest":
        """Return the request with faces and turns as lists in words, separated by commas."""
        words = [() if text is None else tuple(text.split(",")) for text in (faces, turns)]
        return HandRequest(rests=None if rests is None else Path(rests), faces=words[0], turns=words[1], **known)

    def __post_init__(self) -> None:
        if self.noise_bound is not None and self.noise_sd is not None:
            raise InputError(f"--noise-sd {exactly(self.noise_sd)}: goes without --noise-bound; give one of them")
        for name, value, (least, most), what in (
            ("gravity", self.gravity, GRAVITIES, "{}, as 9.80665 [m/s²]"),
            ("noise-bound", self.noise_bound, NOISE, "a fraction of g {}, as 1e-3"),
            ("noise-sd", self.noise_sd, NOISE, "a fraction of g {}, as 1e-3"),
            ("rest-scatter", self.rest_scatter, RATIOS, "{}; 3 is usual"),
        ):
            if value is not None and not least <= value <= most:
                limits = what.format(f"from {least:g} to {most:g}")
                raise InputError(f"--{name} {exactly(value)}: must be {limits}")


@dataclass(frozen=True, eq=False)
class Run:
    """Measurements of one record.

    Attributes
    ----------
    record : record
    rests : StillRests
    deviation : (K,) array
        standard deviation of a mean reading's error [g]
    bound : float or None
        σ [g]; None where nothing tells it
    basis : str
        on what σ rests; empty where nothing tells it
    faces : Faces or None
    moves : Moves or Windows or None
        windows where a true attitude is known; None without gyros
    turns : Turns or None
    warnings : tuple of str
    """

    record: HandRecord
    rests: StillRests
    deviation: Floats
    bound: float | None
    basis: str
    faces: Faces | None
    moves: Moves | Windows | None
    turns: Turns | None
    warnings: tuple[str, ...]

    @property
    def tells_noise(self) -> bool:
        """Whether the errors of readings are known but by the norms: from options or from the scatter at rest."""
        return bool(self.basis) or not isinstance(self.record, PoseRecord) or self.record.scatter is not None

    def part(self, chosen: Ints) -> "Run":
        """Return the run with some of its windows, where a true attitude is known, or of its rests."""
        if isinstance(self.moves, Windows):
            return replace(self, moves=self.moves.those(chosen))
        return self.those(chosen)

    def those(self, chosen: Ints) -> "Run":
        """Return the run with some of the rests, and the moves between neighbours among them."""
        faces = None if self.faces is None else replace(self.faces, up=self.faces.up[chosen])
        moves = self.moves
        if isinstance(moves, Moves):
            moves = moves.among(chosen, len(self.rests))
        rests = self.rests.those(chosen)
        return replace(self, rests=rests, deviation=self.deviation[chosen], faces=faces, moves=moves)


def run_of(record: HandRecord, request: HandRequest) -> Run:
    """Return the measurements of a record.

    Raises
    ------
    InputError
        for a record without rests, a dead accelerometer, or faces and turns that are not those of the record
    """
    if isinstance(record, PoseRecord):
        return _of_poses(record, request)
    series = series_of(record, request)
    warnings: list[str] = []
    decisions = record.decisions or Decisions()
    if decisions.turns and not request.turns:
        request = replace(request, turns=tuple(decisions.turns.split(",")))
    where = str(record.path)
    if request.rests is not None:
        where = f"--rests {request.rests}"
        decisions = _rests_of_file(request.rests, where)
    if decisions.rests is not None:
        rests = averaged(series, rows_of_rests(series.time_s, decisions.rests, where), None)
    else:
        rests = _with_parts(record, series, once(still_rests, series, request.rest_scatter))
    windows = truth_windows(record, series)
    if not len(rests) and windows is None:
        raise InputError(
            f"{record.path}: no rests: let the block rest for two seconds and more in each of a dozen poses, or give "
            f"--rest-scatter (now {exactly(request.rest_scatter or QUIET)}) or --rests FILE"
        )
    if len(rests):
        _check_alive(record, rests.force)
    if rests.limit is not None and request.rest_scatter is None and rests.limit > QUIET:
        warnings.append(
            f"rests: a limit of {QUIET:g} times the noise of the accelerometers leaves too few; found with "
            f"{rests.limit:g} times"
        )
    words = request.faces or decisions.faces() or _faces_in(record, rests)
    moves: Moves | Windows | None = None
    turns = None
    if windows is not None:
        moves, turns = windows, turns_in(record, series, request, np.zeros(len(record), dtype=bool))
        if request.turns:
            raise InputError(f"--turns: {record.path} has a true attitude, which tells more")
    elif series.rate is not None:
        assert isinstance(record, StrapdownRecord)
        limits = once(channel_limits, record)
        saturated = limits.of("w")
        moves = moves_of(series, rests, record.knocks | saturated)
        is_cut = cut_moves(moves)
        moves = moves.those(np.flatnonzero(~is_cut))
        lines = [line for line in limits.lines if line.startswith("w")]
        warnings += [f"{line}; moves and turns over them are left out" for line in lines]
        try:
            turns = turns_in(record, series, request, saturated) or turns_told(record, moves, request)
        except InputError as error:
            raise InputError("; ".join([str(error), *lines])) from error
        if is_cut.any():
            warnings.append(f"{is_cut.sum()} times gravity turns and the gyros do not: the record is cut there")
    elif request.turns:
        raise InputError(f"--turns: {record.path} has no gyros")
    run = _with_noise(record, request, rests, words, moves, turns, warnings)
    return _without_limited(run, series)


def _without_limited(run: Run, series: TimedReadings) -> Run:
    """Return a run without the rests in which an accelerometer is at an end of its range."""
    limited = limited_rests(series.force, run.rests.rows)
    usable = np.flatnonzero(~limited.any(axis=1))
    if len(usable) == len(limited):
        return run
    names = " and ".join(f"f{axis + 1}" for axis in np.flatnonzero(limited.any(axis=0)))
    if not len(usable):
        raise InputError(f"{run.record.path}: {names} is at an end of its range in every rest")
    line = f"rests with {names} at an end of the range: {len(limited) - len(usable)}, left out"
    return replace(run.those(usable), warnings=(*run.warnings, line))


def series_of(record: StrapdownRecord | ForceRecord, request: HandRequest) -> TimedReadings:
    """Return the readings of a record in time, its rates at the rows."""
    return once(_series_of, record, request.gravity, request.rates)


def _series_of(record: StrapdownRecord | ForceRecord, gravity: float, rates: str) -> TimedReadings:
    force = record.specific_force / gravity
    if isinstance(record, ForceRecord):
        return TimedReadings(record.time_s, force)
    rate = rates_of(record)
    if record.increment is not None or rates == "averaged":
        # Means over intervals: those at the rows lie between two of them.
        means = rate if record.increment is not None else np.vstack([rate[:1], mean_rates(record, rates)])
        rate = np.vstack([0.5 * (means[:-1] + means[1:]), means[-1:]])
    return TimedReadings(record.time_s, force, rate)


def _of_poses(record: PoseRecord, request: HandRequest) -> Run:
    """Return the measurements of a table of averaged readings."""
    for name, value in (("rest-scatter", request.rest_scatter), ("rests", request.rests), ("turns", request.turns)):
        if value:
            raise InputError(f"--{name}: {record.path} holds averaged readings, not a series")
    force = record.specific_force / request.gravity
    _check_alive(record, force)
    deviation = np.zeros(len(record))
    if record.scatter is not None:
        deviation = record.scatter.max(axis=1) / request.gravity
    rests = StillRests((), force, deviation, None)
    words = request.faces or record.face or ()
    return _with_noise(record, request, rests, words, None, None, [])


def _with_noise(
    record: HandRecord,
    request: HandRequest,
    rests: StillRests,
    words: Sequence[str],
    moves: Moves | Windows | None,
    turns: Turns | None,
    warnings: list[str],
) -> Run:
    """Return a run with its faces and the errors of its readings."""
    bound, basis = request.noise_bound, ""
    deviation = np.maximum(rests.deviation, LEAST_SD)
    if request.noise_sd is not None:
        deviation = np.full(len(rests), request.noise_sd)
        noise = noise_bound_of(request.noise_sd, len(rests))
        bound, basis = noise.value, noise.basis
    elif bound is not None:
        basis = "given"
        deviation = np.full(len(rests), bound / math.sqrt(3.0))
    faces = faces_of(record, words, len(rests))
    if faces is None and isinstance(moves, Windows):
        faces = _verticals(record, rests)
    return Run(record, rests, deviation, bound, basis, faces, moves, turns, tuple(warnings))


def truth_windows(record: StrapdownRecord | ForceRecord, series: TimedReadings) -> Windows | None:
    """Return windows of two seconds, side by side, between rows of known true attitude; None of too few."""
    if not isinstance(record, StrapdownRecord) or record.attitude is None:
        return None
    usable = usable_in(record, sampling_of(record))
    ends = windows_between(known_rows(record), usable, series.period, WINDOW)
    if len(ends) < FEWEST_WINDOWS:
        return None
    begin, end = (Rotation.from_quat(record.attitude[rows], scalar_first=True) for rows in ends.T)
    return Windows(Way(series, ends), (begin.inv() * end).as_matrix())


def _verticals(record: HandRecord, rests: StillRests) -> Faces | None:
    """Return the verticals at rests in the axes of the true attitude, NaN where it is not known; None of none."""
    assert isinstance(record, StrapdownRecord)
    assert record.attitude is not None
    up = np.full((len(rests), 3), np.nan)
    for number, rows in enumerate(rests.rows):
        known = record.attitude[rows][np.isfinite(record.attitude[rows]).all(axis=1)]
        if len(known):
            up[number] = Rotation.from_quat(known, scalar_first=True).mean().inv().apply([0.0, 0.0, 1.0])
    return Faces(up, TRUTH_ERROR) if np.isfinite(up).all(axis=1).any() else None


def _check_alive(record: HandRecord, force: NDArray) -> None:
    """Refuse a record whose accelerometer never changes though the others do."""
    spread = np.ptp(force, axis=0)
    for axis in np.flatnonzero(spread < EQUAL):
        if len(force) >= FEWEST_TOLD and spread.max() > 0.1:
            raise InputError(f"{record.path}: column f{axis + 1}_mps2: never changes while the others do; is it dead?")


def faces_of(record: HandRecord, words: Sequence[str], count: int) -> Faces | None:
    """Return the known directions at rests by faces in words, or by the columns up1, up2, up3.

    Raises
    ------
    InputError
        for another number of faces than rests, or a word that is not a face
    """
    up = np.full((count, 3), np.nan)
    if isinstance(record, PoseRecord) and record.up is not None and not words:
        up = record.up / np.linalg.norm(record.up, axis=1)[:, None]
    elif words and len(words) != count:
        raise InputError(f"{record.path}: {len(words)} faces are given for {count} rests; give one for each, in order")
    for number, word in enumerate(words):
        try:
            direction = face_of(word.strip())
        except ValueError as error:
            raise InputError(f"--faces {word}: {error}") from error
        if direction is not None:
            up[number] = direction
    if not np.isfinite(up).all(axis=1).any():
        return None
    return Faces(up, FACE_ERROR)


def _faces_in(record: StrapdownRecord | ForceRecord, rests: StillRests) -> list[str]:
    """Return the face of each rest by the columns `face` and `part`; an empty list without them."""
    words = record.face
    if words is None and record.part is not None:
        words = tuple(part if part_of(part)[0] is not None else "" for part in record.part)
    if words is None:
        return []
    faces = []
    for rows in rests.rows:
        inside = {word for word in words[rows] if word}
        faces.append(inside.pop() if len(inside) == 1 else "")
    return faces


def _with_parts(record: StrapdownRecord | ForceRecord, series: TimedReadings, rests: StillRests) -> StillRests:
    """Return the rests, parted where the column `part` or `face` changes within one."""
    words = record.part or record.face
    if words is None:
        return rests
    changes = _changes(words)
    rows = []
    for at in rests.rows:
        edges = [at.start, *changes[(changes > at.start) & (changes < at.stop)].tolist(), at.stop]
        rows += [slice(first, last) for first, last in pairwise(edges) if (last - first) * series.period >= 0.5]
    return averaged(series, rows, rests.limit)


def _changes(words: Sequence[str]) -> Ints:
    """Return the rows at which another word begins."""
    return np.flatnonzero(np.array(words[1:]) != np.array(words[:-1])) + 1


def _rests_of_file(path: Path, where: str) -> Decisions:
    """Return the rests of a file with the columns from_s, to_s and perhaps face.

    Raises
    ------
    InputError
        for a file that has no such columns
    """
    try:
        table = pl.read_csv(path, comment_prefix="#", infer_schema=False)
        columns = [table[name].str.strip_chars().cast(pl.Float64).to_list() for name in ("from_s", "to_s")]
    except (OSError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{where}: needs a CSV file with numbers in the columns from_s, to_s") from error
    columns.append(table["face"].fill_null("").to_list() if "face" in table.columns else [""] * len(table))
    return decisions_of({"rests": [list(row) for row in zip(*columns, strict=True)]}, where)


def cut_moves(moves: Moves) -> Bools:
    """Return the moves (M,) over which gravity turned farther than the gyros can have turned it."""
    before, after = (ends / np.linalg.norm(ends, axis=1)[:, None] for ends in (moves.before, moves.after))
    turned = np.arctan2(np.linalg.norm(np.cross(before, after), axis=1), np.einsum("ij,ij->i", before, after))
    return turned > 1.2 * moves.way.angle + CUT


def parted_at_cuts(record: Measured, gravity: float) -> Measured:
    """Return a record with gyros with a gap in its time stamps where it is cut: where gravity jumps and they do not.

    Each section is then checked as the whole record is.
    """
    if not isinstance(record, StrapdownRecord) or len(record) < FEWEST_ROWS:
        return record
    shift = once(_shift_at_cuts, record, gravity)
    return replace(record, time_s=once(np.add, record.time_s, shift)) if shift.any() else record


def _shift_at_cuts(record: StrapdownRecord, gravity: float) -> Floats:
    """Return the times (N,) that part sections at cuts [s]."""
    series = series_of(record, HandRequest(gravity=gravity))
    rests = once(still_rests, series, None)
    moves = moves_of(series, rests, record.knocks)
    shift = np.zeros(len(record))
    for first, last in moves.way.ends[cut_moves(moves)].tolist():
        steps = np.linalg.norm(np.diff(series.force[first : last + 1], axis=0), axis=1)
        if last - first < MOST_CUT / series.period:
            shift[first + 1 + int(np.argmax(steps)) :] += GAP
    return shift


def turns_in(
    record: StrapdownRecord | ForceRecord, series: TimedReadings, request: HandRequest, saturated: Bools
) -> Turns | None:
    """Return the known turns by the columns `turn` and `part`; None without them, or where turns are given in words.

    Turns over saturated rows (N,) are left out.
    """
    if request.turns or not isinstance(record, StrapdownRecord):
        return None
    words = record.turn
    if words is None and record.part is not None:
        words = tuple(part if part_of(part)[1] is not None else "" for part in record.part)
    if words is None:
        return None
    ends, known = [], []
    for first, stop in pairwise([0, *_changes(words).tolist(), len(words)]):
        turn = turn_of(words[first])
        if turn is not None and stop - first > 2 and not saturated[first:stop].any():
            ends.append((first, stop - 1))
            known.append(turn)
    if not ends:
        return None
    return _checked(record, Way(series, np.array(ends)), known)


def turns_told(record: HandRecord, moves: Moves, request: HandRequest) -> Turns | None:
    """Return the known turns among the moves, told in words in their order: 1:360, or 360 for every whole turn.

    Raises
    ------
    InputError
        for another number of turns than the record has, or a word that is not a turn
    """
    if not request.turns:
        return None
    vectors = moves.way.sums(moves.way.turn)
    angles = np.linalg.norm(vectors, axis=1)
    steady, axes = angles >= STEADY * moves.way.angle, np.argmax(np.abs(vectors), axis=1) + 1
    angle = _lone_angle(request.turns)
    if angle is not None:
        if not 0.0 < angle <= 36000.0:
            raise InputError(f"--turns {request.turns[0]}: an angle in degrees is needed, as 360")
        chosen = np.flatnonzero(steady & (angles >= 0.8 * np.radians(angle)) & (angles <= 1.25 * np.radians(angle)))
        if not len(chosen):
            raise InputError(f"--turns {request.turns[0]}: {record.path} has no move of about {exactly(angle)} degrees")
        known = [(axis, math.nan) for axis in axes[chosen].tolist()]
        return _checked(record, moves.way.those(chosen), known, angle)
    known = []
    for word in request.turns:
        try:
            turn = turn_of(word.strip())
        except ValueError as error:
            raise InputError(f"--turns {word}: {error}") from error
        if turn is not None:
            known.append(turn)
    sizes = [360.0 if math.isnan(angle) else abs(angle) for _, angle in known]
    chosen, number = [], 0
    for move in np.flatnonzero(steady).tolist():
        if number < len(known) and axes[move] == known[number][0] and angles[move] >= LEAST * np.radians(sizes[number]):
            chosen.append(move)
            number += 1
    if number < len(known):
        axis, _ = known[number]
        raise InputError(
            f"--turns {','.join(request.turns)}: {record.path} has no turn {number + 1} between two rests, about axis "
            f"{axis} by about {exactly(sizes[number])} degrees"
        )
    return _checked(record, moves.way.those(np.array(chosen)), known)


def _lone_angle(words: Sequence[str]) -> float | None:
    """Return the angle [deg] of a single word that is a number and no axis; None of other words."""
    if len(words) > 1 or words[0].strip() in ("1", "2", "3"):
        return None
    try:
        return abs(float(words[0]))
    except ValueError:
        return None


def _checked(record: HandRecord, way: Way, known: Sequence[tuple[int, float]], whole: float = 360.0) -> Turns:
    """Return known turns; raise an InputError for one that the gyros contradict."""
    angles = []
    rate = way.sums(way.turn)
    for number, (axis, angle) in enumerate(known):
        read = math.degrees(float(rate[number, axis - 1]))
        size = whole if math.isnan(angle) else abs(angle)
        wrong_sense = not math.isnan(angle) and read * angle < 0.0
        if wrong_sense or not HALF * size <= abs(read) <= size / HALF:
            wanted = size if math.isnan(angle) else angle
            raise InputError(
                f"{record.path}: turn {number + 1} about axis {axis} is {exactly(wanted)} degrees, and its gyro reads "
                f"{digits(read, 3)}; check the axis, the sense and the unit"
            )
        angles.append(math.radians(size))
    return Turns(way, np.array(angles))
