"""One set of positions for all targets, as many as are asked for or fit into given time, and what any number costs."""

import csv
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import resources
from itertools import product
from math import ceil, radians, tan
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..calibration.result import Number
from ..calibration.targets import levelling_error
from ..errors import InputError
from ..progress import shown_status
from ..result import Result
from ..rounding import downwards
from .check import EffectDistance, detecting, named_effects
from .plan import Degrees
from .pool import Bound, bound_positions, pool_of
from .positions import Costs, Places, Request, Task, allowed, costs, task_of
from .search import drawn, merit, search
from .tour import measuring_order, unwound
from .unlisted import UnlistedSize, against_unlisted, sizes_of

if TYPE_CHECKING:
    from polars import DataFrame

FEWEST, MOST_POSITIONS = 5, 60
"""Fewest of a symmetric block, with fifteen parameters."""
SWEEPS = 6
DWELL_S = 20.0
"""Time at each position, where none is given."""


ASKED = ("criterion", "reserve_deg", "resolution_deg", "keep_out", "order", "seed")
ASKED += ("admissible", "bounds", "convention", "baseline", "goal")
"""What a plan of positions repeats of its request."""


class PlannedPosition(Result):
    """Angles as commands to the table [deg], and the mounting where there are several."""

    omitted = frozenset({"mounting"})

    alpha_deg: Degrees
    beta_deg: Degrees
    mounting: str | None = None


class PositionPlan(Result):
    """One set of positions for all targets, and in which order they are measured.

    Attributes
    ----------
    positions : tuple of PlannedPosition
        in the order in which they are measured first
    programme : tuple of int
        every measurement: which position, from 1
    worst_ratio, mean_ratio : float
        of the targets' costs to their optima
    lower_bound, lower_bound_on : float, str
        proven: no set of so many positions of this pool has a lower worst ratio; None where it is not asked for, where
        extra positions are or another criterion is, or after an interruption
    costs, optima : dict
        of each target [σ]: with this set, and with its own optimal plan over all angles
    readings : int
        how many count
    criterion, reserve_deg, resolution_deg, keep_out, order, seed, admissible, bounds, convention, baseline
        as in the request
    starts : int
        local improvements that were made
    interrupted : bool
        whether Ctrl-C ended search or bound
    mountings : dict
        Q (3, 3) by name
    goal, lost, levelling_error, azimuth_error : str, int, float, float or None
        what the correction is for, and its largest error by a-priori estimates, in σ [rad], of a level and of a
        gyrocompass; so many positions may be lost, any: costs are those of the worst
    accuracy, accuracy_kept, fewer_keep : float or None
        the error that was wanted, that of this set, and the best that was found of a position less [rad, g, 1]
    measured : int or None
        positions that are measured already and count beside these
    detection : tuple of EffectDistance
        how well the effects that were named show
    unlisted : tuple of UnlistedSize
        from which size on what is in no catalogue is surely seen, where the set is chosen for that
    task, bound : Task, Bound or None
        what was asked, what is proven; for programs
    duration : float
        time of the programme's moves [s], for programs
    searched : int
        positions of the set without the extra ones, for programs
    """

    omitted = frozenset(
        {"detection", "unlisted", "goal", "lost", "levelling_error", "azimuth_error", "measured", "accuracy"}
        | {"accuracy_kept", "fewer_keep"}
    )

    schema_: Literal["trihedron.plan/1"] = Field(default="trihedron.plan/1", alias="schema")
    positions: Annotated[tuple[PlannedPosition, ...], Field(min_length=1)]
    programme: tuple[int, ...]
    worst_ratio: Annotated[float, Field(ge=1.0 - 1e-9, allow_inf_nan=False)]
    mean_ratio: Number
    lower_bound: Number | None
    lower_bound_on: str | None
    costs: dict[str, Number]
    optima: dict[str, Number]
    readings: int
    criterion: str
    reserve_deg: float
    resolution_deg: float | None
    keep_out: tuple[str, ...]
    order: str
    seed: int
    starts: int
    interrupted: bool
    admissible: str
    bounds: tuple[float, float]
    convention: str
    baseline: str
    mountings: dict[str, list[list[float]]]
    goal: str | None = None
    lost: int | None = None
    levelling_error: Number | None = None
    azimuth_error: Number | None = None
    accuracy: Number | None = None
    accuracy_kept: Number | None = None
    fewer_keep: Number | None = None
    measured: int | None = None
    detection: tuple[EffectDistance, ...] = ()
    unlisted: tuple[UnlistedSize, ...] = ()
    task: Task = Field(default=None, exclude=True)  # pyright: ignore[reportAssignmentType]
    bound: Bound | None = Field(default=None, exclude=True)
    duration: float = Field(default=0.0, exclude=True)
    searched: int = Field(default=0, exclude=True)

    def to_polars(self) -> "DataFrame":
        """The programme, a row for each visit: order, alpha_deg, beta_deg and, of several mountings, mounting."""
        import polars as pl

        rows = [{"order": k, **self.positions[at - 1].to_json()} for k, at in enumerate(self.programme, start=1)]
        return pl.DataFrame(rows, schema_overrides={"alpha_deg": pl.Float64, "beta_deg": pl.Float64})


