"""What an unexplained error depends on: rate, turn, orientation, time, temperature."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnosis.residual_structure import MOST_ROWS, predicted_share, spread
from .building import Built
from .gravity_system import GravityPieces, across, directions_of
from .held_out import angles
from .inspection import Inspection
from .norm_calibration import NAMES
from .search import fit_set
from .segments import Segments


def quoted_number(built: Built) -> int:
    """Number of the part whose errors are quoted: single moves, or the windows of the middle length."""
    scored = [k for k, part in enumerate(built.system.parts) if part.scored]
    return scored[0] if built.forces else scored[len(scored) // 2]


def piece_quantities(built: Built, segments: Segments) -> dict[str, NDArray[np.float64]]:
    """What the errors of pieces may depend on: (S, k) each.

    ``rate``: mean rate about each axis; ``turn``: its integral; ``orientation``: specific force at the beginning;
    ``time``; ``temperature`` where the record has it.
    """
    motion = built.motion
    sums = np.cumsum((motion.rate - built.model.bias) * motion.step[:, None], axis=0)
    turn = sums[segments.last] - sums[segments.first]
    seconds = segments.durations(motion.time_s)
    force = motion.force(segments.first)
    found = {
        "rate": turn / seconds[:, None],
        "turn": turn,
        "orientation": force / np.maximum(np.linalg.norm(force, axis=1), 1e-12)[:, None],
        "time": motion.time_s[segments.first][:, None],
    }
    if motion.temperature is not None:
        found["temperature"] = motion.temperature[segments.first][:, None]
    return found


def residual_structure(built: Built, found: Inspection) -> list[dict[str, Any]]:
    """How much of the quoted errors a smooth function of one quantity predicts at pieces that it was not fitted to.

    Returns
    -------
    list of dict
        ``axis`` of the block, ``on``, ``explained`` and ``explainable``, parts of the sum of squares; the most telling
        first
    """
    system = built.system
    k = quoted_number(built)
    baseline = fit_set(system, ())
    left = angles(system, system.residual - system.matrix(()) @ baseline.solution)[k]
    part = system.parts[k]
    bound = part.bound.max(axis=1)
    if isinstance(built.pieces, GravityPieces):
        left = np.einsum("skp,sk->sp", across(up_at_moves(built, found)), left)
    rows = np.unique(np.linspace(0, len(left) - 1, MOST_ROWS).round().astype(int))
    quantities = piece_quantities(built, part.segments)
    entries = []
    for axis in range(3):
        error = left[rows, axis]
        total = float((error**2).sum())
        explainable = max(0.0, 1.0 - float((bound[rows] ** 2).sum()) / 3.0 / total) if total > 0.0 else 0.0
        for name, values in quantities.items():
            share = predicted_share(spread(values[rows]), error)
            entries.append({"axis": axis + 1, "on": name, "explained": share, "explainable": explainable})
    return sorted(entries, key=lambda entry: -round(float(entry["explained"]), 9))


def up_at_moves(built: Built, found: Inspection) -> NDArray[np.float64]:
    """Directions of gravity (S, 3) at the beginnings of the single moves."""
    assert isinstance(built.pieces, GravityPieces)
    up = directions_of(built.system.point[: len(NAMES)], found.rests, found.gravity, {})
    return up[built.pieces.ends[0][:, 0]]
