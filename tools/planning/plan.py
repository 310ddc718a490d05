"""Plans with their proofs: the readings that estimate one target best, and one set of positions for all targets."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from ..calibration.calibration import Accelerometer, Number, Size
from ..calibration.model import Parametrisation, mountings_of, parametrise
from ..calibration.targets import asked_targets, convention_targets
from ..errors import InputError
from ..progress import shown_status, tracked
from ..result import Result
from .bounds import Bound, bound_positions, pool_of
from .certificate import Optimum, UndeterminedError
from .check import EffectDistance, detecting, named_effects
from .continuum import Continuum, scaled_optimum
from .forms import sheets
from .grid import Grid
from .positions import Places, Request, Task, allowed, costs, measuring_order, stored_positions, task_of, unwound
from .search import drawn, rounded, search

if TYPE_CHECKING:
    from polars import DataFrame

FEWEST, MOST_POSITIONS = 5, 60
"""Fewest of a symmetric block, with fifteen parameters."""


def _plain(value: float) -> int | float:
    return int(value) if float(value).is_integer() else value


ASKED = ("criterion", "reserve_deg", "resolution_deg", "keep_out", "order", "seed")
ASKED += ("admissible", "bounds", "convention", "baseline")
"""What a plan of positions repeats of its request."""
Degrees = Annotated[Number, AfterValidator(_plain)]
"""Whole numbers without a decimal point, zero without its sign."""
Cost = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class PlannedReading(Result):
    """A reading of a plan: the accelerometer, from 1, the angles of the table [deg], and its weight Φ."""

    accelerometer: Accelerometer
    alpha_deg: Degrees
    beta_deg: Degrees
    weight: Number


class Plan(Result):
    """The readings that estimate one target with the least guaranteed error.

    Attributes
    ----------
    target, name, unit : str
        symbol, physical name
    cost : float
        the guaranteed error [σ]
    gap : float
        to which it is proven, relative
    lower_bound : float
        no plan costs less [σ]
    grid_deg : number or None
        step of the grid [deg]; None for the continuum
    admissible : {"paper", "tables"}
    bounds : (float, float)
        u^max [rad], v^0max
    baseline : {"asymmetric", "symmetric"}
    mounting : dict
        Q (3, 3) by its name
    weights : tuple of PlannedReading
    dual : dict
        y, which proves the lower bound, by parameter
    optimum : Optimum
        the same as arrays, for programs
    parametrisation : Parametrisation
        the baseline's parameters and the mounting, for programs
    """

    schema_: Literal["trihedron.plan/1"] = Field(default="trihedron.plan/1", alias="schema")
    target: str
    name: str
    unit: str
    cost: Cost
    gap: Size
    lower_bound: Number
    grid_deg: Degrees | None
    admissible: str
    bounds: tuple[float, float]
    baseline: str
    mounting: dict[str, list[list[float]]]
    weights: Annotated[tuple[PlannedReading, ...], Field(min_length=1)]
    dual: dict[str, Number]
    optimum: Optimum = Field(default=None, exclude=True)  # pyright: ignore[reportAssignmentType]
    parametrisation: Parametrisation = Field(default=None, exclude=True)  # pyright: ignore[reportAssignmentType]


class Plans(Result):
    """The optimal plans of several targets, one after the other; one plan is published as it is."""

    schema_: Literal["trihedron.plan/1"] = Field(default="trihedron.plan/1", alias="schema")
    plans: Annotated[tuple[Plan, ...], Field(min_length=1)]

    def __iter__(self) -> Iterator[Plan]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return iter(self.plans)

    def __len__(self) -> int:
        return len(self.plans)

    def __getitem__(self, index: int) -> Plan:
        return self.plans[index]

    def to_json(self) -> dict[str, Any]:
        """The object, or the objects, of schema trihedron.plan/1."""
        return self.plans[0].to_json() if len(self.plans) == 1 else super().to_json()

    def to_polars(self) -> "DataFrame":
        """A row for each reading of each plan: target, accelerometer, alpha_deg, beta_deg, weight."""
        import polars as pl

        numbers = dict.fromkeys(("alpha_deg", "beta_deg", "weight"), pl.Float64)
        rows = [{"target": plan.target, **reading.to_json()} for plan in self for reading in plan.weights]
        return pl.DataFrame(rows, schema={"target": pl.String, "accelerometer": pl.Int64, **numbers})


def plan_targets(
    targets: Sequence[str] = (),
    *,
    grid: float | None = 1.0,
    mounting: Mapping[str, ArrayLike] | str = "identity",
    progress: bool = False,
    **options: Any,
) -> Plans:
    """The optimal plan of each target, with its proof; arguments and options as of `library.plan`.

    An InputError for options that cannot be used, and for a grid that cannot determine a target.
    """
    request = Request(mountings=(mounting,), **options)
    if request.convention not in ("A1", "A2"):
        raise InputError(f"--convention {request.convention}: must be A1 or A2")
    if request.baseline not in ("asymmetric", "symmetric"):
        raise InputError(f"--baseline {request.baseline}: must be asymmetric or symmetric")
    if grid is not None and not isfinite(grid):
        raise InputError(f"--grid {grid}: must be a number of degrees")
    p = parametrise(mountings_of(mounting), symmetric=request.baseline == "symmetric")
    if len(p.mountings) != 1:
        names = ", ".join(p.mountings)
        raise InputError(f"--mounting: holds {len(p.mountings)} mountings ({names}); a plan is for one")
    found = sheets(p, bounds=request.bounds, rule=request.admissible)
    wanted = asked_targets(targets, p) if targets else convention_targets(p, request.convention)
    everywhere = Continuum(found) if grid is None else Grid(found, grid)
    plans = []
    for target in tracked(wanted, "plans", show=progress):
        try:
            best = scaled_optimum(everywhere, target.weights)
        except UndeterminedError:
            where = "the admissible positions" if grid is None else f"the positions of --grid {grid:g}"
            hint = "" if grid is None else "; give a finer grid"
            raise InputError(f"--target {target.symbol}: {where} cannot determine it{hint}") from None
        readings = zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True)
        plans.append(
            Plan(
                target=target.symbol,
                name=target.name,
                unit=target.unit,
                cost=best.cost,
                gap=best.gap,
                lower_bound=best.lower_bound,
                grid_deg=grid,
                admissible=request.admissible,
                bounds=request.bounds,
                baseline=request.baseline,
                mounting={p.mountings[0]: p.matrices[0].tolist()},
                weights=tuple(
                    PlannedReading(accelerometer=int(k) + 1, alpha_deg=a, beta_deg=b, weight=w)
                    for k, a, b, w in readings
                ),
                dual=dict(zip(p.symbols, best.dual.tolist(), strict=True)),
                optimum=best,
                parametrisation=p,
            )
        )
    return Plans(plans=tuple(plans))


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
        extra positions are, or after an interruption
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
    detection : tuple of EffectDistance
        how well the effects that were named show
    task, bound : Task, Bound or None
        what was asked, what is proven; for programs
    duration : float
        time of the programme's moves [s], for programs
    searched : int
        positions of the set without the extra ones, for programs
    """

    omitted = frozenset({"detection"})

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


