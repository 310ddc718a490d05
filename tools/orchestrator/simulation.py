"""A scenario from its FMUs to its record."""

import platform
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import polars as pl

from ..errors import InputError, one_line, said_of
from ..scenario import Scenario, Stimulus
from .blocks import Values
from .bus import make_buses
from .connections import check_single_sources, resolve_connections
from .coupling import Coupling, stepping_groups
from .ensemble import Ensemble
from .grid import Grid, make_grid
from .interface import Value, Variable
from .journal import Journal
from .loading import Loaded, Sources, check_states, check_steps, load
from .master import Progress, run_fmus
from .parameters import value_at_start
from .programme import Programme, drive_of_programme, resolve_programme
from .recording import block_table, recorded_variables, resolve_columns
from .stimuli import Drive, resolve_constant, resolve_rows
from .tables import NumberTable, read_table, table_from

SCHEMA = "trihedron.run/1"
_PACKAGES = ("trihedron", "fmpy", "pythonfmu", "polars")
_FOLDER_PREFIX = "trihedron-run-"


@dataclass(frozen=True)
class Run:
    """A simulated run.

    Attributes
    ----------
    rows : DataFrame or None
        the record; None where it is too long for memory and only in the file
    scenario : Scenario
        as it was run
    provenance : dict
        what run.json holds: the scenario, versions, content hashes
    files : tuple of Path
        what was written
    """

    rows: pl.DataFrame | None
    scenario: Scenario
    provenance: dict[str, Any]
    files: tuple[Path, ...] = ()

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return self.rows.columns if self.rows is not None else _scan(self.files[0]).collect_schema().names()

    @property
    def height(self) -> int:
        """How many rows there are."""
        return self.rows.height if self.rows is not None else _scan(self.files[0]).select(pl.len()).collect().item()

    @cached_property
    def table(self) -> pl.DataFrame:
        """The rows in memory: `time_s` and the recorded columns; row k is the k-th recorded communication point."""
        return self.rows if self.rows is not None else _scan(self.files[0]).collect()


def _scan(file: Path) -> pl.LazyFrame:
    return pl.scan_csv(file) if file.suffix == ".csv" else pl.scan_parquet(file)


def default_folder(scenario: Scenario) -> Path:
    """Where a run is written when nothing else is asked for: `<scenario>-run` in the current folder."""
    stem = scenario.source.stem if scenario.source is not None else "scenario"
    return Path(f"{stem}-run")


