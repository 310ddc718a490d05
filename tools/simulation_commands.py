"""The command that runs a scenario; a thin layer over `trihedron.tools.bench_run`."""

from pathlib import Path
from typing import Literal

from .answers import Answer, answer
from .options import JsonFile, OutFolder
from .outputs import distinct_files


def simulate(
    scenario: Path,
    /,
    *,
    out: OutFolder | None = None,
    step: float | None = None,
    coupling: Literal["jacobi", "iterate"] | None = None,
    json: JsonFile = None,
) -> Answer:
    """Run a scenario: couple its FMUs, record the run, average its rests.

    Example: trihedron simulate scenarios/static-calibration.toml --out run

    Parameters
    ----------
    scenario
        The scenario file (TOML), or an .ssp.
    out
        Folder for the results; by default <scenario>-run in the current folder.
    step
        Length of a step [s] of an .ssp, where it does not say one or another is wanted.
    coupling
        How cycles of connections of an .ssp are taken; without it they are refused.
    """
    distinct_files({"the scenario": scenario, "--json": json})
    from .bench_run import run_into_folder

    done = run_into_folder(scenario, out, progress=True, step=step, coupling=coupling)
    return answer((str(file) for file in done.files), json, done.to_json())
