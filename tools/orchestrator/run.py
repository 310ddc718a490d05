"""A scenario from its FMUs to its record: run once and written, or prepared once and run many times.

While a run goes on, what is recorded stands in `run.incomplete/` in the run's folder: Parquet files, each whole, and a
run.json that says `"complete": false`. A run that is killed leaves them; every other run takes them away. A long run
needs no more memory than a short one.
"""

import ctypes
import platform
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from multiprocessing.util import Finalize
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import polars as pl
from pydantic import Field

from ...fmus import version
from ..errors import InputError, one_line
from ..files import at_once, json_text, make_folders, said_writable, whole_folder
from ..progress import progress_bar
from ..records import PositionRecord, RawRecord, read_record, write_record
from ..records.read import read_written
from ..records.rests import position_record_of
from ..result import ABSENT, Result
from .archive import temporary_folder
from .load import Sources, interfaces_of, load_fmus, resolve_parameters
from .loops import Assembly, run_fmus
from .program import Ports
from .recorded import RecordColumn, recorded_variables, resolve_columns
from .scenario import Scenario
from .stimuli import check_sources, resolve_stimuli
from .wiring import check_states, paces_of, resolve_connections, stepping_groups

SCHEMA = "trihedron.run/1"
RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""A raw record of more rows is not averaged: it is read whole."""
INCOMPLETE, POSITIONS = "run.incomplete", "positions.csv"
FLUSH_SECONDS = 5.0
WHOLE_BYTES = 256 << 20
"""A record of at most so many bytes is written in one go."""
ROW_GROUP = 1 << 18
_PACKAGES = ("trihedron", "fmpy", "pythonfmu", "polars")


class Simulation(Result):
    """A scenario that was run, and its rests averaged where it is a raw record of a table.

    Attributes
    ----------
    title : str
        of the scenario
    rows : int
        recorded
    columns : list of str
        names of the recorded columns, `time_s` first
    final_time_s : float
    rests : int or None
        how many were averaged; None where the run is no raw record of a table, or where `no_positions` says why
    ended : str
        which FMU has asked for the end of the run before its stop time, and when; else empty
    files : tuple of Path
        everything that was written
    ignored_parameters : tuple of str
        parameters of an .ssp that name nothing in it
    scenario : Scenario
        as it was run
    provenance : dict
        what run.json holds: the scenario, versions, content hashes
    averages : PositionRecord or None
        the averaged rests
    """

    schema_: Literal["trihedron.simulation/1"] = Field(default="trihedron.simulation/1", alias="schema")
    title: str
    rows: int
    columns: list[str]
    final_time_s: float
    rests: int | None = Field(default=None, alias="positions")
    no_positions: str = ""
    ended: str = ""
    files: tuple[Path, ...] = ()
    ignored_parameters: tuple[str, ...] = ()
    scenario: Scenario = Field(default=ABSENT, exclude=True, repr=False)
    provenance: dict[str, Any] = Field(default=ABSENT, exclude=True, repr=False)
    averages: PositionRecord | None = Field(default=None, exclude=True, repr=False)
    held: pl.DataFrame | None = Field(default=None, exclude=True, repr=False)
    """The record; None where it is too long for memory and only in the file."""
    units: dict[str, str] = Field(default={}, exclude=True, repr=False)
    """Column -> unit of its variable, where that is recorded as it is."""
    beside: Path | None = Field(default=None, exclude=True, repr=False)
    """Folder where the files are until they appear."""

    @cached_property
    def table(self) -> pl.DataFrame:
        """The rows in memory: `time_s` and the recorded columns; row k is the k-th recorded communication point."""
        return self.rows_of_file().collect()

    def rows_of_file(self) -> pl.LazyFrame:
        """The same, read as far as it is needed."""
        if self.held is not None:
            return self.held.lazy()
        path = self.files[0]
        if self.beside is not None and (self.beside / path.name).exists():
            path = self.beside / path.name
        if path.suffix == ".csv":
            return pl.scan_csv(path)
        return pl.scan_parquet(path)

    @property
    def positions(self) -> PositionRecord | None:
        """The averaged rests, where the run is a raw record of a table."""
        return self.averages

    @property
    def height(self) -> int:
        """Recorded rows."""
        return self.rows

    def position_record(self) -> PositionRecord:
        """The averaged rests; an InputError where the run is no raw record of a table."""
        if self.averages is None:
            raise InputError(self.no_positions or "the simulation has recorded no position record of a table")
        return self.averages

    def __len__(self) -> int:
        return self.rows

    def __getitem__(self, column: str) -> pl.Series:
        return self.table[column]

    def to_polars(self) -> pl.DataFrame:
        """The run: row k is the k-th recorded communication point."""
        return self.table


class PreparedScenario:
    """A scenario whose FMUs are unpacked, checked and loaded once, ready to be run again and again.

    Each run has new instances of the FMUs, so no run knows of another one, and gives the bits that `simulate` gives.
    An InputError for whatever the scenario asks for and cannot be done.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self._held = scenario, []
        self._closing = ExitStack()
        # Also at the end of a process of multiprocessing, which forgets what atexit was told.
        Finalize(self, self._closing.close, exitpriority=10)
        with ExitStack() as opened:
            folder = opened.enter_context(temporary_folder())
            self.sources = Sources(scenario.base_folder)
            self.loaded = load_fmus(scenario, self.sources, folder)
            self.interfaces = interfaces_of(self.loaded)
            self._wires = resolve_connections(scenario.connections, self.interfaces)
            self._groups = stepping_groups(list(self.interfaces), self._wires, scenario.run.coupling)
            self._paces = paces_of(scenario, self.loaded, self._wires, self._groups)
            check_states(self._groups, self.loaded, scenario.run.coupling)
            self._closing.push(opened.pop_all())

    def close(self) -> None:
        """Take away the unpacked FMUs."""
        self._closing.close()

    @cached_property
    def columns(self) -> list[RecordColumn]:
        """The record's columns, without `time_s`."""
        return resolve_columns(self.scenario.record.columns, self.interfaces)

    def assemble(self, parameters: Mapping[str, Mapping[str, Any]]) -> Assembly:
        """What runs together, with some parameters in place of the scenario's own."""
        loaded = dict(self.loaded)
        for name, settings in parameters.items():
            entry = loaded[name]
            changed = resolve_parameters(entry.interface, settings)
            loaded[name] = replace(entry, values={**entry.values, **changed})
        grid, drives = resolve_stimuli(self.scenario, self.sources, loaded)
        check_sources(self._wires, drives, loaded)
        ports = {}
        for name, entry in loaded.items():
            fmu_drives = [drive for _, drive in drives if drive.fmu == name]
            recorded = recorded_variables(self.columns, name)
            ports[name] = Ports(
                entry.interface, self._wires, fmu_drives, recorded, entry.start_value, self._paces[name]
            )
        for name in loaded:
            ports[name].connect([wire for wire in self._wires if wire.target == name], ports)
        return Assembly(self._groups, self.scenario, self.columns, loaded, ports, grid)

    def run(self, parameters: Mapping[str, Mapping[str, Any]]) -> pl.DataFrame:
        """Run the scenario with some parameters in place of its own: FMU -> variable, array or element -> value."""
        if not self._held:
            # While somebody has it open, a library is not loaded again for each instance.
            with suppress(OSError):
                ours = [entry.fmu for entry in self.loaded.values() if not entry.fmu.guest]
                self._held = [ctypes.CDLL(str(fmu.library)) for fmu in ours]
        assembly = self.assemble(parameters)
        tables: list[pl.DataFrame] = []
        run_fmus(assembly, lambda rows, _: tables.append(rows))
        return pl.concat(tables)


