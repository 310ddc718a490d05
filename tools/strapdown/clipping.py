"""Rests at which an accelerometer is at its limit: their means are no specific force."""

import numpy as np
from numpy.typing import NDArray

LEAST_SHARE = 0.02
"""A channel without a limit is at its extreme in fewer rows of a rest."""
MORE_THAN_USUAL = 3.0
"""A channel that shows steps repeats its values in every rest; at a limit it does so many times as much."""


def clipped_rests(force: NDArray[np.float64], rests: list[slice]) -> NDArray[np.bool_]:
    """Rests (K,) in which an accelerometer often reads its largest or its least value of the record, and elsewhere not.

    Parameters
    ----------
    force : (N, 3) array
        readings, in any unit
    rests : list of slice
        rows of each rest
    """
    found = np.zeros(len(rests), dtype=bool)
    for values in force.T:
        extremes = (values.max(initial=-np.inf), values.min(initial=np.inf))
        at_limit = np.array([max(np.mean(values[rows] == extreme) for extreme in extremes) for rows in rests])
        suspects = at_limit > LEAST_SHARE
        others = [
            share_of_commonest(values[rows]) for rows, suspect in zip(rests, suspects, strict=True) if not suspect
        ]
        if others and suspects.any():
            found |= suspects & (at_limit > MORE_THAN_USUAL * np.median(others))
    return found


def share_of_commonest(values: NDArray[np.float64]) -> float:
    """Part of the values (n,) that are the commonest one."""
    return float(np.unique(values, return_counts=True)[1].max() / len(values))
