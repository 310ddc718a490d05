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

from ..calibration.targets import Target, expression_weights
from .positions import Costs, Places, Task, costs
from .request import FORCE, force_at
from .search import search

NEAR = 1e-3
"""The largest error over all directions is bounded to this, relative."""
ENOUGH = 5e-3
"""A search ends where its directions tell the error over all to this, relative."""
ROUNDS = 6
DECIMALS = 6
"""Of directions that a search takes in."""


def search_force(
    task: Task, count: int, *, given: Sequence[Places] = (), progress: bool = False
) -> tuple[Costs | None, int, bool]:
    """As `search`, for the largest error over all directions; costs are those at the inputs that it begins with."""
    directions, made, interrupted = np.array(FORCE), 0, False
    known = [(force_error(task, one)[0], one) for one in given]
    here, starts = task, task.request.starts
    for _ in range(ROUNDS):
        found, more, interrupted = search(here, count, given=[one for _, one in known], progress=progress)
        made += more
        if found is None:
            break
        bound, worst = force_error(task, found.places)
        known = sorted([*known, (bound, found.places)], key=lambda pair: pair[0])[:2]
        if interrupted or bound <= (1.0 + ENOUGH) * found.worst * here.least.max():
            break
        directions = np.unique(np.concatenate([directions, np.round(worst, DECIMALS)]), axis=0)
        here = at_directions(task, directions)
        here = replace(here, request=replace(here.request, starts=max(1, starts // ROUNDS)))
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


def force_error(task: Task, places: Places) -> tuple[float, NDArray]:
    """A bound of the largest error [σ] over all directions, and the worst directions (n, 3) of octants that matter."""

    def errors(n: NDArray) -> NDArray:
        here = at_directions(task, n)
        return here.together(costs(here, places).ratio * here.best)

    return largest_over_directions(errors)


def largest_over_directions(errors: Callable[[NDArray], NDArray]) -> tuple[float, NDArray]:
    """A bound of an error over all directions, from its values (V,) at some vectors (V, 3), convex in each octant.

    A triangle of directions lies between the plane of its corners and the parallel plane that touches the sphere: the
    largest of the corners on both bounds it. Triangles are divided in four until that is near what was found.
    Also where the error is largest (n, 3) in each octant, where that is near the largest of all.
    """
    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    triangles, octant = np.array([np.diag(one) for one in signs]), np.arange(len(signs))
    found, where, bound = np.zeros(len(signs)), signs.copy(), 0.0
    while len(triangles):
        # The foot of the perpendicular from 0 is the nearest point of the plane.
        beyond = np.linalg.norm(np.linalg.solve(triangles, np.ones((len(triangles), 3, 1)))[..., 0], axis=1)
        corners = np.concatenate([triangles, beyond[:, None, None] * triangles], axis=1).reshape(-1, 3)
        each, at = np.unique(corners, axis=0, return_inverse=True)
        values = errors(each)[at.ravel()].reshape(len(triangles), 6)
        for own, value, triangle in zip(octant, values[:, :3], triangles, strict=True):
            if value.max() > found[own]:
                found[own], where[own] = value.max(), triangle[int(value.argmax())]
        most = values.max(axis=1)
        done = most <= found.max() * (1.0 + NEAR)
        bound = max(bound, float(most[done].max(initial=0.0)))
        a, b, c = triangles[~done].transpose(1, 0, 2)
        ab, bc, ca = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (a + b, b + c, c + a))
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        octant = np.tile(octant[~done], len(parts))
    return bound, where[found > found.max() * (1.0 - 10.0 * ENOUGH)]
