"""Several records of one instrument: what they say together, and what is the instrument's or the run's."""

from collections.abc import Collection, Mapping, Sequence
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
    named_alike,
    names_of,
    plain,
)
from ..result import Result, Told
from .cause import Cause, Finding, NamedEffect, Number, SizedParameter, causes_of, centred, parameters_of
from .helps import CrossGain, Helps, cross_gains
from .procedure import diagnosed
from .repeated import Repeated, repeated
from .result import DIAGNOSIS, FIRST_DIAGNOSIS, Diagnosis
from .search import MOST_WORK
from .witness import EffectWitness

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

    @property
    def noise_bound(self) -> float | None:
        """σ of the records at a table; None where there are none."""
        return next((one.diagnosis.noise_bound for one in self.records if one.diagnosis.noise_bound is not None), None)

    def causes_in(self, sha256: str) -> tuple[Cause, ...]:
        """The effects that act in a record: the instrument's, and its own where it is one of these, by its SHA-256."""
        own = {one.record for one in self.records if one.sha256 and one.sha256 == sha256}
        return tuple(
            Cause(**NamedEffect.keys(cause.effect.place), equivalents=(), parameters=cause.parameters)
            for cause in self.causes
            if cause.effect is not None and (cause.of == "instrument" or cause.record in own)
        )


Diagnosed = Diagnosis | Several
DIAGNOSES: Mapping[str, type[Diagnosed]] = {
    DIAGNOSIS: Diagnosis,
    FIRST_DIAGNOSIS: Diagnosis,
    SEVERAL: Several,
}
"""Schemas of diagnoses, of one record and of several."""


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
    rerun: bool = True,
    sha256: Mapping[str, str] | None = None,
    progress: bool = False,
    most_work: float = MOST_WORK,
) -> Several:
    """What records that were diagnosed each by itself, with their evidence, say together.

    `shared`, `own` are as for `join`; `left_out` has reasons why records are not judged with the others, by label;
    `rerun`: simulate each record with what was found in others; `most_work` is that of the search.
    """
    reasons = {label: (left_out or {}).get(label) or reason_apart(result) for label, result in alone.items()}
    joint = _joined(alone, reasons, shared, own)
    gains, helps = cross_gains(alone) if rerun else ((), ())
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
        found = diagnosed(joint, rerun=False, progress=progress, most_work=most_work)
        return Several(**told, **_judged(joint, alone, found))
    except SolverError as error:
        raise InputError(f"{', '.join(joint.labels)}: {error}; {joint.too_large}") from error


def reason_apart(result: Diagnosis) -> str | None:
    """Why a record is not judged with the others; None where it is."""
    evidence = result.evidence
    if not evidence.names and not evidence.parts:
        return "nothing can be run: " + "; ".join(map(str, result.missing or ()))
    if result.verdict == "unexplained" and not result.unshown:
        return f"unexplained by itself: {(result.not_named or ('no set of effects mends it',))[0]}"
    return _not_sought(evidence.read_off[0].place.title) if evidence.read_off else None


def _not_sought(title: str) -> str:
    return f"by itself {title} mends it, which is not sought in several records together"


def _joined(
    alone: Mapping[str, Diagnosis], reasons: dict[str, str | None], shared: Sequence[str], own: Sequence[str]
) -> Joint | None:
    """The records that can be judged together, two at least; to the reasons are added those of others."""
    members = {label: result.evidence for label, result in alone.items() if reasons[label] is None}
    if len(members) < 2:
        return None
    joint = join(members, shared, own)
    for k, label in enumerate(joint.labels):
        findings = (*alone[label].findings, *alone[label].unshown)
        if findings and all(_unsought(finding.fit, joint, k) for finding in findings):
            reasons[label] = _not_sought(findings[0].title)
    return _joined(alone, reasons, shared, own) if any(reasons[label] for label in members) else joint


def _unsought(fit: Fit, joint: Joint, k: int) -> tuple[EffectPlace, ...]:
    """Those effects of a set that mends a record that are not sought in several records together."""
    known = {*joint.searched[k], *(place for place in fit.places if place.effect == "outlier" and joint.seeks_outliers)}
    return tuple(place for place in fit.places if place not in known)


