"""As few positions as keep a wanted error; and what any number costs."""

from contextlib import suppress
from dataclasses import replace
from math import ceil
from typing import Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from ..progress import shown_status
from ..result import Result
from ..rounding import downwards
from .common import (
    FEWEST,
    MOST_POSITIONS,
    NoSetError,
    PositionPlan,
    common_positions,
    starting_positions,
)
from .pool import HittingSet, bound_positions, pool_of
from .positions import Places, task_of
from .request import GOALS, Request
from .search import drawn, search

FIRST = 6
"""One of so many of the searches is made while it is sought how many positions do."""


def least_count(request: Request) -> int:
    """The fewest positions with which a search begins."""
    return 1 if request.any_number else max(FEWEST, -(-len(request.parametrisation().symbols) // 3))


def fewest_positions(request: Request, *, progress: bool = False) -> PositionPlan:
    """As `common_positions`, of the fewest positions found to keep the error that `request.accuracy` says.

    Numbers of positions are tried in growing steps, then between the last two, with a few of the searches each; then
    all of them are made for the number that was found, and for one less until that keeps it no more. An
    InputError for an error that no positions keep, proven over all angles, or that was not found to be
    kept, and for targets of several units.
    """
    wanted, sigma = request.wanted, request.noise_bound
    if request.goal is not None:
        request.check_unit(GOALS[request.goal])
    task = task_of(request, progress=progress)
    units = {target.unit for target in task.targets}
    if len(units) > 1 and request.goal is None:
        raise InputError(
            f"--accuracy: the targets have units {', '.join(sorted(units))}; ask for those of one by --target"
        )
    if request.goal is None:
        request.check_unit(*units)
    least = float(task.least.max()) * request.magnified
    refused = f"--accuracy {request.accuracy}: no positions"
    if least > wanted:
        raise InputError(
            f"{refused}, however many, keep it at --noise-bound {sigma:g}; "
            f"none are better than {request.told(least, downwards)}"
        )
    tried: dict[int, PositionPlan] = {}

    def keeps(
        count: int, starts: int = max(1, request.starts // FIRST), enough: float = (1.0 - 1e-12) * wanted / least
    ) -> bool:
        asked = replace(request, cuts=0, starts=starts)
        with suppress(NoSetError):
            found = common_positions(count, asked, enough=enough, progress=progress)
            if found.interrupted:
                raise KeyboardInterrupt
            tried[count] = min(found, tried.get(count, found), key=error_of)
        return count in tried and error_of(tried[count]) <= wanted

    high = least_count(request)
    low, stride = high - 1, 1
    while not keeps(high):
        if high == MOST_POSITIONS:
            best = min(error_of(plan) for plan in tried.values())
            raise InputError(f"{refused} up to {high} were found to keep it, best {request.told(best)}")
        low, high, stride = high, min(high + stride, MOST_POSITIONS), 2 * stride
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if keeps(middle) else (middle, high)
    while low >= least_count(request) and keeps(low, request.starts):
        low, high = low - 1, low
    keeps(high, request.starts, 0.0)
    found, fewer = tried[high], tried.get(low)
    told: dict[str, object] = {}
    if request.cuts:
        with shown_status("lower bound", show=progress):
            hitting = HittingSet(task, pool_of(task, places_of(found)))
            for count in range(1, len(found.positions)):
                if not hitting.prove(count, wanted / least, request.cuts - len(hitting)):
                    break
            bound = hitting.bound(len(found.positions), found.worst_ratio)
            possible = ceil(hitting.least_count(wanted / least)[0] - 1e-9)
        told |= {"bound": bound, "lower_bound": bound.ratio, "lower_bound_on": bound.on, "fewest_possible": possible}
    return found.model_copy(
        update={
            "accuracy": wanted * sigma,
            "accuracy_kept": error_of(found) * sigma,
            "fewer_keep": None if fewer is None else error_of(fewer) * sigma,
            **told,
        }
    )


def error_of(plan: PositionPlan) -> float:
    """The largest error of what is asked for [σ]."""
    of_goal = (plan.azimuth_error, plan.levelling_error)
    return next((error for error in of_goal if error is not None), max(plan.costs.values()))


def places_of(plan: PositionPlan) -> Places:
    """The positions of a plan of one mounting."""
    angle = np.radians([(one.alpha_deg, one.beta_deg) for one in plan.positions])
    return Places(angle, np.zeros(len(angle), dtype=int))


class CurvePoint(Result):
    """What N positions cost, ratios of the best set found; no N of the pool have a worst ratio below the bound."""

    positions: int
    readings: int
    worst: float
    mean: float
    bound: float
    pool: int


class Curve(Result):
    """Cost against the number of positions: how many positions are worth their time."""

    schema_: Literal["trihedron.plan-curve/1"] = Field(default="trihedron.plan-curve/1", alias="schema")
    points: tuple[CurvePoint, ...]


def plan_curve(low: int, high: int, request: Request, *, progress: bool = False) -> Curve:
    """The best sets of `low` to `high` positions, each begun with the one before and a position more.

    Ctrl-C ends the curve where it is. An InputError for a range that is empty or too wide, and for options that cannot
    be used.
    """
    if not 1 <= low <= high <= MOST_POSITIONS:
        raise InputError(f"--curve {low} {high}: must be a range of numbers of positions up to {MOST_POSITIONS}")
    task = task_of(request, progress=progress)
    before: Places | None = None
    points: list[CurvePoint] = []
    for count in range(low, high + 1):
        given = starting_positions(task, count)
        if before is not None:
            given = [*given, before.joined(drawn(task, 1, np.random.default_rng(request.seed)))]
        try:
            best, _, interrupted = search(task, count, given=given, progress=progress)
            if best is None:
                continue
            before = best.places
            pool = pool_of(task, before)
            bound = bound_positions(task, pool, count, best.worst)
        except KeyboardInterrupt:
            if not points:
                raise
            break
        points.append(
            CurvePoint(
                positions=count,
                readings=len(best.readings.position),
                worst=best.worst,
                mean=best.mean,
                bound=bound.ratio,
                pool=len(pool.places),
            )
        )
        if interrupted:
            break
    if not points:
        raise InputError(f"--curve {low} {high}: no set was found that determines every target; give more, or --starts")
    return Curve(points=tuple(points))
