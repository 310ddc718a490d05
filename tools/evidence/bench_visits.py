"""Visits of a bench's positions: their circumstances, the true position of the table, the signatures' arguments."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.arrays import Bools, Floats
from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import EffectPlace, Rows
from ...models.effects.accelerometer import NOMINAL_TEMPERATURE
from ...models.effects.columns import ports, small_turns
from ...models.restricted import CONTEXT_SIZE, HOURS, INPUT, KEPT, TEMPERATURE
from ..calibration.model import (
    Linearisation,
    Parametrisation,
    Positions,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)
from ..records import PositionRecord
from .fit import Fit
from .observation import observation_of_rests

INPUT_CHANGE = 1e-4
"""Change of an input [g] between rows whose sense is certain; a smaller one says nothing."""
MOVED = 1e-4
"""An axis whose reading changes by less [rad] from row to row has not moved."""
CHANGED_ONCE = 1.2
"""Factor for an input that changes its sign during a reading in motion, by the parabola through its rows."""
COMPLEX_STEP = 1e-30
Sized = Sequence[tuple[EffectPlace, NDArray]]
"""Effects, each with its linear coefficients."""


@dataclass(frozen=True)
class Circumstances:
    """Circumstances of each of N rows: the quantities, beside the angles, that effects may depend on.

    `hours` (N,) [h]: time since the first row of the record; `temperature` (N,) [degC] where it is known.
    `sense_alpha`, `sense_beta` (N,): sense of the last move of each axis, +1, -1, or 0 where there was none.
    `approached`: true if the record states the senses, false if they follow from the row before.

    `before` (N, 2): encoder readings [rad] of the row before each; NaN for the first row and after a change of
    mounting; None where the rows follow no order. `temperature_resolution`: half a last digit of the written
    temperature [K]; `began`: time of the record's first row [s]. `axis_rates` (N, 2): rates of both axes [rad/s], None
    at rest. `input_senses` (N, 3): senses of the last changes of the inputs, 0 where unknown, None without a series.
    """

    hours: NDArray
    temperature: NDArray | None
    sense_alpha: NDArray
    sense_beta: NDArray
    approached: bool
    before: NDArray | None = None
    temperature_resolution: float = 0.0
    began: float = 0.0
    axis_rates: NDArray | None = None
    input_senses: NDArray | None = None

    def selected(self, rows: NDArray) -> "Circumstances":
        """The circumstances of some rows (n,) of int."""
        arrays = {name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return replace(self, **arrays)


def circumstances_of(record: PositionRecord) -> Circumstances:
    """The circumstances of a record's rows; without approach columns a sense is that of the shorter turn before."""
    began = float(record.time_s[0])
    hours = (record.time_s - began) / 3600.0
    before = np.full((len(hours), 2), np.nan)
    before[1:] = np.stack((record.alpha, record.beta), axis=1)[:-1]
    if record.mounting is not None:
        before[1:][np.array(record.mounting[1:]) != np.array(record.mounting[:-1])] = np.nan
    approached = record.approach_alpha is not None and record.approach_beta is not None
    if approached:
        senses = np.asarray(record.approach_alpha, float), np.asarray(record.approach_beta, float)
    else:
        senses = senses_of(record.alpha), senses_of(record.beta)
    return Circumstances(hours, record.temperature, *senses, approached, before, record.temperature_resolution, began)


def senses_of(angle: NDArray) -> NDArray:
    """Senses (N,) of the shorter turns that lead to each of successive angles (N,) [rad]; 0 before the first move."""
    turns = np.remainder(np.diff(angle) + np.pi, 2.0 * np.pi) - np.pi
    senses = np.zeros(len(angle))
    for row, turn in enumerate(turns, start=1):
        senses[row] = senses[row - 1]
        if abs(turn) > 1e-6:
            senses[row] = np.sign(turn)
    return senses


def is_linear(place: EffectPlace) -> bool:
    """Return whether an effect is linear in its coefficients, so that its signature describes it fully."""
    return place.definition.linear


