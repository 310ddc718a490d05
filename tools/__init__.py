"""Trihedron: FMI co-simulation components for inertial instruments.

Notation used throughout
------------------------
Names are the field's terms; a docstring gives the paper's symbol. Everything inside is SI and radians; degrees
stand only in names that say so (``alpha_deg``). Frames:

base
    axis 1 along the horizontal projection of the table's outer axis, axis 3 up, right-handed.
inner
    fixed to the table's inner frame, axis 3 along the inner axis.
block
    the instrument frame of the accelerometer block: inner frame turned by the mounting Q and the mounting error θ.

A matrix ``r_ab`` takes components in frame b to components in frame a. A quaternion is scalar first and takes body
components to the reference. ``alpha`` is the angle of the outer axis, ``beta`` of the inner axis. Specific force
points up at rest: a level block reads (0, 0, +g).

Packages import one way: ``trihedron.models`` (physics) <- ``trihedron.fmus`` (components) <- ``trihedron`` (tools).
"""

from collections.abc import Mapping
from importlib.metadata import version as _version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from polars import DataFrame

    from trihedron.scenario import Scenario

__version__ = _version("trihedron")


def simulate(
    scenario: "str | Path | Mapping[str, Any] | Scenario", *, out: str | Path | None = None, progress: bool = False
) -> "DataFrame":
    """Run a scenario and return the run as a table in memory.

    Parameters
    ----------
    scenario : path, mapping or Scenario
        a scenario file (TOML), an .ssp, or what would stand in the file; relative paths in a mapping begin here
    out : path, optional
        folder that the run is written to besides
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    DataFrame
        `time_s` and the recorded columns; row k is the k-th recorded communication point

    Raises
    ------
    trihedron.errors.InputError
        whatever cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/table-attitude.toml")
    >>> run["q0"].max()
    """
    from trihedron.orchestrator import simulate as run
    from trihedron.scenario import Scenario, checked_scenario, read_scenario

    folder = None if out is None else Path(out)
    if isinstance(scenario, Scenario):
        return run(scenario, folder, progress=progress).table
    if isinstance(scenario, Mapping):
        return run(checked_scenario(scenario), folder, progress=progress).table
    if Path(scenario).suffix.lower() == ".ssp":
        from trihedron.ssp.importing import scenario_of_ssp

        with scenario_of_ssp(Path(scenario)) as imported:
            return run(imported.scenario, folder, progress=progress).table
    return run(read_scenario(scenario), folder, progress=progress).table
