"""Rank the columns that may be accelerometers or gyros, and the units that these may have, by evidence.

The evidence is the parts of names, the size of gravity, the mean at rest, and usual ranges of converters. It only
orders the answers to a question: the user decides.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ...models.bench.rests import up
from ..records.columns import ANGLES, POSITION
from ..records.columns import FORCE as FORCES
from ..records.columns import VELOCITY as VELOCITIES
from .mapping import OPEN, Mapping
from .names import TIMES, normal
from .numbers import bits_of_signed, date_of
from .presets import presets
from .tables import TABLES
from .understanding import Field, UnderstoodTable
from .units import ANGLE, DEGREE, FORCE, RATE, TIME, VELOCITY, LaboratoryUnit, known_unit, scaled_unit

MEANING = {name: frozenset(words.split()) for name, words in TABLES["meaning"].items()}
"""Words of names by their meaning: of an instrument, of other quantities, of no channel, of no gravity."""
MOST_TRIADS = 3
"""Largest number of answers to a question about columns without names."""
MANY_ROWS = 200
"""Number of rows from which a table is likelier a series than a table of rests."""

LETTERS, DIGITS = ("x", "y", "z"), ("0", "1", "2", "3")
AXES = (LETTERS, DIGITS[1:], DIGITS[:3])
"""Axes of three columns, in order."""
NEAR = 0.25
"""Largest relative distance of the median |f| from gravity of a likely unit."""
RANGES = dict(TABLES["likely"]["ranges"])
"""Counts per g -> counts per deg/s of the range that usually goes with it (MPU and ICM series)."""
FASTEST = 35.0
"""Rate above which a number is more likely in deg/s than in rad/s."""
FASTEST_WHOLE, LARGEST_OF_16_BITS = 4000.0, 65535.0
"""Whole numbers of a gyro beyond the first are counts, not deg/s; beyond the second they have 32 bits."""
LARGEST_PLAIN = 60.0
"""Whole numbers beyond this are counts, not m/s² or g."""
EPOCHS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
"""Unit -> least time since an epoch of this century."""
STEPS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
USUAL_STEP = (2e-4, 0.5)
"""Usual steps of a series [s]."""
SLOW, STILL = 2.0, 0.3
"""Rate below which a number is likelier in rad/s than in deg/s, beside m/s² or if it varies by the second."""
ALIKE = 0.7
"""Correlation of the turns of gravity with rates from which they are the gyros."""
NEAR_TURN = 1.4
"""Largest factor between the turns of gravity and those of gyros in a likely unit."""
SHOWN = 4
"""Largest number of answers to a question about a unit."""
LARGEST = 1e100
"""Largest numbers that are compared: their squares are finite."""
FEWEST_VALUES = 3
"""Fewest different values of a column that may be a channel."""
SPREADS = (0.02, 0.1, 0.25)
"""Spread of |f| over a record, relative to its median: classes of columns without names, the steadiest first."""
EXACT, TURNED = 2e-6, 0.1
"""Relative spread of |f| below which three columns are an estimate, and the change of one of them that shows it."""
OFFSET_BITS = (10, 12, 14, 16, 18, 20, 24)
"""Bits of converters whose zero is in the middle of their range."""
STEADY = 0.15
"""Largest relative spread of |f| about the middle of the range that proves a zero there."""


@dataclass(frozen=True)
class Triad:
    """Three columns in the order of their axes, the quantity that their names mean, and the further words in them."""

    fields: tuple[Field, Field, Field]
    quantity: str = ""
    further: int = 0

    @property
    def numbered(self) -> bool:
        """True if all columns are some of several numbered ones, without words of a quantity beside a unit."""
        return all(field.head.numbered for field in self.fields)

    @property
    def answer(self) -> str:
        """The columns as an answer: their names, or numbers if names hold commas or are not unique."""
        names = [field.label for field in self.fields]
        if any("," in name or not name for name in names):
            names = [str(field.place + 1) for field in self.fields]
        return ",".join(names)


def named_triads(fields: Sequence[Field]) -> list[Triad]:
    """Return the groups of three columns whose names differ in their axis only, with the quantity of their words."""
    groups: dict[tuple[str, ...], dict[str, Field]] = {}
    for field in fields:
        words = normal(re.sub(r"[\[(](\w)[\])]", r" \1", field.head.name)).split()
        if len(words) == 1:
            # gx, gy, gz
            words = re.sub(r"^([a-z])([xyz])$", r"\1 \2", words[0]).split()
        axes = [word for word in words if word in LETTERS] or [word for word in words if word.isdecimal()]
        if len(axes) == 1:
            stem = tuple(word for word in words if word != axes[0])
            groups.setdefault(stem, {})[axes[0]] = field
    triads = []
    for stem, group in groups.items():
        for axes in AXES:
            if group.keys() == set(axes):
                first, second, third = (group[axis] for axis in axes)
                triads.append(Triad((first, second, third), _quantity_of(stem, first.quantity), len(stem)))
    return triads


def may_be_channel(table: UnderstoodTable, field: Field) -> bool:
    """Return True if a column may be a channel or an angle: of a long series, it varies and does not only rise."""
    words = normal(field.head.name).split()
    stems = {re.sub(r"[xyz]$", "", word) for word in words}
    is_other = stems.union(words) & MEANING["no_channel"] or (stems == {"m"} and stems.isdisjoint(words))
    if is_other or field.quantity in (TIME, "temperature"):
        return False
    if len(table.rows) < MANY_ROWS:
        return True
    is_date = field.texts and date_of(field.texts[0])
    return not is_date and len(set(field.texts)) >= FEWEST_VALUES and not rising(table, [field])


def is_without_gravity(field: Field) -> bool:
    """Return True if a name means acceleration without gravity: free, of the user, or linear in short."""
    words = normal(field.head.name).split()
    short = any(word.startswith("linacc") for word in words)
    return short or (not MEANING["no_gravity"].isdisjoint(words) and FORCE in quantities_of(words))


def is_derived(triad: Triad) -> bool:
    """Return True if the names of three columns mean something that is no reading of the instrument."""
    words = normal(triad.fields[0].head.name).split()
    return is_without_gravity(triad.fields[0]) or not MEANING["other"].isdisjoint(words)


def _quantity_of(stem: Sequence[str], of_unit: str) -> str:
    """Return the quantity that the words of a name mean, if its unit is not of another, or that of its unit."""
    if not MEANING["other"].isdisjoint(stem):
        return ""
    for quantity in quantities_of(stem):
        if of_unit in ("", quantity, "counts", "voltage"):
            return quantity
    return of_unit if of_unit in (FORCE, RATE) else ""


def quantities_of(words: Sequence[str]) -> list[str]:
    """Return the quantities of instruments that some words mean."""
    return [quantity for quantity in (FORCE, RATE) if not MEANING[quantity].isdisjoint(words)]


def unnamed_triads(table: UnderstoodTable, fields: Sequence[Field]) -> list[Triad]:
    """Return neighbouring columns of numbers without names, those that are likelier accelerometers first."""
    triads = []
    for three in zip(fields, islice(fields, 1, None), islice(fields, 2, None), strict=False):
        if three[2].place - three[0].place != 2:
            continue
        fewest = min(len(set(column)) for column in values_of(table, three).T.tolist())
        median, spread = size_of(table, three)
        if median > 0.0:
            steadiness = int(np.searchsorted(SPREADS, spread))
            rank = (fewest < FEWEST_VALUES, steadiness, not force_units(median), three[0].place)
            triads.append((rank, Triad(three)))
    return [triad for _, triad in sorted(triads, key=lambda entry: entry[0])]


def numbers_in(table: UnderstoodTable, fields: Sequence[Field]) -> Floats:
    """Return the numbers of some columns, in the rows that have all of them (N, columns); beyond `LARGEST` this."""
    rows = []
    for _, texts in table.rows:
        row = table.values(texts[field.place] for field in fields if field.place < len(texts))
        if len(row) == len(fields):
            rows.append(row)
    return np.clip(np.array(rows, dtype=np.float64).reshape(-1, len(fields)), -LARGEST, LARGEST)


def bits_of_offset(counts: Floats) -> int:
    """Return the bits of a converter whose zero is in the middle of its range, by counts (N, 3) at rest; 0 if none.

    All counts are within the middle 80 % of its range, and their distance from its middle is steady.
    """
    if not len(counts) or counts.min() <= 0.0 or (counts != np.round(counts)).any():
        return 0
    middle = 0.5 * float(counts.min() + counts.max())
    bits = min(OFFSET_BITS, key=lambda bits: abs(np.log(middle / 2.0 ** (bits - 1))))
    zero = 2.0 ** (bits - 1)
    size = np.linalg.norm(counts - zero, axis=1)
    median = float(np.median(size))
    is_steady = float(np.median(np.abs(size - median))) <= STEADY * median
    is_inside = bool((np.abs(counts - zero) < 0.8 * zero).all())
    if median > 0.0 and is_steady and is_inside:
        return bits
    return 0


def zero_of(integers: str) -> float:
    """Return the count of zero that an answer about integers means: 512 for "offset 10", 0 for others."""
    if not integers.startswith("offset"):
        return 0.0
    return 2.0 ** (int(integers.split()[1]) - 1)


def values_of(table: UnderstoodTable, fields: Sequence[Field]) -> Floats:
    """Return the numbers of some columns, in the rows that have all of them (N, columns); counts with their signs."""
    values, integers = numbers_in(table, fields), table.mapping.integers
    if integers == "unsigned" or not len(values):
        return values
    if len(fields) == 3:
        bits = bits_of_offset(values) if integers in ("", OPEN) else 0
        zero = zero_of(f"offset {bits}" if bits else integers)
        if zero and values.min() >= 0.0 and values.max() > 0.5 * zero:
            return values - zero
    for k in range(len(fields)):
        bits = bits_of_signed(values[:, k].tolist())
        if bits:
            values[:, k] -= 2.0**bits * (values[:, k] >= 2.0 ** (bits - 1))
    return values


def size_of(table: UnderstoodTable, fields: Sequence[Field]) -> tuple[float, float]:
    """Return the median of |f| in the file's unit, and the spread about it relative to it; 0 without numbers."""
    size = np.linalg.norm(values_of(table, fields), axis=1)
    median = float(np.median(size)) if len(size) else 0.0
    if median == 0.0:
        return 0.0, 0.0
    return median, float(np.median(np.abs(size - median))) / median


