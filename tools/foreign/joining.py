"""Choose the table of a file that holds several; join accelerometers and gyros of two files on their clocks."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import correlate, correlation_lags

from ...models.arrays import Bools, Floats
from ..errors import InputError, nearest
from ..records.columns import FORCE, RATE, STRAPDOWN_RATES, TEMPERATURE, RecordKind
from ..records.read import table_in_memory
from ..rounding import digits, upwards
from .array_reader import UNNAMED
from .containers import (
    Part,
    array_channels,
    channels_of,
    frame_of,
    joined_stamps,
    labelled_channels,
    parts_of,
    read_begin,
    table_channels,
)
from .conversion import Conversion
from .mapping import OPEN
from .names import TIMES, from_one, heading
from .presets import presets
from .ranking import named_triads
from .sheet import HeaderFacts, Sheet, cell
from .understanding import Field, UnderstoodTable

WHOLE = "(all)"
"""Name of the table of all columns of a file."""
GUESSES = ("numbers", "gyros", "accelerometers", "gyros and accelerometers")
"""Meanings of a table's columns by their names, by rank."""


@dataclass(frozen=True)
class TableInFile:
    """A table in a file: its name, its size, and the meaning of its columns by their names."""

    name: str
    rows: int
    columns: int
    guess: str

    def __str__(self) -> str:
        return f"{self.name or WHOLE}: {self.rows} rows, {self.columns} columns, {self.guess}"


def tables_in(file: Path) -> list[TableInFile]:
    """Return the tables of a file that holds several, those with gyros and accelerometers first."""
    parts = parts_of(file, read_begin(file))
    ranked = sorted(parts, key=lambda part: (-rank_of(part.names), part.name))
    return [TableInFile(part.name, part.rows, len(part.names), GUESSES[rank_of(part.names)]) for part in ranked]


def rank_of(names: tuple[str, ...]) -> int:
    """Return the index of the guess of what columns mean by their names."""
    heads = from_one([heading(name) for name in names])
    columns = {head.column for head in heads}
    for preset in presets().values():
        if preset.is_layout_of(names, ()):
            columns |= preset.columns.keys()
    fields = [Field(place, head, [], ()) for place, head in enumerate(heads)]
    quantities = {triad.quantity for triad in named_triads(fields)}
    has_force = columns >= set(FORCE) or "force" in quantities
    has_rate = columns >= set(RATE) or "rate" in quantities
    return 2 * has_force + has_rate


def sheet_of_part(file: Path, name: str) -> Sheet:
    """Return the table of a name, or the only one with the most instruments; the sheet names all others that may be.

    Raises InputError if there is no such table.
    """
    parts = parts_of(file, read_begin(file))
    if name:
        best = 0
        chosen = [part for part in parts if (part.name or WHOLE) == (name.strip("/") or WHOLE)]
        if not chosen:
            raise InputError(
                f"{file}: --from {name}: is not a table in it; {nearest(name, [part.name or WHOLE for part in parts])}"
            )
    else:
        best = max(rank_of(part.names) for part in parts)
        chosen = [part for part in parts if rank_of(part.names) == best]
    chosen.sort(key=lambda part: (not _has_time(part), not part.name, -part.rows, part.name))
    names = [part.name or WHOLE for part in chosen]
    gyros = (
        []
        if name or best != GUESSES.index("accelerometers")
        else [one.name for one in parts if rank_of(one.names) == 1]
    )
    pairs = [f"{one},{gyro}" for one in names for gyro in gyros if one.rpartition("/")[0] == gyro.rpartition("/")[0]]
    others = (*pairs, *names) if len(names) + len(pairs) > 1 else ()
    return _sheet(file, chosen[0], others)


def sheet_in_memory(source: object) -> Sheet:
    """Return a table in memory of any library as a sheet; an array without names has columns without names."""
    path = Path("table")
    if isinstance(source, np.ndarray) and source.dtype.names is None:
        channels = array_channels(source)
    elif hasattr(source, "dims") and hasattr(source, "coords"):
        channels = labelled_channels(source)
    else:
        channels = table_channels(table_in_memory(source))
    return _sheet(path, Part("", len(channels[0].values), (), partial(list, channels)), ())


def of_instance(sheet: Sheet, part: str) -> Sheet:
    """Return a text's rows of one sensor, as I=0: those whose column I holds 0; other rows are empty.

    Raises InputError if there is no such column or no such row.
    """
    name, _, value = part.partition("=")
    place, count = int(name) - 1 if name.isdecimal() else -1, 0

    def of_sensor(_: int, texts: list[str]) -> list[str]:
        nonlocal place, count
        if place < 0:
            place = texts.index(name) if name in texts else -1
            return texts
        if cell(texts, place).strip() != value:
            return []
        count += 1
        return texts

    rows = sheet.changed(of_sensor)
    if not count or sheet.whole is not None:
        raise InputError(f"{sheet.path}: --from {part}: there is no such row; give the column and its value, as I=0")
    return rows