def _judged(joint: Joint, alone: Mapping[str, Diagnosis], found: Diagnosis) -> dict[str, Any]:
    """Keys of what records say that can be judged together, by their diagnosis as one evidence."""
    named = found.findings if found.verdict in ("explained", "ambiguous") else ()
    told: dict[str, Any] = {
        "verdict": found.verdict,
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
        return told
    told["repeatability"] = repeated(alone, joint, named[0].fit.places if named else (), *joint.asked)
    if found.verdict == "unexplained":
        tried = "no set of up to three effects, of all records or of one, and of parameters that differ in one, mends "
        tried += "them: more of these are needed, or what is not sought"
        if (size := found.cut_off_at) is not None:
            tried = f"the search was cut off among sets of {size}, and none of those that were tried mends them"
        return told | {"not_named": (*(found.not_named or (tried,)), *_must_differ(joint))}
    sized = parameters_of(joint, named[0].fit if named else centred(joint, joint.baseline))
    told["parameters"] = tuple(one for one in sized if one.name in joint.shared)
    if not named:
        return told
    best = named[0]
    rivals, untried = _with_unsought(joint, alone, len(best.fit.places))
    sets = [*(_causes(joint, finding) for finding in named), *rivals]
    # What was not tried in a record is of that run.
    owners = [*({cause.record for cause in causes} for causes in sets), *({label} for label in untried)]
    caution = (*_cautions(alone, joint, best), *untried.values())
    return told | {
        "verdict": "ambiguous" if len(sets) > 1 or caution else found.verdict,
        "radius_with_causes": best.fit.radius,
        "causes": sets[0],
        "alternatives": tuple(sets[1:]),
        "complete": found.cut_off_at is None,
        "witnesses": found.judgement if isinstance(found.judgement, tuple) else (),
        "caution": caution,
        "instrument": _told_by(None, owners),
        "runs": {label: _told_by(label, owners) for label in joint.labels},
    }


def _must_differ(joint: Joint) -> tuple[str, ...]:
    """Where one record stands by itself, and the others together: what they cannot share, if that is enough."""
    said, members = [], dict(zip(joint.labels, joint.members, strict=True))
    for label in joint.labels[-1 if len(members) == 2 else 0 :]:
        parts = {label: members[label]}, {other: those for other, those in members.items() if other != label}
        ends = []
        for part in (join(records, *joint.asked) for records in parts):
            told = () if part.falsified else parameters_of(part, part.baseline)
            ends.append({p.name.partition(" in ")[0]: p.ends for p in told})
        own, others = ends
        both = [name for name in joint.shared if name in own and name in others]
        apart = {name for name in both if own[name][0] > others[name][1] or own[name][1] < others[name][0]}
        differ = [p for p in joint.places if isinstance(p, Differs) and p.record == label and p.where in apart]
        if differ and joint.refit(differ).radius <= joint.limit:
            names = ", ".join(place.where for place in differ)
            said.append(f"with {names} of {label} its own all stand, and if nothing else acts each of them must differ")
    return tuple(said)


def _with_unsought(
    joint: Joint, alone: Mapping[str, Diagnosis], size: int
) -> tuple[list[tuple[JointCause, ...]], dict[str, str]]:
    """Sets, no larger, with what mends a record by itself and is not sought in several; and where such was not tried.

    What is not sought acts as it does there, beside what is. It was tried in a record in sets as large as mend that by
    itself: where more is needed together, anything might do there, if the others stand with one effect less.
    """
    found, untried = [], {}
    members = dict(zip(joint.labels, joint.members, strict=True))
    for k, (label, member) in enumerate(members.items()):
        every = alone[label].findings
        reached = min((len(finding.fit.places) for finding in every), default=0)
        others = {other: those for other, those in members.items() if other != label}
        if reached < size and _beside(join(others, *joint.asked), size - 1) is not None:
            untried[label] = (
                f"{label}: {'fewer effects mend it' if reached else 'nothing falsifies it'} by itself, so what is not "
                "sought in several records together was not tried there, and might do as well"
            )
        tried: dict[tuple[EffectPlace, ...], Finding] = {}
        for finding in every:
            # What contains a set that stands there can always stand, too.
            if not any(finding.contains(other) for other in every):
                tried.setdefault(_unsought(finding.fit, joint, k), finding)
        for places, finding in [pair for pair in tried.items() if 0 < len(pair[0]) <= size][:MOST_TRIED]:
            beside = join(members | {label: Mended.of(member, finding.fit, places)}, *joint.asked)
            more = _beside(beside, size - len(places))
            if more is not None:
                own = (cause for cause in finding.causes if cause.place in places)
                found.append((*(_cause(in_record(c.place, label), c.parameters) for c in own), *more))
    return found, untried


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


def _told_by(label: str | None, owners: Sequence[Collection[str | None]]) -> Open:
    """Whether every set has something of this record, None for the instrument."""
    held = [label in own for own in owners]
    return "yes" if all(held) else "open" if any(held) else "no"


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
