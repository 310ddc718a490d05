"""The outcome of a case: its diagnosis compared with the secret."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ...models.effects import EffectPlace
from ..diagnosis import Cause, Diagnosis, Explanation, NamedEffect, diagnose, diagnosed_together
from ..result import ABSENT, Told
from .bench import NOISE_BOUND
from .case import Case
from .faults import Fault, NamedBreak, breaks_of, parts_of
from .sizes import Hidden, Secret

KINDS = ("right", "candidate", "part", "wrong", "unexplained", "consistent", "insufficient")
"""Possible outcomes of a case.

right
    named, all of it and nothing else, up to effects that no measurement on the bench could tell apart; or, for a clean
    record, nothing named
candidate
    several sets remain, and the true one is among them
part
    one effect of several is named, and no false one
wrong
    a false effect is named, or all remaining sets are wrong
unexplained, consistent, insufficient
    the verdict, if an effect is hidden
"""
NOTHING = "nothing"
"""Word for the secret of a clean record."""


OF_RECORD = ("sigma", "rows", "stretch", "break")
"""Kinds of explanations that name a fault of the record."""


class Outcome(Told):
    """Outcome of a case. Keys of only one kind of record, a table's or a block's, are left out of the other's."""

    seed: int
    case: int
    """seed of the suite, and number of the case in it"""
    records: int = ABSENT
    """number of records of one instrument, if several"""
    positions: int = ABSENT
    mountings: tuple[str, ...] = ABSENT
    baseline: str = ABSENT
    noise: str = ABSENT
    """noise of a table's record"""
    reference: str = ABSENT
    """reference of a block moved by hand: "gravity" or "truth"; so are the next keys up to `rows`, except `hidden`"""
    hidden: tuple[Secret, ...] | dict[str, Any] | None
    """effects of a table; the effect of a block as in a scenario file"""
    fault: Fault | None = ABSENT
    """wrong row or break that is hidden in a table's record"""
    size: float = ABSENT
    """size relative to that of sure detection"""
    stamps_jitter_periods: float = ABSENT
    gyros: dict[str, Any] = ABSENT
    accelerometers: dict[str, Any] = ABSENT
    """known parameters of the components"""
    rows: int = ABSENT
    redrawn: int
    """number of rejected effects"""
    radius: float | None
    """radius of the nominal model, in units of the bound"""
    verdict: str
    """verdict of the diagnosis"""
    outcome: str
    """one of `KINDS`"""
    named: tuple[NamedEffect, ...]
    """the named set, or the best of the remaining ones"""
    named_fault: str | None = ABSENT
    """the sentence on a fault of the record, if one is named"""
    inside: bool | None
    """True if the true parameters are inside their intervals; None if the effect was not named by its own name"""
    errors: tuple[float, ...] = ABSENT
    """relative error of each estimated size, for a table"""
    error: float | None = None
    """relative error of the size, along the true effect, for a block"""
    why: str = ABSENT
    """remark of the diagnosis beside its verdict, for a block"""

    @property
    def secrets(self) -> tuple[Secret, ...]:
        """Effects hidden in a bench, with their sizes."""
        if self.hidden is None or self.reference is not None:
            return ()
        return tuple(self.hidden)  # type: ignore[arg-type]

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """Places of the hidden effects."""
        if self.reference is None:
            return tuple(secret.place for secret in self.secrets)
        if self.hidden is None:
            return ()
        return (NamedEffect.model_validate(self.hidden).place,)

    @property
    def is_clean(self) -> bool:
        """True if nothing is hidden."""
        return not self.places and self.fault is None

    @property
    def relative_size(self) -> float | None:
        """Size of the first effect over that of sure detection; None for a clean record."""
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
        """Names of the hidden effects."""
        return " + ".join([*([self.fault.what] if self.fault else []), *_sorted(self.places)]) or NOTHING

    @property
    def named_words(self) -> str:
        """Names of the named effects, or the verdict if there are none."""
        if self.outcome == "candidate":
            return "ambiguous, among them"
        if self.verdict == "ambiguous":
            return "ambiguous, not among them"
        if self.verdict == "explained":
            if self.outcome == "right":
                return self.hidden_words
            return " + ".join([*(["a fault of the record"] if self.named_fault else []), *_sorted(self.named)])
        if self.verdict == "consistent":
            return NOTHING
        return self.verdict

    def titles(self, *, named: bool, between: str = " + ") -> str:
        """Return effects and places of the secret or of the diagnosis, as a title."""
        if named:
            titles = [self.named_fault] if self.named_fault else []
            titles += [effect.place.title for effect in self.named]
        else:
            titles = [self.fault.title] if self.fault else []
            titles += [place.title for place in self.places]
        return between.join(titles)


