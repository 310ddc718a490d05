"""Functions of `import trihedron as th` for plans; `trihedron plan` takes its options and help from here."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from .. import calibration as calibrations
from .. import noise as noises
from .. import planning
from ..errors import InputError
from ..options import Admissible, Baseline, Bounds, Convention, Mounting, NoiseResult, Option, Progress, Trust

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

GYRO_NOISE = 1e-5
"""Bound of a gyro's mean noise over one second that a plan takes where none is given [rad/s]."""


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
    """Find the best table positions and weights for each target, with the proof that none are better.

    Parameters
    ----------
    targets : str
        Targets, as X4 or X4-X5. Default: all targets of the convention.
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
    noise_bound: float | None = None,
    noise_result: NoiseResult = None,
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
    """Find one set of positions for all targets, with a proven bound for every other set.

    Parameters
    ----------
    count : int, optional
        Number of positions. Default: the fewest that keep the accuracy.
    rate_dps : float, optional
        Rate of the table [deg/s]. Default: 1 rad/s.
    acceleration_dps2 : float, optional
        Angular acceleration of the table [deg/s²]. Default: 1 rad/s².
    goal : str, optional
        Use of the correction, in place of single targets. levelling: smallest error of a level; gyrocompass: of the
        azimuth.
    latitude_deg : float, optional
        Latitude of the gyrocompass [deg]. Default: 55.75.
    accuracy : str, optional
        Largest allowed error of the goal, or of each target: 7arcsec, 20ug, 5ppm, 1e-5.
    noise_bound : float, optional
        σ for goal and accuracy, as a fraction of g. Default: 1e-5.
    noise_result : path or Noise, optional
        The result of `trihedron noise --dwell --json`, in place of σ: the noise of the instrument.
    measured : path, optional
        Position record of positions already measured; they count beside the new ones.
    criterion : str
        Ratio of cost to optimum to minimise: of the worst target, or the mean.
    reserve_deg : float
        Largest setting error that the positions must allow [deg].
    resolution_deg : float, optional
        Step of the table's angles, to which positions are rounded [deg].
    keep_out : sequence of str
        Forbidden angles: alpha:LOW:HIGH or beta:LOW:HIGH [deg].
    order : str
        Order of the positions: the shortest tour, or random against drift.
    repeat : int
        Number of positions to measure twice.
    detect : sequence of str
        Effect that extra positions shall reveal, as 'quadratic accelerometer-3' or 'quadratic'.
    extra : int
        Number of extra positions for --detect.
    mountings : sequence
        Mountings, presets or TOML files, over which to split the positions.
    targets : sequence of str
        Target that the positions must determine, as X4 or X4-X5. Default: all of the convention.
    seed : int
        Seed of the search and of the random order.
    starts : int
        Number of local searches.
    cuts : int
        Number of cuts for the lower bound; 0: no bound.
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
    del options["count"], options["progress"], options["noise_result"]
    options["noise_bound"] = _noise_bound_of(noise_result, noise_bound, count)
    if (count is None) == (accuracy is None):
        raise InputError("a number of positions and --accuracy: give one of the two")
    request = planning.Request(**options)
    if count is None:
        return planning.fewest_positions(request, progress=progress)
    return planning.common_positions(count, request, progress=progress)


