"""The function of a batch, as `import trihedron as th` and the command line have it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from .. import batch as batches
from ..options import Channels, NoiseBound, NoiseSd, Progress, Stamps, Trust

if TYPE_CHECKING:
    from ..lot import Lot

Do: TypeAlias = Literal["calibrate", "diagnose", "noise", "apply"]


@dataclass(frozen=True)
class BatchRequest:
    """A batch that is asked for: arguments of `batch`, the options of the work by their names."""

    files: Sequence[Path]
    do: Do
    out: Path
    options: Mapping[str, Any]
    tolerance: Path | None = None
    jobs: int | None = None
    engine: Literal["local", "dask"] = "local"
    scheduler: str | None = None
    resume: bool = False
    progress: bool = False


def batch(
    *files: str | Path,
    do: Do,
    out: str | Path,
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    gravity: float | None = None,
    mounting: str | None = None,
    baseline: Literal["asymmetric", "symmetric"] | None = None,
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    calibration: str | Path | None = None,
    tolerance: str | Path | None = None,
    jobs: int | None = None,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    resume: bool = False,
    progress: Progress = False,
) -> "Lot":
    """Calibrate, diagnose or correct many records, and judge their instruments as a lot.

    A record that cannot be used is a row with its reason. The folder has a result for each record, a folder for each
    instrument, a table and a page.

    Parameters
    ----------
    files : path
        Records; or one table (CSV) with the column file, and if known serial, date, temperature_degC and options, as
        noise_bound.
    do : str
        Work on each record: calibrate, diagnose, noise or apply.
    out : path
        Folder for the results.
    gravity : float, optional
        Model value of gravity [m/s²]. Default: that of the work.
    mounting : str, optional
        Mounting of the block: a preset, or a TOML file.
    baseline : str, optional
        Scale factors of each accelerometer: two (asymmetric) or one (symmetric).
    calibration : path, optional
        With apply: a calibration, or the folder of a batch that has one for each instrument.
    tolerance : path, optional
        Table of tolerances (TOML): each record passes or fails.
    jobs : int, optional
        Number of worker processes. Default: the number of cores.
    engine : str
        Where the work runs: on this machine, or on a Dask cluster (extra `cluster`).
    scheduler : str, optional
        Address of the scheduler of --engine dask. Its workers read the same paths. Default: a local cluster.
    resume : bool
        Keep the results that the folder holds; work on new, changed and failed records.

    Returns
    -------
    Lot
        A row for each record; distributions, odd instruments, shared causes, trends.

    Raises
    ------
    InputError
        for options that do not go together, or a folder that holds another batch; earlier results are kept
    KeyboardInterrupt
        Ctrl-C; the folder is whole, and `resume` goes on

    Examples
    --------
    >>> import trihedron as th
    >>> th.batch("monday.csv", "tuesday.csv", do="calibrate", out="week", noise_bound=1e-5)  # doctest: +SKIP
    """
    options: dict[str, Any] = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity}
    options |= {"mounting": mounting, "baseline": baseline, "stamps": stamps}
    if calibration is not None:
        options["calibration"] = str(Path(calibration).absolute())
    options |= {"channels": tuple(channels) or None, "trust": trust or None}
    wanted = {name: value for name, value in options.items() if value is not None}
    return batches.carry_out(
        BatchRequest(
            files=[Path(file) for file in files],
            do=do,
            out=Path(out),
            options=wanted,
            tolerance=None if tolerance is None else Path(tolerance),
            jobs=jobs,
            engine=engine,
            scheduler=scheduler,
            resume=resume,
            progress=progress,
        )
    )