def median_size(table: UnderstoodTable, fields: Sequence[Field]) -> float:
    """Return the median of |f| in the file's unit; 0 if no row has three numbers."""
    return size_of(table, fields)[0]


def is_estimate_of_gravity(table: UnderstoodTable, triad: Triad) -> bool:
    """Return True if |f| of a long series is the same to the last digit although its direction changes."""
    values = values_of(table, triad.fields)
    median, spread = size_of(table, triad.fields)
    turns = len(values) >= MANY_ROWS and float(np.ptp(values, axis=0).max()) > TURNED * median
    return turns and spread < EXACT


def estimates_of_gravity(table: UnderstoodTable, fields: Sequence[Field]) -> set[Field]:
    """Return the columns x, y, z that are an estimate of gravity."""
    estimates = set[Field]()
    for triad in named_triads(fields):
        size = np.linalg.norm(values_of(table, triad.fields), axis=1)
        # gyros at rest may have one size in most rows
        if is_estimate_of_gravity(table, triad) and np.ptp(size) < 10.0 * EXACT * np.median(size):
            estimates.update(triad.fields)
    return estimates


def force_units(size: float) -> list[str]:
    """Return the units in which a median |f| is about 1 g, the nearest of the usual ones first."""
    near = []
    for rank, texts in enumerate((TABLES["likely"]["usual"], TABLES["likely"]["further"])):
        for text in texts:
            distance = abs(size * factor_of(text) / STANDARD_GRAVITY - 1.0)
            if distance <= NEAR:
                near.append((rank, distance, text))
    return [text for *_, text in sorted(near)]


