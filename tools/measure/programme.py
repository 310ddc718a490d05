"""The positions to measure, their order, and the guaranteed errors that they promise."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ..errors import InputError
from ..files import LARGEST_RESULT, bytes_of
from ..orchestrator.stimuli import read_number_table
from ..planning import PositionPlan, Request, task_of
from ..planning.task import NOT_DETERMINED, Places, costs
from ..records.columns import ANGLES, LIMITS
from ..result import field_problems

SAME_DEG = 1.0
"""Largest distance of a rest from a position of the plan that it visits [deg]."""


@dataclass(frozen=True)
class TableSetting:
    """A position to set the table to: number and angles [deg]."""

    number: int
    alpha_deg: float
    beta_deg: float

    def distance(self, alpha_deg: float, beta_deg: float) -> float:
        """Return the larger of the distances of the two angles [deg], modulo whole turns."""
        return max(_turn(self.alpha_deg - alpha_deg), _turn(self.beta_deg - beta_deg))


def _turn(difference: float) -> float:
    """Return the size of a difference of angles [deg] without whole turns."""
    return abs((difference + 180.0) % 360.0 - 180.0)


@dataclass(frozen=True)
class TableProgramme:
    """Positions in the order of measurement, their model, and the promised errors.

    Attributes
    ----------
    settings : tuple of Setting
        the positions
    promised : dict
        guaranteed error of each target [σ] if every position is measured as planned
    baseline, convention : str
        model of the scale factors, convention of the targets
    bounds : (float, float)
        u^max [rad] and v^0max of (1.7)
    mounting : dict
        Q (3, 3) by its name
    """

    settings: tuple[TableSetting, ...]
    promised: Mapping[str, float]
    baseline: str
    convention: str
    bounds: tuple[float, float]
    mounting: Mapping[str, list[list[float]]]


def read_programme(path: Path, mounting: str = "identity") -> TableProgramme:
    """Read a folder of `trihedron plan positions --out`, its plan.json, or a table with alpha_deg and beta_deg.

    The mounting is that of a table; a plan has its own. Raises InputError for any other file, for a plan with several
    mountings, and for positions that do not determine every target.
    """
    if path.is_dir():
        path = path / "plan.json"
    if path.suffix.lower() != ".json":
        table, _ = read_number_table(path, str(path), ANGLES)
        angles = np.column_stack([table.columns[name] for name in ANGLES])
        for name, column in zip(ANGLES, angles.T, strict=True):
            low, high, needed = LIMITS[name]
            if wrong := np.flatnonzero((column < low) | (column > high)).tolist():
                raise InputError(f"{table.row(wrong[0])}, column '{name}': {column[wrong[0]]:g}; {needed}")
        return _promising(path, angles, Request(mountings=(mounting,)))
    if mounting != "identity":
        raise InputError(f"--mounting {mounting}: {path} says its own; leave it out")
    try:
        plan = PositionPlan.model_validate_json(bytes_of(path, most=LARGEST_RESULT))
    except ValidationError as error:
        problem = field_problems(error, PositionPlan)[0][1]
        raise InputError(
            f"{path}: is not a plan of positions ({problem}); `trihedron plan positions` makes one"
        ) from error
    if len(plan.mountings) != 1:
        names = ", ".join(plan.mountings)
        raise InputError(f"{path}: is for {len(plan.mountings)} mountings ({names}); plan and measure each by itself")
    rows = []
    for number in plan.programme:
        if not 1 <= number <= len(plan.positions):
            raise InputError(f"{path}: programme: {number} is not a position of the plan")
        position = plan.positions[number - 1]
        rows.append([position.alpha_deg, position.beta_deg])
    request = Request(
        mountings=(plan.mountings,),
        admissible=plan.admissible,
        bounds=plan.bounds,
        convention=plan.convention,
        baseline=plan.baseline,
    )
    return _promising(path, np.array(rows), request)


def _promising(path: Path, angles: NDArray, request: Request) -> TableProgramme:
    """Return the positions (N, 2) [deg] with their guaranteed errors, from the linear programmes."""
    settings = tuple(TableSetting(k, float(a), float(b)) for k, (a, b) in enumerate(angles, start=1))
    parametrisation = request.parametrisation()
    if len(parametrisation.mountings) != 1:
        raise InputError("--mounting: holds several mountings; a record of one table is measured in one")
    # costs relative to an optimum of one
    task = task_of(request, best=np.ones(len(parametrisation.symbols)))
    cost = costs(task, Places(np.radians(angles), np.zeros(len(angles), dtype=int))).ratio
    targets = [target.symbol for target in task.targets]
    missing = []
    for name, value in zip(targets, cost, strict=True):
        if value >= NOT_DETERMINED:
            missing.append(name)
    if missing:
        reason = f"its {len(angles)} positions do not determine {', '.join(missing)}"
        raise InputError(f"{path}: {reason}; `trihedron plan positions 12 --out plan12` gives some that do")
    matrices = dict(zip(parametrisation.mountings, np.asarray(parametrisation.matrices).tolist(), strict=True))
    return TableProgramme(
        settings,
        dict(zip(targets, cost.tolist(), strict=True)),
        request.baseline,
        request.convention,
        (float(request.bounds[0]), float(request.bounds[1])),
        matrices,
    )
