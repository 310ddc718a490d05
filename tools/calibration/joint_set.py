"""The joint feasible set of parameters, seen in pairs: exact polygons of the linearised model."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import Polytope
from ..progress import tracked
from .estimates import feasible_set, is_determined, takes_long
from .result import FeasibleSet
from .targets import Target, convention_targets

GROUPS = (
    ("accelerometer 1", ("X4", "X5", "X16")),
    ("accelerometer 2", ("X9", "X10", "X6+X8", "X17")),
    ("accelerometer 3", ("X14", "X15", "X7+X12", "X11+X13", "X18")),
    ("table and mounting", ("X1", "X2", "X3", "X13", "-X12", "X8")),
)
"""Targets whose errors hang together: those of each accelerometer, those of the bench."""

SAME = 1e-6
"""A direction that gains no more than this part of the set's size gives no new vertex."""


@dataclass(frozen=True)
class PairSet:
    """What readings leave possible of two targets: vertices (V, 2) in order, about the origin of the estimates."""

    first: Target
    second: Target
    vertices: NDArray


def joint_sets(feasible: FeasibleSet) -> dict[str, list[PairSet]]:
    """The pairwise projections of the feasible set, group by group; targets that readings leave open are left out."""
    here = feasible.linearised
    polytope, _ = feasible_set(here, feasible.centre, feasible.slack)
    known = {
        t.symbol.split("@")[0]: t
        for t in reversed(convention_targets(here.parametrisation, "A1"))
        if is_determined(here, t.weights)
    }
    wanted = []
    for group, symbols in GROUPS:
        targets = [known[symbol] for symbol in symbols if symbol in known]
        wanted += [(group, first, second) for i, second in enumerate(targets) for first in targets[:i]]
    result: dict[str, list[PairSet]] = {}
    for group, first, second in tracked(wanted, "joint feasible set", show=takes_long(here)):
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
