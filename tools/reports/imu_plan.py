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
from ..rounding import digits, exactly, upwards
from .bench import physical_words
from .pictures.records import programme_tour
from .plan import READ, ROOM
from .sources import cited, versions


def ratio_lines(plan: ImuPlan) -> list[str]:
    """The worst ratio to what the whole pool would guarantee: of this programme, and of what is usual."""
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


def planned_for(plan: ImuPlan) -> str:
    """The bench and the bounds that the programme is planned for."""
    return (
        f"σ = {exactly(plan.noise_bound)} g, gyros {exactly(plan.gyro_noise)} rad/s over one second, encoders "
        f"{exactly(plan.encoder_bound)} rad; table {exactly(plan.rate_dps)} deg/s, "
        f"{exactly(plan.acceleration_radps2)} rad/s²; latitude {exactly(plan.latitude_deg)}°, azimuth "
        f"{exactly(plan.azimuth_deg)}°"
    )


def way_of(plan: ImuPlan) -> tuple[NDArray, list[NDArray]]:
    """Times [min] at which the table arrives and leaves, and both angles [deg] there."""
    rate, time, visit, corners = math.radians(plan.rate_dps), 0.0, plan.programme[0], []
    for stop in plan.programme:
        way = math.radians(max(abs(stop.alpha_deg - visit.alpha_deg), abs(stop.beta_deg - visit.beta_deg)))
        time += move_duration(way, rate, plan.acceleration_radps2)
        corners += [(t / 60.0, stop.alpha_deg, stop.beta_deg) for t in (time, time + stop.dwell_s)]
        time, visit = time + stop.dwell_s, stop
    minutes, *angles = np.array(corners).T
    return minutes, angles


def imu_page(plan: ImuPlan) -> Page:
    """Return the programme row by row with room for notes, and what it promises."""
    rows: list[list[Cell]] = []
    for number, entry in enumerate(plan.programme, start=1):
        angles = [exactly(entry.alpha_deg), exactly(entry.beta_deg), digits(entry.dwell_s)]
        rows.append([number, *angles, READ, READ, ROOM, "☐"])
    header = ["no.", "α [deg]", "β [deg]", "rest [s]", "α read [deg]", "β read [deg]", "remarks", "done"]
    promises: list[list[Cell]] = []
    for entry in plan.targets:
        figures = [upwards(entry.promised), upwards(entry.bound), upwards(entry.promised / entry.bound, 4)]
        promises.append([symbol_text(entry.symbol), physical_words(entry.name), *figures, unit_text(entry.unit)])
    programme = Section(
        "Programme",
        [
            "Record encoders, gyros and accelerometers without a break. Bring the table to each position in this "
            f"order at {exactly(plan.rate_dps)} deg/s, both axes at once, and let it rest. Angles of more than a "
            "whole turn are whole turns of the table."
        ],
        programme_tour(*way_of(plan)),
        "Both axes over the programme's time.",
        Table(header, rows),
    )
    promise = Section(
        "What it promises",
        [
            "Guaranteed errors of a calibration of the record. Those of a record differ by at most "
            f"{digits(100.0 * plan.held_to)} per cent, by what bench and block are. The bound is what all rests "
            "and turns of the pool together would guarantee.",
            *map(sentence, ratio_lines(plan)),
        ],
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


def write_imu_plan(plan: ImuPlan, folder: Path) -> list[Path]:
    """Write `programme.csv` for a scenario's table, `operator.html` to print, and `imu-plan.json`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    rows = [f"{stop.alpha_deg},{stop.beta_deg},{exactly(stop.dwell_s)}" for stop in plan.programme]
    files = {
        "programme.csv": "\n".join(["alpha_deg,beta_deg,dwell_s", *rows, ""]),
        "operator.html": html(imu_page(plan)),
        "imu-plan.json": plan.json_text(),
    }
    with whole_folder(folder) as folder_beside:
        for name, text in files.items():
            (folder_beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]
