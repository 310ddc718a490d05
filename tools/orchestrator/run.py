"""A scenario from its FMUs to its record: run once and written, or prepared once and run many times.

During a run `run.incomplete/` in the run's folder holds the recorded rows: Parquet files, each whole, and a run.json
with `"complete": false`. A killed run leaves them; the next run removes them. A long run needs no more memory than a
short one.
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
from .recorded import RecordColumn, has_outputs, recorded_variables, resolve_columns
from .scenario import Scenario
from .shared_process import run_in_one_process
from .stimuli import check_sources, resolve_stimuli
from .wiring import check_states, overruled_values, paces_of, resolve_connections, stepping_groups

SCHEMA = "trihedron.run/1"
RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""Largest raw record that is averaged [rows]: it is read whole."""
INCOMPLETE, POSITIONS = "run.incomplete", "positions.csv"
MOST_NAMED = 3
"""Columns that a note names."""
FLUSH_SECONDS, SHOW_SECONDS = 5.0, 0.1
"""Times after which waiting rows are written and shown [s]."""
MOST_WAITING = 8 << 20
"""Rows that wait in memory to be written [bytes]."""
WHOLE_BYTES = 256 << 20
"""Largest record that is written in one piece [bytes]."""
ROW_GROUP = 1 << 18
Show = Callable[[pl.DataFrame], None]
"""Takes the rows since its last call."""
_PACKAGES = ("trihedron", "fmpy", "pythonfmu", "polars")


class Simulation(Result):
    """A completed run of a scenario; its rests are averaged if it is a raw record of a table.

    Attributes
    ----------
    title : str
        title of the scenario
    rows : int
        number of recorded rows
    columns : list of str
        names of the recorded columns, `time_s` first
    final_time_s : float
        time of the last communication point [s]
    rests : int or None
        number of averaged rests; None if the run is not a raw record of a table, or if `no_positions` gives a reason
    ended : str
        the FMU that asked for the end of the run before its stop time, with the time; otherwise empty
    files : tuple of Path
        all written files
    ignored_parameters : tuple of str
        parameters of an .ssp file that match nothing in it
    scenario : Scenario
        the scenario that was run
    provenance : dict
        content of run.json: the scenario, versions, content hashes
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
    notes: tuple[str, ...] = Field(default=(), exclude=True)
    """Sentences about the run that the user must know, as a shortened last step."""
    scenario: Scenario = Field(default=ABSENT, exclude=True, repr=False)
    provenance: dict[str, Any] = Field(default=ABSENT, exclude=True, repr=False)
    averages: PositionRecord | None = Field(default=None, exclude=True, repr=False)
    held: pl.DataFrame | None = Field(default=None, exclude=True, repr=False)
    """The record; None if it is too long for memory and only in the file."""
    units: dict[str, str] = Field(default={}, exclude=True, repr=False)
    """Column -> unit of its variable, if the variable is recorded unchanged."""
    beside: Path | None = Field(default=None, exclude=True, repr=False)
    """Folder of the files until they are moved into place."""

    @cached_property
    def table(self) -> pl.DataFrame:
        """The rows in memory: `time_s` and the recorded columns; row k is the k-th recorded communication point."""
        return self.rows_of_file().collect()

    def rows_of_file(self) -> pl.LazyFrame:
        """The same table, read lazily."""
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
        """The averaged rests if the run is a raw record of a table, otherwise None."""
        return self.averages

    @property
    def height(self) -> int:
        """Number of recorded rows."""
        return self.rows

    def position_record(self) -> PositionRecord:
        """Return the averaged rests.

        Raises InputError if the run is not a raw record of a table.
        """
        if self.averages is None:
            raise InputError(self.no_positions or "the simulation has recorded no position record of a table")
        return self.averages

    def __len__(self) -> int:
        return self.rows

    def __getitem__(self, column: str) -> pl.Series:
        return self.table[column]

    def to_polars(self) -> pl.DataFrame:
        """Return the run: row k is the k-th recorded communication point."""
        return self.table


class PreparedScenario:
    """A scenario whose FMUs are unpacked, checked and loaded once, ready for many runs.

    Each run has new instances of the FMUs, so it is independent of all others and gives the bits of `simulate`. Raises
    InputError for any part of the scenario that cannot be done.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self._held = scenario, []
        self._closing = ExitStack()
        # Also at the end of a process of multiprocessing, which does not run atexit functions.
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
        """Remove the unpacked FMUs."""
        self._closing.close()

    @cached_property
    def columns(self) -> list[RecordColumn]:
        """Columns of the record, without `time_s`."""
        record = self.scenario.record
        return resolve_columns(record.columns, self.interfaces, own_units=bool(record.own_units))

    def assemble(self, parameters: Mapping[str, Mapping[str, Any]]) -> Assembly:
        """Return the parts of a run, with some parameters in place of the scenario's own."""
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
        iterated = []
        if self.scenario.run.coupling == "iterate":
            iterated = [group for group in self._groups if group.cyclic]
        cautions = [entry.caution for entry in loaded.values() if entry.caution]
        notes = [*self.scenario.notes, *cautions, *grid.notes, *overruled_values(loaded, self._wires, iterated)]
        if self.scenario.record.columns is None and not has_outputs(self.interfaces):
            notes.append(f"no FMU has outputs: {_named(self.columns)} recorded; choose with --record NAME")
        return Assembly(self._groups, self.scenario, self.columns, loaded, ports, grid, notes)

    def run(self, parameters: Mapping[str, Mapping[str, Any]]) -> pl.DataFrame:
        """Run the scenario with some parameters in place of its own: FMU -> variable, array or element -> value."""
        if not self._held:
            # While a library stays open, it is not loaded again for each instance.
            with suppress(OSError):
                ours = [entry.fmu for entry in self.loaded.values() if not entry.fmu.guest]
                self._held = [ctypes.CDLL(str(fmu.library)) for fmu in ours]
        assembly = self.assemble(parameters)
        tables: list[pl.DataFrame] = []
        run_fmus(assembly, lambda rows, _: tables.append(rows))
        return pl.concat(tables)


