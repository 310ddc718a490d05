"""The second witness on a bench: readings that were left out, predicted without and with effects, and by shuffles."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.effects import EffectPlace
from .bench_model import MAX_LEVERAGE, determined, predicted_errors
from .bench_visits import readings_at
from .evidence import Errors, Trial, Worst
from .fit import Fit

FOLDS, BLOCKS, SHUFFLES = 5, 4, 60
"""Every fifth position is left out in turn, and every quarter of the time."""
FEWEST_SCORED = 6
SURE_NOISE = 5.0
"""Standard deviations of a prediction that no noise within the bounds exceeds, in all readings of a record."""
UNIFORM = 3.0**-0.5
"""Standard deviation of noise that is uniform within its bound, over it; noise at its very bound has one."""

Prediction = tuple[NDArray, NDArray]
"""Errors (H,) of readings that were left out, and how uncertain they are predicted, as `predicted_errors` has them."""
Moved = Callable[[NDArray, np.random.Generator], NDArray]
"""Columns (M, k) of an effect moved to where they do not belong, by a generator."""
Split = tuple[NDArray, NDArray, Prediction | None]
"""Readings that are left out, those that are kept, and the former by the model without effects, if it has them."""


@dataclass(frozen=True, eq=False)
class LinearReadings:
    """A linear model of M readings: derivatives (M, P), residuals (M,) where it begins, and their bounds (M,) [g]."""

    jacobian: Floats
    residual: Floats
    bound: Floats

    def predicted(self, fitted: NDArray, left_out: NDArray) -> Prediction | None:
        """Return readings that are left out, predicted over those that are fitted."""
        return predicted_errors(self._unit, self._rank, self.residual, self.bound, fitted, left_out)

    @cached_property
    def _unit(self) -> Floats:
        return self.jacobian / self.bound[:, None]

    @cached_property
    def _rank(self) -> int:
        return determined(self._unit)

    def beside(self, columns: NDArray) -> "LinearReadings":
        """The model with more columns (M, k)."""
        return LinearReadings(np.hstack((self.jacobian, columns)), self.residual, self.bound)

    def split(self, parts: Sequence[NDArray], usable: NDArray) -> list[Split]:
        """Return the usable readings of each part, with their predictions from the others."""
        split = []
        for out in parts:
            left_out = np.intersect1d(out, usable)
            fitted = np.setdiff1d(usable, left_out)
            split.append((left_out, fitted, self.predicted(fitted, left_out)))
        return split


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Readings (R,) that were left out, their errors (R,) without and with effects, and the leverages (R,) of these."""

    readings: Ints
    without: Floats
    with_effects: Floats
    leverage: Floats

    @staticmethod
    def of(model: LinearReadings, split: Sequence[Split]) -> "LeftOut | None":
        """Return the prediction of each part from the others; None where they determine too little."""
        scored: list[tuple[NDArray, ...]] = []
        for left_out, fitted, without in split:
            if without is None:
                return None
            with_effects = model.predicted(fitted, left_out)
            if with_effects is None:
                return None
            predictable = (without[1] <= MAX_LEVERAGE) & (with_effects[1] <= MAX_LEVERAGE)
            scored.append(tuple(part[predictable] for part in (left_out, without[0], *with_effects)))
        reading_errors = LeftOut(*(np.concatenate(part) for part in zip(*scored, strict=True)))
        if len(reading_errors.readings) < FEWEST_SCORED:
            return None
        return reading_errors

    @property
    def errors(self) -> Errors:
        """Errors (R,) without and with the effects."""
        return self.without, self.with_effects

    def over(self, bound: NDArray) -> "LeftOut":
        """Return the errors over the readings' bounds (M,)."""
        bounds = bound[self.readings]
        return LeftOut(self.readings, self.without / bounds, self.with_effects / bounds, self.leverage)

    def worst(self, fit: Fit, numbers: NDArray) -> Worst:
        """Return the error with the effects that is farthest beyond the noise within the bounds.

        `numbers` (N,) are the record's own numbers of its rows. A reading errs by its bound at most. Its error is at
        most the number of standard deviations of the others' noise that a sum of independent errors can reach. The
        residuals of the fit give these deviations, as uniform noise, up to the bound.
        """
        free = max(1, len(fit.left) - len(fit.at))
        usual = float(np.sqrt(np.sum((fit.left / fit.allowed) ** 2) / free))
        error = np.abs(self.with_effects) / fit.allowed[self.readings]
        allowed = 1.0 + SURE_NOISE * min(1.0, max(UNIFORM, usual)) * self.leverage
        worst = int(np.argmax(error / allowed))
        row, accelerometer = divmod(int(self.readings[worst]), 3)
        return Worst(int(numbers[row]), accelerometer + 1, float(error[worst]), float(allowed[worst]))


