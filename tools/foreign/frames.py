"""Read the columns of numbers of a file at once, in its units: of a large text, or of a file of columns."""

from collections import Counter
from decimal import Decimal
from pathlib import Path

import numpy as np
import polars as pl

from ...models.arrays import Floats, Ints
from ..records.columns import (
    QUATERNION,
    TEXTS,
    UP,
)
from .converted_times import EPOCH
from .mapping import OPEN
from .names import DATE, TIMES
from .sheet import SEPARATORS
from .understanding import NUMBER, UnderstoodTable

MOST_LEFT_OUT = 0.2
"""Share of the rows that may lack a number before the user is asked about them."""
MAY_LACK = (*QUATERNION, *UP, *TEXTS[1:])
"""Columns whose fields may be empty."""


def ask_of_gaps(table: UnderstoodTable, empty: Counter[str], left_out: int, count: int) -> bool:
    """Ask about rows without a number if they are many of all, by the column that lacks most; return True if asked."""
    if left_out <= MOST_LEFT_OUT * count or table.mapping.incomplete not in ("", OPEN):
        return False
    worst, lacking = empty.most_common(1)[0]
    why = f"{lacking} of {count} rows have no number in {table.origins[worst].name!r}"
    if worst in (*table.kind.optional, DATE):
        table.ask(f"columns.{worst}", ("none",), f"{why}; --set 'incomplete=leave out' leaves out the rows")
    else:
        table.ask("incomplete", ("leave out",), why)
    return True


def numeric_frame(table: UnderstoodTable) -> pl.DataFrame | None:
    """Return the columns of a file that holds numbers; None where some column of the record is a text."""
    frame = table.sheet.frame if table.whole is None else table.whole
    if frame is None:
        return None
    for column, origin in table.origins.items():
        kinds = [frame.dtypes[part.place].is_numeric() for part in (origin.field, *origin.beside)]
        if not all(kinds) or origin.beside or origin.form != NUMBER or column in (*TEXTS, DATE):
            return None
    return frame


def with_whole_text(table: UnderstoodTable) -> bool:
    """Read the columns of a large text as numbers; return False where they are none, or not written plainly."""
    sheet, source = table.sheet, table.sheet.whole
    is_plain = sheet.separator != "blanks" and not table.thousands and not table.mapping.missing
    if source is None or not is_plain or table.layout.last or sheet.cells is not None:
        return False
    for column, origin in table.origins.items():
        if origin.form != NUMBER or origin.beside or column in (*TEXTS, DATE):
            return False
    try:
        table.whole = _whole_text(table, source)
    except pl.exceptions.PolarsError:
        return False
    return True


def _whole_text(table: UnderstoodTable, source: Path | bytes) -> pl.DataFrame:
    """Return the columns of a large text as numbers; those that the record does not use are empty."""
    sheet = table.sheet
    schema: dict[str, type[pl.DataType]] = {str(field.place): pl.String for field in table.fields}
    for column, origin in table.origins.items():
        whole = column == TIMES and all(text.lstrip("+-").isdigit() for text in origin.field.texts)
        schema[str(origin.field.place)] = pl.Int64 if whole else pl.Float64
    used = [field.place for field in table.fields if schema[str(field.place)] != pl.String]
    frame = pl.read_csv(
        source,
        has_header=False,
        skip_rows=table.layout.first - 1,
        separator=SEPARATORS[sheet.separator],
        schema=schema,
        columns=used,
        decimal_comma=table.decimal == ",",
        null_values=["", "NaN", "nan", "NA", "N/A", "n/a", "-"],
    )
    missing = [pl.lit(None, pl.Float64).alias(name) for name in schema if name not in frame.columns]
    return frame.with_columns(missing).select(list(schema))


def values_of_frame(
    table: UnderstoodTable, frame: pl.DataFrame
) -> tuple[dict[str, Floats], Ints, dict[str, list[int]]]:
    """Return the numbers of columns (N,), the lines of their rows, and the lines left out, which lack a number."""
    columns = {column: frame[frame.columns[origin.field.place]] for column, origin in table.origins.items()}
    complete = np.ones(len(frame), dtype=bool)
    lacking: Counter[str] = Counter()
    for column, series in columns.items():
        if column not in MAY_LACK and (series.null_count() or series.dtype.is_float()):
            present = (series.is_not_null() & series.cast(pl.Float64).is_finite().fill_null(value=False)).to_numpy()
            lacking[column] = int(np.count_nonzero(~present))
            complete &= present
    lines = np.arange(table.layout.first, table.layout.first + len(frame))
    left_out = {}
    if not complete.all():
        left_out["a number is missing"] = lines[~complete].tolist()
    if ask_of_gaps(table, lacking, int(np.count_nonzero(~complete)), len(frame)):
        return {}, lines[:0], left_out
    values = {}
    for column, series in columns.items():
        present = series if complete.all() else series.filter(pl.Series(complete))
        unit = table.origins[column].unit
        if column == TIMES and unit is not None and len(present):
            first = present[0]
            if abs(float(first) * unit.factor) > EPOCH or abs(float(present[-1]) * unit.factor) > EPOCH:
                # whole numbers of 64 bits subtract without loss
                table.start = Decimal(repr(first)) * Decimal(repr(unit.factor))
                present = (present.cast(pl.Int64) if present.dtype.is_integer() else present) - first
                table.notes.append("times count from the first row")
        values[column] = present.cast(pl.Float64).to_numpy()
    return values, lines if complete.all() else lines[complete], left_out
