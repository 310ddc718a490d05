"""Words that several documents share: verdicts, targets, what to measure next."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..calibration import Calibration
from ..diagnosis.result import BaselineParameter, Cause, Diagnosis, EffectWitness

VERDICTS = {
    "consistent": "consistent: the model explains the record within the noise bound",
    "falsified": "falsified: no parameters of the model keep every reading within the noise bound",
    "insufficient": "insufficient: the record cannot determine everything that is asked",
    "explained": "explained: a smallest set of effects makes the model consistent, and no other does",
    "ambiguous": "ambiguous: several sets of effects would make the model consistent",
    "unexplained": "unexplained: the model is falsified and nothing in the catalogue mends it",
}


PHYSICAL_WORDS = (
    (r"scale-factor-error-plus-(\d)", r"scale factor of accelerometer \1 for positive input"),
    (r"scale-factor-error-minus-(\d)", r"scale factor of accelerometer \1 for negative input"),
    (r"scale-factor-asymmetry-(\d)", r"scale-factor asymmetry of accelerometer \1"),
    (r"misalignment-(\d)(\d)", r"misalignment of accelerometer \1 towards axis \2"),
    (r"mounting-error-(\d)", r"mounting error about axis \1"),
    (r"bias-(\d)", r"bias of accelerometer \1"),
    (r"outer-axis-tilt", "tilt of the outer axis"),
    (r"outer-angle-offset", "zero of the outer angle"),
    (r"axis-nonorthogonality", "non-orthogonality of the axes"),
)
"""A target's name, and what an engineer calls it."""


def physical_words(name: str) -> str:
    """A target's name in words: "bias-1" is "bias of accelerometer 1"; the name of a mounting stays behind it."""
    for pattern, words in PHYSICAL_WORDS:
        name = re.sub(pattern, words, name)
    return name


MOST_NAMED = 5
"""So many targets that are open are named in a sentence."""


def open_targets(result: Calibration) -> str:
    """What the measurements leave open, in a sentence."""
    gaps = result.missing
    if not gaps:
        return "whether an error that holds over a rest is in them" if result.radius > 1.0 else "more than they have"
    if len(gaps) == len(result.parameters):
        return "any of the targets"
    if len(gaps) > MOST_NAMED:
        return f"{len(gaps)} of the {len(result.parameters)} targets"
    return ", ".join(physical_words(gap.name) for gap in gaps)


def missing_lines(result: Calibration) -> list[str]:
    """What the measurements leave open, in words."""
    if not result.missing:
        return []
    if len(result.missing) == len(result.parameters):
        return ["The readings determine no target. Measure the positions named, or say what is known by --prior."]
    named = ", ".join(f"{physical_words(gap.name)} ({gap.symbol})" for gap in result.missing)
    return [f"The readings do not determine: {named}. Measure the positions named, or say what is known by --prior."]


def position_text(position: Mapping[str, Any]) -> str:
    """A proposed table position."""
    text = f"alpha {position['alpha_deg']:g}°, beta {position['beta_deg']:g}°"
    if "mounting" in position:
        text += f", mounting {position['mounting']}"
    if "approach_alpha" in position:
        text += f", approached {sense_text(position['approach_alpha'])} in alpha, "
        text += f"{sense_text(position['approach_beta'])} in beta"
    if position.get("separates"):
        text += f" (separates {', '.join(position['separates'])})"
    return text


def sense_text(sense: int) -> str:
    """The sense of a move in words."""
    return "forwards" if sense > 0 else "backwards"


def witness_lines(result: Calibration) -> list[str]:
    """The measurements that prove a falsification."""
    if not result.witness:
        return []
    shown = ", ".join(f"{reading.position}/{reading.accelerometer}" for reading in result.witness)
    return [f"proved by position/accelerometer: {shown}"]


def sets_of(result: Diagnosis) -> Sequence[Sequence[Cause]]:
    """The sets that remain, the best first; one where a cause is named."""
    return (result.causes, *(result.alternatives or ())) if result.causes else ()


def parameters_of(result: Diagnosis) -> Sequence[BaselineParameter]:
    """The block's own parameters."""
    return result.baseline.parameters or ()


def witnesses_of(result: Diagnosis) -> Sequence[EffectWitness]:
    """What was left out says of each effect of the first set."""
    return result.judgement if isinstance(result.judgement, tuple) else ()


def sentence_of(cause: Cause, period: float) -> str:
    """What an engineer is told; latency also in samples."""
    if cause.place.effect == "latency":
        return f"{cause.sentence}, {abs(cause.values[0]) / period:.2f} samples"
    return cause.sentence
