"""A campaign as an order to workers, and its folder: manifest, files of the data set, missing parts.

Each file is written whole or not at all.
"""

import contextlib
import hashlib
import io
import json
import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

import polars as pl

from ... import fmus
from ..errors import InputError
from ..files import (
    LARGEST,
    LARGEST_TEXT,
    bytes_of,
    json_text,
    made_folder,
    note_read,
    said_writable,
    whole_file,
    write_text,
)
from ..locks import Taken, locked, refuse_irregular
from ..orchestrator.scenario import read_scenario
from .code import PACKAGES, code_hash
from .file import Campaign, parse_campaign
from .kinds import Output

SCHEMA = "trihedron.campaign-result/1"
MANIFEST, CAMPAIGN_FILE, LOCK = "campaign.json", "campaign.toml", "campaign.lock"
SUMMARY, PAGE = "summary.json", "index.html"
RUNS, RECORDS = "runs", "records"


@dataclass(frozen=True)
class Order:
    """The full description of a campaign for a worker on any machine.

    It has the campaign file and all files that it reads, by their paths below their common folder, and the `code_hash`
    of the process that gives the order.
    """

    campaign_file: str
    files: tuple[tuple[str, bytes], ...]
    code: str

    @cached_property
    def sha256(self) -> str:
        """Hash of the names and contents of all files, and of the code."""
        digest = hashlib.sha256(f"{self.campaign_file}\0{self.code}".encode())
        for name, content in self.files:
            digest.update(f"\0{name} {len(content)}\0".encode() + content)
        return digest.hexdigest()

    def unpack(self, folder: Path) -> Campaign:
        """Write the files into a folder; return the campaign as it is read there."""
        for name, content in self.files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        path = folder / self.campaign_file
        return parse_campaign(path.read_bytes(), path)

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each file that the campaign reads."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.files}


def make_order(path: Path) -> tuple[Order, Campaign]:
    """Read a campaign file and all files that it uses.

    Raises InputError for a file that cannot be read or has another content than expected.
    """

    def content(file: Path) -> bytes:
        most = LARGEST_TEXT if file.suffix.lower() == ".toml" else LARGEST
        return bytes_of(file, label=str(file) if file == path else f"{path}: {file}", most=most)

    contents = {path.resolve(): content(path)}
    campaign = parse_campaign(contents[path.resolve()], path)
    simulated, calibrated = campaign.simulation, campaign.calibration
    if simulated is not None:
        file = (campaign.base_folder / simulated.scenario).resolve()
        contents[file] = content(file)
        for name in _inputs_of_scenario(file):
            inner = (file.parent / name).resolve()
            contents[inner] = content(inner)
    elif calibrated is not None and calibrated.positions is not None:
        file = (campaign.base_folder / calibrated.positions).resolve()
        contents[file] = content(file)
    root = Path(os.path.commonpath([file.parent for file in contents]))
    files = sorted((PurePosixPath(file.relative_to(root)).as_posix(), content) for file, content in contents.items())
    name = PurePosixPath(path.resolve().relative_to(root)).as_posix()
    return Order(name, tuple(files), code_hash()), campaign


def _inputs_of_scenario(file: Path) -> Iterable[str]:
    if file.suffix.lower() != ".toml":
        raise InputError(f"{file}: simulation.scenario must be a scenario file (TOML)")
    scenario = read_scenario(file)
    for setting in scenario.fmus.values():
        for name in (setting.fmu, setting.parameters_from):
            if name is not None:
                yield name
    for stimulus in scenario.stimuli:
        for name in (stimulus.csv, stimulus.programme):
            if name is not None:
                yield name


@dataclass(frozen=True)
class ResultColumns:
    """Columns of a campaign's data set: parameters, kept outputs, and flags for diagnosis and record."""

    parameters: dict[str, type[pl.DataType]]
    outputs: dict[str, Output]
    diagnosis: bool = False
    record: bool = False

    @property
    def schema(self) -> dict[str, type[pl.DataType]]:
        """Name -> data type, in order."""
        dtypes: dict[str, type[pl.DataType]] = {"run": pl.Int64, **self.parameters, "failed": pl.String}
        for name, output in self.outputs.items():
            dtypes[name] = output.dtype
        if self.diagnosis:
            dtypes["diagnosis"] = pl.String
        return dtypes


@dataclass(frozen=True)
class Computed:
    """A computed file of the data set, by its number: its content, and that of the file of records beside it.

    It has the number of runs, the number of failed ones, and the wall-clock and processor time [s].
    """

    partition: int
    scalars: bytes
    records: bytes | None
    runs: int
    failures: int
    seconds: float = 0.0
    cpu_seconds: float = 0.0


