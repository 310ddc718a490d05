"""The second witness: test effects on readings left out of the fit, and on shuffles."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence, Trial
from ..evidence.fit import Fit
from ..fields import Axis, Count, Number
from ..result import Result
from ..rounding import downwards, upwards

CHANCE = 0.05
"""More than this part of the shuffles being as good as an effect speaks against it."""


class Score(Result):
    """Errors of the left-out readings, without and with effects, in the unit of the evidence."""

    scored: Count
    rms_before: Number
    rms_after: Number
    max_before: Number
    max_after: Number

    @staticmethod
    def of(before: NDArray, after: NDArray) -> "Score":
        """Root mean squares and maxima of errors (R,)."""
        return Score(
            scored=len(before),
            rms_before=rms(before),
            rms_after=rms(after),
            max_before=float(np.abs(before).max()),
            max_after=float(np.abs(after).max()),
        )

    @property
    def improves(self) -> bool:
        """Return true if the effects reduce the rms error of the left-out readings."""
        return self.rms_after < self.rms_before


class Shuffles(Result):
    """Shuffles of effects, and the number of them that predicted the left-out readings as well."""

    tried: Count
    as_good: Count

    @staticmethod
    def of(trial: Trial, reached: float) -> "Shuffles":
        """Return the number of shuffles, and of those with an error as small as that of the effects in place."""
        count = as_good = 0
        for errors in trial.shuffled:
            count += 1
            as_good += rms(errors) <= reached
        return Shuffles(tried=count, as_good=as_good)

    @property
    def objects(self) -> bool:
        """Return true if the shuffles speak against the effects."""
        return self.as_good > CHANCE * self.tried


class LargestError(Result):
    """Largest error of a left-out reading, over its bound, and the largest error that noise can cause."""

    position: Count
    accelerometer: Axis
    error: Number
    allowed: Number

    @property
    def objects(self) -> bool:
        """Return true if the error speaks against the effects."""
        return self.error > self.allowed


class EffectWitness(Result):
    """Left-out errors over their bounds for one effect of a set: with the other effects only, and with it."""

    effect: str
    where: str
    rms_without: Number
    rms_with: Number
    shuffles: Shuffles
    place: EffectPlace | None = Field(default=None, exclude=True)

    @staticmethod
    def of(trial: Trial) -> "EffectWitness":
        """The witness of a trial of one effect."""
        (place,), errors = trial.places, trial.folds
        assert errors is not None
        without, reached = rms(errors[0]), rms(errors[1])
        return EffectWitness(
            effect=place.effect,
            where=place.where,
            rms_without=without,
            rms_with=reached,
            shuffles=Shuffles.of(trial, reached),
            place=place,
        )

    @property
    def title(self) -> str:
        """The effect in words."""
        return f"{self.effect} {self.where}" if self.place is None else self.place.title

    @property
    def objections(self) -> tuple[str, ...]:
        """Why the effect may not be named; none where it may."""
        if not self.rms_with < self.rms_without:
            return (f"{self.title} does not improve the parts of the record that were left out",)
        if not self.shuffles.objects:
            return ()
        shuffles = f"{self.shuffles.as_good} of {self.shuffles.tried} shuffles of {self.title} over the record"
        return (f"{shuffles} predict what was left out as well",)


class Witness(Result):
    """Left-out errors for the effects of a set together.

    None of it is evidence for them: almost any effect improves some readings that were left out. Effects are not named
    if they improve none, or no more than their own signatures do where they do not belong. Nor are effects named with
    which a left-out reading misses by more than noise within the bounds can cause.
    """

    folds: Score | None
    blocks: Score | None
    shuffles: Shuffles | None
    largest: LargestError | None
    each: tuple[EffectWitness, ...] = ()
    place_titles: tuple[str, ...] = Field(default=(), exclude=True)

    @staticmethod
    def of(trial: Trial) -> "Witness":
        """The witness of a trial of a whole set."""
        folds = None if trial.folds is None else Score.of(*trial.folds)
        blocks = None if trial.blocks is None else Score.of(*trial.blocks)
        shuffles = None if folds is None else Shuffles.of(trial, folds.rms_after)
        if shuffles is not None and not shuffles.tried:
            shuffles = None
        largest = None if trial.worst is None else LargestError(**vars(trial.worst))
        titles = tuple(place.title for place in trial.places)
        return Witness(folds=folds, blocks=blocks, shuffles=shuffles, largest=largest, place_titles=titles)

    @property
    def objections(self) -> tuple[str, ...]:
        """Why the effects may not be named; none where they may."""
        would_do, objections = f"{' and '.join(self.place_titles)} would do, but", []
        if self.folds is not None and not self.folds.improves:
            objections.append(f"{would_do} does not improve positions that were left out")
        if self.blocks is not None and not self.blocks.improves:
            objections.append(f"{would_do} does not improve parts of the record, in time, that were left out")
        if self.shuffles is not None and self.shuffles.objects:
            objections.append(
                f"{would_do} {self.shuffles.as_good} of {self.shuffles.tried} shuffles over the record predict what "
                "was left out as well"
            )
        if self.largest is not None and self.largest.objects:
            objections.append(
                f"{would_do} the reading at position/accelerometer {self.largest.position}/"
                f"{self.largest.accelerometer}, left out, misses by {downwards(self.largest.error, 3)} times its "
                f"bound; noise makes {upwards(self.largest.allowed, 3)} at most"
            )
        return (*objections, *objections_of(self.each))

    @property
    def not_judged(self) -> str | None:
        """Return the reason why the effects could not be judged, or None; that is not an objection."""
        if self.folds is not None:
            return None
        return "whether the effects improve positions that were left out could not be judged: too few positions"


Judgement = Witness | Sequence[EffectWitness]


def judgement_of(evidence: Evidence, fit: Fit) -> Judgement:
    """Return the judgement of the left-out readings on the effects of a fit: on all together, or on each."""
    together: Witness | None = None
    each: list[EffectWitness] = []
    # The shuffles of a trial are made while it is judged, before the next trial begins.
    for trial in evidence.reader.trials(fit):
        if trial.jointly:
            together = together or Witness.of(trial)
        else:
            each.append(EffectWitness.of(trial))
    return each if together is None else together.model_copy(update={"each": tuple(each)})


def objections_of(judgement: Judgement) -> tuple[str, ...]:
    """Why the effects may not be named; none where they may."""
    if isinstance(judgement, Witness):
        return judgement.objections
    objections: list[str] = []
    for witness in judgement:
        objections += witness.objections
    return tuple(objections)


def by_need(witnesses: Sequence[EffectWitness]) -> list[EffectWitness]:
    """Witnesses of each effect, that of the effect first that is needed most."""
    return sorted(witnesses, key=lambda witness: -witness.rms_without)


def rms(errors: Floats) -> float:
    """Return the root mean square of errors."""
    return float(np.sqrt(np.mean(errors**2)))
