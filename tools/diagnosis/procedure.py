"""From a record to a verdict on the simulation: the procedure of `trihedron diagnose`, whatever the record."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from ..bounded.programmes import SolverError
from ..calibration.procedure import STANDARD_BOUNDS
from ..errors import InputError
from ..evidence.bench import bench_evidence
from ..evidence.evidence import Evidence, Fit
from ..records import PositionRecord
from .judge import causes_of, excluded_sizes, residual_structure
from .result import Diagnosis, EffectWitness, Finding, NamedEffect, Witness
from .search import equivalence_groups, search, single_radii


def diagnose(
    record: PositionRecord,
    *,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    baseline: str = "asymmetric",
    bounds: tuple[float, float] = STANDARD_BOUNDS,
    mounting: Mapping[str, ArrayLike] | str = "identity",
    rerun: bool = True,
    progress: bool = False,
) -> Diagnosis:
    """Say whether the bench's model can be true of a record, and if not, which smallest set of effects mends it.

    Parameters
    ----------
    record, noise_bound, gravity, baseline, bounds, mounting
        as for `trihedron.tools.calibration.calibrate`
    rerun : bool
        simulate held-out positions again, without and with the effect that was named
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        as for `trihedron.tools.calibration.calibrate`
    """
    evidence = bench_evidence(
        record, noise_bound=noise_bound, gravity=gravity, baseline=baseline, bounds=bounds, mounting=mounting
    )
    try:
        return diagnosed(evidence, rerun=rerun, progress=progress)
    except SolverError as error:
        sigma = evidence.calibration.noise_bound
        raise InputError(f"{record.path}: {error}; is --noise-bound {sigma:g} a fraction of g?") from error


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
    if not evidence.falsified:
        excluded = excluded_sizes(evidence, evidence.baseline)
        model = evidence.of_model(evidence.baseline, excluded)
        return _result("insufficient" if "missing" in model else "consistent", told, model, excluded=excluded)
    found = search(evidence, progress=progress)
    told |= {"tried": single_radii(evidence), **evidence.of_misfit()}
    if not found.fits or evidence.objections():
        return _unexplained(evidence, told, evidence.objections())
    groups = equivalence_groups(evidence, found.fits)
    findings = tuple(Finding(causes_of(evidence, group[0]), group[0]) for group in groups)
    best = groups[0][0]
    told |= {"findings": findings, "causes": findings[0].causes, "extended": {"radius": best.radius}}
    told |= {"judgement": _judgement(evidence, best)}
    if len(groups) > 1 or not found.complete:
        return _result(
            "ambiguous",
            told,
            evidence.probe([group[0] for group in groups]),
            alternatives=tuple(finding.causes for finding in findings[1:]),
            complete=found.complete,
        )
    excluded = excluded_sizes(evidence, best)
    return _result(
        "explained",
        told,
        evidence.of_model(best, excluded),
        equivalent_sets=tuple(tuple(NamedEffect.of(place) for place in fit.places) for fit in groups[0][1:]),
        gain=evidence.gain(best) if rerun else None,
        excluded=excluded,
    )


def _judgement(evidence: Evidence, fit: Fit) -> Witness | tuple[EffectWitness, ...]:
    """What was left out says of the effects of a fit: of each, or of the set."""
    if evidence.decisive:
        return tuple(EffectWitness.of(trial) for trial in evidence.trials(fit))
    return next(Witness.of(trial) for trial in evidence.trials(fit))


def _unexplained(evidence: Evidence, told: Mapping[str, Any], objections: tuple[str, ...]) -> Diagnosis:
    structure = residual_structure(evidence.channels())
    return _result("unexplained", told, {}, not_named=objections, residual_structure=structure)


def _result(verdict: str, told: Mapping[str, Any], more: Mapping[str, Any], **keys: Any) -> Diagnosis:
    """The result; of these keys those that hold something."""
    kept = {key: value for key, value in keys.items() if value not in (None, ()) or key in ("gain", "complete")}
    warnings = (*told.get("warnings", ()), *more.get("warnings", ()))
    return Diagnosis.model_validate({**told, **more, **kept, "verdict": verdict, "warnings": warnings})
