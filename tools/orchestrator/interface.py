"""An FMU's interface: variables by name, their types and units, arrays of `name[1]`, `name[2]`, ..."""

import ctypes
import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from fmpy.model_description import ModelDescription, ModelVariable

from ...fmus.units import UNITS, Unit, column_units
from ..errors import InputError, nearest
from .archive import fmi_version

Value = bool | int | float | str
MOST_ELEMENTS = 1_000_000
MANY_ITEMS = 6
"""Largest number of an enumeration's values that a message lists."""
SAME = 1e-6
"""Relative tolerance within which two factors of a unit are equal: some tools write few digits."""
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_NUMBERS: dict[str, Any] = {
    "Float64": np.float64,
    "Float32": np.float32,
    "Int8": np.int8,
    "UInt8": np.uint8,
    "Int16": np.int16,
    "UInt16": np.uint16,
    "Int32": np.int32,
    "UInt32": np.uint32,
    "Int64": np.int64,
    "UInt64": np.uint64,
}
"""Number types of FMI 3.0, in the order of their codes in a program."""


class ValueType(NamedTuple):
    """A type as `fmi2Get...` and `fmi3Get...` name it, with its form in memory.

    Its kind is Real, Integer, Boolean, String or Binary. The value of a String is the address of its bytes; the value
    of a Binary is the address of a `block_of` them.
    """

    kind: str
    dtype: Any

    @property
    def code(self) -> int:
        """Code of the type in a program's operations."""
        return list(_NUMBERS.values()).index(self.dtype)

    @property
    def by_address(self) -> bool:
        """True if the value is an address."""
        return self.kind in ("String", "Binary")

    @property
    def whole_span(self) -> tuple[int, int]:
        """Least and greatest whole number of the type."""
        return int(np.iinfo(self.dtype).min), int(np.iinfo(self.dtype).max)


VALUE_TYPES = {
    **{name: ValueType("Real" if name.startswith("F") else "Integer", dtype) for name, dtype in _NUMBERS.items()},
    "Boolean": ValueType("Boolean", np.uint8),
    "Real": ValueType("Real", np.float64),
    "Integer": ValueType("Integer", np.int32),
    "Boolean2": ValueType("Boolean", np.int32),
    "String": ValueType("String", np.uint64),
    "Binary": ValueType("Binary", np.uint64),
}
"""All types by name; the Boolean of FMI 2.0, an int, is Boolean2."""


def block_of(content: bytes) -> Any:
    """Return the memory of a Binary: the number of its bytes, then the bytes."""
    return ctypes.create_string_buffer(len(content).to_bytes(8, sys.byteorder) + content, 8 + len(content))


def in_memory(kind: str, value: str) -> Any:
    """Return the memory to which the value of a String or Binary points."""
    if kind == "Binary":
        return block_of(bytes.fromhex(value))
    return ctypes.create_string_buffer(value.encode())


def bytes_at(address: int) -> bytes:
    """Return the bytes of a Binary; none if it has no address yet."""
    if not address:
        return b""
    return ctypes.string_at(address + 8, ctypes.c_size_t.from_address(address).value)


def scale_of(exponents: Mapping[str, int], factor: float = 1.0, offset: float = 0.0) -> Unit:
    """Return a foreign unit's relation to SI, its exponents in a fixed order without zeros."""
    return Unit("", "", dict(sorted((base, n) for base, n in exponents.items() if n)), factor, offset)


def _scales() -> dict[str, Unit]:
    """Return our units and the units in which they are displayed."""
    scales: dict[str, Unit] = {}
    for unit in UNITS.values():
        for name, display in unit.display.items():
            scales[name] = scale_of(unit.exponents, unit.factor / display)
    return scales | UNITS


_SCALES = _scales()
_SUFFIXES = column_units()


def plain_unit(unit: str) -> str:
    """Return a unit without the brackets that some tools write around it."""
    if unit.startswith("[") and unit.endswith("]"):
        return unit[1:-1].strip()
    return unit


