"""Causes: effects that explain a record, with what is stated of them and what it leaves possible."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from ...models.effects import EffectPlace
from ..evidence.fit import Fit, contains
from ..result import Result, Told, finite_or_none
from ..rounding import Stated

Number = Annotated[float, Field(allow_inf_nan=False)]
NO_SIZES = ("phase", "start", "time_constant")
"""Ends of names of parameters that say when or where, and not how much."""


class NamedEffect(Told):
    """An effect at its place."""

    effect: str
    where: str
    order: int | None = None
    accelerometer: int | None = None
    axes: tuple[int, ...] | None = None
    law: str | None = None

    @staticmethod
    def keys(place: EffectPlace) -> dict[str, Any]:
        """The effect at a place as the contract writes it."""
        if place.effect != "outlier":
            return place.entry
        return {"effect": place.effect, "where": place.where, "accelerometer": place.axes[0]}

    @staticmethod
    def of(place: EffectPlace) -> "NamedEffect":
        """The effect at a place."""
        return NamedEffect(**NamedEffect.keys(place))

    @property
    def place(self) -> EffectPlace:
        """The effect and its place."""
        axes = self.axes or () if self.accelerometer is None else (self.accelerometer,)
        return EffectPlace(self.effect, self.where, self.order, axes, self.law or "")


class SizedParameter(Result):
    """A parameter with what is stated of it and what the record leaves possible; None where nothing bounds it."""

    name: str
    unit: str
    estimate: Number
    low: Number | None
    high: Number | None

    @staticmethod
    def of(name: str, unit: str, value: float, ends: Sequence[float]) -> "SizedParameter":
        """The parameter with ends that are infinite where nothing bounds it."""
        low, high = map(finite_or_none, ends)
        return SizedParameter(name=name, unit=unit, estimate=value, low=low, high=high)

    @property
    def ends(self) -> tuple[float, float]:
        """What the record leaves possible, infinite where nothing bounds it."""
        return -math.inf if self.low is None else self.low, math.inf if self.high is None else self.high


class Cause(NamedEffect):
    """An effect that explains the record, alone or with others.

    Attributes
    ----------
    equivalents : tuple of NamedEffect
        what no measurement of this kind could tell from it
    parameters : tuple of SizedParameter
    """

    equivalents: tuple[NamedEffect, ...]
    parameters: tuple[SizedParameter, ...]
    among_records: tuple[Any, ...] = Field(default=(), exclude=True)
    """Of several records the place, and those of the equivalents, where one of them is in one record alone."""

    @staticmethod
    def found(
        place: EffectPlace,
        equivalents: Sequence[EffectPlace],
        values: Sequence[float],
        ends: Sequence[tuple[float, float]],
    ) -> "Cause":
        """The effect at a place with what is stated of its parameters, and ends of what is possible or infinity."""
        named = zip(place.definition.parameters, values, ends, strict=True)
        parameters = tuple(SizedParameter.of(p.name, p.unit, value, possible) for p, value, possible in named)
        same = tuple(NamedEffect.of(other) for other in equivalents)
        every = (place, *equivalents)
        among = () if all(type(one) is EffectPlace for one in every) else every
        return Cause(**NamedEffect.keys(place), equivalents=same, parameters=parameters, among_records=among)

    @property
    def place(self) -> EffectPlace:
        """The effect and its place."""
        return self.among_records[0] if self.among_records else super().place

    @property
    def alike(self) -> tuple[EffectPlace, ...]:
        """What no measurement of this kind could tell from it."""
        return self.among_records[1:] or tuple(other.place for other in self.equivalents)

    @property
    def values(self) -> tuple[float, ...]:
        """What is stated of the parameters."""
        return tuple(parameter.estimate for parameter in self.parameters)

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """What the record leaves possible of the parameters."""
        return tuple(p.ends for p in self.parameters)

    @property
    def acts(self) -> bool:
        """Whether the effect cannot be nothing: one size at least cannot be zero; a phase or a time is no size."""
        pairs = list(zip(self.parameters, self.intervals, strict=True))
        sizes = [pair for pair in pairs if not pair[0].name.endswith(NO_SIZES)]
        return any(low > 0.0 or high < 0.0 for _, (low, high) in sizes or pairs)

    @property
    def sentence(self) -> str:
        """What an engineer is told."""
        effect = self.place.definition
        stated = zip(self.parameters, self.intervals, strict=True)
        return effect.sentence(self.place, {p.name: Stated(p.estimate, *ends) for p, ends in stated})


@dataclass(frozen=True)
class Finding:
    """A smallest set of effects that makes the record consistent, and the model with them."""

    causes: tuple[Cause, ...]
    fit: Fit

    @property
    def sets_in(self) -> bool:
        """Whether it is shown that no effect of the set that acts from a time on did so from the beginning."""
        starts = [cause.intervals[-1][0] for cause in self.causes if cause.place.definition.sets_in]
        return all(start > 0.0 for start in starts)

    def contains(self, other: "Finding") -> bool:
        """Whether this set can always do what another one does: by what its effects are, or by when they set in."""
        return contains(self.fit.places, other.fit.places) or (other.sets_in and not self.sets_in)

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(cause.place.title for cause in self.causes)

    @property
    def acts(self) -> bool:
        """Whether none of the effects may be nothing."""
        return all(cause.acts for cause in self.causes)

    @property
    def not_shown(self) -> str:
        """What is said of a set that stands though an effect of it may be nothing."""
        idle = " and ".join(cause.place.title for cause in self.causes if not cause.acts)
        return f"{self.title} would do, but no size of {idle} is shown: each by itself may be zero"

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """The effects."""
        return tuple(cause.place for cause in self.causes)

    def in_order(self, places: Sequence[EffectPlace]) -> "Finding":
        """The same with its causes in another order, those of no place in it last."""
        order = [*places, *(place for place in self.places if place not in places)]
        return Finding(tuple(sorted(self.causes, key=lambda cause: order.index(cause.place))), self.fit)
