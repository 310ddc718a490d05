"""Causes: effects that explain a record, with estimates and intervals of their parameters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import model_validator

from ...models.effects import CATALOGUE, EffectPlace
from ...models.effects.columns import ONSET
from ..bounded.possible import Proofs, Steps, largest_length
from ..bounded.programmes import Interval
from ..bounded.work import Work
from ..evidence.evidence import Evidence
from ..evidence.fit import FAINT, Fit, contains
from ..evidence.of_record import differs, in_record, record_of
from ..fields import Number
from ..result import Result, Told, finite_or_none
from ..rounding import Stated

NO_SIZES = ("phase", "start", "time_constant")
"""Ends of names of parameters that say when or where, and not how much."""


class NamedEffect(Told):
    """An effect at its place; of several records `record` is the one in which alone it acts.

    The effect "parameter" is a shared parameter, `where`, that has another value in a record.
    """

    effect: str
    where: str
    order: int | None = None
    accelerometer: int | None = None
    axes: tuple[int, ...] | None = None
    law: str | None = None
    record: str | None = None

    @staticmethod
    def keys(place: EffectPlace) -> dict[str, Any]:
        """The effect at a place as the contract writes it."""
        keys = dict(place.entry)
        if place.effect == "outlier":
            keys = {"effect": place.effect, "where": place.where, "accelerometer": place.axes[0]}
        if (record := record_of(place)) is not None:
            keys["record"] = record
        return keys

    @staticmethod
    def of(place: EffectPlace) -> "NamedEffect":
        """The effect at a place."""
        return NamedEffect(**NamedEffect.keys(place))

    @property
    def place(self) -> EffectPlace:
        """The effect and its place."""
        axes = self.axes or ()
        if self.accelerometer is not None:
            axes = (self.accelerometer,)
        place = EffectPlace(self.effect, self.where, self.order, axes, self.law or "")
        if self.record is None:
            return place
        return differs(self.where, self.record) if self.effect == "parameter" else in_record(place, self.record)

    @property
    def title(self) -> str:
        """The effect in words."""
        if self.effect == "outlier":
            return f"f{self.place.axes[0]} of row {self.where.removeprefix('position-')}"
        return self.place.title

    @property
    def is_of_instrument(self) -> bool:
        """Return true if the effect acts in every record; false if in one run only."""
        return self.record is None


class SizedParameter(Result):
    """A parameter with its estimate and its interval; None where nothing bounds it."""

    name: str
    unit: str
    estimate: Number
    low: Number | None
    high: Number | None

    @staticmethod
    def of(name: str, unit: str, value: float, ends: Sequence[float]) -> "SizedParameter":
        """The parameter with ends that are infinite where nothing bounds it."""
        low, high = ends
        return SizedParameter(name=name, unit=unit, estimate=value, low=finite_or_none(low), high=finite_or_none(high))

    @property
    def ends(self) -> tuple[float, float]:
        """Return the ends of the interval, infinite where nothing bounds it."""
        return -math.inf if self.low is None else self.low, math.inf if self.high is None else self.high


class Cause(NamedEffect):
    """An effect that explains the record, alone or with others.

    Attributes
    ----------
    equivalents : tuple of NamedEffect
        effects that no measurement of this kind could tell from it
    parameters : tuple of SizedParameter
    """

    equivalents: tuple[NamedEffect, ...]
    parameters: tuple[SizedParameter, ...]

    @model_validator(mode="after")
    def _in_units_of_the_effect(self) -> "Cause":
        known = CATALOGUE.get(self.effect)
        units = {} if known is None else {parameter.name: parameter.unit for parameter in known.parameters}
        for parameter in self.parameters:
            unit = units.get(parameter.name, parameter.unit)
            if unit not in ("", parameter.unit):
                raise ValueError(f"the unit of {parameter.name} is {parameter.unit!r}, and must be {unit}")
        return self

    @staticmethod
    def found(
        place: EffectPlace,
        equivalents: Sequence[EffectPlace],
        values: Sequence[float],
        ends: Sequence[tuple[float, float]],
    ) -> "Cause":
        """Return the effect at a place with estimates and intervals of its parameters; ends may be infinite."""
        parameters = []
        for parameter, value, possible in zip(place.definition.parameters, values, ends, strict=True):
            parameters.append(SizedParameter.of(parameter.name, parameter.unit, value, possible))
        same = tuple(NamedEffect.of(equivalent) for equivalent in equivalents)
        return Cause(**NamedEffect.keys(place), equivalents=same, parameters=tuple(parameters))

    @property
    def alike(self) -> tuple[EffectPlace, ...]:
        """Return the effects that no measurement of this kind could tell from this one."""
        return tuple(equivalent.place for equivalent in self.equivalents)

    @property
    def values(self) -> tuple[float, ...]:
        """Return the estimates of the parameters."""
        return tuple(parameter.estimate for parameter in self.parameters)

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """Return the intervals of the parameters."""
        return tuple(parameter.ends for parameter in self.parameters)

    @property
    def acts(self) -> bool:
        """Return true if the effect cannot be zero: one size at least excludes zero (phases and times do not count)."""
        sizes = [parameter.ends for parameter in self.parameters if not parameter.name.endswith(NO_SIZES)]
        return any(low > 0.0 or high < 0.0 for low, high in sizes or self.intervals)

    @property
    def sentence(self) -> str:
        """The effect and its sizes in words."""
        sizes = {parameter.name: Stated(parameter.estimate, *parameter.ends) for parameter in self.parameters}
        return self.place.definition.sentence(self.place, sizes)


@dataclass(frozen=True)
class Finding:
    """A smallest set of effects that makes the record consistent, and the model with them."""

    causes: tuple[Cause, ...]
    fit: Fit

    @property
    def sets_in(self) -> bool:
        """Return true if every effect with an onset time is proven absent at the beginning of the record."""
        return all(cause.intervals[-1][0] > 0.0 for cause in self.causes if cause.place.definition.searched == ONSET)

    def contains(self, finding: "Finding") -> bool:
        """Return true if this set can do everything that another can, by its effects or by their onset times."""
        return contains(self.fit.places, finding.fit.places) or (finding.sets_in and not self.sets_in)

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(place.title for place in self.places)

    @property
    def acts(self) -> bool:
        """Return true if no effect can be zero, and each moves a reading noticeably."""
        return not self.fit.faint and all(cause.acts for cause in self.causes)

    @property
    def not_shown(self) -> str:
        """Return the reason for not naming a set that fits: one of its effects may be zero."""
        if self.fit.faint:
            faint = " and ".join(place.title for place in self.fit.faint)
            return f"{self.title} would do, but {faint} moves no reading by {FAINT} σ"
        idle = " and ".join(cause.place.title for cause in self.causes if not cause.acts)
        return f"{self.title} would do, but no size of {idle} is shown: each by itself may be zero"

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """The effects."""
        return tuple(cause.place for cause in self.causes)

    def in_order(self, places: Sequence[EffectPlace]) -> "Finding":
        """Return the set with its causes in the given order; causes at other places come last."""
        order = list(dict.fromkeys((*places, *self.places)))
        return Finding(tuple(sorted(self.causes, key=lambda cause: order.index(cause.place))), self.fit)


def centred(evidence: Evidence, fit: Fit) -> Fit:
    """Return the fit moved to the centre of all parameters and coefficients that fit the record."""
    return fit.centred(evidence.model.room, evidence.model.effort.most_rows)


def parameters_of(evidence: Evidence, fit: Fit) -> tuple[SizedParameter, ...]:
    """Return the model's parameters with estimates and intervals, in the presence of the fit's effects."""
    ends = fit.ends(evidence.model.room, evidence.model.effort.most_rows)
    parameters = []
    for (name, unit), value, possible in zip(evidence.rows.names, fit.estimate, ends, strict=False):
        parameters.append(SizedParameter.of(name, unit, value, possible))
    return tuple(parameters)


def causes_of(evidence: Evidence, fit: Fit) -> tuple[Cause, ...]:
    """Return a set of effects as causes, with estimates inside their intervals.

    Effects that the readings show by themselves come first.
    """
    causes = [Cause.found(effect.place, (), effect.values, effect.ends) for effect in evidence.reader.read_off]
    intervals = fit.intervals(evidence.model.room, evidence.model.effort.most_rows)
    for place, values, possible in zip(fit.places, fit.values(), intervals, strict=True):
        ends, stated = evidence.reader.told(place, possible), []
        for parameter, value, interval in zip(place.definition.parameters, values, ends, strict=True):
            stated.append(stated_within(parameter.name, value, interval))
        causes.append(Cause.found(evidence.reader.named(place), equivalents_of(evidence, fit, place), stated, ends))
    return tuple(causes)


def equivalents_of(evidence: Evidence, fit: Fit, place: EffectPlace) -> list[EffectPlace]:
    """Return the effects that no measurement could tell from one of a fit; a partial effect only if it fits, too."""
    classes, alike = evidence.model.classes, []
    for other in classes.equivalents(place):
        places = [other if effect == place else effect for effect in fit.places]
        if other not in classes.within or evidence.model.mended(places, Work()):
            alike.append(other)
    return alike


def finding_of(evidence: Evidence, group: Sequence[Fit]) -> Finding:
    """Return the first set of a group whose effects cannot be zero; else the first set."""
    first: Finding | None = None
    for fit in group:
        middle = centred(evidence, fit)
        finding = Finding(causes_of(evidence, middle), middle)
        if finding.acts:
            return finding
        first = first or finding
    assert first is not None
    return first


def stated_within(name: str, value: float, ends: Interval) -> float:
    """A value within its interval: a phase up to whole turns, a size that is just at its end up to rounding."""
    low, high = ends
    if name.endswith("phase") and math.isfinite(low) and math.isfinite(high):
        return value - 2.0 * np.pi * round((value - 0.5 * (low + high)) / (2.0 * np.pi))
    return min(max(value, low), high)


def excluded_sizes(evidence: Evidence, fit: Fit) -> tuple[dict[str, Any], ...]:
    """Upper bounds of the effects that were not found, each added to the model that explains the record.

    Each entry has effect, where, order and axes of a parameter; sizes above ``above`` are excluded. Effects that the
    record does not bound below their largest possible size are left out.
    """
    excluded, room, count = [], evidence.model.room, len(fit.at)
    for place, columns in evidence.model.beside(fit):
        # A bound of an effect beside one way of the others nearly bounds it beside the next one, too.
        proofs: Proofs = {}
        possible = fit.possible_in_any(room, columns, evidence.model.effort.most_rows, proofs)
        sizes: list[Interval] = []
        for k, parameter in enumerate(place.definition.parameters):
            sizes.append((0.0, largest_coefficient(possible, count + k, parameter.name)))
        for parameter, (_, above) in zip(place.definition.parameters, evidence.reader.told(place, sizes), strict=True):
            if above < parameter.largest and not parameter.name.endswith("phase"):
                bound = {"parameter": parameter.name, "unit": parameter.unit, "above": float(above)}
                excluded.append({**place.entry, **bound})
    return tuple(excluded)


def largest_coefficient(possible: Steps, column: int, name: str) -> float:
    """Largest absolute value of a coefficient, or largest length of the pair of an amplitude and its phase."""
    if name.endswith("phase"):
        return np.inf
    if name.endswith("amplitude"):
        return largest_length(possible.among(np.array([column, column + 1])))
    reach = possible.among(np.array([column]))
    return reach(np.ones(1), reach(-np.ones(1)))
