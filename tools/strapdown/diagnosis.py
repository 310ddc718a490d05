"""From a strapdown record to a verdict on the simulation: the procedure of `trihedron diagnose` for such records."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trihedron.diagnosis.result import Cause
from trihedron.errors import InputError
from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.records import StrapdownRecord
from trihedron.strapdown.building import BIAS, Built, build_with_gravity, build_with_truth
from trihedron.strapdown.gain import effects_of, measure_gain
from trihedron.strapdown.held_out import angles, blocks_in_time, largest_angle, predicted, rms_angle
from trihedron.strapdown.inspection import Inspection, inspect_record
from trihedron.strapdown.intervals import excluded_sizes, parameter_ends
from trihedron.strapdown.judging import is_stable, order_of_effects, witnesses
from trihedron.strapdown.norm_calibration import LARGEST
from trihedron.strapdown.plausibility import check_record, missing_things
from trihedron.strapdown.result import BaselineParameter, Length, StrapdownDiagnosis
from trihedron.strapdown.search import LIMIT, Found, SetFit, classes_of, fit_set, seen_places, smallest_sets
from trihedron.strapdown.separation import what_separates
from trihedron.strapdown.structure import piece_quantities, quoted_number, residual_structure
from trihedron.strapdown.system import System, weighted_step

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
    known = record.attitude is not None and bool(np.isfinite(record.attitude).all(axis=1).any())
    baseline = baseline or ("nominal" if known else "calibrated")
    reference = "true attitude" if known else "gravity"
    warnings = (*record.warnings, *sampling_warnings(found))
    missing = missing_things(found, truth=known)
    if missing:
        return StrapdownDiagnosis("insufficient", found, reference, baseline, missing=missing, warnings=warnings)
    built = (build_with_truth if known else build_with_gravity)(found, baseline, rates)
    system, bound_from = with_reference_errors(built.system) if known else (built.system, RECORD_NOISE)
    built = replace(built, system=system)
    quoted = quoted_number(built)
    start = StrapdownDiagnosis(
        "insufficient",
        found,
        reference,
        baseline,
        noise_bound=float(np.median(system.parts[quoted].bound)),
        noise_bound_from=bound_from,
        bias_at_rest=built.model.bias if known and BIAS not in built.own and len(found.rests) else None,
        warnings=warnings,
        parts=system.parts,
        quoted=quoted,
        quantities=piece_quantities(built, system.parts[quoted].segments),
    )
    return judged(start, built, rerun=rerun)


RECORD_NOISE = "the noise of gyros and accelerometers at rest (Allan deviation), and Earth's rate"
WITH_TRUTH = "the noise of the gyros and the scatter of the true attitude at rest, and Earth's rate"
LEFT_OUT = (
    "the largest errors that all effects together leave in parts of the record that were left out: the noise at rest "
    "is smaller, so the true attitude errs more in motion than at rest, or something is not in the catalogue"
)


def with_reference_errors(system: System) -> tuple[System, str]:
    """The system with bounds that the true attitude's own errors allow, and what they are taken from.

    Where all effects together cannot bring the errors within the noise at rest, no set of them can: then what they
    leave in blocks that are left out is the bound, for each length of windows.
    """
    places = seen_places(system) if np.all(system.parts[0].bound > 0.0) else list(system.places)
    if all((part.bound > 0.0).all() for part in system.parts):
        whole = fit_set(system, places)
        if whole.radius <= LIMIT:
            return system, WITH_TRUTH
    even = replace(system, parts=tuple(replace(p, bound=np.ones_like(p.bound)) for p in system.parts))
    left = angles(even, predicted(even, places, blocks_in_time(even)))
    parts = tuple(
        replace(part, bound=np.maximum(part.bound, np.abs(error).max()))
        for part, error in zip(system.parts, left, strict=True)
    )
    return replace(system, parts=parts), LEFT_OUT


def sampling_warnings(found: Inspection) -> tuple[str, ...]:
    """What a person should know of the sampling."""
    said = [
        f"{name}: {rows} rows are saturated; moves with them are not used"
        for name, rows in found.sampling.saturated.items()
    ]
    if found.sampling.gaps:
        said.append(
            f"{len(found.sampling.gaps)} gaps, {found.sampling.missing} rows missing; moves over them are not used"
        )
    return tuple(said)


def judged(start: StrapdownDiagnosis, built: Built, *, rerun: bool) -> StrapdownDiagnosis:
    """The diagnosis of a system."""
    system = built.system
    seen = seen_places(system)
    not_seen = tuple(place for place in system.places if place not in seen)
    classes = classes_of(system, seen)
    places = list(classes)
    found = smallest_sets(system, places)
    baseline = fit_set(system, ())
    start = replace(start, radius=baseline.radius, not_seen=not_seen, left=left_of(system, baseline))
    if baseline.radius <= LIMIT:
        return without_causes(start, built, baseline, seen)
    start = replace(start, parameters=estimates(system, baseline))
    lengths, stable = by_length(system, places)
    tried = sorted(((p.title, fit_set(system, [p]).radius) for p in places), key=lambda e: (round(e[1], 9), e[0]))
    start = replace(start, lengths=lengths, order_stable=stable, tried=tuple(tried), complete=found.complete)
    if start.bias_at_rest is not None and BIAS in system.places:
        start = replace(start, bias_left_in=bias_left_in(built, start.bias_at_rest))
    impossible = beyond_instruments(system, baseline)
    if impossible or not found.fits:
        structure = tuple(residual_structure(built, start.inspection))
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
    objections = (*(w.objection for w in heard if not w.supports), *only_at_one_length(best.places, lengths, classes))
    start = replace(start, candidates=candidates, witnesses=tuple(heard), objections=objections)
    if objections:
        structure = tuple(residual_structure(built, start.inspection))
        return replace(start, verdict="unexplained", residual_structure=structure)
    return replace(
        start,
        verdict="explained",
        parameters=estimates(system, best, ends=True),
        gain=measure_gain(start.inspection, built, best.places) if rerun else None,
        excluded=excluded_sizes(system, best, seen),
    )


def without_causes(
    start: StrapdownDiagnosis, built: Built, fit: SetFit, seen: Sequence[EffectPlace]
) -> StrapdownDiagnosis:
    """The diagnosis of a record that the baseline explains: consistent, or too little to falsify anything."""
    system = built.system
    parameters = estimates(system, fit, ends=True)
    lengths = tuple(length_of(system, k, (), search=False) for k, part in enumerate(system.parts) if part.scored)
    excluded = excluded_sizes(system, fit, seen)
    start = replace(start, parameters=parameters, lengths=lengths, excluded=excluded)
    missing = undetermined(parameters, excluded, built)
    if missing:
        return replace(start, verdict="insufficient", missing=missing)
    return replace(start, verdict="consistent")


def undetermined(parameters: Sequence[BaselineParameter], excluded: Sequence[dict], built: Built) -> tuple[str, ...]:
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
    if not built.own and not any(entry["effect"] == "gyro-scale-misalignment" for entry in excluded):
        return ("the block hardly turns: no scale factor of a gyro is bounded; turn it about each of its axes",)
    return ()


def estimates(system: System, fit: SetFit, *, ends: bool = False) -> tuple[BaselineParameter, ...]:
    """The baseline's parameters by a fit, with what the record leaves possible where that is asked for."""
    count = len(system.names)
    values = system.point + weighted_step(system.matrix(fit.places), system.residual)[:count]
    limits = parameter_ends(system, fit)[:count] if ends else np.full((count, 2), np.nan)
    if ends:
        values = np.clip(values, limits[:, 0], limits[:, 1])
    return tuple(
        BaselineParameter(name, unit, float(value), *(float(end) if np.isfinite(end) else None for end in pair))
        for (name, unit), value, pair in zip(system.names, values, limits, strict=True)
    )


