"""From a record to a verdict on the simulation: the procedure of `trihedron diagnose`, whatever the record."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.possible import Proofs, Steps, largest_length
from ..bounded.programmes import SolverError
from ..bounded.sets import Work
from ..errors import InputError
from ..evidence.carried_record import carried_evidence
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from ..evidence.rows import Channel
from ..records import PositionRecord, StrapdownRecord
from .beyond import Beyond, keys_of
from .cause import Cause, Finding, NamedEffect, SizedParameter
from .dependence import Standing, dependence
from .hypothesis import (
    Hypothesis,
    adds_nothing,
    answer_of,
    known_to,
    others_that_stand,
    places_of,
    radius_with,
    same_in_catalogue,
)
from .level import Proven, Suffices
from .options import evidence_of
from .order import of_lengths, only_at_one_length, what_helps
from .result import Diagnosis, EffectWitness, Witness
from .rivals import Listed, Unlisted
from .search import MOST_WORK, Found, equivalence_groups, search, single_radii

KERNEL_LENGTHS = (0.15, 0.35, 0.8, 2.0)
"""Lengths over which the functions that are tried vary: of the spread of a quantity, radians of an angle."""
NOISE_PARTS = (0.03, 0.3)
"""Parts of the residual's variance that are put down to noise in the fit of such a function."""
MOST_ROWS = 400
"""Of a longer record rows spread over it are taken."""


def diagnose(
    record: PositionRecord | StrapdownRecord,
    *,
    evidence: Evidence | None = None,
    hypotheses: Sequence[str] = (),
    rerun: bool = True,
    extend: bool = False,
    progress: bool = False,
    **options: Any,
) -> Diagnosis:
    """Say whether the simulation can be true of a record, and if not, which smallest set of effects mends it.

    Options are as for `evidence_of`; or the `evidence` of the record is given. `rerun`:
    simulate what was held out again, without and with the effects that were named, and say the power; `extend`: extend
    the model by what is in no catalogue though something in it stands; `progress`: show a bar on standard error, where
    that is a terminal; `hypotheses` are formulas that are judged. An InputError for a record that cannot be used, or
    for a formula that is none.
    """
    carried = isinstance(record, StrapdownRecord)
    formulas = places_of(hypotheses, at_table=not carried, with_gyros=carried or options.get("bench") is not None)
    evidence = evidence_of(record, **options) if evidence is None else evidence
    # What carries a block is linear in what it was run with, so its formulas are run beside the catalogue.
    beside = evidence
    if formulas and not evidence.missing():
        with known_to(record):
            beside = carried_evidence(record, further=formulas, **options) if carried else evidence
            for place in formulas:
                beside.columns_of([place])
    try:
        result = diagnosed(evidence, rerun=rerun, extend=extend, progress=progress)
        if not formulas:
            return result
        answers = tuple(answered(beside, place, result.findings, rerun=rerun) for place in formulas)
        return result.model_copy(update={"hypotheses": answers})
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; {evidence.too_large}") from error


