"""The record on its way: kept in memory while it is small, on disk while it grows, whole at its end.

While a run goes on, what is recorded stands in `run.incomplete/` in the run's folder: Parquet files, each whole, and a
run.json that says `"complete": false`. A run that is killed leaves them; every other run takes them away.
"""

import json
import shutil
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import polars as pl

from ..errors import InputError, reason
from ..files import whole_folder

INCOMPLETE = "run.incomplete"
FLUSH_SECONDS = 5.0
WHOLE_BYTES = 256 << 20
"""A record of at most so many bytes is written in one go."""
ROW_GROUP = 1 << 18
Finished = tuple[pl.DataFrame | None, tuple[Path, ...]]


class Journal:
    """The rows of a run.

    Parameters
    ----------
    out : Path or None
        the run's folder; None: everything stays in memory
    provenance : dict
        what run.json says of the run
    """

    def __init__(self, out: Path | None, provenance: Mapping[str, Any]) -> None:
        self._out, self._provenance = out, provenance
        self._tables: list[pl.DataFrame] = []
        self._parts = self._bytes = 0
        self._made: list[Path] = []
        self._flushed = time.monotonic()
        self._writer = ThreadPoolExecutor(1)
        self._writing: Future[None] | None = None

    @property
    def due(self) -> bool:
        """Whether rows have been waiting in memory for long."""
        return self._out is not None and time.monotonic() - self._flushed > FLUSH_SECONDS

    @property
    def empty(self) -> bool:
        """Whether there are no rows yet."""
        return not self._tables and not self._parts

    @property
    def folder(self) -> Path:
        """Where the rows are while the run goes on."""
        assert self._out is not None
        return self._out / INCOMPLETE

    def add(self, table: pl.DataFrame, *, more: bool) -> None:
        """Take rows; `more`: others will follow."""
        self._bytes += int(table.estimated_size())
        self._tables.append(table)
        if self._out is not None and (self._parts or more):
            self._spill()

    def _spill(self) -> None:
        """Write what waits in memory as a part, beside the run."""
        if not self._parts:
            self._begin()
        part = self.folder / f"{self._parts:08d}.parquet"
        self._wait()
        rows = pl.concat(self._tables)
        self._tables.clear()
        self._parts += 1
        self._flushed = time.monotonic()
        self._writing = self._writer.submit(_write_part, rows, part)

    def _begin(self) -> None:
        try:
            folder = self.folder
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            if self._out is not None and self._out.exists() and not self._out.is_dir():
                raise InputError(f"{self._out}: is a file; give the name of a folder")
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            self._made = missing
            (folder / "run.json").write_text(provenance_text({**self._provenance, "complete": False}), encoding="utf-8")
        except OSError as error:
            raise InputError(f"{self._out}: cannot be written ({reason(error)})") from error

    def _wait(self) -> None:
        """Wait for the part that is being written."""
        if self._writing is not None:
            writing, self._writing = self._writing, None
            try:
                writing.result()
            except OSError as error:
                raise InputError(f"{self.folder}: cannot be written ({reason(error)})") from error
            except pl.exceptions.PolarsError as error:
                raise InputError(f"{self.folder}: cannot be written ({error})") from error

    def drop(self) -> None:
        """Forget the run: nothing of it is left on disk."""
        self._writer.shutdown(wait=True)
        if self._parts:
            shutil.rmtree(self.folder, ignore_errors=True)
            for folder in self._made:
                if folder != self.folder and folder.is_dir() and not any(folder.iterdir()):
                    folder.rmdir()

    def finish(self, form: str, more: Mapping[str, Any]) -> Finished:
        """Write the run whole into its folder, with run.json.

        Parameters
        ----------
        form : str
            "parquet" or "csv"
        more : mapping
            what run.json says beside the provenance

        Returns
        -------
        table : DataFrame or None
            the rows, unless they are too many to be in memory
        files : tuple of Path
        """
        if self._out is None:
            return pl.concat(self._tables, rechunk=True), ()
        try:
            self._wait()
            written = self._written(self._out, form, {**self._provenance, **more})
            # Of this run, or of one that was killed here.
            shutil.rmtree(self.folder, ignore_errors=True)
            return written
        except pl.exceptions.PolarsError as error:
            raise InputError(f"{self._out}: cannot be written ({error})") from error
        finally:
            self.drop()

    def _written(self, out: Path, form: str, provenance: dict[str, Any]) -> Finished:
        data = f"run.{form}"
        table: pl.DataFrame | None = None
        parts = [self.folder / f"{n:08d}.parquet" for n in range(self._parts)]
        with whole_folder(out) as beside:
            if self._bytes <= WHOLE_BYTES:
                table = pl.concat([*(pl.read_parquet(part) for part in parts), *self._tables], rechunk=True)
                if form == "csv":
                    table.write_csv(beside / data)
                else:
                    table.write_parquet(beside / data)
            else:
                rows = pl.concat([*(pl.scan_parquet(part) for part in parts), *(t.lazy() for t in self._tables)])
                if form == "csv":
                    rows.sink_csv(beside / data, maintain_order=True)
                else:
                    rows.sink_parquet(beside / data, row_group_size=ROW_GROUP, maintain_order=True)
            (beside / "run.json").write_text(provenance_text(provenance), encoding="utf-8", newline="\n")
        # A run of another form that stood here would not be the one that run.json describes.
        for stale in {"run.csv", "run.parquet"} - {data}:
            (out / stale).unlink(missing_ok=True)
        return table, (out / data, out / "run.json")


def _write_part(rows: pl.DataFrame, part: Path) -> None:
    """A part appears whole or not at all."""
    beside = part.with_suffix(".writing")
    rows.write_parquet(beside, compression="uncompressed", statistics=False)
    beside.replace(part)


def provenance_text(provenance: Mapping[str, Any]) -> str:
    """run.json."""
    return json.dumps(provenance, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