def _sorted(effects: Iterable[EffectPlace | NamedEffect]) -> list[str]:
    return sorted(effect.effect for effect in effects)


def diagnosed_case(case: Case, record: Any, *, rerun: bool = False) -> Diagnosis:
    """Return the diagnosis of a case's record or records, with σ, the mountings and the kind of block of a bench."""
    if case.days:
        alone = {label: diagnose(day, rerun=rerun, noise_bound=NOISE_BOUND) for label, day in record.items()}
        return diagnosed_together(alone, rerun=rerun)
    return diagnose(record, rerun=rerun, **case.instrument.asked)


def judged_case(case: Case, result: Diagnosis) -> Outcome:
    """Compare a diagnosis with the secret of its case."""
    instrument, secrets = case.instrument, case.hidden
    sets = [finding.causes for finding in result.findings]
    if case.days:
        kind = outcome_kind(case.places, result.verdict, sets)
    else:
        kind = outcome_kind(case.places, result.verdict, sets, result.equal_sets, result.containing_sets)
        if case.fault is not None or _names_fault(result):
            kind = kind_with_fault(case, result)
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
    if sets or result.causes:
        named = tuple(NamedEffect.of(cause.place) for cause in result.causes or sets[0])
    if case.fault is not None:
        fields["fault"] = case.fault
    if _names_fault(result):
        fields["named_fault"] = result.explanations[0].sentence
    return Outcome(
        **fields,
        redrawn=case.redrawn,
        radius=result.radius,
        verdict=result.verdict,
        outcome=kind,
        named=named,
        inside=inside,
    )


def _names_fault(result: Diagnosis) -> bool:
    """Return True if a diagnosis names a fault of the record."""
    return result.verdict == "explained" and bool(result.explanations) and result.explanations[0].kind in OF_RECORD


def kind_with_fault(case: Case, result: Diagnosis) -> str:
    """Return one of `KINDS` for a hidden fault of the record, or for one that is named.

    A row, or a break with everything that changes there, is right only with the effects beside it. Of hidden readings
    that are off, the right rows are right.
    """
    if result.verdict in ("consistent", "insufficient", "unexplained"):
        return result.verdict
    right = [_is_right(case, explanation) for explanation in result.explanations]
    if result.verdict == "ambiguous":
        return "candidate" if any(right) else "wrong"
    if right[0]:
        return "right"
    return "part" if _is_part(case, result) else "wrong"


def _is_right(case: Case, explanation: Explanation) -> bool:
    """Return True if an explanation is the hidden fault with the hidden effects, and nothing else."""
    if explanation.kind == "sigma":
        return False
    rows, effects = _rows_and_effects(case.places)
    breaks = breaks_of(explanation)
    if case.fault is None or case.fault.kind == "rows":
        rows |= {case.fault.row} if case.fault is not None else set()
    elif not (hidden := [named for named in breaks if case.fault.is_break(named)]):
        return False
    else:
        breaks.remove(hidden[0])
    for named in breaks:
        # The catalogue has such a break, too: beside a fault it is named as one.
        if named.listed not in effects:
            return False
        effects.remove(named.listed)
    named_rows, _ = _rows_and_effects([cause.place for cause in explanation.causes])
    causes = [cause for cause in explanation.causes if cause.effect != "outlier"]
    return named_rows | set(explanation.rows or ()) == rows and _is_same(causes, effects)


