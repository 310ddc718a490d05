"""How alike effects look at the positions of a record: what could be taken for what."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..calibration.model import Linearisation
from .circumstances import Circumstances
from .classes import column_space
from .disturbance import rows_at, signature_columns

NOTHING = 1e-9
"""Columns of which so little is left, relatively, are imitated."""


def likeness(here: Linearisation, circumstances: Circumstances, places: Sequence[EffectPlace]) -> NDArray:
    """Cosines of the least angles between what effects add to the nominal model at a record's positions.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of its rows
    places : sequence of EffectPlace
        linear effects

    Returns
    -------
    (K, K) array
        1 where one can be chosen to look just like the other, 0 where nothing of it can; a row of zeros for an effect
        that adds nothing here
    """
    rows = rows_at(here, here.point, here.positions, circumstances)
    return cosines(here.jacobian, [signature_columns([place], rows) for place in places])


def cosines(imitated: NDArray, columns: Sequence[NDArray]) -> NDArray[np.float64]:
    """Cosines (K, K) of the least angles between the spaces of K blocks of columns (M, k), less what is imitated.

    Parameters
    ----------
    imitated : (M, P) array
        columns whose space is taken out of all the others
    columns : sequence of (M, k) array
    """
    base = column_space(imitated)
    spaces = []
    for block in columns:
        left = block - base @ (base.T @ block)
        left[:, np.linalg.norm(left, axis=0) < NOTHING * np.linalg.norm(block, axis=0)] = 0.0
        spaces.append(column_space(left))
    alike = np.zeros((len(spaces), len(spaces)))
    for i, first in enumerate(spaces):
        for j, second in enumerate(spaces):
            if first.shape[1] and second.shape[1]:
                alike[i, j] = min(1.0, float(np.linalg.norm(first.T @ second, 2)))
    return alike
