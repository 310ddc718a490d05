"""The search for the smallest sets of effects that explain a record, and how alike effects look in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import MAX_SET
from ..bounded.spaces import cosine, same_space, spaces_beyond
from ..evidence.evidence import Evidence, Fit
from ..progress import tracked

MOST_FOUND = 60
"""So many sets of one size are enough to say that the record cannot decide."""
MOST_JUDGED = 1500
"""So many sets of one size are fitted exactly before the search gives up."""
MOST_COMPARED = 10


@dataclass(frozen=True, eq=False)
class Found:
    """The smallest sets that explain a record.

    Attributes
    ----------
    fits : tuple of Fit
        the least radius first; the model without effects where it stands
    complete : bool
        whether they are all; else the search was cut off
    """

    fits: tuple[Fit, ...]
    complete: bool = True


def search(evidence: Evidence, among: Sequence[EffectPlace] | None = None, *, progress: bool = False) -> Found:
    """All sets of effects of the smallest size, up to three, with which the model stands; the least radius first.

    Among so many effects, by default those that can be told apart.
    A set that does not mend the record is tried with other members of its effects' classes, too: these differ in the
    second order of their sizes, for which noise at its bound leaves no room.
    """
    for size in range(1, MAX_SET + 1):
        found: list[Fit] = []
        complete = True
        candidates = tracked(evidence.candidates(size, among), f"sets of {size}", show=progress)
        for judged, candidate in enumerate(candidates, start=1):
            members = product(*(evidence.classes.whole_class(place) for place in candidate))
            fit = next((fit for places in members if (fit := evidence.mended(places)) is not None), None)
            found += [] if fit is None else [fit]
            if len(found) >= MOST_FOUND or judged >= MOST_JUDGED:
                complete = False
                break
        if found or not complete:
            return Found(tuple(sorted(found, key=lambda fit: (round(fit.radius, 9), fit.title))), complete)
    return Found(())


def single_radii(evidence: Evidence) -> tuple[tuple[str, float], ...]:
    """What each single effect leaves, the least first."""
    tried = [(place.title, evidence.alone(place)) for place in evidence.classes.places]
    return tuple(sorted(tried, key=lambda entry: (round(entry[1], 9), entry[0])))


def equivalence_groups(evidence: Evidence, fits: Sequence[Fit]) -> list[list[Fit]]:
    """Sets that cannot be told apart, together; the least radius first."""
    classes = evidence.classes
    groups: list[list[Fit]] = []
    spaces: list[tuple[frozenset[EffectPlace], NDArray]] = []
    for fit in fits:
        # Outliers and effects that are not linear are compared by name: they have no space of their own.
        apart = frozenset(place for place in fit.places if classes.whole_class(place)[0] not in classes.places)
        space = classes.joint_space([place for place in fit.places if place not in apart])
        for group, (others, other) in zip(groups, spaces, strict=True):
            if apart == others and same_space(space, other):
                group.append(fit)
                break
        else:
            groups.append([fit])
            spaces.append((apart, space))
    return groups


def compared_places(
    places: Sequence[EffectPlace], sets: Sequence[Sequence[EffectPlace]], ranked: Sequence[str]
) -> tuple[EffectPlace, ...]:
    """The effects of the sets that remain, then others in the order of their titles' rank; ten at most."""
    named = {place.title: place for place in places}
    titles = dict.fromkeys([*(place.title for found in sets for place in found), *ranked])
    return tuple(named[title] for title in titles if title in named)[:MOST_COMPARED]


def likeness(evidence: Evidence, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
    """Cosines of the least angles between what linear effects add to the model on a record's rows.

    Returns
    -------
    (K, K) array
        1 where one can be sized to look just like the other, 0 where nothing of it can; a row of zeros for an effect
        that adds nothing here
    """
    spaces = spaces_beyond(evidence.nominal, [evidence.columns_of([place]) for place in places])
    return np.array([[cosine(a, b) for b in spaces] for a in spaces]).reshape(len(spaces), len(spaces))
