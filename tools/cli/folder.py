"""The commands of an instrument's folder: add to it, list it, show the nearest entry, say what is no constant."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from .. import instrument as folders
from .. import reports
from ..files import json_text, together, write_text
from .answer import Answer, File, JsonFile, ReportFile, answer, distinct_files, takes

instrument = App(name="instrument", help="An instrument's folder of calibrations and diagnoses: plain JSON.")
Degrees = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


@instrument.command
@takes(folders.add_to_instrument)
def add(folder: Path, result: Path, /, *, temperature: Degrees = None, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron instrument add unit-17 calibration.json --record monday.csv

    Parameters
    ----------
    temperature
        How warm the instrument was [degC].
    """
    distinct_files({"the result": result, "--record": options.get("record"), "--json": json})
    with together():
        entry = folders.add_to_instrument(folder, result, temperature=temperature, **options)
        return answer(entry, json, files=[folder / entry.file])


@instrument.command(name="list")
@takes(folders.entries_of)
def list_(folder: Path, /, *, json: JsonFile = None) -> Answer:
    """Example: trihedron instrument list unit-17"""
    return answer(folders.entries_of(folder), json)


@instrument.command
@takes(folders.nearest_of_instrument)
def show(
    folder: Path,
    /,
    *,
    temperature: Degrees = None,
    out: File = None,
    json: JsonFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron instrument show unit-17 --temperature 35 --kind calibration --out nearest.json

    Parameters
    ----------
    temperature
        Nearest to this temperature [degC].
    out
        Write the result itself, for `trihedron apply`.
    """
    distinct_files({"--out": out, "--json": json})
    entry = folders.nearest_of_instrument(folder, temperature=temperature, **options)
    with together():
        if out is not None:
            write_text(out, json_text(entry.result))
        return answer(entry, json)


@instrument.command
@takes(folders.trend_of_instrument)
def trend(folder: Path, /, *, json: JsonFile = None, report: ReportFile = None) -> Answer:
    """Example: trihedron instrument trend unit-17 --report trend.html"""
    distinct_files({"--json": json, "--report": report})
    found = folders.trend_of_instrument(folder)
    with together():
        if report is not None:
            reports.write_report(report, found)
        return answer(found, json)
