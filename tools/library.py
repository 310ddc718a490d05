"""What `import trihedron as th` gives: a function for each thing that the program does.

Every command is a thin layer over one of these. Results print themselves, show themselves in a notebook, and go to
polars by `to_polars`; those of a published schema go to JSON by `to_json`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from numpy.typing import ArrayLike

from .bench_run import Simulation, simulate
from .checking import Check, check
from .errors import InputError
from .exporting import Exported, export
from .installation import Installation, doctor
from .records import PositionRecord, Source, StrapdownRecord, read_record
from .result import Result
from .templates import new

if TYPE_CHECKING:
    from .attitude import AttitudeRun
    from .calibration import Calibration
    from .calibration.correction import Application
    from .campaign.campaign import Done
    from .diagnosis import Diagnosis
    from .hidden import HiddenRecord
    from .planning.common_plan import CommonPlan
    from .planning.plan import Plans
    from .strapdown.inspection import Inspection
    from .strapdown.result import StrapdownDiagnosis

__all__ = [
    "Check",
    "Exported",
    "InputError",
    "Installation",
    "Simulation",
    "apply",
    "attitude_of_record",
    "calibrate",
    "check",
    "diagnose",
    "doctor",
    "export",
    "hide",
    "inspect",
    "new",
    "plan",
    "plan_positions",
    "read_record",
    "run_campaign",
    "simulate",
]


def calibrate(
    record: Source,
    *,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    convention: Literal["A1", "A2"] = "A1",
    baseline: Literal["asymmetric", "symmetric"] = "asymmetric",
    bounds: tuple[float, float] = (3e-3, 1e-2),
    mounting: str | Mapping[str, ArrayLike] = "identity",
    targets: Sequence[str] = (),
    priors: Sequence[str] = (),
) -> "Calibration":
    """Solve the guaranteed linear programme: estimates, guaranteed errors, exact intervals, verdict.

    Parameters
    ----------
    record : path, DataFrame, record or Simulation
        a position record, or a raw record, whose rests are averaged
    noise_bound : float, optional
        σ, the bound of one averaged reading's error, as a fraction of g; without it the record must tell
    gravity : float
        model value [m/s²]
    convention, baseline, bounds, mounting, targets, priors
        as in `trihedron.tools.calibration.calibrate`

    Raises
    ------
    InputError
        whatever cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/static-calibration.toml")
    >>> th.calibrate(run, noise_bound=1e-5).verdict
    'consistent'
    """
    from .calibration import calibrate as solve

    return solve(
        read_record(record, PositionRecord),
        noise_bound=noise_bound,
        gravity=gravity,
        convention=convention,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        targets=targets,
        priors=priors,
    )


def diagnose(
    record: Source,
    *,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    baseline: Literal["asymmetric", "symmetric", "calibrated", "nominal"] | None = None,
    bounds: tuple[float, float] = (3e-3, 1e-2),
    mounting: str | Mapping[str, ArrayLike] = "identity",
    rates: Literal["instantaneous", "averaged"] = "instantaneous",
    progress: bool = False,
) -> "Diagnosis | StrapdownDiagnosis":
    """Say whether the simulation can be true of a record; if not, name the effect that it lacks.

    Parameters are those of `calibrate`; `progress` shows a bar on standard error, where that is a terminal. Of a
    strapdown record `baseline` is "calibrated" or "nominal", as in `strapdown.diagnosis.diagnose_strapdown`,
    and `rates` says what a rate means; its bounds come from the record.

    Raises
    ------
    InputError
        whatever cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> th.diagnose("measured.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    run = read_record(record, PositionRecord, StrapdownRecord)
    if isinstance(run, StrapdownRecord):
        from .strapdown.diagnosis import diagnose_strapdown

        if noise_bound is not None or bounds != (3e-3, 1e-2) or mounting != "identity":
            raise InputError(f"{run.path}: of a strapdown record noise_bound, bounds and mounting have no meaning")
        return diagnose_strapdown(run, gravity=gravity, baseline=baseline, rates=rates)
    from .diagnosis import diagnose as judge

    if rates != "instantaneous":
        raise InputError(f"--rates {rates}: is of a strapdown record; a record of a table has no rates")
    return judge(
        run,
        noise_bound=noise_bound,
        gravity=gravity,
        baseline=baseline or "asymmetric",
        bounds=bounds,
        mounting=mounting,
        progress=progress,
    )


def plan(*targets: str, progress: bool = False, **options: Any) -> "Plans":
    """The table positions and weights that estimate each target best, with the proof that none are better.

    Parameters
    ----------
    targets : str
        as "X4" or "X4-X5"; all of the convention when none is named
    progress : bool
        show a bar on a terminal
    options
        grid, admissible, bounds, convention, baseline, mounting of `trihedron.tools.planning.plan.plan_targets`

    Examples
    --------
    >>> import trihedron as th
    >>> th.plan("X4")[0].optimum.cost  # doctest: +SKIP
    """
    from .planning.plan import Plans, plan_targets

    return Plans(tuple(plan_targets(targets, progress=progress, **options)))


def plan_positions(count: int, *, progress: bool = False, **options: Any) -> "CommonPlan":
    """One set of `count` positions for all targets, with what is proven of every other set.

    Parameters
    ----------
    count : int
    progress : bool
        show bars on a terminal
    options
        the fields of `trihedron.tools.planning.request.Request`

    Raises
    ------
    InputError
        for options that cannot be used
    """
    from .errors import nearest
    from .planning.common_plan import plan_positions as search
    from .planning.request import Request

    known = list(Request.__dataclass_fields__)
    for name in options:
        if name not in known:
            raise InputError(f"plan_positions: there is no option {name}; {nearest(name, known)}")
    return search(count, Request(**options), progress=progress)


def inspect(record: Source, *, gravity: float = 9.80665) -> "Inspection":
    """Say what a strapdown record supports: sampling, rests, moves, and what its rests say of the instruments.

    Raises
    ------
    InputError
        for a record of a table, or gravity that is none
    """
    from .strapdown.inspection import inspect_record

    if not 1.0 <= gravity <= 100.0:
        raise InputError(f"--gravity {gravity!r}: gravity in m/s2 is needed, 1 to 100")
    return inspect_record(read_record(record, StrapdownRecord), gravity=gravity)


def attitude_of_record(record: Source, **options: Any) -> "AttitudeRun":
    """Run a strapdown record through the attitude computer's FMU; compare with the true attitude where it is known.

    Options are those of `trihedron.tools.attitude.attitude_of_record`: algorithm, rates, gyro_bias, rate_divisor, out,
    progress.
    """
    from .attitude import attitude_of_record as run

    return run(read_record(record, StrapdownRecord), **options)


def apply(calibration: "str | Path | Calibration", record: str | Path, *, noise_bound: float = 0.0) -> "Application":
    """Correct the readings of a record by a calibration.

    Parameters
    ----------
    calibration : path or Calibration
        the file of `trihedron calibrate --json`, or the value
    record : path
        position, raw or strapdown record
    noise_bound : float
        bound of the readings' own errors [g], for what remains after the correction

    Raises
    ------
    InputError
        for a calibration that is not consistent, or a record that cannot be used
    """
    from .calibration.correction import apply_calibration

    return apply_calibration(calibration, Path(record), noise_bound=noise_bound)


def hide(seed: int = 0, *effects: str, baseline: Literal["asymmetric", "symmetric"] = "asymmetric") -> "HiddenRecord":
    """A "measured" record with one hidden effect, and the secret.

    Parameters
    ----------
    seed : int
        decides truth, effect, size and noise
    effects : str
        draw from these only
    baseline : str
        "symmetric" lets scale-asymmetry be hidden

    Raises
    ------
    InputError
        a seed, an effect or a baseline that there is not

    Examples
    --------
    >>> import trihedron as th
    >>> hidden = th.hide(7, "quadratic")
    >>> th.diagnose(hidden.record, noise_bound=1e-5).causes[0].place.effect
    'quadratic'
    """
    from .hidden import hidden_record

    if baseline not in ("asymmetric", "symmetric"):
        raise InputError(f"--baseline {baseline}: must be asymmetric or symmetric")
    return hidden_record(seed, effects=effects or None, symmetric=baseline == "symmetric")


def run_campaign(path: str | Path, out: str | Path | None = None, **options: Any) -> "Done":
    """Carry out a campaign: thousands of runs from one file.

    Options are those of `trihedron.tools.campaign.campaign.run_campaign`: jobs, engine, scheduler, resume, progress.
    """
    from .campaign.campaign import run_campaign as run

    return run(Path(path), None if out is None else Path(out), **options)


def _shown(result: Result, medium: str) -> str:
    """What a person sees of a result: text, or the page of a notebook."""
    from .shown import page_html
    from .summaries import text_of

    text = text_of(result)
    return text if medium == "text" else page_html(text.split("\n"), getattr(result, "to_polars", lambda: None)())


Result.shown = _shown
