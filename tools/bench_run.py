"""A scenario run, and its rests averaged when a table was measured."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import InputError, one_line
from .orchestrator import Run, default_folder
from .orchestrator import simulate as run_once
from .records import PositionRecord, RawRecord, read_record, write_record
from .records.rests import position_record_of
from .scenario import Scenario, checked_scenario, read_scenario
from .shown import Shown

if TYPE_CHECKING:
    from polars import DataFrame, Series

RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""A raw record of more rows is not averaged: it is read whole."""
SCHEMA = "trihedron.simulation/1"


@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """A scenario that was run.

    Attributes
    ----------
    run : Run
        rows, provenance, files of the run itself
    positions : PositionRecord or None
        the averaged rests, where the run is a raw record of a table
    no_positions : str
        why there are none, where there should be
    files : tuple of Path
        everything that was written
    ignored : tuple of str
        parameters of an .ssp that name nothing in it
    """

    run: Run
    positions: PositionRecord | None
    no_positions: str
    files: tuple[Path, ...]
    ignored: tuple[str, ...] = ()

    @property
    def columns(self) -> list[str]:
        """Names of the recorded columns, `time_s` first."""
        return self.run.columns

    @property
    def height(self) -> int:
        """Recorded rows."""
        return self.run.height

    @property
    def provenance(self) -> dict[str, Any]:
        """What run.json holds: the scenario, versions, content hashes."""
        return self.run.provenance

    def __len__(self) -> int:
        return self.height

    def position_record(self) -> PositionRecord:
        """The averaged rests; raises InputError where the run is no raw record of a table."""
        if self.positions is None:
            raise InputError(self.no_positions or "the simulation has recorded no position record of a table")
        return self.positions

    def __getitem__(self, column: str) -> "Series":
        return self.run.table[column]

    def to_polars(self) -> "DataFrame":
        """The run: row k is the k-th recorded communication point."""
        return self.run.table

    def lines(self) -> list[str]:
        """What was run, what it recorded, and where that is."""
        title = self.run.scenario.title or "a scenario without a title"
        said = [f"{title}: {self.height} rows of {', '.join(self.columns)}"]
        if self.positions is not None:
            said.append(f"{len(self.positions)} rests averaged")
        elif self.no_positions:
            said.append(f"no position record: {self.no_positions}")
        return said + [str(file) for file in self.files]

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.simulation/1."""
        return {
            "schema": SCHEMA,
            "title": self.run.scenario.title,
            "rows": self.height,
            "columns": self.columns,
            "final_time_s": self.provenance["final_time_s"],
            "positions": None if self.positions is None else len(self.positions),
            "no_positions": self.no_positions,
            "files": [str(file) for file in self.files],
            "ignored_parameters": list(self.ignored),
        }


def simulate(
    scenario: "str | Path | Mapping[str, Any] | Scenario",
    *,
    out: str | Path | None = None,
    step: float | None = None,
    coupling: str | None = None,
    progress: bool = False,
) -> Simulation:
    """Run a scenario; where its run is a raw record of a table, average its rests into a position record.

    Parameters
    ----------
    scenario : path, mapping or Scenario
        a scenario file (TOML), an .ssp, or what would stand in the file; relative paths in a mapping begin here
    out : path, optional
        folder that everything is written to; nothing is written without it
    step : float, optional
        length of a step [s] of an .ssp, where it does not say one or another is wanted
    coupling : str, optional
        how the cycles of an .ssp are taken, "jacobi" or "iterate"; a scenario says so itself
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Simulation

    Raises
    ------
    trihedron.tools.errors.InputError
        whatever cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/table-attitude.toml")
    >>> run["q0"].max()
    """
    with _opened(scenario, step, coupling) as (checked, ignored):
        return _simulated(checked, None if out is None else Path(out), ignored, progress=progress)


@contextmanager
def _opened(
    scenario: "str | Path | Mapping[str, Any] | Scenario", step: float | None, coupling: str | None
) -> Iterator[tuple[Scenario, tuple[str, ...]]]:
    """The scenario, as long as its files are there; and what was ignored of it."""
    if isinstance(scenario, str | Path) and Path(scenario).suffix.lower() == ".ssp":
        from .ssp.importing import scenario_of_ssp

        with scenario_of_ssp(Path(scenario), step=step, coupling=coupling) as imported:
            yield imported.scenario, imported.ignored
        return
    if step is not None:
        raise InputError("--step: belongs to an .ssp; a scenario says run.step_s")
    if coupling is not None:
        raise InputError("--coupling: belongs to an .ssp; a scenario says run.coupling")
    if isinstance(scenario, Scenario):
        yield scenario, ()
    elif isinstance(scenario, Mapping):
        yield checked_scenario(scenario), ()
    else:
        yield read_scenario(scenario), ()


def _simulated(scenario: Scenario, out: Path | None, ignored: tuple[str, ...], *, progress: bool) -> Simulation:
    run = run_once(scenario, out, progress=progress)
    if out is not None:
        # Averages of an earlier run would not be those of this one.
        (out / "positions.csv").unlink(missing_ok=True)
    if not set(run.columns) >= RAW_COLUMNS:
        return Simulation(run, None, "", run.files, ignored)
    try:
        if run.height > MOST_ROWS:
            raise InputError(f"{run.height} rows are too many to average here; raise record.every")
        positions = averaged(run)
    except InputError as error:
        return Simulation(run, None, str(error), run.files, ignored)
    if out is None:
        return Simulation(run, positions, "", run.files, ignored)
    write_record(positions, out / "positions.csv")
    return Simulation(run, positions, "", (*run.files, out / "positions.csv"), ignored)


def averaged(run: Run) -> PositionRecord:
    """The position record of a run that was recorded as a raw record."""
    raw = read_record(run.files[0] if run.files else run.table)
    if not isinstance(raw, RawRecord):
        raise InputError("the run is not a raw record of a table")
    return position_record_of(raw)


def run_scenario(path: Path, out: Path | None, *, progress: bool, step: float | None = None) -> list[Path]:
    """Run a scenario into a folder; what was left out is said on standard error.

    Parameters
    ----------
    path : Path
        the scenario, or an .ssp
    out : Path or None
        folder for the results; None: <scenario>-run in the current folder
    step : float, optional
        length of a step of an .ssp [s]

    Returns
    -------
    list of Path
        what was written
    """
    return list(run_into_folder(path, out, progress=progress, step=step).files)


def run_into_folder(
    path: Path, out: Path | None, *, progress: bool, step: float | None = None, coupling: str | None = None
) -> Simulation:
    """As `run_scenario`, with the whole result; `coupling` as `simulate` takes it."""
    with _opened(path, step, coupling) as (scenario, ignored):
        if ignored:
            shown = ", ".join(ignored[:3]) + (", ..." if len(ignored) > 3 else "")
            print(f"{path}: {len(ignored)} parameters name nothing in it: {one_line(shown)}", file=sys.stderr)
        done = _simulated(scenario, out if out is not None else default_folder(scenario), ignored, progress=progress)
    if done.no_positions:
        print(f"no position record: {done.no_positions}", file=sys.stderr)
    return done
