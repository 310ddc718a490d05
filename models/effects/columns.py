"""The inputs of a kernel from a record, and the columns of linear effects: the change by a unit of each coefficient.

The kernel is called with columns of rows in place of numbers: restricted Python runs on arrays unchanged. If it
branches on numbers that differ from row to row, it runs again on the rows of each branch.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from types import FunctionType, SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Bools, Floats
from ..restricted import (
    ALPHA,
    ANGULAR_ACCELERATION,
    BETA,
    BLOCK_RESPONSE,
    CONTEXT_SIZE,
    GRAVITY,
    GYRO_CONTEXT_SIZE,
    HOURS,
    INPUT,
    INTERVAL,
    KEPT,
    PREVIOUS_RATE,
    PREVIOUS_STEPS,
    RATE,
    RESPONSE,
    SENSE_ALPHA,
    SENSE_BETA,
    SENSE_INPUT,
    STEP_LENGTH,
    TEMPERATURE,
)
from ..written import written_kernel

if TYPE_CHECKING:
    from .definition import Effect, EffectPlace

ROOM_TEMPERATURE = 20.0
"""Temperature for kernels on rows without one [degC]."""


class RowsDiffer(ValueError):
    """Raised if a kernel branches and `some` (N,) of the rows go another way than the others."""

    def __init__(self, some: Bools) -> None:
        super().__init__("the rows differ")
        self.some = some


class Column(np.ndarray):
    """Numbers (N,) in place of one: true or false, or a whole number, if they all agree."""

    def __bool__(self) -> bool:
        values = self.view(np.ndarray) != 0
        if values.all():
            return True
        if not values.any():
            return False
        raise RowsDiffer(values)

    def __int__(self) -> int:
        values = self.view(np.ndarray)
        same = values == values[0]
        if same.all():
            return int(values[0])
        raise RowsDiffer(same)


def column(values: Floats | float, count: int) -> Column:
    """Return values (N,), or N times one value, as a column."""
    return np.broadcast_to(np.asarray(values, dtype=float), (count,)).view(Column)


Seen = tuple[list[Column], list[Column]]
"""The context and the values of a stage, as a kernel sees them of all rows."""


def _not_given() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class Rows:
    """Averaged readings for the signatures: N rows at the relinearised point.

    Attributes
    ----------
    hours : (N,)
        time since the first row [h]
    alpha, beta : (N,)
        true angles of the outer and the inner axis [rad]
    n : (N, 3)
        inputs of the accelerometers [g]
    by_alpha, by_beta : (N, 3)
        derivatives of the readings by the turns about the outer and the inner axis [g/rad]
    by_kappa, by_epsilon : (N, 3)
        derivatives of the readings by κ and ε [g/rad]; zeros by default
    by_slip : (N, 3, 3)
        derivatives of the readings by further turns of the block on the table, about its axes [g/rad]; zeros by default
    temperature : (N,) or None
        temperature [degC]; None if the record has none
    sense_alpha, sense_beta : (N,)
        sense of the last move of each axis: +1, -1, 0 without a move; zeros by default
    input_sense : (N, 3)
        sense of the last change of each accelerometer's input; zeros by default
    sense_told : (N, 3) of bool
        True if the record shows that sense; everywhere by default
    own : (N, 3)
        response of each accelerometer to its own input, (1 + Γ±) n [g]; n by default
    prediction : (N, 3)
        readings of the nominal model [g]; n by default
    resolution : float
        half of a last digit of the readings [g]
    temperature_resolution : float
        half of a last digit of the temperature [K]
    kept : (N,)
        temperature in the memory of an effect [degC]; zeros by default
    axis_rates : (N, 2)
        rates of both axes [rad/s]; zeros by default: at rest
    from_vertical : float
        angle of the outer axis between the encoder's zero and the vertical, X2 [rad]
    """

    hours: Floats
    alpha: Floats
    beta: Floats
    n: Floats
    by_alpha: Floats
    by_beta: Floats
    by_kappa: Floats = field(default_factory=_not_given)
    by_epsilon: Floats = field(default_factory=_not_given)
    by_slip: Floats = field(default_factory=_not_given)
    temperature: Floats | None = None
    sense_alpha: Floats = field(default_factory=_not_given)
    sense_beta: Floats = field(default_factory=_not_given)
    input_sense: Floats = field(default_factory=_not_given)
    sense_told: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    own: Floats = field(default_factory=_not_given)
    prediction: Floats = field(default_factory=_not_given)
    resolution: float = 0.0
    temperature_resolution: float = 0.0
    kept: Floats = field(default_factory=_not_given)
    from_vertical: float = 0.0
    axis_rates: Floats = field(default_factory=_not_given)

    def __post_init__(self) -> None:
        instead = {
            **dict.fromkeys(("by_kappa", "by_epsilon", "input_sense"), np.zeros_like(self.n)),
            "by_slip": np.zeros((*self.n.shape, 3)),
            **dict.fromkeys(("sense_alpha", "sense_beta", "kept"), np.zeros_like(self.hours)),
            **dict.fromkeys(("own", "prediction"), self.n),
            "axis_rates": np.zeros((len(self.hours), 2)),
            "sense_told": np.ones(self.n.shape, dtype=bool),
        }
        for name, values in instead.items():
            if len(getattr(self, name)) != len(self.hours):
                object.__setattr__(self, name, values)

    @property
    def by_turns(self) -> Floats:
        """Derivatives (N, 3, 7) of the readings by the small turns: of κ, outer, of ε, inner, of the block [g/rad]."""
        of_axes = np.stack((self.by_kappa, self.by_alpha, self.by_epsilon, self.by_beta), axis=2)
        return np.concatenate((of_axes, self.by_slip), axis=2)

    def by_ports(self, stage: str | None) -> Floats:
        """Return derivatives (N, 3, ports) of the readings by the additions at a stage of table or accelerometers."""
        if stage == "encoder_effects":
            # The true angle is the reading less the encoder's error.
            return -np.stack((self.by_alpha, self.by_beta), axis=2)
        if stage == "geometry_effects":
            return self.by_turns
        return np.broadcast_to(np.eye(3), (len(self.hours), 3, 3))

    def seen_by(self, component: str | None) -> Seen:
        """Return context and values of a kernel of the table, or of the accelerometers."""
        if component == "TurntableMotion":
            return self._context, self._context[ALPHA : BETA + 1]
        return self._context, self._context[INPUT : INPUT + 3]

    @cached_property
    def _context(self) -> list[Column]:
        count = len(self.hours)
        context = [column(0.0, count)] * CONTEXT_SIZE
        context[HOURS] = column(self.hours, count)
        context[TEMPERATURE] = column(ROOM_TEMPERATURE if self.temperature is None else self.temperature, count)
        context[ALPHA], context[BETA] = column(self.alpha, count), column(self.beta, count)
        context[SENSE_ALPHA], context[SENSE_BETA] = column(self.sense_alpha, count), column(self.sense_beta, count)
        for axis in range(3):
            context[SENSE_INPUT + axis] = column(self.input_sense[:, axis], count)
            context[INPUT + axis] = column(self.n[:, axis], count)
            context[KEPT + axis] = column(self.kept, count)
        for axis in range(2):
            context[RATE + axis] = column(self.axis_rates[:, axis], count)
        return context


@dataclass(frozen=True)
class MotionRows:
    """Steps of a record in motion for the signatures: N rows, one a step.

    Signatures (N, 3, K) of gyro effects are in rad/s of the reading: reading = true rate + signature · coefficients,
    with means over the step on both sides. Those of accelerometers in motion are in g.

    Attributes
    ----------
    rate : (N, 3)
        mean rates over the steps [rad/s]
    rate_before : (N, 3)
        mean rates over the steps before; at the first step and after a gap, the rates themselves
    specific_force : (N, 3)
        specific force in block axes [g]
    hours : (N,)
        time since the record's first row [h], at the ends of the steps
    step : (N,)
        lengths of the steps [s]
    temperature : (N,) or None
        temperature [degC]; None if the record has none
    period : float
        nominal time between samples [s]; 0 if there is none
    gravity : float
        model value [m/s²]
    response : (3, 3)
        I + Γ, the gyros' response to the rates
    block_response : (3, 3) or (N, 3, 3)
        that of the accelerometers to the specific force
    """

    rate: Floats
    rate_before: Floats
    specific_force: Floats
    hours: Floats
    step: Floats
    temperature: Floats | None = None
    period: float = 0.0
    gravity: float = 9.80665
    response: Floats = field(default_factory=lambda: np.eye(3))
    block_response: Floats = field(default_factory=lambda: np.eye(3))

    def seen_by(self, component: str | None) -> Seen:
        """Return context and values of a kernel of gyros, accelerometers or attitude computer."""
        if component == "GyroBlock":
            return self._gyro_context, _columns(self.rate)
        if component == "AttitudeComputer":
            step = self.step[:, None]
            return _columns(self.rate_before * step), _columns(self.rate * step)
        return self._context, self._context[INPUT : INPUT + 3]

    def _circumstances(self, size: int) -> list[Column]:
        count = len(self.hours)
        context = [column(0.0, count)] * size
        context[HOURS] = column(self.hours, count)
        context[TEMPERATURE] = column(ROOM_TEMPERATURE if self.temperature is None else self.temperature, count)
        context[INPUT : INPUT + 3] = _columns(self.specific_force)
        return context

    @cached_property
    def _gyro_context(self) -> list[Column]:
        context, count = self._circumstances(GYRO_CONTEXT_SIZE), len(self.hours)
        context[STEP_LENGTH] = context[INTERVAL] = column(self.step, count)
        # Before the first step with a row the rates are assumed constant.
        context[PREVIOUS_RATE : PREVIOUS_RATE + 3 * PREVIOUS_STEPS] = _columns(self.rate_before) * PREVIOUS_STEPS
        for place, gain in enumerate(self.response.ravel().tolist()):
            context[RESPONSE + place] = column(gain, count)
        return context

    @cached_property
    def _context(self) -> list[Column]:
        context = self._circumstances(CONTEXT_SIZE)
        context[RATE : RATE + 3] = _columns(self.rate)
        context[ANGULAR_ACCELERATION : ANGULAR_ACCELERATION + 3] = _columns(self.acceleration)
        gains = np.broadcast_to(self.block_response, (len(self.hours), 3, 3))
        context[BLOCK_RESPONSE : BLOCK_RESPONSE + 9] = _columns(gains.reshape(-1, 9))
        context[GRAVITY] = column(self.gravity, len(self.hours))
        return context

    @property
    def acceleration(self) -> Floats:
        """Angular accelerations (N, 3) from the steps before to these [rad/s²]."""
        return (self.rate - self.rate_before) / self.step[:, None]


def _columns(values: Floats) -> list[Column]:
    """Return the columns of values (N, k)."""
    return [column(axis, len(values)) for axis in values.T]


ARRAY_MATH = SimpleNamespace(
    sin=np.sin, cos=np.cos, sqrt=np.sqrt, exp=np.exp, fabs=np.abs, atan2=np.arctan2, floor=np.floor, pi=math.pi
)
"""The functions of `math` in restricted Python, for arrays."""
PORTS = {"encoder_effects": 2, "geometry_effects": 7, "reading_effects": 3, "final_effects": 3, "increment_effects": 3}
"""Number of values that the effects of a stage change."""
ALIKE = 0.1
"""Relative difference below which axes of turns are one."""
SHORT = 1e-6
"""A unit of a delay [s]: it stays within a step."""
ONSET, TIME_CONSTANT = "onset", "time constant"
"""Kinds of a number that a diagnosis searches."""
WHOLE = {ONSET: -1.0, TIME_CONSTANT: math.inf}
"""Numbers [h] with which an effect acts from the first row on, or does not fade."""


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


def units_of(effect: "Effect", number: float | None = None) -> list[tuple[list[float], float]]:
    """Return the parameters of a unit of each linear coefficient, and its size; with a number that is searched.

    An amplitude with a phase has two coefficients: amplitude·cos(phase) and amplitude·sin(phase).
    """
    parameters = effect.linear_parameters
    start = []
    if effect.searched is not None:
        start = [WHOLE[effect.searched] if number is None else number]
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


def ports(effect: "Effect", place: "EffectPlace", rows: Rows | MotionRows, number: float | None = None) -> Floats:
    """Return the change (N, ports, K) by a unit of each linear coefficient at the stage of an effect.

    A searched number has the value `number`; by default the effect acts from the first row on, or does not fade.
    """
    if effect.columns is not None:
        return effect.columns(place, rows)
    units = units_of(effect, number)
    added = [response(effect, place, rows, parameters) / unit for parameters, unit in units]
    return np.stack(added, axis=2)


def response(effect: "Effect", place: "EffectPlace", rows: Rows | MotionRows, parameters: Sequence[float]) -> Floats:
    """Return the change (N, ports) by the kernel of an effect at its stage with some values of its parameters."""
    if "temperature" in effect.needs and rows.temperature is None:
        raise ValueError("effects of temperature need the temperature of the rows")
    context, values = rows.seen_by(effect.component)
    arguments = (*effect.place_numbers(place), *parameters)
    return added_by(on_columns(effect.kernel), context, values, arguments, PORTS[str(effect.stage)])


def added_by(
    kernel: Callable[..., None], context: list[Column], values: list[Column], arguments: tuple[float, ...], size: int
) -> Floats:
    """Return the change (N, size) by a kernel at its ports; if it branches, rows of one branch run together."""
    added: list[Floats | float] = [0.0] * size
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


def chosen(columns: list[Column], rows: Bools) -> list[Column]:
    """Return some rows of columns."""
    return [column[rows].view(Column) for column in columns]


def values_read(text: str, values: str, component: str, rows: Rows | MotionRows) -> Floats:
    """Return the values (N,) of an expression of the context and of the stage's values, for a kernel of a component."""
    kernel = written_kernel(
        f"def reading(context: Vector, {values}: Vector, added: Vector) -> None:\n    added[0] = {text}\n"
    )
    return added_by(on_columns(kernel), *rows.seen_by(component), (), 1)[:, 0]


