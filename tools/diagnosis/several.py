"""Several records of one instrument: what they say together, and what is the instrument's or the run's."""

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..bounded.sets import CutOff, Work
from ..errors import InputError, nearest
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..evidence.joint import Joint, join
from ..evidence.of_record import (
    Differs,
    InRecord,
    Mended,
    in_record,
    is_asked,
    is_of_instrument,
    named_alike,
    names_of,
    plain,
)
from ..result import Result, Told, finite_or_none
from .cause import Finding, NamedEffect, Number, SizedParameter
from .cross_gain import CrossGain, Helps, cross_gains
from .procedure import causes_of, centred, diagnosed
from .result import Diagnosis, EffectWitness
from .search import MOST_WORK

SEVERAL = "trihedron.several/1"
MOST_TRIED = 4
"""So many sets of one record that are not sought in several are tried beside the others."""
Open = Literal["yes", "no", "open"]


class OneRecord(Result):
    """A record by itself: its label, its file's SHA-256, its diagnosis, and why it is not judged with the others."""

    record: str
    sha256: str
    left_out: str | None
    diagnosis: Diagnosis


class JointCause(Result):
    """Something with which the records stand together.

    `of` is "instrument": one value for all records, or "run": of the one `record` alone. It is an `effect`, or a shared
    `parameter`, by its symbol, that has another value there. `equivalents`: what these records cannot tell from it.
    """

    title: str
    of: Literal["instrument", "run"]
    record: str | None
    effect: NamedEffect | None
    parameter: str | None
    equivalents: tuple[str, ...]
    parameters: tuple[SizedParameter, ...]


class InOneRecord(Result):
    """What one record leaves possible of a parameter; None where it does not bound it, or no model stands."""

    record: str
    estimate: Number | None
    low: Number | None
    high: Number | None


class Repeated(Result):
    """A parameter, of the instrument or of an effect, from record to record, each by itself.

    Between two of the records it changes by `at_least` surely; over those with which a model stands by `at_most`, None
    where one leaves it open.
    """

    name: str
    unit: str
    of: Literal["instrument", "run"]
    records: tuple[InOneRecord, ...]
    at_least: Number
    at_most: Number | None


class Several(Told):
    """What several records of one instrument say together.

    Attributes
    ----------
    verdict : str
        "consistent": one set of shared parameters does for all; "explained", "ambiguous": one set of causes does, or
        several; "unexplained": none; "insufficient": shared parameters stay open, or fewer than two can be judged
    records : tuple of OneRecord
        each by itself
    shared, own : tuple of str
        parameters with one value for all records, and those of each record
    radius : float or None
        of the model with shared parameters and no effects, over all records that are judged together
    instrument : str or None
        whether every smallest set holds something that acts in all records alike: "yes", "no", or "open"
    runs : dict
        of each record whether every set holds something of that record alone
    causes, alternatives : tuple of JointCause, tuple of such
        the smallest set with which all records stand, and the others
    repeatability : tuple of Repeated
    gains : tuple of CrossGain
        errors of each record without effects, and with what was found in each
    helps : tuple of Helps
        of each effect that was found, on which other records it helps
    missing : tuple of str
        parameters that the records leave open together
    """

    schema_: Literal["trihedron.several/1"] = Field(default=SEVERAL, alias="schema")
    verdict: Literal["consistent", "explained", "ambiguous", "unexplained", "insufficient"]
    records: tuple[OneRecord, ...]
    shared: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    radius: Number | None = None
    radius_with_causes: Number | None = None
    instrument: Open | None = None
    runs: Mapping[str, Open] = Field(default_factory=dict)
    causes: tuple[JointCause, ...] = ()
    alternatives: tuple[tuple[JointCause, ...], ...] = ()
    complete: bool | None = None
    witnesses: tuple[EffectWitness, ...] = ()
    parameters: tuple[SizedParameter, ...] = ()
    repeatability: tuple[Repeated, ...] = ()
    gains: tuple[CrossGain, ...] = ()
    helps: tuple[Helps, ...] = ()
    missing: tuple[str, ...] = ()
    not_named: tuple[str, ...] = ()
    not_searched: tuple[str, ...] = ()
    caution: tuple[str, ...] = ()

    joint: Any = Field(default=None, exclude=True)
    findings: tuple[Any, ...] = Field(default=(), exclude=True)

    @property
    def judged(self) -> tuple[str, ...]:
        """Labels of the records that are judged together."""
        return tuple(one.record for one in self.records if one.left_out is None)


def labels_of(paths: Sequence[Path]) -> list[str]:
    """What records are called: by the names of their files without ending, or, where two are alike, by number too."""
    names = [path.name.split(".")[0] or path.name for path in paths]
    return [f"{name}-{k}" if names.count(name) > 1 else name for k, name in enumerate(names, start=1)]


