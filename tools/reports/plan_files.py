"""The files of a plan of positions: for a simulated table, a real one, its operator; and of a curve."""

from pathlib import Path

from ..document.page import html
from ..files import whole_folder
from ..planning.order import DWELL_S, checked_dwell
from ..planning.plan import Curve, PlannedPosition, PositionPlan
from .pictures.plans import curve_picture, positions_picture
from .plan import operator_page


def write_plan(plan: PositionPlan, folder: Path, *, dwell_s: float = DWELL_S) -> list[Path]:
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
    checked_dwell(dwell_s)
    rows = [plan.positions[at - 1] for at in plan.programme]
    several = len(plan.mountings) > 1

    def row(one: PlannedPosition) -> str:
        return f"{one.alpha_deg},{one.beta_deg}"

    files: dict[str, str] = {}
    for name in plan.mountings:
        lines = [f"{row(one)},{dwell_s:g}" for one in rows if not several or one.mounting == name]
        if lines:
            files[f"programme-{name}.csv" if several else "programme.csv"] = _csv("alpha_deg,beta_deg,dwell_s", lines)
    files["table.csv"] = _csv(
        "order,alpha_deg,beta_deg,dwell_s" + (",mounting" if several else ""),
        [
            f"{number},{row(one)},{dwell_s:g}{f',{one.mounting}' if several else ''}"
            for number, one in enumerate(rows, start=1)
        ],
    )
    planned = "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg"
    files["angles.csv"] = _csv(planned, [f"{row(one)},{row(one)}" for one in rows])
    files["plan.json"] = plan.json_text()
    files["operator.html"] = html(operator_page(plan, dwell_s))
    files["positions.svg"] = positions_picture(
        [one.alpha_deg for one in plan.positions],
        [one.beta_deg for one in plan.positions],
        [at - 1 for at in plan.programme],
    )
    return _written(files, folder)


def write_curve(curve: Curve, folder: Path) -> list[Path]:
    """Write `curve.csv` and `curve.svg`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    points = curve.points
    rows = [f"{p.positions},{p.readings},{p.worst!r},{p.mean!r},{p.bound!r},{p.pool}" for p in points]
    columns = ([getattr(p, name) for p in points] for name in ("positions", "worst", "mean", "bound"))
    table = _csv("positions,readings,worst_ratio,mean_ratio,lower_bound,pool", rows)
    return _written({"curve.csv": table, "curve.svg": curve_picture(*columns)}, folder)


def _csv(header: str, lines: list[str]) -> str:
    return "\n".join([header, *lines]) + "\n"


def _written(files: dict[str, str], folder: Path) -> list[Path]:
    with whole_folder(folder) as beside:
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in files]
