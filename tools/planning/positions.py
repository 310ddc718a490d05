"""One set of positions for all targets or a goal: of a given number, the fewest for an accuracy, any number.

The stored sets are those of `common_positions.csv`.
"""

import csv
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from importlib import resources
from math import ceil
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from ..fields import Number
from ..progress import shown_status
from ..quantity import Quantity
from ..result import Result
from ..rounding import downwards
from .bounds import Bound, HittingSet, bound_positions, pool_of
from .check import EffectDistance, detecting, named_effects
from .request import GOALS, Request
from .search import random_places, rounded, search_positions
from .targets import Degrees
from .task import Costs, Places, Task, allowed, costs, task_of
from .tour import measuring_order, unwound

if TYPE_CHECKING:
    from polars import DataFrame

FEWEST, MOST_POSITIONS = 5, 60
"""Smallest number of positions (a symmetric block has fifteen parameters) and largest number."""
TRIED_SHARE = 6
"""Fraction 1/n of the searches that is made while the fewest positions are sought."""
DWELL_S = 20.0
"""Default time at each position [s]."""
REPEATED = (
    "criterion",
    "reserve_deg",
    "resolution_deg",
    "keep_out",
    "order",
    "seed",
    "admissible",
    "bounds",
    "convention",
    "baseline",
    "goal",
)
"""Parts of its request that a plan of positions repeats."""


class PlannedPosition(Result):
    """Angles as commands to the table [deg], and the mounting if there are several."""

    omitted = frozenset({"mounting"})

    alpha_deg: Degrees
    beta_deg: Degrees
    mounting: str | None = None


