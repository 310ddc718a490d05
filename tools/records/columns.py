"""Columns of each kind of record, recognition of the kind by them, and conditions on their numbers.

Comment lines of a record, `# key: value`, are read and written here and nowhere else. Some keys hold facts that the
numbers cannot show, for instance after averages or conversions of units.
"""

import math
import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError
from ..rounding import digits, upwards

FORCE = ("f1_mps2", "f2_mps2", "f3_mps2")
RATE = ("w1_radps", "w2_radps", "w3_radps")
INCREMENT = ("dtheta1_rad", "dtheta2_rad", "dtheta3_rad")
VELOCITY = ("dv1_mps", "dv2_mps", "dv3_mps")
QUATERNION = ("q0", "q1", "q2", "q3")
ANGLES = ("alpha_deg", "beta_deg")
TEMPERATURE = "temperature_degC"
MOUNTING = "mounting"
FACE, TURN, PART = "face", "turn", "part"
"""Which axis of the case points up, which turn is made, or either of them by the name of a section."""
TEXTS = (MOUNTING, FACE, TURN, PART)
"""Columns of words; of a series all but the mounting may be empty."""
UP = ("up1", "up2", "up3")
"""The vertical in the axes of the case."""
APPROACH = ("approach_alpha", "approach_beta")

LIMITS = {
    "time_s": (-1e12, 1e12, "seconds are needed"),
    **dict.fromkeys(ANGLES, (-1e6, 1e6, "degrees are needed")),
    TEMPERATURE: (-273.15, 1e4, "degrees Celsius are needed"),
    **dict.fromkeys(RATE, (-1e5, 1e5, "radians per second are needed")),
    **dict.fromkeys(INCREMENT, (-1e3, 1e3, "radians per interval are needed")),
    **dict.fromkeys(VELOCITY, (-1e6, 1e6, "metres per second and interval are needed")),
}
"""No instrument's number lies beyond these; arithmetic with doubles would be too coarse there."""

MOST_LISTED, LISTED_OF_MANY = 20, 3
"""More values of a column outside its range than the first have one line together, after the second number of them."""
SHORTEST = 1e-9
"""Time from row to row [s]: a shorter one is none of an instrument, and its square may be zero."""
QUATERNION_NORM = 1e-3
"""Largest difference of the norm of a true attitude from 1."""
LARGEST_FORCE = 10.0 * STANDARD_GRAVITY
"""Readings beyond this are none of a block at rest or in a hand [m/s²]; in a series a single one is a knock."""
CORRUPT_FORCE = 1e5
"""No accelerometer reads more [m/s²]."""
RESOLUTION = {"resolution_mps2": "resolution", "resolution_deg": "angle", "resolution_degC": "temperature"}
"""Half a last digit of the written numbers, where these come from another file: key -> field of `Comments`."""
SCATTER = "scatter_mps2"
"""Standard error of a row's mean of each accelerometer, where several readings were averaged: three numbers."""
CORRECTED_BY = "corrected_by"
"""The effects that were subtracted from a record's readings, and the diagnosis or calibration that names them."""
CORRECTED_WITHIN = "corrected_within_mps2"
"""Largest error of the subtracted effects, in readings of each accelerometer: three numbers."""
COARSEST = 1e-2 * STANDARD_GRAVITY
"""Half a last digit that is larger is believed only where no two readings are nearer than that digit [m/s²]."""
AS_WRITTEN = 0.9
"""Part of a last digit that readings differ by at the least: a comment line gives half of it rounded up."""
ROUNDING_STEP = 1e-9
"""Readings that differ by less are the same one, converted [m/s²]."""
GRID = 0.02
"""The part of half a last digit that readings on a grid differ by at the least, as a rule, interpolated or not."""
UP_NORM = 1e-2
"""Largest difference of the norm of a known vertical from 1."""
_AXES = str.maketrans("xyz", "123")
_FACE = re.compile(r"([+-]?)\s*([123xyzXYZ])[ _]?([+\-pPaA]?)")
_TURN = re.compile(r"([123xyzXYZ])(?:\s*:\s*([+-]?\d+(?:\.\d+)?)|[ _]rot|)")
INERTIAL = ("attitude_reference", "inertial")
"""Key and value that say of a true attitude that it is against inertial space: Earth's rotation is in it."""
MOST_COMMENTS = 200
"""Lines that are kept."""
LONGEST_COMMENT = 400
"""Characters of a line that are kept."""
_LINE = re.compile(r"#+\s*([^:#][^:]{0,79}?)\s*:\s+(\S.*?)\s*")


