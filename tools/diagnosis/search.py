"""The smallest sets of effects with which the simulation can be true of a record, and which of them are alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.programmes import cosine, same_space, spaces_beyond
from ..bounded.sets import MAX_SET, CutOff, Work
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..progress import tracked

MOST_FOUND = 60
"""So many sets of one size are enough to say that the record cannot decide."""
MOST_WORK = 8e6
"""The work of a search, after which it is cut off: some eight seconds of one processor; in a long record more."""
MOST_COMPARED = 10


@dataclass(frozen=True, eq=False)
class Found:
    """The smallest sets that explain a record, the least radius first; the model without effects where it stands.

    `complete`: whether they are all; else the search was cut off among sets of `size` effects, all smaller ones being
    tried.
    """

    fits: tuple[Fit, ...]
    complete: bool = True
    size: int = 0

    @property
    def is_sample(self) -> bool:
        """Whether work ended the search among sets of several effects: what was found are some of many.

        Beside a function of one quantity at one place that is as simple they are no answer.
        """
        return not self.complete and self.size > 1 and len(self.fits) < MOST_FOUND

    @property
    def told(self) -> Mapping[str, Any]:
        """Keys of the result where the search was cut off."""
        return {} if self.complete else {"complete": False, "cut_off_at": self.size}


def search(
    evidence: Evidence,
    among: Sequence[EffectPlace] | None = None,
    *,
    progress: bool = False,
    most_work: float = MOST_WORK,
) -> Found:
    """All sets of effects of the smallest size, up to three, with which the model stands; the least radius first.

    Among so many effects, by default those that can be told apart; with so much work that it ends in any case.
    A set that does not mend the record is tried with other members of its effects' classes, too: these differ in the
    second order of their sizes, for which noise at its bound leaves no room.
    """
    work = Work(most_work * evidence.length)
    for size in range(1, MAX_SET + 1):
        found: list[Fit] = []
        complete = True
        try:
            for candidate in tracked(evidence.candidates(size, work, among), f"sets of {size}", show=progress):
                members = product(*(evidence.classes.whole_class(place) for place in candidate))
                found += next((fits for places in members if (fits := evidence.mended(places, work))), ())
                if len(found) >= MOST_FOUND:
                    complete = False
                    break
        except CutOff:
            complete = False
        if found or not complete:
            return Found(tuple(sorted(found, key=lambda fit: (round(fit.radius, 9), fit.title))), complete, size)
    return Found(())


def single_radii(evidence: Evidence) -> tuple[tuple[str, float], ...]:
    """What each single effect leaves, the least first."""
    tried = [(place.title, evidence.alone(place)) for place in evidence.classes.places]
    return tuple(sorted(tried, key=lambda entry: (round(entry[1], 9), entry[0])))


def equivalence_groups(evidence: Evidence, fits: Sequence[Fit]) -> list[list[Fit]]:
    """Sets that cannot be told apart, together; the least radius first."""
    classes = evidence.classes
    groups: list[list[Fit]] = []
    spaces: list[tuple[object, NDArray]] = []
    for fit in fits:
        # Outliers and effects that are not linear are compared by name: they have no space of their own.
        apart = frozenset(place for place in fit.places if classes.whole_class(place)[0] not in classes.places)
        space, named = classes.joint_space([place for place in fit.places if place not in apart]), (apart, fit.signs)
        for group, (others, other) in zip(groups, spaces, strict=True):
            if named == others and same_space(space, other):
                group.append(fit)
                break
        else:
            groups.append([fit])
            spaces.append((named, space))
    return groups


def compared_places(
    places: Sequence[EffectPlace], sets: Sequence[Sequence[EffectPlace]], ranked: Sequence[str]
) -> tuple[EffectPlace, ...]:
    """The effects of the sets that remain, then others in the order of their titles' rank; ten at most."""
    named = {place.title: place for place in places}
    titles = dict.fromkeys([*(place.title for found in sets for place in found), *ranked])
    return tuple(named[title] for title in titles if title in named)[:MOST_COMPARED]


def likeness(evidence: Evidence, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
    """Cosines (K, K) of the least angles between what linear effects add to the model on a record's rows.

    1 where one can be sized to look just like the other, 0 where nothing of it can; a row of zeros for an effect that
    adds nothing here.
    """
    spaces = spaces_beyond(evidence.nominal, [evidence.columns_of([place]) for place in places])
    return np.array([[cosine(a, b) for b in spaces] for a in spaces]).reshape(len(spaces), len(spaces))
