"""The picture and the page of `trihedron plan`."""

import numpy as np
from numpy.typing import NDArray

from ..planning.forms import clearance, sheets
from ..planning.plan import Plan, Plans
from ..summaries import physical_words
from .cells import Cell, Written
from .equations import math, signed
from .next_sections import next_positions_csv
from .page import Download, Section, Table, render_page
from .plan_pictures import STEP_DEG, admissible_positions
from .record_sections import versions
from .rounding import minus, symbol_text
from .sources import plan_sources


def plan_picture(plan: Plan) -> str:
    """The paper's figure for any target and mounting, as SVG."""
    best = plan.optimum
    return admissible_positions(
        _fields(plan), best.accelerometer + 1, best.alpha_deg, best.beta_deg, best.weights, plan.target
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


def plan_page(plans: Plans) -> str:
    """The page: costs of all targets, then each target's estimator, positions, weights and picture."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {first.grid_deg:g}°"
    rows: list[list[Cell]] = [
        [
            symbol_text(p.target),
            physical_words(p.name),
            Written(f"{p.cost:.10f}"),
            Written(f"{p.gap:.0e}"),
            len(p.weights),
        ]
        for p in plans
    ]
    sections = [
        Section(
            "Guaranteed errors",
            [
                "A target is estimated by a sum of readings with weights Φ. Errors of readings within σ make it wrong "
                f"by σ Σ|Φ| at most: its cost, in units of σ. Of all positions among {where}, and all weights without "
                "bias, these cost least; no others cost less by more than the gap.",
            ],
            table=Table(["target", "meaning", "cost [σ]", "proven gap", "readings"], rows),
            equations=[math("z = f/g − Q up(α, β)"), math("'estimate' = Σ Φ z, 'error' ≤ σ Σ |Φ|")],
        ),
        *(section for plan in plans for section in plan_sections(plan)),
    ]
    verdict = f"{len(plans)} optimal plans, each proven: no readings of {where} estimate a target better."
    if len(plans) == 1:
        verdict = (
            f"{first.target}, {physical_words(first.name)}, can be estimated to {first.cost:.6f} σ, and no better."
        )
    rule = "(1.7) as printed" if first.admissible == "paper" else "(1.7) with the bias rows, as the published tables"
    (name, matrix), *_ = first.mounting.items()
    provenance = {
        "positions": where,
        "signs certain by": f"{rule}; u = {first.bounds[0]:g}, v = {first.bounds[1]:g}",
        f"mounting {name}": minus("; ".join(" ".join(f"{v:.6g}" for v in row) for row in matrix)),
        "scale factors": "one for both signs" if first.baseline == "symmetric" else "one for each sign",
        **versions(),
    }
    key = {"targets": len(plans), "largest cost": f"{max(p.cost for p in plans):.4f} σ"} if len(plans) > 1 else {}
    return render_page(
        "Optimal plan",
        verdict,
        sections,
        key=key,
        provenance=provenance,
        sources=plan_sources(proven=first.grid_deg is None),
    )


def plan_sections(plan: Plan) -> list[Section]:
    """The estimator of one target, with its numbers."""
    best = plan.optimum
    readings = list(zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True))
    rows: list[list[Cell]] = [
        [int(p) + 1, Written(minus(f"{a:.8g}")), Written(minus(f"{b:.8g}")), Written(minus(f"{w:+.6f}"))]
        for p, a, b, w in readings
    ]
    terms = [
        signed(w, f"{abs(w):.6f} z_{int(p) + 1} ({a:.7g}°, {b:.7g}°)", first=k == 0)
        for k, (p, a, b, w) in enumerate(readings)
    ]
    places = [
        {"alpha_deg": float(a), "beta_deg": float(b)} for a, b in dict.fromkeys((a, b) for _, a, b, _ in readings)
    ]
    name = f"{plan.target}.csv"
    return [
        Section(
            f"{symbol_text(plan.target)}: {physical_words(plan.name)}",
            svg=plan_picture(plan),
            caption="Where the sign of each accelerometer's input is certain, and the readings of the plan.",
            table=Table(["accelerometer", "α [deg]", "β [deg]", "weight"], rows),
            equations=[
                math(f"{'' if k else _left(plan)}{' '.join(terms[k : k + 3])}") for k in range(0, len(terms), 3)
            ],
            download=Download(name, next_positions_csv(places), f"{name}, to take to the table"),
        )
    ]


def _left(plan: Plan) -> str:
    return f"'{symbol_text(plan.target)}' = "