def between(
    first: str | None,
    second: str | None,
    scales: Mapping[str, Unit],
    target_scales: Mapping[str, Unit],
    *,
    relative: bool,
) -> tuple[float, float] | None:
    """Return factor and offset that convert a value from one unit to another; None if the dimensions differ.

    A variable without a unit fits every unit. Units that an FMU does not define come from our table. A difference
    (`relative`) has no offset.
    """
    if first is None or second is None or (plain_unit(first) == plain_unit(second) and first != second):
        return 1.0, 0.0
    source_scale, target_scale = (
        scales.get(first) or _SCALES.get(first),
        target_scales.get(second) or _SCALES.get(second),
    )
    if source_scale is None or target_scale is None:
        if first != second:
            return None
        return 1.0, 0.0
    if source_scale.exponents != target_scale.exponents:
        return None
    factor = source_scale.factor / target_scale.factor
    offset = 0.0
    if not relative:
        offset = (source_scale.offset - target_scale.offset) / target_scale.factor
    rounding = 1e-12
    if first == second:
        rounding = SAME
    if abs(factor - 1.0) <= rounding and abs(offset) <= SAME:
        return 1.0, 0.0
    return factor, offset


def is_angle(unit: str | None, scales: Mapping[str, Unit]) -> bool:
    """Return True for a unit of angle (not of angular rate)."""
    scale = {**scales, **_SCALES}.get(unit or "")
    return scale is not None and scale.exponents == {"rad": 1}


def suffix_for(unit: str | None) -> str:
    """Return the suffix for a unit in a column's name; empty for a pure number."""
    if unit is None or unit == "1":
        return ""
    exact = (suffix for suffix, (name, factor) in _SUFFIXES.items() if name == unit and factor == 1.0)
    displayed = (
        suffix
        for suffix, (name, factor) in _SUFFIXES.items()
        if factor != 1.0 and UNITS[name].display.get(unit) == factor
    )
    spelled = "".join(character for character in unit.replace("/", "p") if character.isalnum())
    return next(exact, None) or next(displayed, spelled)


def conversion(unit: str | None, column: str, scales: Mapping[str, Unit]) -> tuple[float, float]:
    """Return factor and offset that convert a variable's value to its column, whose name ends in a unit's suffix.

    The suffix decides if the variable has no unit. Raises InputError if the suffix is missing or of another dimension.
    """
    suffix, expected = column.rpartition("_")[2], suffix_for(unit)
    if "_" not in column or suffix not in _SUFFIXES:
        suffix = ""
    if unit is None or suffix == expected or (expected and column.endswith(f"_{expected}")):
        return 1.0, 0.0
    if not suffix:
        raise InputError(f"column '{column}' is in {unit} and must say so: name it '{column}_{expected}'")
    name, factor = _SUFFIXES[suffix]
    if name == unit:
        return factor, 0.0
    variable_scale, column_scale = _SCALES.get(unit) or scales.get(unit), _SCALES[name]
    if variable_scale is None or variable_scale.exponents != column_scale.exponents or unit == "1":
        meant = ""
        if expected:
            meant = f"; '{column.removesuffix('_' + suffix)}_{expected}' would be right"
        raise InputError(f"column '{column}' ends in _{suffix}, but the variable is in {unit}{meant}")
    return factor * variable_scale.factor / column_scale.factor, factor * (
        variable_scale.offset - column_scale.offset
    ) / column_scale.factor


