"""The lines of a record for a screen: extremes of each channel in steps of time."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...models.arrays import Floats
from ..records import RawRecord, StrapdownRecord
from ..records.columns import ANGLES

GROUPS = (
    ("Accelerometers", "specific_force", ("f1", "f2", "f3"), "m/s²", 1.0),
    ("Gyros", "rate", ("w1", "w2", "w3"), "deg/s", np.degrees(1.0)),
    ("Gyro increments", "increment", ("dθ1", "dθ2", "dθ3"), "arcsec", np.degrees(3600.0)),
    ("Table", "alpha", ("α",), "deg", np.degrees(1.0)),
    ("Table", "beta", ("β",), "deg", np.degrees(1.0)),
    ("Temperature", "temperature", ("T",), "°C", 1.0),
)
"""Panel, field of a record, names, unit, and factor from the field's unit."""
DRAWN = {field for _, field, *_ in GROUPS}
MOST_POINTS = 4000
FEWEST = 100
"""Fewer rows are read whole at once."""


@dataclass(frozen=True, eq=False)
class SeriesChannels:
    """Channels of a series.

    Attributes
    ----------
    time_s : (N,) array
        [s]
    fields : mapping of str to array or None
        field of a record -> its values, (N,) or (N, 3)
    """

    time_s: Floats
    fields: Mapping[str, Floats | None]


def channels_of_file(path: Path) -> SeriesChannels | None:
    """Return the channels of a series in a file as they stand, unchecked, for a first picture; None of another file."""
    try:
        table = pl.read_csv(path, comment_prefix="#", schema_overrides={"time_s": pl.Float64})
        if "time_s" not in table.columns or table.height < FEWEST:
            return None
        time_s = table["time_s"].to_numpy()
        fields = {}
        for kind in (RawRecord, StrapdownRecord):
            for name, columns in kind.groups.items():
                if name in DRAWN and set(columns) <= set(table.columns):
                    values = table.select(pl.col(columns).cast(pl.Float64)).to_numpy()
                    fields[name] = np.radians(values) if columns[0] in ANGLES else values
    except (OSError, pl.exceptions.PolarsError):
        return None
    is_series = "specific_force" in fields and bool(np.all(np.diff(time_s) > 0.0))
    return SeriesChannels(time_s, fields) if is_series else None


def lines_of(series: SeriesChannels, begin: float | None, end: float | None, points: int) -> dict[str, Any]:
    """Return the channels of a series between two times, as plain values.

    Parameters
    ----------
    series : SeriesChannels
    begin, end : float, optional
        [s]; without these all of it
    points : int
        steps of time; of more rows each step gives the least and the largest value

    Returns
    -------
    dict
        "time" of the steps, and "panels", each with "title", "unit" and "lines" of "name", "low" and "high"
    """
    time_s = series.time_s
    if begin is None or end is None:
        begin, end = float(time_s[0]), float(time_s[-1])
    first, stop = np.searchsorted(time_s, [begin, end])
    first, stop = max(0, int(first) - 1), min(len(time_s), int(stop) + 1)
    edges = steps_of(stop - first, min(max(points, 10), MOST_POINTS)) + first
    panels: dict[str, dict[str, Any]] = {}
    for title, field, names, unit, factor in GROUPS:
        values = series.fields.get(field)
        if values is None:
            continue
        panel = panels.setdefault(title, {"title": title, "unit": unit, "lines": []})
        columns = values[:stop].reshape(stop, -1)
        for axis, name in enumerate(names):
            low, high = extremes(columns[:, axis], edges)
            panel["lines"].append({"name": name, "low": plain(factor * low), "high": plain(factor * high)})
    return {
        "time": plain(time_s[edges], 12),
        "from_s": float(time_s[0]),
        "to_s": float(time_s[-1]),
        "panels": list(panels.values()),
    }


def steps_of(count: int, points: int) -> NDArray[np.int64]:
    """Return the first row of each step; a step is one row where there are few."""
    if count <= 2 * points:
        return np.arange(count)
    return np.unique(np.linspace(0, count, points, endpoint=False).astype(np.int64))


def extremes(values: Floats, edges: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the least and the largest value of each step, shapes (K,); the last step ends with the values."""
    return np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)


def plain(values: Floats, figures: int = 6) -> list[float | None]:
    """Return numbers of JSON, rounded to a number of digits; None for missing ones."""
    numbers: list[float | None] = []
    for value in values.tolist():
        numbers.append(float(f"{value:.{figures}g}") if np.isfinite(value) else None)
    return numbers
