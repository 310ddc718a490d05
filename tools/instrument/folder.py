"""An instrument's folder: calibrations and diagnoses as plain JSON, by date and temperature; changes with time."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ...fmus.parameters import CALIBRATIONS
from ..calibrated import Calibration, OfRecord, Parameter, Provenance, each_by_itself
from ..calibration.targets import words_of
from ..diagnosis.result import DIAGNOSES, Diagnosis, in_present_schema
from ..errors import InputError
from ..evidence.of_record import is_of_instrument, plain
from ..fields import Number
from ..files import LARGEST_RESULT, bytes_of, write_text
from ..records import Record, read_record
from ..result import Result, Told, object_of, parsed_result

INSTRUMENT = "trihedron.instrument/1"
Held = Calibration | Diagnosis
KINDS: Mapping[str, type[Held]] = {**dict.fromkeys(CALIBRATIONS, Calibration), **DIAGNOSES}
"""Schemas of results that a folder holds."""
SAID = {
    "date": ("date", "measured", "measured at"),
    "temperature": ("temperature", "temperature_degC"),
    "serial": ("serial", "serial number", "serial_number", "instrument"),
}
"""Keys of a record's comment lines with facts about a result."""
COLDEST, HOTTEST = -100.0, 200.0
"""[°C]"""


class OnDate(Result):
    """When one of several records was measured (ISO 8601)."""

    record: str
    date: str


class Entry(Told):
    """A calibration or diagnosis of an instrument, with date and temperature of the measurement.

    `date` is ISO 8601; `sha256` is that of the result's file, `record_sha256` of the record's. `result` is the result
    as it was published; `file` is the name of the file of the entry. Of several records together date and temperature
    are those of the last, `dates` has those that are known, and the digests have spaces between them.
    """

    schema_: Literal["trihedron.instrument/1"] = Field(default=INSTRUMENT, alias="schema")
    kind: Literal["calibration", "diagnosis"]
    date: str
    temperature: Number | None = Field(default=None, alias="temperature_degC")
    serial: str | None = None
    verdict: str
    sha256: str
    record_sha256: str = ""
    dates: tuple[OnDate, ...] = ()
    result: dict[str, Any]

    file: str = Field(default="", exclude=True)


class Entries(Told):
    """Entries of an instrument's folder, in order of the dates."""

    schema_: Literal["trihedron.instrument-list/1"] = Field(default="trihedron.instrument-list/1", alias="schema")
    serial: str | None
    entries: tuple[Entry, ...]


def add_to_instrument(
    folder: Path,
    result: Path,
    *,
    records: Sequence[Path] = (),
    date: str | None = None,
    temperature: float | None = None,
    serial: str | None = None,
) -> Entry:
    """Put the file of a calibration or diagnosis into an instrument's folder; make the folder if it is missing.

    Parameters
    ----------
    folder, result : Path
        the folder, the result (JSON)
    records : sequence of Path
        the measured records
    date, serial : str, optional
        date and serial number; by default those of the records' comment lines
    temperature : float, optional
        [°C]; by default the mean of the records

    Returns
    -------
    Entry
        the new entry

    Raises
    ------
    InputError
        another kind of file, no date, another serial number, or a result or record that the folder holds already
    """
    content_bytes = bytes_of(result, most=LARGEST_RESULT)
    content = object_of(content_bytes, str(result))
    parsed = _held(content, str(result))
    by_label = digests_of(parsed)
    digests = []
    for digest in by_label.values():
        if digest:
            digests.append(digest)
    comments = _said_by(records, result, digests)
    facts = {"date": date, "serial": serial}
    if temperature is not None:
        facts["temperature"] = str(temperature)
    in_order = []
    for digest in digests or comments:
        if digest in comments:
            in_order.append(comments[digest])
    serials = []
    for facts_of in in_order:
        number = facts_of.get("serial")
        if number and number not in serials:
            serials.append(number)
    if serial is None and len(serials) > 1:
        raise InputError(f"{result}: its records are of several instruments: {', '.join(serials)}")
    for name in ("date", "serial", "temperature"):
        for facts_of in reversed(in_order):
            facts[name] = facts.get(name) or facts_of.get(name)
    if facts["date"] is None:
        raise InputError(f"{result}: no date: give --date, or --record with a comment line '# date: 2026-11-23'")
    dates = []
    for label, digest in by_label.items():
        measured = comments.get(digest, {}).get("date")
        if label and measured:
            dates.append(OnDate(record=label, date=_minute(measured, "--record")))
    entry = entry_with(parsed, content_bytes, facts)
    entry = entry.model_copy(update={"record_sha256": " ".join(sorted(digests or comments)), "dates": tuple(dates)})
    present_entries: tuple[Entry, ...] = ()
    if folder.exists():
        present_entries = entries_of(folder).entries
    for present in present_entries:
        if present.sha256 == entry.sha256:
            raise InputError(f"{result}: is there already: {folder / present.file}")
        if entry.record_sha256 and (present.record_sha256, present.kind) == (entry.record_sha256, entry.kind):
            raise InputError(f"{result}: a {entry.kind} of this record is there already: {folder / present.file}")
        if entry.serial and present.serial and entry.serial != present.serial:
            raise InputError(f"{folder}: is of the instrument {present.serial}, not of {entry.serial}")
    write_text(folder / entry.file, entry.json_text())
    return entry


