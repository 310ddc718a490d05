"""What a diagnosis made of a case, held against the secret."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ...models.effects import EffectPlace
from ..diagnosis import Cause, Diagnosis, NamedEffect, diagnose, diagnosed_together
from ..result import ABSENT, Told
from .bench import NOISE_BOUND
from .case import Case
from .sizes import Hidden, Secret

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
NOTHING = "nothing"
"""Stands for the secret of a clean record."""


class Outcome(Told):
    """What came of a case. Keys that one kind of record has, a table's or a block's, are left out of the other's."""

    seed: int
    case: int
    """of the suite, and of the case in it"""
    records: int = ABSENT
    """of one instrument, where they are several"""
    positions: int = ABSENT
    mountings: tuple[str, ...] = ABSENT
    baseline: str = ABSENT
    noise: str = ABSENT
    """of a table"""
    reference: str = ABSENT
    """of a block moved by hand: "gravity" or "truth", as what follows up to `rows`, but for what is hidden"""
    hidden: tuple[Secret, ...] | dict[str, Any] | None
    """of a table; of a block the effect as a scenario file writes it"""
    size: float = ABSENT
    """relative to that of sure detection"""
    stamps_jitter_periods: float = ABSENT
    gyros: dict[str, Any] = ABSENT
    accelerometers: dict[str, Any] = ABSENT
    """parameters of the components that are no secret"""
    rows: int = ABSENT
    redrawn: int
    """effects that were put aside"""
    radius: float | None
    """that the nominal model leaves, in units of the bound"""
    verdict: str
    """of the diagnosis"""
    outcome: str
    """one of `KINDS`"""
    named: tuple[NamedEffect, ...]
    """the set that was named, or the best of those that remain"""
    inside: bool | None
    """whether the true parameters are inside their intervals; None where the effect was not named by its own name"""
    errors: tuple[float, ...] = ABSENT
    """of a table: relative error of each estimated size"""
    error: float | None = None
    """of a block: relative error of the size, along the true effect"""
    why: str = ABSENT
    """of a block: what the diagnosis says beside its verdict"""

    @property
    def secrets(self) -> tuple[Secret, ...]:
        """What was hidden in a bench, with its sizes."""
        if self.hidden is None or self.reference is not None:
            return ()
        return tuple(self.hidden)  # type: ignore[arg-type]

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What was hidden."""
        if self.reference is None:
            return tuple(secret.place for secret in self.secrets)
        if self.hidden is None:
            return ()
        return (NamedEffect.model_validate(self.hidden).place,)

    @property
    def relative_size(self) -> float | None:
        """Size of the first effect over that of sure detection; None of a clean record."""
        if not self.places:
            return None
        if self.secrets:
            return self.secrets[0].relative_size
        return self.size

    @property
    def size_errors(self) -> tuple[float, ...]:
        """Relative error of the estimated size of each effect that was named by its own name."""
        if self.reference is None:
            return self.errors
        if self.error is None:
            return ()
        return (self.error,)

    @property
    def hidden_words(self) -> str:
        """The secret in words: the names of the effects."""
        return _names(self.places) or NOTHING

    @property
    def named_words(self) -> str:
        """What was made of it in words: names of the effects, or the verdict where there is none."""
        if self.outcome == "candidate":
            return "ambiguous, among them"
        if self.verdict == "ambiguous":
            return "ambiguous, not among them"
        if self.verdict == "explained":
            if self.outcome == "right":
                return self.hidden_words
            return _names(self.named)
        if self.verdict == "consistent":
            return NOTHING
        return self.verdict

    def titles(self, *, named: bool, between: str = " + ") -> str:
        """What was hidden, or what was named, by effect and place."""
        if named:
            return between.join(effect.place.title for effect in self.named)
        return between.join(place.title for place in self.places)


def _names(effects: Iterable[EffectPlace | NamedEffect]) -> str:
    return " + ".join(sorted(effect.effect for effect in effects))


def diagnosed_case(case: Case, record: Any, *, rerun: bool = False) -> Diagnosis:
    """The diagnosis of a case's record, or records; of a bench σ, the mountings and the kind of block are known."""
    if case.days:
        alone = {label: diagnose(day, rerun=rerun, noise_bound=NOISE_BOUND) for label, day in record.items()}
        return diagnosed_together(alone, rerun=rerun)
    return diagnose(record, rerun=rerun, **case.instrument.asked)


def judged_case(case: Case, result: Diagnosis) -> Outcome:
    """Hold a diagnosis against the secret of its case."""
    instrument, secrets = case.instrument, case.hidden
    sets = [finding.causes for finding in result.findings]
    if case.days:
        kind = outcome_kind(case.places, result.verdict, sets)
    else:
        kind = outcome_kind(case.places, result.verdict, sets, result.equal_sets, result.containing_sets)
        secrets = instrument.as_recorded(case.hidden, result.sources)
    inside, errors = _held_against(secrets, kind, sets, instrument.table)
    fields = instrument.told(case.seed, case.index or 0, secrets)
    if case.days:
        fields["records"] = len(result.records or ())
    if instrument.reference is None:
        fields["errors"] = errors
    else:
        why = "; ".join((*(result.not_named or ()), *map(str, result.missing or ())))
        error = None
        if errors:
            error = errors[0]
        fields |= {"error": error, "why": why}
    named = ()
    if sets:
        named = tuple(NamedEffect.of(cause.place) for cause in sets[0])
    return Outcome(
        **fields,
        redrawn=case.redrawn,
        radius=result.radius,
        verdict=result.verdict,
        outcome=kind,
        named=named,
        inside=inside,
    )