def plan_positions(count: int, request: Request, *, stored: bool = True, progress: bool = False) -> PositionPlan:
    """One set of positions for all targets, with what is proven of every other set.

    It begins with the plan that the package holds for so many positions, where `stored` says so and it fits. The same
    for the same arguments; the best found where Ctrl-C ended the search. An InputError for options that cannot be used,
    and for so few positions that no set was found.
    """
    if not FEWEST <= count <= MOST_POSITIONS:
        raise InputError(f"--positions {count}: must be between {FEWEST} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")
    effects = named_effects(request.detect)
    task = task_of(request, progress=progress)
    p, size = task.parametrisation, task.weights.shape[1]
    if count < -(-size // 3):
        raise InputError(
            f"--positions {count}: must be at least {-(-size // 3)}, three readings of each for {size} parameters"
        )
    given = starting_positions(task, count) if stored else []
    found, starts, interrupted = search(task, count, given=given, progress=progress)
    if found is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise InputError(
            f"--positions {count}: no set was found that determines every target; give more, or --starts{less}"
        )
    if request.resolution_deg is not None:
        found = rounded(task, found)
        if not (found.determined.all() and allowed(task, found.places.angle).all()):
            where = " outside the keep-outs" if request.keep_out else ""
            raise InputError(f"--resolution {request.resolution_deg:g}: too coarse to determine every target{where}")
    bound, detection = None, ()
    if request.cuts and not interrupted and not (effects and request.extra):
        try:
            with shown_status("lower bound", show=progress):
                bound = bound_positions(task, pool_of(task, found.places), count, found.worst)
        except KeyboardInterrupt:
            interrupted = True
    if effects:
        places, detection = detecting(task, found.places, effects)
        found = costs(task, places)
    commands = unwound(found.places.angle, task.keep_out)
    rows, duration = measuring_order(found.places, commands, request)
    order = list(dict.fromkeys(rows.tolist()))
    number = {row: place for place, row in enumerate(order, start=1)}
    mounting = found.places.mounting if len(p.mountings) > 1 else None
    symbols = [target.symbol for target in task.targets]
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
        costs=dict(zip(symbols, (found.ratio * task.best).tolist(), strict=True)),
        optima=dict(zip(symbols, task.best.tolist(), strict=True)),
        readings=len(found.readings.position),
        **{name: getattr(request, name) for name in ASKED},
        starts=starts,
        interrupted=interrupted,
        mountings={name: matrix.tolist() for name, matrix in zip(p.mountings, p.matrices, strict=True)},
        detection=detection,
        task=task,
        bound=bound,
        duration=duration,
        searched=count,
    )


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