def diagnosed(
    evidence: Evidence,
    *,
    rerun: bool = True,
    extend: bool = False,
    progress: bool = False,
    most_work: float = MOST_WORK,
) -> Diagnosis:
    """The diagnosis of evidence, whatever the record; a SolverError where errors are too large to solve.

    `most_work` is that of the search, others as for `diagnose`.
    """
    told: dict[str, Any] = {"evidence": evidence, "causes": (), "extended": None, "gain": None, **evidence.head()}
    if missing := evidence.missing():
        return _result("insufficient", told, missing)
    told |= {**of_lengths(evidence), **({"power": power} if rerun and (power := evidence.power()) else {})}
    if not evidence.falsified:
        excluded, fit = excluded_sizes(evidence, evidence.baseline), centred(evidence, evidence.baseline)
        model = evidence.of_model(fit, excluded)
        if said := _not_named(evidence):
            return _unexplained(evidence, told | {"baseline": model["baseline"]}, said)
        verdict = "insufficient" if "missing" in model else "consistent"
        if evidence.read_off and verdict == "consistent":
            finding = Finding(causes_of(evidence, fit), fit)
            return _result("explained", told | {"findings": [finding]} | _named(finding), model, excluded=excluded)
        return _result(verdict, told, model, excluded=excluded)
    told |= of_dependence(evidence)
    objections = (*evidence.objections(), *_not_named(evidence))
    found = Found(()) if objections else search(evidence, progress=progress, most_work=most_work)
    told |= {"tried": single_radii(evidence) if evidence.ranks_each else (), **evidence.of_misfit(), **found.told}
    listed = Listed(evidence)
    told |= of_what_is_proven(told, listed, found.fits)
    told |= of_functions(evidence, told, found.fits, extend=extend or not found.fits, rerun=rerun)
    if not found.fits:
        helps, said = what_helps(evidence, told.get("lengths", ()))
        gain = evidence.gain(evidence.refit(helps)) if rerun and helps else None
        return _unexplained(evidence, told | {"gain": gain}, (*objections, *said))
    groups = equivalence_groups(evidence, found.fits)
    tried = [finding_of(evidence, group) for group in groups[: evidence.most_sets]]
    findings = [finding for finding in tried if finding.acts]
    idle = tuple(dict.fromkeys(finding.not_shown for finding in tried if not finding.acts))
    # What contains a set that stands can always stand, too: it is no rival, and comes behind.
    containing = [one for one in tried if any(one.contains(other) for other in findings)]
    findings = sorted(findings, key=lambda one: one in containing)
    unlisted = Unlisted.of(told.get("dependence"), listed, findings[0].fit if findings else groups[0][0])
    told |= {"caution": (*told.get("caution", ()), *unlisted.caution)}
    proven = told.get("proven")
    if unlisted.held is not None and not (proven is not None and proven.quantity):
        told["caution"] += laws_beside(evidence, unlisted.held, found.fits)
    if not findings:
        told |= of_functions(evidence, told, (), extend=True, rerun=rerun)
        return _unexplained(evidence, told | {"unshown": tried}, idle)
    if found.is_sample and unlisted.rivals:
        told |= of_functions(evidence, told, (), extend=True, rerun=rerun)
        return _unexplained(evidence, told, (*(_as_simple(finding, unlisted) for finding in findings), *idle))
    if untried := evidence.untried(found.size):
        told |= of_functions(evidence, told, (), extend=True, rerun=rerun)
        return _unexplained(evidence, told, (*(f"{one.title} would do; {untried}" for one in findings), *idle))
    best, judgement = findings[0], judgement_of(evidence, findings[0].fit)
    told |= {"findings": findings, "judgement": judgement}
    objections = tuple(text for witness in _heard(judgement) for text in witness.objections)
    if len(groups) > 1 + len(containing) or not found.complete:
        return _result(
            "ambiguous",
            told | _named(best) | of_extension(told, rerun=rerun),
            evidence.probe([finding.fit for finding in findings]),
            alternatives=tuple(finding.causes for finding in findings[1:]),
            complete=found.complete,
            not_named=idle,
            objections=objections,
        )
    if not isinstance(judgement, Witness):
        # What is needed most comes first.
        heard = sorted(judgement, key=lambda witness: -witness.rms_without)
        places = [witness.place for witness in heard if witness.place is not None]
        best = best.in_order([*(read.place for read in evidence.read_off), *places])
        objections = tuple(text for witness in heard for text in witness.objections)
        objections += only_at_one_length(evidence, best.fit, told.get("lengths", ()))
        told |= {"judgement": heard}
    told |= {"findings": [best]}
    # What has a witness against it is not named.
    if objections:
        told |= of_functions(evidence, told, (), extend=True, rerun=rerun)
        return _unexplained(evidence, told, objections)
    if unlisted.rivals:
        probed = evidence.probe([best.fit, *unlisted.fits(evidence)])
        return _result("ambiguous", told | _named(best) | of_extension(told, rerun=rerun), probed)
    several_laws = unlisted.same is not None or ("beyond" in told and told["beyond"].caution)
    if unlisted.compared and "dependence" in told:
        if proven is not None and proven.quantity:
            # Where other laws of the quantity were not compared, no law is the only one.
            told |= {"level": "quantity" if several_laws or "beyond" not in told else "law"}
        elif len(best.fit.places) <= evidence.most_known_alone:
            told |= {"level": "quantity" if several_laws else "law"}
    excluded = excluded_sizes(evidence, best.fit)
    same = next(group for group in groups if set(best.fit.places) in [set(fit.places) for fit in group])
    return _result(
        "explained",
        told | _named(best),
        evidence.of_model(best.fit, excluded),
        containing=tuple(tuple(NamedEffect.of(place) for place in one.fit.places) for one in containing),
        equivalent_sets=tuple(tuple(NamedEffect.of(place) for place in fit.places) for fit in same[1:]),
        gain=evidence.gain(best.fit) if rerun else None,
        excluded=excluded,
    )


