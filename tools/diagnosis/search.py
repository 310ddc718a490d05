"""The smallest sets of effects with which the simulation can be true of a record, and which of them are alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError, cosine, same_space, spaces_beyond
from ..bounded.sets import MAX_SET
from ..bounded.work import CutOff, Work
from ..evidence.evidence import Model
from ..evidence.fit import Fit
from ..evidence.rows import Rows
from ..progress import tracked

MOST_FOUND = 60
"""Number of sets of one size that show that the record cannot decide."""
MOST_WORK = 8e6
"""The work of a search, after which it is cut off: some eight seconds of one processor; in a long record more."""
MOST_COMPARED = 10
MOST_TITLES = 3
"""Most untried sets that a message names."""


@dataclass(frozen=True, eq=False)
class Found:
    """The smallest sets that explain a record, the least radius first; the nominal model if it fits.

    `complete`: whether they are all; else sets of `size` effects were not all tried, all smaller ones being tried.
    `unsolved`: sets that were not tried because no linear programme of them was solved.
    """

    fits: tuple[Fit, ...]
    complete: bool = True
    size: int = 0
    unsolved: tuple[tuple[EffectPlace, ...], ...] = ()

    @property
    def is_sample(self) -> bool:
        """Return true if the work limit ended the search among sets of several effects: others may fit, too.

        Beside a function of one quantity at one place that is as simple they are no answer.
        """
        return not self.complete and self.size > 1 and len(self.fits) < MOST_FOUND

    @property
    def keys(self) -> Mapping[str, Any]:
        """Keys of the result where the search was cut off."""
        return {} if self.complete else {"complete": False, "cut_off_at": self.size}

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sets that were not tried, in a sentence; none where the solver failed on none."""
        if not self.unsolved:
            return ()
        titles = [" and ".join(place.title for place in places) for places in self.unsolved[:MOST_TITLES]]
        further = len(self.unsolved) - len(titles)
        more = f" and {further} more" if further else ""
        return (f"not tried, since the solver failed: {'; '.join(titles)}{more}",)


def search(
    model: Model,
    among: Sequence[EffectPlace] | None = None,
    *,
    progress: bool = False,
    most_work: float = MOST_WORK,
    largest: int = MAX_SET,
) -> Found:
    """Find all sets of effects of the smallest size, up to `largest`, that make the model fit; least radius first.

    `among` are by default the effects that can be told apart. A set that does not mend the record is tried with other
    members of its effects' classes, too. These differ in the second order of their sizes, for which noise at its bound
    leaves no room.
    """
    work = Work(most_work * model.effort.cost)
    unsolved: list[tuple[EffectPlace, ...]] = []
    for size in range(1, largest + 1):
        fits: list[Fit] = []
        complete = True
        try:
            for candidate in tracked(model.candidates(size, work, among), f"sets of {size}", show=progress):
                fits += _mended(model, candidate, work, unsolved)
                if len(fits) >= MOST_FOUND:
                    complete = False
                    break
        except CutOff:
            complete = False
        if fits or not complete:
            if smaller := without_faint(model, fits):
                # All sets of their size were tried.
                fits, complete, size = smaller, True, len(smaller[0].places)
            fits.sort(key=lambda fit: (round(fit.radius, 9), fit.title))
            return _found(fits, complete, size, unsolved)
    return _found((), True, largest, unsolved)


def without_faint(model: Model, fits: Sequence[Fit]) -> list[Fit]:
    """Return the smallest sets that stand without effects that move no reading noticeably; none of other sets.

    With every error at its bound a search may refuse a true set by rounding alone, and return it with one effect more.
    """
    smaller: dict[frozenset[EffectPlace], Sequence[Fit]] = {}
    for fit in fits:
        shown = tuple(place for place in fit.places if place not in fit.faint)
        if shown and len(shown) < len(fit.places) and frozenset(shown) not in smaller:
            smaller[frozenset(shown)] = model.mended(shown, Work())
    standing = [fit for fits_of_set in smaller.values() for fit in fits_of_set]
    least = min((len(fit.places) for fit in standing), default=0)
    return [fit for fit in standing if len(fit.places) == least]


def _found(fits: Sequence[Fit], complete: bool, size: int, unsolved: Sequence[tuple[EffectPlace, ...]]) -> Found:
    """Return the result of a search that ended among sets of one size; incomplete if a set was not tried."""
    if not unsolved:
        return Found(tuple(fits), complete, size if fits or not complete else 0)
    least = min(len(places) for places in unsolved)
    return Found(tuple(fits), False, min(size, least), tuple(unsolved))


def _mended(
    model: Model, candidate: Sequence[EffectPlace], work: Work, unsolved: list[tuple[EffectPlace, ...]]
) -> Sequence[Fit]:
    """Return the fits of the first members of effects' classes that make the model fit.

    If none does, members on which the solver fails are added to the unsolved.
    """
    classes = [model.classes.whole_class(place) for place in candidate]
    failed = []
    for places in product(*classes):
        try:
            if fits := model.mended(places, work):
                return fits
        except SolverError:
            failed.append(places)
    unsolved += failed
    return ()


def single_radii(model: Model) -> tuple[tuple[EffectPlace, float], ...]:
    """Return single effects with the radii that they leave, the least first; not those on which the solver fails."""
    radii = []
    for place in model.classes.places:
        try:
            radii.append((place, model.alone(place)))
        except SolverError:
            continue
    radii.sort(key=lambda entry: (round(entry[1], 9), entry[0].title))
    return tuple(radii)


def equivalence_groups(model: Model, fits: Sequence[Fit]) -> list[list[Fit]]:
    """Group sets that cannot be told apart; the least radius first."""
    classes = model.classes
    groups: list[list[Fit]] = []
    spaces: list[tuple[object, NDArray]] = []
    for fit in fits:
        # Outliers and effects that are not linear are compared by name: they have no space of their own.
        by_name = {place for place in fit.places if classes.whole_class(place)[0] not in classes.places}
        space = classes.joint_space([place for place in fit.places if place not in by_name])
        names = (frozenset(by_name), fit.signs)
        for group, (names_of_group, space_of_group) in zip(groups, spaces, strict=True):
            if names == names_of_group and same_space(space, space_of_group):
                group.append(fit)
                break
        else:
            groups.append([fit])
            spaces.append((names, space))
    return groups


def compared_places(
    places: Sequence[EffectPlace], sets: Sequence[Sequence[EffectPlace]], ranked: Sequence[str]
) -> tuple[EffectPlace, ...]:
    """The effects of the sets that remain, then others in the order of their titles' rank; ten at most."""
    by_title = {place.title: place for place in places}
    titles: dict[str, None] = {}
    for chosen in sets:
        titles |= dict.fromkeys(place.title for place in chosen)
    titles |= dict.fromkeys(ranked)
    return tuple(by_title[title] for title in titles if title in by_title)[:MOST_COMPARED]


def likeness(rows: Rows, places: Sequence[EffectPlace]) -> Floats:
    """Return cosines (K, K) of the least angles between the columns of linear effects on a record's rows.

    1 where one can be sized to look just like the other, 0 where nothing of it can; a row of zeros for an effect that
    adds nothing here.
    """
    spaces = spaces_beyond(rows.nominal, [rows.columns_of([place]) for place in places])
    cosines = np.zeros((len(spaces), len(spaces)))
    for row, space in enumerate(spaces):
        for column, second in enumerate(spaces):
            cosines[row, column] = cosine(space, second)
    return cosines
