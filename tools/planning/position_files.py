"""The files of a common plan: for the simulated table, for a real one, for its operator."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import whole_folder
from ..orchestrator.stimuli import read_table
from ..records.columns import LIMITS
from .common_plan import CommonPlan
from .places import Places

DWELL_S = 20.0


def write_plan(plan: CommonPlan, folder: Path, *, dwell_s: float = DWELL_S) -> list[Path]:
    """Write everything that is needed to carry a plan out.

    `programme.csv` is a position programme for a scenario's table (one file for each mounting where there are
    several), `table.csv` the list for a real table, `angles.csv` the file for `--check`, where the actual angles are
    filled in, `operator.html` a page to print, `positions.svg` the picture, `plan.json` the plan.

    Parameters
    ----------
    folder : Path
        made where it is missing
    dwell_s : float
        time at each position [s]

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        for a dwell that is not positive, or a folder that cannot be written
    """
    from ..report.position_page import operator_page
    from ..report.position_pictures import positions_picture

    checked_dwell(dwell_s)
    rows = [plan.position(int(row)) for row in plan.programme]
    several = len(plan.mountings) > 1
    files: dict[str, str] = {}
    for name in plan.mountings:
        own = [one for one in rows if not several or one["mounting"] == name]
        lines = [f"{one['alpha_deg']},{one['beta_deg']},{dwell_s:g}" for one in own]
        if lines:
            files[f"programme-{name}.csv" if several else "programme.csv"] = _csv("alpha_deg,beta_deg,dwell_s", lines)
    tail = [f",{one['mounting']}" if several else "" for one in rows]
    header = "order,alpha_deg,beta_deg,dwell_s" + (",mounting" if several else "")
    files["table.csv"] = _csv(
        header,
        [
            f"{number},{one['alpha_deg']},{one['beta_deg']},{dwell_s:g}{end}"
            for number, (one, end) in enumerate(zip(rows, tail, strict=True), start=1)
        ],
    )
    files["angles.csv"] = _csv(
        "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg",
        [f"{one['alpha_deg']},{one['beta_deg']},{one['alpha_deg']},{one['beta_deg']}" for one in rows],
    )
    files["plan.json"] = plan.json_text()
    files["operator.html"] = operator_page(plan, dwell_s)
    degrees = [plan.position(row) for row in range(len(plan.commands))]
    files["positions.svg"] = positions_picture(
        [one["alpha_deg"] for one in degrees], [one["beta_deg"] for one in degrees], plan.programme.tolist()
    )
    with whole_folder(folder) as beside:
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]


def checked_dwell(dwell_s: float) -> float:
    """The dwell [s], or an InputError for one that is not positive."""
    if not (np.isfinite(dwell_s) and dwell_s > 0.0):
        raise InputError(f"--dwell {dwell_s:g}: must be a positive number of seconds")
    return dwell_s


def _csv(header: str, lines: list[str]) -> str:
    return "\n".join([header, *lines]) + "\n"


def read_angles(path: Path) -> tuple[Places, Places]:
    """Planned and actual positions of an `angles.csv`.

    Raises
    ------
    InputError
        for a file that cannot be read, lacks a column, holds no rows, or angles that no table has
    """
    names = ("planned_alpha_deg", "planned_beta_deg", "alpha_deg", "beta_deg")
    table, _ = read_table(path, str(path), names)
    low, high, needed = LIMITS["alpha_deg"]
    for name in names:
        values = table.columns[name]
        for k in np.flatnonzero((values < low) | (values > high)).tolist():
            raise InputError(f"{table.row(k)}, column '{name}': {values[k]:g} is outside {low:g} to {high:g}; {needed}")
    angle = np.radians(np.column_stack([table.columns[name] for name in names]))
    mounting = np.zeros(len(angle), dtype=int)
    return Places(angle[:, :2], mounting), Places(angle[:, 2:], mounting)