def causes_of(system: System, fit: SetFit, classes: dict[EffectPlace, tuple[EffectPlace, ...]]) -> tuple[Cause, ...]:
    """A set of effects with their sizes by least squares and what the record leaves possible of them."""
    ends = parameter_ends(system, fit)[len(system.names) :]
    solution = weighted_step(system.matrix(fit.places), system.residual)
    solution[len(system.names) :] = np.clip(solution[len(system.names) :], ends[:, 0], ends[:, 1])
    values = effects_of(system.names, fit.places, solution)
    found, at = [], 0
    for place in fit.places:
        count = len(CATALOGUE[place.effect].at(place).parameters)
        own = tuple((float(low), float(high)) for low, high in ends[at : at + count])
        found.append(Cause(place, classes.get(place, ()), tuple(float(v) for v in values[place]), own))
        at += count
    return tuple(found)


def left_of(system: System, fit: SetFit) -> tuple[NDArray[np.float64], ...]:
    """Errors that a fit leaves, for each part (S, d) [rad]."""
    return tuple(angles(system, system.residual - system.matrix(fit.places) @ fit.solution))


def by_length(system: System, places: Sequence[EffectPlace]) -> tuple[tuple[Length, ...], bool]:
    """What each length says by itself, and whether the orders of the effects agree."""
    orders = order_of_effects(system, places)
    scored = [k for k, part in enumerate(system.parts) if part.scored]
    lengths = tuple(
        replace(length_of(system, k, places, search=True), order=order) for k, order in zip(scored, orders, strict=True)
    )
    return lengths, is_stable(orders)


def length_of(system: System, k: int, places: Sequence[EffectPlace], *, search: bool) -> Length:
    """What part k says, with what is known at rest."""
    part = system.parts[k]
    alone = system.of_parts([i for i, other in enumerate(system.parts) if i == k or not other.scored])
    found = smallest_sets(alone, places) if search else Found((fit_set(alone, ()),))
    radius = fit_set(alone, ()).radius
    return Length(
        part.label,
        len(part),
        float(np.median(part.bound)),
        rms_angle(part.error),
        largest_angle(part.error),
        radius,
        tuple(fit.places for fit in found.fits),
        None,
    )


def only_at_one_length(
    places: Sequence[EffectPlace], lengths: Sequence[Length], classes: dict[EffectPlace, tuple[EffectPlace, ...]]
) -> tuple[str, ...]:
    """Effects that only one of several lengths needs: they are not named."""
    said = []
    for place in places:
        needing = [length.label for length in lengths if any(place in chosen for chosen in length.sets)]
        if len(lengths) > 1 and len(needing) == 1:
            said.append(f"{place.title} is needed over {needing[0]} and over no other length of windows or moves")
    return tuple(said)


def beyond_instruments(system: System, fit: SetFit) -> tuple[str, ...]:
    """Parameters of the baseline that no instrument has: the record is not what it says."""
    values = system.point + fit.solution[: len(system.names)]
    return tuple(
        f"{name} would be {value:+.2g}: check units, order and signs of the axes"
        for (name, unit), value in zip(system.names, values, strict=True)
        if unit == "1" and abs(value) > LARGEST
    )


def bias_left_in(built: Built, bias: NDArray) -> float:
    """Root mean square error of the quoted pieces, were the mean at rest not taken out [rad]."""
    part = built.system.parts[quoted_number(built)]
    block = built.system.blocks[built.system.places.index(BIAS)]
    return rms_angle(part.error + part.columns[..., block] @ bias)
