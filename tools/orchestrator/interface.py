"""The variables of an FMU: found by name, with arrays put together from `name[1]`, `name[2]`, ..."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from fmpy.model_description import ModelDescription, ModelVariable, SimpleType

from ..errors import InputError, nearest
from .quantities import Scale, scale_of
from .value_types import VALUE_TYPES, ValueType

Value = bool | int | float | str
MOST_ELEMENTS = 1_000_000
MANY_ITEMS = 6
"""So many values of an enumeration can be listed in a line."""


@dataclass(frozen=True)
class Variable:
    """One scalar variable, or one element of an array of FMI 3.0.

    Attributes
    ----------
    name, causality, variability : str
        as the model description has them; the name of an array's element ends with its number
    kind : str
        Real, Integer, Boolean, String or Enumeration; Binary and Clock, which the orchestrator does not pass on
    reference : int
        value reference
    unit : str or None
    minimum, maximum : float or None
        in its unit
    start : bool, int, float, str or None
    items : tuple
        the values of an enumeration with their names
    type : str
        a key of `VALUE_TYPES`
    place, size : int
        which element of the array with this value reference it is, and how many there are
    relative : bool
        a difference: the offset of its unit does not apply
    """

    name: str
    kind: str
    reference: int
    causality: str
    variability: str
    unit: str | None
    minimum: float | None
    maximum: float | None
    start: Value | None
    items: tuple[tuple[int, str], ...] = ()
    type: str = ""
    place: int = 0
    size: int = 1
    relative: bool = False

    @property
    def access(self) -> str:
        """Which of FMI's getters and setters serves it: enumerations are passed as integers."""
        return self.type or {"Enumeration": "Integer", "Boolean": "Boolean2"}.get(self.kind, self.kind)

    @property
    def value_type(self) -> ValueType:
        """How its value is kept in memory.

        Raises
        ------
        InputError
            a type whose values the orchestrator does not pass on
        """
        if self.access not in VALUE_TYPES:
            raise InputError(f"{self.name} is of type {self.kind}, which the orchestrator does not pass on")
        return VALUE_TYPES[self.access]


@dataclass(frozen=True)
class Interface:
    """An FMU's interface, under the FMU's name in the scenario."""

    name: str
    model: str
    variables: Mapping[str, Variable]
    scales: Mapping[str, Scale]
    version: int = 2

    @cached_property
    def arrays(self) -> dict[str, tuple[Variable, ...]]:
        """The arrays: base name to its elements 1 to n."""
        counts: dict[str, int] = {}
        for name in self.variables:
            base = name.partition("[")[0]
            if name == f"{base}[{counts.get(base, 0) + 1}]":
                counts[base] = counts.get(base, 0) + 1
        return {base: tuple(self.variables[f"{base}[{i + 1}]"] for i in range(n)) for base, n in counts.items()}

    def find(self, name: str, causalities: tuple[str, ...] | None = None) -> tuple[Variable, ...]:
        """The variable of this name, or the elements of the array of this name.

        Parameters
        ----------
        name : str
            without the FMU's name
        causalities : tuple of str, optional
            what a misspelt name is compared with first

        Raises
        ------
        InputError
            no such variable; names the nearest
        """
        if name in self.variables:
            return (self.variables[name],)
        if name in self.arrays:
            return self.arrays[name]
        base = name.partition("[")[0]
        if base in self.arrays and base != name:
            raise InputError(
                f"'{self.name}' has no variable '{name}'; {base} has elements 1 to {len(self.arrays[base])}"
            )
        fit = [v.name for v in self.variables.values() if causalities is None or v.causality in causalities]
        known = [n for n in self.arrays if self.arrays[n][0].name in fit]
        known += [n for n in fit if "[" not in n or n.partition("[")[0] not in self.arrays]
        everything = list(self.arrays) + list(self.variables)
        close = nearest(name, known)
        if not close.startswith("did you"):
            other = nearest(name, everything)
            close = other if other.startswith("did you") else close
        raise InputError(f"'{self.name}' has no variable '{name}'; {close}")


def _number(text: object) -> float | None:
    """A number as XML writes it, None where there is none."""
    value = math.nan if text is None else float(str(text))
    return None if math.isnan(value) else value


def _items(declared: SimpleType | None) -> tuple[tuple[int, str], ...]:
    """Values and names of an enumeration's items."""
    return tuple((int(str(item.value)), str(item.name)) for item in declared.items) if declared is not None else ()


def _start(kind: str, text: object) -> Value | None:
    if text is None:
        return None
    if kind == "Boolean":
        return str(text).lower() in ("true", "1")
    if kind == "String":
        return str(text)
    return float(str(text)) if kind == "Real" else int(str(text))


def _starts(kind: str, entry: ModelVariable, size: int) -> Sequence[Value | None]:
    """Start values of all elements; one value stands for all."""
    if not size or kind not in ("Real", "Integer", "Enumeration", "Boolean"):
        return [_start(kind, entry.start)] * max(size, 1)
    found = [_start(kind, text) for text in str(entry.start).split()] if entry.start is not None else [None]
    if len(found) not in (1, size):
        raise ValueError(f"{len(found)} start values for {size} elements")
    return found * size if len(found) == 1 else found