def _named(columns: Sequence[RecordColumn]) -> str:
    """Return the first columns of a record by name, and how many there are if these are not all."""
    names = ", ".join(column.name for column in columns[:MOST_NAMED])
    if len(columns) > MOST_NAMED:
        return f"{len(columns)} states or local variables ({names}, ...)"
    return names or "nothing but the time"


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
        the scenario to run
    out : Path or None
        folder for run.parquet or run.csv and run.json; None writes nothing
    marks : sequence of expressions
        further columns of the record, computed from the same row
    progress : bool
        show a bar on standard error if that is a terminal
    compiled : bool
        True: run the loop over the steps as machine code; False: as plain Python, with the same results

    Returns
    -------
    Simulation
        the run, with the files that were written

    Raises
    ------
    InputError
        for any part of the scenario that cannot be done, in one line; the rows up to the failure of an FMU are written,
        and run.json has the reason why they are not complete
    KeyboardInterrupt
        after Ctrl-C; the recorded rows are written, and run.json marks them as not complete
    """
    with _prepared(scenario) as prepared:
        return _recorded(prepared, Journal(out), lambda run: run, marks, progress=progress, compiled=compiled)


@contextmanager
def _prepared(scenario: Scenario) -> Iterator[PreparedScenario]:
    """Yield a scenario prepared for one run; prefix errors with its name."""
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
    """Run the scenario with its rows in the journal, block by block; `also` adds to the result and to its folder."""
    assembly, scenario = prepared.assemble({}), prepared.scenario
    grid, every, form = assembly.grid, scenario.record.every, scenario.record.format
    journal.provenance = _provenance(prepared, assembly)
    reached, last, ended = 0, grid.steps // every * every, ""

    def keep(rows: pl.DataFrame, tick: int) -> None:
        nonlocal reached
        reached = tick
        journal.add(rows.with_columns(*marks), follows=reached < last)

    def kept_so_far(**entries: Any) -> str:
        """Write the rows of an interrupted run; return the end of the message about them."""
        if journal.empty:
            journal.drop()
            return ""
        so_far = {"complete": reached == last, "steps": reached, "final_time_s": grid.time(reached), **entries}
        # The command writes nothing else after an interruption.
        with at_once(), journal.finished(form, so_far) as (_, files, _):
            return f"; {files[0]} has the run up to {grid.time(reached):.9g} s" if files else ""

    try:
        with progress_bar("simulating", grid.steps, show=progress) as update_bar:
            ended = run_in_one_process(
                assembly, keep, progress=update_bar, flush=lambda: journal.due, compiled=compiled
            )
        so_far: dict[str, Any] = {}
        if assembly.notes:
            journal.provenance["notes"] = list(assembly.notes)
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
                notes=tuple(assembly.notes),
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
    scenario: Scenario,
    out: Path | None = None,
    *,
    ignored: tuple[str, ...] = (),
    progress: bool = False,
    show: Show | None = None,
) -> Simulation:
    """Run a scenario and average its rests into a position record if its run is a raw record of a table.

    Parameters are those of `simulate`; `ignored` goes into the result, and `show` gets the rows during the run.
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
        return _recorded(prepared, Journal(out, show), averaged, progress=progress)