def factor_of(text: str) -> float:
    """Return the size of a known unit in the record's unit."""
    unit = scaled_unit(text)
    assert unit is not None
    return unit.factor


SCALE_BESIDE = re.compile(r"\d[\d.]* ?(?:LSB|counts?|digits?) ?/ ?[^\s,;:]+|\d[\d.]* ?[^\W\d]+/(?:LSB|count|digit)\b")
"""A sensitivity in a line of text."""
ANGLE_UNITS = ("deg", "rad", "arcmin", "arcsec")
FOLLOWS, DIFFERS = 0.05, 0.3
"""Part of the readings that the vertical leaves in the right unit of angles at most, in any other at least."""
LARGEST_ANGLE = 1e9
"""Size of a number from which it is no reading or angle."""
FEWEST_POSITIONS = 12
"""Number of positions below which readings may follow the vertical by chance."""


def angle_unit(table: UnderstoodTable) -> str:
    """Return the unit of angles in which alone the readings of a position table follow the vertical; "" if none does.

    The readings may have any unit, and the block any mounting.
    """
    columns = [*ANGLES, *FORCES]
    if table.kind is not POSITION or not set(columns) <= table.origins.keys():
        return ""
    values = numbers_in(table, [table.origins[column].field for column in columns])
    if len(values) < FEWEST_POSITIONS or not (np.abs(values) < LARGEST_ANGLE).all():
        return ""
    readings = values[:, 2:] - values[:, 2:].mean(axis=0)
    size = float(np.linalg.norm(readings))
    if size == 0.0:
        return ""
    misfits = []
    for text in ANGLE_UNITS:
        vertical = up(*np.radians(factor_of(text) * values[:, :2].T))
        vertical -= vertical.mean(axis=0)
        left = readings - vertical @ np.linalg.lstsq(vertical, readings)[0]
        misfits.append((float(np.linalg.norm(left)) / size, text))
    (least, text), (second, _) = sorted(misfits)[:2]
    return text if least < FOLLOWS and second > DIFFERS else ""


