"""Text, pages and working files of plans."""

import math
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.table_commands import move_duration
from .. import planning
from ..calibration.targets import ARCSEC
from ..document.blocks import Download, Page, Section, Table, table_of
from ..document.notation import Cell, equation, minus, sentence, signed, symbol_text, unit_text
from ..document.page import html
from ..files import whole_folder
from ..planning.request import parsed_keep_out
from ..planning.targets import Plan, Plans
from ..rounding import digits, downwards, exactly, upwards
from .bench import next_positions_csv, physical_words
from .pictures.records import curve_picture, plan_picture, positions_picture, programme_tour
from .sources import cited, matrix_text, versions

if TYPE_CHECKING:
    from ..planning import HandPlan, ImuPlan
    from ..planning.check import SettingCheck
    from ..planning.positions import Curve, PlannedPosition, PositionPlan


ARCMIN = 10800.0 / math.pi
COST = 11
"""Digits of a cost, which is proven to more."""
UNCERTAIN = 1e-8
"""Relative gap above which the text mentions it."""
POSITIONS_DRAWN = (
    "Left: the angles, joined in the order of measurement; grey: not to be used. "
    "Right: the vertical in the inner frame."
)
CURVE_DRAWN = "Cost above the optimum against the number of positions, with the proven bound."


