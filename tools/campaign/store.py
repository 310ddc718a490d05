"""What a campaign is to whoever computes it, and its folder: manifest, files of the data set, what is missing of it.

Files appear whole.
"""

import contextlib
import hashlib
import io
import json
import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path, PurePosixPath
from typing import Any

import polars as pl

from ... import fmus, models
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
from ..locks import Taken, locked
from ..orchestrator.scenario import read_scenario
from .file import Campaign, parse_campaign
from .kinds import Output

SCHEMA = "trihedron.campaign-result/1"
MANIFEST, CAMPAIGN_FILE, LOCK = "campaign.json", "campaign.toml", "campaign.lock"
SUMMARY, PAGE = "summary.json", "index.html"
RUNS, RECORDS = "runs", "records"
_PACKAGES = ("trihedron", "numpy", "scipy", "highspy", "numba", "polars", "fmpy")
_CODE = (
    "bounded",
    "calibration",
    "campaign",
    "compiled.py",
    "diagnosis",
    "evidence",
    "motion",
    "orchestrator",
    "papers",
    "records",
    "trials",
)
"""Sub-packages and modules of the tools that results follow from, beside models and fmus."""


@dataclass(frozen=True)
class Order:
    """Everything that a worker needs to know of a campaign, wherever it is.

    The campaign file and all that it reads, by their paths below the folder that they share, and the `code_hash` of
    whoever gives the order.
    """

    campaign_file: str
    files: tuple[tuple[str, bytes], ...]
    code: str

    @cached_property
    def sha256(self) -> str:
        """Of the names and contents of all files, and of the code."""
        digest = hashlib.sha256(f"{self.campaign_file}\0{self.code}".encode())
        for name, content in self.files:
            digest.update(f"\0{name} {len(content)}\0".encode() + content)
        return digest.hexdigest()

    def unpack(self, folder: Path) -> Campaign:
        """Write the files into a folder; returns the campaign as it is read there."""
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
    """Read a campaign file and all that it reads; an InputError for what cannot be read or is not what it should be."""

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


@cache
def code_hash() -> str:
    """Hash of the code that results follow from, and of the versions of what it uses."""
    digest = hashlib.sha256(f"{platform.python_version()} {platform.machine()}".encode())
    for package in _PACKAGES:
        digest.update(f"\0{package} {fmus.version(package)}".encode())
    tools = Path(__file__).parents[1]
    places = [Path(str(package.__file__)).parent for package in (models, fmus)]
    places += [tools / name for name in _CODE]
    for place in places:
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"\0{path.relative_to(place.parent).as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class ResultColumns:
    """Columns of a campaign's data set: parameters, the outputs that are kept, and whether diagnosis and record are."""

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
    """A file of the data set that was computed, by its number: its content, and that of the file of records beside it.

    It has so many runs, of which some failed, and took so long, by the clock and of the processor [s].
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
        """The file of a partition's scalars."""
        return self.folder / RUNS / self.campaign.file_name(partition)

    def records_path(self, partition: int) -> Path:
        """The file of a partition's records."""
        return self.folder / RECORDS / self.campaign.file_name(partition)

    def write(self, computed: Computed) -> None:
        """Keep a partition; its scalars last: where they are, the partition is whole."""
        if computed.records is not None:
            _write(self.records_path(computed.partition), computed.records)
        _write(self.scalars_path(computed.partition), computed.scalars)

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Keep what was computed over all runs."""
        write_text(self.folder / SUMMARY, json_text(summary, indent=1))

    def missing(self) -> tuple[list[int], int, int]:
        """Partitions that are not there or not whole; runs that are there, and how many of them failed."""
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
        """How many runs of a partition failed; None where it is not there, or not whole."""
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
    """What says which campaign a folder holds, and what its scalars are."""
    return {
        "schema": SCHEMA,
        "campaign": campaign.as_written(),
        "campaign_file": content.decode("utf-8-sig").replace("\r\n", "\n"),
        "order_sha256": order.sha256,
        "code_sha256": order.code,
        "files": order.hashes,
        "versions": {name: fmus.version(name) for name in _PACKAGES} | {"python": platform.python_version()},
        "runs": campaign.runs,
        "runs_of_partition": campaign.partition_size,
        "partitions": campaign.partitions,
        "outputs": {
            name: {"type": output.dtype.__name__, "better": output.better, "good": list(output.good)}
            for name, output in columns.outputs.items()
        },
    }


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a campaign's folder; InputError where there is none."""
    path = folder / MANIFEST
    try:
        text = path.read_bytes()
        content = json.loads(text)
    except OSError as error:
        raise InputError(f"{folder}: holds no campaign ({MANIFEST}: {error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: is not the manifest of a campaign (schema {SCHEMA})")
    return content


def open_result(folder: Path) -> tuple[Store, dict[str, Any]]:
    """The results that a folder holds, for reading."""
    manifest = read_manifest(folder)
    for path in (folder / MANIFEST, *folder.joinpath(RUNS).glob("*.parquet")):
        note_read(path, path.stat())
    text = str(manifest.get("campaign_file", ""))
    campaign = parse_campaign(text.encode(), folder / CAMPAIGN_FILE)
    return Store(folder, campaign), manifest


@contextlib.contextmanager
def opened_store(
    folder: Path, order: Order, campaign: Campaign, columns: ResultColumns, content: bytes, *, resume: bool
) -> Iterator[Store]:
    """A campaign's folder, for nobody else while the block lasts; `content` is the bytes of the campaign file.

    An InputError where it holds another campaign, or this one while `resume` is false, or somebody works in it.
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
                # A campaign that was never begun leaves nothing but the lock, which others may wait for.
                (folder / RUNS).rmdir()
                raise
        for place in (folder, folder / RUNS, folder / RECORDS):
            # Half files of a process that was killed.
            for path in place.glob(".*"):
                path.unlink(missing_ok=True)
        yield store


def _check_same(folder: Path, order: Order, *, resume: bool) -> None:
    if not resume:
        raise InputError(f"--out {folder}: holds a campaign already; --resume goes on with it, or give another folder")
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
            raise InputError(f"--out {folder}: another process works there") from None
        yield
