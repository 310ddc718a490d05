"""A scenario from its FMUs to its record: run once and written, or prepared once and run many times."""

import ctypes
import platform
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cached_property
from importlib.metadata import version
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, Literal

import polars as pl
from pydantic import Field

from ..errors import InputError, one_line
from ..progress import progress_bar
from ..records import PositionRecord, RawRecord, read_record, write_record
from ..records.read import read_written
from ..records.rests import position_record_of
from ..result import ABSENT, Result
from .journal import Column, Journal, recorded_variables, resolve_columns
from .load import Loaded, Sources, check_steps, interfaces_of, load, resolve_parameters
from .loops import Assembly, run_fmus
from .program import Ports
from .scenario import Scenario
from .stimuli import resolve_stimuli
from .wiring import check_single_sources, check_states, resolve_connections, stepping_groups

SCHEMA = "trihedron.run/1"
RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""A raw record of more rows is not averaged: it is read whole."""
_PACKAGES = ("trihedron", "fmpy", "pythonfmu", "polars")
_FOLDER_PREFIX = "trihedron-run-"


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
    files: tuple[Path, ...] = ()
    ignored_parameters: tuple[str, ...] = ()
    scenario: Scenario = Field(default=ABSENT, exclude=True, repr=False)
    provenance: dict[str, Any] = Field(default=ABSENT, exclude=True, repr=False)
    averages: PositionRecord | None = Field(default=None, exclude=True, repr=False)
    held: pl.DataFrame | None = Field(default=None, exclude=True, repr=False)
    """The record; None where it is too long for memory and only in the file."""

    @cached_property
    def table(self) -> pl.DataFrame:
        """The rows in memory: `time_s` and the recorded columns; row k is the k-th recorded communication point."""
        if self.held is not None:
            return self.held
        return (pl.read_csv if self.files[0].suffix == ".csv" else pl.read_parquet)(self.files[0])

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

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self._held = scenario, []
        self._closing = ExitStack()
        # Also at the end of a process of multiprocessing, which forgets what atexit was told.
        Finalize(self, self._closing.close, exitpriority=10)
        try:
            folder = self._closing.enter_context(temporary_folder())
            self.sources = Sources(scenario.base_folder)
            self.loaded = load(scenario, self.sources, folder)
            self.interfaces = interfaces_of(self.loaded)
            self._wires = resolve_connections(scenario.connections, self.interfaces)
            self._groups = stepping_groups(list(self.interfaces), self._wires, scenario.run.coupling)
            check_states(self._groups, self.loaded, scenario.run.coupling)
            check_steps(self.loaded, scenario.run.step_s)
        except BaseException:
            self.close()
            raise

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
            ports[name] = Ports(entry.interface, self._wires, own, recorded, entry.start_value)
        for name in loaded:
            ports[name].connect([wire for wire in self._wires if wire.target == name], ports)
        return Assembly(self._groups, self.scenario, self.columns, loaded, ports, grid)

    def run(self, parameters: Mapping[str, Mapping[str, Any]]) -> pl.DataFrame:
        """Run the scenario with some parameters in place of its own.

        Parameters
        ----------
        parameters : mapping of str to mapping
            FMU -> variable (or array, or element) -> value

        Returns
        -------
        DataFrame
            as `simulate` gives it
        """
        if not self._held:
            # While somebody has it open, a library is not loaded again for each instance.
            with suppress(OSError):
                self._held = [ctypes.CDLL(str(entry.fmu.library)) for entry in self.loaded.values()]
        assembly = self.assemble(parameters)
        tables: list[pl.DataFrame] = []
        run_fmus(assembly, lambda rows, _: tables.append(rows))
        return pl.concat(tables)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for unpacked FMUs; what their scripts left of it in Python's search path and modules goes too."""
    with tempfile.TemporaryDirectory(prefix=_FOLDER_PREFIX, ignore_cleanup_errors=True) as name:
        try:
            yield Path(name)
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
    scenario: Scenario, out: Path | None = None, *, progress: bool = False, compiled: bool = True
) -> Simulation:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario
    out : Path or None
        folder for run.parquet or run.csv and run.json; None: nothing is written
    progress : bool
        show a bar on standard error, where that is a terminal
    compiled : bool
        the loop over the steps as machine code; False: as plain Python, with the same results

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done, in one line; then nothing is written
    KeyboardInterrupt
        Ctrl-C; what was recorded until then is written, and run.json says that it is not complete
    """
    try:
        prepared = PreparedScenario(scenario)
        try:
            return _recorded(prepared, None if out is None else Path(out), progress=progress, compiled=compiled)
        finally:
            prepared.close()
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(one_line(f"{prefix}{error}")) from error
    except MemoryError as error:
        raise InputError("the run does not fit into memory; raise record.every or record less") from error


def _recorded(prepared: PreparedScenario, out: Path | None, *, progress: bool, compiled: bool) -> Simulation:
    """The run, its rows in the journal block by block."""
    assembly, scenario = prepared.assemble({}), prepared.scenario
    grid, every, form = assembly.grid, scenario.record.every, scenario.record.format
    provenance = _provenance(prepared, assembly)
    journal = Journal(out, provenance)
    reached, last = 0, grid.steps // every * every

    def keep(rows: pl.DataFrame, tick: int) -> None:
        nonlocal reached
        reached = tick
        journal.add(rows, more=reached < last)

    try:
        with progress_bar("simulating", grid.steps, show=progress) as shown:
            run_fmus(assembly, keep, progress=shown, flush=lambda: journal.due, compiled=compiled)
    except KeyboardInterrupt:
        if journal.empty:
            journal.drop()
            raise
        so_far = {"complete": False, "steps": reached, "final_time_s": grid.time(reached)}
        _, files = journal.finish(form, so_far)
        where = f"; {files[0]} has the run up to {grid.time(reached):.9g} s" if files else ""
        raise KeyboardInterrupt(f"interrupted{where}") from None
    except BaseException:
        journal.drop()
        raise
    table, files = journal.finish(form, {})
    return Simulation(
        title=scenario.title,
        rows=grid.steps // every + 1,
        columns=["time_s", *(column.name for column in assembly.columns)],
        final_time_s=provenance["final_time_s"],
        files=files,
        scenario=scenario,
        provenance=provenance,
        held=table,
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
