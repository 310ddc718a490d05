"""A scenario from its FMUs to its record: run once and written, or prepared once and run many times.

While a run goes on, what is recorded stands in `run.incomplete/` in the run's folder: Parquet files, each whole, and a
run.json that says `"complete": false`. A run that is killed leaves them; every other run takes them away. A long run
needs no more memory than a short one.
"""

import ctypes
import platform
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import cached_property
from importlib.metadata import version
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, Literal

import polars as pl
from pydantic import Field

from ..errors import InputError, one_line
from ..files import json_text, make_folders, said_writable, whole_folder
from ..locks import own_folder
from ..progress import progress_bar
from ..records import PositionRecord, RawRecord, read_record, write_record
from ..records.read import read_written
from ..records.rests import position_record_of
from ..result import ABSENT, Result
from .load import Loaded, Sources, interfaces_of, load, resolve_parameters
from .loops import Assembly, run_fmus
from .ports import Ports
from .recorded import Column, recorded_variables, resolve_columns
from .scenario import Scenario
from .stimuli import check_single_sources, resolve_stimuli
from .wiring import check_states, paces_of, resolve_connections, stepping_groups

SCHEMA = "trihedron.run/1"
RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""A raw record of more rows is not averaged: it is read whole."""
INCOMPLETE = "run.incomplete"
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

    @cached_property
    def table(self) -> pl.DataFrame:
        """The rows in memory: `time_s` and the recorded columns; row k is the k-th recorded communication point."""
        return self.rows_of_file().collect()

    def rows_of_file(self) -> pl.LazyFrame:
        """The same, read as far as it is needed."""
        if self.held is not None:
            return self.held.lazy()
        return (pl.scan_csv if self.files[0].suffix == ".csv" else pl.scan_parquet)(self.files[0])

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
            self.loaded = load(scenario, self.sources, folder)
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
    def columns(self) -> list[Column]:
        """The record's columns, without `time_s`."""
        return resolve_columns(self.scenario.record.columns, self.interfaces)

    def assemble(self, parameters: Mapping[str, Mapping[str, Any]]) -> Assembly:
        """What runs together, with some parameters in place of the scenario's own."""
        loaded = dict(self.loaded)
        for name, given in parameters.items():
            entry = loaded[name]
            changed = resolve_parameters(entry.interface, given)
            loaded[name] = Loaded(entry.fmu, entry.interface, {**entry.values, **changed})
        grid, drives = resolve_stimuli(self.scenario, self.sources, loaded)
        check_single_sources(self._wires, drives)
        ports = {}
        for name, entry in loaded.items():
            own = [drive for _, drive in drives if drive.fmu == name]
            recorded = recorded_variables(self.columns, name)
            ports[name] = Ports(entry.interface, self._wires, own, recorded, entry.start_value, self._paces[name])
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


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for unpacked FMUs; what their scripts left of it in Python's search path and modules goes too."""
    with own_folder() as folder:
        name = str(folder)
        try:
            yield folder
        finally:
            sys.path[:] = [entry for entry in sys.path if not str(entry).startswith(name)]
            for module, loaded in list(sys.modules.items()):
                if str(getattr(loaded, "__file__", None)).startswith(name):
                    del sys.modules[module]


def default_folder(scenario: Scenario) -> Path:
    """Where a run is written when nothing else is asked for: `<scenario>-run` in the current folder."""
    stem = scenario.source.stem if scenario.source is not None else "scenario"
    return Path(f"{stem}-run")


