"""A scenario from its FMUs to its record."""

import json
import platform
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import polars as pl

from trihedron.errors import InputError
from trihedron.orchestrator.bus import make_buses
from trihedron.orchestrator.connections import check_single_sources, resolve_connections, stepping_order
from trihedron.orchestrator.grid import Grid, make_grid
from trihedron.orchestrator.interface import Value, Variable
from trihedron.orchestrator.loading import Loaded, Sources, load
from trihedron.orchestrator.master import Ticker, run_fmus
from trihedron.orchestrator.parameters import value_at_start
from trihedron.orchestrator.programme import Programme, drive_of_programme, resolve_programme
from trihedron.orchestrator.recording import record_table, recorded_variables, resolve_columns
from trihedron.orchestrator.stimuli import Drive, resolve_constant, resolve_rows
from trihedron.orchestrator.tables import NumberTable, read_table, table_from
from trihedron.scenario import Scenario, Stimulus
from trihedron.writing import whole_folder

SCHEMA = "trihedron.run/1"
_PACKAGES = ("trihedron", "fmpy", "pythonfmu", "polars")
_FOLDER_PREFIX = "trihedron-run-"


@dataclass(frozen=True)
class Run:
    """A simulated run.

    Attributes
    ----------
    table : DataFrame
        `time_s` and the recorded columns; row k is the state at the k-th recorded communication point
    scenario : Scenario
        as it was run
    provenance : dict
        what run.json holds: the scenario, versions, content hashes
    files : tuple of Path
        what was written
    """

    table: pl.DataFrame
    scenario: Scenario
    provenance: dict[str, Any]
    files: tuple[Path, ...] = ()


def default_folder(scenario: Scenario) -> Path:
    """Where a run is written when nothing else is asked for: `<scenario>-run` in the current folder."""
    stem = scenario.source.stem if scenario.source is not None else "scenario"
    return Path(f"{stem}-run")


def simulate(scenario: Scenario, out: Path | None = None, *, progress: bool = False) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario
    out : Path or None
        folder for run.parquet or run.csv and run.json; None: nothing is written
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Run

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done, in one line; then nothing is written
    """
    try:
        table, provenance = _run(scenario, progress=progress)
    except InputError as error:
        prefix = f"{scenario.source}: " if scenario.source is not None else ""
        raise InputError(f"{prefix}{error}") from error
    except MemoryError as error:
        raise InputError("the run does not fit into memory; raise record.every or record less") from error
    files = () if out is None else _write(table, provenance, Path(out), scenario.record.format)
    return Run(table, scenario, provenance, files)


def _run(scenario: Scenario, *, progress: bool) -> tuple[pl.DataFrame, dict[str, Any]]:
    sources = Sources(scenario.base_folder)
    with _temporary_folder() as folder:
        loaded = load(scenario, sources, folder)
        interfaces = {name: entry.interface for name, entry in loaded.items()}
        wires = resolve_connections(scenario.connections, interfaces)
        order = stepping_order(list(interfaces), wires)
        grid, drives = _resolve_stimuli(scenario, sources, loaded)
        check_single_sources(wires, drives)
        columns = resolve_columns(scenario.record.columns, interfaces)
        recorded = {name: recorded_variables(columns, name) for name in interfaces}
        buses = make_buses(order, wires, [drive for _, drive in drives], recorded)
        every = scenario.record.every
        with _ticker(show=progress) as ticks:
            values = run_fmus(
                order,
                {name: entry.fmu for name, entry in loaded.items()},
                {name: entry.values.values() for name, entry in loaded.items()},
                buses,
                grid,
                every,
                ticks,
            )
        table = record_table(columns, values, grid, every)
    return table, _provenance(scenario, loaded, order, sources, grid)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A folder for unpacked FMUs; what their scripts left of it in Python's search path and modules goes too."""
    with tempfile.TemporaryDirectory(prefix=_FOLDER_PREFIX, ignore_cleanup_errors=True) as name:
        try:
            yield Path(name)
        finally:
            sys.path[:] = [entry for entry in sys.path if not str(entry).startswith(name)]
            for module, loaded in list(sys.modules.items()):
                if str(getattr(loaded, "__file__", None)).startswith(name):
                    del sys.modules[module]


def _resolve_stimuli(
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
            with _in(f"stimuli[{number}]"):
                positions = table(stimulus, number, None)
                programmes[number] = resolve_programme(stimulus, positions, scenario.run, interfaces, parameter)
    grid = make_grid(scenario.run, [programme.end for programme in programmes.values()])
    drives: list[tuple[str, Drive]] = []
    for number, stimulus in enumerate(scenario.stimuli, start=1):
        name = f"stimuli[{number}]"
        with _in(name):
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
def _in(where: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


@contextmanager
def _ticker(*, show: bool) -> Iterator[Ticker]:
    """What wraps the loop over the steps: a progress bar, or nothing."""
    if not show or not sys.stderr.isatty():
        yield iter
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:

        def ticks(steps: range) -> Iterator[int]:
            task = bar.add_task("simulating", total=len(steps))
            shown = time.monotonic()
            for k in steps:
                yield k
                if not k & 255 and time.monotonic() - shown > 0.1:
                    shown = time.monotonic()
                    bar.update(task, completed=k + 1)

        yield ticks


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


def _write(table: pl.DataFrame, provenance: dict[str, Any], out: Path, form: str) -> tuple[Path, ...]:
    """Write the table and run.json into a folder, whole or not at all."""
    data = f"run.{form}"
    with whole_folder(out) as beside:
        if form == "csv":
            table.write_csv(beside / data)
        else:
            table.write_parquet(beside / data)
        text = json.dumps(provenance, indent=2, ensure_ascii=False, allow_nan=False)
        (beside / "run.json").write_text(text + "\n", encoding="utf-8", newline="\n")
    # A run of another form that stood here would not be the one that run.json describes.
    for stale in {"run.csv", "run.parquet"} - {data}:
        (out / stale).unlink(missing_ok=True)
    return out / data, out / "run.json"