@dataclass(frozen=True)
class Comments:
    """Key -> value of the comment lines, and the values of the record's own keys [m/s², deg, K], 0 or empty without."""

    about: Mapping[str, str] = field(default_factory=dict)
    resolution: float = 0.0
    angle: float = 0.0
    temperature: float = 0.0
    scatter: tuple[float, ...] = ()


def comments_of(lines: Iterable[tuple[int, str]]) -> tuple[Comments, tuple[int, str, str] | None]:
    """Read comment lines, given with their rows; also return row, key and error of the first own key that is wrong."""
    about: dict[str, str] = {}
    values: dict[str, float] = {}
    scatter: tuple[float, ...] = ()
    for row, line in lines:
        match = _LINE.fullmatch(line[:LONGEST_COMMENT])
        if match is None or len(about) >= MOST_COMMENTS:
            continue
        key, text = match[1], match[2]
        about.setdefault(key, text)
        if key not in (*RESOLUTION, SCATTER, CORRECTED_WITHIN):
            continue
        numbers = [_number(part) for part in text.split()]
        count = 3
        if key in RESOLUTION:
            count = 1
        if len(numbers) != count or not all(0.0 <= number < math.inf for number in numbers):
            needed = "a number"
            if count == 3:
                needed = "three numbers"
            return Comments(), (row, key, f"{text[:40]!r}: {needed} not below 0 must stand there")
        if key == SCATTER:
            scatter = tuple(numbers)
        elif key in RESOLUTION:
            values[RESOLUTION[key]] = numbers[0]
    return Comments(about, scatter=scatter, **values), None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def comment_lines(about: Mapping[str, str]) -> str:
    """Return keys and values as the first lines of a file; text that could not be read back becomes a remark."""
    lines = []
    for key, text in about.items():
        words = []
        for part in (key.replace(":", " "), text):
            words.append(" ".join(part.split()))
        key, text = words
        lines.append(f"# {key[:80] or 'remark'}: {text[: LONGEST_COMMENT - 90] or '-'}\n")
    return "".join(lines[:MOST_COMMENTS])


@dataclass(frozen=True)
class RecordKind:
    """A kind of record: its name, required and optional columns, and the largest number of rows read."""

    name: str
    required: tuple[str, ...]
    optional: tuple[str, ...]
    most_rows: int = 20_000_000

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that it may have."""
        return self.required + self.optional


_TIME = ("time_s",)
_TEMPERATURES = (TEMPERATURE,)
_PARTS = (FACE, TURN, PART)
POSITION = RecordKind(
    "position record", ("position", "time_s", *ANGLES, *FORCE), (TEMPERATURE, *APPROACH, MOUNTING), most_rows=100_000
)
RAW = RecordKind("raw record", _TIME + ANGLES + FORCE, _TEMPERATURES)
BENCH_RATES = RecordKind("bench record", _TIME + ANGLES + RATE + FORCE, _TEMPERATURES)
BENCH_INCREMENTS = RecordKind("bench record", _TIME + ANGLES + INCREMENT + FORCE, _TEMPERATURES)
BENCH = (BENCH_RATES, BENCH_INCREMENTS)
STRAPDOWN_RATES = RecordKind("strapdown record", _TIME + RATE + FORCE, QUATERNION + _TEMPERATURES + _PARTS)
STRAPDOWN_INCREMENTS = RecordKind("strapdown record", _TIME + INCREMENT + FORCE, QUATERNION + _TEMPERATURES + _PARTS)
STRAPDOWN_VELOCITIES = RecordKind("strapdown record", _TIME + INCREMENT + VELOCITY, FORCE + QUATERNION + _TEMPERATURES)
STRAPDOWN_KINDS = (POSITION, STRAPDOWN_VELOCITIES, STRAPDOWN_RATES, STRAPDOWN_INCREMENTS, RAW)
"""For a reader that wants gyros, and no angles of a table: the first whose required columns are all there."""

POSES = RecordKind("pose record", ("position", *FORCE), (*_TIME, TEMPERATURE, FACE, *UP), most_rows=100_000)
FORCES = RecordKind("accelerometer record", _TIME + FORCE, _TEMPERATURES + _PARTS)
FORCES_ALONE = (POSES, FORCES)
"""Kinds without gyros and without angles: a file with a column that may be one of those is none of them."""
KINDS = (POSITION, *BENCH, STRAPDOWN_VELOCITIES, STRAPDOWN_RATES, STRAPDOWN_INCREMENTS, RAW, *FORCES_ALONE)
"""Every kind, the most special first: the first whose required columns are all there is the record's."""
OF_OTHERS = (*RATE, *INCREMENT, *VELOCITY, *ANGLES, *APPROACH, *QUATERNION, MOUNTING)
"""Columns that a record of accelerometers alone has none of."""
LOOKS_LIKE_OTHERS = re.compile(r"gyr|omega|rate|angle|alpha|beta|theta|rad|quat", re.IGNORECASE)


