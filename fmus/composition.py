"""A component extended by effects: composing appends parameters and joins kernels to stages, nothing else."""

import dataclasses
from collections.abc import Sequence

from ..models.effects import CATALOGUE, EffectPlace, parameter_name
from .component import Component, Variable


def effect_variables(effects: Sequence[EffectPlace]) -> tuple[Variable, ...]:
    """The parameters that effects append to a component's table."""
    return tuple(
        Variable(
            parameter_name(place, parameter.name),
            f"{place.title}: {parameter.description}",
            "parameter",
            unit=parameter.unit,
            variability="tunable",
        )
        for place in effects
        for parameter in CATALOGUE[place.effect].at(place).parameters
    )


def can_extend(component: Component, place: EffectPlace) -> bool:
    """Whether an effect extends a component: its own, or the inverse of its own where all that it does is add."""
    effect = CATALOGUE[place.effect]
    undone = bool(component.undoes) and effect.component == component.undoes and effect.stage == "reading_effects"
    return undone or effect.component == component.name


def extend(component: Component, effects: Sequence[EffectPlace]) -> Component:
    """The component with effects composed into it.

    Raises
    ------
    ValueError
        an effect that belongs to another component, has no kernel, has no inverse, or is there already
    """
    for i, place in enumerate(effects):
        effect = CATALOGUE[place.effect]
        if not can_extend(component, place):
            if component.undoes and effect.component == component.undoes:
                raise ValueError(f"effect {place.title} has no inverse that {component.name} could be")
            home = effect.component or "no component"
            raise ValueError(f"effect {place.title} extends {home}, not {component.name}")
        if place in component.effects or place in effects[:i]:
            raise ValueError(f"effect {place.title} is there already")
    return dataclasses.replace(
        component,
        variables=component.variables + effect_variables(effects),
        effects=component.effects + tuple(effects),
    )
