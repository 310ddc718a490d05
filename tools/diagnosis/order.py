"""In which order effects help, and what the moves or windows of one length say by themselves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence, largest_size, rms_size
from ..evidence.fit import ARCMIN, Fit, contains
from ..rounding import digits
from .cause import NamedEffect
from .result import Length, OrderedEffect, OrderOfEffects
from .search import search

MOST_STEPS, MOST_TRIED = 4, 12
HELPS = 0.02
"""An effect stands in the order when it takes so much off the errors that were left out."""
SHOWN = 1.5
"""An effect whose errors, with everything else refitted, are so many bounds is shown by a length."""


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
        least, first = tried[0]
        # What the best one contains comes first where it helps about as much.
        contained = ((left, p) for left, p in tried if (1.0 - HELPS) * left <= least and contains([first], [p]))
        best, place = next(contained, (least, first))
        if best > (1.0 - HELPS) * current:
            break
        # What hardly helps by itself is not tried again behind what helps most.
        places = [p for _, p in tried[:MOST_TRIED]] + chosen if len(tried) > MOST_TRIED else places
        chosen.append(place)
        steps.append(OrderedEffect(**NamedEffect.keys(place), held_out_rms_arcmin=best / ARCMIN))
        current = best
    return OrderOfEffects(held_out_rms_arcmin=start / ARCMIN, steps=tuple(steps))


def what_helps(evidence: Evidence, lengths: Sequence[Length]) -> tuple[tuple[EffectPlace, ...], tuple[str, ...]]:
    """What takes most off the errors that were left out, at the middle length, and is no cause: it does not mend them.

    The effects, and what is said of them; nothing of evidence without lengths, or where nothing helps.
    """
    number = len(lengths) // 2
    if not lengths or (order := lengths[number].order) is None or not order.steps:
        return (), ()
    places = tuple(step.place for step in order.steps)
    sizes = evidence.values_of(places, evidence.estimate(places))
    said = "; ".join(
        place.definition.sentence(place, {p.name: v for p, v in zip(place.definition.parameters, values, strict=True)})
        for place, values in sizes.items()
    )
    needed = evidence.would_need(places)
    return places, (
        f"{' and '.join(step.effect for step in order.steps)}, though of all effects the most help: over "
        f"{lengths[number].over} the errors that were left out fall from {digits(order.held_out_rms_arcmin)} to "
        f"{digits(order.steps[-1].held_out_rms_arcmin)} arcmin rms, and not within their bounds ({said})"
        + (f"; {needed}" if needed else ""),
    )


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
    for place, block in zip(fit.places, fit.blocks, strict=True) if lengths else ():
        if place not in evidence.places:
            # Of one that sets in at a time a length by itself tells less of the time than of the size.
            continue
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
