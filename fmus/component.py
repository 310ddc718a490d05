"""A component: its table of variables and the kernels that work on them; extended by effects, nothing else changes."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal

from ..models.effects import EffectPlace, parameter_name
from .units import STANDARD_GRAVITY

Causality = Literal["parameter", "input", "output", "state", "work"]
Variability = Literal["fixed", "tunable", "discrete", "continuous"]
Type = Literal["real", "integer", "boolean", "enumeration"]


@dataclass(frozen=True)
class Variable:
    """A row of a component's table.

    Attributes
    ----------
    name, description : str
        the kernels' arguments have the same names
    size : int
        0 for a scalar, else the length of the array
    unit : str
        a key of `trihedron.fmus.units.UNITS`
    display_unit : str or None
        in which a person likes to read it
    start : float or tuple of float
        of parameters and inputs
    causality : str
        "parameter", "input", "output"; "state" is the component's memory, "work" is space that a kernel works in
    variability, type : str
        as FMI has them; "real", "integer", "boolean", "enumeration"
    within : (float or None, float or None)
        the least and the largest value, in the variable's unit
    nominal : float or None
        in the variable's unit
    items : tuple of str
        names of the values 1, 2, ... of an enumeration
    follows : tuple of str
        inputs that an output follows at once, without a step
    """

    name: str
    description: str
    size: int = 0
    unit: str = "1"
    display_unit: str | None = None
    start: float | tuple[float, ...] = 0.0
    causality: Causality = "state"
    variability: Variability = "continuous"
    type: Type = "real"
    within: tuple[float | None, float | None] = (None, None)
    nominal: float | None = None
    items: tuple[str, ...] = ()
    follows: tuple[str, ...] = ()

    @property
    def starts(self) -> tuple[float, ...]:
        """Start values of all elements."""
        if isinstance(self.start, tuple):
            return self.start
        return (self.start,) * max(self.size, 1)

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of the scalars: the name itself, or name[1], name[2], ..."""
        if not self.size:
            return (self.name,)
        return tuple(f"{self.name}[{i + 1}]" for i in range(self.size))

    @property
    def limits(self) -> tuple[float | None, float | None]:
        """The least and the largest value that it takes; the items of an enumeration count from 1."""
        if self.items:
            return 1.0, float(len(self.items))
        return self.within


input_ = partial(Variable, causality="input")
output = partial(Variable, causality="output")
fixed = partial(Variable, causality="parameter", variability="fixed")
tunable = partial(Variable, causality="parameter", variability="tunable")
state = partial(Variable, causality="state")
work = partial(Variable, causality="work")

FLAG: dict[str, Any] = {"variability": "discrete", "type": "boolean"}
COUNT: dict[str, Any] = {"variability": "discrete", "type": "integer"}
"""Of an output or an input that is not a number of a quantity."""

GRAVITY = fixed(
    "gravity", "g: model value of gravity", unit="m/s2", start=STANDARD_GRAVITY, within=(1.0, 100.0), nominal=10.0
)
"""The parameter of every component that works with gravity."""


def seed(description: str) -> Variable:
    """The parameter of a component that draws random numbers."""
    return fixed("seed", description, start=1.0, type="integer", within=(0.0, 2147483647.0))