@dataclass(frozen=True)
class Visits:
    """N positions of the table, by the encoders, that were or might be measured, and the circumstances there.

    `resolution` is half a last digit of the readings, as a fraction of g.
    """

    parametrisation: Parametrisation
    at: Positions
    circumstances: Circumstances
    resolution: float = 0.0

    @staticmethod
    def of(linear: Linearisation, circumstances: Circumstances, resolution: float = 0.0) -> "Visits":
        """The positions of a linearised record."""
        return Visits(linear.parametrisation, linear.positions, circumstances, resolution)

    def __len__(self) -> int:
        return len(self.at.alpha)

    def selected(self, rows: NDArray) -> Self:
        """Return the visits of some positions (n,) of int."""
        at = Positions(self.at.alpha[rows], self.at.beta[rows], self.at.mounting[rows])
        return replace(self, at=at, circumstances=self.circumstances.selected(rows))

    def rows(self, point: NDArray, at: Positions | None = None, certain_change: float = INPUT_CHANGE) -> Rows:
        """Return the signatures' arguments at a point (P,), by default at the record's positions; exact derivatives.

        The sense of a change of an input is certain from `certain_change` on: [g], or [g/rad] of an axis that turned.
        """
        p, at, circumstances = self.parametrisation, self.at if at is None else at, self.circumstances
        n = predicted_input(p, point, at)

        turned = replace(at, beta=at.beta + 1j * COMPLEX_STEP)
        slopes = reading_jacobian(p, point, at)
        kappa, outer, epsilon = (slopes[..., p.symbols.index(symbol)] for symbol in ("X1", "X2", "X3"))
        input_sense, sense_told = self._input_senses(point, at, n, certain_change)
        targets = (p.selection @ point)[at.mounting]
        plus = targets[:, [TARGETS.index(positive) for positive, _ in SYMMETRIC_PAIRS]]
        minus = targets[:, [TARGETS.index(negative) for _, negative in SYMMETRIC_PAIRS]]
        vertical = point[p.symbols.index("X2")]
        return Rows(
            hours=circumstances.hours,
            alpha=at.alpha - vertical,
            beta=at.beta,
            n=n,
            by_alpha=-outer,
            by_beta=np.imag(predicted_reading(p, point, turned)) / COMPLEX_STEP,
            by_kappa=kappa,
            by_epsilon=epsilon,
            by_slip=slip_slopes(targets, n, np.where(n >= 0.0, plus, minus)),
            temperature=circumstances.temperature,
            sense_alpha=circumstances.sense_alpha,
            sense_beta=circumstances.sense_beta,
            input_sense=input_sense,
            sense_told=sense_told,
            own=n + np.where(n >= 0.0, plus, minus) * n,
            prediction=predicted_reading(p, point, at),
            resolution=self.resolution,
            temperature_resolution=circumstances.temperature_resolution,
            from_vertical=float(vertical),
            axis_rates=self._axis_rates,
        )

    @property
    def _axis_rates(self) -> Floats:
        rates = self.circumstances.axis_rates
        if rates is None:
            return np.zeros((len(self), 2))
        return rates

    def rows_with(self, fit: Fit) -> Rows:
        """Return the signatures' arguments at the true position of the table, given the effects of a fit."""
        return self.rows(fit.point, self.disturbed(fit.point, fit.sized))

    def _input_senses(
        self, point: NDArray, at: Positions, n: NDArray, certain_change: float
    ) -> tuple[NDArray, NDArray]:
        """Return senses (N, 3) of each input's last change, 0 where unknown, and a mask (N, 3) of those in the record.

        Without approach columns the sense is that of the change from the row before; the first row comes from no input.
        With them the record gives the sense if both axes, or the only one that moved, change the input in the same way
        on the way to the position. Otherwise it depends on the order of the axes, which only a series shows. Where an
        input hardly changes with an axis that turned, a small turn of the block would change the sense: it is unknown.
        A series does not show from which position the table came to the first one.
        """
        p, circumstances = self.parametrisation, self.circumstances
        if circumstances.input_senses is not None:
            return circumstances.input_senses, circumstances.input_senses != 0.0
        if not circumstances.approached and circumstances.before is not None:
            before = Positions(circumstances.before[:, 0], circumstances.before[:, 1], at.mounting)
            change = n - np.nan_to_num(predicted_input(p, point, before))
            size = np.abs(change)
            certain = (size <= INPUT_CHANGE**2 / certain_change) | (size >= certain_change)
            return np.where(certain & (size > INPUT_CHANGE), np.sign(change), 0.0), certain
        outer, inner = self.moved_axes(at)
        unknown = (outer & (circumstances.sense_alpha == 0.0)) | (inner & (circumstances.sense_beta == 0.0))
        certain, ways = np.repeat(~unknown[:, None], 3, axis=1), []
        for alpha, beta in ((outer * circumstances.sense_alpha, 0.0), (0.0, inner * circumstances.sense_beta)):
            slope = self._input_slope(point, at, alpha, beta)
            quarter = replace(at, alpha=at.alpha + 0.5 * np.pi * alpha, beta=at.beta + 0.5 * np.pi * beta)
            # The input is a sine of the turn: of this amplitude, and nearly constant about its ends.
            amplitude = np.hypot(slope, self._input_slope(point, quarter, alpha, beta))
            changes = amplitude > INPUT_CHANGE**2 / certain_change
            certain &= ~changes | (np.abs(slope) >= certain_change)
            ways.append(np.where(changes, slope, 0.0))
        certain &= ways[0] * ways[1] >= 0.0
        return np.where(certain, np.sign(ways[0] + ways[1]), 0.0), certain

    def _input_slope(self, point: NDArray, at: Positions, alpha: ArrayLike, beta: ArrayLike) -> NDArray:
        """Return derivatives (N, 3) [g/rad] of the inputs by turns of the outer and the inner axis at rates (N,)."""
        step = 1j * COMPLEX_STEP
        turning = replace(at, alpha=at.alpha + step * np.asarray(alpha), beta=at.beta + step * np.asarray(beta))
        return np.imag(predicted_input(self.parametrisation, point, turning)) / COMPLEX_STEP

    def moved_axes(self, at: Positions | None = None) -> tuple[NDArray, NDArray]:
        """Return which positions (N,) the outer and the inner axis turned to; both turned where that is unknown."""
        at = self.at if at is None else at
        if self.circumstances.before is None:
            unknown = np.ones(len(at.alpha), dtype=bool)
            return unknown, unknown
        stayed = np.abs(np.stack((at.alpha, at.beta), axis=1) - self.circumstances.before) < MOVED
        return ~stayed[:, 0], ~stayed[:, 1]

    def _turns(self, at: Positions, point: NDArray, sized: Sized) -> NDArray:
        """Turns (N, 7) [rad] that effects add to κ, about the outer axis, to ε, about the inner axis, of the block."""
        nothing = np.zeros((len(at.alpha), 3))
        rows = Rows(
            hours=self.circumstances.hours,
            alpha=at.alpha - point[self.parametrisation.symbols.index("X2")],
            beta=at.beta,
            n=predicted_input(self.parametrisation, point, at),
            by_alpha=nothing,
            by_beta=nothing,
            temperature=self.circumstances.temperature,
            sense_alpha=self.circumstances.sense_alpha,
            sense_beta=self.circumstances.sense_beta,
            axis_rates=self._axis_rates,
        )
        turns = np.zeros((len(at.alpha), 7))
        for place, coefficients in sized:
            if place.definition.turns_table:
                turns += small_turns(place.definition, place, rows) @ coefficients
        return turns

    def true_angles(self, point: NDArray, sized: Sized) -> Positions:
        """Return encoder readings [rad] without the effects on them: the readings of faultless encoders."""
        of_encoders = [entry for entry in sized if entry[0].definition.stage == "encoder_effects"]
        positions = self.at
        if not of_encoders:
            return positions
        for _ in range(6):
            turns = self._turns(positions, point, of_encoders)
            positions = replace(self.at, alpha=self.at.alpha + turns[:, 1], beta=self.at.beta + turns[:, 3])
        return positions

    def disturbed(self, point: NDArray, sized: Sized) -> Positions:
        """Return the true position of the table: its angles, and the small turns behind the encoders."""
        at = self.true_angles(point, sized)
        behind = [entry for entry in sized if entry[0].definition.stage != "encoder_effects"]
        if not any(place.definition.turns_table for place, _ in behind):
            return at
        turns = self._turns(at, point, behind)
        angles = {"alpha": at.alpha + turns[:, 1], "beta": at.beta + turns[:, 3]}
        return replace(at, **angles, tilts=turns[:, [0, 2]], slips=turns[:, 4:])


