"""The optimal plan of each target: the function behind `trihedron plan --target`."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..calibration.model import Parametrisation, parametrise
from ..calibration.mountings import mountings_of
from ..calibration.targets import Target, asked_targets, convention_targets
from ..errors import InputError
from ..progress import tracked
from ..shown import Shown
from .continuum import Continuum
from .forms import DEFAULT_BOUNDS, sheets
from .grids import Grid
from .optimum import Optimum, UndeterminedError

if TYPE_CHECKING:
    from polars import DataFrame

SCHEMA = "trihedron.plan/1"
UNCERTAIN = 1e-8
"""A relative gap above this is said in words."""


@dataclass(frozen=True)
class Plan:
    """The readings that estimate one target with the least guaranteed error.

    Attributes
    ----------
    target : Target
    optimum : Optimum
        positions, weights, cost, dual and proven gap
    grid_deg : float or None
        step of the grid [deg]; None for the continuum
    admissible : {"paper", "tables"}
    bounds : (float, float)
        u^max [rad], v^0max
    parametrisation : Parametrisation
        the baseline's parameters and the mounting
    """

    target: Target
    optimum: Optimum
    grid_deg: float | None
    admissible: str
    bounds: tuple[float, float]
    parametrisation: Parametrisation

    @property
    def mounting(self) -> tuple[str, NDArray]:
        """Name and matrix (3, 3) of the mounting."""
        return self.parametrisation.mountings[0], self.parametrisation.matrices[0]

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.plan/1, of plain lists, strings and numbers."""
        best, (name, matrix) = self.optimum, self.mounting
        rows = zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True)
        return {
            "schema": SCHEMA,
            "target": self.target.symbol,
            "name": self.target.name,
            "unit": self.target.unit,
            "cost": best.cost,
            "gap": best.gap,
            "lower_bound": best.lower_bound,
            "grid_deg": None if self.grid_deg is None else _number(self.grid_deg),
            "admissible": self.admissible,
            "bounds": list(self.bounds),
            "baseline": "symmetric" if self.parametrisation.symmetric else "asymmetric",
            "mounting": {name: matrix.tolist()},
            "weights": [
                {"accelerometer": int(p) + 1, "alpha_deg": _number(a), "beta_deg": _number(b), "weight": float(w)}
                for p, a, b, w in rows
            ],
            "dual": dict(zip(self.parametrisation.symbols, map(float, best.dual), strict=True)),
        }


@dataclass(frozen=True, repr=False)
class Plans(Shown):
    """The optimal plans of several targets, one after the other."""

    plans: tuple[Plan, ...]

    def __iter__(self) -> Iterator[Plan]:
        return iter(self.plans)

    def __len__(self) -> int:
        return len(self.plans)

    def __getitem__(self, index: int) -> Plan:
        return self.plans[index]

    def json_text(self) -> str:
        """The object, or the objects, of schema trihedron.plan/1."""
        return json_text(self.plans)

    def lines(self) -> list[str]:
        """Positions and weights of one plan, or a line for each of several."""
        return plan_summary(self.plans).split("\n")

    def to_polars(self) -> "DataFrame":
        """A row for each reading of each plan: target, accelerometer, alpha_deg, beta_deg, weight."""
        import polars as pl

        numbers = dict.fromkeys(("alpha_deg", "beta_deg", "weight"), pl.Float64)
        rows = [{"target": plan.target.symbol, **reading} for plan in self for reading in plan.to_json()["weights"]]
        return pl.DataFrame(rows, schema={"target": pl.String, "accelerometer": pl.Int64, **numbers})