def likely_units(
    table: UnderstoodTable, quantity: str, fields: Sequence[Field], usual: Sequence[str], stated: LaboratoryUnit | None
) -> list[str]:
    """Return units for a question, the likeliest first; `stated` is the unit of a converter that the file states."""
    likely = likely_of(table.mapping)
    first = _stated_scale(table, quantity, fields)
    first += [likely[quantity]] if quantity in likely else []
    if quantity == FORCE and len(fields) == 3:
        first = _force_answers(values_of(table, fields), first)
    elif quantity in (VELOCITY, ANGLE):
        first = _scales(table, quantity)
    elif quantity == TIME and fields and table.kind is not POSITION:
        first += time_units(table, fields[0])
    elif quantity == RATE and fields:
        first += _rate_units(table, fields)
    if stated is not None and stated.raw:
        first = [text for text in first if scaled_unit(text) and scaled_unit(text) != known_unit(text)]
    return list(dict.fromkeys([*first, *usual]))[:SHOWN]


def _stated_scale(table: UnderstoodTable, quantity: str, fields: Sequence[Field]) -> list[str]:
    """Return the only sensitivity in the lines around a table for its counts, as "131 LSB/(deg/s)"; else none."""
    values = numbers_in(table, fields) if fields else np.zeros(0)
    if (values != np.round(values)).any():
        return []
    units = {text: scaled_unit(text) for text in SCALE_BESIDE.findall(table.layout.lines_around)}
    texts = [text for text, unit in units.items() if unit is not None and unit.per and unit.quantity == quantity]
    return texts if len(texts) == 1 else []


