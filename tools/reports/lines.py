"""The page of a table of columns: numbers as lines over time, a picture for each unit."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import polars as pl

from ...fmus.units import UNITS, column_units
from ..comparison import Compared
from ..document.blocks import Page, Section, Table, table_of
from ..document.notation import Cell, plain, short, unit_text
from ..document.page import write_page
from ..orchestrator import Simulation
from ..orchestrator.interface import suffix_for
from ..rounding import digits
from .pictures.records import MOST_LINES, TRUTH, DrawnLine, lines_picture
from .sources import versions

CONSTANT = "Columns that are constant throughout are not drawn."
MOST_PANELS = 60
"""Largest number of panels of lines that are drawn."""


def split(column: str, units: Mapping[str, str]) -> tuple[str, str]:
    """Return the name of a column without the suffix of its unit, and the unit; "" for a pure number.

    `units` are those of columns whose suffix is not one of ours.
    """
    stem, _, suffix = column.rpartition("_")
    unit_and_factor = column_units().get(suffix)
    if unit_and_factor is None or not stem:
        unit = units.get(column, "")
        return column.removesuffix(f"_{suffix_for(unit)}"), unit_text(unit)
    unit, factor = unit_and_factor
    displayed = (name for name, scale in UNITS[unit].display.items() if scale == factor)
    return stem, unit_text(unit if factor == 1.0 else next(displayed, unit))


def lines_page(title: str, sentence: str, table: pl.LazyFrame, units: Mapping[str, str]) -> Page:
    """Return the page of a table whose first column is `time_s`; its columns are read one by one."""
    sections, rows, not_drawn = _drawn(table, units)
    if rows:
        sections.append(
            Section("All columns", CONSTANT, table=Table(["column", "first", "smallest", "largest", "last"], rows))
        )
    if not_drawn:
        sections.append(
            Section("Not drawn", f"{', '.join(not_drawn)}: texts, or beyond {MOST_PANELS} panels of lines.")
        )
    return Page(plain(title), sentence, [], lambda: sections, provenance=versions(), zoom=True)


def _drawn(
    table: pl.LazyFrame, units: Mapping[str, str], title: str = ""
) -> tuple[list[Section], list[list[Cell]], list[str]]:
    """Return a section for each unit, a row of figures for each column, and the columns that are not drawn.

    Constant and empty columns are in the table alone.
    """
    schema = table.collect_schema()
    times = table.select("time_s").collect()["time_s"].to_numpy()
    by_unit: dict[str, dict[str, list[str]]] = {}
    not_drawn: list[str] = []
    for name, kind in schema.items():
        if name == "time_s":
            continue
        if kind.is_numeric() or kind == pl.Boolean:
            stem, unit = split(name, units)
            # Numbered columns share a panel.
            array = by_unit.setdefault(TRUTH if kind == pl.Boolean else unit, {})
            array.setdefault(re.sub(r"(\[\d+\]|\d+)$", "", stem), []).append(name)
        else:
            not_drawn.append(name)
    sections: list[Section] = []
    rows = []
    room = MOST_PANELS
    for unit, arrays in by_unit.items():
        groups = _panels(arrays.values())
        not_drawn += [name for group in groups[room:] for name in group]
        drawn = []
        for group in groups[:room]:
            drawn.append([])
            for name in group:
                values = table.select(pl.col(name).cast(pl.Float64)).collect()[name].to_numpy()
                line = DrawnLine.of(short(split(name, units)[0]), times, values)
                if not line.constant:
                    drawn[-1].append(line)
                row: list[Cell] = [name]
                row += [digits(value, 6) for value in line.ends]
                rows.append(row)
        drawn = [lines for lines in drawn if lines]
        room -= len(drawn)
        if drawn:
            of_unit = f"in {unit}" if unit else "without unit"
            heading = f"{title}, {of_unit}" if title else f"Columns {of_unit}"
            heading = unit if unit == TRUTH else heading
            sections.append(Section(heading, picture=lines_picture(drawn, unit)))
    return sections, rows, not_drawn


SPREAD = {"smallest": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "largest": 1.0}
"""Quantiles over the runs."""


def spread_over_time(table: pl.LazyFrame, caption: str) -> list[Section]:
    """Return quantiles over runs of each column of numbers at each time, a picture for each unit.

    `table` has rows of many runs, with columns `run` and `time_s`.
    """
    numbers = [name for name, kind in table.collect_schema().items() if kind.is_numeric()]
    by_unit: dict[str, list[list[DrawnLine]]] = {}
    for name in [name for name in numbers if name not in ("run", "time_s")][:MOST_PANELS]:
        value = pl.col(name).cast(pl.Float64)
        quantiles = [value.quantile(at, "linear").alias(name) for name, at in SPREAD.items()]
        quantiles_at_times = table.group_by("time_s").agg(quantiles).sort("time_s").collect()
        stem, unit = split(name, {})
        lines = [
            DrawnLine.of(
                f"{short(stem)}, {name}", quantiles_at_times["time_s"].to_numpy(), quantiles_at_times[name].to_numpy()
            )
            for name in SPREAD
        ]
        by_unit.setdefault(unit, []).append(lines)
    return [
        Section(
            f"Over time, {f'in {unit}' if unit else 'without unit'}",
            picture=lines_picture(panels, unit),
            caption=caption,
        )
        for unit, panels in by_unit.items()
    ]


MATCHED = {
    "rows": "rows of the same times",
    "position": "positions of the same numbers",
    "time": "the second interpolated at the times of the first",
}
"""Matching of the rows of two runs, in words."""


def compared_page(result: Compared) -> Page:
    """Return the verdict and the differences by column; then pictures of the columns that differ."""
    beyond = sum(not difference.within for difference in result.columns)
    columns = ("column", "largest", "time_s", "first", "second", "rms")
    differences = table_of(result.columns, columns)
    rows = []
    for cells, difference in zip(differences.rows, result.columns, strict=True):
        row = list(cells)
        row += [difference.one_only or None, "yes" if difference.within else "no"]
        rows.append(row)
    header = list(differences.header)
    header += ["rows of one only", "within limit"]
    table = Table(header, rows)

    differing = [difference.column for difference in result.columns if difference.largest > 0.0]

    def pictures() -> list[Section]:
        return _drawn(result.differences.lazy().select("time_s", *differing), {}, "Second minus first")[0]

    return Page(
        plain(f"{Path(result.second).name} against {Path(result.first).name}"),
        f"{result.verdict.capitalize()}: {_compared(result, beyond)}.",
        [Section("Differences", _apart(result), table=table)],
        pictures,
        tone="good" if result.verdict == "same" else "attention",
        provenance=versions(),
        zoom=True,
    )


def _compared(result: Compared, beyond: int) -> str:
    """Return the subject of a comparison, and the number of columns with too large differences."""
    what = f"{result.first} and {result.second}, {result.rows} rows ({MATCHED[result.matched]})"
    if beyond:
        return f"{what}; {beyond} of {len(result.columns)} columns differ beyond the limit"
    if result.verdict == "different":
        return f"{what}; common values are within the limit, but one has rows or columns that the other lacks"
    return f"{what}; every column is within its limit"


def _apart(result: Compared) -> list[str]:
    """Return the columns that could not be compared."""
    lines = []
    for words, columns in (
        ("only in the first", result.only_first),
        ("only in the second", result.only_second),
        ("no numbers", result.not_compared),
    ):
        if columns:
            lines.append(f"{words}: {', '.join(columns)}")
    return lines


def _panels(arrays: Iterable[Sequence[str]]) -> list[list[str]]:
    """Return columns by panels: whole arrays if they fit."""
    panels: list[list[str]] = []
    for names in arrays:
        for k in range(0, len(names), MOST_LINES):
            part = list(names[k : k + MOST_LINES])
            if panels and len(panels[-1]) + len(part) <= MOST_LINES:
                panels[-1] += part
            else:
                panels.append(part)
    return panels


def write_plot(
    path: Path, title: str, sentence: str, table: pl.LazyFrame | pl.DataFrame, units: Mapping[str, str] | None = None
) -> None:
    """Write a table of columns over `time_s` as a page of lines, by unit.

    Parameters
    ----------
    path : Path
        .html or .pdf
    title, sentence : str
        title, and description in a sentence
    table : polars.LazyFrame or DataFrame
        the columns; the suffixes of their names are units
    units : mapping, optional
        column -> unit, for columns whose suffix is not one of ours

    Raises
    ------
    InputError
        if the file cannot be written, or the page cannot be printed
    """
    write_page(path, lines_page(title, sentence, table.lazy(), units or {}))


def write_plot_of_run(path: Path, run: Simulation) -> None:
    """Write the recorded columns of a simulation as lines over time.

    Raises InputError if the file cannot be written.
    """
    sentence = f"{run.rows} rows up to {digits(run.final_time_s, 9)} s. {run.ended}".strip()
    write_plot(path, run.title or "A run without a title", sentence, run.rows_of_file(), run.units)