@dataclass(frozen=True)
class FmuVariable:
    """One scalar variable, or one element of an array of FMI 3.0.

    Name, causality, variability, initial, start, minimum and maximum (in its `unit`) are those of the description; the
    name of an array's element ends with its number. `kind` is Real, Integer, Boolean, String, Binary (written in
    hexadecimal digits), Enumeration or Clock, which the orchestrator does not pass on. `access`, a key of
    `VALUE_TYPES`, selects the getter and setter, which take its value `reference`. `items` are the values of an
    enumeration with their names; `place` is its index among the `size` elements of its array. `relative` marks a
    difference: its unit's offset does not apply.
    """

    name: str
    kind: str
    access: str
    reference: int
    causality: str
    variability: str
    unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    start: Value | None = None
    items: tuple[tuple[int, str], ...] = ()
    place: int = 0
    size: int = 1
    relative: bool = False
    initial: str = ""

    @property
    def is_settable(self) -> bool:
        """True for a parameter, an input, or a variable whose initial value FMI allows to set, as a state's."""
        begins = self.causality in ("local", "output") and self.initial in ("exact", "approx")
        return (begins or self.causality in ("parameter", "input")) and self.variability != "constant"

    @property
    def value_type(self) -> ValueType:
        """Return the form of its value in memory.

        Raises InputError for a type that the orchestrator does not pass on.
        """
        if self.access not in VALUE_TYPES:
            raise InputError(f"{self.name} is of type {self.kind}, which the orchestrator does not pass on")
        return VALUE_TYPES[self.access]