class RecordError(InputError):
    """Error of an unusable record; `row` and `column` give the place, where known, `what` the reason."""

    def __init__(self, path: Path, row: int | None, column: str | None, what: str) -> None:
        place = []
        if row is not None:
            place = [f"row {row}"]
        place += [f"column {column}"] if column is not None else []
        super().__init__(f"{path}: {', '.join(place)}: {what}" if place else f"{path}: {what}")
        self.path, self.row, self.column, self.what = path, row, column, what


@dataclass(frozen=True)
class Layout:
    """Columns to read from a file: the record's kind, its columns that are present, and the others."""

    kind: RecordKind
    present: tuple[str, ...]
    extra: tuple[str, ...]

    @property
    def numbers(self) -> tuple[str, ...]:
        """The columns of numbers that are there."""
        return tuple(absent(self.present, TEXTS))


@dataclass(frozen=True, eq=False)
class FileColumns:
    """The columns of a file as read; NaN where an empty field is allowed (`q0..q3`, `up1..up3`).

    `resolution` is half a last digit of the specific forces [m/s²], `angle_resolution` of the angles [deg],
    `temperature_resolution` of the temperature [K].
    """

    path: Path
    layout: Layout
    numbers: dict[str, NDArray]
    texts: Mapping[str, tuple[str, ...]]
    row: NDArray
    resolution: float
    angle_resolution: float = 0.0
    temperature_resolution: float = 0.0
    comments: Comments = field(default_factory=Comments)

    def group(self, names: Sequence[str]) -> NDArray:
        """The named columns side by side, shape (N, len(names))."""
        return np.stack([self.numbers[name] for name in names], axis=1)

    def fault(self, index: int | np.integer, name: str, what: str) -> RecordError:
        """Return the fault of a column in one of the rows read."""
        return RecordError(self.path, int(self.row[index]), name, what)


def with_force(columns: FileColumns) -> FileColumns:
    """The columns with specific forces at the rows, where only increments of velocity are there.

    The mean over the two intervals beside a row; at the last row over the one before it.
    """
    if columns.layout.kind is not STRAPDOWN_VELOCITIES or FORCE[0] in columns.numbers:
        return columns
    time, velocity = columns.numbers["time_s"], columns.group(VELOCITY)
    usual = 1.0
    if len(time) > 1:
        usual = float(np.median(np.diff(time)))
    step = np.concatenate([[usual], np.diff(time)])
    # An invalid interval is a fault of the time, which has its own message.
    step[~(step >= SHORTEST)] = max(usual, SHORTEST)
    two, span = velocity[:-1] + velocity[1:], step[:-1] + step[1:]
    force = np.vstack([two / span[:, None], velocity[-1:] / step[-1]])
    layout = replace(columns.layout, present=(*columns.layout.present, *FORCE))
    numbers = columns.numbers | {name: force[:, axis] for axis, name in enumerate(FORCE)}
    return replace(columns, layout=layout, numbers=numbers)


