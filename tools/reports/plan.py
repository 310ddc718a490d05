"""What plans say: text, pages, and the files to carry one out."""

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from .. import planning
from ..calibration.targets import ARCSEC
from ..document.blocks import Download, Page, Section, Table
from ..document.notation import Cell, equation, minus, signed, symbol_text
from ..document.page import html
from ..files import whole_folder
from ..planning.request import parsed_keep_out
from ..planning.targets import Plan, Plans
from ..rounding import digits, downwards, exactly, upwards
from .bench import next_positions_csv, physical_words
from .makers import cited, matrix_text, versions
from .pictures.records import curve_picture, plan_picture, positions_picture

if TYPE_CHECKING:
    from ..planning.check import SettingCheck
    from ..planning.positions import Curve, PlannedPosition, PositionPlan

COST = 11
"""Digits of a cost, which is proven to more."""
UNCERTAIN = 1e-8
"""A relative gap above this is said in words."""


def plan_lines(plans: Plans) -> list[str]:
    """Positions and weights of one plan, or a line for each of several."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {exactly(first.grid_deg)}°"
    rows = " with the bias rows" if first.admissible == "tables" else ""
    signs = f"signs certain by (1.7){rows}, u = {exactly(first.bounds[0])}, v = {exactly(first.bounds[1])}"
    which = "every position" if first.baseline == "symmetric" else signs
    lines = [f"optimal among {where}; {which}; mounting {next(iter(first.mounting))}", ""]
    if len(plans) > 1:
        lines.append(f"{'target':<12} {'name':<34} {'cost [σ]':>14} {'gap':>8} {'readings':>9}")
        lines += [
            f"{plan.target:<12} {plan.name:<34} {upwards(plan.cost, COST):>14} {upwards(plan.gap, 1):>8} "
            f"{len(plan.weights):>9}"
            for plan in plans
        ]
    else:
        lines.append(f"{'accelerometer':>13} {'alpha [deg]':>14} {'beta [deg]':>14} {'weight':>12}")
        lines += [
            f"{one.accelerometer:>13} {digits(one.alpha_deg, 8):>14} {digits(one.beta_deg, 8):>14} "
            f"{digits(one.weight, 6):>12}"
            for one in first.weights
        ]
        lines += [
            "",
            f"{first.target} ({first.name}): guaranteed error {upwards(first.cost, COST)} σ; "
            f"no plan has less than {downwards(first.lower_bound, COST)} σ (gap {upwards(first.gap, 1)})",
        ]
    lines += [
        f"warning: {plan.target}: the optimum is proven to {upwards(plan.gap)} only"
        for plan in plans
        if plan.gap > UNCERTAIN
    ]
    return lines


def position_lines(plan: "PositionPlan") -> list[str]:
    """The positions in the order of measurement, the costs, and what is proven."""
    several = len(plan.mountings) > 1
    u, v = map(exactly, plan.bounds)
    reserve = f", setting errors up to {exactly(plan.reserve_deg)}°" if plan.reserve_deg else ""
    lines = [
        f"{len(plan.positions)} positions, {plan.readings} readings; signs certain by (1.7)"
        f"{' with the bias rows' if plan.admissible == 'tables' else ''}, u = {u}, v = {v}{reserve}; "
        f"mounting{'s' if several else ''} {', '.join(plan.mountings)}",
        "",
        f"{'':>4} {'alpha [deg]':>12} {'beta [deg]':>12}",
    ]
    for number, at in enumerate(plan.programme, start=1):
        one = plan.positions[at - 1]
        again = "  again" if at in plan.programme[: number - 1] else ""
        mounting = f"  {one.mounting}" if several else ""
        lines.append(f"{number:>4} {digits(one.alpha_deg, 6):>12} {digits(one.beta_deg, 6):>12}{mounting}{again}")
    wide = max(map(len, ("target", *plan.costs))) + 1
    lines += ["", f"{'target':<{wide}} {'cost [σ]':>10} {'optimum':>10} {'ratio':>8}"]
    for target, cost in plan.costs.items():
        best = plan.optima[target]
        lines.append(f"{target:<{wide}} {upwards(cost, 7):>10} {upwards(best, 7):>10} {upwards(cost / best, 6):>8}")
    lines += [
        "",
        f"worst ratio {upwards(plan.worst_ratio, 6)}, mean {upwards(plan.mean_ratio, 6)}; "
        f"moves take {digits(plan.duration)} s",
    ]
    lines += wanted_lines(plan)
    size = plan.task.request.noise_bound / ARCSEC
    if plan.bound is not None:
        ratio = downwards(plan.bound.ratio, 6)
        lines.append(
            f"no {plan.bound.count} positions, of the {plan.bound.on}, have a worst ratio below {ratio} "
            f"(proven by {plan.bound.cuts} cuts and their images)"
        )
        if plan.goal is not None:
            least = float(plan.task.least.max()) * plan.task.request.magnified
            proven = (f"{downwards(error * size, 4)} arcsec" for error in (plan.bound.ratio * least, least))
            lines.append("that is, none have a {} error below {}; of all angles {}".format(plan.goal, *proven))
    if plan.detection:
        lines.append(
            f"{len(plan.positions) - plan.searched} positions more; a unit of an effect is so far from the model, and "
            "2 σ over that is surely seen:"
        )
        lines += [
            f"  {one.effect}: distance {downwards(one.distance_before, 4)} before, "
            f"{downwards(one.distance_after, 4)} now, at most {upwards(one.distance_at_most, 4)}"
            for one in plan.detection
        ]
    if plan.interrupted:
        lines.append(f"interrupted after {plan.starts} starts: the best set so far")
    return lines


def wanted_lines(plan: "PositionPlan") -> list[str]:
    """What the set is for, what it stands on, and what it stands."""
    lines = []
    if plan.measured:
        lines.append(f"{plan.measured} positions that are measured already count beside these")
    request = plan.task.request
    latitude = exactly(request.latitude)
    of_goal = {"levelling": plan.levelling_error, f"a gyrocompass at latitude {latitude}°": plan.azimuth_error}
    for what, error in of_goal.items():
        if error is not None:
            lines.append(
                f"{what} with an axis vertical, by a-priori estimates: wrong by {upwards(error, 6)} σ "
                f"at most, {upwards(error * request.noise_bound / ARCSEC, 4)} arcsec at "
                f"σ = {exactly(request.noise_bound)} g"
            )
    if plan.accuracy_kept is not None:
        kept, fewer = (
            None if error is None else request.error_text(error / request.noise_bound)
            for error in (plan.accuracy_kept, plan.fewer_keep)
        )
        less = f"with a position less than the fewest the best that was found is {fewer}"
        lines.append(f"keeps --accuracy {request.accuracy}: {kept}; {less if fewer else 'with fewer no set was found'}")
    if plan.fewest_possible is not None:
        lines.append(f"no fewer than {plan.fewest_possible} positions of the pool keep it, proven")
    return lines


def curve_lines(curve: "Curve") -> list[str]:
    """The curve as a table."""
    lines = [f"{'positions':>9} {'readings':>8} {'worst ratio':>11} {'mean':>9} {'proven':>9}  on a pool of"]
    lines += [
        f"{p.positions:>9} {p.readings:>8} {upwards(p.worst, 7):>11} {upwards(p.mean, 7):>9} "
        f"{downwards(p.bound, 7):>9}  {p.pool} positions"
        for p in curve.points
    ]
    return lines


def setting_lines(check: "SettingCheck") -> list[str]:
    """What errors of setting do to each target, and what to do about them."""
    lines = [
        f"largest error of setting {upwards(check.largest_error_deg, 4)}°; bias bounded by Σ|b| X^max, "
        f"σ = {upwards(check.noise_bound, 6)}; all in units of σ",
        "",
        f"{'target':<10} {'plan Σ|Φ|':>10} {'Σ|b|X^max':>10} {'(4.2) Σ|Φ|':>11} {'re-solved':>10}  advice",
    ]
    for one in check.targets:
        compensated, solved = ("-" if x is None else upwards(x, 5) for x in (one.compensated, one.solved))
        lines.append(
            f"{one.target:<10} {upwards(one.planned, 5):>10} {upwards(one.bias, 4):>10} {compensated:>11} "
            f"{solved:>10}  {one.advice}"
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


def plan_page(plans: Plans) -> Page:
    """The page: costs of all targets, then each target's estimator, positions, weights and picture."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {exactly(first.grid_deg)}°"
    rows: list[list[Cell]] = []
    for p in plans:
        figures = (upwards(p.cost, COST), upwards(p.gap, 1))
        rows.append([symbol_text(p.target), physical_words(p.name), *figures, len(p.weights)])
    sections = [
        Section(
            "Guaranteed errors",
            "A target is estimated by a sum of readings with weights Φ. Errors of readings within σ make it wrong "
            f"by σ Σ|Φ| at most: its cost, in units of σ. Of all positions among {where}, and all weights without "
            "bias, these cost least; no others cost less by more than the gap.",
            table=Table(["target", "meaning", "cost [σ]", "proven gap", "readings"], rows),
            equations=[equation("z = f/g − Q up(α, β)"), equation("'estimate' = Σ Φ z, 'error' ≤ σ Σ |Φ|")],
        ),
        *map(target_section, plans),
    ]
    verdict = f"{len(plans)} optimal plans, each proven: no readings of {where} estimate a target better."
    if len(plans) == 1:
        cost = upwards(first.cost, 7)
        verdict = f"{first.target}, {physical_words(first.name)}, can be estimated to {cost} σ, and no better."
    rule = "(1.7) as printed" if first.admissible == "paper" else "(1.7) with the bias rows, as the published tables"
    (name, matrix), *_ = first.mounting.items()
    provenance = {
        "positions": where,
        "signs certain by": f"{rule}; u = {exactly(first.bounds[0])}, v = {exactly(first.bounds[1])}",
        f"mounting {name}": matrix_text(matrix),
        "scale factors": "one for both signs" if first.baseline == "symmetric" else "one for each sign",
        **versions(),
    }
    key = (
        {"targets": len(plans), "largest cost": f"{upwards(max(p.cost for p in plans), 5)} σ"} if len(plans) > 1 else {}
    )
    return Page(
        "Optimal plan",
        verdict,
        sections,
        key=key,
        provenance=provenance,
        sources=cited("guaranteed", "simplex", "columns", first.grid_deg is None and "branches"),
    )


