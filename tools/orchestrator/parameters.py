"""Parameters: from a calibration result, from effects and from the scenario, the later over the earlier."""

import json
from collections.abc import Mapping
from typing import Any

from ...fmus.parameters import bench_parameters
from ..errors import InputError, nearest, said_of
from .interface import Interface, Value, Variable, spread

SETTABLE = ("parameter", "input")


def resolve_parameters(
    interface: Interface,
    explicit: Mapping[str, Any],
    calibrated: Mapping[str, Any],
    of_effects: Mapping[str, float],
) -> dict[str, tuple[Variable, Value]]:
    """The values to set before initialisation, one for each variable by its name.

    Parameters
    ----------
    interface : Interface
    explicit : mapping
        the scenario's `parameters`: name to value, or to a list for an array
    calibrated : mapping
        what a calibration says, in the same form; explicit values win
    of_effects : mapping
        the parameters that effects bring

    Raises
    ------
    InputError
        an unknown variable, one that is neither parameter nor input, or a value that it does not take
    """
    resolved: dict[str, tuple[Variable, Value]] = {}
    for origin, values in (
        ("parameters_from", calibrated),
        ("effects", of_effects),
        ("parameters", explicit),
    ):
        named: dict[str, str] = {}
        for name, value in values.items():
            with said_of(f"fmus.{interface.name}.{origin}"):
                variables = interface.find(name, SETTABLE)
                for variable in variables:
                    if variable.causality not in SETTABLE or variable.variability == "constant":
                        raise InputError(_not_settable(interface, variable))
                    if variable.name in named:
                        raise InputError(f"{variable.name} is given twice, by '{named[variable.name]}' and '{name}'")
                    named[variable.name] = name
                for variable, item in spread(value, variables, name):
                    resolved[variable.name] = (variable, item)
    return resolved


def _not_settable(interface: Interface, variable: Variable) -> str:
    what = "a constant" if variable.variability == "constant" else f"{variable.causality}, not a parameter or an input"
    known = [v.name for v in interface.variables.values() if v.causality in SETTABLE]
    close = nearest(variable.name, known)
    return f"{variable.name} of '{interface.name}' is {what}" + (f"; {close}" if close.startswith("did you") else "")


def calibrated_parameters(content: bytes, label: str, component: str) -> Mapping[str, Any]:
    """What a calibration result says of a component's parameters.

    Parameters
    ----------
    content : bytes
        a file of schema trihedron.calibration/1
    label : str
        its name, for messages
    component : str
        the component's name

    Raises
    ------
    InputError
        not such a file, a calibration that has no estimate, or nothing about this component
    """
    try:
        data = json.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{label}: is not JSON ({error})") from error
    if not isinstance(data, dict):
        raise InputError(f"{label}: is not a calibration result (schema trihedron.calibration/1)")
    try:
        found = bench_parameters(data)
    except ValueError as error:
        raise InputError(f"{label}: {error}") from error
    if component not in found:
        raise InputError(f"{label}: says nothing about {component}; {nearest(component, list(found))}")
    return found[component]


def value_at_start(variable: Variable, resolved: Mapping[str, tuple[Variable, Value]]) -> Value | None:
    """What a variable starts with: the scenario's value, else the start value of its model description."""
    return resolved[variable.name][1] if variable.name in resolved else variable.start