def answered(
    evidence: Evidence, place: EffectPlace, findings: Sequence[Finding] = (), *, rerun: bool = True
) -> Hypothesis:
    """What a record says of a formula, beside the smallest sets of the catalogue that were found to stand."""
    before = 0.0 if evidence.missing() else evidence.refit(()).radius
    if evidence.missing() or adds_nothing(evidence, place):
        return answer_of(place, before, "cannot be told")
    same = same_in_catalogue(evidence, place)
    told: dict[str, Any] = {"equivalents": tuple(NamedEffect.of(other) for other in same)}
    fits = evidence.mended([place], Work())
    if not fits:
        return answer_of(place, before, "refuted", radius=radius_with(evidence, place), **told)
    finding = finding_of(evidence, fits)
    told |= {"radius": finding.fit.radius, "parameters": finding.causes[-1].parameters}
    if not evidence.falsified:
        return answer_of(place, before, "not needed", **told)
    idle = () if finding.acts else ("it may be zero",)
    heard = _heard(judgement_of(evidence, finding.fit))
    told["objections"] = (*idle, *evidence.objections(), *(text for witness in heard for text in witness.objections))
    told |= {"as_well": others_that_stand(findings, same), "finding": finding}
    return answer_of(place, before, "stands", gain=evidence.gain(finding.fit) if rerun else None, **told)


def finding_of(evidence: Evidence, group: Sequence[Fit]) -> Finding:
    """The first of a group of sets whose effects cannot be nothing; where each can, the first."""
    findings = (Finding(causes_of(evidence, fit), fit) for fit in (centred(evidence, fit) for fit in group))
    first = next(findings)
    return first if first.acts else next((finding for finding in findings if finding.acts), first)


def judgement_of(evidence: Evidence, fit: Fit) -> Witness | list[EffectWitness]:
    """What was left out says of the effects of a fit: of all together, or of each."""
    # Each trial is heard before the next begins: its shuffles are made as they are asked for.
    heard = [Witness.of(trial) if trial.jointly else EffectWitness.of(trial) for trial in evidence.trials(fit)]
    each = [witness for witness in heard if isinstance(witness, EffectWitness)]
    return next((w.model_copy(update={"each": tuple(each)}) for w in heard if isinstance(w, Witness)), each)


def _heard(judgement: Witness | list[EffectWitness]) -> Sequence[Witness | EffectWitness]:
    return [judgement] if isinstance(judgement, Witness) else judgement


def _not_named(evidence: Evidence) -> tuple[str, ...]:
    """Why effects that readings show by themselves are not named."""
    return tuple(effect.objection for effect in evidence.read_off if effect.objection)


def _as_simple(finding: Finding, unlisted: Unlisted) -> str:
    """Why a set that was found before the search was cut off is not named."""
    rival = unlisted.rivals[0].pair.in_words
    return f"{finding.title} would do; others may that were not tried, and, as simple, {rival} would"


def _named(finding: Finding) -> dict[str, Any]:
    return {"causes": finding.causes, "extended": {"radius": finding.fit.radius}}


def of_dependence(evidence: Evidence) -> Mapping[str, Any]:
    """Keys of a falsified model: on what, and where, the misfit depends, and the noise bound that would do without."""
    bound = evidence.stated_bound
    needed = {} if bound is None else {"noise_bound_needed": evidence.baseline_radius * bound}
    found = dependence(evidence)
    if found is None:
        return needed
    return needed | {"dependence": found, "suffices": tuple(Suffices.of(one) for one in found.standing)}


def of_what_is_proven(told: Mapping[str, Any], listed: Listed, fits: Sequence[Fit]) -> Mapping[str, Any]:
    """Keys of what is proven of place and quantity, beside the sets of the catalogue that stand."""
    if (found := told.get("dependence")) is None:
        return {}
    found = listed.beside(found, fits)
    return {"dependence": found, "proven": Proven.of(found)}


