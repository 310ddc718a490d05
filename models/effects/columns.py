"""Columns of linear effects: what a unit of each coefficient adds, by the kernel called with columns of rows.

Restricted Python runs on arrays in place of scalars as it stands. Where a kernel branches on numbers that differ from
row to row it runs again on the rows of each branch.
"""

import math
from collections.abc import Callable
from functools import cache
from types import FunctionType, SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .rows import Column, MotionRows, Rows, RowsDiffer

if TYPE_CHECKING:
    from .definition import Effect, EffectPlace

ARRAY_MATH = SimpleNamespace(
    sin=np.sin, cos=np.cos, sqrt=np.sqrt, exp=np.exp, fabs=np.abs, atan2=np.arctan2, floor=np.floor, pi=math.pi
)
"""What restricted Python has of `math`, for arrays."""
PORTS = {"encoder_effects": 2, "geometry_effects": 7, "reading_effects": 3, "final_effects": 3, "increment_effects": 3}
"""To how many values the effects of a stage add."""
SHORT = 1e-6
"""A unit of a delay [s]: it stays within a step."""
ALWAYS, NEVER = -1.0, math.inf
"""The time [h] of an effect that acts from the first row on, and the time constant of one that does not fade."""


@cache
def on_columns(kernel: Callable[..., None]) -> Callable[..., None]:
    """Return a kernel, with every kernel that it calls, that computes with arrays."""
    names = {}
    for name in kernel.__code__.co_names:
        value = kernel.__globals__.get(name)
        if name == "math":
            names[name] = ARRAY_MATH
        elif isinstance(value, FunctionType):
            names[name] = on_columns(value)
        elif value is not None:
            names[name] = value
    return FunctionType(
        kernel.__code__, names | {"__builtins__": {"range": range, "int": int, "float": float}}, kernel.__name__
    )


def units_of(effect: "Effect") -> list[tuple[list[float], float]]:
    """Return the parameters of a unit of each linear coefficient, and its size.

    An amplitude with a phase has two coefficients: amplitude·cos(phase) and amplitude·sin(phase).
    """
    start = [ALWAYS] * effect.sets_in + [NEVER] * effect.fades
    parameters = effect.linear_parameters
    units = []
    for k, parameter in enumerate(parameters):
        if parameter.name.endswith("phase"):
            continue
        size = SHORT if parameter.unit == "s" else 1.0
        values = [0.0] * len(parameters) + start
        values[k] = size
        units.append((values, size))
        if k + 1 < len(parameters) and parameters[k + 1].name.endswith("phase"):
            quarter = list(values)
            quarter[k + 1] = 0.5 * math.pi
            units.append((quarter, size))
    return units


def ports(effect: "Effect", place: "EffectPlace", rows: Rows | MotionRows) -> NDArray[np.float64]:
    """Return what a unit of each linear coefficient adds (N, ports, K) at the stage of an effect."""
    if effect.columns is not None:
        return effect.columns(place, rows)
    if "temperature" in effect.needs and rows.temperature is None:
        raise ValueError("effects of temperature need the temperature of the rows")
    context, values = rows.seen_by(effect.component)
    kernel, numbers, size = on_columns(effect.kernel), effect.place_numbers(place), PORTS[str(effect.stage)]
    units = units_of(effect)
    columns = np.zeros((len(values[0]), size, len(units)))
    for k, (parameters, unit) in enumerate(units):
        columns[:, :, k] = added_by(kernel, context, values, (*numbers, *parameters), size) / unit
    return columns


def added_by(
    kernel: Callable[..., None], context: list[Column], values: list[Column], arguments: tuple[float, ...], size: int
) -> NDArray[np.float64]:
    """Return what a kernel adds (N, size) to its ports; where it branches, rows that go the same way together."""
    added: list[NDArray[np.float64] | float] = [0.0] * size
    table = np.zeros((len(context[0]), size))
    try:
        kernel(context, values, *arguments, added)
    except RowsDiffer as differ:
        for rows in (differ.some, ~differ.some):
            table[rows] = added_by(kernel, chosen(context, rows), chosen(values, rows), arguments, size)
        return table
    for port, column in enumerate(added):
        table[:, port] = column
    return table


def chosen(columns: list[Column], rows: NDArray[np.bool_]) -> list[Column]:
    """Return some rows of columns."""
    return [column[rows].view(Column) for column in columns]


def turns(effect: "Effect", place: "EffectPlace", rows: Rows) -> NDArray[np.float64]:
    """Return the small turns (N, 4, K) [rad] at given encoder readings: of κ, outer, of ε, inner.

    The true angle is the reading less what an encoder errs by. With the angles that the turns are functions of taken as
    the true ones they are exact: of an effect on an encoder, `rows` has the angles with its turns in; of one on the
    geometry, without.
    """
    added = ports(effect, place, rows)
    if effect.stage == "geometry_effects":
        return added[:, :4]
    small = np.zeros((len(added), 4, added.shape[2]))
    small[:, 1::2] = -added
    return small


def signature(effect: "Effect", place: "EffectPlace", rows: Rows | MotionRows) -> NDArray[np.float64]:
    """Return how the readings [g], or of a gyro the rates [rad/s], change with each linear coefficient (N, 3, K)."""
    if effect.component == "TurntableMotion":
        assert isinstance(rows, Rows)
        return rows.by_turns @ turns(effect, place, rows)
    added = ports(effect, place, rows)
    if effect.component == "AttitudeComputer":
        assert isinstance(rows, MotionRows)
        # The computer adds what the readings lack.
        return -added / rows.step[:, None, None]
    return added
