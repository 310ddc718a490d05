"""The work of a process on one record of a batch."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .. import corrections, measured, records
from ..calibrated import Calibration
from ..calibration import Applied
from ..diagnosis.result import Diagnosis
from ..errors import InputError
from ..files import LARGEST_RESULT, bytes_of
from ..instrument import entry_with, facts_of, moment, nearest_of_instrument
from ..locks import own_folder
from ..lot import InstrumentValue, Member
from ..noise import Noise
from .jobs import Job

INSTRUMENTS = "instruments"
"""Folder of the instruments' folders, in the folder of a batch."""
SAFE = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-+"
"""Characters of a serial number that a folder's name can have on every system."""


@dataclass(frozen=True)
class Done:
    """A row of the lot, and the contents of the files to write, by their paths in the folder."""

    member: Member
    files: Mapping[str, bytes]


def worked(job: Job) -> Done:
    """Do the work on a record. A record that cannot be used has its reason in the row."""
    serial = job.facts.get("serial", Path(job.record).stem)
    row = Member(record=job.record, serial=serial, date=job.facts.get("date"), temperature_degC=_temperature(job.facts))
    try:
        return _worked(job)
    except InputError as error:
        reason = str(error)
    except Exception as error:
        # One record must not end the others.
        reason = f"a fault of the program: {type(error).__name__}: {error}"
    reason = " ".join(reason.split()).replace(job.path, job.record)
    return Done(row.model_copy(update={"failed": reason or "no message"}), {})


def _worked(job: Job) -> Done:
    options = dict(job.options)
    channels, stamps = options.pop("channels", ()), options.pop("stamps", None)
    path = Path(job.path)
    run: Any = records.read_record(path, channels=channels, stamps=stamps)
    run = replace(run, path=Path(job.record))
    facts = facts_of(run)
    for name, text in job.facts.items():
        facts[name.removesuffix("_degC")] = text
    if "date" in facts:
        moment(facts["date"], f"{job.record}: date")
    label = Path(job.record).stem
    key = job.key()
    files: dict[str, bytes] = {}
    result: Any
    if job.do == "apply":
        calibration = _calibration_for(Path(options.pop("calibration")), facts, label)
        result = corrections.apply(calibration, run, **options)
        files[f"corrected/{key}.csv"] = _csv_of(result, job.record)
    else:
        result = getattr(measured, job.do)(run, **options)
    text = result.json_text().encode()
    name = f"results/{key}.json"
    member = Member(
        record=job.record,
        serial=facts.get("serial", label),
        date=facts.get("date"),
        temperature_degC=_temperature({"temperature_degC": facts["temperature"]}) if "temperature" in facts else None,
        verdict=getattr(result, "verdict", None),
        result=name,
        values=values_of(result),
        causes=result.causes if isinstance(result, Diagnosis) and result.verdict == "explained" else (),
    )
    if isinstance(result, Calibration | Diagnosis) and "date" in facts:
        entry = entry_with(result, text, facts | {"serial": member.serial})
        files[f"{INSTRUMENTS}/{folder_of(member.serial)}/{entry.file}"] = entry.json_text().encode()
    # The row comes last: its file marks whole work.
    files[name] = text
    files[f"rows/{key}.json"] = member.json_text().encode()
    return Done(member, files)


def folder_of(serial: str) -> str:
    """Return the name of an instrument's folder: its serial number, other characters as their numbers."""
    name = "".join(c if c in SAFE else f"%{ord(c):x}" for c in serial)
    return name if name.strip(".") else f"%{name}"


def values_of(result: Any) -> dict[str, InstrumentValue]:
    """Return the numbers of a result that a lot compares, by symbol."""
    values: dict[str, InstrumentValue] = {}
    if isinstance(result, Diagnosis):
        result = result.stated
    if isinstance(result, Calibration):
        for p in result.parameters:
            if p.determined and p.estimate is not None:
                values[p.symbol] = _value(p.unit, p.estimate, p.low, p.high)
    if isinstance(result, Noise):
        for channel in result.channels:
            for one in channel.coefficients:
                if one.detected and one.estimate is not None:
                    symbol = f"{channel.channel} {one.process}"
                    values[symbol] = _value(one.unit, one.estimate, one.low, one.high)
    return values


def _value(unit: str, estimate: float, low: float | None, high: float | None) -> InstrumentValue:
    ends = []
    for end in (low, high):
        ends.append(end if end is not None and math.isfinite(end) else None)
    return InstrumentValue(unit=unit, estimate=estimate, low=ends[0], high=ends[1])


def _calibration_for(calibration: Path, facts: Mapping[str, str], label: str) -> Any:
    """Return a calibration file, or from the folder of a batch that of the record's instrument nearest in date."""
    if not calibration.is_dir():
        return calibration
    serial = facts.get("serial", label)
    folder = calibration / INSTRUMENTS / folder_of(serial)
    if not folder.is_dir():
        raise InputError(f"{calibration}: holds no calibration of the instrument {serial}")
    entry = nearest_of_instrument(folder, date=facts.get("date"), kind="calibration")
    return Calibration.model_validate(entry.result)


def _csv_of(result: Applied, record: str) -> bytes:
    """Return the corrected record as a CSV file."""
    if result.record is None:
        raise InputError(f"{record}: the diagnosis names nothing that a correction could remove")
    with own_folder() as folder:
        path = folder / "corrected.csv"
        records.write_record(result.record, path)
        return bytes_of(path, most=LARGEST_RESULT)


def _temperature(facts: Mapping[str, str]) -> float | None:
    text = facts.get("temperature_degC")
    if text is None:
        return None
    try:
        return float(text.removesuffix("°C").removesuffix("degC"))
    except ValueError as error:
        raise InputError(f"temperature '{text}' is not a number of degrees Celsius") from error