def plans_page(plans: Plans) -> Page:
    """Return the costs of all targets; for one target its readings and weights; then each target's estimator."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {exactly(first.grid_deg)}°"
    rows = []
    warnings = []
    for plan in plans:
        cost, least, gap = upwards(plan.cost, COST), downwards(plan.lower_bound, COST), upwards(plan.gap, 1)
        rows.append([symbol_text(plan.target), physical_words(plan.name), cost, least, gap, len(plan.weights)])
        if plan.gap > UNCERTAIN:
            warnings.append(f"{plan.target}: the optimum is proven to {upwards(plan.gap)} only")
    costs = Section(
        "Guaranteed errors",
        "A target is estimated by a sum of readings with weights Φ. Errors of readings within σ make it wrong "
        f"by σ Σ|Φ| at most: its cost, in units of σ. Of all positions among {where}, and all weights without "
        "bias, these cost least; no others cost less by more than the gap.",
        table=Table(["target", "meaning", "cost [σ]", "no less than [σ]", "proven gap", "readings"], rows),
        equations=[equation("z = f/g − Q up(α, β)"), equation("'estimate' = Σ Φ z, 'error' ≤ σ Σ |Φ|")],
    )
    verdict = f"{len(plans)} optimal plans, each proven: no readings of {where} estimate a target better."
    key: dict[str, object] = {"signs": _certain_signs(first), "mounting": next(iter(first.mounting))}
    if len(plans) == 1:
        verdict = (
            f"{first.target}, {physical_words(first.name)}, can be estimated to {upwards(first.cost, 7)} σ, and no "
            "better."
        )
    else:
        largest = max(plan.cost for plan in plans)
        key |= {"targets": len(plans), "largest cost": f"{upwards(largest, 5)} σ"}
    name, matrix = next(iter(first.mounting.items()))
    provenance = {
        "positions": where,
        "signs certain by": _certain_signs(first),
        f"mounting {name}": matrix_text(matrix),
        "scale factors": "one for both signs" if first.baseline == "symmetric" else "one for each sign",
        **versions(),
    }
    answer, further = [costs], [estimator_section(plan) for plan in plans]
    if len(plans) == 1:
        answer += further
        further = []
    return Page(
        "Optimal plan",
        verdict,
        answer,
        lambda: further,
        key=key,
        provenance=provenance,
        sources=cited("guaranteed", "simplex", "columns", first.grid_deg is None and "branches"),
        warnings=warnings,
    )


def _certain_signs(plan: Plan) -> str:
    """Return the rule by which the signs of inputs are certain, with its bounds."""
    if plan.baseline == "symmetric":
        return "not asked for: one scale factor for both signs"
    rule = "(1.7) as printed" if plan.admissible == "paper" else "(1.7) with the bias rows, as the published tables"
    u, v = plan.bounds
    return f"{rule}; u = {exactly(u)}, v = {exactly(v)}"


def estimator_section(plan: Plan) -> Section:
    """Return the estimator of one target, with its numbers."""
    rows = []
    terms = []
    places = {}
    for reading in plan.weights:
        alpha, beta, weight = reading.alpha_deg, reading.beta_deg, reading.weight
        rows.append([reading.accelerometer, digits(alpha, 8), digits(beta, 8), digits(weight, 6)])
        size = f"{digits(abs(weight), 6)} z_{reading.accelerometer} ({digits(alpha, 7)}°, {digits(beta, 7)}°)"
        terms.append(signed(weight, minus(size)))
        places[alpha, beta] = {"alpha_deg": alpha, "beta_deg": beta}
    terms[0] = f"'{symbol_text(plan.target)}' = {terms[0].removeprefix('+ ').replace('− ', '−')}"
    lines = [" ".join(terms[k : k + 3]) for k in range(0, len(terms), 3)]
    file = f"{plan.target}.csv"
    return Section(
        f"{symbol_text(plan.target)}: {physical_words(plan.name)}",
        picture=plan_picture(plan),
        caption=f"Readings of the plan for {symbol_text(plan.target)}; shaded: the input has a certain sign.",
        table=Table(["accelerometer", "α [deg]", "β [deg]", "weight"], rows),
        equations=[equation(line) for line in lines],
        download=Download(file, next_positions_csv(list(places.values())), f"{file}, to take to the table"),
    )


def positions_page(plan: "PositionPlan") -> Page:
    """Return the positions in the order of measurement, the costs, and the proven bound."""
    u, v = plan.bounds
    rule = " with the bias rows" if plan.admissible == "tables" else ""
    key = {
        "signs certain by": f"(1.7){rule}, u = {exactly(u)}, v = {exactly(v)}",
        "mountings": ", ".join(plan.mountings),
        "worst ratio": upwards(plan.worst_ratio, 6),
        "mean ratio": upwards(plan.mean_ratio, 6),
        "moves take": f"{digits(plan.duration)} s",
    }
    if plan.reserve_deg:
        key["setting errors up to"] = f"{exactly(plan.reserve_deg)}°"
    answer = [_order_section(plan), cost_section(plan)]
    answer += _detection_sections(plan)
    return Page(
        "Positions to measure",
        f"{len(plan.positions)} positions, {plan.readings} readings; no target costs more than "
        f"{upwards(plan.worst_ratio, 5)} times its optimum.",
        answer,
        key=key,
        provenance=versions(),
        warnings=[f"interrupted after {plan.starts} starts: the best set so far"] if plan.interrupted else [],
    )


def _order_section(plan: "PositionPlan") -> Section:
    """Return the positions in the order of measurement."""
    rows = []
    for number, at in enumerate(plan.programme, start=1):
        position = plan.positions[at - 1]
        again = "again" if at in plan.programme[: number - 1] else None
        mounting = position.mounting if len(plan.mountings) > 1 else None
        rows.append([number, digits(position.alpha_deg, 6), digits(position.beta_deg, 6), mounting, again])
    table = Table(["no.", "α [deg]", "β [deg]", "mounting", "measured"], rows)
    return Section("Positions", picture=positions_picture(plan), caption=POSITIONS_DRAWN, table=table)


def cost_section(plan: "PositionPlan") -> Section:
    """Return the guaranteed error of each target beside its optimum, and the proven bound of the set."""
    rows = []
    for target, cost, best in zip(plan.task.targets, plan.costs.values(), plan.optima.values(), strict=True):
        row: list[Cell] = [symbol_text(target.symbol), physical_words(target.name)]
        row += [upwards(cost, 7), upwards(best, 7), upwards(cost / best, 6)]
        rows.append(row)
    texts = ["Guaranteed errors in units of σ, the bound of one averaged reading's error."]
    texts += wanted_lines(plan)
    texts += _bound_texts(plan)
    table = Table(["target", "meaning", "cost [σ]", "optimum [σ]", "ratio"], rows)
    return Section("Guaranteed errors", texts, table=table)


def _bound_texts(plan: "PositionPlan") -> list[str]:
    """Return sentences on the proven bound of all sets of this number of positions."""
    if plan.bound is None:
        return []
    texts = [
        f"No {plan.bound.count} positions, of the {plan.bound.on}, have a worst ratio below "
        f"{downwards(plan.bound.ratio, 6)} (proven by {plan.bound.cuts} cuts and their images)."
    ]
    if plan.goal is not None:
        arcsec = plan.task.request.noise_bound / ARCSEC
        least = float(plan.task.least.max()) * plan.task.request.magnified
        on_pool = downwards(plan.bound.ratio * least * arcsec, 4)
        texts.append(
            f"That is, none have a {plan.goal} error below {on_pool} arcsec; of all angles "
            f"{downwards(least * arcsec, 4)} arcsec."
        )
    return texts


def _detection_sections(plan: "PositionPlan") -> list[Section]:
    """Return the distances of effects from the model with further positions; empty without such a request."""
    if not plan.detection:
        return []
    text = (
        f"{len(plan.positions) - plan.searched} positions more; a unit of an effect is so far from the model, and 2 σ "
        "over that is surely seen."
    )
    columns = ("effect", "distance_before", "distance_after", "distance_at_most")
    return [Section("Effects that are seen", [text], table=table_of(plan.detection, columns))]


def wanted_lines(plan: "PositionPlan") -> list[str]:
    """Return the purpose of the set, its basis, and the errors that it keeps."""
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
        error_kept, fewer = (
            None if error is None else request.error_text(error / request.noise_bound)
            for error in (plan.accuracy_kept, plan.fewer_keep)
        )
        less = f"with a position less than the fewest the best that was found is {fewer}"
        lines.append(
            f"keeps --accuracy {request.accuracy}: {error_kept}; {less if fewer else 'with fewer no set was found'}"
        )
    if plan.fewest_possible is not None:
        lines.append(f"no fewer than {plan.fewest_possible} positions of the pool keep it, proven")
    return lines


def curve_page(curve: "Curve") -> Page:
    """Return the worst and the mean cost against the number of positions, and the proven bound."""
    columns = ("positions", "readings", "worst", "mean", "bound", "pool")
    section = Section("Curve", picture=curve_picture(curve), caption=CURVE_DRAWN, table=table_of(curve.points, columns))
    return Page("Number of positions", f"{len(curve.points)} sets of positions, each the best found.", [section])


ADVICE = {
    "tolerable": "the plan's weights may be used as they are",
    "compensate": "use the weights of (4.2)",
    "re-solve": "solve the programme on the actual angles, as `trihedron calibrate` does",
    "measure again": "the actual angles do not determine every target",
}


def setting_page(check: "SettingCheck") -> Page:
    """Return the consequence of setting errors for each target, with advice."""
    columns = ("target", "planned", "bias", "compensated", "solved", "advice")
    text = f"Bias bounded by Σ|b| X^max, σ = {upwards(check.noise_bound, 6)}; all in units of σ."
    warnings = []
    if check.lost_readings:
        warnings.append(
            f"{check.lost_readings} readings of the plan have lost the certainty of their sign and are left out"
        )
    return Page(
        "Errors of setting",
        f"{check.advice.capitalize()}: {ADVICE[check.advice]}.",
        [Section("Targets", [text], table=table_of(check.targets, columns))],
        key={"largest error of setting": f"{upwards(check.largest_error_deg, 4)}°"},
        warnings=warnings,
    )


READ, ROOM = "_" * 10, "_" * 22
"""Blanks for an encoder's reading, and for a remark."""
MOST_DECIMALS = 4
"""Largest number of decimals of the angles [deg]: finer than any table is set."""