def run_folder(scenario: Scenario) -> Path:
    """Where a run is written when nothing else is asked for: `<scenario>-run` in the current folder."""
    if scenario.source is None:
        return Path("scenario-run")
    return Path(f"{scenario.source.stem}-run")


def run_scenario(
    scenario: Scenario,
    out: Path | None = None,
    *,
    marks: Sequence[pl.Expr] = (),
    progress: bool = False,
    compiled: bool = True,
) -> Simulation:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario
    out : Path or None
        folder for run.parquet or run.csv and run.json; None: nothing is written
    marks : sequence of expressions
        further columns of the record, of what the same row has recorded
    progress : bool
        show a bar on standard error, where that is a terminal
    compiled : bool
        the loop over the steps as machine code; False: as plain Python, with the same results

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done, in one line; what an FMU that fails has given until then is
        written, and run.json says why it is not complete
    KeyboardInterrupt
        Ctrl-C; what was recorded until then is written, and run.json says that it is not complete
    """
    with _prepared(scenario) as prepared:
        return _recorded(prepared, Journal(out), lambda run: run, marks, progress=progress, compiled=compiled)


@contextmanager
def _prepared(scenario: Scenario) -> Iterator[PreparedScenario]:
    """A scenario that is run once; what goes wrong is said of it."""
    try:
        prepared = PreparedScenario(scenario)
        try:
            yield prepared
        finally:
            prepared.close()
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(one_line(f"{prefix}{error}")) from error
    except MemoryError as error:
        raise InputError("the run does not fit into memory; raise record.every or record less") from error


def _recorded(
    prepared: PreparedScenario,
    journal: "Journal",
    also: Callable[[Simulation], Simulation],
    marks: Sequence[pl.Expr] = (),
    *,
    progress: bool,
    compiled: bool = True,
) -> Simulation:
    """The run, its rows in the journal block by block; `also` adds to it, and to the folder beside the run's own."""
    assembly, scenario = prepared.assemble({}), prepared.scenario
    grid, every, form = assembly.grid, scenario.record.every, scenario.record.format
    journal.provenance = _provenance(prepared, assembly)
    reached, last, ended = 0, grid.steps // every * every, ""

    def keep(rows: pl.DataFrame, tick: int) -> None:
        nonlocal reached
        reached = tick
        journal.add(rows.with_columns(*marks), follows=reached < last)

    def kept_so_far(**entries: Any) -> str:
        """What is said of the rows that a run has left which does not come to its end."""
        if journal.empty:
            journal.drop()
            return ""
        so_far = {"complete": reached == last, "steps": reached, "final_time_s": grid.time(reached), **entries}
        # A command that ends so leaves nothing else.
        with at_once(), journal.finished(form, so_far) as (_, files, _):
            return f"; {files[0]} has the run up to {grid.time(reached):.9g} s" if files else ""

    try:
        with progress_bar("simulating", grid.steps, show=progress) as update_bar:
            ended = run_fmus(assembly, keep, progress=update_bar, flush=lambda: journal.due, compiled=compiled)
        so_far: dict[str, Any] = {}
        if ended:
            so_far = {"steps": reached, "final_time_s": grid.time(reached), "ended": ended}
        columns = ["time_s"]
        for column in assembly.columns:
            columns.append(column.name)
        for mark in marks:
            columns.append(mark.meta.output_name())
        with journal.finished(form, so_far) as (table, files, folder):
            run = Simulation(
                title=scenario.title,
                rows=reached // every + 1,
                columns=columns,
                final_time_s=so_far.get("final_time_s", journal.provenance["final_time_s"]),
                ended=ended,
                files=files,
                scenario=scenario,
                provenance={**journal.provenance, **so_far},
                held=table,
                beside=folder,
                units={c.name: c.variable.unit for c in assembly.columns if c.variable.unit and c.factor == 1.0},
            )
            return also(run)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted{kept_so_far()}") from None
    except InputError as error:
        raise InputError(f"{error}{kept_so_far(failure=str(error))}") from error
    except BaseException:
        journal.drop()
        raise