@dataclass(frozen=True)
class Component:
    """A model with its interface.

    Attributes
    ----------
    name, description : str
    variables : tuple of Variable
        the table; value references count its scalars from 1 (0 is the time)
    model : tuple of callable
        the kernels that initialise, step and, where there is a third, respond: that recomputes the outputs that follow
        the inputs at once. Each takes the variables of the table that its arguments name, ``time``, ``step``,
        ``effect``; returns 0 or the number of a message
    messages : tuple of str
        what message 1, 2, ... of the kernels says
    equations : tuple of str
        the model in lines of mathematics, for the documentation
    source : str
        where the model comes from
    step_size, stop_time : float
        of the default experiment [s]
    effects : tuple of EffectPlace
        the effects that it is extended with; their parameters stand last
    undoes : str
        name of the component whose inverse it is: effects that add to that one's readings extend it too
    any_step : bool
        whether steps of any lengths may follow one another
    exchange : bool
        whether its native FMUs are for model exchange too: of what follows time without continuous states, and without
        following inputs at once
    next_event : callable or None
        kernel of one for model exchange: the time of the next event, 1e300 where there is none
    smooth : bool
        whether its outputs change smoothly with inputs and parameters, so that derivatives tell something
    """

    name: str
    description: str
    variables: tuple[Variable, ...]
    model: tuple[Callable[..., int | None], ...]
    messages: tuple[str, ...]
    equations: tuple[str, ...]
    source: str
    step_size: float = 0.01
    stop_time: float = 60.0
    effects: tuple[EffectPlace, ...] = ()
    undoes: str = ""
    any_step: bool = True
    smooth: bool = True
    exchange: bool = False
    next_event: Callable[..., float] | None = None

    @property
    def derivatives(self) -> bool:
        """Return True if its native FMUs give directional derivatives: none of its outputs is rounded."""
        return self.smooth and not any(place.definition.rounds for place in self.effects)

    def capabilities(self, *, native: bool) -> dict[str, bool]:
        """Return the capabilities of its FMUs of a flavour, by their names in FMI 3.0; PythonFMU has no derivatives."""
        return {
            "providesDirectionalDerivatives": native and self.derivatives,
            "canHandleVariableCommunicationStepSize": self.any_step,
            "canGetAndSetFMUState": True,
            "canSerializeFMUState": True,
        }

    @property
    def kernels(self) -> dict[str, Callable[..., float | None]]:
        """The kernels by their names: initialise, step and, where there are such, respond and next_event."""
        kernels: dict[str, Callable[..., float | None]] = dict(
            zip(("initialise", "step", "respond"), self.model, strict=False)
        )
        if self.next_event is not None:
            kernels["next_event"] = self.next_event
        return kernels

    @property
    def interface(self) -> tuple[Variable, ...]:
        """The variables that the world sees."""
        return tuple(self.of("parameter", "input", "output"))

    def of(self, *causalities: Causality) -> list[Variable]:
        """The variables of these causalities, in the order of the table."""
        return [variable for variable in self.variables if variable.causality in causalities]

    @property
    def effect_count(self) -> int:
        """Number of parameters of its effects; they are last in the table."""
        return sum(len(place.definition.parameters) for place in self.effects)

    @property
    def own(self) -> tuple[Variable, ...]:
        """The table without the parameters of effects."""
        return self.variables[: len(self.variables) - self.effect_count]

    @property
    def parameter_starts(self) -> dict[str, float | list[float]]:
        """Start values of the parameters, by variable."""
        starts: dict[str, float | list[float]] = {}
        for variable in self.of("parameter"):
            starts[variable.name] = list(variable.starts) if variable.size else variable.starts[0]
        return starts

    @cached_property
    def arguments(self) -> dict[str, tuple[str, ...]]:
        """Names of each kernel's arguments, in order."""
        return {name: tuple(inspect.signature(kernel).parameters) for name, kernel in self.kernels.items()}


def effect_variables(effects: Sequence[EffectPlace]) -> tuple[Variable, ...]:
    """The parameters that effects append to a component's table."""
    variables: list[Variable] = []
    for place in effects:
        for parameter in place.definition.parameters:
            description = f"{place.title}: {parameter.description}"
            variables.append(tunable(parameter_name(place, parameter.name), description, unit=parameter.unit))
    return tuple(variables)


READ_AT = {
    "rate": ("RATE", "ANGULAR_ACCELERATION"),
    "angle": ("ALPHA", "BETA"),
    "temperature": ("TEMPERATURE",),
    "specific_force": ("INPUT",),
}
"""Inputs of components, by the names of the places of their context at which effects read them."""


def inputs_read(component: Component, effects: Sequence[EffectPlace]) -> dict[str, EffectPlace]:
    """Return the inputs of a component that effects read, each with the first such effect."""
    places_of_inputs = {}
    for place in effects:
        names: set[str] = set()
        for kernel in (place.definition.kernel, place.definition.memory):
            if kernel is not None:
                names.update(kernel.__code__.co_names)
        for variable in component.of("input"):
            if names.intersection(READ_AT.get(variable.name, ())):
                places_of_inputs.setdefault(variable.name, place)
    return places_of_inputs


def can_extend(component: Component, place: EffectPlace) -> bool:
    """Return True if an effect extends a component, or if the component can subtract it."""
    effect = place.definition
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
        effect = place.definition
        if not can_extend(component, place):
            if component.undoes and effect.component == component.undoes:
                raise ValueError(f"effect {place.title} has no inverse that {component.name} could be")
            home = effect.component or "no component"
            raise ValueError(f"effect {place.title} extends {home}, not {component.name}")
        if place in component.effects or place in effects[:i]:
            raise ValueError(f"effect {place.title} is there already")
    return replace(
        component,
        variables=component.variables + effect_variables(effects),
        effects=component.effects + tuple(effects),
    )


def started(component: Component, values: Mapping[str, float | Sequence[float]]) -> Component:
    """The component with other start values of some of its parameters, by variable, each in the variable's unit.

    Raises
    ------
    ValueError
        a name that is no parameter of the component, an array of another length, a value outside the parameter's range
    """
    parameters = {variable.name: variable for variable in component.of("parameter")}
    changed = {}
    for name, value in values.items():
        if name not in parameters:
            raise ValueError(f"{component.name} has no parameter {name}")
        variable = parameters[name]
        scalar = isinstance(value, int | float)
        numbers = tuple(map(float, [value] if isinstance(value, int | float) else value))
        if len(numbers) != len(variable.elements) or scalar != (variable.size == 0):
            raise ValueError(f"{name} has {len(variable.elements)} elements, not {len(numbers)}")
        least, most = variable.limits
        for number in numbers:
            # NaN fails the comparison.
            within = (least is None or number >= least) and (most is None or number <= most)
            if not (within and number - number == 0.0):
                raise ValueError(f"{name} = {number:g} is beyond what {component.name} takes")
        changed[name] = replace(variable, start=numbers if variable.size else numbers[0])
    return replace(component, variables=tuple(changed.get(v.name, v) for v in component.variables))
