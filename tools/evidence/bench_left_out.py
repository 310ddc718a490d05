"""The second witness on a bench: readings that were left out, predicted without and with effects, and by shuffles."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from .bench_model import MAX_LEVERAGE, determined, predicted_errors
from .bench_visits import readings_at
from .evidence import Errors, Trial, Worst
from .fit import Fit

FOLDS, BLOCKS, SHUFFLES = 5, 4, 60
"""Every fifth position is left out in turn, and every quarter of the time."""
FEWEST_SCORED = 6
SURE_NOISE = 5.0
"""So many standard deviations of a prediction no noise within the bounds makes, in all readings of a record."""
UNIFORM = 3.0**-0.5
"""Standard deviation of noise that is uniform within its bound, over it; noise at its very bound has one."""

Prediction = tuple[NDArray, NDArray]
"""Errors (H,) of readings that were left out, and how uncertain they are predicted, as `predicted_errors` has them."""
Moved = Callable[[NDArray, np.random.Generator], NDArray]
"""Columns (M, k) of an effect moved to where they do not belong, by a generator."""
Split = tuple[NDArray, NDArray, Prediction | None]
"""Readings that are left out, those that are kept, and the former by the model without effects, if it has them."""


@dataclass(frozen=True, eq=False)
class Linear:
    """A linear model of M readings: derivatives (M, P), residuals (M,) where it begins, and their bounds (M,) [g]."""

    jacobian: NDArray[np.float64]
    residual: NDArray[np.float64]
    bound: NDArray[np.float64]

    def predicted(self, kept: NDArray, held: NDArray) -> Prediction | None:
        """Readings that are held out, over those that are kept."""
        return predicted_errors(self._unit, self._rank, self.residual, self.bound, kept, held)

    @cached_property
    def _unit(self) -> NDArray[np.float64]:
        return self.jacobian / self.bound[:, None]

    @cached_property
    def _rank(self) -> int:
        return determined(self._unit)

    def beside(self, columns: NDArray) -> "Linear":
        """The model with more columns (M, k)."""
        return Linear(np.hstack((self.jacobian, columns)), self.residual, self.bound)

    def split(self, parts: Sequence[NDArray], used: NDArray) -> list[Split]:
        """Readings of each part, of those that are used, predicted over the others."""
        split = []
        for out in parts:
            held = np.intersect1d(out, used)
            kept = np.setdiff1d(used, held)
            split.append((held, kept, self.predicted(kept, held)))
        return split


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Readings (R,) that were left out, their errors (R,) without and with effects, and the leverages (R,) of these."""

    readings: NDArray[np.int_]
    without: NDArray[np.float64]
    with_effects: NDArray[np.float64]
    leverage: NDArray[np.float64]

    @staticmethod
    def of(model: Linear, split: Sequence[Split]) -> "LeftOut | None":
        """Of each part in turn; None where the others would not do, or tell too few of them."""
        found: list[tuple[NDArray, ...]] = []
        for held, kept, without in split:
            with_effects = model.predicted(kept, held) if without else None
            if without is None or with_effects is None:
                return None
            wanted = (without[1] <= MAX_LEVERAGE) & (with_effects[1] <= MAX_LEVERAGE)
            found.append(tuple(part[wanted] for part in (held, without[0], *with_effects)))
        told = LeftOut(*(np.concatenate(part) for part in zip(*found, strict=True)))
        return told if len(told.readings) >= FEWEST_SCORED else None

    @property
    def errors(self) -> Errors:
        """Errors (R,) without and with the effects."""
        return self.without, self.with_effects

    def over(self, bound: NDArray) -> "LeftOut":
        """The same over the readings' bounds (M,)."""
        own = bound[self.readings]
        return LeftOut(self.readings, self.without / own, self.with_effects / own, self.leverage)

    def worst(self, fit: Fit, numbers: NDArray) -> Worst:
        """The error with the effects that is farthest beyond what noise within the bounds makes of it.

        `numbers` (N,) are the record's own of its rows. A reading is off by its bound at most; its prediction by as
        many standard deviations of the others' noise as no sum of independent errors has. How large these are, what the
        fit leaves says: as uniform noise, up to the bound.
        """
        free = max(1, len(fit.left) - len(fit.at))
        usual = float(np.sqrt(np.sum((fit.left / fit.allowed) ** 2) / free))
        error = np.abs(self.with_effects) / fit.allowed[self.readings]
        allowed = 1.0 + SURE_NOISE * min(1.0, max(UNIFORM, usual)) * self.leverage
        worst = int(np.argmax(error / allowed))
        row, accelerometer = divmod(int(self.readings[worst]), 3)
        return Worst(int(numbers[row]), accelerometer + 1, float(error[worst]), float(allowed[worst]))