@dataclass(frozen=True)
class Store:
    """The folder of a campaign."""

    folder: Path
    campaign: Campaign

    def scalars_path(self, partition: int) -> Path:
        """Return the file of a partition's scalars."""
        return self.folder / RUNS / self.campaign.file_name(partition)

    def records_path(self, partition: int) -> Path:
        """Return the file of a partition's records."""
        return self.folder / RECORDS / self.campaign.file_name(partition)

    def write(self, computed: Computed) -> None:
        """Write a partition, its scalars last: their file marks a whole partition."""
        if computed.records is not None:
            _write(self.records_path(computed.partition), computed.records)
        _write(self.scalars_path(computed.partition), computed.scalars)

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write the results over all runs."""
        write_text(self.folder / SUMMARY, json_text(summary, indent=1))

    def missing(self) -> tuple[list[int], int, int]:
        """Return the missing or incomplete partitions, the number of runs there, and the number of failed ones."""
        missing, runs, failed = [], 0, 0
        for partition in range(self.campaign.partitions):
            failures = self._failures(partition)
            if failures is None:
                missing.append(partition)
            else:
                runs += len(self.campaign.runs_of(partition))
                failed += failures
        return missing, runs, failed

    def _failures(self, partition: int) -> int | None:
        """Return the number of failed runs of a partition; None if it is missing or incomplete."""
        path = self.scalars_path(partition)
        if not path.is_file() or (self.campaign.keep.record and not self.records_path(partition).is_file()):
            return None
        runs = self.campaign.runs_of(partition)
        try:
            table = pl.read_parquet(io.BytesIO(path.read_bytes()), columns=["run", "failed"])
        except (pl.exceptions.PolarsError, OSError):
            return None
        complete = table.height == len(runs) and table["run"][0] == runs[0] and table["run"][-1] == runs[-1]
        if not complete:
            return None
        return int(table["failed"].is_not_null().sum())


def _write(path: Path, content: bytes) -> None:
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def manifest_of(order: Order, campaign: Campaign, columns: ResultColumns, content: bytes) -> dict[str, Any]:
    """Return the manifest: the campaign of a folder, and the meaning of its scalars."""
    return {
        "schema": SCHEMA,
        "campaign": campaign.as_written(),
        "campaign_file": content.decode("utf-8-sig").replace("\r\n", "\n"),
        "order_sha256": order.sha256,
        "code_sha256": order.code,
        "files": order.hashes,
        "versions": {name: fmus.version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "runs": campaign.runs,
        "runs_of_partition": campaign.partition_size,
        "partitions": campaign.partitions,
        "outputs": {
            name: {"type": output.dtype.__name__, "better": output.better, "good": list(output.good)}
            for name, output in columns.outputs.items()
        },
    }


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a campaign's folder.

    Raises InputError if there is none.
    """
    path = folder / MANIFEST
    refuse_irregular(path)
    try:
        text = path.read_bytes()
        content = json.loads(text)
    except OSError as error:
        raise InputError(f"{folder}: holds no campaign ({MANIFEST}: {error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: is not the manifest of a campaign (schema {SCHEMA})")
    outputs = content.get("outputs", {})
    if not isinstance(outputs, dict) or not all(isinstance(output, dict) for output in outputs.values()):
        raise InputError(f"{path}: outputs: is not an object of objects")
    return content


def open_result(folder: Path) -> tuple[Store, dict[str, Any]]:
    """Return the results in a folder, for reading."""
    manifest = read_manifest(folder)
    for path in (folder / MANIFEST, *folder.joinpath(RUNS).glob("*.parquet")):
        if path.is_file():
            note_read(path, path.stat())
    text = str(manifest.get("campaign_file", ""))
    campaign = parse_campaign(text.encode(), folder / CAMPAIGN_FILE)
    return Store(folder, campaign), manifest


@contextlib.contextmanager
def opened_store(
    folder: Path, order: Order, campaign: Campaign, columns: ResultColumns, content: bytes, *, resume: bool
) -> Iterator[Store]:
    """Lock a campaign's folder while the block lasts; `content` is the bytes of the campaign file.

    Raises InputError if it holds another campaign, if it holds this one while `resume` is false, or if another process
    works in it.
    """
    made_folder(folder / RUNS, folder)
    store = Store(folder, campaign)
    with _alone(folder):
        manifest = manifest_of(order, campaign, columns, content)
        written = (json.dumps(manifest, indent=1, ensure_ascii=False) + "\n").encode()
        if (folder / MANIFEST).exists():
            _check_same(folder, order, resume=resume)
        elif any((folder / RUNS).glob("*.parquet")):
            raise InputError(f"--out {folder}: holds files of which {MANIFEST} is missing; give another folder")
        else:
            try:
                _write(folder / MANIFEST, written)
            except BaseException:
                # A campaign that never began leaves only the lock, for which others may be waiting.
                (folder / RUNS).rmdir()
                raise
        for place in (folder, folder / RUNS, folder / RECORDS):
            # Incomplete files of a killed process.
            for path in place.glob(".*"):
                path.unlink(missing_ok=True)
        yield store


def _check_same(folder: Path, order: Order, *, resume: bool) -> None:
    if not resume:
        raise InputError(f"--out {folder}: already has a campaign; continue it with --resume, or give another folder")
    before = read_manifest(folder)
    if before.get("order_sha256") == order.sha256:
        return
    files = before.get("files", {})
    now = order.hashes
    changed = [name for name in sorted({*files, *now}) if files.get(name) != now.get(name)]
    if changed:
        why = f"{changed[0]} is another one than when it was begun"
    else:
        why = "Trihedron, or what it uses, is another version than when it was begun"
    raise InputError(f"--resume: {folder} cannot be gone on with: {why}; results would be mixed: give another --out")


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep others out of a folder."""
    with contextlib.ExitStack() as stack:
        try:
            with said_writable(folder / LOCK):
                stack.enter_context(locked(folder / LOCK))
        except Taken:
            raise InputError(f"--out {folder}: another process uses it") from None
        yield