def outcome_kind(
    places: Sequence[EffectPlace],
    verdict: str,
    sets: Sequence[Sequence[Cause]],
    equivalent_sets: Iterable[Iterable[EffectPlace]] = (),
    containing: Iterable[Iterable[EffectPlace]] = (),
) -> str:
    """One of `KINDS`, for the places of what is hidden and the verdict of a diagnosis.

    `sets` are the one that is named, or those that remain, the best one first; `equivalent_sets` are whole sets that
    cannot be told from the one that is named, `containing` such as are not excluded beside it, as they contain it.
    """
    if verdict in ("consistent", "insufficient", "unexplained"):
        if not places and verdict != "unexplained":
            return "right"
        return verdict
    if any(_is_same(causes, places) for causes in sets):
        if verdict == "explained":
            return "right"
        return "candidate"
    if verdict == "explained":
        if _is_among(places, equivalent_sets):
            return "right"
        if _is_among(places, containing):
            return "candidate"
        if sets and sets[0] and all(set(places) & _alike(cause) for cause in sets[0]):
            return "part"
    return "wrong"


def _is_among(places: Sequence[EffectPlace], sets: Iterable[Iterable[EffectPlace]]) -> bool:
    return any(set(effects) == set(places) for effects in sets)


def _alike(cause: Cause) -> set[EffectPlace]:
    """A cause and what no measurement on the bench could tell from it."""
    return {cause.place, *cause.alike}


def _is_same(causes: Sequence[Cause], places: Sequence[EffectPlace]) -> bool:
    """Whether a set of causes is a set of effects, in some order, up to those that cannot be told apart."""
    if not causes:
        return not places
    for number, place in enumerate(places):
        remaining = list(places)
        del remaining[number]
        if place in _alike(causes[0]) and _is_same(causes[1:], remaining):
            return True
    return False


def _held_against(
    hidden: Sequence[Hidden], kind: str, sets: Sequence[Sequence[Cause]], table: Mapping[str, Any] | None = None
) -> tuple[bool | None, tuple[float, ...]]:
    """Whether the true parameters are inside their intervals, and errors of the sizes, of effects named as they are."""
    if kind != "right" or not sets:
        return None, ()
    inside, errors = True, []
    for effect in hidden:
        for cause in sets[0]:
            if cause.place == effect.place:
                inside = inside and is_inside(as_readings_tell(effect, table), cause)
                errors.append(relative_error(effect, cause))
    complete = errors and len(errors) == len(hidden)
    return inside if complete else None, tuple(errors)


def as_readings_tell(hidden: Hidden, table: Mapping[str, Any] | None) -> tuple[float, ...]:
    """True parameters as far as readings can tell them, which show neither Δg/g nor Δβ of the table.

    The components' inputs are in units of the model's g: they have the factor 1 − Δg/g. Harmonics of the inner axis are
    functions of the true angle, the encoder reading less Δβ, so that a phase of order h is known up to h Δβ.
    """
    if table is None:
        return hidden.values
    place, turn = hidden.place, 0.0
    factor = (1.0 - float(table["gravity_error"])) ** max(0, place.definition.degree)
    if place.where == "inner-axis":
        turn = (place.order or 1) * float(table["beta_offset"])
    values = []
    for name, value in hidden.parameters.items():
        if name.endswith("phase"):
            fitted = value - turn
        else:
            fitted = value * factor
        values.append(fitted)
    return tuple(values)


def is_inside(values: Iterable[float], cause: Cause) -> bool:
    """Whether true parameters are inside a cause's intervals, phases up to whole turns."""
    for value, (low, high), parameter in zip(values, cause.intervals, cause.place.definition.parameters, strict=True):
        if parameter.name.endswith("phase"):
            turns = (-1, 0, 1)
        else:
            turns = (0,)
        if not any(low <= value + 2.0 * math.pi * turn <= high for turn in turns):
            return False
    return True


def relative_error(hidden: Hidden, cause: Cause) -> float:
    """Error of the estimated size, along the true effect, as a part of the true size."""
    names = list(hidden.parameters)
    true, estimate = _vector(names, hidden.values), _vector(names, cause.values)
    along = sum(e * t for e, t in zip(estimate, true, strict=True))
    return float(along / sum(t * t for t in true) - 1.0)


def _vector(names: Sequence[str], values: Sequence[float]) -> list[float]:
    """Parameters as a vector in which errors add: amplitudes and phases by their components; times are not in it."""
    vector: list[float] = []
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if name.endswith("amplitude"):
            vector += [value * math.cos(values[k + 1]), value * math.sin(values[k + 1])]
        elif not name.endswith(("phase", "start", "time_constant")):
            vector.append(value)
    return vector
