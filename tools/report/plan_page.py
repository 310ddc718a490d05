"""The picture and the page of `trihedron plan`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trihedron import __version__
from trihedron.planning.forms import clearance, sheets
from trihedron.planning.plan import Plan
from trihedron.report.page import Section, Table, render_page
from trihedron.report.plan_pictures import STEP_DEG, admissible_positions


def plan_picture(plan: Plan) -> str:
    """The paper's figure for any target and mounting, as SVG."""
    best = plan.optimum
    return admissible_positions(
        _fields(plan), best.accelerometer + 1, best.alpha_deg, best.beta_deg, best.weights, plan.target.symbol
    )


def _fields(plan: Plan) -> list[tuple[int, NDArray]]:
    """Clearance of each accelerometer over the square of angles, whichever sign its input has."""
    angle = np.radians(np.arange(0.0, 360.0 + STEP_DEG / 2, STEP_DEG))
    fields: dict[int, NDArray] = {}
    for sheet in sheets(plan.parametrisation, bounds=plan.bounds, rule=plan.admissible):
        here = clearance(sheet, angle[:, None], angle[None, :])
        number = sheet.accelerometer + 1
        fields[number] = np.maximum(fields[number], here) if number in fields else here
    return sorted(fields.items())


def plan_page(plans: Sequence[Plan]) -> str:
    """The page: costs of all targets, then each target's positions, weights and picture."""
    sections = [
        Section(
            "Guaranteed errors",
            [
                "The least guaranteed error of each target in units of σ, the bound of one reading's error, and how "
                "much less any other plan could have at most."
            ],
            table=Table(
                ["target", "meaning", "cost [σ]", "proven gap", "readings"],
                [
                    [
                        p.target.symbol,
                        p.target.name,
                        f"{p.optimum.cost:.10f}",
                        f"{p.optimum.gap:.0e}",
                        len(p.optimum.weights),
                    ]
                    for p in plans
                ],
            ),
        )
    ]
    for plan in plans:
        best = plan.optimum
        rows = zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True)
        sections.append(
            Section(
                f"{plan.target.symbol}: {plan.target.name}",
                svg=plan_picture(plan),
                caption="Where the sign of each accelerometer's input is certain, and the readings of the plan.",
                table=Table(
                    ["accelerometer", "α [deg]", "β [deg]", "weight"],
                    [[int(p) + 1, f"{a:.8g}", f"{b:.8g}", f"{w:+.6f}"] for p, a, b, w in rows],
                ),
            )
        )
    first = plans[0]
    verdict = (
        f"{len(plans)} optimal plans, each proven"
        if len(plans) > 1
        else (f"{first.target.symbol} can be estimated to {first.optimum.cost:.6f} σ, and no better")
    )
    provenance = {
        "trihedron": __version__,
        "positions": "all angles" if first.grid_deg is None else f"grid of {first.grid_deg:g}°",
        "admissible": f"{first.admissible}, u = {first.bounds[0]:g}, v = {first.bounds[1]:g}",
        "mounting": f"{first.mounting[0]} {first.mounting[1].tolist()}",
    }
    return render_page("Optimal plan", verdict, sections, provenance=provenance)
