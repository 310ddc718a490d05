"""The bench model together with a set of effects, each acting in one way: readings, derivatives, exact fits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import EffectPlace, Rows
from ...models.effects.rows import Variant
from ..bounded.programmes import chebyshev_radius
from ..bounded.sets import least_squares
from ..calibration.model import (
    Linearisation,
    Positions,
    direction_jacobian,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)
from .bench_effects import Circumstances, Visits, acts_on_table, added_bound, is_linear, readings_at, signature_columns
from .fit import Fit, coefficient_count, coefficient_limits

MAX_ITERATIONS, MAX_MOVES = 12, 8
ATTAINED = 1e-10
"""Relative difference between the radius of the programme and the largest misfit where it is attained."""
ASTRAY = 10.0
"""No bench has a parameter as large [1], [rad], [g]: a fit that comes there runs away."""
CONVERGED = 1e-12
"""Parameters [1], [rad] that move by less than this do not move."""
USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
ROUNDS = 12
"""Steps to a centre that few readings cannot draw."""
MAX_LEVERAGE = 1.0
"""A held-out reading is scored when its prediction is at most so many times as uncertain (rms) as a reading."""


@dataclass(frozen=True)
class Relaxation:
    """What any variant of an effect may do, and more: a set that is refused with it is refused with each of them.

    `ways` is the number of variants; 0 of an effect that is linear, but not told everywhere. `touched` (M,) are the
    readings that some variant changes: they say nothing about the bench; by `widening` (M,) the bounds of the others
    grow, fractions of g; `columns` (M, K) are what the effect adds linearly.
    """

    place: EffectPlace
    ways: int
    touched: NDArray
    widening: NDArray
    columns: NDArray


@dataclass(frozen=True)
class Model:
    """Prediction and derivatives of a bench with effects at one point.

    `reading`, `bound` (3 N,): predicted readings and bounds of their errors, fractions of g; `jacobian` (3 N, P + K):
    by parameters of the bench and coefficients of the effects; `variants`: the way in which each effect acts that is
    not linear; `rows`: with this prediction.
    """

    reading: NDArray
    jacobian: NDArray
    bound: NDArray
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
                columns = signature_columns([place], rows)
                found.append(Relaxation(place, 0, added_bound([place], rows) > 0.0, np.zeros(len(columns)), columns))
                continue
            variants = self.variants(place, rows)
            if not variants:
                continue
            touched = np.any(
                [v.lost | v.fixed | (v.offset != 0.0) | np.any(v.columns != 0.0, axis=2) for v in variants], axis=0
            )
            widening = np.max([variant.widening for variant in variants], axis=0)
            nothing = np.zeros((touched.size, 0))
            found.append(Relaxation(place, len(variants), touched.ravel(), widening.ravel(), nothing))
        return found


@dataclass(frozen=True)
class Cast:
    """A set of effects, each in the way in which it is to act.

    `ways`: of each effect that is not linear, which of its variants; `largest`: largest coefficients of effects whose
    circumstances the record does not tell everywhere, by default the largest possible.
    """

    places: tuple[EffectPlace, ...]
    ways: Mapping[EffectPlace, int] = field(default_factory=dict)
    largest: Mapping[EffectPlace, float] = field(default_factory=dict)

    def variants(self, readings: Readings, rows: Rows) -> tuple[Variant | None, ...] | None:
        """The variant of each effect; None where one of the ways is none here."""
        found: list[Variant | None] = []
        for place in self.places:
            seen = readings.variants(place, rows) if place in self.ways else [None]
            if (way := self.ways.get(place, 0)) >= len(seen):
                return None
            found.append(seen[way])
        return tuple(found)

    def blocks(self, variants: Sequence[Variant | None] | None = None) -> tuple[slice, ...]:
        """The coefficients of each effect, one effect after the other."""
        blocks, first = [], 0
        for place, variant in zip(self.places, variants or [None] * len(self.places), strict=True):
            count = coefficient_count(place) if variant is None else variant.columns.shape[2]
            blocks.append(slice(first, first + count))
            first += count
        return tuple(blocks)

    def model(
        self, readings: Readings, point: NDArray, coefficients: NDArray, blocks: Sequence[slice] | None = None
    ) -> Model | None:
        """The bench with these effects at a point and coefficients; None where one of the ways is none there."""
        p, own = readings.parametrisation, dict(zip(self.places, blocks or self.blocks(), strict=True))
        linear = [(place, coefficients[block]) for place, block in own.items() if place not in self.ways]
        at = readings.disturbed(point, linear)
        rows = readings.rows(point, at)
        columns = {place: signature_columns([place], rows) for place, _ in linear}
        reading = predicted_reading(p, point, at, readings.sign).ravel()
        for place, part in linear:
            if not acts_on_table(place):
                reading = reading + columns[place] @ part
        slopes = reading_jacobian(p, point, at, readings.sign)
        rows = replace(rows, prediction=reading.reshape(-1, 3))
        bound = readings.bound + added_bound([place for place, _ in linear], rows, self.largest)
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
        for place, block in own.items():
            if place in self.ways:
                reading = reading + columns[place] @ coefficients[block]
            else:
                columns[place][fixed.ravel()] = 0.0
        jacobian = np.hstack([slopes.reshape(len(reading), -1), *(columns[place] for place in self.places)])
        return Model(reading, jacobian, bound, variants, rows)


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


def fitted(readings: Readings, cast: Cast, start: NDArray) -> Fit | None:
    """Fit the bench together with effects: least squares, then the Chebyshev programme, both relinearised.

    It begins at parameters (P,) of the bench; None where it leaves the way in which an effect acts, or runs away.
    """
    reading, count = readings.reading.ravel(), len(start)
    begun = cast.variants(readings, readings.rows(start))
    if begun is None:
        return None
    blocks = cast.blocks(begun)
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    for block, variant in zip(blocks, begun, strict=True):
        if variant is not None:
            x[count:][block] = 0.5 * (variant.low + variant.high)
    model: Model | None = None
    for iteration in range(MAX_ITERATIONS + 1):
        model = cast.model(readings, x[:count], x[count:], blocks)
        if model is None:
            return None
        step = least_squares(model.jacobian / model.bound[:, None], (reading - model.reading) / model.bound)
        if iteration == MAX_ITERATIONS or np.abs(step).max(initial=0.0) < CONVERGED:
            break
        x = x + step
        if _astray(x, count):
            return None
    assert model is not None
    estimate, residual = x, reading - model.reading
    radius, step, _ = chebyshev_radius(model.jacobian, residual, model.bound)
    for _ in range(MAX_MOVES):
        # Noise may be at its very bound: then the second order of the step to the centre must not count either.
        x = x + step
        if _astray(x, count):
            return None
        model = cast.model(readings, x[:count], x[count:], blocks)
        if model is None:
            return None
        residual = reading - model.reading
        attained = float(np.abs(residual / model.bound).max(initial=0.0))
        if attained <= radius + ATTAINED * max(1.0, radius):
            break
        radius, step, _ = chebyshev_radius(model.jacobian, residual, model.bound)
    radius = float(np.abs(residual / model.bound).max(initial=0.0))
    still = np.zeros(len(x))
    fit = Fit(
        cast.places,
        blocks,
        x,
        still,
        residual,
        model.bound,
        model.jacobian,
        radius,
        estimate,
        x[count:],
        model.variants,
    )
    return fit if _stands(fit, model.rows) else None


def centre_of(readings: Readings, places: Sequence[EffectPlace], start: NDArray, before: Fit | None = None) -> Fit:
    """The point with about the least sum of absolute misfits, which few readings cannot draw, with linear effects.

    It begins at parameters (P,) of the bench, or where the fit `before` with all of the effects but the last is.
    """
    cast, count, bound = Cast(tuple(places)), len(start), readings.bound
    blocks = cast.blocks()
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


def _astray(x: NDArray, count: int) -> bool:
    """Whether a fit runs away."""
    return not (np.abs(x[:count]).max() <= ASTRAY and np.isfinite(x[count:]).all())


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
    ends = [
        coefficient_limits(place) if variant is None else (variant.low, variant.high) for place, _, variant in fit.ways
    ]
    low, high = (np.concatenate(side) - own for side in zip(*ends, strict=True))
    low, high = np.append(-free, low), np.append(free, high)
    radius, step, _ = chebyshev_radius(fit.jacobian, fit.residual, fit.bound, low=low, high=high)
    moved = replace(fit, radius=radius, step=step, stated=own + step[len(fit.point) :])
    return moved if radius <= limit and moved.is_possible else None


# Of a bench


def leverages(jacobian: NDArray, kept: NDArray, held: NDArray) -> NDArray | None:
    """How uncertain (H,) readings that are held out are predicted, over the others; None where these lose the rank."""
    scale = np.abs(jacobian).max(axis=0, initial=0.0)
    unit = jacobian / np.where(scale > 0.0, scale, 1.0)
    rank = np.linalg.matrix_rank(unit, rtol=1e-8)
    if len(kept) <= rank or np.linalg.matrix_rank(unit[kept], rtol=1e-8) < rank:
        return None
    return np.linalg.norm(unit[held] @ np.linalg.pinv(unit[kept], rcond=1e-8), axis=1)


def predicted_errors(
    jacobian: NDArray, residual: NDArray, bound: NDArray, kept: NDArray, held: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Errors (H,) of readings that were left out, and whether their leverage is bounded; None where rank is lost."""
    leverage = leverages(jacobian, kept, held)
    if leverage is None:
        return None
    step = least_squares(jacobian[kept] / bound[kept, None], residual[kept] / bound[kept])
    return residual[held] - jacobian[held] @ step, leverage <= MAX_LEVERAGE
