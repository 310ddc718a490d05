"""From a record to a verdict on the simulation: the procedure of `trihedron diagnose`, whatever the record."""

from collections.abc import Mapping
from typing import Any

from ..bounded.programmes import SolverError
from ..errors import InputError
from ..evidence.bench import bench_evidence
from ..evidence.carried_record import carried_evidence
from ..evidence.evidence import Evidence, Fit
from ..records import PositionRecord, StrapdownRecord
from .judge import causes_of, excluded_sizes, residual_structure
from .lengths import of_lengths, only_at_one_length
from .result import Diagnosis, EffectWitness, Finding, NamedEffect, Witness
from .search import equivalence_groups, search, single_radii


def diagnose(
    record: PositionRecord | StrapdownRecord, *, rerun: bool = True, progress: bool = False, **options: Any
) -> Diagnosis:
    """Say whether the simulation can be true of a record, and if not, which smallest set of effects mends it.

    Parameters
    ----------
    record : PositionRecord or StrapdownRecord
    rerun : bool
        simulate what was held out again, without and with the effects that were named
    progress : bool
        show a bar on standard error, where that is a terminal
    **options
        of a position record as for `bench_evidence`, of a strapdown record as for `carried_evidence`

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        a record that cannot be used
    """
    carried = isinstance(record, StrapdownRecord)
    evidence = carried_evidence(record, **options) if carried else bench_evidence(record, **options)
    try:
        return diagnosed(evidence, rerun=rerun, progress=progress)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; {evidence.too_large}") from error


def diagnosed(evidence: Evidence, *, rerun: bool = True, progress: bool = False) -> Diagnosis:
    """The diagnosis of evidence, whatever the record.

    Raises
    ------
    SolverError
        where the errors are too large for linear programmes
    """
    told: dict[str, Any] = {"evidence": evidence, "causes": (), "extended": None, "gain": None, **evidence.head()}
    if missing := evidence.missing():
        return _result("insufficient", told, missing)
    told |= of_lengths(evidence)
    if not evidence.falsified:
        excluded = excluded_sizes(evidence, evidence.baseline)
        model = evidence.of_model(evidence.baseline, excluded)
        return _result("insufficient" if "missing" in model else "consistent", told, model, excluded=excluded)
    found = search(evidence, progress=progress)
    told |= {"tried": single_radii(evidence), **evidence.of_misfit()}
    if not found.fits or evidence.objections():
        return _unexplained(evidence, told, evidence.objections())
    groups = equivalence_groups(evidence, found.fits)
    findings = [Finding(causes_of(evidence, group[0]), group[0]) for group in groups[: evidence.most_sets]]
    best = findings[0]
    told |= {"findings": findings, "judgement": _judgement(evidence, best.fit)}
    if len(groups) > 1 or not found.complete:
        return _result(
            "ambiguous",
            told | _named(best),
            evidence.probe([finding.fit for finding in findings]),
            alternatives=tuple(finding.causes for finding in findings[1:]),
            complete=found.complete,
        )
    if evidence.decisive:
        # What is needed most comes first; what has no witness is not named.
        heard = sorted(told["judgement"], key=lambda witness: -witness.rms_without)
        best = best.in_order([witness.place for witness in heard])
        told |= {"findings": [best], "judgement": heard}
        alone = only_at_one_length(evidence, best.fit, told["lengths"])
        objections = (*(witness.objection for witness in heard if witness.objection is not None), *alone)
        if objections:
            return _unexplained(evidence, told, objections)
    excluded = excluded_sizes(evidence, best.fit)
    return _result(
        "explained",
        told | _named(best),
        evidence.of_model(best.fit, excluded),
        equivalent_sets=tuple(tuple(NamedEffect.of(place) for place in fit.places) for fit in groups[0][1:]),
        gain=evidence.gain(best.fit) if rerun else None,
        excluded=excluded,
    )


def _judgement(evidence: Evidence, fit: Fit) -> Witness | list[EffectWitness]:
    """What was left out says of the effects of a fit: of each where that is decisive, else of all together."""
    if evidence.decisive:
        return [EffectWitness.of(trial) for trial in evidence.trials(fit)]
    return next(Witness.of(trial) for trial in evidence.trials(fit))


def _named(finding: Finding) -> dict[str, Any]:
    return {"causes": finding.causes, "extended": {"radius": finding.fit.radius}}


def _unexplained(evidence: Evidence, told: Mapping[str, Any], objections: tuple[str, ...]) -> Diagnosis:
    structure = residual_structure(evidence.channels())
    return _result("unexplained", told, {}, not_named=objections, residual_structure=structure)


def _result(verdict: str, told: Mapping[str, Any], more: Mapping[str, Any], **keys: Any) -> Diagnosis:
    """The result; of these keys those that hold something."""
    kept = {key: value for key, value in keys.items() if value not in (None, ()) or key in ("gain", "complete")}
    warnings = (*told.get("warnings", ()), *more.get("warnings", ()))
    return Diagnosis.model_validate({**told, **more, **kept, "verdict": verdict, "warnings": warnings})
