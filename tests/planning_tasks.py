"""Common sets of positions on the tables' admissible set, mounting identity, whose optima have closed forms."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np

from trihedron.tools.planning import common, positions
from trihedron.tools.planning.common import PositionPlan, stored_positions
from trihedron.tools.planning.positions import Places, Task, task_of
from trihedron.tools.planning.request import Request

SCALE, ZERO, SINGLE, SUM, THIRD = 2.0475623761398, 1.0475623761398, 1.00026989733961, 2.00053979467921, 1.02897485655299
OPTIMA = np.array([SINGLE, SINGLE, THIRD, *[SCALE] * 6, *[SUM] * 3, *[SINGLE] * 3, *[ZERO] * 3])
"""Optima over all angles, for bounds of 3e-3 and 1e-2."""


def tables_task(**options: object) -> Task:
    """What is asked with these options of a request."""
    return task_of(Request(**{"admissible": "tables", **options}), best=OPTIMA)  # pyright: ignore[reportArgumentType]


def stored(count: int) -> Places:
    """The set of so many positions that the package holds."""
    places = stored_positions(count)
    assert places is not None
    assert len(places) == count
    return places


@contextmanager
def known_optima() -> Iterator[None]:
    """Within it the optima of the tables' admissible set, which take seconds, are those that are known."""
    with mock.patch.object(positions, "_optima", return_value=(OPTIMA, np.zeros((0, 2)))):
        yield


def planned(count: int, request: Request) -> PositionPlan:
    """A plan on the tables' admissible set, with the known optima."""
    assert request.admissible == "tables"
    with known_optima():
        return common.common_positions(count, request)