def _averages(run: Simulation) -> PositionRecord:
    """Return the averaged rests of a run, read from its file if it has one."""
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
    """The rows of a run: in its folder with the provenance in run.json, or in memory without a folder.

    `show` gets each row when it comes.
    """

    provenance: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, out: Path | None, show: Show | None = None) -> None:
        self._out = None if out is None else Path(out)
        self._show = show
        self._tables: list[pl.DataFrame] = []
        self._parts = self._bytes = self._waiting = 0
        self._made: list[Path] = []
        self._flushed = self._shown = time.monotonic()
        self._writer = ThreadPoolExecutor(1)
        self._writing: Future[None] | None = None

    @property
    def due(self) -> bool:
        """True if rows have waited for too long to be written or to be shown."""
        now = time.monotonic()
        return self._is_late(now) or (self._show is not None and now - self._shown > SHOW_SECONDS)

    def _is_late(self, now: float) -> bool:
        """Return True if rows have waited for too long to be written."""
        return self._out is not None and now - self._flushed > FLUSH_SECONDS

    @property
    def empty(self) -> bool:
        """True if there are no rows yet."""
        return not self._tables and not self._parts

    @property
    def folder(self) -> Path:
        """Folder of the rows during the run."""
        assert self._out is not None
        return self._out / INCOMPLETE

    def add(self, table: pl.DataFrame, *, follows: bool) -> None:
        """Take rows; `follows`: the caller will add more."""
        size, now = int(table.estimated_size()), time.monotonic()
        self._bytes += size
        self._waiting += size
        self._tables.append(table)
        if self._show is not None:
            self._show(table)
            self._shown = now
        is_large = self._out is not None and self._waiting > MOST_WAITING
        if follows and (is_large or self._is_late(now)):
            self._spill()

    def _spill(self) -> None:
        """Write the waiting rows as a part, beside the run."""
        if not self._parts:
            self._begin()
        part = self.folder / f"{self._parts:08d}.parquet"
        self._wait()
        rows = pl.concat(self._tables)
        self._tables.clear()
        self._parts += 1
        self._waiting = 0
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
        """Wait until the current part is written."""
        if self._writing is not None:
            writing, self._writing = self._writing, None
            with said_writable(self.folder, pl.exceptions.PolarsError):
                writing.result()

    def drop(self) -> None:
        """Delete everything that the run wrote."""
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
        """Write the whole run, as "parquet" or "csv", with `entries` in its run.json; it appears after the block.

        Yields the rows (None if they do not fit in memory), the files, and the temporary folder of the files. If the
        block is interrupted, the rows stay in the journal.
        """
        interrupted = False
        try:
            if self._out is None:
                yield pl.concat(self._tables, rechunk=True), (), None
                return
            path = self._out / f"run.{form}"
            self._wait()
            # The files of an earlier run would contradict the new run.json.
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
    """Write a part whole or not at all."""
    incomplete = part.with_suffix(".writing")
    rows.write_parquet(incomplete, compression="uncompressed", statistics=False)
    incomplete.replace(part)