def _provenance(prepared: PreparedScenario, assembly: Assembly) -> dict[str, Any]:
    fmus = {}
    for name, entry in assembly.loaded.items():
        fmus[name] = {"source": entry.fmu.label, "model": entry.interface.model, "sha256": entry.fmu.sha256}
    return {
        "schema": SCHEMA,
        "scenario": prepared.scenario.as_written(),
        "versions": {name: version(name) for name in _PACKAGES} | {"python": platform.python_version()},
        "fmus": fmus,
        "files": dict(sorted(prepared.sources.hashes.items())),
        "order": assembly.order,
        "steps": assembly.grid.steps,
        "final_time_s": assembly.grid.time(assembly.grid.steps),
    }


def simulate_table(
    scenario: Scenario, out: Path | None = None, *, ignored: tuple[str, ...] = (), progress: bool = False
) -> Simulation:
    """Run a scenario; where its run is a raw record of a table, average its rests into a position record.

    Parameters are those of `simulate`; `ignored` goes into the result.
    """

    def averaged(run: Simulation) -> Simulation:
        update: dict[str, Any] = {"ignored_parameters": ignored}
        if set(run.columns) >= RAW_COLUMNS:
            try:
                positions = _averages(run)
                update |= {"averages": positions, "rests": len(positions)}
            except InputError as error:
                update["no_positions"] = str(error)
        if run.beside is not None and "averages" in update:
            write_record(update["averages"], run.beside / POSITIONS)
            files = list(run.files)
            files.append(run.files[0].with_name(POSITIONS))
            update["files"] = tuple(files)
        return run.model_copy(update=update)

    with _prepared(scenario) as prepared:
        return _recorded(prepared, Journal(out), averaged, progress=progress)


