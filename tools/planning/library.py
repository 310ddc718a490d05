"""Functions of `import trihedron as th` for plans; `trihedron plan` takes its options and help from here."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from .. import calibration as calibrations
from .. import planning
from ..errors import InputError
from ..options import Admissible, Baseline, Bounds, Convention, Mounting, Progress

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def plan(
    *targets: str,
    grid: float | None = 1.0,
    admissible: Admissible = "paper",
    bounds: Bounds = (3e-3, 1e-2),
    convention: Convention = "A1",
    baseline: Baseline = "asymmetric",
    mounting: Mounting = "identity",
    progress: Progress = False,
) -> "planning.Plans":
    """Find the table positions and weights that estimate each target best, with the proof that none are better.

    Parameters
    ----------
    targets : str
        A target, as X4 or X4-X5; may be repeated. All of the convention without it.
    grid : float or None
        Step of the grid of positions [deg]; 1 by default. None: all angles.

    Returns
    -------
    Plans
        The optimal plan of each target, with its proof.

    Raises
    ------
    InputError
        for options that cannot be used, and a grid that cannot determine a target

    Examples
    --------
    >>> import trihedron as th
    >>> th.plan("X4")[0].optimum.cost  # doctest: +SKIP
    """
    return planning.optimal_plans(
        targets,
        grid=grid,
        admissible=admissible,
        bounds=bounds,
        convention=convention,
        baseline=baseline,
        mounting=mounting,
        progress=progress,
    )


def plan_positions(
    count: int | None = None,
    *,
    rate_dps: float | None = None,
    acceleration_dps2: float | None = None,
    goal: Literal["levelling", "gyrocompass"] | None = None,
    latitude_deg: float | None = None,
    accuracy: str | None = None,
    noise_bound: float = 1e-5,
    measured: str | Path | None = None,
    criterion: Literal["worst", "mean"] = "worst",
    reserve_deg: float = 0.0,
    resolution_deg: float | None = None,
    keep_out: Sequence[str] = (),
    order: Literal["tour", "random"] = "tour",
    repeat: int = 0,
    detect: Sequence[str] = (),
    extra: int = 6,
    mountings: "Sequence[str | Mapping[str, ArrayLike]]" = ("identity",),
    targets: Sequence[str] = (),
    seed: int = 0,
    starts: int = 30,
    cuts: int = 40,
    admissible: Admissible = "paper",
    bounds: Bounds = (3e-3, 1e-2),
    convention: Convention = "A1",
    baseline: Baseline = "asymmetric",
    progress: Progress = False,
) -> "planning.PositionPlan":
    """Find one set of positions for all targets, with a proven bound of every other set.

    Parameters
    ----------
    count : int, optional
        Number of positions; the fewest found to keep the accuracy without it.
    rate_dps : float, optional
        How fast the table turns [deg/s]; 1 rad/s without it.
    acceleration_dps2 : float, optional
        How fast its rate changes [deg/s²]; 1 rad/s² without it.
    goal : str, optional
        What the correction is for, in place of single targets: levelling makes the largest error of a level small,
        gyrocompass that of the azimuth, at the latitude.
    latitude_deg : float, optional
        Of the gyrocompass [deg], 55.75.
    accuracy : str, optional
        The error that the goal, or each target, must keep, as 7arcsec, 20ug, 5ppm or 1e-5.
    noise_bound : float
        σ, as a fraction of g, for goal and accuracy.
    measured : path, optional
        A position record that is there already: its positions count beside the new ones.
    criterion : str
        Which ratio of cost to optimum is made small.
    reserve_deg : float
        Readings still count with setting errors up to that [deg].
    resolution_deg : float, optional
        Round positions to multiples of this [deg].
    keep_out : sequence of str
        Angles not to use: alpha:LOW:HIGH or beta:LOW:HIGH [deg].
    order : str
        Shortest tour, or at random against drift.
    repeat : int
        Measure so many positions a second time.
    detect : sequence of str
        An effect, as 'quadratic accelerometer-3' or 'quadratic', that extra positions should show.
    extra : int
        Extra positions for --detect.
    mountings : sequence
        Several mountings, presets or TOML files: the set is split over them.
    targets : sequence of str
        What the set is to determine, as X4 or X4-X5; all targets of the convention by default.
    seed : int
        Of search and random order.
    starts : int
        Local searches.
    cuts : int
        Cuts sought for the lower bound. 0: no bound.
    progress : bool
        Show bars on standard error, where that is a terminal.

    Returns
    -------
    PositionPlan
        The positions with their costs, bound and order.

    Raises
    ------
    InputError
        for options that cannot be used, and where no set was found that determines every target

    Examples
    --------
    >>> import trihedron as th
    >>> th.plan_positions(12, reserve_deg=0.1).worst_ratio  # doctest: +SKIP
    """
    options = dict(locals())
    del options["count"], options["progress"]
    if (count is None) == (accuracy is None):
        raise InputError("a number of positions and --accuracy: give one of the two")
    request = planning.Request(**options)
    if count is None:
        return planning.fewest_positions(request, progress=progress)
    return planning.common_positions(count, request, progress=progress)


def plan_check(
    file: str | Path,
    *,
    noise_bound: float = 1e-5,
    keep_out: Sequence[str] = (),
    admissible: Admissible = "paper",
    bounds: Bounds = (3e-3, 1e-2),
    convention: Convention = "A1",
    baseline: Baseline = "asymmetric",
    mounting: Mounting = "identity",
    progress: Progress = False,
) -> "planning.SettingCheck":
    """Compare bias and noise of a plan at the angles that were set, and say what to do about them.

    Parameters
    ----------
    file : path
        A table with planned_alpha_deg, planned_beta_deg, alpha_deg, beta_deg, as `plan positions --out` writes it.
    noise_bound : float
        σ, as a fraction of g.
    keep_out : sequence of str
        Angles that no row may have: alpha:LOW:HIGH or beta:LOW:HIGH [deg].

    Returns
    -------
    SettingCheck
        Bias and noise for each target, with advice.

    Raises
    ------
    InputError
        for a file without these angles, and positions that do not determine every target

    Examples
    --------
    >>> import trihedron as th
    >>> th.plan_check("plan12/angles.csv").advice  # doctest: +SKIP
    """
    planned, actual = planning.read_settings(Path(file), keep_out)
    request = planning.Request(
        keep_out=tuple(keep_out),
        admissible=admissible,
        bounds=bounds,
        convention=convention,
        baseline=baseline,
        mountings=(mounting,),
    )
    return planning.check_settings(planning.task_of(request, progress=progress), planned, actual, noise_bound)


def plan_imu(
    minutes: float,
    *,
    gyro_noise: float = 1e-5,
    encoder_bound: float | None = None,
    latitude_deg: float = 55.75,
    azimuth_deg: float = 0.0,
    rate_dps: float = 100.0,
    exchanges: int = 4,
    noise_bound: float = 1e-5,
    dwell_s: float = 20.0,
    progress: Progress = False,
) -> "planning.ImuPlan":
    """Find rests and turns that determine accelerometers, gyros and bench in a given time.

    Parameters
    ----------
    minutes : float
        Time on the table [min].
    gyro_noise : float
        Bound of the mean of a gyro over one second [rad/s].
    encoder_bound : float, optional
        Bound of an encoder's error [rad]; by default σ.
    latitude_deg : float
        Where the bench stands [deg].
    azimuth_deg : float
        Its outer axis from north towards east [deg].
    rate_dps : float
        How fast the table turns [deg/s].
    exchanges : int
        How often what is chosen is improved.
    noise_bound : float
        σ, as a fraction of g.
    dwell_s : float
        Least rest at a position [s].
    progress : bool
        Show bars on standard error, where that is a terminal.

    Returns
    -------
    ImuPlan
        The programme with its promised errors.

    Raises
    ------
    InputError
        for options that cannot be used, and too little time

    Examples
    --------
    >>> import trihedron as th
    >>> th.plan_imu(30.0).worst_ratio  # doctest: +SKIP
    """
    bench = calibrations.Bench(latitude_deg, azimuth_deg, gyro_noise, encoder_bound)
    return planning.imu_programme(
        minutes,
        planning.Planned(bench, noise_bound),
        dwell_s=dwell_s,
        rate_dps=rate_dps,
        exchanges=exchanges,
        progress=progress,
    )
