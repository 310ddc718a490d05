"""What readings leave possible, at the fit: radius, values, guaranteed errors, exact intervals, pairs of targets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import RELATIVE_TOLERANCE, Polytope, chebyshev_radius
from ..progress import tracked
from .model import NOT_OUTSIDE, Linearisation
from .result import Estimate, FeasibleSet, number_or_none
from .targets import Target, convention_targets

MANY_MEASUREMENTS = 5000
"""From here on the programmes take seconds."""
GROUPS = (
    ("accelerometer 1", ("X4", "X5", "X16")),
    ("accelerometer 2", ("X9", "X10", "X6+X8", "X17")),
    ("accelerometer 3", ("X14", "X15", "X7+X12", "X11+X13", "X18")),
    ("table and mounting", ("X1", "X2", "X3", "X13", "-X12", "X8")),
)
"""Targets whose errors hang together: those of each accelerometer, those of the bench."""
SAME = 1e-6
"""A direction that gains no more than this part of the set's size gives no new vertex."""


def chebyshev_centre(here: Linearisation) -> tuple[float, NDArray, NDArray]:
    """The least max |z − f(X)| / bound of the exact model, where it is attained (P,), and the duals (M,) that prove it.

    The programme is solved again about its own centre with exact residuals until it stays there: near the fit
    one more time is enough. Where the measurements leave parameters open, the programme at the fit stands.
    """
    radius, step, duals = chebyshev_radius(here.jacobian, here.residual, here.bound)
    if here.deficient:
        return radius, here.point, duals
    best = here.point
    attained = float(np.abs(here.residual / here.bound).max())
    for _ in range(8):
        centre = best + step
        residual = here.residual_at(centre)
        worst = float(np.abs(residual / here.bound).max())
        if worst >= attained:
            break
        best, attained = centre, worst
        if attained - radius <= 1e-9 * radius:
            break
        radius, step, duals = chebyshev_radius(here.jacobian, residual, here.bound)
    return radius, best, duals


def estimate_targets(here: Linearisation, wanted: list[Target], intervals: NDArray) -> list[Estimate]:
    """Each target's estimate and guaranteed error, with its exact interval (T, 2), NaN where there is none.

    None stands for what the measurements do not determine.
    """
    numbers = np.full((len(wanted), 4), np.nan)
    numbers[:, 2:] = intervals[: len(wanted)]
    known = [k for k, target in enumerate(wanted) if _is_determined(here, target.weights)]
    reduced = Polytope(here.jacobian @ here.span, here.bound)
    if known:
        reduced.confine(-here.bound, here.bound)
    for k in tracked(known, "guaranteed errors", show=_takes_long(here)):
        weights = wanted[k].weights
        error, _, phi = reduced.maximise(here.span.T @ weights)
        numbers[k, :2] = weights @ here.point + phi @ here.residual, error
    keys = ("estimate", "guaranteed_error", "low", "high")
    return [
        Estimate(symbol=t.symbol, name=t.name, unit=t.unit, **dict(zip(keys, map(number_or_none, row), strict=True)))
        for t, row in zip(wanted, numbers, strict=True)
    ]


def exact_intervals(feasible: FeasibleSet, weights: NDArray) -> NDArray:
    """The least and the greatest weights'X that the measurements leave possible.

    The ends are those of the linear programmes about the Chebyshev centre, moved outwards by what the remainder of the
    linearisation can do: the greatest that it is at any of the vertices, weighted by each programme's duals.

    Shape (K, 2) for weights (K, P), NaN where the measurements do not determine it.
    """
    here, centre = feasible.linearised, feasible.centre
    intervals = np.full((len(weights), 2), np.nan)
    if here.span.shape[1] == 0:
        return intervals
    polytope, residual = _steps_of(feasible)
    tops = {}
    remainder = np.zeros(len(residual))
    known = [k for k, row in enumerate(weights) if _is_determined(here, row)]
    for k in tracked(known, "exact intervals", show=_takes_long(here)):
        for side, sense in enumerate((-1.0, 1.0)):
            value, step, phi = polytope.maximise(here.span.T @ (sense * weights[k]))
            step = here.span @ step
            left = residual - here.residual_at(centre + step) - here.jacobian @ step
            remainder = np.maximum(remainder, np.abs(left))
            used = np.flatnonzero(phi)
            tops[k, side] = value, used, np.abs(phi[used])
    for k in known:
        middle = float(weights[k] @ centre)
        for side, sense in enumerate((-1.0, 1.0)):
            value, used, phi = tops[k, side]
            intervals[k, side] = middle + sense * (value + phi @ remainder[used])
    # where hardly a point is left, rounding alone decides which end is which
    return np.sort(intervals, axis=1)


