"""The command that runs a scenario; a thin layer over `trihedron.bench_run`."""

from pathlib import Path

from trihedron.answers import Answer, answer
from trihedron.options import JsonFile
from trihedron.outputs import distinct_files


def simulate(scenario: Path, /, *, out: Path | None = None, step: float | None = None, json: JsonFile = None) -> Answer:
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
    """
    distinct_files({"the scenario": scenario, "--json": json})
    from trihedron.bench_run import run_into_folder

    done = run_into_folder(scenario, out, progress=True, step=step)
    return answer((str(file) for file in done.files), json, done.to_json())