def simulate(scenario: Scenario, out: Path | None = None, *, progress: bool = False, compiled: bool = True) -> Run:
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

    Returns
    -------
    Run

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done, in one line; then nothing is written
    KeyboardInterrupt
        Ctrl-C; what was recorded until then is written, and run.json says that it is not complete
    """
    try:
        return _run(scenario, None if out is None else Path(out), progress=progress, compiled=compiled)
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(one_line(f"{prefix}{error}")) from error
    except MemoryError as error:
        raise InputError("the run does not fit into memory; raise record.every or record less") from error


def _run(scenario: Scenario, out: Path | None, *, progress: bool, compiled: bool) -> Run:
    sources = Sources(scenario.base_folder)
    with temporary_folder() as folder:
        loaded = load(scenario, sources, folder)
        interfaces = {name: entry.interface for name, entry in loaded.items()}
        wires = resolve_connections(scenario.connections, interfaces)
        coupling = coupling_of(scenario)
        groups = stepping_groups(list(interfaces), wires, coupling)
        check_states(groups, loaded, coupling)
        check_steps(loaded, scenario.run.step_s)
        grid, drives = resolve_stimuli(scenario, sources, loaded)
        check_single_sources(wires, drives)
        columns = resolve_columns(scenario.record.columns, interfaces)
        ensemble = Ensemble(
            groups,
            {name: entry.fmu for name, entry in loaded.items()},
            interfaces,
            {name: entry.values.values() for name, entry in loaded.items()},
            make_buses(
                interfaces,
                wires,
                [drive for _, drive in drives],
                {name: recorded_variables(columns, name) for name in interfaces},
                lambda name, variable: value_at_start(variable, loaded[name].values),
            ),
            coupling,
        )
        provenance = _provenance(scenario, loaded, ensemble.order, sources, grid)
        journal = Journal(out, provenance)
        every = scenario.record.every
        last = grid.steps // every * every

        def keep(ticks: range, values: Values) -> None:
            nonlocal reached
            reached = ticks[-1]
            journal.add(block_table(columns, values, ticks, grid), more=reached < last)

        reached = 0
        try:
            with _bar(grid.steps, show=progress) as shown:
                run_fmus(ensemble, grid, every, keep, progress=shown, flush=lambda: journal.due, compiled=compiled)
        except KeyboardInterrupt:
            if journal.empty:
                journal.drop()
                raise
            so_far = {"complete": False, "steps": reached, "final_time_s": grid.time(reached)}
            _, files = journal.finish(scenario.record.format, so_far)
            where = f"; {files[0]} has the run up to {grid.time(reached):.9g} s" if files else ""
            raise KeyboardInterrupt(f"interrupted{where}") from None
        except BaseException:
            journal.drop()
            raise
        table, files = journal.finish(scenario.record.format, {})
    return Run(table, scenario, provenance, files)


def coupling_of(scenario: Scenario) -> Coupling:
    """How the scenario takes cycles of connections."""
    run, usual = scenario.run, Coupling()
    return Coupling(run.coupling, run.tolerance or usual.tolerance, run.iterations or usual.iterations)


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


def resolve_stimuli(
    scenario: Scenario, sources: Sources, loaded: Mapping[str, Loaded]
) -> tuple[Grid, list[tuple[str, Drive]]]:
    """The run's grid, and the drives by their names in messages; programmes first, for they may end the run."""
    interfaces = {name: entry.interface for name, entry in loaded.items()}

    def parameter(fmu: str, variable: Variable) -> Value | None:
        return value_at_start(variable, loaded[fmu].values)

    def table(stimulus: Stimulus, number: int, wanted: list[str] | None) -> NumberTable:
        label = stimulus.csv or stimulus.programme
        if label is None:
            return table_from(stimulus.table, f"stimuli[{number}].table", wanted)
        found, content = read_table(scenario.base_folder / label, label, wanted)
        sources.note(label, content)
        return found

    programmes: dict[int, Programme] = {}
    for number, stimulus in enumerate(scenario.stimuli, start=1):
        if stimulus.kind == "programme":
            with said_of(f"stimuli[{number}]"):
                positions = table(stimulus, number, None)
                programmes[number] = resolve_programme(stimulus, positions, scenario.run, interfaces, parameter)
    grid = make_grid(scenario.run, [programme.end for programme in programmes.values()])
    drives: list[tuple[str, Drive]] = []
    for number, stimulus in enumerate(scenario.stimuli, start=1):
        name = f"stimuli[{number}]"
        with said_of(name):
            if stimulus.kind == "programme":
                drives.append((name, drive_of_programme(programmes[number], grid)))
            elif stimulus.kind == "constant":
                drives.append((name, resolve_constant(stimulus, interfaces)))
            else:
                found = resolve_rows(
                    stimulus, lambda wanted, s=stimulus, n=number: table(s, n, wanted), grid, interfaces
                )
                drives += [(name, drive) for drive in found]
    return grid, drives


@contextmanager
def _bar(steps: int, *, show: bool) -> Iterator[Progress]:
    """What is told how many steps are made: a progress bar, or nobody."""
    if not show or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress as Bars

    with Bars(console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("simulating", total=steps)
        yield lambda made: bars.update(task, completed=made)


def _provenance(
    scenario: Scenario, loaded: Mapping[str, Loaded], order: list[str], sources: Sources, grid: Grid
) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "scenario": scenario.as_written(),
        "versions": {name: version(name) for name in _PACKAGES} | {"python": platform.python_version()},
        "fmus": {
            name: {"source": entry.fmu.label, "model": entry.interface.model, "sha256": entry.fmu.sha256}
            for name, entry in loaded.items()
        },
        "files": dict(sorted(sources.hashes.items())),
        "order": order,
        "steps": grid.steps,
        "final_time_s": grid.time(grid.steps),
    }
