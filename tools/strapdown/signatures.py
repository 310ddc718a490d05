"""Signatures of effects in attitude: what each coefficient does to the carried attitude over a piece of a record.

A gyro that reads δω(t) too much turns the carried attitude, over a piece from t₀ to t₁, by C(t₀)ᵀ ∫ C (I + Γ)⁻¹ δω dt,
in axes of the piece's beginning and to first order. The integrals run once over the record, chunk by chunk.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from .carrying import GyroModel, matrices_of
from .motion import Motion
from .segments import Segments

CHUNK = 30_000
"""Rows at a time: the memory does not grow with the record."""


def integrals(
    motion: Motion, model: GyroModel, attitude: NDArray, places: Sequence[EffectPlace], rows: NDArray
) -> NDArray[np.float64]:
    """∫ C (I + Γ)⁻¹ δω dt from the first row to some rows (B,), per coefficient of all effects: (B, 3, K).

    Parameters
    ----------
    motion : Motion
    model : GyroModel
        with which the attitude was carried
    attitude : (N, 4) array
        carried, scalar first
    places : sequence of EffectPlace
    rows : (B,) array of int
        in rising order
    """
    inverse = model.inverse
    found: list[NDArray] = []
    total: NDArray | None = None
    for begin in range(1, len(motion), CHUNK):
        end = min(begin + CHUNK, len(motion))
        seen = motion.rows(begin, end, inverse, model.bias)
        columns = np.concatenate([CATALOGUE[p.effect].signature(p, seen) for p in places], axis=2)
        middle = attitude[begin:end] + attitude[begin - 1 : end - 1] * np.sign(
            np.sum(attitude[begin:end] * attitude[begin - 1 : end - 1], axis=1, keepdims=True)
        )
        turn = matrices_of(middle) @ inverse
        grown = np.cumsum(turn @ columns * motion.step[begin:end, None, None], axis=0)
        if total is None:
            total = np.zeros(grown.shape[1:])
            found += [total] * int(np.searchsorted(rows, 1))
        within = rows[np.searchsorted(rows, begin) : np.searchsorted(rows, end)] - begin
        found += list(total + grown[within])
        total = total + grown[-1]
    return np.array(found)


def means_at_rest(
    motion: Motion, model: GyroModel, places: Sequence[EffectPlace], rests: Sequence[slice]
) -> NDArray[np.float64]:
    """What each coefficient adds to the gyros' mean over all rests, (3, K) [rad/s]."""
    total, count = None, 0
    for rows in rests:
        for begin in range(max(rows.start, 1), rows.stop, CHUNK):
            end = min(begin + CHUNK, rows.stop)
            seen = motion.rows(begin, end, model.inverse, model.bias)
            added = np.concatenate([CATALOGUE[p.effect].signature(p, seen).sum(axis=0) for p in places], axis=1)
            total = added if total is None else total + added
            count += end - begin
    size = sum(len(CATALOGUE[p.effect].at(p).parameters) for p in places)
    return np.zeros((3, size)) if total is None else total / count


def piece_columns(parts: Segments, attitude: NDArray, rows: NDArray, integral: NDArray) -> NDArray[np.float64]:
    """Signatures (S, 3, K) in axes of each piece's beginning, from the integrals (B, 3, K) at rows (B,)."""
    before, after = (np.searchsorted(rows, at) for at in (parts.first, parts.last))
    start = matrices_of(attitude[parts.first])
    return start.transpose(0, 2, 1) @ (integral[after] - integral[before])


def turned(parts: Segments, attitude: NDArray) -> NDArray[np.float64]:
    """Rotation (S, 3, 3) of each piece by the carried attitude: body at its end to body at its beginning."""
    start, end = matrices_of(attitude[parts.first]), matrices_of(attitude[parts.last])
    return start.transpose(0, 2, 1) @ end
