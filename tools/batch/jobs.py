"""Jobs of a batch: a record with its facts and options, from files or from a table of records."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl

from ..errors import InputError, nearest
from ..files import bytes_of
from ..instrument import moment
from ..records import decisions_file
from .library import Do

FACTS = ("serial", "date", "temperature_degC")
NUMBERS = ("noise_bound", "noise_sd", "gravity")
"""Options of a record that are numbers."""
TEXTS = ("mounting", "baseline", "stamps")
OPTIONS: Mapping[str, tuple[str, ...]] = {
    "calibrate": (*NUMBERS, *TEXTS, "channels", "trust"),
    "diagnose": (*NUMBERS, *TEXTS, "channels", "trust"),
    "noise": ("gravity", "channels", "trust"),
    "apply": ("noise_bound", "channels", "stamps", "trust", "calibration"),
}
"""Options of each work, as its function names them."""
FILES = ("calibration", "mounting")
"""Options that may name a file or a folder."""
AT_TERMINAL = {"calibration": "with"}
"""Options whose names at a terminal are not those of the parameters."""
LARGEST_TABLE = 1 << 26
"""Bytes of a table of records."""


@dataclass(frozen=True)
class Job:
    """The work on one record.

    Attributes
    ----------
    record : str
        file as the user named it
    path : str
        the same, for a process in any folder
    do : str
    facts : dict of str
        serial, date and temperature_degC as far as the table tells them
    options : dict
        arguments of the function that does the work
    inputs : str
        digest of the files that its options name
    """

    record: str
    path: str
    do: Do
    facts: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    inputs: str = ""

    def key(self) -> str:
        """Return the name of the result: the file's stem, and a hash of all that it is made of.

        That is the record with the decisions beside it, the options, and the files that these name. Raises OSError
        for a record that cannot be read.
        """
        path = Path(self.path)
        if not path.is_file():
            raise FileNotFoundError(self.record)
        digest = hashlib.sha256(path.read_bytes())
        decisions = decisions_file(path)
        if decisions.is_file():
            digest.update(decisions.read_bytes())
        digest.update(repr((self.do, self.record, self.inputs, sorted(self.options.items()))).encode())
        return f"{Path(self.record).stem}-{digest.hexdigest()[:12]}"


def jobs_of(records: Sequence[Path], do: Do, options: Mapping[str, Any]) -> list[Job]:
    """Return the jobs of a batch.

    Parameters
    ----------
    records : sequence of path
        record files, or one table (CSV) with a row for each record: the column `file`, and if known `serial`, `date`,
        `temperature_degC` and options of the work; its relative paths begin at its folder
    do : str
        the work
    options : dict
        options of all records; a cell of the table replaces one

    Raises
    ------
    InputError
        for no record, a record that is given twice, an option of another work, or a column that is none
    """
    if do not in OPTIONS:
        raise InputError(f"--do {do}: is none of {', '.join(OPTIONS)}; {nearest(do, list(OPTIONS))}")
    for name in options:
        if name not in OPTIONS[do]:
            shown = AT_TERMINAL.get(name, name.replace("_", "-"))
            raise InputError(f"--{shown}: is not an option of --do {do}; leave it out")
    if do == "apply" and len(records) == 1 and "calibration" not in options and _table_of(records[0]) is None:
        raise InputError("--with: --do apply needs a calibration, or a folder of `trihedron batch --do calibrate`")
    jobs = []
    for path in records:
        table = _table_of(path)
        if table is None:
            jobs.append(Job(str(path), str(path.absolute()), do, {}, dict(options)))
            continue
        if len(records) > 1:
            raise InputError(f"{path}: is a table of records; give it alone")
        jobs = _jobs_of_table(path, table, do, options)
    if not jobs:
        raise InputError("batch: no record; give files, or a table with the column file")
    known: set[str] = set()
    for job in jobs:
        if job.path in known:
            raise InputError(f"{job.record}: is given twice")
        known.add(job.path)
        if do == "apply" and "calibration" not in job.options:
            raise InputError(f"{job.record}: --do apply needs a calibration: give --with, or the column calibration")
    digests: dict[str, str] = {}
    for job in jobs:
        for name in FILES:
            text = str(job.options.get(name, ""))
            digests.setdefault(text, _digest_of(Path(text)) if text else "")
    named = [[digests[str(job.options.get(name, ""))] for name in FILES] for job in jobs]
    return [replace(job, inputs=" ".join(texts)) for job, texts in zip(jobs, named, strict=True)]


def _digest_of(path: Path) -> str:
    """Return a hash of a file, or of the entries of the instruments in a batch's folder; empty of neither."""
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    digest = hashlib.sha256()
    for entry in sorted(path.glob("instruments/*/*")):
        digest.update(entry.name.encode() + entry.read_bytes())
    return digest.hexdigest() if path.is_dir() else ""


def _table_of(path: Path) -> pl.DataFrame | None:
    """Return a table of records; None for any other file, even one that is missing, and for a pipe."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream:
            first = stream.read(4096)
    except OSError:
        return None
    lines = []
    for line in first.decode("utf-8-sig", "replace").splitlines():
        if line.strip() and not line.startswith("#"):
            lines.append(line)
    separator = ";" if lines and ";" in lines[0] else ","
    if not lines or "file" not in [name.strip().strip('"') for name in lines[0].split(separator)]:
        return None
    content = bytes_of(path, most=LARGEST_TABLE)
    try:
        table = pl.read_csv(
            io.BytesIO(content.removeprefix(b"\xef\xbb\xbf")),
            infer_schema=False,
            separator=separator,
            comment_prefix="#",
        )
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path}: is not a table of records ({str(error).splitlines()[0]})") from error
    return table.rename({name: name.strip() for name in table.columns})


def _jobs_of_table(path: Path, table: pl.DataFrame, do: Do, options: Mapping[str, Any]) -> list[Job]:
    """Return a job for each row of a table of records."""
    known = ("file", *FACTS, *OPTIONS[do])
    for name in table.columns:
        if name not in known:
            raise InputError(f"{path}: column '{name}' is unknown; {nearest(name, list(known))}")
    jobs = []
    for number, row in enumerate(table.iter_rows(named=True), start=1):
        cells = {name: text.strip() for name, text in row.items() if text is not None and text.strip()}
        file = cells.pop("file", None)
        if file is None:
            raise InputError(f"{path}: row {number}, column 'file': is empty")
        own = dict(options)
        facts = {}
        for name, text in cells.items():
            if name in FACTS:
                facts[name] = text
            else:
                own[name] = _option(path, number, name, text)
        _check_facts(f"{path}: row {number}", facts)
        place = path.parent / file
        jobs.append(Job(file, str(place.absolute()), do, facts, own))
    return jobs


def _option(path: Path, number: int, name: str, text: str) -> Any:
    """Return the value of a cell with an option."""
    where = f"{path}: row {number}, column '{name}': '{text}'"
    if name in NUMBERS:
        return _number(where, text)
    if name == "trust":
        if text.lower() not in ("true", "false"):
            raise InputError(f"{where} must be true or false")
        return text.lower() == "true"
    if name == "channels":
        return tuple(text.split())
    if name == "calibration":
        return str((path.parent / text).absolute())
    return text


def _number(where: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{where} is not a number") from error


def _check_facts(where: str, facts: Mapping[str, str]) -> None:
    if "date" in facts:
        moment(facts["date"], f"{where}, column 'date':")
    if "temperature_degC" in facts:
        _number(f"{where}, column 'temperature_degC': '{facts['temperature_degC']}'", facts["temperature_degC"])
