"""The bench with effects, each acting in one way: where the table stands, readings, derivatives, exact fits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import EffectPlace, Rows
from ...models.effects.rows import Variant
from ...models.restricted import CONTEXT_SIZE, HOURS, INPUT
from ..bounded.programmes import Growth, chebyshev_radius, least_squares
from ..bounded.sets import Work
from ..calibration.model import (
    Linearisation,
    Parametrisation,
    Positions,
    direction_jacobian,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)
from ..records import PositionRecord
from .fit import Fit, blocks_of, coefficient_limits

INPUT_CHANGE = 1e-4
"""Change of an input [g] between rows whose sense is certain; a smaller one says nothing."""
MOVED = 1e-4
"""An axis whose reading changes by less [rad] from row to row has not moved."""
LARGEST_OF_BENCH = 0.5
"""No parameter of a bench [1], [rad], [g] is larger, as none of `--bounds`: accelerometers that are swapped or reversed
are no bench with an effect."""
COMPLEX_STEP = 1e-30
Sized = Sequence[tuple[EffectPlace, NDArray]]
"""Effects, each with its linear coefficients."""
MAX_ITERATIONS, MAX_MOVES = 12, 8
ATTAINED = 1e-10
"""Relative difference between the radius of the programme and the largest misfit where it is attained."""
ASTRAY = 10.0
"""No bench has a parameter as large [1], [rad], [g]: a fit that comes there runs away."""
NEAR = 1e-4
"""A step [1], [rad], [g] so small leads near enough to the fit to refuse what is far from standing."""
SECOND_ORDER = 10.0
"""A model differs from the linear one by at most so many times the square of a step's length, the sum of its parts."""
CONVERGED = 1e-12
"""Parameters [1], [rad] that move by less than this do not move."""
USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
ROUNDS = 12
"""Steps to a centre that few readings cannot draw."""
DETERMINED = 1e-8
"""Directions of so small a part of the largest singular value are not determined by readings that are kept."""
MAX_LEVERAGE = 1.0
"""A held-out reading is scored when its prediction is at most so many times as uncertain (rms) as a reading."""


@dataclass(frozen=True)
class Circumstances:
    """The circumstances of each of N rows: what effects may depend on beside the angles.

    `hours` (N,) [h]: time since the first row of the record; `temperature` (N,) [degC] where it is known;
    `sense_alpha`, `sense_beta` (N,): sense of the last move of each axis, +1, -1, or 0 where there was none;
    `approached`: whether the senses are the record's own, not concluded from the row before.

    `before` (N, 2): encoder readings [rad] of the row before each; NaN where there is none, or another mounting; None
    where the rows follow no order. `temperature_resolution`: half a last digit of the temperature as it was written
    [K]; `began`: time of the record's first row [s].
    """

    hours: NDArray
    temperature: NDArray | None
    sense_alpha: NDArray
    sense_beta: NDArray
    approached: bool
    before: NDArray | None = None
    temperature_resolution: float = 0.0
    began: float = 0.0

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
    told = record.approach_alpha is not None and record.approach_beta is not None
    if told:
        senses = np.asarray(record.approach_alpha, float), np.asarray(record.approach_beta, float)
    else:
        senses = senses_of(record.alpha), senses_of(record.beta)
    return Circumstances(hours, record.temperature, *senses, told, before, record.temperature_resolution, began)


def senses_of(angle: NDArray) -> NDArray:
    """Senses (N,) of the shorter turns that lead to each of successive angles (N,) [rad]; 0 before the first move."""
    turns = np.remainder(np.diff(angle) + np.pi, 2.0 * np.pi) - np.pi
    senses = np.zeros(len(angle))
    for row, turn in enumerate(turns, start=1):
        senses[row] = np.sign(turn) if abs(turn) > 1e-6 else senses[row - 1]
    return senses