def quoted(text: str) -> str:
    """Return a field or name for a one-line message: quoted, escaped, cut."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def recognise(path: Path, names: Sequence[str], row: int | None, kinds: Sequence[RecordKind] = KINDS) -> Layout:
    """Find the kind of a record by its columns, in the order of the file; the kinds in the order of preference.

    A RecordError, at the header's row, when a name is empty or repeated, or the columns are those of no kind.
    """
    if len(names) == 1:
        for mark, called in ((";", "semicolons"), ("\t", "tabs")):
            if mark in names[0]:
                raise RecordError(path, row, None, f"the fields are separated by {called}; use commas")
    for place, name in enumerate(names, 1):
        if not name:
            raise RecordError(path, row, None, f"field {place} of the header is empty; each column needs a name")
    repeated = []
    for name, count in Counter(names).items():
        if count > 1:
            repeated.append(name)
    if repeated:
        raise RecordError(path, row, None, f"column {quoted(repeated[0])} is there more than once; keep one")

    present = set(names)
    kind = next((kind for kind in kinds if present.issuperset(kind.required)), None)
    if kind is not None and kind in FORCES_ALONE and may_be_of_others(absent(names, kind.known)):
        kind = None
    of_position = not present.isdisjoint((*APPROACH, MOUNTING))
    if kind is RAW and (of_position or get_close_matches("position", names, n=1, cutoff=0.8)):
        raise RecordError(path, row, None, _what_is_missing(names, POSITION))
    if kind is None:
        # A file that lacks what gyros or angles need is not one of accelerometers alone.
        larger = [kind for kind in kinds if kind not in FORCES_ALONE]
        raise RecordError(path, row, None, _what_is_missing(names, min(larger, key=lambda k: _distance(names, k))))
    if present.issuperset(RATE + INCREMENT) and kind in (STRAPDOWN_RATES, STRAPDOWN_INCREMENTS, *BENCH):
        what = "rates (w1_radps..) and increments (dtheta1_rad..) are both there; keep one of them"
        raise RecordError(path, row, None, what)
    groups = {
        QUATERNION: "the attitude needs q0, q1, q2, q3",
        FORCE: "give f1_mps2..f3_mps2 or none of them",
        UP: "the vertical needs up1, up2, up3",
    }
    for group, advice in groups.items():
        missing = absent(group, present)
        if group[0] in kind.optional and 0 < len(missing) < len(group):
            raise RecordError(path, row, None, f"column '{missing[0]}' is missing: {advice}")
    columns = absent(kind.known, absent(kind.known, present))
    return Layout(kind, tuple(columns), tuple(absent(names, columns)))


def may_be_of_others(names: Sequence[str]) -> bool:
    """Return true if a column may be meant as one of gyros, angles or an attitude."""
    of_others = [name for name in names if LOOKS_LIKE_OTHERS.search(name)]
    return bool(of_others) or any(get_close_matches(name, OF_OTHERS, n=1, cutoff=0.7) for name in names)


def absent(names: Iterable[str], present: Container[str]) -> list[str]:
    """The names that are not among those present, in their order."""
    return [name for name in names if name not in present]


def _distance(names: Sequence[str], kind: RecordKind) -> tuple[int, int]:
    """Return the distance of columns from those of a kind: the number missing, and minus the number present."""
    columns = (set(kind.known) - {"time_s", *FORCE}) & set(names)
    return len(set(kind.required) - set(names)), -len(columns)


def _what_is_missing(names: Sequence[str], kind: RecordKind) -> str:
    missing = absent(kind.required, names)
    close = get_close_matches(missing[0], absent(names, kind.known), n=1, cutoff=0.6)
    hint = ""
    if close:
        hint = f" (is {quoted(close[0])} meant?)"
    verb = "column"
    if len(missing) > 1:
        verb = "columns"
    listed = ", ".join(f"'{name}'" for name in missing)
    return f"{verb} {listed} missing for a {kind.name}{hint}; it needs {','.join(kind.required)}"


def extra_warning(columns: FileColumns) -> tuple[str, ...]:
    """One line that names the columns left out, with the optional column that each may have meant."""
    layout = columns.layout
    if not layout.extra:
        return ()
    unused, lines = absent(layout.kind.optional, layout.present), []
    for name in layout.extra[:8]:
        close = get_close_matches(name, unused, n=1, cutoff=0.75)
        if close:
            line = f"{quoted(name)} (did you mean '{close[0]}'?)"
        else:
            line = quoted(name)
        lines.append(line)
    rest = len(layout.extra) - len(lines)
    rest_in_words = ""
    if rest:
        rest_in_words = f" and {rest} more"
    return (f"{columns.path}: not columns of a {layout.kind.name}, left out: {', '.join(lines)}{rest_in_words}",)


def warnings(columns: FileColumns) -> tuple[str, ...]:
    """Return warnings about numbers that have no faults."""
    lines = []
    if ANGLES[0] in columns.numbers and 0.0 < float(np.abs(columns.group(ANGLES)).max()) <= 2.0 * math.pi:
        lines.append(f"{columns.path}: columns {_all(ANGLES)}: all angles are within ±2π degrees; are they radians?")
    temperature = columns.numbers.get(TEMPERATURE)
    if temperature is not None and float(temperature.min()) >= 200.0:
        lines.append(f"{columns.path}: column {TEMPERATURE}: all above 200 °C; are they kelvins?")
    knocked = np.flatnonzero(knocks_of(columns.group(FORCE)))
    if knocked.size:
        size = float(np.linalg.norm(columns.group(FORCE)[knocked[0]]))
        lines.append(
            f"{columns.path}: |f| is above 10 times gravity in {_rows_from(columns, knocked)} "
            f"({digits(size)} m/s²): knocks; rests and moves with them are left out"
        )
    spoilt = np.flatnonzero(spoilt_attitudes(columns))
    if spoilt.size:
        lines.append(
            f"{columns.path}: q0..q3 are no attitude in {_rows_from(columns, spoilt)}: empty in part, or their norm is "
            f"not 1 within {QUATERNION_NORM:g}; the true attitude counts as not known there"
        )
    return tuple(lines)


def _rows_from(columns: FileColumns, index: NDArray) -> str:
    """Return the rows as text: their number, and the first of them."""
    first = int(columns.row[index[0]])
    if len(index) == 1:
        return f"row {first}"
    return f"{len(index)} rows, the first row {first}"


def least_step(values: NDArray) -> float:
    """Least distance of two values (N,) that differ by more than rounding; infinite where none do."""
    steps = np.diff(np.unique(values))
    return float(steps[steps > ROUNDING_STEP].min(initial=np.inf))


def fault_of_resolution(columns: FileColumns) -> RecordError | None:
    """Return the fault of a resolution in a comment line when all columns have readings that are written more finely.

    It is that of the column with the fewest digits.
    """
    resolution = columns.comments.resolution
    least, usual = [], []
    for name in FORCE:
        # the sums of huge numbers overflow
        values = np.clip(columns.numbers.get(name, np.zeros(0)), -1e9, 1e9)
        steps = np.abs(np.diff(values))
        if (steps > 0.0).any():
            least.append(least_step(values))
            usual.append(float(np.median(steps[steps > 0.0])))
    if not usual or resolution == 0.0:
        return None
    what = ""
    if resolution > COARSEST and max(least) < AS_WRITTEN * 2.0 * resolution:
        what = "all columns are written more finely than to {}"
    elif columns.layout.kind not in (POSITION, POSES) and max(usual) < GRID * resolution:
        # averages of readings on a grid are on none
        what = "readings that are written to {} do not differ by " + f"{digits(max(usual), 2)} m/s2 from row to row"
    if what:
        what = f"comment resolution_mps2: {what.format(f'{upwards(2.0 * resolution)} m/s2')}; correct that line"
        return RecordError(columns.path, None, None, what)
    return None


def faults(columns: FileColumns, *, any_times: bool = False) -> Iterator[RecordError]:
    """Every number out of its range, `position` or `time_s` that repeats or runs back, readings that are not specific
    forces in m/s², quaternions that are none. Where `any_times` holds, the times of a series are not looked at."""
    for name, (low, high, needed) in LIMITS.items():
        values = columns.numbers.get(name, np.zeros(0))
        outside = np.flatnonzero((values < low) | (values > high))
        listed = outside if len(outside) <= MOST_LISTED else outside[:LISTED_OF_MANY]
        for k in listed:
            yield columns.fault(k, name, f"{float(values[k])!r} is outside {low:g} to {high:g}; {needed}")
        if len(outside) > len(listed):
            what = f"{len(outside) - len(listed)} more values, to row {columns.row[outside[-1]]}, are outside; {needed}"
            yield columns.fault(outside[len(listed)], name, what)
    if "position" in columns.numbers:
        values = columns.numbers["position"]
        wrong = np.flatnonzero((values < 1) | (values != np.floor(values)) | (values > 2**53))
        for k in wrong:
            what = f"{float(values[k]):g} is not a positive integer; positions count from 1"
            yield columns.fault(k, "position", what)
        if not wrong.size:
            yield from _increasing(columns, "position")
    if "time_s" in columns.numbers and (not any_times or columns.layout.kind in (POSITION, POSES)):
        yield from _increasing(columns, "time_s", SHORTEST)
    for name in APPROACH:
        values = columns.numbers.get(name, np.zeros(0))
        for k in np.flatnonzero(np.abs(values) != 1.0):
            yield columns.fault(k, name, f"{float(values[k]):g} is neither +1 nor -1, the sense of the last move")
    resolution_fault = fault_of_resolution(columns)
    if resolution_fault is not None:
        yield resolution_fault
    yield from _forces(columns)
    if QUATERNION[0] in columns.numbers:
        yield from _quaternions(columns)
    if UP[0] in columns.numbers:
        up = columns.group(UP)
        known = np.isfinite(up).any(axis=1)
        for k in np.flatnonzero(known & ~(np.abs(np.linalg.norm(up, axis=1) - 1.0) <= UP_NORM)):
            yield columns.fault(
                k, _all(UP), f"is not a unit vector to {UP_NORM:g}; leave all three empty where unknown"
            )
    yield from _words(columns)


def _words(columns: FileColumns) -> Iterator[RecordError]:
    """Yield faults of faces and turns that are none."""
    readers = {FACE: face_of, TURN: turn_of, PART: part_of}
    for name, reader in readers.items():
        for k, text in enumerate(columns.texts.get(name, ())):
            try:
                reader(text)
            except ValueError as error:
                yield columns.fault(k, name, str(error))


def face_of(text: str) -> tuple[float, float, float] | None:
    """Return the vertical in the axes of the case by a face as +1, -X, y+ or z_a; None of an empty text.

    Of names of sections "p" is up and "a" is down. Raises a ValueError for another text.
    """
    if not text:
        return None
    match = _FACE.fullmatch(text)
    if match is None or (match[1] and match[3]):
        raise ValueError(f"{quoted(text)} is not a face; +1, -1, +2, -2, +3 or -3 is needed, the axis that points up")
    up = [0.0, 0.0, 0.0]
    sign = match[1] or match[3] or "+"
    up["123".index(match[2].lower().translate(_AXES))] = -1.0 if sign in ("-", "a", "A") else 1.0
    return up[0], up[1], up[2]


def turn_of(text: str) -> tuple[int, float] | None:
    """Return the axis of a known turn, from 1, and its angle [deg], NaN where only its size is 360; None of no text.

    1:360 is a turn about axis 1 by the right hand, 1 a whole turn about it in either sense. Raises a ValueError for
    another text.
    """
    if not text:
        return None
    match = _TURN.fullmatch(text)
    angle = math.nan
    if match is not None and match[2]:
        angle = float(match[2])
    if match is None or angle == 0.0:
        raise ValueError(f"{quoted(text)} is not a turn; 1:360 is needed, the axis and the angle in degrees")
    return int(match[1].lower().translate(_AXES)), angle


def part_of(text: str) -> tuple[tuple[float, float, float] | None, tuple[int, float] | None]:
    """Return the face and the turn that the name of a section says: one of them at most."""
    if _TURN.fullmatch(text) and not _FACE.fullmatch(text):
        return None, turn_of(text)
    if _FACE.fullmatch(text):
        return face_of(text), None
    return None, None


def _increasing(columns: FileColumns, name: str, least: float = 0.0) -> Iterator[RecordError]:
    """Yield faults where a column does not grow, or grows by less than `least`."""
    values = columns.numbers[name]
    for k in np.flatnonzero((values[1:] <= values[:-1]) | (values[1:] - values[:-1] < least)):
        before, value = float(values[k]), float(values[k + 1])
        verb = "repeats" if value == before else "runs back" if value < before else f"is less than {least:g} s later"
        hint = ""
        if name == "position":
            hint = " (a time series has no such column)"
        elif columns.layout.kind not in (POSITION, POSES):
            hint = "; rows that were sampled evenly are taken with --stamps RATE_HZ"
        what = f"{value:.17g} after {before:.17g} {verb}; it must grow from row to row{hint}"
        yield columns.fault(k + 1, name, what)


def knocks_of(force: NDArray) -> NDArray:
    """Rows (N,) of readings (N, 3) [m/s²] that are beyond 10 times gravity."""
    large = np.abs(force).max(axis=1, initial=0.0)
    # the squares of huge numbers overflow
    return (large > LARGEST_FORCE) | (np.linalg.norm(np.clip(force, -1e9, 1e9), axis=1) > LARGEST_FORCE)


def _forces(columns: FileColumns) -> Iterator[RecordError]:
    """Readings that are none, and the wrong unit; knocks are of a series, not of averaged readings."""
    force = columns.group(FORCE)
    averaged = columns.layout.kind in (POSITION, POSES)
    limit = LARGEST_FORCE if averaged else CORRUPT_FORCE
    # a component beyond the limit first: the squares of huge numbers overflow
    large = np.abs(force) > limit
    for index, axis in np.argwhere(large).tolist():
        what = "10 times gravity"
        if not averaged:
            what = f"{CORRUPT_FORCE:g} m/s2"
        yield columns.fault(index, FORCE[axis], f"{float(force[index, axis]):g} is above {what}; m/s2 are needed")
    if large.any():
        return
    norm = np.sqrt(np.einsum("ij,ij->i", force, force))
    if averaged:
        over = np.flatnonzero(norm > limit)
    else:
        over = np.zeros(0, dtype=int)
    for k in over:
        yield columns.fault(k, _all(FORCE), f"|f| = {norm[k]:g} is above 10 times gravity")
    median = float(np.median(norm)) / STANDARD_GRAVITY
    most = 1.5
    if RATE[0] in columns.numbers or INCREMENT[0] in columns.numbers:
        # vibration or a centrifuge: beside gyros the rests tell the unit (`motion.trust`)
        most = LARGEST_FORCE / STANDARD_GRAVITY
    if not over.size and not 0.5 <= median <= most:
        guess = ""
        if 0.5 <= median * STANDARD_GRAVITY <= 1.5:
            guess = " (readings in g?)"
        what = f"the median of |f| is {median:.4g} times gravity, where 0.5 to {most:g} is possible{guess}"
        yield RecordError(columns.path, None, _all(FORCE), f"{what}; m/s2 are needed")


def spoilt_attitudes(columns: FileColumns) -> NDArray:
    """Return rows (N,) with an invalid true attitude: empty in part, or of a norm that is not 1."""
    if QUATERNION[0] not in columns.numbers:
        return np.zeros(len(columns.row), dtype=bool)
    quaternion = columns.group(QUATERNION)
    # numbers that are far off are found without squaring them
    norm = np.sqrt(np.square(np.clip(quaternion, -2.0, 2.0)).sum(axis=1))
    return ~np.isnan(quaternion).all(axis=1) & ~(np.abs(norm - 1.0) <= QUATERNION_NORM)


def _quaternions(columns: FileColumns) -> Iterator[RecordError]:
    """Columns that are no true attitude: hardly a row of them is one."""
    spoilt = spoilt_attitudes(columns)
    present = ~np.isnan(columns.group(QUATERNION)).all(axis=1)
    if 2 * np.count_nonzero(spoilt) <= np.count_nonzero(present):
        return
    k = int(np.argmax(spoilt))
    quaternion = columns.group(QUATERNION)[k]
    if np.isnan(quaternion).any():
        name = QUATERNION[int(np.argmax(np.isnan(quaternion)))]
        yield columns.fault(k, name, "the field is empty; give all of q0..q3 or none of them")
        return
    norm = math.hypot(*quaternion.tolist())
    what = f"the norm of the attitude is {norm:.6g}; it must be 1 within {QUATERNION_NORM:g}"
    yield columns.fault(k, _all(QUATERNION), f"{what}, and is so in hardly a row")


def _all(names: tuple[str, ...]) -> str:
    if len(names) > 2:
        return f"{names[0]}..{names[-1]}"
    return ", ".join(names)
