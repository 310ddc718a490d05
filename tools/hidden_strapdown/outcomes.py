"""What a diagnosis made of a strapdown record, held against the secret."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...models.effects import EffectPlace
from ..diagnosis import Cause
from ..diagnosis.result import place_json
from ..strapdown.result import StrapdownDiagnosis
from .cases import StrapdownCase


@dataclass(frozen=True)
class StrapdownOutcome:
    """What came of a case.

    Attributes
    ----------
    case : StrapdownCase
    verdict : str
    kind : str
        one of `trihedron.tools.hidden_suite.outcomes.KINDS`
    named : tuple of EffectPlace
        the set that was named, or the best of those that remain
    inside : bool or None
        whether the true parameters are inside their intervals; None where the effect was not named by its own name
    error : float or None
        relative error of the estimated size, along the true effect
    radius : float or None
        that the baseline leaves
    why : str
        what the diagnosis says beside its verdict
    """

    case: StrapdownCase
    verdict: str
    kind: str
    named: tuple[EffectPlace, ...]
    inside: bool | None
    error: float | None
    radius: float | None
    why: str = ""

    def to_json(self) -> dict[str, Any]:
        """The case, its secret and what came of it."""
        return {
            **self.case.answer(),
            "rows": len(self.case.motion) - 1,
            "redrawn": self.case.redrawn,
            "radius": self.radius,
            "verdict": self.verdict,
            "outcome": self.kind,
            "named": [place_json(place) for place in self.named],
            "inside": self.inside,
            "error": self.error,
            "why": self.why,
        }


def outcome_of(case: StrapdownCase, result: StrapdownDiagnosis) -> StrapdownOutcome:
    """Hold a diagnosis against the secret of its case."""
    sets = result.candidates
    named = tuple(cause.place for cause in sets[0]) if sets else ()
    kind = kind_of(case, result.verdict, sets)
    own = next((cause for cause in sets[0] if cause.place in case.places), None) if kind == "right" and sets else None
    inside = error = None
    if own is not None and case.secret is not None:
        true = case.secret.values
        inside = all(low <= value <= high for value, (low, high) in zip(true, own.intervals, strict=True))
        error = sum(e * t for e, t in zip(own.values, true, strict=True)) / sum(t * t for t in true) - 1.0
    why = "; ".join((*result.objections, *result.missing))
    return StrapdownOutcome(case, result.verdict, kind, named, inside, error, result.radius, why)


def kind_of(case: StrapdownCase, verdict: str, sets: Sequence[Sequence[Cause]]) -> str:
    """One of `trihedron.tools.hidden_suite.outcomes.KINDS`."""
    if verdict in ("consistent", "insufficient", "unexplained"):
        return "right" if not case.places and verdict != "unexplained" else verdict
    alike = [[{cause.place, *cause.equivalents} for cause in causes] for causes in sets]
    true = [len(case.places) == 1 == len(found) and case.places[0] in found[0] for found in alike]
    if any(true):
        return "right" if verdict == "explained" else "candidate"
    part = verdict == "explained" and alike and all(set(case.places) & own for own in alike[0])
    return "part" if part else "wrong"
