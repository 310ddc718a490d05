"""Turns and reflections of both angles that leave the planning problem as it is."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .forms import basis
from .places import Places, Task, clearances

SAMPLES = 40
"""Positions, drawn at random, at which a symmetry is checked: forms of nine terms are the same if they agree there."""
EQUAL = 1e-11


@dataclass(frozen=True)
class Symmetry:
    """θ → sense θ + shift, for both angles.

    Attributes
    ----------
    sense : (2,) array
        ±1
    shift : (2,) array
        0 or π [rad]
    """

    sense: NDArray
    shift: NDArray

    def of(self, angle: NDArray) -> NDArray:
        """Images (N, 2) of positions (N, 2) [rad]."""
        return np.mod(self.sense * angle + self.shift, 2.0 * np.pi)


def symmetries(task: Task) -> list[Symmetry]:
    """Of the sixteen candidates, those that map readings to readings and targets to targets, up to signs.

    The cost of every target on a set of positions and on its image under one of these is then that of a target with
    the same optimum: what is proven of a set holds for its images. Keep-outs are not looked at.
    """
    rng = np.random.default_rng(1)
    angle = rng.uniform(0.0, 2.0 * np.pi, (SAMPLES, 2))
    found = []
    for senses in product((1.0, -1.0), repeat=2):
        for shifts in product((0.0, np.pi), repeat=2):
            symmetry = Symmetry(np.array(senses), np.array(shifts))
            if _holds(task, symmetry, angle):
                found.append(symmetry)
    return found


def _holds(task: Task, symmetry: Symmetry, angle: NDArray) -> bool:
    """Whether F at the images, times a sign for each accelerometer, is F with its parameters in another order."""
    here, there = (_of_all_mountings(task, a) for a in (angle, symmetry.of(angle)))
    if np.abs(here[1] - there[1]).max() > EQUAL:
        return False
    for signs in product((1.0, -1.0), repeat=2):
        turned = there[0] * np.array([1.0, *signs])[None, :, None]
        mixed = _permutation(here[0].reshape(-1, here[0].shape[2]), turned.reshape(-1, here[0].shape[2]))
        if mixed is not None and _targets_stay(task, mixed):
            return True
    return False


def _of_all_mountings(task: Task, angle: NDArray) -> tuple[NDArray, NDArray]:
    mountings = range(len(task.parametrisation.mountings))
    found = [_regressors_and_clearances(task, Places(angle, np.full(len(angle), k))) for k in mountings]
    return np.concatenate([f for f, _ in found]), np.concatenate([clear for _, clear in found])


def _regressors_and_clearances(task: Task, places: Places) -> tuple[NDArray, NDArray]:
    """F (N, 3, P) of the sheet with the larger clearance, and that clearance (N, 3)."""
    clear = clearances(task, places)
    a, b = basis(places.angle[:, 0]), basis(places.angle[:, 1])
    f = np.einsum("spij,ni,nj->nsp", task.regressor, a, b, optimize=True)
    regressor, best = np.zeros((len(places), 3, f.shape[2])), np.zeros((len(places), 3))
    for p in range(3):
        own = np.flatnonzero((task.accelerometer == p) & (task.mounting == places.mounting[0]))
        pick = own[clear[:, own].argmax(axis=1)]
        regressor[:, p] = f[np.arange(len(places)), pick]
        best[:, p] = clear[np.arange(len(places)), pick]
    return regressor, best


def _permutation(here: NDArray, there: NDArray) -> NDArray | None:
    """D (P, P), a permutation with signs, with there = here D; None where there is none."""
    size = here.shape[1]
    mixed = np.zeros((size, size))
    for column in range(size):
        for sign in (1.0, -1.0):
            same = np.abs(here - sign * there[:, column : column + 1]).max(axis=0) < EQUAL
            if same.sum() == 1:
                mixed[int(same.argmax()), column] = sign
    return mixed if (np.abs(mixed).sum(axis=0) == 1).all() and (np.abs(mixed).sum(axis=1) == 1).all() else None


def _targets_stay(task: Task, mixed: NDArray) -> bool:
    weights = task.weights
    for moved in weights @ mixed:
        near = np.minimum(np.abs(weights - moved).max(axis=1), np.abs(weights + moved).max(axis=1))
        if near.min() > EQUAL:
            return False
    return True