def operator_page(plan: "PositionPlan", dwell_s: float) -> Page:
    """Return the programme row by row with room for notes, the picture, and the value of the plan, as HTML."""
    several = len(plan.mountings) > 1
    header = ["no.", "α [deg]", "β [deg]", "mounting", "dwell [s]", "α read [deg]", "β read [deg]", "remarks", "done"]
    rows = []
    for number, at in enumerate(plan.programme, start=1):
        position, first = plan.positions[at - 1], plan.programme.index(at) + 1
        alpha = exactly(round(position.alpha_deg, MOST_DECIMALS))
        beta = exactly(round(position.beta_deg, MOST_DECIMALS))
        mounting = position.mounting if several else None
        remark = f"again no. {first}" if first < number else ROOM
        rows.append([number, alpha, beta, mounting, exactly(dwell_s), READ, READ, remark, "☐"])
    minutes = (plan.duration + dwell_s * len(plan.programme)) / 60.0
    setting = "Write down the encoder readings, not the commands."
    if plan.reserve_deg:
        setting = f"Set to {exactly(plan.reserve_deg)}° or better, and write down the encoder readings."
    instructions = [
        "Bring the table to each position in this order, wait for the dwell, then go on. "
        "Both axes may move at once. Angles are commands to the axes, within one turn.",
        setting,
    ]
    instructions += _kept_out(plan)
    sections = [
        Section("Programme", instructions, table=Table(header, rows)),
        Section(
            "Positions",
            picture=positions_picture(plan),
            caption="Left: the angles, joined in the order of measurement; grey: not to be used. Right: the vertical "
            "in the inner frame.",
        ),
        cost_section(plan),
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
    """Return the operator's text on keep-outs."""
    if not plan.keep_out:
        return []
    arcs = [
        f"{'αβ'[axis]} between {exactly(round(degrees(low), 6))}° and {exactly(round(degrees(high), 6))}°"
        for axis, low, high in map(parsed_keep_out, plan.keep_out)
    ]
    return [f"Not to be used: {', '.join(arcs)}. No move crosses the widest of these of an axis."]


def write_plan(plan: "PositionPlan", folder: Path, *, dwell_s: float) -> list[Path]:
    """Write all files that are needed to carry out a plan.

    - `programme.csv`: a position programme for a scenario's table, one file for each mounting if there are several
    - `table.csv`: the list for a real table
    - `angles.csv`: the file for `--check`, in which the operator fills in the actual angles
    - `operator.html`: a page to print
    - `positions.svg`: the picture
    - `plan.json`: the plan

    Parameters
    ----------
    plan : PositionPlan
        the plan
    folder : Path
        folder of the files, made if it is missing
    dwell_s : float
        time at each position [s]

    Returns
    -------
    list of Path
        the files

    Raises
    ------
    InputError
        for a dwell that is not positive, or a folder that cannot be written
    """
    planning.checked_dwell(dwell_s)
    rows = [plan.positions[at - 1] for at in plan.programme]
    several = len(plan.mountings) > 1

    def row(position: "PlannedPosition") -> str:
        return f"{position.alpha_deg},{position.beta_deg}"

    files: dict[str, str] = {}
    for name in plan.mountings:
        lines = [f"{row(position)},{exactly(dwell_s)}" for position in rows if not several or position.mounting == name]
        if lines:
            files[f"programme-{name}.csv" if several else "programme.csv"] = _csv("alpha_deg,beta_deg,dwell_s", lines)
    files["table.csv"] = _csv(
        "order,alpha_deg,beta_deg,dwell_s" + (",mounting" if several else ""),
        [
            f"{number},{row(position)},{exactly(dwell_s)}{f',{position.mounting}' if several else ''}"
            for number, position in enumerate(rows, start=1)
        ],
    )
    planned = "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg"
    files["angles.csv"] = _csv(planned, [f"{row(position)},{row(position)}" for position in rows])
    files["plan.json"] = plan.json_text()
    files["operator.html"] = html(operator_page(plan, dwell_s))
    files["positions.svg"] = positions_picture(plan).svg()
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
    return _written({"curve.csv": table, "curve.svg": curve_picture(curve).svg()}, folder)


def _csv(header: str, rows: list[str]) -> str:
    lines = [header]
    lines += rows
    return "\n".join(lines) + "\n"


def _written(files: dict[str, str], folder: Path) -> list[Path]:
    with whole_folder(folder) as beside:
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]