def members_of(
    evidence: Mapping[str, Evidence], shared: Sequence[str] = (), own: Sequence[str] = ()
) -> dict[str, Evidence]:
    """Evidence of records that can be joined, as `named_alike` has it.

    An InputError for a name that no record's parameter has, or a parameter that is asked to be both shared and own.
    """
    members = named_alike(evidence)
    known = dict.fromkeys(one for member in members.values() for name, _ in member.names for one in names_of(name))
    for asked in (*shared, *own):
        if not any(fnmatchcase(one, asked) for one in known):
            option = "--shared" if asked in shared else "--own"
            raise InputError(f"{option} {asked}: no parameter of these records; {nearest(asked, list(known))}")
    every = dict.fromkeys(name for member in members.values() for name, _ in member.names)
    if both := [name for name in every if is_asked(name, shared) and is_asked(name, own)]:
        raise InputError(f"--shared and --own: {both[0]} cannot be both")
    return members


def diagnosed_together(
    alone: Mapping[str, Diagnosis],
    *,
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
    left_out: Mapping[str, str] | None = None,
    sha256: Mapping[str, str] | None = None,
    progress: bool = False,
    most_work: float = MOST_WORK,
) -> Several:
    """What records that were diagnosed each by itself, with their evidence, say together.

    `shared`, `own` are as for `join`; `left_out` has reasons why records are not judged with the others, by label;
    `most_work` is that of the search.
    """
    reasons = {label: (left_out or {}).get(label) or reason_apart(result) for label, result in alone.items()}
    joint = _joined(alone, reasons, shared, own)
    gains, helps = cross_gains(alone)
    told: dict[str, Any] = {
        "gains": gains,
        "helps": helps,
        "records": [
            OneRecord(record=label, sha256=(sha256 or {}).get(label, ""), left_out=reasons[label], diagnosis=result)
            for label, result in alone.items()
        ],
    }
    if joint is None:
        told["repeatability"] = repeated(alone, None, (), shared, own)
        return Several(verdict="insufficient", not_named=("fewer than two records can be judged together",), **told)
    try:
        return _judged(joint, alone, told, (shared, own), progress=progress, most_work=most_work)
    except SolverError as error:
        raise InputError(f"{', '.join(joint.labels)}: {error}; {joint.too_large}") from error


def reason_apart(result: Diagnosis) -> str | None:
    """Why a record is not judged with the others; None where it is."""
    evidence = result.evidence
    if not evidence.names and not evidence.parts:
        return "nothing can be run: " + "; ".join(map(str, result.missing or ()))
    if result.verdict == "unexplained" and not result.unshown:
        return f"unexplained by itself: {(result.not_named or ('no set of effects mends it',))[0]}"
    if evidence.read_off:
        return _not_sought(evidence.read_off[0].place.title)
    return None


def _not_sought(title: str) -> str:
    return f"by itself {title} mends it, which is not sought in several records together"


def _joined(
    alone: Mapping[str, Diagnosis], reasons: dict[str, str | None], shared: Sequence[str], own: Sequence[str]
) -> Joint | None:
    """The records that can be judged together, two at least; to the reasons are added those of others."""
    while True:
        members = {label: result.evidence for label, result in alone.items() if reasons[label] is None}
        if len(members) < 2:
            return None
        joint, before = join(members, shared, own), len(members)
        for k, label in enumerate(joint.labels):
            findings = (*alone[label].findings, *alone[label].unshown)
            if findings and all(_unsought(finding.fit, joint, k) for finding in findings):
                reasons[label] = _not_sought(findings[0].title)
        if before == sum(reason is None for reason in reasons.values()):
            return joint


def _unsought(fit: Fit, joint: Joint, k: int) -> bool:
    """Whether a set that mends a record has an effect that is not sought in several records together."""
    known = {*joint.searched[k], *(place for place in fit.places if place.effect == "outlier" and joint.seeks_outliers)}
    return not known.issuperset(fit.places)