def entry_with(result: Held, content: bytes, facts: Mapping[str, str | None]) -> Entry:
    """Return the entry of a result in an instrument's folder.

    `content` is its file; `facts` has the date, and the temperature [°C] and the serial number where they are known.
    """
    kind: Literal["calibration", "diagnosis"] = "calibration"
    published = object_of(content, "result")
    if isinstance(result, Diagnosis):
        kind = "diagnosis"
        if not result.records:
            published = result.to_json()
    date, digest = _minute(facts["date"] or "", "--date"), hashlib.sha256(content).hexdigest()
    return Entry(
        kind=kind,
        date=date,
        temperature_degC=_degrees(facts.get("temperature")),
        serial=facts.get("serial"),
        verdict=str(published["verdict"]),
        sha256=digest,
        record_sha256=" ".join(sorted(filter(None, digests_of(result).values()))),
        result=published,
        file=f"{date.replace(':', '')}-{kind}-{digest[:8]}.json",
    )


def _said_by(paths: Sequence[Path], result: Path, digests: Sequence[str]) -> dict[str, dict[str, str]]:
    """Return date, temperature and serial number from records, by SHA-256; an InputError for other records."""
    comments: dict[str, dict[str, str]] = {}
    for path in paths:
        measured = read_record(path)
        is_another = measured.sha256 not in digests
        if not digests:
            is_another = bool(comments)
        if is_another:
            raise InputError(f"{path}: is not the record of {result}: its SHA-256 is another")
        comments[measured.sha256] = facts_of(measured)
    return comments


def facts_of(record: Record) -> dict[str, str]:
    """Return date, temperature and serial number of a record, from its comment lines and temperatures."""
    facts: dict[str, str] = {}
    for name, keys in SAID.items():
        for key in reversed(keys):
            if key in record.about:
                facts[name] = record.about[key]
    temperature = getattr(record, "temperature", None)
    if temperature is not None:
        facts.setdefault("temperature", str(float(temperature.mean())))
    return facts