def target_section(plan: Plan) -> Section:
    """The estimator of one target, with its numbers."""
    best = plan.optimum
    readings = list(zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True))
    rows: list[list[Cell]] = []
    terms = []
    for p, a, b, w in readings:
        rows.append([int(p) + 1, digits(a, 8), digits(b, 8), digits(w, 6)])
        terms.append(signed(w, minus(f"{digits(abs(w), 6)} z_{int(p) + 1} ({digits(a, 7)}°, {digits(b, 7)}°)")))
    terms[0] = f"'{symbol_text(plan.target)}' = {terms[0].removeprefix('+ ').replace('− ', '−')}"
    places = dict.fromkeys((float(a), float(b)) for _, a, b, _ in readings)
    name = f"{plan.target}.csv"
    content = next_positions_csv([{"alpha_deg": a, "beta_deg": b} for a, b in places])
    return Section(
        f"{symbol_text(plan.target)}: {physical_words(plan.name)}",
        svg=plan_picture(plan),
        caption="Where the sign of each accelerometer's input is certain, and the readings of the plan.",
        table=Table(["accelerometer", "α [deg]", "β [deg]", "weight"], rows),
        equations=[equation(" ".join(terms[k : k + 3])) for k in range(0, len(terms), 3)],
        download=Download(name, content, f"{name}, to take to the table"),
    )