def small_turns(effect: "Effect", place: "EffectPlace", rows: Rows) -> Floats:
    """Return the small turns (N, 7, K) [rad] at given encoder readings: of κ, outer, of ε, inner, of the block.

    The true angle is the reading less the encoder's error. The turns are exact functions of the true angles. For an
    effect on an encoder, `rows` has the angles with its turns; for one on the geometry, without.
    """
    added = ports(effect, place, rows)
    if effect.stage == "geometry_effects":
        return added
    small = np.zeros((len(added), 7, added.shape[2]))
    small[:, [1, 3]] = -added
    return small


def is_inner_axis(rows: Rows, k: int) -> bool:
    """Return True if an axis of the block, counted from 0, is the inner axis at all rows, except for mounting
    errors."""
    by_axis, by_inner = rows.by_slip[:, :, k], rows.by_beta
    apart = min(np.linalg.norm(by_axis - by_inner), np.linalg.norm(by_axis + by_inner))
    return bool(apart <= ALIKE * np.linalg.norm(by_inner))


def signature(effect: "Effect", place: "EffectPlace", rows: Rows | MotionRows) -> Floats:
    """Return the change of readings [g], or for a gyro of rates [rad/s], by each coefficient (N, 3, K); not for the
    table."""
    added = ports(effect, place, rows)
    if effect.component == "AttitudeComputer":
        assert isinstance(rows, MotionRows)
        # The computer adds the missing part of the readings.
        return -added / rows.step[:, None, None]
    return added
