"""The second witness: positions that were left out, blocks in time, and shuffled effects as a negative control.

None of it is evidence for an effect. Almost any effect improves some readings that were left out; but one that improves
none, or no more than its own signature does at positions that it does not belong to, deserves a warning.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Linearisation
from .extended_fit import ExtendedFit, least_squares_step
from .gain import MAX_LEVERAGE

FOLDS = 5
BLOCKS = 4
SHUFFLES = 60
FEWEST_SCORED = 6
USUAL_CHANCE = 0.05
"""More than this part of the shuffles being as good as the effect deserves a warning."""


@dataclass(frozen=True)
class Score:
    """Errors of readings that were left out, without and with the effects, fractions of g.

    Attributes
    ----------
    before, after : (S,) array
    """

    before: NDArray
    after: NDArray

    @property
    def improves(self) -> bool:
        """Whether the readings are predicted better with the effects, on the whole."""
        return bool(np.mean(self.after**2) < np.mean(self.before**2))

    def to_json(self) -> dict[str, Any]:
        """Root mean squares and maxima."""
        return {
            "scored": len(self.before),
            "rms_before": float(np.sqrt(np.mean(self.before**2))),
            "rms_after": float(np.sqrt(np.mean(self.after**2))),
            "max_before": float(np.abs(self.before).max()),
            "max_after": float(np.abs(self.after).max()),
        }


@dataclass(frozen=True)
class Judgement:
    """What readings that were left out say of a set of effects.

    Attributes
    ----------
    folds, blocks : Score or None
        every fifth position left out in turn; every quarter of the time; None where that is not possible
    shuffles, as_good : int
        shuffles tried, and how many of them predicted the folds as well as the effects in their own places
    """

    folds: Score | None
    blocks: Score | None
    shuffles: int
    as_good: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is suspicious about the effects."""
        said = []
        if self.folds is None:
            said.append(
                "whether the effects improve positions that were left out could not be judged: too few positions"
            )
        elif not self.folds.improves:
            said.append("the effects do not improve positions that were left out")
        if self.blocks is not None and not self.blocks.improves:
            said.append("the effects do not improve parts of the record, in time, that were left out")
        if self.shuffles and self.as_good > USUAL_CHANCE * self.shuffles:
            said.append(f"{self.as_good} of {self.shuffles} shuffles of the effects predict what was left out as well")
        return tuple(said)

    def to_json(self) -> dict[str, Any]:
        """The entry `judgement`."""
        return {
            "folds": None if self.folds is None else self.folds.to_json(),
            "blocks": None if self.blocks is None else self.blocks.to_json(),
            "shuffles": {"tried": self.shuffles, "as_good": self.as_good} if self.shuffles else None,
            "warnings": list(self.warnings),
        }


def judge(here: Linearisation, fit: ExtendedFit) -> Judgement:
    """Leave out positions and blocks in time; shuffle the effects' signatures over the positions.

    Every model is the one linearised at the fit to the whole record.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    fit : ExtendedFit
        the model with effects
    """
    count = len(here.reading)
    turns = [np.arange(first, count, FOLDS) for first in range(FOLDS)]
    blocks = [part for part in np.array_split(np.arange(count), BLOCKS) if len(part)]
    used, lasting = without_outliers(fit)
    if lasting.sum() == len(fit.point):
        return Judgement(None, None, 0, 0)
    jacobian = fit.jacobian[:, lasting]
    folds = score(here, jacobian, fit.residual, turns, used)
    shuffled = 0
    as_good = 0
    if folds is not None and fit.linear:
        rng = np.random.default_rng(count)
        bench = fit.jacobian[:, : len(fit.point)]
        own = jacobian[:, len(fit.point) :]
        # With the effects taken out at their sizes, a shuffle begins where the nominal model does.
        whole = fit.residual + own @ fit.coefficients[lasting[len(fit.point) :]]
        reached = np.sqrt(np.mean(folds.after**2))
        for _ in range(SHUFFLES):
            order = rng.permutation(count)
            moved = own.reshape(count, 3, -1)[order].reshape(3 * count, -1)
            tried = score(here, np.hstack((bench, moved)), whole, turns, used)
            if tried is not None:
                shuffled += 1
                as_good += bool(np.sqrt(np.mean(tried.after**2)) <= reached)
    return Judgement(folds, score(here, jacobian, fit.residual, blocks, used), shuffled, as_good)


def without_outliers(fit: ExtendedFit) -> tuple[NDArray, NDArray]:
    """Readings (M,) of bool that no outlier of the set moves, and columns (P + K,) of bool that are no outlier's."""
    used = np.ones(len(fit.residual), dtype=bool)
    lasting = np.ones(fit.jacobian.shape[1], dtype=bool)
    for place, block in zip(fit.places, fit.blocks, strict=True):
        if place.effect == "outlier":
            columns = np.arange(len(fit.point) + block.start, len(fit.point) + block.stop)
            lasting[columns] = False
            used &= ~np.any(fit.jacobian[:, columns] != 0.0, axis=1)
    return used, lasting


def score(
    here: Linearisation, jacobian: NDArray, residual: NDArray, parts: Sequence[NDArray], used: NDArray
) -> Score | None:
    """Leave out each part (rows) in turn and predict it; None where the others would not do, or score too little."""
    before, after = [], []
    for out in parts:
        held = np.intersect1d((3 * out[:, None] + np.arange(3)).ravel(), np.flatnonzero(used))
        kept = np.setdiff1d(np.flatnonzero(used), held)
        with_effects = predicted_errors(jacobian, residual, here.bound, kept, held)
        without = predicted_errors(here.jacobian, here.residual, here.bound, kept, held)
        if with_effects is None or without is None:
            return None
        wanted = with_effects[1] & without[1]
        before.append(without[0][wanted])
        after.append(with_effects[0][wanted])
    if sum(len(part) for part in before) < FEWEST_SCORED:
        return None
    return Score(np.concatenate(before), np.concatenate(after))


def predicted_errors(
    jacobian: NDArray, residual: NDArray, bound: NDArray, kept: NDArray, held: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Errors (H,) of readings that were left out, and whether their leverage is bounded; None where rank is lost."""
    scale = np.abs(jacobian).max(axis=0)
    unit = jacobian / np.where(scale > 0.0, scale, 1.0)
    rank = np.linalg.matrix_rank(unit, tol=1e-8 * np.linalg.norm(unit, 2))
    part = unit[kept]
    if len(kept) <= rank or np.linalg.matrix_rank(part, tol=1e-8 * np.linalg.norm(part, 2)) < rank:
        return None
    leverage = np.linalg.norm(unit[held] @ np.linalg.pinv(part, rcond=1e-8), axis=1)
    step = least_squares_step(jacobian[kept], residual[kept], bound[kept])
    return residual[held] - jacobian[held] @ step, leverage <= MAX_LEVERAGE