READ, ROOM = "_" * 10, "_" * 22
"""Where an operator writes an encoder's reading, and a remark."""
MOST_DECIMALS = 4
"""Of the angles [deg]: finer than any table is set."""


def operator_page(plan: "PositionPlan", dwell_s: float) -> Page:
    """The programme row by row with room for notes, the picture, and what the plan is worth, as HTML."""
    several = len(plan.mountings) > 1
    header = ["no.", "α [deg]", "β [deg]", "mounting", "dwell [s]", "α read [deg]", "β read [deg]", "remarks", "done"]
    rows: list[list[Cell]] = []
    for number, at in enumerate(plan.programme, start=1):
        one, first = plan.positions[at - 1], plan.programme.index(at) + 1
        angles = [exactly(round(angle, MOST_DECIMALS)) for angle in (one.alpha_deg, one.beta_deg)]
        remark = f"again no. {first}" if first < number else ROOM
        rows.append([number, *angles, one.mounting if several else None, exactly(dwell_s), READ, READ, remark, "☐"])
    minutes = (plan.duration + dwell_s * len(plan.programme)) / 60.0
    reserve = plan.reserve_deg
    sections = [
        Section(
            "Programme",
            [
                "Bring the table to each position in this order, wait for the dwell, then go on. "
                "Both axes may move at once. Angles are commands to the axes, within one turn.",
                f"Set to {exactly(reserve)}° or better; write the encoder readings down as they are."
                if reserve
                else "Write the encoder readings down as they are: what counts is where the table stands.",
                *_kept_out(plan),
            ],
            table=Table(header, rows).told(),
        ),
        Section(
            "Positions",
            svg=positions_picture(plan),
            caption="Left: the angles, joined in the order of measurement; grey: not to be used. Right: the vertical "
            "in the inner frame.",
        ),
        Section(
            "What it gives",
            ["Guaranteed errors in units of σ, the bound of one averaged reading's error.", *wanted_lines(plan)],
            table=Table(
                ["target", "meaning", "cost [σ]", "optimum [σ]", "ratio"],
                [
                    [symbol_text(t.symbol), physical_words(t.name), *(upwards(v, 6) for v in (c, b, c / b))]
                    for t, c, b in zip(plan.task.targets, plan.costs.values(), plan.optima.values(), strict=True)
                ],
            ),
        ),
    ]
    verdict = (
        f"{len(plan.programme)} measurements at {len(plan.positions)} positions, about {digits(minutes)} minutes; "
        f"no target costs more than {upwards(plan.worst_ratio, 5)} times its optimum."
    )
    provenance = {
        "admissible": f"{plan.admissible}, u = {exactly(plan.bounds[0])}, v = {exactly(plan.bounds[1])}",
        "mountings": ", ".join(plan.mountings),
        "order": f"{plan.order}, seed {plan.seed}",
        **versions(),
    }
    return Page(
        "Positions to measure", verdict, sections, provenance=provenance, sources=cited("guaranteed", "simplex")
    )


