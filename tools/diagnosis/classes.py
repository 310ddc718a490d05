"""Effects that no measurement on this bench could tell apart form one class."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..calibration.model import Linearisation, Positions, reading_jacobian
from .circumstances import Circumstances
from .disturbance import rows_at, signature_columns

GRID_STEP_DEG = 15.0
SAME_SPACE = 1e-7
"""Largest sine of an angle between two signature spaces that are called the same."""


def residual_spaces(here: Linearisation, places: Sequence[EffectPlace]) -> list[NDArray]:
    """What each effect's signature adds to the nominal model over a dense set of positions, as orthonormal columns.

    The positions cover the sphere with every mounting of the record, no input near zero; times are unrelated to the
    angles. To first order: the model is linearised at a faultless bench.
    """
    degrees = np.arange(0.5 * GRID_STEP_DEG, 360.0, GRID_STEP_DEG)
    mountings = range(len(here.parametrisation.mountings))
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, mountings, indexing="ij"))
    at = Positions(np.radians(alpha), np.radians(beta), mounting.astype(int))
    point = np.zeros(len(here.symbols))
    bench = reading_jacobian(here.parametrisation, point, at).reshape(3 * len(alpha), -1)
    basis = column_space(bench)
    rows = rows_at(here, point, at, varied_circumstances(len(alpha)))
    spaces = []
    for place in places:
        columns = signature_columns([place], rows)
        left = columns - basis @ (basis.T @ columns)
        left[:, np.linalg.norm(left, axis=0) < 1e-9 * np.linalg.norm(columns, axis=0)] = 0.0
        spaces.append(column_space(left))
    return spaces


def varied_circumstances(count: int) -> Circumstances:
    """Times, temperatures and senses in an order that no angle follows."""
    index = np.arange(count)
    # Fractional parts of multiples of irrational numbers fill the unit interval evenly and are unrelated.
    time, temperature, first, second = (index * step % 1.0 for step in (0.618034, 0.414214, 0.732051, 0.236068))
    return Circumstances(
        time, 20.0 + 10.0 * temperature, np.where(first < 0.5, -1.0, 1.0), np.where(second < 0.5, -1.0, 1.0), True
    )


def column_space(columns: NDArray) -> NDArray:
    """Orthonormal basis of the space that columns span."""
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, values > 1e-9 * values.max(initial=0.0)] if values.max(initial=0.0) > 0.0 else u[:, :0]


def same_space(a: NDArray, b: NDArray) -> bool:
    """Whether two orthonormal bases span the same space."""
    return a.shape == b.shape and float(np.linalg.norm(a - b @ (b.T @ a), 2)) < SAME_SPACE


@dataclass(frozen=True)
class Classes:
    """Effects that can be told apart at all, and what each stands for.

    Attributes
    ----------
    places : tuple of EffectPlace
        one of each class, in the order of the catalogue; effects that lie wholly in the nominal model are left out
    members : tuple of tuple of EffectPlace
        the others of each class
    spaces : tuple of array
        what each adds to the nominal model, as orthonormal columns over a dense set of positions
    """

    places: tuple[EffectPlace, ...]
    members: tuple[tuple[EffectPlace, ...], ...]
    spaces: tuple[NDArray, ...]

    def equivalents(self, place: EffectPlace) -> tuple[EffectPlace, ...]:
        """What no measurement with these mountings could tell from the effect at `place`."""
        return tuple(other for other in self.whole_class(place) if other != place)

    def whole_class(self, place: EffectPlace) -> tuple[EffectPlace, ...]:
        """The class of an effect; it alone where it is in none."""
        every = ((first, *members) for first, members in zip(self.places, self.members, strict=True))
        return next((members for members in every if place in members), (place,))

    def joint_space(self, places: Sequence[EffectPlace]) -> NDArray:
        """What a set of effects adds to the nominal model together."""
        return column_space(np.hstack([self.spaces[self.places.index(self.whole_class(place)[0])] for place in places]))


def classes_of(here: Linearisation, places: Sequence[EffectPlace]) -> Classes:
    """Sort effects into classes by what they add to the nominal model at any positions with these mountings."""
    firsts: list[EffectPlace] = []
    spaces: list[NDArray] = []
    members: list[list[EffectPlace]] = []
    for place, space in zip(places, residual_spaces(here, places), strict=True):
        if space.shape[1] == 0:
            continue
        same = next((k for k, other in enumerate(spaces) if same_space(space, other)), None)
        if same is None:
            firsts.append(place)
            spaces.append(space)
            members.append([])
        else:
            members[same].append(place)
    return Classes(tuple(firsts), tuple(tuple(m) for m in members), tuple(spaces))
