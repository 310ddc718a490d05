"""How alike effects look in a strapdown record: what could be taken for what."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..diagnosis.likeness import cosines
from ..evidence.evidence import Evidence

MOST_COMPARED = 10


def compared_places(
    places: Sequence[EffectPlace], sets: Sequence[Sequence[EffectPlace]], ranked: Sequence[str]
) -> tuple[EffectPlace, ...]:
    """The effects of the sets that remain, then others in the order of their titles' rank; ten at most."""
    named = {place.title: place for place in places}
    titles = dict.fromkeys([*(place.title for found in sets for place in found), *ranked])
    return tuple(named[title] for title in titles if title in named)[:MOST_COMPARED]


def likeness(system: Evidence, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
    """Cosines of the least angles between what effects add to the errors, beyond what the baseline imitates.

    Parameters
    ----------
    system : Evidence
    places : sequence of EffectPlace
        effects of the system

    Returns
    -------
    (K, K) array
        1 where one can be sized to look just like the other, 0 where nothing of it can; a row of zeros for an effect
        that adds nothing here
    """
    return cosines(system.nominal, [system.columns_of([place]) for place in places])