def _averages(run: Simulation) -> PositionRecord:
    """The averaged rests of a run, whose file stands beside its place where it has one."""
    if run.rows > MOST_ROWS:
        raise InputError(f"{run.rows} rows are too many to average here; raise record.every")
    if run.beside is None:
        raw = read_record(run.table)
    else:
        raw = read_written(run.beside / run.files[0].name)
    if not isinstance(raw, RawRecord):
        raise InputError("the run is not a raw record of a table")
    if run.beside is not None:
        raw = replace(raw, path=run.files[0])
    return position_record_of(raw)


class Journal:
    """The rows of a run: in its folder with a run.json that says its provenance, without a folder in memory."""

    provenance: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, out: Path | None) -> None:
        self._out = None if out is None else Path(out)
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

    def add(self, table: pl.DataFrame, *, follows: bool) -> None:
        """Take rows; `more`: others will follow."""
        self._bytes += int(table.estimated_size())
        self._tables.append(table)
        if self._out is not None and (self._parts or follows):
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
        with said_writable(self._out, pl.exceptions.PolarsError):
            folder = self.folder
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            if self._out is not None and self._out.exists() and not self._out.is_dir():
                raise InputError(f"{self._out}: is a file; give the name of a folder")
            shutil.rmtree(folder, ignore_errors=True)
            make_folders(folder)
            self._made = missing
            (folder / "run.json").write_text(json_text({**self.provenance, "complete": False}), encoding="utf-8")

    def _wait(self) -> None:
        """Wait for the part that is being written."""
        if self._writing is not None:
            writing, self._writing = self._writing, None
            with said_writable(self.folder, pl.exceptions.PolarsError):
                writing.result()

    def drop(self) -> None:
        """Forget the run: nothing of it is left on disk."""
        self._writer.shutdown(wait=True)
        self._tables.clear()
        if self._parts:
            shutil.rmtree(self.folder, ignore_errors=True)
            for folder in self._made[1:]:
                with suppress(OSError):
                    folder.rmdir()
        self._parts = 0

    @contextmanager
    def finished(
        self, form: str, entries: Mapping[str, Any]
    ) -> Iterator[tuple[pl.DataFrame | None, tuple[Path, ...], Path | None]]:
        """Write the run whole, as "parquet" or "csv", with run.json, which says `more` too; it appears after the block.

        Gives the rows, unless they are too many to be in memory, the files, and the folder beside their own where they
        are until then. A block that is interrupted leaves the rows to the journal.
        """
        interrupted = False
        try:
            if self._out is None:
                yield pl.concat(self._tables, rechunk=True), (), None
                return
            path = self._out / f"run.{form}"
            self._wait()
            # Those of an earlier run would not be of the one that run.json describes.
            with (
                said_writable(self._out, pl.exceptions.PolarsError),
                whole_folder(self._out, obsolete=(INCOMPLETE, "run.csv", "run.parquet", POSITIONS)) as folder,
            ):
                table = self._write(folder / path.name)
                text = json_text({**self.provenance, **entries})
                (folder / "run.json").write_text(text, encoding="utf-8", newline="\n")
                yield table, (path, self._out / "run.json"), folder
        except KeyboardInterrupt:
            interrupted = True
            raise
        finally:
            if not interrupted:
                self.drop()

    def _write(self, path: Path) -> pl.DataFrame | None:
        parts = [self.folder / f"{n:08d}.parquet" for n in range(self._parts)]
        if self._bytes <= WHOLE_BYTES:
            table = pl.concat([pl.read_parquet(part) for part in parts] + self._tables, rechunk=True)
            if path.suffix == ".csv":
                table.write_csv(path)
            else:
                table.write_parquet(path)
            return table
        rows = pl.concat([pl.scan_parquet(part) for part in parts] + [table.lazy() for table in self._tables])
        if path.suffix == ".csv":
            rows.sink_csv(path, maintain_order=True)
        else:
            rows.sink_parquet(path, row_group_size=ROW_GROUP, maintain_order=True)
        return None


def _write_part(rows: pl.DataFrame, part: Path) -> None:
    """A part appears whole or not at all."""
    incomplete = part.with_suffix(".writing")
    rows.write_parquet(incomplete, compression="uncompressed", statistics=False)
    incomplete.replace(part)
