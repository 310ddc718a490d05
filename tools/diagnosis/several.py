"""Joint diagnosis of several records of one instrument: effects of the instrument, and effects of one run."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..bounded.work import CutOff, Work
from ..calibrated import (
    Calibration,
    OfRecord,
    Open,
    Parameter,
    Provenance,
    ReadingError,
    each_by_itself,
)
from ..calibration.estimates import simplest_directions
from ..calibration.targets import corners, error_weights, words_of
from ..errors import InputError, nearest
from ..evidence.evidence import Evidence, undetermined
from ..evidence.fit import Fit
from ..evidence.joint import LEAST_PART, Joint, join
from ..evidence.of_record import Differs, in_record, is_asked, is_of_instrument, mended, named_alike, names_of
from .cause import Cause, Finding, NamedEffect, SizedParameter, causes_of, centred, parameters_of
from .helps import cross_gains
from .procedure import diagnosed
from .result import Diagnosis, Explanation, OneRecord, Whose, simplest_first
from .search import MOST_WORK
from .set_aside import ROW, SetAside

MOST_TRIED = 4
"""Most sets of a single record, not sought in several, that are tried beside the others."""
NOTHING_MENDS = (
    "no set of up to three effects, of all records or of one, and of parameters that differ in one, mends them: more "
    "of these are needed, or what is not sought"
)
CUT_OFF = "the search was cut off among sets of {size}, and none of those that were tried mends them"
NOT_TRIED = (
    "{label}: {why} by itself, so what is not sought in several records together was not tried there, and might do as "
    "well"
)


def labels_of(paths: Sequence[Path]) -> list[str]:
    """Return labels of records: file names without ending, with a number where two are alike."""
    names = [path.name.split(".")[0] or path.name for path in paths]
    labels = []
    for k, name in enumerate(names, start=1):
        labels.append(f"{name}-{k}" if names.count(name) > 1 else name)
    return labels


def members_of(
    evidence: Mapping[str, Evidence], shared: Sequence[str] = (), own: Sequence[str] = ()
) -> dict[str, Evidence]:
    """Evidence of records that can be joined, as `named_alike` has it.

    An InputError for a name that no record's parameter has, or a parameter that is asked to be both shared and own.
    """
    members = named_alike(evidence)
    names: dict[str, None] = {}
    for member in members.values():
        names |= dict.fromkeys(name for name, _ in member.rows.names)
    spellings: dict[str, None] = {}
    for name in names:
        spellings |= dict.fromkeys(names_of(name))
    for pattern in (*shared, *own):
        if not any(fnmatchcase(name, pattern) for name in spellings):
            option = "--shared" if pattern in shared else "--own"
            raise InputError(f"{option} {pattern}: no parameter of these records; {nearest(pattern, list(spellings))}")
    for name in names:
        if is_asked(name, shared) and is_asked(name, own):
            raise InputError(f"--shared and --own: {name} cannot be both")
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
) -> Diagnosis:
    """Diagnose several records together, each already diagnosed by itself, with its evidence.

    `shared` and `own` are as for `join`; `left_out` has reasons why records are not judged with the others, by label.
    `rerun`: simulate each record with the effects of the others.
    """

    def joined(judged: Mapping[str, Diagnosis]) -> tuple[dict[str, str | None], Evidence | None]:
        reasons = {label: (left_out or {}).get(label) or reason_apart(one) for label, one in judged.items()}
        return reasons, _joined(judged, reasons, shared, own)

    aside = SetAside.of(alone)
    reasons, joint = joined(aside.diagnoses)
    together = None if joint is None else _diagnosed(joint, progress)
    if together is None or not _is_simpler_than_row(together):
        further = aside.beside(shared, own, left_out or {})
        if further is not None:
            aside = further
            reasons, joint = joined(aside.diagnoses)
            together = None if joint is None else _diagnosed(joint, progress)
    judged = aside.diagnoses
    records = []
    for label, diagnosis in alone.items():
        fault = aside.sentences.get(label) if reasons[label] is None else None
        digest = (sha256 or {}).get(label, "")
        records.append(
            OneRecord(record=label, sha256=digest, left_out=reasons[label], set_aside=fault, diagnosis=diagnosis)
        )
    keys: dict[str, Any] = {"records": tuple(records), "cross_gain": (), "helps": ()}
    if rerun:
        keys["cross_gain"], keys["helps"] = cross_gains(judged)
    if joint is None or together is None:
        return Diagnosis(
            verdict="insufficient",
            calibration=undetermined("fewer than two records can be judged together"),
            causes=(),
            baseline_model="shared parameters",
            not_named=("fewer than two records can be judged together",),
            repeatability=repeated(judged, None, (), shared, own),
            **keys,
        )
    try:
        return together.model_copy(update={**keys, **Together(joint, judged, together).keys})
    except SolverError as error:
        raise _unsolved(joint, error) from error


def _diagnosed(joint: Evidence, progress: bool) -> Diagnosis:
    """Diagnose a joint; an InputError where the solver fails."""
    try:
        return diagnosed(joint, rerun=False, progress=progress)
    except SolverError as error:
        raise _unsolved(joint, error) from error


def _unsolved(joint: Evidence, error: SolverError) -> InputError:
    return InputError(f"{', '.join(joint.model.labels)}: {error}; {joint.reader.too_large}")


def _is_simpler_than_row(together: Diagnosis) -> bool:
    """Return true if a set of effects needs no more numbers than a wrong row, or one more."""
    sets = [explanation.numbers for explanation in together.explanations]
    return min(sets, default=math.inf) <= ROW + 1


def reason_apart(diagnosis: Diagnosis) -> str | None:
    """Why a record is not judged with the others; None where it is."""
    evidence = diagnosis.evidence
    if not evidence.rows.names and not evidence.rows.parts:
        return "nothing can be run: " + "; ".join(map(str, diagnosis.missing or ()))
    if diagnosis.verdict == "explained" and not diagnosis.findings and not evidence.reader.read_off:
        return f"explained by itself: {diagnosis.explanations[0].sentence.rstrip('.')}"
    if diagnosis.verdict == "unexplained" and not diagnosis.unshown:
        return f"unexplained by itself: {(diagnosis.not_named or ('no set of effects explains it',))[0]}"
    if evidence.reader.read_off:
        return _not_sought(evidence.reader.read_off[0].place.title)
    return None


def _not_sought(title: str) -> str:
    return f"{title} explains it by itself; this effect is not tried for several records"


def _joined(
    alone: Mapping[str, Diagnosis], reasons: dict[str, str | None], shared: Sequence[str], own: Sequence[str]
) -> Evidence | None:
    """Return the records to judge together, at least two; add the reasons for excluding the others."""
    while True:
        members = {label: diagnosis.evidence for label, diagnosis in alone.items() if reasons[label] is None}
        if len(members) < 2:
            return None
        joint = join(members, shared, own)
        for k, label in enumerate(joint.model.labels):
            findings = (*alone[label].findings, *alone[label].unshown)
            if findings and all(_unsought(finding.fit, joint.model, k) for finding in findings):
                reasons[label] = _not_sought(findings[0].title)
        if not any(reasons[label] for label in members):
            return joint


def _unsought(fit: Fit, joint: Joint, k: int) -> tuple[EffectPlace, ...]:
    """Those effects of a set that mends a record that are not sought in several records together."""
    unsought = []
    for place in fit.places:
        if place not in joint.searched[k] and not (place.effect == "outlier" and joint.seeks_outliers):
            unsought.append(place)
    return tuple(unsought)


@dataclass(frozen=True, eq=False)
class Together:
    """Records judged together: joint evidence, separate diagnoses, and the joint diagnosis."""

    evidence: Evidence
    alone: Mapping[str, Diagnosis]
    found: Diagnosis

    @property
    def joint(self) -> Joint:
        """The model of all of them."""
        return self.evidence.model

    @property
    def keys(self) -> dict[str, Any]:
        """Keys of the result."""
        joint, diagnosis = self.joint, self.found
        own_names: dict[str, None] = {}
        for member in joint.members:
            own_names |= dict.fromkeys(name for name, _ in member.rows.names if name not in joint.shared)
        keys: dict[str, Any] = {"shared": joint.shared, "own": tuple(own_names), "not_searched": joint.not_searched}
        keys["findings"] = ()
        if self.best is not None:
            keys["findings"] = diagnosis.findings
        if diagnosis.verdict == "insufficient":
            return keys
        places = self.best.fit.places if self.best is not None else ()
        keys["repeatability"] = repeated(self.alone, joint, places, *joint.asked)
        if diagnosis.verdict == "unexplained":
            size = diagnosis.cut_off_at
            reason = NOTHING_MENDS
            if size is not None:
                reason = CUT_OFF.format(size=size)
            keys["not_named"] = (*(diagnosis.not_named or (reason,)), *self._must_differ())
        elif self.best is not None:
            keys |= self._of_sets(self.best)
        return keys

    @cached_property
    def best(self) -> Finding | None:
        """The set that is named, or the first of those that remain."""
        if self.found.verdict in ("explained", "ambiguous"):
            return self.found.findings[0]
        return None

    def _of_sets(self, best: Finding) -> dict[str, Any]:
        """Return the keys of the sets that fit the records."""
        rivals, untried = self._with_unsought(len(best.fit.places))
        explanations = []
        by_causes = {explanation.causes: explanation for explanation in self.found.explanations}
        for unsorted in self.found.sets:
            causes = tuple(sorted(unsorted, key=lambda cause: not cause.is_of_instrument))
            explanations.append(by_causes[unsorted].model_copy(update={"causes": causes}))
        explanations += [Explanation.of_causes(causes) for causes in rivals]
        owners: list[Collection[str | None]] = []
        for explanation in explanations:
            owners.append({cause.record for cause in explanation.causes})
        # An effect not tried in a record belongs to that run.
        owners += [{label} for label in untried]
        caution = (*self._cautions(best), *untried.values())
        is_named = self.found.verdict == "explained" and len(explanations) == 1 and not caution
        return {
            "verdict": "explained" if is_named else "ambiguous",
            "explanations": simplest_first(explanations),
            "causes": explanations[0].causes if is_named else (),
            "alternatives": () if is_named else tuple(explanation.causes for explanation in explanations),
            "complete": self.found.cut_off_at is None,
            "caution": caution,
            "instrument": _is_in_every(None, owners),
            "runs": {label: _is_in_every(label, owners) for label in self.joint.labels},
        }

    def _must_differ(self) -> tuple[str, ...]:
        """Return sentences on values that must differ in one record, where that suffices to make all records fit."""
        joint, members = self.joint, dict(zip(self.joint.labels, self.joint.members, strict=True))
        sentences = []
        # With two records, a value that the first cannot share, the second cannot share either.
        labels = joint.labels[-1:] if len(members) == 2 else joint.labels
        for label in labels:
            ends_here = self._ends_of({label: members[label]})
            ends_beside = self._ends_of(_without(members, label))
            apart = set()
            for name in joint.shared:
                if name in ends_here and name in ends_beside:
                    (low, high), (least, most) = ends_here[name], ends_beside[name]
                    if low > most or high < least:
                        apart.add(name)
            places = [p for p in joint.places if isinstance(p, Differs) and p.record == label and p.where in apart]
            if places and joint.refit(places).radius <= joint.limit:
                names = ", ".join(place.where for place in places)
                sentences.append(
                    f"with {names} of {label} its own all stand, and if nothing else acts each of them must differ"
                )
        return tuple(sentences)

    def _ends_of(self, members: Mapping[str, Evidence]) -> dict[str, tuple[float, float]]:
        """Return the ends of each parameter of several records together; empty if they do not fit."""
        part = join(members, *self.joint.asked)
        if part.model.falsified:
            return {}
        return {sized.name.partition(" in ")[0]: sized.ends for sized in parameters_of(part, part.model.baseline)}

    def _with_unsought(self, size: int) -> tuple[list[tuple[Cause, ...]], dict[str, str]]:
        """Return sets, no larger, with effects that mend one record but are not sought in several.

        An effect that is not sought acts there as it does beside the sought ones. It was tried in a record in sets as
        large as mend that record by itself. Where more is needed together, anything might act there, if the others
        stand with one effect less.
        """
        joint, sets, untried = self.joint, [], {}
        members = dict(zip(joint.labels, joint.members, strict=True))
        for k, (label, member) in enumerate(members.items()):
            findings = self.alone[label].findings
            reached = min((len(finding.fit.places) for finding in findings), default=0)
            if reached < size and _beside(join(_without(members, label), *joint.asked), size - 1) is not None:
                why = "fewer effects mend it" if reached else "nothing falsifies it"
                untried[label] = NOT_TRIED.format(label=label, why=why)
            for places, finding in self._tried_alone(k, findings, size):
                joined = join(members | {label: mended(member, finding.fit, places)}, *joint.asked)
                causes_beside = _beside(joined, size - len(places))
                if causes_beside is not None:
                    causes_here = (cause for cause in finding.causes if cause.place in places)
                    sets.append((*(_in_record(cause, label) for cause in causes_here), *causes_beside))
        return sets, untried

    def _tried_alone(
        self, k: int, findings: Sequence[Finding], size: int
    ) -> Iterator[tuple[tuple[EffectPlace, ...], Finding]]:
        """Yield effects not sought in several records, at most `size`, each with a set that mends one record alone."""
        unsought: dict[tuple[EffectPlace, ...], Finding] = {}
        for finding in findings:
            # A set that contains a fitting set can always fit, too.
            if not any(finding.contains(rival) for rival in findings):
                unsought.setdefault(_unsought(finding.fit, self.joint, k), finding)
        fitting = [pair for pair in unsought.items() if 0 < len(pair[0]) <= size]
        yield from fitting[:MOST_TRIED]

    def _cautions(self, best: Finding) -> tuple[str, ...]:
        """Return cautions where one record alone has a function outside the catalogue as simple as the only set.

        It is not a rival of an effect of the instrument if another record refutes it and names that effect alone.
        """
        sure: set[EffectPlace] = set()
        for label in self.joint.labels:
            sure.update(cause.place for cause in self.alone[label].causes)
        cautions: list[str] = []
        for k, label in enumerate(self.joint.labels):
            diagnosis = self.alone[label]
            one_set = diagnosis.verdict == "ambiguous" and len(diagnosis.sets) < 2 and diagnosis.complete is not False
            acting = [place for place in best.fit.places if self.joint.acts(k, place)]
            if one_set and any(not sure & {p, *self.joint.classes.equivalents(p)} for p in acting):
                cautions += [f"{label}: {text}" for text in diagnosis.caution]
        return tuple(cautions)


def _without(members: Mapping[str, Evidence], label: str) -> dict[str, Evidence]:
    """All records but one."""
    return {name: member for name, member in members.items() if name != label}


def _beside(joint: Evidence, most: int) -> tuple[Cause, ...] | None:
    """Return at most `most` causes that make the records fit; empty where none is needed, None if all are refuted."""
    if not joint.model.falsified:
        return ()
    for size in range(1, most + 1):
        try:
            for places in joint.model.candidates(size, Work(MOST_WORK)):
                if fits := joint.model.mended(places, Work()):
                    causes = causes_of(joint, fits[0])
                    return tuple(sorted(causes, key=lambda cause: not cause.is_of_instrument))
        except CutOff:
            # A set that is not refuted stays a rival.
            return ()
    return None


def _in_record(cause: Cause, label: str) -> Cause:
    """A cause of one record as one among several."""
    keys = NamedEffect.keys(in_record(cause.place, label))
    return Cause(**keys, equivalents=(), parameters=cause.parameters)


def _is_in_every(label: str | None, owners: Sequence[Collection[str | None]]) -> Whose:
    """Return whether every set has an effect of this record (None: of the instrument); "open" if only some have."""
    present = [label in owner for owner in owners]
    if all(present):
        return "yes"
    return "open" if any(present) else "no"


# Repeatability


def repeated(
    alone: Mapping[str, Diagnosis], joint: Joint | None, places: Sequence[EffectPlace], *asked: Sequence[str]
) -> Calibration:
    """Return the parameters of model and shared effects from each record alone, with their changes.

    With the effects of `places` that act in it where it is judged with the others and stands with them, else with what
    explains it by itself, or with none. `asked` are names of shared parameters, and of parameters that each record has
    for itself.
    """
    records = {}
    for label, diagnosis in alone.items():
        parameters: list[Parameter] = []
        fit = _standing(label, diagnosis, joint, places)
        if fit is not None:
            parameters += [parameter_of(sized) for sized in parameters_of(diagnosis.evidence, fit)]
            for cause in causes_of(diagnosis.evidence, fit):
                if cause.place in places:
                    parameters += [parameter_of(sized, cause.place) for sized in cause.parameters]
        provenance = Provenance(record=label)
        records[label] = OfRecord(sigma=diagnosis.calibration.sigma, parameters=parameters, provenance=provenance)
    return each_by_itself(records, lambda symbol: ": " in symbol or is_of_instrument(symbol, *asked))


def parameter_of(sized: SizedParameter, place: EffectPlace | None = None) -> Parameter:
    """Return a parameter of a model, or of an effect at a place, as calibrations have it."""
    symbol = sized.name if place is None else f"{place.title}: {sized.name}"
    bounded = sized.low is not None and sized.high is not None
    return Parameter(
        symbol=symbol,
        name=words_of(symbol),
        unit=sized.unit,
        determined=bounded,
        estimate=float(sized.estimate) if bounded else None,
        low=sized.low,
        high=sized.high,
    )


def _standing(label: str, diagnosis: Diagnosis, joint: Joint | None, places: Sequence[EffectPlace]) -> Fit | None:
    """Return the model that fits one record alone; None if none or several fit."""
    evidence = diagnosis.evidence
    if joint is not None and label in joint.labels:
        fit = joint.alone_with(joint.labels.index(label), places)
        if fit.radius <= evidence.model.limit:
            return centred(evidence, fit)
    if diagnosis.verdict == "explained" and diagnosis.findings:
        return diagnosis.findings[0].fit
    if diagnosis.verdict == "consistent":
        return centred(evidence, evidence.model.baseline)
    return None


# Calibrated


def calibrated_together(
    members: Mapping[str, Evidence],
    *,
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
    sha256: Sequence[str],
) -> Calibration:
    """Return the calibration of a table's records, by the labels of their evidence.

    `shared`, `own` are as for `join`, InputErrors as for `members_of`. A falsified one has no parameters: no values fit
    all records, and `trihedron diagnose` says why.
    """
    joint = join(members_of(members, shared, own), shared, own)
    calibrations = {label: record.reader.calibration_of() for label, record in members.items()}
    fit, missing = None, ()
    errors: Sequence[list[ReadingError]] = [[] for _ in members]
    if not joint.model.falsified:
        fit, missing = centred(joint, joint.model.baseline), joint.reader.missing().get("missing", ())
        if not missing:
            errors = _reading_errors(joint, list(calibrations.values()), fit)
    together = joint.reader.calibration_of(fit)
    of_record = {}
    for (label, record), digest, of_readings in zip(together.of_record.items(), sha256, errors, strict=True):
        changed = {
            "parameters": _where_determined(record.parameters),
            "reading_errors": of_readings,
            "provenance": Provenance(record=label, record_sha256=digest),
        }
        of_record[label] = record.model_copy(update=changed)
    first = next(iter(calibrations.values()))
    changed = {
        "verdict": "insufficient" if missing else together.verdict,
        "radius": joint.model.radius,
        "gravity": first.gravity,
        "convention": "A1",
        "baseline": first.baseline,
        "parameters": _where_determined(together.parameters),
        "open": _open_directions(joint, missing),
        "of_record": of_record,
    }
    return together.model_copy(update=changed)


def _open_directions(joint: Evidence, missing: Sequence[str]) -> list[Open]:
    """Return the directions that the records leave open together, and what else is not determined by itself."""
    if not missing:
        return []
    reader: Any = joint.reader
    directions = np.linalg.svd(joint.rows.nominal, full_matrices=True)[2][reader.rank :]
    names = [name for name, _ in joint.rows.names]
    of_direction = []
    for direction in simplest_directions(directions.T):
        moved = [name for name, part in zip(names, direction, strict=True) if abs(part) > LEAST_PART]
        of_direction.append(Open(parameters=moved))
    in_some: set[str] = set()
    for direction in of_direction:
        in_some.update(direction.parameters)
    return of_direction + [Open(parameters=[name]) for name in missing if name not in in_some]


def _where_determined(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters without the estimates of those that the records leave open."""
    return [p if p.determined else p.model_copy(update={"estimate": None}) for p in parameters]


def _reading_errors(joint: Evidence, calibrations: Sequence[Calibration], fit: Fit) -> list[list[ReadingError]]:
    """Return the possible errors of the accelerometers at the corners of the input, for each record."""
    possible = fit.possible(joint.model.room, None, joint.model.effort.most_rows).among(np.arange(len(fit.central)))
    errors = []
    for calibration, chosen in zip(calibrations, joint.model.chosen, strict=True):
        weights = error_weights(calibration.linearised.parametrisation) @ chosen
        of_member = []
        for (accelerometer, n), w in zip(corners(), weights, strict=True):
            middle = float(w @ fit.central)
            of_member.append(ReadingError.of(accelerometer, n, middle - possible(-w), middle + possible(w)))
        errors.append(of_member)
    return errors