def _has_time(part: Part) -> bool:
    return any(heading(name).column == TIMES for name in part.names)


def _sheet(file: Path, part: Part, others: tuple[str, ...]) -> Sheet:
    channels = joined_stamps(channels_of(file, part))
    likely = f"{part.rate:g} Hz" if part.rate else ""
    units = tuple(channel.unit for channel in channels)
    named = int(not all(channel.name.startswith(UNNAMED) for channel in channels))
    stated = HeaderFacts(
        header_row=named, first_row=named + 1, units=units, likely_rate=likely, parts=others, remark=part.remark
    )
    return Sheet(file, name=part.name, stated=stated, frame=frame_of(file, channels))


GYROS = RecordKind("gyro record", (TIMES, *RATE), (TEMPERATURE,))
"""Gyros alone: one of two files."""
ALIKE = 1e-6
"""Largest difference of stamps that are the same [steps]."""
LONGEST_LAG, LONGEST_START = 0.5, 30.0
"""Largest lag that is looked for [s]: on one clock, and where each file may count from its own start."""
LEAST_CORRELATION = 0.7
"""Correlation from which a lag is stated."""
LEAST_LAG = 0.1
"""Lag that shows two clocks [s]: estimates of hand-moved records err by less."""
LEAST_GAP = 5.0
"""Steps of the slower clock from which a gap is not bridged by interpolation."""
NEAR = 3
"""Steps about the largest correlation in which the lag is interpolated."""
SMOOTHED = 0.05
"""Time over which readings are averaged before a lag is estimated [s]."""

Side = tuple[UnderstoodTable, Conversion]


@dataclass(frozen=True)
class Instrument:
    """The accelerometers or gyros of one file, with their times on the common clock (N,) [s]."""

    table: UnderstoodTable
    conversion: Conversion
    columns: tuple[str, ...]
    word: str
    unit: str
    times: Floats

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.table.sheet.path.name

    @property
    def step(self) -> float:
        """Median step of the clock [s]."""
        return float(np.median(np.diff(self.times)))

    @property
    def counts_from_zero(self) -> bool:
        """True if the times begin at 0 s, as those of any clock that begins with its file."""
        return self.table.start == 0 and abs(float(self.conversion.numbers[TIMES][0])) < 0.5 * self.step

    def at(self, times: Floats) -> dict[str, Floats]:
        """Return the channels, interpolated linearly to other times (M,) [s]."""
        return {column: np.interp(times, self.times, self.conversion.numbers[column]) for column in self.columns}


def joined(forces: Side, rates: Side) -> Side:
    """Return one table of both files, on the faster clock; the slower readings are interpolated linearly.

    Asks whether the clocks are the same if both begin at 0 s and the record shows a lag between them.

    Raises InputError if the clocks have less than three rows in common.
    """
    table, answer = forces[0], forces[0].mapping.lag
    is_open = answer in ("", OPEN)
    lag = 0.0 if is_open else float(answer)
    shift = float(rates[0].start - table.start) - lag
    force = Instrument(*forces, FORCE, "accelerometers", "m/s²", forces[1].numbers[TIMES])
    rate = Instrument(*rates, RATE, "gyros", "rad/s", rates[1].numbers[TIMES] + shift)
    fast, slow = (rate, force) if rate.step < force.step * (1.0 - ALIKE) else (force, rate)
    inside = _common_rows(fast, slow)
    times = fast.times[inside]
    numbers = {TIMES: times, **force.at(times), **rate.at(times)}
    notes = [*table.notes, *rates[0].notes]
    place = np.interp(times, slow.times, np.arange(len(slow.times)))
    are_same = bool(np.abs(place - np.round(place)).max() < ALIKE)
    if are_same:
        notes.append("both files have the same times")
    else:
        second = np.diff([slow.conversion.numbers[column] for column in slow.columns], 2)
        within = f"within {upwards(float(np.abs(second).max(initial=0.0)) / 8.0)} {slow.unit}"
        how = f"are interpolated linearly to the times of {fast.file}, {within}"
        notes.append(f"the {slow.word} {how}, an eighth of the largest second difference")
    if lag:
        notes.append(f"{digits(abs(lag), 4)} s {'taken from' if lag > 0.0 else 'added to'} the times of the gyros")
    notes.append(_lag_note(force, rate, numbers, is_open=is_open))
    if table.start != 0:
        numbers[TIMES] = times - times[0]
    names = (field.head.text for field in rates[0].free_fields)
    notes += [f"left out of {rate.file}: column {name!r}" for name in names if name]
    if not inside.all():
        notes.append(f"{np.count_nonzero(~inside)} rows of {fast.file} are outside the times of {slow.file}")
    table.kind, table.notes = STRAPDOWN_RATES, []
    table.origins |= {column: origin for column, origin in rates[0].origins.items() if column in RATE}
    resolution = {} if slow is force and not are_same else force.conversion.resolution
    left_out = {**force.conversion.left_out, **rate.conversion.left_out}
    rows = fast.conversion.row[inside]
    return table, Conversion(numbers, {}, rows, left_out, resolution, notes=list(dict.fromkeys(notes)))


