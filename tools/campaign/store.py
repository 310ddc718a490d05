"""The folder of a campaign: its manifest, the files of its data set, what is missing of it. Files appear whole."""

import contextlib
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from ..errors import InputError
from ..files import whole_file, write_text
from .file import Campaign, parse_campaign
from .runs import Columns, Computed, Order, versions

SCHEMA = "trihedron.campaign-result/1"
MANIFEST, CAMPAIGN_FILE, LOCK = "campaign.json", "campaign.toml", ".lock"
SUMMARY, PAGE = "summary.json", "index.html"
RUNS, RECORDS = "runs", "records"


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
            with whole_file(self.records_path(computed.partition)) as beside:
                beside.write_bytes(computed.records)
        with whole_file(self.scalars_path(computed.partition)) as beside:
            beside.write_bytes(computed.scalars)

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Keep what was computed over all runs."""
        write_text(self.folder / SUMMARY, json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n")

    def missing(self) -> tuple[list[int], int, int]:
        """Partitions that are not there or not whole; runs that are there, and how many of them failed."""
        missing, done, failed = [], 0, 0
        for partition in range(self.campaign.partitions):
            found = self._failures(partition)
            if found is None:
                missing.append(partition)
            else:
                done += len(self.campaign.runs_of(partition))
                failed += found
        return missing, done, failed

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
        whole = table.height == len(runs) and table["run"][0] == runs[0] and table["run"][-1] == runs[-1]
        return int(table["failed"].is_not_null().sum()) if whole else None

    def tidy(self) -> None:
        """Take away what a killed process left beside its files."""
        for folder in (self.folder, self.folder / RUNS, self.folder / RECORDS):
            for path in folder.glob(".*") if folder.is_dir() else ():
                if path.name != LOCK and path.is_file():
                    path.unlink(missing_ok=True)


def manifest_of(order: Order, campaign: Campaign, columns: Columns, content: bytes) -> dict[str, Any]:
    """What says which campaign a folder holds, and what its scalars are."""
    return {
        "schema": SCHEMA,
        "campaign": campaign.as_written(),
        "campaign_file": content.decode("utf-8-sig").replace("\r\n", "\n"),
        "order_sha256": order.sha256,
        "code_sha256": order.code,
        "files": order.hashes,
        "versions": versions(),
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
        content = json.loads(path.read_bytes())
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
    text = str(manifest.get("campaign_file", ""))
    return Store(folder, parse_campaign(text.encode(), folder / CAMPAIGN_FILE)), manifest


@contextlib.contextmanager
def opened(
    folder: Path, order: Order, campaign: Campaign, columns: Columns, content: bytes, *, resume: bool
) -> Iterator[Store]:
    """A campaign's folder, for nobody else while the block lasts; `content` is the bytes of the campaign file.

    Raises
    ------
    InputError
        a folder that holds another campaign, or this one while `resume` is false, or that somebody works in
    """
    try:
        (folder / RUNS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be made a folder ({error.strerror})") from error
    store = Store(folder, campaign)
    with locked(folder):
        if (folder / MANIFEST).exists():
            _check_same(folder, order, resume=resume)
        elif any((folder / RUNS).glob("*.parquet")):
            raise InputError(f"--out {folder}: holds files of which {MANIFEST} is missing; give another folder")
        store.tidy()
        if not (folder / MANIFEST).exists():
            manifest = manifest_of(order, campaign, columns, content)
            write_text(folder / MANIFEST, json.dumps(manifest, indent=1, ensure_ascii=False) + "\n")
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
def locked(folder: Path) -> Iterator[None]:
    """Keep others out of a folder; the lock goes with the process, however that ends."""
    try:
        import fcntl
    except ImportError:
        # No such locks here; two campaigns in one folder write the same files with the same bytes.
        yield
        return
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"--out {folder}: another process works there") from error
        except OSError:
            # A file system without locks.
            pass
        try:
            yield
        finally:
            (folder / LOCK).unlink(missing_ok=True)
