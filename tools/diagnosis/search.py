"""The search for the smallest sets of effects that explain a record, whole and by length; how alike effects look."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import MAX_SET, cosine, same_space, spaces_beyond
from ..evidence.evidence import Evidence, largest_size, rms_size
from ..evidence.fit import ARCMIN, Fit
from ..progress import tracked
from .result import Length, NamedEffect, OrderedEffect, OrderOfEffects

MOST_FOUND = 60
"""So many sets of one size are enough to say that the record cannot decide."""
MOST_JUDGED = 1500
"""So many sets of one size are fitted exactly before the search gives up."""
MOST_COMPARED = 10
MOST_STEPS, MOST_TRIED = 4, 12
HELPS = 0.02
"""An effect stands in the order when it takes so much off the errors that were left out."""
SHOWN = 1.5
"""An effect whose errors, with everything else refitted, are so many bounds is shown by a length."""


@dataclass(frozen=True, eq=False)
class Found:
    """The smallest sets that explain a record, the least radius first; the model without effects where it stands.

    `complete`: whether they are all; else the search was cut off.
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
    """Cosines (K, K) of the least angles between what linear effects add to the model on a record's rows.

    1 where one can be sized to look just like the other, 0 where nothing of it can; a row of zeros for an effect that
    adds nothing here.
    """
    spaces = spaces_beyond(evidence.nominal, [evidence.columns_of([place]) for place in places])
    return np.array([[cosine(a, b) for b in spaces] for a in spaces]).reshape(len(spaces), len(spaces))


def of_lengths(evidence: Evidence) -> Mapping[str, Any]:
    """What each scored part of evidence says with what is known beside it; nothing of evidence without such parts.

    Where the model is falsified: its smallest sets of effects, the order in which effects help with what was left out,
    and the same as measured, with nothing taken out.
    """
    found = []
    places, falsified = evidence.classes.places if evidence.falsified else (), evidence.falsified
    measured = evidence.as_measured() if falsified else None
    for k in evidence.scored:
        part, alone = evidence.parts[k], evidence.of_length(k)
        sets = [()] if not (falsified and alone.falsified) else [fit.places for fit in search(alone, places).fits]
        found.append(
            Length(
                over=part.label,
                pieces=len(part),
                noise_bound_arcmin=float(np.median(part.bound)) / ARCMIN,
                rms_arcmin=rms_size(part.error) / ARCMIN,
                max_arcmin=largest_size(part.error) / ARCMIN,
                radius=alone.baseline.radius,
                smallest_sets=tuple(tuple(NamedEffect.of(place) for place in chosen) for chosen in sets),
                order=order_of_effects(alone, places) if falsified else None,
                order_as_measured=order_of_effects(measured.of_length(k), places) if measured else None,
            )
        )
    if not found:
        return {}
    return {"lengths": tuple(found), "order_stable": is_stable([one.order for one in found]) if falsified else None}


def order_of_effects(evidence: Evidence, places: Sequence[EffectPlace]) -> OrderOfEffects:
    """The order in which effects take most off the errors of the one scored part that were left out."""
    (scored,), folds = evidence.scored, evidence.folds()

    def left(chosen: Sequence[EffectPlace]) -> float:
        return rms_size(evidence.split(evidence.left_out(chosen, folds))[scored])

    start = current = left(())
    chosen: list[EffectPlace] = []
    steps = []
    while len(chosen) < min(len(places), MOST_STEPS):
        tried = sorted(((left([*chosen, p]), p) for p in places if p not in chosen), key=lambda entry: entry[0])
        best, place = tried[0]
        if best > (1.0 - HELPS) * current:
            break
        # What hardly helps by itself is not tried again behind what helps most.
        places = [p for _, p in tried[:MOST_TRIED]] + chosen if len(tried) > MOST_TRIED else places
        chosen.append(place)
        steps.append(OrderedEffect(**NamedEffect.keys(place), held_out_rms_arcmin=best / ARCMIN))
        current = best
    return OrderOfEffects(held_out_rms_arcmin=start / ARCMIN, steps=tuple(steps))


def is_stable(orders: Sequence[OrderOfEffects | None]) -> bool:
    """Whether no two lengths put two effects that both have in opposite orders, and all begin with the same effect."""
    named = [[step.place for step in order.steps] for order in orders if order is not None]
    for a in named:
        for b in named:
            if [place for place in a if place in b] != [place for place in b if place in a]:
                return False
    return len({tuple(order[:1]) for order in named}) <= 1


def only_at_one_length(evidence: Evidence, fit: Fit, lengths: Sequence[Length]) -> tuple[str, ...]:
    """Effects that one of several lengths needs at most, and that another one would show and does not: not named."""
    said = []
    for place, block in zip(fit.places, fit.blocks, strict=True):
        own, size = evidence.numbers_of([place]), fit.central[len(fit.point) :][block]
        alone = evidence.with_errors([part.columns[..., own] @ size for part in evidence.parts])
        others = [p for p in fit.places if p != place]
        needing = [
            one.over for one in lengths if any(place in [n.place for n in chosen] for chosen in one.smallest_sets)
        ]
        if len(needing) > 1:
            continue
        against = [
            one.over
            for k, one in zip(evidence.scored, lengths, strict=True)
            if one.over not in needing and alone.of_length(k).refit(others).radius > SHOWN
        ]
        if against:
            needed = f"is needed over {needing[0]} alone" if needing else "is needed over no length by itself"
            said.append(f"{place.title} {needed}; over {', '.join(against)} it would show and is not needed")
    return tuple(said)
