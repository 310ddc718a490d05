"""The second witness: blocks in time that are left out, shuffled signatures, and the order in which effects help.

An effect that does not improve what was left out, or whose signature does as well at pieces that it does not belong
to, is not named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence, Folds, rms_size

SHUFFLES = 40
CHANCE = 0.05
"""An effect is not named when more than this part of its shuffles predicts what was left out as well."""
MOST_STEPS, MOST_TRIED = 4, 12
HELPS = 0.02
"""An effect stands in the order when it takes so much off the errors that were left out."""


@dataclass(frozen=True)
class Witness:
    """What was left out says of one effect of a set.

    Attributes
    ----------
    place : EffectPlace
    without, with_it : float
        root mean square of the errors left out over their bounds, with the set but for the effect, and with it
    as_good, shuffles : int
        shuffles of its signature, and how many of them did as well
    """

    place: EffectPlace
    without: float
    with_it: float
    as_good: int
    shuffles: int

    @property
    def supports(self) -> bool:
        """Whether the effect may be named."""
        return self.with_it < self.without and self.as_good <= CHANCE * self.shuffles

    @property
    def objection(self) -> str:
        """Why it may not."""
        if not self.with_it < self.without:
            return f"{self.place.title} does not improve the parts of the record that were left out"
        return (
            f"{self.as_good} of {self.shuffles} shuffles of {self.place.title} over the record predict what was left "
            "out as well"
        )

    def to_json(self) -> dict[str, Any]:
        """An entry of `judgement`."""
        return {
            "effect": self.place.effect,
            "where": self.place.where,
            "rms_without": self.without,
            "rms_with": self.with_it,
            "shuffles": {"tried": self.shuffles, "as_good": self.as_good},
        }


@dataclass(frozen=True)
class Order:
    """In which order effects help most with what was left out, by windows of one length.

    Attributes
    ----------
    label : str
        of the windows or moves
    start : float
        root mean square error of the baseline [rad]
    steps : tuple of (EffectPlace, float)
        each effect with the error that is left [rad]
    """

    label: str
    start: float
    steps: tuple[tuple[EffectPlace, float], ...]

    @property
    def effects(self) -> tuple[EffectPlace, ...]:
        """The effects in their order."""
        return tuple(place for place, _ in self.steps)


def witnesses(system: Evidence, places: Sequence[EffectPlace]) -> tuple[Witness, ...]:
    """Leave out blocks in time and shuffle the signatures of each effect of a set in turn."""
    blocks = system.folds()
    reached = _rms(system.left_out(places, blocks))
    rng = np.random.default_rng(len(system.residual))
    found = []
    for place in places:
        others = [p for p in places if p != place]
        as_good = 0
        for _ in range(SHUFFLES):
            as_good += _rms(_shuffled(system, place, rng).left_out(places, blocks)) <= reached
        without = _rms(system.left_out(others, blocks))
        found.append(Witness(place, without, reached, int(as_good), SHUFFLES))
    return tuple(found)


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _shuffled(system: Evidence, place: EffectPlace, rng: np.random.Generator) -> Evidence:
    """The system with the signature of one effect moved to other pieces of the same kind."""
    block = system.blocks[system.places.index(place)]
    parts = []
    for part in system.parts:
        columns = part.columns.copy()
        columns[..., block] = part.columns[rng.permutation(len(part))][..., block]
        parts.append(replace(part, columns=columns))
    return replace(system, parts=tuple(parts))


def order_of_effects(system: Evidence, places: Sequence[EffectPlace]) -> tuple[Order, ...]:
    """The order for each kind of windows or moves by itself, with what is known at rest beside it."""
    found = []
    for k in system.scored:
        found.append(_order(system.of_length(k), places))
    return tuple(found)


def _order(system: Evidence, places: Sequence[EffectPlace]) -> Order:
    (scored,) = system.scored
    blocks = system.folds()
    start = current = _left(system, (), blocks, scored)
    chosen: list[EffectPlace] = []
    steps = []
    while len(chosen) < min(len(places), MOST_STEPS):
        tried = [(_left(system, [*chosen, p], blocks, scored), p) for p in places if p not in chosen]
        tried.sort(key=lambda entry: entry[0])
        best, place = tried[0]
        # What hardly helps by itself is not tried again behind what helps most.
        places = [p for _, p in tried[:MOST_TRIED]] + chosen if len(tried) > MOST_TRIED else places
        if best > (1.0 - HELPS) * current:
            break
        chosen.append(place)
        steps.append((place, best))
        current = best
    return Order(system.parts[scored].label, start, tuple(steps))


def _left(system: Evidence, places: Sequence[EffectPlace], blocks: Folds, scored: int) -> float:
    return rms_size(system.split(system.left_out(places, blocks))[scored])


def is_stable(orders: Sequence[Order]) -> bool:
    """Whether no two lengths put two effects that both have in opposite orders, and all begin with the same effect."""
    for a in orders:
        for b in orders:
            common = [place for place in a.effects if place in b.effects]
            if common != [place for place in b.effects if place in common]:
                return False
    return len({order.effects[:1] for order in orders}) <= 1
