"""The error of the corrected specific force over all directions of an input of 1 g, and positions that make it small.

The error at an input n is Γ n + b, Γ lower triangular. Its length is bounded by the root of the sum of the squares of
its components' errors, each the least guaranteed one. A component is a linear combination of the parameters, linear in
n within an octant, and the least guaranteed error of a combination is a support function: all of it is convex within an
octant. A search looks at a few directions, and takes in those where its set turns out to be worst.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Parametrisation
from ..calibration.targets import Target, expression_weights
from .positions import Costs, Places, Task, costs, estimators, readings
from .request import FORCE, force_at
from .search import search

NEAR = 1e-3
"""The largest error over all directions is bounded to this, relative."""
ENOUGH = 5e-3
"""A search ends where its directions tell the error over all to this, relative."""
GAIN = 1e-4
"""A search's improvements end where steps gain less: it knows a few directions alone."""
ROUNDS = 6
DECIMALS = 6
"""Of directions that a search takes in."""
BEYOND = 3.0**0.5
"""So far from 0 the touching plane of an octant cuts its axes."""


def search_force(
    task: Task, count: int, *, given: Sequence[Places] = (), enough: float = 0.0, progress: bool = False
) -> tuple[Costs | None, int, bool]:
    """As `search`, for the largest error over all directions; costs are those at the inputs that it begins with."""
    directions, made, interrupted = np.array(FORCE), 0, False
    known, least = [(force_error(task, one)[0], one) for one in given], float(task.least.max())
    later = task.request.starts // ROUNDS
    here, starts = task, task.request.starts - (ROUNDS - 1) * later
    for _ in range(ROUNDS):
        here = replace(here, request=replace(task.request, starts=starts))
        found, more, interrupted = search(
            here, count, given=[one for _, one in known], least_gain=GAIN, enough=enough, progress=progress
        )
        made += more
        if found is None:
            break
        bound, worst = force_error(task, found.places)
        known = sorted([*known, (bound, found.places)], key=lambda pair: pair[0])[:2]
        if (
            interrupted
            or bound <= enough * least
            or (found.worst > enough and bound <= (1.0 + ENOUGH) * found.worst * least)
        ):
            break
        directions = np.unique(np.concatenate([directions, np.round(worst, DECIMALS)]), axis=0)
        here, starts = at_directions(task, directions), later
    best = costs(task, known[0][1]) if known else None
    return best if best is not None and best.determined.all() else None, made, interrupted


def at_directions(task: Task, directions: NDArray) -> Task:
    """The task of the error at these inputs (V, 3) [g], relative to what no positions better."""
    p = task.parametrisation
    texts = [force_at(n, symmetric=p.symmetric) for n in directions.tolist()]
    each = list(dict.fromkeys(text for group in texts for text in group))
    at = {text: k for k, text in enumerate(each)}
    return replace(
        task,
        targets=tuple(Target(text, "specific-force-error", "g", expression_weights(text, p)) for text in each),
        best=np.full(len(each), task.best.max()),
        groups=tuple(tuple(at[text] for text in group) for group in texts),
        least=np.full(len(texts), task.least.max()),
    )


def force_error(task: Task, places: Places, limit: float = 0.0) -> tuple[float, NDArray]:
    """A bound of the largest error [σ] over all directions, and the worst directions (n, 3) of octants that matter.

    It is no better than it takes to say on which side of the limit it is.
    """
    given, p = readings(task, places), task.parametrisation
    losable = len(places) - len(task.measured) if task.request.lost else 0

    def errors(n: NDArray) -> NDArray:
        each, at = np.unique(_force_weights(n, p).reshape(-1, len(p.symbols)), axis=0, return_inverse=True)
        values = [dual @ a for a, (_, dual, *_) in zip(each, estimators(given, each, losable), strict=True)]
        return np.linalg.norm(np.array(values)[at.ravel()].reshape(-1, 3), axis=1)

    return largest_over_directions(errors, limit)


def _force_weights(n: NDArray, p: Parametrisation) -> NDArray:
    """Weights (V, 3, P) of what each accelerometer reads too much at inputs (V, 3) [g]."""

    def weights(at: Sequence[float]) -> NDArray:
        return np.array([expression_weights(text, p) for text in force_at(at, symmetric=p.symmetric)])

    bias = weights((0.0, 0.0, 0.0))
    by = np.array([[weights((sign * axis).tolist()) - bias for sign in (1.0, -1.0)] for axis in np.eye(3)])
    return bias + np.einsum("vcs,cspk->vpk", np.maximum(np.stack([n, -n], axis=2), 0.0), by)


def largest_over_directions(errors: Callable[[NDArray], NDArray], limit: float = 0.0) -> tuple[float, NDArray]:
    """A bound of an error over all directions, from its values (V,) at some vectors (V, 3), convex in each octant.

    A triangle of directions lies between the plane of its corners and the parallel plane that touches the sphere: the
    largest of the corners on both bounds it. On the touching plane a corner's error lies below the chord to the one
    `BEYOND`. Triangles are divided in four until that is near what was found, or on which side of a limit is known.
    Also where the error is largest (n, 3) in each octant, where that is near the largest of all.
    """

    def along(n: NDArray) -> NDArray:
        each, at = np.unique(n.reshape(-1, 3), axis=0, return_inverse=True)
        values = errors(np.concatenate([each, BEYOND * each])).reshape(2, -1)
        return values[:, at.ravel()].T.reshape(*n.shape[:-1], 2)

    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    triangles, octant = np.array([np.diag(one) for one in signs]), np.arange(len(signs))
    found, where, bound, values = np.zeros(len(signs)), signs.copy(), 0.0, along(triangles)
    while len(triangles):
        for own, value, triangle in zip(octant, values[..., 0], triangles, strict=True):
            if value.max() > found[own]:
                found[own], where[own] = value.max(), triangle[int(value.argmax())]
        # The foot of the perpendicular from 0 is the nearest point of the plane.
        beyond = np.linalg.norm(np.linalg.solve(triangles, np.ones((len(triangles), 3, 1)))[..., 0], axis=1)
        share = (beyond - 1.0)[:, None] / (BEYOND - 1.0)
        most = np.maximum(values[..., 0], values[..., 0] + share * (values[..., 1] - values[..., 0])).max(axis=1)
        if found.max() > limit > 0.0:
            bound = max(bound, float(most.max()))
            break
        done = most <= max(found.max() * (1.0 + NEAR), limit)
        bound = max(bound, float(most[done].max(initial=0.0)))
        triangles, octant, values = triangles[~done], octant[~done], values[~done]
        a, b, c = triangles.transpose(1, 0, 2)
        middle = np.stack([a + b, b + c, c + a], axis=1)
        middle /= np.linalg.norm(middle, axis=2, keepdims=True)
        points = np.concatenate([triangles, middle], axis=1)
        values = np.concatenate([values, along(middle)], axis=1) if len(middle) else values
        parts = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
        triangles, octant = points[:, parts].reshape(-1, 3, 3), np.repeat(octant, len(parts))
        values = values[:, parts].reshape(-1, 3, 2) if len(middle) else values
    return bound, where[found > found.max() * (1.0 - 10.0 * ENOUGH)]
