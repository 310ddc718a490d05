"""Decide the source of times: numbers, dates, times of day, sample numbers, or the order of the rows."""

import re
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..records.columns import (
    POSES,
    POSITION,
    TEXTS,
)
from .mapping import OPEN
from .names import DATE, SAMPLE, TIMES
from .numbers import (
    date_of,
    date_orders,
    is_clock,
    is_missing,
    parsed_moment,
    two_parts,
)
from .ranking import (
    MANY_ROWS,
    likely_of,
    rising,
    time_units,
)
from .sheet import cell
from .understanding import (
    CLOCK,
    MOMENT,
    NAME,
    NUMBER,
    Field,
    Origin,
    UnderstoodTable,
)
from .units import TIME, is_rate

RATE_BESIDE = re.compile(r"\b(?:at|\w*rate|\w*frequency)(?: set to)?\W{1,4}(\d+(?:\.\d+)?) ?(k?Hz)", re.IGNORECASE)


def decide_time(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the source of times: numbers, times of day, dates, sample numbers, or the order of the rows."""
    time, date = fields.get(TIMES), fields.get(DATE)
    if time is None and SAMPLE in fields and table.kind is not POSITION:
        _refuse_period(table, f"{fields[SAMPLE].label!r} counts samples")
        table.origins[TIMES] = origin_of(table, SAMPLE, fields[SAMPLE])
        return
    if time is None:
        time, date = date, None
    if time is None:
        _ask_for_time(table)
        return
    origin = origin_of(table, TIMES, time)
    if time.cells and all(map(is_clock, time.texts)):
        origin = replace(origin, form=CLOCK)
        ambiguous = next(filter(two_parts, time.texts), None)
        if ambiguous and table.mapping.clock in ("", OPEN):
            table.ask("clock", ("h:m", "m:s"), f"the meaning of {ambiguous!r} is not clear")
    elif any(table.value(text) is None for text in time.texts) and any(map(date_of, time.texts)):
        origin = replace(origin, form=MOMENT)
        _decide_dates(table, time)
    table.origins[TIMES] = origin
    if origin.form == CLOCK and date is not None:
        table.origins[DATE] = replace(origin_of(table, DATE, date), form=MOMENT)
        _decide_dates(table, date)


def written_times(table: UnderstoodTable, free: list[Field]) -> dict[str, Field]:
    """Return the only column of dates, times of day or numbers in a unit of time that goes from row to row."""
    dates = [field for field in free if field.texts and all(map(date_of, field.texts))]
    going = [field for field in free if len(field.texts) > 2 and len(set(field.texts)) == len(field.texts)]
    moments = [field for field in dates if field in going and ":" in field.texts[0]]
    clocks = [field for field in going if all(map(is_clock, field.texts))]
    if len(moments) == 1:
        return {TIMES: moments[0]}
    if len(clocks) == 1 and len(dates) < 2:
        return dict(zip((TIMES, DATE), (clocks[0], *dates), strict=False))
    # columns that are equal are one
    timed = list({tuple(field.texts): field for field in reversed(free) if field.quantity == TIME}.values())
    if len(timed) == 1 and rising(table, timed):
        return {TIMES: timed[0]}
    return {}


def _ask_for_time(table: UnderstoodTable) -> None:
    """Ask for the source of times in a table without a known column of times."""
    if table.mapping.time == "order" or table.kind is POSES:
        return
    is_series, is_kind_open = len(table.rows) >= MANY_ROWS, table.is_asked("kind")
    timed = [field.label for field in table.filled if field.quantity == TIME]
    if not is_kind_open:
        _refuse_period(table, "no column has the name of a time")
    if not is_kind_open and table.kind is POSITION and not timed:
        table.settled["time"] = "order"
        table.notes.append("the file has no times: rows count as 1 s apart")
        return
    if TIME in table.mapping.units or (is_kind_open and not is_series):
        return
    if timed and not is_kind_open:
        in_order = "; rows in their order: --set time=order" if table.kind is POSITION else ""
        table.ask("columns.time_s", timed[:3], f"which column is the time{in_order}")
        return
    if table.sheet.stated.time:
        return
    rate = table.sheet.stated.likely_rate or _rate_beside(table) or likely_of(table.mapping).get(TIME, "100 Hz")
    risen = [field for field in rising(table, table.filled) if field.quantity in ("", TIME)] if is_series else []
    if not risen:
        why = "no column is known as a time: rows at which rate; else columns.time_s=NAME names it"
        table.ask("units.time", (rate,), why)
        return
    table.ask("columns.time_s", [field.label for field in risen[:3]], "which column is the time; none: a rate is asked")
    counts = table.values(risen[0].texts)
    likely = [rate] if counts[-1] - counts[0] == len(counts) - 1 else time_units(table, risen[0])
    table.ask("units.time", list(dict.fromkeys([*likely, "s", "ms", "us"])), "the times have no unit")


def _rate_beside(table: UnderstoodTable) -> str:
    """Return the only rate in the lines around the table, as "at 30 Hz" or "Sample rate: 100 Hz"; "" for several."""
    rates = {f"{rate} {unit}" for rate, unit in RATE_BESIDE.findall(table.layout.lines_around)}
    return rates.pop() if len(rates) == 1 else ""


def _refuse_period(table: UnderstoodTable, where: str) -> None:
    """Refuse a unit of time if there are no times: counted rows need their rate."""
    answer = table.mapping.units.get(TIME, OPEN)
    if answer != OPEN and not is_rate(answer):
        advice = "give the rate, as '100 Hz', or the column of the time by columns.time_s=NAME"
        raise InputError(f"{table.sheet.path}: units.time = {answer!r}: {where}; {advice}")


def _decide_dates(table: UnderstoodTable, field: Field) -> None:
    """Decide the order of day, month and year; ask if it matters for the times."""
    rows = table.sheet.rows(table.layout.first, table.layout.last or None)
    written = (cell(row, field.place) for _, row in rows)
    dates = (date_of(text) for text in written if not is_missing(text, table.mapping.missing))
    texts = list(dict.fromkeys(filter(None, dates)))
    orders = date_orders(texts)
    times = np.array([[parsed_moment(text, order) or 0.0 for text in texts] for order in orders])
    times = times.reshape(len(orders), len(texts))
    answer = table.mapping.dates.replace(OPEN, "")
    differing = [text for text, at in zip(texts, (times - times[:, :1]).T, strict=True) if len(set(at.tolist())) > 1]
    if not answer and differing:
        table.ask("dates", orders, f"the meaning of {differing[0]!r} is not clear")
    table.settled["dates"] = answer or (orders[0] if orders else "")
    if not answer and len(orders) > 1 and not differing:
        # all on the same day: the order does not matter
        table.notes.append("the order of day and month does not matter: all rows are of one day")


def origin_of(table: UnderstoodTable, column: str, field: Field) -> Origin:
    """Return a column's origin as far as its own head and the mapping define it."""
    is_name = column in TEXTS or (column == "position" and are_labels(field))
    source = table.mapping.of(column)
    beside = table.beside.get(column, ())
    return Origin(field, NAME if is_name else NUMBER, sign=source.sign, offset=source.offset, beside=beside)


def are_labels(field: Field) -> bool:
    """Return True if positions have names instead of numbers: P1, P2, ..., alike except for their numbers."""
    patterns = {re.sub(r"\d+", "0", text) for text in field.texts}
    return len(patterns) == 1 and "0" in min(patterns) and patterns.isdisjoint(("0", "-0", "0.0", "0,0"))