def _steps_of(feasible: FeasibleSet) -> tuple[Polytope, NDArray]:
    """Steps from the centre, in coordinates of `span`, that keep residuals within bounds; the residuals (M,) there."""
    here = feasible.linearised
    residual = here.residual_at(feasible.centre)
    room = np.maximum(here.bound + feasible.slack, np.abs(residual)) * (1.0 + RELATIVE_TOLERANCE)
    polytope = Polytope(here.jacobian @ here.span, here.bound)
    polytope.confine(residual - room, residual + room)
    return polytope, residual


def _takes_long(here: Linearisation) -> bool:
    """Whether there are so many measurements that progress is worth showing."""
    return len(here.bound) >= MANY_MEASUREMENTS


def _is_determined(here: Linearisation, weights: NDArray) -> bool:
    """Whether the measurements determine weights'X."""
    outside = float(np.linalg.norm(weights - here.span @ (here.span.T @ weights)))
    return outside <= NOT_OUTSIDE * float(np.linalg.norm(weights))


@dataclass(frozen=True)
class PairSet:
    """What readings leave possible of two targets: vertices (V, 2) in order, about the origin of the estimates."""

    first: Target
    second: Target
    vertices: NDArray


def joint_sets(feasible: FeasibleSet) -> dict[str, list[PairSet]]:
    """The pairwise projections of the feasible set, group by group; targets that readings leave open are left out."""
    here = feasible.linearised
    polytope, _ = _steps_of(feasible)
    known = {
        t.symbol.split("@")[0]: t
        for t in reversed(convention_targets(here.parametrisation, "A1"))
        if _is_determined(here, t.weights)
    }
    wanted = []
    for group, symbols in GROUPS:
        targets = [known[symbol] for symbol in symbols if symbol in known]
        wanted += [(group, first, second) for i, second in enumerate(targets) for first in targets[:i]]
    result: dict[str, list[PairSet]] = {}
    for group, first, second in tracked(wanted, "joint feasible set", show=_takes_long(here)):
        weights = np.array([first.weights, second.weights])
        middle = weights @ feasible.centre
        result.setdefault(group, []).append(PairSet(first, second, middle + _polygon(polytope, weights @ here.span)))
    return result


def _polygon(polytope: Polytope, weights: NDArray) -> NDArray:
    """Vertices of a polytope's projection {weights x}: from four on, each edge is pushed out until it holds."""
    size = np.array([sum(polytope.maximise(sign * row)[0] for sign in (-1.0, 1.0)) for row in weights])
    scale = np.where(size > 0.0, size, 1.0)
    rows = weights / scale[:, None]

    def furthest(direction: NDArray) -> NDArray:
        return rows @ polytope.maximise(direction @ rows)[1]

    vertices = [furthest(np.array(d)) for d in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))]
    k = 0
    while k < len(vertices) and len(vertices) < 100:
        here, after = vertices[k], vertices[(k + 1) % len(vertices)]
        edge = after - here
        if np.abs(edge).max() <= SAME:
            k += 1
            continue
        outwards = np.array([edge[1], -edge[0]])
        found = furthest(outwards)
        if (found - here) @ outwards > SAME * np.linalg.norm(outwards):
            vertices.insert(k + 1, found)
        else:
            k += 1
    return np.array(vertices) * scale
