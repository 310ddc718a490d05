"""One set of N positions for all targets: the function behind `trihedron plan --positions`."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..progress import shown_status
from ..shown import Shown
from .detection import Detection, detecting, named_effects
from .measuring_order import apart, move_times, repeated, shortest_tour, tour_duration, unwound
from .places import Places, Task, allowed
from .plan import SCHEMA
from .pool import pool_of
from .position_bound import Bound, HittingSet, bound_positions
from .position_costs import Costs, costs
from .position_search import search
from .request import Request, requested_task, stored_positions
from .rounding import rounded

if TYPE_CHECKING:
    from polars import DataFrame

FEWEST, MOST_POSITIONS = 5, 60
"""Fewest of a symmetric block, with fifteen parameters."""
TABLE_RATE, TABLE_ACCELERATION = 1.0, 1.0
"""Limits [rad/s], [rad/s²] of both axes by which tours are timed."""


@dataclass(frozen=True, repr=False)
class CommonPlan(Shown):
    """A common set of positions and in which order they are measured.

    Attributes
    ----------
    request : Request
    task : Task
    found : Costs
        of the whole set, extra positions included
    commands : (N, 2) array
        angles of the set as commands to the table [rad]
    programme : (R,) array of int
        the set's positions in the order of measurement, some of them twice
    duration : float
        time of the programme's moves [s]
    bound : Bound or None
        what is proven; None where it is not asked for, where extra positions are, or after an interruption
    detection : Detection or None
    starts : int
        local improvements that were made
    interrupted : bool
        whether Ctrl-C ended search or bound
    searched : int
        positions of the set without the extra ones, which stand after them
    """

    request: Request
    task: Task
    found: Costs
    commands: NDArray
    programme: NDArray
    duration: float
    bound: Bound | None
    detection: Detection | None
    starts: int
    interrupted: bool
    searched: int

    @property
    def mountings(self) -> tuple[str, ...]:
        """Names of the mountings."""
        return self.task.parametrisation.mountings

    def position(self, row: int) -> dict[str, Any]:
        """A position of the set as it stands in a file: degrees, and the mounting where there are several."""
        alpha, beta = (_plain(float(x)) for x in np.round(np.degrees(self.commands[row]), 9))
        one: dict[str, Any] = {"alpha_deg": alpha, "beta_deg": beta}
        if len(self.mountings) > 1:
            one["mounting"] = self.mountings[int(self.found.places.mounting[row])]
        return one

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.plan/1, of plain lists, strings and numbers."""
        request, p = self.request, self.task.parametrisation
        symbols = [target.symbol for target in self.task.targets]
        order = list(dict.fromkeys(self.programme.tolist()))
        place = {row: number for number, row in enumerate(order, start=1)}
        content: dict[str, Any] = {
            "schema": SCHEMA,
            "positions": [self.position(row) for row in order],
            "programme": [place[int(row)] for row in self.programme],
            "worst_ratio": self.found.worst,
            "mean_ratio": self.found.mean,
            "lower_bound": None if self.bound is None else self.bound.ratio,
            "lower_bound_on": None if self.bound is None else self.bound.on,
            "costs": dict(zip(symbols, (self.found.ratio * self.task.best).tolist(), strict=True)),
            "optima": dict(zip(symbols, self.task.best.tolist(), strict=True)),
            "readings": len(self.found.readings.position),
            "criterion": request.criterion,
            "reserve_deg": request.reserve_deg,
            "resolution_deg": request.resolution_deg,
            "keep_out": list(request.keep_out),
            "order": request.order,
            "seed": request.seed,
            "starts": self.starts,
            "interrupted": self.interrupted,
            "admissible": request.admissible,
            "bounds": list(request.bounds),
            "convention": request.convention,
            "baseline": request.baseline,
            "mountings": {name: matrix.tolist() for name, matrix in zip(p.mountings, p.matrices, strict=True)},
        }
        if self.detection is not None:
            found = self.detection
            content["detection"] = [
                {
                    "effect": e.title,
                    "distance_before": float(b),
                    "distance_after": float(a),
                    "distance_at_most": float(m),
                }
                for e, b, a, m in zip(found.effects, found.before, found.after, found.most, strict=True)
            ]
        return content

    def json_text(self) -> str:
        """The plan as a JSON file."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def lines(self) -> list[str]:
        """Positions in the order of measurement, costs, what is proven."""
        from .common_summary import plan_summary

        shown: Any = self
        return plan_summary(shown).split("\n")

    def to_polars(self) -> "DataFrame":
        """The programme, a row for each visit: order, alpha_deg, beta_deg and, of several mountings, mounting."""
        import polars as pl

        rows = [{"order": k, **self.position(int(row))} for k, row in enumerate(self.programme, start=1)]
        return pl.DataFrame(rows, schema_overrides={"alpha_deg": pl.Float64, "beta_deg": pl.Float64})


def plan_positions(count: int, request: Request, *, stored: bool = True, progress: bool = False) -> CommonPlan:
    """One set of positions for all targets, with what is proven of every other set.

    Parameters
    ----------
    count : int
        N
    request : Request
        criterion: the worst or the mean ratio of costs to the targets' own optima is made small. reserve_deg: readings
        still count when positions are set with an error up to that. resolution_deg: of the table. keep_out: angles that
        are not used, "alpha:LOW:HIGH" in degrees. order: "tour" or "random". repeat: so many positions are measured
        twice. detect: effects that the extra positions show. seed, starts, cuts: of the search and of the bound
    stored : bool
        begin with the plan that the package holds for so many positions, where it fits
    progress : bool
        show bars on a terminal

    Returns
    -------
    CommonPlan
        the same for the same arguments; the best found where Ctrl-C ended the search

    Raises
    ------
    InputError
        for options that cannot be used, and for so few positions that no set was found
    """
    if not FEWEST <= count <= MOST_POSITIONS:
        raise InputError(f"--positions {count}: must be between {FEWEST} and {MOST_POSITIONS}")
    if not 0 <= request.repeat <= count:
        raise InputError(f"--repeat {request.repeat}: must be between 0 and the number of positions")
    effects = named_effects(request.detect)
    task = requested_task(request, progress=progress)
    fewest = -(-task.regressor.shape[1] // 3)
    if count < fewest:
        raise InputError(
            f"--positions {count}: must be at least {fewest}, three readings of each for {task.regressor.shape[1]} "
            "parameters"
        )
    given = starting_positions(task, count) if stored else []
    result = search(
        task,
        count,
        criterion=request.criterion,
        seed=request.seed,
        starts=request.starts,
        given=given,
        progress=progress,
    )
    if result is None:
        less = ", or leave more angles by --keep-out" if request.keep_out else ""
        raise InputError(
            f"--positions {count}: no set was found that determines every target; give more, or --starts{less}"
        )
    found, detection = result.best, None
    if request.resolution_deg is not None:
        found = rounded(task, found, request.resolution_deg, request.criterion)
        if not (found.determined.all() and allowed(task, found.places.angle).all()):
            where = " outside the keep-outs" if request.keep_out else ""
            raise InputError(f"--resolution {request.resolution_deg:g}: too coarse to determine every target{where}")
    bound, interrupted = None, result.interrupted
    if request.cuts and not interrupted and not (effects and request.extra):
        try:
            with shown_status("lower bound", show=progress):
                hitting = HittingSet(task, pool_of(task, found.places), request.seed)
                bound = bound_positions(hitting, count, found.worst, request.cuts)
        except KeyboardInterrupt:
            interrupted = True
    if effects:
        places, detection = detecting(task, found.places, effects, request.extra)
        found = costs(task, places)
    commands = unwound(found.places.angle, task.keep_out)
    programme, duration = _programme(found.places, commands, request)
    return CommonPlan(
        request, task, found, commands, programme, duration, bound, detection, result.starts, interrupted, count
    )


def starting_positions(task: Task, count: int) -> list[Places]:
    """The set of so many positions that the package holds, where it is for this mounting and in no keep-out."""
    p = task.parametrisation
    places = stored_positions(count)
    if places is None or len(p.mountings) != 1 or not np.array_equal(p.matrices[0], np.eye(3)):
        return []
    return [places] if allowed(task, places.angle).all() else []


def _programme(places: Places, commands: NDArray, request: Request) -> tuple[NDArray, float]:
    """The order of measurement, one mounting after the other, and the time of its moves [s]."""
    rng = np.random.default_rng(request.seed)
    whole, duration = [], 0.0
    for mounting in np.unique(places.mounting):
        rows = np.flatnonzero(places.mounting == mounting)
        times = move_times(commands[rows], TABLE_RATE, TABLE_ACCELERATION)
        order = shortest_tour(times) if request.order == "tour" else rng.permutation(len(rows))
        share = round(request.repeat * len(rows) / len(places))
        order = apart(repeated(order, share), commands[rows])
        duration += tour_duration(times, order)
        whole.append(rows[order])
    return np.concatenate(whole), duration


def _plain(value: float) -> float | int:
    """A whole number without its decimal point, zero without its sign."""
    return int(value) if value.is_integer() else value
