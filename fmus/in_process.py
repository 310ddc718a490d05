"""A component without FMI: run in this process, as plain Python or compiled by numba."""

from collections.abc import Callable
from functools import cache
from typing import Any

from .component import Component, Variable
from .flat_source import flat_source
from .instance import Instance


def instance_rows(component: Component) -> tuple[tuple, ...]:
    """The component's table as `Instance` takes it."""
    return tuple((v.name, v.causality, v.size, v.starts, v.variability, *limits(v)) for v in component.variables)


def limits(variable: Variable) -> tuple[float | None, float | None]:
    """The least and the largest value that a variable takes; the items of an enumeration count from 1."""
    if variable.items:
        return 1.0, float(len(variable.items))
    return variable.minimum, variable.maximum


def effect_count(component: Component) -> int:
    """How many parameters the effects of a component have."""
    from ..models.effects import CATALOGUE

    return sum(len(CATALOGUE[place.effect].at(place).parameters) for place in component.effects)


@cache
def kernel_functions(component: Component) -> dict[str, Callable[..., Any]]:
    """The kernels of a component, with its effects, made from its flat source."""
    namespace: dict[str, Any] = {}
    source = "from __future__ import annotations\nimport math\n\n\n" + flat_source(component)
    exec(compile(source, f"<kernels of {component.name}>", "exec"), namespace)
    return {name: namespace[name] for name in component.kernels}


def instantiate(component: Component) -> Instance:
    """An instance of the component in plain Python."""
    return Instance(instance_rows(component), kernel_functions(component), component.arguments, effect_count(component))


@cache
def references(component: Component) -> dict[str, int]:
    """Value reference of each scalar, by its name."""
    names = [element for v in component.interface for element in v.elements]
    return {name: i + 1 for i, name in enumerate(names)}


def parameter_starts(name: str) -> dict[str, float | list[float]]:
    """Start values of a component's parameters, by variable."""
    from . import components

    return {
        v.name: list(v.starts) if v.size else v.starts[0]
        for v in components()[name].interface
        if v.causality == "parameter"
    }
