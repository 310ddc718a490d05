"""The commands of `trihedron plan`: for one target, for all, at the angles that were set, for a whole IMU."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from .. import document, planning, reports
from .. import noise as noises
from ..errors import InputError, nearest
from ..files import write_text
from ..planning import library
from ..rounding import exactly
from .answer import Answer, File, Folder, JsonFile, ReportFile, answer, distinct_files, with_options_of

plan = App(
    name="plan",
    help="Choose where to measure: for one target, for all, or for a whole IMU. Check the angles that were set.\n\n"
    "Example: trihedron plan positions 12 --out plan12",
)
OF_A_SET = ("--curve", "--accuracy", "--goal", "--starts", "--cuts", "--seed", "--criterion", "--reserve", "--keep-out")
"""Options of the former `plan` that were of a common set of positions alone."""


@plan.command
@with_options_of(library.plan)
def target(
    *targets: str,
    grid: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    continuum: bool = False,
    picture: File = None,
    json: JsonFile = None,
    report: ReportFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron plan target X4 --continuum --picture X4.svg

    Parameters
    ----------
    grid
        Step of the grid of positions [deg]. Default: 1.
    continuum
        Use all angles in place of a grid.
    picture
        Write the paper's figure of one target to this SVG file.
    """
    distinct_files({"--json": json, "--report": report, "--picture": picture})
    if continuum and grid is not None:
        raise InputError("--grid and --continuum: give one of the two")
    if picture is not None and len(targets) != 1:
        raise InputError("--picture: is of one target; give one")
    if grid is None and not continuum:
        grid = 1.0
    plans = library.plan(*targets, grid=grid, **options, progress=True)
    if report is not None:
        reports.write_report(report, plans)
    if picture is not None:
        write_text(picture, reports.plan_picture(plans[0]).svg())
    return answer(plans, json)


