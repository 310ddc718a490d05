"""What a programme of rests and turns for a whole IMU says: text, the operator's page, files."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.table_commands import move_duration
from ..document.blocks import Page, Section, Table
from ..document.notation import Cell, sentence, symbol_text, unit_text
from ..document.page import html
from ..files import whole_folder
from ..planning import ImuPlan
from ..planning.imu import Promised
from ..rounding import digits, exactly, upwards
from .bench import physical_words
from .makers import cited, versions
from .pictures.records import programme_tour
from .plan import READ, ROOM


def ratio_lines(plan: ImuPlan) -> list[str]:
    """The worst ratio to what the whole pool would guarantee: of this programme, and of what is usual."""
    lines = [
        f"worst ratio to what all {plan.pool} rests and turns of the pool together, and these programmes, would "
        f"guarantee: {upwards(plan.worst_ratio, 4)} ({plan.worst})"
    ]
    for one in plan.practices:
        worth = "leaves targets open" if one.worst_ratio is None else f"{upwards(one.worst_ratio, 4)} ({one.worst})"
        lines.append(f"{one.name}, in {digits(one.minutes)} minutes: {worth}")
    return lines


def planned_for(plan: ImuPlan) -> str:
    """The bench and the bounds that the programme is planned for."""
    return (
        f"σ = {exactly(plan.noise_bound)} g, gyros {exactly(plan.gyro_noise)} rad/s over one second, encoders "
        f"{exactly(plan.encoder_bound)} rad; table {exactly(plan.rate_dps)} deg/s, "
        f"{exactly(plan.acceleration_radps2)} rad/s²; latitude {exactly(plan.latitude_deg)}°, azimuth "
        f"{exactly(plan.azimuth_deg)}°"
    )


def lines(plan: ImuPlan) -> list[str]:
    """The programme, what it promises, what is usual."""
    said = [
        f"{len(plan.programme)} rests in {digits(plan.minutes)} minutes; {planned_for(plan)}",
        "",
        f"{'':>4} {'alpha [deg]':>12} {'beta [deg]':>12} {'rest [s]':>9}",
    ]
    for k, one in enumerate(plan.programme, start=1):
        said.append(f"{k:>4} {exactly(one.alpha_deg):>12} {exactly(one.beta_deg):>12} {digits(one.dwell_s):>9}")
    said += ["", f"{'target':<8} {'name':<34} {'promised':>11} {'bound':>11} {'ratio':>7}  unit"]
    for one in plan.targets:
        promised, bound, ratio = _figures(one)
        said.append(f"{one.symbol:<8} {one.name:<34} {promised:>11} {bound:>11} {ratio:>7}  {one.unit}")
    return [*said, "", *ratio_lines(plan)]


def _figures(one: Promised) -> tuple[str, str, str]:
    return upwards(one.promised), upwards(one.bound), upwards(one.promised / one.bound, 4)


def way_of(plan: ImuPlan) -> tuple[NDArray, list[NDArray]]:
    """Times [min] at which the table arrives and leaves, and both angles [deg] there."""
    rate, time, here, corners = math.radians(plan.rate_dps), 0.0, plan.programme[0], []
    for one in plan.programme:
        way = math.radians(max(abs(one.alpha_deg - here.alpha_deg), abs(one.beta_deg - here.beta_deg)))
        time += move_duration(way, rate, plan.acceleration_radps2)
        corners += [(t / 60.0, one.alpha_deg, one.beta_deg) for t in (time, time + one.dwell_s)]
        time, here = time + one.dwell_s, one
    minutes, *angles = np.array(corners).T
    return minutes, angles


def operator_page(plan: ImuPlan) -> Page:
    """The programme row by row with room for notes, and what it promises."""
    rows: list[list[Cell]] = []
    for k, one in enumerate(plan.programme, start=1):
        angles = [exactly(one.alpha_deg), exactly(one.beta_deg), digits(one.dwell_s)]
        rows.append([k, *angles, READ, READ, ROOM, "☐"])
    promised: list[list[Cell]] = [
        [symbol_text(one.symbol), physical_words(one.name), *_figures(one), unit_text(one.unit)] for one in plan.targets
    ]
    header = ["no.", "α [deg]", "β [deg]", "rest [s]", "α read [deg]", "β read [deg]", "remarks", "done"]
    sections = [
        Section(
            "Programme",
            [
                "Record encoders, gyros and accelerometers without a break. Bring the table to each position in this "
                f"order at {exactly(plan.rate_dps)} deg/s, both axes at once, and let it rest. Angles of more than a "
                "whole turn are whole turns of the table.",
            ],
            *(programme_tour(*way_of(plan)), "Both axes over the programme's time."),
            table=Table(header, rows),
        ),
        Section(
            "What it promises",
            [
                "Guaranteed errors of a calibration of the record. Those of a record differ by at most "
                f"{digits(100.0 * plan.held_to)} per cent, by what bench and block are. The bound is what all rests "
                "and turns of the pool together would guarantee.",
                *map(sentence, ratio_lines(plan)),
            ],
            table=Table(["target", "meaning", "promised", "bound", "ratio", "unit"], promised),
        ),
    ]
    verdict = (
        f"{len(plan.programme)} rests in {digits(plan.minutes)} minutes determine accelerometers, gyros and bench; no "
        f"guaranteed error is more than {upwards(plan.worst_ratio, 4)} times its bound."
    )
    return Page(
        "Rests and turns for the whole IMU",
        verdict,
        sections,
        provenance={"planned for": planned_for(plan), **versions()},
        sources=cited("guaranteed", "simplex"),
    )


def write_imu_plan(plan: ImuPlan, folder: Path) -> list[Path]:
    """Write `programme.csv` for a scenario's table, `operator.html` to print, and `imu-plan.json`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    rows = [f"{one.alpha_deg},{one.beta_deg},{exactly(one.dwell_s)}" for one in plan.programme]
    files = {
        "programme.csv": "\n".join(["alpha_deg,beta_deg,dwell_s", *rows, ""]),
        "operator.html": html(operator_page(plan)),
        "imu-plan.json": plan.json_text(),
    }
    with whole_folder(folder) as beside:
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]