# A programme for a whole IMU


def ratio_lines(plan: "ImuPlan") -> list[str]:
    """Return the worst ratio to the guarantee of the whole pool: of this programme, and of usual practice."""
    lines = [
        f"worst ratio to what all {plan.pool} rests and turns of the pool together, and these programmes, would "
        f"guarantee: {upwards(plan.worst_ratio, 4)} ({plan.worst})"
    ]
    for practice in plan.practices:
        worth = (
            "leaves targets open"
            if practice.worst_ratio is None
            else f"{upwards(practice.worst_ratio, 4)} ({practice.worst})"
        )
        lines.append(f"{practice.name}, in {digits(practice.minutes)} minutes: {worth}")
    return lines


def planned_for(plan: "ImuPlan") -> str:
    """Return the bench and the bounds that the programme assumes."""
    return (
        f"σ = {exactly(plan.noise_bound)} g, gyros {exactly(plan.gyro_noise)} rad/s over one second, encoders "
        f"{exactly(plan.encoder_bound)} rad; table {exactly(plan.rate_dps)} deg/s, "
        f"{exactly(plan.acceleration_radps2)} rad/s²; latitude {exactly(plan.latitude_deg)}°, azimuth "
        f"{exactly(plan.azimuth_deg)}°"
    )


def hand_page(plan: "HandPlan") -> Page:
    """Return the steps of a plan by hand, each with the errors that are predicted after it."""
    errors = f"|f| at rest in any pose to {digits(1e3 * plan.pose_error, 2)} mg"
    turns = f"a turn of 90° to {digits(ARCMIN * plan.turn_error, 2)} arcmin"
    after = f" after the rests of {plan.measured}" if plan.measured else ""
    verdict = (
        f"{len(plan.steps)} rests{after}, {digits(plan.minutes, 2)} minutes: {errors}, {turns} (1 standard error)."
    )
    if not plan.steps:
        verdict = f"Nothing is missing in {plan.measured}: {errors}, {turns} (1 standard error)."
    rows = []
    for number, step in enumerate(plan.steps, start=1):
        pose_error, turn_error = digits(1e3 * step.pose_error, 2), digits(ARCMIN * step.turn_error, 2)
        rows.append([number, step.turn or "begin", step.pose, digits(step.rest_s), pose_error, turn_error])
    header = ["step", "move", "then at rest", "rest [s]", "|f| in any pose [mg]", "turn of 90° [arcmin]"]
    words = [
        "Hold the block still at each rest: on a table, or against something firm. Directions need no accuracy: 10° "
        "off is as good. Move within a few seconds from rest to rest, slower than the gyros' range. Record one file.",
        "Axis 1 up: accelerometer 1 reads +1 g. Errors are predicted from the poses, the noise at rest "
        f"({digits(1e3 * plan.rest_sd, 2)} mg) and an error of each move of 7 arcmin. The error of a turn is that "
        "of its worst component.",
    ]
    parameters = table_of(plan.parameters, ("symbol", "unit", "standard_error", "wanted"))
    return Page(
        "Plan by hand",
        verdict,
        [
            Section("Steps", words, table=Table(header, rows) if rows else None),
            Section("Predicted standard errors", table=parameters),
        ],
        warnings=plan.warnings,
    )