@plan.command
@with_options_of(library.plan_positions)
def positions(
    count: int | None = None,
    /,
    *,
    curve: Annotated[tuple[int, int] | None, Parameter(allow_leading_hyphen=True)] = None,
    dwell: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    out: Folder = None,
    json: JsonFile = None,
    report: ReportFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron plan positions 12 --reserve 0.1 --out plan12

    Example: trihedron plan positions --goal levelling --accuracy 7arcsec

    Parameters
    ----------
    curve
        Show the cost against the number of positions, from LOW to HIGH.
    dwell
        Time at each position [s], for --out and --report. Default: 20, or that of --noise.
    out
        Folder for programme, table list, operator's page, picture.
    """
    noise = options.get("noise_result")
    distinct_files({"--json": json, "--report": report, "--noise": noise})
    for name in ("noise_bound", "noise_result"):
        if name in options and not options.keys() & {"goal", "accuracy"}:
            raise InputError(f"--{name.removesuffix('_result').replace('_', '-')}: goes with --goal or --accuracy")
    dwell = _dwell_of(dwell, noise)
    if curve is not None:
        if report is not None:
            raise InputError("--report: does not go with --curve; it is the page of one set")
        return _curve(count, options, curve, out, json)
    chosen = library.plan_positions(count, **options, progress=True)
    files = []
    if out is not None:
        files = reports.write_plan(chosen, out, dwell_s=dwell)
    if report is not None:
        document.write_page(report, reports.operator_page(chosen, dwell))
    return answer(chosen, json, files=files)


def _dwell_of(dwell: float | None, noise: Any) -> float:
    """Return the time at each position [s]: that of the noise, where σ is for it.

    Raises InputError for another one beside the noise.
    """
    if noise is None:
        return planning.checked_dwell(planning.DWELL_S if dwell is None else dwell)
    usual = noises.bound_for(noise, None).dwell_s
    if dwell is not None and dwell != usual:
        raise InputError(
            f"--dwell {exactly(dwell)}: {noise} gives σ for {exactly(usual)} s; leave out --dwell, or run "
            "`trihedron noise` with it"
        )
    return usual


NOT_OF_A_CURVE = (
    *("resolution_deg", "order", "repeat", "detect", "extra", "measured"),
    *("rate_dps", "acceleration_dps2", "latitude_deg", "accuracy", "noise_result"),
)
"""Options of one set that a curve has no use for."""


def _curve(count: int | None, options: dict[str, Any], curve: tuple[int, int], out: Path | None, json: Path | None):
    if count is not None:
        raise InputError(f"{count} positions and --curve: give one of the two")
    for name in NOT_OF_A_CURVE:
        if name in options:
            option = name.removesuffix("_deg").removesuffix("_result").replace("_", "-")
            raise InputError(f"--{option}: does not go with --curve")
    points = planning.plan_curve(*curve, planning.Request(**options), progress=True)
    files = []
    if out is not None:
        files = reports.write_curve(points, out)
    return answer(points, json, files=files)


@plan.command(name="check")
@with_options_of(library.plan_check)
def check_plan(file: Path, /, *, json: JsonFile = None, **options: Any) -> Answer:
    """Example: trihedron plan check plan12/angles.csv --noise-bound 1e-5"""
    distinct_files({"the angles": file, "--json": json, "--noise": options.get("noise_result")})
    return answer(library.plan_check(file, **options, progress=True), json)


@plan.command
@with_options_of(library.plan_imu)
def imu(
    *,
    minutes: Annotated[float, Parameter(allow_leading_hyphen=True)] = 30.0,
    out: Folder = None,
    json: JsonFile = None,
    report: ReportFile = None,
    **options: Any,
) -> Answer:
    """Example: trihedron plan imu --minutes 30 --gyro-noise 1e-5 --out imu30

    Parameters
    ----------
    out
        Folder for programme, operator's page and plan.
    """
    distinct_files({"--json": json, "--report": report, "--noise": options.get("noise_result")})
    programme = library.plan_imu(minutes, **options, progress=True)
    files = []
    if out is not None:
        files = reports.write_imu_plan(programme, out)
    if report is not None:
        reports.write_report(report, programme)
    return answer(programme, json, files=files)


@plan.command
@with_options_of(library.plan_hand)
def hand(*, json: JsonFile = None, report: ReportFile = None, **options: Any) -> Answer:
    """Example: trihedron plan hand --accuracy 1mg --turn-accuracy 10arcmin

    Example: trihedron plan hand --accuracy 0.5mg --measured monday.csv
    """
    measured = options.get("measured")
    distinct_files({"--measured": None if measured is None else Path(measured), "--json": json, "--report": report})
    steps = library.plan_hand(**options)
    if report is not None:
        reports.write_report(report, steps)
    return answer(steps, json)


@plan.default
def former(*words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)]) -> Answer:
    """Refuse the spelling of `plan` with options alone, and answer with the command that it is now."""
    commands = ("target", "positions", "check", "imu", "hand")
    if words and not words[0].startswith("-"):
        raise InputError(f"plan {words[0]}: is not a command; {nearest(words[0], commands)}")
    spelling = present_spelling(words)
    plan.parse_args(spelling, exit_on_error=False, print_error=False)
    command = shlex.join(["trihedron", "plan", *spelling])
    raise InputError(f"plan has five commands, {', '.join(commands)}: write {command}")


def present_spelling(words: Sequence[str]) -> list[str]:
    """Return the present command for these former options of `plan`."""
    options = [word.partition("=")[0] for word in words]
    if "--imu" in options:
        return ["imu", *(word for word in words if word != "--imu")]
    if "--check" in options:
        return ["check", *_without(words, "--check")]
    if "--positions" in options:
        return ["positions", *_without(words, "--positions")]
    if set(options) & set(OF_A_SET):
        return ["positions", *words]
    return ["target", *_without(words, "--target")]


def _without(words: Sequence[str], option: str) -> list[str]:
    """The values of an option in front, then all words but these."""
    values, rest = [], []
    after = False
    for word in words:
        name, equals, value = word.partition("=")
        if after:
            values.append(word)
            after = False
        elif name != option:
            rest.append(word)
        elif equals:
            values.append(value)
        else:
            after = True
    if any(value.startswith("-") for value in values):
        return [*rest, "--", *values]
    return [*values, *rest]
