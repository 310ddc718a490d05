"""A record calibrated with each explanation that remains: one calibration that holds with any of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.effects import EffectPlace
from ..calibrated import CalibratedEffect, Calibration, Open, Parameter, SetOfEffects, noise_option
from .cause import NO_SIZES, Cause
from .result import Diagnosis, Explanation
from .with_effects import either_effects, either_parameters, ends_of_either


@dataclass(frozen=True)
class Way:
    """A diagnosis of one explanation, and the calibration with it."""

    diagnosis: Diagnosis
    calibration: Calibration

    @property
    def titles(self) -> list[str]:
        """The effects of the explanation in words, or its sentence."""
        causes = self.diagnosis.causes
        return [cause.place.title for cause in causes] or [self.diagnosis.explanations[0].sentence.rstrip(".")]


def explanations_to_use(diagnosis: Diagnosis, noise_bound: float | None = None) -> tuple[Diagnosis, ...]:
    """Return a diagnosis for each explanation to calibrate a record with; none where nothing is named.

    Of an ambiguous diagnosis these are the sets of effects and the faults that remain. Of an unexplained one they are
    the sets with which the model would stand with a noise bound that a person gives.
    """
    if diagnosis.verdict == "explained":
        return (diagnosis,)
    explanations: list[Explanation] = []
    if diagnosis.verdict == "ambiguous":
        explanations += [one for one in diagnosis.explanations if not is_without_law(one)]
    if diagnosis.verdict == "unexplained" and diagnosis.unit is None and noise_bound is not None:
        for entry in diagnosis.stands_with or ():
            if entry.effects and entry.noise_bound <= noise_bound:
                explanations.append(Explanation.of_causes(tuple(_of_any_size(e.place) for e in entry.effects)))
    chosen = []
    for one in explanations:
        changed = {"verdict": "explained", "explanations": (one,), "causes": one.causes, "alternatives": None}
        chosen.append(diagnosis.model_copy(update=changed))
    return tuple(chosen)


def without_explanation(diagnosis: Diagnosis) -> str:
    """Return a sentence on a diagnosis that names nothing to calibrate with."""
    if diagnosis.verdict == "consistent":
        return "the diagnosis is consistent and names no effect: calibrated without it"
    text = f"the diagnosis is {diagnosis.verdict} and names no effect: these are the estimates without effects"
    options = [f"{entry.option} with {entry.title}" for entry in diagnosis.stands_with or () if entry.option]
    return f"{text}; the model would stand with {'; or '.join(options)}" if options else text


def is_without_law(explanation: Explanation) -> bool:
    """Return true of a function of a quantity whose law nothing states: no record can be calibrated with it."""
    return explanation.kind == "function" and not explanation.causes


def _of_any_size(place: EffectPlace) -> Cause:
    """Return an effect whose size nothing tells."""
    count = len(place.definition.parameters)
    return Cause.found(place, (), [0.0] * count, [(-np.inf, np.inf)] * count)


def with_any_of(ways: Sequence[Way], diagnosis: Diagnosis, refusals: Sequence[str]) -> Calibration:
    """Return one calibration that holds with any of several explanations: the union of their intervals.

    The estimates are those of the first explanation. `refusals` are the reasons why the record cannot be calibrated
    with others: then nothing is guaranteed.
    """
    standing = [way for way in ways if way.calibration.verdict != "falsified"] or list(ways[:1])
    first = standing[0].calibration
    parameters, reading_errors = first.parameters, first.reading_errors
    least = first
    for way in standing[1:]:
        other = way.calibration
        parameters = either_parameters(parameters, other.parameters)
        pairs = zip(reading_errors, other.reading_errors, strict=False)
        reading_errors = [one.model_copy(update=ends_of_either(one, another)) for one, another in pairs]
        if other.verdict == "insufficient" and least.verdict != "insufficient":
            least = other
    # Weights that are best with one explanation promise nothing with another.
    parameters = [p.model_copy(update={"a_priori": None, "guaranteed_error": None}) for p in parameters]
    left_out = [*refusals, *(one.sentence.rstrip(".") for one in diagnosis.explanations if is_without_law(one))]
    if left_out:
        parameters, reading_errors = [p.model_copy(update={"low": None, "high": None}) for p in parameters], []
    changed: dict[str, Any] = {
        "verdict": least.verdict,
        "no_estimate": least.no_estimate,
        "open": _open_of(standing),
        "parameters": parameters,
        "reading_errors": reading_errors,
        "effects": _effects(standing),
        "sets": [_set_of(way) for way in standing],
        "warnings": [_remark(diagnosis, standing, left_out), *first.warnings],
    }
    return first.model_copy(update=changed)


def _open_of(standing: Sequence[Way]) -> list[Open]:
    """Return the directions that the record leaves open with any of the explanations, each once."""
    entries: list[Open] = []
    for way in standing:
        entries += [entry for entry in way.calibration.open if entry not in entries]
    return entries


def _remark(diagnosis: Diagnosis, standing: Sequence[Way], left_out: Sequence[str]) -> str:
    """Return the sentence on the questions that the diagnosis leaves open."""
    count = len(standing)
    text = f"the diagnosis is ambiguous, {count} explanations with stated laws remain"
    if diagnosis.verdict == "unexplained":
        text = f"the diagnosis is unexplained with its own σ; with this one each of {count} of its effects would do"
    if not left_out:
        return f"{text}: the intervals hold with any of these, the estimates are those of the first"
    more = f", and {len(left_out) - 1} more" if len(left_out) > 1 else ""
    return f"{text}: the estimates are those of the first. No interval is given, as others remain: {left_out[0]}{more}"


def _set_of(way: Way) -> SetOfEffects:
    sigma = way.calibration.stands_with_sigma
    return SetOfEffects(effects=way.titles, stands_with_sigma=sigma, option=noise_option(sigma))


def _effects(standing: Sequence[Way]) -> list[CalibratedEffect]:
    """Return the effects of all explanations; one that is not in every explanation may be zero."""
    by_title: dict[str, list[CalibratedEffect]] = {}
    for way in standing:
        for effect in way.calibration.effects:
            by_title.setdefault(effect.effect, []).append(effect)
    of_first = {effect.effect for effect in standing[0].calibration.effects}
    effects = []
    for title, entries in by_title.items():
        effect = entries[0]
        for other in entries[1:]:
            (effect,) = either_effects([effect], [other])
        if len(entries) < len(standing):
            sizes = [_or_zero(parameter, is_zero=title not in of_first) for parameter in effect.parameters]
            effect = effect.model_copy(update={"parameters": sizes})
        effects.append(effect)
    return effects


def _or_zero(size: Parameter, *, is_zero: bool) -> Parameter:
    """Return a size whose interval holds zero, too; its estimate is zero where the first explanation lacks it."""
    if size.symbol.endswith(NO_SIZES) or size.low is None or size.high is None:
        return size
    ends: dict[str, Any] = {"low": min(size.low, 0.0), "high": max(size.high, 0.0)}
    return size.model_copy(update=ends | ({"estimate": 0.0} if is_zero else {}))