def slip_slopes(targets: NDArray, n: NDArray, scale: NDArray) -> NDArray:
    """Derivatives (N, 3, 3) of the readings by further turns of the block, from targets (N, 18), inputs and scales."""
    slopes = np.zeros((len(n), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        slopes[:, i, k], slopes[:, j, k] = n[:, j], -n[:, i]
    first, second = slopes[:, 0], slopes[:, 1]
    shear = [targets[:, TARGETS.index(name), None] for name in ("X6+X8", "X7+X12", "X11+X13")]
    of_readings = (1.0 + scale)[:, :, None] * slopes
    of_readings[:, 1] += shear[0] * first
    of_readings[:, 2] += shear[1] * first + shear[2] * second
    return of_readings


def readings_at(rows: NDArray) -> NDArray:
    """Numbers (3 n,) of the readings at some positions (n,) of int."""
    return (3 * rows[:, None] + np.arange(3)).ravel()


def signature_columns(places: Sequence[EffectPlace], rows: Rows) -> NDArray:
    """Return the columns (3 N, K) of linear effects for the readings, side by side."""
    columns = [np.zeros((3 * len(rows.hours), 0))]
    for place in places:
        effect = place.definition
        columns.append(observation_of_rests(rows, effect.stage).of(ports(effect, place, rows)))
    return np.hstack(columns)


def untold_readings(places: Sequence[EffectPlace], rows: Rows) -> Bools:
    """Return which readings (3 N,) some linear effect changes by an amount that the record does not determine."""
    untold = np.zeros(rows.n.shape, dtype=bool)
    for place in places:
        if place.definition.untold is not None:
            untold |= place.definition.untold(place, rows) > 0.0
    return untold.ravel()


def left_open(place: EffectPlace, rows: Rows) -> Floats:
    """Return the undetermined part of each reading (3 N,) per unit of an effect's size [g]."""
    effect, open_parts = place.definition, np.zeros(rows.n.shape)
    for function in (effect.untold, effect.open_argument):
        if function is not None:
            open_parts = open_parts + function(place, rows)
    return (open_parts * np.where(rows.axis_rates.any(axis=1), CHANGED_ONCE, 1.0)[:, None]).ravel()


def acted_on(bent: Sequence[tuple[EffectPlace, tuple[float, ...]]], rows: Rows, reading: NDArray) -> NDArray:
    """Return readings (N, 3) after the kernels of effects that are not linear, with these parameters."""
    readings = reading.copy()
    temperature = np.full(len(readings), NOMINAL_TEMPERATURE) if rows.temperature is None else rows.temperature
    # The memory of an effect begins with the first row.
    remembered = np.full(3, temperature[0] if len(readings) else NOMINAL_TEMPERATURE)
    for row in range(len(readings)):
        context, past = np.zeros(CONTEXT_SIZE), max(row - 1, 0)
        context[HOURS], context[INPUT : INPUT + 3] = rows.hours[row], rows.n[row]
        context[TEMPERATURE] = temperature[row]
        for place, values in bent:
            effect = place.definition
            numbers = effect.place_numbers(place)
            if effect.memory is not None:
                effect.memory(context, (rows.hours[past], temperature[past]), *numbers, *values, remembered)
                context[KEPT : KEPT + 3] = remembered
            if effect.kernel is not None:
                effect.kernel(context, rows.own[row], *numbers, *values, readings[row])
    return readings