def way_of(plan: "ImuPlan") -> tuple[NDArray, list[NDArray]]:
    """Return times [min] at which the table arrives and leaves, and both angles [deg] there."""
    rate, time, visit, corners = math.radians(plan.rate_dps), 0.0, plan.programme[0], []
    for stop in plan.programme:
        way = math.radians(max(abs(stop.alpha_deg - visit.alpha_deg), abs(stop.beta_deg - visit.beta_deg)))
        time += move_duration(way, rate, plan.acceleration_radps2)
        corners += [(t / 60.0, stop.alpha_deg, stop.beta_deg) for t in (time, time + stop.dwell_s)]
        time, visit = time + stop.dwell_s, stop
    minutes, alpha, beta = np.array(corners).T
    return minutes, [alpha, beta]


def imu_page(plan: "ImuPlan") -> Page:
    """Return the programme row by row with room for notes, and its promised errors."""
    rows = []
    for number, entry in enumerate(plan.programme, start=1):
        alpha, beta = exactly(entry.alpha_deg), exactly(entry.beta_deg)
        rows.append([number, alpha, beta, digits(entry.dwell_s), READ, READ, ROOM, "☐"])
    header = ["no.", "α [deg]", "β [deg]", "rest [s]", "α read [deg]", "β read [deg]", "remarks", "done"]
    promises: list[list[Cell]] = []
    for entry in plan.targets:
        row: list[Cell] = [symbol_text(entry.symbol), physical_words(entry.name)]
        row += [upwards(entry.promised), upwards(entry.bound), upwards(entry.promised / entry.bound, 4)]
        row.append(unit_text(entry.unit))
        promises.append(row)
    minutes, angles_deg = way_of(plan)
    programme = Section(
        "Programme",
        [
            "Record encoders, gyros and accelerometers without a break. Bring the table to each position in this "
            f"order at {exactly(plan.rate_dps)} deg/s, both axes at once, and let it rest. Angles of more than a "
            "whole turn are whole turns of the table."
        ],
        programme_tour(minutes, angles_deg),
        "Both axes over the programme's time.",
        Table(header, rows),
    )
    texts = [
        "Guaranteed errors of a calibration of the record. Those of a record differ by at most "
        f"{digits(100.0 * plan.held_to)} per cent, by what bench and block are. The bound is what all rests "
        "and turns of the pool together would guarantee."
    ]
    for line in ratio_lines(plan):
        texts.append(sentence(line))
    promise = Section(
        "Guaranteed errors",
        texts,
        table=Table(["target", "meaning", "promised", "bound", "ratio", "unit"], promises),
    )
    return Page(
        "Rests and turns for the whole IMU",
        f"{len(plan.programme)} rests in {digits(plan.minutes)} minutes determine accelerometers, gyros and bench; no "
        f"guaranteed error is more than {upwards(plan.worst_ratio, 4)} times its bound.",
        [programme, promise],
        provenance={"planned for": planned_for(plan), **versions()},
        sources=cited("guaranteed", "simplex"),
    )


def write_imu_plan(plan: "ImuPlan", folder: Path) -> list[Path]:
    """Write `programme.csv` for a scenario's table, `operator.html` to print, and `imu-plan.json`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    rows = [f"{stop.alpha_deg},{stop.beta_deg},{exactly(stop.dwell_s)}" for stop in plan.programme]
    files = {
        "programme.csv": _csv("alpha_deg,beta_deg,dwell_s", rows),
        "operator.html": html(imu_page(plan)),
        "imu-plan.json": plan.json_text(),
    }
    return _written(files, folder)