class NoSetError(InputError):
    """No set of so many positions was found that determines every target."""


def plan_positions(count: int, request: Request, *, stored: bool = True, progress: bool = False) -> PositionPlan:
    """One set of positions for all targets, with what is proven of every other set.

    It begins with the plan that the package holds for so many positions, where `stored` says so and it fits. The same
    for the same arguments; the best found where Ctrl-C ended the search. An InputError for options that cannot be used,
    and for so few positions that no set was found.
    """
    fewest = 1 if request.any_number else FEWEST
    if not fewest <= count <= MOST_POSITIONS:
        raise InputError(f"--positions {count}: must be between {fewest} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")
    effects = named_effects(request.detect)
    task = task_of(request, progress=progress)
    p, size = task.parametrisation, task.weights.shape[1]
    if count < -(-size // 3) and not request.any_number:
        raise InputError(
            f"--positions {count}: must be at least {-(-size // 3)}, three readings of each for {size} parameters"
        )
    for option, value in {"--detect": effects, "--against-unlisted": request.against_unlisted}.items():
        if value and (request.measured or request.lost):
            raise InputError(f"{option}: does not go with --{'measured' if request.measured else 'lost'}")
    given = [places.joined(task.measured) for places in starting_positions(task, count)] if stored else []
    if request.against_unlisted:
        places, starts, interrupted = against_unlisted(task, count, given, progress=progress)
        found = costs(task, places)
        found = found if found.determined.all() else None
    else:
        found, starts, interrupted = search(task, count, given=given, progress=progress)
    if found is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise NoSetError(
            f"{count} positions: no set was found that determines every target; give more, or --starts{less}"
        )
    if request.resolution_deg is not None and not request.against_unlisted:
        found = rounded(task, found)
        if not (found.determined.all() and allowed(task, found.places.angle).all()):
            where = " outside the keep-outs" if request.keep_out else ""
            raise InputError(f"--resolution {request.resolution_deg:g}: too coarse to determine every target{where}")
    bound, detection = None, ()
    if request.cuts and not (interrupted or request.against_unlisted or (effects and request.extra)):
        try:
            with shown_status("lower bound", show=progress):
                bound = bound_positions(task, pool_of(task, found.places), count, found.worst)
        except KeyboardInterrupt:
            interrupted = True
    if effects:
        places, detection = detecting(task, found.places, effects)
        found = costs(task, places)
    places = found.places.chosen(np.arange(len(found.places) - len(task.measured)))
    commands = unwound(places.angle, task.keep_out)
    rows, duration = measuring_order(places, commands, request)
    order = list(dict.fromkeys(rows.tolist()))
    number = {row: place for place, row in enumerate(order, start=1)}
    mounting = places.mounting if len(p.mountings) > 1 else None
    symbols = [target.symbol for target in task.targets]
    every = dict(zip(symbols, (found.ratio * task.best).tolist(), strict=True))
    return PositionPlan(
        positions=tuple(
            PlannedPosition(
                alpha_deg=alpha,
                beta_deg=beta,
                mounting=None if mounting is None else p.mountings[int(mounting[row])],
            )
            for row, (alpha, beta) in zip(order, np.round(np.degrees(commands[order]), 9).tolist(), strict=True)
        ),
        programme=tuple(number[row] for row in rows.tolist()),
        worst_ratio=found.worst,
        mean_ratio=found.mean,
        lower_bound=None if bound is None else bound.ratio,
        lower_bound_on=None if bound is None else bound.on,
        costs=every,
        optima=dict(zip(symbols, task.best.tolist(), strict=True)),
        readings=len(found.readings.position),
        **{name: getattr(request, name) for name in ASKED},
        lost=request.lost or None,
        levelling_error=None if request.goal is None else levelling_error(every),
        azimuth_error=None if request.goal != "gyrocompass" else _error(request, every),
        measured=len(task.measured) or None,
        starts=starts,
        interrupted=interrupted,
        mountings={name: matrix.tolist() for name, matrix in zip(p.mountings, p.matrices, strict=True)},
        detection=detection,
        unlisted=sizes_of(task, found.places) if request.against_unlisted else (),
        task=task,
        bound=bound,
        duration=duration,
        searched=count,
    )


def least_count(request: Request) -> int:
    """The fewest positions with which a search begins."""
    return 1 if request.any_number else max(FEWEST, -(-len(request.parametrisation().symbols) // 3))


def plan_in_time(minutes: float, request: Request, *, dwell_s: float = DWELL_S, progress: bool = False) -> PositionPlan:
    """As `plan_positions`, of as many positions as are measured in so many minutes, moves and repetitions included.

    A rough set says how long moves take; then a position less is tried until they fit. An InputError for less time than
    the fewest positions need.
    """
    seconds = 60.0 * minutes
    if not (np.isfinite(minutes) and seconds >= checked_dwell(dwell_s)):
        raise InputError(f"--minutes {minutes:g}: must be at least one --dwell of {dwell_s:g} seconds")

    def used(plan: PositionPlan) -> float:
        return plan.duration + dwell_s * len(plan.programme)

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
        count -= max(0, ceil((used(rough) - seconds) / (dwell_s + rough.duration / len(rough.programme))))
    for tried in range(count, least - 1, -1):
        if used(found := plan_positions(tried, request, progress=progress)) <= seconds:
            return found
    raise too_little


def _error(request: Request, errors: Mapping[str, float]) -> float:
    """The largest error of what is asked for [σ], by those of the targets."""
    if request.goal is None:
        return max(errors.values())
    return levelling_error(errors) * (abs(tan(radians(request.latitude))) if request.goal == "gyrocompass" else 1.0)


def plan_to_accuracy(request: Request, *, progress: bool = False) -> PositionPlan:
    """As `plan_positions`, of the fewest positions found to keep the error that `request.accuracy` says.

    Numbers of positions are tried in growing steps, then between the last two. An InputError for an error that no
    positions keep, proven over all angles, or that was not found to be kept, and for targets of several units.
    """
    wanted, sigma = request.wanted, request.noise_bound
    alone = replace(request, goal=None, accuracy=None, latitude_deg=None, targets=request.expressions)
    own = task_of(alone, progress=progress)
    units = {target.unit for target in own.targets}
    if len(units) > 1 and request.goal is None:
        raise InputError(
            f"--accuracy: the targets have units {', '.join(sorted(units))}; ask for those of one by --target"
        )
    least = _error(request, dict(zip([target.symbol for target in own.targets], own.best.tolist(), strict=True)))
    refused = f"--accuracy {request.accuracy}: no positions"
    if least > wanted:
        raise InputError(
            f"{refused}, however many, keep it at --noise-bound {sigma:g}; "
            f"none are better than {request.told(least, downwards)}"
        )
    tried: dict[int, PositionPlan] = {}

    def keeps(count: int) -> bool:
        with suppress(NoSetError):
            tried[count] = plan_positions(count, request, progress=progress)
            if tried[count].interrupted:
                raise KeyboardInterrupt
            return _error(request, tried[count].costs) <= wanted
        return False

    high = least_count(request)
    low, stride = high - 1, 1
    while not keeps(high):
        if high == MOST_POSITIONS:
            best = min(_error(request, plan.costs) for plan in tried.values())
            raise InputError(f"{refused} up to {high} were found to keep it, best {request.told(best)}")
        low, high, stride = high, min(high + stride, MOST_POSITIONS), 2 * stride
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if keeps(middle) else (middle, high)
    found, fewer = tried[high], tried.get(low)
    return found.model_copy(
        update={
            "accuracy": wanted * sigma,
            "accuracy_kept": _error(request, found.costs) * sigma,
            "fewer_keep": None if fewer is None else _error(request, fewer.costs) * sigma,
        }
    )


def rounded(task: Task, found: Costs) -> Costs:
    """The set with every angle a multiple of the table's resolution, chosen so that the cost stays least.

    One position after the other goes to the best of the four multiples around it, while the later ones are still where
    they were; then each may move by one step, while that helps.
    """
    step_deg = task.request.resolution_deg
    assert step_deg is not None

    def best_of(here: Costs, row: int, trials: list[NDArray]) -> Costs:
        angles = np.repeat(here.places.angle[None], len(trials), axis=0)
        angles[:, row] = np.radians(np.array(trials) * step_deg)
        inside = angles[allowed(task, angles[:, row])]
        if not len(inside):
            return costs(task, here.places.at(angles[0]))
        return min((costs(task, here.places.at(angle)) for angle in inside), key=lambda trial: merit(task, trial))

    best = found
    own_rows = range(len(found.places) - len(task.measured))
    for row in own_rows:
        low = np.floor(np.degrees(best.places.angle[row]) / step_deg)
        best = best_of(best, row, [low + shift for shift in product((0, 1), repeat=2)])
    for _ in range(SWEEPS):
        before = merit(task, best)
        for row in own_rows:
            own = np.round(np.degrees(best.places.angle[row]) / step_deg)
            best = best_of(best, row, [own + shift for shift in product((0, -1, 1), repeat=2)])
        if merit(task, best) >= before:
            break
    return best


def starting_positions(task: Task, count: int) -> list[Places]:
    """The set of so many positions that the package holds, where it is for this mounting and in no keep-out."""
    p = task.parametrisation
    places = stored_positions(count)
    if places is None or len(p.mountings) != 1 or not np.array_equal(p.matrices[0], np.eye(3)):
        return []
    return [places] if allowed(task, places.angle).all() else []


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


def stored_positions(count: int) -> Places | None:
    """The plan of so many positions that the package holds: mounting `identity`, the tables' admissible set."""
    angle = [(float(r["alpha_deg"]), float(r["beta_deg"])) for r in _stored_rows() if int(r["positions"]) == count]
    return Places(np.radians(angle), np.zeros(count, dtype=int)) if angle else None


def stored_counts() -> list[int]:
    """For how many positions the package holds a plan."""
    return sorted({int(row["positions"]) for row in _stored_rows()})


def _stored_rows() -> Iterator[dict[str, str]]:
    text = resources.files("trihedron.tools.planning").joinpath("common_positions.csv").read_text(encoding="utf-8")
    return csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))


def checked_dwell(dwell_s: float) -> float:
    """The time at each position [s], or an InputError for one that is not positive."""
    if not (np.isfinite(dwell_s) and dwell_s > 0.0):
        raise InputError(f"--dwell {dwell_s:g}: must be a positive number of seconds")
    return dwell_s
