"""Encoders that read more coarsely than the noise: their rounding goes into the bounds if it explains the misfit."""

import numpy as np

from ..calibration.calibration import Misfit
from ..errors import InputError
from ..evidence.bench import Bench
from ..evidence.evidence import Evidence
from ..records import PositionRecord
from .leading import LeadingFunctions, Residual

LEAST = 1.8
"""Steps that move readings by fewer σ are not looked at: a larger σ says as much."""
FILLED = 0.2
"""Rounding fills at least this part of its bound: where errors stay far below, the angles were only commanded so."""
WIDE = 4.0
"""The size of the misfit tells steps from noise if they move readings by this number of σ."""


def with_rounding(evidence: Evidence) -> Evidence:
    """Return the evidence with half a step of the encoders in the bounds, where exact angles falsify the model.

    The misfit must look like noise, or as large as rounding makes it beside the effect that explains most. Otherwise
    the evidence is returned as it is.
    """
    source, model = evidence.source, evidence.model
    if source is None or not isinstance(model, Bench) or not isinstance(source.record, PositionRecord):
        return evidence
    if not model.falsified or source.record.steps.error:
        return evidence
    stepped, sigma = source.record.with_steps, model.calibration.noise_bound
    if stepped.steps.error < LEAST * sigma:
        return evidence
    candidates = LeadingFunctions(evidence)
    residual = candidates.residual
    misfit = _misfit(evidence, residual)
    is_noise = candidates.is_noise(residual) and misfit.turns_gravity(sigma)
    if not is_noise and not _is_rounding(evidence, candidates, stepped):
        return evidence
    try:
        wider = source.again(stepped)
    except InputError:
        return evidence
    if is_noise and not FILLED <= wider.model.radius <= wider.model.limit:
        return evidence
    return wider


def _is_rounding(evidence: Evidence, candidates: LeadingFunctions, stepped: PositionRecord) -> bool:
    """Return True if wide steps explain the remainder of the best effect."""
    model, columns = evidence.model, list(candidates.effects.values())
    sigma, remaining = model.calibration.noise_bound, candidates.residual
    if stepped.steps.error < WIDE * sigma:
        return False
    if columns:
        remaining = remaining.beside(columns[int(np.argmax(remaining.of_blocks(columns)))])
    return _misfit(evidence, remaining).is_rounding(stepped.steps, sigma)


def _misfit(evidence: Evidence, residual: Residual) -> Misfit:
    """Return a residual over the bounds as errors of the readings."""
    bound = evidence.rows.bound
    return Misfit(bound * residual.left, bound[:, None] * residual.base, evidence.model.here.reading)