def is_linear(place: EffectPlace) -> bool:
    """Whether an effect is linear in its coefficients, so that its signature says it all."""
    return place.definition.variants is None


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
    def of(here: Linearisation, circumstances: Circumstances, resolution: float = 0.0) -> "Visits":
        """The positions of a linearised record."""
        return Visits(here.parametrisation, here.positions, circumstances, resolution)

    def __len__(self) -> int:
        return len(self.at.alpha)

    def selected(self, rows: NDArray) -> Self:
        """Some of them (n,) of int."""
        at = Positions(self.at.alpha[rows], self.at.beta[rows], self.at.mounting[rows])
        return replace(self, at=at, circumstances=self.circumstances.selected(rows))

    def rows(self, point: NDArray, at: Positions | None = None) -> Rows:
        """What signatures see at a point (P,), or where the table really stands; derivatives exact to rounding."""
        p, at, circumstances = self.parametrisation, self.at if at is None else at, self.circumstances
        n = predicted_input(p, point, at)

        turned = replace(at, beta=at.beta + 1j * COMPLEX_STEP)
        slopes = reading_jacobian(p, point, at)
        kappa, outer, epsilon = (slopes[..., p.symbols.index(symbol)] for symbol in ("X1", "X2", "X3"))
        input_sense, sense_told = self._input_senses(point, at, n)
        targets = (p.selection @ point)[at.mounting]
        plus, minus = (targets[:, [TARGETS.index(pair[k]) for pair in SYMMETRIC_PAIRS]] for k in (0, 1))
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
        )

    def rows_with(self, fit: Fit) -> Rows:
        """What signatures see where the table really stands with the effects of a fit."""
        return self.rows(fit.point, self.disturbed(fit.point, fit.sized))

    def _input_senses(self, point: NDArray, at: Positions, n: NDArray) -> tuple[NDArray, NDArray]:
        """Senses (N, 3) of the last change of each input, 0 where not told, and whether (N, 3) the record tells them.

        Without approach columns the sense is that of the change from the row before; the first row comes from no
        input. With them it is told where both axes, or the only one that moved, change the input in the same way when
        they come to the position: else it depends on which of them came last, which no record says.
        """
        p, circumstances = self.parametrisation, self.circumstances
        if not circumstances.approached and circumstances.before is not None:
            before = Positions(circumstances.before[:, 0], circumstances.before[:, 1], at.mounting)
            change = n - np.nan_to_num(predicted_input(p, point, before))
            return np.where(np.abs(change) > INPUT_CHANGE, np.sign(change), 0.0), np.ones(n.shape, dtype=bool)
        outer, inner = self.moved_axes(at)
        ways = []
        for alpha, beta in ((outer * circumstances.sense_alpha, 0.0), (0.0, inner * circumstances.sense_beta)):
            turning = replace(at, alpha=at.alpha + 1j * COMPLEX_STEP * alpha, beta=at.beta + 1j * COMPLEX_STEP * beta)
            ways.append(np.sign(np.imag(predicted_input(p, point, turning)) / COMPLEX_STEP))
        told = ways[0] * ways[1] >= 0.0
        return np.where(told, np.sign(ways[0] + ways[1]), 0.0), told

    def moved_axes(self, at: Positions | None = None) -> tuple[NDArray, NDArray]:
        """Whether (N,) outer and inner axis turned on the way to each position; both where that is not known."""
        at = self.at if at is None else at
        if self.circumstances.before is None:
            both = np.ones(len(at.alpha), dtype=bool)
            return both, both
        stayed = np.abs(np.stack((at.alpha, at.beta), axis=1) - self.circumstances.before) < MOVED
        return ~stayed[:, 0], ~stayed[:, 1]

    def _turns(self, at: Positions, point: NDArray, sized: Sized) -> NDArray:
        """Turns (N, 4) [rad] that effects add to κ, about the outer axis, to ε and about the inner axis."""
        nothing = np.zeros((len(at.alpha), 3))
        rows = Rows(
            hours=self.circumstances.hours,
            alpha=at.alpha - point[self.parametrisation.symbols.index("X2")],
            beta=at.beta,
            n=nothing,
            by_alpha=nothing,
            by_beta=nothing,
            sense_alpha=self.circumstances.sense_alpha,
            sense_beta=self.circumstances.sense_beta,
        )
        turns = np.zeros((len(at.alpha), 4))
        for place, coefficients in sized:
            function = place.definition.turns
            if function is not None:
                turns += function(place, rows) @ coefficients
        return turns

    def true_angles(self, point: NDArray, sized: Sized) -> Positions:
        """Encoder readings [rad] freed from what effects add to them: the readings of faultless encoders."""
        of_encoders = [entry for entry in sized if entry[0].definition.stage == "encoder_effects"]
        there = self.at
        for _ in range(6 if of_encoders else 0):
            turns = self._turns(there, point, of_encoders)
            there = replace(self.at, alpha=self.at.alpha + turns[:, 1], beta=self.at.beta + turns[:, 3])
        return there

    def disturbed(self, point: NDArray, sized: Sized) -> Positions:
        """Where the table really stands: true angles, and the small turns of what gives way behind the encoders."""
        at = self.true_angles(point, sized)
        behind = [entry for entry in sized if entry[0].definition.stage != "encoder_effects"]
        if not any(place.definition.turns for place, _ in behind):
            return at
        turns = self._turns(at, point, behind)
        return replace(at, alpha=at.alpha + turns[:, 1], beta=at.beta + turns[:, 3], tilts=turns[:, [0, 2]])


