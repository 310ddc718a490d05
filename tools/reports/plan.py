"""What a person reads of plans."""

from ..planning.check import SettingCheck
from ..planning.plan import Curve, Plans, PositionPlan

UNCERTAIN = 1e-8
"""A relative gap above this is said in words."""


def plan_lines(plans: Plans) -> list[str]:
    """Positions and weights of one plan, or a line for each of several."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {first.grid_deg:g}°"
    rows = " with the bias rows" if first.admissible == "tables" else ""
    signs = f"signs certain by (1.7){rows}, u = {first.bounds[0]:g}, v = {first.bounds[1]:g}"
    which = "every position" if first.baseline == "symmetric" else signs
    lines = [f"optimal among {where}; {which}; mounting {next(iter(first.mounting))}", ""]
    if len(plans) > 1:
        lines.append(f"{'target':<12} {'name':<34} {'cost [σ]':>14} {'gap':>8} {'readings':>9}")
        lines += [
            f"{plan.target:<12} {plan.name:<34} {plan.cost:>14.10f} {plan.gap:>8.0e} {len(plan.weights):>9}"
            for plan in plans
        ]
    else:
        lines.append(f"{'accelerometer':>13} {'alpha [deg]':>14} {'beta [deg]':>14} {'weight':>12}")
        lines += [
            f"{one.accelerometer:>13} {one.alpha_deg:>14.8g} {one.beta_deg:>14.8g} {one.weight:>+12.6f}"
            for one in first.weights
        ]
        lines += [
            "",
            f"{first.target} ({first.name}): guaranteed error {first.cost:.10f} σ; "
            f"no plan has less than {first.lower_bound:.10f} σ (gap {first.gap:.0e})",
        ]
    lines += [
        f"warning: {plan.target}: the optimum is proven to {plan.gap:.1e} only"
        for plan in plans
        if plan.gap > UNCERTAIN
    ]
    return lines


def position_lines(plan: PositionPlan) -> list[str]:
    """The positions in the order of measurement, the costs, and what is proven."""
    several = len(plan.mountings) > 1
    lines = [
        f"{len(plan.positions)} positions, {plan.readings} readings; signs certain by (1.7)"
        f"{' with the bias rows' if plan.admissible == 'tables' else ''}, u = {plan.bounds[0]:g}, "
        f"v = {plan.bounds[1]:g}{f', setting errors up to {plan.reserve_deg:g}°' if plan.reserve_deg else ''}; "
        f"mounting{'s' if several else ''} {', '.join(plan.mountings)}",
        "",
        f"{'':>4} {'alpha [deg]':>12} {'beta [deg]':>12}",
    ]
    for number, at in enumerate(plan.programme, start=1):
        one = plan.positions[at - 1]
        again = "  again" if at in plan.programme[: number - 1] else ""
        mounting = f"  {one.mounting}" if several else ""
        lines.append(f"{number:>4} {one.alpha_deg:>12.6g} {one.beta_deg:>12.6g}{mounting}{again}")
    lines += ["", f"{'target':<12} {'cost [σ]':>10} {'optimum':>10} {'ratio':>8}"]
    for target, cost in plan.costs.items():
        best = plan.optima[target]
        lines.append(f"{target:<12} {cost:>10.6f} {best:>10.6f} {cost / best:>8.5f}")
    lines += ["", f"worst ratio {plan.worst_ratio:.5f}, mean {plan.mean_ratio:.5f}; moves take {plan.duration:.0f} s"]
    if plan.bound is not None:
        lines.append(
            f"no {plan.bound.count} positions of the {plan.bound.on} have a worst ratio below {plan.bound.ratio:.5f} "
            f"(proven by {plan.bound.cuts} cuts and their images; of all angles nothing better than 1 is proven)"
        )
    if plan.detection:
        lines.append(
            f"{len(plan.positions) - plan.searched} positions more; a unit of an effect is so far from the model, and "
            "2 σ over that is surely seen:"
        )
        lines += [
            f"  {one.effect}: distance {one.distance_before:.4f} before, {one.distance_after:.4f} now, "
            f"at most {one.distance_at_most:.4f}"
            for one in plan.detection
        ]
    if plan.interrupted:
        lines.append(f"interrupted after {plan.starts} starts: the best set so far")
    return lines


def curve_lines(curve: Curve) -> list[str]:
    """The curve as a table."""
    lines = [f"{'positions':>9} {'readings':>8} {'worst ratio':>11} {'mean':>9} {'proven':>9}  on a pool of"]
    lines += [
        f"{p.positions:>9} {p.readings:>8} {p.worst:>11.6f} {p.mean:>9.6f} {p.bound:>9.6f}  {p.pool} positions"
        for p in curve.points
    ]
    return lines


def check_lines(check: SettingCheck) -> list[str]:
    """What errors of setting do to each target, and what to do about them."""
    lines = [
        f"largest error of setting {check.largest_error_deg:.4g}°; bias bounded by Σ|b| X^max, "
        f"σ = {check.noise_bound:g}; all in units of σ",
        "",
        f"{'target':<10} {'plan Σ|Φ|':>10} {'Σ|b|X^max':>10} {'(4.2) Σ|Φ|':>11} {'re-solved':>10}  advice",
    ]
    for one in check.targets:
        compensated, solved = ("-" if x is None else f"{x:.4f}" for x in (one.compensated, one.solved))
        lines.append(
            f"{one.target:<10} {one.planned:>10.4f} {one.bias:>10.4g} {compensated:>11} {solved:>10}  {one.advice}"
        )
    said = {
        "tolerable": "the plan's weights may be used as they are",
        "compensate": "use the weights of (4.2)",
        "re-solve": "solve the programme on the actual angles, as `trihedron calibrate` does",
        "measure again": "the actual angles do not determine every target",
    }
    lines += ["", f"over all targets: {check.advice}: {said[check.advice]}"]
    if check.lost_readings:
        lines.append(
            f"{check.lost_readings} readings of the plan have lost the certainty of their sign and are left out"
        )
    return lines
