"""`trihedron plan` for a common set of positions: options, files, what is printed."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .errors import InputError
from .outputs import ordinary_folder


@dataclass(frozen=True)
class PositionOptions:
    """Options of a common set of positions; None where not given."""

    positions: Annotated[
        int | None, Parameter(allow_leading_hyphen=True, help="One set of so many positions for all targets.")
    ] = None
    curve: Annotated[
        tuple[int, int] | None,
        Parameter(allow_leading_hyphen=True, help="Cost against the number of positions, from LOW to HIGH."),
    ] = None
    check: Annotated[
        Path | None,
        Parameter(help="Compare bias and noise of a plan at the angles that were set: planned_..., alpha_deg, ..."),
    ] = None
    criterion: Annotated[
        Literal["worst", "mean"] | None, Parameter(help="Which ratio of cost to optimum is made small; worst.")
    ] = None
    reserve: Annotated[
        float | None,
        Parameter(allow_leading_hyphen=True, help="Readings still count with setting errors up to that [deg]; 0."),
    ] = None
    resolution: Annotated[
        float | None, Parameter(allow_leading_hyphen=True, help="Round positions to multiples of this [deg].")
    ] = None
    keep_out: Annotated[
        tuple[str, ...] | None, Parameter(help="Angles not to use: alpha:LOW:HIGH or beta:LOW:HIGH [deg].")
    ] = None
    order: Annotated[
        Literal["tour", "random"] | None, Parameter(help="Shortest tour, or at random against drift; tour.")
    ] = None
    repeat: Annotated[
        int | None, Parameter(allow_leading_hyphen=True, help="Measure so many positions a second time.")
    ] = None
    detect: Annotated[
        tuple[str, ...] | None,
        Parameter(help="An effect, as 'quadratic accelerometer-3' or 'quadratic', that extra positions should show."),
    ] = None
    extra: Annotated[int | None, Parameter(allow_leading_hyphen=True, help="Extra positions for --detect; 6.")] = None
    mountings: Annotated[
        tuple[str, ...] | None,
        Parameter(
            consume_multiple=(1, None), help="Several mountings, presets or TOML files: the set is split over them."
        ),
    ] = None
    seed: Annotated[int | None, Parameter(allow_leading_hyphen=True, help="Of search and random order; 0.")] = None
    starts: Annotated[int | None, Parameter(allow_leading_hyphen=True, help="Local searches; 30.")] = None
    cuts: Annotated[
        int | None, Parameter(allow_leading_hyphen=True, help="Cuts sought for the lower bound; 40. 0: no bound.")
    ] = None
    dwell: Annotated[
        float | None, Parameter(allow_leading_hyphen=True, help="Time at each position [s], for --out; 20.")
    ] = None
    noise_bound: Annotated[
        float | None, Parameter(allow_leading_hyphen=True, help="σ, as a fraction of g, for --check; 1e-5.")
    ] = None
    out: Annotated[
        Path | None,
        Parameter(validator=ordinary_folder, help="Folder for programme, table list, operator's page, picture."),
    ] = None

    def given(self) -> dict[str, Any]:
        """The options that were given, by their field names."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) is not None}


SEARCH = ("criterion", "reserve", "keep_out", "seed", "starts", "cuts", "mountings")
FOR = {
    "positions": (*SEARCH, "resolution", "order", "repeat", "detect", "extra", "dwell", "out"),
    "curve": (*SEARCH, "out"),
    "check": ("noise_bound",),
}
"""Which options go with which of the three uses."""
IN_REQUEST = {"reserve": "reserve_deg", "resolution": "resolution_deg"}


