"""A measurement at the table: readings as they come, judged, with the next position and the records on a page."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from .. import live, workbench
from .. import measure as measuring


def measure(
    plan: str | Path,
    *,
    source: str | Path,
    out: str | Path,
    noise_bound: float,
    gravity: float = 9.80665,
    mounting: str = "identity",
    channels: Sequence[str] = (),
    dwell_s: float = 20.0,
    promise: float = 1.02,
    patience_s: float | None = None,
    resume: bool = False,
    serve: bool = False,
    port: int = 0,
    progress: bool = False,
) -> "measuring.Measured":
    """Guide a measurement at the table: judge each rest, name the next position, say when to stop.

    Readings are kept as they come; after each rest the guaranteed errors are computed. The measurement ends with the
    source, by the operator's word, or after some time without readings. Then the positions are diagnosed.

    Parameters
    ----------
    plan : path
        Folder or plan.json of `trihedron plan positions N --out`, or a table with alpha_deg and beta_deg.
    source : path
        Source of the readings: a growing file, or - for standard input.
    out : path
        The raw record (CSV), which grows with the readings; its companion files are in the same folder.
    noise_bound : float
        σ: bound of the error of one averaged reading, as a fraction of g.
    gravity : float
        Model value of gravity [m/s²].
    mounting : str
        Mounting for a table of angles: a preset, or a TOML file with [name] matrix = [[...], ...]. A plan has its own.
    channels : sequence of str
        Order and signs of the file's channels. 2,1,-3: axis 1 is f2, axis 3 is f3 reversed. Further: alpha=-1, beta=-1.
        Repeat it for several. The record keeps the file's channels.
    dwell_s : float
        Averaging time of a rest [s].
    promise : float
        Largest guaranteed error that keeps the plan's promise, as a multiple of the plan's.
    patience_s : float, optional
        End after this time without readings [s]. Default: the operator ends the measurement.
    resume : bool
        Continue an interrupted measurement.
    serve : bool
        Serve the page of `trihedron open` on this machine, with the measurement above the records; print its address.
    port : int
        Port of the live page; 0 takes a free one.
    progress : bool
        Show on standard error what happens, and hear words that are typed.

    Returns
    -------
    Measured
        The session with its rests, errors and verdict.

    Raises
    ------
    InputError
        a plan, source or record that cannot be used; what came until then is kept

    Examples
    --------
    >>> import trihedron as th
    >>> th.measure("plan24", source="growing.csv", out="monday.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    options = measuring.SessionOptions(noise_bound, gravity, tuple(channels), promise, dwell_s, patience_s)
    programme = measuring.read_programme(Path(plan), mounting)
    coming = measuring.source_of(str(source))
    measurement = measuring.Measurement.begun(programme, options, Path(out), coming.name, resume=resume)
    views: list[measuring.View] = [live.terminal_of(str(source))] if progress else []
    with ExitStack() as stack:
        if serve:
            desk = workbench.Desk()
            table = workbench.TableView(desk, measurement.files.positions_file)
            page = stack.enter_context(closing(workbench.DeskServer(desk, port, table=table)))
            print(f"the page of this measurement, for this machine alone: {page.address}", file=sys.stderr, flush=True)
            views.append(table)
        return measuring.carry_out(measurement, coming, views)