def _judged(
    joint: Joint,
    alone: Mapping[str, Diagnosis],
    told: dict[str, Any],
    asked: tuple[Sequence[str], Sequence[str]],
    *,
    progress: bool,
    most_work: float,
) -> Several:
    """The verdict on records that can be judged together: their diagnosis as one evidence, and whose its causes are."""
    found = diagnosed(joint, rerun=False, progress=progress, most_work=most_work)
    named = found.findings if found.verdict in ("explained", "ambiguous") else ()
    told |= {
        "joint": joint,
        "shared": joint.shared,
        "own": tuple(dict.fromkeys(n for m in joint.members for n, _ in m.names if n not in joint.shared)),
        "radius": joint.baseline_radius,
        "not_searched": joint.not_searched,
        "missing": found.missing or (),
        "not_named": found.not_named or (),
        "findings": named,
    }
    if found.verdict == "insufficient":
        return Several(verdict="insufficient", **told)
    told |= {"repeatability": repeated(alone, joint, named[0].fit.places if named else (), *asked)}
    if found.verdict == "unexplained":
        told["not_named"] = found.not_named or (_nothing(found),)
        return Several(verdict="unexplained", **told)
    told |= {"parameters": _shared_parameters(joint, named[0].fit if named else centred(joint, joint.baseline))}
    if not named:
        return Several(verdict="consistent", **told)
    best = named[0]
    rivals, untried = _with_unsought(joint, alone, asked, len(best.fit.places))
    sets = [*(_causes(joint, finding) for finding in named), *rivals]
    caution = (*_cautions(alone, joint, best), *untried)
    several = found.verdict == "ambiguous" or len(sets) > 1 or caution
    return Several(
        verdict="ambiguous" if several else "explained",
        radius_with_causes=best.fit.radius,
        causes=sets[0],
        alternatives=tuple(sets[1:]),
        complete=found.cut_off_at is None,
        witnesses=found.judgement if isinstance(found.judgement, tuple) else (),
        caution=caution,
        **told,
        **_owners(joint, sets),
    )


def _nothing(found: Diagnosis) -> str:
    if found.cut_off_at is None:
        return (
            "no set of up to three effects, of all records or of one, and of parameters that differ in one, mends them"
        )
    return f"the search was cut off among sets of {found.cut_off_at}, and none of those that were tried mends them"


def _owners(joint: Joint, sets: Sequence[Sequence[JointCause]]) -> dict[str, Any]:
    """Keys that say whose what was found is, whichever set is true."""
    runs = {label: _told_by([any(c.record == label for c in causes) for causes in sets]) for label in joint.labels}
    return {"instrument": _told_by([any(c.of == "instrument" for c in causes) for causes in sets]), "runs": runs}


def _with_unsought(
    joint: Joint, alone: Mapping[str, Diagnosis], asked: tuple[Sequence[str], Sequence[str]], size: int
) -> tuple[list[tuple[JointCause, ...]], tuple[str, ...]]:
    """Sets, no larger, with one that mends a record by itself and is not sought in several; and what was not tried.

    Each is tried as it acts there, beside sets that are sought. In a record that nothing falsifies by itself none was
    sought: there anything might do where the others stand with one effect less.
    """
    found, untried = [], []
    members = dict(zip(joint.labels, joint.members, strict=True))
    for k, label in enumerate(joint.labels):
        every = alone[label].findings
        if not members[label].falsified:
            others = join({other: member for other, member in members.items() if other != label}, *asked)
            if _beside(others, size - 1) is not None:
                untried.append(label)
        tried = [f for f in every if _unsought(f.fit, joint, k) and len(f.fit.places) <= size]
        # What contains a set that stands there can always stand, too.
        tried = [f for f in tried if not any(f.contains(other) for other in every)]
        for finding in tried[:MOST_TRIED]:
            beside = join(members | {label: Mended.of(members[label], finding.fit)}, *asked)
            more = _beside(beside, size - len(finding.fit.places))
            if more is not None:
                found.append((*(_cause(in_record(c.place, label), c.parameters) for c in finding.causes), *more))
    return found, tuple(
        f"{label}: nothing falsifies it by itself, so what is not sought in several records together was not tried "
        "there, and might do as well"
        for label in untried
    )


def _beside(joint: Joint, most: int) -> tuple[JointCause, ...] | None:
    """Causes, so many at most, with which the records stand, empty where they need none; None where all are refuted."""
    if not joint.falsified:
        return ()
    for size in range(1, most + 1):
        try:
            candidates = joint.candidates(size, Work(MOST_WORK))
            fit = next((fits[0] for places in candidates if (fits := joint.mended(places, Work()))), None)
        except CutOff:
            # What was not refuted stays a rival.
            return ()
        if fit is not None:
            return _causes(joint, Finding(causes_of(joint, fit), fit))
    return None


def _told_by(sets: Sequence[bool]) -> Open:
    return "yes" if all(sets) else "open" if any(sets) else "no"


def _causes(joint: Joint, finding: Finding) -> tuple[JointCause, ...]:
    """A set of effects as it is published, the instrument's first."""
    found = [_cause(c.place, c.parameters, joint.classes.equivalents(c.place)) for c in finding.causes]
    return tuple(sorted(found, key=lambda cause: cause.of == "run"))


def _cause(place: EffectPlace, parameters: Sequence[SizedParameter], same: Sequence[EffectPlace] = ()) -> JointCause:
    """An effect with whose it is."""
    differs = isinstance(place, Differs)
    return JointCause(
        title=place.title,
        of="run" if isinstance(place, InRecord) else "instrument",
        record=place.record if isinstance(place, InRecord) else None,
        effect=None if differs else NamedEffect.of(plain(place)),
        parameter=place.where if differs else None,
        equivalents=tuple(other.title for other in same),
        parameters=tuple(parameters),
    )


