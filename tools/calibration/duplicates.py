"""Repeated positions whose readings differ by more than noise can do: a contradiction whatever the model is."""

import numpy as np
from numpy.typing import NDArray

from .linearisation import Linearisation


def contradiction(here: Linearisation, number: NDArray, limit: float) -> str | None:
    """One sentence on the worst contradiction between readings at exactly the same angles in the same mounting.

    Parameters
    ----------
    here : Linearisation
    number : (N,) array of int
        the record's position numbers
    limit : float
        how far two such readings may be apart, as a fraction of g
    """
    at = here.positions
    _, label = np.unique(np.stack([at.alpha, at.beta, at.mounting], axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    reading = here.reading[order]
    spread = np.maximum.reduceat(reading, starts) - np.minimum.reduceat(reading, starts)
    group, axis = np.unravel_index(int(np.argmax(spread)), spread.shape)
    if spread[group, axis] <= limit:
        return None
    rows = order[label[order] == label[order[starts[group]]]]
    values = here.reading[rows, axis]
    first, second = sorted((int(number[rows[values.argmin()]]), int(number[rows[values.argmax()]])))
    return (
        f"positions {first} and {second} are the same, but accelerometer {axis + 1} reads {spread[group, axis]:.2g} g "
        "differently there, more than two noise bounds: no model explains that"
    )
