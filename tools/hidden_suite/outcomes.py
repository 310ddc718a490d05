"""What a diagnosis made of a case, held against the secret."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Protocol

from ...models.effects import CATALOGUE, EffectPlace
from ..diagnosis import Cause, Diagnosis
from ..diagnosis.result import Finding, place_json
from .cases import Hidden, SuiteCase

KINDS = ("right", "candidate", "part", "wrong", "unexplained", "consistent", "insufficient")
"""What can come of a case.

right
    named, all of it and nothing else, up to effects that no measurement on the bench could tell apart; or, of a clean
    record, nothing named
candidate
    several sets remain, and the true one is among them
part
    an effect of several is named, and nothing that is not there
wrong
    something is named that is not there, or the sets that remain are all wrong
unexplained, consistent, insufficient
    the verdict, where something is hidden
"""


DEGREES = {
    **dict.fromkeys(("scale-asymmetry", "scale-drift", "temperature-scale"), 1),
    **dict.fromkeys(("quadratic", "odd-quadratic", "cross-product", "cross-square"), 2),
    "cubic": 3,
}
"""Degrees of effects in the inputs, where they are not 0."""


class Secretive(Protocol):
    """A case as it is counted."""

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What is hidden."""
        ...


class Counted(Protocol):
    """What came of a case, as it is counted; `Outcome` says what the attributes are."""

    @property
    def case(self) -> Secretive: ...
    @property
    def verdict(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def named(self) -> tuple[EffectPlace, ...]: ...


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes
    ----------
    case : SuiteCase
    verdict : str
        of the diagnosis
    kind : str
        one of `KINDS`
    named : tuple of EffectPlace
        the set that was named, or the best of those that remain
    inside : bool or None
        whether the true parameters are inside their intervals; None where the effect was not named by its own name
    errors : tuple of float
        relative error of the estimated size of each effect that was named by its own name
    radius : float
        that the nominal model leaves, in units of σ
    """

    case: SuiteCase
    verdict: str
    kind: str
    named: tuple[EffectPlace, ...]
    inside: bool | None
    errors: tuple[float, ...]
    radius: float

    def to_json(self) -> dict[str, Any]:
        """The case, its secret and what came of it."""
        bench = self.case.bench
        return {
            "seed": self.case.seed,
            "case": self.case.index,
            "positions": len(bench.alpha),
            "mountings": list(bench.mountings),
            "baseline": bench.baseline,
            "noise": self.case.noise,
            "redrawn": self.case.redrawn,
            "hidden": [hidden_json(hidden) for hidden in self.case.hidden],
            "radius": self.radius,
            "verdict": self.verdict,
            "outcome": self.kind,
            "named": [place_json(place) for place in self.named],
            "inside": self.inside,
            "errors": list(self.errors),
        }


def hidden_json(hidden: Hidden) -> dict[str, Any]:
    """A secret: the effect, its parameters, and its size against the two that have a theory."""
    parameters = [p.name for p in CATALOGUE[hidden.place.effect].at(hidden.place).parameters]
    return {
        **place_json(hidden.place),
        "parameters": dict(zip(parameters, hidden.values, strict=True)),
        "size": hidden.size,
        "surely_detected": finite(hidden.sizes.detected),
        "rivals_excluded": finite(hidden.sizes.excluded),
        "last_rival": hidden.sizes.rival,
    }


def finite(value: float) -> float | None:
    """A number, or None for one that JSON lacks."""
    return value if math.isfinite(value) else None


def outcome_of(case: SuiteCase, result: Diagnosis) -> Outcome:
    """Hold a diagnosis against the secret of its case."""
    finding = result.findings[0] if result.findings else None
    named = finding.places if finding else ()
    kind = kind_of(case, result)
    inside, errors = None, ()
    if kind == "right" and finding is not None:
        own = [(h, cause) for h in case.hidden for cause in finding.causes if cause.place == h.place]
        truth = case.bench.truth["TurntableMotion"]
        if len(own) == len(case.hidden):
            inside = all(is_inside(as_readings_tell(h, truth), cause) for h, cause in own)
        errors = tuple(relative_error(h, cause) for h, cause in own)
    return Outcome(case, result.verdict, kind, named, inside, errors, result.baseline.radius)


def kind_of(case: SuiteCase, result: Diagnosis) -> str:
    """One of `KINDS`."""
    if result.verdict in ("consistent", "insufficient", "unexplained"):
        clean = not case.hidden and result.verdict != "unexplained"
        return "right" if clean else result.verdict
    if any(is_same(finding, case.places) for finding in result.findings):
        return "right" if result.verdict == "explained" else "candidate"
    if result.verdict == "explained":
        if any(set(places) == set(case.places) for places in result.equivalent_sets):
            return "right"
        causes = result.findings[0].causes
        if causes and all(set(case.places) & alike(cause) for cause in causes):
            return "part"
    return "wrong"


def alike(cause: Cause) -> set[EffectPlace]:
    """A cause and what no measurement on the bench could tell from it."""
    return {cause.place, *cause.equivalents}


def is_same(finding: Finding, places: Sequence[EffectPlace]) -> bool:
    """Whether a set of causes is a set of effects, up to those that cannot be told apart."""
    if len(finding.causes) != len(places):
        return False
    return any(
        all(place in alike(cause) for place, cause in zip(order, finding.causes, strict=True))
        for order in permutations(places)
    )


def as_readings_tell(hidden: Hidden, truth: Mapping[str, Any]) -> tuple[float, ...]:
    """True parameters as far as readings can tell them, which show neither Δg/g nor Δβ.

    The components' inputs are in units of the model's g: they have the factor 1 − Δg/g. Harmonics of the inner axis are
    functions of the true angle, the encoder reading less Δβ, so that a phase of order h is known up to h Δβ.
    """
    true_g, offset = 1.0 - float(truth["gravity_error"]), float(truth["beta_offset"])
    place = hidden.place
    factor = true_g ** DEGREES.get(place.effect, 0)
    turn = (place.order or 1) * offset if place.where == "inner-axis" else 0.0
    parameters = CATALOGUE[place.effect].at(place).parameters
    return tuple(
        value - turn if parameter.name.endswith("phase") else value * factor
        for value, parameter in zip(hidden.values, parameters, strict=True)
    )


def is_inside(values: Iterable[float], cause: Cause) -> bool:
    """Whether true parameters are inside a cause's intervals, phases up to whole turns."""
    parameters = CATALOGUE[cause.place.effect].at(cause.place).parameters
    turns = [(-1, 0, 1) if parameter.name.endswith("phase") else (0,) for parameter in parameters]
    return all(
        any(low <= value + 2.0 * math.pi * turn <= high for turn in possible)
        for value, (low, high), possible in zip(values, cause.intervals, turns, strict=True)
    )


def relative_error(hidden: Hidden, cause: Cause) -> float:
    """Error of the estimated size, along the true effect, as a part of the true size."""
    true, estimate = vector_of(hidden.place, hidden.values), vector_of(hidden.place, cause.values)
    return float(sum(e * t for e, t in zip(estimate, true, strict=True)) / sum(t * t for t in true) - 1.0)


def vector_of(place: EffectPlace, values: Sequence[float]) -> list[float]:
    """Parameters as a vector in which errors add: amplitudes and phases by their components."""
    names = [parameter.name for parameter in CATALOGUE[place.effect].at(place).parameters]
    vector, k = [], 0
    while k < len(names):
        if names[k].endswith("amplitude"):
            vector += [values[k] * math.cos(values[k + 1]), values[k] * math.sin(values[k + 1])]
            k += 2
        else:
            vector.append(values[k])
            k += 1
    return vector
