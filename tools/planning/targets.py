"""The readings that estimate one target best, with the proof: on a grid of any step, or over all angles."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Field

from ..calibration.model import Parametrisation, mountings_of, parametrise
from ..calibration.targets import Target, asked_targets, convention_targets
from ..errors import InputError
from ..fields import Axis, Number, Size
from ..progress import tracked
from ..result import Result
from .certificate import ColumnProgramme, Optimum, UndeterminedError, scaled_optimum, settled_optimum
from .continuum import Continuum
from .forms import FineGrid, SignSheet, WholeGrid, clearance, dual_forms, regressors_at, sheets
from .request import Request

if TYPE_CHECKING:
    from polars import DataFrame

FIRST_LINES = 12
"""Rows and columns of the coarse grid with which the search begins."""
BEST_ROWS = 20
WHOLE = 480
"""Largest number of lines of a grid that is priced whole."""
FINEST_DEG = 0.01


def _plain(angle: float) -> int | float:
    return int(angle) if float(angle).is_integer() else angle


Degrees = Annotated[Number, AfterValidator(_plain)]
"""Whole numbers without a decimal point, zero without its sign."""
Cost = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class PositionGrid:
    """A grid over [0°, 360°] × [0°, 360°] and its columns so far, shared by all targets.

    Positions that coincide (0° and 360°) count once. A coarse grid is priced whole. A fine one is never listed: every
    n-th line gives the first columns. A row is then examined only if its greatest |F'y| over β, known exactly, exceeds
    one. Raises InputError for a step that is not between 0.01 and 180 degrees.
    """

    def __init__(self, sheets: Sequence[SignSheet], step_deg: float):
        if not FINEST_DEG <= step_deg <= 180.0:
            raise InputError(f"--grid {step_deg:g}: the step must be between {FINEST_DEG:g} and 180 degrees")
        count = int(360.0 / step_deg + 1e-9) + 1
        degrees = np.arange(count) * step_deg
        self._degrees = degrees[degrees < 360.0 - 1e-9 * step_deg]
        self._angle = np.radians(self._degrees)
        self._sheets = sheets
        self._columns = ColumnProgramme(sheets[0].regressor.shape[0])
        self._at = np.zeros((0, 3), dtype=int)
        lines = np.arange(0, len(self._angle), -(-len(self._angle) // WHOLE))
        self._coarse = WholeGrid(sheets, self._angle, lines)
        self._fine = FineGrid(sheets, self._angle) if len(lines) < len(self._angle) else None
        first = lines[np.unique(np.linspace(len(lines) // 90, len(lines) - 1, FIRST_LINES).astype(int))]
        i, j = np.repeat(first, len(first)), np.tile(first, len(first))
        for k, sheet in enumerate(sheets):
            inside = clearance(sheet, self._angle[i], self._angle[j]) > 0.0
            self._add(np.column_stack([np.full(inside.sum(), k), i[inside], j[inside]]))

    def _add(self, places: NDArray) -> None:
        if len(places):
            sheet, i, j = places.T
            self._columns.add(regressors_at(self._sheets, sheet, self._angle[i], self._angle[j]))
            self._at = np.vstack([self._at, places])

    def ceiling(self, dual: NDArray) -> float:
        """Return a bound of |F'y| on the grid, rounding included."""
        forms = dual_forms(self._sheets, dual)
        if self._fine is None:
            return self._coarse.price(forms)[0]
        return self._fine.price(forms, None)[0]

    def _price(self, dual: NDArray) -> tuple[float, NDArray]:
        """Price like `WholeGrid.price`: the coarser lines and the best rows first, the whole grid if they are all
        below one."""
        forms = dual_forms(self._sheets, dual)
        bound, places = self._coarse.price(forms)
        if self._fine is not None and not len(places):
            bound, places = self._fine.price(forms, BEST_ROWS)
            if not len(places):
                bound, places = self._fine.price(forms, None)
        return bound, places

    def optimum(self, target: NDArray) -> Optimum:
        """Return the plan of least cost for a target a (P,), with the dual that proves it.

        Raises UndeterminedError if the grid's positions cannot determine the target.
        """
        self._columns.aim(target)
        weights, dual, possible = self._columns.solve()
        bound, places = self._price(dual)
        while len(places):
            self._add(places)
            weights, dual, possible = self._columns.solve()
            bound, places = self._price(dual)
        if not possible:
            raise UndeterminedError
        used = np.flatnonzero(weights)
        sheet, i, j = self._at[used].T
        accelerometer = np.array([self._sheets[k].accelerometer for k in sheet])
        at = accelerometer, self._angle[i], self._angle[j], self._degrees[i], self._degrees[j]
        return settled_optimum(target, dual, bound, self._columns.regressors[used], weights[used], at)