def _force_answers(values: Floats, likely: list[str]) -> list[str]:
    """Return units of readings (N, 3) by the size of gravity; the layout's first where it agrees, counts as counts."""
    if not len(values):
        return likely
    size = float(np.median(np.linalg.norm(values, axis=1)))
    near = force_units(size)
    are_counts = bool((values == np.round(values)).all()) and float(np.abs(values).max()) > LARGEST_PLAIN
    if are_counts and not any("LSB" in text for text in near):
        near.insert(0, f"{round(size)} LSB/g")
    near.sort(key=lambda text: ("LSB" in text) != are_counts)
    agreed = [text for text in likely if abs(size * factor_of(text) / STANDARD_GRAVITY - 1.0) <= NEAR]
    return agreed + near + [text for text in likely if not near]


def _scales(table: UnderstoodTable, quantity: str) -> list[str]:
    """Return the sensitivities of a layout's increments, those of the instrument that gravity fits first."""
    preset = presets().get(table.mapping.preset)
    if preset is None or quantity not in preset.scales or not table.origins.keys() >= {*VELOCITIES, TIMES}:
        return []
    increments = values_of(table, [table.origins[column].field for column in VELOCITIES])
    times = values_of(table, [table.origins[TIMES].field])[:, 0]
    if len(times) < 2 or not len(increments):
        return []
    size = float(np.median(np.linalg.norm(increments, axis=1))) / max(float(np.median(np.diff(times))), 1e-6)
    distances = [
        abs(np.log(max(size * factor_of(text), 1e-12) / STANDARD_GRAVITY)) for text in preset.scales["velocity"]
    ]
    return [preset.scales[quantity][place] for place in np.argsort(distances, kind="stable")]


def time_units(table: UnderstoodTable, field: Field) -> list[str]:
    """Return units of a column of times, the likeliest first: by the size of an epoch, else by its steps."""
    values = np.array(table.values(field.texts[:200]))
    if len(values) < 2:
        return []
    step = float(np.median(np.abs(np.diff(values))))
    usual = [unit for unit, factor in STEPS.items() if USUAL_STEP[0] <= step * factor <= USUAL_STEP[1]]
    for unit, least in EPOCHS.items():
        if values.min() > least and (unit in usual or not usual):
            return [unit]
    return usual[:1]


def rising(table: UnderstoodTable, fields: Sequence[Field]) -> list[Field]:
    """Return the columns whose numbers rise from row to row: they may be times."""
    risen = []
    for field in fields:
        values = np.array(table.values(field.texts))
        if len(values) > 2 and len(values) == len(field.texts) and (values[1:] > values[:-1]).all():
            risen.append(field)
    return risen


def likely_of(mapping: Mapping) -> dict[str, str]:
    """Return the likely units of the layout that a mapping names."""
    preset = presets().get(mapping.preset)
    return preset.likely if preset else {}


def _rate_units(table: UnderstoodTable, fields: Sequence[Field]) -> list[str]:
    """Return units of rates: sensitivities for counts, by the range of the accelerometers; else by their size."""
    values = values_of(table, fields)
    if not values.size:
        return []
    largest = float(np.abs(values).max())
    whole = bool((values == np.round(values)).all()) and largest > 0.0
    forces = accelerometers_of(table)
    usual = [f"{number} LSB/(deg/s)" for number in RANGES.values()]
    by_turns = _unit_of_turns(_size_of_turns(table, forces, fields), whole=whole)
    if by_turns:
        return list(dict.fromkeys([by_turns, *(usual if whole else ("rad/s", "deg/s"))]))
    if whole and len(forces) == 3:
        size = median_size(table, forces)
        units = force_units(size)
        for unit in units:
            counts = re.match(r"(\d+) LSB", unit)
            if counts and float(counts[1]) in RANGES:
                return [f"{RANGES[float(counts[1])]} LSB/(deg/s)", *usual]
        if size > LARGEST_PLAIN and "mg" not in units:
            # beside counts
            return usual
    if whole and largest > FASTEST_WHOLE:
        return ["655360 LSB/(deg/s)", *usual] if largest > LARGEST_OF_16_BITS else usual
    # a moving sensor in deg/s reads more
    is_si = len(forces) == 3 and force_units(median_size(table, forces))[:1] == ["m/s2"]
    is_slow = largest < SLOW and (is_si or float(np.ptp(values, axis=0).max()) > STILL)
    wanders = float(np.abs(np.median(values, axis=0)).max())
    if largest < FASTEST and (is_slow or wanders < 0.03):
        return ["rad/s", "deg/s"]
    return ["deg/s", "rad/s"]


