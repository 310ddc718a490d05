"""What an effect sees of a record at rest or in motion, and the ways in which one that is not linear can act on it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..restricted import (
    ALPHA,
    ANGULAR_ACCELERATION,
    BETA,
    CONTEXT_SIZE,
    GRAVITY,
    GYRO_CONTEXT_SIZE,
    HOURS,
    INPUT,
    INTERVAL,
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

ROOM_TEMPERATURE = 20.0
"""What a kernel sees of rows without a temperature [degC]."""


class RowsDiffer(ValueError):
    """Raised where a kernel branches and `some` (N,) of the rows go another way than the others."""

    def __init__(self, some: NDArray[np.bool_]) -> None:
        super().__init__("the rows differ")
        self.some = some


class Column(np.ndarray):
    """Numbers (N,) in place of one: true or false, or a whole number, where all of them say the same."""

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


def column(values: NDArray[np.float64] | float, count: int) -> Column:
    """Values (N,), or N times one value, as a column."""
    return np.broadcast_to(np.asarray(values, dtype=float), (count,)).view(Column)


Seen = tuple[list[Column], list[Column]]
"""The context and the values of a stage, as a kernel sees them of all rows."""


def _not_given() -> NDArray[np.float64]:
    return np.zeros(0)


@dataclass(frozen=True)
class Rows:
    """Averaged readings as the signatures see them: N rows at the relinearised point.

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
        derivatives of the readings by κ and ε [g/rad]; zeros where not given
    by_slip : (N, 3, 3)
        derivatives of the readings by further turns of the block on the table, about its axes [g/rad]; zeros where not
        given
    temperature : (N,) or None
        [degC]; None where the record has none
    sense_alpha, sense_beta : (N,)
        sense of the last move of each axis: +1, -1, 0 where there was none; zeros where not given
    input_sense : (N, 3)
        sense of the last change of each accelerometer's input; zeros where not given
    sense_told : (N, 3) of bool
        whether the record tells that sense; everywhere where not given
    own : (N, 3)
        response of each accelerometer to its own input, (1 + Γ±) n [g]; n where not given
    prediction : (N, 3)
        readings of the nominal model [g]; n where not given
    resolution : float
        half of a last digit of the readings [g]
    temperature_resolution : float
        half of a last digit of the temperature [K]
    axis_rates : (N, 2)
        rates of both axes [rad/s]; zeros where not given: at rest
    from_vertical : float
        angle of the outer axis between the encoder's zero and the vertical, X2 [rad]
    """

    hours: NDArray[np.float64]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    n: NDArray[np.float64]
    by_alpha: NDArray[np.float64]
    by_beta: NDArray[np.float64]
    by_kappa: NDArray[np.float64] = field(default_factory=_not_given)
    by_epsilon: NDArray[np.float64] = field(default_factory=_not_given)
    by_slip: NDArray[np.float64] = field(default_factory=_not_given)
    temperature: NDArray[np.float64] | None = None
    sense_alpha: NDArray[np.float64] = field(default_factory=_not_given)
    sense_beta: NDArray[np.float64] = field(default_factory=_not_given)
    input_sense: NDArray[np.float64] = field(default_factory=_not_given)
    sense_told: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    own: NDArray[np.float64] = field(default_factory=_not_given)
    prediction: NDArray[np.float64] = field(default_factory=_not_given)
    resolution: float = 0.0
    temperature_resolution: float = 0.0
    from_vertical: float = 0.0
    axis_rates: NDArray[np.float64] = field(default_factory=_not_given)

    def __post_init__(self) -> None:
        instead = {
            **dict.fromkeys(("by_kappa", "by_epsilon", "input_sense"), np.zeros_like(self.n)),
            "by_slip": np.zeros((*self.n.shape, 3)),
            **dict.fromkeys(("sense_alpha", "sense_beta"), np.zeros_like(self.hours)),
            **dict.fromkeys(("own", "prediction"), self.n),
            "axis_rates": np.zeros((len(self.hours), 2)),
            "sense_told": np.ones(self.n.shape, dtype=bool),
        }
        for name, values in instead.items():
            if len(getattr(self, name)) != len(self.hours):
                object.__setattr__(self, name, values)

    @property
    def by_turns(self) -> NDArray[np.float64]:
        """Derivatives (N, 3, 4) of the readings by the small turns: of κ, outer, of ε, inner [g/rad]."""
        return np.stack((self.by_kappa, self.by_alpha, self.by_epsilon, self.by_beta), axis=2)

    def seen_by(self, component: str | None) -> Seen:
        """Context and values of a kernel of the table, or of the accelerometers."""
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
        for axis in range(2):
            context[RATE + axis] = column(self.axis_rates[:, axis], count)
        return context


@dataclass(frozen=True)
class MotionRows:
    """Steps of a record in motion as the signatures see them: N rows, one a step.

    Signatures (N, 3, K) of gyro effects are in rad/s of the reading: reading = true rate + signature · coefficients,
    with means over the step on both sides; those of accelerometers in motion are in g.

    Attributes
    ----------
    rate : (N, 3)
        mean rates over the steps [rad/s]
    rate_before : (N, 3)
        mean rates over the steps before; at the first step and after a gap, the rates themselves
    specific_force : (N, 3)
        in block axes [g]
    hours : (N,)
        time since the record's first row [h], at the ends of the steps
    step : (N,)
        lengths of the steps [s]
    temperature : (N,) or None
        [degC]; None where the record has none
    period : float
        nominal time between samples [s]; 0 where there is none
    gravity : float
        model value [m/s²]
    response : (3, 3)
        I + Γ, how the gyros respond to the rates
    """

    rate: NDArray[np.float64]
    rate_before: NDArray[np.float64]
    specific_force: NDArray[np.float64]
    hours: NDArray[np.float64]
    step: NDArray[np.float64]
    temperature: NDArray[np.float64] | None = None
    period: float = 0.0
    gravity: float = 9.80665
    response: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    def seen_by(self, component: str | None) -> Seen:
        """Context and values of a kernel of gyros, accelerometers or attitude computer."""
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
        # Before the step that a row tells of the rates are taken as even.
        context[PREVIOUS_RATE : PREVIOUS_RATE + 3 * PREVIOUS_STEPS] = _columns(self.rate_before) * PREVIOUS_STEPS
        for place, gain in enumerate(self.response.ravel().tolist()):
            context[RESPONSE + place] = column(gain, count)
        return context

    @cached_property
    def _context(self) -> list[Column]:
        context = self._circumstances(CONTEXT_SIZE)
        context[RATE : RATE + 3] = _columns(self.rate)
        context[ANGULAR_ACCELERATION : ANGULAR_ACCELERATION + 3] = _columns(self.acceleration)
        context[GRAVITY] = column(self.gravity, len(self.hours))
        return context

    @property
    def acceleration(self) -> NDArray[np.float64]:
        """Angular accelerations (N, 3) from the steps before to these [rad/s²]."""
        return (self.rate - self.rate_before) / self.step[:, None]


def _columns(values: NDArray[np.float64]) -> list[Column]:
    """The columns of values (N, k)."""
    return [column(own, len(values)) for own in values.T]


@dataclass(frozen=True)
class Variant:
    """One way in which an effect that is not linear in its parameters can act on N rows: which readings it changes.

    Within a variant the effect is linear: the prediction gains ``offset + columns @ coefficients``.

    Attributes
    ----------
    offset : (N, 3)
        what is added to the prediction of the nominal model [g]
    columns : (N, 3, K)
        derivatives by the K coefficients that remain; K may be 0
    widening : (N, 3)
        by which the bounds of the readings grow [g]
    low, high : (K,)
        limits of the coefficients
    values : callable
        K coefficients -> values of the parameters
    limits : tuple of (low, high)
        for each parameter, the values with which the effect acts in this way
    lost : (N, 3) of bool
        readings to which the accelerometer's own input adds nothing, derivatives by the bench's parameters included
    fixed : (N, 3) of bool
        readings that do not depend on the bench at all
    stands : callable
        rows at another fit (with `own` and `prediction` of the nominal part), coefficients -> whether the effect
        would change these readings there, and no others
    paid : (N, 3, K) or None
        by how much a reading may differ [g] per unit of the size of each coefficient, which then all have one sign: the
        bounds grow by it; None where the columns are exact
    sizes : (S, K) or None
        sums of coefficients that are the first of the parameters; None where these are the coefficients
    slipped : (N,) of bool or None
        rows at which the coefficients, three, are the vector by which the block is turned on the table: the columns are
        what that does to first order; None where they say it all
    elsewhere : callable or None
        other rows, later than these -> (n, 3, K): the columns there; None where only the kernel says what it does
    mixed : (N, 3, 3) or None
        what becomes of the three readings where channels are exchanged: matrix times readings; None where they are not
    undecided : callable
        other rows, σ [g] -> (N, 3) of bool: readings of which the limits of the parameters leave open what the effect
        does to them
    """

    offset: NDArray[np.float64]
    columns: NDArray[np.float64]
    widening: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    values: Callable[[NDArray[np.float64]], tuple[float, ...]]
    limits: tuple[tuple[float, float], ...]
    lost: NDArray[np.bool_]
    fixed: NDArray[np.bool_]
    paid: NDArray[np.float64] | None = None
    sizes: NDArray[np.float64] | None = None
    slipped: NDArray[np.bool_] | None = None
    mixed: NDArray[np.float64] | None = None
    elsewhere: Callable[[Rows], NDArray[np.float64]] | None = None
    stands: Callable[[Rows, NDArray[np.float64]], bool] = lambda rows, coefficients: True
    undecided: Callable[[Rows, float], NDArray[np.bool_]] = lambda rows, sigma: np.zeros(rows.n.shape, dtype=bool)

    @property
    def directions(self) -> NDArray[np.float64]:
        """Sums (S, K) of coefficients that are the first of the parameters."""
        return np.eye(self.columns.shape[2]) if self.sizes is None else self.sizes

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Readings (N, 3) that the effect changes, but for what widens their bounds."""
        changed = self.lost | self.fixed | (self.offset != 0.0) | np.any(self.columns != 0.0, axis=2)
        return changed if self.mixed is None else changed | np.any(self.mixed != np.eye(3), axis=2)

    @property
    def adds(self) -> bool:
        """Whether it adds its columns and does no more: then it is linear."""
        return self.mixed is None and not any(
            values.any() for values in (self.offset, self.widening, self.lost, self.fixed)
        )