def _rows_and_effects(places: Sequence[EffectPlace]) -> tuple[set[int], list[EffectPlace]]:
    """Return the rows whose readings are off, and the other effects."""
    rows, effects = set(), []
    for place in places:
        if place.effect == "outlier":
            rows.add(int(place.where.removeprefix("position-")))
        else:
            effects.append(place)
    return rows, effects


def _is_part(case: Case, result: Diagnosis) -> bool:
    """Return True if the first explanation names nothing false: the fault, hidden effects, or parts of their breaks."""
    fault, explanation = case.fault, result.explanations[0]
    if fault is None or not case.places:
        return False
    fault_alone, effects_alone = replace(case, hidden=()), replace(case, fault=None)
    if _is_right(fault_alone, explanation) or _is_right(effects_alone, explanation):
        return True
    breaks = breaks_of(explanation)
    for cause in explanation.causes:
        if parts_of(cause.place):
            breaks.append(_break_of(cause, result))
        elif not _alike(cause) & set(case.places):
            return False
    hidden = [parts_of(place) for place in case.places]
    of_breaks = all(fault.has_part(named) or any(named.parts <= parts for parts in hidden) for named in breaks)
    rows = {fault.row} if fault.kind == "rows" else set()
    return bool(breaks) and of_breaks and set(explanation.rows or ()) <= rows


def _break_of(step: Cause, result: Diagnosis) -> NamedBreak:
    """Return a step of the catalogue as a break, between the rows around its possible times."""
    hours = result.sources.circumstances.hours
    low, high = step.intervals[-1]
    return NamedBreak(int((hours <= low).sum()), int((hours < high).sum()) + 1, parts_of(step.place))


def outcome_kind(
    places: Sequence[EffectPlace],
    verdict: str,
    sets: Sequence[Sequence[Cause]],
    equivalent_sets: Iterable[Iterable[EffectPlace]] = (),
    containing: Iterable[Iterable[EffectPlace]] = (),
) -> str:
    """Return one of `KINDS`, for the places of the hidden effects and the verdict of a diagnosis.

    `sets` are the named one, or the remaining ones, the best first. `equivalent_sets` are whole sets that cannot be
    told from the named one; `containing` are sets that contain it and are therefore not excluded.
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
    """Return a cause and all effects that no measurement on the bench could tell from it."""
    return {cause.place, *cause.alike}


def _is_same(causes: Sequence[Cause], places: Sequence[EffectPlace]) -> bool:
    """Return True if a set of causes equals a set of effects, in any order, up to indistinguishable effects."""
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
    """Return True if the true parameters are inside their intervals, and the errors of the sizes, for named effects."""
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
    """Return the true parameters as readings show them, without Δg/g and Δβ of the table, which readings do not show.

    The components' inputs are in units of the model's g: they have the factor 1 − Δg/g. Harmonics of the inner axis are
    functions of the true angle, the encoder reading less Δβ, so a phase of order h is known up to h Δβ.
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
    """Return True if true parameters are inside a cause's intervals, phases up to whole turns."""
    for value, (low, high), parameter in zip(values, cause.intervals, cause.place.definition.parameters, strict=True):
        if parameter.name.endswith("phase"):
            turns = (-1, 0, 1)
        else:
            turns = (0,)
        if not any(low <= value + 2.0 * math.pi * turn <= high for turn in turns):
            return False
    return True


def relative_error(hidden: Hidden, cause: Cause) -> float:
    """Return the error of the estimated size, along the true effect, relative to the true size."""
    names = list(hidden.parameters)
    true, estimate = _vector(names, hidden.values), _vector(names, cause.values)
    along = sum(e * t for e, t in zip(estimate, true, strict=True))
    return float(along / sum(t * t for t in true) - 1.0)


def _vector(names: Sequence[str], values: Sequence[float]) -> list[float]:
    """Return parameters as a vector in which errors add: amplitudes and phases by components, without times."""
    vector: list[float] = []
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if name.endswith("amplitude"):
            vector += [value * math.cos(values[k + 1]), value * math.sin(values[k + 1])]
        elif not name.endswith(("phase", "start", "time_constant")):
            vector.append(value)
    return vector
