"""What moves or windows of one length say by themselves, and of effects that all lengths together need."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..evidence.carried import BIAS
from ..evidence.evidence import Evidence, Fit, largest_size, rms_size
from .judging import Order, is_stable, order_of_effects
from .result import Length
from .search import Found, smallest_sets

SHOWN = 1.5
"""An effect whose errors, with everything else refitted, are so many bounds is shown by a length."""


def by_length(
    system: Evidence, places: Sequence[EffectPlace], bias: NDArray | None = None
) -> tuple[tuple[Length, ...], bool]:
    """What each length says by itself, and whether the orders of the effects agree.

    Parameters
    ----------
    system : Evidence
    places : sequence of EffectPlace
    bias : (3,) array or None
        the gyros' mean at rest that was taken out [rad/s]: the order is taken with it left in, too
    """
    orders = order_of_effects(system, places)
    raw: Sequence[Order | None] = [None] * len(orders)
    if bias is not None and BIAS in places:
        left_in = with_error(system, system.numbers_of([BIAS]), bias, added=True)
        raw = order_of_effects(left_in, places)
    lengths = tuple(
        replace(length_of(system, k, places, search=True), order=order, as_measured=before)
        for k, order, before in zip(system.scored, orders, raw, strict=True)
    )
    return lengths, is_stable(orders)


def length_of(system: Evidence, k: int, places: Sequence[EffectPlace], *, search: bool) -> Length:
    """What part k says, with what is known at rest."""
    part = system.parts[k]
    alone = system.of_length(k)
    found = smallest_sets(alone, places) if search else Found((alone.refit(()),))
    radius = alone.refit(()).radius
    return Length(
        part.label,
        len(part),
        float(np.median(part.bound)),
        rms_size(part.error),
        largest_size(part.error),
        radius,
        tuple(fit.places for fit in found.fits),
    )


def only_at_one_length(system: Evidence, best: Fit, lengths: Sequence[Length]) -> tuple[str, ...]:
    """Effects that one of several lengths needs at most, and that another one would show and does not: not named."""
    said, at = [], len(system.names)
    for place in best.places:
        own = system.numbers_of([place])
        size = best.solution[at : at + len(own)]
        at += len(own)
        needing = [length.label for length in lengths if any(place in chosen for chosen in length.sets)]
        if len(needing) > 1:
            continue
        others = [p for p in best.places if p != place]
        against = []
        for k, length in zip(system.scored, lengths, strict=True):
            alone = system.of_length(k)
            shown = with_error(alone, own, size)
            if length.label not in needing and shown.refit(others).radius > SHOWN:
                against.append(length.label)
        if against:
            needed = f"is needed over {needing[0]} alone" if needing else "is needed over no length by itself"
            said.append(f"{place.title} {needed}; over {', '.join(against)} it would show and is not needed")
    return tuple(said)


def with_error(system: Evidence, columns: NDArray, size: NDArray, *, added: bool = False) -> Evidence:
    """The evidence with errors of one effect of a size, alone or added to their own."""
    own = 1.0 if added else 0.0
    return system.with_errors([own * part.error + part.columns[..., columns] @ size for part in system.parts])