def json_text(plans: Sequence[Plan]) -> str:
    """One plan as its object; several as `{"schema": ..., "plans": [...]}`."""
    content = [plan.to_json() for plan in plans]
    whole = content[0] if len(content) == 1 else {"schema": SCHEMA, "plans": content}
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def plan_targets(
    targets: Sequence[str] = (),
    *,
    grid: float | None = 1.0,
    admissible: str = "paper",
    bounds: tuple[float, float] = DEFAULT_BOUNDS,
    convention: str = "A1",
    baseline: str = "asymmetric",
    mounting: Mapping[str, ArrayLike] | str = "identity",
    progress: bool = False,
) -> list[Plan]:
    """The optimal plan of each target, with its proof.

    Parameters
    ----------
    targets : sequence of str
        linear combinations of X1..X18, as "X4-X5"; all targets of the convention when none is given
    grid : float or None
        step of the grid [deg] over [0, 360] × [0, 360]; None for all angles
    admissible : {"paper", "tables"}
        (1.7) as printed; with the bias rows, as the published tables
    bounds : (float, float)
        u^max [rad] and v^0max of (1.7)
    convention : {"A1", "A2"}
        which targets when none is given
    baseline : {"asymmetric", "symmetric"}
        two scale factors for each accelerometer, or one; with one every position is admissible
    mounting : str or mapping of str to (3, 3) array
        a preset, a TOML file with one mounting, or Q by name
    progress : bool
        show a bar on a terminal

    Returns
    -------
    list of Plan

    Raises
    ------
    InputError
        for options that cannot be used, and for a grid that cannot determine a target
    """
    if convention not in ("A1", "A2"):
        raise InputError(f"--convention {convention}: must be A1 or A2")
    if baseline not in ("asymmetric", "symmetric"):
        raise InputError(f"--baseline {baseline}: must be asymmetric or symmetric")
    if grid is not None and not isfinite(grid):
        raise InputError(f"--grid {grid}: must be a number of degrees")
    p = parametrise(mountings_of(mounting), symmetric=baseline == "symmetric")
    found = sheets(p, bounds=bounds, rule=admissible)
    wanted = asked_targets(targets, p) if targets else convention_targets(p, convention)
    search = Continuum(found) if grid is None else Grid(found, grid)
    plans = []
    for target in tracked(wanted, "plans", show=progress):
        size = float(np.abs(target.weights).max())
        try:
            best = search.optimum(target.weights / size).times(size)
        except UndeterminedError:
            where = "the admissible positions" if grid is None else f"the positions of --grid {grid:g}"
            hint = "" if grid is None else "; give a finer grid"
            raise InputError(f"--target {target.symbol}: {where} cannot determine it{hint}") from None
        plans.append(Plan(target, best, grid, admissible, bounds, p))
    return plans


def _number(value: float) -> float | int:
    """A whole number without its decimal point."""
    return int(value) if float(value).is_integer() else float(value)


def plan_summary(plans: Sequence[Plan]) -> str:
    """What a person reads: positions and weights of one plan, or a line for each of several."""
    first = plans[0]
    where = "all angles" if first.grid_deg is None else f"a grid of {first.grid_deg:g}°"
    baseline = (
        "every position"
        if first.parametrisation.symmetric
        else (
            f"signs certain by (1.7){' with the bias rows' if first.admissible == 'tables' else ''}, "
            f"u = {first.bounds[0]:g}, v = {first.bounds[1]:g}"
        )
    )
    lines = [f"optimal among {where}; {baseline}; mounting {first.mounting[0]}", ""]
    if len(plans) > 1:
        lines.append(f"{'target':<12} {'name':<34} {'cost [σ]':>14} {'gap':>8} {'readings':>9}")
        for plan in plans:
            best = plan.optimum
            lines.append(
                f"{plan.target.symbol:<12} {plan.target.name:<34} {best.cost:>14.10f} {best.gap:>8.0e} "
                f"{len(best.weights):>9}"
            )
    else:
        best = first.optimum
        lines.append(f"{'accelerometer':>13} {'alpha [deg]':>14} {'beta [deg]':>14} {'weight':>12}")
        for p, a, b, w in zip(best.accelerometer, best.alpha_deg, best.beta_deg, best.weights, strict=True):
            lines.append(f"{p + 1:>13} {a:>14.8g} {b:>14.8g} {w:>+12.6f}")
        lines += [
            "",
            f"{first.target.symbol} ({first.target.name}): guaranteed error {best.cost:.10f} σ; "
            f"no plan has less than {best.lower_bound:.10f} σ (gap {best.gap:.0e})",
        ]
    lines += [
        f"warning: {plan.target.symbol}: the optimum is proven to {plan.optimum.gap:.1e} only"
        for plan in plans
        if plan.optimum.gap > UNCERTAIN
    ]
    return "\n".join(lines)
