"""A scenario run, and its rests averaged when a table was measured."""

import sys
from pathlib import Path

from trihedron.errors import InputError
from trihedron.orchestrator import default_folder, simulate
from trihedron.records import PositionRecord, RawRecord, read_record, write_position_record
from trihedron.records.rests import average_rests, find_rests
from trihedron.scenario import Scenario, read_scenario

RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}
MOST_ROWS = 20_000_000
"""A raw record of more rows is not averaged: it is read whole."""


def run_scenario(path: Path, out: Path | None, *, progress: bool, step: float | None = None) -> list[Path]:
    """Simulate a scenario; where its run is a raw record, average the rests into a position record beside it.

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
        what was written; why there is no position record, where the rests do not give one, goes to standard error
    """
    if path.suffix.lower() == ".ssp":
        from trihedron.ssp.importing import scenario_of_ssp

        with scenario_of_ssp(path, step=step) as imported:
            if imported.ignored:
                shown = ", ".join(imported.ignored[:3]) + (", ..." if len(imported.ignored) > 3 else "")
                print(f"{path}: {len(imported.ignored)} parameters name nothing in it: {shown}", file=sys.stderr)
            return _run(imported.scenario, out, progress=progress)
    if step is not None:
        raise InputError("--step: belongs to an .ssp; a scenario says run.step_s")
    return _run(read_scenario(path), out, progress=progress)


def _run(scenario: Scenario, out: Path | None, *, progress: bool) -> list[Path]:
    folder = out if out is not None else default_folder(scenario)
    run = simulate(scenario, folder, progress=progress)
    files = list(run.files)
    # Averages of an earlier run would not be those of this one.
    (folder / "positions.csv").unlink(missing_ok=True)
    if set(run.columns) >= RAW_COLUMNS:
        try:
            if run.height > MOST_ROWS:
                raise InputError(f"{run.height} rows are too many to average here; raise record.every")
            write_position_record(averaged(files[0]), folder / "positions.csv")
            files.append(folder / "positions.csv")
        except InputError as error:
            print(f"no position record: {error}", file=sys.stderr)
    return files


def averaged(run_file: Path) -> PositionRecord:
    """The position record of a run that was recorded as a raw record."""
    raw = read_record(run_file)
    if not isinstance(raw, RawRecord):
        raise InputError(f"{run_file}: is not a raw record of a table")
    return average_rests(raw, find_rests(raw))
