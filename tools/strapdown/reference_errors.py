"""Bounds of a record with true attitude, whose own errors in motion are not known beforehand."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .building import Built
from .held_out import angles, blocks_in_time, predicted
from .search import LIMIT, fit_set
from .system import System

JUMP, ROUNDS_OF_JUMPS = 12.0, 6
"""A window with so many times the median error that all effects leave is a jump; jumps are dropped in rounds."""
ROOM = 1.2
"""A bound over the largest error that was seen: there are only so many windows."""
RECORD_NOISE = "the noise of gyros and accelerometers at rest (Allan deviation), and Earth's rate"
WITH_TRUTH = "the noise of the gyros and the scatter of the true attitude at rest, and Earth's rate"
LEFT_OUT = (
    "the largest errors that all effects together leave in parts of the record that were left out: the noise at rest "
    "is smaller, so the true attitude errs more in motion than at rest, or something is not in the catalogue"
)


def with_reference_errors(built: Built) -> tuple[Built, str, tuple[str, ...]]:
    """A record's system with bounds that the true attitude's own errors allow, what they come from, and warnings.

    Where all effects together cannot bring the errors within the noise at rest, no set of them can: then what they
    leave in blocks that are left out is the bound, for each length of windows. Windows with errors many times those of
    the others, which nothing in the catalogue makes, are not used.
    """
    system = built.system
    if all((part.bound > 0.0).all() for part in system.parts) and fit_set(system, system.places).radius <= LIMIT:
        return built, WITH_TRUTH, ()
    kept = [np.ones(len(part), dtype=bool) for part in system.parts]
    for _ in range(ROUNDS_OF_JUMPS):
        left = left_out_by_all(chosen_pieces(built, kept).system)
        jumps = [np.linalg.norm(error, axis=1) for error in left]
        far = [size > JUMP * np.median(size) for size in jumps]
        if not any(mask.any() for mask in far):
            break
        for mine, mask in zip(kept, far, strict=True):
            mine[np.flatnonzero(mine)[mask]] = False
    built = chosen_pieces(built, kept)
    left = left_out_by_all(built.system)
    parts = tuple(
        replace(part, bound=np.maximum(part.bound, ROOM * np.abs(error).max()))
        for part, error in zip(built.system.parts, left, strict=True)
    )
    dropped = [(int((~mine).sum()), part.label) for mine, part in zip(kept, system.parts, strict=True)]
    said = tuple(
        f"{count} windows of {label} are not used: gyros or truth jump there as no effect does"
        for count, label in dropped
        if count
    )
    return replace(built, system=replace(built.system, parts=parts)), LEFT_OUT, said


def left_out_by_all(system: System) -> list[NDArray[np.float64]]:
    """Errors (S, d) of each part that all effects together leave in blocks that are left out [rad]."""
    even = replace(system, parts=tuple(replace(part, bound=np.ones_like(part.bound)) for part in system.parts))
    return angles(even, predicted(even, system.places, blocks_in_time(even)))


def chosen_pieces(built: Built, kept: Sequence[NDArray]) -> Built:
    """The windows that masks (S,) choose, of each length."""
    assert isinstance(built.pieces, list)
    parts = tuple(part.selected(mask) for part, mask in zip(built.system.parts, kept, strict=True))
    pieces = [windows.selected(mask) for windows, mask in zip(built.pieces, kept, strict=True)]
    return replace(built, system=replace(built.system, parts=parts), pieces=pieces)