def readings_at(rows: NDArray) -> NDArray:
    """Numbers (3 n,) of the readings at some positions (n,) of int."""
    return (3 * rows[:, None] + np.arange(3)).ravel()


def signature_columns(places: Sequence[EffectPlace], rows: Rows) -> NDArray:
    """Signatures (3 N, K) of all effects, side by side."""
    columns = [place.definition.signature(place, rows).reshape(3 * len(rows.hours), -1) for place in places]
    return np.hstack(columns) if columns else np.zeros((3 * len(rows.hours), 0))


def untold_readings(places: Sequence[EffectPlace], rows: Rows) -> NDArray[np.bool_]:
    """Readings (3 N,) of which the record does not tell what some linear effect does to them."""
    untold = np.zeros(rows.n.shape, dtype=bool)
    for place in places:
        if place.definition.untold is not None:
            untold |= place.definition.untold(place, rows) > 0.0
    return untold.ravel()


def left_open(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """By how much readings (3 N,) may differ per unit of an effect's size, as far as the record tells [g]."""
    effect, found = place.definition, np.zeros(rows.n.shape)
    for function in (effect.untold, effect.open_argument):
        if function is not None:
            found = found + function(place, rows)
    return found.ravel()


def growths_of(
    places: Mapping[EffectPlace, int], rate: NDArray[np.float64], x: NDArray[np.float64]
) -> tuple[Growth, ...]:
    """The bounds' growth about a solution x (n,), in every branch of signs that the coefficients may have.

    `places` are effects of one coefficient with its column; by `rate` (M, n) the bounds grow per unit of its size. None
    where nothing grows.
    """
    paid = [(place, column) for place, column in places.items() if rate[:, column].any()]
    if not paid:
        return ()
    found = []
    # Of each coefficient the ends, sign by sign, that are possible.
    ends = [
        [
            (sign, float(end[0]))
            for sign, end in zip((-1.0, 1.0), coefficient_limits(place), strict=True)
            if sign * end > 0
        ]
        for place, _ in paid
    ]
    for branch in product(*ends):
        own, low, high = np.zeros(len(x)), np.full(len(x), -np.inf), np.full(len(x), np.inf)
        for (sign, end), (_, column) in zip(branch, paid, strict=True):
            own[column] = sign
            low[column], high[column] = min(0.0, end) - x[column], max(0.0, end) - x[column]
        found.append(Growth(rate @ (own * x), rate * own, low, high))
    return tuple(found)


def least_radius(
    jacobian: NDArray, residual: NDArray, bound: NDArray, growths: Sequence[Growth]
) -> tuple[float, NDArray, int]:
    """The least radius of all branches of the bounds' growth, the step (n,) to it, and which branch it is."""
    tried = [chebyshev_radius(jacobian, residual, bound, growth=growth)[:2] for growth in growths or (None,)]
    branch = int(np.argmin([radius for radius, _ in tried]))
    return (*tried[branch], branch)


def acted_on(bent: Sequence[tuple[EffectPlace, tuple[float, ...]]], rows: Rows, reading: NDArray) -> NDArray:
    """Readings (N, 3) after the kernels of effects that are not linear, with these parameters."""
    seen = reading.copy()
    for row in range(len(seen)):
        context = np.zeros(CONTEXT_SIZE)
        context[HOURS], context[INPUT : INPUT + 3] = rows.hours[row], rows.n[row]
        for place, values in bent:
            effect = place.definition
            if effect.kernel is not None:
                effect.kernel(context, rows.own[row], *effect.place_numbers(place), *values, seen[row])
    return seen


@dataclass(frozen=True)
class Relaxation:
    """What any variant of an effect may do, and more: a set that is refused with it is refused with each of them.

    `ways` is the number of variants; 0 of an effect that is linear, but not told everywhere. `touched` (M,) are the
    readings that some variant changes: they say nothing about the bench; by `widening` (M,) the bounds of the others
    grow, fractions of g; `columns` (M, K) are what the effect adds linearly, and by `rate` (M,) the bounds grow per
    unit of its size.
    """

    place: EffectPlace
    ways: int
    touched: NDArray
    widening: NDArray
    columns: NDArray
    rate: NDArray


@dataclass(frozen=True)
class Model:
    """Prediction and derivatives of a bench with effects at one point.

    `reading`, `bound` (3 N,): predicted readings and bounds of their errors, fractions of g; `jacobian` (3 N, P + K):
    by parameters of the bench and coefficients of the effects; by `rate` (3 N, P + K) the bounds grow per unit of a
    coefficient's size; `variants`: the way in which each effect acts that is not linear; `rows`: with this prediction.
    """

    reading: NDArray
    jacobian: NDArray
    bound: NDArray
    rate: NDArray
    variants: tuple[Variant | None, ...]
    rows: Rows


@dataclass(frozen=True, kw_only=True)
class Readings(Visits):
    """Readings at positions of the table, and how a bench with effects predicts them.

    `reading` (N, 3) over g, `bound` (3 N,) of their errors, fractions of g, `sign` (N, 3) of the inputs, by which scale
    factors are chosen.
    """

    reading: NDArray
    bound: NDArray
    sign: NDArray

    @staticmethod
    def of(here: Linearisation, circumstances: Circumstances, resolution: float = 0.0) -> "Readings":
        """The readings of a linearised record."""
        at = (here.parametrisation, here.positions, circumstances, resolution)
        return Readings(*at, reading=here.reading, bound=here.bound, sign=here.sign)

    def selected(self, rows: NDArray) -> Self:
        """Those at some of the positions (n,) of int."""
        measured = {"reading": self.reading[rows], "bound": self.bound[readings_at(rows)], "sign": self.sign[rows]}
        return replace(super().selected(rows), **measured)

    def variants(self, place: EffectPlace, rows: Rows) -> list[Variant]:
        """The ways in which an effect can act on the readings."""
        seen = place.definition.variants
        return [] if seen is None else seen(place, rows, self.reading, float(self.bound.min()))

    def relaxations(self, rows: Rows, places: Sequence[EffectPlace]) -> list[Relaxation]:
        """Of each effect that can act on the readings at all, what it may do at most."""
        found = []
        for place in places:
            if is_linear(place):
                own = np.zeros(rows.n.size), signature_columns([place], rows), left_open(place, rows)
                found.append(Relaxation(place, 0, untold_readings([place], rows), *own))
                continue
            variants = self.variants(place, rows)
            if not variants:
                continue
            touched = np.any([variant.touched for variant in variants], axis=0)
            widening = np.max([variant.widening for variant in variants], axis=0)
            nothing = np.zeros((touched.size, 0)), np.zeros(touched.size)
            found.append(Relaxation(place, len(variants), touched.ravel(), widening.ravel(), *nothing))
        return found


@dataclass(frozen=True)
class Cast:
    """A set of effects, each in the way in which it is to act.

    `ways`: of each effect that is not linear, which of its variants.
    """

    places: tuple[EffectPlace, ...]
    ways: Mapping[EffectPlace, int] = field(default_factory=dict)

    def variants(self, readings: Readings, rows: Rows) -> tuple[Variant | None, ...] | None:
        """The variant of each effect; None where one of the ways is none here."""
        found: list[Variant | None] = []
        for place in self.places:
            seen = readings.variants(place, rows) if place in self.ways else [None]
            if (way := self.ways.get(place, 0)) >= len(seen):
                return None
            found.append(seen[way])
        return tuple(found)

    def model(
        self, readings: Readings, point: NDArray, coefficients: NDArray, blocks: Sequence[slice] | None = None
    ) -> Model | None:
        """The bench with these effects at a point and coefficients; None where one of the ways is none there."""
        p, own = readings.parametrisation, dict(zip(self.places, blocks or blocks_of(self.places), strict=True))
        linear = [(place, coefficients[block]) for place, block in own.items() if place not in self.ways]
        at = readings.disturbed(point, linear)
        rows = readings.rows(point, at)
        columns = {place: signature_columns([place], rows) for place, _ in linear}
        reading = predicted_reading(p, point, at, readings.sign).ravel()
        for place, part in linear:
            # Of what turns the table, or adds to its encoders, the turns are exact: it stands elsewhere.
            if place.definition.turns is None:
                reading = reading + columns[place] @ part
        slopes = reading_jacobian(p, point, at, readings.sign)
        rows = replace(rows, prediction=reading.reshape(-1, 3))
        bound, rate = readings.bound, np.zeros((len(reading), len(point) + len(coefficients)))
        for place, part in linear:
            if len(part) == 1:
                rate[:, len(point) + own[place].start] = left_open(place, rows)
            else:
                # What is open of an amplitude and a phase is of second order: that of their size here.
                bound = bound + float(np.linalg.norm(part)) * left_open(place, rows)
        variants = self.variants(readings, rows)
        if variants is None:
            return None
        fixed = np.zeros(rows.n.shape, dtype=bool)
        for place, variant in zip(self.places, variants, strict=True):
            if variant is not None:
                slopes = _without_lost(readings, point, at, variant, slopes)
                reading = reading + variant.offset.ravel()
                bound = bound + variant.widening.ravel()
                columns[place] = variant.columns.reshape(len(reading), -1)
                fixed |= variant.fixed
        slopes[fixed] = 0.0
        rate[fixed.ravel()] = 0.0
        for place, block in own.items():
            if place in self.ways:
                reading = reading + columns[place] @ coefficients[block]
            else:
                columns[place][fixed.ravel()] = 0.0
        jacobian = np.hstack([slopes.reshape(len(reading), -1), *(columns[place] for place in self.places)])
        for variant in variants:
            if variant is not None and variant.mixed is not None:
                # Channels are exchanged last, with all that they read.
                reading, jacobian = _mixed(variant.mixed, reading), _mixed(variant.mixed, jacobian)
                bound, rate = (_mixed(np.abs(variant.mixed), values) for values in (bound, rate))
        return Model(reading, jacobian, bound, rate, variants, rows)


def _mixed(matrix: NDArray, values: NDArray) -> NDArray:
    """Values (3 N,) or (3 N, K) of the readings multiplied by the matrix (N, 3, 3) of each row."""
    return (matrix @ values.reshape(len(matrix), 3, -1)).reshape(values.shape)


def _without_lost(readings: Readings, point: NDArray, at: Positions, variant: Variant, slopes: NDArray) -> NDArray:
    """Derivatives (N, 3, P) of the readings by the bench's parameters, less what a variant does not let through."""
    if not variant.lost.any():
        return slopes
    p, left = readings.parametrisation, slopes.copy()
    targets = (p.selection @ point)[at.mounting]
    inputs, n = direction_jacobian(p, point, at), predicted_input(p, point, at)
    for k, pair in enumerate(SYMMETRIC_PAIRS):
        rows = np.flatnonzero(variant.lost[:, k])
        chosen = np.where(readings.sign[rows, k] >= 0, TARGETS.index(pair[0]), TARGETS.index(pair[1]))
        scale = 1.0 + targets[rows, chosen]
        by_scale = p.selection[at.mounting[rows], chosen]
        left[rows, k] -= scale[:, None] * inputs[rows, k] + n[rows, k][:, None] * by_scale
    return left


def fitted(
    readings: Readings,
    cast: Cast,
    start: NDArray,
    limit: float = np.inf,
    work: Work | None = None,
) -> Fit | None:
    """Fit the bench together with effects: least squares, then the Chebyshev programme, both relinearised.

    It begins at parameters (P,) of the bench; None where it leaves the way in which an effect acts, or runs away, or
    where its radius is surely above the limit: then what the last steps would change is not worth their work, which is
    counted.
    """
    reading, count, work = readings.reading.ravel(), len(start), work or Work()
    begun = cast.variants(readings, readings.rows(start))
    if begun is None:
        return None
    blocks = blocks_of(cast.places, begun)
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    for block, variant in zip(blocks, begun, strict=True):
        if variant is not None:
            x[count:][block] = 0.5 * (variant.low + variant.high)

    def model_at(x: NDArray) -> Model | None:
        work.add(model_work(readings))
        astray = not (np.abs(x[:count]).max() <= ASTRAY and np.isfinite(x[count:]).all())
        return None if astray else cast.model(readings, x[:count], x[count:], blocks)

    single = {place: count + block.start for place, block in zip(cast.places, blocks, strict=True)}
    single = {place: column for place, column in single.items() if is_linear(place)}

    def fit_at(x: NDArray, model: Model, estimate: NDArray, *, there: bool = False) -> Fit:
        """The fit linear at x: at the centre that a step leads to, or as it is `there`."""
        residual, growths = reading - model.reading, growths_of(single, model.rate, x)
        if there:
            # Of all branches the bounds are widest in that in which x lies.
            growths = tuple(sorted(growths, key=lambda growth: -growth.now.sum()))
            grown = growths[0].now if growths else 0.0
            step, radius = np.zeros(len(x)), float(((np.abs(residual) - grown) / model.bound).max(initial=0.0))
        else:
            work.programme(*model.jacobian.shape)
            radius, step, branch = least_radius(model.jacobian, residual, model.bound, growths)
            growths = (*growths[branch : branch + 1], *growths[:branch], *growths[branch + 1 :])
        at = (x, step, residual, model.bound, model.jacobian)
        return Fit(cast.places, blocks, *at, radius, estimate, x[count:], model.variants, growths)

    model, near = model_at(x), False
    # Readings of which the record tells least have no weight at first.
    size = np.append(np.zeros(count), np.ones(len(x) - count))
    for iteration in range(MAX_ITERATIONS + 1):
        if model is None:
            return None
        loose = model.bound + model.rate @ size
        step = least_squares(model.jacobian / loose[:, None], (reading - model.reading) / loose)
        if iteration == MAX_ITERATIONS or np.abs(step).max(initial=0.0) < CONVERGED:
            break
        x = x + step
        size = np.abs(x)
        model = model_at(x)
        if model is not None and not near and np.abs(step).max(initial=0.0) < NEAR:
            near, tried = True, fit_at(x, model, x)
            # By how much the programmes to come may end lower: the second order of the steps that remain.
            more = SECOND_ORDER * float(np.abs(tried.step).sum() ** 2 / model.bound.min())
            if tried.radius > limit + more:
                return None
    assert model is not None
    estimate, fit = x, fit_at(x, model, x)
    for _ in range(MAX_MOVES):
        # Noise may be at its very bound: then the second order of the step to the centre must not count either.
        x = x + fit.step
        model = model_at(x)
        if model is None:
            return None
        least, fit = fit.radius, fit_at(x, model, estimate, there=True)
        if fit.radius <= least + ATTAINED * max(1.0, least):
            break
        fit = fit_at(x, model, estimate)
    fit = fit_at(x, model, estimate, there=True)
    return fit if _stands(fit, model.rows) else None


def model_work(readings: Visits) -> float:
    """The work of one model of these readings."""
    return 2000.0 + 20.0 * len(readings)


def centre_of(readings: Readings, places: Sequence[EffectPlace], start: NDArray, before: Fit | None = None) -> Fit:
    """The point with about the least sum of absolute misfits, which few readings cannot draw, with linear effects.

    It begins at parameters (P,) of the bench, or where the fit `before` with all of the effects but the last is.
    """
    cast, count, bound = Cast(tuple(places)), len(start), readings.bound
    blocks = blocks_of(cast.places)
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    if before is not None:
        x[: len(before.at)] = before.at
    for iteration in range(ROUNDS + 1):
        model = cast.model(readings, x[:count], x[count:], blocks)
        assert model is not None
        residual = readings.reading.ravel() - model.reading
        # Least squares with these bounds is the least sum of absolute values; misfits within the noise count as one.
        loose = bound * np.sqrt(np.maximum(1.0, np.abs(residual / bound)))
        step = least_squares(model.jacobian / loose[:, None], residual / loose)
        settled = iteration == ROUNDS or np.abs(step).max(initial=0.0) < 0.1 * bound.min()
        if settled or not np.abs((x + step)[:count]).max() <= ASTRAY:
            radius = float(np.abs(residual / bound).max(initial=0.0))
            return Fit(cast.places, blocks, x, 0.0 * x, residual, bound, model.jacobian, radius, x, x[count:])
        x = x + step
    raise AssertionError("the loop returns")


def usual_misfit(fit: Fit) -> float:
    """What most of the readings' misfits at a fit do not exceed, in units of the bounds."""
    return float(np.quantile(np.abs(fit.residual / fit.bound), USUAL))


def _stands(fit: Fit, rows: Rows) -> bool:
    """Whether each effect that is not linear acts at the fit in the way that was assumed."""
    for block, variant in zip(fit.blocks, fit.variants, strict=True):
        if variant is None:
            continue
        middle = fit.coefficients[block]
        within = bool(np.all(middle >= variant.low - 1e-12) and np.all(middle <= variant.high + 1e-12))
        if not within or not variant.stands(rows, middle):
            return False
    return True


def with_possible_sizes(fit: Fit, limit: float, largest_of_bench: float) -> Fit | None:
    """A fit with possible sizes, its own or the nearest; None where none keep the radius at or below the limit."""
    if np.abs(fit.point).max() > largest_of_bench:
        return None
    if fit.is_possible:
        return fit
    own, free = fit.coefficients, np.full(len(fit.point), np.inf)
    low, high = (np.append(sign * free, end - own) for sign, end in zip((-1.0, 1.0), fit.limits, strict=True))
    growth = fit.growths[0] if fit.growths else None
    radius, step, _ = chebyshev_radius(fit.jacobian, fit.residual, fit.bound, low=low, high=high, growth=growth)
    moved = replace(fit, radius=radius, step=step, stated=own + step[len(fit.point) :])
    return moved if radius <= limit and moved.is_possible else None


# Readings that are left out


def leverages(jacobian: NDArray, kept: NDArray, held: NDArray) -> NDArray | None:
    """How uncertain (H,) readings that are held out are predicted, over the others; None where these lose the rank."""
    inverse = _inverse(jacobian, kept)
    return None if inverse is None else np.linalg.norm(jacobian[held] @ inverse, axis=1)


def predicted_errors(
    jacobian: NDArray, residual: NDArray, bound: NDArray, kept: NDArray, held: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Errors (H,) of readings that were left out, and their leverages (H,); None where rank is lost.

    They are predicted by least squares over those that are kept, each in units of its bound; a leverage is by how many
    bounds the prediction is uncertain where each error is one bound (rms).
    """
    unit = jacobian / bound[:, None]
    inverse = _inverse(unit, kept)
    if inverse is None:
        return None
    weights = unit[held] @ inverse
    errors = residual[held] - bound[held] * (weights @ (residual[kept] / bound[kept]))
    return errors, np.linalg.norm(weights, axis=1)


def _inverse(matrix: NDArray, kept: NDArray) -> NDArray | None:
    """The pseudoinverse (n, K) of the rows that are kept; None where they lose the rank of all, or are too few."""
    scale = np.abs(matrix).max(axis=0, initial=0.0)
    unit = matrix / np.where(scale > 0.0, scale, 1.0)
    values = np.linalg.svd(unit, compute_uv=False)
    rank = int((values > DETERMINED * values.max(initial=0.0)).sum())
    u, own, directions = np.linalg.svd(unit[kept], full_matrices=False)
    held = own > DETERMINED * own.max(initial=0.0)
    if len(kept) <= rank or held.sum() < rank:
        return None
    inverse = (directions[held].T / own[held]) @ u[:, held].T
    return inverse / np.where(scale > 0.0, scale, 1.0)[:, None]