def of_functions(
    evidence: Evidence, told: Mapping[str, Any], fits: Sequence[Fit], *, extend: bool, rerun: bool
) -> Mapping[str, Any]:
    """Keys of what is possible of a function whose place and quantity are proven: band, laws, what extends the model.

    `fits` are sets of effects of the catalogue that stand; `extend`, `rerun` are as for `diagnose`.
    """
    found = told.get("dependence")
    if found is None or found.proven is None:
        return {}
    beyond = Beyond(evidence, found.proven.pair, found.proven.form, tuple(fits))
    return keys_of(beyond, extend=extend, rerun=rerun)


def laws_beside(evidence: Evidence, held: Standing, fits: Sequence[Fit]) -> tuple[str, ...]:
    """What else does as well as sets of the catalogue (fits) that one function holds, though no quantity is proven."""
    if len(fits[0].places) <= evidence.most_known_alone:
        return ()
    beyond = Beyond(evidence, held.pair, held.form, tuple(fits))
    return beyond.caution if beyond.bands else ()


def of_extension(told: Mapping[str, Any], *, rerun: bool) -> dict[str, Any]:
    """Keys of what extends the model whatever the law, where the catalogue does not decide it; as `of_functions`."""
    if "beyond" not in told or "extension" in told:
        return {}
    extension = told["beyond"].extension(rerun)
    return {} if extension is None else {"extension": extension}


def _unexplained(evidence: Evidence, told: Mapping[str, Any], objections: tuple[str, ...]) -> Diagnosis:
    structure, proven = residual_structure(evidence.channels()), told.get("proven")
    levels: dict[str, Any] = {}
    if proven is not None:
        names = (proven.on, *proven.same) if proven.quantity else proven.not_excluded
        levels = {"level": "quantity" if proven.quantity else "place", "depends_on": names}
    return _result("unexplained", told, {}, not_named=objections, residual_structure=structure, **levels)


def _result(verdict: str, told: Mapping[str, Any], more: Mapping[str, Any], **keys: Any) -> Diagnosis:
    """The result; of these keys those that hold something."""
    kept = {key: value for key, value in keys.items() if value not in (None, ()) or key in ("gain", "complete")}
    warnings = (*told.get("warnings", ()), *more.get("warnings", ()))
    return Diagnosis.model_validate({**told, **more, **kept, "verdict": verdict, "warnings": warnings})


def centred(evidence: Evidence, fit: Fit) -> Fit:
    """The fit whose parameters and coefficients are one possible point in the middle of what the record leaves."""
    return fit.centred(evidence.room(fit), evidence.most_rows)


def parameters_of(evidence: Evidence, fit: Fit) -> tuple[SizedParameter, ...]:
    """The model's parameters as a fit states them, with what the record leaves possible beside the fit's effects."""
    ends = fit.ends(evidence.room(fit), evidence.most_rows)
    named = zip(evidence.names, fit.estimate, ends, strict=False)
    return tuple(SizedParameter.of(name, unit, value, possible) for (name, unit), value, possible in named)


def causes_of(evidence: Evidence, fit: Fit) -> tuple[Cause, ...]:
    """A set of effects as causes: what is stated of each, inside what the record leaves possible.

    What the readings show by themselves stands before them.
    """
    causes = [Cause.found(read.place, (), read.values, read.ends) for read in evidence.read_off]
    intervals = fit.intervals(evidence.room(fit), evidence.most_rows)
    for place, values, possible in zip(fit.places, fit.values(), intervals, strict=True):
        parameters, ends = place.definition.parameters, evidence.told(place, possible)
        # A phase is told up to whole turns, a size that is just at its end up to rounding.
        stated = [
            value - 2.0 * np.pi * round((value - 0.5 * (low + high)) / (2.0 * np.pi))
            if parameter.name.endswith("phase") and np.isfinite((low, high)).all()
            else min(max(value, low), high)
            for parameter, value, (low, high) in zip(parameters, values, ends, strict=True)
        ]
        causes.append(Cause.found(evidence.named(place), evidence.classes.equivalents(place), stated, ends))
    return tuple(causes)