def turns_of(table: UnderstoodTable, forces: Sequence[Field], rates: Sequence[Field]) -> tuple[float, float]:
    """Return the turn of gravity over that of the rates [rad per row and unit], and their correlation; else 0."""
    force, rate = values_of(table, forces), values_of(table, rates)
    count = len(force)
    size = np.linalg.norm(force, axis=1, keepdims=True)
    if len(rate) != count or count < MANY_ROWS or not size.all():
        return 0.0, 0.0
    up = force / size
    against = np.cumsum(np.cross(up, rate), axis=0)
    # over some rows the noise of the accelerometers is small
    width = count // 20
    turned, expected = up[width:] - up[:-width], against[width:] - against[:-width]
    turned, expected = turned - turned.mean(axis=0), expected - expected.mean(axis=0)
    product, square = float(np.sum(turned * expected)), float(np.sum(expected**2))
    if square == 0.0:
        return 0.0, 0.0
    return abs(product) / square, abs(product) / math.sqrt(square * float(np.sum(turned**2)))


def _size_of_turns(table: UnderstoodTable, forces: Sequence[Field], rates: Sequence[Field]) -> float:
    """Return the size of a unit of rates in which they turn gravity as the accelerometers show [rad/s]; else 0."""
    time = table.origins.get(TIMES)
    if len(forces) != 3 or time is None:
        return 0.0
    units = [unit for unit in time_units(table, time.field) if time.unit is None]
    unit = time.unit or (scaled_unit(units[0]) if units else None)
    times = np.array(table.values(time.field.texts)) * (0.0 if unit is None else unit.factor)
    scale, correlation = turns_of(table, forces, rates)
    if len(times) < MANY_ROWS or correlation < ALIKE or not np.median(np.diff(times)) > 0.0:
        return 0.0
    return scale / float(np.median(np.diff(times)))


def _unit_of_turns(scale: float, *, whole: bool) -> str:
    """Return the usual unit of rates of a size [rad/s], or a sensitivity of counts; "" if there is none."""
    if not scale:
        return ""
    sizes = {"rad/s": 1.0, "deg/s": DEGREE}
    if whole:
        sizes |= {f"{counts} LSB/(deg/s)": DEGREE / float(counts) for counts in RANGES.values()}
    text, size = min(sizes.items(), key=lambda entry: abs(math.log(entry[1] / scale)))
    if abs(math.log(size / scale)) < math.log(NEAR_TURN):
        return text
    return f"{DEGREE / scale:.3g} LSB/(deg/s)" if whole else ""


def by_evidence(table: UnderstoodTable, quantity: str, fields: Sequence[Field], units: Sequence[str]) -> list[str]:
    """Return units in the order of their distance from what gravity or its turns show, unchanged without evidence."""
    scale = 0.0
    if quantity == FORCE and len(fields) == 3:
        scale = STANDARD_GRAVITY / max(median_size(table, fields), 1e-12)
    elif quantity == RATE and len(fields) == 3:
        scale = _size_of_turns(table, accelerometers_of(table), fields)
    if not scale:
        return list(units)
    return sorted(units, key=lambda text: abs(math.log(factor_of(text) / scale)))


def accelerometers_of(table: UnderstoodTable) -> list[Field]:
    """Return the columns of the accelerometers, those that are proposed where they are asked for."""
    forces = [table.origins[column].field for column in FORCES if column in table.origins]
    return forces or list(table.proposed.get(FORCE, ()))
