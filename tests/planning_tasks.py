"""Common sets of positions on the tables' admissible set, mounting identity, whose optima have closed forms."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np

import trihedron as th
from trihedron.tools.planning import Places, PositionPlan, Request, Task, stored_positions, task, task_of

SCALE, ZERO, SINGLE, SUM, THIRD = 2.0475623761398, 1.0475623761398, 1.00026989733961, 2.00053979467921, 1.02897485655299
OPTIMA = np.array([SINGLE] * 2 + [THIRD] + [SCALE] * 6 + [SUM] * 3 + [SINGLE] * 3 + [ZERO] * 3)
"""Optima over all angles, for bounds of 3e-3 and 1e-2."""


def tables_task(**options: Any) -> Task:
    """Return the task with these options of a request."""
    return task_of(Request(**{"admissible": "tables", **options}), best=OPTIMA)


def stored(count: int) -> Places:
    """Return the package's set of this number of positions."""
    places = stored_positions(count)
    assert places is not None
    assert len(places) == count
    return places


@contextmanager
def known_optima(optima: Any = OPTIMA) -> Iterator[None]:
    """Replace the optima, which take seconds, by known ones: by default those of the tables' admissible set."""
    with mock.patch.object(task, "_optima", return_value=(np.array(optima), np.zeros((0, 2)))):
        yield


def planned(count: int | None, *, optima: Any = OPTIMA, **options: Any) -> PositionPlan:
    """Return a plan, by default of one start and without a bound, on the tables' admissible set."""
    with known_optima(optima):
        return th.plan_positions(count, **{"admissible": "tables", "starts": 1, "cuts": 0, **options})


def angles(plan: PositionPlan) -> np.ndarray:
    """Return the plan's commands (N, 2) [rad]."""
    return np.radians([(at.alpha_deg, at.beta_deg) for at in plan.positions])
