"""The linear system of a strapdown record: errors of the carried attitude, their bounds, and what each effect adds.

error = nominal · x + columns · c + noise within the bounds, in radians, about one run of the simulation. Errors are
computed less true: what a gyro reads too much turns the computed attitude too far.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from .segments import Segments


@dataclass(frozen=True, eq=False)
class Part:
    """Errors of one kind, of S pieces with d components each.

    Attributes
    ----------
    segments : Segments
        the pieces; of norms the rests
    error, bound : (S, d) array
        [rad]
    nominal : (S, d, P) array
        by the parameters of the baseline
    columns : (S, d, K) array
        by the coefficients of the effects
    scored : bool
        whether these are the errors that the simulation is judged by: of the attitude over moves or windows
    """

    segments: Segments
    error: NDArray[np.float64]
    bound: NDArray[np.float64]
    nominal: NDArray[np.float64]
    columns: NDArray[np.float64]
    scored: bool

    def __len__(self) -> int:
        return len(self.error)

    @property
    def label(self) -> str:
        """In words."""
        return self.segments.label

    def selected(self, index: NDArray) -> "Part":
        """The same with some of the pieces (mask or numbers)."""
        index = np.arange(len(self))[index]
        return Part(
            self.segments.selected(index),
            self.error[index],
            self.bound[index],
            self.nominal[index],
            self.columns[index],
            self.scored,
        )


@dataclass(frozen=True, eq=False)
class System:
    """All parts, with the names of their columns.

    Attributes
    ----------
    parts : tuple of Part
    names : tuple of (str, str)
        name and unit of each parameter of the baseline
    point : (P,) array
        values of these parameters about which the system is linear
    places : tuple of EffectPlace
        effects that can be tried
    blocks : tuple of slice
        the columns of each
    """

    parts: tuple[Part, ...]
    names: tuple[tuple[str, str], ...]
    point: NDArray[np.float64]
    places: tuple[EffectPlace, ...]
    blocks: tuple[slice, ...]

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Errors over their bounds (M,)."""
        return _joined([part.error / part.bound for part in self.parts])

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Columns (M, P) of the baseline over the bounds."""
        return _rows([part.nominal / part.bound[..., None] for part in self.parts], len(self.names))

    @cached_property
    def columns(self) -> NDArray[np.float64]:
        """Columns (M, K) of all effects over the bounds."""
        count = self.blocks[-1].stop if self.blocks else 0
        return _rows([part.columns / part.bound[..., None] for part in self.parts], count)

    @cached_property
    def scored(self) -> NDArray[np.bool_]:
        """Rows (M,) that the simulation is judged by."""
        return _joined([np.full(part.error.shape, part.scored) for part in self.parts])

    def columns_of(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Columns (M, k) of some effects over the bounds."""
        return self.columns[:, self.numbers_of(places)]

    def numbers_of(self, places: Sequence[EffectPlace]) -> NDArray[np.int_]:
        """Numbers of the columns of some effects."""
        chosen = [self.blocks[self.places.index(place)] for place in places]
        return np.concatenate([np.arange(b.start, b.stop) for b in chosen]) if chosen else np.zeros(0, dtype=int)

    def matrix(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Columns of the baseline and of some effects (M, P + k)."""
        return np.hstack([self.nominal, self.columns_of(places)])

    def limits_of(self, places: Sequence[EffectPlace]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ends of the possible values of each coefficient of some effects."""
        parameters = [p for place in places for p in CATALOGUE[place.effect].at(place).parameters]
        low = [-p.largest if p.smallest is None else p.smallest for p in parameters]
        return np.array(low, dtype=float), np.array([p.largest for p in parameters], dtype=float)

    def of_parts(self, wanted: Sequence[int]) -> "System":
        """The system of some parts."""
        return replace(self, parts=tuple(self.parts[k] for k in wanted))

    def with_places(self, kept: Sequence[EffectPlace]) -> "System":
        """The system with some of the effects."""
        numbers = self.numbers_of(kept)
        blocks, start = [], 0
        for place in kept:
            size = self.blocks[self.places.index(place)]
            blocks.append(slice(start, start + size.stop - size.start))
            start = blocks[-1].stop
        parts = tuple(replace(part, columns=part.columns[..., numbers]) for part in self.parts)
        return replace(self, parts=parts, places=tuple(kept), blocks=tuple(blocks))


def _joined(values: Sequence[NDArray]) -> NDArray:
    return np.concatenate([value.ravel() for value in values])


def _rows(values: Sequence[NDArray], count: int) -> NDArray:
    return np.concatenate([value.reshape(value.shape[0] * value.shape[1], count) for value in values])


def weighted_step(matrix: NDArray, residual: NDArray) -> NDArray[np.float64]:
    """Least squares of rows in units of their bounds; directions that nothing determines stay where they are."""
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(matrix / scale, residual, rcond=1e-10)[0] / scale
