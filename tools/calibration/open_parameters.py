"""Parameters that the measurements leave open: what they may do to everything else."""

import numpy as np
from numpy.typing import NDArray

from .linearisation import Linearisation


def open_moves(here: Linearisation, extent: NDArray) -> NDArray:
    """Moves (P - rank, P) along the directions that the measurements leave open, as far as truth may be.

    Truth is within `extent` (P,): the bounds of (1.7), the biases like v, or priors. The fit is where it is.
    """
    rank = here.span.shape[1]
    directions = np.linalg.svd(here.span, full_matrices=True)[0][:, rank:].T
    return directions * (np.abs(directions) @ extent + np.abs(directions @ here.point))[:, None]


def undetermined_remainder(here: Linearisation, moves: NDArray) -> NDArray:
    """How far `open_moves` may move readings (M,), as a fraction of g.

    To first order hardly at all; to second order what is left open turns into errors of everything else. The
    second differences along all pairs of moves are summed in absolute value.
    """
    moved = np.zeros(len(here.bound))

    def shift(move: NDArray) -> NDArray:
        return here.residual_at(here.point + move) - here.residual

    single = [shift(move) for move in moves]
    for j, move in enumerate(moves):
        moved += np.maximum(np.abs(single[j]), np.abs(shift(-move)))
        for k in range(j):
            moved += np.abs(shift(move + moves[k]) - single[j] - single[k])
    return moved
