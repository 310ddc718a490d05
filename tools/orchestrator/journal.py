"""What is recorded: columns with units in their names, block by block, in memory while it is small, whole at its end.

A long run needs no more memory than a short one: its blocks go to disk.
While a run goes on, what is recorded stands in `run.incomplete/` in the run's folder: Parquet files, each whole, and a
run.json that says `"complete": false`. A run that is killed leaves them; every other run takes them away.
"""

import ctypes
import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from ..errors import InputError, reason, said_of
from ..files import whole_folder
from .interface import VALUE_TYPES, Interface, Variable, conversion, refer, suffix_for
from .program import Ports
from .stimuli import Grid

INCOMPLETE = "run.incomplete"
FLUSH_SECONDS = 5.0
WHOLE_BYTES = 256 << 20
"""A record of at most so many bytes is written in one go."""
ROW_GROUP = 1 << 18
BLOCK_BYTES = 16 << 20
Keep = Callable[[pl.DataFrame, int], None]
"""(rows, communication point of the last one): called for each block."""


@dataclass(frozen=True)
class Column:
    """A column of the record: value = factor * variable + offset."""

    name: str
    fmu: str
    variable: Variable
    factor: float = 1.0
    offset: float = 0.0

    def series(self, values: Any) -> pl.Series:
        """The column from the recorded values of its variable, in the variable's own unit."""
        if self.variable.kind == "String":
            return pl.Series(self.name, values, dtype=pl.String)
        if self.variable.kind == "Boolean":
            return pl.Series(self.name, np.asarray(values) != 0, dtype=pl.Boolean)
        if self.variable.kind != "Real":
            return pl.Series(self.name, np.array(values))
        found = np.array(values, dtype=np.float64)
        same = (self.factor, self.offset) == (1.0, 0.0)
        return pl.Series(self.name, found if same else self.factor * found + self.offset)


def resolve_columns(columns: Mapping[str, str] | None, interfaces: Mapping[str, Interface]) -> list[Column]:
    """The columns of the record; every output of every FMU where none are named.

    An InputError for an unknown variable, an array, or a suffix that does not fit the variable's unit.
    """
    resolved = []
    if columns is None:
        for fmu, interface in interfaces.items():
            for variable in interface.variables.values():
                if variable.causality == "output" and variable.access in VALUE_TYPES:
                    suffix = suffix_for(variable.unit)
                    name = f"{fmu}.{variable.name}_{suffix}" if suffix else f"{fmu}.{variable.name}"
                    resolved.append(Column(name, fmu, variable))
        return resolved
    for name, text in columns.items():
        with said_of(f"record.columns.{name}"):
            if name == "time_s" or not name.strip() or any(c in name for c in ',"\r\n'):
                raise InputError("is not a name for a column (time_s is there by itself)")
            interface, variables = refer(text, interfaces, ("output",))
            if len(variables) != 1:
                raise InputError(f"'{text}' has {len(variables)} elements; a column takes one: '{text}[1]'")
            scaled = conversion(variables[0].unit, name, interface.scales)
            _ = variables[0].value_type
            resolved.append(Column(name, interface.name, variables[0], *scaled))
    return resolved


def recorded_variables(columns: Iterable[Column], fmu: str) -> list[Variable]:
    """The variables of one FMU that are recorded, each once."""
    return list(dict.fromkeys(column.variable for column in columns if column.fmu == fmu))