class PlannedReading(Result):
    """A reading of a plan: the accelerometer, from 1, the angles of the table [deg], and its weight Φ."""

    accelerometer: Axis
    alpha_deg: Degrees
    beta_deg: Degrees
    weight: Number


class Plan(Result):
    """The readings that estimate one target with the least guaranteed error.

    Attributes
    ----------
    target, name, unit : str
        symbol, physical name, unit
    cost : float
        the guaranteed error [σ]
    gap : float
        relative gap to the lower bound
    lower_bound : float
        no plan costs less [σ]
    grid_deg : number or None
        step of the grid [deg]; None for the continuum
    admissible : {"paper", "tables"}
        rule of the admissible set
    bounds : (float, float)
        u^max [rad], v^0max
    baseline : {"asymmetric", "symmetric"}
        model of the scale factors
    mounting : dict
        Q (3, 3) by its name
    weights : tuple of PlannedReading
        readings with their weights
    dual : dict
        y, which proves the lower bound, by parameter
    optimum : Optimum
        the same as arrays; in Python only
    parametrisation : Parametrisation
        the baseline's parameters and the mounting; in Python only
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
    """The optimal plans of several targets, one after the other; the JSON of one plan is the plan itself."""

    schema_: Literal["trihedron.plan/1"] = Field(default="trihedron.plan/1", alias="schema")
    plans: Annotated[tuple[Plan, ...], Field(min_length=1)]

    def __iter__(self) -> Iterator[Plan]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return iter(self.plans)

    def __len__(self) -> int:
        return len(self.plans)

    def __getitem__(self, index: int) -> Plan:
        return self.plans[index]

    def to_json(self) -> dict[str, Any]:
        """Return the object, or the objects, of schema trihedron.plan/1."""
        return self.plans[0].to_json() if len(self.plans) == 1 else super().to_json()

    def to_polars(self) -> "DataFrame":
        """Return a row for each reading of each plan: target, accelerometer, alpha_deg, beta_deg, weight."""
        import polars as pl

        numbers = dict.fromkeys(("alpha_deg", "beta_deg", "weight"), pl.Float64)
        rows = [{"target": plan.target, **reading.to_json()} for plan in self for reading in plan.weights]
        return pl.DataFrame(rows, schema={"target": pl.String, "accelerometer": pl.Int64, **numbers})


def optimal_plans(
    targets: Sequence[str] = (),
    *,
    grid: float | None = 1.0,
    mounting: Mapping[str, ArrayLike] | str = "identity",
    progress: bool = False,
    **options: Any,
) -> Plans:
    """Return the optimal plan of each target, with its proof; arguments and options are those of `library.plan`.

    Raises InputError for invalid options, and for a grid that cannot determine a target.
    """
    request = Request(mountings=(mounting,), **options)
    if grid is not None and not isfinite(grid):
        raise InputError(f"--grid {grid}: must be a number of degrees")
    p = parametrise(mountings_of(mounting), symmetric=request.baseline == "symmetric")
    if len(p.mountings) != 1:
        names = ", ".join(p.mountings)
        raise InputError(f"--mounting: holds {len(p.mountings)} mountings ({names}); a plan is for one")
    block = sheets(p, bounds=request.bounds, rule=request.admissible)
    estimated = asked_targets(targets, p) if targets else convention_targets(p, request.convention)
    positions = Continuum(block) if grid is None else PositionGrid(block, grid)
    plans = []
    for target in tracked(estimated, "plans", show=progress):
        try:
            optimum = scaled_optimum(positions.optimum, target.weights)
        except UndeterminedError:
            where, hint = "the admissible positions", ""
            if grid is not None:
                where, hint = f"the positions of --grid {grid:g}", "; give a finer grid"
            raise InputError(f"{target.symbol}: {where} cannot determine it{hint}") from None
        plans.append(_plan_of(target, optimum, request, p, grid))
    return Plans(plans=tuple(plans))


def _plan_of(target: Target, optimum: Optimum, request: Request, p: Parametrisation, grid: float | None) -> Plan:
    readings = []
    for k, accelerometer in enumerate(optimum.accelerometer):
        alpha, beta, weight = optimum.alpha_deg[k], optimum.beta_deg[k], optimum.weights[k]
        readings.append(
            PlannedReading(accelerometer=int(accelerometer) + 1, alpha_deg=alpha, beta_deg=beta, weight=weight)
        )
    return Plan(
        target=target.symbol,
        name=target.name,
        unit=target.unit,
        cost=optimum.cost,
        gap=optimum.gap,
        lower_bound=optimum.lower_bound,
        grid_deg=grid,
        admissible=request.admissible,
        bounds=request.bounds,
        baseline=request.baseline,
        mounting={p.mountings[0]: p.matrices[0].tolist()},
        weights=tuple(readings),
        dual=dict(zip(p.symbols, optimum.dual.tolist(), strict=True)),
        optimum=optimum,
        parametrisation=p,
    )
