"""The system of a record without truth: gravity is the reference.

At each rest the accelerometers show the direction of gravity and its size, and the gyros must not turn. Over each move
the simulation carries the direction to the next rest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.effects import CATALOGUE, EffectPlace, Rows
from ...models.turntable import EARTH_RATE
from .bounds import GyroNoise, factor_for
from .norm_calibration import COLUMNS, NAMES, ROWS, block_of, inputs_of, norm_equations
from .rests import Rests
from .segments import MOST_SEGMENTS, Segments, all_rows, move_segments, rest_segments
from .signatures import piece_columns, turned
from .system import Part

TOGETHER = (1, 2, 3)
"""Moves between neighbouring rests, and over two and three rests."""
EARTH = 1.0
"""So many times Earth's rate widens the bounds: the gyros' bias is free, so only its change between poses counts."""


@dataclass(frozen=True, eq=False)
class Poses:
    """What the accelerometers say at the rests.

    Attributes
    ----------
    n, up : (K, 3) array
        inputs [g] and their directions
    inverse : (3, 3) array
        (I + Γ)⁻¹ of the accelerometers
    deviation : (K, 3) array
        standard deviation of the readings [g]
    slopes : (K, 3, P + E) array
        how the inputs computed change with the nine parameters, then with the coefficients of static effects
    norm, norm_deviation : (K,) array
        |n| − 1 and its standard deviation [g]
    """

    n: NDArray[np.float64]
    up: NDArray[np.float64]
    inverse: NDArray[np.float64]
    deviation: NDArray[np.float64]
    slopes: NDArray[np.float64]
    norm: NDArray[np.float64]
    norm_deviation: NDArray[np.float64]


def poses_of(x: NDArray, rests: Rests, deviation: NDArray, gravity: float, places: Sequence[EffectPlace]) -> Poses:
    """The poses, with accelerometers of nine parameters (9,) and readings of known deviation (K, 3) [g]."""
    reading = rests.force / gravity
    n = inputs_of(x, reading)
    norm, _, back = norm_equations(x, reading)
    matrix, _ = block_of(x)
    inverse = np.linalg.inv(matrix)
    by_parameters = np.zeros((len(n), 3, len(NAMES)))
    for k, (p, q) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        by_parameters[:, p, k] = n[:, q]
    by_parameters[:, :, 6:] = np.eye(3)
    of_effects = [force_columns(place, n, rests) for place in places]
    # Readings too large by s, by an effect or a parameter larger in truth, make inputs too large by (I + Γ)⁻¹ s.
    slopes = inverse @ np.concatenate([by_parameters, *of_effects], axis=2)
    up = n / np.linalg.norm(n, axis=1)[:, None]
    return Poses(n, up, inverse, deviation, slopes, norm, np.sqrt((back**2 * deviation**2).sum(axis=1)))


def force_columns(place: EffectPlace, n: NDArray, rests: Rests) -> NDArray[np.float64]:
    """Signature (K, 3, k) of a static effect of the accelerometers at inputs (K, 3) [g]."""
    rows = Rows(
        hours=(rests.time_s - rests.time_s[:1]) / 3600.0,
        alpha=np.zeros(len(n)),
        beta=np.zeros(len(n)),
        n=n,
        by_alpha=np.zeros_like(n),
        by_beta=np.zeros_like(n),
        temperature=rests.temperature,
    )
    return CATALOGUE[place.effect].at(place).signature(place, rows)


def directions_of(
    x: NDArray, rests: Rests, gravity: float, effects: Mapping[EffectPlace, tuple[float, ...]]
) -> NDArray[np.float64]:
    """Directions of gravity (K, 3) at the rests, with accelerometers of nine parameters and effects of such sizes."""
    reading = rests.force / gravity
    n = inputs_of(x, reading)
    for _ in range(2 if effects else 0):
        added = sum(force_columns(place, n, rests) @ np.array(values) for place, values in effects.items())
        n = inputs_of(x, reading - added)
    return n / np.linalg.norm(n, axis=1)[:, None]


def norm_rows(poses: Poses, rests: Rests) -> tuple[Segments, NDArray, NDArray, NDArray]:
    """The rests, |n| − 1 (K, 1), its deviation and its slopes (K, 1, 9 + E)."""
    first = np.array([rows.start for rows in rests.rows], dtype=int)
    last = np.array([rows.stop - 1 for rows in rests.rows], dtype=int)
    slopes = np.einsum("kp,kpc->kc", poses.up, poses.slopes)[:, None, :]
    return Segments("norms", "norms", first, last), poses.norm[:, None], poses.norm_deviation[:, None], slopes


def across(up: NDArray) -> NDArray[np.float64]:
    """Two unit vectors across each direction (S, 3): (S, 2, 3)."""
    least = np.eye(3)[np.argmin(np.abs(up), axis=1)]
    first = np.cross(up, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(up, first)], axis=1)


def move_errors(
    rotation: NDArray, before: NDArray, after: NDArray, about: NDArray | None = None
) -> NDArray[np.float64]:
    """Errors (S, 2) of directions (S, 3) after moves, carried back by rotations (S, 3, 3), across those before.

    The two axes are those across `about` (S, 3), where other directions were known before.
    """
    carried = np.einsum("sij,sj->si", rotation, after)
    return np.einsum("skp,sp->sk", across(before if about is None else about), carried - before)


@dataclass(frozen=True, eq=False)
class GravityPieces:
    """The pieces of a record without truth, and the rests at their ends."""

    rests: Segments
    rest_numbers: NDArray[np.int_]
    moves: tuple[Segments, ...]
    ends: tuple[NDArray[np.int_], ...]

    @property
    def rows(self) -> NDArray[np.int_]:
        """Every row at which a piece begins or ends."""
        return all_rows([self.rests, *self.moves])


def spread(moves: Segments, ends: NDArray) -> tuple[Segments, NDArray[np.int_]]:
    """All single moves; of more moves over several rests so many, spread over the record: they say much the same."""
    if len(moves) <= MOST_SEGMENTS or moves.label == "1 move":
        return moves, ends
    kept = np.linspace(0, len(moves) - 1, MOST_SEGMENTS).round().astype(int)
    return moves.selected(kept), ends[kept]


def gravity_pieces(rests: Rests, broken: NDArray) -> GravityPieces:
    """Rests, and moves over one, two and three rests."""
    still, numbers = rest_segments(rests, broken)
    found = [move_segments(rests, broken, together) for together in TOGETHER]
    found = [spread(moves, ends) for moves, ends in found if len(moves)]
    return GravityPieces(still, numbers, tuple(m for m, _ in found), tuple(e for _, e in found))


def gravity_parts(
    pieces: GravityPieces,
    poses: Poses,
    rests: Rests,
    attitude: NDArray,
    integral: NDArray,
    gyro_parameters: int,
    noise: GyroNoise,
    time_s: NDArray,
) -> list[Part]:
    """The parts of the system: norms at the rests, turns at rest, moves.

    Parameters
    ----------
    pieces : GravityPieces
    poses : Poses
    rests : Rests
    attitude : (N, 4) array
        carried
    integral : (B, 3, P + K) array
        of the gyros' baseline parameters and effects, at the pieces' rows
    gyro_parameters : int
        P: how many columns of them are the baseline's
    noise : GyroNoise
    time_s : (N,) array
        of the record

    Returns
    -------
    list of Part
        baseline: the accelerometers' nine, then the gyros'; effects: the gyros', then the accelerometers'
    """
    rows = pieces.rows
    acc, split = len(NAMES), gyro_parameters
    effects = integral.shape[2] - split

    def joined(of_forces: NDArray, of_rates: NDArray) -> tuple[NDArray, NDArray]:
        nominal = np.concatenate([of_forces[..., :acc], of_rates[..., :split]], axis=-1)
        return nominal, np.concatenate([of_rates[..., split:], of_forces[..., acc:]], axis=-1)

    count = len(poses.n)
    factor = factor_for(count + 3 * len(pieces.rests) + 2 * sum(len(moves) for moves in pieces.moves))
    segments, norm, deviation, slopes = norm_rows(poses, rests)
    nominal, columns = joined(slopes, np.zeros((count, 1, split + effects)))
    parts = [Part(segments, norm, factor * deviation, nominal, columns, scored=False)]
    still = pieces.rests
    if len(still):
        by_rates = piece_columns(still, attitude, rows, integral)
        nominal, columns = joined(np.zeros((len(still), 3, poses.slopes.shape[2])), by_rates)
        error = small_turns(turned(still, attitude))
        seconds = still.durations(time_s)
        limit = factor * np.sqrt(noise.angle_square(seconds)) + EARTH * EARTH_RATE * seconds
        parts.append(Part(still, error, np.repeat(limit[:, None], 3, axis=1), nominal, columns, scored=False))
    for moves, ends in zip(pieces.moves, pieces.ends, strict=True):
        start, end = ends.T
        rotation, up = turned(moves, attitude), poses.up[start]
        sideways = across(up)
        error = move_errors(rotation, up, poses.up[end])
        # An error e of the attitude moves the direction by e × u: along t by e · (u × t).
        lever = np.cross(up[:, None, :], sideways)
        by_rates = lever @ piece_columns(moves, attitude, rows, integral)
        at_end, at_start = (sideways @ rotation @ _direction(poses, end), sideways @ _direction(poses, start))
        by_forces = at_end @ poses.slopes[end] - at_start @ poses.slopes[start]
        seconds = moves.durations(time_s)[:, None]
        square = _spread(at_end @ poses.inverse, poses.deviation[end]) + noise.angle_square(seconds[:, 0])[:, None]
        square = square + _spread(at_start @ poses.inverse, poses.deviation[start])
        limit = factor * np.sqrt(square) + EARTH * EARTH_RATE * seconds
        nominal, columns = joined(by_forces, by_rates)
        parts.append(Part(moves, error, limit, nominal, columns, scored=True))
    return parts


def _direction(poses: Poses, index: NDArray) -> NDArray:
    """How directions change with the inputs (S, 3, 3): across them, over their size."""
    up, size = poses.up[index], np.linalg.norm(poses.n[index], axis=1)
    return (np.eye(3) - up[:, :, None] * up[:, None, :]) / size[:, None, None]


def _spread(rows: NDArray, deviation: NDArray) -> NDArray:
    """Mean square (S, d) of rows (S, d, 3) of errors with such deviations (S, 3)."""
    return np.einsum("sdp,sp->sd", rows**2, deviation**2)


def small_turns(rotation: NDArray) -> NDArray:
    return Rotation.from_matrix(rotation).as_rotvec() if len(rotation) else np.zeros((0, 3))
