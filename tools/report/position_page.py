"""The page that an operator takes to the table."""

from collections.abc import Sequence

from ..planning.plan import PositionPlan
from ..summaries import physical_words
from .cells import Cell, Written
from .page import Section, Table, render_page
from .position_pictures import positions_picture
from .record_sections import versions
from .rounding import minus, symbol_text
from .sources import common_plan_sources

MOST_DECIMALS = 4
"""Of the angles [deg]: finer than any table is set."""


def decimals_of(angles: Sequence[float]) -> int:
    """The fewest decimals that show all angles [deg] as they are, four at most."""
    exact = (d for d in range(MOST_DECIMALS) if all(abs(round(a, d) - a) < 1e-7 for a in angles))
    return next(exact, MOST_DECIMALS)


def operator_page(plan: PositionPlan, dwell_s: float) -> str:
    """The programme row by row with room for notes, the picture, and what the plan is worth, as HTML."""
    several = len(plan.mountings) > 1
    degrees = [(one.alpha_deg, one.beta_deg) for one in plan.positions]
    places = decimals_of([angle for both in degrees for angle in both])
    header = ["no.", "α [deg]", "β [deg]", *(["mounting"] if several else []), "dwell [s]", "remark", "done"]
    rows: list[list[Cell]] = []
    for number, at in enumerate(plan.programme, start=1):
        one = plan.positions[at - 1]
        first = plan.programme.index(at) + 1
        remark = f"again no. {first}" if first < number else ""
        mounting = [one.mounting] if several else []
        angles = [Written(minus(f"{angle:z.{places}f}")) for angle in (one.alpha_deg, one.beta_deg)]
        rows.append([number, *angles, *mounting, Written(f"{dwell_s:g}"), remark, "☐"])
    minutes = (plan.duration + dwell_s * len(plan.programme)) / 60.0
    reserve = plan.reserve_deg
    sections = [
        Section(
            "Programme",
            [
                "Bring the table to each position in this order, wait for the dwell, then go on. "
                "Both axes may move at once. Angles are commands to the axes, within one turn.",
                f"Set to {reserve:g}° or better; write the encoder readings down as they are."
                if reserve
                else "Write the encoder readings down as they are: what counts is where the table stands.",
            ],
            table=Table(header, rows),
        ),
        Section(
            "Positions",
            svg=positions_picture(*zip(*degrees, strict=True), [at - 1 for at in plan.programme]),
            caption="Left: the angles, joined in the order of measurement. Right: the vertical in the inner frame.",
        ),
        Section(
            "What it gives",
            ["Guaranteed errors in units of σ, the bound of one averaged reading's error."],
            table=Table(
                ["target", "meaning", "cost [σ]", "optimum [σ]", "ratio"],
                [
                    [symbol_text(t.symbol), physical_words(t.name), *(Written(f"{v:.5f}") for v in (c, b, c / b))]
                    for t, c, b in zip(plan.task.targets, plan.costs.values(), plan.optima.values(), strict=True)
                ],
            ),
        ),
    ]
    verdict = (
        f"{len(plan.programme)} measurements at {len(plan.positions)} positions, about {minutes:.0f} minutes; "
        f"no target costs more than {plan.worst_ratio:.4f} times its optimum."
    )
    provenance = {
        "admissible": f"{plan.admissible}, u = {plan.bounds[0]:g}, v = {plan.bounds[1]:g}",
        "mountings": ", ".join(plan.mountings),
        "order": f"{plan.order}, seed {plan.seed}",
        **versions(),
    }
    return render_page("Positions to measure", verdict, sections, provenance=provenance, sources=common_plan_sources())