def _common_rows(fast: Instrument, slow: Instrument) -> Bools:
    """Return a mask of the rows of the faster clock between two readings of the slower one.

    Raises InputError if a clock runs backwards, or if they have no time in common.
    """
    for side in (fast, slow):
        back = np.flatnonzero(np.diff(side.times) <= 0.0)
        if len(back):
            raise InputError(f"{side.table.sheet.path}: row {back[0] + 1} of its data: the time does not increase")
    edge = ALIKE * slow.step
    inside = (fast.times >= slow.times[0] - edge) & (fast.times <= slow.times[-1] + edge)
    after = np.clip(np.searchsorted(slow.times, fast.times), 1, len(slow.times) - 1)
    inside &= slow.times[after] - slow.times[after - 1] <= LEAST_GAP * slow.step
    if np.count_nonzero(inside) < 3:
        spans = [f"{side.file} from {side.times[0]:.6g} to {side.times[-1]:.6g} s" for side in (fast, slow)]
        raise InputError(f"{fast.table.sheet.path}: no times in common: {', '.join(spans)}; give files of one clock")
    return inside


def _lag_note(force: Instrument, rate: Instrument, numbers: dict[str, Floats], *, is_open: bool) -> str:
    """Return what turns of gravity show of the clocks; ask for the lag where it shows two that begin at 0 s."""
    is_doubtful = is_open and force.counts_from_zero and rate.counts_from_zero
    lag, correlation = lag_of(numbers, LONGEST_START if is_doubtful else LONGEST_LAG)
    not_certain = "; both files begin at 0 s: that they have one clock is not certain" if is_doubtful else ""
    if correlation < LEAST_CORRELATION:
        return f"the lag between the files is unknown: the motion turns gravity too little{not_certain}"
    behind = "behind" if lag >= 0.0 else "ahead of"
    measured = f"the gyros are {digits(abs(lag), 2)} s {behind} the accelerometers"
    if is_doubtful and abs(lag) > max(LEAST_LAG, force.step, rate.step):
        why = f"both files begin at 0 s, but {measured}: the lag to remove, or 0 if they have one clock"
        force.table.ask("lag", (f"{lag:.4g}", "0"), why)
    return f"{measured} (correlation {digits(correlation, 2)}); not corrected{not_certain}"


def lag_of(numbers: dict[str, Floats], longest: float) -> tuple[float, float]:
    """Return the lag [s] of the gyros behind the accelerometers, and the correlation of the turns of gravity there.

    The lag is at most `longest` [s] and a quarter of the record; both are 0 for a record that is too short.
    """
    time = numbers[TIMES]
    step = float(np.median(np.diff(time)))
    count = int((time[-1] - time[0]) / step)
    most = min(round(longest / step), count // 4)
    if most <= 2 * NEAR or count > 5_000_000:
        return 0.0, 0.0
    grid = time[0] + step * np.arange(count)
    width = max(int(SMOOTHED / step), 1)
    force, rate = (
        uniform_filter1d(np.stack([np.interp(grid, time, numbers[name]) for name in names], axis=1), width, axis=0)
        for names in (FORCE, RATE)
    )
    up = force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-9)
    # gravity turns against the block
    turning = np.linalg.norm(np.gradient(up, step, axis=0), axis=1)
    expected = np.linalg.norm(np.cross(rate, up), axis=1)
    if not turning.std() > 0.0 or not expected.std() > 0.0:
        return 0.0, 0.0
    lags = correlation_lags(count, count)
    sums = correlate(expected - expected.mean(), turning - turning.mean(), method="fft") / (count - np.abs(lags))
    near = np.abs(lags) <= most
    middle = int(lags[near][np.argmax(sums[near])])
    # about the largest one, the same rows of the accelerometers against shifted rows of the gyros
    shifts = np.arange(middle - NEAR, middle + NEAR + 1)
    margin = abs(middle) + NEAR
    fixed = turning[margin : count - margin]
    scores = [np.corrcoef(fixed, expected[margin + shift : count - margin + shift])[0, 1] for shift in shifts]
    best = int(np.argmax(scores[1:-1])) + 1
    left, top, right = scores[best - 1 : best + 2]
    curvature = min(left - 2.0 * top + right, -1e-12)
    return (float(shifts[best]) + 0.5 * (left - right) / curvature) * step, float(top)