def entries_of(folder: Path) -> Entries:
    """Return the entries of an instrument's folder in order of the dates.

    Parameters
    ----------
    folder : path
        the folder

    Returns
    -------
    Entries
        serial number and entries

    Raises
    ------
    InputError
        no folder, or a JSON file in it that is not an entry
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    entries = []
    for path in sorted(folder.glob("*.json")):
        content = object_of(bytes_of(path, most=LARGEST_RESULT), str(path))
        entry = parsed_result(content, {INSTRUMENT: Entry}, str(path))
        if entry is None:
            raise InputError(f"{path}: schema {content.get('schema')!r}: is not an entry of an instrument's folder")
        _held(entry.result, f"{path}: result")
        moment(entry.date, f"{path}: date")
        entries.append(entry.model_copy(update={"file": path.name}))
    entries.sort(key=lambda entry: (moment(entry.date, ""), entry.file))
    return Entries(serial=next((entry.serial for entry in entries if entry.serial), None), entries=tuple(entries))


def nearest_of_instrument(
    folder: Path,
    *,
    date: str | None = None,
    temperature: float | None = None,
    kind: Literal["calibration", "diagnosis"] | None = None,
) -> Entry:
    """Return the entry nearest in date or temperature; by default the last one.

    Parameters
    ----------
    folder : path
        the instrument's folder
    date : str, optional
        as 2026-11-23 or 2026-11-23T14:00
    temperature : float, optional
        [°C]
    kind : str, optional
        "calibration" or "diagnosis"; by default either

    Returns
    -------
    Entry
        the entry, of the given kind

    Raises
    ------
    InputError
        date and temperature together, or a folder without such an entry
    """
    if date is not None and temperature is not None:
        raise InputError("--date and --temperature: give one of the two")
    of_kind = [entry for entry in entries_of(folder).entries if kind in (None, entry.kind)]
    if temperature is not None:
        of_kind = [entry for entry in of_kind if entry.temperature is not None]
    if not of_kind and temperature is not None:
        raise InputError(f"{folder}: holds no {kind or 'entry'} with a temperature")
    if not of_kind:
        raise InputError(f"{folder}: holds no {kind or 'entry'}")
    if temperature is not None:
        return min(of_kind, key=lambda entry: abs((entry.temperature or 0.0) - temperature))
    if date is not None:
        target = moment(date, "--date")
        return min(of_kind, key=lambda entry: abs(moment(entry.date, "") - target))
    return of_kind[-1]


def trend_of_instrument(folder: Path) -> Calibration:
    """Return each parameter by date, and the date from which no constant is possible.

    A constant is falsified at the first date whose interval is disjoint from an earlier one: intervals that meet
    pairwise have a common point.

    Parameters
    ----------
    folder : path
        the instrument's folder

    Returns
    -------
    Calibration
        a calibration of each record, with the `changes` of each parameter

    Raises
    ------
    InputError
        fewer than two entries with parameters
    """
    content = entries_of(folder)
    dated = []
    for entry in content.entries:
        dated += [(date, record) for date, record in _dated(entry) if record.parameters]
    dated.sort(key=lambda pair: moment(pair[0], ""))
    if len(dated) < 2:
        raise InputError(f"{folder}: two records at least must tell parameters, of consistent or explained results")
    labels = _labels([date for date, _ in dated])
    records = {label: record for label, (_, record) in zip(labels, dated, strict=True)}
    comments = {} if content.serial is None else {"serial": content.serial}
    about = Provenance(record=folder.name, kind="instrument", comments=comments)
    return each_by_itself(records, lambda symbol: ": " in symbol or is_of_instrument(symbol), about)


def digests_of(result: Held) -> dict[str, str]:
    """SHA-256 of each record of a result by its label, in their order; empty where it is not known."""
    if isinstance(result, Diagnosis) and result.records:
        return {alone.record: alone.sha256 for alone in result.records}
    if isinstance(result, Calibration) and result.of_record:
        return {label: record.provenance.sha256 for label, record in result.of_record.items()}
    source = result.record if isinstance(result, Diagnosis) else result.provenance
    if source is None:
        return {"": ""}
    return {"": source.sha256}


def parameters_told(result: Held) -> Iterator[tuple[str, str, str, Any]]:
    """Yield the parameters of a consistent or explained result: record label, name, unit, estimate with ends.

    Values that several records share appear once, with the last record that has the shared value.
    """
    if result.verdict not in ("consistent", "explained", "noise-unknown"):
        return
    if isinstance(result, Calibration):
        last = next(reversed(result.of_record), "")
        yield from ((last, p.symbol, p.unit, p) for p in result.targets)
        for label, record in result.of_record.items():
            yield from ((label, p.symbol, p.unit, p) for p in record.parameters)
    else:
        yield from _of_diagnosis(result)


def _of_diagnosis(result: Diagnosis) -> Iterator[tuple[str, str, str, Any]]:
    """Yield the parameters of records judged together; a shared one that differs in a record appears by itself."""
    judged = result.judged or ("",)
    apart = set()
    for cause in result.causes:
        if cause.effect == "parameter":
            apart.add((cause.record, cause.where))
    for p in result.stated.parameters:
        shared_by = []
        for label in judged:
            if (label, p.symbol) not in apart:
                shared_by.append(label)
        yield (shared_by or [""])[-1], p.symbol, p.unit, p
    for cause in result.causes:
        if cause.effect != "parameter":
            title = plain(cause.place).title
            yield from ((cause.record or judged[-1], f"{title}: {p.name}", p.unit, p) for p in cause.parameters)
    if result.repeatability is None:
        return
    for change in result.repeatability.changes:
        for label, p in result.repeatability.each(change.symbol).items():
            if label in judged and (change.of == "run" or (label, change.symbol) in apart):
                yield label, p.symbol, p.unit, p


def _dated(entry: Entry) -> list[tuple[str, OfRecord]]:
    """Return, for each record of an entry, its date and the interval of each bounded parameter."""
    result, dates = _held(entry.result, entry.file), {on_date.record: on_date.date for on_date in entry.dates}
    nominal = result.calibration if isinstance(result, Diagnosis) else result
    values: dict[str, dict[str, Parameter]] = {label: {} for label in digests_of(result)}
    for label, symbol, unit, p in parameters_told(result):
        if label in values and None not in (p.estimate, p.low, p.high):
            values[label][symbol] = Parameter(
                symbol=symbol,
                name=words_of(symbol),
                unit=unit,
                determined=True,
                estimate=p.estimate,
                low=p.low,
                high=p.high,
            )
    dated = []
    for label, parameters in values.items():
        own = nominal.of_record.get(label)
        source = Provenance(record=label, record_sha256=digests_of(result)[label])
        sigma = nominal.sigma if own is None else own.sigma
        record = OfRecord(sigma=sigma, parameters=list(parameters.values()), provenance=source)
        dated.append((dates.get(label, entry.date), record))
    return dated


def moment(text: str, where: str) -> datetime:
    """A date, with or without a time, without a zone: one that has a zone is taken to UTC."""
    try:
        parsed = datetime.fromisoformat(text.strip())
    except ValueError as error:
        raise InputError(f"{where} {text}: write a date as 2026-11-23 or 2026-11-23T14:00") from error
    if parsed.tzinfo is None:
        return parsed
    return parsed.astimezone(UTC).replace(tzinfo=None)


def _minute(text: str, where: str) -> str:
    return moment(text, where).isoformat(timespec="minutes")


def _labels(dates: Sequence[str]) -> list[str]:
    """Dates without the time of day where that is midnight, numbered where two are alike."""
    short = [date.removesuffix("T00:00") for date in dates]
    labels = []
    for number, text in enumerate(short, start=1):
        label = text
        if short.count(text) > 1:
            label = f"{text} ({short[:number].count(text)})"
        labels.append(label)
    return labels


def _degrees(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        value = float(text.removesuffix("°C").removesuffix("degC"))
    except ValueError:
        value = COLDEST - 1.0
    if not COLDEST <= value <= HOTTEST:
        raise InputError(f"--temperature {text}: must be a number of degrees Celsius, {COLDEST:g} to {HOTTEST:g}")
    return value


def _held(content: Mapping[str, Any], where: str) -> Held:
    """Parse a stored result; an InputError, beginning with `where`, for any other object."""
    result = parsed_result(in_present_schema(content), KINDS, where)
    if result is None:
        raise InputError(f"{where}: schema {content.get('schema')!r}: a calibration or a diagnosis is needed")
    return result
