"""What the numbers of a record must fulfil before anything is computed from them."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...fmus.units import STANDARD_GRAVITY
from .columns import (
    ANGLES,
    APPROACH,
    FORCE,
    INCREMENT,
    QUATERNION,
    RATE,
    TEMPERATURE,
    Columns,
    RecordError,
    refusal,
)

LIMITS = {
    "time_s": (-1e12, 1e12, "seconds are needed"),
    **dict.fromkeys(ANGLES, (-1e6, 1e6, "degrees are needed")),
    TEMPERATURE: (-273.15, 1e4, "degrees Celsius are needed"),
    **dict.fromkeys(RATE, (-1e5, 1e5, "radians per second are needed")),
    **dict.fromkeys(INCREMENT, (-1e3, 1e3, "radians per interval are needed")),
}
"""Beyond these no instrument's number lies, and arithmetic with doubles would lose what is asked of it."""

QUATERNION_NORM = 1e-3
"""How far the norm of a true attitude may be from 1."""


def checked(columns: Columns) -> tuple[str, ...]:
    """Check the columns of a record; give the warnings.

    Raises
    ------
    InputError
        for the first of `faults`; file, row and column are named
    """
    for fault in faults(columns):
        raise fault
    return warnings(columns)


def warnings(columns: Columns) -> tuple[str, ...]:
    """What a person should be told of columns that have no faults."""
    return (*_angle_warning(columns.path, columns), *_temperature_warning(columns))


def faults(columns: Columns) -> Iterator[RecordError]:
    """Every number out of its range, `position` or `time_s` that repeats or runs back, readings that are not specific
    forces in m/s², quaternions that are none."""
    for name, (low, high, needed) in LIMITS.items():
        values = columns.optional(name)
        if values is None:
            continue
        for k in np.flatnonzero((values < low) | (values > high)):
            yield _wrong(columns, k, name, f"{float(values[k])!r} is outside {low:g} to {high:g}; {needed}")
    if "position" in columns.numbers:
        yield from _positions(columns)
    yield from _increasing(columns, "time_s")
    for name in APPROACH:
        values = columns.optional(name)
        if values is None:
            continue
        for k in np.flatnonzero(np.abs(values) != 1.0):
            yield _wrong(columns, k, name, f"{float(values[k]):g} is neither +1 nor -1, the sense of the last move")
    yield from _forces(columns)
    if QUATERNION[0] in columns.numbers:
        yield from _quaternions(columns)


def _wrong(columns: Columns, index: int | np.integer, name: str, what: str) -> RecordError:
    return refusal(columns.path, int(columns.row[index]), name, what)


def _positions(columns: Columns) -> Iterator[RecordError]:
    values = columns.numbers["position"]
    wrong = np.flatnonzero((values < 1) | (values != np.floor(values)) | (values > 2**53))
    for k in wrong:
        what = f"{float(values[k]):g} is not a positive integer; positions count from 1"
        yield _wrong(columns, k, "position", what)
    if not wrong.size:
        yield from _increasing(columns, "position")


def _increasing(columns: Columns, name: str) -> Iterator[RecordError]:
    values = columns.numbers[name]
    for k in np.flatnonzero(values[1:] <= values[:-1]):
        before, value = float(values[k]), float(values[k + 1])
        verb = "repeats" if value == before else "runs back"
        hint = " (a time series has no such column)" if name == "position" else ""
        what = f"{value:.17g} after {before:.17g} {verb}; it must grow from row to row{hint}"
        yield _wrong(columns, k + 1, name, what)


def _forces(columns: Columns) -> Iterator[RecordError]:
    force = columns.group(FORCE)
    limit = 10.0 * STANDARD_GRAVITY
    # a component beyond the limit first: the squares of huge numbers overflow
    large = np.abs(force) > limit
    for index, axis in np.argwhere(large).tolist():
        what = f"{float(force[index, axis]):g} is above 10 times gravity; m/s2 are needed"
        yield _wrong(columns, index, FORCE[axis], what)
    if large.any():
        return
    norm = np.sqrt(np.einsum("ij,ij->i", force, force))
    over = np.flatnonzero(norm > limit)
    for k in over:
        yield _wrong(columns, k, _all(FORCE), f"|f| = {norm[k]:g} is above 10 times gravity")
    median = float(np.median(norm)) / STANDARD_GRAVITY
    if not over.size and not 0.5 <= median <= 1.5:
        guess = " (readings in g?)" if 0.5 <= median * STANDARD_GRAVITY <= 1.5 else ""
        what = f"the median of |f| is {median:.4g} times gravity, where 0.5 to 1.5 is possible{guess}"
        yield refusal(columns.path, None, _all(FORCE), f"{what}; m/s2 are needed")


def _quaternions(columns: Columns) -> Iterator[RecordError]:
    quaternion = columns.group(QUATERNION)
    empty = np.isnan(quaternion)
    partly = empty.any(axis=1) & ~empty.all(axis=1)
    for k in np.flatnonzero(partly):
        name = QUATERNION[int(np.argmax(empty[k]))]
        yield _wrong(columns, k, name, "the field is empty; give all of q0..q3 or none of them")
    known = np.flatnonzero(~empty.any(axis=1))
    scale = np.abs(quaternion[known]).max(axis=1, initial=0.0)
    # numbers that are far off are found without squaring them
    norm = np.where(scale > 2.0, scale, np.sqrt(np.square(np.clip(quaternion[known], -2.0, 2.0)).sum(axis=1)))
    for k in np.flatnonzero(np.abs(norm - 1.0) > QUATERNION_NORM):
        what = f"the norm of the attitude is {norm[k]:.6g}; it must be 1 within {QUATERNION_NORM:g}"
        yield _wrong(columns, int(known[k]), _all(QUATERNION), what)


def _angle_warning(path: Path, columns: Columns) -> tuple[str, ...]:
    if ANGLES[0] not in columns.numbers:
        return ()
    largest = float(np.abs(columns.group(ANGLES)).max())
    if not 0.0 < largest <= 2.0 * math.pi:
        return ()
    return (f"{path}: columns {_all(ANGLES)}: all angles are within ±2π degrees; are they radians?",)


def _temperature_warning(columns: Columns) -> tuple[str, ...]:
    values = columns.optional(TEMPERATURE)
    if values is None or float(values.min()) < 200.0:
        return ()
    return (f"{columns.path}: column {TEMPERATURE}: all above 200 °C; are they kelvins?",)


def _all(names: tuple[str, ...]) -> str:
    return f"{names[0]}..{names[-1]}" if len(names) > 2 else ", ".join(names)
