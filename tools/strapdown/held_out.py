"""Blocks in time that are left out, predicted by what the rest of the record says."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from .system import System

BLOCKS = 8
"""Blocks in time, left out in turn."""
RANK = 1e-12
"""Directions of so small a part of the sum of squares are not determined."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """The block of each piece.

    Attributes
    ----------
    count : int
    of_piece : tuple of (S,) array of int
        for each part of the system
    """

    count: int
    of_piece: tuple[NDArray[np.int_], ...]

    def rows(self, system: System) -> NDArray[np.int_]:
        """The block of each row (M,)."""
        parts = [
            np.repeat(numbers, part.error.shape[1]) for numbers, part in zip(self.of_piece, system.parts, strict=True)
        ]
        return np.concatenate(parts)


def blocks_in_time(system: System, count: int = BLOCKS) -> Blocks:
    """Blocks of the record's rows, each with as many pieces of the shortest kind as the others."""
    scored = [part for part in system.parts if part.scored]
    main = max(scored, key=len)
    middles = 0.5 * (main.segments.first + main.segments.last)
    count = min(count, len(main))
    edges = np.quantile(middles, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return Blocks(
        count,
        tuple(np.searchsorted(edges, 0.5 * (part.segments.first + part.segments.last)) for part in system.parts),
    )


def predicted(system: System, places: Sequence[EffectPlace], blocks: Blocks) -> NDArray[np.float64]:
    """Errors (M,) in units of their bounds, each block's by least squares over the others.

    A piece that reaches into a block that is left out is left out with it where its middle lies in it.
    """
    matrix, of_row = system.matrix(places), blocks.rows(system)
    left = np.array(system.residual)
    if not matrix.shape[1]:
        return left
    scale = np.linalg.norm(matrix, axis=0)
    matrix = matrix / np.where(scale > 0.0, scale, 1.0)
    outs = [np.flatnonzero(of_row == number) for number in range(blocks.count)]
    grams = np.array([matrix[out].T @ matrix[out] for out in outs])
    products = np.array([matrix[out].T @ system.residual[out] for out in outs])
    for out, gram, product in zip(outs, grams.sum(axis=0) - grams, products.sum(axis=0) - products, strict=True):
        step = np.linalg.lstsq(gram, product, rcond=RANK)[0]
        left[out] = system.residual[out] - matrix[out] @ step
    return left


def angles(system: System, values: NDArray) -> list[NDArray[np.float64]]:
    """Rows (M,) in units of their bounds as errors [rad], for each part (S, d)."""
    found, at = [], 0
    for part in system.parts:
        size = part.error.size
        found.append(values[at : at + size].reshape(part.error.shape) * part.bound)
        at += size
    return found


def rms_angle(error: NDArray) -> float:
    """Root mean square of the size of errors (S, d) [rad]."""
    return float(np.sqrt(np.mean((error**2).sum(axis=1)))) if len(error) else 0.0


def largest_angle(error: NDArray) -> float:
    """Largest size of errors (S, d) [rad]."""
    return float(np.linalg.norm(error, axis=1).max(initial=0.0))