def _cautions(alone: Mapping[str, Diagnosis], joint: Joint, best: Finding) -> tuple[str, ...]:
    """What a record by itself says against the only set of the catalogue: a function in no catalogue is as simple.

    It is no rival of what is the instrument's where another record, which that refutes, names this by itself.
    """
    sure = {
        cause.place for label in joint.labels if alone[label].verdict == "explained" for cause in alone[label].causes
    }
    said = []
    for k, label in enumerate(joint.labels):
        result = alone[label]
        acting = [place for place in best.fit.places if joint.acts(k, place)]
        alike = [{place, *joint.classes.equivalents(place)} for place in acting]
        unsure = [places for places in alike if not places & sure]
        if unsure and result.verdict == "ambiguous" and not result.alternatives and result.complete is not False:
            said += [f"{label}: {text}" for text in result.caution]
    return tuple(said)


def _shared_parameters(joint: Joint, fit: Fit) -> tuple[SizedParameter, ...]:
    """Estimates and intervals of the shared parameters."""
    ends = fit.ends(joint.room(fit), joint.most_rows)
    return tuple(
        SizedParameter(name=name, unit=unit, estimate=value, low=finite_or_none(low), high=finite_or_none(high))
        for (name, unit), value, (low, high) in zip(joint.names, fit.estimate, ends, strict=False)
        if name in joint.shared
    )


def repeated(
    alone: Mapping[str, Diagnosis],
    joint: Joint | None,
    places: Sequence[Any],
    shared: Sequence[str],
    own: Sequence[str],
) -> tuple[Repeated, ...]:
    """Parameters of the model and of shared effects from record to record, each record by itself.

    With the effects of `places` that act in it where it is judged with the others and stands with them, else with what
    explains it by itself, or with none.
    """
    values: dict[tuple[str, str], dict[str, tuple[float, float, float]]] = {}
    for label, result in alone.items():
        fit = _standing(label, result, joint, places)
        for name, unit in getattr(result.evidence, "names", ()):
            values.setdefault((name, unit), {})
        if fit is None:
            continue
        evidence = result.evidence
        ends = fit.ends(evidence.room(fit), evidence.most_rows)
        for name, value, (low, high) in zip(evidence.names, fit.estimate, ends, strict=False):
            values[name][label] = (float(value), float(low), float(high))
        intervals = fit.intervals(evidence.room(fit), evidence.most_rows)
        for place, sizes, possible in zip(fit.places, fit.values(), intervals, strict=True):
            if place not in places:
                continue
            for parameter, size, (low, high) in zip(
                place.definition.parameters, sizes, evidence.told(place, possible), strict=True
            ):
                key = (f"{place.title}: {parameter.name}", parameter.unit)
                values.setdefault(key, {})[label] = (size, low, high)
    return tuple(
        repeated_of(
            key, found, tuple(alone), "instrument" if ": " in key[0] or is_of_instrument(key[0], shared, own) else "run"
        )
        for key, found in values.items()
    )


def repeated_of(
    key: tuple[str, str],
    found: Mapping[str, tuple[float, float, float]],
    labels: Sequence[str],
    of: Literal["instrument", "run"],
) -> Repeated:
    """A parameter, by name and unit, of which some records of these labels leave an estimate and two ends."""
    nothing = (math.nan, -math.inf, math.inf)
    rows = {label: found.get(label, nothing) for label in labels}
    lows, highs = ([row[k] for row in rows.values()] for k in (1, 2))
    records = tuple(
        InOneRecord(
            record=label,
            estimate=None if math.isinf(low) or math.isinf(high) else value,
            low=finite_or_none(low),
            high=finite_or_none(high),
        )
        for label, (value, low, high) in rows.items()
    )
    least = max(0.0, max(lows) - min(highs))
    most = max((found[label][2] for label in found), default=math.inf) - min(
        (v[1] for v in found.values()), default=0.0
    )
    return Repeated(name=key[0], unit=key[1], of=of, records=records, at_least=least, at_most=finite_or_none(most))


def _standing(label: str, result: Diagnosis, joint: Joint | None, places: Sequence[Any]) -> Fit | None:
    """The model with which a record stands by itself; None where none does, or several."""
    evidence = result.evidence
    if joint is not None and label in joint.labels:
        fit = joint.alone_with(joint.labels.index(label), places)
        if fit.radius <= evidence.limit:
            return centred(evidence, fit)
    if result.verdict == "explained":
        return result.findings[0].fit
    if result.verdict == "consistent":
        return centred(evidence, evidence.baseline)
    return None