def _elements(entry: ModelVariable, version: int) -> list[Variable]:
    """The scalars of one entry of the model description."""
    declared = entry.declaredType
    kind = VALUE_TYPES[entry.type].kind if entry.type in VALUE_TYPES else str(entry.type)

    def attribute(key: str) -> object:
        own = getattr(entry, key, None)
        return own if own is not None else getattr(declared, key, None)

    unit, ordered = attribute("unit"), kind in ("Real", "Integer", "Enumeration")
    relative = bool(entry.relativeQuantity) or bool(getattr(declared, "relativeQuantity", False))
    size = math.prod(entry.shape) if entry.shape else 0
    if entry.shape and not 1 <= size <= MOST_ELEMENTS:
        raise ValueError(f"an array of {size} elements; 1 to {MOST_ELEMENTS} are possible")
    found = []
    for place, start in enumerate(_starts(kind, entry, size)):
        found.append(
            Variable(
                f"{entry.name}[{place + 1}]" if size else str(entry.name),
                kind,
                int(entry.valueReference),
                str(entry.causality),
                str(entry.variability),
                str(unit) if unit else None,
                _number(attribute("min")) if ordered else None,
                _number(attribute("max")) if ordered else None,
                start,
                _items(declared) if kind == "Enumeration" else (),
                "" if version == 2 else "Int64" if kind == "Enumeration" else str(entry.type),
                place,
                max(size, 1),
                relative,
            )
        )
    return found


def interface_of(name: str, label: str, description: ModelDescription) -> Interface:
    """The interface of an FMU as its model description gives it; arrays of FMI 3.0 become their elements, row by row.

    Raises
    ------
    InputError
        two variables of one name, or a number in the description that is none
    """
    version = 3 if str(description.fmiVersion).startswith("3") else 2
    variables: dict[str, Variable] = {}
    for entry in description.modelVariables:
        try:
            elements = _elements(entry, version)
        except (ValueError, TypeError) as error:
            raise InputError(f"{label}: modelDescription.xml, variable '{entry.name}': {error}") from error
        for variable in elements:
            if variable.name in variables:
                raise InputError(f"{label}: modelDescription.xml has two variables '{variable.name}'")
            variables[variable.name] = variable
    return Interface(name, str(description.modelName), variables, _scales(description, label), version)


def _scales(description: ModelDescription, label: str) -> dict[str, Scale]:
    scales = {}
    for unit in description.unitDefinitions:
        base = unit.baseUnit
        if base is None:
            continue
        try:
            exponents = {k: int(getattr(base, k) or 0) for k in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
            factor = 1.0 if base.factor is None else float(base.factor)
            offset = 0.0 if base.offset is None else float(base.offset)
        except ValueError as error:
            raise InputError(f"{label}: modelDescription.xml, unit '{unit.name}': {error}") from error
        scales[str(unit.name)] = scale_of(exponents, factor, offset)
    return scales


def refer(
    text: str, interfaces: Mapping[str, Interface], causalities: tuple[str, ...] | None = None
) -> tuple[Interface, tuple[Variable, ...]]:
    """What `fmu.variable`, `fmu.variable[2]` or `fmu.array` stands for.

    Raises
    ------
    InputError
        no such FMU or variable; names the nearest
    """
    fmu, dot, name = text.partition(".")
    if not dot or not name:
        raise InputError(f"'{text}' must name an FMU and a variable: fmu.variable")
    if fmu not in interfaces:
        raise InputError(f"'{text}': there is no FMU '{fmu}'; {nearest(fmu, list(interfaces))}")
    return interfaces[fmu], interfaces[fmu].find(name, causalities)


def checked(value: Value, variable: Variable) -> Value:
    """A value as the variable's type takes it.

    Raises
    ------
    InputError
        another type, not finite, or outside the declared limits
    """
    kind, value_type = variable.kind, variable.value_type
    if kind == "Real" and isinstance(value, int | float) and not isinstance(value, bool):
        value = float(value)
        if not math.isfinite(value):
            raise InputError(f"{variable.name} = {value} is not a finite number")
    elif kind in ("Integer", "Enumeration") and isinstance(value, int) and not isinstance(value, bool):
        low, high = value_type.whole_span
        if not low <= value <= high:
            raise InputError(f"{variable.name} = {value} does not fit {(high - low).bit_length()} bits")
    elif not (kind == "Boolean" and isinstance(value, bool)) and not (kind == "String" and isinstance(value, str)):
        shown = str(value).lower() if isinstance(value, bool) else repr(value)
        wanted = {"Real": "a number", "Boolean": "true or false", "String": "a text"}.get(kind, "a whole number")
        raise InputError(f"{variable.name} = {shown} must be {wanted}: it is {kind}")
    if not isinstance(value, str | bool):
        low, high = variable.minimum, variable.maximum
        if (low is not None and value < low) or (high is not None and value > high):
            span = f"[{'-inf' if low is None else low}, {'inf' if high is None else high}]"
            raise InputError(f"{variable.name} = {value} is outside its limits {span}")
        if variable.items and value not in dict(variable.items):
            known = [f"{number} ({item})" for number, item in variable.items]
            shown = known if len(known) <= MANY_ITEMS else [*known[:2], "...", known[-1]]
            raise InputError(f"{variable.name} = {value} is none of its values: {', '.join(shown)}")
    return value


def spread(value: Value | list[Value], variables: tuple[Variable, ...], name: str) -> list[tuple[Variable, Value]]:
    """One checked value for each variable of a scalar or an array.

    Raises
    ------
    InputError
        lengths differ, or a value that a variable does not take
    """
    values = value if isinstance(value, list) else [value]
    if isinstance(value, list) and len(variables) == 1 and len(values) != 1:
        raise InputError(f"{name} is a scalar; {len(values)} values are given")
    if len(values) != len(variables):
        given = f"{len(values)} are given" if isinstance(value, list) else "one value is given"
        raise InputError(f"{name} has {len(variables)} elements; {given}")
    return [(variable, checked(item, variable)) for variable, item in zip(variables, values, strict=True)]
