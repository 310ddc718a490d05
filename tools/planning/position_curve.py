"""Cost against the number of positions: how many positions are worth their time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import whole_folder
from .common_plan import MOST_POSITIONS, starting_positions
from .places import Places
from .pool import pool_of
from .position_bound import HittingSet, bound_positions
from .position_search import drawn, search
from .request import Request, requested_task


@dataclass(frozen=True)
class CurvePoint:
    """What N positions cost.

    Attributes
    ----------
    positions, readings : int
    worst, mean : float
        ratios of the best set found
    bound : float
        proven: no N positions of the pool have a lower worst ratio
    pool : int
        size of the pool
    """

    positions: int
    readings: int
    worst: float
    mean: float
    bound: float
    pool: int


def plan_curve(low: int, high: int, request: Request, *, progress: bool = False) -> list[CurvePoint]:
    """The best sets of `low` to `high` positions, each begun with the one before and a position more.

    Ctrl-C ends the curve where it is.

    Raises
    ------
    InputError
        for a range that is empty or too wide, and for options that cannot be used
    """
    if not 1 <= low <= high <= MOST_POSITIONS:
        raise InputError(f"--curve {low} {high}: must be a range of numbers of positions up to {MOST_POSITIONS}")
    task = requested_task(request, progress=progress)
    before: Places | None = None
    points: list[CurvePoint] = []
    for count in range(low, high + 1):
        given = starting_positions(task, count)
        if before is not None:
            more = drawn(task, 1, np.random.default_rng(request.seed))
            joined = [np.concatenate(pair) for pair in ((before.angle, more.angle), (before.mounting, more.mounting))]
            given = [*given, Places(*joined)]
        try:
            found = search(
                task,
                count,
                criterion=request.criterion,
                seed=request.seed,
                starts=request.starts,
                given=given,
                progress=progress,
            )
            if found is None:
                continue
            before = found.best.places
            pool = pool_of(task, before)
            hitting = HittingSet(task, pool, request.seed)
            bound = bound_positions(hitting, count, found.best.worst, request.cuts)
        except KeyboardInterrupt:
            if not points:
                raise
            break
        best = found.best
        points.append(
            CurvePoint(count, len(best.readings.position), best.worst, best.mean, bound.ratio, len(pool.places))
        )
        if found.interrupted:
            break
    if not points:
        raise InputError(f"--curve {low} {high}: no set was found that determines every target; give more, or --starts")
    return points


def curve_summary(points: Sequence[CurvePoint]) -> str:
    """The curve as a table."""
    lines = [f"{'positions':>9} {'readings':>8} {'worst ratio':>11} {'mean':>9} {'proven':>9}  on a pool of"]
    lines += [
        f"{p.positions:>9} {p.readings:>8} {p.worst:>11.6f} {p.mean:>9.6f} {p.bound:>9.6f}  {p.pool} positions"
        for p in points
    ]
    return "\n".join(lines)


def write_curve(points: Sequence[CurvePoint], folder: Path) -> list[Path]:
    """Write `curve.csv` and `curve.svg`.

    Raises
    ------
    InputError
        for a folder that cannot be written
    """
    from ..report.position_pictures import curve_picture

    table = ["positions,readings,worst_ratio,mean_ratio,lower_bound,pool"]
    table += [f"{p.positions},{p.readings},{p.worst!r},{p.mean!r},{p.bound!r},{p.pool}" for p in points]
    columns = ([getattr(p, name) for p in points] for name in ("positions", "worst", "mean", "bound"))
    with whole_folder(folder) as beside:
        (beside / "curve.csv").write_text("\n".join(table) + "\n", encoding="utf-8", newline="\n")
        (beside / "curve.svg").write_text(curve_picture(*columns), encoding="utf-8", newline="\n")
    return [folder / "curve.csv", folder / "curve.svg"]