class Blocks:
    """Rows of recorded values, of every so manyth communication point, handed on when a block is full.

    The loops copy `records` (N, 3) for each row: target of row 0, source, bytes. A block has `rows` rows; `row` is the
    next one to be recorded.
    """

    def __init__(
        self, columns: Sequence[Column], ports: Mapping[str, Ports], grid: Grid, every: int, keep: Keep
    ) -> None:
        self._columns, self._grid, self._keep, self.every = columns, grid, keep, every
        self._tick = self.row = 0
        recorded = [(n, p.outputs[a], count) for n, p in ports.items() for a, count in p.recorded.items() if count]
        numbers = [(name, port, count) for name, port, count in recorded if port.access != "String"]
        width = sum(count * port.values.itemsize for _, port, count in numbers)
        self.rows = max(1, min(grid.steps // every + 1, BLOCK_BYTES // max(width, 8)))
        self._values: dict[tuple[str, str], np.ndarray] = {}
        self._texts: dict[tuple[str, str], list[str]] = {}
        self._addresses, copies = [], []
        for name, port, count in numbers:
            table = np.zeros((self.rows, count), dtype=port.values.dtype)
            copies.append((table.ctypes.data, port.address, count * table.itemsize))
            self._values |= {(name, v.name): table[:, at] for at, v in enumerate(port.variables[:count])}
        for name, port, count in recorded:
            for at, variable in enumerate(port.variables[:count] if port.access == "String" else ()):
                texts = self._texts[name, variable.name] = []
                self._addresses.append((texts, port.values, at))
        self.records = np.array(copies, dtype=np.int64).reshape(-1, 3)

    @property
    def has_text(self) -> bool:
        """Whether strings are recorded, which only Python can keep."""
        return bool(self._texts)

    def record(self) -> None:
        """Record a row now."""
        for target, source, size in self.records.tolist():
            ctypes.memmove(target + self.row * size, source, size)
        self.keep_texts()
        self.advance(self.row + 1)

    def keep_texts(self) -> None:
        """Keep the strings of a row."""
        for texts, addresses, at in self._addresses:
            address = int(addresses[at])
            texts.append(ctypes.string_at(address).decode("utf-8", "replace") if address else "")

    def advance(self, row: int) -> None:
        """So many rows of the block are recorded; a full block is handed on."""
        self.row = row
        if row == self.rows:
            self.flush()

    def flush(self) -> None:
        """Hand on what is recorded."""
        if not self.row:
            return
        end = self._tick + self.row * self.every
        ticks = np.arange(self._tick, end, self.every)
        series = [pl.Series("time_s", self._grid.start + ticks * self._grid.step)]
        for column in self._columns:
            at = (column.fmu, column.variable.name)
            series.append(column.series(self._texts[at] if at in self._texts else self._values[at][: self.row]))
        self._keep(pl.DataFrame(series), end - self.every)
        self._tick, self.row = end, 0
        for texts in self._texts.values():
            texts.clear()


class Journal:
    """The rows of a run: in its folder with a run.json that says its provenance, without a folder in memory."""

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
        with _written(self._out):
            folder = self.folder
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            if self._out is not None and self._out.exists() and not self._out.is_dir():
                raise InputError(f"{self._out}: is a file; give the name of a folder")
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            self._made = missing
            (folder / "run.json").write_text(provenance_text({**self._provenance, "complete": False}), encoding="utf-8")

    def _wait(self) -> None:
        """Wait for the part that is being written."""
        if self._writing is not None:
            writing, self._writing = self._writing, None
            with _written(self.folder):
                writing.result()

    def drop(self) -> None:
        """Forget the run: nothing of it is left on disk."""
        self._writer.shutdown(wait=True)
        if self._parts:
            shutil.rmtree(self.folder, ignore_errors=True)
            for folder in self._made:
                if folder != self.folder and folder.is_dir() and not any(folder.iterdir()):
                    folder.rmdir()

    def finish(self, form: str, more: Mapping[str, Any]) -> tuple[pl.DataFrame | None, tuple[Path, ...]]:
        """Write the run whole into its folder, as "parquet" or "csv", with run.json, which says `more` too.

        Gives the rows, unless they are too many to be in memory, and the files.
        """
        if self._out is None:
            return pl.concat(self._tables, rechunk=True), ()
        try:
            self._wait()
            with _written(self._out):
                table = self._write(self._out, form, {**self._provenance, **more})
            # Of this run, or of one that was killed here.
            shutil.rmtree(self.folder, ignore_errors=True)
        finally:
            self.drop()
        # A run of another form that stood here would not be the one that run.json describes.
        for stale in {"run.csv", "run.parquet"} - {f"run.{form}"}:
            (self._out / stale).unlink(missing_ok=True)
        return table, (self._out / f"run.{form}", self._out / "run.json")

    def _write(self, out: Path, form: str, provenance: dict[str, Any]) -> pl.DataFrame | None:
        parts = [self.folder / f"{n:08d}.parquet" for n in range(self._parts)]
        with whole_folder(out) as beside:
            data, table = beside / f"run.{form}", None
            if self._bytes <= WHOLE_BYTES:
                table = pl.concat([*(pl.read_parquet(part) for part in parts), *self._tables], rechunk=True)
                table.write_csv(data) if form == "csv" else table.write_parquet(data)
            else:
                rows = pl.concat([*(pl.scan_parquet(part) for part in parts), *(t.lazy() for t in self._tables)])
                if form == "csv":
                    rows.sink_csv(data, maintain_order=True)
                else:
                    rows.sink_parquet(data, row_group_size=ROW_GROUP, maintain_order=True)
            (beside / "run.json").write_text(provenance_text(provenance), encoding="utf-8", newline="\n")
        return table


@contextmanager
def _written(folder: Path | None) -> Iterator[None]:
    """Say of a folder that it cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({reason(error)})") from error
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{folder}: cannot be written ({error})") from error


def _write_part(rows: pl.DataFrame, part: Path) -> None:
    """A part appears whole or not at all."""
    beside = part.with_suffix(".writing")
    rows.write_parquet(beside, compression="uncompressed", statistics=False)
    beside.replace(part)


def provenance_text(provenance: Mapping[str, Any]) -> str:
    """run.json."""
    return json.dumps(provenance, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