def _kept_out(plan: "PositionPlan") -> list[str]:
    """What an operator is told of keep-outs."""
    if not plan.keep_out:
        return []
    arcs = [
        f"{'αβ'[axis]} between {exactly(round(degrees(low), 6))}° and {exactly(round(degrees(high), 6))}°"
        for axis, low, high in map(parsed_keep_out, plan.keep_out)
    ]
    return [f"Not to be used: {', '.join(arcs)}. No move crosses the widest of these of an axis."]


def write_plan(plan: "PositionPlan", folder: Path, *, dwell_s: float) -> list[Path]:
    """Write everything that is needed to carry a plan out.

    `programme.csv` is a position programme for a scenario's table (one file for each mounting where there are
    several), `table.csv` the list for a real table, `angles.csv` the file for `--check`, where the actual angles are
    filled in, `operator.html` a page to print, `positions.svg` the picture, `plan.json` the plan.

    Parameters
    ----------
    plan : PositionPlan
    folder : Path
        made where it is missing
    dwell_s : float
        time at each position [s]

    Raises
    ------
    InputError
        for a dwell that is not positive, or a folder that cannot be written
    """
    planning.checked_dwell(dwell_s)
    rows = [plan.positions[at - 1] for at in plan.programme]
    several = len(plan.mountings) > 1

    def row(one: "PlannedPosition") -> str:
        return f"{one.alpha_deg},{one.beta_deg}"

    files: dict[str, str] = {}
    for name in plan.mountings:
        lines = [f"{row(one)},{exactly(dwell_s)}" for one in rows if not several or one.mounting == name]
        if lines:
            files[f"programme-{name}.csv" if several else "programme.csv"] = _csv("alpha_deg,beta_deg,dwell_s", lines)
    files["table.csv"] = _csv(
        "order,alpha_deg,beta_deg,dwell_s" + (",mounting" if several else ""),
        [
            f"{number},{row(one)},{exactly(dwell_s)}{f',{one.mounting}' if several else ''}"
            for number, one in enumerate(rows, start=1)
        ],
    )
    planned = "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg"
    files["angles.csv"] = _csv(planned, [f"{row(one)},{row(one)}" for one in rows])
    files["plan.json"] = plan.json_text()
    files["operator.html"] = html(operator_page(plan, dwell_s))
    files["positions.svg"] = positions_picture(plan)
    return _written(files, folder)


def write_curve(curve: "Curve", folder: Path) -> list[Path]:
    """Write `curve.csv` and `curve.svg`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    points = curve.points
    rows = [f"{p.positions},{p.readings},{p.worst!r},{p.mean!r},{p.bound!r},{p.pool}" for p in points]
    table = _csv("positions,readings,worst_ratio,mean_ratio,lower_bound,pool", rows)
    return _written({"curve.csv": table, "curve.svg": curve_picture(curve)}, folder)


def _csv(header: str, rows: list[str]) -> str:
    return "\n".join([header, *rows, ""])


def _written(files: dict[str, str], folder: Path) -> list[Path]:
    with whole_folder(folder) as beside:
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]
