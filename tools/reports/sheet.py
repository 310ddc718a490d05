"""The sheet of a calibration, one A4 page to sign: operator, numbers, correction, provenance."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..calibrated import Calibration, Parameter
from ..calibration.calibration import HOW_TO_FIND
from ..calibration.correction import correction_of
from ..document.blocks import Page, Section, Table, table_of
from ..document.notation import Cell, equation, unit_text
from ..document.page import write_page
from ..errors import InputError, nearest
from ..files import LARGEST_TEXT, bytes_of
from ..instrument import SAID
from ..records import PositionRecord
from ..rounding import digits
from . import bench
from .calibration import TONES, WORDS, promised_error, verdict_sentence

HEAD: Mapping[str, tuple[str, ...]] = {
    "serial number": SAID["serial"],
    "operator": ("operator", "measured by"),
    "bench": ("bench", "table"),
    "date": SAID["date"],
    "temperature": SAID["temperature"],
}
"""Fields of the head, and the keys of their comment lines."""


def read_about(path: Path) -> dict[str, str]:
    """Read the fields of a calibration's sheet from a TOML file: keys of comment lines, texts or numbers.

    Raises InputError for any other content.
    """
    label = f"--about {path}"
    try:
        content = tomllib.loads(bytes_of(path, label=label, most=LARGEST_TEXT).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{label}: is not TOML: {error}") from error
    if not content:
        raise InputError(f'{label}: says nothing; write serial_number = "...", operator, bench, date, temperature')
    keys: list[str] = []
    for names in HEAD.values():
        keys += names
    about = {}
    for key, value in content.items():
        if key.casefold() not in keys:
            raise InputError(f"{label}: {key}: unknown key; {nearest(key, keys)}")
        if isinstance(value, bool | dict | list):
            raise InputError(f"{label}: {key}: a text, a number or a date must stand there")
        about[key] = str(value)
    return about


def sheet_page(result: Calibration, record: PositionRecord | None, about: Mapping[str, str]) -> Page:
    """Return the sheet; `about` overrides the comment lines of the record, and unknown fields are left to write."""
    sections = [_numbers("Calibrated values", result, result.targets)]
    if result.stands:
        sections.append(_correction(result))
    rests: list[list[Cell]] = [["evidence", f"{result.positions} positions, {result.measurements} readings"]]
    for name, value in bench.provenance(result).items():
        rests.append([name, str(value)])
    sections.append(Section("Basis", table=Table(["", ""], rests)))
    if result.gyros is not None:
        sections.append(_numbers("Gyros, in the accelerometers' axes", result, result.of_gyros))
    fields = ["calibrated by: name, signature", "checked by: name, signature", "date"]
    signatures = Table(fields, [["", "", ""]], fixed=True)
    sections.append(Section("Signed", table=signatures))
    return Page(
        "Calibration sheet",
        verdict_sentence(result),
        sections,
        tone=TONES.get(result.verdict, "attention"),
        key=_head(record, about),
        sheet=True,
    )


def _head(record: PositionRecord | None, about: Mapping[str, str]) -> dict[str, str]:
    """Return operator, instrument, date and temperature; empty texts for unknown ones."""
    facts: dict[str, str] = {}
    if record is not None:
        if record.raw is not None:
            facts |= record.raw.about
        facts |= record.about
    facts = {key.casefold(): text for key, text in (facts | dict(about)).items()}
    head = {}
    for name, keys in HEAD.items():
        texts = [facts[key] for key in keys if key in facts]
        head[name] = texts[0] if texts else ""
    if not head["temperature"] and record is not None and record.temperature is not None:
        head["temperature"] = bench.temperature_text(record.temperature)
    if head["temperature"]:
        head["temperature"] = f"{head['temperature'].removesuffix('°C').strip()} °C"
    return head


def _correction(result: Calibration) -> Section:
    """Return the equation of correction with its numbers."""
    equations = []
    for n, reading, plus, minus in bench.correction_terms(
        correction_of(result.to_json(), "calibration"), result.noise_bound, "_"
    ):
        equations.append(equation(f"{n} = {reading} / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}"))
    text = f"f are the readings in m/s², g = {digits(result.gravity, 9)} m/s²; g n are the corrected readings."
    return Section("Equation of correction", text, equations=equations)


def _numbers(title: str, result: Calibration, parameters: Sequence[Parameter]) -> Section:
    """Return each parameter with its guaranteed error and interval; a falsified model has none."""
    if result.verdict == "noise-unknown" and not result.stands:
        return Section(title, f"No value is guaranteed: the noise bound is unknown. {HOW_TO_FIND.capitalize()}.")
    if result.verdict == "falsified":
        return Section(title, "No value is guaranteed: no parameters of the model explain the readings.")
    columns = ("symbol", "name", "central", "error_bound", "low", "high", "unit")
    numbers = table_of(parameters, columns, WORDS | {"unit": lambda unit: unit_text(unit) or "1"})
    header = ["symbol", "quantity", "value", promised_error(result), "at least", "at most", "unit"]
    return Section(title, table=Table(header, numbers.rows, fixed=True))


def write_sheet(
    path: Path, result: Calibration, record: PositionRecord | None = None, about: Mapping[str, str] | None = None
) -> None:
    """Write the sheet of a calibration as HTML, or as PDF if the name ends so.

    Parameters
    ----------
    path : Path
        .html or .pdf
    result : Calibration
        the calibration
    record : PositionRecord, optional
        its record, with comment lines and temperatures; by default the result's own
    about : mapping, optional
        fields of the head, as of `read_about`

    Raises
    ------
    InputError
        if the file cannot be written, or the page cannot be printed
    """
    write_page(path, sheet_page(result, record or result.made_of, about or {}))
