"""What `import trihedron as th` does at the table, while it is measured: as `library`, documented once."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from . import live
from . import measure as measuring


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
    """Accompany a measurement at the table: which rest is good, what is next, when one can stop, what is wrong.

    Readings are kept as they come, and the rests in them judged; after each the guaranteed errors are computed. It ends
    where the source does, on the operator's word, or when `patience_s` is over; then the positions are diagnosed.

    Parameters
    ----------
    plan : path
        Folder or plan.json of `trihedron plan positions N --out`, or a table with alpha_deg and beta_deg.
    source : path
        Where readings come from: a file that grows, or - for standard input.
    out : path
        The raw record (CSV), which grows with what comes; what goes with it is written beside.
    noise_bound : float
        σ that is promised of one averaged reading: a bound of its error, as a fraction of g.
    gravity : float
        Model value of gravity [m/s²].
    mounting : str
        Of a table: name of a preset, or a TOML file with [name] matrix = [[...], ...]. A plan says its own.
    channels : sequence of str
        How the file's channels are read: 2,1,-3 (accelerometers: axis 1 is the file's f2, axis 3 its f3 reversed),
        alpha=-1, beta=-1; may be repeated. The record is kept as it comes.
    dwell_s : float
        How long a rest should be averaged [s].
    promise : float
        The promise is kept by guaranteed errors up to so many times the plan's.
    patience_s : float, optional
        End when nothing has come for so long [s]; by default the operator ends it.
    resume : bool
        Go on with what is there already: a measurement that was interrupted.
    serve : bool
        Serve a page, on this machine alone, and say its address.
    port : int
        Of the page; 0 is any that is free.
    progress : bool
        Show on standard error what happens, and hear words that are typed.

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
            page = stack.enter_context(closing(live.PageServer(port)))
            print(f"the page of this measurement, for this machine alone: {page.address}", file=sys.stderr, flush=True)
            views.append(page)
        return measuring.carry_out(measurement, coming, views)