def trials(
    nominal: LinearReadings, fit: Fit, name_in_record: Callable[[EffectPlace], EffectPlace], numbers: Ints
) -> Iterator[Trial]:
    """Yield the trials of a set on left-out positions and blocks in time, then those of each effect beside the others.

    Every model is the one linearised at the fit to the whole record. `name_in_record` and `numbers` (N,) give the
    record's own names of effects and rows.
    """
    count, bench, places = len(numbers), len(fit.point), tuple(map(name_in_record, fit.places))
    turns = [readings_at(np.arange(first, count, FOLDS)) for first in range(FOLDS)]
    blocks = [readings_at(part) for part in np.array_split(np.arange(count), BLOCKS) if len(part)]
    lasting, usable = without_outliers(fit)
    if lasting.sum() == bench:
        yield Trial(places, None, None, jointly=True)
        return
    with_all = LinearReadings(fit.jacobian[:, lasting], fit.residual, fit.allowed)
    turned = nominal.split(turns, usable)
    folds, parts = LeftOut.of(with_all, turned), LeftOut.of(with_all, nominal.split(blocks, usable))
    of_effects = lasting & (np.arange(len(fit.at)) >= bench)
    shuffled = _shuffled(_without(fit, lasting, of_effects), fit.jacobian[:, of_effects], turned, by_position)
    judged = [part.worst(fit, numbers) for part in (folds, parts) if part is not None]
    worst = max(judged, key=lambda worst: worst.error / worst.allowed, default=None)
    # Shuffles cost most: they are made only where requested.
    errors_shuffled = (errors.with_effects for errors in shuffled) if folds and fit.linear else ()
    in_turn, in_blocks = folds and folds.errors, parts and parts.errors
    yield Trial(places, in_turn, in_blocks, errors_shuffled, jointly=True, worst=worst, rows=folds and folds.readings)
    if folds and fit.linear and sum(place.effect != "outlier" for place in fit.places) > 1:
        yield from trials_of_each(fit, turns, by_position)


def trials_of_each(fit: Fit, parts: Sequence[NDArray], moved: Moved) -> Iterator[Trial]:
    """Yield the trial of each effect but outliers beside the others, on parts (rows) left out in turn.

    `moved` gives an effect's columns at places where they do not belong.
    """
    lasting, usable = without_outliers(fit)
    with_all = LinearReadings(fit.jacobian[:, lasting], fit.residual, fit.allowed)
    for place, block, _ in fit.ways:
        of_effect = np.zeros(len(fit.at), dtype=bool)
        of_effect[len(fit.point) :][block] = place.effect != "outlier"
        without = _without(fit, lasting, of_effect)
        split = without.split(parts, usable) if of_effect.any() else []
        if of_effect.any() and (alone := LeftOut.of(with_all, split)) is not None:
            shuffled = _shuffled(without, fit.jacobian[:, of_effect], split, moved)
            errors_shuffled = (errors.over(fit.allowed).with_effects for errors in shuffled)
            yield Trial((place,), alone.over(fit.allowed).errors, None, errors_shuffled)


def without_outliers(fit: Fit) -> tuple[Bools, Ints]:
    """Return the mask (P + K,) of the columns that are not of outliers, and the readings that no outlier changes."""
    lasting = np.ones(len(fit.at), dtype=bool)
    for place, block, _ in fit.ways:
        lasting[len(fit.point) :][block] = place.effect != "outlier"
    return lasting, np.flatnonzero(~np.any(fit.jacobian[:, ~lasting] != 0.0, axis=1))


def _without(fit: Fit, lasting: NDArray, removed: NDArray) -> LinearReadings:
    """Return the model without the removed columns (P + K,), with their effects subtracted at the sizes of the fit."""
    return LinearReadings(
        fit.jacobian[:, lasting & ~removed], fit.residual + fit.jacobian[:, removed] @ fit.at[removed], fit.allowed
    )


def by_position(columns: NDArray, rng: np.random.Generator) -> Floats:
    """Columns (3 N, k) moved to other positions."""
    count = len(columns) // 3
    return columns.reshape(count, 3, -1)[rng.permutation(count)].reshape(3 * count, -1)


def _shuffled(model: LinearReadings, columns: NDArray, split: Sequence[Split], moved: Moved) -> Iterator[LeftOut]:
    """Columns (M, k) of effects moved, beside a model without them."""
    rng = np.random.default_rng(len(columns) // 3)
    for _ in range(SHUFFLES):
        reading_errors = LeftOut.of(model.beside(moved(columns, rng)), split)
        if reading_errors is not None:
            yield reading_errors