def simulate(
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
    try:
        prepared = PreparedScenario(scenario)
        try:
            folder = None if out is None else Path(out)
            return _recorded(prepared, folder, marks, progress=progress, compiled=compiled)
        finally:
            prepared.close()
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(one_line(f"{prefix}{error}")) from error
    except MemoryError as error:
        raise InputError("the run does not fit into memory; raise record.every or record less") from error


def _recorded(
    prepared: PreparedScenario, out: Path | None, marks: Sequence[pl.Expr], *, progress: bool, compiled: bool
) -> Simulation:
    """The run, its rows in the journal block by block."""
    assembly, scenario = prepared.assemble({}), prepared.scenario
    grid, every, form = assembly.grid, scenario.record.every, scenario.record.format
    provenance = _provenance(prepared, assembly)
    journal = Journal(out, provenance)
    reached, last, ended = 0, grid.steps // every * every, ""

    def keep(rows: pl.DataFrame, tick: int) -> None:
        nonlocal reached
        reached = tick
        journal.add(rows.with_columns(*marks), more=reached < last)

    def kept_so_far(**more: Any) -> str:
        """What is said of the rows that a run has left which does not come to its end."""
        if journal.empty:
            journal.drop()
            return ""
        so_far = {"complete": reached == last, "steps": reached, "final_time_s": grid.time(reached), **more}
        _, files = journal.finish(form, so_far)
        return f"; {files[0]} has the run up to {grid.time(reached):.9g} s" if files else ""

    try:
        with progress_bar("simulating", grid.steps, show=progress) as shown:
            ended = run_fmus(assembly, keep, progress=shown, flush=lambda: journal.due, compiled=compiled)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted{kept_so_far()}") from None
    except InputError as error:
        raise InputError(f"{error}{kept_so_far(failure=str(error))}") from error
    except BaseException:
        journal.drop()
        raise
    so_far = {"steps": reached, "final_time_s": grid.time(reached), "ended": ended} if ended else {}
    table, files = journal.finish(form, so_far)
    return Simulation(
        title=scenario.title,
        rows=reached // every + 1,
        columns=["time_s", *(c.name for c in assembly.columns), *(mark.meta.output_name() for mark in marks)],
        final_time_s=grid.time(reached) if ended else provenance["final_time_s"],
        ended=ended,
        files=files,
        scenario=scenario,
        provenance={**provenance, **so_far},
        held=table,
        units={c.name: c.variable.unit for c in assembly.columns if c.variable.unit and c.factor == 1.0},
    )


def _provenance(prepared: PreparedScenario, assembly: Assembly) -> dict[str, Any]:
    fmus = {
        name: {"source": entry.fmu.label, "model": entry.interface.model, "sha256": entry.fmu.sha256}
        for name, entry in assembly.loaded.items()
    }
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
    run = simulate(scenario, out, progress=progress)
    if out is not None:
        # Averages of an earlier run would not be those of this one.
        (out / "positions.csv").unlink(missing_ok=True)
    found: dict[str, Any] = {"ignored_parameters": ignored}
    if set(run.columns) >= RAW_COLUMNS:
        try:
            if run.rows > MOST_ROWS:
                raise InputError(f"{run.rows} rows are too many to average here; raise record.every")
            raw = read_written(run.files[0]) if run.files else read_record(run.table)
            if not isinstance(raw, RawRecord):
                raise InputError("the run is not a raw record of a table")
            positions = position_record_of(raw)
            found |= {"averages": positions, "rests": len(positions)}
        except InputError as error:
            found["no_positions"] = str(error)
    if out is not None and "averages" in found:
        write_record(found["averages"], out / "positions.csv")
        found["files"] = (*run.files, out / "positions.csv")
    return run.model_copy(update=found)


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
        with said_writable(self._out, pl.exceptions.PolarsError):
            folder = self.folder
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            if self._out is not None and self._out.exists() and not self._out.is_dir():
                raise InputError(f"{self._out}: is a file; give the name of a folder")
            shutil.rmtree(folder, ignore_errors=True)
            make_folders(folder)
            self._made = missing
            (folder / "run.json").write_text(json_text({**self._provenance, "complete": False}), encoding="utf-8")

    def _wait(self) -> None:
        """Wait for the part that is being written."""
        if self._writing is not None:
            writing, self._writing = self._writing, None
            with said_writable(self.folder, pl.exceptions.PolarsError):
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
            with said_writable(self._out, pl.exceptions.PolarsError):
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
            (beside / "run.json").write_text(json_text(provenance), encoding="utf-8", newline="\n")
        return table


def _write_part(rows: pl.DataFrame, part: Path) -> None:
    """A part appears whole or not at all."""
    beside = part.with_suffix(".writing")
    rows.write_parquet(beside, compression="uncompressed", statistics=False)
    beside.replace(part)
