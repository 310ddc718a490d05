"""Channels of a position record that are exchanged or reversed, angles of the other sense or unit: tried before a fit.

A way of reading is right where the readings are the inputs of an ideal bench, but for small parameters and what effects
do: reading = (1 + E) P Q up(α, β) + b, with P a signed permutation and E, b of usual size. In each way the penalised
least squares of E and b have closed form, and that of P is a sum of three numbers out of eighteen.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.bench import up
from ..records import PositionRecord
from ..records.channels import (
    LARGEST_MISFIT,
    LEAST_MISFIT,
    PERMUTATIONS,
    SENSES,
    USUAL,
    Channels,
    advice,
    far_better,
    reading_of,
)
from ..rounding import digits
from .model import Parametrisation, Positions

FEWEST = 6
"""Fewer positions fit too many ways."""
CHANGES = 0.25
"""Where the first or the last rows, but for one of them, are nearer to an ideal bench as they are read, by squares of
so much in all [g²], channels change during the record: that is an effect, and no way of reading it."""
TURNS = tuple((unit, *senses) for unit in (1.0, 180.0 / np.pi) for senses in SENSES)
"""Units and senses of the angles that are tried; the first changes nothing."""
PLACES = np.array(
    [[row.argmax() if row.max() > 0.0 else row.argmin() + 3 for row in matrix] for matrix in PERMUTATIONS]
)
"""Where the costs of the rows (48, 3) of each signed permutation stand: of inputs 1, 2, 3, then of these reversed."""


def channels_advice(record: PositionRecord, reading: NDArray, p: Parametrisation, at: Positions) -> str:
    """One line where another way of reading a record fits far better than the one it is read in; else nothing.

    The readings (N, 3) are over g. Nothing is said where a person has said that the file stands as it is.
    """
    if len(reading) < FEWEST or record.channels == Channels():
        return ""
    inputs = [
        np.einsum("nij,nj->ni", p.matrices[at.mounting], up(alpha * unit * at.alpha, beta * unit * at.beta))
        for unit, alpha, beta in TURNS
    ]
    costs, scale = costs_of(reading, inputs)
    same = far_better(costs)
    if scale > LARGEST_MISFIT or not len(same):
        return ""

    def apart(way: int) -> NDArray[np.float64]:
        """Squares (N,) of what the readings are apart from an ideal bench that is read so [g²]."""
        turn, permutation = divmod(int(way), len(PERMUTATIONS))
        return np.square(reading - inputs[turn] @ PERMUTATIONS[permutation].T).sum(axis=1)

    as_read, better = apart(0), apart(same[0])
    if _changes(better - as_read):
        return ""
    ways = []
    for turn, permutation in (divmod(int(way), len(PERMUTATIONS)) for way in same):
        unit, alpha, beta = TURNS[turn]
        matrix = PERMUTATIONS[permutation]
        channels = Channels(reading_of(matrix), alpha=alpha, beta=beta, radians=unit != 1.0)
        ways.append((channels, _mounting(matrix, p, channels)))
    return (
        f"{record.path}: the readings are {digits(np.sqrt(as_read.mean()), 2)} g rms from those of an ideal bench, and "
        f"{digits(np.sqrt(better.mean()), 2)} g when they are read with {advice(ways, record.channels)}"
    )


def _changes(gains: NDArray[np.float64]) -> bool:
    """Whether the first or the last rows, but for one, gain more than `CHANGES` as they are read; gains (N,) [g²]."""
    return any(
        bool(np.any(np.cumsum(rows) - np.maximum.accumulate(np.maximum(rows, 0.0)) > CHANGES))
        for rows in (gains, gains[::-1])
    )


def costs_of(reading: NDArray, inputs: Sequence[NDArray]) -> tuple[NDArray[np.float64], float]:
    """Costs of every signed permutation with each of some inputs (N, 3), one after the other; the usual misfit [g].

    That is what the best of the inputs leaves with any linear map to readings (N, 3), and not less than `LEAST_MISFIT`.
    """
    designs = [np.hstack([one, np.ones((len(one), 1))]) for one in inputs]
    scale = max(LEAST_MISFIT, min(_left(design, reading) for design in designs))
    of_rows = [_costs(design, reading, scale) for design in designs]
    return np.concatenate([table[np.arange(3), PLACES].sum(axis=1) for table in of_rows]), scale


def _left(design: NDArray, reading: NDArray) -> float:
    """Root mean square of what any linear map leaves, by the readings that are more than its parameters [g]."""
    solution, _, rank, _ = np.linalg.lstsq(design, reading, rcond=1e-6)
    if rank >= len(reading):
        return LEAST_MISFIT
    return float(np.sqrt(np.square(reading - design @ solution).sum() / (3 * (len(reading) - rank))))


def _costs(design: NDArray, reading: NDArray, scale: float) -> NDArray[np.float64]:
    """Least penalised squares (3, 6) of each reading taken for each input, and for each input reversed."""
    both = np.hstack([reading, design[:, :3]])
    across = design.T @ both
    normal = design.T @ design + (scale / USUAL) ** 2 * np.eye(4)
    left = (both.T @ both - across.T @ np.linalg.solve(normal, across)) / scale**2
    own, mixed, of_inputs = np.diag(left)[:3, None], left[:3, 3:], np.diag(left)[3:]
    return np.hstack([own - 2.0 * mixed + of_inputs, own + 2.0 * mixed + of_inputs])


def _mounting(matrix: NDArray, p: Parametrisation, channels: Channels) -> str:
    """The mounting that a signed permutation with these senses is, too; nothing where it is none."""
    if np.linalg.det(matrix) < 0.0 or np.array_equal(matrix, np.eye(3)):
        return ""
    senses = str(Channels(alpha=channels.alpha, beta=channels.beta, radians=channels.radians))
    beside = f" with {senses}" if senses else ""
    if len(p.matrices) > 1:
        return f"mountings that are {_written(matrix)} times those given{beside}"
    return f"--mounting FILE with matrix = {_written(matrix @ p.matrices[0])}{beside}"


def _written(matrix: NDArray) -> str:
    return str([[round(float(value), 9) + 0.0 for value in row] for row in matrix]).replace(".0", "")