def plan_check(
    file: str | Path,
    *,
    noise_bound: float | None = None,
    noise_result: NoiseResult = None,
    keep_out: Sequence[str] = (),
    admissible: Admissible = "paper",
    bounds: Bounds = (3e-3, 1e-2),
    convention: Convention = "A1",
    baseline: Baseline = "asymmetric",
    mounting: Mounting = "identity",
    progress: Progress = False,
) -> "planning.SettingCheck":
    """Compare the bias and noise of a plan at the angles that were set, and advise.

    Parameters
    ----------
    file : path
        Table (CSV) with planned_alpha_deg, planned_beta_deg, alpha_deg, beta_deg, as written by `plan positions --out`.
    noise_bound : float, optional
        σ, as a fraction of g. Default: 1e-5.
    noise_result : path or Noise, optional
        The result of `trihedron noise --dwell --json`, in place of σ: the noise of the instrument.
    keep_out : sequence of str
        Forbidden angles: alpha:LOW:HIGH or beta:LOW:HIGH [deg].

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
    noise_bound = _noise_bound_of(noise_result, noise_bound, len(planned))
    return planning.check_settings(planning.task_of(request, progress=progress), planned, actual, noise_bound)


def plan_imu(
    minutes: float,
    *,
    gyro_noise: float | None = None,
    encoder_bound: float | None = None,
    latitude_deg: float = 55.75,
    azimuth_deg: float = 0.0,
    rate_dps: float = 100.0,
    exchanges: int = 4,
    noise_bound: float | None = None,
    noise_result: NoiseResult = None,
    dwell_s: float = 20.0,
    progress: Progress = False,
) -> "planning.ImuPlan":
    """Find rests and turns that determine accelerometers, gyros and bench in a given time.

    Parameters
    ----------
    minutes : float
        Time on the table [min].
    gyro_noise : float, optional
        Bound of a gyro's mean noise over one second [rad/s]. Default: 1e-5, or by --noise.
    encoder_bound : float, optional
        Bound of an encoder's error [rad]. Default: σ.
    latitude_deg : float
        Latitude of the bench [deg].
    azimuth_deg : float
        Azimuth of the bench's outer axis, from north towards east [deg].
    rate_dps : float
        Rate of the table [deg/s].
    exchanges : int
        Number of improvements of the chosen set.
    noise_bound : float, optional
        σ, as a fraction of g. Default: 1e-5.
    noise_result : path or Noise, optional
        The result of `trihedron noise --dwell --json`, in place of σ: the noise of the instrument.
    dwell_s : float
        Shortest rest at a position [s].
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
    if noise_result is not None:
        averaged = noises.bound_for(noise_result, noise_bound, dwell_s=dwell_s)
        noise_bound = averaged.sigma
        if gyro_noise is None:
            gyro_noise = noises.gyro_bound_for(noise_result, averaged)
    noise_bound = _noise_bound_of(None, noise_bound, None)
    if gyro_noise is None:
        gyro_noise = GYRO_NOISE
    bench = calibrations.BenchOnEarth(latitude_deg, azimuth_deg, gyro_noise, encoder_bound)
    return planning.imu_programme(
        minutes,
        planning.Planned(bench, noise_bound),
        dwell_s=dwell_s,
        rate_dps=rate_dps,
        exchanges=exchanges,
        progress=progress,
    )


def _noise_bound_of(noise: NoiseResult, noise_bound: float | None, positions: int | None) -> float:
    """Return σ by the noise of the instrument, as given, or the usual one."""
    if noise is not None:
        return noises.bound_for(noise, noise_bound, positions).sigma
    return planning.Request.noise_bound if noise_bound is None else noise_bound


def plan_hand(
    *,
    accuracy: str = "1mg",
    turn_accuracy: str | None = None,
    targets: Sequence[str] = (),
    noise_result: Annotated[str | Path | None, Option(name="--noise")] = None,
    noise_density: float = 4e-3,
    measured: str | Path | None = None,
    trust: Trust = False,
) -> "planning.HandPlan":
    """Find the poses and turns by hand that calibrate an IMU without a table, to a wanted error.

    Parameters
    ----------
    accuracy : str
        Wanted standard error of |f| at rest in the worst pose: 1mg, 200ug.
    turn_accuracy : str, optional
        Wanted standard error of a turn of 90° about the worst axis by the gyros: 10arcmin. Default: gyros do not
        matter.
    targets : sequence of str
        Wanted standard error of a parameter: bias_1=0.5mg, gamma_21=5e-4, M12=1mrad. Repeat it for several.
    noise_result : path, optional
        The result of `trihedron noise --json`: its noise density counts.
    noise_density : float
        Noise density of the accelerometers [m/s²/√Hz], from which the length of a rest follows; 4e-3 is 0.4 mg/√Hz.
    measured : path, optional
        A strapdown record whose rests and moves count.

    Returns
    -------
    HandPlan
        The steps, with the predicted errors after each.

    Raises
    ------
    InputError
        for a wanted error that cannot be reached, an unknown parameter, or a record that cannot be used

    Examples
    --------
    >>> import trihedron as th
    >>> len(th.plan_hand(accuracy="1mg").steps)
    9
    """
    if noise_result is not None:
        noise_density = planning.density_of(noises.read_noise(noise_result))
    return planning.plan_by_hand(
        planning.HandPlanRequest(accuracy, turn_accuracy, tuple(targets), noise_density, measured, trust)
    )
