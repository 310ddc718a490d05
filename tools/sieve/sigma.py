"""A noise bound that is too small: a larger one makes the model fit, alone or with one effect."""

from dataclasses import replace

import numpy as np

from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..bounded.work import Work
from ..calibrated import Sigma
from ..errors import InputError
from ..evidence.bench import Bench
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..records import PositionRecord
from ..rounding import upwards
from .beside import bent_fits
from .leading import LeadingFunctions, Residual
from .simple import Simple

MOST = 2.0
"""Largest factor by which a noise bound is sought that is too small."""
APPARENT = 1.3
"""A smaller radius proves no effect."""
MOST_WITH_EFFECT = 1.5
"""The same beside an effect."""
APART = 9.0
"""Difference of the explained variances from which an effect is told apart from the best one."""
MOST_WORK = 2e6
"""Work of the search for effects that are not linear."""
MOST_RIVALS = 4
"""Most effects of which one is named beside a larger noise bound."""


def too_small_bounds(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the least noise bound that makes the model fit, if the misfit looks like noise.

    The misfit looks like noise if no function of one quantity, break or single reading explains more of its squares
    than of noise. If one effect does, the same test applies to the rest.
    """
    if evidence.source is None or not isinstance(evidence.source.record, PositionRecord):
        return ()
    candidates = LeadingFunctions(evidence)
    residual = candidates.residual
    if evidence.model.radius <= MOST and candidates.is_noise(residual):
        return _alone(evidence)
    if evidence.model.radius < APPARENT:
        return ()
    wider = _with_effect(evidence, candidates, residual)
    if wider or _one_effect_fits(evidence, candidates, residual):
        return wider
    return _with_bent_effect(evidence, candidates)


def _one_effect_fits(evidence: Evidence, candidates: LeadingFunctions, residual: Residual) -> bool:
    """Return whether the effect that explains most makes the model fit with the noise bound as it is."""
    places = list(candidates.effects)
    if not places:
        return False
    explained = residual.of_blocks(list(candidates.effects.values()))
    fit = _fit_of(evidence, places[int(np.argmax(explained))])
    return fit is not None and fit.radius <= evidence.model.limit


def _alone(evidence: Evidence) -> tuple[Simple, ...]:
    sigma = _rounded_up(evidence, evidence.model.radius)
    wider = _with_bound(evidence, sigma)
    if wider is None or wider.model.falsified:
        return ()
    sentence = f"No fault is found, but σ looks too small. With σ = {upwards(sigma)} g the record fits."
    return (_simple(wider, 1, wider.model.radius, sentence, sigma),)


def _with_effect(evidence: Evidence, candidates: LeadingFunctions, residual: Residual) -> tuple[Simple, ...]:
    """Return a larger noise bound with the effect that explains most, and its near equivalents."""
    places = list(candidates.effects)
    if not places:
        return ()
    explained = residual.of_blocks(list(candidates.effects.values()))
    best = int(np.argmax(explained))
    left = _residual_beside(evidence, candidates, places[best])
    if left is None or np.sqrt(left.squares / len(left.errors)) > MOST_WITH_EFFECT or not candidates.is_noise(left):
        return ()
    variance = left.squares / left.freedom
    near = np.flatnonzero(explained >= explained[best] - APART * variance)
    ranked = near[np.argsort(-explained[near])][:MOST_RIVALS]
    found = []
    for number in ranked.tolist():
        simple = _beside(evidence, places[number])
        if simple is not None:
            found.append(simple)
    return tuple(found)


def _residual_beside(evidence: Evidence, candidates: LeadingFunctions, place: EffectPlace) -> Residual | None:
    """Return the residual beside an effect; where its size widens bounds, over these. None where it has no fit."""
    if place.definition.untold is None:
        return candidates.residual.beside(candidates.effects[place])
    fit = _fit_of(evidence, place)
    return None if fit is None else _residual_of(fit)


def _residual_of(fit: Fit) -> Residual:
    """Return the residual of a fit over what it allows."""
    return Residual(fit.left / fit.allowed, fit.jacobian / fit.allowed[:, None])


def _beside(evidence: Evidence, place: EffectPlace) -> Simple | None:
    """A larger noise bound and one effect; None where they do not do, or the effect does without."""
    fit = _fit_of(evidence, place)
    if fit is None or not evidence.model.limit < fit.radius <= MOST_WITH_EFFECT:
        return None
    sigma = _rounded_up(evidence, fit.radius)
    wider = _with_bound(evidence, sigma)
    again = None if wider is None else _fit_of(wider, place)
    if wider is None or again is None or again.radius > wider.model.limit:
        return None
    numbers = 2 + len(place.definition.parameters) + (place.order is not None)
    sentence = f"With σ = {upwards(sigma)} g and {place.title} the record fits."
    simple = _simple(wider, numbers, again.radius, sentence, sigma)
    return replace(simple, where=("sigma", place.where), fit=again)


def _with_bent_effect(evidence: Evidence, candidates: LeadingFunctions) -> tuple[Simple, ...]:
    """Return a larger noise bound with an effect that is not linear in its sizes, and leaves noise."""
    wider = _with_bound(evidence, MOST_WITH_EFFECT * evidence.model.calibration.noise_bound)
    if wider is None or not isinstance(wider.model, Bench) or not wider.model.falsified:
        return ()
    faults = []
    for fit in bent_fits(wider, Work(MOST_WORK, "a larger σ beside an effect"))[:MOST_RIVALS]:
        remaining = _residual_of(fit)
        times = MOST_WITH_EFFECT * fit.radius
        if times > evidence.model.limit and candidates.is_noise(remaining):
            faults.append(_beside_bent(evidence, fit.places[0], times))
    return tuple(fault for fault in faults if fault is not None)


def _beside_bent(evidence: Evidence, place: EffectPlace, times: float) -> Simple | None:
    """Return a larger noise bound with one effect beside it; None where no effect suffices."""
    sigma = _rounded_up(evidence, times)
    wider = _with_bound(evidence, sigma)
    fits = () if wider is None else wider.model.mended([place], Work())
    if wider is None or not fits:
        return None
    numbers = 2 + len(place.definition.parameters) + (place.order is not None)
    sentence = f"With σ = {upwards(sigma)} g and {place.title} the record fits."
    simple = _simple(wider, numbers, fits[0].radius, sentence, sigma)
    return replace(simple, where=("sigma", place.where), fit=fits[0])


def _simple(wider: Evidence, numbers: int, radius: float, sentence: str, sigma: float) -> Simple:
    return Simple("sigma", numbers, ("sigma",), sentence, radius, wider, change={"noise_bound": sigma})


def _fit_of(evidence: Evidence, place: EffectPlace) -> Fit | None:
    """The fit of one effect; None where it cannot be tried."""
    try:
        return evidence.model.refit([place])
    except (SolverError, ValueError):
        return None


def _rounded_up(evidence: Evidence, times: float) -> float:
    """Return a multiple of the noise bound, rounded up to two digits."""
    return float(upwards(times * evidence.model.calibration.noise_bound, 2))


def _with_bound(evidence: Evidence, sigma: float) -> Evidence | None:
    """The evidence with another noise bound, which nobody gave; None where it cannot be made."""
    assert evidence.source is not None
    try:
        wider = evidence.source.again(noise_bound=sigma, noise_sd=None)
    except InputError:
        return None
    basis = "the least with which the model stands"
    calibration = wider.model.calibration.model_copy(update={"sigma": Sigma.of(sigma, basis)})
    model = replace(wider.model, calibration=calibration)
    return Evidence(model, replace(wider.reader, model=model), wider.source)