class PositionPlan(Result):
    """One set of positions for all targets, and the order of their measurement.

    Attributes
    ----------
    positions : tuple of PlannedPosition
        in the order of their first measurement
    programme : tuple of int
        every measurement as a position number, from 1
    worst_ratio, mean_ratio : float
        ratio of the targets' costs to their optima; for a goal, worst ratio of its error to the least possible one
    lower_bound, lower_bound_on : float, str
        proven: no set of this number of positions of this pool has a lower worst ratio; None if not requested, with
        extra positions, for another criterion, and after an interruption
    costs, optima : dict
        cost of each target [σ]: with this set, and with its own optimal plan over all angles
    readings : int
        number of readings that count
    criterion, reserve_deg, resolution_deg, keep_out, order, seed, admissible, bounds, convention, baseline
        as in the request
    starts : int
        local improvements that were made
    interrupted : bool
        True if Ctrl-C ended search or bound
    mountings : dict
        Q (3, 3) by name
    goal, levelling_error, azimuth_error : str, float, float or None
        purpose of the correction, and its largest a-priori error, in σ [rad], of a level and of a gyrocompass
    accuracy, accuracy_kept, fewer_keep : float or None
        the requested error, that of this set, and the best one with a position fewer [rad, g, 1]
    fewest_possible : int or None
        proven: no fewer positions of the pool keep the accuracy
    measured : int or None
        positions that are measured already and count beside these
    detection : tuple of EffectDistance
        visibility of the named effects
    task, bound : Task, Bound or None
        the request, and the proof; in Python only
    duration : float
        time of the programme's moves [s]; in Python only
    searched : int
        positions of the set without the extra ones; in Python only
    """

    omitted = frozenset(
        {
            "detection",
            "goal",
            "levelling_error",
            "azimuth_error",
            "measured",
            "accuracy",
            "accuracy_kept",
            "fewer_keep",
            "fewest_possible",
        }
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
    levelling_error: Number | None = None
    azimuth_error: Number | None = None
    accuracy: Number | None = None
    accuracy_kept: Number | None = None
    fewer_keep: Number | None = None
    fewest_possible: int | None = None
    measured: int | None = None
    detection: tuple[EffectDistance, ...] = ()
    task: Task = Field(default=None, exclude=True)  # pyright: ignore[reportAssignmentType]
    bound: Bound | None = Field(default=None, exclude=True)
    duration: float = Field(default=0.0, exclude=True)
    searched: int = Field(default=0, exclude=True)

    @property
    def largest_error(self) -> float:
        """Return the error of the goal, or the largest of a target [σ]."""
        if self.azimuth_error is not None:
            return self.azimuth_error
        return max(self.costs.values()) if self.levelling_error is None else self.levelling_error

    @property
    def places(self) -> Places:
        """Return the positions of a plan of one mounting."""
        angle = np.radians([(one.alpha_deg, one.beta_deg) for one in self.positions])
        return Places(angle, np.zeros(len(angle), dtype=int))

    def to_polars(self) -> "DataFrame":
        """Return the programme, a row for each visit: order, alpha_deg, beta_deg and, of several mountings,
        mounting."""
        import polars as pl

        rows = [{"order": k, **self.positions[at - 1].to_json()} for k, at in enumerate(self.programme, start=1)]
        return pl.DataFrame(rows, schema_overrides={"alpha_deg": pl.Float64, "beta_deg": pl.Float64})


class NoSetError(InputError):
    """No set of this number of positions determines every target."""


def common_positions(count: int, request: Request, *, enough: float = 0.0, progress: bool = False) -> PositionPlan:
    """Find one set of positions for all targets, with a proven bound of every other set.

    The search begins with the package's stored plan of this number of positions, if it fits. The same arguments give
    the same set. The search ends with the best so far after Ctrl-C, or once the worst ratio is at most `enough`. Raises
    InputError for invalid options, and if no set was found because the positions are too few.
    """
    _check_count(count, request)
    effects = named_effects(request.detect)
    task = task_of(request, progress=progress)
    if count < _least_count(request):
        size = task.weights.shape[1]
        raise InputError(
            f"{count} positions: must be at least {-(-size // 3)}, three readings of each for {size} parameters"
        )
    if effects and request.measured:
        raise InputError("--detect: does not go with --measured")
    beginnings = [places.joined(task.measured) for places in _starting_positions(task, count)]
    best, starts, interrupted = search_positions(task, count, beginnings=beginnings, enough=enough, progress=progress)
    if best is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise NoSetError(
            f"{count} positions: no set was found that determines every target; give more, or --starts{less}"
        )
    if request.resolution_deg is not None:
        best = rounded(task, best)
        if not (best.complete and allowed(task, best.places.angle).all()):
            where = " outside the keep-outs" if request.keep_out else ""
            raise InputError(f"--resolution {request.resolution_deg:g}: too coarse to determine every target{where}")
    bound, detection = None, ()
    if request.cuts and not interrupted and not (effects and request.extra):
        try:
            with shown_status("lower bound", show=progress):
                bound = bound_positions(task, pool_of(task, best.places), count, best.worst)
        except KeyboardInterrupt:
            interrupted = True
    if effects:
        places, detection = detecting(task, best.places, effects)
        best = costs(task, places)
    outcome = {"starts": starts, "interrupted": interrupted, "detection": detection, "searched": count}
    return _plan_of(task, best, outcome | _proven(bound))


def _check_count(count: int, request: Request) -> None:
    fewest = 1 if request.any_number else FEWEST
    if not fewest <= count <= MOST_POSITIONS:
        raise InputError(f"{count} positions: must be between {fewest} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")


def _least_count(request: Request) -> int:
    """Return the fewest positions with which a search begins."""
    if request.any_number:
        return 1
    return max(FEWEST, -(-len(request.parametrisation().symbols) // 3))


def _proven(bound: Bound | None) -> dict[str, Any]:
    if bound is None:
        return {"lower_bound": None, "lower_bound_on": None}
    return {"bound": bound, "lower_bound": bound.ratio, "lower_bound_on": bound.on}


def _plan_of(task: Task, best: Costs, outcome: dict[str, Any]) -> PositionPlan:
    """Return the plan of the set that a search ended with: order of measurement, commands, costs."""
    request, p = task.request, task.parametrisation
    places = best.places.chosen(np.arange(len(best.places) - len(task.measured)))
    commands = unwound(places.angle, task.keep_out)
    rows, duration = measuring_order(places, commands, request)
    order = list(dict.fromkeys(rows.tolist()))
    positions = []
    for row in order:
        alpha, beta = np.round(np.degrees(commands[row]), 9).tolist()
        mounting = p.mountings[int(places.mounting[row])] if len(p.mountings) > 1 else None
        positions.append(PlannedPosition(alpha_deg=alpha, beta_deg=beta, mounting=mounting))
    symbols = [target.symbol for target in task.targets]
    level = best.worst * float(task.least.max())
    return PositionPlan(
        positions=tuple(positions),
        programme=tuple(order.index(row) + 1 for row in rows.tolist()),
        worst_ratio=best.worst,
        mean_ratio=best.mean,
        costs=dict(zip(symbols, (best.ratio * task.best).tolist(), strict=True)),
        optima=dict(zip(symbols, task.best.tolist(), strict=True)),
        readings=len(best.readings.position),
        **{name: getattr(request, name) for name in REPEATED},
        levelling_error=None if request.goal is None else level,
        azimuth_error=level * request.magnified if request.goal == "gyrocompass" else None,
        measured=len(task.measured) or None,
        mountings={name: matrix.tolist() for name, matrix in zip(p.mountings, p.matrices, strict=True)},
        task=task,
        duration=duration,
        **outcome,
    )


def _starting_positions(task: Task, count: int) -> list[Places]:
    """Return the package's set of this number of positions, if it fits this mounting and the keep-outs."""
    p = task.parametrisation
    places = stored_positions(count)
    if places is None or len(p.mountings) != 1 or not np.array_equal(p.matrices[0], np.eye(3)):
        return []
    return [places] if allowed(task, places.angle).all() else []


def stored_positions(count: int) -> Places | None:
    """Return the package's plan of this number of positions: mounting `identity`, the tables' admissible set."""
    angle = []
    for row in _stored_rows():
        if int(row["positions"]) == count:
            angle.append((float(row["alpha_deg"]), float(row["beta_deg"])))
    return Places(np.radians(angle), np.zeros(count, dtype=int)) if angle else None


def stored_counts() -> list[int]:
    """Return the numbers of positions for which the package holds a plan."""
    return sorted({int(row["positions"]) for row in _stored_rows()})


def _stored_rows() -> Iterator[dict[str, str]]:
    text = resources.files("trihedron.tools.planning").joinpath("common_positions.csv").read_text(encoding="utf-8")
    return csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))


def checked_dwell(dwell_s: float) -> float:
    """Return the time at each position [s].

    Raises InputError if it is not positive.
    """
    if not (np.isfinite(dwell_s) and dwell_s > 0.0):
        raise InputError(f"--dwell {dwell_s:g}: must be a positive number of seconds")
    return dwell_s


class _Trials:
    """Plans of several numbers of positions for an accuracy: the best of each number so far."""

    def __init__(self, request: Request, least: float, *, progress: bool):
        self._request, self._least, self._progress = replace(request, cuts=0), least, progress
        self.plans: dict[int, PositionPlan] = {}

    def try_count(self, count: int, *, thoroughly: bool = False, further: bool = False) -> bool:
        """Search a set of this number of positions; return True if the best one keeps the accuracy.

        By default a few of the searches are made; `thoroughly` makes all, and `further` continues after the accuracy is
        kept.
        """
        starts = self._request.starts
        if not thoroughly:
            starts = max(1, starts // TRIED_SHARE)
        enough = 0.0 if further else (1.0 - 1e-12) * self._request.largest_error / self._least
        with suppress(NoSetError):
            plan = common_positions(
                count, replace(self._request, starts=starts), enough=enough, progress=self._progress
            )
            if plan.interrupted:
                raise KeyboardInterrupt
            before = self.plans.get(count, plan)
            self.plans[count] = before if before.largest_error < plan.largest_error else plan
        return count in self.plans and self.plans[count].largest_error <= self._request.largest_error

    def fewest(self) -> int:
        """Return the fewest positions found to keep the accuracy.

        Numbers are tried in growing steps, then between the last two; one less than the result is tried thoroughly.
        Raises InputError if no number was found.
        """
        least = _least_count(self._request)
        high, low, stride = least, least - 1, 1
        while not self.try_count(high):
            if high == MOST_POSITIONS:
                best = min(plan.largest_error for plan in self.plans.values())
                raise InputError(
                    f"--accuracy {self._request.accuracy}: no positions up to {high} were found to keep it, "
                    f"best {self._request.error_text(best)}"
                )
            low, high, stride = high, min(high + stride, MOST_POSITIONS), 2 * stride
        while high - low > 1:
            middle = (low + high) // 2
            if self.try_count(middle):
                high = middle
            else:
                low = middle
        while low >= least and self.try_count(low, thoroughly=True):
            low, high = low - 1, low
        self.try_count(high, thoroughly=True, further=True)
        return high


def fewest_positions(request: Request, *, progress: bool = False) -> PositionPlan:
    """Plan like `common_positions`, with the fewest positions found to keep the accuracy of the request.

    Raises InputError for an error that no positions keep (proven over all angles), for one that no found set keeps, and
    for targets of several units.
    """
    accuracy, sigma = request.largest_error, request.noise_bound
    if request.goal is not None:
        request.check_unit(GOALS[request.goal])
    task = task_of(request, progress=progress)
    if request.goal is None:
        units = sorted({target.unit for target in task.targets})
        if len(units) > 1:
            raise InputError(f"--accuracy: the targets have units {', '.join(units)}; ask for those of one by --target")
        request.check_unit(units[0])
    least = float(task.least.max()) * request.magnified
    if least > accuracy:
        raise InputError(
            f"--accuracy {request.accuracy}: no positions, however many, keep it at --noise-bound {sigma:g}; "
            f"none are better than {request.error_text(least, downwards)}"
        )
    trials = _Trials(request, least, progress=progress)
    count = trials.fewest()
    plan, fewer = trials.plans[count], trials.plans.get(count - 1)
    update: dict[str, object] = {"accuracy": accuracy * sigma, "accuracy_kept": plan.largest_error * sigma}
    if fewer is not None:
        update["fewer_keep"] = fewer.largest_error * sigma
    if request.cuts:
        with shown_status("lower bound", show=progress):
            hitting = HittingSet(task, pool_of(task, plan.places))
            for number in range(1, count):
                if not hitting.prove(number, accuracy / least, request.cuts - len(hitting)):
                    break
            update |= _proven(hitting.bound(count, plan.worst_ratio))
            update["fewest_possible"] = ceil(hitting.least_count(accuracy / least)[0] - 1e-9)
    return plan.model_copy(update=update)


class CurvePoint(Result):
    """Cost of N positions: ratios of the best set found; no N of the pool have a worst ratio below the bound."""

    positions: Annotated[int, Quantity("positions")]
    readings: Annotated[int, Quantity("readings")]
    worst: Annotated[float, Quantity("worst ratio", "", "up", 7)]
    mean: Annotated[float, Quantity("mean", "", "up", 7)]
    bound: Annotated[float, Quantity("proven", "", "down", 7)]
    pool: Annotated[int, Quantity("positions of the pool")]


class Curve(Result):
    """Cost against the number of positions: the gain of each further position."""

    schema_: Literal["trihedron.plan-curve/1"] = Field(default="trihedron.plan-curve/1", alias="schema")
    points: tuple[CurvePoint, ...]


def plan_curve(low: int, high: int, request: Request, *, progress: bool = False) -> Curve:
    """Return the best sets of `low` to `high` positions, each begun with the previous one and a further position.

    Ctrl-C ends the curve early. Raises InputError for a range that is empty or too wide, and for invalid options.
    """
    if not 1 <= low <= high <= MOST_POSITIONS:
        raise InputError(f"--curve {low} {high}: must be a range of numbers of positions up to {MOST_POSITIONS}")
    task = task_of(request, progress=progress)
    before: Places | None = None
    points: list[CurvePoint] = []
    for count in range(low, high + 1):
        beginnings = _starting_positions(task, count)
        if before is not None:
            beginnings.append(before.joined(random_places(task, 1, np.random.default_rng(request.seed))))
        try:
            best, _, interrupted = search_positions(task, count, beginnings=beginnings, progress=progress)
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
