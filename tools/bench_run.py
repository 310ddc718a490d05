"""A scenario run, and its rests averaged when a table was measured."""

from pathlib import Path


from trihedron.errors import InputError
from trihedron.orchestrator import default_folder, simulate
from trihedron.records import PositionRecord, RawRecord, read_record, write_position_record
from trihedron.records.rests import average_rests, find_rests
from trihedron.scenario import read_scenario

RAW_COLUMNS = {"time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"}


def run_scenario(path: Path, out: Path | None, *, progress: bool) -> list[Path]:
    """Simulate a scenario; where its run is a raw record, average the rests into a position record beside it.

    Parameters
    ----------
    path : Path
        the scenario
    out : Path or None
        folder for the results; None: <scenario>-run in the current folder

    Returns
    -------
    list of Path
        what was written
    """
    scenario = read_scenario(path)
    folder = out if out is not None else default_folder(scenario)
    run = simulate(scenario, folder, progress=progress)
    files = list(run.files)
    if set(run.table.columns) >= RAW_COLUMNS:
        record = averaged(files[0])
        if record is not None:
            write_position_record(record, folder / "positions.csv")
            files.append(folder / "positions.csv")
    return files


def averaged(run_file: Path) -> PositionRecord | None:
    """The position record of a run that was recorded as a raw record; None where the table never rested."""
    raw = read_record(run_file)
    if not isinstance(raw, RawRecord):
        return None
    try:
        return average_rests(raw, find_rests(raw))
    except InputError:
        return None


