"""The commands of an instrument's folder: add to it, list it, show the nearest entry, say what is no constant."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from .. import instrument as folders
from .. import reports
from ..files import json_text, write_text
from .answer import Answer, File, JsonFile, ReportFile, answer, distinct_files

instrument = App(name="instrument", help="An instrument's folder of calibrations and diagnoses: plain JSON.")
Degrees = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


@instrument.command
def add(
    folder: Path,
    result: Path,
    /,
    *,
    records: Annotated[tuple[Path, ...], Parameter(name="--record")] = (),
    date: str | None = None,
    temperature: Degrees = None,
    serial: str | None = None,
    json: JsonFile = None,
) -> Answer:
    """Put a calibration or diagnosis into an instrument's folder, which is made where there is none.

    Example: trihedron instrument add unit-17 calibration.json --record monday.csv

    Example: trihedron instrument add unit-17 together.json --record monday.csv --record tuesday.csv

    Parameters
    ----------
    folder
        The instrument's folder.
    result
        The result of `trihedron calibrate --json` or `trihedron diagnose --json`, of one record or several.
    records
        The record that it was made from: its comment lines (# date: ..., # temperature: ..., # serial: ...) and its
        temperatures say what the options do not; of several records once for each.
    date
        When it was measured, as 2026-11-23 or 2026-11-23T14:00.
    temperature
        How warm the instrument was [degC].
    serial
        Its serial number.
    """
    given = {f"--record {k}": path for k, path in enumerate(records, start=1)}
    distinct_files({"the result": result, **given, "--json": json})
    entry = folders.add_to_instrument(
        folder, result, records=records, date=date, temperature=temperature, serial=serial
    )
    return answer(entry, json, files=[folder / entry.file])


@instrument.command(name="list")
def list_(folder: Path, /, *, json: JsonFile = None) -> Answer:
    """Say what an instrument's folder holds, in order of the dates.

    Example: trihedron instrument list unit-17

    Parameters
    ----------
    folder
        The instrument's folder.
    """
    return answer(folders.entries_of(folder), json)


@instrument.command
def show(
    folder: Path,
    /,
    *,
    date: str | None = None,
    temperature: Degrees = None,
    kind: Literal["calibration", "diagnosis"] | None = None,
    out: File = None,
    json: JsonFile = None,
) -> Answer:
    """Say which calibration or diagnosis is nearest in date or temperature; the last one by default.

    Example: trihedron instrument show unit-17 --temperature 35 --kind calibration --out nearest.json

    Parameters
    ----------
    folder
        The instrument's folder.
    date
        Nearest to this date, as 2026-11-23 or 2026-11-23T14:00.
    temperature
        Nearest to this temperature [degC].
    kind
        Of calibrations, or of diagnoses, only.
    out
        Write the result itself, for `trihedron apply`.
    """
    distinct_files({"--out": out, "--json": json})
    entry = folders.nearest_of_instrument(folder, date=date, temperature=temperature, kind=kind)
    if out is not None:
        write_text(out, json_text(entry.result))
    return answer(entry, json)


@instrument.command
def trend(folder: Path, /, *, json: JsonFile = None, report: ReportFile = None) -> Answer:
    """Show each parameter over the dates, with its intervals, and since when no constant is possible.

    Example: trihedron instrument trend unit-17 --report trend.html

    Parameters
    ----------
    folder
        The instrument's folder.
    """
    distinct_files({"--json": json, "--report": report})
    found = folders.trend_of_instrument(folder)
    if report is not None:
        reports.write_report(report, found)
    return answer(found, json)