def plan_common(
    options: PositionOptions,
    common: dict[str, Any],
    others: dict[str, object],
    json: Path | None,
    report: Path | None = None,
) -> Answer | None:
    """Do what these options ask for; None where they ask for nothing.

    Parameters
    ----------
    options : PositionOptions
    common : dict
        admissible, bounds, convention, baseline, mounting
    others : dict
        options of the plans of single targets, by name; false where not given
    json : Path or None
    report : Path or None
        where the operator's page of a plan of positions is written too

    Raises
    ------
    InputError
        for options that do not go together
    """
    given = options.given()
    uses = [name for name in FOR if name in given]
    if len(uses) > 1:
        raise InputError(f"--{uses[0]} and --{uses[1]}: give one of the two")
    if not uses:
        if given:
            raise InputError(f"--{_dashed(next(iter(given)))}: goes with --positions, --curve or --check")
        return None
    use = uses[0]
    for name in given:
        if name != use and name not in FOR[use]:
            raise InputError(f"--{_dashed(name)}: does not go with --{use}")
    for name, value in others.items():
        if value:
            raise InputError(f"{name}: does not go with --{use}; a common set serves all targets, at any angles")
    if "mountings" in given and common["mounting"] != "identity":
        raise InputError("--mounting and --mountings: give one of the two")
    if use == "positions":
        return _positions(options, given, common, json, report)
    if report is not None:
        raise InputError(f"--report: does not go with --{use}; it is the page of --target or --positions")
    return (_curve if use == "curve" else _check)(options, given, common, json)


def _dashed(name: str) -> str:
    return name.replace("_", "-")


def _request(given: dict[str, Any], common: dict[str, Any]) -> Any:
    from .planning.request import Request

    own = {IN_REQUEST.get(k, k): v for k, v in given.items() if IN_REQUEST.get(k, k) in Request.__dataclass_fields__}
    basis = {name: value for name, value in common.items() if name != "mounting"}
    return Request(**{"mountings": (common["mounting"],), **basis, **own})


def _positions(
    options: PositionOptions, given: dict[str, Any], common: dict[str, Any], json: Path | None, report: Path | None
) -> Answer:
    from .planning.common_plan import plan_positions
    from .planning.position_files import DWELL_S, checked_dwell, write_plan
    from .printing import write_report
    from .report.position_page import operator_page

    assert options.positions is not None
    dwell = checked_dwell(DWELL_S if options.dwell is None else options.dwell)
    plan = plan_positions(options.positions, _request(given, common), progress=True)
    files = write_plan(plan, options.out, dwell_s=dwell) if options.out is not None else []
    if report is not None:
        write_report(report, operator_page(plan, dwell))
    return answer([*plan.lines(), *map(str, files)], json, plan.json_text())


def _curve(options: PositionOptions, given: dict[str, Any], common: dict[str, Any], json: Path | None) -> Answer:
    from .planning.position_curve import curve_summary, plan_curve, write_curve

    assert options.curve is not None
    points = plan_curve(*options.curve, _request(given, common), progress=True)
    files = write_curve(points, options.out) if options.out is not None else []
    content = {"schema": "trihedron.plan-curve/1", "points": [dict(vars(point)) for point in points]}
    return answer([curve_summary(points), *map(str, files)], json, content)


def _check(options: PositionOptions, given: dict[str, Any], common: dict[str, Any], json: Path | None) -> Answer:
    from .planning.position_files import read_angles
    from .planning.request import requested_task
    from .planning.setting_check import check_settings, check_summary

    assert options.check is not None
    planned, actual = read_angles(options.check)
    noise = 1e-5 if options.noise_bound is None else options.noise_bound
    if not 0.0 < noise < 1.0:
        raise InputError(f"--noise-bound {noise:g}: must be above 0 and below 1, a fraction of g")
    task = requested_task(_request(given, common), progress=True)
    found = check_settings(task, planned, actual, noise)
    content = {
        "schema": "trihedron.setting-check/1",
        "advice": found.advice,
        "lost_readings": found.lost,
        "largest_error_deg": found.largest_deg,
        "noise_bound": found.noise_bound,
        "targets": [dict(vars(target)) for target in found.targets],
    }
    return answer(check_summary(found), json, content)
