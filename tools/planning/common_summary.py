"""What a person reads of a common plan."""

from .common_plan import CommonPlan


def plan_summary(plan: CommonPlan) -> str:
    """What a person reads: the positions in the order of measurement, the costs, and what is proven."""
    task, found = plan.task, plan.found
    several = len(plan.mountings) > 1
    lines = [
        f"{len(found.places)} positions, {len(found.readings.position)} readings; signs certain by (1.7)"
        f"{' with the bias rows' if task.rule == 'tables' else ''}, u = {task.bounds[0]:g}, v = {task.bounds[1]:g}"
        f"{f', setting errors up to {plan.request.reserve_deg:g}°' if plan.request.reserve_deg else ''}; "
        f"mounting{'s' if several else ''} {', '.join(plan.mountings)}",
        "",
        f"{'':>4} {'alpha [deg]':>12} {'beta [deg]':>12}",
    ]
    for number, row in enumerate(plan.programme, start=1):
        one = plan.position(int(row))
        again = "  again" if row in plan.programme[: number - 1] else ""
        mounting = f"  {one['mounting']}" if several else ""
        lines.append(f"{number:>4} {one['alpha_deg']:>12.6g} {one['beta_deg']:>12.6g}{mounting}{again}")
    lines += ["", f"{'target':<12} {'cost [σ]':>10} {'optimum':>10} {'ratio':>8}"]
    for target, best, ratio in zip(task.targets, task.best, found.ratio, strict=True):
        lines.append(f"{target.symbol:<12} {ratio * best:>10.6f} {best:>10.6f} {ratio:>8.5f}")
    lines += ["", f"worst ratio {found.worst:.5f}, mean {found.mean:.5f}; moves take {plan.duration:.0f} s"]
    if plan.bound is not None:
        lines.append(
            f"no {plan.bound.count} positions of the {plan.bound.on} have a worst ratio below {plan.bound.ratio:.5f} "
            f"(proven by {plan.bound.cuts} cuts and their images; of all angles nothing better than 1 is proven)"
        )
    if plan.detection is not None:
        extra = len(found.places) - plan.searched
        lines.append(
            f"{extra} positions more; a unit of an effect is so far from the model, and 2 σ over that is surely seen:"
        )
        shown = plan.detection
        for effect, before, after, most in zip(shown.effects, shown.before, shown.after, shown.most, strict=True):
            lines.append(f"  {effect.title}: distance {before:.4f} before, {after:.4f} now, at most {most:.4f}")
    if plan.interrupted:
        lines.append(f"interrupted after {plan.starts} starts: the best set so far")
    return "\n".join(lines)
