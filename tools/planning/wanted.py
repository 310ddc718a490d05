"""As many positions as fit into given time, or as keep a wanted error; and what any number costs."""

from contextlib import suppress
from dataclasses import replace
from itertools import product
from math import ceil
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.table_commands import move_duration
from ..errors import InputError
from ..progress import shown_status, tracked
from ..result import Result
from ..rounding import downwards
from .common import (
    DWELL_S,
    FEWEST,
    MOST_POSITIONS,
    NoSetError,
    PositionPlan,
    checked_dwell,
    plan_of,
    plan_positions,
    proven_everywhere,
    starting_positions,
)
from .force import force_error
from .pool import HittingSet, bound_positions, pool_of, symmetries
from .positions import Costs, Places, allowed, costs, task_of
from .request import GOALS, Request
from .search import drawn, search
from .tour import limits_of, measuring_order, move_times, tour_duration, unwound

STEPS_DEG = (30.0, 10.0, 5.0, 2.0, 1.0, 0.3, 0.1)
"""By which a position is moved where moves are to take less time."""
FIRST = 6
"""One of so many of the searches is made while it is sought how many positions do."""


def least_count(request: Request) -> int:
    """The fewest positions with which a search begins."""
    return 1 if request.any_number else max(FEWEST, -(-len(request.parametrisation().symbols) // 3))


def seconds_of(plan: PositionPlan, dwell_s: float) -> float:
    """Time [s] of rests and moves."""
    return plan.duration + dwell_s * len(plan.programme)


def plan_in_time(minutes: float, request: Request, *, dwell_s: float = DWELL_S, progress: bool = False) -> PositionPlan:
    """As `plan_positions`, of as many positions as are measured in so many minutes, moves and repetitions included.

    A rough set says how long moves take; then a position less is tried until they fit. An InputError for less time than
    the fewest positions need.
    """
    seconds = 60.0 * minutes
    if not (np.isfinite(minutes) and seconds >= checked_dwell(dwell_s)):
        raise InputError(f"--minutes {minutes:g}: must be at least one --dwell of {dwell_s:g} seconds")

    least = least_count(request)
    too_little = InputError(
        f"--minutes {minutes:g}: is too little for {least + request.repeat} rests of {dwell_s:g} s, the fewest, "
        "and the moves between them; give more, or a shorter --dwell"
    )
    most = min(int(seconds // dwell_s) - request.repeat, MOST_POSITIONS)
    if most < least:
        raise too_little
    count = most
    # One start may find none where more of them do.
    with suppress(NoSetError):
        rough = plan_positions(most, replace(request, starts=1, cuts=0), progress=progress)
        each = dwell_s + rough.duration / len(rough.programme)
        count -= max(0, ceil((seconds_of(rough, dwell_s) - seconds) / each))
    for tried in range(count, least - 1, -1):
        if seconds_of(found := plan_positions(tried, request, progress=progress), dwell_s) <= seconds:
            return found
    raise too_little


def plan_to_accuracy(request: Request, *, dwell_s: float = DWELL_S, progress: bool = False) -> PositionPlan:
    """As `plan_positions`, of the fewest positions, or minutes, found to keep the error that `request.accuracy` says.

    Numbers of positions are tried in growing steps, then between the last two, with a few of the searches each; then
    all of them are made for the number that was found, and for one less until that keeps it no more. For the fewest
    minutes positions are moved together, while they keep it, and more of them are tried while their rests alone take
    less time. An InputError for an error that no positions keep, proven over all angles, or that was not found to be
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
            found = plan_positions(count, asked, enough=enough, progress=progress)
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
    while request.fewest == "positions" and low >= least_count(request) and keeps(low, request.starts):
        low, high = low - 1, low
    keeps(high, request.starts, 0.0)
    found, fewer = tried[high], tried.get(low)
    told: dict[str, object] = {}
    if request.fewest == "minutes":
        found = quicker(found, progress=progress)
        while high < MOST_POSITIONS and dwell_s * (high + 1 + request.repeat) < seconds_of(found, dwell_s):
            high += 1
            if keeps(high):
                found = min(found, quicker(tried[high], progress=progress), key=lambda plan: seconds_of(plan, dwell_s))
        told["minutes"] = seconds_of(found, dwell_s) / 60.0
    if request.cuts:
        with shown_status("lower bound", show=progress):
            hitting = HittingSet(task, pool_of(task, places_of(found)))
            for count in range(1, len(found.positions)):
                if not hitting.prove(count, wanted / least, request.cuts - len(hitting)):
                    break
            bound = hitting.bound(len(found.positions), found.worst_ratio)
            possible = ceil(hitting.least_count(wanted / least)[0] - 1e-9)
        told |= {"bound": bound, "lower_bound": bound.ratio, "lower_bound_on": bound.on, "fewest_possible": possible}
        if request.fewest == "minutes":
            way = move_duration(hitting.reach(wanted / least), *limits_of(request))
            told["minutes_possible"] = (dwell_s * (possible + request.repeat) + way) / 60.0
    return found.model_copy(
        update={
            "accuracy": wanted * sigma,
            "accuracy_kept": error_of(found) * sigma,
            "fewer_keep": None if fewer is None else error_of(fewer) * sigma,
            **told,
        }
    )


def quicker(plan: PositionPlan, *, progress: bool = False) -> PositionPlan:
    """The plan with its positions moved together, or itself: moves take less time, the wanted error is kept.

    It begins with the image under the task's symmetries whose tour is shortest; then one position after the other is
    moved, by ever smaller steps, while that shortens the tour.
    """
    task, request, limits = plan.task, plan.task.request, limits_of(plan.task.request)

    def kept(angle: NDArray) -> Costs | None:
        if not allowed(task, angle).all():
            return None
        found = costs(task, own.at(angle).joined(task.measured))
        error = found.worst * float(task.least.max())
        # At the inputs that a search begins with a force's error is no larger than over all.
        if error * request.magnified > request.wanted or not found.determined.all():
            return None
        if request.goal == "force" and force_error(task, found.places, request.wanted)[0] > request.wanted:
            return None
        return found

    def ordered(angle: NDArray) -> tuple[NDArray, float]:
        return measuring_order(own.at(angle), unwound(angle, task.keep_out), request)

    own = places_of(plan)
    images = [angle for angle in (s.of(own.angle) for s in symmetries(task)) if allowed(task, angle).all()]
    angle = min([own.angle, *images], key=lambda angle: round(ordered(angle)[1], 9))
    best, (order, time) = kept(angle), ordered(angle)
    resolution = request.resolution_deg or 0.0
    for step in tracked(STEPS_DEG, "shorter moves", show=progress):
        step = max(step, resolution)
        step = round(step / resolution) * resolution if resolution else step
        gained = True
        while gained:
            gained = False
            for row, way in product(range(len(angle)), product((-1.0, 0.0, 1.0), repeat=2)):
                trial = angle.copy()
                trial[row] += np.radians(step) * np.array(way)
                needed = tour_duration(move_times(unwound(trial, task.keep_out), limits), order)
                if needed < time - 1e-6 and (found := kept(trial)) is not None:
                    angle, best, time, gained = trial, found, needed, True
            order, time = ordered(angle)
    if best is None or time >= plan.duration:
        return plan
    return plan_of(task, best, starts=plan.starts, interrupted=False, searched=plan.searched)


def error_of(plan: PositionPlan) -> float:
    """The largest error of what is asked for [σ]."""
    of_goal = (plan.force_error, plan.azimuth_error, plan.levelling_error)
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
    if request.goal == "force":
        raise InputError("--curve: does not go with --goal force; ask for each number by --positions")
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
            bound = bound_positions(task, pool, count, best.worst, proven_everywhere(count, request))
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