@dataclass(frozen=True)
class Interface:
    """An FMU's interface, under the FMU's name in the scenario."""

    name: str
    model: str
    variables: Mapping[str, FmuVariable]
    scales: Mapping[str, Unit]
    version: int = 2
    states: frozenset[str] = frozenset()
    """Names of the continuous states."""

    @cached_property
    def arrays(self) -> dict[str, tuple[FmuVariable, ...]]:
        """Arrays: base name to its elements 1 to n."""
        arrays: dict[str, list[FmuVariable]] = {}
        for name, variable in self.variables.items():
            base = name.partition("[")[0]
            if name == f"{base}[{len(arrays.get(base, ())) + 1}]":
                arrays.setdefault(base, []).append(variable)
        return {base: tuple(elements) for base, elements in arrays.items()}

    def named(self, causality: str) -> list[str]:
        """Return the names of the variables of a causality."""
        return [v.name for v in self.variables.values() if v.causality == causality]

    def find(self, name: str, causalities: tuple[str, ...] | None = None) -> tuple[FmuVariable, ...]:
        """Return the variable of this name (without the FMU's), or the elements of the array of this name.

        Raises InputError if there is none, with the nearest name, of these causalities first.
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
        names, elements = [], []
        for variable in self.variables.values():
            if causalities is None or variable.causality in causalities:
                array = variable.name.partition("[")[0]
                if "[" not in variable.name or array not in self.arrays:
                    elements.append(variable.name)
                elif self.arrays[array][0] is variable:
                    names.append(array)
        names += elements
        meant, nearest_of_all = nearest(name, names), nearest(name, list(self.arrays) + list(self.variables))
        if nearest_of_all.startswith("did you") and not meant.startswith("did you"):
            meant = nearest_of_all
        raise InputError(f"'{self.name}' has no variable '{name}'; {meant}")


def _start(kind: str, text: object) -> Value | None:
    if text is None:
        return None
    if kind in ("String", "Binary", "Clock"):
        return str(text)
    if kind == "Boolean":
        return str(text).lower() in ("true", "1")
    if kind == "Real":
        return float(str(text))
    return int(str(text))


def _starts(kind: str, entry: ModelVariable, size: int, *, resized: bool) -> Sequence[Value | None]:
    """Return the start values of all elements; one value serves all, and an array of changed size has none."""
    if not size or kind not in ("Real", "Integer", "Enumeration", "Boolean"):
        return [_start(kind, entry.start)] * max(size, 1)
    if entry.start is None:
        return [None] * size
    starts = [_start(kind, text) for text in str(entry.start).split()]
    if resized and len(starts) != 1:
        return [None] * size
    if len(starts) not in (1, size):
        raise ValueError(f"{len(starts)} start values for {size} elements")
    if len(starts) == 1:
        return starts * size
    return starts


def _elements(entry: ModelVariable, version: int, lengths: Mapping[str, int]) -> list[FmuVariable]:
    """Return the scalars of one entry of the model description, with array lengths from structural parameters."""
    if not 0 <= int(entry.valueReference) < 1 << 32:
        raise ValueError(f"its value reference {entry.valueReference} does not fit 32 bits")
    declared = entry.declaredType
    kind = VALUE_TYPES[entry.type].kind if entry.type in VALUE_TYPES else str(entry.type)
    if version == 2:
        access = {"Enumeration": "Integer", "Boolean": "Boolean2"}.get(kind, kind)
    else:
        access = "Int64" if kind == "Enumeration" else str(entry.type)

    def attribute(key: str) -> object:
        value = getattr(entry, key, None)
        if value is None:
            return getattr(declared, key, None)
        return value

    def limit(key: str) -> float | None:
        text = attribute(key)
        if text is None or kind not in ("Real", "Integer", "Enumeration"):
            return None
        value = float(str(text))
        if math.isnan(value):
            return None
        return value

    items = declared.items if declared is not None and kind == "Enumeration" else ()
    described = [int(n) for n in entry.shape or ()]
    variables = [dimension.variable for dimension in entry.dimensions] or [None] * len(described)
    shape = [n if v is None else lengths.get(v.name, n) for n, v in zip(described, variables, strict=True)]
    size = math.prod(shape) if shape else 0
    if shape and not 1 <= size <= MOST_ELEMENTS:
        raise ValueError(f"an array of {size} elements; 1 to {MOST_ELEMENTS} are possible")
    return [
        FmuVariable(
            name=f"{entry.name}[{place + 1}]" if size else str(entry.name),
            kind=kind,
            access=access,
            reference=int(entry.valueReference),
            causality=str(entry.causality),
            variability=str(entry.variability),
            unit=str(attribute("unit") or "") or None,
            minimum=limit("min"),
            maximum=limit("max"),
            start=start,
            items=tuple((int(str(item.value)), str(item.name)) for item in items),
            place=place,
            size=max(size, 1),
            relative=bool(entry.relativeQuantity) or bool(getattr(declared, "relativeQuantity", False)),
            initial=str(entry.initial),
        )
        for place, start in enumerate(_starts(kind, entry, size, resized=shape != described))
    ]


def interface_of(
    name: str, label: str, description: ModelDescription, lengths: Mapping[str, int] | None = None
) -> Interface:
    """Return an FMU's interface from its model description; arrays of FMI 3.0 become their elements, row by row.

    `lengths` are values of structural parameters that differ from the description. Raises InputError if two variables
    share a name, or if the description has text in place of a number.
    """
    version = fmi_version(description)
    variables: dict[str, FmuVariable] = {}
    for entry in description.modelVariables:
        try:
            elements = _elements(entry, version, lengths or {})
        except (ValueError, TypeError) as error:
            raise InputError(f"{label}: modelDescription.xml, variable '{entry.name}': {error}") from error
        for variable in elements:
            if variable.name in variables:
                raise InputError(f"{label}: modelDescription.xml has two variables '{variable.name}'")
            variables[variable.name] = variable
    states = set[str]()
    for entry in description.modelVariables:
        if entry.derivative is not None:
            states.add(str(entry.derivative.name))
    scales = {}
    for unit in description.unitDefinitions:
        base = unit.baseUnit
        if base is None:
            continue
        try:
            exponents = {key: int(getattr(base, key) or 0) for key in BASE_UNITS}
            factor, offset = 1.0, 0.0
            if base.factor is not None:
                factor = float(base.factor)
            if base.offset is not None:
                offset = float(base.offset)
        except ValueError as error:
            raise InputError(f"{label}: modelDescription.xml, unit '{unit.name}': {error}") from error
        scales[str(unit.name)] = scale_of(exponents, factor, offset)
    elements = set[str]()
    for variable in variables.values():
        if variable.name in states or (variable.size > 1 and variable.name.rpartition("[")[0] in states):
            elements.add(variable.name)
    return Interface(name, str(description.modelName), variables, scales, version, frozenset(elements))


def refer(
    text: str, interfaces: Mapping[str, Interface], causalities: tuple[str, ...] | None = None
) -> tuple[Interface, tuple[FmuVariable, ...]]:
    """Return the FMU and the variables that `fmu.variable`, `fmu.variable[2]` or `fmu.array` names.

    Raises InputError with the nearest name if there is none.
    """
    fmu, dot, name = text.partition(".")
    if not dot or not name:
        raise InputError(f"'{text}' must name an FMU and a variable: fmu.variable")
    if fmu not in interfaces:
        raise InputError(f"'{text}': there is no FMU '{fmu}'; {nearest(fmu, list(interfaces))}")
    return interfaces[fmu], interfaces[fmu].find(name, causalities)


def refer_to(
    causality: str, text: str, interfaces: Mapping[str, Interface]
) -> tuple[Interface, tuple[FmuVariable, ...]]:
    """Like `refer`, but accept only inputs (or outputs)."""
    interface, variables = refer(text, interfaces, (causality,))
    for variable in variables:
        if variable.causality != causality:
            close = nearest(variable.name, interface.named(causality))
            raise InputError(f"'{text}' is not an {causality} ({variable.causality}); {close}")
    return interface, variables


def checked(value: Value, variable: FmuVariable) -> Value:
    """Return a value in its variable's type.

    Raises InputError for a value of another type, not finite, or outside the variable's limits.
    """
    kind, value_type = variable.kind, variable.value_type
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind == "Real" and number:
        value = float(value)
        if not math.isfinite(value):
            raise InputError(f"{variable.name} = {value} is not a finite number")
    elif kind in ("Integer", "Enumeration") and number and isinstance(value, int):
        low, high = value_type.whole_span
        if not low <= value <= high:
            raise InputError(f"{variable.name} = {value} does not fit {(high - low).bit_length()} bits")
    elif kind == "Binary" and isinstance(value, str):
        if not re.fullmatch(r"([0-9A-Fa-f]{2})*", value):
            raise InputError(f"{variable.name} = {value!r} must be hexadecimal digits, two for each byte")
    elif not (kind == "Boolean" and isinstance(value, bool)) and not (kind == "String" and isinstance(value, str)):
        text = repr(value)
        if isinstance(value, bool):
            text = str(value).lower()
        expected = {
            "Real": "a number",
            "Boolean": "true or false",
            "String": "a text",
            "Binary": "hexadecimal digits",
        }.get(kind, "a whole number")
        raise InputError(f"{variable.name} = {text} must be {expected}: it is {kind}")
    if number and not isinstance(value, str):
        low, high = variable.minimum, variable.maximum
        if (low is not None and value < low) or (high is not None and value > high):
            span = f"[{'-inf' if low is None else low}, {'inf' if high is None else high}]"
            raise InputError(f"{variable.name} = {value} is outside its limits {span}")
        if variable.items and value not in dict(variable.items):
            choices = [f"{number} ({item})" for number, item in variable.items]
            if len(choices) > MANY_ITEMS:
                choices[2:-1] = ["..."]
            raise InputError(f"{variable.name} = {value} is none of its values: {', '.join(choices)}")
    return value


def spread(
    value: Value | list[Value], variables: tuple[FmuVariable, ...], name: str
) -> list[tuple[FmuVariable, Value]]:
    """Return one checked value for each variable of a scalar or array.

    Raises InputError if the lengths differ.
    """
    values: list[Value] = []
    count = "one value is given"
    if not isinstance(value, list):
        values.append(value)
    else:
        values, count = value, f"{len(value)} are given"
        if len(variables) == 1 and len(values) != 1:
            raise InputError(f"{name} is a scalar; {len(values)} values are given")
    if len(values) != len(variables):
        raise InputError(f"{name} has {len(variables)} elements; {count}")
    return [(variable, checked(item, variable)) for variable, item in zip(variables, values, strict=True)]