def trials(
    nominal: Linear, fit: Fit, named: Callable[[EffectPlace], EffectPlace], numbers: NDArray[np.int_]
) -> Iterator[Trial]:
    """What was left out says of a set: positions in turn and blocks in time; then of each effect beside the others.

    Every model is the one linearised at the fit to the whole record. `named` and `numbers` (N,) are effects and rows as
    the record names them.
    """
    count, bench, places = len(numbers), len(fit.point), tuple(map(named, fit.places))
    turns = [readings_at(np.arange(first, count, FOLDS)) for first in range(FOLDS)]
    blocks = [readings_at(part) for part in np.array_split(np.arange(count), BLOCKS) if len(part)]
    lasting, used = without_outliers(fit)
    if lasting.sum() == bench:
        yield Trial(places, None, None, jointly=True)
        return
    whole = Linear(fit.jacobian[:, lasting], fit.residual, fit.allowed)
    turned = nominal.split(turns, used)
    folds, parts = (LeftOut.of(whole, split) for split in (turned, nominal.split(blocks, used)))
    own = lasting & (np.arange(len(fit.at)) >= bench)
    shuffled = _shuffled(_without(fit, lasting, own), fit.jacobian[:, own], turned, by_position)
    left = [part.worst(fit, numbers) for part in (folds, parts) if part is not None]
    worst = max(left, key=lambda one: one.error / one.allowed, default=None)
    # Shuffles cost most of all: they are made where they are asked for.
    tried = (left.with_effects for left in shuffled) if folds and fit.linear else ()
    rows = folds and folds.readings
    yield Trial(places, folds and folds.errors, parts and parts.errors, tried, jointly=True, worst=worst, rows=rows)
    if folds and fit.linear and sum(place.effect != "outlier" for place in fit.places) > 1:
        yield from trials_of_each(fit, turns, by_position)


def trials_of_each(fit: Fit, parts: Sequence[NDArray], moved: Moved) -> Iterator[Trial]:
    """What parts (rows) that are left out in turn say of each effect of a fit but outliers, beside the others.

    `moved` gives an effect's columns at places where they do not belong.
    """
    lasting, used = without_outliers(fit)
    whole = Linear(fit.jacobian[:, lasting], fit.residual, fit.allowed)
    for place, block, _ in fit.ways:
        own = np.zeros(len(fit.at), dtype=bool)
        own[len(fit.point) :][block] = place.effect != "outlier"
        others = _without(fit, lasting, own)
        split = others.split(parts, used) if own.any() else []
        if own.any() and (alone := LeftOut.of(whole, split)) is not None:
            shuffled = _shuffled(others, fit.jacobian[:, own], split, moved)
            tried = (left.over(fit.allowed).with_effects for left in shuffled)
            yield Trial((place,), alone.over(fit.allowed).errors, None, tried)


def without_outliers(fit: Fit) -> tuple[NDArray[np.bool_], NDArray[np.int_]]:
    """Which columns (P + K,) are not those of outliers, which last at no other reading, and the readings without."""
    lasting = np.ones(len(fit.at), dtype=bool)
    for place, block, _ in fit.ways:
        lasting[len(fit.point) :][block] = place.effect != "outlier"
    return lasting, np.flatnonzero(~np.any(fit.jacobian[:, ~lasting] != 0.0, axis=1))


def _without(fit: Fit, lasting: NDArray, own: NDArray) -> Linear:
    """The model without some columns (P + K,) of bool, which begins with these effects taken out at their sizes."""
    return Linear(fit.jacobian[:, lasting & ~own], fit.residual + fit.jacobian[:, own] @ fit.at[own], fit.allowed)


def by_position(own: NDArray, rng: np.random.Generator) -> NDArray[np.float64]:
    """Columns (3 N, k) moved to other positions."""
    count = len(own) // 3
    return own.reshape(count, 3, -1)[rng.permutation(count)].reshape(3 * count, -1)


def _shuffled(others: Linear, own: NDArray, split: Sequence[Split], moved: Moved) -> Iterator[LeftOut]:
    """Columns (M, k) of effects moved, beside a model without them."""
    rng = np.random.default_rng(len(own) // 3)
    for _ in range(SHUFFLES):
        left = LeftOut.of(others.beside(moved(own, rng)), split)
        if left is not None:
            yield left
