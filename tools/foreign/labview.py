"""LabVIEW's measurement files (.lvm): a text with a header that says its separator, decimal mark, units and period."""

from pathlib import Path

from ..errors import InputError
from .numbers import number
from .sheet import Sheet, Stated

FIRST_LINE = "LabVIEW Measurement"
END = "***End_of_Header***"
KEPT = ("Operator", "Project", "Description", "Date", "Time", "Notes")
"""What of the header is about the measurement; the rest is about the file."""


def is_labview(lines: list[str]) -> bool:
    """Whether lines of text are a measurement file."""
    return lines[0].strip().startswith(FIRST_LINE)


def labview_sheet(path: Path, lines: list[str], encoding: str) -> Sheet:
    """A measurement file as a sheet that knows what its header says; an InputError where that says no table."""
    ends = [line for line, text in enumerate(lines, 1) if text.strip().startswith(END)]
    if len(ends) != 2:
        what = "no end of its header" if not ends else f"{len(ends) - 1} parts with a header; one is read"
        raise InputError(f"{path}: is a LabVIEW measurement file with {what}")
    separator = "," if any(text.strip() == "Separator,Comma" for text in lines[: ends[0]]) else "\t"
    rows = [text.split(separator) for text in lines[: ends[1]]]
    header: dict[str, list[str]] = {}
    for cells in rows:
        header.setdefault(cells[0].strip(), [cell.strip() for cell in cells[1:]])
    decimal = _first(header, "Decimal_Separator") or "."
    if decimal not in (".", ","):
        raise InputError(f"{path}: Decimal_Separator {decimal!r}: is neither a point nor a comma")
    names = next((line for line, text in enumerate(lines[ends[1] :], ends[1] + 1) if text.strip()), 0)
    seconds = _first(header, "X_Dimension") in ("", "Time")
    period = number(_first(header, "Delta_X"), decimal)
    kept = [text if any(text.startswith(f"{key}{separator}") for key in KEPT) else "" for text in lines[: ends[0]]]
    stated = Stated(
        decimal=decimal,
        header_row=names,
        units=("s" if seconds else "", *header.get("Y_Unit_Label", ())),
        first_row=names + 1,
        time=f"{period!r} s" if seconds and period and _first(header, "X_Columns") == "No" else "",
    )
    return Sheet(
        path,
        [*kept, *[""] * (ends[1] - ends[0]), *lines[ends[1] :]],
        encoding=encoding,
        separator="tab" if separator == "\t" else ",",
        stated=stated,
    )


def _first(header: dict[str, list[str]], key: str) -> str:
    """The first text behind a key; "" where there is none."""
    return next(iter(header.get(key, ())), "")
