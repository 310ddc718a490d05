"""One set of so many positions for all targets, or for a goal."""

import csv
from collections.abc import Iterator
from importlib import resources
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..calibrated import Number
from ..errors import InputError
from ..progress import shown_status
from ..result import Result
from .check import EffectDistance, detecting, named_effects
from .plan import Degrees
from .pool import Bound, bound_positions, pool_of
from .positions import Costs, Places, Request, Task, allowed, costs, task_of
from .search import merit, search
from .tour import measuring_order, unwound

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
        of the targets' costs to their optima; worst of a goal, of its error to what no positions better
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
    goal, levelling_error, azimuth_error : str, float, float or None
        what the correction is for, and its largest error by a-priori estimates, in σ [rad], of a level and of a
        gyrocompass
    accuracy, accuracy_kept, fewer_keep : float or None
        the error that was wanted, that of this set, and the best that was found of a position less [rad, g, 1]
    fewest_possible : int or None
        proven: no fewer positions of the pool keep the wanted error
    measured : int or None
        positions that are measured already and count beside these
    detection : tuple of EffectDistance
        how well the effects that were named show
    task, bound : Task, Bound or None
        what was asked, what is proven; for programs
    duration : float
        time of the programme's moves [s], for programs
    searched : int
        positions of the set without the extra ones, for programs
    """

    omitted = frozenset(
        {"detection", "goal", "levelling_error", "azimuth_error", "measured"}
        | {"accuracy", "accuracy_kept", "fewer_keep", "fewest_possible"}
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

    def to_polars(self) -> "DataFrame":
        """The programme, a row for each visit: order, alpha_deg, beta_deg and, of several mountings, mounting."""
        import polars as pl

        rows = [{"order": k, **self.positions[at - 1].to_json()} for k, at in enumerate(self.programme, start=1)]
        return pl.DataFrame(rows, schema_overrides={"alpha_deg": pl.Float64, "beta_deg": pl.Float64})


class NoSetError(InputError):
    """No set of so many positions was found that determines every target."""


def common_positions(
    count: int, request: Request, *, stored: bool = True, enough: float = 0.0, progress: bool = False
) -> PositionPlan:
    """One set of positions for all targets, with what is proven of every other set.

    It begins with the plan that the package holds for so many positions, where `stored` says so and it fits. The same
    for the same arguments; the best found where Ctrl-C ended the search, or where one has a worst ratio that is enough.
    An InputError for options that cannot be used, and for so few positions that no set was found.
    """
    fewest = 1 if request.any_number else FEWEST
    if not fewest <= count <= MOST_POSITIONS:
        raise InputError(f"{count} positions: must be between {fewest} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")
    effects = named_effects(request.detect)
    task = task_of(request, progress=progress)
    size = task.weights.shape[1]
    if count < -(-size // 3) and not request.any_number:
        raise InputError(
            f"{count} positions: must be at least {-(-size // 3)}, three readings of each for {size} parameters"
        )
    if effects and request.measured:
        raise InputError("--detect: does not go with --measured")
    given = [places.joined(task.measured) for places in starting_positions(task, count)] if stored else []
    found, starts, interrupted = search(task, count, given=given, enough=enough, progress=progress)
    if found is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise NoSetError(
            f"{count} positions: no set was found that determines every target; give more, or --starts{less}"
        )
    if request.resolution_deg is not None:
        found = rounded(task, found)
        if not (found.determined.all() and allowed(task, found.places.angle).all()):
            where = " outside the keep-outs" if request.keep_out else ""
            raise InputError(f"--resolution {request.resolution_deg:g}: too coarse to determine every target{where}")
    bound, detection = None, ()
    if request.cuts and not (interrupted or (effects and request.extra)):
        try:
            with shown_status("lower bound", show=progress):
                bound = bound_positions(task, pool_of(task, found.places), count, found.worst)
        except KeyboardInterrupt:
            interrupted = True
    if effects:
        places, detection = detecting(task, found.places, effects)
        found = costs(task, places)
    return plan_of(
        task,
        found,
        starts=starts,
        interrupted=interrupted,
        bound=bound,
        detection=detection,
        searched=count,
    )


def plan_of(task: Task, found: Costs, *, bound: Bound | None = None, **told: Any) -> PositionPlan:
    """The plan of a set that was found: order of measurement, commands, costs; and what else is told of it."""
    request, p = task.request, task.parametrisation
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
        bound=bound,
        costs=every,
        optima=dict(zip(symbols, task.best.tolist(), strict=True)),
        readings=len(found.readings.position),
        **{name: getattr(request, name) for name in ASKED},
        **goal_errors(task, found),
        measured=len(task.measured) or None,
        mountings={name: matrix.tolist() for name, matrix in zip(p.mountings, p.matrices, strict=True)},
        task=task,
        duration=duration,
        **told,
    )


def goal_errors(task: Task, found: Costs) -> dict[str, float]:
    """The largest errors of the goal [σ] by their names; none without a goal."""
    request = task.request
    if request.goal is None:
        return {}
    of_level = found.worst * float(task.least.max())
    told = {"levelling_error": of_level}
    return told | ({"azimuth_error": of_level * request.magnified} if request.goal == "gyrocompass" else {})


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
