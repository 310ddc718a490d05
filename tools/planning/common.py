"""One set of positions for all targets, the order in which it is measured, and what any number of positions costs.

Positions are measured at random against drift, or on the shortest tour.
"""

import csv
from collections.abc import Iterator, Sequence
from importlib import resources
from itertools import product
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.table_commands import move_duration
from ..calibration.result import Number
from ..errors import InputError
from ..progress import shown_status
from ..result import Result
from .check import EffectDistance, detecting, named_effects
from .plan import Degrees
from .positions import TURN, Costs, Places, Request, Task, allowed, costs, pool_of, task_of
from .search import Bound, bound_positions, drawn, merit, search
from .unlisted import UnlistedSize, against_unlisted, sizes_of

if TYPE_CHECKING:
    from polars import DataFrame

FEWEST, MOST_POSITIONS = 5, 60
"""Fewest of a symmetric block, with fifteen parameters."""
SWEEPS = 6
EXACT = 10
"""Tours of so many positions are found exactly, by dynamic programming; longer ones by exchanges from every start."""
TABLE_RATE, TABLE_ACCELERATION = 1.0, 1.0
"""Limits [rad/s], [rad/s²] of both axes by which tours are timed."""
DWELL_S = 20.0
"""Time at each position, where none is given."""
SAME_PLACE = np.radians(0.02)
"""Positions as near as this [rad] make one rest where one follows the other: the table hardly moves between them."""


ASKED = ("criterion", "reserve_deg", "resolution_deg", "keep_out", "order", "seed")
ASKED += ("admissible", "bounds", "convention", "baseline")
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

    omitted = frozenset({"detection", "unlisted"})

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


