"""A pool of table positions on which lower bounds are proven, closed under the symmetries of the problem."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .places import Places, Readings, Task, allowed, readings
from .symmetry import symmetries

OFFSETS_DEG = (0.0, 1.4, 2.5, 5.0, 10.0, 20.0, 30.0, 45.0)
"""Distances of the pool's lines from the multiples of 90° of both axes."""


@dataclass(frozen=True)
class Pool:
    """Positions, grouped with their images.

    Attributes
    ----------
    places : Places
        n of them
    orbit : (n,) array of int
        which group each belongs to
    readings : Readings
        of all positions, in their order
    """

    places: Places
    orbit: NDArray
    readings: Readings

    @property
    def orbits(self) -> int:
        """Number of groups."""
        return int(self.orbit.max()) + 1

    def heights(self, duals: NDArray) -> NDArray:
        """The greatest |F'y| over the readings of each position, (n, D) for duals (D, P)."""
        first = np.searchsorted(self.readings.position, np.arange(len(self.places)))
        return np.maximum.reduceat(np.abs(self.readings.regressor @ duals.T), first, axis=0)

    @property
    def description(self) -> str:
        """What it is, in words."""
        return f"pool of {len(self.places)} positions"


def pool_of(task: Task, extra: Places | None = None) -> Pool:
    """Crossings of lines at fixed distances from the multiples of 90°, optimal plans, other positions; all images too.

    Positions in a keep-out, and those where no reading counts, are left out.

    Parameters
    ----------
    extra : Places or None
        positions that are to be in the pool too
    """
    offsets = np.array(sorted({sign * offset for offset in OFFSETS_DEG for sign in (1.0, -1.0)}))
    lines = np.unique(np.mod((90.0 * np.arange(4)[:, None] + offsets).ravel(), 360.0))
    grid = np.radians(np.stack(np.meshgrid(lines, lines, indexing="ij"), axis=-1).reshape(-1, 2))
    mountings = range(len(task.parametrisation.mountings))
    angle = np.concatenate([grid for _ in mountings])
    mounting = np.repeat(np.arange(len(mountings)), len(grid))
    if len(task.support):
        angle = np.concatenate([angle, *[task.support for _ in mountings]])
        mounting = np.concatenate([mounting, np.repeat(np.arange(len(mountings)), len(task.support))])
    if extra is not None:
        angle, mounting = np.concatenate([angle, extra.angle]), np.concatenate([mounting, extra.mounting])
    group = symmetries(task)
    images = np.stack([np.round(np.mod(np.degrees(s.of(angle)), 360.0), 9) % 360.0 for s in group], axis=1)
    keys = np.concatenate([np.broadcast_to(mounting[:, None, None], (*images.shape[:2], 1)), images], axis=2)
    least = np.array([min(map(tuple, of_one)) for of_one in keys])
    _, orbit = np.unique(least, axis=0, return_inverse=True)
    every, first = np.unique(keys.reshape(-1, 3), axis=0, return_index=True)
    places = Places(np.radians(every[:, 1:]), every[:, 0].astype(int))
    orbit = np.repeat(orbit.ravel(), len(group))[first]
    read = np.unique(readings(task, places).position)
    read = read[allowed(task, places.angle[read])]
    _, orbit = np.unique(orbit[read], return_inverse=True)
    places = places.chosen(read)
    return Pool(places, orbit.ravel(), readings(task, places))
