"""The commands that plan measurements; thin layers over `trihedron.tools.planning`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .errors import InputError
from .options import Baseline, Bounds, JsonFile, Mounting, ReportFile
from .outputs import distinct_files, ordinary_file
from .position_commands import PositionOptions, plan_common

NO_POSITIONS = PositionOptions()


def plan(
    *,
    target: Annotated[
        tuple[str, ...],
        Parameter(
            allow_leading_hyphen=True,
            help="A target, as X4 or X4-X5; may be repeated. All of the convention without it.",
        ),
    ] = (),
    grid: Annotated[
        float | None,
        Parameter(allow_leading_hyphen=True, help="Step of the grid of positions [deg]; 1 by default."),
    ] = None,
    continuum: Annotated[bool, Parameter(help="All angles in place of a grid.")] = False,
    admissible: Annotated[
        Literal["paper", "tables"],
        Parameter(help="(1.7) as printed, or with the bias rows, as the published tables were computed."),
    ] = "paper",
    bounds: Bounds = (3e-3, 1e-2),
    convention: Literal["A1", "A2"] = "A1",
    baseline: Baseline = "asymmetric",
    mounting: Mounting = "identity",
    json: JsonFile = None,
    report: ReportFile = None,
    picture: Annotated[
        Path | None,
        Parameter(help="Write the paper's figure, for one target, to this SVG file.", validator=ordinary_file),
    ] = None,
    common: Annotated[PositionOptions, Parameter(name="*")] = NO_POSITIONS,
) -> Answer:
    """Find the table positions and weights that estimate each target best, with the proof that none are better.

    Or one set of N positions for all targets; what sets of more positions gain; or what setting errors do to a plan.

    Example: trihedron plan --target X4 --continuum --picture X4.svg

    Example: trihedron plan --positions 12 --reserve 0.1 --out plan12
    """
    distinct_files({"--json": json, "--report": report, "--picture": picture})
    settings = {"admissible": admissible, "bounds": bounds, "convention": convention, "baseline": baseline}
    others = {"--target": target, "--grid": grid, "--continuum": continuum, "--picture": picture}
    done = plan_common(common, {**settings, "mounting": mounting}, others, json, report)
    if done is not None:
        return done
    if continuum and grid is not None:
        raise InputError("--grid and --continuum: give one of the two")
    if picture is not None and len(target) != 1:
        raise InputError("--picture: is of one target; give one --target")
    from . import library

    plans = library.plan(
        *target,
        grid=None if continuum else 1.0 if grid is None else grid,
        admissible=admissible,
        bounds=bounds,
        convention=convention,
        baseline=baseline,
        mounting=mounting,
        progress=True,
    )
    if report is not None or picture is not None:
        from .printing import write_report
        from .report.plan_page import plan_page, plan_picture
        from .writing import write_text

        if report is not None:
            write_report(report, plan_page(plans.plans))
        if picture is not None:
            write_text(picture, plan_picture(plans[0]))
    return answer(plans.lines(), json, plans.json_text())