def excluded_sizes(evidence: Evidence, fit: Fit) -> tuple[dict[str, Any], ...]:
    """Upper bounds of the effects that were not found, each added to the model that explains the record.

    Of each parameter with effect, where, order and axes: sizes above ``above`` are excluded; effects that the record
    does not bound below their largest possible size are left out.
    """
    found, room, count = [], evidence.room(fit), len(fit.at)
    for place, columns in evidence.beside(fit):
        # What bounds an effect beside one way of the others bounds it beside the next one nearly as well.
        proofs: Proofs = {}
        possible = fit.possible_in_any(room, columns, evidence.most_rows, proofs)
        parameters = place.definition.parameters
        sizes = [largest_coefficient(possible, count + k, parameter.name) for k, parameter in enumerate(parameters)]
        ends = evidence.told(place, [(0.0, size) for size in sizes])
        for parameter, (_, above) in zip(parameters, ends, strict=True):
            if above < parameter.largest and not parameter.name.endswith("phase"):
                found.append(
                    {**place.entry, "parameter": parameter.name, "unit": parameter.unit, "above": float(above)}
                )
    return tuple(found)


def largest_coefficient(possible: Steps, column: int, name: str) -> float:
    """Largest absolute value of a coefficient, or largest length of the pair of an amplitude and its phase."""
    if name.endswith("phase"):
        return np.inf
    if name.endswith("amplitude"):
        return largest_length(possible.among(np.array([column, column + 1])))
    reach = possible.among(np.array([column]))
    return reach(np.ones(1), reach(-np.ones(1)))


def residual_structure(channels: Sequence[Channel]) -> tuple[dict[str, Any], ...]:
    """How much of the residual a smooth function of one quantity predicts at readings that it was not fitted to.

    Of each component, by its label, and quantity ``on``: ``explained``, the part of the residual's sum of squares that
    is predicted when each reading is left out in turn; ``explainable``, the part that is more than noise within the
    bound, uniform, would be on average. The most telling quantity first, then those of several variables.
    """
    found, joint = [], []
    for channel in channels:
        rows = np.unique(np.linspace(0, len(channel.error) - 1, MOST_ROWS).round().astype(int))
        error, bound = channel.error[rows], channel.bound[rows]
        circles = {name: circle(angle[rows]) for name, angle in channel.angles.items()}
        single = circles | {name: spread(values[rows]) for name, values in channel.quantities.items()}
        several = {" and ".join(circles): np.hstack(list(circles.values()))} if circles else {}
        several |= {name: spread(values[rows]) for name, values in channel.joint.items()}
        total = float((error**2).sum())
        explainable = max(0.0, 1.0 - float((bound**2).sum()) / 3.0 / total) if total > 0.0 else 0.0
        for names, entries in ((single, found), (several, joint)):
            for on, coordinates in names.items():
                share = predicted_share(coordinates, error)
                entries.append({**channel.label, "on": on, "explained": share, "explainable": explainable})

    def telling(entry: dict[str, Any]) -> float:
        return -round(float(entry["explained"]), 9)

    return (*sorted(found, key=telling), *sorted(joint, key=telling))


def circle(angle: NDArray) -> NDArray:
    """An angle (N,) as a point (N, 2) of the unit circle."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def spread(values: NDArray) -> NDArray:
    """Quantities (N, k) in units of their standard deviation; zeros where they do not vary."""
    deviation = values.std(axis=0)
    return (values - values.mean(axis=0)) / np.where(
        deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf
    )


def predicted_share(coordinates: NDArray, residual: NDArray) -> float:
    """Part of the sum of squares that a smooth function of coordinates (N, k) predicts of readings left out in turn.

    Kernel regression with Gaussian functions of several lengths; the length and the noise that predict best are taken.
    The errors of readings left out follow from one decomposition: e_i = [K⁻¹ r]_i / [K⁻¹]_ii.
    """
    total = float((residual**2).sum())
    if total == 0.0 or not np.ptp(coordinates, axis=0).any():
        return 0.0
    square = ((coordinates[:, None, :] - coordinates[None, :, :]) ** 2).sum(axis=2)
    least = total
    for length in KERNEL_LENGTHS:
        values, vectors = np.linalg.eigh(np.exp(-0.5 * square / length**2))
        weights = vectors.T @ residual
        for noise in NOISE_PARTS:
            inverse = 1.0 / (np.maximum(values, 0.0) + noise)
            errors = (vectors @ (inverse * weights)) / ((vectors**2) @ inverse)
            least = min(least, float((errors**2).sum()))
    return max(0.0, 1.0 - least / total)