def plan_positions(count: int, request: Request, *, stored: bool = True, progress: bool = False) -> PositionPlan:
    """One set of positions for all targets, with what is proven of every other set.

    It begins with the plan that the package holds for so many positions, where `stored` says so and it fits. The same
    for the same arguments; the best found where Ctrl-C ended the search. An InputError for options that cannot be used,
    and for so few positions that no set was found.
    """
    fewest = 1 if request.targets else FEWEST
    if not fewest <= count <= MOST_POSITIONS:
        raise InputError(f"--positions {count}: must be between {fewest} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")
    effects = named_effects(request.detect)
    task = task_of(request, progress=progress)
    p, size = task.parametrisation, task.weights.shape[1]
    if count < -(-size // 3) and not request.targets:
        raise InputError(
            f"--positions {count}: must be at least {-(-size // 3)}, three readings of each for {size} parameters"
        )
    given = starting_positions(task, count) if stored else []
    if request.against_unlisted:
        places, starts, interrupted = against_unlisted(task, count, given, progress=progress)
        found = costs(task, places)
        found = found if found.determined.all() else None
    else:
        found, starts, interrupted = search(task, count, given=given, progress=progress)
    if found is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise InputError(
            f"--positions {count}: no set was found that determines every target; give more, or --starts{less}"
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
        unlisted=sizes_of(task, found.places) if request.against_unlisted else (),
        task=task,
        bound=bound,
        duration=duration,
        searched=count,
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
    for row in range(len(found.places)):
        low = np.floor(np.degrees(best.places.angle[row]) / step_deg)
        best = best_of(best, row, [low + shift for shift in product((0, 1), repeat=2)])
    for _ in range(SWEEPS):
        before = merit(task, best)
        for row in range(len(found.places)):
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


def measuring_order(places: Places, commands: NDArray, request: Request) -> tuple[NDArray, float]:
    """The rows of the set in the order of measurement, one mounting after the other, and the time of the moves [s].

    Tour or random order, its seed, and how many positions are measured twice are of the request; the commands (N, 2)
    are the angles of the places [rad].
    """
    rng = np.random.default_rng(request.seed)
    whole, duration = [], 0.0
    for mounting in np.unique(places.mounting):
        rows = np.flatnonzero(places.mounting == mounting)
        times = move_times(commands[rows])
        order = shortest_tour(times) if request.order == "tour" else rng.permutation(len(rows))
        share = round(request.repeat * len(rows) / len(places))
        order = apart(repeated(order, share), commands[rows])
        duration += tour_duration(times, order)
        whole.append(rows[order])
    return np.concatenate(whole), duration


def checked_dwell(dwell_s: float) -> float:
    """The time at each position [s], or an InputError for one that is not positive."""
    if not (np.isfinite(dwell_s) and dwell_s > 0.0):
        raise InputError(f"--dwell {dwell_s:g}: must be a positive number of seconds")
    return dwell_s


def unwound(angle: NDArray, keep_out: Sequence[Sequence[tuple[float, float]]] = ((), ())) -> NDArray:
    """Angles (N, 2) [rad] as commands within one turn of each axis, cut where no position lies.

    The cut is in the axis's widest keep-out, which no move then crosses, or else in the widest gap between positions.
    The turn is the one about zero that leaves the commands as small as possible.
    """
    commands = np.mod(angle, TURN)
    for axis in (0, 1):
        own = np.sort(commands[:, axis])
        gaps = np.append(np.diff(own), own[0] + TURN - own[-1])
        widest = int(gaps.argmax())
        cut = own[widest] + 0.5 * gaps[widest]
        if keep_out[axis]:
            low, high = max(keep_out[axis], key=lambda interval: interval[1] - interval[0])
            cut = 0.5 * (low + high)
        start = cut + 1e-12
        turned = start + np.mod(commands[:, axis] - start, TURN)
        turned -= TURN * np.round(0.5 * (turned.max() + turned.min()) / (TURN))
        commands[:, axis] = turned
    return commands


def move_times(commands: NDArray) -> NDArray:
    """Times [s] of all moves: (N + 1, N), the first row from (0, 0); both axes move at once."""
    starts = np.vstack([np.zeros((1, 2)), commands])
    way = np.abs(starts[:, None] - commands[None]).max(axis=2)
    return np.vectorize(lambda distance: move_duration(float(distance), TABLE_RATE, TABLE_ACCELERATION))(way)


def tour_duration(times: NDArray, order: NDArray) -> float:
    """Time [s] of the moves of a programme that begins at (0, 0)."""
    before = np.concatenate([[0], order[:-1] + 1])
    return float(times[before, order].sum())


def shortest_tour(times: NDArray) -> NDArray:
    """The order (N,) with the least time of all moves from (0, 0) on, not back."""
    count = times.shape[1]
    if count <= EXACT:
        return _exact(times)
    tours = []
    for first in range(count):
        order, left = [first], set(range(count)) - {first}
        while left:
            order.append(min(left, key=lambda k, last=order[-1]: (times[last + 1, k], k)))
            left.remove(order[-1])
        tours.append(_exchanged(times, np.array(order)))
    return min(tours, key=lambda order: (round(tour_duration(times, order), 9), order.tolist()))


def _exact(times: NDArray) -> NDArray:
    """Held and Karp's recursion over sets of positions."""
    count = times.shape[1]
    best = np.full((1 << count, count), np.inf)
    came = np.zeros((1 << count, count), dtype=int)
    for last in range(count):
        best[1 << last, last] = times[0, last]
    for members in range(1, 1 << count):
        inside = [k for k in range(count) if members >> k & 1]
        for new in range(count):
            if members >> new & 1:
                continue
            ways = best[members, inside] + times[np.array(inside) + 1, new]
            k = int(ways.argmin())
            if ways[k] < best[members | 1 << new, new]:
                best[members | 1 << new, new] = ways[k]
                came[members | 1 << new, new] = inside[k]
    members, last = (1 << count) - 1, int(best[-1].argmin())
    order = [last]
    while members != 1 << last:
        members, last = members ^ 1 << last, int(came[members, last])
        order.append(last)
    return np.array(order[::-1])


def _exchanged(times: NDArray, order: NDArray) -> NDArray:
    """Reverse parts of a tour, and move short parts, while that shortens it."""
    best, count = tour_duration(times, order), len(order)
    improved = True
    while improved:
        improved = False
        for i in range(count):
            for j in range(i + 1, count + 1):
                reversed_part = np.concatenate([order[:i], order[i:j][::-1], order[j:]])
                trials = [reversed_part]
                if j - i <= 3:
                    rest, part = np.concatenate([order[:i], order[j:]]), order[i:j]
                    trials += [np.concatenate([rest[:k], part, rest[k:]]) for k in range(len(rest) + 1) if k != i]
                for trial in trials:
                    duration = tour_duration(times, trial)
                    if duration < best - 1e-9:
                        order, best, improved = trial, duration, True
    return order


def repeated(order: NDArray, count: int) -> NDArray:
    """The order with `count` of its positions measured again, spread over it, half the programme after the first time.

    Half a programme apart, the two readings of a position tell drift and repeatability as well as any can.
    """
    if not count:
        return order
    size = len(order)
    chosen = np.unique(np.linspace(0, size - 1, count).round().astype(int))
    after: dict[int, list[int]] = {}
    for row in chosen:
        after.setdefault((int(row) + size // 2) % size, []).append(int(order[row]))
    programme: list[int] = []
    for row, position in enumerate(order):
        programme.append(int(position))
        programme += after.get(row, [])
    return np.array(programme)


def apart(order: NDArray, commands: NDArray) -> NDArray:
    """The order with no position right after one in the same place, where others can come between.

    A position that a plan has twice, for its weight, would make one long rest. The second one goes to where the first
    is half a programme away, or as near to that as it can. The order (M,) holds rows of the commands (N, 2) [rad].
    """
    programme = [int(row) for row in order]

    def same(a: int, b: int) -> bool:
        return bool(np.abs(commands[a] - commands[b]).max() < SAME_PLACE)

    def places_for(row: int) -> list[int]:
        around = (programme[max(k - 1, 0) : k + 1] for k in range(len(programme) + 1))
        return [k for k, neighbours in enumerate(around) if not any(same(row, other) for other in neighbours)]

    half = len(order) // 2
    for _ in order:
        twice = [at for at in range(1, len(programme)) if same(programme[at - 1], programme[at])]
        if not twice:
            break
        row = programme.pop(twice[0])
        free = places_for(row) or [twice[0]]
        wanted = (twice[0] + half) % len(order)
        programme.insert(min(free, key=lambda k, wanted=wanted: (abs(k - wanted), k)), row)
    return np.array(programme, dtype=int)
