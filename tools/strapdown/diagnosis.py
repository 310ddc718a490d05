"""From a strapdown record to a verdict on the simulation: the procedure of `trihedron diagnose` for such records."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..diagnosis.result import Cause
from ..diagnosis.search import compared_places, likeness
from ..errors import InputError
from ..evidence.carried import (
    BIAS,
    LIMIT,
    SCALE,
    Carried,
    about_main_effect,
    carried_evidence,
    check_record,
    has_truth,
    missing_things,
    with_reference_errors,
)
from ..evidence.evidence import Fit, rms_size
from ..evidence.gain import carried_gain
from ..motion.inspect import Inspection, inspect_record
from ..motion.norm import LARGEST
from ..motion.rests import rest_warnings
from ..records import StrapdownRecord
from .intervals import excluded_sizes
from .judging import witnesses
from .lengths import by_length, length_of, only_at_one_length
from .result import BaselineParameter, StrapdownDiagnosis
from .search import classes_of, seen_places, smallest_sets
from .separation import what_separates
from .sizes import causes_of, estimates, left_of
from .structure import residual_structure

BASELINES = ("calibrated", "nominal")
MOST_CANDIDATES = 12
"""So many sets that remain are shown."""


def diagnose_strapdown(
    record: StrapdownRecord,
    *,
    gravity: float = STANDARD_GRAVITY,
    baseline: str | None = None,
    rates: str = "instantaneous",
    rerun: bool = True,
) -> StrapdownDiagnosis:
    """Say whether the simulation can be true of a strapdown record, and if not, which effects it lacks.

    With true attitude in the record the carried attitude is compared with it over windows of several lengths; without,
    the direction of gravity is carried from rest to rest.

    Parameters
    ----------
    record : StrapdownRecord
    gravity : float
        model value [m/s²]
    baseline : "calibrated", "nominal" or None
        whether the gyros' bias, scale factors and misalignments are free. None: calibrated where gravity is the
        reference, nominal where the truth is known: the block as delivered, its mean at rest taken out
    rates : "instantaneous" or "averaged"
        what a rate in the record means
    rerun : bool
        estimate, export and simulate again on blocks that were not used

    Returns
    -------
    StrapdownDiagnosis

    Raises
    ------
    InputError
        a record whose gyros and accelerometers, or truth, cannot belong together: units, order or signs of axes
    """
    if baseline not in (None, *BASELINES):
        raise InputError(f"baseline '{baseline}' is not one of a strapdown record: calibrated or nominal")
    found = inspect_record(record, gravity=gravity)
    check_record(found)
    known = has_truth(found)
    baseline = baseline or ("nominal" if known else "calibrated")
    reference = "true attitude" if known else "gravity"
    warnings = (*record.warnings, *sampling_warnings(found))
    missing = missing_things(found)
    if missing:
        return StrapdownDiagnosis(
            "insufficient", found, reference, baseline, missing=missing, warnings=warnings, rates=rates
        )
    built, bound_from, jumps = with_reference_errors(about_main_effect(carried_evidence(found, baseline, rates)))
    warnings = (*warnings, *jumps)
    quoted = built.parts[built.quoted]
    start = StrapdownDiagnosis(
        "insufficient",
        found,
        reference,
        baseline,
        noise_bound=float(np.median(quoted.bound)),
        noise_bound_from=bound_from,
        bias_at_rest=built.model.bias if known and BIAS not in built.own and len(found.rests) else None,
        warnings=warnings,
        rates=rates,
        parts=built.parts,
        quoted=built.quoted,
        quantities=built.quantities(),
    )
    try:
        return judged(start, built, rerun=rerun)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; the errors are too large for one linear system") from error


def sampling_warnings(found: Inspection) -> tuple[str, ...]:
    """What a person should know of the sampling."""
    said = [
        f"{name}: {rows} rows are saturated" + ("; moves with them are not used" if name.startswith("w") else "")
        for name, rows in found.sampling.saturated.items()
    ]
    said += rest_warnings(found.rests, found.gravity)
    if found.sampling.gaps:
        said.append(
            f"{len(found.sampling.gaps)} gaps, {found.sampling.missing} rows missing; moves over them are not used"
        )
    return tuple(said)


def judged(start: StrapdownDiagnosis, system: Carried, *, rerun: bool) -> StrapdownDiagnosis:
    """The diagnosis of a system."""
    seen = seen_places(system)
    not_seen = (*(place for place in system.places if place not in seen), *system.not_searched)
    classes = classes_of(system, seen)
    places = list(classes)
    found = smallest_sets(system, places)
    baseline = system.refit(())
    start = replace(start, radius=baseline.radius, not_seen=not_seen, left=left_of(system, baseline))
    if baseline.radius <= LIMIT:
        return without_causes(start, system, baseline, seen)
    start = replace(start, parameters=estimates(system, baseline))
    lengths, stable = by_length(system, places, start.bias_at_rest)
    tried = sorted(((p.title, system.refit([p]).radius) for p in places), key=lambda e: (round(e[1], 9), e[0]))
    start = replace(start, lengths=lengths, order_stable=stable, tried=tuple(tried), complete=found.complete)
    compared = compared_places(places, [fit.places for fit in found.fits], [title for title, _ in tried])
    start = replace(start, compared=compared, alike=likeness(system, compared))
    if start.bias_at_rest is not None and BIAS in system.places:
        start = replace(start, bias_left_in=bias_left_in(system, start.bias_at_rest))
    impossible = beyond_instruments(system, baseline)
    if impossible or not found.fits:
        structure = tuple(residual_structure(system))
        return replace(start, verdict="unexplained", residual_structure=structure, objections=impossible)
    candidates = tuple(causes_of(system, fit, classes) for fit in found.fits[:MOST_CANDIDATES])
    best = found.fits[0]
    start = replace(
        start, candidates=candidates, extended_radius=best.radius, left=left_of(system, best), complete=found.complete
    )
    if len(found.fits) > 1:
        separate = what_separates([fit.places for fit in found.fits[:MOST_CANDIDATES]], start.reference)
        return replace(start, verdict="ambiguous", separate=separate, witnesses=witnesses(system, best.places))
    heard = sorted(witnesses(system, best.places), key=lambda witness: -witness.without)
    by_need = [witness.place for witness in heard]
    candidates = (tuple(sorted(candidates[0], key=lambda cause: by_need.index(cause.place))),)
    objections = (*(w.objection for w in heard if not w.supports), *only_at_one_length(system, best, lengths))
    start = replace(start, candidates=candidates, witnesses=tuple(heard), objections=objections)
    if objections:
        structure = tuple(residual_structure(system))
        return replace(start, verdict="unexplained", residual_structure=structure)
    return replace(
        start,
        verdict="explained",
        warnings=(*start.warnings, *clock_doubt(start.inspection, candidates[0])),
        parameters=estimates(system, best, ends=True),
        gain=carried_gain(system, best.places) if rerun else None,
        excluded=excluded_sizes(system, best, seen),
    )


def without_causes(
    start: StrapdownDiagnosis, system: Carried, fit: Fit, seen: Sequence[EffectPlace]
) -> StrapdownDiagnosis:
    """The diagnosis of a record that the baseline explains: consistent, or too little to falsify anything."""
    parameters = estimates(system, fit, ends=True)
    lengths = tuple(length_of(system, k, (), search=False) for k in system.scored)
    excluded = excluded_sizes(system, fit, seen)
    start = replace(start, parameters=parameters, lengths=lengths, excluded=excluded)
    missing = undetermined(parameters, excluded, system)
    if missing:
        return replace(start, verdict="insufficient", missing=missing)
    return replace(start, verdict="consistent")


def undetermined(parameters: Sequence[BaselineParameter], excluded: Sequence[dict], system: Carried) -> tuple[str, ...]:
    """What the record leaves open of the gyros, and what would tell it."""
    wide = [
        p.name
        for p in parameters
        if p.low is None or p.high is None or (p.unit == "1" and p.high - p.low > 2.0 * LARGEST)
    ]
    if wide:
        return (
            f"not determined: {', '.join(wide)}; turn the block about each of its axes, there and back, and let it "
            "rest in more poses",
        )
    if not system.own and not any(entry["effect"] == "gyro-scale-misalignment" for entry in excluded):
        return ("the block hardly turns: no scale factor of a gyro is bounded; turn it about each of its axes",)
    return ()


def beyond_instruments(system: Carried, fit: Fit) -> tuple[str, ...]:
    """Parameters of the baseline that no instrument has: the record is not what it says."""
    values = system.point + fit.solution[: len(system.names)]
    return tuple(
        f"{name} would be {value:+.2g}: check units, order and signs of the axes"
        for (name, unit), value in zip(system.names, values, strict=True)
        if unit == "1" and abs(value) > LARGEST
    )


def clock_doubt(found: Inspection, causes: Sequence[Cause]) -> tuple[str, ...]:
    """That a wrong clock of the record does to rates what scale factors do that are alike, where they may be alike."""
    for cause in causes:
        if cause.place != SCALE or found.record.rate is None:
            continue
        low, high = np.array(cause.intervals).reshape(3, 3, 2).transpose(2, 0, 1)
        least, most = float(np.diag(low).max()), float(np.diag(high).min())
        beside = ~np.eye(3, dtype=bool)
        if least <= most and least * most > 0.0 and (low[beside] <= 0.0).all() and (high[beside] >= 0.0).all():
            percent = 50.0 * (least + most)
            return (
                f"time stamps that are {abs(percent):.2g} % too {'long' if percent > 0 else 'short'} would do the same",
            )
    return ()


def bias_left_in(system: Carried, bias: NDArray) -> float:
    """Root mean square error of the quoted pieces, were the mean at rest not taken out [rad]."""
    part = system.parts[system.quoted]
    return rms_size(part.error + part.columns[..., system.numbers_of([BIAS])] @ bias)
